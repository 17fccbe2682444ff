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
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.snapshot import NAN
from nfo_sinus_driver.link import (
    Address,
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
#: The age is checked at least this often, so that a changed time-out takes effect, s.
_WATCH_PERIOD = 0.25
#: How long the set-points that the drive had are remembered, s.
_REMEMBERED = 10.0


class Request(NamedTuple):
    """
    A requested set-point.

    :ivar value: in the unit of the control mode.
    :ivar at: when it came in, s of the clock of the bus.
    """

    value: float
    at: float


_NONE = Request(NAN, -math.inf)


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
        self._age_task: Task | None = None
        #: No set-point has come within ``setpoint_timeout``: the drive was given 0.
        self.expired = False
        #: The report of the set-point time-out, until set-points arrive again.
        self.timed_out: Report | None = None
        self._waits_for_answer = False
        #: What was written last, and what of that was not answered; NaN: nothing.
        self._sent = self._unanswered = NAN
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
        self._request = Request(value, self._bus.now())
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
        self._keys, self._written = {}, {}
        self._encode.cache_clear()
        if target is not None:
            for step in target.writes(0.0):
                address, data = self._params.target(step)
                self._keys[address] = step.key
                self._written[address] = data, self.following_since
        self.commanded = 0.0 if follows else NAN
        self._state.direction.command(self.commanded)
        self._had = [(0.0, math.inf)]
        self.clamped = self._clamp_reported = False
        self.expired = False
        self.timed_out = None
        self._waits_for_answer = False
        self._unanswered = NAN
        self._busy_since = math.inf
        if follows:
            self._age_task = self._bus.spawn(self._watch_age())

    def stop_following(self) -> None:
        """Follow no more set-points."""
        self.following_since = math.inf
        self.commanded = NAN
        self._state.direction.command(NAN)
        self.clamped = False
        if self._age_task is not None:
            self._bus.cancel(self._age_task)
        self._age_task = None

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
        self._state.direction.command(value)
        value = 0.0 if math.isnan(value) else value
        oldest = self._bus.now() - _REMEMBERED
        self._had = [one for one in self._had if one[1] >= oldest]
        if (value, math.inf) not in self._had:
            self._had.append((value, math.inf))

    def _has(self, value: float) -> None:
        """Note that the drive has a set-point, and none of the others any more."""
        self.commanded = value
        self._may_have(value)
        now = self._bus.now()
        self._had = [
            (one, until if one == value else min(until, now)) for one, until in self._had
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

    def _due(self, request: Request) -> list[tuple[Address, bytes]]:
        """Return the writes for a request: what the drive does not have, or not recently."""
        assert self._target is not None
        found: list[tuple[Address, bytes]] = []
        before_all = self._decoded(self._in_drive)
        for address, data in self._encode(self._limited(request), before_all):
            if not self._is_current(address, data):
                found.append((address, data))
        return found

    def _is_current(self, address: Address, data: bytes) -> bool:
        """Return whether the drive has the same there, and it need not be written again."""
        before, since = self._written.get(address, (b'', -math.inf))
        if data != before or since == -math.inf:
            return False
        return self._is_once(address) or self._bus.now() - since < self._rewrite_period

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
        self.expired = False
        if self.timed_out is not None:
            self.timed_out = None
            self._state.notify(Severity.INFO, Cause.SETPOINTS_AGAIN)

    def _make(self) -> Written | None:
        request = self._request
        if self._target is None or not self._counts(request):
            return None
        limited = self._limited(request)
        unanswered = not self._state.responsive and limited == self._unanswered
        if unanswered or not self._params.recognition.holds:
            self._waits_for_answer = True
            return None
        self._accept(request, limited)
        if self.clamped and not self._clamp_reported:
            self._report_limited(request.value, limited)
        self._clamp_reported = self.clamped
        due = self._due(request)
        if not due:
            return None
        # each of several writes has its own turn, and a newer set-point may come between
        address, data = due[0]
        self._sent = limited
        self._may_have(self._decoded({**self._in_drive, address: data}))
        by_itself = len(due) > 1 or self._is_once(address)
        return Write(address, data) if by_itself else self._params.with_status(address, data)

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
        if error is None:
            self._take_note(written.address, written.data)
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

    def _take_note(self, address: Address, data: bytes) -> None:
        self._busy_since = math.inf
        self._unanswered = NAN
        self._written[address] = data, self._bus.now()
        if len(self._written) == len(self._keys):
            self._has(self._decoded(self._in_drive))

    def _missed(self, error: LinkError, address: Address) -> None:
        """
        Note that the set-point in the drive is unknown.

        It is written again when the drive responds, and a newer one at once.

        :param address: of several, the only one where that is so: it has the old or the new.
        """
        # the poll finds out at once whether it responds, in the time that a silent drive may
        # take from its neighbours
        self._params.count(error)
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
        if error.code != Refused.BUSY:
            return False
        now = self._bus.now()
        self._busy_since = min(self._busy_since, now)
        return now < self._busy_since + _LONGEST_BUSY

    @property
    def _in_drive(self) -> dict[Address, bytes]:
        """The bytes that the drive has, as far as they are known."""
        return {address: data for address, (data, _) in self._written.items()}

    def _decoded(self, data: Mapping[Address, bytes]) -> float:
        """Return the set-point that bytes mean to the drive, after its own rounding."""
        assert self._target is not None
        if len(data) < len(self._keys):
            return NAN
        keys = self._keys.items()
        value = self._params.value
        return self._target.value({key: value(key, data[address]) for address, key in keys})

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
        if self._in_drive != dict(map(self._params.target, zero)):
            if self.timed_out is None:
                self.timed_out = Report(Cause.SETPOINT_TIMED_OUT, timeout=timeout)
                self._state.notify(Severity.WARNING, self.timed_out)
            before = self._request
            for step in zero:
                if self._request is not before:
                    # that one is written instead
                    return
                self._may_have(0.0)
                address, data = self._params.target(step)
                if self._is_once(address) and self._is_current(address, data):
                    continue
                try:
                    await self._params.write(replace(step, retry=False), Priority.STOP)
                except (LinkError, DriveError) as error:
                    if isinstance(error, Refused) and not self._may_be_busy(error):
                        why = Report(Cause.SETPOINT_REFUSED, value=0.0, error=str(error))
                        self._state.hooks.setpoint_refused(why)
                        return
                    # the poll finds out whether the drive is lost; until then this is tried again
                    await self._bus.sleep(_WATCH_PERIOD)
                    return
                self._written[address] = data, self._bus.now()
                self._busy_since = math.inf
            if self._request is before:
                self._has(0.0)
        self.expired = True
