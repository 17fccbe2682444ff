# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The requests on the line that command a drive, by its connection: run command, and stop."""

from __future__ import annotations

from collections.abc import Sequence
import itertools

from connections import Connection
from support.wire import Request

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.families.sinus_g2.words import Scmd

#: Remote set-point, function bits and inverter status, and the bits CW and enable [M4 §4].
_SIZE, _BITS, _STATUS = 223, 281, 284
_CLOCKWISE, _DIRECTIONS, _ENABLE = 1, 3, 4


def run_command(connection: Connection) -> Request:
    """Return the request that has the drive at address 1 follow the set-points of the bus."""
    if connection.bus == 'movitrac':
        return _movitrac(_BITS, _ENABLE | _CLOCKWISE)
    return _sinus(connection, 'fieldbus.scmd', Scmd.FIELDBUS)


def run_commands(connection: Connection, requests: Sequence[Request]) -> int:
    """Return how often that drive was commanded to run; function bits are refreshed meanwhile."""
    if connection.bus != 'movitrac':
        return requests.count(run_command(connection))
    written = [
        request.words[1]
        for request in requests
        if request.place == _BITS and request.words is not None
    ]
    runs = [bool(bits & _DIRECTIONS) for bits in written]
    return sum(now and not before for before, now in itertools.pairwise([False, *runs]))


def stop_sequence(connection: Connection) -> list[Request]:
    """Return the requests of a stop at address 1, up to the status that confirms it."""
    if connection.bus == 'movitrac':
        read_bits, read_status = (Request(1, place, 1, None) for place in (_BITS, _STATUS))
        return [_movitrac(_SIZE, 0), read_bits, _movitrac(_BITS, _ENABLE), read_status]
    # one place for all set-points on Classic [C11]
    setpoint = 'fieldbus.setpoint' if connection.bus == 'classic' else 'status.frq_set'
    status = load_family(connection.model)['fieldbus.drive_status'].at(connection.bus)
    words = 1 if connection.bus == 'classic' else status.codec.size // 2
    return [
        _sinus(connection, 'fieldbus.scmd', Scmd.STOP),
        _sinus(connection, setpoint, 0),
        Request(1, status.index, words, None),
    ]


def _movitrac(index: int, value: int) -> Request:
    return Request(1, index, 1, (0, value))


def _sinus(connection: Connection, key: str, word: int) -> Request:
    return Request(1, load_family(connection.model)[key].at(connection.bus).index, 1, (word,))
