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

"""The ways in to simulated drives: which protocol is served where, how fast, in what format."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.simulator.classic import Classic
from nfo_sinus_driver.simulator.classic_frames import BROADCAST
from nfo_sinus_driver.simulator.firmware import NEW
from nfo_sinus_driver.simulator.firmware import Firmware
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii
from nfo_sinus_driver.simulator.modbus_frames import ModbusRtu
from nfo_sinus_driver.simulator.modbus_frames import ModbusTcp
from nfo_sinus_driver.simulator.ports import Port
from nfo_sinus_driver.simulator.ports import PtyPort
from nfo_sinus_driver.simulator.ports import TcpPort
from nfo_sinus_driver.simulator.protocol import Protocol
from nfo_sinus_driver.simulator.timing import FORMAT_CODES
from nfo_sinus_driver.simulator.timing import Timing

#: How long a gateway waits for a drive by default (s).
GATEWAY_TIMEOUT = 0.1


@dataclass(frozen=True)
class _Kind:
    """
    A protocol and its defaults ([M0 §6.1.2, §6.2.2]).

    :ivar make: makes it; it gets the time that a gateway waits.
    :ivar data_bits: those it can do with.
    """

    make: Callable[[float], Protocol]
    baud: int
    char_format: str
    data_bits: str
    addresses: range = range(1, 248)


_KINDS: Mapping[str, _Kind] = {
    ModbusRtu.name: _Kind(lambda _: ModbusRtu(), 19200, '8E1', '8'),
    ModbusAscii.name: _Kind(lambda _: ModbusAscii(), 19200, '7E1', '7'),
    ModbusTcp.name: _Kind(ModbusTcp, 19200, '8E1', '8'),
    Classic.name: _Kind(lambda _: Classic(), 9600, '7E1', '78', range(1, BROADCAST)),
}
PROTOCOLS = tuple(_KINDS)


@dataclass(frozen=True)
class Door:
    """
    One way in.

    :ivar protocol: the name of its protocol.
    :ivar timing: speed and format; of :class:`ModbusTcp` those of the line behind the gateway.
    :ivar link: a symbolic link to its pseudo-terminal, if it has one.
    :ivar tcp: its TCP port, if it has one.
    """

    protocol: str
    timing: Timing
    link: str | None = None
    tcp: int | None = None

    @property
    def bus_type(self) -> int:
        """BusType of a drive that is meant to be reached this way."""
        return self.make(0.0).bus_type

    def format_code(self, firmware: Firmware) -> int:
        """Return the code of SiProt for its format."""
        formats = firmware.formats if self.protocol == Classic.name else FORMAT_CODES
        return formats[self.timing.char_format]

    def make(self, gateway_timeout: float) -> Protocol:
        """Return the protocol; a gateway waits so long for a drive (s)."""
        return _KINDS[self.protocol].make(gateway_timeout)

    def open(self) -> Port:
        """
        Return its port.

        :raises PortError: it cannot be had.
        """
        return PtyPort(self.link) if self.tcp is None else TcpPort(self.tcp)

    def check(self, model: str, address: int) -> None:
        """
        Look whether a drive can be reached this way.

        :raises ValueError: its model does not speak the protocol, or its address is none of it.
        """
        if self.protocol == Classic.name and model != 'sinus_g2':
            raise ValueError(f'{model} does not speak {self.protocol}')
        possible = _KINDS[self.protocol].addresses
        if address not in possible:
            span = f'{possible.start} to {possible.stop - 1}'
            raise ValueError(f'address {address} is not possible: {span} over {self.protocol}')


def door(
    protocol: str,
    *,
    link: str | None = None,
    tcp: int | None = None,
    baud: int | None = None,
    char_format: str | None = None,
    firmware: Firmware = NEW,
) -> Door:
    """
    Return a way in; what is not given is the protocol's default.

    :raises ValueError: an unknown protocol, or one that does not go with the rest.
    """
    if protocol not in _KINDS:
        raise ValueError(f'unknown protocol {protocol!r}: choose one of {", ".join(_KINDS)}')
    if link is not None and tcp is not None:
        raise ValueError('a line is either a pseudo-terminal or a TCP port, not both')
    if protocol == ModbusTcp.name:
        if link is not None:
            raise ValueError(f'{protocol} needs a TCP port, not a link')
        tcp = tcp or 0
    kind = _KINDS[protocol]
    timing = Timing(kind.baud if baud is None else baud, char_format or kind.char_format)
    if timing.char_format[0] not in kind.data_bits:
        raise ValueError(f'{protocol} has {kind.data_bits} data bits, {timing.char_format} has not')
    formats = firmware.formats if protocol == Classic.name else FORMAT_CODES
    if timing.char_format not in formats:
        raise ValueError(f'{timing.char_format}: this drive has {", ".join(formats)} on {protocol}')
    if protocol == Classic.name and timing.baud > firmware.most_baud:
        raise ValueError(f'{timing.baud} baud: this drive has {firmware.most_baud} at most')
    return Door(protocol, timing, link, tcp)


def parse_door(text: str, firmware: Firmware = NEW) -> Door:
    """
    Return the way in that was typed as ``PROTOCOL``, ``PROTOCOL:LINK`` or ``PROTOCOL:PORT``.

    :raises ValueError: it is none.
    """
    protocol, _, place = text.partition(':')
    if place.isascii() and place.isdigit():
        if int(place) > 65535:
            raise ValueError(f'TCP port {place} is not possible: 0 (any free one) to 65535')
        return door(protocol, tcp=int(place), firmware=firmware)
    return door(protocol, link=place or None, firmware=firmware)
