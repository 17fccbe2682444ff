# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""From standstill to a run and back: what the output stage of a MOVITRAC 31.. does, in phases."""

from __future__ import annotations

from collections.abc import Mapping
import enum

from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.movitrac31.codes import Number
from nfo_sinus_driver.simulator.movitrac31.commands import Command


class Phase(enum.Enum):
    """What the output stage does."""

    #: Nothing.
    OFF = 'off'
    #: Current flows, and the motor is not yet turned.
    MAGNETIZING = 'magnetizing'
    RUNNING = 'running'
    #: A normal stop, by the ramp for going down.
    STOPPING = 'stopping'
    #: By the ramp t13 or t23: the enable is gone.
    RAPID_STOP = 'rapid_stop'
    DC_BRAKING = 'dc_braking'
    #: Current flows, and the motor stands again.
    DEMAGNETIZING = 'demagnetizing'
    #: Direct current in a motor that stands, with an enable and without.
    HOLDING = 'holding'
    HEATING = 'heating'


_MOVING = frozenset({Phase.RUNNING, Phase.STOPPING, Phase.RAPID_STOP, Phase.DC_BRAKING})
_NUMBERS: Mapping[Phase, Number] = {
    Phase.OFF: Number.NO_ENABLE,
    Phase.MAGNETIZING: Number.START_MAGNETIZATION,
    Phase.RUNNING: Number.ENABLE,
    Phase.STOPPING: Number.NORMAL_STOP,
    Phase.RAPID_STOP: Number.RAPID_STOP,
    Phase.DC_BRAKING: Number.DC_BRAKING,
    Phase.DEMAGNETIZING: Number.STOP_MAGNETIZATION,
    Phase.HOLDING: Number.DC_HOLDING_CURRENT,
    Phase.HEATING: Number.HEATING_CURRENT,
}


class Sequence:
    """
    The phases of one drive.

    :ivar phase: the one it is in.
    """

    def __init__(self, motor: Motor) -> None:
        self._motor = motor
        self.phase = Phase.OFF
        #: Of magnetizing, and of demagnetizing (s).
        self._left = 0.0

    def off(self) -> None:
        """Switch the output stage off: the motor coasts."""
        self.phase = Phase.OFF
        self._motor.release()

    def follow(self, command: Command) -> None:
        """Do what is wanted now."""
        parameters = command.parameters
        phase = self._next(command)
        if phase is not self.phase:
            times = {
                Phase.MAGNETIZING: parameters.premagnetization,
                Phase.DEMAGNETIZING: parameters.postmagnetization,
            }
            self._left = times.get(phase, 0.0)
            self.phase = phase
        if phase is Phase.OFF:
            self._motor.release()
            return
        retards = {Phase.RAPID_STOP: parameters.stop, Phase.DC_BRAKING: parameters.dc_braking}
        motor = self._motor
        motor.energise()
        motor.accel = parameters.up
        motor.retard = retards.get(phase, parameters.down)
        motor.demand = command.direction * command.setpoint if phase is Phase.RUNNING else 0.0

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        self._left = max(0.0, self._left - dt)

    @property
    def waiting(self) -> bool:
        """Whether a phase goes on for a time."""
        return self._left > 0

    @property
    def moving(self) -> bool:
        """Whether it turns the motor, or stops it."""
        return self.phase in _MOVING

    @property
    def number(self) -> Number:
        """What the inverter status shows of it."""
        motor = self._motor
        if self.phase is Phase.RUNNING and motor.ramp * motor.demand < 0:
            return Number.CHANGE_DIRECTION
        return _NUMBERS[self.phase]

    def _next(self, command: Command) -> Phase:
        parameters = command.parameters
        if command.enable and command.direction:
            starts = self.phase is Phase.OFF and parameters.premagnetization
            if starts or (self.phase is Phase.MAGNETIZING and self._left):
                return Phase.MAGNETIZING
            return Phase.RUNNING
        if self.moving and not self._motor.at_zero:
            if not command.enable:
                return Phase.RAPID_STOP
            return Phase.DC_BRAKING if parameters.dc_braking else Phase.STOPPING
        ends = self.moving and parameters.postmagnetization
        if ends or (self.phase is Phase.DEMAGNETIZING and self._left):
            return Phase.DEMAGNETIZING
        if command.enable:
            return Phase.HOLDING if parameters.holds else Phase.OFF
        return Phase.HEATING if parameters.heats else Phase.OFF
