# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
For each reading of ``readings.csv`` what a drive shows of it.

The numbers are those of ``docs/readings.md``. What is asked and compared stands here as the manuals
print it, not as the driver's tables have it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass
import enum
import functools
import math
from pathlib import Path
import re
from typing import Any, TypeVar

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.cli.check.sight import (
    BlockSight,
    CanopenSight,
    ClassicSight,
    ModbusSight,
    MovitracSight,
    Sight,
)
from nfo_sinus_driver.cli.check.turn import Moment

_TABLE = Path(__file__).parent / 'readings.csv'
_ANY = 'any'
#: Registers of both Sinus [M0 §6.2, M1].
_INV_ST, _DRIVE_STATUS, _MODE, _COMMAND = 0x2A5, 0x258, 0x294, 0x298
_UNKNOWN_REGISTER = 2
#: Tenths of a hertz, and what is near, as a share: the motor slips.
_COUNTS_A_HERTZ, _NEAR = 10, 0.2
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
        if moment is None or moment.as_expected is None or not words:
            why = 'not answered' if moment is None or moment.as_expected is not None else moment.saw
            yield Seen(reading, *_not_seen(f'{reading.moment}: {why}'))
            continue
        ranges = reading.words or (_around(_COUNTS_A_HERTZ * moment.hertz),)
        if any(map(math.isnan, ranges[0])):
            yield Seen(reading, *_not_seen(f'{reading.moment}: the set-point was a speed'))
            continue
        right = any(least <= words[0] <= most for least, most in ranges)
        numbers = _hex(word & 0xFFFF for word in words)
        yield Seen(reading, *_judged(right, f'{reading.moment}, {reading.shows}: {numbers}'))


def _around(counts: float) -> tuple[float, float]:
    return counts - _NEAR * abs(counts), counts + _NEAR * abs(counts)


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
def _wrong_sum(sight: Sight) -> Found:
    request = sight.request(next(iter(sight.parameters.values())))
    # it may be refused, but not left without an answer
    sight.ask(request)
    answer = sight.wire.ask(request, spoiled=True)
    # without the address, which is the owner's
    other = f'{len(answer.frame)} bytes' if answer.frame else 'no answer'
    came = answer.pdu.hex(' ') or other
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


# --- of a MOVITRAC --------------------------------------------------------------------------------


_FAULT_MEMORY = range(8, 13)
_CARDS, _STATUS = 237, 284
_AT_X20, _AT_X21, _FIELDBUS_CARD = (*range(6), 9), (*range(4), 9), 2
_FAULTS = frozenset((
    *range(1, 8), *range(10, 15), *range(17, 29), 33, 34, *range(36, 40), 41, 43, 44, 45,
    50, 51, 52, *range(54, 66), 87,
))
_LAST_STATUS, _LAST_FAULT_BCD = 19, 0x87
_ILLEGAL_INDEX, _NO_OPTION = 0x10, (0x17, 0x2E)


def _bytes_at(sight: MovitracSight, index: int) -> str:
    data = sight.value(index)
    if data is None:
        code = sight.refused_with(index)
        return f'{index}: {"no answer" if code is None else f"refused with {code:02X}h"}'
    return f'{index}: {data.hex(" ")}'


def _word_at(sight: MovitracSight, index: int) -> bytes | None:
    data = sight.value(index)
    return data if data is not None and len(data) == 4 else None


def _decimal(data: bytes) -> int | None:
    """Return digits as a number, of four bytes in hundredths."""
    return int(data.hex()) if data.hex().isdecimal() else None


def _fault_memory(sight: MovitracSight) -> tuple[list[int], str]:
    """Return P060 to P064, of which -1 has other digits, and what came of them."""
    words = [word for index in _FAULT_MEMORY if (word := _word_at(sight, index)) is not None]
    numbers = [-1 if (number := _decimal(word)) is None else number for word in words]
    return numbers, ', '.join(_bytes_at(sight, index) for index in _FAULT_MEMORY)


def _remembered(sight: MovitracSight) -> tuple[list[int], str]:
    """Return the faults that are remembered, and what came."""
    numbers, saw = _fault_memory(sight)
    return [number for number in numbers if number], saw


@_looking
def _sum_of_all_bytes(sight: MovitracSight) -> Found:
    answer = sight.ask(bytes((0x01, 0x0F)))
    if not answer.frame:
        return _not_seen('271: no answer')
    # what is damaged has no sum that is right
    sight.missed.clear()
    return _judged(bool(answer.pdu), f'271: {answer.frame.hex(" ")}')


