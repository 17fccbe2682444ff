# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The protocols, their factory settings, and the settings of a line.

The link of a protocol is loaded when it is opened: a driver uses only one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import importlib
from typing import Protocol, cast

from nfo_sinus_driver.link.interface import BAUD_RATES, LineProtocol, LineSettings, Link
from nfo_sinus_driver.setting import FIXED, setting

#: The addresses of drives on Modbus [M0 §6.2.2].
_MODBUS_UNITS = range(1, 248)
#: Modbus TCP: a device that is no gateway answers as this one, or as 0 [Modbus Messaging on TCP/IP
#: Implementation Guide §4.4.2.2]. Behind a gateway 0 is all drives of its line.
_NO_GATEWAY = 255
#: Classic: the address at which a drive that is alone on its line answers, whatever its own is.
POINT_TO_POINT = 0
#: Classic: the address that all drives obey and none answers.
BROADCAST = 95

MODBUS_RTU = LineProtocol(
    name='modbus_rtu',
    link='modbus.rtu.RtuLink',
    addressing='modbus',
    units=_MODBUS_UNITS,
    baud_rate=19200,
    char_format='8E1',
    # more than the manuals of the shipped drives have, for drives that files describe
    baud_rates=(*BAUD_RATES, 115_200),
    char_formats=('8E1', '8O1', '8N2', '8N1', '8E2', '8O2'),
    has_parts=True,
    identifies=True,
    writes_and_reads=True,
)
MODBUS_ASCII = LineProtocol(
    name='modbus_ascii',
    link='modbus.ascii.AsciiLink',
    addressing='modbus',
    units=_MODBUS_UNITS,
    baud_rate=19200,
    char_format='7E1',
    char_formats=('7E1', '7O1', '7N2', '7N1', '7E2', '7O2'),
    has_parts=True,
    identifies=True,
    writes_and_reads=True,
)
MODBUS_TCP = LineProtocol(
    name='modbus_tcp',
    link='modbus.tcp.TcpLink',
    addressing='modbus',
    units=(0, *_MODBUS_UNITS, _NO_GATEWAY),
    point_to_point=0,
    # the line behind a gateway is set in the gateway
    baud_rate=19200,
    char_format='8E1',
    has_parts=True,
    identifies=True,
    writes_and_reads=True,
    most_requests=50.0,
    carries=frozenset(('telegram1',)),
    check='the address in the drive (a drive or PLC that is at the network itself may answer as '
    'unit 255 alone: set address to that, or to 0), and in the gateway: protocol, RS232 or RS485, '
    'baud rate and parity of its line',
)
CLASSIC = LineProtocol(
    name='classic',
    link='pairs.classic.ClassicLink',
    addressing='classic',
    units=range(POINT_TO_POINT, BROADCAST),
    baud_rate=9600,
    char_format='7E1',
    char_formats=('7E1', '7O1', '7N2', '8E1', '8O1', '8N2', '8N1'),
    has_parts=True,
    broadcast=BROADCAST,
    point_to_point=POINT_TO_POINT,
)
MOVITRAC = LineProtocol(
    name='movitrac',
    link='pairs.movitrac.MovitracLink',
    addressing='movitrac',
    # P842 [M4 §2.3.1]
    units=range(64),
    baud_rate=9600,
    char_format='8N1',
    baud_rates=(9600,),
    char_formats=('8N1',),
    check='power, the interface (USS 11A or UST 11A on X4, or terminals 67/68 of the option '
    'on X20), master-slave operation off (P880 = No), the address (P842), A and B of the '
    'wires, 9600 bit/s 8N1 in a device server',
)
CANOPEN = LineProtocol(
    name='canopen',
    link='canopen.link.CanopenLink',
    addressing='canopen',
    units=range(1, 128),
    baud_rate=125_000,
    char_format='8N1',
    baud_rates=(10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000),
    identifies=True,
    rates_disturb=True,
    check='power, the node id, the bit rate, CAN_H and CAN_L, 120 ohms at each end of the bus '
    'and nowhere else, and that the interface is up (ip -details link show)',
)

