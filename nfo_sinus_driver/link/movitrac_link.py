# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The protocol of SEW's MOVITRAC 31.. over one serial line: no belief in a doubtful answer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import contextlib
import time

from nfo_sinus_driver.link import movitrac, movitrac_refusal
from nfo_sinus_driver.link.another_master import DOUBTFUL
from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    DamagedAnswer,
    LineSettings,
    LinkError,
    NeverSilent,
    NoAnswer,
    NothingToAsk,
    PortError,
    Remarks,
    Reply,
)
from nfo_sinus_driver.link.late_replies import LateReplies
from nfo_sinus_driver.link.line_protocols import MOVITRAC
from nfo_sinus_driver.link.movitrac import (
    Answer,
    Data,
    Enquiry,
    Kind,
    Nack,
    Overhearing,
    Reader,
    Request,
    Select,
)
from nfo_sinus_driver.link.other_requests import TRIES, OtherRequests
from nfo_sinus_driver.link.port import NEVER_SILENT, Port, await_silence, port_of
from nfo_sinus_driver.link.serial_link import Echo

#: How much later than at once a drive may be told to answer (P843), s.
LONGEST_RESPONSE_TIME = 0.2
#: Pauses within an answer, s: 10 ms of the drive [M4 §2.4.2], and what a USB adapter holds back.
_INTER_BYTE_TIMEOUT = 0.03
#: Silence between two frames, in characters: the manual wants none, but the drive has to let go of
#: the two wires before it can see a start delimiter.
_GAP = 2
#: How long a write waits at least for a line that is not silent, s.
_WRITE_WAIT = 0.02
#: The least that an answer takes, s; less is a line without speed.
_AT_ONCE = 0.001
#: What every drive has and may be read at any time: its address (P842), its response time (P843),
#: frequency and heat sink temperature. With four of them one is always certain, see LateReplies.
_EVERYWHERE = (206, 207, 0, 4)


class _Ambiguous(DamagedAnswer):
    """An ACK or NACK came that may belong to an earlier request."""


