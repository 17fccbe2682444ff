# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The serial protocol of SEW's MOVITRAC 31..: frames, without I/O, return codes, the link [M4 §2.1].

:func:`encode` makes a frame; a :class:`Reader` finds messages in the bytes that come in, in any
pieces, among noise and the remains of others. A start delimiter gives the type and the length of a
frame; its last byte is the sum of all others, without carry [C85].

A drive refuses by NACK with one of 34 return codes [M4 §2.1.2]. Two of them only inform, for the
drive has carried out the request [C81].
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

from nfo_sinus_driver.link.foreign_traffic import Codec
from nfo_sinus_driver.link.interface import Address, DamagedAnswer, Refused, Reply
from nfo_sinus_driver.link.late_replies import STOP_WAITS
from nfo_sinus_driver.link.pairs.pair_link import CodecLink
from nfo_sinus_driver.link.protocols import MOVITRAC

#: How many bytes a value has, in a plain frame and in a long one.
SIZES = (4, 8)
#: Bytes of LONG_DATA, the longest answer.
LONGEST_ANSWER = 12

#: How many encoded requests are cached: those of a poll are sent again and again.
_PREPARED = 1024

_ENQUIRY = 0xB5
_DATA = 0xC8
_LONG_DATA = 0xAC
_SELECT = 0xA9
_LONG_SELECT = 0xAD
_ACK = 0xD2
_NACK = 0xF3
#: The length of a frame, by its start delimiter.
_LENGTHS = {
    _ENQUIRY: 5,
    _DATA: 8,
    _LONG_DATA: LONGEST_ANSWER,
    _SELECT: 9,
    _LONG_SELECT: 13,
    _ACK: 2,
    _NACK: 3,
}
#: Bytes of LONG_SELECT, the longest frame.
_LONGEST = max(_LENGTHS.values())
#: Bytes that may come before or after a frame when a transmitter is switched.
_GLITCH = 2


@dataclass(frozen=True)
class Enquiry:
    """Ask for the value of a parameter."""

    unit: int
    index: int


@dataclass(frozen=True)
class Select:
    """SELECT or LONG_SELECT, by the length of its value: give a parameter a value."""

    unit: int
    index: int
    value: bytes


@dataclass(frozen=True)
class Data:
    """DATA or LONG_DATA: the value that a parameter has."""

    index: int
    value: bytes


@dataclass(frozen=True)
class Ack:
    """It was done."""


@dataclass(frozen=True)
class Nack:
    """It was not done, or not quite as requested: the return code says why."""

    code: int


Request = Enquiry | Select
Answer = Data | Ack | Nack
Message = Request | Answer
#: What distinguishes answers: the index that a DATA names, else only its type.
Kind = int | type[Answer]


def kind(answer: Answer) -> Kind:
    """Return what distinguishes an answer from others."""
    return answer.index if isinstance(answer, Data) else type(answer)


def kinds(request: Request) -> tuple[Kind, Kind]:
    """Return the kinds of answers that a request may have."""
    return request.index if isinstance(request, Enquiry) else Ack, Nack


def answers(message: Message, request: Request) -> bool:
    """Return whether a message may be the answer to a request."""
    return not isinstance(message, Request) and kind(message) in kinds(request)


def check_sum(body: bytes) -> int:
    """Return the frame check sum: the sum of all bytes before it, without carry."""
    return sum(body) & 0xFF


@lru_cache(_PREPARED)
def encode(message: Message) -> bytes:
    """
    Return the frame of a message.

    :raises ValueError: an address, an index or a value that the protocol cannot express.
    """
    if isinstance(message, Ack):
        body = bytes((_ACK,))
    elif isinstance(message, Nack):
        body = bytes((_NACK, message.code))
    elif isinstance(message, Data):
        start = _start(message.value, _DATA, _LONG_DATA)
        body = bytes((start,)) + _word(message.index) + message.value
    else:
        MOVITRAC.require_unit(message.unit)
        value = message.value if isinstance(message, Select) else b''
        start = _start(value, _SELECT, _LONG_SELECT) if isinstance(message, Select) else _ENQUIRY
        body = bytes((start, message.unit)) + _word(message.index) + value
    return body + bytes((check_sum(body),))