#: The values of the driver's ``protocol`` parameter, and their protocols.
PROTOCOLS: Mapping[str, LineProtocol] = {
    protocol.name: protocol
    for protocol in (MODBUS_RTU, MODBUS_ASCII, MODBUS_TCP, CLASSIC, MOVITRAC, CANOPEN)
}
#: The bit rates of all of them.
BIT_RATES = tuple(sorted({rate for each in PROTOCOLS.values() for rate in each.baud_rates}))
#: Which addresses a drive may have, as text.
ADDRESSES = '; '.join(
    dict.fromkeys(
        f'{protocol.name if protocol is MODBUS_TCP else protocol.addressing} {protocol.unit_spans}'
        + f' ({protocol.point_to_point}: alone on its line)' * (protocol.point_to_point is not None)
        for protocol in PROTOCOLS.values()
    )
)


class _LinkClass(Protocol):
    """The class of a link."""

    def on_port(self, port: str, settings: LineSettings, trace: str = '') -> Link:
        """Return the link on a port; it is not open yet."""


def link_class(protocol: LineProtocol) -> _LinkClass:
    """Return the link class of a protocol."""
    module, _, name = protocol.link.rpartition('.')
    return cast('_LinkClass', getattr(importlib.import_module(f'{__package__}.{module}'), name))


def protocol_of(name: str) -> LineProtocol:
    """
    Return a protocol.

    :raises ValueError: there is none of that name; the message says which ones there are.
    """
    if name not in PROTOCOLS:
        raise ValueError(f'unknown protocol {name!r}: choose one of {", ".join(PROTOCOLS)}')
    return PROTOCOLS[name]


@dataclass(frozen=True)
class BusSettings:
    """The settings of a line; the fields are parameters of the bus node, fixed at the start."""

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
        zero='the factory setting of the described drive, or of the protocol',
        also=f'0 or one of {", ".join(map(str, BIT_RATES))}, as the protocol has it',
        change=FIXED,
    )
    char_format: str = setting(
        '',
        'data bits, parity and stop bits, those of the drive',
        zero='the factory setting of the described drive, or of the protocol',
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
    request_gap: float = setting(
        0.0,
        'least silence before each request, a stop, too, for a gateway or drive that loses what '
        'follows too soon; not with canopen',
        0, 1, unit='s', zero='that of the protocol',
        change=FIXED,
    )
    rs485: bool = setting(
        False,
        'let the port itself switch the RS-485 transmitter; most adapters do it by themselves',
        change=FIXED,
    )
    trace: str = setting(
        '',
        'a file to which each frame of the line is written, with its time, as the simulator does',
        zero='none',
        change=FIXED,
    )

    @property
    def line(self) -> LineSettings:
        """
        The settings of the serial line, by default the factory settings of the protocol.

        :raises ValueError: no such protocol, or a setting that no drive has; the message says
            which ones there are.
        """
        usual = protocol_of(self.protocol)
        return LineSettings(
            self.baud_rate or usual.baud_rate,
            self.char_format or usual.char_format,
            self.response_timeout,
            self.rs485,
            self.request_gap,
        )

    def open(self) -> Link:
        """
        Return the link; it is not open yet.

        :raises ValueError: settings with which it can never work, see :func:`open_link`.
        """
        return open_link(self.protocol, self.port, self.line, self.trace)


def open_link(protocol: str, port: str, settings: LineSettings, trace: str = '') -> Link:
    """
    Return the link for a protocol on a port; it is not open yet.

    :param port: a device path, or a URL of pyserial (``socket://host:port``); ``host:port`` of
        the gateway for ``modbus_tcp``, where only the ``response_timeout`` of the settings counts;
        for ``canopen`` the name of a CAN interface, such as ``can0``, too.
    :param trace: a file to which each frame is written; ``''``: none.
    :raises ValueError: no such protocol or kind of URL, or a setting with which the protocol can
        never work; the message says what can.
    """
    found = protocol_of(protocol)
    found.require_baud_rate(settings.baud_rate)
    found.require_char_format(settings.char_format)
    return link_class(found).on_port(port, settings, trace)
