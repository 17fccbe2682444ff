# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus TCP without a gateway: the drive or the PLC answers as unit 255 or 0 alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.described import SHIPPED, DescribedRig
from support.rig import Rig

from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.link import PROTOCOLS

#: Where the unit stands in a frame of Modbus TCP.
_UNIT = 6


def at_the_network(rig: Rig, unit: int) -> None:
    """Have the drive answer as this unit, and as no other."""
    wire, line = rig.line.wire, rig.line
    receive, send = wire.receive, line.send

    def received(frame: bytes, now: float) -> None:
        if frame[_UNIT] == unit:
            receive(frame[:_UNIT] + b'\1' + frame[_UNIT + 1 :], now)

    def sent(data: bytes) -> None:
        send(data[:_UNIT] + bytes((unit,)) + data[_UNIT + 1 :])

    wire.receive = received
    line.send = sent  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ('connection', 'unit'),
    [('tcp', 255), ('telegram1 g2', 255), ('telegram1 g2', 0)],
)
def test_a_device_that_is_no_gateway_is_used_at_its_unit(connection: str, unit: int) -> None:
    rig = Rig(connection, own={1: {'address': unit}})
    at_the_network(rig, unit)
    rig.turn()
    rig.answer(rig.drive.stop())
    rig.wait_until(lambda: not rig.turns, 3.0)
    rig.kill()


def networked(tmp_path: Path) -> Path:
    """A file that describes a drive with a network port of its own."""
    serial = "line:\n  baud_rate: 9600\n  char_format: '8N1'\n"
    text = SHIPPED['abb_acs355'].read_text()
    file = tmp_path / 'mine.vfd.yaml'
    file.write_text(text.replace(serial, 'line:\n  protocol: modbus_tcp\n'))
    return file


def test_unit_0_is_for_what_is_at_the_network_itself(tmp_path: Path) -> None:
    tcp = PROTOCOLS['modbus_tcp']
    for model in ('sinus_g2', 'sinus_optimal', 'auto'):
        with pytest.raises(ValueError, match='behind a gateway that is all drives of its line'):
            DriveSettings(model=model, address=0).require_line(tcp)
    DriveSettings(model=str(networked(tmp_path)), address=0).require_line(tcp)
    DriveSettings(model='sinus_g2', control_method='telegram1', address=0).require_line(tcp)
    for address in (248, 254):
        with pytest.raises(ValueError, match='Modbus has 0 to 247, 255'):
            DriveSettings(address=address).require_line(tcp)
    with pytest.raises(ValueError, match='Modbus has 1 to 247'):
        DriveSettings(address=255).require_line(PROTOCOLS['modbus_rtu'])


def test_nothing_is_written_to_unit_0_before_a_read_was_answered(tmp_path: Path) -> None:
    rig = DescribedRig(networked(tmp_path), 'modbus_tcp', own={1: {'address': 0}})
    at_the_network(rig, 7)
    rig.pass_time(10.0)
    stop = rig.drive.stop()
    rig.pass_time(5.0)
    assert stop.done()
    assert rig.asked
    assert all(data is None for _, _, data in rig.asked)
    rig.kill()


def test_where_no_unit_answers_the_message_says_which_to_try() -> None:
    assert 'unit 255 alone: set address to that, or to 0' in PROTOCOLS['modbus_tcp'].check
