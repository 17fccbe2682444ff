# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of a G2."""

from __future__ import annotations

from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.injections import Injection, argument, assign
from nfo_sinus_driver.simulator.sinus import parts
from nfo_sinus_driver.simulator.sinus_g2.control_unit import FACTORY, G2ControlUnit
from nfo_sinus_driver.simulator.sinus_g2.firmware import G2Variant
from nfo_sinus_driver.simulator.sinus_g2.servers import (
    CanopenServer,
    ClassicServer,
    ModbusServer,
    TelegramServer,
)

_INJECTIONS = {
    **parts.INJECTIONS,
    'torn': Injection('let a counter carry just after Classic has read one of its two words',
        lambda at, given: assign(at.drive.servers['classic'], tears=given.times),
        argument('times', 'how many times', type=int, default=1)),
    'tuning-fails': Injection('let the next tuning end with a fault',
        lambda at, given: at.unit.fail_tuning(given.code),
        argument('code', 'InvSt code: 16 (TunFailP) or 17 (TunFailM)', type=int)),
}

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
    injections=_INJECTIONS,
)
