# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of an Optimal."""

from __future__ import annotations

from dataclasses import replace

from nfo_sinus_driver.catalog import Family, load_family
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.modbus import READ_INPUT
from nfo_sinus_driver.simulator.sinus import parts
from nfo_sinus_driver.simulator.sinus.control_unit import FACTORY
from nfo_sinus_driver.simulator.sinus_optimal import telegram1
from nfo_sinus_driver.simulator.sinus_optimal.control_unit import OptimalControlUnit

#: Settings that need no value of their own: they begin at the least that is allowed.
_MORE = ('control.run_dly', 'control.f_sleep')
#: [M1] speaks of a Frequency mode and a Speed mode.
_MODES = {0: 'Freque', 3: 'Speed'}


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


FAMILY = SimulatedFamily(
    control_unit=OptimalControlUnit,
    factory=FACTORY,
    machine=_machine,
    servers={'modbus': ModbusServer, 'telegram1': telegram1.Server},
    options=(parts.COMMANDS, *parts.OPTIONS),
    verbs=parts.VERBS,
)
