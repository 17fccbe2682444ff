# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A family that is nothing but a folder: found, enabled, turned, reversed, faulted and stopped.

The Acme has big-endian numbers, a status word of its own, a set-point in packed decimal digits and
its direction in another register.
"""

from __future__ import annotations

from collections.abc import Callable
import dataclasses
import math
from pathlib import Path
import shutil
import struct
from typing import Any

from made_up_rig import FarEnd, MadeUpRig
import pytest
from support.said import raises

from nfo_sinus_driver import families
from nfo_sinus_driver.catalog import CatalogError, load_family
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.link import NoAnswer, Refused

RAMP, WORD, TURN, SIZE, STATUS, CODE, HERTZ, KIND = 10, 100, 101, 102, 200, 201, 202, 300
RESET, RUN, REMOTE = 1 << 3, 1 << 12, 1 << 15
RUNNING, TRIPPED, HAS_REMOTE = 1 << 5, 1 << 9, 1 << 13


class Acme(FarEnd):
    """An Acme."""

    def __init__(self) -> None:
        super().__init__(dict.fromkeys((*range(100, 104), *range(200, 205), KIND), 0))
        self.registers[RAMP] = 50
        #: What it follows after each write, Hz; what to do after the next one.
        self.followed: list[float] = []
        self.then: Callable[[], object] = lambda: None
        self.trip(0)

    def trip(self, code: int) -> None:
        """Let a fault happen, or end: 0."""
        word = self.registers[WORD]
        runs = word & RUN and word & REMOTE and not code
        status = HAS_REMOTE * bool(word & REMOTE) | RUNNING * bool(runs) | TRIPPED * bool(code)
        usual = (3 if runs else 2) if word & REMOTE else 1
        self.registers.update({STATUS: status, CODE: code or usual})
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
        return self.registers[CODE] if self.registers[STATUS] & TRIPPED else 0

    def was_written(self, before: dict[int, int]) -> None:
        """Reset a fault on the edge, and go on as the control word says."""
        reset = self.registers[WORD] & RESET and not before[WORD] & RESET
        self.trip(0 if reset else self.fault)
        self.followed.append(self.hertz)
        then, self.then = self.then, lambda: None
        then()


@pytest.fixture(autouse=True)
def _one_folder_more(monkeypatch: pytest.MonkeyPatch) -> None:
    more = str(Path(__file__).parents[1] / 'made_up')
    monkeypatch.setattr(families, '__path__', [*families.__path__, more])


class Bench(MadeUpRig):
    """An Acme and its driver."""

    def __init__(self, model: str = 'acme', **settings: Any) -> None:
        self.acme = Acme()
        settings = {'control_method': 'drive_control', **settings}
        super().__init__(self.acme, model, **settings)

    def turn_at(self, frequency: float) -> None:
        """Set this set-point, enabled before if need be."""
        if not self.drive.following:
            self.connect()
            self.enable()
        self.drive.set_setpoint(frequency)
        self.wait_until(lambda: self.acme.hertz == frequency, 5.0)
        self.pass_time(0.2)


def test_it_is_found() -> None:
    with Bench() as rig:
        assert rig.found == 'acme'


def test_one_without_an_identity_is_the_model_without_one() -> None:
    with Bench() as rig:
        del rig.acme.registers[KIND]
        assert rig.found == 'sinus_optimal'


def test_of_two_without_an_identity_the_user_has_to_choose(monkeypatch: pytest.MonkeyPatch) -> None:
    silent = dataclasses.replace(load_family('acme').profile, identified_by='')
    monkeypatch.setitem(load_family('acme').__dict__, 'profile', silent)
    with Bench() as rig, raises(Cause.SEVERAL_MODELS):
        _ = rig.found


def test_a_run() -> None:
    with Bench() as rig:
        acme = rig.acme
        rig.connect(parameters=True)
        assert dict(rig.drive.parameters.values) == {'ramp.up': 5.0}
        assert not acme.writes

        rig.enable()
        runs = acme.writes.index((WORD, REMOTE | RUN))
        # with control and set-point 0, and only then
        assert {(WORD, REMOTE), (TURN, 0), (SIZE, 0), (SIZE + 1, 0)} <= {*acme.writes[:runs]}
        assert acme.registers[STATUS] == HAS_REMOTE | RUNNING

        rig.turn_at(20.0)
        begun = len(acme.writes)
        rig.turn_at(-12.34)
        # the size is none before the direction changes
        none, size = [(SIZE, 0), (SIZE + 1, 0)], [(SIZE, 0), (SIZE + 1, 0x1234)]
        assert acme.writes[begun:] == [*none, (TURN, 1), *size]
        snapshot = rig.drive.snapshot
        assert (snapshot.actual, snapshot.setpoint, snapshot.text) == (-12.34, -12.34, 'Run')
        # what stands there already is not written again
        rig.turn_at(-50.0)
        assert acme.writes[begun + 5 :] == [(SIZE, 0), (SIZE + 1, 0x5000)]

        acme.trip(70)
        rig.pass_time(1.0)
        assert not rig.drive.following and acme.registers[WORD] == REMOTE
        assert rig.notes.said('Too hot. Let it cool')
        assert rig.answer(rig.drive.acknowledge()) == 'acknowledged 70 Hot'
        assert acme.hertz == 0

        rig.enable()
        rig.turn_at(-30.0)
        assert 'stopped' in rig.answer(rig.drive.stop())
        assert (acme.hertz, acme.registers[WORD]) == (0, REMOTE)
        assert 'released' in rig.answer(rig.drive.disconnect(1.0))
        assert acme.registers[WORD] == 0


def test_a_set_point_that_is_not_refreshed_ends_in_both_registers() -> None:
    with Bench(setpoint_timeout=0.2) as rig:
        rig.turn_at(-20.0)
        rig.pass_time(1.0)
        assert (rig.acme.hertz, rig.acme.registers[TURN]) == (0, 0)
        assert rig.drive.snapshot.setpoint == 0 and rig.drive.following
        rig.drive.set_setpoint(-5.0)
        rig.pass_time(0.1)
        assert -5.0 in rig.acme.followed


#: What goes wrong with a write: the register, the set-point, and what is written in all.
LOST: list[tuple[int, float, list[tuple[int, int]]]] = [
    # no motor is slowed down for it
    (SIZE, -30.0, [(SIZE, 0), (SIZE + 1, 0x3000)]),
    # after silence a direction is written again
    (TURN, 30.0, [(SIZE, 0), (SIZE + 1, 0), (TURN, 0), (SIZE, 0), (SIZE + 1, 0x3000)]),
]


def test_a_lost_answer_to_a_part_of_a_set_point() -> None:
    for register, wanted, written in LOST:
        with Bench() as rig:
            rig.turn_at(-20.0)
            rig.acme.fates[register] = NoAnswer('silence')
            begun = len(rig.acme.writes)
            rig.turn_at(wanted)
            assert rig.acme.writes[begun:] == written
            assert rig.drive.snapshot.setpoint == wanted


def test_no_size_is_followed_in_the_other_direction() -> None:
    wanted = [35.0, -12.5, -50.0, 50.0, 0.0, -1.0, 0.0, 1.0, -0.01, 400.0, -400.0]
    with Bench() as rig:
        rig.turn_at(-20.0)
        for before, value in zip([-20.0, *wanted], wanted, strict=False):
            rig.acme.followed.clear()
            rig.turn_at(value)
            assert rig.drive.snapshot.setpoint == value
            assert set(rig.acme.followed) <= {before, 0.0, value}, value


def test_a_newer_set_point_comes_between_the_writes_of_one() -> None:
    with Bench() as rig:
        rig.turn_at(-20.0)
        begun = len(rig.acme.writes)
        # when the size of -20 Hz is none, it is wanted once more, instead of 30 Hz
        rig.acme.then = lambda: rig.drive.set_setpoint(-20.0)
        rig.drive.set_setpoint(30.0)
        rig.pass_time(0.3)
        assert rig.acme.writes[begun:] == [
            (SIZE, 0), (SIZE + 1, 0), (SIZE, 0), (SIZE + 1, 0x2000),
        ]
        assert rig.acme.hertz == -20.0


def test_a_refused_part_stops_the_motor() -> None:
    with Bench() as rig:
        rig.turn_at(-20.0)
        rig.acme.fates[SIZE] = Refused(Refused.ILLEGAL_VALUE, 'not that')
        rig.drive.set_setpoint(-35.0)
        rig.pass_time(1.0)
        assert rig.notes.said('it refused set-point -35: not that')
        assert rig.acme.registers[WORD] == REMOTE and not rig.drive.following


@pytest.fixture
def bare(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The same drive as a family that has no roles but those of its status."""
    folder = tmp_path / f'bare_{tmp_path.name}'
    shutil.copytree(Path(__file__).parents[1] / 'made_up' / 'acme', folder)
    (folder / 'roles.csv').write_text(
        'role,parameter\nstatus_word,bus.status\nstatus_code,bus.code\n', encoding='utf-8'
    )
    monkeypatch.setattr(families, '__path__', [*families.__path__, str(tmp_path)])
    return folder.name


