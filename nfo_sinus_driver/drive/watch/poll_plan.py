# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
When a drive is polled next, what that does, and what it reads.

Nothing is read here: what is known of the drive decides.

===================  =============================================================================
the drive is lost    CONNECT, each second at first, then more seldom, for it costs its neighbours;
                     more often just before its own time-out would stop it
its stop is owed,    WAIT: it gets no request but that stop and the look before it
and it is not known
what is there
it is connected      POLL at the rate of the settings; between two polls STATUS alone: five times a
                     second while the motor runs, ten times where it would restart by itself
it is not active,    POLL each half second
it idles             at ``idle_poll_rate``; each 2 s while another drive is read for the first time
===================  =============================================================================
"""

from __future__ import annotations

import enum
from typing import NamedTuple

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.motion.controller import Controller
from nfo_sinus_driver.drive.motion.setpoint import Setpoint

#: How often a drive is polled while its node is not active, s.
_INACTIVE_PERIOD = 0.5
#: How often an idle one is polled at most while another one is read for the first time, s.
_YIELDING_PERIOD = 2.0
#: How often the control mode is read, and what scales set-points, while no motor at standstill may
#: start by one, s; and once in so many times what only scales measured values.
_MODE_PERIOD = 1.0
_ALL_SCALES = 10
#: How often the status is read at least while the motor runs, s; and of a drive that keeps its run
#: command without power: so two requests of the least time without it get no answer.
WATCH_PERIOD = 0.2
_RESTART_WATCH_PERIOD = 0.1
#: How often a drive that is lost is tried again, at first and at last, s.
_RECONNECT_PERIOD = 1.0
_SLOWEST_RECONNECT = 4.0
#: The bus is silent for no more than this share of the drive's own time-out.
_KEEP_ALIVE_SHARE = 1 / 3
#: How often the rest of a poll is read, s: the other one of frequency and speed, and an inverter
#: status that the status word gives no reason to read. All that the driver reacts to shows in
#: that word: fault, control lost, a stop, the current limit.
_SLOW_PERIOD = 0.1
#: On a full line, where each read waits for its turn, once in so many turns of this drive: so two
#: reads that every poll takes become 2.4 at most, with the control mode, which changes least.
_SLOW_TURNS = 15
_MODE_TURNS = 60


class Turn(enum.Enum):
    """What the next turn of the poller does."""

    WAIT = enum.auto()
    CONNECT = enum.auto()
    POLL = enum.auto()
    STATUS = enum.auto()


class Reads(NamedTuple):
    """
    What a poll reads beside the status.

    :ivar mode: the control mode, and what scales set-points.
    :ivar every_scale: what scales measured values, too.
    :ivar is_regular: it was due, and not only read because a motor at standstill may start.
    """

    mode: bool
    every_scale: bool
    is_regular: bool


class PollPlan:
    """
    The plan of one drive; used on the bus alone.

    :param controller: how it is commanded; ``None`` if this driver only reads.
    :ivar active: it is polled at full rate.
    """

    def __init__(
        self, state: DriveState, setpoint: Setpoint, controller: Controller | None
    ) -> None:
        self._bus = state.bus
        self._state = state
        self._contact = state.contact
        self._setpoint = setpoint
        self._controller = controller
        self.active = False
        #: How often in a row it could not be connected to.
        self._failed_reconnects = 0
        #: How long a value took that was measured last, s: long, where the line is full.
        self._turn = 0.0
        #: When was last read what changes rarely: control mode and scales; and how often it was.
        self._rare_read_at = 0.0
        self._rare_reads = 1

    # --- what the poller tells ----------------------------------------------------------------

    def set_active(self, active: bool) -> None:
        """Have it polled at full rate, or only so that the drive stays watched."""
        self.active = active

    def connected(self) -> None:
        """Note that the drive is connected, or was lost just now: it is tried again at once."""
        self._failed_reconnects = 0

    def connecting_failed(self) -> None:
        """Note that it could not be connected to."""
        self._failed_reconnects += 1

    def measured(self, seconds: float) -> None:
        """Note how long a value took, s."""
        self._turn = seconds

    def rare_read(self, at: float) -> None:
        """Note that what changes rarely was read, when it was due."""
        self._rare_read_at = at
        self._rare_reads += 1

    def read_rare_soon(self) -> None:
        """Have it read with the next poll: it may be another one now."""
        self._rare_read_at = float('-inf')

    # --- when, and what -----------------------------------------------------------------------

    def turn(self, polled_at: float) -> Turn:
        """
        Return what is done now.

        :param polled_at: when the last poll began, s.
        """
        if self._contact.connected:
            return Turn.POLL if self._bus.now() >= polled_at + self.period else Turn.STATUS
        return Turn.WAIT if self._waits_to_look else Turn.CONNECT

    def pause(self, polled_at: float) -> float:
        """Return how long to wait until the next turn, s."""
        state = self._state
        if self._waits_to_look:
            # as soon as it was seen the rest is read
            return WATCH_PERIOD
        if not self._contact.connected:
            # a drive that stays silent costs its neighbours less and less
            pause = min(_RECONNECT_PERIOD * self._failed_reconnects, _SLOWEST_RECONNECT)
            pause = state.pause_before_timeout(pause, state.timeout.seconds)
            # the life counter goes on, else the PLC takes the driver for dead
            return min(pause, self.period) if self._contact.behind_plc else pause
        pause = polled_at + self.period - self._bus.now()
        # however low the poll rate, a motor that runs is watched, and so is one whose run
        # command may still be active, for it would start when its fault ends
        if self._may_restart:
            return min(pause, _RESTART_WATCH_PERIOD)
        watched = state.control.stopping or self._setpoint.following
        return min(pause, WATCH_PERIOD) if watched else pause

    @property
    def priority(self) -> Priority:
        """The priority of what a poll reads."""
        urgent = self._may_restart and not self._contact.responsive
        return Priority.LOOK if urgent else Priority.POLL

    @property
    def period(self) -> float:
        """How often it is polled, s."""
        state, settings = self._state, self._state.settings
        rate = settings.poll_rate
        if settings.idle_poll_rate and self._is_idle:
            rate = settings.idle_poll_rate
        period = 1 / rate if rate else 0.0
        if not self.active:
            period = _INACTIVE_PERIOD
        if self.yields:
            period = max(period, _YIELDING_PERIOD)
        for timeout in (state.timeout.seconds, state.plc_time):
            if timeout:
                period = min(period, timeout * _KEEP_ALIVE_SHARE)
        return period

    @property
    def reads(self) -> Reads:
        """What a poll reads that begins now."""
        period = max(_MODE_PERIOD, _MODE_TURNS * self._turn)
        rare = self._bus.now() - self._rare_read_at > period
        measured = self._state.measurements
        # the mode can only change at standstill, and a motor there may start by the next set-point
        may_start = self._setpoint.following and 0 in (measured.frequency, measured.speed)
        every = rare and self._rare_reads % _ALL_SCALES == 0
        return Reads(mode=rare or may_start, every_scale=every, is_regular=rare)

    @property
    def slow_period(self) -> float:
        """How old the values may be that not every poll reads, s."""
        return max(_SLOW_PERIOD, _SLOW_TURNS * self._turn)

    @property
    def code_holds(self) -> float:
        """How long an inverter status counts while the status word stays the same, s."""
        control = self._state.control
        if control.stop_owed and not control.enabled:
            # the driver waits for the status to change
            return 0.0
        if self._contact.missed_since_poll:
            # it may have been switched off and on
            return 0.0
        return self.slow_period

    @property
    def yields(self) -> bool:
        """Whether it polls seldom while another drive's settings are first read."""
        return self._bus.reads_another_first(self._state.settings.address) and self._is_idle

    @property
    def _is_idle(self) -> bool:
        """The motor is at standstill, and nothing was begun that may change that."""
        status = self._state.status
        if self._state.control.stop_owed or status is None or status.driven:
            return False
        # a motor that coasts is not driven; what is not measured is NaN, and no greater than 0
        measured = self._state.measurements
        return not any(abs(value) > 0 for value in (measured.frequency, measured.speed))

    @property
    def _waits_to_look(self) -> bool:
        """It is lost, and gets no request but that of its stop."""
        waits = self._controller is not None and self._controller.waits_to_look
        return waits and not self._contact.behind_plc

    @property
    def _may_restart(self) -> bool:
        """After a moment without power the motor would run again, as if nothing had been."""
        return self._state.model.profile.may_run_again and self._setpoint.following
