# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of a Sinus H, and telegram 1 as its module takes it [M3 §7.1]."""

from __future__ import annotations

from typing import Annotated, Literal

from nfo_sinus_driver.simulator import telegram1
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.injections import Injections
from nfo_sinus_driver.simulator.sinus_h import keypad
from nfo_sinus_driver.simulator.sinus_h.control_unit import (
    Control,
    SinusHControlUnit,
    SinusHVariant,
)
from nfo_sinus_driver.simulator.telegram1 import clipped


class Server(telegram1.Server):
    """
    The fieldbus side of one Sinus H.

    With bit 0 clear alone it would stay in operation, and with bit 10 clear nothing counts [C107].
    """

    lost_clears = int(Control.ON | Control.NO_QUICK_STOP)
    lost_sets = int(Control.CONTROL_BY_PLC)

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, SinusHControlUnit)
        self._unit = drive.control_unit

    @property
    def online(self) -> bool:
        """Whether the module is set to the standard telegram (COM-22)."""
        return self._unit.memory.raw(keypad.TELEGRAM) == keypad.STANDARD_TELEGRAM

    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value."""
        self._unit.take_telegram(Control(stw1), setpoint)
        return int(self._unit.status_word), clipped(self._unit.actual)


class SinusHInjections(Injections):
    """What else can be made to happen to a Sinus H."""

    def keypad(
        self, key: Annotated[Literal['start', 'stop', 'reset'], 'start, stop or reset']
    ) -> None:
        """Press a key: start and stop of the keypad, reset of a fault."""
        unit = self._drive.control_unit
        assert isinstance(unit, SinusHControlUnit)
        unit.press(key)


FAMILY = SimulatedFamily(
    control_unit=SinusHControlUnit,
    variant=SinusHVariant,
    factory=keypad.FACTORY,
    machine=keypad.with_keypad,
    servers={'telegram1': Server},
    injections=SinusHInjections,
)
