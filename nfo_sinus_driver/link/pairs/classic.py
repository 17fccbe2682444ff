# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The Classic protocol: messages without I/O, and the link [M0 §6.1], [M2 §5].

:func:`encode` makes a message; a :class:`Reader` finds messages in the bytes that come in, in any
pieces, among noise and the remains of others. Hexadecimal digits are sent in upper case and read
in both [C86].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
import math
from operator import xor
import struct
import time
from typing import Any

from nfo_sinus_driver.link.foreign_traffic import Codec
from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    DamagedAnswer,
    LineSettings,
    LinkError,
    PortError,
    Refused,
    Reply,
    Why,
)
from nfo_sinus_driver.link.pairs.pair_link import CodecLink
from nfo_sinus_driver.link.ports.port import Port
from nfo_sinus_driver.link.protocols import BROADCAST, CLASSIC, POINT_TO_POINT

#: How many encoded messages are cached: the ENQUIRIES of a poll are sent again and again.
PREPARED = 1024

_EOT = 0x04
_ENQ = 0x05
_STX = 0x02
_ETX = 0x03
_ACK = 0x06
_NAK = 0x15
_FIRST_ADDRESS = 0x20


@dataclass(frozen=True)
class Enquiry:
    """Ask for the value of a parameter."""

    unit: int
    number: int


@dataclass(frozen=True)
class Select:
    """Give a parameter a value."""

    unit: int
    number: int
    word: int


@dataclass(frozen=True)
class Value:
    """REPLY: the value that a parameter has."""

    unit: int
    number: int
    word: int


@dataclass(frozen=True)
class Ack:
    """It was done."""

    unit: int


@dataclass(frozen=True)
class Nak:
    """It was not done, or there is no such parameter."""

    unit: int


Request = Enquiry | Select
Message = Enquiry | Select | Value | Ack | Nak
#: What distinguishes answers: the number that a REPLY names, else only its type.
Kind = int | type[Message]


def kind(message: Message) -> Kind:
    """Return what distinguishes an answer from others."""
    return message.number if isinstance(message, Value) else type(message)


def kinds(request: Request) -> tuple[Kind, Kind]:
    """Return the kinds of answers that a request may have."""
    return request.number if isinstance(request, Enquiry) else Ack, Nak


def answers(message: Message, request: Request) -> bool:
    """Return whether a message may be the answer to a request."""
    if request.unit not in (message.unit, POINT_TO_POINT) or isinstance(message, (Enquiry, Select)):
        return False
    return kind(message) in kinds(request)


@lru_cache(PREPARED)
def encode(message: Message) -> bytes:
    """Return the bytes of a message; a ValueError if the protocol cannot express it."""
    if not 0 <= message.unit <= BROADCAST:
        raise ValueError(f'address {message.unit}: Classic has 0 to {BROADCAST}')
    address = bytes((_FIRST_ADDRESS + message.unit,))
    if isinstance(message, Ack):
        return address + bytes((_ACK,))
    if isinstance(message, Nak):
        return address + bytes((_NAK,))
    parameter = b'E' + _digits(message.number)
    if isinstance(message, Enquiry):
        return bytes((_EOT,)) + address + parameter + bytes((_ENQ,))
    body = parameter + b'=' + _digits(message.word) + bytes((_ETX,))
    frame = address + bytes((_STX,)) + body + bytes((check_sum(body),))
    return bytes((_EOT,)) + frame if isinstance(message, Select) else frame


def check_sum(body: bytes | bytearray) -> int:
    """Return the BCC: all characters after STX, ETX included, exclusive-ored [C44]."""
    return reduce(xor, body, 0)


def _digits(number: int) -> bytes:
    if not 0 <= number <= 0xFFFF:
        raise ValueError(f'{number} does not fit into four hexadecimal digits')
    return b'%04X' % number


_Chars = frozenset[int]
_ADDRESS: _Chars = frozenset(range(_FIRST_ADDRESS, _FIRST_ADDRESS + BROADCAST + 1))
_HEX: _Chars = frozenset(b'0123456789ABCDEFabcdef')
_ANY: _Chars = frozenset(range(256))
_PARAMETER = (frozenset(b'Ee'), *4 * (_HEX,))
_TEXT = (frozenset((_STX,)), *_PARAMETER, frozenset(b'='), *4 * (_HEX,), frozenset((_ETX,)))
#: The characters that each message may have, one set for each position; an answer has no EOT.
_VALUE = (_ADDRESS, *_TEXT, _ANY)
_VERDICT = (_ADDRESS, frozenset((_ACK, _NAK)))
_ENQUIRY = (frozenset((_EOT,)), _ADDRESS, *_PARAMETER, frozenset((_ENQ,)))
_SELECT = (frozenset((_EOT,)), *_VALUE)
_ANSWERS = (_VALUE, _VERDICT)
_REQUESTS = (_ENQUIRY, _SELECT)

#: Characters of a REPLY, the longest answer.
LONGEST_ANSWER = len(_VALUE)


