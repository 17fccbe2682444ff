# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What both ways to command a MOVITRAC 31 share [M4 §4]: a set-point that is a size (index 223), and
what is seen to before a start.

The terminals count beside the line, so they are looked at before anything is written.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping
import contextlib
import math
from typing import ClassVar

from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    ControlMethod,
    Holder,
    Limits,
    NotPossible,
    Read,
    Refusal,
    SetpointTarget,
    Steps,
    Write,
)
from nfo_sinus_driver.families.movitrac31 import words
from nfo_sinus_driver.families.movitrac31.product import read_if_there
from nfo_sinus_driver.families.movitrac31.words import Bits

BITS = 'fieldbus.function_bits'
SIZE = 'fieldbus.remote_setpoint'
STATUS_WORD = 'fieldbus.inverter_status'
TERMINALS = 'status.terminals'
FREQUENCY = 'status.frequency'
CONTROL_MODE = 'serial.control_mode'

#: The greatest set-point of index 223, Hz.
MOST = 400.0
#: The function of each terminal, by the parameter that assigns it; that of 41 is fixed.
_ASSIGNED = {
    terminal: f'terminal.input_{terminal}' for terminal in words.TERMINALS if terminal != 41
}
_DIRECTIONS = ('CW/Stop', 'CCW/Stop')
_ENABLE = 'Enable/Stop'
_INHIBIT = '/Controller inhibit'
#: What drives the motor by itself whatever the line says, and how that is ended.
_ELSEWHERE = (
    ('control.operating_mode', 'Positioning control', 'P770 to V/f mode or Speed control'),
    ('control.synchronous_operation', True, 'P760 to No'),
    ('serial.master_slave', True, 'P880 to No'),
    ('serial.manual_operation', True, 'P870 to No at the keypad'),
)
#: The V/f pattern of each parameter set.
_PATTERNS = ('frequency.vf_pattern_1', 'frequency.vf_pattern_2')


def _by_pattern(name: str) -> Mapping[str, str]:
    """Return the parameter of each V/f pattern."""
    return {f'V/f pattern {number}': f'frequency.{name}_{number}' for number in (1, 2, 3)}


#: The least frequency; that at which a motor has its rated voltage; and the greatest.
_LEAST, _BASE, _GREATEST = map(_by_pattern, ('f_min', 'f_base', 'f_max'))
#: Changed while the motor is enabled, each could turn it otherwise than the line says.
START_SETTINGS = frozenset(
    (
        *(key for key, _, _ in _ELSEWHERE),
        *_ASSIGNED.values(),
        *_PATTERNS,
        *_LEAST.values(),
        *(CONTROL_MODE, 'motor.enable_set_selection'),
    )
)


class Size(SetpointTarget):
    """A set-point that is a size, in index 223."""

    def read_limits(self, has: Callable[[str], bool], *, older: bool = False) -> Steps[Limits]:
        """Read base and greatest frequency of the V/f pattern in use (P201, P202 and the like)."""
        pattern = yield from _pattern()
        nominal = yield from _read_of(_BASE, pattern)
        most = min(self.most, (yield from _read_of(_GREATEST, pattern)))
        return Limits(0.0 if self.forward_only else -most, most, nominal)


