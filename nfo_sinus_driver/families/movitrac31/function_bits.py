# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A MOVITRAC 31 commanded by function bits, while P841 is Remote control [M4 §4].

The set-point is a size (index 223) beside a direction (two of the function bits). The bits are ORed
with the terminals, and an enable has to stand at those, too.
"""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
from typing import ClassVar

from nfo_sinus_driver.catalog.directed import DirectedTarget
from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    Holder,
    NotPossible,
    Read,
    Refusal,
    Removal,
    SetpointTarget,
    Steps,
    Write,
    one_step,
    try_steps,
)
from nfo_sinus_driver.catalog.status import StatusCode
from nfo_sinus_driver.families.movitrac31 import words
from nfo_sinus_driver.families.movitrac31.line import (
    BITS,
    CONTROL_MODE,
    FREQUENCY,
    MOST,
    SIZE,
    TERMINALS,
    Assigned,
    ByLine,
    Size,
    assignments,
    require_enable,
    require_no_direction,
    take_direction,
)
from nfo_sinus_driver.families.movitrac31.product import read_if_there
from nfo_sinus_driver.families.movitrac31.words import Bits

_DIRECTIONS = Bits.CLOCKWISE | Bits.COUNTER_CLOCKWISE


class DirectionAndSize(Size, DirectedTarget):
    """A set-point whose size stands in index 223, and whose sign is one of two direction bits."""


class FunctionBits(ByLine):
    """
    Control through the function bits while P841 is Remote control.

    A stop takes the direction away and leaves the enable, so that the motor ramps as for set-point
    0; without the enable it would take the stop ramp.
    """

    means = 'function bits'
    coasts = True
    stop_ramp = True
    # standing enabled without a direction may be shown as Enable [C105]
    reads_run_command = True
    holders: ClassVar[Mapping[Value, Holder]] = {
        words.STANDARD: Holder.LOCAL,
        # terminals start the motor there
        words.REMOTE_SETPOINT: Holder.LOCAL,
        words.REMOTE_CONTROL: Holder.BUS,
        # a PLC, which is as little us as a terminal is
        words.FIELDBUS: Holder.LOCAL,
    }
    target = DirectionAndSize(
        SIZE,
        MOST,
        direction=BITS,
        forward=int(Bits.ENABLE | Bits.CLOCKWISE),
        reverse=int(Bits.ENABLE | Bits.COUNTER_CLOCKWISE),
    )
    setpoints: ClassVar[Mapping[str, SetpointTarget]] = {'Freque': target}
    control_retained = (
        'P841 stays Remote control, for another value can start the motor; change '
        'serial.control_mode, or P841 at the keypad, to give it to the terminals'
    )

    def _require_terminals(self, assigned: Assigned, closed: int) -> None:
        require_no_direction(assigned, closed)
        require_enable(assigned, closed)

    def take_control(self) -> Steps[None]:
        """
        Remove function bits and set-point, then set P841 to Remote control if it is not.

        With another P841 the drive may refuse or ignore the others, so they are written again
        [C110]. Where a direction and a set-point are left behind by that, by which the motor would
        turn at once, it goes by way of Remote setpoint: there the set-point counts, and the bits do
        not.

        :raises NotPossible: it keeps other function bits, or another set-point.
        """
        found = yield Read(CONTROL_MODE)
        if found != words.REMOTE_CONTROL:
            for write in (Write(BITS, 0), Write(SIZE, 0.0)):
                with contextlib.suppress(Refusal):
                    yield write
            if (yield from _would_turn()):
                yield from self._pass_remote_setpoint(found)
            else:
                yield Write(CONTROL_MODE, words.REMOTE_CONTROL, stored=True)
        yield Write(BITS, 0, head=True)
        yield from self.zero_setpoint('')
        kept = int((yield Read(BITS)))
        if kept:
            raise NotPossible(f'the drive keeps function bits {kept:04X}h where 0 was written')

    def _pass_remote_setpoint(self, found: Value) -> Steps[None]:
        """
        Set P841 to Remote setpoint, remove the set-point, and go on to Remote control.

        Where that fails P841 is put back, unless the motor could start by it.
        """
        yield Write(CONTROL_MODE, words.REMOTE_SETPOINT, stored=True)
        try:
            yield from self.zero_setpoint('')
            yield Write(CONTROL_MODE, words.REMOTE_CONTROL, stored=True)
        except (NotPossible, Refusal):
            yield from try_steps(_put_back(found))
            raise

    def run(self) -> Steps[None]:
        """Enable, forward; once, for the state before a second one would be unknown."""
        yield Write(BITS, int(Bits.ENABLE | Bits.CLOCKWISE), retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """
        Take the direction away, and write set-point 0 [C126]; an enable that stands is left.

        None is given, for a direction may come from a terminal. Does nothing to a drive that is not
        under control of the line: refused if it is and does not obey.
        """
        yield from self._stop_by(take_direction(), self.target.zero(retry=False))

    def has_run_command(self) -> Steps[bool | None]:
        """Return whether a direction stands in the function bits; false if they are not read."""
        bits = yield from read_if_there(BITS)
        return bits is not None and bool(int(bits) & _DIRECTIONS)

    def remove_leftover(self) -> Steps[None]:
        """
        Remove a direction, which would count once P841 is set to Remote control at the keypad.

        Until then the bits do not count; with a fieldbus no manual says whose they are.
        """
        if (yield Read(CONTROL_MODE)) == words.FIELDBUS:
            return
        if (yield from self.has_run_command()):
            yield from try_steps(take_direction())

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor at once, by controller inhibit; control is kept."""
        inhibit = Write(BITS, int(Bits.CONTROLLER_INHIBIT))
        yield from self._stop_by(one_step(inhibit), self.target.zero(retry=True))

    def rapid_stop(self, control_mode: str) -> Steps[None]:
        """Take the enable with the direction, so that the motor takes ramp t13 or t23 [C105]."""
        cleared = Write(BITS, 0, retry=False)
        yield from self._stop_by(one_step(cleared), self.target.zero(retry=False))

    def release(self) -> Steps[None]:
        """Remove function bits and set-point; P841 stays, for another one can start the motor."""
        if (yield from self.in_control()):
            yield from self._stop_by(one_step(Write(BITS, 0)), self.target.zero(retry=True))

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove function bits and set-point while a fault is active, each by itself."""
        command = yield from try_steps(one_step(Write(BITS, 0)))
        setpoint = yield from try_steps(self.zero_setpoint(control_mode))
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault by one rising edge of the reset bit, the run bits removed first.

        :raises NotPossible: a direction stands at a terminal, by which the motor could start; the
            drive keeps its function bits; or it ignores them.
        """
        require_no_direction((yield from assignments()), int((yield Read(TERMINALS))))
        if (yield from self.remove(control_mode)) is not Removal.COMMAND:
            raise NotPossible(
                'the drive refuses function bits: reset it at the keypad or by a terminal'
            )
        yield from self._reset()
        return ''


def _put_back(found: Value) -> Steps[None]:
    """Set P841 to what it was, where neither a terminal nor a fieldbus can start the motor then."""
    if found != words.STANDARD:
        return
    require_no_direction((yield from assignments()), int((yield Read(TERMINALS))))
    if not (yield Read(FREQUENCY)):
        yield Write(CONTROL_MODE, found, stored=True)


def _would_turn() -> Steps[bool]:
    """Return whether function bits and set-point would turn the motor if they counted."""
    bits = yield from read_if_there(BITS)
    directed = bits is not None and int(bits) & _DIRECTIONS
    return bool(directed) and bool((yield from read_if_there(SIZE)))
