# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Telegram 1 as a G2 takes it over PROFIBUS [M0 §6.3], in either set of words.

The words are those of PROFIdrive [C111], or DriveControl and DriveStatus, where a master maps these
[M0 tables 14 to 16]. Set-point and actual value are scaled as the parameters are.
"""

from __future__ import annotations

import enum

from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.simulator import telegram1
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.sinus_g2.control_unit import DRIVECONTROL, LEVELS, G2ControlUnit
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Phase

#: What each bit of STW1 of PROFIdrive is in DriveControl.
_CONTROL = {
    1 << 0: Control.SWITCH_ON,
    1 << 1: Control.ENABLE_VOLTAGE,
    1 << 2: Control.DISABLE_QUICK_STOP,
    1 << 3: Control.ENABLE_OP,
    1 << 4: Control.ENABLE_RFG,
    1 << 5: Control.UNLOCK_RFG,
    1 << 6: Control.USE_REF_FOR_RFG,
    1 << 7: Control.RESET_MALFUNCTION,
    1 << 10: Control.NET_CTRL | Control.NET_REF,
}
_CONTROL_BY_PLC = 1 << 10


class Zsw1(enum.IntFlag):
    """ZSW1 of PROFIdrive, standard telegram 1."""

    READY_TO_SWITCH_ON = 1 << 0
    READY_TO_OPERATE = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    NO_COAST_STOP = 1 << 4
    NO_QUICK_STOP = 1 << 5
    SWITCHING_ON_INHIBITED = 1 << 6
    WARNING = 1 << 7
    WITHIN_TOLERANCE = 1 << 8
    CONTROL_REQUESTED = 1 << 9
    REACHED = 1 << 10
    PULSES_ENABLED = 1 << 15


_SWITCHED_ON = Zsw1.READY_TO_SWITCH_ON | Zsw1.READY_TO_OPERATE
#: What the states of the drive are in PROFIdrive; S5, switching off, looks like S3.
_STATES = {
    Phase.NOT_READY_TO_SWITCH_ON: Zsw1(0),
    Phase.SWITCH_ON_DISABLED: Zsw1.SWITCHING_ON_INHIBITED,
    Phase.READY_TO_SWITCH_ON: Zsw1.READY_TO_SWITCH_ON,
    Phase.SWITCHED_ON: _SWITCHED_ON,
    Phase.OPERATION_ENABLED: _SWITCHED_ON | Zsw1.OPERATION_ENABLED,
    Phase.DISABLE: _SWITCHED_ON,
    Phase.SHUTDOWN: _SWITCHED_ON,
    Phase.QUICK_STOP: Zsw1.SWITCHING_ON_INHIBITED,
    Phase.FAULT_REACTION_ACTIVE: Zsw1.FAULT,
    Phase.FAULTED: Zsw1.FAULT,
}


class Server(telegram1.Server):
    """The fieldbus side of one G2."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, G2ControlUnit)
        self._unit = drive.control_unit
        #: STW1 that was not ignored last.
        self._obeyed = 0

    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value."""
        unit = self._unit
        if unit.telegram['telegram_words'] == DRIVECONTROL:
            unit.take_telegram(self._by_level(stw1), setpoint)
            return int(unit.status_word), unit.actual
        # without control by PLC the process data do not count, and what was before goes on
        if stw1 & _CONTROL_BY_PLC:
            self._obeyed = stw1
            word = sum(bit for given, bit in _CONTROL.items() if stw1 & given)
            unit.take_telegram(self._by_level(word), setpoint)
        else:
            unit.fieldbus.heard()
        return int(self._zsw1(stw1)), unit.actual

    def _by_level(self, word: int) -> int:
        """Add what makes the drive switch on by a bit that has been there all the time."""
        return word | Control.AUTO_INIT if self._unit.telegram['commands'] == LEVELS else word

    def _zsw1(self, stw1: int) -> Zsw1:
        unit, motor = self._unit, self._unit.motor
        status = _STATES[unit.machine.phase]
        if stw1 & 1 << 1:
            status |= Zsw1.NO_COAST_STOP
        if stw1 & 1 << 2:
            status |= Zsw1.NO_QUICK_STOP
        if unit.on_bus:
            status |= Zsw1.CONTROL_REQUESTED
        if motor.limited or unit.faults.alarms:
            status |= Zsw1.WARNING
        if unit.machine.phase is Phase.OPERATION_ENABLED and motor.reached:
            status |= Zsw1.WITHIN_TOLERANCE | Zsw1.REACHED
        return status | Zsw1.PULSES_ENABLED if motor.driven else status
