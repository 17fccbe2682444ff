# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A Classic link on a line in virtual time."""

from __future__ import annotations

from typing import TypeVar

from classic_far_end import FarEnd, Fate
import pytest
from support.addresses import classic_id, packed
from virtual_wire import Wire

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.link.classic import ClassicLink
from nfo_sinus_driver.link.interface import Address, LineSettings, Refused, Reply

TIMEOUT = 0.1
SETTINGS = LineSettings(baud_rate=9600, char_format='7E1', response_timeout=TIMEOUT)
UNIT = 1
MODE = 0x29
A = classic_id(0x1E)
B = classic_id(0xB6)
#: OpTime, as the manual prints it: the low word first.
LONG = classic_id(0x27, 0x127)

_T = TypeVar('_T')
_G2 = load_family('sinus_g2')


def know_g2(link: ClassicLink) -> None:
    """Have a link know what a Sinus G2 is, at each address."""

    def at(key: str) -> Address:
        return Address(*_G2[key].at('classic').place)

    why = _G2.profile.why_refused
    assert why is not None
    for unit in link.protocol.units:
        link.use_resync_reads(
            unit,
            tuple(map(at, _G2.profile.resync_reads['classic'])),
            lambda read, before: why(lambda key: read(at(key)), before),
        )


class Bench:
    """A link on a virtual line; everything done with it happens in virtual time."""

    def __init__(self, *fates: Fate, settings: LineSettings = SETTINGS, unit: int = UNIT) -> None:
        self.wire = Wire(settings)
        self.drive = FarEnd(self.wire, iter(fates))
        self.link = ClassicLink(self.wire, settings, self.wire.monotonic)
        know_g2(self.link)
        self.unit = unit
        self.link.open()

    def read(self, address: Address, unit: int | None = None) -> Reply:
        return self.link.read(self.unit if unit is None else unit, address)

    def write(self, address: Address, *words: int, unit: int | None = None) -> Reply:
        unit = self.unit if unit is None else unit
        return self.link.write(unit, address, packed(*words))

    def refused(self, code: int, *words: str) -> Refused:
        with pytest.raises(Refused) as raised:
            self.write(A, 5)
        assert raised.value.code == code
        for word in words:
            assert word in str(raised.value)
        return raised.value

    @property
    def asked(self) -> list[int]:
        """The parameters of all requests so far."""
        return [number for _, number, _, _ in self.drive.requests]

    def answer_of(self, index: int) -> bytes:
        """What the drive answers to the request with this index."""
        return packed(self.drive.word(self.asked[index], index))
