# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Telegram 1 through a PLC or gateway: what is the same in every family [M1, M3, M0 §6.3].

Control word and set-point are written together, and stand in the block of registers of the PLC
until others do. The status word has what the PLC says of it above ZSW1. Words by which a motor may
run go on from those before: after a gap in which the PLC may have stopped the drive they are
refused, so that nothing but an enable lets it run again [C108].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    ControlMethod,
    Hold,
    Holder,
    NotPossible,
    Read,
    Refusal,
    Removal,
    SetpointTarget,
    Status,
    Steps,
    Write,
    try_steps,
)
from nfo_sinus_driver.catalog.status import Fact, State, StatusCode, StatusWord

STATUS = 'telegram.status'
ACTUAL = 'telegram.actual'
#: STW1 and set-point, by which no motor is let run.
BEGIN = 'telegram.begin'
#: Those by which one may, going on from what stands.
NEXT = 'telegram.next'
#: Bits of STW1 that are to be cleared.
CLEAR = 'telegram.clear'
SETPOINT = 'telegram.setpoint'

#: What PROFIdrive has of bits, beside ZSW1.
BIT_FIELDS = frozenset(('profidrive.control_word', 'profidrive.status_word'))
#: What the PLC says of the data, above ZSW1.
RELEASED = 1 << 17
FAULT_ACK = 1 << 7
#: How long a word is given to reach the drive, s.
_TAKEN_IN = 1.0

NOT_RELEASED = 190
FAULT = 191
WARNING = 192
#: The code of a status that nothing else is to be said of, by its state.
_BY_STATE: Mapping[State, int] = {state: 200 + state.value for state in State}


@dataclass(frozen=True)
class Words(StatusWord):
    """
    What ZSW1 means, with what the PLC says of it above; control is lost with the release.

    :ivar shown: ZSW1 alone.
    """

    shown: int = 0xFFFF

    def _bits(self, word: int) -> Fact:
        facts = super()._bits(word)
        return facts if word & RELEASED else facts & ~Fact.NETWORK_CONTROL


def code_by(
    state_of: Callable[[int], State], *, fault: int, warning: int = 0
) -> Callable[[int], int]:
    """Return what gives the code that a status word reports, by its bits and the state of ZSW1."""

    def code(word: int) -> int:
        if word & fault:
            return FAULT
        if not word & RELEASED:
            return NOT_RELEASED
        return WARNING if word & warning else _BY_STATE[state_of(word & 0xFFFF)]

    return code


class Telegram1(ControlMethod):
    """
    Control by STW1 and set-point in the block of registers of a PLC.

    :cvar ready: STW1 with which the bus has control and the motor stands.
    :cvar runs: the bits of it by which the motor runs; a stop clears them.
    :cvar control: the bit of ZSW1 that confirms control.
    :cvar echoes: that bit says nothing of who commands: without control by PLC the drive ignores
        the whole word and goes on as before, so that a motor that turns may do so by the bus
        ([C107], [C116]).
    """

    means = 'telegram 1'
    references = ('fieldbus',)
    addressing = 'telegram1'
    plc_time = 1.0
    control_retained = (
        'without STW1 keypad or terminals would have it, by which the motor could start'
    )
    ready: ClassVar[int]
    runs: ClassVar[int]
    control: ClassVar[int] = 1 << 9
    echoes: ClassVar[bool] = False

    def in_control(self) -> Steps[bool]:
        """Return whether the bus has control, by this driver or an earlier session."""
        word = int((yield Read(STATUS)))
        if not word & RELEASED:
            return False
        if word & self.control or not self.echoes:
            return bool(word & self.control)
        return bool((yield Read(ACTUAL)))

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""
        return Holder.BUS if (yield from self.in_control()) else Holder.LOCAL

    def require_startable(self) -> Steps[None]:
        """
        Ensure that the PLC lets us command the drive.

        :raises NotPossible: it does not.
        """
        if not int((yield Read(STATUS))) & RELEASED:
            raise NotPossible(
                'the PLC has not released the drive to ROS (bit 1 of register +3 of its block is '
                '0): release it in the PLC'
            )

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """Write set-point 0; the PLC has it with its answer. Refused where no STW1 stands."""
        yield Write(SETPOINT, 0.0)

    def stop(self, control_mode: str) -> Steps[None]:
        """
        Clear the run bits of what stands, and the set-point with them, in one telegram.

        Where no word of this driver stands, a drive that the bus controls, or may control, is given
        the one by which it stops; a drive that keypad or terminals control is left alone.
        """
        try:
            yield Write(CLEAR, self.runs | FAULT_ACK, retry=False)
        except Refusal:
            word = int((yield Read(STATUS, retry=False)))
            if word & RELEASED and (word & self.control or self.echoes):
                yield begin(self.stopping(word), retry=False)

    def stopping(self, word: int) -> int:
        """Return STW1 by which a drive with this status stops as usual, and keeps control."""
        return self.ready

    def release(self) -> Steps[None]:
        """Leave the drive ready, under control of the bus; it stands, or its ramp ends first."""
        if (yield from self.in_control()):
            word = int((yield Read(STATUS)))
            turns = yield Read(ACTUAL)
            yield begin(self.stopping(word) if turns else self.ready)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove run bits and set-point."""
        obeyed = yield from try_steps(self.stop(control_mode))
        return Removal.COMMAND if obeyed else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault by one edge of bit 7, the run bits clear, and set-point 0.

        Each word stands until it has reached the drive, and the bit until the fault is gone, for a
        while.

        :raises NotPossible: the PLC does not let us command the drive.
        """
        yield from self.require_startable()
        yield begin(self.ready)
        yield Hold(lambda status: True, _TAKEN_IN)
        yield begin(self.ready | FAULT_ACK)
        yield FAULT_GONE
        yield begin(self.ready)
        return ''


def begin(word: int, *, retry: bool = True) -> Write:
    """Return what writes STW1 by which no motor is let run, and set-point 0."""
    return Write(BEGIN, word << 16, retry=retry)


def following(word: int, *, retry: bool = True) -> Write:
    """Return what writes STW1 that goes on from the one before, and set-point 0."""
    return Write(NEXT, word << 16, retry=retry)


def active_method(status: Status | None) -> Steps[str]:
    """Return the control method, of which there is one behind a PLC."""
    yield from ()
    return 'telegram1'


def setpoints(most: float, *, forward_only: bool = False) -> Mapping[str, SetpointTarget]:
    """Return where set-points go; which control mode it is the telegram does not report."""
    return {'Freque': SetpointTarget(SETPOINT, most, forward_only=forward_only)}
