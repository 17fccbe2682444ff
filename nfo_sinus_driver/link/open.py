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

from nfo_sinus_driver.link.interface import Link
from nfo_sinus_driver.link.rtu_link import RtuLink
from nfo_sinus_driver.link.serial_port import SerialPort
from nfo_sinus_driver.link.settings import LineSettings
from nfo_sinus_driver.link.url_port import UrlPort

#: The names that the driver's ``protocol`` parameter takes.
PROTOCOLS = ('modbus_rtu',)


def open_link(protocol: str, port: str, settings: LineSettings) -> Link:
    """
    Return the link for a protocol on a port; it is not open yet.

    :param port: a device path, or a URL of pyserial (``socket://host:port``).
    :raises ValueError: there is no such protocol; the message lists those there are.
    """
    if protocol not in PROTOCOLS:
        raise ValueError(f'unknown protocol {protocol!r}: choose one of {", ".join(PROTOCOLS)}')
    carrier = UrlPort(port, settings) if '://' in port else SerialPort(port, settings)
    return RtuLink(carrier, settings)