def _start(value: bytes, plain: int, long: int) -> int:
    """Return the start delimiter of a frame that carries a value."""
    if len(value) not in SIZES:
        raise ValueError(f'a value of {len(value)} bytes: there are those of 4 and of 8')
    return plain if len(value) == SIZES[0] else long


def _word(index: int) -> bytes:
    if not 0 <= index <= 0xFFFF:
        raise ValueError(f'index {index} does not fit into two bytes')
    return index.to_bytes(2, 'big')


def decode(data: bytes) -> Message | None:
    """Return the message whose frame begins the bytes; ``None`` if none does, or not yet."""
    length = _LENGTHS.get(data[0], 0) if data else 0
    if not 0 < length <= len(data) or check_sum(data[: length - 1]) != data[length - 1]:
        return None
    start, body = data[0], data[1 : length - 1]
    if start == _ACK:
        return Ack()
    if start == _NACK:
        return Nack(body[0])
    if start in (_DATA, _LONG_DATA):
        return Data(int.from_bytes(body[:2], 'big'), body[2:])
    unit, index = body[0], int.from_bytes(body[1:3], 'big')
    if unit not in MOVITRAC.units:
        return None
    return Enquiry(unit, index) if start == _ENQUIRY else Select(unit, index, body[3:])


def is_glitch(data: bytes) -> bool:
    """Return whether bytes are too few to be part of an answer, and none begins a frame."""
    return len(data) <= _GLITCH and _LENGTHS.keys().isdisjoint(data)


class Reader:
    """
    Finds all messages, of any master and drive, in the bytes that come in.

    A message with a value counts when its sum is right, whatever came before it. ACK and NACK are
    too short to be checked, so they count only at the beginning, behind whole frames, such as the
    echo of the request, or behind a glitch: a byte or two of which none begins a frame. All other
    bytes are passed over.

    :ivar rest: the bytes behind the last message that may become one.
    """

    def __init__(self) -> None:
        self.rest = b''
        #: Nothing but what :attr:`rest` has came behind the last message.
        self._is_all = True

    def feed(self, data: bytes) -> list[Message]:
        """Take bytes that came in; return the messages that they complete, in order."""
        self.rest += data
        found: list[Message] = []
        behind = 0
        for _, end, message in _messages(self.rest, self._is_all):
            found.append(message)
            behind, self._is_all = end, True
        rest = self.rest[behind:]
        self.rest = rest[1 - _LONGEST :]
        self._is_all &= self.rest == rest
        return found


def _messages(data: bytes, is_all: bool) -> Iterator[tuple[int, int, Message]]:
    """
    Yield each message that counts, where its frame begins and where it ends.

    :param is_all: nothing came between these bytes and the last message.
    """
    start = behind = 0
    while start < len(data):
        message = decode(data[start:])
        junk = data[behind:start]
        is_verdict = isinstance(message, (Ack, Nack))
        if message is None or (is_verdict and not (is_all and is_glitch(junk))):
            start += 1
            continue
        end = start + _LENGTHS[data[start]]
        yield start, end, message
        start = behind = end
        is_all = True


class ReturnCode(NamedTuple):
    """
    The meaning of a return code.

    :ivar kind: the code of :class:`Refused` that means the same.
    :ivar remedy: what an operator does about it.
    """

    kind: int
    meaning: str
    remedy: str


_NO_SUCH = Refused.ILLEGAL_ADDRESS
_VALUE = Refused.ILLEGAL_VALUE
_STATE = Refused.DEVICE_FAILURE
_CONFLICT = Refused.SETTINGS_CONFLICT
_RELEASE = Refused.RELEASE_NEEDED

_OPTION = ReturnCode(
    _NO_SUCH,
    'the necessary option pcb is not installed',
    'fit the option that the parameter belongs to, or leave it as it is',
)
_OTHER_INTERFACE = ReturnCode(
    _STATE,
    'not permitted via this serial interface',
    'use the keypad, or the other interface (X4 or X20)',
)
_INHIBIT = (
    'stop the motor, then inhibit the controller, by a quick stop or by a terminal that has the '
    'function /Controller inhibit'
)

