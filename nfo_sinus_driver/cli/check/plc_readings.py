# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive behind a PLC shows of its readings in the block."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from nfo_sinus_driver.cli.check.sight import BlockSight
from nfo_sinus_driver.cli.check.verdict import Found, Looks, as_hex, judged, not_seen

LOOKS = Looks()

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
        return not_seen(_NO_DATA)
    saw = f'ZSW1: {shown[0]:04X}h'
    if shown[0] & _FAULT_PRESENT:
        return not_seen(f'a fault is active: {saw}')
    return judged(shown[0] & _PATTERN in patterns, saw)


@LOOKS.add
def _four_patterns(sight: BlockSight) -> Found:
    return _pattern(sight, _PATTERNS)


@LOOKS.add
def _profidrive_words(sight: BlockSight) -> Found:
    # the standard has "not ready" as well
    return _pattern(sight, (0, *_PATTERNS))


def _echoes(sight: BlockSight, bits: Mapping[int, int]) -> Found:
    words = sight.block(_REGISTERS)
    if words is None or not words[_FLAGS] & _DATA_VALID:
        return not_seen(_NO_DATA)
    status, command = words[0], words[_STW1]
    saw = f'STW1: {command:04X}h, ZSW1: {status:04X}h'
    if not words[_FLAGS] & _RELEASED:
        return not_seen(f'the drive is not released, and may have other words: {saw}')
    came = {bit: bool(status & 1 << bit) for bit in bits}
    sent = {bit: bool(command & 1 << source) for bit, source in bits.items()}
    if came == sent and not any(came.values()):
        return not_seen(f'they are 0: {saw}')
    return judged(came == sent, saw)


@LOOKS.add
def _two_echoes(sight: BlockSight) -> Found:
    return _echoes(sight, {4: 1, 5: 2})


@LOOKS.add
def _three_echoes(sight: BlockSight) -> Found:
    return _echoes(sight, {4: 1, 5: 2, 9: 10})


def _alarm_information(sight: BlockSight) -> int | None:
    shown = sight.shown
    if shown is None or len(shown) <= _ALARM_INFORMATION or not shown[_FLAGS] & _MORE_VALID:
        return None
    return shown[_ALARM_INFORMATION]


@LOOKS.add
def _one_alarm_bit(sight: BlockSight) -> Found:
    word, shown = _alarm_information(sight), sight.shown
    if word is None or shown is None:
        return not_seen('the PLC does not show the longer telegram')
    saw = f'ZSW1: {shown[0]:04X}h, alarm information: {word:04X}h'
    if not shown[0] & _FAULT_PRESENT:
        return not_seen(f'no fault is active: {saw}')
    # latched, level and hardware; 4 is a warning
    return judged(bool(word & 0xF), saw)


@LOOKS.add
def _longer_telegram(sight: BlockSight) -> Found:
    word, shown = _alarm_information(sight), sight.shown
    if word is None or shown is None:
        return not_seen('the PLC does not show the longer telegram')
    # bits 5 to 15 are reserved
    return judged(word < 1 << 5, f'+5 to +7: {as_hex(shown[_ALARM_INFORMATION:])}')


@LOOKS.add
def _life_counter(sight: BlockSight) -> Found:
    longest = began = last = 0.0
    life, moves = None, 0
    for now, words in sight.watch():
        if not words[_FLAGS] & _DATA_VALID:
            return not_seen(_NO_DATA)
        if words[2] != life:
            # what stands for good is a PLC that stands
            longest = max(longest, last - began)
            life, began, moves = words[2], now, moves + 1
        last = now
    if moves < _LEAST_MOVES:
        return not_seen(f'the life counter has moved {moves} times')
    return judged(longest <= _SILENCE, f'the life counter stood for {longest:.2f} s at most')
