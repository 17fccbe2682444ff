# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
For each reading of ``readings.csv`` what a drive shows of it.

The numbers are those of ``docs/readings.md``. What is asked and compared stands here as the manuals
print it, not as the driver's tables have it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
import csv
from dataclasses import dataclass
import functools
import math
from pathlib import Path

from nfo_sinus_driver.cli.check import (
    canopen_readings,
    classic_readings,
    modbus_readings,
    movitrac_readings,
    plc_readings,
)
from nfo_sinus_driver.cli.check.sight import Sight
from nfo_sinus_driver.cli.check.turn import Moment
from nfo_sinus_driver.cli.check.verdict import Found, Looks, Verdict, as_hex, judged, not_seen

_TABLE = Path(__file__).parent / 'readings.csv'
_ANY = 'any'
#: Tenths of a hertz, and what is near, as a share: the motor slips.
_COUNTS_A_HERTZ, _NEAR = 10, 0.2


@dataclass(frozen=True)
class Reading:
    """
    One row of the table.

    :ivar part: ``read``, ``eyes``: a person says what the keypad shows, or ``turn``.
    :ivar shows: what looks, or the parameter that is asked about.
    :ivar moment: of ``turn`` the moment at which that parameter is read.
    :ivar words: and the first words, signed, that show the reading, as ranges; none: ten for each
        hertz of the set-point.
    """

    number: int
    families: frozenset[str]
    protocols: frozenset[str]
    part: str
    shows: str
    moment: str
    words: tuple[tuple[int, int], ...]
    expectation: str

    def fits(self, family: str, protocol: str) -> bool:
        """Return whether it is one of such a drive."""
        kinds = {protocol, protocol.partition('_')[0], _ANY}
        if protocol in ('modbus_rtu', 'modbus_ascii'):
            kinds.add('modbus_serial')
        return bool(self.families & {family, _ANY}) and bool(self.protocols & kinds)


@dataclass(frozen=True)
class Seen:
    """What came of one reading: ``saw`` has the bytes, or why nothing was seen."""

    reading: Reading
    verdict: Verdict
    saw: str


_ON_ANY_LINE = Looks()


@_ON_ANY_LINE.add
def _wrong_sum(sight: Sight) -> Found:
    request = sight.request(next(iter(sight.parameters.values())))
    # it may be refused, but not left without an answer
    sight.ask(request)
    answer = sight.wire.ask(request, spoiled=True)
    # without the address, which is the owner's
    other = f'{len(answer.frame)} bytes' if answer.frame else 'no answer'
    came = answer.pdu.hex(' ') or other
    return judged(not answer.frame, f'to a wrong sum: {came}')


_LOOKS = {
    **_ON_ANY_LINE,
    **modbus_readings.LOOKS,
    **classic_readings.LOOKS,
    **movitrac_readings.LOOKS,
    **plc_readings.LOOKS,
    **canopen_readings.LOOKS,
}


@functools.cache
def table() -> tuple[Reading, ...]:
    """Return all readings that a drive can show."""
    with _TABLE.open(newline='', encoding='utf-8') as file:
        return tuple(
            Reading(
                int(row['number']), frozenset(row['families'].split('|')),
                frozenset(row['protocols'].split('|')), row['part'], row['shows'], row['moment'],
                tuple(map(_range, row['words'].split())), row['expectation'],
            )
            for row in csv.DictReader(file)
        )


def look(sight: Sight, protocol: str) -> Iterator[Seen]:
    """Yield what a drive shows of each reading that needs no person."""
    for reading in table():
        if reading.part == 'read' and reading.fits(sight.model.name, protocol):
            sight.missed.clear()
            verdict, saw = _LOOKS[reading.shows](sight)
            if sight.missed:
                # a line that fails is no reading that is wrong
                missed = ', '.join(pdu.hex(' ') for pdu in sight.missed)
                verdict, saw = not_seen(f'no answer to {missed}')
            yield Seen(reading, verdict, saw)


def turned(
    moments: Sequence[Moment], family: str, protocol: str
) -> Iterator[Seen]:
    """Yield what a drive has shown of each reading while its motor turned."""
    for reading in table():
        if reading.part != 'turn' or not reading.fits(family, protocol):
            continue
        moment = next((one for one in moments if one.name == reading.moment), None)
        words = moment.words.get(reading.shows) if moment is not None else None
        if moment is None or moment.as_expected is None or not words:
            why = 'not answered' if moment is None or moment.words else moment.saw
            yield Seen(reading, *not_seen(f'{reading.moment}: {why}'))
            continue
        ranges = reading.words or (_around(_COUNTS_A_HERTZ * moment.hertz),)
        if any(map(math.isnan, ranges[0])):
            yield Seen(reading, *not_seen(f'{reading.moment}: the set-point was a speed'))
            continue
        right = any(least <= words[0] <= most for least, most in ranges)
        numbers = as_hex(word & 0xFFFF for word in words)
        yield Seen(reading, *judged(right, f'{reading.moment}, {reading.shows}: {numbers}'))


def _around(counts: float) -> tuple[float, float]:
    return counts - _NEAR * abs(counts), counts + _NEAR * abs(counts)


def _range(text: str) -> tuple[int, int]:
    least, _, most = text.partition('..')
    return int(least), int(most or least)


def looks() -> Collection[str]:
    """Return the names of what looks."""
    return _LOOKS.keys()
