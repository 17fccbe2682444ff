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
from drive_rig import Rig
from drive_rig import wait_until
from parameters_rig import ACCEL
from parameters_rig import THREE
from parameters_rig import THREE_BEFORE
from parameters_rig import Store
from parameters_rig import connect
from parameters_rig import error_of
from parameters_rig import far
from parameters_rig import on_read
from parameters_rig import on_write
from parameters_rig import written
import pytest
from support.said import said

from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused

OVERLOAD = 5


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

    def refuse(write: Store, key: str, raw: int) -> None:
        if faulted:
            # just now, so that no poll has seen it
            rig.far.trip(OVERLOAD)
        raise Refused(reason, 'as the test wants it')

    on_write(rig, monkeypatch, refuse)
    if faulted:
        says += f'; fault {OVERLOAD} '
    error = error_of(parameters.change({'control.accel': 7}))
    assert said(error).startswith(f'control.accel: {says}')
    assert said(error).endswith('is active: call ~/fault_ack first') is faulted
    assert error.left == ()
    assert parameters.values['control.accel'] == ACCEL
    assert written(rig) == {}


def test_refusal_because_the_motor_runs(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    rig.enable()
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    # it started after the driver had looked
    parameters._data = {**parameters._data, 'motor.i_magn': parameters._registers.encode(
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
    assert said(error) == (
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
    assert said(error) == (
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
    assert said(error).startswith('freque.f_fix1: the drive cannot do this')
    assert said(error).endswith('; put back: control.accel, control.retard')
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
    assert 'put back: control.retard;' in said(error)
    assert 'control.accel is NOT put back to 0.2 s: the drive cannot do this' in said(error)
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
    assert 'freque.f_fix1: ' in said(error)
    assert 'it is 10 Hz as before' in said(error)
    assert error.left == ()
    assert far(rig, *THREE) == THREE_BEFORE


def test_roll_back_does_not_undo_another_change(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters = connect(rig)

    def refuse(write: Store, key: str, raw: int) -> None:
        if key == 'freque.f_fix1':
            raise Refused(Reason.STATE, 'never')
        write(key, raw)

    on_write(rig, monkeypatch, refuse)
    futures: list[Future[Any]] = []

    def start() -> None:
        # the worker finds both at the same moment
        futures.append(parameters.change({'control.accel': 7, 'freque.f_fix1': 7}))
        futures.append(parameters.change({'control.accel': 9}))

    rig.bus.call(start)
    wait_until(lambda: len(futures) == 2)
    error_of(futures[0])
    (change,) = futures[1].result(PATIENCE)
    assert change.new == 9
    assert far(rig, 'control.accel') == [9] == [parameters.values['control.accel']]
