# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The least that a master in Python can do; a process of its own.

Sends the requests of a cycle over and over: raw descriptor, ``select``, answers of known length, a
sleep of t3.5 before each request. It makes each request, and checks and reads each answer. It runs
until it is ended.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import reduce
import itertools
from operator import xor
import os
import select
import struct
import time
import tty

import recorded_cycle

_TIMEOUT = 0.5
_POLYNOMIAL = 0xA001


def _crc_entry(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ (_POLYNOMIAL if value & 1 else 0)
    return value


_CRC = [_crc_entry(value) for value in range(256)]


def crc(data: bytes) -> int:
    """Return the check sum of Modbus RTU; 0 of a frame that ends with its own."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _CRC[(value ^ byte) & 0xFF]
    return value


def ask_rtu(request: bytes) -> bytes:
    """Return a request with its check sum."""
    return request[:-2] + struct.pack('<H', crc(request[:-2]))


def words_rtu(answer: bytes) -> tuple[int, ...]:
    """Return the words of an answer to a read."""
    if crc(answer):
        raise SystemExit(f'damaged on a perfect line: {answer.hex()}')
    return struct.unpack(f'>{len(answer) // 2 - 2}H', answer[3:-2])


def ask_classic(request: bytes) -> bytes:
    """Return an ENQUIRY, which has no check sum."""
    return bytes(request)


def words_classic(answer: bytes) -> tuple[int, ...]:
    """Return the word of a REPLY."""
    if reduce(xor, answer[2:]):
        raise SystemExit(f'damaged on a perfect line: {answer.hex()}')
    return (int(answer[8:12], 16),)


def ask_movitrac(request: bytes) -> bytes:
    """Return an ENQUIRY with its check sum."""
    return request[:-1] + bytes((sum(request[:-1]) & 0xFF,))


def words_movitrac(answer: bytes) -> tuple[int, ...]:
    """Return the words of a DATA."""
    if sum(answer[:-1]) & 0xFF != answer[-1]:
        raise SystemExit(f'damaged on a perfect line: {answer.hex()}')
    return struct.unpack(f'>{len(answer) // 2 - 2}H', answer[3:-1])


#: How a request is made, and how its answer is read.
_CODECS: dict[str, tuple[Callable[[bytes], bytes], Callable[[bytes], tuple[int, ...]]]] = {
    'modbus_rtu': (ask_rtu, words_rtu),
    'classic': (ask_classic, words_classic),
    'movitrac': (ask_movitrac, words_movitrac),
}


def main() -> None:
    """Run until somebody ends it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('protocol', choices=_CODECS)
    parser.add_argument('port')
    parser.add_argument('gap', type=float, help='between an answer and the next request, s')
    parser.add_argument('cycle')
    options = parser.parse_args()
    cycle = recorded_cycle.load(options.cycle)
    ask, words = _CODECS[options.protocol]
    gap = options.gap
    port = os.open(options.port, os.O_RDWR | os.O_NOCTTY)
    tty.setraw(port)
    for request, length in itertools.cycle(cycle):
        os.write(port, ask(request))
        answer = b''
        while len(answer) < length:
            if not select.select((port,), (), (), _TIMEOUT)[0]:
                raise SystemExit(f'no answer on a perfect line to {request.hex()}')
            answer += os.read(port, length - len(answer))
        words(answer)
        if gap:
            time.sleep(gap)


if __name__ == '__main__':
    main()
