# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus over one serial line: exact timing, and no belief in a doubtful answer."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
import math
import time
from typing import Any, NamedTuple, TypeVar

from nfo_sinus_driver.link.foreign_traffic import DOUBTFUL
from nfo_sinus_driver.link.interface import (
    Address,
    AnotherValue,
    Clock,
    DamagedAnswer,
    LineSettings,
    LinkError,
    NeverSilent,
    NoAnswer,
    NotReady,
    Refused,
    Reply,
    Why,
    silent,
)
from nfo_sinus_driver.link.late_replies import LATEST_REPLY, STOP_WAITS, Doubt, LateReplies
from nfo_sinus_driver.link.modbus.foreign import ForeignModbus
from nfo_sinus_driver.link.modbus.link import SPECIFIC, ModbusLink, ReadDevice, ReportSlaveId
from nfo_sinus_driver.link.modbus.other_values import OtherValues
from nfo_sinus_driver.link.modbus.pdu import (
    AnswerReader,
    Request,
    Write,
    WriteAndRead,
    read_of,
    refusal_head,
    write_of,
)
from nfo_sinus_driver.link.ports.port import Port
from nfo_sinus_driver.link.request_link import LONG_PAUSE, WRITE_WAIT, RequestLink
from nfo_sinus_driver.link.second_answers import different

_T = TypeVar('_T')

_FIRST_BYTE_LOST = (
    'the first byte of the answer is missing: the RS-485 adapter switches from sending to '
    'receiving too late; use one that switches by itself, or try rs485 true where the port switches'
)

#: The longest pause that is waited for, s.
_MOST_PAUSE = 0.2

#: How many of the longest pauses an answer may have.
_PAUSES = 3
#: Bytes in the answer to a read of two registers.
_TWO_REGISTERS = 7


class _Came(NamedTuple):
    """
    What came of a request.

    :ivar answer: what it means; of no use where there is an error.
    :ivar arrived: when it came, s.
    :ivar error: why there is none, or what it says in its place.
    :ivar frame: its bytes.
    :ivar is_surplus: more bytes came than the answer has.
    :ivar late: one of its kind might have come from before.
    :ivar asked_too: another master has sent the same request, which is answered, too.
    """

    answer: Any
    arrived: float
    error: LinkError | None
    frame: bytes
    is_surplus: bool
    late: bool
    asked_too: bool


