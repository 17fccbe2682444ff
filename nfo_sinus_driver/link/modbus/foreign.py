# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another Modbus master on a line, by its requests and the answers to them."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
import math
from typing import NamedTuple

from nfo_sinus_driver.link.foreign_traffic import Sightings
from nfo_sinus_driver.link.interface import Remarks
from nfo_sinus_driver.link.modbus.link import (
    ENCAPSULATED_INTERFACE,
    REPORT_SLAVE_ID,
    ReadDevice,
    ReportSlaveId,
)
from nfo_sinus_driver.link.modbus.pdu import REFUSAL_LENGTH

_ANOTHER_MODBUS_MASTER = (
    'another Modbus master asks the drives on this line: a line has one master, so disconnect it '
    'or stop its program; until then readings come later, and commands of its own may reach a drive'
)
#: How many of our own requests may still come back, or be answered by the same bytes.
_OWN = 8
#: More bytes than any frame has.
_MOST = 600
#: Functions whose answer has its length; functions whose answer is the beginning of the request.
_READS = (1, 2, 3, 4)
_SINGLE = (5, 6)
_MULTIPLE = (15, 16)
_READ_WRITE = 23
#: The lengths of the requests for the identity of a unit.
_REPORT_LENGTH = 2
_DEVICE_LENGTH = 5
#: No message is longer.
_LONGEST_ANSWER = 254
_EXCEPTION = 0x80


def message_lengths(beginning: bytes) -> set[int]:
    """Return the possible lengths of a message that begins like this, request or answer."""
    if len(beginning) < 2 or not beginning[0]:
        return set()
    if beginning[1] == REPORT_SLAVE_ID:
        return {_REPORT_LENGTH, ReportSlaveId(beginning[0]).measure(beginning)}
    if len(beginning) < 3:
        return set()
    function, with_data = beginning[1], 3 + beginning[2]
    if function & _EXCEPTION:
        return {REFUSAL_LENGTH}
    if function in _READS:
        return {6, with_data}
    if function in _SINGLE:
        return {6}
    if function == ENCAPSULATED_INTERFACE:
        return {_DEVICE_LENGTH, ReadDevice(beginning[0]).measure(beginning)}
    if function in _MULTIPLE:
        return {6, 7 + beginning[6]} if len(beginning) > 6 else {6}
    if function == _READ_WRITE:
        return {with_data, 11 + beginning[10]} if len(beginning) > 10 else {with_data}
    return set()


