# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What has happened to a drive and its driver, as far as the laws in ``any_order_laws.py`` need it.

From what the test tells, and from what the simulated drive and its line show by themselves; what
the driver says is not asked for, but whether it is connected. Times are those of the virtual clock.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import dataclass
import itertools
import math
from typing import Any

from any_order_shown import shown_by
from support.rig import Rig

#: How the driver is set.
POLL_RATE = 5.0
SETPOINT_TIMEOUT = 1.0
SHUTDOWN_TIMEOUT = 1.0
#: How much longer everything may take while answers are spoiled by chance, s.
NOISY = 2.0
#: A stop that a fault keeps a drive from taking is not repeated within this, s.
REFUSED = 0.3
#: For how long a line is known as one where answers come twice, s, and how much longer eight
#: requests take there, in ASCII, too.
_TWICE_FOR, _LATER_BY = 60.0, 0.2

#: Reads that acknowledge a fault.
ACKNOWLEDGING_READS = ('fieldbus.inv_st_with_ack', 'fieldbus.sio_err')

#: Commands that end a run.
STOPS = ('stop', 'quick_stop', 'deactivate', 'disconnect', 'stop_for_good')
#: Commands that may turn the motor.
_TURN = ('enable', 'tune')


@dataclass
class Command:
    """A command that is on its way."""

    name: str
    future: Future[Any]
    at: float
    #: How much had been asked by then.
    asked: int
    #: The line was whole and the drive known when it was given, and has been since.
    undisturbed: bool
    #: A stop was on its way when it was given.
    overruled: bool
    #: It stops, and there was nothing to stop: neither a run command nor one on its way.
    idle: bool


