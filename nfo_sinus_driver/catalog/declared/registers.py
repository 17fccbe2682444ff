# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""All registers and coils of a description with their use: none has two that exclude each other."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import NamedTuple

from nfo_sinus_driver.catalog.declared.yaml_file import Problems
from nfo_sinus_driver.catalog.parameter import Address

#: What is written: a register or a coil; all coils that are pulses are one, with the number of the
#: one that was set last in it.
Place = tuple[str, int]
#: The place of all pulses.
PULSES: Place = 'pulse', 0


def place_of(address: Address) -> Place:
    """Return what is written at an address, in whatever way that is."""
    return address.space.partition('_')[0], address.index



class Use(enum.Enum):
    """What a register or coil is for. Some bits that are only read of one are none of these."""

    #: A step of a command writes it, or the direction.
    COMMAND = enum.auto()
    #: A step writes 0 there: that may be set-point 0.
    ZERO = enum.auto()
    #: A coil that is a command by being set.
    PULSE = enum.auto()
    SETPOINT = enum.auto()
    #: A parameter, a measured value, or the set-point where it is read elsewhere.
    VALUE = enum.auto()
    #: The number of a fault.
    FAULT = enum.auto()
    #: A condition on some of its bits.
    BITS = enum.auto()


#: The uses that go together: a drive may show its status where it takes commands.
_TOGETHER = frozenset(
    map(
        frozenset,
        (
            (Use.COMMAND,),
            (Use.ZERO,),
            (Use.PULSE,),
            (Use.BITS,),
            (Use.COMMAND, Use.ZERO),
            (Use.COMMAND, Use.BITS),
            (Use.ZERO, Use.BITS),
            (Use.ZERO, Use.SETPOINT),
            (Use.FAULT, Use.BITS),
        ),
    )
)


class _Taken(NamedTuple):
    """A use, of what, and where the file says so."""

    use: Use
    what: str
    line: int
    path: Path


class Registers:
    """The table of one file; what is wrong goes to the problems, with both lines."""

    def __init__(self, problems: Problems) -> None:
        self._problems = problems
        self._taken: dict[tuple[str, int], list[_Taken]] = {}
        #: What a report has named: one is enough for all the commands that write there.
        self._reported: set[_Taken] = set()

    def note_use(
        self, use: Use, what: str, line: int, space: str, first: int, count: int = 1
    ) -> None:
        """
        Note the use of a register or coil, or of several in a row.

        :param space: ``register``, in whatever way it is written, ``input`` or ``coil``.
        """
        mine = _Taken(use, what, line, self._problems.path)
        kind = space.partition('_')[0]
        for number in range(first, first + count):
            taken = self._taken.setdefault((kind, number), [])
            for other in taken:
                together = other.what == what or frozenset((use, other.use)) in _TOGETHER
                if not together and self._reported.isdisjoint((mine, other)):
                    self._reported |= {mine, other}
                    self._report(mine, other, kind)
            taken.append(mine)

    def _report(self, mine: _Taken, other: _Taken, kind: str) -> None:
        file = '' if other.path == mine.path else f'{other.path.name}, '
        place = 'coil' if kind == 'coil' else 'register'
        self._problems.add(
            mine.line,
            f'{mine.what} and {other.what} ({file}line {other.line}) stand in the same {place}: '
            'check both numbers and types; some bits of a value are said with bits',
        )