def _answer_head(message: bytes) -> bytes:
    """Return the beginning of the answer to a message if it may be a request; else nothing."""
    function, length = message[1], len(message)
    count = int.from_bytes(message[4:6], 'big')
    if function in _READS and length == 6:
        size = 2 * count if function > 2 else -(-count // 8)
        return message[:2] + bytes((size,)) if 0 < size < 251 else b''
    if function in _SINGLE:
        return message
    if function == REPORT_SLAVE_ID and length == _REPORT_LENGTH:
        return ReportSlaveId(message[0]).answer_head
    if function == ENCAPSULATED_INTERFACE and length == _DEVICE_LENGTH:
        return ReadDevice(message[0], message[3]).answer_head
    if function in _MULTIPLE and length > 7:
        return message[:6]
    if function == _READ_WRITE and length > 11 and 0 < count < 126:
        return message[:2] + bytes((2 * count,))
    return b''


def _answer_length(request: bytes) -> int:
    """Return how long the answer to a request is at most."""
    head = _answer_head(request)
    if request[1] in (REPORT_SLAVE_ID, ENCAPSULATED_INTERFACE):
        return _LONGEST_ANSWER
    return len(head) + head[2] if len(head) == 3 else len(head)


def _refusal_head(message: bytes) -> bytes:
    """Return the beginning of the refusal of a request."""
    return bytes((message[0], message[1] | _EXCEPTION))


def _kinds(request: bytes) -> tuple[bytes, bytes]:
    """Return how the answer to a request begins, and its refusal."""
    return _answer_head(request), _refusal_head(request)


def _answers(message: bytes, request: bytes) -> bool:
    """Return whether a message can only be the answer to a request, or the request once more."""
    if message.startswith(_refusal_head(request)):
        return len(message) == REFUSAL_LENGTH
    if request[1] in _SINGLE:
        return message == request
    # a request may begin as an answer does: 0264h is read by the first bytes of an answer of two
    return message.startswith(_answer_head(request)) and not _answer_head(message)


class _OpenRequest(NamedTuple):
    """A request of another master, and until when its answer is waited for."""

    message: bytes
    until: float


class ForeignModbus:
    """
    Finds the requests of another master, and the answers to them, in what is no answer to us.

    Its request is open until its answer has come, or may be late. While it is open, and in every
    exchange in which any of its bytes came, no answer is certain: one to a read names no
    register.

    :param messages: yields the whole frames in some bytes: where each begins and ends, and its
        message.
    :param patience: returns how long an answer of a unit, and of a length, is waited for, s.
    :param is_second: returns whether a frame, with its message, is a second answer to us.
    """

    def __init__(
        self,
        remarks: Remarks,
        response_timeout: float,
        messages: Callable[[bytes], Iterator[tuple[int, int, bytes]]],
        patience: Callable[[int, int], float],
        is_second: Callable[[bytes, bytes], bool],
    ) -> None:
        self._sightings = Sightings(remarks)
        self._is_second = is_second
        self._response_timeout = response_timeout
        self._patience = patience
        self._messages = messages
        #: What may become a frame, how much of it was taken as no frame, and when it came; and what
        #: came between the frames of another master.
        self._buffer = b''
        self._taken = 0
        self._heard_at = -math.inf
        self._rest = b''
        self._own: deque[bytes] = deque(maxlen=_OWN)
        #: In the order in which they came, which is that of their answers.
        self._open_requests: dict[int, list[_OpenRequest]] = {}
        #: How the answers to those may begin that came since our last request.
        self._meanwhile: set[bytes] = set()

    def sent(self, frame: bytes) -> None:
        """Note a request of ours: it may come back, and is not of another master."""
        self._own.append(frame)
        self._meanwhile.clear()

    def may_be_answered_by(self, kind: bytes) -> bool:
        """
        Return whether what came since our last request may be answered by an answer of a kind.

        Bytes of no frame may be of such a request, too.
        """
        return kind in self._meanwhile or self.has_rest

    @property
    def has_rest(self) -> bool:
        """Bytes came that are of no whole frame, and were not taken."""
        return bool(self._rest) or len(self._buffer) > self._taken

    def is_there(self, now: float) -> bool:
        """Return whether another master has sent anything recently."""
        return self._sightings.is_there(now)

    def open_until(self, unit: int) -> float:
        """Return until when an answer of a unit may be to another master; 0: it is not."""
        requests = self._open_requests.get(unit)
        return max(request.until for request in requests) if requests else 0.0

    def take_open(self, unit: int) -> list[bytes]:
        """Return how answers and refusals begin that may still come, for a request goes before."""
        requests = self._open_requests.pop(unit, ())
        return [kind for request in requests for kind in _kinds(request.message)]

    def hear_bytes(self, data: bytes, now: float) -> bool:
        """Take bytes that are no answer to us; those of no frame are kept for a while."""
        if now > self._heard_at + self._response_timeout:
            self._rest += self._take_buffer()
            self._buffer, self._taken = b'', 0
        self._heard_at = now
        buffer = self._buffer + data
        behind = 0
        for start, end, message in self._messages(buffer):
            # an answer comes behind its request
            if start >= behind and self._is_known(buffer[start:end], message, now):
                self._rest += buffer[max(behind, self._taken) : start]
                behind = end
        behind = max(behind, len(buffer) - _MOST)
        self._buffer, self._taken = buffer[behind:], max(0, self._taken - behind)
        return False

    def _take_buffer(self) -> bytes:
        """Return what has become no frame yet, once."""
        taken, self._taken = self._taken, len(self._buffer)
        return self._buffer[taken:]

    def was_answered_in(self, data: bytes) -> bool:
        """Return whether another master's request and the answer to it are in some bytes."""
        request = b''
        for _, _, message in self._messages(data):
            if request and _answers(message, request):
                return True
            if _answer_head(message):
                request = message
        return False

    def take_rest(self, unit: int) -> bytes:
        """Return the bytes of no frame of another master, now that the line is silent."""
        if self._open_requests.get(unit):
            # the beginning of the answer, perhaps
            return b''
        rest, self._rest = self._rest + self._take_buffer(), b''
        return rest

    def clear(self) -> None:
        """Forget what came: the port is closed."""
        self._buffer = self._rest = b''
        self._taken = 0
        self._open_requests.clear()

    def _is_own(self, frame: bytes, message: bytes, now: float) -> bool:
        """Return whether a frame may be an echo of ours; a write's answer is the same."""
        if message[1] in _SINGLE:
            return frame in self._own
        # another master that is there may send the same
        return frame in [*self._own][-1:] and not self.is_there(now)

    def _is_known(self, frame: bytes, message: bytes, now: float) -> bool:
        if not self.is_there(now) and self._is_second(frame, message):
            return True
        return self._is_foreign(frame, message, now)

    def _is_foreign(self, frame: bytes, message: bytes, now: float) -> bool:
        if self._is_own(frame, message, now):
            return False
        requests = self._open_requests.setdefault(message[0], [])
        for number, request in enumerate(requests, start=1):
            if _answers(message, request.message):
                # those before it were lost; a write that comes again may have been, too
                again = [request._replace(until=now)] if message == request.message else []
                requests[:number] = again
                return True
        if not _answer_head(message):
            return False
        self._sightings.add(now, _ANOTHER_MODBUS_MASTER)
        self._meanwhile.update(_kinds(message))
        patience = self._patience(message[0], _answer_length(message))
        requests.append(_OpenRequest(message, now + patience))
        return True
