# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages of the Classic protocol of NFO, without I/O, and why one refuses [M0 §6.1], [M2 §5].

:func:`encode` makes a message; a :class:`Reader` finds messages in whatever bytes come in, in any
pieces, among noise and the remains of others. Hexadecimal digits are sent in upper case and read
in both [C86].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, reduce
from operator import xor

from nfo_sinus_driver.link.interface import LinkError, Refused
from nfo_sinus_driver.link.line_protocols import BROADCAST, POINT_TO_POINT

#: Of how many messages what is sent is kept; the ENQUIRIES of a poll are sent again and again.
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
#: What tells answers apart: the number that a REPLY names, else only what it is.
Kind = int | type[Message]


def kind(message: Message) -> Kind:
    """Return what tells an answer from others."""
    return message.number if isinstance(message, Value) else type(message)


def kinds(request: Request) -> tuple[Kind, Kind]:
    """Return the kinds of answers that a request may have."""
    return request.number if isinstance(request, Enquiry) else Ack, Nak


def nameless(request: Request) -> tuple[Kind, ...]:
    """Return those of them that do not say what they answer."""
    return tuple(kind for kind in kinds(request) if isinstance(kind, type))


def answers(message: Message, request: Request) -> bool:
    """Tell whether a message may be the answer to a request."""
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
#: What characters each kind of message may have, one set for each; an answer has no EOT.
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

    A message counts only when every character is one that may stand there and the check sum is
    right. It is cut by its length, for a check sum may be any control character. What breaks off
    is passed over up to the character that breaks it, so that its remains are taken for nothing
    and the next whole message is found. A REPLY straight behind an EOT is no REPLY but a SELECT:
    the echo of a request never looks like an answer.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()

    @property
    def pending(self) -> int:
        """How many bytes have come of a message that is not whole yet."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[Message]:
        """Take bytes that came in; return the messages that became whole, in their order."""
        self._buffer += data
        found: list[Message] = []
        while self._buffer:
            shapes = _REQUESTS if self._buffer[0] == _EOT else _ANSWERS
            fit, shape = max([(_fit(self._buffer, shape), shape) for shape in shapes], key=_first)
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
        """Return where to look on, when only the first ``fit`` characters belong together."""
        # an STX has its address before it, even where that could be a digit of what broke off
        return max(1, fit - (self._buffer[fit] == _STX))


def _first(entry: tuple[int, object]) -> int:
    return entry[0]


def _fit(data: bytearray, shape: tuple[_Chars, ...]) -> int:
    """Return how many characters at the beginning are as the shape wants them."""
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


#: The parameters that the protocol itself needs; both firmwares have them.
INV_ST = 0x00E9  #: inverter status, without acknowledging
SIO_ERR = 0x00AC  #: serial fault flags; reading clears them and the serial fault
MODE = 0x0029  #: who controls the drive

#: The inverter status of a serial fault [M0 table 19].
SIO_FAIL = 14
#: The inverter status codes that are faults; the rest are what the drive does.
_FAULTS = range(1, 24)

_VALUE_BIT = 10
#: Prefix, unknown, unreadable, not to be written.
_ADDRESS_BITS = (5, 7, 8, 9)
#: SioErr, bit by bit [M2 table 4].
FLAGS = {
    0: 'the inverter is blocked by an alarm',
    1: 'wrong parity',
    2: 'wrong check sum',
    3: 'wrong message structure',
    4: 'time-out of the serial communication',
    5: 'wrong parameter prefix',
    6: 'not permitted in the current mode',
    7: 'unknown parameter',
    8: 'the parameter cannot be read',
    9: 'the parameter cannot be written',
    10: 'the value is out of range',
    14: 'receive buffer overrun',
}


def flag_names(word: int) -> list[str]:
    """Return what the serial fault flags say, in words."""
    bits = (bit for bit in range(16) if word >> bit & 1)
    return [FLAGS.get(bit, f'flag {bit}') for bit in bits]


def refused_by_status(inv_st: int) -> Refused:
    """Return what the inverter status says of a NAK, where the flags are not read."""
    if inv_st == SIO_FAIL:
        text = 'a serial fault (Sio Fail) is active: until it is acknowledged nothing can be done'
        return Refused(Refused.DEVICE_FAILURE, f'{text} (NAK)')
    if inv_st in _FAULTS:
        text = f'a fault is active (InvSt {inv_st}): until it is acknowledged nothing can be done'
        return Refused(Refused.DEVICE_FAILURE, f'{text} (NAK)')
    text = 'the drive does not accept this value, or not in its present state'
    return Refused(Refused.ILLEGAL_VALUE, f'{text} (NAK, InvSt {inv_st})')


def refused_by_flags(word: int) -> Refused:
    """Return what the serial fault flags say of the NAK that raised them; they are clear now."""
    code = Refused.DEVICE_FAILURE
    if word >> _VALUE_BIT & 1:
        code = Refused.ILLEGAL_VALUE
    elif any(word >> bit & 1 for bit in _ADDRESS_BITS):
        code = Refused.ILLEGAL_ADDRESS
    why = ', '.join(flag_names(word)) or 'it does not say why'
    text = f'the drive refused: {why}; its serial fault (Sio Fail) by this is cleared (NAK)'
    return Refused(code, text)


def refused_unknown(error: LinkError) -> Refused:
    """Return what to say of a NAK whose reason could not be found out."""
    return Refused(Refused.DEVICE_FAILURE, f'the drive refused (NAK); why is not known: {error}')
