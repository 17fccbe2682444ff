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

"""Set-points and the drive's own time-out."""

from __future__ import annotations

import math

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from virtual_rig import MakeVirtual

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.families.sinus_g2.words import Mode

OVERLOAD = 5
#: Read registers, and who are you.
ONLY_READ = {3, 17, 43}


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
    wait_until(lambda: math.isfinite(rig.drive.snapshot.actual))


def test_the_same_set_point_goes_elsewhere_in_another_control_mode(
    make_virtual: MakeVirtual
) -> None:
    rig = make_virtual()
    rig.ride(20.0)
    rig.send(0.0)
    rig.pass_time(1.0)
    rig.answer(rig.drive.stop())
    rig.pass_time(1.0)
    rig.far.memory.set('control.mode', 'Speed')
    rig.pass_time(3.0)
    frequencies = rig.written(rig.register('status.frq_set'))
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.pass_time(0.5)
    rig.send(20.0)
    rig.pass_time(0.5)
    assert rig.far.memory.raw('status.spd_set') == 20
    assert rig.written(rig.register('status.frq_set')) == frequencies


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_set_point_that_is_no_number(rig: Rig, value: float) -> None:
    rig.turn(10.0)
    with pytest.raises(ValueError, match='is no number'):
        rig.drive.set_setpoint(value)
    rig.next_snapshots(3)
    assert rig.drive.snapshot.setpoint == 10.0


@pytest.mark.parametrize(
    ('most', 'asked', 'given'),
    [
        # the nominal frequency of the motor: 400 may have been meant as rpm
        (0.0, 400.0, 50.0),
        (0.0, -1e30, -50.0),
        (10.0, 25.0, 10.0),
        (10.0, -10.01, -10.0),
        # more than nominal is what somebody says, up to what the drive takes
        (87.0, 90.0, 87.0),
        (500.0, 400.0, 150.0),
    ],
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
    rig.notes.wait_for('no set-point for 0.3 s: the motor ramps to a stop', Severity.WARNING)
    # it is no stop: the next set-point is followed
    assert rig.drive.armed
    assert rig.far.motor.driven
    rig.publish(8.0)
    rig.wait_for_frequency(8.0)
    rig.notes.wait_for(Cause.SETPOINTS_AGAIN, Severity.INFO)


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


def timeouts(rig: Rig) -> tuple[int, int]:
    """SioTot (tenths of a second) and AutoStop in the drive."""
    return rig.far.memory.raw('serial.sio_tot'), rig.far.memory.raw('serial.auto_stop')


def test_drive_timeout_is_set(make_rig: MakeRig) -> None:
    rig = make_rig(drive_timeout=2.5)
    rig.connect()
    assert timeouts(rig) == (25, 1)
    assert rig.far.writes == {'serial.sio_tot': 1, 'serial.auto_stop': 1}
    rig.notes.wait_for('serial.sio_tot: 0 -> 2.5 s (drive_timeout)')
    rig.notes.wait_for('serial.auto_stop: false -> true (drive_timeout)')
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
    rig.refuse(monkeypatch, 'serial.auto_stop')
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


def test_bus_is_never_silent_for_long(make_virtual: MakeVirtual) -> None:
    # polls are wanted less often than the drive must hear of us
    rig = make_virtual(
        drive_timeout=2.5, poll_rate=0.1, telemetry_rate=0.0, setpoint_timeout=0.0
    )
    rig.connect()
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.answer(rig.drive.stop())
    rig.pass_time(30.0)
    assert rig.far.control_unit.mode is Mode.BUS
    assert rig.far.faults.codes == []
