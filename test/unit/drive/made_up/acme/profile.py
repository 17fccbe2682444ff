# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How an Acme is commanded: a control word, a direction, and the size of a frequency."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import enum
import math

from nfo_sinus_driver.catalog.profile import (
    ControlMethod,
    Holder,
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

_WORD, _TURN, _SIZE, _STATUS = 'bus.word', 'bus.turn', 'bus.size', 'bus.status'


class Word(enum.IntFlag):
    """The control word."""

    RESET = 1 << 3
    RUN = 1 << 12
    REMOTE = 1 << 15


class StatusBit(enum.IntFlag):
    """The status word."""

    RUNNING = 1 << 5
    TRIPPED = 1 << 9
    REMOTE = 1 << 13


class Frequency(SetpointTarget):
    """A frequency: its direction in one register, its size in another."""

    written_once = frozenset((_TURN,))

    def writes(self, value: float, before: float = math.nan) -> Sequence[Write]:
        """Return what is to be written: no size of the one direction is followed in the other."""
        turn = Write(_TURN, 'reverse' if value < 0 else 'forward')
        if value == 0:
            return Write(_SIZE, 0.0), turn
        if before == 0 or before * value > 0:
            return turn, Write(_SIZE, abs(value))
        return Write(_SIZE, 0.0), turn, Write(_SIZE, abs(value))

    def value(self, values: Mapping[str, object]) -> float:
        """Return the frequency with its sign."""
        size = values[_SIZE]
        assert isinstance(size, float)
        return -size if values[_TURN] == 'reverse' else size


_FREQUENCY = Frequency(_SIZE, 400.0)


class DriveControl(ControlMethod):
    """Control through the control word."""

    means = 'control word'
    references = ('fieldbus',)

    def in_control(self) -> Steps[bool]:
        """Return whether the bus has control."""
        return bool(int((yield Read(_STATUS))) & StatusBit.REMOTE)

    def holder(self) -> Steps[Holder]:
        """Return who has control."""
        return Holder.BUS if (yield from self.in_control()) else Holder.LOCAL

    def take_control(self) -> Steps[None]:
        """Take control with no run command."""
        yield Write(_WORD, Word.REMOTE)

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """Write set-point 0, and read it back."""
        yield from _FREQUENCY.set_to_zero()

    def run(self) -> Steps[None]:
        """Give the run command."""
        yield Write(_WORD, Word.REMOTE | Word.RUN, retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """Remove the run command, and write set-point 0, each by itself."""
        if (yield from self.perhaps_in_control()):
            command = one_step(Write(_WORD, Word.REMOTE, retry=False))
            yield from self._stop_by(command, _FREQUENCY.zero(retry=False))

    def release(self) -> Steps[None]:
        """Give control back."""
        if (yield from self.in_control()):
            yield Write(_WORD, 0)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove the run command, and write set-point 0, each by itself."""
        command = yield from try_steps(one_step(Write(_WORD, Word.REMOTE)))
        setpoint = yield from try_steps(self.zero_setpoint(control_mode))
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """Acknowledge by an edge."""
        for word in (Word.REMOTE, Word.REMOTE | Word.RESET, Word.REMOTE):
            yield Write(_WORD, word)
        return ''


def _state(word: int) -> State:
    if word & StatusBit.TRIPPED:
        return State.FAULTED
    return State.OPERATION_ENABLED if word & StatusBit.RUNNING else State.READY_TO_SWITCH_ON


def _active_method(status: Status | None) -> Steps[str]:
    yield from ()
    return 'drive_control'


PROFILE = Profile(
    title='Acme',
    status_word=StatusWord(
        state=_state,
        by_bit={
            StatusBit.RUNNING: Fact.OPERATION_ENABLED,
            StatusBit.TRIPPED: Fact.FAULT,
            StatusBit.REMOTE: Fact.NETWORK_CONTROL,
        },
        by_state={},
    ),
    holders={},
    methods={'drive_control': DriveControl},
    setpoints={'Freque': _FREQUENCY},
    active_method=_active_method,
    identified_by='bus.kind',
    most={Role.ACTUAL_FREQUENCY: 480.0, Role.ACTUAL_SPEED: 24000.0},
)
