# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A family whose status is one word, which says that the motor runs until it stands.

The Bolt tells its code in that word, stores who has control, is refused by a terminal that is
closed, has a time-out that always stops, and runs in one direction.
"""

from __future__ import annotations

from collections.abc import Callable
import dataclasses
import math
from pathlib import Path
import shutil
from typing import Any

from made_up_rig import FarEnd, MadeUpRig
import pytest
from support.said import raises

from nfo_sinus_driver import families
from nfo_sinus_driver.catalog import CatalogError, load_family
from nfo_sinus_driver.drive import Cause, DriveSettings
from nfo_sinus_driver.drive.known.settings import AUTO

MADE_UP = Path(__file__).parents[1] / 'made_up'
PATIENT, SOURCE, BITS, SIZE, STATUS, INPUTS, HERTZ, TURNS = 11, 12, 100, 102, 400, 402, 403, 404
RUN, RESET = 1 << 0, 1 << 3
RUNNING, TRIPPED, BACKWARDS = 1 << 0, 1 << 1, 1 << 3


class Bolt(FarEnd):
    """A Bolt; its ramp goes on by a step whenever its frequency is read."""

    def __init__(self) -> None:
        super().__init__(dict.fromkeys((10, PATIENT, SOURCE, BITS, SIZE, *range(STATUS, 405)), 0))
        self.registers[10] = 50
        #: By how much the frequency changes each time, 0.01 Hz; which fault is active.
        self.step = 100
        self.fault = 0
        #: It goes on as before, whatever is written.
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
        registers[STATUS] = self.fault or (2 if runs else 1)
        facts = RUNNING * bool(runs) | TRIPPED * bool(self.fault)
        registers[STATUS + 1] = facts | BACKWARDS * self.backwards

    def was_written(self, before: dict[int, int]) -> None:
        if self.registers[BITS] & RESET and not before[BITS] & RESET:
            self.fault = 0
        if not self.deaf:
            runs = self.registers[BITS] & RUN and self.registers[SOURCE] and not self.fault
            self._demand = self.registers[SIZE] if runs else 0


@pytest.fixture(autouse=True)
def _more_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(families, '__path__', [*families.__path__, str(MADE_UP)])


class Bench(MadeUpRig):
    """A Bolt and its driver."""

    def __init__(self, **settings: Any) -> None:
        self.bolt = Bolt()
        super().__init__(self.bolt, 'bolt', **settings)

    def turn_at_40(self) -> None:
        self.connect(parameters=True)
        self.enable()
        self.drive.set_setpoint(40.0)
        self.wait_until(lambda: self.bolt.hertz == 40.0)
        self.pass_time(0.2)


def test_it_is_found() -> None:
    with Bench() as rig:
        assert rig.found == 'bolt'


def test_the_usual_control_method_is_that_of_the_family() -> None:
    g2 = DriveSettings(model='sinus_g2')
    assert g2.method == 'mode_scmd'
    # what was not chosen is not kept when the model turns out to be another
    assert dataclasses.replace(g2, model='bolt').method == 'function_bits'
    assert DriveSettings(model=AUTO).method == ''
    with pytest.raises(ValueError, match="control_method 'mode_scmd': choose one of"):
        DriveSettings(model='bolt', control_method='mode_scmd')


def test_a_status_is_one_read_and_the_frequency_comes_with_it() -> None:
    with Bench() as rig:
        rig.turn_at_40()
        snapshot = rig.drive.snapshot
        seen = snapshot.status
        assert seen is not None
        assert (seen.code, snapshot.text, seen.word) == (2, 'Run', 2 << 16 | RUNNING)
        # the code is not published a second time
        assert seen.shown_word == RUNNING
        assert (snapshot.frequency, snapshot.actual) == (40.0, 40.0)
        rig.bolt.reads.clear()
        rig.pass_time(2.0)
        reads = [number for number in rig.bolt.reads if number in (STATUS, HERTZ)]
        # it may be in the midst of one when it is begun to be counted
        reads = reads[reads.index(STATUS) :]
        assert len(reads) > 30
        assert reads[: len(reads) // 2 * 2] == [STATUS, HERTZ] * (len(reads) // 2)


def test_the_word_has_the_sign_of_what_is_measured() -> None:
    with Bench() as rig:
        rig.turn_at_40()
        rig.bolt.registers[TURNS] = 1200
        rig.pass_time(2.0)
        assert (rig.drive.snapshot.frequency, rig.drive.snapshot.speed) == (40.0, 1200.0)
        rig.bolt.backwards = True
        rig.wait_until(lambda: rig.drive.snapshot.speed < 0, 0.3)
        assert rig.drive.snapshot.frequency == pytest.approx(-rig.bolt.hertz, abs=2.0)
        assert rig.drive.snapshot.speed == -1200.0
        # in size it has hardly changed
        assert rig.drive.snapshot.status.driven


def test_who_has_control_is_asked_now_and_then() -> None:
    with Bench(poll_rate=50.0) as rig:
        rig.turn_at_40()
        for enabled, least in ((True, 3), (False, 10)):
            rig.bolt.reads.clear()
            rig.wait_until(lambda: rig.bolt.reads.count(SOURCE) > 1)
            asked = [number for number in rig.bolt.reads if number in (STATUS, SOURCE)]
            first = asked.index(SOURCE)
            # not with every status
            assert asked.index(SOURCE, first + 1) - first > least
            assert rig.drive.snapshot.enabled == enabled
            rig.answer(rig.drive.stop())
            rig.pass_time(0.5)
        rig.turn_at_40()
        rig.bolt.registers[SOURCE] = 0
        rig.pass_time(5.0)
        assert rig.notes.said(Cause.OTHERS_IN_CONTROL)
        assert not rig.drive.snapshot.enabled


def falls(rig: Bench) -> None:
    """It falls before the stop, and no more after it."""
    rig.bolt.step = 5
    rig.drive.set_setpoint(20.0)
    rig.wait_until(lambda: rig.bolt.hertz < 35)
    rig.bolt.step = 0


def wobbles(rig: Bench) -> None:
    rig.bolt.step, rig.bolt.wobble = 0, 5


def is_not_known(rig: Bench) -> None:
    rig.meet = lambda key, data: 'refused' if key == 'status.hertz' else None
    rig.pass_time(2.0)
    assert math.isnan(rig.drive.snapshot.frequency)


@pytest.mark.parametrize('frequency', [falls, wobbles, is_not_known])
def test_a_frequency_that_does_not_fall_after_the_stop_confirms_nothing(
    frequency: Callable[[Bench], None],
) -> None:
    with Bench() as rig:
        rig.turn_at_40()
        frequency(rig)
        rig.bolt.deaf = True
        with raises(Cause.STOP_UNCONFIRMED):
            rig.result(rig.drive.stop())
        rig.pass_time(1.0)
        assert rig.notes.said('CANNOT STOP THE MOTOR')
        rig.bolt.deaf, rig.bolt.step, rig.bolt.wobble = False, 5, 0
        rig.meet = lambda key, data: None
        rig.pass_time(5.0)
        assert not rig.drive.stop_unconfirmed
        assert rig.bolt.registers[BITS] == 0


def test_what_is_stored_is_written_once_and_reported_and_kept() -> None:
    with Bench() as rig:
        rig.turn_at_40()
        assert rig.notes.said(
            'bus.source (SOURCE) was changed to take control, and stays so: '
            'terminals -> line'
        )
        rig.answer(rig.drive.stop())
        rig.enable()
        assert rig.bolt.writes.count((SOURCE, 1)) == 1
        answer = rig.answer(rig.drive.disconnect(4.0))
        assert Cause.CONTROL_KEPT in answer.causes
        assert answer.endswith(
            'the bus keeps control: SOURCE is stored; set it to terminals at the keypad'
        )
        assert (rig.bolt.hertz, rig.bolt.registers[BITS], rig.bolt.registers[SOURCE]) == (0, 0, 1)


def test_a_time_out_that_always_stops_needs_nothing_else() -> None:
    with Bench(drive_timeout=4.0).connect() as rig:
        rig.result(rig.drive.enable())
        assert rig.bolt.registers[PATIENT] == 40
        assert rig.drive.state.timeout.seconds == 4.0 and rig.drive.state.timeout.stops_motor
        assert not rig.notes.said('time-out of its own')
    with Bench().connect() as rig:
        assert rig.notes.said('no time-out of its own (T BUS is 0, and')


def test_a_set_point_is_limited_to_the_one_direction() -> None:
    with Bench() as rig:
        rig.turn_at_40()
        rig.drive.set_setpoint(-5.0)
        rig.pass_time(5.0)
        assert rig.bolt.hertz == 0
        assert rig.notes.said('set-point -5 is limited to 0')
        assert rig.drive.following and rig.drive.snapshot.setpoint_clamped


def test_what_a_drive_cannot_measure_is_its_familys() -> None:
    bolt, acme = load_family('bolt'), load_family('acme')
    assert bolt.can_be('status.hertz', 119.0) and not bolt.can_be('status.hertz', -121.0)
    assert acme.can_be('status.hertz', 400.0)
    # neither a word whose code the manual lacks
    assert bolt.can_be('bus.status', 145 << 16) and not bolt.can_be('bus.status', 7 << 16)


@pytest.mark.parametrize('role', ['status_word', 'actual_frequency'])
def test_what_shows_whether_it_runs_has_to_be_there(
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
