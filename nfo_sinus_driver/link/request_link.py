# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Requests on one serial line: send, wait, and decide whether to believe the answer.

:class:`RequestLink` has what all protocols share; each adds its messages. :mod:`.pairs` serves
those whose codec distinguishes answers from requests.

Modbus does not (:mod:`.modbus.serial`): the answer to a read names no register, that to a write is
the request again, and how long one is follows from the request. So what is believed there rests on
the answers before, with pairs on the kind of an answer. One engine for both would share thirty
lines more, and need a dozen steps that one protocol alone takes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
import contextlib
import math
import time
from typing import Any, Generic, Protocol, TypeVar

from nfo_sinus_driver.link.foreign_traffic import TRIES
from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    DamagedAnswer,
    InProgress,
    LineProtocol,
    LineSettings,
    LinkError,
    NeverSilent,
    NoAnswer,
    NotReady,
    Refused,
    Remarks,
    Reply,
)
from nfo_sinus_driver.link.late_replies import LATEST_REPLY, LISTENING_STEP, LateReplies
from nfo_sinus_driver.link.pauses import Pauses
from nfo_sinus_driver.link.ports.port import Port, port_of
from nfo_sinus_driver.link.second_answers import SecondAnswers
from nfo_sinus_driver.link.thread_clock import ThreadClock

#: How long a write waits at least for a line that is not silent, s.
WRITE_WAIT = 0.02
_NEVER_SILENT = 'the line is never silent: noise, or another master on it'
_IN_PIECES = (
    'answers come in pieces with long pauses: the adapter, or the device server, holds bytes back; '
    'set its latency timer or packing time to the least, or use another one'
)
#: A pause within an answer that is longer than a good adapter makes, s; so many of them are
#: reported, and their count decays: on a busy machine there is one now and then.
LONG_PAUSE = 0.03
_MANY_PAUSES = 3
#: For so many silences at most a line is heard that is not silent.
_SILENCES = 3
_KEPT_OF_PAUSES = 0.9

_Request = TypeVar('_Request')
_Answer = TypeVar('_Answer')
_Self = TypeVar('_Self', bound='RequestLink[Any]')


class Echo:
    """
    Distinguishes the echo of a request from its answer.

    ``present`` is set when a request itself is found among the bytes that come; from then on every
    request has to come back before anything else counts. That matters most where the answer is
    the same as the request: function 06 of Modbus.

    :ivar present: every request comes back.
    :ivar before: what came between the request and its echo.
    :ivar held: what has come in place of the echo so far.
    """

    def __init__(self) -> None:
        self.present = False
        self.before = b''
        self._awaited = b''
        self.held = b''

    def sent(self, frame: bytes) -> None:
        """Expect a request to come back, if there is an echo."""
        self._awaited = frame if self.present else b''
        self.held = self.before = b''

    @property
    def bytes_needed(self) -> int:
        """How many bytes of the echo have to come yet."""
        return max(0, len(self._awaited) - len(self.held))

    def strip(self, data: bytes) -> bytes:
        """Return the bytes that came behind the echo."""
        if not self._awaited:
            return data
        self.held += data
        before, echo, rest = self.held.partition(self._awaited)
        if echo:
            self.before = before
            self._awaited = self.held = b''
        return rest

    def give_up(self) -> bytes:
        """Return what came instead of the echo."""
        held, self.held, self._awaited = self.held, b'', b''
        return held


class ForeignTraffic(Protocol):
    """Finds another master on the line."""

    def is_there(self, now: float) -> bool:
        """Return whether another master has sent anything recently."""

    def open_until(self, unit: int) -> float:
        """Return until when an answer of a unit may be to another master; 0: it is not."""

    def hear_bytes(self, data: bytes, now: float) -> bool:
        """Take bytes; return whether they are known to be of another exchange."""

    def clear(self) -> None:
        """Forget what came: the port is closed."""


