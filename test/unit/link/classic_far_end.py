# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that speaks the Classic protocol, written from the manual without the link's codec."""

from __future__ import annotations

from collections.abc import Callable
import re

from virtual_wire import Asked, FarEnd, Wire

EOT, ENQ, STX, ETX, ACK, NAK = b'\x04', b'\x05', b'\x02', b'\x03', b'\x06', b'\x15'
REQUEST = re.compile(
    rb'\x04([ -\x7f])(?:E([0-9A-F]{4})\x05|\x02(E([0-9A-F]{4})=([0-9A-F]{4})\x03)(.))', re.DOTALL
)
INV_ST, INV_ST_ACK, SIO_ERR = 0xE9, 0xE8, 0xAC
BROADCAST = 95


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


class Drives(FarEnd):
    """
    Drives that speak Classic.

    :ivar values: parameters that have a value of their own.
    :ivar address: what stands in its answers; ``None``: the address that was asked.
    :ivar lower: they write digits in lower case.
    """

    def __init__(self, wire: Wire) -> None:
        super().__init__(wire)
        self.values: dict[int, int | Callable[[], int]] = {}
        self.address: int | None = None
        self.lower = False

    def value(self, place: int, size: int, number: int) -> bytes:
        value = self.values.get(place)
        word = value() if callable(value) else value
        return super().value(place, size, number) if word is None else word.to_bytes(2, 'big')

    def parsed(self, frame: bytes) -> Asked:
        unit, number, written = parsed(frame)
        return Asked(unit, number, 2, None if written is None else written.to_bytes(2, 'big'))

    def answer(self, asked: Asked, frame: bytes, number: int) -> bytes:
        if asked.unit == BROADCAST:
            return b''
        unit = asked.unit if self.address is None else self.address
        if asked.written is not None:
            return verdict(unit, True)
        word = int.from_bytes(self.value(asked.place, 2, number), 'big')
        return reply(unit, asked.place, word, lower=self.lower)

    def refusal(self, asked: Asked, frame: bytes, number: int) -> bytes:
        return verdict(asked.unit if self.address is None else self.address, False)
