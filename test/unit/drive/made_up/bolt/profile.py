# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Bolt is commanded: function bits, the size of a frequency, and a source that is stored.

All of its status is one word, the code included, which says that the motor runs until it stands,
and nothing of who has control.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import enum
import math

from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    ControlMethod,
    Holder,
    NotPossible,
    Profile,
    Read,
    Removal,
    SetpointTarget,
    Status,
    Steps,
    Write,
    one_step,
    try_steps,
)
from nfo_sinus_driver.catalog.status import Fact, Role, State, StatusCode, StatusWord

_BITS, _SIZE, _SOURCE, _INPUTS = 'bus.bits', 'bus.size', 'bus.source', 'bus.inputs'
_STATUS = 'bus.status'
_HOLDERS: Mapping[Value, Holder] = {'terminals': Holder.LOCAL, 'line': Holder.BUS}


class Bit(enum.IntFlag):
    """The function bits."""

    RUN = 1 << 0
    RESET = 1 << 3


class StatusBit(enum.IntFlag):
    """The low half of the status word; the code is in the high one."""

    RUNNING = 1 << 0
    TRIPPED = 1 << 1
    BACKWARDS = 1 << 3


class Frequency(SetpointTarget):
    """A frequency in one direction."""

    def writes(self, value: float, before: float = math.nan) -> Sequence[Write]:
        """Return what is to be written."""
        return (Write(_SIZE, value),)

    def value(self, values: Mapping[str, object]) -> float:
        """Return the frequency."""
        size = values[_SIZE]
        assert isinstance(size, float)
        return size


_FREQUENCY = Frequency(_SIZE, 100.0, forward_only=True)


class FunctionBits(ControlMethod):
    """Control by function bits."""

    means = 'function bits'
    references = ('fieldbus',)
    control_retained = 'SOURCE is stored; set it to terminals at the keypad'

    def in_control(self) -> Steps[bool]:
        """Return whether the line has control."""
        return (yield from self.holder()) is Holder.BUS

    def holder(self) -> Steps[Holder]:
        """Return who has control."""
        return _HOLDERS[(yield Read(_SOURCE))]

    def require_startable(self) -> Steps[None]:
        """Ensure that no terminal would start the motor."""
        if (yield Read(_INPUTS)):
            raise NotPossible('terminal X1 is closed: open it')

    def take_control(self) -> Steps[None]:
        """Take control with no run command, for ever."""
        yield Write(_BITS, 0)
        yield Write(_SOURCE, 'line', stored=True)

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """Write set-point 0, and read it back."""
        yield from _FREQUENCY.set_to_zero()

    def run(self) -> Steps[None]:
        """Give the run command."""
        yield Write(_BITS, Bit.RUN, retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """Remove the run command, and write set-point 0, each by itself."""
        if (yield from self.perhaps_in_control()):
            yield from self._stop_by(
                one_step(Write(_BITS, 0, retry=False)), _FREQUENCY.zero(retry=False)
            )

    def release(self) -> Steps[None]:
        """Leave control where it is."""
        yield Write(_BITS, 0)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove the run command, and write set-point 0, each by itself."""
        command = yield from try_steps(one_step(Write(_BITS, 0)))
        setpoint = yield from try_steps(self.zero_setpoint(control_mode))
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """Acknowledge by an edge."""
        for word in (0, Bit.RESET, 0):
            yield Write(_BITS, word)
        return ''


def _state(word: int) -> State:
    if word & StatusBit.TRIPPED:
        return State.FAULTED
    return State.OPERATION_ENABLED if word & StatusBit.RUNNING else State.READY_TO_SWITCH_ON


def _active_method(status: Status | None) -> Steps[str]:
    yield from ()
    return 'function_bits'


PROFILE = Profile(
    title='Bolt',
    status_word=StatusWord(
        state=_state,
        by_bit={
            StatusBit.RUNNING: Fact.OPERATION_ENABLED,
            StatusBit.TRIPPED: Fact.FAULT,
            StatusBit.BACKWARDS: Fact.REVERSE,
        },
        by_state={},
        code=lambda word: word >> 16,
        shown=0xFFFF,
        by_frequency=True,
        sizes=frozenset((Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED)),
    ),
    holders=_HOLDERS,
    methods={'function_bits': FunctionBits},
    setpoints={'Freque': _FREQUENCY},
    active_method=_active_method,
    identified_by=_STATUS,
    most={Role.ACTUAL_FREQUENCY: 120.0},
)
