# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The Classic protocol over one serial line: no belief in a doubtful answer, nor in a bare ACK."""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
import struct
import time
from typing import NamedTuple

from nfo_sinus_driver.link import classic
from nfo_sinus_driver.link.another_master import DOUBTFUL
from nfo_sinus_driver.link.classic import (
    INV_ST,
    MODE,
    SIO_ERR,
    SIO_FAIL,
    Enquiry,
    Kind,
    Message,
    Nak,
    Reader,
    Request,
    Select,
    Value,
    nameless,
)
from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    DamagedAnswer,
    LineSettings,
    LinkError,
    NoAnswer,
    NothingToAsk,
    PortError,
    Refused,
    Remarks,
    Reply,
)
from nfo_sinus_driver.link.late_replies import LateReplies
from nfo_sinus_driver.link.line_protocols import BROADCAST, CLASSIC
from nfo_sinus_driver.link.other_requests import TRIES, OtherRequests
from nfo_sinus_driver.link.port import Port, port_of

#: What a message carries.
_WORD = struct.Struct('>H')
#: Pauses within an answer may last this long, s: no manual limits them [C86], and an adapter may
#: hold bytes back.
_INTER_BYTE_TIMEOUT = 0.07
#: Silence that shows that an ACK or NAK does not come twice: characters, and s at least.
_NO_DOUBLE = 2
_NO_DOUBLE_LEAST = 0.002
#: How long a write waits at most while another master's request is answered, s.
_WRITE_WAIT = 0.05
#: How long drives may be busy with a broadcast, which none of them confirms, s: this at most, else
#: so many times what the slowest of them took lately for a request of its own, which is forgotten
#: by and by.
_TURNAROUND = 0.1
_TURNAROUND_MARGIN = 2.0
_KEPT_OF_SLOWEST = 0.98
#: What every firmware has and may be read at any time [M0 tables 2 and 3], [M2 tables 1 and 2]:
#: InvSt without acknowledging, MODE, Control/Mode and f-Nom. With four of them one is always
#: certain, see LateReplies.
_EVERYWHERE = (INV_ST, MODE, 0x0030, 0x000F)
#: How old the inverter status may be to show that a serial fault is new, s.
_FRESH = 1.0


class _Answer(NamedTuple):
    request: Request
    kind: Kind
    arrived: float


class _Ambiguous(DamagedAnswer):
    """An ACK or NAK came that may belong to an earlier request."""


