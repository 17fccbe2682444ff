# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive is told on its line, by the way there: its run command, and its stop."""

from __future__ import annotations

from collections.abc import Sequence
import itertools

from support.wire import Request
from ways import Way

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.families.sinus_g2.words import Scmd

#: Remote set-point, function bits and inverter status, and the bits CW and enable [M4 §4].
_SIZE, _BITS, _STATUS = 223, 281, 284
_CLOCKWISE, _DIRECTIONS, _ENABLE = 1, 3, 4


def run_command(way: Way) -> Request:
    """Return the request that has the drive at address 1 follow the set-points of the bus."""
    if way.bus == 'movitrac':
        return _movitrac(_BITS, _ENABLE | _CLOCKWISE)
    return _sinus(way, 'fieldbus.scmd', Scmd.FIELDBUS)


def run_commands(way: Way, requests: Sequence[Request]) -> int:
    """Return how often that drive was told to run; function bits are refreshed while it does."""
    if way.bus != 'movitrac':
        return requests.count(run_command(way))
    told = [one.words[1] for one in requests if one.place == _BITS and one.words is not None]
    runs = [bool(bits & _DIRECTIONS) for bits in told]
    return sum(now and not before for before, now in itertools.pairwise([False, *runs]))


def stop_sequence(way: Way) -> list[Request]:
    """Return the requests of a stop at address 1, up to the status that confirms it."""
    if way.bus == 'movitrac':
        read_bits, read_status = (Request(1, place, 1, None) for place in (_BITS, _STATUS))
        return [_movitrac(_SIZE, 0), read_bits, _movitrac(_BITS, _ENABLE), read_status]
    # one place for all set-points on Classic [C11]
    setpoint = 'fieldbus.setpoint' if way.bus == 'classic' else 'status.frq_set'
    status = load_family(way.model)['fieldbus.drive_status'].at(way.bus)
    words = 1 if way.bus == 'classic' else status.codec.size // 2
    return [
        _sinus(way, 'fieldbus.scmd', Scmd.STOP),
        _sinus(way, setpoint, 0),
        Request(1, status.index, words, None),
    ]


def _movitrac(index: int, value: int) -> Request:
    return Request(1, index, 1, (0, value))


def _sinus(way: Way, key: str, word: int) -> Request:
    return Request(1, load_family(way.model)[key].at(way.bus).index, 1, (word,))
