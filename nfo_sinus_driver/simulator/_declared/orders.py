# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Notices which commands of a described drive the written words make."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from nfo_sinus_driver.catalog import to_words
from nfo_sinus_driver.catalog.declared import Await, Condition, Description, SetBits, Step, Write

#: The first register or coil of a key, and whether it is a coil.
Place = tuple[int, bool]


def words_of(drive: Description, step: Write) -> Iterator[tuple[Place, int]]:
    """Yield where each word of a step goes; a setting is kept as any other, and is no command."""
    parameter = drive.parameters[step.key]
    address = parameter.at('modbus')
    if parameter.is_setting:
        return
    if address.space == 'coil':
        yield (address.index, True), int(step.value)
        return
    for index, word in enumerate(to_words(parameter.encode(step.value)), address.index):
        yield (index, False), word


class Order:
    """
    One command: a row of words, each of which has to come after the one before.

    :ivar places: where its words go.
    """

    def __init__(self, drive: Description, steps: tuple[Step, ...]) -> None:
        #: Of each word where it goes, the bits that count, and what they are.
        self._row: list[tuple[Place, int, int]] = []
        self._shown: dict[int, Condition] = {}
        self._passed = 0
        setpoint = drive.parameters[drive.setpoint.key].at('modbus').index
        for step in steps:
            if isinstance(step, Write):
                for place, word in words_of(drive, step):
                    if place != (setpoint, False):
                        self._row.append((place, 0xFFFF, word))
            elif isinstance(step, SetBits):
                index = drive.parameters[step.key].at('modbus').index
                self._row.append(((index, False), step.set | step.clear, step.set))
            elif isinstance(step, Await):
                self._shown[len(self._row)] = step.condition
        self.places = {place for place, _, _ in self._row}

    @property
    def last(self) -> tuple[Place, int] | None:
        """Where its last word goes, and what it is."""
        return (self._row[-1][0], self._row[-1][2]) if self._row else None

    @property
    def shows(self) -> Condition | None:
        """What the drive shows by now, for a step that waits for it."""
        return self._shown.get(self._passed)

    def take_word(self, place: Place, word: int) -> bool:
        """Take a word that was written; return whether the command is complete by it."""
        if place not in self.places:
            return False
        if not self._fits(self._passed % len(self._row), place, word):
            self._passed = 0
        if self._fits(self._passed % len(self._row), place, word):
            self._passed = self._passed % len(self._row) + 1
        return self._passed == len(self._row)

    def _fits(self, number: int, place: Place, word: int) -> bool:
        where, mask, wanted = self._row[number]
        return where == place and word & mask == wanted


def orders_of(drive: Description) -> Mapping[str, Order]:
    """Return the commands of a drive, by name."""
    lists = {
        'prepare': drive.prepare, 'run': drive.run, 'stop': drive.stop, 'coast': drive.coast,
        'quick_stop': drive.quick_stop, 'reset': drive.reset, 'release': drive.release,
    }
    return {name: Order(drive, tuple(steps)) for name, steps in lists.items() if steps}
