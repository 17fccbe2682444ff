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

"""Whatever goes wrong when a parameter is written: all or nothing, or the message says what not."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
from parameters_rig import ACCEL
from parameters_rig import SILENCE
from parameters_rig import Store
from parameters_rig import connect
from parameters_rig import far
from parameters_rig import on_read
from parameters_rig import on_write
from parameters_rig import refuse_write
from parameters_rig import written
import pytest

from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive.parameter_writer import ParameterError
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused

OVERLOAD = 5
THREE = {'control.accel': 7.0, 'control.retard': 7.0, 'freque.f_fix1': 7.0}
THREE_BEFORE = [ACCEL, ACCEL, 10.0]


@pytest.fixture
def quick(make_rig: MakeRig) -> Rig:
    """A rig on which nobody waits long for what will not be answered."""
    return make_rig(response_timeout=0.3, retries=1)


def error_of(future: Future[Any]) -> ParameterError:
    with pytest.raises(ParameterError) as error:
        future.result(PATIENCE)
    return error.value


# --- refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('reason', 'says'),
    [
        (Reason.ADDRESS, 'the drive has no such parameter (exception 2)'),
        (Reason.VALUE, 'the drive does not accept 7 s (exception 3)'),
        (Reason.STATE, 'the drive cannot do this in its present state (exception 4)'),
    ],
)
@pytest.mark.parametrize('faulted', [False, True])
def test_refusal(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, reason: Reason, says: str, faulted: bool
) -> None:
    parameters = connect(rig)
    refuse_write(rig, monkeypatch, 'control.accel', reason)
    if faulted:
        # just now, so that no poll has seen it
        rig.simulator.inject('fault', OVERLOAD)
        says += f'; fault {OVERLOAD} '
    error = error_of(parameters.change({'control.accel': 7}))
    assert str(error).startswith(f'control.accel: {says}')
    assert str(error).endswith('stands: call ~/fault_ack first') is faulted
    assert error.left == ()
    assert parameters.values['control.accel'] == ACCEL
    assert written(rig) == {}


def test_refusal_because_the_motor_runs(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    rig.enable()
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    # it started after the driver had looked
    parameters._words = {**parameters._words, 'motor.i_magn': parameters._registers.words(
        'motor.i_magn', 2.0
    )}  # fmt: skip
    message = rig.refused(parameters.change({'motor.i_magn': 2.0}))
    assert message == (
        'motor.i_magn: the drive cannot do this in its present state (exception 4): '
        'the motor must be stopped for this, and it runs'
    )


def test_drive_that_is_lax_is_not_trusted(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    rig.enable()
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    monkeypatch.setattr(rig.far, 'write_raw', lambda key, raw: rig.far._store(key, raw))
    message = rig.refused(parameters.change({'motor.i_magn': 2.0}))
    assert 'only while the motor is stopped' in message
    assert far(rig, 'motor.i_magn') == [1.8]


# --- a drive that does something else -------------------------------------------------------------


def test_drive_that_keeps_another_value(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)

    def clamp(write: Store, key: str, raw: int) -> None:
        write(key, min(raw, 5000))

    on_write(rig, monkeypatch, clamp)
    error = error_of(parameters.change({'control.accel': 7}))
    assert str(error) == (
        'control.accel: the drive keeps 5 s where 7 s was written; it is 0.2 s as before'
    )
    assert error.left == ()
    assert far(rig, 'control.accel') == [ACCEL]
    assert parameters.values['control.accel'] == ACCEL


def test_drive_that_keeps_the_old_value(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    on_write(rig, monkeypatch, lambda write, key, raw: None)
    assert rig.refused(parameters.change({'control.accel': 7})) == (
        'control.accel: the drive keeps 0.2 s where 7 s was written; it is 0.2 s as before'
    )


def test_drive_that_keeps_another_value_for_good(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters = connect(rig)
    on_write(rig, monkeypatch, lambda write, key, raw: write(key, 5000))
    error = error_of(parameters.change({'control.accel': 7}))
    assert str(error) == (
        'control.accel: the drive keeps 5 s where 7 s was written; '
        'control.accel is NOT put back to 0.2 s: the drive keeps 5 s'
    )
    assert error.left == ('control.accel',)


def test_refusal_of_what_was_done_all_the_same(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    # as when the answer to the first write was lost and the second one was refused
    parameters = connect(rig)

    def do_and_refuse(write: Store, key: str, raw: int) -> None:
        write(key, raw)
        raise Refused(Reason.STATE, 'twice')

    on_write(rig, monkeypatch, do_and_refuse)
    assert len(parameters.change({'control.accel': 7}).result(PATIENCE)) == 1
    assert far(rig, 'control.accel') == [7] == [parameters.values['control.accel']]


# --- all or nothing -------------------------------------------------------------------------------


def test_roll_back_in_reverse_order(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    order: list[str] = []

    def work(write: Store, key: str, raw: int) -> None:
        order.append(key)
        if key == 'freque.f_fix1':
            raise Refused(Reason.STATE, 'not this one')
        write(key, raw)

    on_write(rig, monkeypatch, work)
    error = error_of(parameters.change(THREE))
    assert str(error).startswith('freque.f_fix1: the drive cannot do this')
    assert str(error).endswith('; put back: control.accel, control.retard')
    accel, retard, fix = THREE
    assert order == [accel, retard, fix, retard, accel]
    assert far(rig, *THREE) == THREE_BEFORE
    assert [parameters.values[key] for key in THREE] == THREE_BEFORE
    assert error.left == ()


def test_roll_back_that_fails_names_what(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)

    def work(write: Store, key: str, raw: int) -> None:
        back = key == 'control.accel' and raw < 1000
        if back or key == 'freque.f_fix1':
            raise Refused(Reason.STATE, 'never')
        write(key, raw)

    on_write(rig, monkeypatch, work)
    error = error_of(parameters.change(THREE))
    assert 'put back: control.retard;' in str(error)
    assert 'control.accel is NOT put back to 0.2 s: the drive cannot do this' in str(error)
    assert error.left == ('control.accel',)
    assert far(rig, *THREE) == [7, ACCEL, 10]


def test_roll_back_is_tried_again(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    refusals = iter([Reason.STATE, Reason.VALUE])

    def work(write: Store, key: str, raw: int) -> None:
        if key == 'freque.f_fix1':
            raise Refused(Reason.STATE, 'never')
        if key == 'control.accel' and raw < 1000:
            reason = next(refusals, None)
            if reason is not None:
                raise Refused(reason, 'not at once')
        write(key, raw)

    on_write(rig, monkeypatch, work)
    error = error_of(parameters.change(THREE))
    assert error.left == ()
    assert far(rig, *THREE) == THREE_BEFORE


def test_reading_back_is_refused(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    # nobody knows whether it was taken: it is put back with the others
    parameters = connect(rig)
    rig.drive.parameters._keys = ()
    asked: list[str] = []

    def refuse(key: str) -> None:
        asked.append(key)
        if asked.count('freque.f_fix1') == 2:
            raise Refused(Reason.STATE, 'not now')

    on_read(rig, monkeypatch, refuse)
    error = error_of(parameters.change(THREE))
    assert 'freque.f_fix1: ' in str(error)
    assert 'it is 10 Hz as before' in str(error)
    assert error.left == ()
    assert far(rig, *THREE) == THREE_BEFORE


# --- silence --------------------------------------------------------------------------------------


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
    assert str(error).startswith('freque.f_fix1: unit 1 did not answer')
    assert '; it is 10 Hz as before; put back: control.accel, control.retard' in str(error)
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
    message = str(error)
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
    for key, value in (('control.accel', 7), ('motor.i_magn', 2)):
        error = error_of(parameters.change({key: value}))
        assert str(error).startswith(f'{key}: unit 1 did not answer')
        assert error.left == ()
    parameters.apply({'motor.i_magn': 2, 'control.accel': 7}, write=True).result(PATIENCE)
    told = [text for _, text in quick.notes.events if text.startswith('not applied from')]
    assert len(told) == 2
    assert len(parameters.drift) == 2


def test_port_that_is_lost_in_the_middle(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch, tmp_path: Any, hasty: None
) -> None:
    rig = make_rig(link=str(tmp_path / 'port'), response_timeout=0.3, retries=1)
    parameters = connect(rig)

    def unplug(write: Store, key: str, raw: int) -> None:
        if key == 'freque.f_fix1':
            rig.simulator.inject('hangup', 1.0)
        else:
            write(key, raw)

    on_write(rig, monkeypatch, unplug)
    error = error_of(parameters.change(THREE))
    assert str(error).startswith('freque.f_fix1: ')
    assert 'control.accel is NOT put back to 0.2 s' in str(error)
    assert 'control.accel' in error.left
    assert not rig.notes.told('error in the driver')
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
    assert rig.refused(first) == 'the driver is ending'
    assert rig.refused(second) == 'the driver is ending'
    rig.bus.close()
    text = 'ended half-way, NOT put back: control.accel: 0.2 -> 7 s'
    assert rig.notes.told(text, Severity.WARNING)
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
