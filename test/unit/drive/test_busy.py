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


"""A drive that is busy (Modbus exception 06) has done nothing, and is asked again."""

from __future__ import annotations

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import SCMD
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.addresses import Words
from support.said import said
from virtual_rig import MakeVirtual

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import Refused

ACCEL = 0x2B0
FREQUENCY = 0x3FC


class Busy:
    """Has the drive say that it is busy, so many times for each register that was named."""

    def __init__(self, rig: Rig, times: int, *registers: int, writes: bool = False) -> None:
        self._left = dict.fromkeys(registers, times)
        self._writes = writes
        self.said = 0
        rig.tap.before = self

    def __call__(self, register: int, words: Words | None) -> None:
        if self._left.get(register, 0) > 0 and (words is not None or not self._writes):
            self._left[register] -= 1
            self.said += 1
            raise Refused(Refused.BUSY)


def test_a_command_is_given_again(rig: Rig) -> None:
    rig.connect()
    busy = Busy(rig, 2, MODE, SCMD)
    rig.enable()
    assert busy.said == 4
    assert rig.drive.armed
    assert rig.writes(SCMD).count(0x101) == 1


def test_a_value_is_read_again(rig: Rig) -> None:
    rig.connect()
    busy = Busy(rig, 3, 0x2A5, 0x258)
    rig.next_snapshots(5)
    assert busy.said == 6
    assert rig.drive.snapshot.connected
    assert not rig.notes.told('lost')


def test_one_that_is_busy_for_ever_is_told_of(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drive_state, 'TIMEOUT', 0.5)
    rig.connect()
    Busy(rig, 10_000, MODE)
    assert 'the drive is busy (exception 6)' in rig.refused(rig.drive.enable())


def test_a_stop_is_tried_on(rig: Rig) -> None:
    rig.turn()
    busy = Busy(rig, 3, SCMD)
    assert said(rig.drive.stop().result(PATIENCE)).startswith(('stopping', 'stopped'))
    assert busy.said == 3
    rig.wait_until_still()


def test_a_setpoint_is_written_again(rig: Rig) -> None:
    rig.turn(20.0)
    register = rig.drive.registers.address('status.frq_set').index
    busy = Busy(rig, 3, register, writes=True)
    rig.publish(10.0)
    rig.wait_for_frequency(10.0)
    assert busy.said == 3
    assert rig.drive.armed


def test_a_drive_that_takes_no_setpoint_for_long_is_stopped(rig: Rig) -> None:
    rig.turn(20.0)
    register = rig.drive.registers.address('status.frq_set').index
    Busy(rig, 10_000, register, writes=True)
    rig.publish(10.0)
    wait_until(lambda: not rig.drive.armed)
    reason = 'refused set-point 10: the drive is busy'
    rig.notes.wait_for(reason, Severity.WARNING)
    rig.tap.before = lambda register, words: None
    rig.wait_until_still()


@pytest.mark.parametrize(
    ('method', 'key'),
    [('mode_scmd', 'fieldbus.mode'), ('drive_control', 'fieldbus.drv_ctrl_write_mask')],
)
def test_a_quick_stop_stays_one(make_virtual: MakeVirtual, method: str, key: str) -> None:
    rig = make_virtual({'control.retard': 10.0}, control_method=method)
    rig.ride()
    rig.be_busy(rig.register(key), writes=True)
    assert rig.answer(rig.drive.quick_stop()) == 'released: the motor coasts'
    assert not rig.far.motor.driven


@pytest.mark.parametrize('retard', [0.3, 10.0])
def test_a_stop_is_confirmed_whatever_else_cannot_be_read(
    make_virtual: MakeVirtual, retard: float
) -> None:
    rig = make_virtual({'control.retard': retard})
    rig.ride()
    rig.be_busy(rig.register('control.st_mode'), 10_000)
    assert rig.answer(rig.drive.stop()).startswith('stopping (')
    assert not rig.drive.stop_unconfirmed


def test_set_point_0_is_written_again_when_no_others_come(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(setpoint_timeout=0.5)
    rig.ride()
    rig.be_busy(rig.register('status.frq_set'), writes=True)
    rig.send(None)
    rig.pass_time(2.0)
    assert rig.said('no set-point for 0.5 s', Severity.WARNING)
    assert abs(rig.far.motor.frequency) < 0.1
    assert rig.drive.armed
    # how long it was busy then does not count any more
    rig.be_busy(rig.register('status.frq_set'), writes=True)
    rig.send(15.0)
    rig.pass_time(1.0)
    assert rig.drive.armed
    assert abs(rig.far.motor.frequency - 15.0) < 0.2


def test_one_that_was_busy_was_not_switched_off(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    rig.be_busy(rig.register('status.frq_set'), 5, writes=True)
    rig.send(10.0)
    rig.pass_time(0.03)
    rig.far.control_unit.press('stop')
    rig.pass_time(0.5)
    assert rig.said(Cause.CONTROL_LOST, Severity.WARNING)
    assert not rig.said('did not answer')
    assert not rig.said('switched off')


def test_one_that_did_not_answer_a_setpoint_may_have_been(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    setpoint = rig.register('status.frq_set')

    def miss(register: int, words: Words | None) -> None:
        if register == setpoint and words is not None:
            rig.before = lambda register, words: None
            rig.far.control_unit.press('stop')
            raise NoAnswer('nobody answers')

    rig.before = miss
    rig.send(10.0)
    rig.pass_time(0.5)
    assert rig.said(Cause.POWER_CYCLED, Severity.WARNING)


def test_one_that_is_busy_while_connected_to_is_no_other_model(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual()
    rig.be_busy(rig.register('fieldbus.sw_ver'), 10_000)
    answer = rig.answer(rig.drive.connect())
    assert 'the drive is busy' in answer
    assert 'model' not in answer


def test_one_that_is_busy_when_it_is_there_again_is_no_other_model(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual()
    rig.connect()
    rig.link.state = 'silent'
    rig.pass_time(3.0)
    assert rig.said('lost: ')
    rig.be_busy(rig.register('fieldbus.sw_ver'), 10_000)
    rig.link.mend()
    rig.pass_time(8.0)
    assert not rig.said('another model')
    rig.before = lambda register, words: None
    rig.pass_time(5.0)
    assert rig.drive.snapshot.connected


def test_a_status_that_is_refused_for_ever_is_a_loss_too(make_virtual: MakeVirtual) -> None:
    # nobody could watch the motor
    rig = make_virtual()
    rig.ride()
    rig.be_busy(rig.register('fieldbus.inv_st'), 10)
    rig.pass_time(2.0)
    assert rig.drive.armed
    rig.be_busy(rig.register('fieldbus.inv_st'), 10_000)
    rig.pass_time(5.0)
    assert rig.said('lost: the drive is busy')
    assert not rig.drive.armed
