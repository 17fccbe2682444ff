# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a MOVITRAC shows of its readings over its line."""

from __future__ import annotations

from nfo_sinus_driver.cli.check.sight import MovitracSight
from nfo_sinus_driver.cli.check.verdict import Found, Looks, judged, not_seen

LOOKS = Looks()

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


@LOOKS.add
def _sum_of_all_bytes(sight: MovitracSight) -> Found:
    answer = sight.ask(bytes((0x01, 0x0F)))
    if not answer.frame:
        return not_seen('271: no answer')
    # what is damaged has no sum that is right
    sight.missed.clear()
    return judged(bool(answer.pdu), f'271: {answer.frame.hex(" ")}')


@LOOKS.add
def _sign_in_bcd(sight: MovitracSight) -> Found:
    # P001, P111 and the temperatures of the fault memory
    indices = 4, 98, 402, 411, 420, 429, 438
    numbers = {index: data.hex() for index in indices if (data := sight.value(index)) is not None}
    shown = {index: digits for index, digits in numbers.items() if digits[0] != '0'}
    shown |= {index: digits for index, digits in numbers.items() if not digits[1:].isdecimal()}
    if not shown:
        return not_seen('nothing is below 0')
    right = all(digits[0] in 'f81' and digits[1:].isdecimal() for digits in shown.values())
    return judged(right, ', '.join(_bytes_at(sight, index) for index in shown))


@LOOKS.add
def _fault_codes_by_100(sight: MovitracSight) -> Found:
    numbers, saw = _remembered(sight)
    if not numbers:
        return not_seen(f'no fault is remembered: {saw}')
    return judged(all(100 <= number < 8800 for number in numbers), saw)


@LOOKS.add
def _whole_fault_codes(sight: MovitracSight) -> Found:
    numbers, saw = _remembered(sight)
    if not numbers:
        return not_seen(f'no fault is remembered: {saw}')
    return judged(all(number % 100 == 0 for number in numbers), saw)


@LOOKS.add
def _no_fault_and_codes(sight: MovitracSight) -> Found:
    numbers, saw = _fault_memory(sight)
    kind, saw = _word_at(sight, 271), f'{_bytes_at(sight, 271)}, {saw}'
    if kind is None:
        return not_seen(saw)
    # 0 is no fault, so none stands behind it
    ordered = all(numbers[: sum(map(bool, numbers))])
    # 3000.00, 3100.00 or 5000.00
    return judged(ordered and _decimal(kind) in (300000, 310000, 500000), saw)


@LOOKS.add
def _bytes_of_a_word(sight: MovitracSight) -> Found:
    word, saw = _word_at(sight, _STATUS), _bytes_at(sight, _STATUS)
    if word is None:
        return not_seen(saw)
    fault, status, cards, flags = word
    # binary, or two digits
    numbers = fault <= _LAST_FAULT_BCD
    numbers &= status in range(_LAST_STATUS + 1) or _decimal(word[1:2]) in range(_LAST_STATUS + 1)
    options = cards & 0xF in _AT_X20 and cards >> 4 in _AT_X21
    return judged(numbers and options and flags < 1 << 5, saw)


@LOOKS.add
def _half_bytes(sight: MovitracSight) -> Found:
    # P550 and P551, each 50 at least and 99 999 999 at most
    numbers = {index: data for index in (302, 304) if (data := sight.value(index)) is not None}
    saw = ', '.join(_bytes_at(sight, index) for index in (302, 304))
    if not numbers:
        return not_seen(saw)
    halves = all(len(data) == 8 and max(data) <= 0xF for data in numbers.values())

    def in_range(data: bytes) -> bool:
        return 50 <= int(bytes(data).hex()[1::2], 16) < 10**8

    if halves and all(in_range(data) and in_range(data[::-1]) for data in numbers.values()):
        return not_seen(f'they can be read both ways: {saw}')
    return judged(halves and all(map(in_range, numbers.values())), saw)


