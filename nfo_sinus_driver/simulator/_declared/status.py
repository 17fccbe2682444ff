# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Finds a status of which a described drive's conditions say what is true of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import functools
import itertools

from nfo_sinus_driver.catalog.declared import Condition

#: Of so many bits all numbers are tried.
_MOST_BITS = 10
#: Of wider fields, so many numbers that the conditions name.
_MOST_TRIED = 4096

#: A condition, whether it is to hold, and how much that counts.
Wish = tuple[Condition, bool, int]


@functools.lru_cache(maxsize=1024)
def compose(wishes: tuple[Wish, ...], fixed_mask: int, fixed: int) -> int:
    """
    Return a status by which as much as possible is as wished.

    :param fixed_mask: bits that are what ``fixed`` has.
    """
    status = fixed & fixed_mask
    for group in _groups(wishes):
        mask = 0
        for condition, _, _ in group:
            mask |= condition.mask
        free = mask & ~fixed_mask
        best = max(_candidates(free, group), key=lambda word: (_score(group, status | word), -word))
        status |= best
    return status


def _score(group: Sequence[Wish], status: int) -> int:
    return sum(weight for condition, wanted, weight in group if condition.holds(status) is wanted)


def _groups(wishes: Sequence[Wish]) -> Iterator[list[Wish]]:
    """Yield the conditions that share bits, together."""
    left = list(wishes)
    while left:
        group = [left.pop(0)]
        mask = group[0][0].mask
        while found := next((wish for wish in left if wish[0].mask & mask), None):
            left.remove(found)
            group.append(found)
            mask |= found[0].mask
        yield group


def _candidates(free: int, group: Sequence[Wish]) -> Iterator[int]:
    if free.bit_count() <= _MOST_BITS:
        yield from _submasks(free)
        return
    named = [
        sorted({0, free & condition.mask, *(value & free for value in condition.values)})
        for condition, _, _ in group
    ]
    for parts in itertools.islice(itertools.product(*named), _MOST_TRIED):
        yield functools.reduce(int.__or__, parts)


def _submasks(free: int) -> Iterator[int]:
    word = 0
    while True:
        yield word
        if word == free:
            return
        word = (word - free) & free