class MovitracLink:
    """
    A master of the MOVITRAC's protocol on one line.

    A DATA names its index, ACK and NACK name nothing, and no answer names its drive. So whenever
    an answer is missing or damaged, or bytes come that nobody asked for, the kinds of answers that
    may still come from that drive are in quarantine (:class:`LateReplies`). One of these kinds is
    only read after the drive has answered something else. A write is never kept waiting, for it
    may be a stop; but if its answer is in quarantine it is not believed: the line is cleared by
    reading something, and :class:`DamagedAnswer` says that nobody knows.

    Where the late answer may be *another* drive's, or be the one before told twice, the line is
    listened to for as long as the right answer may take; if anything more comes, nothing is
    believed. So a drive that is dead costs its neighbours no transaction.

    The requests of another master are found (:class:`OtherRequests`). What may answer them, and any
    answer that may have met another one, is not believed; a read is repeated.

    Drives may be set to answer up to 0.2 s late (P843). Nobody has to say so: the first request,
    and each after a failure, is waited for so much longer than ``response_timeout``, any other as
    much longer as the drive has taken of late.

    An adapter that echoes what is sent is noticed at the first request; from then on an answer
    counts only behind the echo.

    What is promised: no value of another index is taken, no answer of the drive up to three
    time-outs late to a question asked before, no ACK of another write to it. Not told apart is a
    late answer of another drive just when the right one is lost, and one that is told twice, the
    second time when the right one may be on its way, but does not come. There is no parity, and
    the check is a sum: choose short wires.
    """

    supervision = None
    #: [M4 §2.3.1], [M4 §2.3.3]; 31 drives on a line at most, with addresses of 64 [C75].
    protocol = MOVITRAC

    def __init__(self, port: Port, settings: LineSettings, now: Clock = time.monotonic) -> None:
        self._now = now
        self._port = port
        self._settings = settings
        self.remarks = Remarks()
        self._late: LateReplies[Request, Kind] = LateReplies(
            settings.response_timeout, movitrac.kinds
        )
        self._others: OtherRequests[Request] = OtherRequests(
            self.remarks, settings.response_timeout + LONGEST_RESPONSE_TIME, Overhearing().feed,
            Request, movitrac.encode, movitrac.answers,
        )
        self._echo = Echo()
        #: The frame of the last answer, if the last request had one.
        self._last = b''
        #: When the last byte was on the line, as far as we know.
        self._line_end = 0.0

    @classmethod
    def on_port(cls, port: str, settings: LineSettings) -> MovitracLink:
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
        self._others.clear()
        self._echo = Echo()
        self._last = b''

    def use_resync_reads(self, unit: int, addresses: Sequence[Address]) -> None:
        """Take parameters that are safe to read; here those are asked that every drive has."""

    def parts(self, address: Address) -> tuple[Address]:
        """Return the whole: a frame carries all of a value."""
        return (address,)

    def read(self, unit: int, address: Address) -> Reply:
        """Read one parameter, of 4 or of 8 bytes."""
        answer, arrived = self._enquire(Enquiry(unit, address.index))
        if isinstance(answer, Nack):
            raise movitrac_refusal.refusal(answer.code)
        assert isinstance(answer, Data)
        if len(answer.value) != address.size:
            came = f'a value of {len(answer.value)} bytes came instead of {address.size}'
            raise DamagedAnswer(f'unit {unit}, index {address.index}: {came}')
        return Reply(answer.value, arrived)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """
        Write one parameter, of 4 or of 8 bytes.

        A drive that says by NACK that it has started a factory setting, or keeps the value only
        until it is switched off, has done it [C81].
        """
        request = Select(unit, address.index, data)
        self._await_gap(is_write=True)
        try:
            answer, arrived = self._transact(request)
        except _Ambiguous:
            # not after mere noise: a stop that is given again would only have to wait for it
            self._settle(unit)
            raise
        if isinstance(answer, Nack) and answer.code not in movitrac_refusal.DONE:
            raise movitrac_refusal.refusal(answer.code)
        return Reply(b'', arrived)

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """Write one parameter, then read another; in as many transactions as that takes."""
        self.write(unit, address, data)
        return self.read(unit, source)

    def read_then_write(self, unit: int, source: Address, address: Address, data: bytes) -> Reply:
        """
        Read a parameter whose value nobody needs, then write another; nothing is sent between.

        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """
        self._await_gap(is_write=True)
        try:
            with contextlib.suppress(NoAnswer, DamagedAnswer):
                self._transact(Enquiry(unit, source.index))
            return self.write(unit, address, data)
        except LinkError as error:
            error.maybe_done = True
            raise

    def identify(self, unit: int) -> NothingToAsk:
        """Return no questions: the protocol has none but for parameters."""
        return NothingToAsk()

    # --- belief -----------------------------------------------------------------------------------

    def _enquire(self, request: Enquiry) -> tuple[Answer, float]:
        """Return the answer to a question; another master may cost some tries."""
        for tries_left in reversed(range(TRIES)):
            try:
                return self._enquire_once(request)
            except DamagedAnswer:
                if not tries_left or not self._others.is_there(self._now()):
                    raise
        raise AssertionError

    def _enquire_once(self, request: Enquiry) -> tuple[Answer, float]:
        """
        Return the answer to a question that is not in quarantine, if need be after another one.

        :raises NotReady: everything that could be asked first is in quarantine, too.
        """
        self._await_gap()
        certain = self._first_certain(request, *self._resync_reads(request.unit))
        if certain is not request:
            self._resync_read(certain)
            self._await_gap()
        try:
            return self._transact(request)
        except LinkError as error:
            error.heard = certain is not request
            raise

    def _resync_read(self, request: Enquiry) -> None:
        """Have the unit answer; whatever it says, what was late has come before it."""
        try:
            self._transact(request)
        except LinkError as error:
            # nobody has heard the request for which it was asked
            error.maybe_done = False
            raise

    def _settle(self, unit: int) -> None:
        """Read something, so that the next answer is believed again; if not, then not."""
        try:
            self._await_gap()
            self._transact(self._first_certain(*self._resync_reads(unit)))
        except PortError:
            raise
        except LinkError:
            return

    def _resync_reads(self, unit: int) -> Iterator[Enquiry]:
        return (Enquiry(unit, index) for index in _EVERYWHERE)

    def _first_certain(self, *requests: Enquiry) -> Enquiry:
        questions = ((request, (request.index,)) for request in requests)
        return self._late.first_certain(requests[0].unit, questions, self._now())

    def _response_time(self, unit: int) -> float:
        """Return how much later than at once a drive may answer, s."""
        longest = self._late.longest(unit)
        unsettled = bool(self._late.quarantined(unit, self._now()))
        return LONGEST_RESPONSE_TIME if unsettled or not longest else longest

    def _is_doubtful(self, request: Request, answer: Answer, arrived: float, sent: float) -> bool:
        """Tell whether an answer may be another unit's, late, or the one before, told twice."""
        frame = movitrac.encode(answer)
        # a character less, for no clock is exact
        soonest = sent + (len(frame) - 1) * self._settings.char_time
        return (frame == self._last and arrived < soonest) or self._late.may_be_of_another(
            request.unit, movitrac.kind(answer), arrived
        )

    def _listen(self, request: Request, until: float) -> None:
        """Wait as long as the right answer may take, if this was none (DamagedAnswer: it came)."""
        while (now := self._now()) < until:
            if data := self._port.read(until):
                self._line_end = max(self._line_end, now)
                self._others.hear(data, self._now())
                raise DamagedAnswer(f'unit {request.unit}: two answers came, one of them is late')

    def _await_gap(self, *, is_write: bool = False) -> None:
        """
        Wait for a gap of silence, so that the drives hear the request; take what came unasked.

        A write may be a stop, and the noise may be on our side of the line alone: rather than not
        at all it is sent into it, as soon as no answer that began before can still be coming.

        :raises NeverSilent: there is none.
        """
        gap = _GAP * self._settings.char_time
        longest = movitrac.LONGEST_ANSWER * self._settings.char_time
        wait = max(_WRITE_WAIT, longest) if is_write else self._settings.response_timeout
        give_up = self._now() + wait
        while True:
            data, self._line_end, silent = await_silence(
                self._port, self._now, self._line_end, gap, wait
            )
            if not self._others.hear(data, self._now()):
                self._heard_unasked(data)
            if not silent and not is_write:
                raise NeverSilent(NEVER_SILENT)
            until = min(self._others.open_until, give_up)
            if self._now() >= until:
                break
            # what another master asked is answered first
            if data := self._port.read(until):
                self._line_end = max(self._line_end, self._now())
                self._others.hear(data, self._line_end)
        if late := self._others.take_late(self._now()):
            self._late.expect(late, self._now())

    def _heard_unasked(self, data: bytes) -> None:
        """Take note of bytes that nobody asked for, unless switching a transmitter makes them."""
        if not movitrac.is_glitch(data):
            self._late.heard_unasked(self._now())

    # --- one transaction --------------------------------------------------------------------------

    def _transact(self, request: Request) -> tuple[Answer, float]:
        """Return the answer to a request, and when its last byte came."""
        unit, char_time = request.unit, self._settings.char_time
        frame = movitrac.encode(request)
        response_time = self._response_time(unit)
        self._late.sent(request)
        self._echo.sent(frame)
        self._others.sent(request)
        sent = self._now() + len(frame) * char_time
        self._line_end = sent
        self._port.write(frame)
        reader = Reader(request)
        try:
            answer, arrived = self._receive(request, reader, sent + response_time)
            length = len(reader.frame) * char_time
            if self._is_doubtful(request, answer, arrived, sent):
                self._listen(request, sent + response_time + length)
        except (NoAnswer, DamagedAnswer):
            self._late.expect(request, self._now())
            self._last = b''
            raise
        finally:
            # or another master asks the same
            if frame in reader.other and not self._others.is_there(self._now()):
                self._echo.present = True
        # units answer in order: whatever was still to come from it has come before this
        self._late.release(unit)
        self._late.took(unit, max(_AT_ONCE, arrived - sent - length))
        self._last = reader.frame
        # and the request has left, even where the port is faster than its settings say
        self._line_end = arrived
        self._heard_unasked(reader.rest)
        return answer, arrived

    def _receive(self, request: Request, reader: Reader, due: float) -> tuple[Answer, float]:
        """
        Return the answer, and when it came.

        :param due: when it begins at last, if the drive is as fast as it can be.
        """
        encoded = movitrac.encode(request)
        quarantined = self._late.quarantined(request.unit, self._now())
        longest = movitrac.LONGEST_ANSWER * self._settings.char_time + _INTER_BYTE_TIMEOUT
        deadline = due + self._settings.response_timeout
        # one answer, and as much rubbish again, however long somebody keeps talking
        last_chance = deadline + 2 * longest
        while True:
            data = self._port.read(deadline)
            now = self._now()
            if not data:
                if now < deadline:
                    continue
                break
            self._line_end = max(self._line_end, now)
            self._others.hear(data, now)
            data = self._echo.strip(data)
            while (answer := reader.feed(data)) is not None:
                passed = reader.passed_over
                stray = len(self._echo.before) + (passed != encoded and len(passed))
                doubtful = self._others.doubts(answer, request, now, stray)
                if movitrac.kind(answer) not in quarantined and not doubtful:
                    return answer, now
                if isinstance(request, Select):
                    raise _Ambiguous(
                        f'unit {request.unit} answered, but perhaps to an earlier request'
                    )
                data = b''
                if doubtful:
                    raise DamagedAnswer(f'unit {request.unit}: {DOUBTFUL}')
            if self._others.was_answered:
                raise DamagedAnswer(f'unit {request.unit}: {DOUBTFUL}')
            deadline = min(max(deadline, now + longest), last_chance)
        held = self._echo.give_up()
        if held:
            # an adapter that echoes no more; if it does, the next echo will tell
            self._echo.present = False
        came = len(held) + len(reader.frame + reader.other)
        if held or reader.frame or reader.other not in (b'', encoded):
            raise DamagedAnswer(f'unit {request.unit}: {came} bytes came that are no answer')
        raise NoAnswer(f'unit {request.unit} did not answer')
