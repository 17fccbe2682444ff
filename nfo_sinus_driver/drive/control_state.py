# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The states of control of one drive, and what leads from one to another.

This is the one place that knows whether the motor may turn; :mod:`.controller` turns the table.
``docs/control.md`` has it as a table made from here.
"""

from __future__ import annotations

from collections.abc import Mapping
import enum


class ControlState(enum.Enum):
    """What the driver is doing with the drive; the values say it to people."""

    OFFLINE = 'the drive is not connected, and nothing has to be stopped'
    IDLE = 'connected; nothing was begun that could make the motor turn'
    ENABLING = 'an enable is on its way: control is taken, a run command may stand'
    ENABLED = 'the motor runs and follows set-points, or the reference of the drive'
    PROCEDURE = 'a procedure, such as tuning, has the drive to itself'
    ABORTING = 'a procedure was stopped and has not ended yet'
    STOPPING = 'the run command is removed, again and again until the drive says that it stops'
    BLOCKED = 'a fault keeps the motor still, and the drive from taking the stop until it is over'
    CLOSED = 'the driver is ending: the motor is stopped, and nothing can start it any more'


class ControlEvent(enum.Enum):
    """What can happen; the values say it to people."""

    CONNECTED = 'the drive is connected'
    LOST = 'the drive is lost, or left alone'
    ENABLE = 'somebody enables the motor'
    REFUSED = 'an enable is refused before anything was written'
    RUNNING = 'the status says that the motor runs, at set-point 0'
    STOP = 'a reason to stop: a service, a fault, a refusal, control lost, a failed enable …'
    STOPPED = 'the status confirms that the drive stops'
    FAULT_BLOCKS = 'the drive has a fault, stands, and refuses the stop'
    FAULT_OVER = 'it may take commands again'
    BEGIN = 'a procedure asks for the drive'
    END = 'the procedure has ended'
    CLOSE = 'the driver ends'


#: Where each event leads from each state; with a dot it changes nothing, or is refused.
_TABLE = """
              OFFLINE   IDLE      ENABLING ENABLED  PROCEDURE ABORTING STOPPING BLOCKED  CLOSED
CONNECTED     IDLE      .         .        .        .         .        .        .        .
LOST          .         OFFLINE   STOPPING STOPPING ABORTING  .        .        STOPPING .
ENABLE        .         ENABLING  .        .        .         .        .        .        .
REFUSED       .         .         IDLE     .        .         .        .        .        .
RUNNING       .         .         ENABLED  .        .         .        .        .        .
STOP          STOPPING  STOPPING  STOPPING STOPPING ABORTING  .        .        .        .
STOPPED       .         .         .        .        .         .        IDLE     .        .
FAULT_BLOCKS  .         .         .        .        .         .        BLOCKED  .        .
FAULT_OVER    .         .         .        .        .         .        .        STOPPING .
BEGIN         PROCEDURE PROCEDURE .        .        .         .        .        .        .
END           .         .         .        .        IDLE      IDLE     .        .        .
CLOSE         CLOSED    CLOSED    CLOSED   CLOSED   CLOSED    CLOSED   CLOSED   CLOSED   .
"""


def _read(table: str) -> Mapping[tuple[ControlState, ControlEvent], ControlState]:
    head, *rows = (line.split() for line in table.strip().splitlines())
    states = [ControlState[name] for name in head]
    transitions = {}
    for name, *cells in rows:
        for state, cell in zip(states, cells, strict=True):
            if cell != '.':
                transitions[state, ControlEvent[name]] = ControlState[cell]
    return transitions


#: The same, to be looked up; what is not in it changes nothing, or is refused.
TRANSITIONS = _read(_TABLE)

#: Something that the driver has begun may drive the motor.
COMMANDED = frozenset(
    (ControlState.ENABLING, ControlState.ENABLED, ControlState.PROCEDURE, ControlState.ABORTING)
)
