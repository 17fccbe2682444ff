# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Which answers to a write are believed that name another value than was written.

A drive may limit or round what it takes, and answer what it has then. But an answer that is late,
or comes twice, looks the same where it is to an earlier write, and so does one to another master.
Without I/O; time is in seconds of one steady clock.
"""

from __future__ import annotations

from collections import deque

from nfo_sinus_driver.link.interface import AnotherValue, DamagedAnswer
from nfo_sinus_driver.link.modbus.pdu import WRITE_SINGLE_REGISTER, Request, Write

#: Where a value stands in the answer to a write of one register: behind unit, function, register.
_VALUE_AT, _LENGTH = 4, 6


class OtherValues:
    """
    The values that units answer in place of those that were written.

    Another value is believed when it comes twice in a row for the same register, and was not
    written there by this end for as long as answers may be late.

    :param memory: how late an answer may be, s.
    """

    def __init__(self, memory: float) -> None:
        self._memory = memory
        #: The last writes: where, what and when; and what came last in place of one.
        self._written: deque[tuple[bytes, bytes, float]] = deque()
        self._answered: dict[bytes, bytes] = {}

    def sent(self, request: Request[object], now: float) -> None:
        """Note a request of this end."""
        if isinstance(request, Write) and request.function == WRITE_SINGLE_REGISTER:
            self._written.append((request.answer_head[:_VALUE_AT], request.data, now))
        while self._written and self._written[0][2] < now - self._memory:
            self._written.popleft()

    def took(self, request: Request[object]) -> None:
        """Note that a request was answered with the value that was written."""
        if isinstance(request, Write):
            self._answered.pop(request.answer_head[:_VALUE_AT], None)

    def error_of(
        self, request: Request[object], message: bytes
    ) -> AnotherValue | DamagedAnswer | None:
        """Return what a message means that came alone; ``None``: it names no other value."""
        place = request.answer_head[:_VALUE_AT]
        if not isinstance(request, Write) or request.function != WRITE_SINGLE_REGISTER:
            return None
        value = message[_VALUE_AT:]
        if not message.startswith(place) or len(message) != _LENGTH or value == request.data:
            return None
        if any((where, data) == (place, value) for where, data, _ in self._written):
            return None
        before = self._answered.get(place)
        self._answered[place] = value
        if before == value:
            return AnotherValue(request.unit, request.data, value)
        doubtful = DamagedAnswer(
            f'unit {request.unit} answers {value.hex()}h where {request.data.hex()}h was written'
        )
        doubtful.responded = True
        return doubtful
