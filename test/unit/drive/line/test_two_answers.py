# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Each request is answered twice: by a repeater, or by two drives at one address."""

from __future__ import annotations

import math
from pathlib import Path
from random import Random
from typing import Any

import pytest
from support.belief import Judge
from support.described import DescribedRig
from support.oddities import described
from support.rig import Rig
from support.stops import takes_run_away

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.simulator.family import simulated_drive

LINES = ('rtu', 'ascii', 'classic', 'movitrac', 'optimal', 'described')


def repeat(rig: Rig, *seconds: float) -> None:
    """Have each answer come again so long after its end, s; one of these, by chance."""
    line = rig.line
    alter, send = line.wire.faults.alter, line.send
    random = Random(0)
    expected: list[bytes] = []
    came = b''

    def noted(address: int, frame: bytes, instead: Any) -> list[Any]:
        replies: list[Any] = alter(address, frame, instead)
        expected.extend(reply.data for reply in replies)
        return replies

    def sent(data: bytes) -> None:
        nonlocal came
        send(data)
        came += data
        if expected and came.endswith(expected[0]):
            frame, came = expected.pop(0), b''
            end = random.choice(seconds) + line.settings.frame_gap
            end += len(frame) * line.settings.char_time
            line.later(rig.clock.now + end, lambda: again(frame))

    def again(frame: bytes) -> None:
        if came:
            # the drive is answering
            line.later(rig.clock.now + 0.0005, lambda: again(frame))
        else:
            send(frame)

    line.wire.faults.alter = noted
    line.send = sent  # type: ignore[method-assign]


