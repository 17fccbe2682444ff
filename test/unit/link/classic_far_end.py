# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that speaks the Classic protocol, written from the manual without the link's codec."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import itertools
import re

from virtual_wire import Wire

EOT, ENQ, STX, ETX, ACK, NAK = b'\x04', b'\x05', b'\x02', b'\x03', b'\x06', b'\x15'
REQUEST = re.compile(
    rb'\x04([ -\x7f])(?:E([0-9A-F]{4})\x05|\x02(E([0-9A-F]{4})=([0-9A-F]{4})\x03)(.))', re.DOTALL
)
INV_ST, INV_ST_ACK, SIO_ERR = 0xE9, 0xE8, 0xAC


def bcc(body: bytes) -> bytes:
    check = 0
    for char in body:
        check ^= char
    return bytes((check,))


def reply(unit: int, number: int, word: int, *, lower: bool = False) -> bytes:
    text = f'E{number:04x}={word:04x}' if lower else f'E{number:04X}={word:04X}'
    body = text.replace('e', 'E', 1).encode() + ETX if lower else text.encode() + ETX
    return bytes((32 + unit,)) + STX + body + bcc(body)


def verdict(unit: int, good: bool) -> bytes:
    return bytes((32 + unit,)) + (ACK if good else NAK)


def parsed(frame: bytes) -> tuple[int, int, int | None]:
    """The address, the parameter, and for a SELECT the value."""
    match = REQUEST.fullmatch(frame)
    assert match, frame
    address, asked, body, written, word, check = match.groups()
    if asked is not None:
        return address[0] - 32, int(asked, 16), None
    assert bcc(body) == check, frame
    return address[0] - 32, int(written, 16), int(word, 16)


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
    :ivar values: parameters that have a value of their own.
    :ivar pace: how long a request takes on the line, in the time that its characters need.
    :ivar address: what stands in its answers; ``None``: the address that was asked.
    """

    def __init__(self, wire: Wire, fates: Iterator[Fate] | None = None) -> None:
        self._wire = wire
        self._fates = fates or itertools.repeat(GOOD)
        self._free = 0.0
        self.requests: list[tuple[int, int, int | None, str]] = []
        self.values: dict[int, int | Callable[[], int]] = {}
        self.address: int | None = None
        self.pace = 1.0
        self.lower = False
        self.before = b''
        self.echo = False
        wire.far_end = self.take

    def heal(self, *fates: Fate) -> None:
        """Answer from now on, but for the next requests' fates."""
        self._fates = iter(fates)

    @staticmethod
    def word(number: int, index: int) -> int:
        """What a parameter holds when the request with this index is carried out."""
        return (number * 7 + index * 131) & 0xFFFF

    def take(self, frame: bytes, end: float) -> None:
        index = len(self.requests)
        unit, number, written = parsed(frame)
        fate = next(self._fates, GOOD)
        self.requests.append((unit, number, written, fate.what))
        if self.echo:
            self._wire.arrive(end - len(frame) * self._wire.settings.char_time, frame)
        if fate.what == 'drop' or unit == 95:
            return
        address = unit if self.address is None else self.address
        if fate.what.startswith('refuse'):
            answer = verdict(address, False)
        elif written is not None:
            answer = verdict(address, True)
        else:
            value = self.values.get(number, self.word(number, index))
            word = value() if callable(value) else value
            answer = reply(address, number, word, lower=self.lower)
        if fate.what == 'damage':
            answer = answer[:-1] + bytes((answer[-1] ^ 1,))
        if fate.what in ('double', 'refuse twice'):
            answer += answer
        end -= (1 - self.pace) * len(frame) * self._wire.settings.char_time
        start = max(self._free, end + fate.delay * self._wire.settings.response_timeout)
        self._free = self._wire.arrive(start, self.before + answer, lump=fate.lump)
