# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus over one serial line: exact time, and no belief in a doubtful answer."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
import contextlib
import time
from typing import Any, TypeVar

from nfo_sinus_driver.link.another_master import DOUBTFUL, AnotherMaster
from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    DamagedAnswer,
    LineSettings,
    LinkError,
    NeverSilent,
    NoAnswer,
    NotReady,
    Refused,
    Remarks,
    Reply,
)
from nfo_sinus_driver.link.late_replies import Doubt, LateReplies
from nfo_sinus_driver.link.modbus_link import SPECIFIC, ModbusLink, ReadDevice, ReportSlaveId
from nfo_sinus_driver.link.modbus_pdu import (
    AnswerReader,
    Request,
    Write,
    WriteAndRead,
    read_of,
    refusal_head,
    write_and_read_of,
)
from nfo_sinus_driver.link.port import NEVER_SILENT, Port, await_silence, port_of

_T = TypeVar('_T')

_FIRST_BYTE_LOST = (
    'the first byte of the answer is missing: the RS-485 adapter switches from sending to '
    'receiving too late; use one that switches by itself, or try rs485 true where the port switches'
)

_IN_PIECES = (
    'answers come in pieces with long pauses: the adapter, or the device server, holds bytes back; '
    'set its latency timer or packing time to the least, or use another one'
)
#: A pause within an answer of which the operator hears, s: more than a good adapter makes.
_LONG_PAUSE = 0.03
#: No pause is waited for longer, s.
_MOST_PAUSE = 0.2

#: How often a read is asked while another master asks at the same time.
_TRIES = 3
#: How many of the longest pauses within an answer there may be.
_PAUSES = 3
#: How long a write waits at least for a line that is not silent, s.
_WRITE_WAIT = 0.02
#: Bytes in the answer to a read of two registers.
_TWO_REGISTERS = 7


