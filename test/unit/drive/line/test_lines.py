# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Lines of several drives to which something happens: each motor stops, and what is told is true.

``support/line_laws.py`` has the laws, ``support/line_runs.py`` what happens and what is called for;
``make exhaustive`` has it happen at each request.
"""

from __future__ import annotations

import itertools
from zlib import crc32

import pytest
from support.drive_timeout import by_default, drive_timeout
from support.line_laws import LineLaws
from support.line_runs import CALLS, HAPPENS, KINDS, LineRun
from support.rig import Rig

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive.broadcast import broadcast_stop


@pytest.mark.parametrize('calls', ['no stop', 'stop all soon', 'end soon'])
@pytest.mark.parametrize('kind', ['rtu 1', 'rtu 2', 'rtu 3', 'rtu 8', 'rtu 16'])
@pytest.mark.parametrize('at', [0, 1, 2, 5])
def test_all_answers_are_lost_from_one_request_on(kind: str, calls: str, at: int) -> None:
    run(kind, 'all answers lost', calls, at)


def test_of_a_line_that_hears_no_write_no_stop_waits_for_vain_ones_of_others() -> None:
    # the set-points 0 that were in vain before are no tries of the stops
    run('rtu 8', 'writes unheard', 'no set-points', at=1)


@pytest.mark.parametrize('happens', HAPPENS)
@pytest.mark.parametrize('kind', KINDS)
def test_whatever_happens_to_a_line(kind: str, happens: str) -> None:
    # another call and another request for each
    turn = crc32(f'{kind}, {happens}'.encode())
    run(kind, happens, list(CALLS)[turn % len(CALLS)], at=turn % 13)


def run(kind: str, happens: str, calls: str, at: int) -> None:
    """Let something happen at a request (AssertionError: a law is broken)."""
    asked = itertools.count()
    LineRun(
        KINDS[kind], lambda key, writes: (happens, calls) if next(asked) == at else None
    ).run()


@pytest.mark.parametrize('any_counts', [False, True])
def test_a_drive_counts_any_message_or_those_to_it(any_counts: bool) -> None:
    with by_default('rtu', drives=2, line={'any_counts': any_counts}) as rig:
        rig.turn()
        rig.kill()
        read_of_the_second = next(
            frame['hex'] for frame in rig.line.frames if frame['hex'].startswith('0203')
        )
        for _ in range(4):
            rig.line.another_sends(bytes.fromhex(read_of_the_second), rig.clock.now)
            rig.line.go_to(rig.clock.now + 1.0)
        assert LineLaws(rig).still_turning() == ([1, 2] if any_counts else [2])


#: How much later than its own time-out a lost drive stands, s: its loss, two stops and the end of
#: its ramp come besides.
_LOST_BEFORE = 3.3


@pytest.mark.parametrize('any_counts', [False, True])
def test_a_drive_that_hears_reads_alone_is_stopped_by_its_own_time_out(any_counts: bool) -> None:
    with by_default('rtu', drives=2, line={'any_counts': any_counts}) as rig:
        rig.turn()
        begun = rig.clock.now
        rig.line.plan = lambda frame: 'drop' if frame[1] == 0x03 else 'unheard'
        rig.wait_until(lambda: not any(far.motor.driven for far in rig.fars.values()))
        assert rig.clock.now - begun < drive_timeout(rig) + _LOST_BEFORE


def test_no_poll_of_a_lost_drive_feeds_its_time_out_beside_one_that_answers() -> None:
    # longer than the longest pause between two polls of a lost one
    with Rig('rtu', drives=2, drive_timeout=8.0) as rig:
        rig.turn()
        begun = rig.clock.now
        lost = {0x03: 'drop'}
        rig.line.plan = lambda frame: (
            lost.get(frame[1], 'unheard') if rig.line.unit_of(frame) == 1 else None
        )
        rig.wait_until(lambda: not rig.turns)
        assert rig.clock.now - begun < drive_timeout(rig) + _LOST_BEFORE


def test_one_at_standstill_is_not_asked_while_the_time_out_of_another_runs() -> None:
    with by_default('rtu', drives=2, line={'any_counts': True}) as rig:
        rig.connect()
        rig.enable(1)
        rig.send(20.0, 1)
        rig.wait_until(lambda: rig.far.motor.frequency > 19.0)
        begun = rig.clock.now
        rig.line.plan = lambda frame: 'drop' if frame[1] == 0x03 else 'unheard'
        rig.wait_until(lambda: not rig.turns)
        assert rig.clock.now - begun < drive_timeout(rig) + _LOST_BEFORE


def test_a_line_with_a_drive_that_answers_is_not_quiet_for_another() -> None:
    with by_default('rtu', drives=2) as rig:
        rig.turn()
        rig.line.plan = lambda frame: 'drop' if rig.line.unit_of(frame) == 1 else None
        rig.pass_time(drive_timeout(rig) + 2 * _LOST_BEFORE)
        assert not rig.fars[2].faults and rig.drives[2].following


def test_a_drive_whose_time_out_has_struck_while_the_driver_stood_still_is_stopped() -> None:
    with by_default('rtu') as rig:
        rig.turn()
        rig.line.go_to(rig.clock.now + drive_timeout(rig) + 0.5)
        rig.pass_time(0.3)
        assert rig.notes.said(Cause.DRIVER_PAUSED)


def test_behind_a_port_that_is_back_where_it_was_one_look_goes_before_a_stop() -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state = 'gone'
        rig.pass_time(4.0)
        rig.asked.clear()
        rig.line.mend()
        rig.wait_until(lambda: not rig.turns)
        before = list(itertools.takewhile(lambda request: request[2] is None, rig.asked))
        assert len(before) <= 2, before


def test_one_that_does_not_tell_its_firmware_any_more_is_stopped_by_its_status() -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(5.0)
        rig.meet = lambda key, data: 'refused' if key == 'fieldbus.sw_ver' else None
        rig.line.mend()
        rig.wait_until(lambda: not rig.turns, 4.0)


@pytest.mark.parametrize(('connection', 'call'), [
    # SEW MOVITRAC and telegram 1 have the rapid stop
    ('rtu', 'quick_stop'), ('movitrac', 'rapid_stop'), ('rtu', 'rapid_stop'),
    ('classic', 'broadcast_stop'), ('rtu', 'stop'),
])
def test_a_stop_that_is_called_for_again_and_again_keeps_no_other_back(
    connection: str, call: str
) -> None:
    # a node that calls until one succeeds
    with Rig(connection, drives=3) as rig:
        rig.turn()
        rig.line.state = 'silent'
        for drive in rig.drives.values():
            drive.stop()
        for _ in range(60):
            if call == 'broadcast_stop':
                broadcast_stop(rig.bus, rig.drives.values())
            else:
                getattr(rig.drives[1], call)()
            rig.pass_time(0.02)
        rig.pass_time(1.5)
        rig.line.mend()
        # longer than the longest pause between two looks at a lost one
        rig.wait_until(lambda: not rig.turns, 2.0)
