# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of an Optimal: its tables, its Modbus and its telegram 1."""

from __future__ import annotations

from dataclasses import replace

from nfo_sinus_driver.catalog import Family, load_family
from nfo_sinus_driver.families.sinus_optimal.words import ControlWord
from nfo_sinus_driver.simulator import telegram1
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.modbus import READ_INPUT
from nfo_sinus_driver.simulator.sinus import parts
from nfo_sinus_driver.simulator.sinus.control_unit import FACTORY
from nfo_sinus_driver.simulator.sinus_optimal.control_unit import (
    OptimalControlUnit,
    OptimalVariant,
)
from nfo_sinus_driver.simulator.telegram1 import clipped

#: Settings that need no value of their own: they begin at the least that is allowed.
_MORE = ('control.run_dly', 'control.f_sleep')
#: [M1] speaks of a Frequency mode and a Speed mode.
_MODES = {0: 'Freque', 3: 'Speed'}


#: The bit by which a PLC takes control: another one than in Drive Control.
PLC_CONTROL = 1 << 10
#: The bits that are the same in both.
_SAME = (
    ControlWord.SWITCH_ON
    | ControlWord.ECHO_1
    | ControlWord.ECHO_2
    | ControlWord.ENABLE
    | ControlWord.FAULT_ACK
)


class ModbusServer(parts.ModbusServer):
    """The Modbus side of one Optimal [C57]."""

    functions = parts.ModbusServer.functions | {READ_INPUT}


def _machine(model: Family) -> Family:
    """
    Return the model with every parameter that a simulated drive of it needs.

    No manual lists the settings of the Optimal [C58], though it has some: those that the
    simulation needs are taken from the G2. They are at its keypad only, and no bus reaches them.
    """
    g2 = load_family('sinus_g2')
    hidden = {key: g2[key] for key in (*FACTORY, *_MORE)}
    hidden['control.mode'] = replace(hidden['control.mode'], labels=_MODES)
    return replace(model, parameters={**hidden, **model})


class TelegramServer(telegram1.Server):
    """The fieldbus side of one Optimal."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, OptimalControlUnit)
        self._unit = drive.control_unit

    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value."""
        word = ControlWord(stw1) & _SAME
        if stw1 & PLC_CONTROL:
            word |= ControlWord.BUS_CONTROL
        self._unit.take_telegram(int(word), setpoint)
        return int(self._unit.status_word), clipped(self._unit.telegram_actual)


FAMILY = SimulatedFamily(
    control_unit=OptimalControlUnit,
    variant=OptimalVariant,
    factory=FACTORY,
    machine=_machine,
    servers={'modbus': ModbusServer, 'telegram1': TelegramServer},
    injections=parts.INJECTIONS,
)
