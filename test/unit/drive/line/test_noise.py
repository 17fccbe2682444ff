# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Noise is waited out: nothing is stopped by it that answers again within ``lost_after``."""

from __future__ import annotations

from collections.abc import Callable
import random
from typing import Any

import pytest
from support.rig import CONNECTIONS, Rig
from support.variants import stopping_at_timeout

from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN
from nfo_sinus_driver.simulator.motor import Motor

#: The driver gave the motor up, whether or not it could say so to the drive.
_ENDS = ('lost: ', 'stopped: ', 'stopping: ')
#: A MOVITRAC is asked seldom, may answer 0.2 s late (P843), and its answers name no drive.
LINES: dict[str, tuple[str, dict[str, Any]]] = {
    'rtu': ('rtu', {}),
    'rtu 19200': ('rtu', {'baud': 19200}),
    'classic': ('classic', {}),
    'movitrac': ('movitrac', {}),
}
#: How long an answer is waited for at most, s.
_WAIT = {'movitrac': 0.4}
_each_line = pytest.mark.parametrize('line', LINES)


def made(line: str = 'rtu', **settings: Any) -> Rig:
    connection, options = LINES[line]
    return Rig(connection, line=options, **settings)


def ends(rig: Rig) -> list[str]:
    """Return why the driver gave the motor up since the run began, each time."""
    return [event.text for event in rig.notes.events if event.text.startswith(_ENDS)]


def drown(rig: Rig, seconds: float, after: float = 0.0) -> None:
    """Let nothing get through for a while, either way."""
    rig.pass_time(after)
    rig.line.wire.faults.dead_until = rig.clock.now + seconds


def published(rig: Rig, since: float) -> list[float]:
    """Return when a status of a connected drive was measured since then."""
    statuses = [snapshot.status for snapshot in rig.notes.snapshots]
    return [status.at for status in statuses if status and status.at >= since]


def _goes_on(motor: Motor) -> bool:
    return motor.driven and bool(motor.demand)


def damage(share: float) -> Callable[[bytes], str | None]:
    chance = random.Random(7)
    return lambda frame: 'damage' if chance.random() < share else None


@_each_line
@pytest.mark.parametrize(('share', 'most'), [(0.03, 0), (0.1, 2)])
def test_damaged_answers_stop_nothing(line: str, share: float, most: int) -> None:
    with made(line, drive_timeout=1.5, poll_rate=5.0, telemetry_rate=0.0) as rig:
        rig.turn()
        # not the same series again after each stop
        rig.line.plan = noise = damage(share)
        stops = 0
        for _ in range(6):
            rig.pass_time(10.0)
            if ends(rig):
                stops += 1
                rig.notes.events.clear()
                rig.line.plan = lambda frame: None
                rig.pass_time(3.0)
                rig.enable()
                rig.line.plan = noise
        assert stops <= most
        assert not rig.far.faults


@_each_line
@pytest.mark.parametrize('length', [0.3, 0.8, 0.99])
@pytest.mark.parametrize('timeout', [1.5, AS_THE_DRIVE_CAN], ids=['the shortest', 'default'])
def test_a_burst_shorter_than_lost_after_stops_nothing(
    line: str, length: float, timeout: float
) -> None:
    connection = CONNECTIONS[LINES[line][0]]
    stops = stopping_at_timeout(connection.model, connection.method)
    with made(line, drive_timeout=timeout, parameters=stops) as rig:
        rig.turn()
        assert rig.drive.state.timeout.seconds == (2.0 if timeout < 0 else timeout)
        for number in range(10):
            # at another moment of the round each time
            drown(rig, length, after=0.1 + 0.0154 * number)
            rig.pass_time(2.0)
            assert not ends(rig)
            assert rig.drive.following
            assert not rig.far.faults


@_each_line
def test_after_a_burst_it_is_asked_and_the_first_status_comes_at_once(line: str) -> None:
    late = []
    with made(line, drive_timeout=2.0) as rig:
        rig.turn()
        for number, length in enumerate((0.05, 0.1, 0.2, 0.4, 0.7, 1.0) * 2):
            drown(rig, length, after=0.1 + 0.0117 * number)
            end = rig.clock.now + length
            rig.pass_time(length + 2.0)
            asked = min(
                frame['first']
                for frame in rig.line.frames
                if frame['direction'] == 'request' and frame['first'] >= end
            )
            if asked - end > _WAIT.get(line, 0.2) + 0.05:
                late.append((length, 'asked', asked - end))
            if (came := min(published(rig, asked))) - asked > 0.2:
                late.append((length, 'published', came - asked))
            assert not ends(rig)
    assert not late


def test_a_drive_that_is_lost_is_asked_again_before_its_own_time_out_strikes() -> None:
    with made(drive_timeout=2.5) as rig:
        rig.turn()
        for number in range(5):
            drown(rig, 2.2, after=0.1 + 0.006 * number)
            rig.pass_time(5.0)
            assert ends(rig)[0].startswith('lost: ')
            assert not rig.far.faults
            rig.enable()
            rig.pass_time(1.0)
            rig.notes.events.clear()


def test_without_an_answer_it_is_lost_after_the_time_set() -> None:
    wrong = {}
    for lost_after in (0.5, 1.0, 3.0):
        with made(lost_after=lost_after) as rig:
            rig.turn()
            begin = rig.clock.now
            rig.line.state = 'silent'
            rig.pass_time(lost_after + 1.0)
            (lost_at,) = [at for at, _, text in rig.notes.events if text.startswith('lost: ')]
            # from the first request in vain, but for a moment, to the end of the one under way then
            if not lost_after + 0.1 <= lost_at - begin <= lost_after + 0.45:
                wrong[lost_after] = lost_at - begin
            assert not rig.drive.following
    assert not wrong


