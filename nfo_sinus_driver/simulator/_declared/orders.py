# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Notices which commands of a described drive the written words make.

A file names whole words, and a real drive looks at bits: masters that have driven these drives for
years write others. So of a register with the run command those bits count in which a run word,
forward or reverse, differs from any other command there:

- a word that the file names is that command alone (words that are numbers: 5 stops, 7 resets);
- one that is a run word in them runs;
- one that is another command, in the bits in which that differs from a run word, but for those of
  the direction, is that, and where it is one by more bits, not the one by fewer;
- any other takes the run command away, and so do these.

A word that is repeated changes nothing: a PLC writes cyclically. A reset counts from its first
word. Pulses, and words beside a direction that is alone, are that command and no other: nothing but
a stop takes the run command away. A pulse that is repeated is another one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from nfo_sinus_driver.catalog import to_words
from nfo_sinus_driver.catalog.declared import (
    PULSES,
    Await,
    Condition,
    Description,
    Place,
    SetBits,
    Step,
    Write,
    place_of,
)

_RUN, _RESET = 'run', 'reset'
_WHOLE = 0xFFFF


@dataclass(frozen=True)
class _Word:
    """
    A word of a command: where it goes, what it is, and the bits of it that count.

    :ivar given: the file names these bits.
    """

    place: Place
    value: int
    mask: int = _WHOLE
    given: bool = False

    def fits(self, place: Place, word: int) -> bool:
        """Return whether a word that is written is this one."""
        return place == self.place and (word ^ self.value) & self.mask == 0

    def differs(self, others: Iterable[_Word]) -> int:
        """Return the bits in which it differs from any of these, at the same place."""
        bits = 0
        for other in others:
            if other.place == self.place:
                bits |= (self.value ^ other.value) & self.mask & other.mask
        return bits

    def by(self, mask: int) -> _Word:
        """Return the same by other bits; where there are none, or the file names them, as it is."""
        return self if self.given or not mask else replace(self, mask=mask)


class _Order:
    """One command: a row of words, each of which has to come after the one before."""

    def __init__(self, row: tuple[_Word, ...], shown: Mapping[int, Condition]) -> None:
        self.row = row
        self._shown = shown
        self._passed = 0

    @property
    def shows(self) -> Condition | None:
        """What the drive shows by now, for a step that waits for it."""
        return self._shown.get(self._passed)

    def is_complete_by(self, place: Place, word: int) -> bool:
        """Take a word that was written; return whether the command is complete by it."""
        if all(place != known.place for known in self.row):
            return False
        if self._passed < len(self.row) and self.row[self._passed].fits(place, word):
            self._passed += 1
        elif not (self._passed and self.row[self._passed - 1].fits(place, word)):
            self._passed = int(self.row[0].fits(place, word))
        return self._passed == len(self.row)


