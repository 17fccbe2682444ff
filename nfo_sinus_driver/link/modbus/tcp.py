# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Modbus TCP of a master: frames, without I/O, and the link to drives behind a gateway.

A frame is a number that the answer repeats, two bytes of zero, the length of the message and the
message (MODBUS Messaging on TCP/IP Implementation Guide V1.0b §3.1.3). TCP delivers bytes complete
and in order, so there is no check sum, and a header that makes no sense is of another device.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
import contextlib
import math
import struct
import time
from typing import Any, TypeVar
from urllib.parse import urlsplit

from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    Connecting,
    DamagedAnswer,
    GatewayFault,
    GatewayLate,
    GatewaySilent,
    LineSettings,
    LinkError,
    NoAnswer,
    NoPath,
    NotReady,
    NotSent,
    PortError,
    Refused,
    Remarks,
    Reply,
    Why,
)
from nfo_sinus_driver.link.late_replies import LATEST_REPLY, longer_than
from nfo_sinus_driver.link.modbus import pdu
from nfo_sinus_driver.link.modbus.link import ModbusLink
from nfo_sinus_driver.link.modbus.other_values import OtherValues
from nfo_sinus_driver.link.modbus.pdu import Request, Write, WriteAndRead, read_of, understand
from nfo_sinus_driver.link.pauses import Pauses
from nfo_sinus_driver.link.plc import telegram
from nfo_sinus_driver.link.ports.tcp_connection import (
    CLOSED_HINT,
    Connection,
    TcpConnection,
    TracedConnection,
)
from nfo_sinus_driver.link.ports.trace import Trace
from nfo_sinus_driver.link.protocols import MODBUS_TCP
from nfo_sinus_driver.link.thread_clock import ThreadClock

_HEADER = struct.Struct('>HHH')
#: The lengths of a message, from unit and function alone to the most data.
_MESSAGE_LENGTHS = range(2, 255)


def encode(request: Request[object], number: int) -> bytes:
    """Return the frame of a request; its answer will have the same number."""
    message = pdu.encode(request)
    return _HEADER.pack(number, 0, len(message)) + message


class FrameReader:
    """Cuts a connection into frames; after an invalid header it is ``out_of_step`` for good."""

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

#: The port of gateways.
_PORT = 502
#: How long the gateway may take to accept a connection, and how long to wait for that at a time, s:
#: the thread has other work.
_CONNECT_TIMEOUT = 3.0
_SLICE = 0.02
#: How many connections in a row that the gateway closes after one answer are no coincidence.
_CLOSINGS = 2
#: For how many of the last requests given up an answer is recognised as late.
_GIVEN_UP = 64
_HINT = f'is the gateway or PLC switched on and its address right? If so, {CLOSED_HINT}'