def test_one_damaged_answer_in_each_round_is_no_loss() -> None:
    # 81 of 84 requests were answered, and the drive was "lost"
    with made(setpoint_timeout=0.0) as rig:
        rig.turn()
        asked: list[str] = []
        spoiled = 0

        def spoil(key: str, data: bytes | None) -> str | None:
            nonlocal spoiled
            if data is None and key in ('status.frq_act', 'status.spd_act'):
                asked.append(key)
                # the speed of each round, but not when that one read is repeated
                if asked[-2:] == ['status.frq_act', 'status.spd_act']:
                    spoiled += 1
                    return 'damage'
            return None

        before = len(rig.notes.snapshots)
        rig.meet = spoil
        rig.pass_time(6.0)
        assert spoiled > 10
        assert not ends(rig)
        # and each round was published, with the speed
        seen = rig.notes.snapshots[before:]
        assert len(seen) >= spoiled - 1
        assert all(snapshot.connected and snapshot.speed == snapshot.speed for snapshot in seen)


@pytest.mark.parametrize('key', ['status.frq_act', 'fieldbus.inv_st'])
def test_one_read_that_never_comes_whole_leaves_no_motor_unwatched(key: str) -> None:
    with made() as rig:
        rig.turn()
        # all else is answered, so it is never silent
        rig.meet = lambda asked, data: 'damage' if asked == key and data is None else None
        rig.pass_time(0.3)
        rig.send(0.0)
        rig.pass_time(5.0)
        assert abs(rig.far.motor.frequency) < 0.2
        rig.send(20.0)
        rig.far.trip(3)
        rig.pass_time(5.0)
        assert not rig.drive.following


def test_a_stop_that_is_never_answered_leaves_the_line_to_others_too() -> None:
    with made() as rig:
        rig.turn()
        # none of its steps is
        rig.meet = lambda key, data: None if data is None else 'damage'
        stop = rig.drive.stop()
        rig.pass_time(3.0)
        assert stop.exception() is not None
        seen = len(rig.notes.snapshots)
        rig.pass_time(5.0)
        assert len(rig.notes.snapshots) >= seen + 5
        rig.meet = lambda key, data: None
        rig.pass_time(1.0)
        assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('poll_rate', [0.2, 0.5, 2.0])
def test_a_drive_that_is_seldom_asked_is_not_lost_for_that(poll_rate: float) -> None:
    with made(poll_rate=poll_rate, telemetry_rate=0.0) as rig:
        rig.connect()
        rig.pass_time(0.3)
        rig.notes.events.clear()
        for number in range(8):
            # some of them take a poll, others none
            drown(rig, 0.7, after=0.11 * number)
            rig.pass_time(7.0)
        assert not ends(rig)
        # silence is another thing, and counts from the first request without an answer
        rig.line.state = 'silent'
        rig.pass_time(1 / poll_rate + 1.5)
        assert len(ends(rig)) == 1


#: How soon a stop takes effect by which share of damaged bytes, s; docs/serial_line.md has them.
IN_NOISE = {0.02: 2.0, 0.05: 4.0, 0.1: 8.0, 0.2: 60.0}
#: The same of lines with longer frames; none where there is no bound.
_ON = {'movitrac': {0.2: None}, 'classic': {0.1: 12.0, 0.2: None}}


@pytest.mark.parametrize('share', IN_NOISE)
@pytest.mark.parametrize('connection', ['rtu', 'optimal', 'classic', 'movitrac', 'described'])
def test_a_stop_takes_effect_in_noise_that_has_gone_on_for_a_while(
    connection: str, share: float
) -> None:
    longest = _ON.get(connection, {}).get(share, IN_NOISE[share])
    if longest is None:
        pytest.skip('too few of its frames arrive whole')
    for seed in range(5):
        line = {'baud': 19200} if connection in ('rtu', 'optimal') else {}
        rig = Rig(connection, line=line, poll_rate=50.0)
        rig.turn()
        rig.line.damage_bytes(share, seed)
        rig.pass_time(2.0)
        rig.drive.stop()
        rig.wait_until(lambda rig=rig: not rig.turns, longest)
        rig.kill()


@pytest.mark.parametrize('connection', ['optimal', 'described'])
def test_in_noise_no_stop_waits_for_those_of_drives_that_answer_more(connection: str) -> None:
    drives, share = 4, 0.05
    for seed in range(10):
        rig = Rig(connection, drives=drives, line={'baud': 19200}, poll_rate=50.0)
        rig.turn()
        rig.line.damage_bytes(share, seed)
        rig.pass_time(0.3)
        for drive in rig.drives.values():
            drive.stop()
        for far in rig.fars.values():
            rig.wait_until(
                lambda far=far: not (far.motor.driven and far.motor.demand),
                1.5 * IN_NOISE[share],
            )
        rig.kill()


def test_in_noise_the_stops_of_a_long_line_share_the_time() -> None:
    took = []
    for seed in range(8):
        rig = Rig('optimal', drives=8, line={'baud': 19200}, poll_rate=50.0)
        rig.turn()
        rig.line.damage_bytes(0.05, seed)
        rig.pass_time(0.3)
        began = rig.clock.now
        for drive in rig.drives.values():
            drive.stop()
        motors = [far.motor for far in rig.fars.values()]
        rig.wait_until(lambda motors=motors: not any(map(_goes_on, motors)))
        took.append(rig.clock.now - began)
        rig.kill()
    # one run is a matter of luck: where those that answer go first the mean is 4.7 s
    assert sum(took) / len(took) < 2.5, took
