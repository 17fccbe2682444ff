# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A MOVITRAC 31 that its terminals start, while P841 is Remote setpoint, and the line gives the
frequency [M4 §4].
"""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
from typing import ClassVar

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
    MOST,
    SIZE,
    Assigned,
    ByLine,
    Size,
    require_direction,
    require_enable,
    take_direction,
)
from nfo_sinus_driver.families.movitrac31.product import read_if_there
from nfo_sinus_driver.families.movitrac31.words import Bits


class RemoteSetpoint(ByLine):
    """
    The line gives the frequency; the terminals give enable and direction, and start the motor.

    A stop is set-point 0, at which the motor stands. Function bits may count for nothing: only
    where that does not help control is taken from the terminals, and the motor is released.
    """

    means = 'the set-point beside the terminals'
    reads_run_command = True
    holders: ClassVar[Mapping[Value, Holder]] = {
        words.STANDARD: Holder.LOCAL,
        words.REMOTE_SETPOINT: Holder.BUS,
        # by function bits of an earlier session
        words.REMOTE_CONTROL: Holder.BUS,
        words.FIELDBUS: Holder.LOCAL,
    }
    target = Size(SIZE, MOST, forward_only=True, directed=False)
    setpoints: ClassVar[Mapping[str, SetpointTarget]] = {'Freque': target}
    control_retained = (
        'P841 stays Remote setpoint, for another value can start the motor; change '
        'serial.control_mode, or P841 at the keypad, to give the set-point to the terminals'
    )

    def _require_terminals(self, assigned: Assigned, closed: int) -> None:
        require_enable(assigned, closed)
        require_direction(assigned, closed)

    @staticmethod
    def _elsewhere() -> NotPossible:
        return NotPossible(
            'the motor follows a set-point of a fieldbus or of terminals (P841): open the '
            'terminals with a direction, set serial.control_mode to Remote setpoint, close them '
            'again, then enable'
        )

    def take_control(self) -> Steps[None]:
        """
        Set P841 to Remote setpoint if it is not, with set-point 0.

        :raises NotPossible: a set-point is left in the drive that the motor would follow at once.
        """
        if (yield Read(CONTROL_MODE)) != words.REMOTE_SETPOINT:
            for write in (Write(BITS, 0), Write(SIZE, 0.0)):
                with contextlib.suppress(Refusal):
                    yield write
            if (yield from read_if_there(SIZE)) != 0:
                raise NotPossible(
                    'a set-point stands in the drive that it does not change with this P841, and '
                    'the motor would follow it: open the terminals with a direction, set '
                    'serial.control_mode to Remote setpoint, close them again, then enable'
                )
            yield Write(CONTROL_MODE, words.REMOTE_SETPOINT, stored=True)
        yield from self.zero_setpoint('')

    def run(self) -> Steps[None]:
        """Do nothing: the terminals have started the motor, at set-point 0."""
        yield from ()

    def stop(self, control_mode: str) -> Steps[None]:
        """Write set-point 0; and take the direction away that function bits may give."""
        yield from self._stop_by(self.target.zero(retry=False), take_direction())

    def has_run_command(self) -> Steps[bool | None]:
        """Return false: the terminals go on running the motor, at set-point 0."""
        yield from ()
        return False

    def force_stop(self, control_mode: str) -> Steps[bool]:
        """Write set-point 0, then take control from the terminals, and inhibit the controller."""
        removed = yield from self.remove(control_mode)
        # before, too: where it counts already it does so from the first moment on
        yield from try_steps(one_step(Write(BITS, int(Bits.CONTROLLER_INHIBIT))))
        yield from try_steps(one_step(Write(CONTROL_MODE, words.REMOTE_CONTROL)))
        return (yield from _inhibit()) or removed is Removal.COMMAND

    def release(self) -> Steps[None]:
        """Write set-point 0; P841 stays, for another one can start the motor."""
        if (yield from self.in_control()):
            yield from self._stop_by(self.target.zero(retry=True), take_direction())

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove function bits and set-point while a fault is active; without one nothing turns."""
        yield from try_steps(one_step(Write(BITS, 0)))
        setpoint = yield from try_steps(self.zero_setpoint(control_mode))
        return Removal.COMMAND if setpoint else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault by the reset bit, as far as it counts, with set-point 0.

        :raises NotPossible: the drive keeps another set-point, or ignores function bits.
        """
        if (yield from self.remove(control_mode)) is not Removal.COMMAND:
            raise NotPossible(
                'the drive keeps a set-point, and the motor would turn: reset it at the keypad or '
                'by a terminal'
            )
        yield from self._reset()
        return ''


def _inhibit() -> Steps[bool]:
    """Write the controller inhibit; return whether it is taken, and counts."""
    inhibited = yield from try_steps(one_step(Write(BITS, int(Bits.CONTROLLER_INHIBIT))))
    return inhibited and (yield from read_if_there(CONTROL_MODE)) == words.REMOTE_CONTROL
