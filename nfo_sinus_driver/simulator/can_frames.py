# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""Frames of a CAN bus, and how long each takes on the wire (ISO 11898-1)."""

from __future__ import annotations

from collections.abc import Iterator
import functools
from typing import NamedTuple

#: The identifiers of standard frames, and of extended ones.
STANDARD, EXTENDED = range(1 << 11), range(1 << 29)
#: The most bytes that a frame carries.
MOST_DATA = 8

_CRC = 0x4599
_CRC_BITS = 15
#: As many equal bits as this are followed by one of the other kind.
_RUN = 5
#: What is not stuffed: delimiters, acknowledgement, end of frame, and the pause behind it.
_UNSTUFFED = 1 + 2 + 7 + 3
#: An error flag that all others join, its delimiter, and the pause behind it.
ERROR_BITS = 12 + 8 + 3


class Frame(NamedTuple):
    """
    A frame.

    :ivar identifier: of :data:`STANDARD`, or of :data:`EXTENDED`; the least has precedence.
    :ivar data: what it carries; of a remote frame nothing that counts, but as many bytes.
    :ivar remote: it asks for a frame.
    :ivar extended: its identifier has 29 bits.
    """

    identifier: int
    data: bytes = b''
    remote: bool = False
    extended: bool = False


@functools.lru_cache(maxsize=4096)
def bits(frame: Frame) -> int:
    """Return how many bits a frame has on the wire, with stuffed ones and the pause behind it."""
    sent = list(_head(frame))
    if not frame.remote:
        sent += _bits_of(int.from_bytes(frame.data, 'big'), 8 * len(frame.data))
    sent += _bits_of(_check_sum(sent), _CRC_BITS)
    stuffed, last, run = 0, -1, 0
    for bit in sent:
        run = run + 1 if bit == last else 1
        last = bit
        if run == _RUN:
            # the stuffed bit is the first of the next run
            stuffed, last, run = stuffed + 1, 1 - bit, 1
    return len(sent) + stuffed + _UNSTUFFED


def _head(frame: Frame) -> Iterator[int]:
    """Give the bits from the start of a frame to its length."""
    yield 0
    if frame.extended:
        yield from _bits_of(frame.identifier >> 18, 11)
        yield from (1, 1)
        yield from _bits_of(frame.identifier & 0x3FFFF, 18)
        yield from (int(frame.remote), 0, 0)
    else:
        yield from _bits_of(frame.identifier, 11)
        yield from (int(frame.remote), 0, 0)
    yield from _bits_of(len(frame.data), 4)


def _bits_of(number: int, count: int) -> Iterator[int]:
    return (number >> place & 1 for place in reversed(range(count)))


def _check_sum(sent: list[int]) -> int:
    found = 0
    for bit in sent:
        inverted = bit ^ found >> _CRC_BITS - 1
        found = found << 1 & (1 << _CRC_BITS) - 1
        if inverted:
            found ^= _CRC
    return found
