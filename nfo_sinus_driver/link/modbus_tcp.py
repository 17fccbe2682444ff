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

"""
Modbus TCP of a master: frames, without I/O, and the link to drives behind a gateway.

A frame is a number that the answer repeats, two bytes of zero, the length of the message and the
message (MODBUS Messaging on TCP/IP Implementation Guide V1.0b §3.1.3). TCP itself sees to it that
bytes come whole and in order, so there is no check sum, and a header that makes no sense says that
somebody else is there.
"""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import select
import socket
import struct
import time
from typing import Any
from typing import TypeVar
from urllib.parse import urlsplit

from nfo_sinus_driver.link import modbus_pdu
from nfo_sinus_driver.link import telegram
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import DamagedAnswer
from nfo_sinus_driver.link.interface import GatewaySilent
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.interface import LinkError
from nfo_sinus_driver.link.interface import NoAnswer
from nfo_sinus_driver.link.interface import NoPath
from nfo_sinus_driver.link.interface import PortError
from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.line_protocols import MODBUS_TCP
from nfo_sinus_driver.link.modbus_link import ModbusLink
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.modbus_pdu import understand

_HEADER = struct.Struct('>HHH')
#: Unit and function, and as much data as there can be.
_MESSAGE_LENGTHS = range(2, 255)


def encode(request: Request[object], number: int) -> bytes:
    """Return the frame of a request; its answer will have the same number."""
    message = modbus_pdu.encode(request)
    return _HEADER.pack(number, 0, len(message)) + message


class FrameReader:
    """Cuts a connection into frames; after what is none it is ``out_of_step`` for good."""

    def __init__(self) -> None:
        self.out_of_step = False
        self._buffer = b''

    @property
    def received(self) -> int:
        """How many bytes have come of a frame that is not complete."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Take bytes that came in; return number and message of each frame that is complete."""
        self._buffer += data
        frames = []
        while len(self._buffer) >= _HEADER.size and not self.out_of_step:
            number, protocol, length = _HEADER.unpack_from(self._buffer)
            end = _HEADER.size + length
            if protocol or length not in _MESSAGE_LENGTHS:
                self.out_of_step = True
            elif len(self._buffer) < end:
                break
            else:
                frames.append((number, self._buffer[_HEADER.size : end]))
                self._buffer = self._buffer[end:]
        return frames


_T = TypeVar('_T')

#: Where gateways listen.
_PORT = 502
#: How long the gateway may take to accept a connection, s.
_CONNECT_TIMEOUT = 3.0
#: How long it may take to acknowledge bytes before the connection counts as lost, s.
_ACKNOWLEDGE_TIMEOUT = 5.0
_HINT = 'is the gateway switched on and its address right?'
_READ_SIZE = 4096


