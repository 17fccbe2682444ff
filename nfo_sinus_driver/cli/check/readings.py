# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
For each reading of ``readings.csv`` what a drive shows of it.

The numbers are those of ``docs/readings.md``. What is asked and compared stands here as the manuals
print it, not as the driver's tables have it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
import csv
from dataclasses import dataclass
import enum
import functools
from pathlib import Path
import re
from typing import Any, TypeVar

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.cli.check.sight import ClassicSight, ModbusSight, Sight
from nfo_sinus_driver.cli.check.turn import Moment

_TABLE = Path(__file__).parent / 'readings.csv'
_ANY = 'any'
#: Registers of both Sinus [M0 §6.2, M1].
_INV_ST, _DRIVE_STATUS, _MODE, _COMMAND = 0x2A5, 0x258, 0x294, 0x298
_UNKNOWN_REGISTER = 2
#: In no table of any manual.
_NOWHERE = 0xFFF0
_READ_DEVICE = bytes((43, 14, 1, 0))
_REPORT = bytes((17,))
_BY_INPUT = bytes.fromhex('04 02A5 0001')


class Verdict(enum.Enum):
    """What a drive shows of a reading."""

    CONFIRMED = 'confirmed'
    CONTRADICTED = 'CONTRADICTED'
    NOT_SEEN = 'not seen'


