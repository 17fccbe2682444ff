# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A line that brings bytes faster than they are taken: every request ends all the same.

Else the worker of the bus would stay in it, and no stop would be sent any more.
"""

from __future__ import annotations

import contextlib

import pytest
from support.addresses import classic_id, packed, register

from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.interface import Address, LineSettings
from nfo_sinus_driver.link.modbus.ascii import AsciiLink
from nfo_sinus_driver.link.modbus.rtu import RtuLink
from nfo_sinus_driver.link.pairs.classic import ClassicLink
from nfo_sinus_driver.link.pairs.movitrac import MovitracLink

SETTINGS = LineSettings(19200, '8N1', 0.1)
#: How long it takes to have a byte, s: no longer than until the next is there.
BYTE = 5e-4
INDEX = Address('index', 223, None, 4)


class Flood:
    """A port at which a byte is always waiting, from the first request on, or from the start."""

    def __init__(self, *, begun: bool) -> None:
        self.now = 0.0
        self.sent: list[bytes] = []
        self._begun = begun

    def clock(self) -> float:
        return self.now

    def open(self) -> None:
        pass

    close = open

    def write(self, data: bytes) -> None:
        self.sent.append(data)
        self._begun = True

    def read(self, until: float) -> bytes:
        if not self._begun:
            self.now = max(self.now, until)
            return b''
        self.now += BYTE
        assert self.now < 6.0, 'it never ends'
        return b'\x55'

    # as a port of a CAN bus

    trouble = remark = ''
    send = write

    def receive(self, until: float) -> list[Frame]:
        return [Frame(0x7F0, b'')] if self.read(until) else []


WAYS = {
    'rtu': (RtuLink, register(0x0260), packed(0)),
    'ascii': (AsciiLink, register(0x0260), packed(0)),
    'classic': (ClassicLink, classic_id(0x0010), bytes(2)),
    'movitrac': (MovitracLink, INDEX, bytes(4)),
    'canopen': (CanopenLink, Address('object', 0x2013, 0, 2), bytes(2)),
}


@pytest.mark.parametrize('begun', [False, True], ids=['from the request on', 'from the start'])
@pytest.mark.parametrize('way', WAYS)
def test_every_request_ends_and_a_write_is_sent(way: str, begun: bool) -> None:
    make, address, data = WAYS[way]
    port = Flood(begun=begun)
    link = make(port, SETTINGS, port.clock)
    link.open()
    for ask in (lambda: link.read(1, address), lambda: link.write(1, address, data)):
        sent, before = len(port.sent), port.now
        with contextlib.suppress(LinkError):
            ask()
        assert port.now < before + 2.0
    assert len(port.sent) > sent
    if way == 'classic':
        link.write(95, address, data)
        assert port.now < before + 3.0
