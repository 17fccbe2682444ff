# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Telegram 1 as an Optimal takes it over PROFINET and PROFIBUS [M1, Profinet]."""

from __future__ import annotations

from nfo_sinus_driver.families.sinus_optimal.words import Control
from nfo_sinus_driver.simulator import telegram1
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.sinus_optimal.control_unit import OptimalControlUnit
from nfo_sinus_driver.simulator.telegram1 import clipped

#: The bit by which a PLC takes control: another one than in Drive Control.
PLC_CONTROL = 1 << 10
#: The bits that are the same in both.
_SAME = (
    Control.SWITCH_ON
    | Control.ECHO_1
    | Control.ECHO_2
    | Control.ENABLE
    | Control.FAULT_ACK
)


class Server(telegram1.Server):
    """The fieldbus side of one Optimal."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, OptimalControlUnit)
        self._unit = drive.control_unit

    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value."""
        word = Control(stw1) & _SAME
        if stw1 & PLC_CONTROL:
            word |= Control.BUS_CONTROL
        self._unit.take_telegram(int(word), setpoint)
        return int(self._unit.status_word), clipped(self._unit.telegram_actual)
