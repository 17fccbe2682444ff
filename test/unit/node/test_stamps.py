# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a message's stamp tells: when it was, in the order in which messages go out."""

from __future__ import annotations

import itertools
import math

from hypothesis import given, strategies as st

from nfo_sinus_driver.node.messages.stamps import Sequence, Stamps

#: What the node's clock shows when the steady one shows 0, ns.
_EPOCH = 1_800_000_000_000_000_000
_MS = 1_000_000


class Clocks:
    """Two clocks that go on by what each reading takes."""

    def __init__(self, epoch: int = _EPOCH) -> None:
        self.epoch = epoch
        self.time = 0
        self.waits: list[int] = []

    def _read(self) -> int:
        self.time += self.waits.pop(0) if self.waits else 1000
        return self.time

    def steady(self) -> int:
        """Return the steady clock's time, ns."""
        return self._read()

    def node(self) -> int:
        """Return the node's time, ns."""
        return self._read() + self.epoch

    def stamps(self) -> Stamps:
        """Return what is tried here."""
        return Stamps(self.node, self.steady)


def test_a_moment_is_given_in_the_time_of_the_node() -> None:
    clocks = Clocks()
    clocks.time = 5000 * _MS
    assert abs(clocks.stamps().of(4.25) - (_EPOCH + 4250 * _MS)) < 0.01 * _MS
    assert clocks.stamps().of(math.nan) == 0


def test_a_wait_between_the_clocks_does_not_count_as_time() -> None:
    clocks = Clocks()
    clocks.time = 5000 * _MS
    # 300 ms before the node's clock is read, then as long behind it
    clocks.waits = [1000, 300 * _MS, 1000, 1000, 1000, 300 * _MS]
    assert abs(clocks.stamps().of(5.0) - (_EPOCH + 5000 * _MS)) < 0.01 * _MS


def test_a_machine_that_always_waits_gets_the_best_there_is() -> None:
    clocks = Clocks()
    clocks.waits = [wait for size in (40, 9, 30, 50, 60) for wait in (1000, size * _MS, 1000)]
    error = clocks.stamps().of(1.0) - (_EPOCH + 1000 * _MS)
    assert abs(error) < 5 * _MS, 'half of the shortest wait'


def test_simulated_time_has_nothing_before_its_zero() -> None:
    clocks = Clocks(epoch=-5000 * _MS)
    clocks.time = 5001 * _MS
    assert clocks.stamps().of(1.0) == 0


@given(
    st.lists(st.floats(0.0, 10.0), min_size=1, max_size=20),
    st.lists(st.integers(0, 50 * _MS), max_size=40),
)
def test_no_stamp_is_before_the_last(ages: list[float], waits: list[int]) -> None:
    clocks = Clocks()
    clocks.time = 100_000 * _MS
    clocks.waits = waits
    sequence = Sequence(clocks.stamps())
    stamps = [sequence.next(clocks.time / 1e9 - age) for age in ages]
    assert all(before <= after for before, after in itertools.pairwise(stamps))


def test_a_clock_that_is_set_back_takes_the_stamps_with_it() -> None:
    clocks = Clocks()
    clocks.time = 100_000 * _MS
    sequence = Sequence(clocks.stamps())
    first = sequence.next(99.5)
    # a bag that is played again, or a wall clock that was wrong
    clocks.epoch -= 60_000 * _MS
    again = sequence.next(99.6)
    assert abs(again - (first - 59_900 * _MS)) < 0.01 * _MS


def test_a_clock_beyond_2038_gives_the_latest_stamp_that_a_message_can_have() -> None:
    clocks = Clocks(2**31 * 1_000_000_000)
    clocks.time = 5000 * _MS
    latest = 2**31 * 1_000_000_000 - 1
    assert clocks.stamps().of(5.0) == clocks.stamps().now() == latest
    assert Sequence(clocks.stamps()).next(5.0) == latest
