# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One screen for people, and one JSON file to send, without name, path and serial number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
import dataclasses
import math
from typing import Any

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.cli.check.readings import Seen
from nfo_sinus_driver.cli.check.sight import Register, Sight, Timing
from nfo_sinus_driver.cli.check.turn import Moment
from nfo_sinus_driver.cli.check.verdict import Verdict
from nfo_sinus_driver.version import VERSION

#: So many registers with something odd are on the screen; the file has all.
_MOST_SHOWN = 12
_EXPECTED = {True: '', False: 'NOT AS EXPECTED: ', None: ''}
#: What tells one drive from all others.
_OWN = (Role.BUS_ADDRESS,)
#: And what those end with that are addresses on another bus.
_ADDRESS = 'address'


def screen(
    seen: Sequence[Seen],
    registers: Sequence[Register],
    timing: Timing,
    refused: str,
    moments: Sequence[Moment],
) -> Iterator[str]:
    """
    Yield the lines for people.

    :param refused: which of the functions 04, 08, 17 and 43 it has; nothing: it speaks no Modbus.
    """
    yield (
        f'line: first byte after {_ms(timing.least)} least, {_ms(timing.median)} median, '
        f'{_ms(timing.p99)} at 99 %'
        + ('' if math.isnan(timing.least_pause) else
           f'; answers after a silence of {_ms(timing.least_pause)}')
    )
    if refused:
        yield f'functions: {refused}'
    answered = [register for register in registers if register.words is not None]
    yield f'parameters: {len(answered)} of {len(registers)} answered'
    odd = [register for register in registers if register.words is None or register.remark]
    for register in odd[:_MOST_SHOWN]:
        code = register.refused_with
        why = register.remark or ('no answer' if code is None else f'refused with {code}')
        words = '' if register.words is None else f' {_words(register.words)}'
        yield f'  {register.index:04X}h {register.key}:{words} {why}'
    if len(odd) > _MOST_SHOWN:
        yield f'  and {len(odd) - _MOST_SHOWN} more'
    for moment in moments:
        yield f'{moment.name}: {_EXPECTED[moment.as_expected]}{moment.saw}'
    for verdict in Verdict:
        of_it = [one for one in seen if one.verdict is verdict]
        if verdict is Verdict.CONFIRMED:
            yield f'{verdict.value}: {_numbers(of_it)}'
            continue
        yield f'{verdict.value}: {"none" if not of_it else ""}'.rstrip()
        for one in of_it:
            yield f'  C{one.reading.number} {one.reading.expectation}: {one.saw}'


def document(
    sight: Sight,
    facts: Mapping[str, Any],
    seen: Sequence[Seen],
    registers: Sequence[Register],
    timing: Timing,
    moments: Sequence[Moment],
) -> Mapping[str, Any]:
    """Return what is sent: nothing of it tells whose drive it is, or which."""
    own = {sight.model.roles[role] for role in _OWN if role in sight.model.roles}
    return {
        'nfo_sinus_driver': VERSION,
        **facts,
        'timing': dataclasses.asdict(timing),
        'readings': [
            {
                'number': one.reading.number, 'verdict': one.verdict.value, 'saw': one.saw,
                'expectation': one.reading.expectation,
            }
            for one in seen
        ],
        'moments': [
            {
                'name': moment.name, 'saw': moment.saw, 'as_expected': moment.as_expected,
                'words': {
                    key: _words(word & 0xFFFF for word in words)
                    for key, words in moment.words.items()
                },
            }
            for moment in moments
        ],
        'registers': [
            {
                'register': f'{register.index:04X}', 'key': register.key,
                'words': None if register.words is None else _words(register.words),
                'refused_with': register.refused_with, 'value': register.value,
                'remark': register.remark,
            }
            for register in registers
            if register.key not in own and not register.key.endswith(_ADDRESS)
        ],
    }


def _numbers(seen: Iterable[Seen]) -> str:
    # a reading may have several rows
    return ', '.join(dict.fromkeys(f'C{one.reading.number}' for one in seen)) or 'none'


def _words(words: Iterable[int]) -> str:
    return ' '.join(f'{word:04X}' for word in words)


def _ms(seconds: float) -> str:
    return '-' if math.isnan(seconds) else f'{1000 * seconds:.1f} ms'
