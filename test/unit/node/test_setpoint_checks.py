# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Two sources of set-points at once are noticed, and a stamp that is repeated."""

from __future__ import annotations

from collections.abc import Iterable

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.node.drive.setpoint_checks import Origin, Repeated, Sources

OWN, ALL = '/line/infeed/setpoint', '/line/bus/setpoint_all'
Given = tuple[float, Origin, float]


def noticed(messages: Iterable[Given]) -> set[str]:
    """The topics that are named while messages come in, each with its time and its value."""
    sources, found = Sources(), set[str]()
    for now, origin, value in sorted(messages, key=lambda message: message[0]):
        found |= sources.take_setpoint(origin, value, now)
    return found


def stream(
    topic: str, value: float, begin: float = 0.0, period: float = 0.1, count: int = 50,
    counted: bool = True,
) -> list[Given]:
    """What one publisher sends."""
    return [
        (begin + n * period, Origin(topic, n + 1 if counted else None), value)
        for n in range(count)
    ]


@pytest.mark.parametrize('counted', [True, False])
@pytest.mark.parametrize('period', [0.02, 0.1, 1.0, 2.0])
def test_two_topics_at_once_are_named(period: float, counted: bool) -> None:
    own = stream(OWN, 20.0, counted=counted)
    beside = stream(ALL, -20.0, 0.05, period, round(5 / period), counted=counted)
    assert noticed(own + beside) == {OWN, ALL}


@pytest.mark.parametrize('later', [0.05, 1.05])
def test_two_publishers_of_one_topic_are_noticed_where_they_count(later: float) -> None:
    both = stream(OWN, 20.0) + stream(OWN, -20.0, later)
    assert noticed(both) == {OWN}
    uncounted = stream(OWN, 20.0, counted=False) + stream(OWN, -20.0, later, counted=False)
    assert not noticed(uncounted)


def test_two_sources_that_agree_are_not_reported() -> None:
    assert not noticed(stream(OWN, 20.0) + stream(ALL, 20.0, 0.05))


def test_one_that_takes_over_for_a_while_is_no_source_at_once() -> None:
    assert not noticed(
        stream(OWN, 20.0, 0.0) + stream(ALL, 5.0, 5.0) + stream(OWN, 20.0, 10.0)
        + stream(ALL, 0.0, 15.0, count=1)
    )


@given(st.lists(st.tuples(st.floats(-50, 50), st.integers(1, 5)), max_size=60))
def test_one_publisher_is_never_taken_for_two(steps: list[tuple[float, int]]) -> None:
    # the middleware may lose any of its messages
    number, messages = 0, list[Given]()
    for at, (value, step) in enumerate(steps):
        number += step
        messages.append((0.01 * at, Origin(OWN, number), value))
    assert not noticed(messages)


def test_one_that_begins_anew_is_not_taken_for_two() -> None:
    assert not noticed(stream(OWN, 20.0) + stream(OWN, 10.0, 5.0) + stream(OWN, 5.0, 10.0))


S = 10**9


def test_a_stamp_that_is_repeated_while_the_clock_stands_grows_old() -> None:
    repeated = Repeated()
    ages = [repeated.age(7 * S, 7 * S, 100.0 + 0.1 * n) for n in range(30)]
    assert ages == pytest.approx([0.1 * n for n in range(30)])
    # two that take turns are as old as the newer one
    assert repeated.age(6 * S, 7 * S, 104.0) == pytest.approx(4.0)
    # the simulation goes on, however slowly
    assert repeated.age(7 * S + 1, 7 * S + 1, 105.0) == 0.0


def test_a_clock_that_is_set_back_makes_no_stamp_old() -> None:
    repeated = Repeated()
    for n in range(5):
        repeated.age(n * S, n * S, 100.0 + n)
    # a simulation begins anew
    for n in range(5):
        assert repeated.age(n * S, n * S, 200.0 + n) == 0.0
