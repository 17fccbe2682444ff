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

"""A drive without a status word: only its inverter status tells what it does [C21]."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from drive_rig import MODEST
from drive_rig import PATIENCE
from drive_rig import Notes
from drive_rig import wait_until
import pytest
from support.said import raises
from support.said import said

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import line_settings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.simulator.simulator import Simulator
from nfo_sinus_driver.simulator.sinus_g2.classic import Server

SETTINGS = DriveSettings(classic_dialect='v5.0', setpoint_timeout=0.0, poll_rate=MODEST)


def test_stop_down_a_long_ramp_is_confirmed_and_said_once() -> None:
    settings = {'control.accel': 2.0, 'control.retard': 20.0}
    line = line_settings('classic', response_timeout=2.0)
    with Simulator(protocol='classic', dialect='5.0', boot_time=0.2, settings=settings) as far:
        bus = Bus(open_link('classic', far.port, line))
        notes = Notes()
        drive = Drive(bus, SETTINGS, notes)
        bus.start()
        try:
            drive.connect().result(PATIENCE)
            drive.activate()
            drive.enable().result(PATIENCE)
            drive.set_setpoint(40.0)
            wait_until(lambda: far.drives[1].motor.frequency > 30.0)
            assert said(drive.stop().result(PATIENCE)) == 'stopping: it ramps down'
            polls = len(notes.snapshots)
            wait_until(lambda: len(notes.snapshots) > polls + 20)
            assert far.drives[1].motor.driven, 'the ramp was too short to see anything'
            assert not notes.told(Cause.RUNS_UNASKED)
            assert not notes.told(Cause.CANNOT_STOP)
            assert not drive.stop_unconfirmed
        finally:
            bus.close()


@pytest.mark.parametrize(
    ('dialect', 'chosen'), [('5.0', 'v5.0'), ('5.0', ''), ('2.03', 'v2.03'), ('2.03', '')]
)
def test_torque_has_the_decimals_of_its_firmware(dialect: str, chosen: str) -> None:
    # one decimal on firmware of the v5.0 dialect, none on others [C115]
    line = line_settings('classic', response_timeout=2.0)
    with Simulator(protocol='classic', dialect=dialect, boot_time=0.2) as far:
        far.drives[1].motor.torque = 0.6
        bus = Bus(open_link('classic', far.port, line))
        drive = Drive(bus, replace(SETTINGS, classic_dialect=chosen), Notes())
        bus.start()
        try:
            drive.connect().result(PATIENCE)
            assert drive.measure('status.trq_act').result(PATIENCE) == 60.0
        finally:
            bus.close()


# --- who controls, where only the inverter status tells -------------------------------------------


@pytest.fixture
def far() -> Iterator[Simulator]:
    settings = {'control.accel': 0.3, 'control.retard': 0.3}
    with Simulator(protocol='classic', dialect='5.0', boot_time=0.2, settings=settings) as far:
        yield far


@pytest.fixture
def notes() -> Notes:
    return Notes()


@pytest.fixture
def drive(far: Simulator, notes: Notes) -> Iterator[Drive]:
    """An active drive without a status word."""
    bus = Bus(open_link('classic', far.port, line_settings('classic', response_timeout=2.0)))
    drive = Drive(bus, SETTINGS, notes)
    bus.start()
    try:
        drive.connect().result(PATIENCE)
        drive.activate()
        wait_until(lambda: drive.snapshot.status)
        yield drive
    finally:
        bus.close()


def show(far: Simulator, monkeypatch: pytest.MonkeyPatch, code: int | None) -> None:
    """Have the drive say this of itself, whatever it does; ``None``: what it does."""
    monkeypatch.undo()
    if code is not None:
        monkeypatch.setattr(type(far.drives[1].control_unit), 'inv_st', property(lambda _: code))


def turning(far: Simulator, drive: Drive) -> None:
    drive.enable().result(PATIENCE)
    drive.set_setpoint(20.0)
    wait_until(lambda: far.drives[1].motor.frequency > 19.0)


def polls(notes: Notes, count: int) -> None:
    before = len(notes.snapshots)
    wait_until(lambda: len(notes.snapshots) > before + count)


@pytest.mark.parametrize('code', [26, 27])
def test_a_chopper_and_a_current_limit_are_nobody_elses_take_over(
    far: Simulator, drive: Drive, notes: Notes, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    turning(far, drive)
    show(far, monkeypatch, code)
    wait_until(lambda: drive.snapshot.status.code == code)
    drive.set_setpoint(20.0)
    polls(notes, 5)
    assert drive.armed, notes.events
    assert far.drives[1].motor.driven
    status = drive.snapshot.status
    assert status.runs_by_bus and status.driven
    assert Fact.NETWORK_CONTROL | Fact.OPERATION_ENABLED in status.facts
    show(far, monkeypatch, None)
    drive.set_setpoint(20.0)
    polls(notes, 5)
    assert drive.armed, notes.events


@pytest.mark.parametrize('press', ['start', 'ext', 'stop'])
def test_a_take_over_behind_a_current_limit_is_noticed(
    far: Simulator, drive: Drive, notes: Notes, monkeypatch: pytest.MonkeyPatch, press: str
) -> None:
    turning(far, drive)
    show(far, monkeypatch, 27)
    wait_until(lambda: drive.snapshot.status.code == 27)
    assert drive.armed
    with far.lock:
        far.drives[1].control_unit.press(press)
    wait_until(lambda: not drive.armed)
    notes.wait_for('keypad or terminals have control now and run the motor (27 Cur Limt)')


def test_a_motor_that_starts_against_its_current_limit(
    far: Simulator, drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = type(far.drives[1].control_unit).inv_st
    limited = property(lambda unit: 27 if unit.motor.driven else code.fget(unit))
    monkeypatch.setattr(type(far.drives[1].control_unit), 'inv_st', limited)
    assert 'enabled' in said(drive.enable().result(PATIENCE))
    assert drive.armed


def test_a_stop_is_not_confirmed_by_a_current_limit(
    far: Simulator, drive: Drive, notes: Notes, monkeypatch: pytest.MonkeyPatch
) -> None:
    turning(far, drive)
    unit = type(far.drives[1].control_unit)
    monkeypatch.setattr(unit, 'command', lambda self, scmd: None)
    show_only = property(lambda _: 27)
    monkeypatch.setattr(unit, 'inv_st', show_only)
    with raises(Cause.STOP_UNCONFIRMED):
        drive.stop().result(PATIENCE)
    monkeypatch.undo()
    wait_until(lambda: not drive.stop_unconfirmed)
    wait_until(lambda: not far.drives[1].motor.driven)


@pytest.mark.parametrize('press', ['start', 'ext'])
def test_a_motor_that_others_run_is_seen_to_run(
    far: Simulator, drive: Drive, notes: Notes, press: str
) -> None:
    with far.lock:
        far.drives[1].control_unit.press(press)
    wait_until(lambda: drive.snapshot.status.driven)
    with raises(Cause.RUN_BY_OTHERS):
        drive.stop().result(PATIENCE)
    assert far.drives[1].motor.driven
    assert not drive.snapshot.status.runs_by_bus
    polls(notes, 5)
    # it is left alone
    assert not notes.told(Cause.RUNS_UNASKED)
    assert far.drives[1].motor.driven


def test_counters_have_24_bits_over_classic(
    drive: Drive, notes: Notes, monkeypatch: pytest.MonkeyPatch
) -> None:
    enquiry = Server.enquiry

    def filled(self: Server, number: int) -> int:
        word = enquiry(self, number)
        # nobody says what the rest of the second word of a counter has [C26]
        return word | 0xA500 if number in (0x0127, 0x0128, 0x00DE) else word

    monkeypatch.setattr(Server, 'enquiry', filled)
    before = len(notes.telemetry)
    wait_until(lambda: len(notes.telemetry) > before + 8)
    values = notes.telemetry[-1].values
    assert values[Role.OPERATING_TIME] == pytest.approx(1234.5, abs=0.2)
    assert 0 <= values[Role.RUNNING_TIME] < 1e5
    assert 0 <= values[Role.BRAKE_TIME] < 1e5


def test_current_limit_is_no_stop() -> None:
    # its code stands in for the one that says who runs the motor
    settings = {'control.accel': 2.0, 'control.retard': 2.0}
    line = line_settings('classic', response_timeout=2.0)
    with Simulator(protocol='classic', dialect='5.0', boot_time=0.2, settings=settings) as far:
        bus = Bus(open_link('classic', far.port, line))
        notes = Notes()
        drive = Drive(bus, SETTINGS, notes)
        bus.start()
        try:
            drive.connect().result(PATIENCE)
            drive.activate()
            drive.enable().result(PATIENCE)
            drive.set_setpoint(20.0)
            wait_until(lambda: abs(far.drives[1].motor.frequency - 20.0) < 0.2)
            with far.lock:
                far.drives[1].motor.load = 6.0
            wait_until(lambda: notes.snapshots[-1].text == 'Cur Limt')
            polls = len(notes.snapshots)
            wait_until(lambda: len(notes.snapshots) > polls + 3)
            assert drive.armed
            status = notes.snapshots[-1].status
            assert status is not None and status.runs_by_bus and status.kind is Kind.ALARM
            texts = [text for _, text in notes.events if 'the current limit' in text]
            assert len(texts) == 1
            assert said(drive.stop().result(PATIENCE)).startswith('stop')
            # somebody who takes it away is noticed all the same
            with far.lock:
                far.drives[1].motor.load = 0.3
            wait_until(lambda: not far.drives[1].motor.driven)
            drive.enable().result(PATIENCE)
            far.inject('keypad', 'stop')
            wait_until(lambda: not drive.armed)
        finally:
            bus.close()