class Reader:
    """
    Finds the messages in the bytes that come in.

    A message counts only when every character is allowed at its place and the check sum is right.
    It is cut by its length, for a check sum may be any control character. A broken message is
    passed over up to the character that breaks it, so that its remains count for nothing and the
    next whole message is found. A REPLY straight behind an EOT is no REPLY but a SELECT: the echo
    of a request never looks like an answer.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()

    @property
    def rest(self) -> bytes:
        """The bytes of a message that is not complete yet."""
        return bytes(self._buffer)

    def feed(self, data: bytes) -> list[Message]:
        """Take bytes that came in; return the messages that they complete, in order."""
        self._buffer += data
        found: list[Message] = []
        while self._buffer:
            shapes = _REQUESTS if self._buffer[0] == _EOT else _ANSWERS
            fit = -1
            shape: tuple[_Chars, ...] = ()
            for candidate in shapes:
                fits = _fit(self._buffer, candidate)
                if fits > fit:
                    fit, shape = fits, candidate
            message = _decode(self._buffer[:fit]) if fit == len(shape) else None
            if message is not None:
                found.append(message)
                del self._buffer[:fit]
            elif fit == len(self._buffer) < len(shape):
                break
            else:
                # a check sum that is wrong breaks the message, and may begin the next one
                del self._buffer[: self._broken_at(min(fit, len(shape) - 1))]
        return found

    def _broken_at(self, fit: int) -> int:
        """Return where to go on, when only the first ``fit`` characters belong together."""
        # an STX has its address before it, even where that could be a digit of what broke off
        return max(1, fit - (self._buffer[fit] == _STX))


def _fit(data: bytearray, shape: tuple[_Chars, ...]) -> int:
    """Return how many characters at the beginning fit the shape."""
    fit = 0
    for char, allowed in zip(data, shape, strict=False):
        if char not in allowed:
            break
        fit += 1
    return fit


def _decode(frame: bytearray) -> Message | None:
    """Return the message of a whole frame; ``None`` if its check sum is wrong."""
    is_request = frame[0] == _EOT
    unit = frame[is_request] - _FIRST_ADDRESS
    if len(frame) == len(_VERDICT):
        return Ack(unit) if frame[1] == _ACK else Nak(unit)
    if len(frame) == len(_ENQUIRY):
        return Enquiry(unit, int(frame[3:7], 16))
    body = frame[is_request + 2 : -1]
    if check_sum(body) != frame[-1]:
        return None
    number, word = int(body[1:5], 16), int(body[6:10], 16)
    return Select(unit, number, word) if is_request else Value(unit, number, word)


#: The value in a message.
_WORD = struct.Struct('>H')
#: Pauses within an answer may last this long, s: no manual limits them [C86], and an adapter may
#: hold bytes back.
_INTER_BYTE_TIMEOUT = 0.07
#: Silence that shows that an ACK or NAK does not come twice: characters, and s at least.
_NO_DOUBLE = 2
_NO_DOUBLE_LEAST = 0.002
#: How long a write waits at least while another master's request is answered, s.
_WRITE_WAIT = 0.05
#: How long drives may be busy with a broadcast, which none of them confirms, s: this at most, else
#: so many times what the slowest of them took recently for a request of its own, which decays.
_TURNAROUND = 0.1
_TURNAROUND_MARGIN = 2.0
_KEPT_OF_SLOWEST = 0.98
#: How old a status may be to show that a fault is new, s.
_FRESH = 1.0
CODEC = Codec(
    Enquiry, Select, kind, kinds, answers, encode, Reader, LONGEST_ANSWER, _INTER_BYTE_TIMEOUT
)


class ClassicLink(CodecLink):
    """
    A master of the Classic protocol on one line: no belief in a doubtful answer, nor in a bare ACK.

    A REPLY names its parameter, ACK and NAK name nothing.

    Point to point (unit 0) an answer may carry any address [C86]. Do not mix it with others on
    one line.

    What is promised: no value of another parameter or another drive is taken, no answer up to
    three time-outs late to an earlier request, no ACK of another write. A REPLY that comes twice
    is noticed when it comes before the same request, sent again at once, can have been answered,
    ACK and NAK when they begin again within two characters; later ones may pass for the answer, a
    REPLY one reading old. ACK, NAK and an ENQUIRY have no check sum: parity is all that protects
    them, so choose a format that has it.
    """

    #: Factory settings and formats of both firmwares [M0 §6.1.2], [M2 §4], [C5], [C6]; addresses
    #: [M0 §6.1.2], [C10].
    protocol = CLASSIC
    _codec = CODEC

    def __init__(self, port: Port, settings: LineSettings, now: Clock = time.monotonic) -> None:
        super().__init__(port, settings, now)
        #: What finds out why each unit refused.
        self._why: dict[int, Why] = {}
        #: The status that each unit reported last, and when.
        self._status: dict[int, tuple[int, float]] = {}
        #: What the slowest unit took recently until its answer began, s.
        self._slowest = _TURNAROUND

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        super().close()
        self._status.clear()

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        """Name parameters that are safe to read at any time, and what tells why a unit refused."""
        super().use_resync_reads(unit, addresses)
        self._why[unit] = why

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        """Read one parameter of one word, or one part of another."""
        assert address.sub_index is None
        if unit == BROADCAST:
            raise ValueError('a broadcast is not answered')
        word, arrived = self._enquire(unit, address, once)
        return Reply(_WORD.pack(word), arrived)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """
        Write one parameter; unit 95 means all of them, and none confirms it.

        It has one word: parameters of two are never written, and no manual says how.

        :raises LinkError: as its subclasses say.
        """
        request = Select(unit, address.index, _WORD.unpack(data)[0])
        if unit == BROADCAST:
            return Reply(b'', self._broadcast(request))
        began = self._now()
        answer, arrived = self._command(request)
        if isinstance(answer, Nak):
            raise self._refusal(unit, began)
        return Reply(b'', arrived)

    def _enquire(self, unit: int, address: Address, once: bool = False) -> tuple[int, float]:
        """Return the value of a parameter, and when it came."""
        number = address.index
        asked_at = self._now()
        answer, arrived = self._ask(Enquiry(unit, number), once)
        if isinstance(answer, Nak):
            text = f'the drive has no parameter E{number:04X} that can be read (NAK)'
            raise Refused(Refused.ILLEGAL_ADDRESS, text)
        if number in self._resync_numbers.get(unit, ())[:1]:
            # it may have been in the port for long, if this program stood still
            self._status[unit] = answer.word, asked_at
        return answer.word, arrived

    def _broadcast(self, request: Select) -> float:
        """Send a request to all units, and leave them the time for it; return when it was sent."""
        self._await_gap(request, is_write=True)
        self._another.sent(request)
        sent = self._send(request, encode(request))
        self._last = None
        # an echo, or late answers: nothing answers this
        until = sent + min(_TURNAROUND, _TURNAROUND_MARGIN * self._slowest)
        while self._now() < until:
            self._read_line(until)
        return sent

    def _refusal(self, unit: int, began: float) -> Refused:
        """
        Find out why a SELECT was answered by NAK [M0 §6.1.5].

        :param began: when the SELECT was sent.
        """
        why = self._why.get(unit)
        if why is None:
            return Refused(Refused.DEVICE_FAILURE, 'the drive refused (NAK)')
        before, read_at = self._status.get(unit, (None, -math.inf))
        if began - read_at >= _FRESH:
            before = None
        try:
            return Refused(*why(lambda read: self._enquire(unit, *read)[0], before))
        except PortError:
            raise
        except LinkError as error:
            text = f'the drive refused (NAK); why is not known: {error}'
            return Refused(Refused.DEVICE_FAILURE, text)

    # --- belief -----------------------------------------------------------------------------------

    @cached_property
    def _gap(self) -> float:
        return _NO_DOUBLE * self._settings.char_time

    @property
    def _write_wait(self) -> float:
        return max(_WRITE_WAIT, super()._write_wait)

    def _gap_before(self, request: Any) -> float:
        # a pause only where an answer that comes twice could pass for that to the request
        if self._last is None or self._last[0].unit != request.unit:
            return 0.0
        last = kind(self._last[1])
        doubled = isinstance(last, type) and last in kinds(request)
        return max(self._gap, _NO_DOUBLE_LEAST) if doubled else 0.0

    def _note_unrequested(self, data: bytes, request: Any) -> None:
        # answers to requests without one are expected anyway
        if self._last is not None and not self._is_second(data):
            self._late.expect(self._last[0], self._now())

    def _ask_once(self, request: Any, once: bool) -> tuple[Any, float]:
        reply = super()._ask_once(request, once)
        if not self._again or not self._came_early(request):
            return reply
        if once:
            raise DamagedAnswer(f'unit {request.unit}: an answer came twice')
        self._make_certain(request)
        return self._transact(request)

    def _came_early(self, request: Any) -> bool:
        """
        Return whether the last REPLY came too early for the request; then expect another.

        It may be the one before, sent twice. A line without speed, such as a pseudo-terminal, is
        always early.
        """
        early = self._again and self._last is not None and isinstance(self._last[1], Value)
        if early:
            self._late.expect(request, self._now())
        return early

    def _expect_again(self, request: Any) -> None:
        self._came_early(request)

    def _took(self, unit: int, seconds: float) -> None:
        super()._took(unit, seconds)
        self._slowest = max(seconds, _KEPT_OF_SLOWEST * self._slowest)

    def _was_passed_over(
        self, messages: Sequence[Any], request: Any, quarantined: Any, now: float
    ) -> bool:
        # units answer in order: ours was lost, unless this is a late one to us
        return self._another.is_there(now) and any(
            isinstance(message, Value)
            and message.unit == request.unit
            and message.number not in quarantined
            for message in messages
        )

    def _deadline(self, deadline: float, now: float) -> float:
        if not self._another.is_there(now):
            return deadline
        # its next request may be as late as the time-out
        longest = LONGEST_ANSWER * self._settings.char_time
        return min(deadline, now + longest + 2 * self._slowest)
