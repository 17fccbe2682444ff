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
A family that is nothing but a folder: found, enabled, turned, reversed, faulted and stopped.

The Acme has big-endian numbers, a status word of its own, a set-point in packed decimal digits and
its direction in another register.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import dataclasses
import math
from pathlib import Path
import shutil
import struct
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
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import Refused

RAMP, WORD, TURN, SIZE, TOLD, CODE, HERTZ, KIND = 10, 100, 101, 102, 200, 201, 202, 300
RESET, RUN, REMOTE = 1 << 3, 1 << 12, 1 << 15
RUNNING, TRIPPED, HAS_REMOTE = 1 << 5, 1 << 9, 1 << 13


class Acme(FarEnd):
    """An Acme."""

    def __init__(self) -> None:
        super().__init__(dict.fromkeys((*range(100, 104), *range(200, 205), KIND), 0))
        self.registers[RAMP] = 50
        #: What it was told to follow after each write, Hz; what to do after the next one.
        self.followed: list[float] = []
        self.then: Callable[[], object] = lambda: None
        self.trip(0)

    def trip(self, code: int) -> None:
        """Let a fault happen, or end: 0."""
        word = self.registers[WORD]
        runs = word & RUN and word & REMOTE and not code
        told = HAS_REMOTE * bool(word & REMOTE) | RUNNING * bool(runs) | TRIPPED * bool(code)
        usual = (3 if runs else 2) if word & REMOTE else 1
        self.registers.update({TOLD: told, CODE: code or usual})
        size = int(f'{self.registers[SIZE]:04X}{self.registers[SIZE + 1]:04X}')
        hertz = (-size if self.registers[TURN] else size) if runs else 0
        high, low = struct.unpack('>2H', struct.pack('>i', hertz))
        self.registers.update({HERTZ: high, HERTZ + 1: low})

    @property
    def hertz(self) -> float:
        """The frequency at which the motor turns, Hz."""
        words = self.registers[HERTZ], self.registers[HERTZ + 1]
        return float(struct.unpack('>i', struct.pack('>2H', *words))[0] / 100)

    @property
    def fault(self) -> int:
        """The code of the fault that stands."""
        return self.registers[CODE] if self.registers[TOLD] & TRIPPED else 0

    def was_written(self, before: dict[int, int]) -> None:
        """Reset a fault on the edge, and go on as the control word says."""
        reset = self.registers[WORD] & RESET and not before[WORD] & RESET
        self.trip(0 if reset else self.fault)
        self.followed.append(self.hertz)
        then, self.then = self.then, lambda: None
        then()


@pytest.fixture(autouse=True)
def _one_folder_more(monkeypatch: pytest.MonkeyPatch) -> None:
    more = str(Path(__file__).parent / 'made_up')
    monkeypatch.setattr(families, '__path__', [*families.__path__, more])


@pytest.fixture
def acme() -> Acme:
    return Acme()


@pytest.fixture
def bus(acme: Acme) -> Iterator[Bus]:
    bus = Bus(acme)  # type: ignore[arg-type]
    bus.start()
    yield bus
    bus.close()


def test_it_is_found(bus: Bus) -> None:
    assert bus.run(detect_model(bus, 1)).result(PATIENCE) == 'acme'


def test_one_that_tells_nothing_is_the_one_of_which_nothing_tells(acme: Acme, bus: Bus) -> None:
    del acme.registers[KIND]
    assert bus.run(detect_model(bus, 1)).result(PATIENCE) == 'sinus_optimal'


