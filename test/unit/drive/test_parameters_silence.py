# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""No answer while parameters are written: what happened is found out, or told to be unknown."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
from parameters_rig import SILENCE
from parameters_rig import THREE
from parameters_rig import THREE_BEFORE
from parameters_rig import Store
from parameters_rig import connect
from parameters_rig import error_of
from parameters_rig import far
from parameters_rig import on_write
from parameters_rig import written
import pytest
from support.said import said

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Severity

#: For what will not be answered, s.
SHORT = 0.3


@pytest.fixture
def quick(make_rig: MakeRig) -> Rig:
    """A rig on which nobody asks often for what will not be answered."""
    return make_rig(retries=1)


def test_answer_to_the_write_is_lost(quick: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(quick)

    def lose(write: Store, key: str, raw: int) -> None:
        write(key, raw)
        quick.simulator.inject('drop', 1)

    on_write(quick, monkeypatch, lose)
    (change,) = parameters.change({'control.accel': 7}).result(PATIENCE)
    assert change.new == 7
    assert far(quick, 'control.accel') == [7] == [parameters.values['control.accel']]
    # once and once again
    assert written(quick) == {'control.accel': 2}


def test_write_gets_lost(quick: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(quick)

    def lose(write: Store, key: str, raw: int) -> None:
        if key == 'freque.f_fix1':
            quick.simulator.inject('drop', 1)
        else:
            write(key, raw)

    on_write(quick, monkeypatch, lose)
    error = error_of(parameters.change(THREE))
    assert said(error).startswith('freque.f_fix1: unit 1 did not answer')
    assert '; it is 10 Hz as before; put back: control.accel, control.retard' in said(error)
    assert error.left == ()
    assert far(quick, *THREE) == THREE_BEFORE


@pytest.mark.parametrize('done', [False, True])
def test_silence_in_the_middle(
    quick: Rig, monkeypatch: pytest.MonkeyPatch, hasty: None, done: bool
) -> None:
    parameters = connect(quick)

    def vanish(write: Store, key: str, raw: int) -> None:
        if done or key != 'freque.f_fix1':
            write(key, raw)
        if key == 'freque.f_fix1':
            quick.far.silence(SILENCE)

    on_write(quick, monkeypatch, vanish)
    sent = len(quick.trace())
    error = error_of(parameters.change(THREE))
    message = said(error)
    assert message.startswith('freque.f_fix1: unit 1 did not answer')
    assert 'whether the drive took 7 Hz is not known' in message
    assert 'freque.f_fix1 is NOT put back to 10 Hz' in message
    assert 'control.retard is NOT put back to 0.2 s' in message
    assert 'control.accel is NOT put back to 0.2 s: not tried any more' in message
    assert error.left == ('freque.f_fix1', 'control.retard', 'control.accel')
    # not two time-outs for each of a hundred
    assert len([frame for frame in quick.trace()[sent:] if frame['direction'] == 'request']) < 40
    with quick.simulator.lock:
        monkeypatch.undo()
        quick.far.silence(0)
    wait_until(lambda: quick.drive.snapshot.connected)
    # what it has is seen, and it can be put right
    old = dict(zip(THREE, THREE_BEFORE, strict=True))
    parameters.change(old).result(PATIENCE)
    assert far(quick, *THREE) == THREE_BEFORE
    assert [parameters.values[key] for key in THREE] == THREE_BEFORE


def test_silence_from_the_beginning(quick: Rig) -> None:
    parameters = connect(quick)
    with quick.simulator.lock:
        quick.far.silence(SILENCE)
    quick.set_response_timeout(SHORT)
    for key, value in (('control.accel', 7), ('motor.i_magn', 2)):
        error = error_of(parameters.change({key: value}))
        assert said(error).startswith(f'{key}: unit 1 did not answer')
        assert error.left == ()
    parameters.apply({'motor.i_magn': 2, 'control.accel': 7}, write=True).result(PATIENCE)
    told = [text for _, text in quick.notes.events if text.startswith('not applied from')]
    assert len(told) == 2
    assert len(parameters.drift) == 2


def test_port_that_is_lost_in_the_middle(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch, tmp_path: Any, hasty: None
) -> None:
    rig = make_rig(link=str(tmp_path / 'port'), retries=1)
    parameters = connect(rig)

    def unplug(write: Store, key: str, raw: int) -> None:
        if key == 'freque.f_fix1':
            rig.simulator.inject('hangup', 1.0)
        else:
            write(key, raw)

    on_write(rig, monkeypatch, unplug)
    error = error_of(parameters.change(THREE))
    assert said(error).startswith('freque.f_fix1: ')
    assert 'control.accel is NOT put back to 0.2 s' in said(error)
    assert 'control.accel' in error.left
    assert not rig.notes.told(Cause.DRIVER_ERROR)
    monkeypatch.undo()
    wait_until(lambda: rig.drive.snapshot.connected and rig.bus.port_error is None)
    parameters.change(dict(zip(THREE, THREE_BEFORE, strict=True))).result(PATIENCE)
    assert far(rig, *THREE) == THREE_BEFORE


def test_end_of_the_driver_in_the_middle(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)

    def end(write: Store, key: str, raw: int) -> None:
        write(key, raw)
        if key == 'control.retard':
            rig.bus._stopping = True

    on_write(rig, monkeypatch, end)
    first = parameters.change(THREE)
    second = parameters.change({'control.accel': 9})
    assert rig.refused(first) == 'this driver is ending'
    assert rig.refused(second) == 'this driver is ending'
    rig.bus.close()
    text = 'ended half-way, NOT put back: control.accel: 0.2 -> 7 s'
    rig.notes.wait_for(text, Severity.WARNING)
    assert far(rig, *THREE) == [7, 7, 10]


def test_change_goes_on_when_the_one_before_was_cancelled(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters = connect(rig)
    tasks: list[Any] = []

    def cancel(write: Store, key: str, raw: int) -> None:
        write(key, raw)
        if key == 'control.retard':
            rig.bus.call(lambda: rig.bus.cancel(tasks[0]))

    on_write(rig, monkeypatch, cancel)
    others: list[Future[Any]] = []

    def start() -> None:
        tasks.append(rig.bus.spawn(parameters.change_now(THREE)))
        # and one that waits, is not cancelled, and one that waits and is
        others.append(parameters.change({'control.accel': 9}))
        tasks.append(rig.bus.spawn(parameters.change_now({'control.accel': 11})))
        others.append(parameters.change({'freque.f_fix2': 9}))
        rig.bus.call(lambda: rig.bus.cancel(tasks[1]))

    rig.bus.call(start)
    wait_until(lambda: len(others) == 2)
    for other in others:
        other.result(PATIENCE)
    assert far(rig, 'control.accel', 'freque.f_fix1', 'freque.f_fix2') == [9, 10, 9]
