# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""An answer that repeats the one before, on a line that has given no cause for doubt yet."""

from __future__ import annotations

from link_bench import UNIT, A, B, Bench, D
import pytest
from test_echo import SameWords
from virtual_wire import Fate

from nfo_sinus_driver.link import DamagedAnswer
from nfo_sinus_driver.link.late_replies import SUSPECT_FOR


def trusting(fates: list[Fate] | None = None) -> Bench:
    """Return a bench whose link has heard nothing twice yet."""
    return Bench(fates, trusted=True)


def test_same_words_cost_no_request_and_hardly_any_time() -> None:
    bench = trusting()
    bench.slave = SameWords(bench.wire)
    bench.read(A)
    began = bench.wire.now
    bench.read(B)
    first = bench.wire.now - began
    began = bench.wire.now
    bench.read(A)
    assert bench.asked == [A.index, B.index, A.index]
    assert bench.wire.now - began == pytest.approx(first, rel=0.1)


@pytest.mark.parametrize('again', [0.05, 0.1, 0.15])
def test_answer_sent_twice_is_not_taken_for_the_next(again: float) -> None:
    # the unit takes as long as it does, and the second copy comes within that
    bench = trusting([Fate(delay=0.2), Fate(0.2, 'double', again=again), Fate(delay=0.2)])
    bench.read(D)
    first = bench.read(A).data
    error = bench.expect(DamagedAnswer, lambda: bench.read(B))
    assert 'came twice' in str(error)
    # from now on nothing is believed that could be a repetition
    assert bench.read(B).data == bench.answer_of(len(bench.asked) - 1) != first


def test_line_with_an_answer_sent_twice_is_not_trusted_for_a_while() -> None:
    bench = trusting([Fate(what='double')])
    bench.read(A)
    bench.wire.now += 0.01
    bench.read(D)
    bench.slave = SameWords(bench.wire)
    bench.read(A)
    bench.read(B)
    assert bench.asked[-1] not in (A.index, B.index), 'nothing confirmed it'
    bench.wire.now += SUSPECT_FOR + 1.0
    bench.read(A)
    bench.read(B)
    assert bench.asked[-2:] == [A.index, B.index]


def test_one_slow_answer_does_not_slow_the_others_for_ever() -> None:
    bench = trusting([Fate(delay=0.9)])
    bench.read(D)
    slow = bench.link._late.longest(UNIT)
    for _ in range(60):
        bench.read(D)
    assert bench.link._late.longest(UNIT) < slow / 10