@_looking
def _sign_in_bcd(sight: MovitracSight) -> Found:
    # P001, P111 and the temperatures of the fault memory
    indices = 4, 98, 402, 411, 420, 429, 438
    numbers = {index: data.hex() for index in indices if (data := sight.value(index)) is not None}
    shown = {index: digits for index, digits in numbers.items() if digits[0] != '0'}
    shown |= {index: digits for index, digits in numbers.items() if not digits[1:].isdecimal()}
    if not shown:
        return _not_seen('nothing is below 0')
    right = all(digits[0] in 'f81' and digits[1:].isdecimal() for digits in shown.values())
    return _judged(right, ', '.join(_bytes_at(sight, index) for index in shown))


@_looking
def _fault_codes_by_100(sight: MovitracSight) -> Found:
    numbers, saw = _remembered(sight)
    if not numbers:
        return _not_seen(f'no fault is remembered: {saw}')
    return _judged(all(100 <= number < 8800 for number in numbers), saw)


@_looking
def _whole_fault_codes(sight: MovitracSight) -> Found:
    numbers, saw = _remembered(sight)
    if not numbers:
        return _not_seen(f'no fault is remembered: {saw}')
    return _judged(all(number % 100 == 0 for number in numbers), saw)


@_looking
def _no_fault_and_codes(sight: MovitracSight) -> Found:
    numbers, saw = _fault_memory(sight)
    kind, saw = _word_at(sight, 271), f'{_bytes_at(sight, 271)}, {saw}'
    if kind is None:
        return _not_seen(saw)
    # 0 is no fault, so none stands behind it
    ordered = all(numbers[: sum(map(bool, numbers))])
    # 3000.00, 3100.00 or 5000.00
    return _judged(ordered and _decimal(kind) in (300000, 310000, 500000), saw)


@_looking
def _bytes_of_a_word(sight: MovitracSight) -> Found:
    word, saw = _word_at(sight, _STATUS), _bytes_at(sight, _STATUS)
    if word is None:
        return _not_seen(saw)
    fault, status, cards, flags = word
    # binary, or two digits
    numbers = fault <= _LAST_FAULT_BCD
    numbers &= status in range(_LAST_STATUS + 1) or _decimal(word[1:2]) in range(_LAST_STATUS + 1)
    options = cards & 0xF in _AT_X20 and cards >> 4 in _AT_X21
    return _judged(numbers and options and flags < 1 << 5, saw)


@_looking
def _half_bytes(sight: MovitracSight) -> Found:
    # P550 and P551, each 50 at least and 99 999 999 at most
    numbers = {index: data for index in (302, 304) if (data := sight.value(index)) is not None}
    saw = ', '.join(_bytes_at(sight, index) for index in (302, 304))
    if not numbers:
        return _not_seen(saw)
    halves = all(len(data) == 8 and max(data) <= 0xF for data in numbers.values())

    def in_range(data: bytes) -> bool:
        return 50 <= int(bytes(data).hex()[1::2], 16) < 10**8

    if halves and all(in_range(data) and in_range(data[::-1]) for data in numbers.values()):
        return _not_seen(f'they can be read both ways: {saw}')
    return _judged(halves and all(map(in_range, numbers.values())), saw)


@_looking
def _bytes_of_the_cards(sight: MovitracSight) -> Found:
    indices = 13, _CARDS, _STATUS
    terminals, cards, status = (_word_at(sight, index) for index in indices)
    saw = ', '.join(_bytes_at(sight, index) for index in indices)
    if terminals is None or cards is None or status is None:
        return _not_seen(saw)
    in_both = cards[1] in _AT_X20 and cards[2] in _AT_X21 and status[2] == cards[2] << 4 | cards[1]
    empty = not any((terminals[0], terminals[1] >> 3, cards[0], cards[3]))
    return _judged(in_both and empty, saw)


@_looking
def _second_voltage(sight: MovitracSight) -> Found:
    word, saw = _word_at(sight, 287), _bytes_at(sight, 287)
    if word is None:
        return _not_seen(saw)
    number = _decimal(word)
    right = number is not None and number % 100 == 0 and 200 <= number // 100 <= 600
    return _judged(right, saw)


@_looking
def _stop_setpoints(sight: MovitracSight) -> Found:
    most = {298: 2500, 299: 500, 300: 2500, 301: 500}
    words = {index: word for index in most if (word := _word_at(sight, index)) is not None}
    saw = ', '.join(_bytes_at(sight, index) for index in most)
    if not any(map(any, words.values())):
        return _not_seen(f'they are 0, in whatever unit: {saw}')
    numbers = {index: _decimal(word) for index, word in words.items()}
    right = all(number is not None and number <= most[at] for at, number in numbers.items())
    return _judged(right, saw)