class History:
    """Keeps what has happened to a rig, and whether a client may want the motor to run since."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._far = rig.far
        self.shown = shown_by(rig)
        self.times = self.shown.times
        self._method = rig.drive.settings.method
        self._follows = rig.drive.settings.reference == 'fieldbus'
        self._commands: list[Command] = []
        #: It was enabled, and nothing has happened since that ends that.
        self.enabled_at: float | None = None
        #: When what made it stop happened last, and from when on it may not run.
        self.lost_at = self._no_run_from = rig.clock.now
        self._setpoint: tuple[float, float] = (-math.inf, 0.0)
        #: Since when the newest set-point has been what it is, and that.
        self.setpoint_since: tuple[float, float] = (-math.inf, 0.0)
        #: This driver may have started the motor.
        self._ours = False
        #: A run command stood in the drive when it was looked at last.
        self._stood = False
        #: The run command that stands is another master's.
        self._foreign = False
        self.active = self.watched = False
        self._watched_at = self._active_at = self._commanded_at = rig.clock.now
        self._whole_since: float | None = rig.clock.now
        self._broken_since: float | None = None
        self.disturbed_at = rig.clock.now
        self._running_since: float | None = None
        self._conditions = tuple(self._present_conditions())
        #: When the last fault came, and when the run was enabled that ended by it alone, if the
        #: drive may end that fault by itself.
        self._faulted_at = -math.inf
        self._ended_by_fault: float | None = None
        #: The drive ends the fault that is active by itself; it has so ended the last one.
        self._ends_itself = self._ended_itself = False
        self._stop_due: int | None = None
        #: How much had been asked when keypad or terminals took the drive from the bus last.
        self._taken_away = -1
        #: When a stop was last written, taken or refused, and whether a fault was active.
        self._stop_tried_at = -math.inf
        self._tried_in_fault = False
        #: When the drive was last seen to tune.
        self._tuned_at = -math.inf

    # --- what the test tells ----------------------------------------------------------------------

    @property
    def now(self) -> float:
        return self._rig.clock.now

    def command(self, name: str, future: Future[Any]) -> None:
        """Record a command that was given."""
        undisturbed = self._steady
        waiting = [given for given in self._commands if not given.future.done()]
        stops = [given for given in waiting if given.name in STOPS and not given.idle]
        overruled = any(not self._may_be_confirmed(given) for given in stops)
        asked = len(self._rig.asked)
        turning = [given for given in waiting if given.name in _TURN] + stops
        idle = name in STOPS and not (self.enabled_at or self.standing or turning)
        command = Command(name, future, self.now, asked, undisturbed, overruled, idle)
        self._commands.append(command)
        if name == 'enable':
            if self.enabled_at is None and not overruled:
                self.enabled_at = self.now
            self._ours = True
        elif name == 'tune':
            self._ours = True
        elif name in STOPS:
            ours = self._steady and self.standing and not self._foreign
            if name != 'quick_stop' and ours and not self._refused_just_now:
                self._stop_due = len(self._rig.asked)
            self.lose(self.times.carried_out)
        elif name == 'acknowledge':
            self._rig.acknowledged += 1
        if name in ('deactivate', 'disconnect', 'stop_for_good'):
            self.active = False
        if name == 'disconnect':
            self.watched = False

    def _may_be_confirmed(self, stop: Command) -> bool:
        """Return whether the status was read since a stop was written that has no answer yet."""
        sent = ((key, data) for _, key, data in self._rig.asked[stop.asked :])
        after = itertools.dropwhile(lambda request: request[1] is None, sent)
        return any(map(self.shown.reads_status, after))

    @property
    def _refused_just_now(self) -> bool:
        """A fault has just kept the drive from taking a stop: none is due again so soon."""
        return self._tried_in_fault and self.now - self._stop_tried_at < REFUSED

    def connected(self) -> None:
        """Record that the driver looks after the drive from now on, or tries to."""
        if not self.watched:
            self.watched = True
            self._watched_at = self.now
            self._no_run_from = max(self._no_run_from, self.now + self.times.carried_out)

    def activated(self) -> None:
        """Record that it polls at full rate from now on."""
        self.active = True
        self._active_at = self.now

    def gave(self, value: float) -> None:
        """Record a set-point that was given."""
        if value != self._setpoint[1]:
            self.setpoint_since = self.now, value
        self._setpoint = self.now, value

    def lose(self, within: float) -> None:
        """Record something after which the motor may not turn, but for a moment yet."""
        self.enabled_at = None
        self._ended_by_fault = None
        self.lost_at = self.now
        later = NOISY if self._rig.line.noise else 0.0
        self._no_run_from = max(self._no_run_from, self.now + within + later)

    def disturbed(self) -> None:
        """Record that another master did something to the drive."""
        self.disturbed_at = self.now

    def spoiled(self) -> None:
        """Record that the request that is on its way may have to be sent again, and waits."""
        self._stop_due = None
        again = self.now + 2 * self.times.response_timeout
        self._no_run_from = max(self._no_run_from, again + self.times.carried_out)
        if self._whole_since is not None:
            self._whole_since = again
        for command in self._commands:
            command.undisturbed = False

    def started_by_another(self) -> None:
        """Record that another master has given a run command over the bus."""
        self.disturbed_at = self.now
        self._foreign = True

    def forgotten(self) -> None:
        """Record that the drive may have been made to forget its run command."""
        if not self.standing and not self.pending('enable'):
            self.lose(self.noticed)

    def control_mode_changed(self) -> None:
        """Record that the drive controls another quantity now."""
        self.disturbed_at = self.now
        if not self.pending('enable'):
            self.lose(self.noticed + self.shown.patience('control mode'))

    def killed(self) -> None:
        """Record that the driver is no more."""
        self._commands.clear()
        self.lose(0.0)
        self.active = self.watched = self._ours = False
        self._stop_due = None

    @property
    def enabling(self) -> bool:
        """It is enabled, or is about to be."""
        return self.pending('enable') or self.enabled_at is not None

    def pending(self, name: str) -> bool:
        """Return whether a command of this name is on its way."""
        return any(command.name == name for command in self._commands)

    @property
    def noticed(self) -> float:
        """Within which time something is noticed, s."""
        noticed = self.times.noticed if self.active else self.times.noticed_idle
        # after an answer that came twice each of two polls waits for more
        twice = self.now - self._rig.line.doubled_at < _TWICE_FOR
        return noticed + _LATER_BY if twice else noticed

    @property
    def settled_since(self) -> float:
        """Since when all that happens can be noticed; infinity if it cannot."""
        if self._whole_since is None or not self.watched or not self._connected:
            return math.inf
        return max(self._whole_since, self._watched_at)

    # --- what the simulated drive reports ---------------------------------------------------------

    @property
    def running(self) -> bool:
        """The drive carries out a run command that came over the bus."""
        return self.shown.running

    @property
    def standing(self) -> bool:
        """A run command that came over the bus stands in it, carried out or not."""
        return self.shown.standing

    @property
    def turning(self) -> bool:
        """It turns the motor, or is about to."""
        motor = self._far.motor
        return self.running and motor.driven and abs(motor.demand) > 1e-6

    def _present_conditions(self) -> Iterator[bool]:
        """Return what has to stay as it is for the motor to run on."""
        yield not self._far.faults
        yield self.shown.by_bus
        yield self.shown.may_run
        yield self._far.control_unit.initialised

    @property
    def _connected(self) -> bool:
        snapshot = self._rig.notes.snapshot
        return snapshot is not None and snapshot.connected

    @property
    def _steady(self) -> bool:
        return self.now - self.settled_since > self.noticed

    # --- what is seen -----------------------------------------------------------------------------

    def _watch_line(self) -> None:
        if self._rig.line.passes and self._rig.line.noise and self._far.listening:
            self._watch_noise()
            return
        if self._rig.line.whole and self._far.listening:
            if self._whole_since is None:
                self._whole_since = self.now
                self._broken_since = None
                back = self.times.found if not self._ours else self.times.taken_back
                self._no_run_from = max(self._no_run_from, self.now + back)
            return
        self._whole_since = self._stop_due = None
        for command in self._commands:
            command.undisturbed = False
        if self._broken_since is None:
            self._broken_since = self.now
        lost = self.times.lost if self.active else self.times.lost_idle
        for_good = self.now - self._broken_since > lost and not self._rig.line.losses
        if for_good and (self.enabled_at is not None or self._ended_by_fault is not None):
            self.lose(self.times.taken_back)
        # nothing can stop it now
        self._no_run_from = max(self._no_run_from, self.now + self.times.taken_back)

    def _watch_noise(self) -> None:
        """Ask nothing to be prompt while answers are spoiled by chance; but all to be done."""
        if self._broken_since is not None:
            back = self.times.found if not self._ours else self.times.taken_back
            self._no_run_from = max(self._no_run_from, self.now + back + NOISY)
        elif self._whole_since is not None and self._no_run_from > self.now:
            # it has come back only just
            self._no_run_from += NOISY
        self._whole_since = self._broken_since = self._stop_due = None
        for command in self._commands:
            command.undisturbed = False

    def _watch_conditions(self) -> None:
        conditions = tuple(self._present_conditions())
        if not conditions[0]:
            self._ends_itself, self._ended_itself = self.shown.restarts_itself, False
        if conditions == self._conditions:
            return
        ended = [was and not now for was, now in zip(self._conditions, conditions, strict=True)]
        if conditions[0] and not self._conditions[0]:
            self._ended_itself = self._ends_itself and not self._acknowledging
            self._forgive_fault()
        self._conditions = conditions
        enabled_at = self.enabled_at
        # what happens before the run command is given does not end an enabling, and what another
        # master gave is none; nor does a RUN input that is lost, for a G2 does not tell it from a
        # start that is yet to come
        given = self._stood and not self._foreign
        unmoved = not given or ended == [False, False, True, False]
        if any(ended) and not (unmoved and self.pending('enable')):
            self._taken_away = len(self._rig.asked) if ended[1] and sum(ended) == 1 else -1
            self.lose(self.noticed + (self.times.control_reported if ended[1] else 0.0))
        if ended[0]:
            self._faulted_at = self.now
            by_itself = all(map(self.shown.has_tries, self._far.faults.codes))
            self._ended_by_fault = enabled_at if by_itself and sum(ended) == 1 else None

    @property
    def _acknowledging(self) -> bool:
        """The last request may have ended a fault."""
        _, key, data = self._rig.asked[-1]
        if data is None:
            return key in ACKNOWLEDGING_READS
        return not self.shown.stops(key, self._rig.number(data))

    def _forgive_fault(self) -> None:
        """Let a run go on whose fault came, and ended by itself, before it had to be noticed."""
        due = max(self.settled_since, self._faulted_at) + self.noticed
        if self._ended_by_fault is not None and self.now < due:
            self.enabled_at = self._ended_by_fault
