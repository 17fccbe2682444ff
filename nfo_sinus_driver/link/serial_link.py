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

"""Modbus over one serial line: exact time, and no belief in a doubtful answer."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from collections.abc import Sequence
import contextlib
import time
from typing import Any
from typing import Protocol
from typing import TypeVar

from nfo_sinus_driver.link.answer_reader import AnswerReader
from nfo_sinus_driver.link.doubts import Doubts
from nfo_sinus_driver.link.echo import Echo
from nfo_sinus_driver.link.errors import DamagedAnswer
from nfo_sinus_driver.link.errors import LinkError
from nfo_sinus_driver.link.errors import NeverSilent
from nfo_sinus_driver.link.errors import NoAnswer
from nfo_sinus_driver.link.errors import NotReady
from nfo_sinus_driver.link.errors import Refused
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.modbus_link import ModbusLink
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.modbus_pdu import Write
from nfo_sinus_driver.link.modbus_pdu import WriteAndRead
from nfo_sinus_driver.link.modbus_pdu import refusal_head
from nfo_sinus_driver.link.modbus_pdu import write_and_read_of
from nfo_sinus_driver.link.modbus_probes import answer_kinds
from nfo_sinus_driver.link.modbus_probes import probes
from nfo_sinus_driver.link.settings import LineSettings

_T = TypeVar('_T')

#: How long a line is not trusted that has told something nobody asked for, s.
DISTRUST = 60.0
#: How much later than its slowest answer of late a unit may answer.
_LATER = 1.25
#: What is left of the memory of a slow answer with each of the next.
_DECAY = 0.95
#: How many of the longest pauses within an answer there may be.
_PAUSES = 3
#: How long a write waits at least for a line that is not silent, s.
_WRITE_PATIENCE = 0.02
#: Bytes in the answer to a read of two registers.
_TWO_REGISTERS = 7


class Port(Protocol):
    """What carries the bytes."""

    def open(self) -> None: ...  # noqa: D102

    def close(self) -> None: ...  # noqa: D102

    def write(self, data: bytes) -> None: ...  # noqa: D102

    def read(self, until: float) -> bytes: ...  # noqa: D102


class SerialLink(ModbusLink):
    """
    A Modbus master on one line.

    Between frames the line is silent for a gap at least, counted from the last byte seen on it.

    A read answer does not name its register. So whenever an answer is missing or damaged, or
    bytes come that nobody asked for, its shape is in doubt (:class:`Doubts`): a request whose
    answer could be confused with it is only sent after one of another shape has been answered. A
    write is sent at once, for it may be a stop, and its answer names what was written.

    For the same reason an answer with the very bytes of the one before is not believed at once: it
    may be the one before, told twice. The right one would come when a unit answers, so until then
    the line is listened to. A line that has told something nobody asked for is not trusted so far
    for a while: there it is believed only after a request of another shape. If it answers the same
    question too, what it says is right, but one more may come: the next request of its shape waits
    for that.
    """

    def __init__(self, port: Port, settings: LineSettings) -> None:
        self._port = port
        self._settings = settings
        self._doubts: Doubts[bytes] = Doubts(settings.response_timeout)
        self._safe: dict[int, tuple[Address, ...]] = {}
        self._echo = Echo()
        self._last: Request[Any] | None = None
        #: The last answer of each unit, to what, and until when it may come again.
        self._told: dict[int, tuple[bytes, Request[Any], float]] = {}
        #: The last answer repeats the one before it, to this request.
        self._repeats: Request[Any] | None = None
        #: Until when an answer may well come twice.
        self._distrust_until = 0.0
        #: How long a unit has taken at most to answer, s, and when the last request had left.
        self._slowest: dict[int, float] = {}
        self._sent_at = 0.0
        #: The probe on its way is only about that.
        self._confirming = False
        #: Other bytes came with the last answer.
        self._stray = False
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
        self._echo = Echo()
        self._told.clear()
        self._last = None

    def distrust(self) -> None:
        """Expect answers that come twice: it has been heard that they do."""
        self._distrust_until = time.monotonic() + DISTRUST

    def use_probes(self, unit: int, probes: Sequence[Address]) -> None:
        """Name parameters of different sizes that are safe to read at any time."""
        self._safe[unit] = tuple(probes)

    def write_and_read(
        self, unit: int, address: Address, data: bytes, source: Address
    ) -> Reply:
        """
        Write one parameter and read another (function 23), or only write it.

        It is only written where the answer could be confused with another, for no write waits until
        the line can be believed.

        :raises LinkError: as its subclasses say.
        """
        request = write_and_read_of(unit, address, data, source)
        self._await_silence(request)
        if not self._doubts.of(unit).isdisjoint(answer_kinds(request)):
            return self.write(unit, address, data)
        return Reply(*self._ask(request))

    # --- what the protocols differ in -------------------------------------------------------------

    @property
    @abstractmethod
    def _gap(self) -> float:
        """How long the line is silent between two frames, s."""

    @abstractmethod
    def _encode(self, request: Request[Any]) -> bytes:
        """Return the frame of a request."""

    @abstractmethod
    def _reader(self, request: Request[_T]) -> AnswerReader[_T]:
        """Return what finds the answer to a request."""

    @abstractmethod
    def _frame_length(self, message_length: int) -> int:
        """Return how many bytes the frame of a message has."""

    # --- belief -----------------------------------------------------------------------------------

    def _ask(self, request: Request[_T]) -> tuple[_T, float]:
        """Return the answer to a request, and when its last byte came."""
        self._await_silence(request)
        # a write answer names what was written, and nobody believes it without reading back
        probed = not isinstance(request, Write) and self._make_certain(request)
        try:
            answer = self._transact(request)
        except Refused:
            self._confirm(request)
            raise
        except LinkError as error:
            error.heard = probed
            raise
        self._confirm(request, names_it=isinstance(request, Write))
        return answer

    def _ask_unheard(self, request: Request[object]) -> None:
        """Send a request at once and wait for its answer, whatever that is and says."""
        self._await_silence(request)
        with contextlib.suppress(NoAnswer, DamagedAnswer, Refused):
            self._transact(request)
        if self._repeats is not None:
            # it may be the one before, told twice
            self._doubt(request)

    def _in_doubt(self, request: Request[Any]) -> bool:
        """Tell whether the answer to an earlier request would look like that to this one."""
        return request.answer_head in self._doubts.of(request.unit)

    def _doubt(self, request: Request[Any]) -> None:
        """Expect an answer to a request, one more than has come."""
        self._doubts.add(request.unit, answer_kinds(request))

    def _make_certain(self, request: Request[Any]) -> bool:
        """
        Have the unit answer something else, if its answer to this could be confused with another.

        :returns: whether it was asked, and answered.
        :raises NotReady: that cannot be told from others either.
        """
        if not self._in_doubt(request):
            return False
        questions = [(request, (request.answer_head,)), *self._probes(request.unit)]
        question = self._doubts.first_certain(request.unit, questions)
        if question is request:
            return False
        try:
            self._probe(question)
        except LinkError as error:
            # nobody has heard the request itself
            error.maybe_done = False
            raise
        self._await_silence(request)
        return True

    def _probes(self, unit: int) -> Iterator[tuple[Request[Any], Sequence[bytes]]]:
        return probes(unit, self._safe.get(unit, ()))

    def _probe(self, probe: Request[Any]) -> None:
        """Have a unit answer, whatever it says."""
        # a refusal that is believed tells as well as an answer that all is said
        with contextlib.suppress(Refused):
            self._transact(probe)

    def _confirm(self, request: Request[Any], *, names_it: bool = False) -> None:
        """
        Make sure that the answer is not the one before, told twice.

        :param names_it: the answer says itself what it is about.
        """
        if self._repeats is None:
            return
        if time.monotonic() > self._distrust_until:
            if not names_it and self._repeats != request:
                self._listen(request)
            return
        if names_it or self._repeats == request:
            # what it says is right, but it may come once more
            self._doubts.add(request.unit, (request.answer_head,))
            return
        stray = self._stray
        self._doubt(request)
        self._confirming = True
        try:
            stray |= self._await_silence(request)
            self._probe(self._doubts.first_certain(request.unit, self._probes(request.unit)))
            if not stray and not self._stray:
                return
        except (NotReady, NeverSilent):
            pass
        except (NoAnswer, DamagedAnswer):
            # the right answer may be as late as that to the probe
            self._doubt(request)
            raise
        finally:
            self._confirming = False
        raise DamagedAnswer(f'unit {request.unit}: an answer came twice')

    def _listen(self, request: Request[Any]) -> None:
        """
        Wait as long as the right answer may take, if this was the one before, told twice.

        :raises DamagedAnswer: it came.
        """
        length = self._frame_length(request.answer_length) * self._settings.char_time
        until = self._sent_at + _LATER * self._slowest.get(request.unit, 0.0) + length
        while (now := time.monotonic()) < until:
            if self._port.read(until):
                self._line_end = max(self._line_end, now)
                self._doubt(request)
                self.distrust()
                raise DamagedAnswer(f'unit {request.unit}: an answer came twice')

    def _await_silence(self, request: Request[Any]) -> bool:
        """
        Wait for a gap of silence; tell whether bytes came meanwhile that nobody asked for.

        A write may be a stop, and the noise may be on our side of the line alone: rather than not
        at all it is sent into it, as soon as no answer that began before can still be coming.

        :raises NeverSilent: there is none.
        """
        is_write = isinstance(request, (Write, WriteAndRead))
        patience = self._write_patience if is_write else self._settings.response_timeout
        give_up = max(self._line_end + self._gap, time.monotonic()) + patience
        came = False
        while True:
            data = self._port.read(self._line_end + self._gap)
            now = time.monotonic()
            if not data:
                if now >= self._line_end + self._gap:
                    return came
                continue
            came = True
            self.distrust()
            self._line_end = max(self._line_end, now)
            if self._last is not None:
                self._doubt(self._last)
            if now > give_up:
                if is_write:
                    return came
                raise NeverSilent('the line is never silent: noise, or another master on it')

    @property
    def _write_patience(self) -> float:
        """How long a write waits for a line that is not silent, s: one answer of two registers."""
        longest = self._frame_length(_TWO_REGISTERS) * self._settings.char_time
        return max(_WRITE_PATIENCE, longest)

    # --- one transaction --------------------------------------------------------------------------

    def _transact(self, request: Request[_T]) -> tuple[_T, float]:
        frame = self._encode(request)
        self._last = request
        self._repeats = None
        self._echo.sent(frame)
        self._port.write(frame)
        self._sent_at = time.monotonic() + len(frame) * self._settings.char_time
        self._line_end = self._sent_at
        reader = self._reader(request)
        try:
            answer, arrived = self._receive(request, reader, frame)
        except (NoAnswer, DamagedAnswer):
            self._doubt(request)
            raise
        except Refused:
            self._doubts.end(request.unit)
            self._remember(request, reader.frame)
            raise
        finally:
            # what comes back before the answer to a write may be its answer
            if not isinstance(request, Write) and frame in reader.other:
                self._echo.present = True
            self._stray = bool(self._echo.before or reader.other.replace(frame, b'', 1))
        self._remember(request, reader.frame)
        late = self._in_doubt(request)
        if not late:
            # units answer in order: whatever was still to come has come before this
            self._doubts.end(request.unit)
        if not late and self._repeats is None:
            # and the request has left, even where the port is faster than its settings say
            self._line_end = arrived
        took = arrived - self._sent_at - len(reader.frame) * self._settings.char_time
        # one slow answer is remembered for some dozens
        self._slowest[request.unit] = max(took, _DECAY * self._slowest.get(request.unit, 0.0))
        if late or reader.received:
            self.distrust()
            # it may answer an earlier write of the same, or answer twice: one more may come
            self._doubt(request)
        return answer, arrived

    def _remember(self, request: Request[Any], frame: bytes) -> None:
        """Note what a unit told, and whether it told just that a moment ago."""
        now = time.monotonic()
        before = self._told.get(request.unit)
        if before is not None and before[0] == frame and now < before[2]:
            self._repeats = before[1]
        again = self._settings.response_timeout + len(frame) * self._settings.char_time
        self._told[request.unit] = frame, request, now + again

    def _receive(
        self, request: Request[_T], reader: AnswerReader[_T], frame: bytes
    ) -> tuple[_T, float]:
        char_time = self._settings.char_time
        # an exception names neither register nor length: it may belong to the earlier request
        believe_refusal = refusal_head(request) not in self._doubts.of(request.unit)
        first = deadline = self._line_end + self._settings.response_timeout
        # one answer, and as much rubbish again, however long somebody keeps talking
        length = self._frame_length(request.answer_length)
        last_chance = first + 2 * length * char_time
        came = 0
        refusals: list[Refused] = []
        while True:
            data = self._port.read(deadline)
            now = time.monotonic()
            if not data:
                if now < deadline:
                    continue
                break
            # what comes while the request still leaves is no answer to it
            self._line_end = max(self._line_end, now)
            data = self._echo.strip(data)
            came += len(data)
            answer = _feed(reader, data, None if believe_refusal else refusals)
            if answer is not None:
                return answer, now
            rest = (self._echo.missing + reader.missing) * char_time + reader.patience
            deadline = min(max(first, now + rest), last_chance + _PAUSES * reader.patience)
        held = self._echo.give_up()
        if held and not isinstance(request, Write):
            answer = _feed(reader, held, refusals)
            if answer is not None and not reader.other:
                # an answer and nothing else: the adapter echoes no more
                self._echo.present = False
                return answer, now
        if self._confirming and len(refusals) == 1 and not held and came == len(reader.frame):
            # had there been another answer to come, it would be here, too
            raise refusals[0]
        if held or (came and reader.other != frame):
            raise DamagedAnswer(
                f'unit {request.unit}: {came + len(held)} bytes came that are no answer'
            )
        raise NoAnswer(f'unit {request.unit} did not answer')


def _feed(reader: AnswerReader[_T], data: bytes, refusals: list[Refused] | None) -> _T | None:
    """Return the answer in what came so far; add the refusals before it, or raise the first."""
    while True:
        try:
            return reader.feed(data)
        except Refused as refusal:
            if refusals is None:
                raise
            refusals.append(refusal)
            data = b''