@_looking
def _process_data(sight: MovitracSight) -> Found:
    words = [word for index in range(613, 619) if (word := _word_at(sight, index)) is not None]
    saw = ', '.join(_bytes_at(sight, index) for index in range(613, 619))
    if not words:
        return _not_seen(saw)
    if any(any(word[:2]) for word in words):
        return _judged(False, saw)
    if all(word.hex().isdecimal() for word in words):
        return _not_seen(f'they can be read both ways: {saw}')
    return _judged(True, saw)


@_looking
def _manual_operation(sight: MovitracSight) -> Found:
    saw = f'{_bytes_at(sight, 196)}, {_bytes_at(sight, 197)}'
    setting, word = _word_at(sight, 196), _word_at(sight, 197)
    right = setting is not None and _decimal(setting) in (0, 100) and word is not None
    return _judged(right, saw)


@_looking
def _missing_option(sight: MovitracSight) -> Found:
    cards = _word_at(sight, _CARDS)
    saw = f'{_bytes_at(sight, _CARDS)}, {_bytes_at(sight, 600)}'
    code = sight.refused_with(600)
    if cards is None or code is None:
        return _not_seen(saw)
    return _judged((code in _NO_OPTION) is (cards[1] != _FIELDBUS_CARD), saw)


@_looking
def _no_1000_added(sight: MovitracSight) -> Found:
    # P841
    return _judged(sight.refused_with(1205) is not None, _bytes_at(sight, 1205))


@_looking
def _indices_of_the_list(sight: MovitracSight) -> Found:
    illegal = sorted({
        index for parameter in sight.parameters.values()
        if sight.refused_with(index := parameter.at('movitrac').index) == _ILLEGAL_INDEX
    })
    return _judged(not illegal, f'illegal: {", ".join(map(str, illegal)) or "none"}')


@_looking
def _status_numbers(sight: MovitracSight) -> Found:
    word = _word_at(sight, _STATUS)
    remembered, memory = _remembered(sight)
    saw = f'{_bytes_at(sight, _STATUS)}, {memory}'
    if word is None:
        return _not_seen(saw)
    fault, status = word[:2]
    two_digits = _decimal(word[1:2]) in range(_LAST_STATUS + 1)
    if status > _LAST_STATUS and not two_digits:
        return _judged(False, saw)
    if not fault:
        if status < 10 or (status <= _LAST_STATUS and two_digits):
            return _not_seen(f'it can be read both ways: {saw}')
        return _judged(True, saw)
    # binary where that is a code, else two digits
    ways = [fault, _decimal(word[:1])]
    if fault not in _FAULTS:
        ways.reverse()
    is_remembered = [way is not None and 100 * way in remembered for way in ways]
    if not any(is_remembered):
        return _not_seen(f'it is not remembered: {saw}')
    return _judged(is_remembered[0], saw)


# --- behind a PLC ---------------------------------------------------------------------------------


_NO_DATA = 'the PLC has no valid data of the drive'
#: Of the block: the flags, the first word of a longer telegram, and the control word.
_FLAGS, _ALARM_INFORMATION, _STW1, _REGISTERS = 3, 5, 8, 11
_DATA_VALID, _RELEASED, _MORE_VALID = 1 << 0, 1 << 1, 1 << 2
_FAULT_PRESENT = 1 << 3
#: Bits 6 and 0 to 2 of ZSW1 in each of four states [M3 §7.2.2].
_PATTERN, _PATTERNS = 0x47, (0x40, 0x01, 0x03, 0x07)
#: For so long a life counter may stand, s.
_SILENCE = 0.2
#: How often it moves at least, the first reading being one, where it tells anything.
_LEAST_MOVES = 3


def _pattern(sight: BlockSight, patterns: Collection[int]) -> Found:
    shown = sight.shown
    if shown is None:
        return _not_seen(_NO_DATA)
    saw = f'ZSW1: {shown[0]:04X}h'
    if shown[0] & _FAULT_PRESENT:
        return _not_seen(f'a fault is active: {saw}')
    return _judged(shown[0] & _PATTERN in patterns, saw)


@_looking
def _four_patterns(sight: BlockSight) -> Found:
    return _pattern(sight, _PATTERNS)