class ClassicLink:
    """
    A master of the Classic protocol on one line.

    A REPLY names its parameter, ACK and NAK name nothing. So whenever an answer is missing or
    damaged, or bytes come that nobody asked for, the kinds of answers that may still come are in
    quarantine (:class:`LateReplies`). A parameter whose REPLY is there is only read after another
    one has been. A write is never kept waiting, for it may be a stop; but if its answer is there
    it is not believed: the line is cleared by reading something, and :class:`DamagedAnswer` says
    that nobody knows.

    An adapter that echoes what is sent is noticed at the first request; from then on an answer
    counts only behind the echo.

    The requests of another master are found (:class:`OtherRequests`). What may answer them, and any
    answer that may have met another one, is not believed; a read is repeated.

    Point to point (unit 0) an answer may carry any address [C86]. Do not mix it with others on
    one line.

    What is promised: no value of another parameter or another drive is taken, no answer up to
    three time-outs late to a question asked before, no ACK of another write. A REPLY that comes
    twice is noticed when it comes before the same question, asked again at once, can have been
    answered, ACK and NAK when they begin again within two characters; later ones may pass for the
    answer, a REPLY one reading old. ACK, NAK and an ENQUIRY have no check sum: parity is all that
    protects them, so choose a format that has it.
    """

    supervision = None
    #: Factory settings and formats of both firmwares [M0 §6.1.2], [M2 §4], [C5], [C6]; addresses
    #: [M0 §6.1.2], [C10].
    protocol = CLASSIC

    def __init__(self, port: Port, settings: LineSettings, now: Clock = time.monotonic) -> None:
        self._now = now
        self._port = port
        self._settings = settings
        self.remarks = Remarks()
        self._late: LateReplies[Request, Kind] = LateReplies(
            settings.response_timeout, classic.kinds
        )
        self._others: OtherRequests[Request] = OtherRequests(
            self.remarks, settings.response_timeout, Reader().feed,
            Request, classic.encode, classic.answers,
        )
        #: The inverter status that each unit told last, and when.
        self._inv_st: dict[int, tuple[int, float]] = {}
        self._last: _Answer | None = None
        self._echoes = False
        #: What the slowest unit took lately until its answer began, s.
        self._slowest = _TURNAROUND

    @classmethod
    def on_port(cls, port: str, settings: LineSettings) -> ClassicLink:
        """Return the link on a port; a ValueError says what is no port."""
        return cls(port_of(port, settings), settings)

    def open(self) -> None:
        """Open the port."""
        self._port.open()

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        self._port.close()
        self._late.clear()
        self._others.clear()
        self._inv_st.clear()
        self._last = None
        self._echoes = False

    def use_resync_reads(self, unit: int, addresses: Sequence[Address]) -> None:
        """
        Take parameters that are safe to read; here those are asked that every firmware has.

        To ask for what a drive does not have is a serial fault, for which it stops when under
        serial control [M2 table 4].
        """

    def parts(self, address: Address) -> tuple[Address, ...]:
        """Return the words: a message carries one."""
        if address.sub_index is None:
            return (address,)
        ids = address.index, address.sub_index
        return tuple(Address(address.space, id_, None, _WORD.size) for id_ in ids)

    def read(self, unit: int, address: Address) -> Reply:
        """Read one parameter of one word, or one word of another."""
        (part,) = self.parts(address)
        word, arrived = self._enquire(unit, part.index)
        return Reply(_WORD.pack(word), arrived)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """
        Write one parameter; unit 95 means all of them, and nobody confirms it.

        It has one word: nobody writes what has two, and no manual says how.

        :raises LinkError: as its subclasses say.
        """
        (word,) = _WORD.unpack(data)
        return Reply(b'', self._select(Select(unit, address.index, word)))

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """Write one parameter, then read another; in as many transactions as that takes."""
        self.write(unit, address, data)
        return self.read(unit, source)

    def read_then_write(self, unit: int, source: Address, address: Address, data: bytes) -> Reply:
        """
        Read a parameter whose value nobody needs, then write another; nothing is sent between.

        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """
        request = Enquiry(unit, source.index)
        self._listen(request)
        try:
            with contextlib.suppress(NoAnswer, DamagedAnswer):
                _, _, early = self._transact(request)
                if early:
                    self._late.expect(request, self._now())
            return self.write(unit, address, data)
        except LinkError as error:
            error.maybe_done = True
            raise

    def identify(self, unit: int) -> NothingToAsk:
        """Return no questions: the protocol has none but for parameters."""
        return NothingToAsk()

    # --- transactions -------------------------------------------------------------------------

    def _enquire(self, unit: int, number: int) -> tuple[int, float]:
        """Return the value of a parameter, and when it came; another master may cost tries."""
        for tries_left in reversed(range(TRIES)):
            try:
                return self._enquire_once(unit, number)
            except DamagedAnswer:
                if not tries_left or not self._others.is_there(self._now()):
                    raise
        raise AssertionError

    def _enquire_once(self, unit: int, number: int) -> tuple[int, float]:
        if unit == BROADCAST:
            raise ValueError('nobody answers a broadcast')
        request = Enquiry(unit, number)
        self._listen(request)
        certain = self._first_certain(unit, number)
        if certain != number:
            self._enquire_once(unit, certain)
            self._listen(request)
        answer, arrived, early = self._transact(request)
        if early:
            self._late.expect(request, self._now())
            self._clear(unit)
            self._listen(request)
            answer, arrived, _ = self._transact(request)
        if isinstance(answer, Value):
            if number == INV_ST:
                self._inv_st[unit] = answer.word, arrived
            return answer.word, arrived
        text = f'the drive has no parameter E{number:04X} that can be read (NAK)'
        raise Refused(Refused.ILLEGAL_ADDRESS, text)

    def _select(self, request: Select) -> float:
        """Write one word; return when the answer came."""
        self._listen(request)
        if request.unit == BROADCAST:
            return self._call(request)
        began = self._now()
        try:
            answer, arrived, _ = self._transact(request)
        except _Ambiguous:
            # not after mere noise: a stop that is given again would only have to wait for it
            self._settle(request.unit)
            raise
        if isinstance(answer, Nak):
            raise self._refusal(request.unit, began)
        return arrived

    def _call(self, request: Select) -> float:
        """Tell all units something, and leave them the time to do it; return when it was said."""
        sent = self._send(request)
        self._last = None
        until = sent + min(_TURNAROUND, _TURNAROUND_MARGIN * self._slowest)
        while self._now() < until:
            # an echo, or what is late: nobody answers this
            self._port.read(until)
        return sent

    def _refusal(self, unit: int, began: float) -> Refused:
        """
        Ask why a SELECT was answered by NAK [M0 §6.1.5]; nothing but our own error is cleared.

        :param began: when the SELECT was sent.
        """
        before, seen = self._inv_st.get(unit, (SIO_FAIL, 0.0))
        # a serial fault that was not there just before: this SELECT is its cause
        ours = before != SIO_FAIL and began - seen < _FRESH
        try:
            inv_st, _ = self._enquire(unit, INV_ST)
            if inv_st != SIO_FAIL or not ours:
                return classic.refused_by_status(inv_st)
            return classic.refused_by_flags(self._enquire(unit, SIO_ERR)[0])
        except PortError:
            raise
        except LinkError as error:
            return classic.refused_unknown(error)

    def _settle(self, unit: int) -> None:
        """Read something, so that the next answer is believed again; if not, then not."""
        try:
            self._clear(unit)
        except PortError:
            raise
        except LinkError:
            return

    def _clear(self, unit: int) -> None:
        """
        Read something that cannot be mistaken: what was late has come before it.

        :raises NotReady: everything that could be read is in quarantine.
        """
        self._enquire(unit, self._first_certain(unit))

    def _first_certain(self, unit: int, *numbers: int) -> int:
        """
        Return the first of some parameters, or of those to be read at any time, not in quarantine.

        :raises NotReady: all are.
        """
        questions = ((number, (number,)) for number in (*numbers, *_EVERYWHERE))
        return self._late.first_certain(unit, questions, self._now())

    def _listen(self, request: Request) -> None:
        """Take what came unasked; wait for it where it could pass for the answer to a request."""
        last = self._last
        until = 0.0
        if last and last.request.unit == request.unit and last.kind in nameless(request):
            pause = max(_NO_DOUBLE * self._settings.char_time, _NO_DOUBLE_LEAST)
            until = max(until, last.arrived + pause)
        is_write = isinstance(request, Select)
        give_up = self._now() + (_WRITE_WAIT if is_write else self._settings.response_timeout)
        until = max(until, min(self._others.open_until, give_up))
        while True:
            data = self._port.read(until)
            now = self._now()
            if data:
                if not self._others.hear(data, now) and last:
                    self._late.expect(last.request, now)
                # more may follow, or what another master asked is answered first
                gap = _NO_DOUBLE * self._settings.char_time
                until = max(until, min(max(now + gap, self._others.open_until), give_up))
            if now >= until:
                break
        if late := self._others.take_late(now):
            self._late.expect(late, now)

    def _send(self, request: Request) -> float:
        """Hand a request to the port; return when its last byte will have left."""
        frame = classic.encode(request)
        self._others.sent(request)
        began = self._now()
        self._port.write(frame)
        return began + len(frame) * self._settings.char_time

    def _transact(self, request: Request) -> tuple[Message, float, bool]:
        """
        Return the answer to a request, when its last byte came, and whether that was too early.

        Too early is what was told just before and is told again before the request can have been
        answered. A line without speed, such as a pseudo-terminal, is always early.
        """
        before, self._last = self._last, None
        sent = self._send(request)
        try:
            answer, arrived, more = self._receive(request, sent)
        except (NoAnswer, DamagedAnswer):
            self._late.expect(request, self._now())
            # if the adapter still echoes, the next echo will tell
            self._echoes = False
            raise
        # units answer in order: whatever was still to come has come before this
        self._late.release(request.unit)
        self._last = _Answer(request, classic.kind(answer), arrived)
        took = arrived - sent - len(classic.encode(answer)) * self._settings.char_time
        self._slowest = max(took, _KEPT_OF_SLOWEST * self._slowest)
        if more:
            self._late.expect(request, self._now())
        again = before is not None and before.request == request and isinstance(answer, Value)
        # a character less, for no clock is exact
        least = (classic.LONGEST_ANSWER - 1) * self._settings.char_time
        return answer, arrived, again and arrived < sent + least

    def _receive(self, request: Request, sent: float) -> tuple[Message, float, bool]:
        """Return the answer, when it came, and whether more came behind it."""
        quarantined = self._late.quarantined(request.unit, self._now())
        longest = classic.LONGEST_ANSWER * self._settings.char_time + _INTER_BYTE_TIMEOUT
        deadline = sent + self._settings.response_timeout
        # one answer, and as much rubbish again, however long somebody keeps talking
        last_chance = deadline + 2 * longest
        reader = classic.Reader()
        echoed = not self._echoes
        answered = False
        came = 0
        while True:
            data = self._port.read(deadline)
            now = self._now()
            if not data:
                if now < deadline:
                    continue
                break
            came += len(data)
            self._others.hear(data, now)
            messages = reader.feed(data)
            for number, message in enumerate(messages, start=1):
                if message == request:
                    # or another master asks the same
                    self._echoes |= not self._others.is_there(now)
                    echoed = True
                    came -= len(classic.encode(request))
                elif echoed and classic.answers(message, request):
                    kind = classic.kind(message)
                    stray = came - len(classic.encode(message))
                    doubtful = self._others.doubts(message, request, now, stray)
                    if kind not in quarantined and not doubtful:
                        return message, now, bool(messages[number:] or reader.pending)
                    if isinstance(request, Select):
                        raise _Ambiguous(
                            f'unit {request.unit} answered, but perhaps to an earlier request'
                        )
                    if doubtful:
                        raise DamagedAnswer(f'unit {request.unit}: {DOUBTFUL}')
                elif self._others.is_there(now) and isinstance(message, Value):
                    # units answer in order: ours was lost, unless this is a late one to us
                    answered |= message.unit == request.unit and message.number not in quarantined
            if answered or self._others.was_answered:
                raise DamagedAnswer(f'unit {request.unit}: {DOUBTFUL}')
            deadline = min(max(deadline, now + longest), last_chance)
            if self._others.is_there(now):
                # its next request may be as far away as the time-out
                deadline = min(deadline, now + longest - _INTER_BYTE_TIMEOUT + 2 * self._slowest)
        if came:
            raise DamagedAnswer(f'unit {request.unit}: {came} bytes came that are no answer')
        raise NoAnswer(f'unit {request.unit} did not answer')
