# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A master of a protocol whose codec distinguishes answers from requests."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Sequence
import time
from typing import Any

from nfo_sinus_driver.link.foreign_traffic import DOUBTFUL, Codec, ForeignPairs
from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    DamagedAnswer,
    Identification,
    LineSettings,
    LinkError,
    NoAnswer,
    Plan,
    PortError,
    Reply,
    Why,
    silent,
)
from nfo_sinus_driver.link.late_replies import LateReplies
from nfo_sinus_driver.link.ports.port import Port
from nfo_sinus_driver.link.request_link import LONG_PAUSE, WRITE_WAIT, RequestLink


class _Ambiguous(DamagedAnswer):
    """An answer came that names nothing and may belong to an earlier request."""


class CodecLink(RequestLink[Any]):
    """
    A master of a protocol whose refusals and confirmations name nothing.

    If the answer to a write is in quarantine it is not believed: the line is cleared by reading
    something, and :class:`DamagedAnswer` says that the outcome is unknown.

    The requests of another master are found (:class:`ForeignPairs`). An answer that may be to one
    of them, or may have collided with another, is not believed; a read is repeated.
    """

    _codec: Codec
    #: How late a drive may answer, s.
    _longest_response = 0.0

    def __init__(self, port: Port, settings: LineSettings, now: Clock = time.monotonic) -> None:
        super().__init__(port, settings, now)
        codec = self._codec
        longest = settings.response_timeout + self._longest_response
        self._late = LateReplies(settings.response_timeout, codec.kinds, longest)
        self._another: ForeignPairs = ForeignPairs(self.remarks, longest, codec)
        #: The last answer is the one before, and came before the request can have been answered.
        self._again = False
        #: The last request, its answer and when it came; ``None``: it had none.
        self._last: tuple[Any, Any, float] | None = None
        #: What is safe to read, by unit: of four one is always certain, see :class:`LateReplies`.
        self._resync_numbers: dict[int, tuple[int, ...]] = {}

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""
        super().close()
        self._last = None

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        """Name parameters that are safe to read at any time."""
        self._resync_numbers[unit] = tuple(address.index for address in addresses)

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """Write one parameter, then read another; in as many transactions as that takes."""
        self.write(unit, address, data)
        return self.read(unit, source)

    @abstractmethod
    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        """Read one parameter (LinkError: as its subclasses say)."""

    def identify(self, unit: int) -> Plan[Identification]:
        """Ask nothing: the protocol has only parameters."""
        yield from ()
        return Identification()

    @property
    def _writes(self) -> tuple[type[Any], ...]:
        return (self._codec.select,)

    def _read_request(self, unit: int, address: Address) -> Any:
        return self._codec.enquiry(unit, address.index)

    @property
    def _write_wait(self) -> float:
        return max(WRITE_WAIT, self._codec.longest_answer * self._settings.char_time)

    def _resync_reads(self, unit: int) -> Iterable[Any]:
        numbers = self._resync_numbers.get(unit, ())
        return (self._codec.enquiry(unit, number) for number in numbers)

    def _distinct_kinds(self, request: Any) -> Sequence[Any]:
        return self._codec.kinds(request)[:1]

    def _take_late(self, request: Any, now: float) -> None:
        if late := self._another.take_late(now):
            self._late.expect(late, now)

    def _note_unrequested(self, data: bytes, request: Any) -> None:
        if not self._is_second(data):
            super()._note_unrequested(data, request)

    def _is_second(self, data: bytes) -> bool:
        """Return whether the last answer has come again, and silences see to that."""
        now, unit = self._now(), self._seconds.last_unit
        if self._another.is_there(now):
            # an answer to that one may be the same
            return False
        is_second = self._seconds.take_frame(unit, data, self._line_end)
        return is_second and self._seconds.silence(unit, now) > 0.0

    def _longest_delay(self, unit: int) -> float:
        """Return how late an answer may begin, s."""
        return 0.0

    def _confirm(self, request: Any, answer: Any, arrived: float, until: float) -> None:
        """
        Make sure of an answer.

        :param until: when the right answer has come, if this was none.
        :raises DamagedAnswer: it is none.
        """

    def _command(self, request: Any) -> tuple[Any, float]:
        """Return the answer to a write, and when it came."""
        self._await_gap(request, is_write=True)
        try:
            return self._transact(request)
        except _Ambiguous:
            # not after mere noise: a repeated stop would only have to wait for it
            self._settle(request.unit)
            raise

    def _settle(self, unit: int) -> None:
        """Try to read something, so that the next answer is believed again."""
        first = next(iter(self._resync_reads(unit)), None)
        if first is None or self.stop_waits():
            return
        try:
            self._await_gap(first)
            self._resync_read(self._first_certain(unit))
        except PortError:
            raise
        except LinkError:
            return

    # --- one transaction --------------------------------------------------------------------------

    def _transact(self, request: Any) -> tuple[Any, float]:
        char_time = self._settings.char_time
        before, self._last, self._again = self._last, None, False
        delay = self._longest_delay(request.unit)
        self._another.sent(request)
        sent = self._send(request, self._codec.encode(request))
        try:
            answer, arrived, behind = self._receive(request, sent + delay)
            length = len(self._codec.encode(answer)) * char_time
            # a character less, for no clock is exact
            early = arrived < sent + length - char_time
            self._again = early and before is not None and before[1] == answer
            self._confirm(request, answer, arrived, sent + delay + length)
        except (NoAnswer, DamagedAnswer) as error:
            self._note_missing(request, error)
            self._seconds.unanswered(request, self._now())
            self._late.expect(request, self._now())
            if self._echo.give_up():
                # the adapter does not echo any more; if it does, the next echo will show it
                self._echo.present = False
            raise
        # units answer in order: late answers of it have come before this
        self._late.release(request.unit)
        self.pauses.answered(request.unit, type(request), arrived)
        if self._has_run:
            self._took(request.unit, arrived - sent - length)
        self._last = request, answer, arrived
        # and the request has left, even where the port is faster than its settings say
        self._line_end = arrived
        self._seconds.answered(request, self._codec.encode(answer), arrived)
        if behind:
            self._note_unrequested(behind, request)
        if silence := self._seconds.silence(request.unit, arrived):
            came, _ = self._hear_out(silence)
            if came:
                self._note_unrequested(came, request)
        return answer, arrived

    def _receive(self, request: Any, due: float) -> tuple[Any, float, bytes]:
        """
        Return the answer, when it came, and what came behind it.

        :param due: when it begins, if the drive is as fast as it can be.
        """
        codec, unit = self._codec, request.unit
        quarantined = self._late.quarantined(unit, self._now())
        longest = codec.longest_answer * self._settings.char_time + codec.inter_byte_timeout
        deadline = due + self._settings.response_timeout
        deadline = min(deadline, self._sent_at + self._most(unit, codec.longest_answer))
        # one answer, and as much noise again, however long the line is not silent
        last_chance = deadline + 2 * longest
        reader = codec.reader()
        came = 0
        last = pause = 0.0
        while True:
            data = self._read_line(min(last + LONG_PAUSE, deadline)) if came else b''
            looked = not data
            if not (data := data or self._read_line(deadline)):
                break
            now = self._now()
            self._another.hear_bytes(data, now)
            data = self._echo.strip(data)
            if came and looked:
                # less the time of these bytes themselves; without a look that found none, this
                # thread may not have run
                pause = max(pause, now - last - len(data) * self._settings.char_time)
            last = now
            came += len(data)
            messages = reader.feed(data)
            passed_over = []
            for number, message in enumerate(messages, start=1):
                if not codec.answers(message, request):
                    if message == request:
                        came -= len(codec.encode(request))
                        # or another master sends the same
                        self._echo.present |= not self._another.is_there(now)
                    elif not self._is_second(codec.encode(message)):
                        passed_over.append(message)
                    continue
                stray = len(self._echo.before) + came - len(codec.encode(message))
                doubtful = self._another.doubts(message, request, now, stray)
                if codec.kind(message) not in quarantined and not doubtful:
                    behind = b''.join(map(codec.encode, messages[number:])) + reader.rest
                    if not stray:
                        self._note_pause(pause)
                    return message, now, behind
                if isinstance(request, codec.select):
                    raise _Ambiguous(f'unit {unit} answered, but perhaps to an earlier request')
                if doubtful:
                    raise DamagedAnswer(f'unit {unit}: {DOUBTFUL}')
            lost = self._was_passed_over(passed_over, request, quarantined, now)
            if lost or self._another.was_answered:
                raise DamagedAnswer(f'unit {unit}: {DOUBTFUL}')
            deadline = self._deadline(min(max(deadline, now + longest), last_chance), now)
            if now >= deadline:
                break
        came += len(self._echo.before) + len(self._echo.held)
        if came:
            raise DamagedAnswer(f'unit {unit}: {came} bytes came that are no answer')
        raise silent(unit)

    def _took(self, unit: int, seconds: float) -> None:
        """Note how long a unit took to answer."""
        self._late.took(unit, seconds)

    def _was_passed_over(
        self, messages: Sequence[Any], request: Any, quarantined: Any, now: float
    ) -> bool:
        """Return whether an answer to another master shows that the request was lost."""
        return False

    def _deadline(self, deadline: float, now: float) -> float:
        """Return until when to wait for more of an answer."""
        return deadline
