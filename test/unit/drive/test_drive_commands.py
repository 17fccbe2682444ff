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


"""What a person asks of a drive, and what is answered."""

from __future__ import annotations

import math
from typing import Any

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import RUN
from drive_rig import SCMD
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.said import said
from virtual_rig import MakeVirtual

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import confirmation
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused

OVERLOAD = 5
#: Read registers, and who are you.
ONLY_READ = {3, 17, 43}


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the driver give up soon on what will never happen."""
    monkeypatch.setattr(confirmation, 'TIMEOUT', 0.2)


# --- connecting -----------------------------------------------------------------------------------


def test_connect_says_who_answers(rig: Rig) -> None:
    identity = rig.connect()
    assert 'firmware 4.38 / 4018' in identity
    assert rig.drive.identity is not None
    assert rig.drive.identity.firmware == pytest.approx(4.38)
    assert rig.notes.told(Cause.CONNECTED, Severity.INFO)
    assert rig.notes.told(identity, Severity.INFO)
    # a second time is no harm
    assert str(rig.drive.connect().result(PATIENCE)) == identity
    assert not rig.drive.armed


def test_connect_writes_nothing(rig: Rig) -> None:
    rig.connect()
    rig.next_snapshots()
    assert functions(rig) <= ONLY_READ


def functions(rig: Rig) -> set[int]:
    """The functions of all requests so far."""
    return {bytes.fromhex(frame['hex'])[1] for frame in rig.trace() if is_request(frame)}


def is_request(frame: dict[str, Any]) -> bool:
    return frame['direction'] == 'request'


def test_missing_time_out_is_mentioned(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.connect()
    assert rig.notes.told(Cause.OWN_TIMEOUT_OFF, Severity.WARNING)


def test_nobody_at_this_address(make_rig: MakeRig) -> None:
    rig = make_rig(address=7, response_timeout=0.05, retries=0)
    message = rig.refused(rig.drive.connect())
    assert message.startswith('no response from address 7: check in this order')
    # what is wrong most often stands first [C93]
    hints = [message.index(word) for word in ('BusType', 'S5', 'address, baud', 'parity')]
    assert hints == sorted(hints)
    assert rig.drive.identity is None
    assert not rig.drive.snapshot.connected


def test_rubbish_at_this_address(make_rig: MakeRig) -> None:
    rig = make_rig(response_timeout=0.5, retries=0)
    rig.simulator.inject('damage', 50)
    message = rig.refused(rig.drive.connect())
    assert 'is no answer' in message
    assert 'check baud rate and parity' in message


def test_commands_before_anybody_answers(make_rig: MakeRig) -> None:
    rig = make_rig(address=7, response_timeout=0.02, retries=0)
    rig.drive.activate()
    assert 'the drive at address 7' in rig.refused(rig.drive.enable())
    assert 'the drive at address 7' in rig.refused(rig.drive.acknowledge())


def test_snapshot_is_what_the_drive_says(rig: Rig) -> None:
    rig.turn(20.0)
    wait_until(lambda: rig.drive.snapshot.text == 'Bus Run')
    snapshot = rig.drive.snapshot
    assert snapshot.connected and snapshot.enabled
    assert (snapshot.control_method, snapshot.control_mode) == ('mode_scmd', 'Freque')
    assert (snapshot.unit, snapshot.setpoint) == ('Hz', 20.0)
    assert snapshot.actual == snapshot.frequency
    assert 500 < snapshot.speed < 620
    assert 0 <= snapshot.setpoint_age < PATIENCE
    assert not snapshot.setpoint_clamped
    assert snapshot.frequency == pytest.approx(20.0, abs=0.11)
    assert snapshot.kind is Kind.STATUS
    assert snapshot.status is not None and snapshot.status.runs


def test_telemetry(rig: Rig) -> None:
    rig.connect()
    wait_until(lambda: rig.notes.telemetry)
    values = rig.notes.telemetry[0].values
    assert values[Role.DC_LINK_VOLTAGE] == pytest.approx(565, abs=5)
    assert values[Role.OPERATING_TIME] == pytest.approx(1234.5, abs=0.1)
    assert values[Role.ENERGY] == pytest.approx(1.234)
    assert not any(math.isnan(value) for value in values.values())


def test_telemetry_of_older_firmware(make_rig: MakeRig) -> None:
    # E-Out came with 4.38, and what is not there must not be asked for
    rig = make_rig(parameters={'fieldbus.sw_ver': 4.30})
    rig.connect()
    wait_until(lambda: rig.notes.telemetry)
    values = rig.notes.telemetry[0].values
    assert {role for role, value in values.items() if math.isnan(value)} == {
        Role.ENERGY,
        Role.TOTAL_ENERGY,
    }
    asked = {bytes.fromhex(frame['hex'])[2:4].hex() for frame in rig.trace() if is_request(frame)}
    assert '02a8' in asked
    assert not {'05b0', '05b4'} & asked


def test_telemetry_turned_off(make_rig: MakeRig) -> None:
    rig = make_rig(telemetry_rate=0.0)
    rig.connect()
    rig.next_snapshots(10)
    assert rig.notes.telemetry == []


# --- enabling and stopping ------------------------------------------------------------------------


def test_a_ride(rig: Rig) -> None:
    rig.connect()
    assert rig.enable() == 'enabled; it follows set-points that arrive from now on'
    assert rig.drive.armed
    assert rig.far.motor.driven
    assert rig.enable() == 'is enabled already'
    for frequency in (20.0, -15.0, 0.0, 7.5):
        rig.publish(frequency)
        rig.wait_for_frequency(frequency)
    assert said(rig.drive.stop().result(PATIENCE)) == 'stopping: it ramps down'
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


def test_start_delay_of_the_drive_is_waited_for(make_rig: MakeRig, impatient: None) -> None:
    rig = make_rig(parameters={'control.run_dly': 1})
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
    assert 'its RUN input is not active' in message
    assert 'DIN1' in message
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
    refuse(rig, monkeypatch, 'fieldbus.scmd', only=RUN)
    message = rig.refused(rig.drive.enable())
    assert 'exception 4' in message
    assert not rig.drive.armed
    wait_until(lambda: not rig.drive.stop_unconfirmed)


def refuse(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, key: str, only: int | None = None
) -> None:
    """Let the simulated drive refuse to have a parameter written."""
    write = rig.far.write_raw

    def write_raw(written: str, raw: int) -> None:
        if written == key and only in (None, raw):
            raise Refused(Reason.STATE, 'as the test wants it')
        write(written, raw)

    monkeypatch.setattr(rig.far, 'write_raw', write_raw)


# --- faults ---------------------------------------------------------------------------------------


def test_acknowledge(rig: Rig) -> None:
    rig.turn()
    assert rig.drive.armed
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: rig.drive.snapshot.kind is Kind.FAULT)
    assert rig.drive.snapshot.text == 'Overload'
    assert rig.drive.snapshot.requires_ack
    assert rig.drive.snapshot.remedy
    assert rig.notes.told('fault 5 Overload')
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


# --- only watching --------------------------------------------------------------------------------


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
    assert functions(rig) <= ONLY_READ
    assert rig.far.control_unit.ack_reads == 0


# --- set-points -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('mode', 'unit', 'key', 'value', 'raw'),
    [
        ('Freque', 'Hz', 'status.frq_set', 12.34, 123),
        ('Speed', 'rpm', 'status.spd_set', -600.4, -600),
        ('Torque', '%', 'status.trq_set', 25.0, 25),
        ('PI-Reg', 'bar', 'status.reg_set', 40.0, 400),
    ],
)
def test_set_point_goes_where_the_control_mode_wants_it(
    make_rig: MakeRig, mode: str, unit: str, key: str, value: float, raw: int
) -> None:
    rig = make_rig(parameters={'control.mode': mode, 'pi_reg.unit': 'bar'})
    rig.connect()
    rig.enable()
    rig.publish(value)
    wait_until(lambda: rig.far.memory.raw(key) == raw)
    rig.next_snapshots(2)
    assert (rig.drive.snapshot.control_mode, rig.drive.snapshot.unit) == (mode, unit)
    # what is shown is what the drive was given, after its rounding
    assert rig.drive.snapshot.setpoint == pytest.approx(raw * (0.1 if unit in 'Hz bar' else 1))
    assert math.isfinite(rig.drive.snapshot.actual)


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_set_point_that_is_no_number(rig: Rig, value: float) -> None:
    rig.turn(10.0)
    with pytest.raises(ValueError, match='is no number'):
        rig.drive.set_setpoint(value)
    rig.next_snapshots(3)
    assert rig.drive.snapshot.setpoint == 10.0


@pytest.mark.parametrize(
    ('most', 'asked', 'given'),
    [(0.0, 400.0, 150.0), (0.0, -1e30, -150.0), (10.0, 25.0, 10.0), (10.0, -10.01, -10.0)],
)
def test_set_point_is_clamped(
    make_rig: MakeRig, most: float, asked: float, given: float
) -> None:
    rig = make_rig(setpoint_max=most)
    rig.connect()
    rig.enable()
    rig.publish(asked)
    wait_until(lambda: rig.drive.snapshot.setpoint == given)
    assert rig.drive.snapshot.setpoint_clamped
    assert rig.far.memory.raw('status.frq_set') == 10 * given
    rig.next_snapshots(5)
    # said once, not with every message
    texts = [text for _, text in rig.notes.events if 'is limited to' in text]
    assert len(texts) == 1
    assert texts[0].startswith(f'set-point {asked:g} is limited to {given:g}')
    rig.publish(5.0)
    wait_until(lambda: rig.drive.snapshot.setpoint == 5.0)
    assert not rig.drive.snapshot.setpoint_clamped


def test_set_point_from_before_does_not_count(rig: Rig) -> None:
    rig.connect()
    rig.drive.set_setpoint(30.0)
    rig.enable()
    rig.next_snapshots(10)
    assert rig.far.motor.frequency == 0.0
    assert rig.drive.snapshot.setpoint == 0.0
    assert math.isnan(rig.drive.snapshot.setpoint_age)
    rig.drive.set_setpoint(5.0)
    rig.wait_for_frequency(5.0)


def test_old_set_point_in_the_drive_does_not_count(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'status.frq_set': 50.0})
    rig.connect()
    rig.enable()
    assert rig.far.memory.raw('status.frq_set') == 0
    assert rig.far.motor.frequency == 0.0


def test_unchanged_set_point_is_not_written_each_time(rig: Rig) -> None:
    rig.turn(10.0)
    before = len(rig.writes(0x3FC))
    published = rig.published
    wait_until(lambda: rig.published >= published + 25)
    # once a second it is written all the same, for who knows what the drive does
    assert len(rig.writes(0x3FC)) - before < 20


def test_set_points_stop_coming(make_rig: MakeRig) -> None:
    rig = make_rig(setpoint_timeout=0.3)
    rig.turn(10.0)
    rig.stop_publishing()
    rig.wait_for_frequency(0.0)
    assert rig.far.memory.raw('status.frq_set') == 0
    wait_until(lambda: rig.drive.snapshot.setpoint == 0.0)
    assert rig.notes.told('no set-point for 0.3 s: the motor ramps to a stop', Severity.WARNING)
    # it is no stop: the next set-point is followed
    assert rig.drive.armed
    assert rig.far.motor.driven
    rig.publish(8.0)
    rig.wait_for_frequency(8.0)
    wait_until(lambda: rig.notes.told(Cause.SETPOINTS_AGAIN, Severity.INFO))


def test_set_points_may_stop_coming_for_ever(make_rig: MakeRig) -> None:
    rig = make_rig(setpoint_timeout=0.0)
    rig.connect()
    rig.enable()
    rig.drive.set_setpoint(10.0)
    rig.wait_for_frequency(10.0)
    # a new time-out takes effect at once
    rig.drive.settings = DriveSettings(setpoint_timeout=0.1)
    rig.wait_for_frequency(0.0)
    assert rig.drive.armed


# --- the drive's own time-out ---------------------------------------------------------------------


def timeouts(rig: Rig) -> tuple[int, int]:
    """SioTot (tenths of a second) and AutoStop in the drive."""
    return rig.far.memory.raw('serial.sio_tot'), rig.far.memory.raw('serial.auto_stop')


def test_drive_timeout_is_set(make_rig: MakeRig) -> None:
    rig = make_rig(drive_timeout=2.5)
    rig.connect()
    assert timeouts(rig) == (25, 1)
    assert rig.far.writes == {'serial.sio_tot': 1, 'serial.auto_stop': 1}
    assert rig.notes.told('serial.sio_tot: 0 -> 2.5 s (drive_timeout)')
    assert rig.notes.told('serial.auto_stop: false -> true (drive_timeout)')
    assert not rig.notes.told(Cause.OWN_TIMEOUT_OFF)
    # parameters live in EEPROM: what is right is not written again
    assert rig.drive.set_drive_timeout(2.5).result(PATIENCE) == ()
    (change,) = rig.drive.set_drive_timeout(3.0).result(PATIENCE)
    assert str(change) == 'serial.sio_tot: 2.5 -> 3 s'
    assert rig.far.writes == {'serial.sio_tot': 2, 'serial.auto_stop': 1}


def test_drive_timeout_may_be_left_as_it_is(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'serial.sio_tot': 7.0})
    rig.connect()
    assert timeouts(rig) == (70, 0)
    assert rig.drive.set_drive_timeout(0.0).result(PATIENCE) == ()
    assert not rig.far.writes


def test_time_out_of_the_drive_that_strikes_before_it_is_lost_is_told(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual({'serial.sio_tot': 1.2, 'serial.auto_stop': True})
    rig.connect()
    assert rig.said('SioTot 1.2 s) is less than lost_after + 0.5 s', Severity.WARNING)
    assert rig.said('set drive_timeout, at least 1.5 s', Severity.WARNING)


def test_drive_timeout_that_is_refused(make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make_rig(parameters={'serial.sio_tot': 7.0})
    rig.connect()
    refuse(rig, monkeypatch, 'serial.auto_stop')
    assert 'exception 4' in rig.refused(rig.drive.set_drive_timeout(2.0))
    assert timeouts(rig) == (70, 0)


def test_drive_timeout_that_the_drive_changes(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make_rig(parameters={'serial.sio_tot': 7.0})
    rig.connect()
    store = rig.far._store
    monkeypatch.setattr(
        rig.far,
        '_store',
        lambda key, raw: store(key, max(raw, 50) if key == 'serial.sio_tot' else raw),
    )
    message = rig.refused(rig.drive.set_drive_timeout(2.0))
    assert message == (
        'serial.sio_tot: the drive keeps 5 s where 2 s was written; it is 7 s as before'
    )
    assert timeouts(rig) == (70, 0)


def test_drive_timeout_that_no_manual_allows(make_rig: MakeRig) -> None:
    # the register holds up to 6553.5 s; the driver must cope with what it reads
    rig = make_rig(drive_timeout=2.0)
    with rig.simulator.lock:
        rig.far.memory.put('serial.sio_tot', 300)
    rig.connect()
    assert timeouts(rig) == (20, 1)


def test_bus_is_never_silent_for_long(make_rig: MakeRig) -> None:
    # polls are wanted less often than the drive must hear of us
    rig = make_rig(drive_timeout=2.5, poll_rate=0.1, telemetry_rate=0.0, setpoint_timeout=0.0)
    rig.connect()
    rig.enable()
    rig.drive.stop().result(PATIENCE)
    end = rig.far.time + 3.5
    wait_until(lambda: rig.far.time > end)
    assert rig.far.control_unit.mode is Mode.BUS
    assert rig.far.faults.codes == []


# --- leaving --------------------------------------------------------------------------------------


def test_clean_exit(make_rig: MakeRig) -> None:
    rig = make_rig(drive_timeout=5.0)
    rig.turn()
    answer = said(rig.drive.disconnect(PATIENCE).result(PATIENCE))
    assert answer == 'stopping: it ramps down; control released'
    assert not rig.far.motor.driven
    assert rig.far.control_unit.mode is Mode.STOP
    assert rig.far.control_unit.mode_ext_writes == 0
    assert not rig.drive.armed
    assert not rig.drive.snapshot.connected
    # nobody talks any more, and no fault comes of it
    rig.skip(10.0)
    assert rig.far.faults.codes == []
    # and the next one finds a drive that works
    rig.connect()
    assert rig.enable().startswith('enabled')


def test_exit_of_one_who_never_had_control(rig: Rig) -> None:
    rig.connect()
    rig.simulator.inject('keypad', 'start')
    assert said(rig.drive.disconnect(1.0).result(PATIENCE)) == 'not under bus control'
    assert rig.far.motor.driven
    assert functions(rig) <= ONLY_READ


def test_exit_leaves_a_slow_motor_to_its_ramp(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.retard': 60.0})
    rig.turn()
    answer = said(rig.drive.disconnect(0.1).result(PATIENCE))
    assert answer == 'stopping: it ramps down; it was left to its ramp, under bus control'
    assert rig.far.motor.driven
    assert rig.writes(SCMD)[-1] == 0
    assert Mode.STOP not in rig.writes(MODE)


def test_exit_releases_a_slow_motor_that_would_end_in_a_fault(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.retard': 60.0}, drive_timeout=5.0)
    rig.turn()
    answer = said(rig.drive.disconnect(0.1).result(PATIENCE))
    assert answer.startswith('released to coast')
    assert not rig.far.motor.driven
    rig.skip(10.0)
    assert rig.far.faults.codes == []


@pytest.mark.parametrize('retries', [0, 2])
def test_exit_in_the_middle_of_silence(make_rig: MakeRig, hasty: None, retries: int) -> None:
    # a driver that cannot stop the motor says so and keeps trying
    rig = make_rig(retries=retries)
    rig.turn()
    rig.set_response_timeout(0.1)
    rig.simulator.inject('line-dead', 3600)
    rig.refused(rig.drive.disconnect(0.1))
    assert not rig.drive.armed
    assert rig.drive.stop_unconfirmed
    rig.simulator.inject('heal')
    rig.wait_until_still()
    wait_until(lambda: not rig.drive.stop_unconfirmed)


# --- settings -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('setting', 'message'),
    [
        ({'address': -1}, 'allowed are 0 to 247'),
        ({'address': 248}, 'allowed are 0 to 247'),
        ({'model': 'sinus_h'}, "choose one of 'sinus_g2'"),
        ({'control_method': 'profidrive'}, "choose one of 'mode_scmd', 'drive_control', 'monitor'"),
        (
            {'reference': 'analog', 'control_method': 'drive_control'},
            'with drive_control on sinus_g2 it must be fieldbus or terminal',
        ),
        ({'expected_control_mode': 'Frequency'}, "'Freque', 'PI-Reg', 'Torque', 'Speed'"),
        ({'poll_rate': -1.0}, 'allowed are 0 to 1000 Hz'),
        ({'poll_rate': math.nan}, 'allowed are'),
        ({'telemetry_rate': 101.0}, 'allowed are 0 to 100 Hz'),
        ({'setpoint_timeout': -0.1}, 'allowed are 0 to 3600 s'),
        ({'setpoint_max': math.inf}, 'allowed are 0 to 32767'),
        ({'shutdown_timeout': -1.0}, 'allowed are 0 to 600 s'),
        ({'lost_after': 0.1}, 'allowed are 0.2 to 60 s'),
        ({'lost_after': 61.0}, 'allowed are 0.2 to 60 s'),
        ({'drive_timeout': 1.4}, 'at least 1.5 s, half a second more than lost_after'),
        ({'drive_timeout': 1.2, 'lost_after': 0.75}, 'at least 1.3 s, half a second more'),
        ({'drive_timeout': 25.1}, 'allowed are 0 to 25 s'),
        ({'drive_timeout': 2.55}, 'between two steps of the drive, 2.5 and 2.6'),
    ],
)
def test_settings_that_make_no_sense(setting: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=next(iter(setting))) as error:
        DriveSettings(**setting)
    assert message in said(error.value)


def test_settings_that_do() -> None:
    for timeout in range(15, 251):
        assert DriveSettings(drive_timeout=timeout / 10).drive_timeout == timeout / 10
    for timeout in range(7, 251):
        longest = (timeout - 5) / 10
        assert DriveSettings(drive_timeout=timeout / 10, lost_after=longest)
    assert DriveSettings(drive_timeout=0.0, setpoint_timeout=0.0, poll_rate=1000.0)


