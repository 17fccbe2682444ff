# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive can show of a reading, and the table of what looks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import enum
from typing import Any, TypeVar

from nfo_sinus_driver.cli.check.sight import Sight


class Verdict(enum.Enum):
    """What a drive shows of a reading."""

    CONFIRMED = 'confirmed'
    CONTRADICTED = 'CONTRADICTED'
    NOT_SEEN = 'not seen'


#: The verdict, and what was seen: the bytes, or why nothing was.
Found = tuple[Verdict, str]
_S = TypeVar('_S', bound=Sight)


class Looks(dict[str, Callable[[Any], Found]]):
    """What looks at a drive over one protocol, by the name that ``readings.csv`` has for it."""

    def add(self, function: Callable[[_S], Found]) -> Callable[[_S], Found]:
        """Have one more, by the name of the function."""
        self[function.__name__.lstrip('_')] = function
        return function


def judged(confirmed: bool, saw: str) -> Found:
    """Return that a reading is right, or wrong."""
    return (Verdict.CONFIRMED if confirmed else Verdict.CONTRADICTED), saw


def not_seen(why: str) -> Found:
    """Return that a drive shows nothing of a reading, and why."""
    return Verdict.NOT_SEEN, why


def as_hex(words: Iterable[int] | None) -> str:
    """Return words as people read them."""
    return 'nothing' if words is None else ' '.join(f'{word:04X}h' for word in words)