@LOOKS.add
def _bytes_of_the_cards(sight: MovitracSight) -> Found:
    indices = 13, _CARDS, _STATUS
    terminals, cards, status = (_word_at(sight, index) for index in indices)
    saw = ', '.join(_bytes_at(sight, index) for index in indices)
    if terminals is None or cards is None or status is None:
        return not_seen(saw)
    in_both = cards[1] in _AT_X20 and cards[2] in _AT_X21 and status[2] == cards[2] << 4 | cards[1]
    empty = not any((terminals[0], terminals[1] >> 3, cards[0], cards[3]))
    return judged(in_both and empty, saw)


@LOOKS.add
def _second_voltage(sight: MovitracSight) -> Found:
    word, saw = _word_at(sight, 287), _bytes_at(sight, 287)
    if word is None:
        return not_seen(saw)
    number = _decimal(word)
    right = number is not None and number % 100 == 0 and 200 <= number // 100 <= 600
    return judged(right, saw)


@LOOKS.add
def _stop_setpoints(sight: MovitracSight) -> Found:
    most = {298: 2500, 299: 500, 300: 2500, 301: 500}
    words = {index: word for index in most if (word := _word_at(sight, index)) is not None}
    saw = ', '.join(_bytes_at(sight, index) for index in most)
    if not any(map(any, words.values())):
        return not_seen(f'they are 0, in whatever unit: {saw}')
    numbers = {index: _decimal(word) for index, word in words.items()}
    right = all(number is not None and number <= most[at] for at, number in numbers.items())
    return judged(right, saw)


@LOOKS.add
def _process_data(sight: MovitracSight) -> Found:
    words = [word for index in range(613, 619) if (word := _word_at(sight, index)) is not None]
    saw = ', '.join(_bytes_at(sight, index) for index in range(613, 619))
    if not words:
        return not_seen(saw)
    if any(any(word[:2]) for word in words):
        return judged(False, saw)
    if all(word.hex().isdecimal() for word in words):
        return not_seen(f'they can be read both ways: {saw}')
    return judged(True, saw)


@LOOKS.add
def _manual_operation(sight: MovitracSight) -> Found:
    saw = f'{_bytes_at(sight, 196)}, {_bytes_at(sight, 197)}'
    setting, word = _word_at(sight, 196), _word_at(sight, 197)
    right = setting is not None and _decimal(setting) in (0, 100) and word is not None
    return judged(right, saw)


@LOOKS.add
def _missing_option(sight: MovitracSight) -> Found:
    cards = _word_at(sight, _CARDS)
    saw = f'{_bytes_at(sight, _CARDS)}, {_bytes_at(sight, 600)}'
    code = sight.refused_with(600)
    if cards is None or code is None:
        return not_seen(saw)
    return judged((code in _NO_OPTION) is (cards[1] != _FIELDBUS_CARD), saw)


@LOOKS.add
def _no_1000_added(sight: MovitracSight) -> Found:
    # P841
    return judged(sight.refused_with(1205) is not None, _bytes_at(sight, 1205))


@LOOKS.add
def _indices_of_the_list(sight: MovitracSight) -> Found:
    illegal = sorted({
        index for parameter in sight.parameters.values()
        if sight.refused_with(index := parameter.at('movitrac').index) == _ILLEGAL_INDEX
    })
    return judged(not illegal, f'illegal: {", ".join(map(str, illegal)) or "none"}')


@LOOKS.add
def _status_numbers(sight: MovitracSight) -> Found:
    word = _word_at(sight, _STATUS)
    remembered, memory = _remembered(sight)
    saw = f'{_bytes_at(sight, _STATUS)}, {memory}'
    if word is None:
        return not_seen(saw)
    fault, status = word[:2]
    two_digits = _decimal(word[1:2]) in range(_LAST_STATUS + 1)
    if status > _LAST_STATUS and not two_digits:
        return judged(False, saw)
    if not fault:
        if status < 10 or (status <= _LAST_STATUS and two_digits):
            return not_seen(f'it can be read both ways: {saw}')
        return judged(True, saw)
    # binary where that is a code, else two digits
    ways = [fault, _decimal(word[:1])]
    if fault not in _FAULTS:
        ways.reverse()
    is_remembered = [way is not None and 100 * way in remembered for way in ways]
    if not any(is_remembered):
        return not_seen(f'it is not remembered: {saw}')
    return judged(is_remembered[0], saw)
