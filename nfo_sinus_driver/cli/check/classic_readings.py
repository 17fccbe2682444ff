# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive shows of its readings over Classic."""

from __future__ import annotations

import re

from nfo_sinus_driver.cli.check.sight import ClassicSight
from nfo_sinus_driver.cli.check.verdict import Found, Looks, judged, not_seen

LOOKS = Looks()


@LOOKS.add
def _classic_error_log(sight: ClassicSight) -> Found:
    # an entry is two words
    number = 0x200 + 2 * 32
    word = sight.word(number)
    if word is None:
        confirmed = sight.is_refused(number) and sight.word(0x200) is not None
        return judged(confirmed, f'entry 33, E{number:04X}: NAK')
    if not word:
        return not_seen(f'entry 33, E{number:04X}: answered, and empty')
    return judged(False, f'entry 33, E{number:04X}: {word:04X}h')


@LOOKS.add
def _both_words_of_the_scale(sight: ClassicSight) -> Found:
    words = [sight.word(number) for number in (0xE1, 0xE2, 0xE3, 0xE4)]
    saw = ', '.join('nothing' if word is None else f'{word:04X}h' for word in words)
    saw = f'E00E1 to E00E4: {saw}'
    if all(word is None for word in words):
        return not_seen(f'an older drive has none of them: {saw}')
    # of each the low word has the higher number
    return judged(None not in words and bool(words[1]) and bool(words[3]), saw)


@LOOKS.add
def _sum_with_the_end(sight: ClassicSight) -> Found:
    answer = sight.ask(bytes((0x00, 0xE9)))
    if not answer.frame:
        return not_seen('E00E9: no answer')
    # without the address, which is the owner's; what is damaged has no sum that is right
    sight.missed.clear()
    return judged(bool(answer.pdu), f'E00E9: {answer.frame[1:].hex(" ")}')


@LOOKS.add
def _own_address_and_upper_case(sight: ClassicSight) -> Found:
    frames = [sight.ask(sight.request(one)).frame for one in sight.parameters.values()]
    digits = b''.join(frame[8:12] for frame in frames if len(frame) > 12)
    if not re.search(rb'[A-Fa-f]', digits):
        return not_seen('no digit of what came is a letter')
    lower = re.search(rb'[a-f]', digits)
    return judged(lower is None, 'digits in lower case' if lower else 'digits in upper case')
