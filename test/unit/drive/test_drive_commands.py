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

"""Enable, stop and acknowledge: what is answered, and what the drive does."""

from __future__ import annotations

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import RUN
from drive_rig import SCMD
from drive_rig import STOPPING_OR_STOPPED
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.said import said

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.families.sinus_g2.words import Mode

OVERLOAD = 5
#: Read registers, and who are you.
ONLY_READ = {3, 17, 43}


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the driver give up soon on what will never happen."""
    monkeypatch.setattr(drive_state, 'TIMEOUT', 0.2)


def test_a_ride(rig: Rig) -> None:
    rig.connect()
    assert rig.enable() == 'enabled; it follows set-points that arrive from now on'
    assert rig.drive.armed
    assert rig.far.motor.driven
    assert rig.enable() == 'is enabled already'
    for frequency in (20.0, -15.0, 0.0, 7.5):
        rig.publish(frequency)
        rig.wait_for_frequency(frequency)
    assert said(rig.drive.stop().result(PATIENCE)).startswith(STOPPING_OR_STOPPED)
    assert not rig.drive.armed
    rig.assert_stays_still()
    assert said(rig.drive.stop().result(PATIENCE)) == 'stopped (37 Bus Stby)'
    # control is kept
    assert rig.far.control_unit.mode is Mode.BUS
    assert rig.enable().startswith('enabled')
    rig.wait_for_frequency(7.5)


def test_stop_that_coasts_says_so(make_rig: MakeRig) -> None:
    # a slow ramp would be noticed: it is not used
    rig = make_rig(parameters={'control.st_mode': 'Release', 'control.retard': 60.0})
    rig.turn()
    answer = said(rig.drive.stop().result(PATIENCE))
    assert answer == 'stopping: it coasts' or answer.startswith('stopped (')
    rig.assert_stays_still()


def test_quick_stop_lets_the_motor_coast(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.retard': 60.0})
    rig.turn()
    assert said(rig.drive.quick_stop().result(PATIENCE)) == 'released: the motor coasts'
    assert not rig.far.motor.driven
    assert rig.writes(MODE)[-1] == Mode.STOP
    rig.assert_stays_still()
    assert rig.far.control_unit.mode is Mode.STOP
    # and again from there
    rig.far.motor.rotor = 0.0
    assert rig.enable().startswith('enabled')


def test_stops_of_a_drive_with_a_fault(rig: Rig) -> None:
    rig.turn()
    rig.simulator.inject('fault', 5)
    wait_until(lambda: not rig.drive.armed)
    for command in (rig.drive.stop, rig.drive.quick_stop):
        assert said(command().result(PATIENCE)).startswith('stopped by fault 5 Overload')


def test_stop_of_a_drive_that_is_not_ours(rig: Rig) -> None:
    rig.connect()
    rig.simulator.inject('keypad', 'start')
    rig.next_snapshots()
    for command in (rig.drive.stop, rig.drive.quick_stop):
        assert rig.answer(command()).startswith('the bus has no control of this drive')
        # whoever runs it at the keypad is not disturbed
        assert rig.far.motor.driven
    assert rig.writes(MODE) == []


def test_enable_needs_an_active_drive(rig: Rig) -> None:
    rig.drive.connect().result(PATIENCE)
    assert rig.refused(rig.drive.enable()) == 'the drive is not active'
    rig.drive.activate()
    rig.enable()
    assert said(rig.drive.deactivate().result(PATIENCE)).startswith('stop')
    assert not rig.drive.armed
    assert rig.refused(rig.drive.enable()) == 'the drive is not active'
    rig.wait_until_still()


def test_stopped_for_good(rig: Rig) -> None:
    rig.turn()
    rig.drive.stop_for_good(PATIENCE).result(PATIENCE)
    rig.drive.activate()
    assert rig.refused(rig.drive.enable()) == 'the drive is not active'
    rig.assert_stays_still()


def test_two_at_a_time_cannot_enable(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.run_dly': 5})
    rig.connect()
    first = rig.drive.enable()
    assert rig.refused(rig.drive.enable()) == 'it is being enabled already'
    rig.drive.stop().result(PATIENCE)
    assert rig.refused(first) == 'it was stopped while it was being enabled'


def test_start_delay_of_the_drive_is_waited_for(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the delay is longer, and what follows it has as long as everything else
    monkeypatch.setattr(drive_state, 'TIMEOUT', 2.5)
    rig = make_rig(parameters={'control.run_dly': 3})
    rig.connect()
    assert rig.enable().startswith('enabled')
    assert rig.far.motor.driven


def test_fault_that_stands(rig: Rig) -> None:
    rig.connect()
    rig.simulator.inject('fault', OVERLOAD)
    message = rig.refused(rig.drive.enable())
    assert message.startswith('fault 5 Overload is active: The power monitor has tripped')
    assert 'Reduce the load' in message
    assert message.endswith('then call ~/fault_ack')
    assert RUN not in rig.writes(SCMD)


def test_run_input_is_missing(make_rig: MakeRig, impatient: None) -> None:
    rig = make_rig(run_input=False)
    rig.connect()
    message = rig.refused(rig.drive.enable())
    assert 'its RUN input (DIN1) is not active' in message
    assert not rig.drive.armed
    # the run command that waits for RUN is taken back
    wait_until(lambda: rig.far.control_unit.scmd == 0)
    rig.simulator.inject('run', 'on')
    rig.publish(20)
    rig.assert_stays_still()


@pytest.mark.parametrize('expected', ['Speed', 'PI-Reg'])
def test_unexpected_control_mode(make_rig: MakeRig, expected: str) -> None:
    rig = make_rig(expected_control_mode=expected)
    rig.connect()
    message = rig.refused(rig.drive.enable())
    assert message.startswith(f'the drive is in control mode Freque, expected is {expected}')
    assert RUN not in rig.writes(SCMD)
    rig.drive.settings = DriveSettings(expected_control_mode='Freque')
    assert rig.enable().startswith('enabled')


def test_drive_that_lets_nobody_take_control(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.connect()
    peek = rig.far._peek
    monkeypatch.setattr(rig.far, '_peek', lambda key: 0 if key == 'fieldbus.mode' else peek(key))
    assert 'MODE is Inhibit' in rig.refused(rig.drive.enable())
    assert rig.writes(MODE) == []


def test_drive_that_keeps_its_set_point(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.memory.put('status.frq_set', 300)
        monkeypatch.setattr(rig.far, '_store', lambda key, raw: None)
    message = rig.refused(rig.drive.enable())
    assert message == 'the drive keeps a set-point of 30 where 0 was written'
    assert RUN not in rig.writes(SCMD)


def test_drive_that_refuses_the_run_command(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.connect()
    rig.refuse(monkeypatch, 'fieldbus.scmd', only=RUN)
    message = rig.refused(rig.drive.enable())
    assert 'exception 4' in message
    assert not rig.drive.armed
    wait_until(lambda: not rig.drive.stop_unconfirmed)


def test_acknowledge(rig: Rig) -> None:
    rig.turn()
    assert rig.drive.armed
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: rig.drive.snapshot.kind is Kind.FAULT)
    assert rig.drive.snapshot.text == 'Overload'
    assert rig.drive.snapshot.requires_ack
    assert rig.drive.snapshot.remedy
    rig.notes.wait_for('fault 5 Overload')
    rig.acknowledged = 1
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 5 Overload'
    assert rig.far.control_unit.ack_reads == 1
    rig.assert_stays_still()
    assert rig.enable().startswith('enabled')
    rig.wait_for_frequency(20.0)


def test_acknowledge_what_still_stands(rig: Rig) -> None:
    rig.connect()
    rig.simulator.inject('fault', OVERLOAD, standing=True)
    rig.acknowledged = 1
    message = rig.refused(rig.drive.acknowledge())
    assert message.startswith('5 Overload is still active: The power monitor has tripped')
    assert 'Reduce the load' in message
    assert rig.far.faults.codes == [OVERLOAD]


def test_nothing_to_acknowledge(rig: Rig) -> None:
    rig.connect()
    answer = said(rig.drive.acknowledge().result(PATIENCE))
    assert answer.startswith('nothing to acknowledge (')
    assert rig.far.control_unit.ack_reads == 0


@pytest.mark.parametrize('code', [14, 15])
def test_serial_fault_is_acknowledged(make_rig: MakeRig, code: int) -> None:
    rig = make_rig()
    rig.turn()
    rig.simulator.inject('fault', code)
    wait_until(lambda: not rig.drive.armed)
    rig.acknowledged = 1
    assert said(rig.drive.acknowledge().result(PATIENCE)).startswith(f'acknowledged {code} ')
    assert rig.far.faults.codes == []
    rig.assert_stays_still()


def test_monitor_writes_nothing_at_all(make_rig: MakeRig) -> None:
    rig = make_rig(
        control_method='monitor', drive_timeout=2.0, parameters={'control.auto_start': False}
    )
    rig.connect()
    with rig.simulator.lock:
        # somebody else runs it over the bus
        rig.far.write_raw('fieldbus.mode', 3)
        rig.far.write_raw('status.frq_set', 100)
        rig.far.write_raw('fieldbus.scmd', RUN)
    commands = [rig.drive.enable, rig.drive.stop, rig.drive.quick_stop, rig.drive.acknowledge]
    for command in commands:
        assert 'control_method is monitor: this driver only reads' in rig.refused(command())
    assert 'monitor' in rig.refused(rig.drive.set_drive_timeout(3.0))
    rig.drive.set_setpoint(30.0)
    rig.wait_for_frequency(10.0)
    wait_until(lambda: abs(rig.drive.snapshot.frequency - 10.0) < 0.11)
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: rig.drive.snapshot.kind is Kind.FAULT)
    rig.drive.deactivate().result(PATIENCE)
    assert said(rig.drive.disconnect(1.0).result(PATIENCE)) == 'only watched'
    assert rig.functions <= ONLY_READ
    assert rig.far.control_unit.ack_reads == 0
