# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A process that leaks is told from one that has settled."""

from __future__ import annotations

import math
import os
import threading

import pytest
from support.settled import LEAST, MOST_GROWTH, Sample, unsettled

MINUTES = 120


def samples(growth: float = 0.0, threads: float = 0.0, descriptors: float = 0.0) -> list[Sample]:
    """What grows by so much a minute, after a beginning that takes a while in any case."""
    return [
        Sample(
            100 + 8 * (1 - math.exp(-n / 10)) + 0.1 * (n % 3) + growth * n,
            20 + n % 2 + int(threads * n),
            50 + n % 4 + int(descriptors * n),
        )
        for n in range(MINUTES)
    ]


def test_what_has_settled_is_not_complained_of() -> None:
    assert unsettled(samples()) == []


@pytest.mark.parametrize(('growth', 'what'), [
    ({'growth': 2 * MOST_GROWTH['memory'] * 4 / MINUTES}, 'memory'),
    ({'threads': 0.1}, 'threads'),
    ({'descriptors': 0.1}, 'descriptors'),
])
def test_what_grows_is_named(growth: dict[str, float], what: str) -> None:
    (complaint,) = unsettled(samples(**growth))
    assert complaint.startswith(what)


def test_a_pool_that_gets_one_more_thread_has_settled() -> None:
    before = samples()
    after = [
        sample._replace(threads=sample.threads + (n > MINUTES // 2))
        for n, sample in enumerate(before)
    ]
    assert unsettled(after) == []


def test_too_short_a_run_shows_nothing() -> None:
    assert 'too few' in unsettled(samples()[: LEAST - 1])[0]


def test_a_sample_is_of_the_process() -> None:
    before = Sample.of(os.getpid())
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    read, write = os.pipe()
    held = bytearray(os.urandom(20 * 2**20))
    after = Sample.of(os.getpid())
    ended.set()
    thread.join()
    os.close(read)
    os.close(write)
    assert after.memory >= before.memory + 0.9 * len(held) / 2**20
    assert after.threads == before.threads + 1
    assert after.descriptors == before.descriptors + 2
