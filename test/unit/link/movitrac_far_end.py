# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that speak the MOVITRAC's protocol, written from the manual without the link's codec."""

from __future__ import annotations

from virtual_wire import Asked, FarEnd, Wire

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


class Drives(FarEnd):
    """
    Drives that speak the MOVITRAC's protocol.

    :ivar sizes: of the values that are not of 4 bytes.
    :ivar code: the return code with which they refuse.
    """

    def __init__(self, wire: Wire) -> None:
        super().__init__(wire)
        self.sizes: dict[int, int] = {}
        self.code = 0x13

    def parsed(self, frame: bytes) -> Asked:
        unit, index, written = parsed(frame)
        return Asked(unit, index, self.sizes.get(index, 4), written)

    def answer(self, asked: Asked, frame: bytes, number: int) -> bytes:
        if asked.written is not None:
            return ACK
        return data(asked.place, self.value(asked.place, asked.size, number))

    def refusal(self, asked: Asked, frame: bytes, number: int) -> bytes:
        return nack(self.code)
