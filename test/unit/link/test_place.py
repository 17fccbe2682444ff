# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Whether a port that is back is where it was before."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path
import tty

import pytest

from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.ports import place
from nfo_sinus_driver.link.ports.place import place_of_interface, place_of_tty
from nfo_sinus_driver.link.ports.port import port_of

_HUB = 'devices/pci0000:00/0000:00:14.0/usb1/1-2'
_FTDI = {'idVendor': '0403', 'idProduct': '6001', 'serial': 'A50285BI'}


class Sysfs:
    """What Linux shows of adapters."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._numbers: dict[str, int] = {}

    def plug(self, socket: str, adapter: dict[str, str], way: str, number: int = 0) -> str:
        """Plug in a USB adapter; return where its terminal is."""
        usb = self._root / _HUB / socket
        for name, text in adapter.items():
            self._write(usb / name, text)
        name = way.rpartition('/')[2]
        found = usb / way
        self._write(found / 'uevent', '')
        if 'ttyUSB' in way:
            (found / 'device').symlink_to(usb / way.removesuffix(f'/tty/{name}'))
            self._write(found / 'device' / 'port_number', str(number))
        return self.show(found)

    def show(self, found: Path) -> str:
        """Have it listed; return the place of the terminal that has that number."""
        entries = self._root / 'dev' / 'char'
        entries.mkdir(parents=True, exist_ok=True)
        minor = self._numbers.setdefault(str(found), len(self._numbers))
        (entries / f'188:{minor}').symlink_to(found)
        return place_of_tty(os.makedev(188, minor))

    def board(self, way: str) -> str:
        """Return where a terminal is that is a part of the computer."""
        found = self._root / 'devices' / way
        self._write(found / 'uevent', '')
        return self.show(found)

    def interface(self, socket: str, channel: int, name: str = 'can0') -> str:
        """Plug in a CAN adapter of several channels; return where this one is."""
        found = self._root / _HUB / socket / f'{socket}:1.0' / 'net' / name
        self._write(self._root / _HUB / socket / 'idVendor', '1d50')
        self._write(found / 'dev_id', hex(channel))
        return self.show_interface(found)

    def show_interface(self, found: Path) -> str:
        """Have a network interface listed; return its place."""
        self._write(found / 'uevent', '')
        entries = self._root / 'class' / 'net'
        entries.mkdir(parents=True, exist_ok=True)
        (entries / found.name).unlink(missing_ok=True)
        (entries / found.name).symlink_to(found)
        return place_of_interface(found.name)

    @staticmethod
    def _write(path: Path, text: str) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f'{text}\n', encoding='ascii')


@pytest.fixture
def sysfs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Sysfs:
    monkeypatch.setattr(place, '_SYS', tmp_path)
    return Sysfs(tmp_path)


def test_an_adapter_in_the_same_socket_by_any_name(sysfs: Sysfs) -> None:
    before = sysfs.plug('1-2.3', _FTDI, '1-2.3:1.0/ttyUSB0/tty/ttyUSB0')
    assert before and before == sysfs.plug('1-2.3', _FTDI, '1-2.3:1.0/ttyUSB7/tty/ttyUSB7')
    modem = sysfs.plug('1-2.4', _FTDI, '1-2.4:1.0/tty/ttyACM0')
    assert modem and modem == sysfs.plug('1-2.4', _FTDI, '1-2.4:1.0/tty/ttyACM1')


def test_an_adapter_without_a_serial_number(sysfs: Sysfs) -> None:
    adapter = {'idVendor': '1a86', 'idProduct': '7523'}
    before = sysfs.plug('1-2.3', adapter, '1-2.3:1.0/ttyUSB0/tty/ttyUSB0')
    assert before and before == sysfs.plug('1-2.3', adapter, '1-2.3:1.0/ttyUSB1/tty/ttyUSB1')


@pytest.mark.parametrize(
    ('socket', 'adapter', 'interface', 'number'),
    [
        ('1-2.4', {}, 0, 0),
        ('1-2.3', {'idVendor': '067b'}, 0, 0),
        ('1-2.3', {'idProduct': '6011'}, 0, 0),
        ('1-2.3', {'serial': 'A50285BJ'}, 0, 0),
        # an adapter with several ports
        ('1-2.3', {}, 1, 0),
        ('1-2.3', {}, 0, 1),
    ],
)
def test_another_socket_or_adapter(
    sysfs: Sysfs, socket: str, adapter: dict[str, str], interface: int, number: int
) -> None:
    before = sysfs.plug('1-2.3', _FTDI, '1-2.3:1.0/ttyUSB0/tty/ttyUSB0')
    way = f'{socket}:1.{interface}/ttyUSB1/tty/ttyUSB1'
    assert sysfs.plug(socket, _FTDI | adapter, way, number) not in (before, '')


def test_ports_that_are_parts_of_the_computer(sysfs: Sysfs) -> None:
    ports = [sysfs.board(f'platform/serial8250/tty/ttyS{number}') for number in (0, 1)]
    assert len(set(ports)) == 2 and all(ports)


def test_what_has_a_program_behind_it_has_no_place(sysfs: Sysfs, tmp_path: Path) -> None:
    assert sysfs.board('virtual/tty/tnt0') == ''
    assert sysfs.show_interface(tmp_path / 'devices/virtual/net/vcan0') == ''


def test_what_is_gone_has_no_place(sysfs: Sysfs) -> None:
    assert place_of_tty(os.makedev(188, 9)) == '' and place_of_interface('can9') == ''


def test_a_can_interface(sysfs: Sysfs) -> None:
    before = sysfs.interface('1-2.3', 0)
    assert before and before == sysfs.interface('1-2.3', 0)
    assert len({before, sysfs.interface('1-2.4', 0), sysfs.interface('1-2.3', 1)}) == 3


@pytest.fixture
def device() -> Iterator[str]:
    far, near = os.openpty()
    tty.setraw(near)
    yield os.ttyname(near)
    os.close(far)
    os.close(near)


def test_a_pseudo_terminal_by_a_name_that_lasts_alone(device: str, tmp_path: Path) -> None:
    link = tmp_path / 'line'
    link.symlink_to(device)
    for name, expected in ((str(link), str(link)), (device, '')):
        port = port_of(name, LineSettings())
        port.open()
        port.close()
        assert port.place == expected


@pytest.mark.parametrize(
    ('url', 'is_told'),
    [
        ('socket://server:4001', True),
        ('RFC2217://server:4001', True),
        # these may lead to any device
        ('hwgrep://ttyUSB', False),
        ('spy:///dev/ttyUSB0', False),
    ],
)
def test_a_place_on_the_network_is_host_and_port(url: str, is_told: bool) -> None:
    assert port_of(url, LineSettings()).place == (url if is_told else '')


@pytest.mark.parametrize(
    ('protocol', 'port', 'expected'),
    [
        ('modbus_tcp', '10.0.0.1', '10.0.0.1:502'),
        ('modbus_rtu', 'socket://server:1', 'socket://server:1'),
        ('classic', 'socket://server:1', 'socket://server:1'),
        ('canopen', 'socket://server:1', 'socket://server:1'),
        # not open yet
        ('canopen', 'can0', ''),
    ],
)
def test_every_link_says_where_its_port_is(protocol: str, port: str, expected: str) -> None:
    rates = {'canopen': 125_000, 'classic': 9600}
    formats = {'classic': '7E1', 'canopen': '8N1'}
    settings = LineSettings(rates.get(protocol, 19200), formats.get(protocol, '8E1'))
    assert open_link(protocol, port, settings).place == expected
