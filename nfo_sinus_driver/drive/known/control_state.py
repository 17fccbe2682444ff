# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The states of control of one drive, and what leads from one to another.

This alone knows whether the motor may turn, and whether it is being stopped:
:mod:`..motion.controller` and :mod:`..motion.stopping` dispatch the events. ``docs/control.md`` has
the same table.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import enum
import math

from nfo_sinus_driver.drive.known.events import Report
from nfo_sinus_driver.drive.known.exclusive_access import ExclusiveAccess
from nfo_sinus_driver.drive.known.stop_reason import StopReason, reason_of
from nfo_sinus_driver.drive.known.transitions import read_table


class ControlState(enum.Enum):
    """What the driver is doing with the drive; the values describe it to users."""

    OFFLINE = 'the drive is not connected, and nothing has to be stopped'
    IDLE = 'connected; nothing was begun that could make the motor turn'
    ENABLING = 'an enable is on its way: control is taken, a run command may be active'
    ENABLED = 'the motor runs and follows set-points, or the reference of the drive'
    PROCEDURE = 'a procedure, such as tuning, has exclusive access to the drive'
    STOPPING = 'the run command is removed, again and again until the drive confirms that it stops'
    BLOCKED = 'a fault keeps the motor still, and the drive refuses the stop until it is over'


class ControlEvent(enum.Enum):
    """What can happen; the values describe it to users."""

    CONNECTED = 'the drive is connected'
    LOST = 'the drive is lost, or disconnected'
    ENABLE = 'a client enables the motor'
    REFUSED = 'an enable is refused before anything was written'
    RUNNING = 'the status shows that the motor runs, at set-point 0'
    STOP = 'a reason to stop: a service, a fault, a refusal, control lost, a failed enable …'
    STOPPED = 'the status confirms that the drive stops'
    FAULT_BLOCKS = 'the drive has a fault, stands, and refuses the stop'
    FAULT_OVER = 'it may take commands again'
    BEGIN = 'a procedure begins'
    END = 'a procedure has ended by itself'


#: Where each event leads from each state; with a dot it changes nothing, or is refused.
_TABLE = """
              OFFLINE   IDLE      ENABLING ENABLED  PROCEDURE STOPPING BLOCKED
CONNECTED     IDLE      .         .        .        .         .        .
LOST          .         OFFLINE   STOPPING STOPPING STOPPING  .        STOPPING
ENABLE        .         ENABLING  .        .        .         .        .
REFUSED       .         .         IDLE     .        .         .        .
RUNNING       .         .         ENABLED  .        .         .        .
STOP          STOPPING  STOPPING  STOPPING STOPPING STOPPING  .        .
STOPPED       .         .         .        .        .         IDLE     .
FAULT_BLOCKS  .         .         .        .        .         BLOCKED  .
FAULT_OVER    .         .         .        .        .         .        STOPPING
BEGIN         PROCEDURE PROCEDURE .        .        .         .        .
END           .         .         .        .        IDLE      .        .
"""

#: The same by state and event; what is missing changes nothing, or is refused.
TRANSITIONS = read_table(_TABLE, ControlState, ControlEvent)

#: Something that the driver has begun may drive the motor.
COMMANDED = frozenset((ControlState.ENABLING, ControlState.ENABLED, ControlState.PROCEDURE))
#: What leads there; refused whatever the state while the driver ends, or a procedure goes on.
_BEGINNINGS = frozenset((ControlEvent.ENABLE, ControlEvent.BEGIN))


class ControlTable:
    """
    The state of control of one drive.

    :param now: the clock of the bus.
    :ivar state: what the driver is doing with the drive.
    :ivar since: when the last event came, s: an earlier status says nothing of it.
    :ivar stopped_at: when a stop was confirmed last, s.
    :ivar closed_at: since when the driver ends, and nothing begins any more, s.
    :ivar access: of the procedure beside which nothing begins, also while it is ending.
    :ivar stopped_for: why the motor was stopped last; ``None`` before the first time.
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._on_change: Callable[[ControlState], None] = lambda before: None
        self._on_stop: Callable[[Report], None] = lambda why: None
        self.state = ControlState.OFFLINE
        self.since = 0.0
        self.stopped_at = -math.inf
        self.closed_at = math.inf
        self.access: ExclusiveAccess | None = None
        self.stopped_for: Report | None = None
        self._now = now

    def listen(
        self, on_change: Callable[[ControlState], None], on_stop: Callable[[Report], None]
    ) -> None:
        """
        Take what is called when the state changes.

        :param on_change: with the state before, after each transition to another one.
        :param on_stop: with the reason, when what may drive the motor is stopped.
        """
        self._on_change, self._on_stop = on_change, on_stop

    def close(self) -> None:
        """Let nothing begin any more: the driver ends."""
        self.closed_at = self._now()

    @contextlib.contextmanager
    def exclusive(self, what: str) -> Iterator[ExclusiveAccess]:
        """Give a procedure exclusive access; a stop ends it."""
        self.dispatch(ControlEvent.BEGIN)
        self.access = access = ExclusiveAccess(what)
        try:
            yield access
        finally:
            self.access = None
            self.dispatch(ControlEvent.END)

    def dispatch(self, event: ControlEvent, why: Report | None = None) -> None:
        """Go where an event leads; where that ends what may drive the motor, note why."""
        before = self.state
        if not self._forbids(event):
            self.state = TRANSITIONS.get((before, event), before)
        self.since = self._now()
        if event is ControlEvent.STOPPED:
            self.stopped_at = self.since
        if self.state is not before:
            self._note(before, why)
            self._on_change(before)

    def explain(self, why: Report) -> None:
        """Note a better reason for the stop in progress."""
        self.stopped_for = why

    def _note(self, before: ControlState, why: Report | None) -> None:
        """Note why the motor is stopped, if it was commanded or ran without an enable."""
        commanded = before in COMMANDED or reason_of(why) is StopReason.NOT_ENABLED
        if why is not None and commanded and self.state is ControlState.STOPPING:
            self.stopped_for = why
            self._on_stop(why)

    def accepts(self, event: ControlEvent) -> bool:
        """Whether an event leads to another state."""
        return (self.state, event) in TRANSITIONS and not self._forbids(event)

    def _forbids(self, event: ControlEvent) -> bool:
        return event in _BEGINNINGS and (self.closed or self.access is not None)

    @property
    def closed(self) -> bool:
        """The driver ends: the motor is stopped, and nothing can start it any more."""
        return self.closed_at < math.inf

    @property
    def procedure(self) -> str:
        """The procedure that goes on, also while it is ending; ``''``: none."""
        return '' if self.access is None else self.access.what

    @property
    def enabled(self) -> bool:
        """The motor follows set-points, or the reference of the drive."""
        return self.state is ControlState.ENABLED

    @property
    def commanded(self) -> bool:
        """Something that the driver has begun may drive the motor."""
        return self.state in COMMANDED

    @property
    def stop_owed(self) -> bool:
        """This driver may have run the motor, and has no confirmation that it stops."""
        return self.commanded or self.stopping

    @property
    def stopping(self) -> bool:
        """A stop is not confirmed yet."""
        return self.state is ControlState.STOPPING or self.blocked

    @property
    def blocked(self) -> bool:
        """A fault keeps the motor still, and the drive refuses the stop until it is over."""
        return self.state is ControlState.BLOCKED
