# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The set-point of one drive: newest wins, clamped, watched for its age."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
import functools
import math
from typing import NamedTuple

from nfo_sinus_driver.bus import LatestValue, Priority, Task
from nfo_sinus_driver.catalog import Limits, SetpointTarget
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.snapshot import NAN
from nfo_sinus_driver.link import (
    Address,
    AnotherValue,
    DamagedAnswer,
    Interrupted,
    LinkError,
    Refused,
    Write,
    Written,
)

#: An unchanged set-point is written again when the last write is this old, s: another master
#: may have changed it meanwhile.
_REWRITE_PERIOD = 5.0
#: And this share of the drive's own time-out. Any message keeps that from striking over Classic
#: [M0 §6.1.5], so the polls do; what counts over Modbus no manual says [M0 §5.3.3]: it might be
#: only what commands the drive.
_KEEP_ALIVE_SHARE = 1 / 3
#: How long a drive may be too busy for a set-point, s.
_LONGEST_BUSY = 1.0
#: The age is checked at least this often, so that a changed time-out takes effect, s; and whether
#: the last write was acknowledged.
_WATCH_PERIOD = 0.25
_ACKNOWLEDGED_PERIOD = 0.1
#: How often a set-point is sent in vain until it counts as failed after ``lost_after``, and 0: less
#: may be noise, where an answer is waited for long, or each drive of a line has few turns.
_TRIES, _TRIES_OF_0 = 5, 3
#: How much later it has failed at the latest, and a drive is lost that does not answer at all, s.
_LOST_WITHIN = 0.3
#: How much later one has failed for which there was no second turn, s, and in rounds of the line.
_TURNS_WITHIN, _ROUNDS = 2.0, 2
#: How long the set-points that the drive had are remembered, s.
_REMEMBERED = 10.0


class Request(NamedTuple):
    """
    A requested set-point.

    :ivar value: in the unit of the control mode.
    :ivar at: when it came in, s of the clock of the bus.
    :ivar since: when the first of its like came in, with no other one between.
    """

    value: float
    at: float
    since: float


_NONE = Request(NAN, -math.inf, -math.inf)


class _InVain(NamedTuple):
    """
    A write of a set-point that is not acknowledged.

    :ivar value: the newest that was to be written.
    :ivar since: when it was first sent, or 0 was due, s of the clock of the bus.
    :ivar tries: how often it was sent since; one that is answered in doubt counts half, for after
        a lost answer the next one may be that of the write before.
    """

    value: float
    since: float
    tries: float


class Turn(NamedTuple):
    """
    The moment from which on set-points have another sign than before, or none any more.

    :ivar at: when the first of them was due, s of the clock of the bus.
    :ivar before: the last one before; ``value`` that one.
    """

    at: float
    before: float
    value: float


NO_TURN = Turn(math.inf, 0.0, 0.0)


