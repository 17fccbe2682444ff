# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What every family of Sinus is made of: its Modbus, and what can happen to it."""

from __future__ import annotations

from argparse import Namespace

from nfo_sinus_driver.simulator import modbus
from nfo_sinus_driver.simulator.classic import LineError
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.injections import Injection, Target, argument
from nfo_sinus_driver.simulator.sinus.control_unit import SinusControlUnit

#: What only the newer firmware of a G2 has [C57].
NEWER = frozenset((modbus.REPORT_SLAVE_ID, modbus.WRITE_AND_READ, modbus.ENCAPSULATED))


class ModbusServer(modbus.Server):
    """The Modbus side of one Sinus, whose newer functions can be refused or unheard of."""

    def __init__(self, drive: SimulatedDrive) -> None:
        super().__init__(drive)
        assert isinstance(drive.control_unit, SinusControlUnit)
        newer = drive.control_unit.variant.newer_functions
        if newer != 'known':
            self.functions -= NEWER
        if newer == 'silent':
            self.silent = NEWER


def _serial_error(at: Target, given: Namespace) -> None:
    flags = {flag.bit_length() - 1: flag for flag in LineError}
    if given.bit not in flags:
        raise ValueError(f'SioErr has no bit {given.bit}, only {", ".join(map(str, flags))}')
    at.unit.serial_error(flags[given.bit])


INJECTIONS = {
    'sio-error': Injection(
        'let something go wrong on the line: a flag of SioErr, Sio Fail under bus control',
        _serial_error,
        argument('bit', 'bit of SioErr, such as 1: parity', type=int),
    ),
}