class TcpLink(ModbusLink):
    """
    A Modbus master on one connection to a gateway; a unit is a drive behind it.

    Every request has a number of its own, which its answer repeats: a late or doubled answer is
    distinguished by that, so nothing is ever in quarantine. A drive that does not answer does not
    affect the connection.

    A connection may stay open and mute, when the gateway has lost its other side, or a router has
    forgotten it. :meth:`open` then begins another one beside it; the first that answers is kept.
    Before the other is used the mute one is closed so that nothing that was handed over to it
    arrives later.

    A gateway that closes the connection after each answer gets another one for each request. One
    that closes it twice at a function that it has never answered is not asked that any more.

    :param response_timeout: from a request sent to its answer, s.
    :param connection: makes what carries the bytes, of host and port.
    :param request_gap: the least time from an answer to the next request, s.
    """

    protocol = MODBUS_TCP

    def __init__(
        self,
        host: str,
        port: int,
        response_timeout: float,
        connection: Callable[[str, int], Connection] = TcpConnection,
        now: Clock = time.monotonic,
        request_gap: float = 0.0,
    ) -> None:
        self.clock = self._now = ThreadClock(now)
        self.stop_waits: Callable[[], bool] = lambda: False
        self._host = host
        self._port = port
        self.place = self._name = f'[{host}]:{port}' if ':' in host else f'{host}:{port}'
        self._response_timeout = response_timeout
        self._make = connection
        self._connection: Connection | None = None
        #: One that has been begun, and until when to wait for it.
        self._begun: Connection | None = None
        self._begun_until = 0.0
        self._reader = FrameReader()
        self._number = 0
        #: How long the gateway has ever taken to answer for a unit, s.
        self._longest_ever: dict[int, float] = {}
        #: The requests on this connection without an answer, and how many answers came.
        self._given_up: deque[int] = deque(maxlen=_GIVEN_UP)
        self._others = OtherValues(LATEST_REPLY * response_timeout)
        self._answers = 0
        #: The last request on this connection has not been answered.
        self._unanswered = False
        #: How many connections in a row the gateway has closed after one answer.
        self._closings = 0
        #: The functions that the gateway has answered, and how often in a row it has closed a
        #: connection at another one.
        self._known: set[int] = set()
        self._closed_at: dict[int, int] = {}
        self._blocks = telegram.Blocks(self.transfer, now)
        self.remarks = Remarks()
        #: When the last message was sent, or came.
        self._line_end = -math.inf
        self.pauses = Pauses(self.remarks.add, lambda: self._line_end, request_gap)
        self.last_byte_at = -math.inf

    def wait_at_most(self, seconds: float) -> None:
        """Wait for the next answers so long at most, s, but as long as the unit has ever taken."""
        self._patience = seconds

    def end_listening_if(self, stop_waits: Callable[[], bool]) -> None:
        """Wait for no more than the answer to the request that was sent, where a stop waits."""
        self.stop_waits = stop_waits

    def answers_twice(self, unit: int) -> bool:
        """Return false: each answer has the number of its request."""
        return False

    @classmethod
    def on_port(cls, port: str, settings: LineSettings, trace: str = '') -> TcpLink:
        """Return the link to a gateway; of the settings only those of time count."""

        where = host_and_port(port)
        kept = Trace(trace) if trace else None

        def connection(host: str, number: int) -> Connection:
            made = TcpConnection(host, number)
            return made if kept is None else TracedConnection(made, kept)

        return cls(
            *where,
            settings.response_timeout,
            connection,
            request_gap=settings.request_gap,
        )

    def open(self) -> None:
        """
        Connect to the gateway; where a connection is open, and mute, to another beside it.

        :raises Connecting: it takes longer; the next call goes on.
        """
        if self._begun is None:
            self._begin()
        if not self._go_on(self._now() + _SLICE):
            raise Connecting

    def close(self) -> None:
        """Close the connection; harmless when it is closed already."""
        self._drop_begun()
        connection, self._connection = self._connection, None
        self.pauses.forget_failures()
        if connection is not None:
            connection.close(discard=self._unanswered)

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        """Read one parameter, of a drive or of the block of a PLC."""
        if address.block is not None:
            return self._blocks(unit, address).read(address)
        return super().read(unit, address, once)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter, likewise."""
        if address.block is not None:
            return self._blocks(unit, address).write(address, data)
        return super().write(unit, address, data)

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """Write one parameter and read another in one transaction, both of the same."""
        if address.block is not None:
            return self._blocks(unit, address).write_and_read(address, data, source)
        return super().write_and_read(unit, address, data, source)

    def read_then_write(self, unit: int, source: Address, address: Address, data: bytes) -> Reply:
        """
        Read a parameter whose value is not needed, then write another; nothing is sent between.

        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """
        with contextlib.suppress(NoAnswer, DamagedAnswer, Refused, NoPath):
            try:
                self._exchange(read_of(unit, source))
            except OSError as error:
                raise self._lost(error) from error
        try:
            return self.write(unit, address, data)
        except LinkError as error:
            error.maybe_done = True
            raise

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        """Take parameters that are safe to read; here nothing has to be resynchronised."""

    # --- the connection ---------------------------------------------------------------------------

    @property
    def _is_closed_each_time(self) -> bool:
        """The gateway closes the connection after each answer."""
        return self._closings >= _CLOSINGS

    def _begin(self) -> None:
        self._begun = self._make(self._host, self._port)
        self._begun_until = self._now() + _CONNECT_TIMEOUT
        try:
            self._begun.open()
        except OSError as error:
            self._drop_begun()
            raise self._unreachable(error) from error

    def _go_on(self, until: float) -> bool:
        """Wait for the connection that was begun; return whether it is in use now."""
        assert self._begun is not None
        try:
            if not self._begun.connected(self._now.until(until)):
                if self._now() < self._begun_until:
                    return False
                raise TimeoutError('timed out')
        except OSError as error:
            self._drop_begun()
            raise self._unreachable(error) from error
        begun, self._begun = self._begun, None
        self.close()
        self._connection = begun
        self._reader = FrameReader()
        self._given_up.clear()
        self._answers = 0
        self._unanswered = False
        if not self._is_closed_each_time:
            self._blocks.forget()
        return True

    def _drop_begun(self) -> None:
        begun, self._begun = self._begun, None
        if begun is not None:
            begun.close()

    def _connect_again(self) -> None:
        """Connect once more, in the middle of a request."""
        self.close()
        self._begin()
        if not self._go_on(self._now() + self._response_timeout):
            self._drop_begun()
            raise self._unreachable(TimeoutError('timed out'))

    def _usable(self) -> Connection:
        """Return the connection for the next request."""
        if self._begun is not None:
            self._go_on(self._now())
        connection = self._connection
        if connection is None:
            raise PortError(f'{self._name} is not connected')
        if self._is_closed_each_time and self._answers:
            self._connect_again()
        elif self._answers == 1 and not self._unanswered and self._was_closed(connection):
            self._note_closing()
            self._connect_again()
        assert self._connection is not None
        return self._connection

    def _was_closed(self, connection: Connection) -> bool:
        """Return whether the gateway has closed it since its answer."""
        try:
            self._reader.feed(connection.read(0.0))
        except OSError:
            return True
        return False

    def _note_closing(self) -> None:
        """Note that the gateway has closed a connection after one answer."""
        self._closings += 1
        if self._is_closed_each_time:
            self.remarks.add(
                f'{self._name} closes the connection after each answer: it is opened again for '
                'each request, which takes longer; look in the settings of the gateway for one '
                'that keeps connections open'
            )

    # --- one transaction --------------------------------------------------------------------------

    def _ask(self, request: Request[_T], once: bool = False) -> tuple[_T, float]:
        """Return the answer to a request, and when it came."""
        if self._closed_at.get(request.function, 0) >= _CLOSINGS:
            raise _unknown(request)
        try:
            return self._exchange(request)
        except ConnectionError as error:
            if self._may_not_know(request):
                return self._ask_again(request, error, once=once)
            first = not self._closes_after_one(request)
            if first or once or isinstance(request, (Write, WriteAndRead)):
                raise self._lost(error) from error
        except OSError as error:
            raise self._lost(error) from error
        # the gateway answers one request a connection, and this one changes nothing
        self._connect_again()
        if self.stop_waits():
            raise NotReady(self._now())
        try:
            return self._exchange(request)
        except OSError as error:
            raise self._lost(error) from error

    def _may_not_know(self, request: Request[object]) -> bool:
        """Return whether the gateway has closed the connection at a function that is new to it."""
        # a plain write is never given up: it may be a stop
        is_plain_write = isinstance(request, Write)
        return bool(self._known) and request.function not in self._known and not is_plain_write

    def _ask_again(
        self, request: Request[_T], why: ConnectionError, *, once: bool
    ) -> tuple[_T, float]:
        """Return the answer to what the gateway has closed the connection at, if it may be sent."""
        function = request.function
        self._closed_at[function] = 1 + self._closed_at.get(function, 0)
        has_effect = once or isinstance(request, WriteAndRead)
        if self._closed_at[function] < _CLOSINGS:
            if has_effect:
                raise self._lost(why) from why
            self._connect_again()
            return self._ask(request)
        self.remarks.add(
            f'{self._name} closes the connection at function {function}, which it does not know: '
            'the driver goes on without it'
        )
        self._connect_again()
        raise _unknown(request)

    def _closes_after_one(self, request: Request[object]) -> bool:
        """Return whether the gateway seems to close after each answer: it has just done so."""
        if self._answers != 1 or self._reader.received:
            return False
        self._note_closing()
        return True

    def _exchange(self, request: Request[_T]) -> tuple[_T, float]:
        connection = self._usable()
        while self._now() < (ready_at := self.pauses.ready_at(request.unit)):
            # usually the bus has waited for that already; what comes is late
            self._reader.feed(connection.read(self._now.until(ready_at)))
        self._number = self._number % 0xFFFF + 1
        self._unanswered = True
        writes = isinstance(request, (Write, WriteAndRead))
        self.pauses.sent(request.unit, self._now(), writes=writes)
        connection.write(encode(request, self._number))
        self._others.sent(request, self._now())
        self._line_end = sent_at = self._now()
        unit = request.unit
        most = max(self._patience, longer_than(self._longest_ever.get(unit, math.inf)))
        deadline = sent_at + min(self._response_timeout, most)
        others: list[int] = []
        while True:
            data = connection.read(self._now.until(deadline))
            now = self._now()
            if data:
                self.last_byte_at = self._line_end = now
            for number, message in self._reader.feed(data):
                if number == self._number:
                    self._note_answer()
                    self._note_for_pauses(request, message, now)
                    self._known.add(request.function)
                    self._closed_at.pop(request.function, None)
                    if self._now.resumed_at <= sent_at:
                        longest = self._longest_ever.get(unit, 0.0)
                        self._longest_ever[unit] = max(longest, now - sent_at)
                    return self._understood(request, message), now
                others.append(number)
            if self._reader.out_of_step:
                raise PortError(
                    f'{self._name} does not speak Modbus TCP; if it is a serial device server, '
                    f'set protocol to modbus_rtu and port to socket://{self._name}'
                )
            if data:
                # it sends, so no other is needed
                self._drop_begun()
            if now >= deadline:
                break
        error = self._missing(request, others)
        if isinstance(error, GatewaySilent) and self._now.resumed_at <= sent_at:
            self.pauses.unanswered(unit, type(request))
        self._given_up.append(self._number)
        raise error

    def _note_answer(self) -> None:
        self._drop_begun()
        self._unanswered = False
        self._answers += 1
        if self._answers > 1:
            self._closings = 0

    def _note_for_pauses(self, request: Request[object], message: bytes, now: float) -> None:
        code = message[2] if message.startswith(pdu.refusal_head(request)) else 0
        if code == Refused.NO_ANSWER:
            # it has waited so long that nothing comes too soon after its own word
            self.pauses.unanswered(request.unit, type(request))
        elif code != Refused.NO_PATH:
            self.pauses.answered(request.unit, type(request), now)

    def _missing(self, request: Request[object], others: Sequence[int]) -> LinkError:
        """Return the error when no answer to a request came, but perhaps others."""
        unit = request.unit
        strange = [number for number in others if number not in self._given_up]
        if strange:
            return GatewayFault(
                f'unit {unit}: the gateway answered with transaction number {strange[0]} instead '
                f'of {self._number}, that of the request: update or replace the gateway, or set it '
                'to pass bytes on and use socket:// with modbus_rtu'
            )
        if self._reader.received:
            return GatewayFault(
                f'unit {unit}: only a part of the answer came, by the length in its header: update '
                'or replace the gateway, or raise response_timeout where the network is slow'
            )
        if others:
            return GatewayLate(
                f'the answer of the gateway for unit {unit} came after response_timeout: set it '
                "longer than the gateway's own time-out"
            )
        return GatewaySilent(
            f'the gateway did not answer for unit {unit}: '
            'response_timeout has to be longer than its own'
        )

    def _understood(self, request: Request[_T], message: bytes) -> _T:
        try:
            answer = understand(request, message)
        except Refused as refusal:
            raise _of_gateway(request, refusal) from None
        if answer is None and message[0] != request.unit:
            raise GatewayFault(
                f'the gateway answered as unit {message[0]} and not as unit {request.unit}, which '
                'was asked: correct the table of units in the settings of the gateway, or address'
            )
        if answer is None and (error := self._others.error_of(request, message)) is not None:
            raise error
        if answer is None:
            raise GatewayFault(
                f'unit {request.unit}: the gateway sent what is no answer: update or replace it, '
                'and check protocol'
            )
        self._others.took(request)
        return answer

    def _unreachable(self, error: OSError) -> PortError:
        return PortError(f'{self._name} cannot be reached ({error}): {_HINT}')

    def _lost(self, why: OSError) -> PortError:
        hint = CLOSED_HINT if isinstance(why, ConnectionError) else _HINT
        return PortError(f'the connection to {self._name} was lost ({why}): {hint}')


def host_and_port(port: str) -> tuple[str, int]:
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


def _unknown(request: Request[Any]) -> NotSent:
    return NotSent(
        Refused.ILLEGAL_FUNCTION,
        f'the gateway closes the connection at function {request.function}, which it does not know',
    )


def _of_gateway(request: Request[Any], refusal: Refused) -> LinkError:
    """Return what a refusal means: a gateway answers in the name of the unit."""
    if refusal.code == Refused.NO_PATH:
        return NoPath(
            f'the gateway has no path to unit {request.unit} (exception {refusal.code}): '
            'check the table of units and the serial port in the settings of the gateway'
        )
    if refusal.code == Refused.NO_ANSWER:
        silent = NoAnswer(
            f'unit {request.unit} did not answer the gateway (exception {refusal.code})'
        )
        silent.heard = True
        return silent
    return refusal