class TcpLink(ModbusLink):
    """
    A Modbus master on one connection to a gateway; a unit is a drive behind it.

    Every request has a number of its own, which its answer repeats: a late or doubled answer is
    told from the right one by that, so nothing is ever in quarantine. Drives that do not answer
    leave the connection as it is.

    :param response_timeout: from a request sent to its answer, s.
    """

    protocol = MODBUS_TCP

    def __init__(self, host: str, port: int, response_timeout: float) -> None:
        self._host = host
        self._port = port
        self._name = f'[{host}]:{port}' if ':' in host else f'{host}:{port}'
        self._response_timeout = response_timeout
        self._socket: socket.socket | None = None
        self._reader = FrameReader()
        self._number = 0
        self._blocks = telegram.Blocks(self._ask)

    @classmethod
    def on_port(cls, port: str, settings: LineSettings) -> TcpLink:
        """Return the link to a gateway; of the settings only the ``response_timeout`` counts."""
        return cls(*_host_and_port(port), settings.response_timeout)

    def open(self) -> None:
        """Connect to the gateway."""
        self.close()
        try:
            self._socket = socket.create_connection((self._host, self._port), _CONNECT_TIMEOUT)
            # requests are small and shall leave at once
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            # a cable that was pulled says nothing by itself
            milliseconds = int(1000 * _ACKNOWLEDGE_TIMEOUT)
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, milliseconds)
        except OSError as error:
            self.close()
            raise PortError(f'{self._name} cannot be reached ({error}): {_HINT}') from error
        self._reader = FrameReader()
        self._blocks.forget()

    def close(self) -> None:
        """Close the connection; harmless when it is closed already."""
        connection, self._socket = self._socket, None
        if connection is not None:
            connection.close()

    def read(self, unit: int, address: Address) -> Reply:
        """Read one parameter, of a drive or of the block of a PLC."""
        if address.space == telegram.ADDRESSING:
            return self._blocks(unit, address).read(address)
        return super().read(unit, address)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter, likewise."""
        if address.space == telegram.ADDRESSING:
            return self._blocks(unit, address).write(address, data)
        return super().write(unit, address, data)

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """Write one parameter and read another in one transaction, both of the same."""
        if address.space == telegram.ADDRESSING:
            return self._blocks(unit, address).write_and_read(address, data, source)
        return super().write_and_read(unit, address, data, source)

    def use_resync_reads(self, unit: int, addresses: Sequence[Address]) -> None:
        """Take parameters that are safe to read; here nothing has to be resynchronised."""

    def _ask(self, request: Request[_T]) -> tuple[_T, float]:
        """Return the answer to a request, and when it came."""
        connection = self._connection()
        self._number = self._number % 0xFFFF + 1
        try:
            connection.sendall(encode(request, self._number))
        except OSError as error:
            raise self._lost(error) from error
        deadline = time.monotonic() + self._response_timeout
        while True:
            data = self._receive(connection, deadline)
            now = time.monotonic()
            for number, message in self._reader.feed(data):
                # others answer requests that were given up, or answer twice
                if number == self._number:
                    return self._understood(request, message), now
            if self._reader.out_of_step:
                raise PortError(
                    f'{self._name} does not speak Modbus TCP; if it is a serial device server, '
                    f'set protocol to modbus_rtu and port to socket://{self._name}'
                )
            if now >= deadline:
                break
        if self._reader.received:
            raise DamagedAnswer(f'unit {request.unit}: only a part of the answer came')
        raise GatewaySilent(
            f'the gateway did not answer for unit {request.unit}: '
            'response_timeout has to be longer than its own'
        )

    def _ask_unheard(self, request: Request[object]) -> None:
        """Send a request and wait for its answer, whatever that is and says."""
        with contextlib.suppress(NoAnswer, DamagedAnswer, Refused, NoPath):
            self._ask(request)

    def _understood(self, request: Request[_T], message: bytes) -> _T:
        try:
            answer = understand(request, message)
        except Refused as refusal:
            raise _of_gateway(request, refusal) from None
        if answer is None:
            raise DamagedAnswer(f'unit {request.unit}: the gateway sent what is no answer')
        return answer

    def _receive(self, connection: socket.socket, until: float) -> bytes:
        """Return what has come; nothing when the time is over."""
        wait = max(0.0, until - time.monotonic())
        try:
            if not select.select((connection,), (), (), wait)[0]:
                return b''
            data = connection.recv(_READ_SIZE)
        except OSError as error:
            raise self._lost(error) from error
        if not data:
            raise self._lost('the gateway closed it')
        return data

    def _connection(self) -> socket.socket:
        if self._socket is None:
            raise PortError(f'{self._name} is not connected')
        return self._socket

    def _lost(self, why: OSError | str) -> PortError:
        return PortError(f'the connection to {self._name} was lost ({why}): {_HINT}')


def _host_and_port(port: str) -> tuple[str, int]:
    """Return where a gateway is: ``host``, ``host:port`` or ``[IPv6 address]:port``."""
    try:
        parts = urlsplit(f'//{port}')
        where = parts.hostname, _PORT if parts.port is None else parts.port
    except ValueError:
        where = None, 0
    host, number = where
    if host is None or not number or parts.netloc != port or '@' in port:
        raise ValueError(
            f'port {port!r} is no gateway: modbus_tcp wants host:port, such as 192.0.2.1:502'
        )
    return host, number


def _of_gateway(request: Request[Any], refusal: Refused) -> LinkError:
    """Return what a refusal means: a gateway speaks with the voice of the unit that is asked."""
    if refusal.code == Refused.NO_PATH:
        return NoPath(
            f'the gateway has no path to unit {request.unit} (exception {refusal.code}): '
            'check the table of units and the serial port in the settings of the gateway'
        )
    if refusal.code == Refused.NO_ANSWER:
        return NoAnswer(
            f'unit {request.unit} did not answer the gateway (exception {refusal.code})'
        )
    return refusal