class SerialLink(ModbusLink):
    """
    A Modbus master on one line.

    Between frames the line is silent for a gap at least, counted from the last byte seen on it.

    A read answer does not name its register. So whenever an answer is missing or damaged, or
    bytes come that nobody asked for, its shape is in quarantine (:class:`LateReplies`): a request
    whose answer could be confused with it is only sent after one of another shape has been
    answered. A write is sent at once, for it may be a stop, and its answer names what was written.

    For the same reason an answer with the very bytes of the one before is not believed at once: it
    may be the one before, told twice. The right one would come when a unit answers, so until then
    the line is listened to. A line that has told something nobody asked for is not trusted so far
    for a while: there it is believed only after a request of another shape. If it answers the same
    question too, what it says is right, but one more may come: the next request of its shape waits
    for that.
    """

    def __init__(self, port: Port, settings: LineSettings, now: Clock = time.monotonic) -> None:
        self._now = now
        self._port = port
        self._settings = settings
        self.remarks = Remarks()
        self._late: LateReplies[Request[Any], bytes] = LateReplies(
            settings.response_timeout, answer_kinds
        )
        self._another = AnotherMaster(self.remarks, settings.response_timeout, self._messages)
        self._resync_addresses: dict[int, tuple[Address, ...]] = {}
        self._echo = Echo()
        #: How long a pause within an answer may be on this line, s, as far as answers have shown.
        self._pause = 0.0
        #: When the last request had left.
        self._sent_at = 0.0
        #: The resync read on its way is only about that.
        self._confirming = False
        #: Other bytes came with the last answer.
        self._stray = False
        #: The last answer may be to another master.
        self._doubtful = False
        #: When the last byte was on the line, as far as we know.
        self._line_end = 0.0

    @classmethod
    def on_port(cls, port: str, settings: LineSettings) -> SerialLink:
        """Return the link on a port; a ValueError says what is no port."""
        return cls(port_of(port, settings), settings)

    def open(self) -> None:
        """Open the port."""
        self._port.open()
        self._line_end = self._now()

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        self._port.close()
        self._late.clear()
        self._another.clear()
        self._echo = Echo()

    def use_resync_reads(self, unit: int, addresses: Sequence[Address]) -> None:
        """Name parameters of different sizes that are safe to read at any time."""
        self._resync_addresses[unit] = tuple(addresses)

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """
        Write one parameter and read another (function 23), or only write it.

        It is only written where the answer could be confused with another, for no write waits until
        the line can be believed.

        :raises LinkError: as its subclasses say.
        """
        request = write_and_read_of(unit, address, data, source)
        self._await_silence(request)
        quarantined = self._late.quarantined(unit, self._now())
        doubted = not quarantined.isdisjoint(answer_kinds(request))
        if doubted or self._another.is_there(self._now()):
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
    def _messages(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """Yield the messages of the whole frames in some bytes; where each begins and ends."""

    @abstractmethod
    def _frame_length(self, message_length: int) -> int:
        """Return how many bytes the frame of a message has."""

    # --- belief -----------------------------------------------------------------------------------

    def _ask(self, request: Request[_T]) -> tuple[_T, float]:
        """Return the answer to a request, and when its last byte came."""
        if isinstance(request, Write):
            return self._ask_once(request)
        for tries_left in reversed(range(1 if isinstance(request, WriteAndRead) else _TRIES)):
            try:
                answer = self._ask_once(request)
            except Refused:
                if not self._doubtful:
                    raise
            except DamagedAnswer:
                if not tries_left or not self._another.is_there(self._now()):
                    raise
            else:
                if not self._doubtful:
                    return answer
        raise DamagedAnswer(f'unit {request.unit}: {DOUBTFUL}')

    def _ask_once(self, request: Request[_T]) -> tuple[_T, float]:
        """Return the answer to a request, which may be to another master."""
        self._await_silence(request)
        # a write answer names what was written, and nobody believes it without reading back
        resynced = not isinstance(request, Write) and self._make_certain(request)
        try:
            answer = self._transact(request)
        except Refused:
            self._confirm(request)
            raise
        except LinkError as error:
            error.heard = resynced
            raise
        self._confirm(request, names_it=isinstance(request, Write))
        return answer

    def _ask_unheard(self, request: Request[object]) -> None:
        """Send a request at once and wait for its answer, whatever that is and says."""
        self._await_silence(request)
        with contextlib.suppress(NoAnswer, DamagedAnswer, Refused):
            self._transact(request)
        if self._late.repeated is not None:
            # it may be the one before, told twice
            self._late.expect(request, self._now())

    def _make_certain(self, request: Request[Any]) -> bool:
        """Have the unit answer something else first, if needed; tells whether it was asked."""
        unit, now = request.unit, self._now()
        if request.answer_head not in self._late.quarantined(unit, now):
            return False
        questions = [(request, (request.answer_head,)), *self._resync_reads(unit)]
        question = self._late.first_certain(unit, questions, now)
        if question is request:
            return False
        try:
            self._resync_read(question)
        except LinkError as error:
            # nobody has heard the request itself
            error.maybe_done = False
            raise
        self._await_silence(request)
        return True

    def _resync_reads(self, unit: int) -> Iterator[tuple[Request[Any], Sequence[bytes]]]:
        return resync_reads(unit, self._resync_addresses.get(unit, ()))

    def _resync_read(self, read: Request[Any]) -> None:
        """Have a unit answer, whatever it says."""
        # a refusal that is believed tells as well as an answer that all is said
        with contextlib.suppress(Refused):
            self._transact(read)

    def _confirm(self, request: Request[Any], *, names_it: bool = False) -> None:
        """Make sure that the answer, if it ``names_it`` not itself, is not the one before again."""
        if self._late.repeated is None:
            return
        now = self._now()
        doubt = self._late.doubt_about(request, now, names_it=names_it)
        if doubt is Doubt.LISTEN:
            self._listen(request)
        elif doubt is Doubt.ONCE_MORE:
            self._late.quarantine(request.unit, (request.answer_head,), now)
        elif doubt is Doubt.RESYNC:
            self._late.expect(request, now)
            self._resync(request)

    def _resync(self, request: Request[Any]) -> None:
        """Have a unit answer something else: had another answer come, it would show."""
        stray = self._stray
        self._confirming = True
        try:
            stray |= self._await_silence(request)
            reads = self._resync_reads(request.unit)
            self._resync_read(self._late.first_certain(request.unit, reads, self._now()))
            if not stray and not self._stray:
                return
        except (NotReady, NeverSilent):
            pass
        except (NoAnswer, DamagedAnswer):
            # the right answer may be as late as that to the other
            self._late.expect(request, self._now())
            raise
        finally:
            self._confirming = False
        raise DamagedAnswer(f'unit {request.unit}: an answer came twice')

    def _listen(self, request: Request[Any]) -> None:
        """Wait as long as the right answer may take, if this was the one before, told twice."""
        length = self._frame_length(request.answer_length) * self._settings.char_time
        until = self._sent_at + self._late.longest(request.unit) + length
        while (now := self._now()) < until:
            if self._port.read(until):
                self._line_end = max(self._line_end, now)
                self._late.heard_unasked(self._now())
                raise DamagedAnswer(f'unit {request.unit}: an answer came twice')

    def _await_silence(self, request: Request[Any]) -> bool:
        """
        Wait for a gap of silence; tell whether bytes came meanwhile that nobody asked for.

        A write may be a stop, and the noise may be on our side of the line alone: rather than not
        at all it is sent into it, as soon as no answer that began before can still be coming.

        :raises NeverSilent: there is none.
        """
        is_write = isinstance(request, (Write, WriteAndRead))
        wait = self._write_wait if is_write else self._settings.response_timeout
        give_up = self._now() + self._settings.response_timeout
        came = False
        while True:
            heard = await_silence(self._port, self._now, self._line_end, self._gap, wait)
            data, self._line_end, silent = heard
            came |= bool(data)
            now = self._now()
            self._another.hear(data, now)
            if not silent and not is_write:
                self._late.heard_unasked(now)
                raise NeverSilent(NEVER_SILENT)
            until = min(self._another.stands_until(request.unit), give_up)
            if is_write or now >= until:
                break
            # what another master asked is answered first
            if data := self._port.read(until):
                self._line_end = max(self._line_end, self._now())
                self._another.hear(data, self._line_end)
        if late := self._another.take_late(request.unit, now):
            self._late.quarantine(request.unit, (late,), now)
        stray = bool(self._another.take_rest(request.unit)) and (
            came or self._another.is_there(now)
        )
        if stray:
            self._late.heard_unasked(now)
        return stray

    @property
    def _write_wait(self) -> float:
        """How long a write waits for a line that is not silent, s: one answer of two registers."""
        longest = self._frame_length(_TWO_REGISTERS) * self._settings.char_time
        return max(_WRITE_WAIT, longest)

    # --- one transaction --------------------------------------------------------------------------

    def _transact(self, request: Request[_T]) -> tuple[_T, float]:
        frame = self._encode(request)
        self._late.sent(request)
        self._echo.sent(frame)
        self._another.sent(frame)
        self._port.write(frame)
        self._sent_at = self._now() + len(frame) * self._settings.char_time
        self._line_end = self._sent_at
        reader = self._reader(request)
        try:
            answer, arrived = self._receive(request, reader, frame)
        except (NoAnswer, DamagedAnswer):
            self._late.expect(request, self._now())
            raise
        except Refused:
            self._late.release(request.unit)
            length = len(reader.frame) * self._settings.char_time
            self._late.note(request, reader.frame, self._now(), length)
            raise
        finally:
            other = reader.other
            now = self._now()
            # what comes back before the answer to a write may be its answer, and another master may
            # ask the same as we do
            alone = not self._another.is_there(now)
            came_back = not isinstance(request, Write) and frame in other
            if alone and came_back:
                self._echo.present = True
            stray = self._echo.before + other.replace(frame, b'', 1)
            self._stray = bool(stray)
            self._another.hear(stray, now)
            stands = now < self._another.stands_until(request.unit)
            self._doubtful = self._another.is_there(now) and (self._stray or stands)
        length = len(reader.frame) * self._settings.char_time
        self._late.note(request, reader.frame, arrived, length)
        late = request.answer_head in self._late.quarantined(request.unit, arrived)
        if not late:
            # units answer in order: whatever was still to come has come before this
            self._late.release(request.unit)
        if not late and self._late.repeated is None:
            # and the request has left, even where the port is faster than its settings say
            self._line_end = arrived
        self._late.took(request.unit, arrived - self._sent_at - length)
        if came_back and not alone:
            # another master has asked the same, which is answered, too
            self._late.quarantine(request.unit, (request.answer_head,), arrived)
        if late or (reader.received and not self._doubtful):
            # it may answer an earlier write of the same, or answer twice: one more may come
            self._late.heard_unasked(self._now())
        return answer, arrived

    def _receive(
        self, request: Request[_T], reader: AnswerReader[_T], frame: bytes
    ) -> tuple[_T, float]:
        char_time = self._settings.char_time
        # an exception names neither register nor length: it may belong to the earlier request
        quarantined = self._late.quarantined(request.unit, self._now())
        believe_refusal = refusal_head(request) not in quarantined
        first = deadline = self._line_end + self._settings.response_timeout
        # one answer, and as much rubbish again, however long somebody keeps talking
        length = self._frame_length(request.answer_length)
        last_chance = first + 2 * length * char_time
        came = 0
        last = longest = 0.0
        refusals: list[Refused] = []
        while True:
            data = self._port.read(deadline)
            now = self._now()
            if not data:
                if now < deadline:
                    continue
                break
            # what comes while the request still leaves is no answer to it
            self._line_end = max(self._line_end, now)
            data = self._echo.strip(data)
            if came:
                # less what these bytes took themselves
                longest = max(longest, now - last - len(data) * char_time)
            last = now
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
            another = self._another.is_there(now)
            if not another and self._lacks_first_byte(request, frame, reader.other + held):
                raise DamagedAnswer(f'unit {request.unit}: {_FIRST_BYTE_LOST}')
            raise DamagedAnswer(
                f'unit {request.unit}: {came + len(held)} bytes came that are no answer'
            )
        raise NoAnswer(f'unit {request.unit} did not answer')


    def _learn_pause(self, longest: float) -> None:
        """Take note of the longest pause, s, within an answer that came whole, and of no other."""
        if longest > _LONG_PAUSE:
            self._pause = max(self._pause, min(2 * longest, _MOST_PAUSE))
            self.remarks.add(_IN_PIECES)

    def _lacks_first_byte(self, request: Request[_T], frame: bytes, came: bytes) -> bool:
        """Tell whether what came is the answer without its first byte, which is the request's."""
        return _feed(self._reader(request), frame[:1] + came, []) is not None


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


class Echo:
    """
    Tells an echo of a request from its answer.

    Who finds the request itself among the bytes that come sets ``present``; from then on every
    request has to come back before anything else counts. That matters most where the answer is
    the same as the request: function 06.

    :ivar present: every request comes back.
    :ivar before: what came between the request and its echo.
    """

    def __init__(self) -> None:
        self.present = False
        self.before = b''
        self._awaited = b''
        self._held = b''

    def sent(self, frame: bytes) -> None:
        """Expect a request to come back, if they do."""
        self._awaited = frame if self.present else b''
        self._held = self.before = b''

    @property
    def bytes_needed(self) -> int:
        """How many bytes of the echo have to come yet."""
        return max(0, len(self._awaited) - len(self._held))

    def strip(self, data: bytes) -> bytes:
        """Return what of the bytes that came is no echo, nor came before it."""
        if not self._awaited:
            return data
        self._held += data
        before, echo, rest = self._held.partition(self._awaited)
        if echo:
            self.before = before
            self._awaited = self._held = b''
        return rest

    def give_up(self) -> bytes:
        """Return what came instead of the echo."""
        held, self._held, self._awaited = self._held, b'', b''
        return held


#: The object of function 43/14 whose text is empty, so its answer is the shortest [M0 §6.2.4].
_PRODUCT_CODE = 1


def answer_kinds(request: Request[Any]) -> tuple[bytes, bytes]:
    """Return what tells the answer to a request from others, and what its refusal."""
    return request.answer_head, refusal_head(request)


def resync_reads(
    unit: int, addresses: Sequence[Address]
) -> Iterator[tuple[Request[Any], Sequence[bytes]]]:
    """
    Yield requests that do nothing, the quickest first, each with what has to tell its answer.

    First the parameters that the drive is known to have. Then functions 17 and 43/14, which only
    identify a drive [M0 §6.2.4]: one that does not have them [C57] refuses, and a refusal names
    the function, so that tells as much.
    """
    for address in addresses:
        read = read_of(unit, address)
        yield read, (read.answer_head,)
    for request in (ReportSlaveId(unit), ReadDevice(unit, SPECIFIC, _PRODUCT_CODE)):
        yield request, answer_kinds(request)
