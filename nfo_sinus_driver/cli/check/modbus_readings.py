# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive shows of its readings over Modbus."""

from __future__ import annotations

import re

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.cli.check.sight import ModbusSight
from nfo_sinus_driver.cli.check.verdict import Found, Looks, as_hex, judged, not_seen

LOOKS = Looks()

#: Registers of both Sinus [M0 §6.2, M1].
_INV_ST, _DRIVE_STATUS, _MODE, _COMMAND = 0x2A5, 0x258, 0x294, 0x298
_UNKNOWN_REGISTER = 2
#: In no table of any manual.
_NOWHERE = 0xFFF0
_READ_DEVICE = bytes((43, 14, 1, 0))
_REPORT = bytes((17,))
_BY_INPUT = bytes.fromhex('04 02A5 0001')


def _came(sight: ModbusSight, pdu: bytes) -> str:
    answer = sight.ask(pdu)
    if answer.refused_with is not None:
        return f'function {pdu[0]:02}: refused with {answer.refused_with}'
    return f'function {pdu[0]:02}: {"answered" if answer.pdu else "no answer"}'


@LOOKS.add
def _error_log_of_32(sight: ModbusSight) -> Found:
    # an entry is two words, each four registers behind the one before
    register = 0xC000 + 4 * 32
    words = sight.words(register, 2)
    if words is None:
        return judged(sight.words(0xC000, 2) is not None, f'entry 33, {register:04X}h: refused')
    if not any(words):
        return not_seen(f'entry 33, {register:04X}h: answered, and empty')
    return judged(False, f'entry 33, {register:04X}h: {as_hex(words)}')


@LOOKS.add
def _speed_scale(sight: ModbusSight) -> Found:
    numbers = sight.words(0x268, 2), sight.words(0x26A, 2)
    read = [words for words in numbers if words is not None]
    saw = f'0268h: {as_hex(numbers[0])}, 026Ah: {as_hex(numbers[1])}'
    return judged(len(read) == 2 and all(map(any, read)), saw)


@LOOKS.add
def _signed_temperature(sight: ModbusSight) -> Found:
    word = sight.word(0x454)
    if word is None:
        return not_seen('0454h is not answered')
    signed = (word ^ 0x8000) - 0x8000
    saw = f'0454h: {word:04X}h = {signed}'
    if 0 <= signed <= 150:
        return not_seen(f'it is not below 0: {saw}')
    return judged(-100 <= signed < 0, saw)


@LOOKS.add
def _status_of_two_words(sight: ModbusSight) -> Found:
    words = sight.words(_DRIVE_STATUS, 2)
    # the low word stands first
    return judged(words is not None and words[1] == 0, f'0258h: {as_hex(words)}')


@LOOKS.add
def _two_versions(sight: ModbusSight) -> Found:
    pdu = sight.ask(_READ_DEVICE).pdu
    objects, at = {}, 7
    while len(pdu) >= at + 2 and len(pdu) >= at + 2 + pdu[at + 1]:
        objects[pdu[at]] = pdu[at + 2 : at + 2 + pdu[at + 1]]
        at += 2 + pdu[at + 1]
    if 2 not in objects:
        return not_seen(_came(sight, _READ_DEVICE))
    text = objects[2].decode('ascii', 'replace')
    both = [part.strip() for part in text.split('/')]
    right = len(both) == 2 and all(re.fullmatch(r'[0-9.]+', part) for part in both)
    return judged(right, f'object 2: {text!r}')


@LOOKS.add
def _number_as_printed(sight: ModbusSight) -> Found:
    word = sight.word(_INV_ST)
    codes = sight.model.status_codes
    if word is not None:
        return judged(word in codes, f'02A5h: {word:04X}h')
    # not the one below, which acknowledges; the one above is not in the tables
    above = sight.word(_INV_ST + 1)
    return judged(False, f'02A5h: refused, 02A6h: {as_hex(above if above is None else (above,))}')