#: NACKs of a drive that has carried out the request.
DONE: Mapping[int, str] = {
    0x1E: 'factory setting was started',
    0x28: 'parameter stored to volatile memory, lost on power-down (P801 is Off)',
}
REFUSALS: Mapping[int, ReturnCode] = {
    0x10: ReturnCode(_NO_SUCH, 'illegal index', 'look whether the model is set right'),
    0x11: ReturnCode(
        _NO_SUCH, 'function or parameter not implemented', 'this size or firmware does not have it'
    ),
    0x12: ReturnCode(_NO_SUCH, 'read access only', 'it cannot be written'),
    0x13: ReturnCode(_CONFLICT, 'parameter lock (P800) active', 'set P800 to No'),
    0x14: ReturnCode(
        Refused.BUSY, 'factory setting (P830) running', 'wait until it is done, some seconds'
    ),
    0x15: ReturnCode(_VALUE, 'parameter value too large', 'choose a smaller one'),
    0x16: ReturnCode(_VALUE, 'parameter value too small', 'choose a larger one'),
    0x17: _OPTION,
    0x18: ReturnCode(
        _STATE, 'fault in system software', 'switch the drive off and on; if it stays, ask SEW'
    ),
    0x19: _OTHER_INTERFACE,
    0x1A: ReturnCode(_CONFLICT, 'speed control (P770) active', 'set P770 to V/f mode first'),
    0x1B: ReturnCode(_STATE, 'unauthorized access', 'it is for the maker alone'),
    0x1C: ReturnCode(_RELEASE, 'output stage is not inhibited', _INHIBIT),
    0x1D: ReturnCode(
        _VALUE, 'invalid parameter value', 'choose one of its steps; not all between are allowed'
    ),
    0x22: ReturnCode(
        _CONFLICT,
        '4Q operation 1 (P890) required, for example for hoist function 1 (P710)',
        'set P890 to Yes first',
    ),
    0x23: ReturnCode(
        _CONFLICT,
        '4Q operation 2 (P891) required, for example for hoist function 2 (P712)',
        'set P891 to Yes first',
    ),
    0x24: ReturnCode(_CONFLICT, 'DC braking 1 (P730) active', 'set P730 to No first'),
    0x25: ReturnCode(_CONFLICT, 'DC braking 2 (P733) active', 'set P733 to No first'),
    0x26: ReturnCode(_CONFLICT, 'hoist function set 1 (P710) active', 'set P710 to No first'),
    0x27: ReturnCode(_CONFLICT, 'hoist function set 2 (P712) active', 'set P712 to No first'),
    0x29: _OTHER_INTERFACE,
    0x2A: ReturnCode(_CONFLICT, 'speed control (P770) inactive', 'set P770 to Speed control first'),
    0x2B: ReturnCode(_RELEASE, 'controller inhibit required', _INHIBIT),
    0x2C: ReturnCode(
        _CONFLICT,
        'motor size-up 1 (P328) and rapid start 1 (P720) exclude each other',
        'set the other one to No first',
    ),
    0x2D: ReturnCode(
        _CONFLICT,
        'motor size-up 2 (P348) and rapid start 2 (P723) exclude each other',
        'set the other one to No first',
    ),
    0x2E: _OPTION,
    0x2F: ReturnCode(
        _CONFLICT,
        '4Q operation 1 (P890) and DC braking 1 (P730) exclude each other',
        'set the other one to No first',
    ),
    0x30: ReturnCode(
        _CONFLICT,
        '4Q operation 2 (P891) and DC braking 2 (P733) exclude each other',
        'set the other one to No first',
    ),
    0x31: ReturnCode(
        _STATE,
        'controller inhibit active',
        'take the inhibit away first (terminal or function bits); that may start the motor',
    ),
    0x32: ReturnCode(
        _CONFLICT, 'synchronous operation control (P760) inactive', 'set P760 to Yes first'
    ),
    0x33: ReturnCode(
        _CONFLICT,
        'this drive is slave of the synchronous operation control (P761)',
        'change it in the master, or P761 first',
    ),
    0x34: ReturnCode(
        Refused.ILLEGAL_FUNCTION,
        'illegal message type',
        'the parameter may be of the other length, 4 or 8 bytes: look whether the model is right',
    ),
}