def test_of_two_that_tell_nothing_a_person_has_to_say(
    acme: Acme, bus: Bus, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = dataclasses.replace(load_family('acme').profile, told_by='')
    monkeypatch.setitem(load_family('acme').__dict__, 'profile', silent)
    with raises(Cause.SEVERAL_MODELS):
        bus.run(detect_model(bus, 1)).result(PATIENCE)


def driver(bus: Bus, notes: Notes, **settings: Any) -> Drive:
    usual = {'model': 'acme', 'control_method': 'drive_control', 'setpoint_timeout': 0.0}
    settings = {**usual, **settings}
    return Drive(bus, DriveSettings(**settings), notes)


def turning(acme: Acme, bus: Bus, notes: Notes, **settings: Any) -> Drive:
    """A drive that turns at -20 Hz."""
    drive = driver(bus, notes, **settings)
    drive.connect().result(PATIENCE)
    drive.activate()
    drive.enable().result(PATIENCE)
    drive.set_setpoint(-20.0)
    wait_until(lambda: acme.hertz == -20.0)
    return drive


def test_a_ride(acme: Acme, bus: Bus) -> None:
    notes = Notes()
    drive = driver(bus, notes)
    drive.connect(parameters=True).result(PATIENCE)
    drive.activate()
    assert dict(drive.parameters.values) == {'ramp.up': 5.0}
    assert not acme.writes

    assert 'enabled' in said(drive.enable().result(PATIENCE))
    runs = acme.writes.index((WORD, REMOTE | RUN))
    # with control and set-point 0, and only then
    assert {(WORD, REMOTE), (TURN, 0), (SIZE, 0), (SIZE + 1, 0)} <= {*acme.writes[:runs]}
    assert acme.registers[TOLD] == HAS_REMOTE | RUNNING

    drive.set_setpoint(20.0)
    wait_until(lambda: acme.hertz == 20.0)
    begun = len(acme.writes)
    drive.set_setpoint(-12.34)
    wait_until(lambda: acme.hertz == -12.34)
    # the size is none before the direction changes
    none, size = [(SIZE, 0), (SIZE + 1, 0)], [(SIZE, 0), (SIZE + 1, 0x1234)]
    assert acme.writes[begun:] == [*none, (TURN, 1), *size]
    wait_until(lambda: drive.snapshot.actual == -12.34)
    assert (drive.snapshot.setpoint, drive.snapshot.text) == (-12.34, 'Run')
    # what stands there already is not written again
    drive.set_setpoint(-50.0)
    wait_until(lambda: acme.hertz == -50.0)
    assert acme.writes[begun + 5 :] == [(SIZE, 0), (SIZE + 1, 0x5000)]

    with acme.lock:
        acme.trip(70)
    wait_until(lambda: not drive.armed)
    wait_until(lambda: acme.registers[WORD] == REMOTE)
    notes.wait_for('Too hot. Let it cool')
    assert said(drive.acknowledge().result(PATIENCE)) == 'acknowledged 70 Hot'
    assert acme.hertz == 0

    drive.enable().result(PATIENCE)
    drive.set_setpoint(-30.0)
    wait_until(lambda: acme.hertz == -30.0)
    assert 'stopped' in said(drive.stop().result(PATIENCE))
    assert (acme.hertz, acme.registers[WORD]) == (0, REMOTE)
    assert 'released' in said(drive.disconnect(1.0).result(PATIENCE))
    assert acme.registers[WORD] == 0


def test_a_set_point_that_nobody_refreshes_ends_in_both_registers(acme: Acme, bus: Bus) -> None:
    drive = turning(acme, bus, Notes())
    drive.settings = dataclasses.replace(drive.settings, setpoint_timeout=0.2)
    wait_until(lambda: (acme.hertz, acme.registers[TURN]) == (0, 0))
    wait_until(lambda: drive.snapshot.setpoint == 0)
    assert drive.armed
    drive.set_setpoint(-5.0)
    wait_until(lambda: -5.0 in acme.followed)


def test_a_lost_answer_to_a_set_point_slows_no_motor_down(acme: Acme, bus: Bus) -> None:
    drive = turning(acme, bus, Notes())
    acme.fates[SIZE] = NoAnswer('silence')
    begun = len(acme.writes)
    drive.set_setpoint(-30.0)
    wait_until(lambda: acme.hertz == -30.0)
    assert acme.writes[begun:] == [(SIZE, 0), (SIZE + 1, 0x3000)]
    wait_until(lambda: drive.snapshot.setpoint == -30.0)


def test_after_silence_a_direction_is_written_again(acme: Acme, bus: Bus) -> None:
    drive = turning(acme, bus, Notes())
    acme.fates[TURN] = NoAnswer('silence')
    begun = len(acme.writes)
    drive.set_setpoint(30.0)
    wait_until(lambda: acme.hertz == 30.0)
    none = [(SIZE, 0), (SIZE + 1, 0)]
    assert acme.writes[begun:] == [*none, (TURN, 0), (SIZE, 0), (SIZE + 1, 0x3000)]
    wait_until(lambda: drive.snapshot.setpoint == 30.0)


def test_no_size_is_followed_in_the_other_direction(acme: Acme, bus: Bus) -> None:
    drive = turning(acme, bus, Notes())
    wanted = [35.0, -12.5, -50.0, 50.0, 0.0, -1.0, 0.0, 1.0, -0.01, 400.0, -400.0]
    for before, value in zip([-20.0, *wanted], wanted, strict=False):
        acme.followed.clear()
        drive.set_setpoint(value)
        wait_until(lambda value=value: acme.hertz == drive.snapshot.setpoint == value)
        assert set(acme.followed) <= {before, 0.0, value}, value


def test_a_newer_set_point_comes_between_the_writes_of_one(acme: Acme, bus: Bus) -> None:
    drive = turning(acme, bus, Notes())
    begun = len(acme.writes)
    # when the size of -20 Hz is none, it is asked for once more, instead of 30 Hz
    acme.then = lambda: drive.set_setpoint(-20.0)
    drive.set_setpoint(30.0)
    wait_until(lambda: len(acme.writes) == begun + 4)
    assert acme.writes[begun:] == [(SIZE, 0), (SIZE + 1, 0), (SIZE, 0), (SIZE + 1, 0x2000)]
    assert acme.hertz == -20.0


def test_a_refused_part_stops_the_motor(acme: Acme, bus: Bus) -> None:
    notes = Notes()
    drive = turning(acme, bus, notes)
    acme.fates[SIZE] = Refused(Refused.ILLEGAL_VALUE, 'not that')
    drive.set_setpoint(-35.0)
    notes.wait_for('it refused set-point -35: not that')
    wait_until(lambda: acme.registers[WORD] == REMOTE)
    assert not drive.armed


def test_it_follows_no_set_point_for_all(acme: Acme, bus: Bus) -> None:
    drive = turning(acme, bus, Notes())
    refused = said(drive.setpoint.why_not_shared('acme'))
    assert refused == 'acme takes a set-point in several writes'


@pytest.fixture
def bare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The same drive as a family that has no roles but those of its status."""
    folder = tmp_path / f'bare_{tmp_path.name}'
    shutil.copytree(Path(__file__).parent / 'made_up' / 'acme', folder)
    (folder / 'roles.csv').write_text(
        'role,parameter\nstatus_word,bus.told\nstatus_code,bus.code\n', encoding='utf-8'
    )
    monkeypatch.setattr(families, '__path__', [*families.__path__, str(tmp_path)])
    return folder.name


def test_a_role_that_is_missing_is_a_feature_that_it_lacks(
    acme: Acme, bus: Bus, bare: str
) -> None:
    notes = Notes()
    drive = turning(acme, bus, notes, model=bare)
    polls = len(notes.snapshots)
    wait_until(lambda: len(notes.snapshots) > polls + 20)
    assert drive.snapshot.connected and drive.armed
    assert math.isnan(drive.snapshot.speed) and math.isnan(drive.snapshot.frequency)
    # nothing says that it coasts
    assert drive.stop().result(PATIENCE).cause is not Cause.COASTING
    assert acme.hertz == 0


def test_a_family_without_a_status_code_is_none(bare: str, tmp_path: Path) -> None:
    roles = tmp_path / bare / 'roles.csv'
    roles.write_text('role,parameter\nstatus_word,bus.told\n', encoding='utf-8')
    with pytest.raises(CatalogError, match='status_code'):
        load_family(bare)
