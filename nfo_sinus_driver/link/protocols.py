# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The link that speaks each protocol, loaded when it is opened: a driver speaks only one."""

from __future__ import annotations

from dataclasses import dataclass
import importlib
from typing import Protocol, cast

from nfo_sinus_driver.link.interface import LineProtocol, LineSettings, Link
from nfo_sinus_driver.link.line_protocols import BIT_RATES, PROTOCOLS
from nfo_sinus_driver.setting import FIXED, setting


class _LinkClass(Protocol):
    """What makes a link of a kind."""

    def on_port(self, port: str, settings: LineSettings) -> Link:
        """Return the link on a port; it is not open yet."""


def link_class(protocol: LineProtocol) -> _LinkClass:
    """Return what makes links of a protocol."""
    module, name = protocol.link.split('.')
    return cast('_LinkClass', getattr(importlib.import_module(f'{__package__}.{module}'), name))


def protocol_of(name: str) -> LineProtocol:
    """
    Return a protocol.

    :raises ValueError: there is none of that name; the message says which there are.
    """
    if name not in PROTOCOLS:
        raise ValueError(f'unknown protocol {name!r}: choose one of {", ".join(PROTOCOLS)}')
    return PROTOCOLS[name]


@dataclass(frozen=True)
class BusSettings:
    """A line and how it is used; the fields are parameters of the bus node, fixed at the start."""

    port: str = setting(
        '/dev/ttyUSB0',
        'the port of the line: a device path, or a pyserial URL such as socket://host:port; for '
        'modbus_tcp host:port of the gateway; for canopen a CAN interface such as can0, too',
        change=FIXED,
    )
    protocol: str = setting(
        'modbus_rtu',
        'the protocol on the line, the one that the drive is set to',
        choices=tuple(PROTOCOLS), change=FIXED,
    )
    baud_rate: int = setting(
        0,
        'bit rate of the line in bit/s, that of the drive',
        zero='the factory setting of the protocol',
        also=f'0 or one of {", ".join(map(str, BIT_RATES))}, as the protocol has it',
        change=FIXED,
    )
    char_format: str = setting(
        '',
        'data bits, parity and stop bits, those of the drive',
        zero='the factory setting of the protocol',
        also='such as 8E1, 8O1, 8N2; with 7 for modbus_ascii',
        change=FIXED,
    )
    response_timeout: float = setting(
        0.2,
        'from the last byte sent to the first byte of the answer',
        0.01, 10.0, unit='s', change=FIXED,
    )
    retries: int = setting(
        2,
        'how often a request is repeated when there is no response and repeating is safe',
        0, 10, change=FIXED,
    )
    max_requests: float = setting(
        50.0,
        'with modbus_tcp: how many requests the PLC or gateway is sent a second at most, because '
        'it has other work; stops are sent at once',
        0, 10000, unit='Hz', zero='no limit',
        change=FIXED,
    )
    rs485: bool = setting(
        False,
        'let the port itself switch the RS-485 transmitter; most adapters do it by themselves',
        change=FIXED,
    )

    @property
    def line(self) -> LineSettings:
        """
        How the line is set, with the factory settings of the protocol where nothing else is said.

        :raises ValueError: no such protocol, or a setting that no drive has; the message says
            which there are.
        """
        usual = protocol_of(self.protocol)
        return LineSettings(
            self.baud_rate or usual.baud_rate,
            self.char_format or usual.char_format,
            self.response_timeout,
            self.rs485,
        )

    def open(self) -> Link:
        """
        Return the link; it is not open yet.

        :raises ValueError: settings with which it can never work, see :func:`open_link`.
        """
        return open_link(self.protocol, self.port, self.line)


def open_link(protocol: str, port: str, settings: LineSettings) -> Link:
    """
    Return the link for a protocol on a port; it is not open yet.

    :param port: a device path, or a URL of pyserial (``socket://host:port``); ``host:port`` of
        the gateway for ``modbus_tcp``, where only the ``response_timeout`` of the settings counts;
        for ``canopen`` the name of a CAN interface, such as ``can0``, too.
    :raises ValueError: no such protocol or kind of URL, or a setting with which the protocol can
        never work; the message says what can.
    """
    found = protocol_of(protocol)
    found.require_baud_rate(settings.baud_rate)
    found.require_char_format(settings.char_format)
    return link_class(found).on_port(port, settings)