def refusal(code: int) -> Refused:
    """Return the refusal of a NACK with a return code."""
    hexadecimal = f'(return code {code:02X})'
    known = REFUSALS.get(code)
    if known is None:
        why = DONE.get(code, 'the drive refused; no manual lists why')
        return Refused(_STATE, f'{why} {hexadecimal}')
    return Refused(known.kind, f'{known.meaning}: {known.remedy} {hexadecimal}')


#: The longest delay that a drive may be set to answer with (P843), s.
LONGEST_RESPONSE_TIME = 0.2
#: Pauses within an answer, s: 10 ms of the drive [M4 §2.4.2], and what a USB adapter holds back.
_INTER_BYTE_TIMEOUT = 0.03
#: Silence between two frames, in characters: the manual wants none, but the drive has to release
#: the two wires before it can receive a start delimiter.
_GAP = 2
#: The least time of an answer, s; less is a line without speed.
_AT_ONCE = 0.001
CODEC = Codec(
    Enquiry, Select, kind, kinds, answers, encode, Reader, LONGEST_ANSWER, _INTER_BYTE_TIMEOUT
)


class MovitracLink(CodecLink):
    """
    A master of the MOVITRAC's protocol on one line: no belief in a doubtful answer.

    A DATA names its index, ACK and NACK name nothing, and no answer names its drive. Where a late
    answer may be *another* drive's, or the one before sent twice, the line is read for as long as
    the right answer may take; if anything more comes, nothing is believed. So an unresponsive drive
    costs its neighbours no transaction.

    Drives may be set to answer up to 0.2 s late (P843). No setting is needed for that: the first
    request, and each after a failure, may take so much longer than ``response_timeout``, any other
    as much longer as the drive has taken recently.

    What is promised: no value of another index is taken, no answer of the drive up to three
    time-outs late to an earlier request, no ACK of another write to it. Not distinguished is a late
    answer of another drive just when the right one is lost, and one that is sent twice, the second
    time when the right one may be on its way, but does not come. There is no parity, and the check
    is a sum: choose short wires.
    """

    #: [M4 §2.3.1], [M4 §2.3.3]; 31 drives on a line at most, with addresses of 64 [C75].
    protocol = MOVITRAC
    _codec = CODEC
    _longest_response = LONGEST_RESPONSE_TIME

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        """Read one parameter, of 4 or of 8 bytes."""
        answer, arrived = self._ask(Enquiry(unit, address.index), once)
        if isinstance(answer, Nack):
            raise refusal(answer.code)
        if len(answer.value) != address.size:
            came = f'a value of {len(answer.value)} bytes came instead of {address.size}'
            raise DamagedAnswer(f'unit {unit}, index {address.index}: {came}')
        return Reply(answer.value, arrived)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """
        Write one parameter, of 4 or of 8 bytes.

        A drive whose NACK says that it has started a factory setting, or keeps the value only until
        it is switched off, has carried it out [C81].
        """
        answer, arrived = self._command(Select(unit, address.index, data))
        if isinstance(answer, Nack) and answer.code not in DONE:
            raise refusal(answer.code)
        return Reply(b'', arrived)

    @cached_property
    def _gap(self) -> float:
        return _GAP * self._settings.char_time

    def _note_unrequested(self, data: bytes, request: Any) -> None:
        # a transmitter that is switched makes a byte or two
        if not is_glitch(data):
            super()._note_unrequested(data, request)

    def _longest_delay(self, unit: int) -> float:
        longest = self._late.longest(unit)
        unsettled = bool(self._late.quarantined(unit, self._now()))
        return LONGEST_RESPONSE_TIME if unsettled or not longest else longest

    def _took(self, unit: int, seconds: float) -> None:
        super()._took(unit, max(_AT_ONCE, seconds))

    def _confirm(self, request: Any, answer: Any, arrived: float, until: float) -> None:
        # it may be the one before, sent twice, or another unit's, late
        foreign = self._late.may_be_of_another(request.unit, kind(answer), arrived)
        if not (self._again or foreign):
            return
        if data := self._listen(until):
            self._another.hear_bytes(data, self._now())
            raise DamagedAnswer(f'unit {request.unit}: two answers came, one of them is late')
        if self._now() < until:
            raise DamagedAnswer(f'unit {request.unit}: {STOP_WAITS}')
