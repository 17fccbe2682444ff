# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of a G2."""

from __future__ import annotations

from typing import Annotated

from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.sinus.parts import SinusInjections
from nfo_sinus_driver.simulator.sinus_g2.control_unit import FACTORY, G2ControlUnit
from nfo_sinus_driver.simulator.sinus_g2.firmware import G2Variant
from nfo_sinus_driver.simulator.sinus_g2.servers import (
    CanopenServer,
    ClassicServer,
    ModbusServer,
    TelegramServer,
)


class G2Injections(SinusInjections):
    """What else can be made to happen to a G2."""

    def torn(self, times: Annotated[int, 'how many times'] = 1) -> None:
        """Let a counter carry just after Classic has read one of its two words."""
        server = self._drive.servers['classic']
        assert isinstance(server, ClassicServer)
        server.tears += times

    def tuning_fails(
        self, code: Annotated[int, 'InvSt code: 16 (TunFailP) or 17 (TunFailM)']
    ) -> None:
        """Let the next tuning end with a fault."""
        unit = self._drive.control_unit
        assert isinstance(unit, G2ControlUnit)
        unit.fail_tuning(code)


FAMILY = SimulatedFamily(
    control_unit=G2ControlUnit,
    variant=G2Variant,
    factory=FACTORY,
    servers={
        'modbus': ModbusServer,
        'classic': ClassicServer,
        'canopen': CanopenServer,
        'telegram1': TelegramServer,
    },
    injections=G2Injections,
)
