# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
So many frames through every decoder in turn; each case can be gone through again by its number.

Frames are counted through: case ``n`` has the frames from ``n`` times :data:`CASE` on, and what it
does follows from the seed and ``n`` alone.
"""

from __future__ import annotations

from collections.abc import Iterable
import functools
import gc
from random import Random
import sys
import traceback
from typing import NamedTuple

from fuzz.can_decoders import CAN_CASES
from fuzz.decoders import LINK_CASES
from fuzz.node_decoders import NODE_CASES
from fuzz.other_decoders import OTHER_CASES

#: Frames of one case.
CASE = 100
CASES = {**LINK_CASES, **CAN_CASES, **NODE_CASES, **OTHER_CASES}
#: Cases after which all that is made once is there, and blocks of memory that may come later.
_WARM = 4 * len(CASES)
_MORE_BLOCKS = 500


class Finding(NamedTuple):
    """
    Something that is wrong.

    :ivar frame: the first frame of its case.
    :ivar decoder: what was under fuzz.
    :ivar what: what was wrong, and where.
    """

    frame: int
    decoder: str
    what: str


class Part(NamedTuple):
    """A part of a campaign: the cases ``first`` to before ``end``."""

    seed: int
    first: int
    end: int


def decoder_of(case: int) -> str:
    """Return which decoder a case is about."""
    return tuple(CASES)[case % len(CASES)]


def run(part: Part) -> list[Finding]:
    """Go through the cases of a part; return what is wrong."""
    findings: list[Finding] = []
    blocks = 0
    for case in range(part.first, part.end):
        findings += _judged(part.seed, case)
        if case == part.first + _WARM:
            blocks = _allocated()
    grown = _allocated() - blocks
    if part.end - part.first > 2 * _WARM and grown > _MORE_BLOCKS and not findings:
        what = f'memory has grown by {grown} blocks'
        findings.append(Finding(part.first * CASE, 'all', what))
    return findings


def _judged(seed: int, case: int) -> Iterable[Finding]:
    decoder = decoder_of(case)
    try:
        CASES[decoder](Random(f'{seed} {case}'), CASE)
    except Exception:
        return [Finding(case * CASE, decoder, traceback.format_exc())]
    return []


def _allocated() -> int:
    # what a cache keeps is bounded, and fills slowly; a frozen one would not be found
    gc.unfreeze()
    for found in gc.get_objects():
        # its type, for some objects raise at whatever they are asked
        if type(found) is functools._lru_cache_wrapper:
            found.cache_clear()
    # the newest object may be of a case: it would keep all that it knows
    del found
    gc.collect()
    return sys.getallocatedblocks()