class Setpoint:
    """The set-point that the motor follows while the drive is enabled."""

    def __init__(self, state: DriveState) -> None:
        self._bus = state.bus
        self._params = state.params
        self._state = state
        self._slot = LatestValue(
            state.settings.address,
            self._make,
            self._done,
            lambda reply: state.hooks.status_arrived(reply),
            # a motor is to stand still, whether the drive answers or not
            urgent=lambda: self._request.value == 0,
        )
        #: The newest request; written by any thread, at once.
        self._request = _NONE
        self.control_mode = ''
        self._limits = Limits()
        self._target: SetpointTarget | None = None
        #: The parameters that a set-point is written to, by where that is.
        self._keys: dict[Address, str] = {}
        #: Encodes a set-point. A program that sends the same one again and again has it encoded
        #: once: that takes longer than all else that is done for it.
        self._encode = functools.lru_cache(maxsize=1)(self._encoded)
        #: Since when the drive follows set-points, s of the clock of the bus; else infinite.
        self.following_since = math.inf
        #: What the drive has and since when, by address; nothing where that is not known, and minus
        #: infinity where it may have taken a later write.
        self._written: dict[Address, tuple[bytes, float]] = {}
        #: What it answers that it has in place of that, by address.
        self._held: dict[Address, bytes] = {}
        #: What watches the age of set-points, and whether they are acknowledged.
        self._tasks: list[Task] = []
        #: No set-point has come within ``setpoint_timeout``: 0 is due, and the drive has taken it.
        self.ceased = self.expired = False
        #: The report of the set-point time-out, until set-points arrive again.
        self.timed_out: Report | None = None
        self._waits_for_answer = False
        #: What was written last, and what of that was not answered; NaN: nothing.
        self._sent = self._unanswered = NAN
        #: Since when the last write is due, s.
        self._sent_due = -math.inf
        #: What is not acknowledged, by address.
        self._in_vain: dict[Address, _InVain] = {}
        #: What was wanted last, in the unit of the control mode, and when that got another sign.
        self._wanted, self.turn = 0.0, NO_TURN
        self._busy_since = math.inf
        self._clamp_reported = False
        #: The set-points that the drive may have had recently, and until when; newest last.
        self._had: list[tuple[float, float]] = []
        #: What the drive was last given, in the unit of the control mode.
        self.commanded = NAN
        self.clamped = False

    def request(self, value: float) -> None:
        """Request a set-point, from any thread; it must be finite, and counts only if enabled."""
        if not math.isfinite(value):
            raise ValueError(f'a set-point of {value} is no number')
        now, last = self._bus.now(), self._request
        self._request = Request(value, now, last.since if value == last.value else now)
        if self.following:
            self._bus.request(self._slot)

    @property
    def following(self) -> bool:
        """The drive follows set-points."""
        return self.following_since < math.inf

    @property
    def directed(self) -> bool:
        """The sign of a set-point is the direction of the motor."""
        return self._target is None or self._target.directed

    @property
    def is_command(self) -> bool:
        """There is no run command beside it."""
        return self._target is not None and self._target.is_command

    @property
    def age(self) -> float:
        """How long ago the newest valid set-point came, s; NaN if none did since the enable."""
        at = self._request.at
        return self._bus.now() - at if at > self.following_since else NAN

    def follow(self, control_mode: str, limits: Limits, target: SetpointTarget | None) -> None:
        """
        Follow set-points that come in from now on; the drive has 0 now.

        With a reference of the drive's own, none is followed and none is missed.

        :param limits: those of a set-point, in the unit of the control mode.
        :param target: where set-points go; ``None``: none is followed.
        """
        self.control_mode = control_mode
        self._limits = limits
        self._target, follows = target, target is not None
        self.following_since = self._bus.now()
        self._keys, self._written, self._held = {}, {}, {}
        self._encode.cache_clear()
        if target is not None:
            for step in target.writes(0.0):
                address, data = self._params.target(step)
                self._keys[address] = step.key
                self._written[address] = data, self.following_since
        self.commanded = 0.0 if follows else NAN
        self._state.measurements.direction.command(self.commanded)
        self._had = [(0.0, math.inf)]
        self.clamped = self._clamp_reported = False
        self.ceased = self.expired = False
        self.timed_out = None
        self._waits_for_answer = False
        self._unanswered = NAN
        self._in_vain = {}
        self._wanted, self.turn = 0.0, NO_TURN
        self._busy_since = math.inf
        if follows:
            self._tasks = [
                self._bus.spawn(self._watch_age()),
                self._bus.spawn(self._watch_acknowledgement()),
            ]

    def stop_following(self) -> None:
        """Follow no more set-points."""
        self.following_since = math.inf
        self.commanded = NAN
        self._state.measurements.direction.command(NAN)
        self.clamped = False
        tasks, self._tasks = self._tasks, []
        for task in tasks:
            self._bus.cancel(task)

    def answered(self) -> None:
        """Note that the drive responds; write what could not be written before."""
        if self._waits_for_answer:
            self._waits_for_answer = False
            self._bus.request(self._slot)

    def least_since(self, at: float, *, reverse: bool) -> float:
        """
        Return the lowest set-point that the drive can have had since then, in one direction.

        :param at: s of the clock of the bus; longer ago than 10 s is not known.
        """
        return min(
            (max(0.0, -value if reverse else value) for value, until in self._had if until >= at),
            default=0.0,
        )

    def range_since(self, at: float) -> tuple[float, float]:
        """Return the least and the greatest set-point that the drive can have had since then."""
        values = [value for value, until in self._had if until >= at]
        return min(values, default=0.0), max(values, default=0.0)

    def write_again(self) -> None:
        """Write the set-point again, for the drive may have another one."""
        self._written = {
            where: (data, since if self._is_once(where) else -math.inf)
            for where, (data, since) in self._written.items()
        }
        self._bus.request(self._slot)

    def _may_have(self, value: float) -> None:
        """Note that the drive may have a set-point from now on; NaN: it is not known which."""
        self._state.measurements.direction.command(value)
        value = 0.0 if math.isnan(value) else value
        oldest = self._bus.now() - _REMEMBERED
        self._had = [(had, until) for had, until in self._had if until >= oldest]
        if (value, math.inf) not in self._had:
            self._had.append((value, math.inf))

    def _has(self, value: float) -> None:
        """Note that the drive has a set-point, and none of the others any more."""
        self.commanded = value
        self._may_have(value)
        now = self._bus.now()
        self._had = [
            (had, until if had == value else min(until, now)) for had, until in self._had
        ]

    @property
    def _rewrite_period(self) -> float:
        """After how long an unchanged set-point is written again, s."""
        timeout = self._state.timeout.seconds
        return min(_REWRITE_PERIOD, timeout * _KEEP_ALIVE_SHARE) if timeout else _REWRITE_PERIOD

    def _is_old(self, at: float) -> bool:
        """Return whether a request has expired while it waited for the line."""
        timeout = self._state.settings.setpoint_timeout
        return bool(timeout) and self._bus.now() - at > timeout

    @property
    def _most(self) -> float:
        """
        The greatest set-point that it may be given, in either direction.

        More than nominal only where a setting says so: a value in the wrong unit, rpm for Hz, must
        not race the motor.
        """
        limits = self._limits
        own = max(limits.most, -limits.least)
        return min(own, self._state.settings.setpoint_max or limits.nominal)

    def _counts(self, request: Request) -> bool:
        """Return whether a request came after the drive was enabled, and is still fresh."""
        return request.at > self.following_since and not self._is_old(request.at)

    def _encoded(self, value: float, before: float) -> tuple[tuple[Address, bytes], ...]:
        """Return what is written, and where, for a set-point in place of the one before."""
        assert self._target is not None
        return tuple(map(self._params.target, self._target.writes(value, before)))

    def _due(self, value: float) -> list[tuple[Address, bytes]]:
        """Return the writes for a set-point: what the drive does not have, or not recently."""
        writes = self._encode(value, self._decoded(self._in_drive))
        return [(where, data) for where, data in writes if not self._is_current(where, data)]

    def _is_current(self, address: Address, data: bytes) -> bool:
        """Return whether the drive has the same there, and it need not be written again."""
        before, since = self._written.get(address, (b'', -math.inf))
        if data != before or since == -math.inf:
            return False
        if self._is_once(address) or self._bus.now() - since < self._rewrite_period:
            return True
        # one that is the command would start a motor that has stopped by itself
        status = self._state.status
        starts = self.is_command and self._wanted != 0
        return starts and status is not None and not status.driven

    def _is_once(self, address: Address) -> bool:
        """Return whether this address is written only once."""
        return self._target is not None and self._keys[address] in self._target.written_once

    def _limited(self, request: Request) -> float:
        limits, most = self._limits, self._most
        taken = max(limits.least, min(limits.most, request.value))
        # beyond what the drive takes, rather than beyond what the user allows
        return max(-most, min(most, taken))

    def _accept(self, request: Request, limited: float) -> None:
        """Note that a request counts, with its limited value."""
        self.clamped = limited != request.value
        self.ceased = self.expired = False
        if self.timed_out is not None:
            self.timed_out = None
            self._state.notify(Severity.INFO, Cause.SETPOINTS_AGAIN)

    def _make(self) -> Written | None:
        request = self._request
        if self._target is None or not self._counts(request):
            return None
        limited = self._limited(request)
        due_at = self._due_at(request)
        self._want(limited, due_at)
        unanswered = not self._state.contact.responsive and limited == self._unanswered
        if unanswered or not self._state.contact.is_recognised:
            self._waits_for_answer = True
            if limited == 0:
                self._note_waiting(limited, due_at)
            return None
        self._accept(request, limited)
        if self.clamped and not self._clamp_reported:
            self._report_limited(request.value, limited)
        self._clamp_reported = self.clamped
        due = self._due(limited)
        if not due:
            self._in_vain.clear()
            return None
        # each of several writes has its own turn, and a newer set-point may come between
        address, data = due[0]
        self._sent = limited
        self._sent_due = self._due_since(address, data, due_at) if limited == 0 else self._bus.now()
        self._may_have(self._decoded({**self._in_drive, address: data}))
        by_itself = len(due) > 1 or self._is_once(address)
        return Write(address, data) if by_itself else self._params.with_status(address, data)

    def _due_since(self, address: Address, data: bytes, at: float) -> float:
        """Return since when a write is due, s; one that the drive has is only repeated, now."""
        return self._bus.now() if self._written.get(address, (b'',))[0] == data else at

    def _want(self, value: float, at: float) -> None:
        """Note what is wanted from a moment on, s."""
        before, self._wanted = self._wanted, value
        if sign(value) != sign(before):
            self.turn = Turn(at, before, value)

    def _due_at(self, request: Request) -> float:
        """Return since when a request is to be carried out, s."""
        return max(request.since, self.following_since)

    def _note_waiting(self, value: float, due_at: float) -> None:
        """Note what waits to be sent, where others are in vain: 0 from when it is due, else now."""
        at = self._bus.now() if value else due_at
        for address, data in self._due(value):
            self._note_in_vain(address, value, self._due_since(address, data, at))

    def _note_in_vain(
        self, address: Address, value: float, since: float, tries: float = 0.0
    ) -> None:
        """Note that a set-point is not acknowledged; the first of several in a row counts."""
        before = self._in_vain.get(address, _InVain(value, since, 0))
        self._in_vain[address] = _InVain(value, before.since, before.tries + tries)

    def _report_limited(self, value: float, limited: float) -> None:
        chosen = self._state.settings.setpoint_max
        nominal = chosen == 0 and abs(limited) == self._limits.nominal
        self._state.notify(
            Severity.WARNING,
            Cause.SETPOINT_BEYOND_NOMINAL if nominal else Cause.SETPOINT_LIMITED,
            value=value,
            limited=limited,
            unit=self._state.unit,
        )

    def _done(self, written: Written, error: LinkError | None) -> None:
        if not self.following:
            return
        if isinstance(error, Refused):
            error = self._params.meant(error)
        if error is None or isinstance(error, AnotherValue):
            held = None if error is None else error.data
            self._take_note(written.address, written.data, held)
            if len(self._keys) > 1:
                self._bus.request(self._slot)
        elif isinstance(error, Refused) and not self._may_be_busy(error):
            asked = self._decoded({**self._in_drive, written.address: written.data})
            why = Report(Cause.SETPOINT_REFUSED, value=asked, error=str(error))
            self._state.hooks.setpoint_refused(why)
        elif isinstance(error, Interrupted):
            # no status is needed: the PLC has stopped the drive, and does not let it go on
            self._state.hooks.setpoint_refused(Report(Cause.LINE_FAILED, error=str(error)))
        else:
            self._missed(error, written.address)

    def _take_note(self, address: Address, data: bytes, held: bytes | None = None) -> None:
        """
        Note that a write was acknowledged.

        :param held: what the drive answers that it has, if that is another value.
        """
        self._busy_since = math.inf
        self._unanswered = NAN
        self._note_written(address, data, held)
        if len(self._written) == len(self._keys):
            self._has(self._decoded(self._in_drive))

    def _note_written(self, address: Address, data: bytes, held: bytes | None) -> None:
        self._in_vain.pop(address, None)
        self._written[address] = data, self._bus.now()
        if held is None:
            self._held.pop(address, None)
            return
        is_news = self._held.get(address) != held
        self._held[address] = held
        if is_news:
            asked, has = (
                self._decoded({**self._in_drive, address: value}) for value in (data, held)
            )
            self._state.notify(
                Severity.WARNING,
                Cause.SETPOINT_HELD,
                value=asked,
                held=has,
                unit=self._state.unit,
            )

    def _missed(self, error: LinkError, address: Address) -> None:
        """
        Note that the set-point in the drive is unknown.

        It is written again when the drive responds, and a newer one at once.

        :param address: of several, the only one where that is so: it has the old or the new.
        """
        # the poll finds out at once whether it responds, in the time that a silent drive may
        # take from its neighbours
        self._state.contact.count(error)
        if not isinstance(error, Refused):
            self._note_in_vain(address, self._sent, self._sent_due, _try(error))
        self._waits_for_answer = True
        self._unanswered = self._sent
        if len(self._keys) > 1 and address in self._written:
            # the motor goes on in its direction, and need not be stopped first
            self._written[address] = self._written[address][0], -math.inf
        else:
            self._written = {}
        self._state.missed()

    def _may_be_busy(self, error: Refused) -> bool:
        """Return whether a refusal only means that the drive is busy, and not for long yet."""
        if not error.is_busy:
            return False
        now = self._bus.now()
        self._busy_since = min(self._busy_since, now)
        return now < self._busy_since + _LONGEST_BUSY

    @property
    def _in_drive(self) -> dict[Address, bytes]:
        """The bytes that the drive has, as far as they are known."""
        return {
            address: self._held.get(address, data) for address, (data, _) in self._written.items()
        }

    def _decoded(self, data: Mapping[Address, bytes]) -> float:
        """Return the set-point that bytes mean to the drive, after its own rounding."""
        assert self._target is not None
        if len(data) < len(self._keys):
            return NAN
        keys = self._keys.items()
        value = self._params.value
        return self._target.value({key: value(key, data[address]) for address, key in keys})

    def _require_acknowledged(self) -> None:
        """
        Stop the motor where what it was to do is not acknowledged for ``lost_after``.

        A drive that answers nothing at all ought to be lost by then, for a better reason.
        """
        now, seconds = self._bus.now(), self._state.settings.lost_after
        contact = self._state.contact
        if self._slot.pending and self._counts(self._request):
            self._note_waiting(self._limited(self._request), self._due_at(self._request))
        is_held = not contact.is_recognised
        for failed in self._in_vain.values():
            silent = contact.is_silent_since(failed.since)
            least = _TRIES if failed.value else _TRIES_OF_0
            tried = is_held or max(failed.tries, self._bus.writes_in_vain) >= least
            if not tried and failed.tries <= (1 if failed.value else 0):
                # on a slow line it waits for its turn, or one try was lost in noise; so long
                rounds = _ROUNDS * self._bus.round_time()
                if now < failed.since + seconds + max(_TURNS_WITHIN, rounds):
                    continue
            # after that long it does not matter how often there was time to try it again
            longer = _LOST_WITHIN if silent or not tried else 0.0
            if failed.since + seconds + longer <= now:
                why = Report(
                    Cause.SETPOINT_UNACKNOWLEDGED, value=failed.value, seconds=now - failed.since
                )
                self._state.hooks.setpoint_refused(why)
                return

    async def _watch_acknowledgement(self) -> None:
        try:
            while True:
                await self._bus.sleep(_ACKNOWLEDGED_PERIOD)
                self._require_acknowledged()
        except Exception as error:
            # what is not watched must not be followed
            self._state.hooks.setpoint_refused(Report(Cause.DRIVER_ERROR, error=repr(error)))

    async def _watch_age(self) -> None:
        try:
            while True:
                timeout = self._state.settings.setpoint_timeout
                last = max(self._request.at, self.following_since)
                left = last + timeout - self._bus.now() if timeout else math.inf
                if left > 0 or self.expired:
                    await self._bus.sleep(min(left, _WATCH_PERIOD) if left > 0 else _WATCH_PERIOD)
                else:
                    await self._expire(timeout)
        except Exception as error:
            # a set-point without a time-out must not be followed
            self._state.hooks.setpoint_refused(Report(Cause.DRIVER_ERROR, error=repr(error)))

    async def _expire(self, timeout: float) -> None:
        assert self._target is not None
        zero = self._target.writes(0.0, self._decoded(self._in_drive))
        # what is not acknowledged the drive may have taken all the same
        if self._in_vain or self._in_drive != dict(map(self._params.target, zero)):
            before = self._request
            due_at = max(before.at, self.following_since) + timeout
            self._want(0.0, due_at)
            self.ceased = True
            for step in zero:
                if self._request is not before:
                    # that one is written instead
                    return
                self._may_have(0.0)
                address, data = self._params.target(step)
                if self._is_once(address) and self._is_current(address, data):
                    continue
                self._note_in_vain(address, 0.0, due_at)
                try:
                    has = await self._params.write(replace(step, retry=False), Priority.STOP)
                except (LinkError, DriveError) as error:
                    if isinstance(error, Refused) and not self._may_be_busy(error):
                        why = Report(Cause.SETPOINT_REFUSED, value=0.0, error=str(error))
                        self._state.hooks.setpoint_refused(why)
                        return
                    # the poll finds out whether the drive is lost; until then this is tried again
                    if not isinstance(error, Refused):
                        self._note_in_vain(address, 0.0, due_at, _try(error))
                    await self._bus.sleep(_WATCH_PERIOD)
                    return
                self._note_written(address, data, None if has == data else has)
                self._busy_since = math.inf
            if self._request is before:
                self._has(self._decoded(self._in_drive))
                self.timed_out = Report(Cause.SETPOINT_TIMED_OUT, timeout=timeout)
                self._state.notify(Severity.WARNING, self.timed_out)
        self.ceased = self.expired = True


def sign(value: float) -> int:
    """Return 1, -1, or 0 for 0."""
    return (value > 0) - (value < 0)


def _try(error: LinkError | DriveError) -> float:
    """Return what a write counts as that failed."""
    return 0.5 if isinstance(error, DamagedAnswer) else 1.0
