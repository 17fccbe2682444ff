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

"""
Firmware of the v5.0 dialect takes settings under bus control alone, and faults on unknown ids.

[C100], [C21]: a SELECT of anything but MODE is answered by NAK before MODE = Sio; who asks for what
this firmware does not know while the bus has control stops the motor by a serial fault.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
from typing import Any

from drive_rig import PATIENCE
from drive_rig import Notes
from drive_rig import patient
from drive_rig import wait_until
import pytest
from support.said import raises
from support.said import said

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive.tuning import Procedure
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.link import line_settings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.simulator.classic_frames import LineError
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused
from nfo_sinus_driver.simulator.simulator import Simulator

STOP, EXT, BUS = 1, 2, 3
SIO_FAIL = 14
QUICK = {'control.accel': 0.3, 'control.retard': 0.3}


class Rig:
    """
    A drive of this firmware, and drivers of it, one after the other.

    :ivar modes: what was written to MODE.
    :ivar flags: what went wrong on the line, as the drive notes it.
    :ivar energised: the motor was, at any time.
    """

    def __init__(self, stack: contextlib.ExitStack, dialect: str, **options: Any) -> None:
        self._stack = stack
        options = {'settings': QUICK, **options}
        self.simulator = Simulator(protocol='classic', dialect=dialect, boot_time=0.2, **options)
        self.far: SimulatedDrive = self.simulator.drives[1]
        self.modes: list[int] = []
        self.flags = LineError(0)
        self.energised = False
        self._listen()
        stack.enter_context(self.simulator)
        self.drive: Drive
        self.notes = Notes()
        self.bus: Bus

    def _listen(self) -> None:
        far = self.far
        write, fail, energise = far.write_raw, far.control_unit.serial_error, far.motor.energise

        def note_write(key: str, raw: int) -> None:
            write(key, raw)
            if key == 'fieldbus.mode':
                self.modes.append(raw)

        def note_error(what: LineError) -> None:
            self.flags |= what
            fail(what)

        def note_energy() -> None:
            self.energised = True
            energise()

        far.write_raw = note_write  # type: ignore[method-assign]
        far.control_unit.serial_error = note_error  # type: ignore[method-assign]
        far.motor.energise = note_energy  # type: ignore[method-assign]

    def driver(self, **settings: Any) -> Drive:
        """Begin a driver."""
        lost_after = patient(settings.get('drive_timeout', 0.0))
        usual = {'classic_dialect': 'v5.0', 'setpoint_timeout': 0.0, 'lost_after': lost_after}
        settings = {**usual, **settings}
        line = line_settings('classic', response_timeout=2.0)
        self.bus = Bus(open_link('classic', self.simulator.port, line))
        self.drive = Drive(self.bus, DriveSettings(**settings), self.notes)
        self.bus.start()
        self._stack.callback(self.bus.close)
        return self.drive

    def connect(self, **settings: Any) -> Drive:
        """Begin a driver, connect and activate."""
        drive = self.driver(**settings)
        drive.connect().result(PATIENCE)
        drive.activate()
        wait_until(lambda: drive.snapshot.status)
        return drive

    def turn(self) -> None:
        """Enable and turn."""
        self.drive.enable().result(PATIENCE)
        self.drive.set_setpoint(20.0)
        wait_until(lambda: self.far.motor.frequency > 19.0)

    def change(self, **values: Any) -> None:
        """Change parameters of the group Control."""
        wanted = {f'control.{name}': value for name, value in values.items()}
        self.drive.parameters.change(wanted).result(PATIENCE)

    def why_not(self, **values: Any) -> str:
        """Return why parameters are not changed; nothing may have been written."""
        before = (dict(self.far.writes), list(self.modes), self.far.motor.driven)
        with pytest.raises(DriveError) as error:
            self.change(**values)
        assert (dict(self.far.writes), self.modes, self.far.motor.driven) == before
        return said(error.value)


@pytest.fixture
def stack(unhurried: None) -> Iterator[contextlib.ExitStack]:
    with contextlib.ExitStack() as stack:
        yield stack


@pytest.fixture
def rig(stack: contextlib.ExitStack) -> Rig:
    return Rig(stack, '5.0')


# --- settings -------------------------------------------------------------------------------------


def test_settings_are_written_under_control_that_is_given_back(rig: Rig) -> None:
    rig.connect()
    rig.change(accel=6.0, retard=7.0)
    assert (rig.far.peek('control.accel'), rig.far.peek('control.retard')) == (6.0, 7.0)
    assert rig.modes == [BUS, STOP]
    assert not rig.energised
    assert not rig.flags
    assert rig.far.control_unit.status_code == 24
    assert rig.far.command_writes.get('status.frq_set'), 'no old set-point may stand'


def test_no_control_is_taken_for_what_the_drive_has_already(rig: Rig) -> None:
    rig.connect()
    rig.change(accel=0.3)
    assert rig.modes == []


@pytest.mark.parametrize('turning', [False, True])
def test_under_bus_control_settings_are_just_written(rig: Rig, turning: bool) -> None:
    rig.connect()
    rig.turn()
    if not turning:
        rig.drive.stop().result(PATIENCE)
        wait_until(lambda: not rig.far.motor.driven)
    rig.drive.set_setpoint(20.0)
    modes = list(rig.modes)
    rig.change(accel=6.0)
    assert rig.far.peek('control.accel') == 6.0
    assert rig.modes == modes == [BUS]
    assert rig.far.motor.driven == turning
    assert rig.drive.armed == turning
    assert not rig.flags


def test_what_else_has_control_keeps_it(rig: Rig) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.set_run_input(False)
        rig.far.control_unit.press('ext')
    assert 'giving it back to them could start the motor: press STOP' in rig.why_not(accel=6.0)
    with rig.simulator.lock:
        rig.far.set_run_input(True)
    wait_until(lambda: rig.far.motor.driven)
    assert 'the motor runs' in rig.why_not(accel=6.0)
    with rig.simulator.lock:
        rig.far.control_unit.press('stop')
    wait_until(lambda: not rig.far.motor.driven)
    rig.change(accel=6.0)
    assert rig.far.peek('control.accel') == 6.0


def test_not_while_a_fault_is_active(rig: Rig) -> None:
    rig.connect()
    rig.simulator.inject('fault', 5)
    wait_until(lambda: rig.drive.snapshot.status.faulted)
    why = rig.why_not(accel=6.0)
    assert '5 Overload' in why
    assert '~/fault_ack' in why
    rig.drive.acknowledge().result(PATIENCE)
    rig.change(accel=6.0)


def test_not_while_it_is_tuned_by_others(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.connect()
    monkeypatch.setattr(type(rig.far.control_unit), 'mode', property(lambda _: 0))
    assert 'MODE is Inhibit' in rig.why_not(accel=6.0)


def test_a_write_that_fails_half_way_gives_control_back(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.connect()
    store = rig.far._store
    monkeypatch.setattr(
        rig.far, '_store', lambda key, raw: key == 'control.retard' or store(key, raw)
    )
    with raises(Cause.DRIVE_KEEPS_OTHER) as error:
        rig.change(accel=6.0, retard=7.0)
    assert 'put back: control.accel' in said(error.value)
    assert rig.far.peek('control.accel') == pytest.approx(0.3)
    assert rig.modes == [BUS, STOP]
    assert not rig.energised


def test_a_value_that_is_refused_puts_all_back(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    # a refusal under bus control is a serial fault: MODE is Stop after it
    rig.connect()
    write = rig.far.write_raw

    def refuse(key: str, raw: int) -> None:
        if key == 'control.retard':
            raise Refused(Reason.VALUE, 'not this one')
        write(key, raw)

    monkeypatch.setattr(rig.far, 'write_raw', refuse)
    with pytest.raises(DriveError) as error:
        rig.change(accel=6.0, retard=7.0)
    assert 'put back: control.accel' in said(error.value)
    assert rig.far.peek('control.accel') == pytest.approx(0.3)
    wait_until(lambda: rig.far.control_unit.mode == STOP)
    assert not rig.energised


def test_an_enable_waits_until_settings_are_written(rig: Rig) -> None:
    rig.connect()
    write, enables = rig.far.write_raw, []

    def enable_meanwhile(key: str, raw: int) -> None:
        write(key, raw)
        if key == 'control.accel':
            enables.append(rig.drive.enable())

    rig.far.write_raw = enable_meanwhile  # type: ignore[method-assign]
    rig.drive.parameters.change({'control.accel': 6.0, 'control.retard': 7.0})
    wait_until(lambda: enables)
    with raises(Cause.PROCEDURE_GOES_ON):
        enables[0].result(PATIENCE)
    wait_until(lambda: rig.modes == [BUS, STOP])
    assert not rig.energised
    rig.turn()


def test_a_run_command_that_the_drive_has_kept_is_removed(rig: Rig) -> None:
    # no manual says that MODE = Stop ends it
    rig.connect()
    take = rig.far.control_unit.take

    def keeps(source: Any) -> None:
        take(source)
        if source.value == 'scmd':
            rig.far.control_unit.scmd = Scmd.FIELDBUS

    rig.far.control_unit.take = keeps  # type: ignore[method-assign]
    with rig.simulator.lock:
        rig.far.memory.set('status.frq_set', 20.0)
    rig.change(accel=6.0)
    assert rig.far.peek('control.accel') == 6.0
    assert not rig.far.motor.turning
    assert rig.modes == [BUS, STOP]


# --- the drive's own time-out ---------------------------------------------------------------------


def test_the_drives_time_out_is_set(rig: Rig) -> None:
    rig.connect(drive_timeout=4.0)
    assert (rig.far.peek('serial.sio_tot'), rig.far.peek('serial.auto_stop')) == (4.0, True)
    assert rig.modes == [BUS, STOP]
    rig.drive.set_drive_timeout(5.0).result(PATIENCE)
    assert rig.far.peek('serial.sio_tot') == 5.0
    assert rig.modes == [BUS, STOP] * 2
    assert not rig.flags


def test_the_drives_time_out_is_set_when_the_bus_gets_control(rig: Rig) -> None:
    with rig.simulator.lock:
        rig.far.control_unit.press('ext')
    rig.connect(drive_timeout=4.0)
    rig.notes.wait_for(Cause.OWN_TIMEOUT_LATER, Severity.WARNING)
    assert rig.far.peek('serial.sio_tot') == 0
    assert rig.far.control_unit.mode == EXT
    with rig.simulator.lock:
        rig.far.control_unit.press('stop')
    wait_until(lambda: not rig.far.motor.turning)
    rig.turn()
    assert (rig.far.peek('serial.sio_tot'), rig.far.peek('serial.auto_stop')) == (4.0, True)
    assert rig.modes == [BUS]
    assert not rig.flags


# --- nothing is asked that it does not know -------------------------------------------------------


def test_two_lost_answers_do_not_trip_it(rig: Rig) -> None:
    rig.connect(setpoint_timeout=0.0, retries=4, lost_after=30.0)
    rig.turn()
    read, lost = rig.far.read_raw, [2]

    def lose(key: str) -> int:
        # the status, and what is read to find out whether its answer is only late
        if key in ('fieldbus.inv_st', 'fieldbus.mode') and lost[0]:
            lost[0] -= 1
            rig.simulator.line.faults.add('drop', 1, None, 0.0)
        return read(key)

    rig.far.read_raw = lose  # type: ignore[method-assign]
    wait_until(lambda: not lost[0])
    polls = len(rig.notes.snapshots)
    wait_until(lambda: len(rig.notes.snapshots) > polls + 3)
    assert rig.flags == 0
    assert rig.far.motor.driven


@pytest.mark.parametrize('control_method', ['mode_scmd', 'monitor'])
def test_a_driver_that_is_begun_while_the_motor_turns(rig: Rig, control_method: str) -> None:
    rig.connect(setpoint_timeout=0.0)
    rig.turn()
    rig.bus.close()
    rig.connect(classic_dialect='', control_method=control_method)
    assert rig.flags == 0
    assert rig.far.control_unit.status_code != SIO_FAIL
    rig.notes.wait_for('the bus has control', Severity.WARNING)
    if control_method == 'mode_scmd':
        wait_until(lambda: not rig.far.motor.driven)
        wait_until(lambda: rig.far.control_unit.status_code == 37)
    else:
        assert rig.far.motor.driven


@pytest.mark.parametrize(('dialect', 'firmware'), [('2.03', '4.38'), ('5.0', '')])
def test_the_firmware_is_asked_for_while_the_bus_has_no_control(
    stack: contextlib.ExitStack, dialect: str, firmware: str
) -> None:
    rig = Rig(stack, dialect)
    drive = rig.connect(classic_dialect='')
    assert drive.identity is not None
    assert firmware in str(drive.identity)
    assert bool(firmware) == (drive.snapshot.status.word is not None)
    assert rig.flags == (LineError(0) if firmware else LineError.UNKNOWN)
    assert rig.far.control_unit.status_code == 24


def test_a_drive_that_was_asked_once_is_known_when_it_comes_back_under_control(
    stack: contextlib.ExitStack,
) -> None:
    rig = Rig(stack, '2.03')
    drive = rig.connect(classic_dialect='')
    rig.turn()
    rig.simulator.inject('line-dead', 3600.0)
    rig.notes.wait_for('lost')
    told = len([1 for _, text in rig.notes.events if text.startswith('connected')])
    rig.simulator.inject('heal')
    wait_until(
        lambda: len([1 for _, text in rig.notes.events if text.startswith('connected')]) > told
    )
    assert '4.38' in str(drive.identity)
    assert not rig.notes.told('the bus has control')


def test_no_control_word_is_asked_of_it(stack: contextlib.ExitStack) -> None:
    with pytest.raises(ValueError, match=r'classic_dialect v5\.0 has no control word'):
        DriveSettings(classic_dialect='v5.0', control_method='drive_control')


def test_nothing_at_all_is_asked_that_it_does_not_know(rig: Rig) -> None:
    # answers are lost for longer than a drive would wait by default
    drive = rig.driver(telemetry_rate=50.0, drive_timeout=16.0)
    drive.connect(parameters=True).result(PATIENCE)
    drive.activate()
    wait_until(lambda: drive.snapshot.status)
    assert drive.parameters.values

    def beside() -> None:
        """What goes on while nobody commands."""
        measured, polls = len(rig.notes.telemetry), len(rig.notes.snapshots)
        wait_until(lambda: len(rig.notes.telemetry) > measured + 8)
        wait_until(lambda: len(rig.notes.snapshots) > polls + 3)
        for what in ('drop', 'damage', 'noise', 'double', 'delay'):
            rig.simulator.inject(what, 3)
            polls = len(rig.notes.snapshots)
            wait_until(lambda seen=polls: len(rig.notes.snapshots) > seen + 3)

    beside()
    rig.change(accel=0.4)
    drive.error_log(40).result(PATIENCE)
    drive.erase_error_log().result(PATIENCE)
    with pytest.raises(DriveError):
        drive.reset_energy().result(PATIENCE)
    rig.simulator.inject('heal')
    wait_until(lambda: not rig.far.faults and drive.snapshot.status)
    assert drive.tune(Procedure.CALCULATE).result(PATIENCE).success
    rig.turn()
    drive.parameters.refresh().result(PATIENCE)
    rig.change(accel=0.5)
    drive.set_drive_timeout(20.0).result(PATIENCE)
    drive.error_log(40).result(PATIENCE)
    assert LineError.UNKNOWN not in rig.flags
    drive.stop().result(PATIENCE)
    beside()
    assert not rig.flags, rig.flags
    rig.simulator.inject('heal')
    rig.simulator.inject('fault', 5)
    wait_until(lambda: drive.snapshot.status and drive.snapshot.status.faulted)
    drive.acknowledge().result(PATIENCE)
    drive.disconnect(5.0).result(PATIENCE)
    unasked = LineError.UNKNOWN | LineError.PREFIX | LineError.UNREADABLE | LineError.UNWRITABLE
    assert not rig.flags & unasked
