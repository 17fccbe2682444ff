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

"""Modbus RTU over one serial line: exact time, and no belief in a doubtful answer."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import time
from typing import Any
from typing import Protocol
from typing import TypeVar

from nfo_sinus_driver.link import rtu
from nfo_sinus_driver.link.errors import DamagedAnswer
from nfo_sinus_driver.link.errors import NoAnswer
from nfo_sinus_driver.link.errors import NotReady
from nfo_sinus_driver.link.errors import Refused
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.interface import Words
from nfo_sinus_driver.link.rtu_identify import RtuInquiry
from nfo_sinus_driver.link.settings import LineSettings

_T = TypeVar('_T')

#: How late an answer may come, in time-outs, before it counts as lost for good.
LATEST_ANSWER = 4
#: USB adapters hand bytes over in lumps, so a pause within an answer may last this long, s.
_LUMP = 0.03


class Port(Protocol):
    """What carries the bytes."""

    def open(self) -> None: ...  # noqa: D102

    def close(self) -> None: ...  # noqa: D102

    def write(self, data: bytes) -> None: ...  # noqa: D102

    def read(self, until: float) -> bytes: ...  # noqa: D102


#: The heads of answers that may still come, and until when.
_Doubt = dict[bytes, float]


class RtuLink:
    """
    A Modbus RTU master on one line.

    Between frames the line is silent for t3.5 at least, counted from the last byte seen on it.

    A read answer does not name its register. So whenever an answer is missing or damaged, or
    bytes come that nobody asked for, the unit is in doubt: a request whose answer could be
    confused with one still on its way is only sent after a request of another shape has been
    answered (units answer in order), or after :data:`LATEST_ANSWER` time-outs of silence.
    """

    space = 'modbus'

    def __init__(self, port: Port, settings: LineSettings) -> None:
        self._port = port
        self._settings = settings
        self._probes: dict[int, tuple[Address, ...]] = {}
        self._doubts: dict[int, _Doubt] = {}
        self._last: rtu.Request[Any] | None = None
        #: When the last byte was on the line, as far as we know.
        self._line_end = 0.0

    def open(self) -> None:
        """
        Open the port.

        :raises PortError: it cannot be opened; the message says what to do.
        """
        self._port.open()
        self._line_end = time.monotonic()

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        self._port.close()
        self._doubts.clear()
        self._last = None

    def use_probes(self, unit: int, probes: Sequence[Address]) -> None:
        """Name parameters of different sizes that are safe to read at any time."""
        self._probes[unit] = tuple(probes)

    def read(self, unit: int, address: Address) -> Reply:
        """
        Read one parameter (function 03).

        :raises LinkError: as its subclasses say.
        """
        return Reply(*self._ask(rtu.Read(unit, address.numbers[0], address.words)))

    def write(self, unit: int, address: Address, words: Words) -> Reply:
        """
        Write one parameter (function 06 for one word, 16 for several).

        :raises LinkError: as its subclasses say.
        """
        return Reply(*self._ask(rtu.Write(unit, address.numbers[0], words)))

    def write_and_read(
        self, unit: int, address: Address, words: Words, source: Address
    ) -> Reply:
        """
        Write one parameter and read another, in one transaction (function 23).

        :raises LinkError: as its subclasses say.
        """
        register, read_from = address.numbers[0], source.numbers[0]
        request = rtu.WriteAndRead(unit, register, words, read_from, source.words)
        return Reply(*self._ask(request))

    def identify(self, unit: int) -> RtuInquiry:
        """Return the questions by which a unit tells who it is (functions 43/14 and 17)."""
        return RtuInquiry(unit, self._ask)

    def _ask(self, request: rtu.Request[_T]) -> tuple[_T, float]:
        """Return the answer to a request, and when its last byte came."""
        self._await_silence()
        doubt = self._doubt(request.unit)
        # a write answer names what was written, and nobody believes it without reading back
        if not isinstance(request, rtu.Write) and doubt:
            # a refusal that is believed tells as well as an answer that all is said
            with contextlib.suppress(Refused):
                self._transact(self._probe(request.unit, doubt))
            self._await_silence()
        return self._transact(request)

    def _doubt(self, unit: int) -> _Doubt:
        """Return what may still come, without what is too late by now."""
        now = time.monotonic()
        doubt = {head: until for head, until in self._doubts.get(unit, {}).items() if until > now}
        self._doubts[unit] = doubt
        return doubt

    def _probe(self, unit: int, doubt: _Doubt) -> rtu.Read:
        probes = [
            rtu.Read(unit, address.numbers[0], address.words)
            for address in self._probes.get(unit, ())
        ]
        for probe in probes:
            if probe.answer_head not in doubt:
                return probe
        # not until nothing is in doubt: a write that fails again and again must not keep reads out
        ends = [doubt[probe.answer_head] for probe in probes] or doubt.values()
        raise NotReady(max(ends))

    def _distrust(self, request: rtu.Request[Any]) -> None:
        until = time.monotonic() + (LATEST_ANSWER - 1) * self._settings.response_timeout
        self._doubts.setdefault(request.unit, {})[request.answer_head] = until

    def _await_silence(self) -> None:
        """Wait for t3.5 of silence; bytes that come meanwhile were not asked for."""
        gap = self._settings.frame_gap
        give_up = time.monotonic() + self._settings.response_timeout
        while True:
            data = self._port.read(self._line_end + gap)
            now = time.monotonic()
            if not data:
                if now >= self._line_end + gap:
                    return
                continue
            self._line_end = max(self._line_end, now)
            if self._last is not None:
                self._distrust(self._last)
            if now > give_up:
                raise DamagedAnswer('the line is never silent: noise, or another master on it')

    def _transact(self, request: rtu.Request[_T]) -> tuple[_T, float]:
        frame = rtu.encode(request)
        self._last = request
        self._port.write(frame)
        self._line_end = time.monotonic() + len(frame) * self._settings.char_time
        answer = rtu.AnswerReader(request)
        try:
            reply, arrived = self._receive(request, answer)
        except (NoAnswer, DamagedAnswer):
            self._distrust(request)
            raise
        except Refused:
            self._doubts.pop(request.unit, None)
            raise
        late = request.answer_head in self._doubt(request.unit)
        if not late:
            # units answer in order: whatever was still to come has come before this
            self._doubts.pop(request.unit, None)
            # and the request has left, even where the port is faster than its settings say
            self._line_end = arrived
        if late or answer.received:
            # it may answer an earlier write of the same, or answer twice: one more may come
            self._distrust(request)
        return reply, arrived

    def _receive(
        self, request: rtu.Request[_T], answer: rtu.AnswerReader[_T]
    ) -> tuple[_T, float]:
        char_time = self._settings.char_time
        # an exception names neither register nor length: it may belong to the earlier request
        believe_refusal = all(head[1] != request.function for head in self._doubt(request.unit))
        deadline = self._line_end + self._settings.response_timeout
        # one answer, and as much rubbish again, however long somebody keeps talking
        last_chance = deadline + 2 * request.answer_length * char_time + _LUMP
        came = 0
        while True:
            data = self._port.read(deadline)
            now = time.monotonic()
            if not data:
                if now < deadline:
                    continue
                break
            came += len(data)
            # what comes while the request still leaves is no answer to it
            self._line_end = max(self._line_end, now)
            reply = self._feed(answer, data, believe_refusal)
            if reply is not None:
                return reply, now
            rest = answer.missing * char_time + _LUMP
            deadline = min(max(deadline, now + rest), last_chance)
        if came:
            raise DamagedAnswer(f'unit {request.unit}: {came} bytes came that are no answer')
        raise NoAnswer(f'unit {request.unit} did not answer')

    @staticmethod
    def _feed(answer: rtu.AnswerReader[_T], data: bytes, believe_refusal: bool) -> _T | None:
        while True:
            try:
                return answer.feed(data)
            except Refused:
                if believe_refusal:
                    raise
                data = b''
