# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What every family of Sinus is made of: its Modbus, its options, what can happen to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nfo_sinus_driver.simulator import modbus
from nfo_sinus_driver.simulator.classic_frames import LineError
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import Option
from nfo_sinus_driver.simulator.injections import Argument, Target, Verb
from nfo_sinus_driver.simulator.modbus import KNOWN, TREATMENTS
from nfo_sinus_driver.simulator.sinus.control_unit import CHOICES, KEYS, SinusControlUnit

OPTIONS = (
    Option('lenient', 'a Classic message that is refused while the bus has control is no serial '
           'fault'),
    Option(
        'newer_functions',
        'how drives treat functions 17, 23 and 43, which older ones do not have (default: known)',
        TREATMENTS,
    ),
    Option(
        'run_command_in_fault',
        'what an acknowledged fault does to a run command (default: drops; of the Optimal keeps)',
        CHOICES['run_command_in_fault'],
    ),
    Option(
        'refuses_in_fault',
        'what is refused while a fault is active; on Classic always all (default: nothing)',
        CHOICES['refuses_in_fault'],
    ),
    Option(
        'stop_in_tuning',
        'whether SCMD = Stop ends a tuning, or is refused until it is over (default: taken)',
        CHOICES['stop_in_tuning'],
    ),
    Option(
        'tuning_ends_in',
        'what a tuning that succeeds ends in: a code of success, or standby (default: code)',
        CHOICES['tuning_ends_in'],
    ),
)
#: For the families that have telegram 1.
COMMANDS = Option(
    'commands',
    'on telegram 1: a command counts when its bit rises, or as long as it stands (default: edges)',
    ('edges', 'levels'),
)


def _unit(target: Target) -> SinusControlUnit:
    unit = target.one.control_unit
    assert isinstance(unit, SinusControlUnit)
    return unit


def _sio_error(target: Target, given: dict[str, Any]) -> None:
    flags = {flag.bit_length() - 1: flag for flag in LineError}
    if given['bit'] not in flags:
        raise ValueError(f'SioErr has no bit {given["bit"]}, only {", ".join(map(str, flags))}')
    _unit(target).serial_error(flags[given['bit']])


VERBS: Mapping[str, Verb] = {
    'keypad': Verb(
        'press a key: stop (STOP), ext (SHIFT+STOP: to the terminals), start (run locally)',
        lambda target, given: _unit(target).press(given['key']),
        (Argument('key', str, 'stop, ext or start', choices=tuple(KEYS)),),
    ),
    'sio-error': Verb(
        'let something go wrong on the line: a flag of SioErr, and Sio Fail under bus control',
        _sio_error,
        (Argument('bit', int, 'bit of SioErr, such as 1: parity'),),
    ),
}


#: What only the newer firmware of a G2 has [C57].
NEWER = frozenset((modbus.REPORT_SLAVE_ID, modbus.WRITE_AND_READ, modbus.ENCAPSULATED))


class ModbusServer(modbus.Server):
    """The Modbus side of one Sinus, whose newer functions can be refused or unheard of."""

    def __init__(self, drive: SimulatedDrive) -> None:
        super().__init__(drive)
        assert isinstance(drive.control_unit, SinusControlUnit)
        self._unit = drive.control_unit

    def treats(self, function: int) -> str:
        """Return how the drive treats a function."""
        chosen = self._unit.newer_functions if function in NEWER else KNOWN
        return super().treats(function) if chosen == KNOWN else chosen
