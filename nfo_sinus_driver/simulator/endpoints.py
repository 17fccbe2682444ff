# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The ends of simulated lines: which protocol is served where, how fast, in what format.

A protocol is a file, and a row of :data:`PROTOCOLS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from nfo_sinus_driver.simulator.can_line import CanLine
from nfo_sinus_driver.simulator.canopen import NODES
from nfo_sinus_driver.simulator.classic import BROADCAST, Classic
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.lawicel import BIT_RATES, Adapter
from nfo_sinus_driver.simulator.line import Line
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii, ModbusRtu, ModbusTcp, ThroughPlc
from nfo_sinus_driver.simulator.movitrac import ADDRESSES, Movitrac
from nfo_sinus_driver.simulator.plc import TELEGRAM
from nfo_sinus_driver.simulator.ports import Port, PtyPort, TcpPort
from nfo_sinus_driver.simulator.protocol import Protocol, Station
from nfo_sinus_driver.simulator.timing import Timing
from nfo_sinus_driver.simulator.wire import Wire

#: How long a gateway waits for a drive by default (s).
GATEWAY_TIMEOUT = 0.1


@dataclass(frozen=True)
class _Row:
    """
    A protocol and its defaults ([M0 §6.1.2, §6.2.2], [M4 §2.2.2]).

    :ivar kind: what cuts its bytes into frames; ``None``: a CAN bus has no bytes.
    :ivar tables: its name in the tables of the families, by which a drive has a server for it.
    :ivar data_bits: those it can do with.
    :ivar bauds: the rates that it has; none: the drives say.
    """

    kind: type[Protocol] | None
    tables: str
    baud: int
    char_format: str
    data_bits: str
    addresses: range = range(1, 248)
    bauds: tuple[int, ...] = ()


PROTOCOLS: Mapping[str, _Row] = {
    ModbusRtu.name: _Row(ModbusRtu, 'modbus', 19200, '8E1', '8'),
    ModbusAscii.name: _Row(ModbusAscii, 'modbus', 19200, '7E1', '7'),
    ModbusTcp.name: _Row(ModbusTcp, 'modbus', 19200, '8E1', '8'),
    Classic.name: _Row(Classic, 'classic', 9600, '7E1', '78', range(1, BROADCAST)),
    Movitrac.name: _Row(Movitrac, 'movitrac', 9600, '8N1', '8', ADDRESSES),
    ThroughPlc.name: _Row(ThroughPlc, TELEGRAM, 19200, '8E1', '8'),
    CanLine.name: _Row(None, 'canopen', 125_000, '8N1', '8', NODES, BIT_RATES),
}


class Endpoint:
    """
    One end of a line; what is not given is the protocol's default.

    :param link: a symbolic link to its pseudo-terminal.
    :param tcp: its TCP port, in place of a pseudo-terminal.
    :raises ValueError: no line can be so.

    :ivar tables: the name of its protocol in the tables of the families.
    :ivar spoken: the protocol that the drives themselves speak.
    :ivar timing: speed and format; of :class:`ModbusTcp` those of the line behind the gateway, of
        a CAN bus the bit rate alone.
    :ivar can_echo: a half-duplex adapter can be at the line.
    :ivar through_plc: a PLC stands between the line and the drives.
    """

    def __init__(
        self,
        protocol: str,
        *,
        link: str | None = None,
        tcp: int | None = None,
        baud: int | None = None,
        char_format: str | None = None,
    ) -> None:
        if protocol not in PROTOCOLS:
            raise ValueError(f'unknown protocol {protocol!r}: choose one of {", ".join(PROTOCOLS)}')
        if link is not None and tcp is not None:
            raise ValueError('link and tcp exclude each other: a line is at one of both')
        row = PROTOCOLS[protocol]
        self.can_echo = row.kind is not None and row.kind.serial
        if row.kind is not None and not row.kind.serial:
            if link is not None:
                raise ValueError(f'{protocol} needs a TCP port, not a link')
            tcp = tcp or 0
        if tcp is not None and not 0 <= tcp <= 65535:
            raise ValueError(f'TCP port {tcp} is not possible: 0 (any free one) to 65535')
        self.timing = Timing(row.baud if baud is None else baud, char_format or row.char_format)
        if self.timing.char_format[0] not in row.data_bits:
            has = self.timing.char_format
            raise ValueError(f'{protocol} has {row.data_bits} data bits, {has} has not')
        if row.bauds and self.timing.baud not in row.bauds:
            rates = ', '.join(map(str, row.bauds))
            raise ValueError(f'{self.timing.baud} bit/s: choose one of {rates}')
        self.protocol = protocol
        self.tables = row.tables
        self.spoken = row.tables if row.kind is None else row.kind.spoken
        self.through_plc = row.kind is ThroughPlc
        self.tcp = tcp
        self._link = link
        self._row = row

    @classmethod
    def parse(cls, text: str) -> Endpoint:
        """Return the end typed as ``PROTOCOL``, ``PROTOCOL:LINK`` or ``PROTOCOL:PORT``."""
        protocol, _, place = text.partition(':')
        if place.isascii() and place.isdigit():
            return cls(protocol, tcp=int(place))
        return cls(protocol, link=place or None)

    def check(self, address: int) -> None:
        """Look whether an address is one of the protocol (ValueError: it is not)."""
        possible = self._row.addresses
        if address not in possible:
            span = f'{possible.start} to {possible.stop - 1}'
            raise ValueError(f'address {address} is not possible: {span} over {self.protocol}')

    def open(self) -> Port:
        """Return its port (PortError: it cannot be had)."""
        return PtyPort(self._link) if self.tcp is None else TcpPort(self.tcp)

    def wire(
        self,
        port: Port,
        drives: Sequence[SimulatedDrive],
        stations: Sequence[Station],
        clock: Callable[[], float],
        *,
        gateway_timeout: float = GATEWAY_TIMEOUT,
        echo: bool = False,
        **how: Any,
    ) -> Wire:
        """
        Return the line on its port.

        :param stations: who is at a line of bytes: the drives, or what stands before them.
        :param gateway_timeout: how long a gateway waits for a drive (s).
        :param how: what :class:`Line` and :class:`CanLine` take alike.
        """
        if self._row.kind is None:
            return CanLine(port, Adapter(), drives, self.timing, **how)
        protocol = self._row.kind(gateway_timeout)
        return Line(port, protocol, stations, self.timing, clock, echo=echo, **how)