class ByLine(ControlMethod):
    """
    What both ways to command it share.

    :cvar target: where its set-points go.
    """

    references = ('fieldbus',)
    target: ClassVar[SetpointTarget]

    def in_control(self) -> Steps[bool]:
        """Return whether the line has control of the drive, from us or from an earlier session."""
        return (yield from self.holder()) is Holder.BUS

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""
        return self.holders.get((yield Read(CONTROL_MODE)), Holder.UNKNOWN)

    def require_startable(self) -> Steps[None]:
        """
        Ensure that the motor does what the line says, and nothing before; it only reads.

        :raises NotPossible: something else drives it, or would, or it would turn at set-point 0.
        """
        for key, value, remedy in _ELSEWHERE:
            if (yield from read_if_there(key)) == value:
                raise NotPossible(
                    f'the motor is not driven by set-points of the line: set {remedy}'
                )
        self._require_terminals((yield from assignments()), int((yield Read(TERMINALS))))
        # at standstill, too, a drive may show that it is enabled
        if not (yield from self.in_control()) and (yield Read(FREQUENCY)):
            raise self._elsewhere()
        yield from _require_still_at_zero()

    @abc.abstractmethod
    def _require_terminals(self, assigned: Assigned, closed: int) -> None:
        """Ensure that the terminals allow a start (NotPossible: they do not)."""

    @staticmethod
    def _elsewhere() -> NotPossible:
        """Return what to say of a motor that the line does not drive."""
        return NotPossible('the motor is driven by a fieldbus or by terminals (P841): stop it')

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """
        Write set-point 0, and read it back; the direction is left alone.

        :raises NotPossible: the drive keeps another value.
        """
        yield from self.target.set_to_zero()

    def _reset(self) -> Steps[None]:
        """
        Acknowledge a fault by one rising edge of the reset bit.

        :raises NotPossible: the drive ignores it, as it may do with function bits unless P841 is
            Remote control [C110].
        """
        remote_control = (yield Read(CONTROL_MODE)) == words.REMOTE_CONTROL
        for bits in (Bits.RESET, Bits(0)):
            write = Write(BITS, int(bits))
            with contextlib.nullcontext() if remote_control else contextlib.suppress(Refusal):
                yield write
                if bits:
                    yield FAULT_GONE
        if not remote_control and int((yield Read(STATUS_WORD))) & words.FAULT:
            raise NotPossible(
                'P841 is not Remote control, and the drive ignores function bits: reset it at the '
                'keypad or by a terminal'
            )


#: What each terminal is for; ``None`` of those that the drive does not have.
Assigned = Mapping[int, Value | None]


def take_direction() -> Steps[None]:
    """
    Take the direction away, and keep enable and inhibit.

    Where the bits cannot be read nothing of them is kept: without its enable the motor takes the
    stop ramp, and none is given that did not stand.
    """
    kept = Bits(0)
    with contextlib.suppress(Refusal):
        kept = Bits(int((yield Read(BITS, retry=False))))
    yield Write(BITS, int(kept & (Bits.ENABLE | Bits.CONTROLLER_INHIBIT)), retry=False)


def assignments() -> Steps[Assigned]:
    """Return what each terminal is for; ``None`` of those that the drive does not have."""
    found: dict[int, Value | None] = {41: 'CW/Stop'}
    for terminal, key in _ASSIGNED.items():
        found[terminal] = yield from read_if_there(key)
    return found


def require_no_direction(assigned: Assigned, closed: int) -> None:
    """Ensure that no terminal gives a direction (NotPossible: one does)."""
    for terminal, function in assigned.items():
        if function in _DIRECTIONS and closed & words.TERMINALS[terminal]:
            raise NotPossible(
                f'terminal {terminal} ({function}) is closed: the motor would turn by it; open it'
            )


def require_direction(assigned: Assigned, closed: int) -> None:
    """Ensure that a terminal gives a direction (NotPossible: none does)."""
    having = [terminal for terminal, function in assigned.items() if function in _DIRECTIONS]
    if not any(closed & words.TERMINALS[terminal] for terminal in having):
        names = ' or '.join(map(str, having))
        raise NotPossible(
            f'no terminal with a direction is closed ({names}): with P841 = Remote setpoint it '
            'starts the motor; close it, then enable'
        )


def require_enable(assigned: Assigned, closed: int) -> None:
    """Ensure that no terminal keeps the motor from running (NotPossible: one does)."""
    for terminal, function in assigned.items():
        if function in (_ENABLE, _INHIBIT) and not closed & words.TERMINALS[terminal]:
            raise NotPossible(
                f'terminal {terminal} ({function}) is open: the motor cannot run; close it'
            )


def _require_still_at_zero() -> Steps[None]:
    """
    Ensure that the motor stands at set-point 0.

    :raises NotPossible: the parameter set in use has a least frequency.
    """
    least = _LEAST.get((yield from _pattern()))
    frequency: float = 0.0 if least is None else (yield Read(least))
    if frequency:
        raise NotPossible(
            f'the motor would turn at set-point 0: set {least} to 0 (it is {frequency:g} Hz)'
        )


def _read_of(keys: Mapping[str, str], pattern: str) -> Steps[float]:
    """Read the frequency of a V/f pattern; infinite for one that the manual does not list."""
    return float((yield Read(keys[pattern]))) if pattern in keys else math.inf


def _pattern() -> Steps[str]:
    """Return the V/f pattern of the parameter set in use."""
    word = int((yield Read(STATUS_WORD)))
    pattern = yield Read(_PATTERNS[bool(word & words.IN_SET_2)])
    return str(pattern)