@LOOKS.add
def _bits_and_code(sight: ModbusSight) -> Found:
    # one register, or two with the low word first
    words = sight.words(_DRIVE_STATUS) or sight.words(_DRIVE_STATUS, 2)
    status, code = words[0] if words else None, sight.word(_INV_ST)
    if status is None or code is None or code not in sight.model.status_codes:
        return not_seen('no status, or no status code of the manual')
    kind = sight.model.status_codes[code].kind
    fault, alarm = bool(status & 1 << 3), bool(status & 1 << 7)
    saw = f'0258h: {status:04X}h, 02A5h: {code} ({kind.value})'
    if kind is Kind.FAULT or kind is Kind.ALARM or fault or alarm:
        return judged((fault, alarm) == (kind is Kind.FAULT, kind is Kind.ALARM), saw)
    return not_seen(f'no fault and no alarm is active: {saw}')


def _mode(sight: ModbusSight, known: range) -> Found:
    word = sight.word(_MODE)
    return judged(word in known, f'0294h: {as_hex(None if word is None else (word,))}')


@LOOKS.add
def _mode_to_3(sight: ModbusSight) -> Found:
    if sight.word(_MODE) in range(1, 4):
        return not_seen(f'it is not 0: 0294h: {sight.word(_MODE):04X}h')
    return _mode(sight, range(4))


@LOOKS.add
def _mode_from_1(sight: ModbusSight) -> Found:
    return _mode(sight, range(1, 4))


@LOOKS.add
def _smode(sight: ModbusSight) -> Found:
    word = sight.word(_COMMAND)
    if word is None:
        return not_seen('0298h cannot be read')
    return judged(word in (0, 0x081, 0x101), f'0298h: {word:04X}h')


@LOOKS.add
def _actual_references(sight: ModbusSight) -> Found:
    frequency, speed = sight.words(0x518), sight.words(0x260)
    saw = f'0518h: {as_hex(frequency)}, 0260h: {as_hex(speed)}'
    return judged(frequency is not None and speed is not None, saw)


@LOOKS.add
def _newer_functions(sight: ModbusSight) -> Found:
    requests = _BY_INPUT, _REPORT, _READ_DEVICE
    has = [sight.ask(pdu).pdu[:1] == pdu[:1] for pdu in requests]
    saw = ', '.join(_came(sight, pdu) for pdu in requests)
    if not any(has):
        return not_seen(f'an older drive has none of them: {saw}')
    return judged(has == [False, True, True], saw)


@LOOKS.add
def _input_registers(sight: ModbusSight) -> Found:
    requests = _BY_INPUT, _REPORT, _READ_DEVICE
    has = [sight.ask(pdu).pdu[:1] == pdu[:1] for pdu in requests]
    return judged(has == [True, False, False], ', '.join(_came(sight, pdu) for pdu in requests))


@LOOKS.add
def _all_registers(sight: ModbusSight) -> Found:
    missing = [
        f'{parameter.at("modbus").index:04X}h'
        for parameter in sight.parameters.values()
        if sight.words(parameter.at('modbus').index, parameter.at('modbus').codec.size // 2) is None
    ]
    return judged(not missing, f'not answered: {", ".join(missing) or "none"}')


@LOOKS.add
def _code_to_63(sight: ModbusSight) -> Found:
    word = sight.word(_INV_ST)
    return judged(word in range(64), f'02A5h: {as_hex(None if word is None else (word,))}')


@LOOKS.add
def _unknown_register(sight: ModbusSight) -> Found:
    answer = sight.read(_NOWHERE)
    if not answer.pdu:
        return not_seen(f'{_NOWHERE:04X}h: no answer')
    saw = f'{_NOWHERE:04X}h: {answer.pdu.hex(" ")}'
    return judged(answer.refused_with == _UNKNOWN_REGISTER, saw)


@LOOKS.add
def _speed_in_every_mode(sight: ModbusSight) -> Found:
    words, mode = sight.words(0x264), sight.words(0x24C)
    return judged(words is not None, f'0264h: {as_hex(words)}, control mode {as_hex(mode)}')


@LOOKS.add
def _reported_id(sight: ModbusSight) -> Found:
    pdu = sight.ask(_REPORT).pdu
    if pdu[:1] != _REPORT:
        return not_seen(_came(sight, _REPORT))
    if len(pdu) < 2:
        return judged(False, 'function 17: nothing behind it')
    count, text = pdu[1], pdu[2:]
    with_run_byte = text[1:2] in (b'\x00', b'\xff') and text[2:].isascii()
    # what it says may have the serial number in it
    saw = f'function 17: {len(text)} bytes, count {count}'
    plain = len(text) == 16 and text.isascii()
    return judged(count == len(text) and (plain or with_run_byte), saw)
