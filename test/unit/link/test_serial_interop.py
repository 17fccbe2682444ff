# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Our serial links talk to pymodbus's own server."""

from __future__ import annotations

from collections.abc import Iterator

from pymodbus_server import REGISTERS, serial_server
import pytest
from support.addresses import packed, register
from support.plans import followed

from nfo_sinus_driver.link import BusSettings, Link, Refused

ONE = register(0x2A5)
TWO = register(0x258, 2)


@pytest.fixture(scope='module', params=['rtu', 'ascii'])
def link(request: pytest.FixtureRequest) -> Iterator[Link]:
    protocol = f'modbus_{request.param}'
    with serial_server(request.param) as path:
        link = BusSettings(path, protocol, response_timeout=5.0).open()
        link.use_resync_reads(1, (ONE, TWO))
        link.open()
        yield link
        link.close()


def test_read(link: Link) -> None:
    assert link.read(1, ONE).data == packed(0x2A5)
    assert link.read(1, TWO).data == packed(0x258, 0x259)
    assert link.read(2, TWO).data == packed(0x258, 0x259)


def test_write_and_read_back(link: Link) -> None:
    assert link.write(1, register(0x400), packed(0xABCD)).data == b''
    assert link.write(1, register(0x410, 2), packed(0x3A0D, 0x0A3A)).data == b''
    assert link.read(1, register(0x400)).data == packed(0xABCD)
    assert link.read(1, register(0x410, 2)).data == packed(0x3A0D, 0x0A3A)
    # and one drive is not another
    assert link.read(2, register(0x400)).data == packed(0x400)


def test_write_and_read_at_once(link: Link) -> None:
    reply = link.write_and_read(1, register(0x420), packed(7), register(0x420, 2))
    assert reply.data == packed(7, 0x421)


def test_refusal(link: Link) -> None:
    with pytest.raises(Refused) as refusal:
        link.read(1, register(REGISTERS[-1] + 1))
    assert refusal.value.code == Refused.ILLEGAL_ADDRESS


def test_identification(link: Link) -> None:
    # not every version has function 17
    found = followed(link.identify(1))
    assert found.product == 'NFO Sinus'
    assert found.model == '1.50/400'
    assert found.revision == '4.30 / 4018'
