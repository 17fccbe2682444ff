# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that speak the MOVITRAC's protocol, written from the manual without the link's codec."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
import itertools

from virtual_wire import Wire

ENQUIRY, SELECT, LONG_SELECT = 0xB5, 0xA9, 0xAD
_REQUESTS = {ENQUIRY: 5, SELECT: 9, LONG_SELECT: 13}
ACK = b'\xd2\xd2'


def sealed(body: bytes) -> bytes:
    """Add the sum of all bytes, without carry [M4 §2.4.3]."""
    total = 0
    for byte in body:
        total += byte
    return body + (total % 256).to_bytes(1, 'big')


def data(index: int, value: bytes) -> bytes:
    start = {4: b'\xc8', 8: b'\xac'}[len(value)]
    return sealed(start + index.to_bytes(2, 'big') + value)


def nack(code: int) -> bytes:
    return sealed(bytes((0xF3, code)))


def parsed(frame: bytes) -> tuple[int, int, bytes | None]:
    """The address, the index, and for a SELECT the value."""
    assert len(frame) == _REQUESTS[frame[0]] and sealed(frame[:-1]) == frame, frame.hex(' ')
    value = None if frame[0] == ENQUIRY else frame[4:-1]
    return frame[1], int.from_bytes(frame[2:4], 'big'), value


@dataclass(frozen=True)
class Fate:
    """
    What becomes of one request.

    :ivar delay: how long the drive takes, in time-outs.
    :ivar what: ``answer``, ``refuse``, ``drop`` (carried out, not answered), ``damage``,
        ``double``, ``refuse twice``.
    """

    delay: float = 0.0
    what: str = 'answer'
    lump: bool = False


GOOD = Fate()


class FarEnd:
    """
    Answers in order, each request as its fate says; a value tells which request it answers.

    :ivar requests: every request that arrived, and the fate that it had.
    :ivar sizes: of the values that are not of 4 bytes.
    :ivar response_time: P843 of every drive, s.
    :ivar pace: how long a request takes on the line, in the time that its characters need.
    :ivar code: the return code with which it refuses.
    :ivar before: what comes before each answer, and after it.
    """

    def __init__(self, wire: Wire, fates: Iterator[Fate] | None = None) -> None:
        self._wire = wire
        self._fates = fates or itertools.repeat(GOOD)
        self._free: dict[int, float] = {}
        self.requests: list[tuple[int, int, bytes | None, str]] = []
        self.sizes: dict[int, int] = {}
        self.response_time = 0.0
        self.pace = 1.0
        self.code = 0x13
        self.before = self.after = b''
        self.echo = False
        wire.far_end = self.take

    def heal(self, *fates: Fate) -> None:
        """Answer from now on, but for the next requests' fates."""
        self.meet(iter(fates))

    def meet(self, fates: Iterator[Fate]) -> None:
        """Meet the next requests with some fates, each decided when its request comes."""
        self._fates = fates

    def value(self, index: int, number: int) -> bytes:
        """What a parameter holds when the request with this number is carried out."""
        return (index * 7 + number * 131).to_bytes(self.sizes.get(index, 4), 'big')

    def take(self, frame: bytes, end: float) -> None:
        number = len(self.requests)
        unit, index, written = parsed(frame)
        fate = next(self._fates, GOOD)
        self.requests.append((unit, index, written, fate.what))
        char_time = self._wire.settings.char_time
        if self.echo:
            self._wire.arrive(end - len(frame) * char_time, frame)
        if fate.what == 'drop':
            return
        if fate.what.startswith('refuse'):
            answer = nack(self.code)
        elif written is not None:
            answer = ACK
        else:
            answer = data(index, self.value(index, number))
        if fate.what == 'damage':
            answer = answer[:-1] + bytes((answer[-1] ^ 1,))
        if fate.what in ('double', 'refuse twice'):
            answer += answer
        end -= (1 - self.pace) * len(frame) * char_time
        delay = self.response_time + fate.delay * self._wire.settings.response_timeout
        start = max(self._free.get(unit, 0.0), end + delay)
        stream = self.before + answer + self.after
        self._free[unit] = self._wire.arrive(start, stream, lump=fate.lump)
