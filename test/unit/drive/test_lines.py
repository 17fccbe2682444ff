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
from support.line_laws import LineLaws
from support.line_runs import CALLS, HAPPENS, KINDS, LineRun
from support.own_timeout import by_default


@pytest.mark.parametrize('calls', ['no stop', 'stop all soon', 'end soon'])
@pytest.mark.parametrize('kind', ['rtu 1', 'rtu 2', 'rtu 3', 'rtu 8', 'rtu 16'])
@pytest.mark.parametrize('at', [0, 1, 2, 5])
def test_all_answers_are_lost_from_one_request_on(kind: str, calls: str, at: int) -> None:
    run(kind, 'all answers lost', calls, at)


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
            one['hex'] for one in rig.line.frames if one['hex'].startswith('0203')
        )
        for _ in range(4):
            rig.line.another_sends(bytes.fromhex(read_of_the_second), rig.clock.now)
            rig.line.go_to(rig.clock.now + 1.0)
        assert LineLaws(rig).still_turning() == ([1, 2] if any_counts else [2])
