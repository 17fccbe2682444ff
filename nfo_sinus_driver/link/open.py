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

import re

from nfo_sinus_driver.link.interface import Link
from nfo_sinus_driver.link.rtu_link import RtuLink
from nfo_sinus_driver.link.serial_port import SerialPort
from nfo_sinus_driver.link.settings import LineSettings
from nfo_sinus_driver.link.url_port import UrlPort

#: The names that the driver's ``protocol`` parameter takes.
PROTOCOLS = ('modbus_rtu',)

#: An address on a network without the kind of URL that says what is there.
_HOST_AND_PORT = re.compile(r'[^/]+:\d+')


def open_link(protocol: str, port: str, settings: LineSettings) -> Link:
    """
    Return the link for a protocol on a port; it is not open yet.

    :param port: a device path, or a URL of pyserial (``socket://host:port``).
    :raises ValueError: no such protocol or kind of URL, or a setting with which the protocol can
        never work; the message says what can.
    """
    if protocol not in PROTOCOLS:
        raise ValueError(f'unknown protocol {protocol!r}: choose one of {", ".join(PROTOCOLS)}')
    if settings.data_bits != 8:
        # [M0 §6.2.2]
        raise ValueError(
            f'char_format {settings.char_format!r}: {protocol} has 8 data bits, write '
            f'8{settings.char_format[1:]}'
        )
    return RtuLink(_carrier(port, settings), settings)


def _carrier(port: str, settings: LineSettings) -> UrlPort | SerialPort:
    if not port:
        raise ValueError('port is empty: name a device, such as /dev/ttyUSB0')
    if '://' in port:
        return UrlPort(port, settings)
    if _HOST_AND_PORT.fullmatch(port):
        raise ValueError(
            f'port {port!r} is no device: write socket://{port} for a serial device server'
        )
    return SerialPort(port, settings)