class SerialLink(RequestLink[Request[Any]], ModbusLink):
    """
    A Modbus master on one line.

    A read answer does not name its register, so its kind is its shape; the answer to a write names
    what was written.

    So a request of another master that was not answered when ours is sent leaves the kinds of its
    answer and of its refusal in quarantine, and one that comes during an exchange makes an answer
    of these kinds doubtful.

    For the same reason an answer with the same bytes as the one before is not believed at once: it
    may be the one before, sent twice. The line is read for as long as the right one may take. After
    unrequested bytes the line is trusted less for a while: then it is believed only after a request
    of another shape. If it answers the same request too, it is right, but one more may come: the
    next request of its shape waits for that.
    """

    _another: ForeignModbus

    def __init__(self, port: Port, settings: LineSettings, now: Clock = time.monotonic) -> None:
        super().__init__(port, settings, now)
        self._late: LateReplies[Request[Any], bytes] = LateReplies(
            settings.response_timeout, answer_kinds
        )
        self._another = ForeignModbus(
            self.remarks, settings.response_timeout, self._messages, self._answer_time,
            self._is_second,
        )
        self._resync_addresses: dict[int, tuple[Address, ...]] = {}
        #: How long a pause within an answer may be on this line, s, by the answers so far.
        self._pause = 0.0
        #: A resync read is under way that only confirms an answer.
        self._confirming = False
        #: Other bytes came with the last answer.
        self._stray = False
        #: The last answer may be to another master.
        self._doubtful = False
        #: A second answer has come since the last silence that was waited for.
        self._second_came = False
        #: The frame of the last answer, or refusal.
        self._answer = b''
        #: What units answer in place of what was written, and whether the last answer is such.
        self._others = OtherValues(LATEST_REPLY * settings.response_timeout)
        self._has_other_value = False

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        """Name parameters of different sizes that are safe to read at any time."""
        parts = (part for address in addresses for part in self.protocol.parts(address))
        self._resync_addresses[unit] = tuple(parts)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter (function 06 for one register, 16 for several, 05 for a coil)."""
        request = write_of(unit, address, data)
        self._await_gap(request, is_write=True)
        # a write answer names what was written, and it is not believed without reading back
        return Reply(*self._believed(request))

    def _write_and_read(self, request: WriteAndRead) -> tuple[bytes, float] | None:
        # no write waits until the line can be believed
        self._await_gap(request, is_write=True)
        quarantined = self._late.quarantined(request.unit, self._now())
        doubted = not quarantined.isdisjoint(answer_kinds(request))
        doubted |= self._seconds.silence(request.unit, self._now()) > 0.0
        if doubted or self._another.is_there(self._now()):
            return None
        return self._believed(request)

    # --- what differs by protocol -----------------------------------------------------------------

    @abstractmethod
    def _encode(self, request: Request[Any]) -> bytes:
        """Return the frame of a request."""

    @abstractmethod
    def _reader(self, request: Request[_T]) -> AnswerReader[_T]:
        """Return what finds the answer to a request."""

    @abstractmethod
    def _messages(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """Yield the messages of the whole frames in some bytes; where each begins and ends."""

    @abstractmethod
    def _frame_length(self, message_length: int) -> int:
        """Return how many bytes the frame of a message has."""

    # --- belief -----------------------------------------------------------------------------------

    def answers_twice(self, unit: int) -> bool:
        """Return whether a unit does: an answer counts once the line was silent behind it."""
        return self._seconds.silence(unit, self._now()) > 0.0

    def _believed(self, request: Request[_T]) -> tuple[_T, float]:
        """Return the answer to a request: not one sent twice, nor one to another master."""
        names_it = isinstance(request, Write)
        try:
            answer = self._transact(request)
        except Refused:
            # it names a function, and nothing else
            self._require_ours(request)
            self._require_certain(request)
            raise
        if names_it:
            # of a write a second one passes for no other answer
            self._confirm(request, names_it=True)
        else:
            self._require_ours(request)
            self._require_certain(request)
        return answer

    def _require_certain(self, request: Request[Any]) -> None:
        """Make sure that the answer is not one before again, nor one of two (DamagedAnswer)."""
        if silence := self._seconds.silence(request.unit, self._now()):
            self._require_same(request, silence)
        else:
            self._confirm(request)

    def _require_same(self, request: Request[Any], silence: float) -> None:
        """Take what comes until the line is silent: the answer once more, and nothing else."""
        length = self._frame_length(request.answer_length) * self._settings.char_time
        least = self._sent_at + self._late.longest(request.unit) + length
        came, is_silent = self._hear_out(silence, least)
        self._another.take_rest(request.unit)
        if not is_silent:
            self._late.expect(request, self._now())
            raise DamagedAnswer(f'unit {request.unit}: {STOP_WAITS}')
        refused = self._seconds.is_refused(request.unit, self._now())
        if refused or came.replace(self._answer, b''):
            raise different(request.unit)

    def _require_ours(self, request: Request[Any]) -> None:
        """Make sure that the last answer is to us (DamagedAnswer: perhaps not)."""
        if self._doubtful:
            if self._another.has_rest:
                # a request of which nothing is known
                self._late.expect(request, self._now())
            raise DamagedAnswer(f'unit {request.unit}: {DOUBTFUL}')

    @property
    def _writes(self) -> tuple[type[Any], ...]:
        return (Write, WriteAndRead)

    def _read_request(self, unit: int, address: Address) -> Request[Any]:
        return read_of(unit, address)

    def _expect_again(self, request: Request[Any]) -> None:
        if self._late.repeated is not None:
            self._late.expect(request, self._now())

    def _resync_reads(self, unit: int) -> Iterator[Request[Any]]:
        """
        Yield requests without effect, the quickest first.

        First the parameters that the drive is known to have. Then functions 17 and 43/14, which
        only identify a drive [M0 §6.2.4]: a drive without them [C57] refuses, and a refusal names
        the function, so it serves as well.
        """
        for address in self._resync_addresses.get(unit, ()):
            yield read_of(unit, address)
        yield ReportSlaveId(unit)
        yield ReadDevice(unit, SPECIFIC, _PRODUCT_CODE)

    def _distinct_kinds(self, request: Request[Any]) -> Sequence[bytes]:
        identifies = isinstance(request, (ReportSlaveId, ReadDevice))
        return answer_kinds(request) if identifies else (request.answer_head,)

    def _confirm(self, request: Request[Any], *, names_it: bool = False) -> None:
        """Make sure that the answer, unless it ``names_it``, is not the one before again."""
        if self._late.repeated is None:
            return
        now = self._now()
        doubt = self._late.doubt_about(request, now, names_it=names_it)
        if doubt is Doubt.LISTEN:
            self._require_one(request)
        elif doubt is Doubt.ONCE_MORE:
            self._late.quarantine(request.unit, (request.answer_head,), now)
        elif doubt is Doubt.RESYNC:
            self._late.expect(request, now)
            self._resync(request)

    def _resync_read(self, request: Request[Any]) -> None:
        super()._resync_read(request)
        self._require_ours(request)

    def _resync(self, request: Request[Any]) -> None:
        """Have a unit answer another request: a second answer would come before."""
        if self.stop_waits():
            raise DamagedAnswer(f'unit {request.unit}: {STOP_WAITS}')
        stray = self._stray
        self._confirming = True
        try:
            stray |= self._await_gap(request)
            self._resync_read(self._first_certain(request.unit))
            if not stray and not self._stray:
                return
        except (NotReady, NeverSilent):
            pass
        except (NoAnswer, DamagedAnswer):
            # the right answer may be as late as that to the resync read
            self._late.expect(request, self._now())
            raise
        finally:
            self._confirming = False
        raise DamagedAnswer(f'unit {request.unit}: an answer came twice')

    def _require_one(self, request: Request[Any]) -> None:
        """Wait as long as the right answer may take, in case this was the one before again."""
        length = self._frame_length(request.answer_length) * self._settings.char_time
        # the right one comes behind it, where it was on the line when that was to begin
        until = self._sent_at + self._late.longest(request.unit) + 2 * length + self._gap
        if self._listen(until):
            self._late.note_unrequested(self._now())
            raise DamagedAnswer(f'unit {request.unit}: an answer came twice')
        if self._now() < until:
            self._late.expect(request, self._now())
            raise DamagedAnswer(f'unit {request.unit}: {STOP_WAITS}')

    def _await_gap(self, request: Request[Any], *, is_write: bool = False) -> bool:
        self._second_came = False
        try:
            came = super()._await_gap(request, is_write=is_write)
        except NeverSilent:
            self._late.note_unrequested(self._now())
            raise
        now = self._now()
        there = self._another.is_there(now)
        stray = bool(self._another.take_rest(request.unit)) and (came or there)
        second = self._second_came
        if stray or (second and not self._seconds.silence(request.unit, now)):
            self._late.note_unrequested(now)
        if second and not is_write:
            # for as long as is known by now
            super()._await_gap(request)
        if stray and there:
            self._late.expect(request, now)
        if stray and there and not is_write:
            # a request of another master may be in it, and its answer still to come
            until = now + self._late.longest(request.unit)
            while data := self._listen(until):
                self._another.hear_bytes(data, self._now())
            super()._await_gap(request)
        return stray or second

    def _note_unrequested(self, data: bytes, request: Request[Any]) -> None:
        # whether it is a frame of another master is known when the line is silent
        return

    def _take_late(self, request: Request[Any], now: float) -> None:
        if still_open := self._another.take_open(request.unit):
            self._late.quarantine(request.unit, still_open, now)

    @property
    def _write_wait(self) -> float:
        return max(WRITE_WAIT, self._frame_length(_TWO_REGISTERS) * self._settings.char_time)

    # --- one transaction --------------------------------------------------------------------------

    def _transact(self, request: Request[_T]) -> tuple[_T, float]:
        frame = self._encode(request)
        self._another.sent(frame)
        self._has_other_value = False
        self._others.sent(request, self._now())
        self._send(request, frame)
        came = self._await_answer(request, frame)
        if came.error is None:
            self._take_answer(request, came)
        elif isinstance(came.error, (NoAnswer, DamagedAnswer)):
            self._note_missing(request, came.error)
            self._seconds.unanswered(request, self._now())
            self._late.expect(request, self._now())
        elif isinstance(came.error, (AnotherValue, Refused)):
            self._take_refusal(request, came)
        if came.error is None:
            return came.answer, came.arrived
        try:
            raise came.error
        finally:
            # as above
            del came

    def _await_answer(self, request: Request[Any], frame: bytes) -> _Came:
        """Wait for the answer to a request that was sent; return what came of it."""
        reader = self._reader(request)
        answer, arrived, error = None, math.nan, None
        try:
            answer, arrived = self._receive(request, reader, frame)
        except LinkError as failure:
            error = failure
        if error is None:
            self._note_answer(request, request.answer_head, reader.frame)
        elif isinstance(error, Refused):
            self._note_answer(request, refusal_head(request), reader.frame)
        late = request.answer_head in self._late.quarantined(request.unit, self._now())
        asked_too = self._take_others(request, reader, frame)
        try:
            return _Came(
                answer, arrived, error, reader.frame, bool(reader.received), late, asked_too
            )
        finally:
            # else its traceback and this frame keep each other
            error = None

    def _take_answer(self, request: Request[Any], came: _Came) -> None:
        """Note that a request was answered, and what else may come by that."""
        late, arrived = came.late, came.arrived
        self._doubtful = self._is_doubtful(request.answer_head, late)
        self._others.took(request)
        length = len(came.frame) * self._settings.char_time
        self._late.note_reply(request, came.frame, arrived, length)
        self.pauses.answered(request.unit, type(request), arrived)
        self._release(request, late=late, asked_too=came.asked_too)
        if not late and self._late.repeated is None:
            # and the request has left, even where the port is faster than its settings say
            self._line_end = arrived
        if self._has_run and not self._doubtful:
            self._late.took(request.unit, arrived - self._sent_at - length)
        twice = self._seconds.silence(request.unit, arrived) > 0.0
        if late or (came.is_surplus and not self._doubtful and not twice):
            # it may answer an earlier write of the same, or answer twice: one more may come
            self._late.note_unrequested(self._now())

    def _take_refusal(self, request: Request[Any], came: _Came) -> None:
        """Note that a request was refused, or that the drive answers that it has another value."""
        is_refusal = isinstance(came.error, Refused)
        self._doubtful = is_refusal and self._is_doubtful(refusal_head(request))
        self._release(request, asked_too=came.asked_too)
        self.pauses.answered(request.unit, type(request), self._now())
        if is_refusal:
            length = len(came.frame) * self._settings.char_time
            self._late.note_reply(request, came.frame, self._now(), length)

    def _is_second(self, frame: bytes, message: bytes) -> bool:
        # it came when the line was last in use, and not when it had been silent since
        is_second = self._seconds.take_frame(message[0], frame, self._line_end, message)
        self._second_came |= is_second
        return is_second

    def _note_answer(self, request: Request[Any], head: bytes, frame: bytes) -> None:
        self._answer = frame
        self._seconds.answered(request, frame, self._now(), head)

    def _take_others(
        self, request: Request[_T], reader: AnswerReader[_T], frame: bytes
    ) -> bool:
        """Take all that came beside the answer; return whether another master asks the same."""
        other = reader.other
        now = self._now()
        # what comes back before the answer to a write may be its answer, and another master may
        # send the same request
        came_back = frame in other and not isinstance(request, Write)
        alone = not self._another.is_there(now)
        if alone and came_back:
            self._echo.present = True
        stray = self._echo.before + other.replace(frame, b'', 1)
        if self._has_other_value:
            # it is the unit's, and not of another master
            stray = b''
        self._stray = bool(stray)
        if stray:
            self._another.hear_bytes(stray, now)
        return came_back and not alone

    def _is_doubtful(self, kind: bytes, late: bool = False) -> bool:
        """
        Return whether the last answer, of a kind, may be to another master.

        :param late: one of its kind might have come from before.
        """
        there = self._another.is_there(self._now())
        return there and (late or self._another.may_be_answered_by(kind))

    def _answer_time(self, unit: int, length: int) -> float:
        """Return how long an answer of a length to another master is waited for, s."""
        recently = self._late.longest(unit)
        most = self._settings.response_timeout
        on_line = self._frame_length(length) * self._settings.char_time
        return min(recently + on_line + self._gap, most) if recently else most

    def _release(
        self, request: Request[Any], *, late: bool = False, asked_too: bool = False
    ) -> None:
        """
        Expect no late answer any more: units answer in order, so they have come before the last.

        :param late: the last may be such a one itself.
        :param asked_too: another master has sent the same request, which is answered, too.
        """
        if not (late or self._doubtful):
            self._late.release(request.unit)
        if asked_too:
            self._late.expect(request, self._now())

    def _receive(
        self, request: Request[_T], reader: AnswerReader[_T], frame: bytes
    ) -> tuple[_T, float]:
        char_time = self._settings.char_time
        # an exception names neither register nor length: it may belong to the earlier request
        quarantined = self._late.quarantined(request.unit, self._now())
        believe_refusal = refusal_head(request) not in quarantined
        # one answer, and as much noise again, however long bytes keep coming
        length = self._frame_length(request.answer_length)
        patience = min(self._settings.response_timeout, self._most(request.unit, length))
        first = deadline = self._line_end + patience
        last_chance = first + 2 * length * char_time
        came = 0
        last = longest = 0.0
        looked = False
        refusals: list[Refused] = []
        while True:
            look = last + LONG_PAUSE if came and not looked else deadline
            data = self._take(min(look, deadline))
            now = self._now()
            if not data:
                looked = now >= look
                if now < deadline:
                    continue
                break
            # bytes that come while the request is still being sent are no answer to it
            self._line_end = max(self._line_end, now)
            data = self._echo.strip(data)
            if came and looked:
                # less the time of these bytes themselves; without a look that found none, this
                # thread may not have run
                longest = max(longest, now - last - len(data) * char_time)
            last, looked = now, False
            came += len(data)
            answer = _feed(reader, data, None if believe_refusal else refusals)
            if answer is not None:
                if not reader.other:
                    self._learn_pause(longest)
                return answer, now
            if self._another.is_there(now) and self._another.was_answered_in(reader.other):
                # units answer in order: ours was lost, or will be late
                break
            pause = max(reader.inter_byte_timeout, self._pause)
            rest = (self._echo.bytes_needed + reader.bytes_needed) * char_time + pause
            deadline = min(max(first, now + rest), last_chance + _PAUSES * pause)
            if now >= deadline:
                break
        held = self._echo.give_up()
        if held and not isinstance(request, Write):
            answer = _feed(reader, held, refusals)
            if answer is not None and not reader.other:
                # an answer and nothing else: the adapter does not echo any more
                self._echo.present = False
                return answer, now
        if self._confirming and len(refusals) == 1 and not held and came == len(reader.frame):
            # a second answer would have come by now
            raise refusals[0]
        if came and not held:
            self._require_written(request, reader.other)
        if held or (came and reader.other != frame):
            another = self._another.is_there(now)
            if not another and self._lacks_first_byte(request, frame, reader.other + held):
                raise DamagedAnswer(f'unit {request.unit}: {_FIRST_BYTE_LOST}')
            raise DamagedAnswer(
                f'unit {request.unit}: {came + len(held)} bytes came that are no answer'
            )
        raise silent(request.unit)

    def _require_written(self, request: Request[Any], came: bytes) -> None:
        """Raise what it means if the unit alone has answered, and another value."""
        messages = [message for _, _, message in self._messages(came)]
        if len(messages) != 1 or self._frame_length(len(messages[0])) != len(came):
            return
        if messages[0] in self._late.quarantined(request.unit, self._now()):
            # it answers another master
            return
        if (error := self._others.error_of(request, messages[0])) is not None:
            self._has_other_value = True
            raise error

    def _learn_pause(self, longest: float) -> None:
        """Note the longest pause, s, within a complete answer, and of no other."""
        if self._note_pause(longest):
            self._pause = max(self._pause, min(2 * longest, _MOST_PAUSE))

    def _lacks_first_byte(self, request: Request[_T], frame: bytes, came: bytes) -> bool:
        """Return whether what came is the answer without its first byte, that of the request."""
        return _feed(self._reader(request), frame[:1] + came, []) is not None


def _feed(reader: AnswerReader[_T], data: bytes, refusals: list[Refused] | None) -> _T | None:
    """Return the answer so far; add the refusals before it, or raise the first."""
    while True:
        try:
            return reader.feed(data)
        except Refused as refusal:
            if refusals is None:
                raise
            refusals.append(refusal)
            data = b''


#: The object of function 43/14 whose text is empty, so its answer is the shortest [M0 §6.2.4].
_PRODUCT_CODE = 1


def answer_kinds(request: Request[Any]) -> tuple[bytes, bytes]:
    """Return the kind of the answer to a request, and that of its refusal."""
    return request.answer_head, refusal_head(request)
