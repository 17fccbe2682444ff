# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A Modbus link on a line in virtual time."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from support.addresses import packed, register
from virtual_wire import Fate, Slave, Wire

from nfo_sinus_driver.link.interface import Address, LineSettings, LinkError, Reply
from nfo_sinus_driver.link.rtu import RtuLink
from nfo_sinus_driver.link.serial_link import SerialLink

TIMEOUT = 0.1
SETTINGS = LineSettings(baud_rate=19200, response_timeout=TIMEOUT)
UNIT = 1
#: Resync reads of one word and of two, as a drive has them.
ONE = register(0x2A5)
TWO = register(0x258, 2)
A = register(0x400)
B = register(0x264)
C = register(0x3EC, 2)
D = register(0x2A8, 2)


class Bench:
    """
    A link on a virtual line; everything done with it happens in virtual time.

    :ivar link_class: which link.
    :ivar wire_class: and on which line.
    """

    link_class: type[SerialLink] = RtuLink
    wire_class: type[Wire] = Wire

    def __init__(
        self,
        fates: list[Fate] | None = None,
        settings: LineSettings = SETTINGS,
        resync: tuple[Address, ...] = (ONE, TWO),
        *,
        trusted: bool = False,
    ) -> None:
        self.wire = self.wire_class(settings)
        self.slave = Slave(self.wire, iter(fates or []))
        self.link = self.link_class(self.wire, settings, self.wire.monotonic)
        self.link.open()
        if not trusted:
            # as behind a line that has sent something twice before
            self.link._late.note_unrequested(self.wire.now)
        self.link.use_resync_reads(UNIT, resync)

    def read(self, address: Address, unit: int = UNIT) -> Reply:
        return self.link.read(unit, address)

    def write(self, address: Address, *words: int, unit: int = UNIT) -> Reply:
        return self.link.write(unit, address, packed(*words))

    def expect(self, error: type[LinkError], action: Callable[[], object]) -> LinkError:
        with pytest.raises(error) as raised:
            action()
        assert type(raised.value) is error
        return raised.value

    def write_and_read(
        self, address: Address, data: bytes, source: Address
    ) -> Reply:
        return self.link.write_and_read(UNIT, address, data, source)

    @property
    def asked(self) -> list[int]:
        """The registers of all requests so far."""
        return [register for _, _, register, _ in self.slave.requests]

    def answer_of(self, number: int) -> bytes:
        """What the slave says to the request with this number."""
        _, _, place, count = self.slave.requests[number]
        return packed(*self.slave.words(place, count, number))