def test_a_role_that_is_missing_is_a_feature_that_it_lacks(bare: str) -> None:
    with Bench(bare) as rig:
        rig.turn_at(-20.0)
        rig.pass_time(2.0)
        assert rig.drive.snapshot.connected and rig.drive.following
        assert math.isnan(rig.drive.snapshot.speed) and math.isnan(rig.drive.snapshot.frequency)
        # nothing says that it coasts
        assert rig.result(rig.drive.stop()).cause is not Cause.COASTING
        assert rig.acme.hertz == 0


def test_a_family_without_a_status_code_is_none(bare: str, tmp_path: Path) -> None:
    roles = tmp_path / bare / 'roles.csv'
    roles.write_text('role,parameter\nstatus_word,bus.status\n', encoding='utf-8')
    with pytest.raises(CatalogError, match='status_code'):
        load_family(bare)


@pytest.mark.parametrize('key', ['bus.size', 'bus.kind'])
def test_a_profile_names_no_parameter_that_the_tables_lack(
    bare: str, tmp_path: Path, key: str
) -> None:
    profile = tmp_path / bare / 'profile.py'
    text = profile.read_text(encoding='utf-8')
    profile.write_text(text.replace(key, f'{key}_x'), encoding='utf-8')
    with pytest.raises(CatalogError, match=f'profile.py: no parameter is {key}_x'):
        load_family(bare)