@_looking
def _profidrive_words(sight: BlockSight) -> Found:
    # the standard has "not ready" as well
    return _pattern(sight, (0, *_PATTERNS))


def _echoes(sight: BlockSight, bits: Mapping[int, int]) -> Found:
    words = sight.block(_REGISTERS)
    if words is None or not words[_FLAGS] & _DATA_VALID:
        return _not_seen(_NO_DATA)
    status, command = words[0], words[_STW1]
    saw = f'STW1: {command:04X}h, ZSW1: {status:04X}h'
    if not words[_FLAGS] & _RELEASED:
        return _not_seen(f'the drive is not released, and may have other words: {saw}')
    came = {bit: bool(status & 1 << bit) for bit in bits}
    sent = {bit: bool(command & 1 << source) for bit, source in bits.items()}
    if came == sent and not any(came.values()):
        return _not_seen(f'they are 0: {saw}')
    return _judged(came == sent, saw)


@_looking
def _two_echoes(sight: BlockSight) -> Found:
    return _echoes(sight, {4: 1, 5: 2})


@_looking
def _three_echoes(sight: BlockSight) -> Found:
    return _echoes(sight, {4: 1, 5: 2, 9: 10})


def _alarm_information(sight: BlockSight) -> int | None:
    shown = sight.shown
    if shown is None or len(shown) <= _ALARM_INFORMATION or not shown[_FLAGS] & _MORE_VALID:
        return None
    return shown[_ALARM_INFORMATION]


@_looking
def _one_alarm_bit(sight: BlockSight) -> Found:
    word, shown = _alarm_information(sight), sight.shown
    if word is None or shown is None:
        return _not_seen('the PLC does not show the longer telegram')
    saw = f'ZSW1: {shown[0]:04X}h, alarm information: {word:04X}h'
    if not shown[0] & _FAULT_PRESENT:
        return _not_seen(f'no fault is active: {saw}')
    # latched, level and hardware; 4 is a warning
    return _judged(bool(word & 0xF), saw)


@_looking
def _longer_telegram(sight: BlockSight) -> Found:
    word, shown = _alarm_information(sight), sight.shown
    if word is None or shown is None:
        return _not_seen('the PLC does not show the longer telegram')
    # bits 5 to 15 are reserved
    return _judged(word < 1 << 5, f'+5 to +7: {_hex(shown[_ALARM_INFORMATION:])}')


@_looking
def _life_counter(sight: BlockSight) -> Found:
    longest = began = last = 0.0
    life, moves = None, 0
    for now, words in sight.watch():
        if not words[_FLAGS] & _DATA_VALID:
            return _not_seen(_NO_DATA)
        if words[2] != life:
            # what stands for good is a PLC that stands
            longest = max(longest, last - began)
            life, began, moves = words[2], now, moves + 1
        last = now
    if moves < _LEAST_MOVES:
        return _not_seen(f'the life counter has moved {moves} times')
    return _judged(longest <= _SILENCE, f'the life counter stood for {longest:.2f} s at most')


# --- on CANopen -----------------------------------------------------------------------------------


#: The status, of which one sub-index acknowledges: 1, or 0 where they begin at 0.
_INVERTER_STATUS, _WITHOUT_ACKNOWLEDGE = 0x2026, 2
_NO_SUB_INDEX = 0x06090011


def _object(sight: CanopenSight, index: int, sub_index: int = 0) -> str:
    data = sight.value(index, sub_index)
    code = sight.aborted_with(index, sub_index)
    came = 'no answer' if code is None else f'abort {code:08X}h'
    return f'{index:04X}h.{sub_index}: {came if data is None else data.hex(" ")}'


@_looking
def _error_log_object(sight: CanopenSight) -> Found:
    indices = 0x2F7C, 0x4F7D
    right = any(sight.value(index) is not None for index in indices)
    return _judged(right, ', '.join(_object(sight, index) for index in indices))


@_looking
def _status_object(sight: CanopenSight) -> Found:
    place = _INVERTER_STATUS, _WITHOUT_ACKNOWLEDGE
    data = sight.value(*place)
    if data is None:
        return _judged(sight.aborted_with(*place) == _NO_SUB_INDEX, _object(sight, *place))
    code = int.from_bytes(data, 'little')
    return _judged(code in sight.model.status_codes, _object(sight, *place))


@_looking
def _drive_profile(sight: CanopenSight) -> Found:
    # StatusWord and the mode
    indices = 0x6041, 0x6061
    right = all(sight.value(index) is not None for index in indices)
    return _judged(right, ', '.join(_object(sight, index) for index in indices))