class Told:
    """
    What is believed, and when it is told that answers come twice.

    :ivar at: when it was; infinity: it was not.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self.judge = Judge(rig)
        self.at = math.inf
        self.looked = rig.looked
        rig.looked = self.look

    def look(self) -> None:
        self.looked()
        if any('twice' in remark for remark in self._rig.bus.remarks):
            self.at = min(self.at, self._rig.clock.now)

    @property
    def false(self) -> list[tuple[float, str]]:
        """What was false from then on."""
        return [answer for answer in self.judge.false if answer[0] > self.at]


def running(connection: str, *seconds: float) -> tuple[Rig, Told]:
    """Return a drive that turns, whose answers come twice from then on."""
    rig = Rig(connection, poll_rate=20.0)
    rig.turn()
    rig.notes.snapshots.clear()
    told = Told(rig)
    repeat(rig, *seconds)
    return rig, told


@pytest.mark.parametrize('seconds', [0.0, 0.0007, 0.004, 0.011, 0.03, 0.06, 0.09, 0.3, 0.7])
@pytest.mark.parametrize('connection', LINES)
def test_nothing_is_believed_that_was_not_said(connection: str, seconds: float) -> None:
    rig, told = running(connection, seconds, 1.1 * seconds)
    rig.pass_time(20.0)
    assert not told.false
    # two in a row are told
    assert told.at < math.inf or len(told.judge.false) < 2
    assert not rig.notes.said(Cause.CHANGED_AT_DRIVE)
    if seconds < 0.1:
        # none is so late that no silence helps: the motor runs on
        shown = [snapshot for snapshot in rig.notes.snapshots if abs(snapshot.frequency - 20) < 0.3]
        assert len(shown) > 15
        assert rig.turns
    assert_stopped(rig)


def assert_stopped(rig: Rig) -> None:
    """Have it stopped: the stop waits for no second answer."""
    called = rig.clock.now
    stop = rig.drive.stop()
    rig.wait_until(lambda: rig.line.sent_at > called or not rig.turns, 0.35)
    rig.wait_until(lambda: not rig.turns, 3.0)
    rig.answer(stop)
    rig.kill()


@pytest.mark.parametrize('seconds', [0.004, 0.03, 0.09])
@pytest.mark.parametrize(
    'connection',
    [
        'rtu', 'classic', 'described', 'optimal',
        # what they stop by is read before
        'optimal, control word', 'classic, control word',
    ],
)
def test_on_a_line_of_eight_no_stop_waits_for_a_second_answer(
    connection: str, seconds: float
) -> None:
    rig = Rig(connection, drives=8, poll_rate=20.0)
    rig.turn()
    repeat(rig, seconds)
    rig.pass_time(6.0)
    rig.asked.clear()
    stops = [drive.stop() for drive in rig.drives.values()]

    def stopped() -> set[int]:
        return {at for at, key, data in rig.asked if takes_run_away(rig, key, data)}

    # the rest of the request under way, and eight requests with their silence; on Classic what is
    # read before is certain at once
    most = 1.0 if connection == 'classic, control word' else 0.5
    rig.wait_until(lambda: stopped() == set(rig.drives), most)
    for stop in stops:
        rig.answer(stop)
    rig.kill()


def words(rig: Rig) -> set[tuple[int, int]]:
    """Return which words were written to register 10 of which unit."""
    return {(unit, rig.number(data)) for unit, key, data in rig.asked if data and 'r000a' in key}


@pytest.mark.parametrize('drives', [1, 4])
@pytest.mark.parametrize('seconds', [0.004, 0.03, 0.09])
def test_a_stop_that_has_to_be_read_before_is_written_all_the_same(
    tmp_path: Path, seconds: float, drives: int
) -> None:
    register = {'register': 10}
    control = {
        'run': [{**register, 'set': 1, 'clear': 2}],
        # what else is in the register has to stay: it cannot be written without being read
        'stop': [{**register, 'set': 2, 'clear': 1}],
    }
    rig = DescribedRig(described(tmp_path, control=control), drives=drives, poll_rate=20.0)
    rig.turn()
    repeat(rig, seconds)
    rig.pass_time(6.0)
    rig.asked.clear()
    stops = [drive.stop() for drive in rig.drives.values()]
    removed = {(unit, 2) for unit in rig.drives}
    rig.wait_until(lambda: removed <= words(rig), 2.0)
    for stop in stops:
        rig.answer(stop)
    rig.kill()


def test_a_stop_leaves_what_else_is_in_a_register(tmp_path: Path) -> None:
    register = {'register': 10}
    control = {'run': [{**register, 'set': 0x81}], 'stop': [{**register, 'clear': 0x01}]}
    rig = DescribedRig(described(tmp_path, control=control), poll_rate=20.0)
    rig.turn()
    repeat(rig, 0.03)
    rig.pass_time(6.0)
    rig.asked.clear()
    rig.answer(rig.drive.stop())
    assert words(rig) == {(1, 0x80)}
    rig.kill()


def test_an_ordinary_stop_of_a_movitrac_stays_one() -> None:
    rig = Rig('movitrac', poll_rate=20.0)
    rig.turn()
    repeat(rig, 0.03)
    rig.pass_time(6.0)
    rig.asked.clear()
    rig.answer(rig.drive.stop())
    bits = [rig.number(data) for _, key, data in rig.asked if data and 'function_bits' in key]
    # without Enable it would be a rapid one
    assert bits and all(number & 0x04 for number in bits)
    rig.kill()


@pytest.mark.parametrize('seconds', [0.0, 0.004, 0.03, 0.09])
@pytest.mark.parametrize('connection', LINES)
def test_a_drive_is_connected_read_and_enabled(connection: str, seconds: float) -> None:
    rig = Rig(connection, poll_rate=20.0)
    told = Told(rig)
    repeat(rig, seconds, 1.1 * seconds)
    rig.connect(parameters=seconds < 0.05)
    rig.wait_until(lambda: 'enabled' in rig.answer(rig.drive.enable()), 30.0)
    rig.send(20.0)
    rig.pass_time(3.0)
    assert rig.turns
    assert not told.false
    assert_stopped(rig)


@pytest.mark.parametrize('connection', LINES)
def test_of_two_drives_at_one_address_nothing_is_believed(connection: str) -> None:
    rig = Rig(connection, poll_rate=20.0)
    rig.turn()
    told = Told(rig)
    other = simulated_drive(rig.connection.model, 1, boot_time=0.0)
    other.step = 0.02
    other.control_unit.set_to([(rig.line._end.spoken, rig.line._end.timing)])
    other.advance_to(rig.clock.now)
    rig.line.wire.stations.append(other)
    rig.pass_time(20.0)
    assert told.at < math.inf
    assert not told.false
    if connection not in ('classic', 'movitrac'):
        assert rig.notes.said('answered twice, and not alike')
    assert_stopped(rig)
