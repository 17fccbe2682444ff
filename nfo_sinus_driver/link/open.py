# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Choose the link for a protocol and a port."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import re
from urllib.parse import urlsplit

from nfo_sinus_driver.link.ascii_link import AsciiLink
from nfo_sinus_driver.link.classic_link import ClassicLink
from nfo_sinus_driver.link.interface import Link
from nfo_sinus_driver.link.rtu_link import RtuLink
from nfo_sinus_driver.link.serial_port import SerialPort
from nfo_sinus_driver.link.settings import LineSettings
from nfo_sinus_driver.link.tcp_link import TcpLink
from nfo_sinus_driver.link.url_port import UrlPort


@dataclass(frozen=True)
class Factory:
    """
    How a drive leaves the factory.

    :ivar baud_rate: bit/s.
    :ivar char_format: such as ``8E1``.
    :ivar data_bits: what the protocol can do; ``None`` for both, and where the line is not ours.
    """

    baud_rate: int
    char_format: str
    data_bits: int | None


#: What the driver's ``protocol`` parameter takes [M0 §6.2.2].
PROTOCOLS: Mapping[str, Factory] = {
    'modbus_rtu': Factory(19200, '8E1', 8),
    'modbus_ascii': Factory(19200, '7E1', 7),
    # the line behind a gateway has the settings of the gateway
    'modbus_tcp': Factory(19200, '8E1', None),
    # [M0 §6.1.2], [C6]
    'classic': Factory(9600, '7E1', None),
}
#: Where gateways listen.
MODBUS_TCP_PORT = 502

#: An address on a network without the kind of URL that says what is there.
_HOST_AND_PORT = re.compile(r'[^/]+:\d+')


def line_settings(
    protocol: str,
    *,
    baud_rate: int = 0,
    char_format: str = '',
    response_timeout: float = 0.2,
    rs485: bool = False,
) -> LineSettings:
    """
    Return how a line is set; ``0`` and ``''`` are the factory settings of the protocol.

    :raises ValueError: no such protocol, or a setting that no drive has; the message says which
        there are.
    """
    factory = _factory(protocol)
    return LineSettings(
        baud_rate or factory.baud_rate,
        char_format or factory.char_format,
        response_timeout,
        rs485,
    )


def open_link(protocol: str, port: str, settings: LineSettings) -> Link:
    """
    Return the link for a protocol on a port; it is not open yet.

    :param port: a device path, or a URL of pyserial (``socket://host:port``); ``host:port`` of
        the gateway for ``modbus_tcp``, where only the ``response_timeout`` of the settings counts.
    :raises ValueError: no such protocol or kind of URL, or a setting with which the protocol can
        never work; the message says what can.
    """
    data_bits = _factory(protocol).data_bits
    if protocol == 'modbus_tcp':
        return TcpLink(*_host_and_port(port), settings.response_timeout)
    if data_bits is not None and settings.data_bits != data_bits:
        raise ValueError(
            f'char_format {settings.char_format!r}: {protocol} has {data_bits} data bits, write '
            f'{data_bits}{settings.char_format[1:]}'
        )
    carrier = _carrier(port, settings)
    if protocol == 'classic':
        return ClassicLink(carrier, settings)
    if protocol == 'modbus_ascii':
        return AsciiLink(carrier, settings)
    return RtuLink(carrier, settings)


def _factory(protocol: str) -> Factory:
    if protocol not in PROTOCOLS:
        raise ValueError(f'unknown protocol {protocol!r}: choose one of {", ".join(PROTOCOLS)}')
    return PROTOCOLS[protocol]


def _carrier(port: str, settings: LineSettings) -> UrlPort | SerialPort:
    if not port:
        raise ValueError('port is empty: name a device, such as /dev/ttyUSB0')
    if '://' in port:
        return UrlPort(port, settings)
    if _HOST_AND_PORT.fullmatch(port):
        raise ValueError(
            f'port {port!r} is no device: write socket://{port} for a serial device server, or '
            'set protocol to modbus_tcp for a gateway'
        )
    return SerialPort(port, settings)


def _host_and_port(port: str) -> tuple[str, int]:
    """Return where a gateway is: ``host``, ``host:port`` or ``[IPv6 address]:port``."""
    try:
        parts = urlsplit(f'//{port}')
        where = parts.hostname, MODBUS_TCP_PORT if parts.port is None else parts.port
    except ValueError:
        where = None, 0
    host, number = where
    if host is None or not number or parts.netloc != port or '@' in port:
        raise ValueError(
            f'port {port!r} is no gateway: modbus_tcp wants host:port, such as 192.0.2.1:502'
        )
    return host, number
