# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the simulator has to know of a G2."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import Option, SimulatedFamily
from nfo_sinus_driver.simulator.injections import Argument, Target, Verb
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.sinus import parts
from nfo_sinus_driver.simulator.sinus_g2 import canopen, canopen_shape, classic, telegram1
from nfo_sinus_driver.simulator.sinus_g2.control_unit import (
    FACTORY,
    TELEGRAM_CHOICES,
    G2ControlUnit,
)
from nfo_sinus_driver.simulator.sinus_g2.firmware import DIALECTS

_REVISION_LENGTH = 17
_MODEL_LENGTH = 8


class ModbusServer(parts.ModbusServer):
    """The Modbus side of one G2, which tells who it is."""

    functions = parts.ModbusServer.functions | parts.NEWER

    def __init__(self, drive: SimulatedDrive) -> None:
        super().__init__(drive)
        self._objects = _device_objects(drive.memory)

    def device_objects(self) -> Mapping[int, bytes]:
        """Return the objects of Read Device Identification, by their numbers."""
        return self._objects


def _device_objects(memory: Memory) -> Mapping[int, bytes]:
    """Return the objects of Read Device Identification, by their numbers [M0 §6.2.4]."""
    versions = f' {memory.number("fieldbus.sw_ver"):.2f} / {memory.number("fieldbus.nfo_ver"):.0f} '
    texts = (
        'NFO Drives AB',
        '',
        versions.ljust(_REVISION_LENGTH),
        'http://www.nfo.se',
        'NFO Sinus',
        _model(memory.number('motor.p_nom'), memory.number('motor.u_nom')),
        '',
    )
    return {number: text.encode('ascii') for number, text in enumerate(texts)}


def _model(power: float, voltage: float) -> str:
    """Return power and voltage in 8 characters, such as 1.50/400 or 11.0/400."""
    fitting = (f'{power:.{decimals}f}/{voltage:.0f}' for decimals in (2, 1, 0))
    return next(text for text in fitting if len(text) <= _MODEL_LENGTH).ljust(_MODEL_LENGTH)


def _torn(target: Target, given: dict[str, Any]) -> None:
    server = target.one.servers['classic']
    assert isinstance(server, classic.Server)
    server.tears += given['times']


def _fail_tuning(target: Target, given: dict[str, Any]) -> None:
    unit = target.one.control_unit
    assert isinstance(unit, G2ControlUnit)
    unit.fail_tuning(given['code'])


FAMILY = SimulatedFamily(
    control_unit=G2ControlUnit,
    factory=FACTORY,
    servers={
        'modbus': ModbusServer,
        'classic': classic.Server,
        'canopen': canopen.Server,
        'telegram1': telegram1.Server,
    },
    options=(
        Option(
            'dialect',
            'the manual that describes the Classic protocol of the drives (default: as their '
            'firmware, fieldbus.sw_ver, says)',
            tuple(DIALECTS),
        ),
        *parts.OPTIONS,
        *canopen_shape.OPTIONS,
        Option(
            'telegram_words',
            'of the G2 on telegram 1: the words are those of PROFIdrive, or DriveControl and '
            'DriveStatus (default: profidrive)',
            TELEGRAM_CHOICES['telegram_words'],
        ),
        parts.COMMANDS,
    ),
    verbs={
        **parts.VERBS,
        'torn': Verb(
            'let a counter carry just after Classic has read one of its two words',
            _torn,
            (Argument('times', int, 'how many times', 1),),
        ),
        'tuning-fails': Verb(
            'let the next tuning end with a fault',
            _fail_tuning,
            (Argument('code', int, 'InvSt code: 16 (TunFailP) or 17 (TunFailM)'),),
        ),
    },
)