class RequestLink(ABC, Generic[_Request]):
    """
    A master on one serial line; one request at a time.

    Between frames the line is silent for a gap, counted from the last byte on it. After a missing
    or damaged answer, or unrequested bytes, the kinds of answers that may still come are in
    quarantine (:class:`LateReplies`). A read whose answer could be confused with them is
    sent after the unit has answered something else, a *resync read*. A write is sent at once, for
    it may be a stop. An answer that may be to another master is not believed; a read is repeated.

    An adapter that echoes what is sent is noticed at the first request; from then on an answer
    counts only behind the echo.
    """

    supervision = None
    _patience = math.inf
    protocol: LineProtocol
    _another: ForeignTraffic
    _late: LateReplies[Any, Any]

    def __init__(self, port: Port, settings: LineSettings, now: Clock = time.monotonic) -> None:
        self.clock = self._now = ThreadClock(now)
        self.stop_waits: Callable[[], bool] = lambda: False
        self._port = port
        self._settings = settings
        self.remarks = Remarks()
        self.pauses = Pauses(
            self.remarks.add,
            lambda: self._line_end,
            settings.request_gap,
            self.protocol.broadcast,
        )
        timeout = settings.response_timeout
        self._seconds = SecondAnswers(self.remarks.add, timeout, LATEST_REPLY * timeout)
        self.last_byte_at = -math.inf
        self._echo = Echo()
        #: When the last known byte was on the line.
        self._line_end = 0.0
        #: How many of the last answers had long pauses.
        self._in_pieces = 0.0
        #: When the last request had been sent.
        self._sent_at = 0.0

    def wait_at_most(self, seconds: float) -> None:
        """Wait for the next answers so long at most, s, but as long as the unit has ever taken."""
        self._patience = seconds

    def end_listening_if(self, stop_waits: Callable[[], bool]) -> None:
        """Wait for no more than the answer to the request that was sent, where a stop waits."""
        self.stop_waits = stop_waits

    @classmethod
    def on_port(
        cls: type[_Self], port: str, settings: LineSettings, trace: str = ''
    ) -> _Self:
        """Return the link on a port; a ValueError says what is no port."""
        return cls(port_of(port, settings, trace), settings)

    @property
    def place(self) -> str:
        """Where the port is."""
        return self._port.place

    def open(self) -> None:
        """Open the port."""
        self._port.open()
        self._line_end = self._now()

    def answers_twice(self, unit: int) -> bool:
        """Return false: an answer counts at once, and the silence behind it is waited for after."""
        return False

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        self._port.close()
        self._late.clear()
        self._another.clear()
        self._seconds.clear()
        self.pauses.forget_failures()
        self._echo = Echo()

    def read_then_write(self, unit: int, source: Address, address: Address, data: bytes) -> Reply:
        """
        Read a parameter whose value is not needed, then write another; nothing is sent between.

        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """
        request = self._read_request(unit, source)
        self._await_gap(request)
        try:
            with contextlib.suppress(NoAnswer, DamagedAnswer, Refused):
                self._transact(request)
            self._expect_again(request)
            return self.write(unit, address, data)
        except LinkError as error:
            error.maybe_done = True
            raise

    @abstractmethod
    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter (LinkError: as its subclasses say)."""

    # --- what differs by protocol -----------------------------------------------------------------

    @property
    @abstractmethod
    def _gap(self) -> float:
        """How long the line is silent between two frames, s."""

    @property
    @abstractmethod
    def _write_wait(self) -> float:
        """How long a write waits for a line that is not silent, s: one answer at least."""

    @abstractmethod
    def _read_request(self, unit: int, address: Address) -> _Request:
        """Return the request that reads a parameter."""

    @abstractmethod
    def _resync_reads(self, unit: int) -> Iterable[_Request]:
        """Yield requests that do nothing, the best first."""

    @abstractmethod
    def _distinct_kinds(self, request: _Request) -> Sequence[Any]:
        """Return the kinds of answers to a read that are distinct from others."""

    @abstractmethod
    def _transact(self, request: _Request) -> tuple[Any, float]:
        """Send a request; return its answer, and when its last byte came."""

    @abstractmethod
    def _take_late(self, request: _Request, now: float) -> None:
        """Quarantine the late answers to requests of another master."""

    def _most(self, unit: int, length: int) -> float:
        """
        Return how long the first byte of an answer is waited for at most, s.

        One that comes and is not heard has left the line by then, too.

        :param length: of the answer, in characters.
        """
        least = self._late.longest_ever(unit) + length * self._settings.char_time + self._gap
        return max(self._patience, least)

    def _gap_before(self, request: _Request) -> float:
        """Return how long the line is silent before a request if nothing unrequested comes, s."""
        return self._gap

    def _silence_before(self, request: Any, is_write: bool) -> float:
        """Return how long the line has to be silent before a request, s; 0: as usual."""
        silence = self.pauses.silence(request.unit)
        if is_write:
            # no stop waits for an answer that comes twice
            return silence
        return max(silence, self._seconds.silence(request.unit, self._now()))

    def _hear_out(self, silence: float, least: float = 0.0) -> tuple[bytes, bool]:
        """
        Take what comes until the line is silent, or a stop waits; return it, and whether it is.

        Where answers are waited for briefly, others go first.

        :param silence: how long it has to be, s.
        :param least: until when at least.
        """
        came = b''
        if not self._patience:
            return came, False
        until = max(least, self._line_end + silence)
        give_up = until + _SILENCES * silence
        while data := self._listen(until):
            came += data
            until = min(max(least, self._line_end + silence), give_up)
        if came:
            self._another.hear_bytes(came, self._now())
        return came, self._now() >= until

    @property
    @abstractmethod
    def _writes(self) -> tuple[type[Any], ...]:
        """The requests that write."""

    def _note_missing(self, request: Any, error: LinkError) -> None:
        """Note that no answer to a request came, or one that is damaged."""
        if isinstance(error, NoAnswer) and self._has_run:
            self.pauses.unanswered(request.unit, type(request))

    def _note_unrequested(self, data: bytes, request: _Request) -> None:
        """Note bytes of no known exchange."""
        self._late.note_unrequested(self._now())

    def _expect_again(self, request: _Request) -> None:
        """Expect another answer where the last may have been the one before, sent twice."""

    # --- belief -----------------------------------------------------------------------------------

    def _ask(self, request: _Request, once: bool = False) -> tuple[Any, float]:
        """Return the answer to a read, and when it came; another master may cost some tries."""
        for tries_left in reversed(range(1 if once else TRIES)):
            try:
                return self._ask_once(request, once)
            except DamagedAnswer:
                others = self._another.is_there(self._now())
                if not (tries_left and others) or self.stop_waits():
                    raise
        raise AssertionError

    def _ask_once(self, request: _Request, once: bool) -> tuple[Any, float]:
        self._await_gap(request)
        resynced = self._make_certain(request)
        try:
            return self._believed(request)
        except LinkError as error:
            error.responded = resynced
            raise

    def _believed(self, request: _Request) -> tuple[Any, float]:
        """Return the answer to a request, if it is one to believe, and when it came."""
        return self._transact(request)

    def _make_certain(self, request: Any) -> bool:
        """
        Have the unit answer another request first, if needed; return whether it did.

        :raises NotReady: all that could be sent first is in quarantine, too; or a stop waits.
        """
        if not self._late.quarantined(request.unit, self._now()):
            return False
        question = self._first_certain(request.unit, request)
        if question is request:
            return False
        try:
            self._resync_read(question)
        except LinkError as error:
            # the request itself has not been sent
            error.maybe_done = False
            raise
        if self.stop_waits():
            raise InProgress(self._now())
        self._await_gap(request)
        return True

    def _first_certain(self, unit: int, *requests: _Request) -> _Request:
        """Return the first of some requests, or of the resync reads, that is not in doubt."""

        def questions() -> Iterator[tuple[_Request, Sequence[Any]]]:
            for request in requests:
                yield request, self._distinct_kinds(request)
            for request in self._resync_reads(unit):
                yield request, self._distinct_kinds(request)

        return self._late.first_certain(unit, questions(), self._now())

    def _resync_read(self, request: _Request) -> None:
        """Have a unit answer; whatever it says, late answers have come before it."""
        with contextlib.suppress(Refused):
            self._transact(request)

    # --- the line ---------------------------------------------------------------------------------

    def _await_gap(self, request: Any, *, is_write: bool = False) -> bool:
        """
        Wait for a gap of silence; return whether unrequested bytes came meanwhile.

        A write may be a stop, and the noise may be on our side of the line alone: rather than not
        at all it is sent into the noise, once no earlier answer can still be coming.

        :raises NeverSilent: there is none.
        :raises NotReady: a stop waits, and goes ahead of a read.
        """
        wait = self._write_wait if is_write else self._settings.response_timeout
        give_up = self._now() + wait
        # usually the bus has waited for that already, in favour of others
        gap = max(self._gap_before(request), self.pauses.ready_at(request.unit) - self._line_end)
        silence = self._silence_before(request, is_write)
        gap, least = max(gap, silence), max(self._gap, silence)
        stray = False
        while True:
            data, now, silent = self._await_silence(gap, wait, is_write, least)
            if data and not self._another.hear_bytes(data, now):
                stray = True
                self._note_unrequested(data, request)
            if not is_write and self.stop_waits():
                raise NotReady(now)
            if not silent and not is_write:
                raise NeverSilent(_NEVER_SILENT)
            until = min(self._another.open_until(request.unit), give_up)
            if now >= until:
                break
            # requests of another master are answered first
            if data := self._read_line(until) if is_write else self._listen(until):
                self._another.hear_bytes(data, self._now())
                gap = least
        self._take_late(request, now)
        return stray

    def _await_silence(
        self, gap: float, wait: float, is_write: bool, least: float
    ) -> tuple[bytes, float, bool]:
        """
        Wait for silence on the line.

        :param gap: how long it has to last, s.
        :param wait: how much longer than that to wait for it, s.
        :param least: how long it has to last where bytes come, s.
        :returns: all bytes that came meanwhile, the moment, and whether silence came, too.
        """
        give_up = max(self._line_end + gap, self._now()) + wait
        came = b''
        while True:
            look = self._line_end + gap
            if not is_write and gap > LISTENING_STEP:
                look = min(look, self._now() + LISTENING_STEP)
            data = self._take(look)
            now = self._now()
            if data:
                came += data
                gap = least
                self._line_end = max(self._line_end, now)
            elif now >= self._line_end + gap:
                return came, now, True
            if (data and now > give_up) or (not is_write and self.stop_waits()):
                return came, now, False

    def _send(self, request: Any, frame: bytes) -> float:
        """Hand a request to the port; return when its last byte will have left."""
        self._late.sent(request)
        writes = isinstance(request, self._writes)
        self.pauses.sent(request.unit, self._now(), writes=writes)
        self._echo.sent(frame)
        self._line_end = self._now() + len(frame) * self._settings.char_time
        self._sent_at = self._line_end
        self._port.write(frame)
        return self._sent_at

    def _take(self, until: float) -> bytes:
        """Return what has come, as the port does."""
        data = self._port.read(self._now.until(until))
        if data:
            self.last_byte_at = self._now()
        return data

    def _listen(self, until: float) -> bytes:
        """Return the next bytes on the line until a moment, or none once a stop waits."""
        while (now := self._now()) < until and not self.stop_waits():
            data = self._take(min(until, now + LISTENING_STEP))
            if data:
                self._line_end = max(self._line_end, self._now())
                return data
        return b''

    def _read_line(self, until: float) -> bytes:
        """Return the next bytes on the line until a moment; empty: it has passed."""
        while True:
            data = self._take(until)
            now = self._now()
            if data:
                # bytes that come while the request is still being sent are no answer to it
                self._line_end = max(self._line_end, now)
                return data
            if now >= until:
                return data

    @property
    def _has_run(self) -> bool:
        """The thread has run since the last request: what it measures is of the line."""
        return self._now.resumed_at <= self._sent_at

    def _note_pause(self, longest: float) -> bool:
        """Note the longest pause, s, within a whole answer; return whether it is too long."""
        if not self._has_run:
            return False
        too_long = longest > LONG_PAUSE
        self._in_pieces = self._in_pieces + 1 if too_long else _KEPT_OF_PAUSES * self._in_pieces
        if self._in_pieces >= _MANY_PAUSES:
            self.remarks.add(_IN_PIECES)
        return too_long
