# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What must hold of a drive and its driver whatever happens, judged by the simulated drive alone.

Written from the manuals and the laws of the house, not from the driver: nothing here is imported
from it but what it publishes. What they are judged by is in ``any_order_history.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
import math
from typing import Any

from any_order_history import SETPOINT_TIMEOUT, STOPS, Command, History
from any_order_shown import CONTROL
from support.rig import Rig

from nfo_sinus_driver.catalog import Fact, InverterStatus
from nfo_sinus_driver.drive import Cause, DriveError, Severity, Snapshot

#: Within this it is said that a motor cannot be stopped, s.
SAID = 5.0
#: No command keeps a client waiting longer, s.
LONGEST_COMMAND = 12.0

#: For so many transactions a motor may have current that an acknowledgement has let go.
POWERED = 2
#: How often is looked while nothing happens, s.
_LOOKS = 0.004


class Broken(AssertionError):
    """A law is broken."""


@dataclass
class Compared:
    """What was true and what was reported, what of it differed, and when it was looked at last."""

    truth: dict[str, Any]
    reported: dict[str, Any]
    differing: list[str]
    at: float = -math.inf


class Laws(History):
    """Watches a rig; raises :class:`Broken` as soon as a law is."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        rig.looked, rig.meet, rig.line.passed = self.look, self._meet, self._passed
        self._asked_at = self.now
        self._looked: object = None
        self._looked_at = self.now
        self._truth: dict[str, tuple[Any, float]] = {}
        self._seen: dict[str, Any] = {}
        #: When what is reported of a fact was right last, if it is wrong now.
        self._agreed_at: dict[str, float] = {}
        self._compared = Compared({}, {}, [])
        self._last: Snapshot | None = None
        #: When it was last shown as not enabled.
        self._not_enabled_at = -math.inf
        self._last_reported: dict[str, Any] = {}
        #: When a motor that another master runs stood last, for it has no set-point.
        self._idle_at = -math.inf
        #: How much had been asked when an acknowledgement let the motor go.
        self._turned_from: int | None = None

    def killed(self) -> None:
        super().killed()
        self._truth.clear()
        self._seen = {}
        self._agreed_at.clear()
        self._compared = Compared({}, {}, [])

    def _passed(self) -> None:
        """Look, unless a moment has passed in which nothing was sent or published."""
        notes = self._rig.notes
        seen = len(self._rig.line.frames), id(notes.snapshot), len(notes.events)
        if self._looked != seen or self.now - self._looked_at >= _LOOKS:
            self._looked, self._looked_at = seen, self.now
            self._rig.judge(self.look)

    # --- the laws ---------------------------------------------------------------------------------

    def look(self) -> None:
        """Judge the present moment."""
        self._watch_line()
        self._watch_conditions()
        self._judge_running()
        self._judge_acknowledged()
        self._judge_commands()
        self._judge_status()
        self._judge_silence()

    def _judge_running(self) -> None:
        running = self.running
        if not running:
            self._running_since = None
        elif self._running_since is None:
            self._running_since = self.now
        standing = self._stood = self.standing
        if not self.watched or self._method == 'monitor':
            return
        self._foreign = self._foreign and standing
        if (self.shown.refuses_stop and self._far.faults) or self.shown.hides_stop:
            # it refuses the stop or does not show its own, so that it may go on until that is over
            self._no_run_from = max(self._no_run_from, self.now + self.noticed)
        if (standing or running) and self.enabled_at is None:
            self._judge_standing()
        if self._follows and self.turning and self.enabled_at is not None:
            self._judge_setpoint(self.enabled_at)

    def _judge_acknowledged(self) -> None:
        """
        No motor turns by an acknowledgement [C98].

        But on a drive that refuses every command while a fault is active, until it has heard the
        stop that follows at once.
        """
        acknowledging = [command for command in self._commands if command.name == 'acknowledge']
        begun = min((command.at for command in acknowledging), default=math.inf)
        # one that ran before had no fault to acknowledge
        started = self._running_since is not None and self._running_since > begun
        by_us = started and self.disturbed_at < begun and self.enabled_at is None
        by_itself = self.shown.restarts_itself or self._ended_itself
        by_itself |= self._ended_by_fault is not None
        if not (by_us and self.running and self._far.motor.driven) or by_itself or self._foreign:
            self._turned_from = None
            return
        asked = len(self._rig.asked)
        if self._turned_from is None:
            self._turned_from = asked
        if self._whole_since is None or self._whole_since > begun:
            return
        if not self.shown.powered_by_acknowledgement:
            if self.turning:
                raise Broken('an acknowledgement turns the motor')
        elif asked > self._turned_from + POWERED:
            raise Broken(f'an acknowledgement turns the motor for {POWERED} transactions')

    def _judge_standing(self) -> None:
        """A run command of a past run is removed; one of another master when it is noticed."""
        if self._foreign:
            since = self.now if self._running_since is None else self._running_since
            # a drive that is not connected is not watched
            if not self._connected:
                self._no_run_from = max(self._no_run_from, self.now + self.noticed)
            late = since + self.noticed
            if not self.turning:
                self._idle_at = self.now
            # a motor that stands may stand on its way to a stop, by what the drive shows
            idle = max(late, self._idle_at + self.noticed)
            late = max(self._no_run_from, min(idle, late + self.shown.patience('standstill')))
        else:
            late = self._no_run_from
        if self.now > late:
            raise Broken(f'a run command stands that is not wanted since {self.lost_at:.3f}')
        self._require_word_of_it()

    def _judge_setpoint(self, enabled_at: float) -> None:
        late = max(self._no_run_from, enabled_at + self.noticed if self._foreign else 0.0)
        if self.now <= late:
            return
        at = self._setpoint[0]
        if at <= enabled_at:
            raise Broken('it turns although no set-point came since it was enabled')
        whole_since = self._whole_since
        if whole_since is None:
            return
        late = max(at + SETPOINT_TIMEOUT, whole_since + 2 * self.times.response_timeout)
        late += self.times.noticed
        if self.now > late:
            raise Broken(f'it turns by a set-point from {at:.3f} at {self.now:.3f}')

    def _require_word_of_it(self) -> None:
        """A motor that runs and cannot be stopped is loudly said to."""
        # what another master has started may never have been seen
        if not self._ours or self._running_since is None or self._foreign:
            return
        since = max(self._running_since, self.lost_at)
        # the line that is lost was broken before
        from_when = since if self._broken_since is None else min(since, self._broken_since)
        if self.now > since + SAID and not self._said(from_when, Cause.CANNOT_STOP):
            raise Broken(f'it runs since {since:.3f}, with no message that it cannot be stopped')

    def _said(self, since: float, what: Cause) -> bool:
        return any(
            at >= since and severity is Severity.ERROR and what in text.causes
            for at, severity, text in self._rig.notes.events
        )

    def _judge_commands(self) -> None:
        if self._commands:
            self._commanded_at = self.now
        if self.shown.tuning:
            self._tuned_at = self.now
        for command in tuple(self._commands):
            if command.future.done():
                self._commands.remove(command)
                self._judge_answer(command)
            elif self.now > command.at + LONGEST_COMMAND:
                raise Broken(f'{command.name} is never answered')

    def _judge_answer(self, command: Command) -> None:
        error = command.future.exception()
        if error is not None and not isinstance(error, DriveError):
            raise Broken(f'{command.name} raised {error!r}')
        if command.name == 'enable':
            self._judge_enabled(command, error)
        elif command.name in STOPS and self._method != 'monitor':
            # what another master starts while the drive is lost is seen once it is found again
            since = max(self.disturbed_at, self.settled_since if self._foreign else -math.inf)
            untouched = since + self.times.noticed_idle < command.at and self.enabled_at is None
            if error is None and untouched and self.running:
                raise Broken(f'{command.name} is answered although it runs')
            if error is None and self.shown.tuning:
                raise Broken(f'{command.name} is answered although it tunes')
            # a tuning that has just ended may have refused what came before its end
            tuned = self._tuned_at >= command.at
            local = not self.shown.by_bus or bool(self._far.faults) or tuned
            if error is not None and untouched and command.undisturbed and not local:
                raise Broken(f'{command.name} failed for no reason: {error}')

    def _judge_enabled(self, command: Command, error: BaseException | None) -> None:
        if error is None and command.overruled:
            raise Broken('an enable that came while a stop was on its way is not refused')
        if error is None:
            return
        ours = self.enabled_at is not None and self.enabled_at <= command.at
        if ours and not self.pending('enable'):
            self.lose(self.times.carried_out)

    def _judge_silence(self) -> None:
        """Keep the drive's own time-out from striking."""
        sio_tot = self._rig.drive.settings.wanted_drive_timeout
        if not sio_tot or not self._steady or not self._connected:
            return
        if self.now - self._asked_at > sio_tot / 2:
            raise Broken('the bus was silent for longer than half the time-out of the drive')

    # --- what is written --------------------------------------------------------------------------

    def _meet(self, key: str, data: bytes | None) -> None:
        self._asked_at = self.now
        if data is not None:
            number = self._rig.number(data)
            self._rig.judge(lambda: self._wrote(key, number))

    def _wrote(self, key: str, number: int) -> None:
        if self._method == 'monitor':
            raise Broken(f'monitor wrote {key}')
        for complaint in self.shown.wrong(key, number):
            raise Broken(complaint)
        stops = self.shown.stops(key, number)
        # the run command of DriveControl takes control, too: from a STOP that it crosses on its way
        crossed = self._taken_away == len(self._rig.asked) - 1
        if crossed and key == CONTROL and not stops:
            enables = (command.at for command in self._commands if command.name == 'enable')
            self.enabled_at = next(enables, None)
        # stops go ahead of everything but what each has to read itself
        due = self._stop_due
        lead = self.shown.lead * max(1, sum(command.name in STOPS for command in self._commands))
        if stops:
            self._stop_due = None
            self._stop_tried_at, self._tried_in_fault = self.now, bool(self._far.faults)
        before = 0 if due is None else len(self._rig.asked) - 1 - due
        if before > lead:
            raise Broken(f'{before} transactions went ahead of a stop')

    # --- what is reported -------------------------------------------------------------------------

    @staticmethod
    def _reported(snapshot: Snapshot) -> dict[str, Any]:
        """Return what the driver says of it."""
        seen = snapshot.status
        if seen is None:
            return {}
        return {
            'code': seen.code,
            'fault': snapshot.kind.value == 'fault',
            # a code alone may hide it
            'by bus': seen.from_bus if _tells_control(seen) else None,
            'running': seen.runs and seen.from_bus,
            'limit': _has(seen, 'LIMIT_ACTIVE'),
            'run input missing': _has(seen, 'RUN_INPUT_MISSING'),
            'sleeping': _has(seen, 'SLEEPING'),
            'control mode': snapshot.control_mode,
            'frequency': snapshot.frequency,
        }

    def _judge_status(self) -> None:
        truth = self.shown.facts()
        if truth != self._seen:
            self._seen = truth
            for name, value in truth.items():
                if name not in self._truth or self._truth[name][0] != value:
                    self._truth[name] = value, self.now
        snapshot = self._rig.notes.snapshot
        if not self.watched or snapshot is None:
            return
        self._judge_connected(snapshot)
        if not snapshot.connected:
            return
        if snapshot is not self._last:
            self._last, self._last_reported = snapshot, self._reported(snapshot)
        known_since = max(self.settled_since, self._active_at)
        if self.shown.polls_wait:
            known_since = max(known_since, self._commanded_at)
        for name in self._differing(truth, self._last_reported):
            value, since = self._truth[name]
            patience = self.noticed + self.shown.patience(name)
            agreed_at = self._agreed_at.get(name, known_since)
            if self.now - max(since, known_since, agreed_at) > patience:
                reported = self._last_reported[name]
                raise Broken(f'{name} is reported as {reported}, and it is {value}')
        if not snapshot.enabled:
            self._not_enabled_at = self.now
        running, since = self._truth['running']
        late = self.noticed + self.shown.patience('running')
        long_since = self.now - max(since, known_since, self._not_enabled_at) > late
        if snapshot.enabled and running is False and long_since:
            raise Broken('it is reported as enabled, and it does not run')

    def _differing(self, truth: dict[str, Any], reported: dict[str, Any]) -> list[str]:
        """Return what is reported otherwise than it is; note until when the rest was right."""
        before = self._compared
        if before.truth != truth or before.reported is not reported:
            for name in before.truth:
                if name not in before.differing:
                    self._agreed_at[name] = before.at
            differing = [name for name, value in truth.items() if not _agree(reported[name], value)]
            self._compared = before = Compared(truth, reported, differing)
        before.at = self.now
        return before.differing

    def _judge_connected(self, snapshot: Snapshot) -> None:
        if self._broken_since is not None and snapshot.connected:
            was_active = self.active and self._active_at < self._broken_since
            lost = self.times.lost if was_active else self.times.lost_idle
            # commands without a response go before the polls
            since = max(self._broken_since, self._commanded_at)
            if self.now - since > lost and not self._rig.line.losses:
                raise Broken('it is reported as connected, and it is not')
        if self._whole_since is None or snapshot.connected:
            return
        if self.now - max(self._whole_since, self._watched_at) > self.times.found:
            raise Broken('it is reported as not connected, and it is there')


def _tells_control(seen: InverterStatus) -> bool:
    return seen.word is not None or Fact.NETWORK_CONTROL in seen.valid


def _has(seen: Any, name: str) -> bool:
    """Return whether a status has a fact."""
    return bool(seen.facts & type(seen.facts)[name])


def _agree(reported: Any, value: Any) -> bool:
    """Return whether what is shown is true; of what is not known, ``None``, all is."""
    if value is None or reported is None:
        return True
    if isinstance(value, float):
        return bool(abs(reported - value) < 0.3)
    return bool(reported == value)