class Orders:
    """
    The commands of one drive.

    :ivar places: where their words go.
    :ivar pulses: the coils that are commands by being set.
    """

    def __init__(self, drive: Description) -> None:
        lists = {
            'prepare': drive.prepare, _RUN: drive.run, 'stop': drive.stop, 'coast': drive.coast,
            'quick_stop': drive.quick_stop, _RESET: drive.reset, 'release': drive.release,
        }
        rows = {name: _row(drive, tuple(steps)) for name, steps in lists.items() if steps}
        if _RESET in rows:
            words, shown = rows[_RESET]
            rows[_RESET] = words[:1], shown
        self._directions = _directions(drive)
        direction = drive.setpoint.direction
        self._alone = direction is not None and direction.alone
        run, _ = rows.get(_RUN, ((), {}))
        place = run[-1].place if run else None
        running = () if self._alone else self._directions
        #: What runs the motor by itself, once what comes before it was written.
        self._runs = [*run[-1:], *(way for way in running if way.place == place)]
        others = [word for name, (words, _) in rows.items() if name != _RUN for word in words]
        others += run[:-1]
        counts = _union(word.differs(others) for word in self._runs)
        counts |= _union(word.differs(self._runs) for word in self._runs)
        self._runs = [word.by(counts) for word in self._runs]
        if not self._alone:
            self._directions = tuple(
                way.by(counts if way.place == place else way.differs(self._directions))
                for way in self._directions
            )
        self._orders = {
            name: _Order(
                tuple(
                    word if word.place != place
                    else word.by(counts if name == _RUN else self._bits_of(word))
                    for word in words
                ),
                shown,
            )
            for name, (words, shown) in rows.items()
        }
        listed = [*self._directions, *(word for words, _ in rows.values() for word in words)]
        self.places = {word.place for word in listed}
        self.pulses = {word.value for word in listed if word.place == PULSES}

    def _bits_of(self, word: _Word) -> int:
        """Return the bits by which a word is no run command, whichever way the motor turns."""
        bits = word.differs(self._runs)
        of_direction = _union(run.differs(self._runs) for run in self._runs)
        return bits & ~of_direction or bits

    def made_by(self, place: Place, word: int) -> Collection[str]:
        """Take a word that was written; return the commands that are complete by it."""
        done = {
            name: order.row[-1].mask
            for name, order in self._orders.items()
            if order.is_complete_by(place, word)
        }
        named = [name for name in done if self._orders[name].row[-1].value == word]
        return named or [
            name
            for name, mask in done.items()
            if not any(mask != more and mask & more == mask for more in done.values())
        ]

    def removes_run(self, place: Place, word: int) -> bool:
        """Return whether a word takes the run command away, whatever it is besides."""
        if place == PULSES or self._alone:
            # each is a command by itself, and nothing but the stop ends another one
            return False
        return self.has_run(place) and not any(known.fits(place, word) for known in self._runs)

    def direction_of(self, place: Place, word: int) -> int:
        """Return which way a word commands: 1 forward, -1 reverse, 0 neither."""
        for way, direction in zip((1, -1), self._directions, strict=False):
            if direction.fits(place, word):
                return way
        return 0

    def runs_by_direction(self, place: Place) -> bool:
        """Return whether the word of the direction that goes to a place runs the motor, too."""
        return self.has_run(place) and not self._alone

    def has_run(self, place: Place) -> bool:
        """Return whether the run command is in the words that go to a place."""
        return any(run.place == place for run in self._runs)

    @property
    def shown(self) -> Iterator[Condition]:
        """What the drive shows for the steps that wait for it by now."""
        for order in self._orders.values():
            if order.shows is not None:
                yield order.shows


def _row(
    drive: Description, steps: tuple[Step, ...]
) -> tuple[tuple[_Word, ...], dict[int, Condition]]:
    """Return the words of a command, and what is waited for before which of them."""
    row: list[_Word] = []
    shown: dict[int, Condition] = {}
    setpoint = place_of(drive.parameters[drive.setpoint.key].at('modbus'))
    for step in steps:
        if isinstance(step, Write):
            row += (word for word in _words(drive, step) if word.place != setpoint)
        elif isinstance(step, SetBits):
            place = place_of(drive.parameters[step.key].at('modbus'))
            row.append(_Word(place, step.set, step.set | step.clear, given=True))
        elif isinstance(step, Await):
            shown[len(row)] = step.condition
    return tuple(row), shown


def _words(drive: Description, step: Write) -> Iterator[_Word]:
    """Yield each word of a step; a setting is kept as any other, and is no command."""
    parameter = drive.parameters[step.key]
    address = parameter.at('modbus')
    if parameter.is_setting:
        return
    kind, first = place_of(address)
    if kind != 'register':
        # a coil has one bit, and of a pulse the number is the command
        yield _Word((kind, first), int(step.value), given=kind == 'pulse')
        return
    for index, word in enumerate(to_words(parameter.encode(step.value)), first):
        yield _Word((kind, index), word)


def _directions(drive: Description) -> tuple[_Word, ...]:
    """Return the words for forward and reverse, where there are such."""
    direction = drive.setpoint.direction
    if direction is None:
        return ()
    place = place_of(drive.parameters[direction.key].at('modbus'))
    ways = direction.forward, direction.reverse
    return tuple(_Word(place, way, given=place == PULSES) for way in ways)


def _union(masks: Iterable[int]) -> int:
    bits = 0
    for mask in masks:
        bits |= mask
    return bits
