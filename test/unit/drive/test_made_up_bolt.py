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
A family whose status is one word, which says that the motor runs until it stands.

The Bolt tells its code in that word, stores who has control, is refused by a terminal that is
closed, has a time-out that always stops, and runs in one direction.
"""

from __future__ import annotations

from collections.abc import Iterator
import dataclasses
from pathlib import Path
import shutil
from typing import Any

from drive_rig import PATIENCE
from drive_rig import Notes
from drive_rig import wait_until
from made_up_rig import FarEnd
import pytest
from support.said import raises
from support.said import said

from nfo_sinus_driver import families
from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.catalog import CatalogError
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive.detect import detect_model
from nfo_sinus_driver.drive.settings import AUTO

MADE_UP = Path(__file__).parent / 'made_up'
PATIENT, SOURCE, BITS, SIZE, TOLD, INPUTS, HERTZ, TURNS = 11, 12, 100, 102, 400, 402, 403, 404
RUN, RESET = 1 << 0, 1 << 3
RUNNING, TRIPPED, BACKWARDS = 1 << 0, 1 << 1, 1 << 3


class Bolt(FarEnd):
    """A Bolt; its ramp goes on by a step whenever its frequency is read."""

    def __init__(self) -> None:
        super().__init__(dict.fromkeys((10, PATIENT, SOURCE, BITS, SIZE, *range(TOLD, 405)), 0))
        self.registers[10] = 50
        #: By how much the frequency changes each time, 0.01 Hz; which fault is active.
        self.step = 100
        self.fault = 0
        #: It goes on as it was told before, whatever is written.
        self.deaf = False
        #: By how much the frequency goes up and down while it does, 0.01 Hz.
        self.wobble = 0
        #: Its motor is turned the other way.
        self.backwards = False
        self._demand = 0

    @property
    def hertz(self) -> float:
        """The frequency at which the motor turns, Hz."""
        return self.registers[HERTZ] / 100

    def was_read(self, number: int) -> None:
        registers = self.registers
        if number == HERTZ:
            wanted, has = self._demand, registers[HERTZ]
            self.wobble = -self.wobble
            registers[HERTZ] = has + self.wobble + max(-self.step, min(self.step, wanted - has))
        runs = (registers[BITS] & RUN or registers[HERTZ]) and not self.fault
        registers[TOLD] = self.fault or (2 if runs else 1)
        facts = RUNNING * bool(runs) | TRIPPED * bool(self.fault)
        registers[TOLD + 1] = facts | BACKWARDS * self.backwards

    def was_written(self, before: dict[int, int]) -> None:
        if self.registers[BITS] & RESET and not before[BITS] & RESET:
            self.fault = 0
        if not self.deaf:
            runs = self.registers[BITS] & RUN and self.registers[SOURCE] and not self.fault
            self._demand = self.registers[SIZE] if runs else 0


@pytest.fixture(autouse=True)
def _more_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(families, '__path__', [*families.__path__, str(MADE_UP)])


@pytest.fixture
def bolt() -> Bolt:
    return Bolt()


@pytest.fixture
def bus(bolt: Bolt) -> Iterator[Bus]:
    bus = Bus(bolt)  # type: ignore[arg-type]
    bus.start()
    yield bus
    bus.close()


def connected(bus: Bus, notes: Notes, **settings: Any) -> Drive:
    """A drive that can be enabled."""
    settings = {'model': 'bolt', 'setpoint_timeout': 0.0, **settings}
    drive = Drive(bus, DriveSettings(**settings), notes)
    drive.connect(parameters=True).result(PATIENCE)
    drive.activate()
    return drive


def turning(bolt: Bolt, bus: Bus, notes: Notes) -> Drive:
    """A drive that turns at 40 Hz."""
    drive = connected(bus, notes)
    drive.enable().result(PATIENCE)
    drive.set_setpoint(40.0)
    wait_until(lambda: bolt.hertz == 40.0)
    return drive


def test_it_is_found(bus: Bus) -> None:
    assert bus.run(detect_model(bus, 1)).result(PATIENCE) == 'bolt'


def test_the_usual_control_method_is_that_of_the_family() -> None:
    g2 = DriveSettings(model='sinus_g2')
    assert g2.method == 'mode_scmd'
    # what was not chosen is not kept when the model turns out to be another
    assert dataclasses.replace(g2, model='bolt').method == 'function_bits'
    assert DriveSettings(model=AUTO).method == ''
    with pytest.raises(ValueError, match="control_method 'mode_scmd': choose one of"):
        DriveSettings(model='bolt', control_method='mode_scmd')


def test_a_status_is_one_read_and_the_frequency_comes_with_it(bolt: Bolt, bus: Bus) -> None:
    drive = turning(bolt, bus, Notes())
    seen = drive.snapshot.status
    assert seen is not None
    assert (seen.code, drive.snapshot.text) == (2, 'Run')
    assert seen.word == 2 << 16 | RUNNING
    # the code is not published a second time
    assert seen.shown_word == RUNNING
    with bolt.lock:
        bolt.reads.clear()
    wait_until(lambda: bolt.reads.count(TOLD) > 20)
    with bolt.lock:
        reads = [number for number in bolt.reads if number in (TOLD, HERTZ)]
    # it may be in the midst of one when it is begun to be counted
    reads = reads[reads.index(TOLD) :]
    assert reads[: len(reads) // 2 * 2] == [TOLD, HERTZ] * (len(reads) // 2)
    assert (drive.snapshot.frequency, drive.snapshot.actual) == (40.0, 40.0)


def test_the_word_tells_the_sign_of_what_is_measured(bolt: Bolt, bus: Bus) -> None:
    drive = turning(bolt, bus, Notes())
    bolt.registers[TURNS] = 1200
    wait_until(lambda: (drive.snapshot.frequency, drive.snapshot.speed) == (40.0, 1200.0))
    bolt.backwards = True
    wait_until(lambda: (drive.snapshot.frequency, drive.snapshot.speed) == (-40.0, -1200.0))
    # in size it has not changed
    assert drive.snapshot.status is not None and drive.snapshot.status.keeps_running


def test_who_has_control_is_asked_now_and_then(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = turning(bolt, bus, notes)
    with bolt.lock:
        bolt.reads.clear()
    wait_until(lambda: SOURCE in bolt.reads)
    wait_until(lambda: bolt.reads.count(SOURCE) > 1)
    with bolt.lock:
        asked = [number for number in bolt.reads if number in (TOLD, SOURCE)]
    first = asked.index(SOURCE)
    # not with every status
    assert asked.index(SOURCE, first + 1) - first > 10
    with bolt.lock:
        bolt.registers[SOURCE] = 0
    notes.wait_for(Cause.OTHERS_IN_CONTROL)
    wait_until(lambda: not drive.snapshot.enabled)


def test_a_stop_is_confirmed_by_a_frequency_that_falls(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = turning(bolt, bus, notes)
    bolt.step = 1
    assert drive.stop().result(PATIENCE).cause is Cause.RAMPING
    seen = drive.inverter.seen
    assert seen is not None and seen.runs and seen.driven and seen.frequency > 0
    # all the way down nobody takes it for a motor that runs unasked
    looks = len(notes.snapshots)
    wait_until(lambda: len(notes.snapshots) > looks + 50)
    bolt.step = 100
    wait_until(lambda: drive.snapshot.frequency == 0)
    assert not notes.told(Cause.RUNS_UNASKED)
    assert drive.snapshot.status is not None and not drive.snapshot.status.driven
    assert drive.stop().result(PATIENCE).cause is Cause.STOPPED


def test_a_motor_that_stands_is_not_driven_whatever_the_word_says(bus: Bus) -> None:
    drive = connected(bus, Notes())
    drive.enable().result(PATIENCE)
    seen = drive.read_status().result(PATIENCE)
    assert seen.runs and seen.frequency == 0
    assert not seen.driven and not seen.keeps_running


def test_a_fall_from_before_the_stop_confirms_nothing(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = turning(bolt, bus, notes)
    bolt.step = 5
    drive.set_setpoint(20.0)
    wait_until(lambda: bolt.hertz < 35)
    with bolt.lock:
        bolt.deaf, bolt.step = True, 0
    with raises(Cause.STOP_UNCONFIRMED):
        drive.stop().result(PATIENCE)
    notes.wait_for('CANNOT STOP THE MOTOR')
    with bolt.lock:
        bolt.deaf, bolt.step = False, 5
    wait_until(lambda: not drive.stop_unconfirmed)
    assert bolt.registers[BITS] == 0


def test_a_frequency_that_wobbles_confirms_nothing(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = turning(bolt, bus, notes)
    with bolt.lock:
        bolt.deaf, bolt.step, bolt.wobble = True, 0, 5
    with raises(Cause.STOP_UNCONFIRMED):
        drive.stop().result(PATIENCE)
    with bolt.lock:
        bolt.deaf, bolt.step, bolt.wobble = False, 5, 0
    wait_until(lambda: not drive.stop_unconfirmed)


def test_a_motor_that_runs_unasked_is_stopped(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = turning(bolt, bus, notes)
    drive.stop().result(PATIENCE)
    wait_until(lambda: drive.snapshot.frequency == 0)
    with bolt.lock:
        before = dict(bolt.registers)
        bolt.registers.update({BITS: RUN, SIZE: 3000})
        bolt.was_written(before)
    notes.wait_for(Cause.RUNS_UNASKED)
    wait_until(lambda: bolt.registers[BITS] == 0)
    wait_until(lambda: bolt.hertz == 0)


def test_without_a_frequency_no_stop_is_believed(bolt: Bolt, bus: Bus) -> None:
    drive = turning(bolt, bus, Notes())
    del bolt.registers[HERTZ]
    wait_until(lambda: drive.snapshot.frequency != drive.snapshot.frequency)
    with raises(Cause.STOP_UNCONFIRMED):
        drive.stop().result(PATIENCE)


def test_what_is_stored_is_written_once_and_reported(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = connected(bus, notes)
    drive.enable().result(PATIENCE)
    told = 'bus.source (SOURCE) was changed to take control, and is stored in the drive: terminals'
    assert notes.told(f'{told} -> line')
    drive.stop().result(PATIENCE)
    drive.enable().result(PATIENCE)
    assert bolt.writes.count((SOURCE, 1)) == 1


def test_control_that_is_kept_is_said(bolt: Bolt, bus: Bus) -> None:
    drive = turning(bolt, bus, Notes())
    answer = drive.disconnect(PATIENCE).result(PATIENCE)
    assert answer.cause is Cause.CONTROL_KEPT
    assert said(answer).endswith(
        'the bus keeps control: SOURCE is stored; set it to terminals at the keypad'
    )
    assert (bolt.hertz, bolt.registers[BITS], bolt.registers[SOURCE]) == (0, 0, 1)


def test_an_enable_that_is_not_possible_leaves_the_drive_as_it_was(bolt: Bolt, bus: Bus) -> None:
    bolt.registers[SOURCE] = 1
    drive = connected(bus, Notes())
    bolt.registers[INPUTS] = 1
    begun = len(bolt.writes)
    with raises(Cause.NOT_POSSIBLE) as refused:
        drive.enable().result(PATIENCE)
    assert said(refused.value) == 'terminal X1 is closed: open it'
    assert bolt.writes[begun:] == []
    assert not drive.stop_unconfirmed
    bolt.registers[INPUTS] = 0
    assert drive.enable().result(PATIENCE).cause is Cause.ENABLED


def test_a_fault_that_is_there_at_the_start_waits_for_a_person(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    bolt.fault, bolt.registers[SOURCE] = 145, 1
    drive = connected(bus, notes)
    notes.wait_for('fault 145 Bus')
    begun = len(bolt.writes)
    with raises(Cause.FAULT_FORBIDS):
        drive.enable().result(PATIENCE)
    assert bolt.writes[begun:] == []
    assert (BITS, RESET) not in bolt.writes
    assert said(drive.acknowledge().result(PATIENCE)) == 'acknowledged 145 Bus'
    assert drive.enable().result(PATIENCE).cause is Cause.ENABLED


def test_a_time_out_that_always_stops_needs_nothing_else(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = connected(bus, notes, drive_timeout=4.0)
    assert bolt.registers[PATIENT] == 40
    assert drive.inverter.timeout.seconds == 4.0 and drive.inverter.timeout.stops_motor
    assert not notes.told('time-out of its own')


def test_a_time_out_that_is_off_is_called_by_its_name(bus: Bus) -> None:
    notes = Notes()
    connected(bus, notes)
    notes.wait_for('no time-out of its own (T BUS is 0)')


def test_a_set_point_is_limited_to_the_one_direction(bolt: Bolt, bus: Bus) -> None:
    notes = Notes()
    drive = turning(bolt, bus, notes)
    drive.set_setpoint(-5.0)
    wait_until(lambda: bolt.hertz == 0)
    notes.wait_for('set-point -5 is limited to 0')
    assert drive.armed and drive.snapshot.setpoint_clamped


def test_what_a_drive_cannot_measure_is_its_familys() -> None:
    bolt, acme = load_family('bolt'), load_family('acme')
    assert bolt.can_be('status.hertz', 119.0) and not bolt.can_be('status.hertz', -121.0)
    assert acme.can_be('status.hertz', 400.0)
    # neither a word whose code the manual lacks
    assert bolt.can_be('bus.told', 145 << 16) and not bolt.can_be('bus.told', 7 << 16)


@pytest.mark.parametrize('role', ['status_word', 'actual_frequency'])
def test_what_tells_whether_it_runs_has_to_be_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, role: str
) -> None:
    folder = tmp_path / f'without_{role}'
    shutil.copytree(MADE_UP / 'bolt', folder)
    roles = (folder / 'roles.csv').read_text(encoding='utf-8').splitlines(keepends=True)
    kept = ''.join(line for line in roles if not line.startswith(role))
    (folder / 'roles.csv').write_text(kept, encoding='utf-8')
    monkeypatch.setattr(families, '__path__', [*families.__path__, str(tmp_path)])
    with pytest.raises(CatalogError, match=f'no parameter is the {role}'):
        load_family(folder.name)