@dataclass(frozen=True)
class Reading:
    """
    One row of the table.

    :ivar part: ``read``, ``eyes``: a person says what the keypad shows, or ``turn``.
    :ivar shows: what looks, or the parameter that is asked about.
    :ivar moment: of ``turn`` the moment at which that parameter is read.
    :ivar words: and the first words, signed, that show the reading, as ranges.
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


Found = tuple[Verdict, str]
_S = TypeVar('_S', bound=Sight)
_looks: dict[str, Callable[[Any], Found]] = {}


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
            verdict, saw = _looks[reading.shows](sight)
            if sight.missed:
                # a line that fails is no reading that is wrong
                missed = ', '.join(pdu.hex(' ') for pdu in sight.missed)
                verdict, saw = _not_seen(f'no answer to {missed}')
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
        if moment is None or not words:
            why = 'not answered' if moment is None or moment.as_expected is not None else moment.saw
            yield Seen(reading, *_not_seen(f'{reading.moment}: {why}'))
            continue
        right = any(least <= words[0] <= most for least, most in reading.words)
        numbers = _hex(word & 0xFFFF for word in words)
        yield Seen(reading, *_judged(right, f'{reading.moment}, {reading.shows}: {numbers}'))


def _range(text: str) -> tuple[int, int]:
    least, _, most = text.partition('..')
    return int(least), int(most or least)


def looks() -> Collection[str]:
    """Return the names of what looks."""
    return _looks.keys()


def _looking(function: Callable[[_S], Found]) -> Callable[[_S], Found]:
    _looks[function.__name__.lstrip('_')] = function
    return function


def _judged(confirmed: bool, saw: str) -> Found:
    return (Verdict.CONFIRMED if confirmed else Verdict.CONTRADICTED), saw


def _not_seen(why: str) -> Found:
    return Verdict.NOT_SEEN, why


def _hex(words: Iterable[int] | None) -> str:
    return 'nothing' if words is None else ' '.join(f'{word:04X}h' for word in words)


def _came(sight: Sight, pdu: bytes) -> str:
    answer = sight.ask(pdu)
    if answer.refused_with is not None:
        return f'function {pdu[0]:02}: refused with {answer.refused_with}'
    return f'function {pdu[0]:02}: {"answered" if answer.pdu else "no answer"}'


@_looking
def _error_log_of_32(sight: ModbusSight) -> Found:
    # an entry is two words, each four registers behind the one before
    register = 0xC000 + 4 * 32
    words = sight.words(register, 2)
    if words is None:
        return _judged(sight.words(0xC000, 2) is not None, f'entry 33, {register:04X}h: refused')
    if not any(words):
        return _not_seen(f'entry 33, {register:04X}h: answered, and empty')
    return _judged(False, f'entry 33, {register:04X}h: {_hex(words)}')


@_looking
def _wrong_sum(sight: ModbusSight) -> Found:
    request = bytes.fromhex('03 0000 0001')
    # it may be refused, but not left without an answer
    sight.ask(request)
    answer = sight.wire.ask(request, spoiled=True)
    # without the address, which is the owner's
    came = answer.frame[1:].hex(' ') or 'no answer'
    return _judged(not answer.frame, f'to a wrong sum: {came}')


@_looking
def _speed_scale(sight: ModbusSight) -> Found:
    numbers = sight.words(0x268, 2), sight.words(0x26A, 2)
    read = [words for words in numbers if words is not None]
    saw = f'0268h: {_hex(numbers[0])}, 026Ah: {_hex(numbers[1])}'
    return _judged(len(read) == 2 and all(map(any, read)), saw)


@_looking
def _signed_temperature(sight: ModbusSight) -> Found:
    word = sight.word(0x454)
    if word is None:
        return _not_seen('0454h is not answered')
    signed = (word ^ 0x8000) - 0x8000
    saw = f'0454h: {word:04X}h = {signed}'
    if 0 <= signed <= 150:
        return _not_seen(f'it is not below 0: {saw}')
    return _judged(-100 <= signed < 0, saw)


@_looking
def _status_of_two_words(sight: ModbusSight) -> Found:
    words = sight.words(_DRIVE_STATUS, 2)
    # the low word stands first
    return _judged(words is not None and words[1] == 0, f'0258h: {_hex(words)}')


@_looking
def _two_versions(sight: ModbusSight) -> Found:
    pdu = sight.ask(_READ_DEVICE).pdu
    objects, at = {}, 7
    while len(pdu) >= at + 2 and len(pdu) >= at + 2 + pdu[at + 1]:
        objects[pdu[at]] = pdu[at + 2 : at + 2 + pdu[at + 1]]
        at += 2 + pdu[at + 1]
    if 2 not in objects:
        return _not_seen(_came(sight, _READ_DEVICE))
    text = objects[2].decode('ascii', 'replace')
    both = [part.strip() for part in text.split('/')]
    right = len(both) == 2 and all(re.fullmatch(r'[0-9.]+', part) for part in both)
    return _judged(right, f'object 2: {text!r}')


@_looking
def _number_as_printed(sight: ModbusSight) -> Found:
    word = sight.word(_INV_ST)
    codes = sight.model.status_codes
    if word is not None:
        return _judged(word in codes, f'02A5h: {word:04X}h')
    # not the one below, which acknowledges; the one above is not in the tables
    above = sight.word(_INV_ST + 1)
    return _judged(False, f'02A5h: refused, 02A6h: {_hex(above if above is None else (above,))}')


@_looking
def _bits_and_code(sight: ModbusSight) -> Found:
    # one register, or two with the low word first
    words = sight.words(_DRIVE_STATUS) or sight.words(_DRIVE_STATUS, 2)
    status, code = words[0] if words else None, sight.word(_INV_ST)
    if status is None or code is None or code not in sight.model.status_codes:
        return _not_seen('no status, or no status code of the manual')
    kind = sight.model.status_codes[code].kind
    fault, alarm = bool(status & 1 << 3), bool(status & 1 << 7)
    saw = f'0258h: {status:04X}h, 02A5h: {code} ({kind.value})'
    if kind is Kind.FAULT or kind is Kind.ALARM or fault or alarm:
        return _judged((fault, alarm) == (kind is Kind.FAULT, kind is Kind.ALARM), saw)
    return _not_seen(f'no fault and no alarm is active: {saw}')


def _mode(sight: ModbusSight, known: range) -> Found:
    word = sight.word(_MODE)
    return _judged(word in known, f'0294h: {_hex(None if word is None else (word,))}')


@_looking
def _mode_to_3(sight: ModbusSight) -> Found:
    if sight.word(_MODE) in range(1, 4):
        return _not_seen(f'it is not 0: 0294h: {sight.word(_MODE):04X}h')
    return _mode(sight, range(4))


@_looking
def _mode_from_1(sight: ModbusSight) -> Found:
    return _mode(sight, range(1, 4))


@_looking
def _smode(sight: ModbusSight) -> Found:
    word = sight.word(_COMMAND)
    if word is None:
        return _not_seen('0298h cannot be read')
    return _judged(word in (0, 0x081, 0x101), f'0298h: {word:04X}h')


@_looking
def _actual_references(sight: ModbusSight) -> Found:
    frequency, speed = sight.words(0x518), sight.words(0x260)
    saw = f'0518h: {_hex(frequency)}, 0260h: {_hex(speed)}'
    return _judged(frequency is not None and speed is not None, saw)


@_looking
def _newer_functions(sight: ModbusSight) -> Found:
    requests = _BY_INPUT, _REPORT, _READ_DEVICE
    has = [sight.ask(pdu).pdu[:1] == pdu[:1] for pdu in requests]
    saw = ', '.join(_came(sight, pdu) for pdu in requests)
    if not any(has):
        return _not_seen(f'an older drive has none of them: {saw}')
    return _judged(has == [False, True, True], saw)


@_looking
def _input_registers(sight: ModbusSight) -> Found:
    requests = _BY_INPUT, _REPORT, _READ_DEVICE
    has = [sight.ask(pdu).pdu[:1] == pdu[:1] for pdu in requests]
    return _judged(has == [True, False, False], ', '.join(_came(sight, pdu) for pdu in requests))


@_looking
def _all_registers(sight: ModbusSight) -> Found:
    missing = [
        f'{parameter.at("modbus").index:04X}h'
        for parameter in sight.parameters.values()
        if sight.words(parameter.at('modbus').index, parameter.at('modbus').codec.size // 2) is None
    ]
    return _judged(not missing, f'not answered: {", ".join(missing) or "none"}')


@_looking
def _code_to_63(sight: ModbusSight) -> Found:
    word = sight.word(_INV_ST)
    return _judged(word in range(64), f'02A5h: {_hex(None if word is None else (word,))}')


@_looking
def _unknown_register(sight: ModbusSight) -> Found:
    answer = sight.read(_NOWHERE)
    if not answer.pdu:
        return _not_seen(f'{_NOWHERE:04X}h: no answer')
    saw = f'{_NOWHERE:04X}h: {answer.pdu.hex(" ")}'
    return _judged(answer.refused_with == _UNKNOWN_REGISTER, saw)


@_looking
def _speed_in_every_mode(sight: ModbusSight) -> Found:
    words, mode = sight.words(0x264), sight.words(0x24C)
    return _judged(words is not None, f'0264h: {_hex(words)}, control mode {_hex(mode)}')


@_looking
def _reported_id(sight: ModbusSight) -> Found:
    pdu = sight.ask(_REPORT).pdu
    if pdu[:1] != _REPORT:
        return _not_seen(_came(sight, _REPORT))
    if len(pdu) < 2:
        return _judged(False, 'function 17: nothing behind it')
    count, text = pdu[1], pdu[2:]
    with_run_byte = text[1:2] in (b'\x00', b'\xff') and text[2:].isascii()
    # what it says may have the serial number in it
    saw = f'function 17: {len(text)} bytes, count {count}'
    plain = len(text) == 16 and text.isascii()
    return _judged(count == len(text) and (plain or with_run_byte), saw)


# --- on Classic -----------------------------------------------------------------------------------


@_looking
def _classic_error_log(sight: ClassicSight) -> Found:
    # an entry is two words
    number = 0x200 + 2 * 32
    word = sight.word(number)
    if word is None:
        confirmed = sight.is_refused(number) and sight.word(0x200) is not None
        return _judged(confirmed, f'entry 33, E{number:04X}: NAK')
    if not word:
        return _not_seen(f'entry 33, E{number:04X}: answered, and empty')
    return _judged(False, f'entry 33, E{number:04X}: {word:04X}h')


@_looking
def _both_words_of_the_scale(sight: ClassicSight) -> Found:
    words = [sight.word(number) for number in (0xE1, 0xE2, 0xE3, 0xE4)]
    saw = ', '.join('nothing' if word is None else f'{word:04X}h' for word in words)
    saw = f'E00E1 to E00E4: {saw}'
    if all(word is None for word in words):
        return _not_seen(f'an older drive has none of them: {saw}')
    # of each the low word has the higher number
    return _judged(None not in words and bool(words[1]) and bool(words[3]), saw)


@_looking
def _sum_with_the_end(sight: ClassicSight) -> Found:
    answer = sight.ask(bytes((0x00, 0xE9)))
    if not answer.frame:
        return _not_seen('E00E9: no answer')
    # without the address, which is the owner's; what is damaged has no sum that is right
    sight.missed.clear()
    return _judged(bool(answer.pdu), f'E00E9: {answer.frame[1:].hex(" ")}')


@_looking
def _own_address_and_upper_case(sight: ClassicSight) -> Found:
    frames = [sight.ask(sight.request(one)).frame for one in sight.parameters.values()]
    digits = b''.join(frame[8:12] for frame in frames if len(frame) > 12)
    if not re.search(rb'[A-Fa-f]', digits):
        return _not_seen('no digit of what came is a letter')
    lower = re.search(rb'[a-f]', digits)
    return _judged(lower is None, 'digits in lower case' if lower else 'digits in upper case')
