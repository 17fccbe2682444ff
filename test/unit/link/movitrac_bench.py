# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The link of the MOVITRAC's protocol on a line in virtual time."""

from __future__ import annotations

from typing import TypeVar

from movitrac_far_end import FarEnd, Fate
from virtual_wire import Wire

from nfo_sinus_driver.link.interface import Address, LineSettings, Reply
from nfo_sinus_driver.link.movitrac import MovitracLink

TIMEOUT = 0.2
SETTINGS = LineSettings(baud_rate=9600, char_format='8N1', response_timeout=TIMEOUT)
CHAR = SETTINGS.char_time
UNIT = 1
#: What the link asks where it has to be certain, the first first.
RESYNC = 206
VALUE = bytes.fromhex('00000370')

_T = TypeVar('_T')


def at(index: int, size: int = 4) -> Address:
    """Return the address of a parameter."""
    return Address('index', index, None, size)


A = at(0x19)
B = at(0x11C)
LONG = at(0x107, 8)


class Bench:
    """A link on a virtual line; everything done with it happens in virtual time."""

    def __init__(self, *fates: Fate, settings: LineSettings = SETTINGS) -> None:
        self.wire = Wire(settings)
        self.wire.gap = 2 * settings.char_time
        self.drive = FarEnd(self.wire, iter(fates))
        self.drive.sizes[LONG.index] = 8
        self.link = MovitracLink(self.wire, settings, self.wire.monotonic)
        for unit in self.link.protocol.units:
            self.link.use_resync_reads(unit, tuple(map(at, (206, 207, 0, 4))))
        self.link.open()

    def read(self, address: Address, unit: int = UNIT) -> Reply:
        return self.link.read(unit, address)

    def write(self, address: Address, value: bytes = VALUE, unit: int = UNIT) -> Reply:
        return self.link.write(unit, address, value)

    @property
    def asked(self) -> list[int]:
        """The parameters of all requests so far."""
        return [index for _, index, _, _ in self.drive.requests]

    def answer_of(self, number: int) -> bytes:
        """What the drive answers to the request with this number."""
        return self.drive.value(self.asked[number], number)
