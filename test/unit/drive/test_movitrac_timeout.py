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

"""The PC time-out of a MOVITRAC 31: it strikes when the driver dies, and at no other time."""

from __future__ import annotations

from line_rig import MakeLine
from movitrac_rig import MODEL
from movitrac_rig import PC_TIMEOUT_INDEX
from movitrac_rig import WAYS
from movitrac_rig import assert_only_enable_helps
from movitrac_rig import make
from movitrac_rig import succeeded
import pytest
from support.addresses import Words
from virtual_rig import MakeVirtual

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.simulator.movitrac31.codes import PC_TIMEOUT


@pytest.mark.parametrize('timeout_stop', ['coasts', 'ramps'])
def test_the_pc_time_out_strikes_when_the_driver_dies(
    make_virtual: MakeVirtual, timeout_stop: str
) -> None:
    rig = make(make_virtual, {'timeout_stop': timeout_stop}, drive_timeout=1.5)
    rig.ride()
    rig.pass_time(20.0)
    rig.send(None)
    rig.pass_time(5.0)
    # nobody sends set-points any more, and it is still enabled
    assert rig.drive.armed and not rig.far.faults
    rig.send(20.0)
    rig.pass_time(1.0)
    rig.kill()
    rig.elapse(1.0)
    assert not rig.far.faults
    rig.elapse(1.0)
    assert rig.far.faults.codes == [PC_TIMEOUT]
    rig.elapse(2.0)
    assert not rig.far.motor.driven


def test_a_pc_time_out_that_is_found_is_acknowledged_by_a_person_alone(
    make_virtual: MakeVirtual,
) -> None:
    rig = make(make_virtual, {'bits_in_fault': 'kept'}, drive_timeout=1.5)
    rig.ride()
    rig.kill()
    rig.elapse(5.0)
    rig.begin()
    rig.connect()
    rig.pass_time(3.0)
    assert any('145 PC time out' in text or 'fault 145' in text for _, _, text in rig.notes.events)
    assert rig.far.faults.codes == [PC_TIMEOUT]
    assert '145 PC time out' in rig.answer(rig.drive.enable())
    assert rig.far.faults.codes == [PC_TIMEOUT]
    assert 'acknowledged 145 PC time out' in rig.answer(rig.drive.acknowledge())
    assert_only_enable_helps(rig)


@pytest.mark.parametrize('found', [0.0, 5.0])
@pytest.mark.parametrize('end', [['clean up'], ['exit', 'clean up']], ids=['clean up', 'exit'])
def test_a_clean_end_leaves_the_pc_time_out_as_it_was_found(
    make_virtual: MakeVirtual, found: float, end: list[str]
) -> None:
    rig = make_virtual({'serial.pc_timeout': found}, model=MODEL, drive_timeout=1.5)
    rig.ride()
    assert rig.far.memory.number('serial.pc_timeout') == 1.5
    # set again and changed: what was found stays what it was
    rig.answer(rig.drive.set_drive_timeout(2.0))
    for name in end:
        assert succeeded(rig, WAYS[name](rig.drive)), name
    assert rig.far.memory.number('serial.pc_timeout') == found
    assert bool(rig.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING)) == bool(found)
    rig.send(None)
    rig.kill()
    rig.elapse(20.0)
    assert bool(rig.far.faults) == bool(found)


def test_a_clean_end_turns_the_pc_time_out_off_when_the_motor_has_stopped(
    make_virtual: MakeVirtual,
) -> None:
    rig = make(make_virtual, drive_timeout=1.5)
    rig.ride()
    frequencies: list[float] = []

    def meet(index: int, words: Words | None) -> None:
        if index == PC_TIMEOUT_INDEX and words is not None:
            frequencies.append(rig.far.motor.frequency)

    rig.before = meet
    assert succeeded(rig, rig.drive.disconnect(5.0))
    assert frequencies == [0.0]


def test_a_clean_end_during_a_long_ramp_leaves_no_fault(make_virtual: MakeVirtual) -> None:
    rig = make_virtual({'ramp.t11_down': 60.0}, model=MODEL, drive_timeout=1.5)
    rig.ride()
    assert succeeded(rig, rig.drive.disconnect(0.5))
    rig.send(None)
    rig.kill()
    rig.elapse(1.0)
    assert rig.far.motor.frequency > 10
    rig.elapse(60.0)
    assert not rig.far.faults and not rig.far.motor.turning


@pytest.mark.parametrize('seconds', [0.0, 4.0])
def test_a_pc_time_out_of_somebody_else_is_left_alone(
    make_virtual: MakeVirtual, seconds: float
) -> None:
    rig = make(make_virtual, drive_timeout=1.5)
    rig.ride()
    rig.far.set_from_keypad('serial.pc_timeout', seconds)
    rig.pass_time(1.0)
    written = len(rig.written(PC_TIMEOUT_INDEX))
    assert succeeded(rig, rig.drive.disconnect(1.0))
    assert len(rig.written(PC_TIMEOUT_INDEX)) == written
    assert rig.far.memory.number('serial.pc_timeout') == seconds


def test_a_pc_time_out_that_cannot_be_ended_is_told(make_virtual: MakeVirtual) -> None:
    rig = make(make_virtual, drive_timeout=1.5)
    rig.ride()
    rig.far.set_from_keypad('special.parameter_lock', True)
    # the motor stands all the same
    assert succeeded(rig, rig.drive.disconnect(1.0))
    assert rig.far.motor.frequency == 0
    assert rig.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING)


def test_a_drive_that_answers_late_is_followed_all_the_same(make_virtual: MakeVirtual) -> None:
    rig = make_virtual({'serial.response_time': 200.0}, model=MODEL, drive_timeout=3.0)
    rig.ride()
    rig.pass_time(30.0)
    assert rig.drive.armed and not rig.far.faults
    assert succeeded(rig, rig.drive.stop())


@pytest.mark.parametrize('count', [4, 8])
def test_several_at_one_line_are_kept_alive_while_others_are_enabled(
    make_line: MakeLine, count: int
) -> None:
    # an enable asks some forty times, and nobody sends set-points yet
    rig = make_line(count, protocol='movitrac', drive_timeout=1.5)
    rig.connect()
    rig.enable()
    assert not any(far.faults for far in rig.fars.values())
    rig.keep(lambda: rig.give_all(20.0))
    rig.pass_time(20.0)
    assert not any(far.faults for far in rig.fars.values())
    assert all(drive.armed for drive in rig.drives.values())
    assert all(far.motor.frequency > 19 for far in rig.fars.values())
    stops = [drive.stop() for drive in rig.drives.values()]
    for stop in stops:
        rig.answer(stop)
        assert stop.exception() is None
    rig.pass_time(3.0)
    assert not any(far.motor.turning for far in rig.fars.values())
