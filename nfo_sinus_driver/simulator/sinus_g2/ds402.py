# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The drive profile that the CANopen module of a G2 has: DS402 [M0 §6.4.2 table 11].

The manual prints names and indices alone; types, bits and codes are those of CiA 402. The module
controls the generic state machine [M0 §7], whose bits 0 to 7 are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import math

from nfo_sinus_driver.families.sinus_g2.words import ControlWord, Status
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.memory import Memory, Reason, Refused
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Phase

CONTROL_WORD = 'fieldbus.control_word'
STATUS_WORD = 'fieldbus.status_word'
MODE = 'fieldbus.modes_of_operation'
#: Parameters that are objects of the profile, too.
ALIASES: Mapping[str, str] = {'fieldbus.shutdown_option_code': 'control.st_mode'}

_SHARED = 0xFF
_TOLD = (
    Status.READY_TO_SWITCH_ON
    | Status.SWITCHED_ON
    | Status.OP_ENABLED
    | Status.FAULTED
    | Status.VOLTAGE_ENABLED
    | Status.QUICK_STOP_DISABLED
    | Status.SWITCH_ON_DISABLED
    | Status.CTRL_FROM_NET
    | Status.SETPOINT_REACHED
    | Status.LIMIT_ACTIVE
)
#: What a motor that ramps to a stop has left already, where that is shown at once.
_LEFT = {
    Phase.DISABLE: Status.OP_ENABLED,
    Phase.SHUTDOWN: Status.OP_ENABLED | Status.SWITCHED_ON,
}
_VELOCITY, _TORQUE, _NO_MODE = 2, 4, 0
#: Both of them, a bit each.
_SUPPORTED = 0b1010
_SQUIRREL_CAGE = 7
#: By control.mode: Freque, PI-Reg, Torque, Speed.
_MODES = (_VELOCITY, _NO_MODE, _TORQUE, _VELOCITY)
#: What CiA 402 calls a fault of the inverter status; any other is a generic one.
_ERRORS: Mapping[int, int] = {
    0: 0x0000,
    2: 0x3130,
    3: 0x4210,
    4: 0x4310,
    5: 0x2310,
    7: 0x3220,
    8: 0x3210,
    9: 0x2330,
    12: 0x2320,
    15: 0x7500,
}
_GENERIC = 0x1000


def control(word: int) -> ControlWord:
    """Return what a ControlWord is to the state machine; the module has control."""
    return ControlWord(word & _SHARED) | ControlWord.NET_CTRL | ControlWord.NET_REF


def status_word(status: Status, phase: Phase, ramp: str) -> int:
    """
    Return the StatusWord for the status of the state machine; reverse is no state of its own.

    :param ramp: while the motor ramps to a stop, it is shown ``running``; or ``ready`` at once.
    """
    word = status & _TOLD
    if status & Status.REV_OP_ENABLED:
        word |= Status.OP_ENABLED
    return int(word & ~_LEFT.get(phase, Status(0)) if ramp == 'ready' else word)


class DriveProfile:
    """What the objects of one drive say that are not stored, and the reference that they give."""

    def __init__(self, memory: Memory, motor: Motor, faults: Faults) -> None:
        self._memory = memory
        self._motor = motor
        self._faults = faults
        self._shown: Mapping[str, Callable[[], float]] = {
            'fieldbus.error_code': lambda: _ERRORS.get(faults.shown, _GENERIC),
            'fieldbus.vl_velocity_demand': lambda: self._counts(motor.ramp),
            'fieldbus.vl_velocity_actual_value': lambda: motor.speed / self._factor,
            MODE: lambda: self._mode,
            f'{MODE}_display': lambda: self._mode,
            'fieldbus.motor_rated_current': lambda: 1000 * memory.number('motor.i_nom'),
            'fieldbus.torque_actual_value': lambda: 1000 * motor.torque,
            'fieldbus.motor_type': lambda: _SQUIRREL_CAGE,
            'fieldbus.supported_drive_modes': lambda: _SUPPORTED,
        }

    def show(self, key: str) -> int | None:
        """Return the raw number of what is not stored, else ``None``."""
        shown = self._shown.get(key)
        return None if shown is None else round(shown())

    def require_mode(self, raw: int) -> None:
        """Refuse another mode than the drive is in: one value is valid [M0 §6.4.2]."""
        if raw != self._mode:
            raise Refused(Reason.VALUE, f'the mode of operation is {self._mode}')

    @property
    def reference(self) -> float:
        """What 6042h or 6071h ask for, signed: Hz, or the torque relative to nominal."""
        if self._mode == _TORQUE:
            return self._memory.number('fieldbus.target_torque') / 100
        target = self._memory.number('fieldbus.vl_target_velocity')
        least = self._memory.number('fieldbus.vl_velocity_min_amount')
        most = self._memory.number('fieldbus.vl_velocity_max_amount')
        target = math.copysign(min(max(abs(target), least), most), target)
        return target * self._factor * self._motor.plate.pole_pairs / 60

    def _counts(self, frequency: float) -> float:
        return 60 * frequency / self._motor.plate.pole_pairs / self._factor

    @property
    def _mode(self) -> int:
        return _MODES[self._memory.raw('control.mode')]

    @property
    def _factor(self) -> float:
        """What comes over the bus times this is a speed, rpm."""
        above = self._memory.number('fieldbus.vl_dimension_factor_numerator')
        below = self._memory.number('fieldbus.vl_dimension_factor_denominator')
        return above / below if above > 0 and below > 0 else 1.0
