# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""When a drive is polled and what that does is decided in one place, by what is known of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive.watch.poll_plan import PollPlan, Turn

_NOW = 100.0


def plan(
    *,
    connected: bool = True,
    responsive: bool = True,
    behind_plc: bool = False,
    missed: bool = False,
    waits: bool = False,
    stopping: bool = False,
    following: bool = False,
    enabled: bool = False,
    may_run_again: str = '',
    frequency: float = 0.0,
    driven: bool = False,
    own_timeout: float = 0.0,
    plc_time: float = 0.0,
    active: bool = True,
    reads_another: bool = False,
    idle_rate: float = 0.0,
    failed: int = 0,
) -> PollPlan:
    """Return the plan of a drive of which this is known, polled ten times a second."""
    owed = stopping or enabled
    state: Any = SimpleNamespace(
        bus=SimpleNamespace(now=lambda: _NOW, reads_another_first=lambda unit: reads_another),
        contact=SimpleNamespace(
            connected=connected,
            responsive=responsive,
            behind_plc=behind_plc,
            missed_since_poll=missed,
        ),
        control=SimpleNamespace(stopping=stopping, stop_owed=owed, enabled=enabled),
        settings=SimpleNamespace(poll_rate=10.0, idle_poll_rate=idle_rate, address=1),
        timeout=SimpleNamespace(seconds=own_timeout),
        plc_time=plc_time,
        model=SimpleNamespace(profile=SimpleNamespace(may_run_again=bool(may_run_again))),
        measurements=SimpleNamespace(frequency=frequency, speed=frequency * 30),
        status=SimpleNamespace(driven=driven),
        pause_before_timeout=lambda pause, seconds: min(pause, seconds or pause),
    )
    setpoint: Any = SimpleNamespace(following=following)
    controller: Any = SimpleNamespace(waits_to_look=waits)
    made = PollPlan(state, setpoint, controller)
    made.set_active(active)
    for _ in range(failed):
        made.connecting_failed()
    return made


@pytest.mark.parametrize(
    ('known', 'since', 'turn', 'pause'),
    [
        # connected: a poll when it is due, its status between two
        ({}, 0.1, Turn.POLL, 0.0),
        ({}, 0.02, Turn.STATUS, 0.08),
        ({'active': False}, 0.1, Turn.STATUS, 0.4),
        ({'active': False, 'own_timeout': 0.9}, 0.1, Turn.STATUS, 0.2),
        ({'active': False, 'plc_time': 0.6}, 0.1, Turn.STATUS, 0.1),
        # a motor that runs, or is to stop, is watched however low the rate
        ({'active': False, 'following': True}, 0.1, Turn.STATUS, 0.2),
        ({'active': False, 'stopping': True}, 0.1, Turn.STATUS, 0.2),
        ({'active': False, 'following': True, 'may_run_again': 'x'}, 0.1, Turn.STATUS, 0.1),
        # an idle one gives its time to others
        ({'idle_rate': 1.0}, 0.5, Turn.STATUS, 0.5),
        ({'idle_rate': 1.0, 'driven': True}, 0.5, Turn.POLL, -0.4),
        ({'idle_rate': 1.0, 'frequency': 1.0}, 0.5, Turn.POLL, -0.4),
        ({'idle_rate': 1.0, 'enabled': True}, 0.5, Turn.POLL, -0.4),
        ({'reads_another': True}, 0.5, Turn.STATUS, 1.5),
        ({'reads_another': True, 'enabled': True}, 0.5, Turn.POLL, -0.4),
        # lost: looked for more and more seldom
        ({'connected': False}, 9.0, Turn.CONNECT, 0.0),
        ({'connected': False, 'failed': 2}, 9.0, Turn.CONNECT, 2.0),
        ({'connected': False, 'failed': 9}, 9.0, Turn.CONNECT, 4.0),
        ({'connected': False, 'failed': 9, 'own_timeout': 1.5}, 9.0, Turn.CONNECT, 1.5),
        ({'connected': False, 'failed': 9, 'behind_plc': True}, 9.0, Turn.CONNECT, 0.1),
        # and left alone while its stop waits for a look
        ({'connected': False, 'failed': 9, 'waits': True}, 9.0, Turn.WAIT, 0.2),
        ({'connected': False, 'waits': True, 'behind_plc': True}, 9.0, Turn.CONNECT, 0.0),
    ],
)
def test_turn_and_pause(known: dict[str, Any], since: float, turn: Turn, pause: float) -> None:
    made = plan(**known)
    assert made.turn(_NOW - since) is turn
    assert made.pause(_NOW - since) == pytest.approx(pause)


@pytest.mark.parametrize(
    ('known', 'priority'),
    [
        ({'responsive': False}, Priority.POLL),
        ({'may_run_again': 'x', 'following': True}, Priority.POLL),
        ({'may_run_again': 'x', 'responsive': False}, Priority.POLL),
        ({'may_run_again': 'x', 'following': True, 'responsive': False}, Priority.LOOK),
    ],
)
def test_a_drive_that_may_restart_by_itself_is_asked_first(
    known: dict[str, Any], priority: Priority
) -> None:
    assert plan(**known).priority is priority


@pytest.mark.parametrize(
    ('known', 'holds'),
    [
        ({}, True),
        ({'enabled': True}, True),
        ({'stopping': True}, False),
        ({'missed': True}, False),
    ],
)
def test_a_code_is_read_anew_where_it_may_have_changed_unseen(
    known: dict[str, Any], holds: bool
) -> None:
    assert bool(plan(**known).code_holds) == holds


def test_what_changes_rarely_is_read_once_a_second_and_before_a_start() -> None:
    made = plan(enabled=True, frequency=10.0, following=True)
    assert made.reads.mode and made.reads.is_regular and not made.reads.every_scale
    made.rare_read(_NOW - 0.5)
    assert not made.reads.mode
    made.read_rare_soon()
    assert made.reads.mode
    for _ in range(8):
        made.rare_read(_NOW - 1.5)
    assert made.reads.every_scale
    may_start = plan(following=True)
    may_start.rare_read(_NOW)
    assert may_start.reads.mode and not may_start.reads.is_regular


def test_on_a_full_line_each_value_is_read_less_often() -> None:
    made = plan()
    made.measured(0.1)
    assert made.slow_period == pytest.approx(1.5)
    made.rare_read(_NOW - 5.0)
    assert not made.reads.mode
    made.rare_read(_NOW - 6.5)
    assert made.reads.mode
