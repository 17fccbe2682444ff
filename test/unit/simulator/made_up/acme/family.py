# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated Acme: run by a control word, its direction in another register than its size."""

from __future__ import annotations

from dataclasses import dataclass
import enum
from typing import Any

from nfo_sinus_driver.simulator.control_unit import ControlUnit, Variant, choice
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.injections import Injection, argument
from nfo_sinus_driver.simulator.memory import Memory


class Word(enum.IntFlag):
    """The control word."""

    RESET = 1 << 3
    RUN = 1 << 12
    REMOTE = 1 << 15


class StatusBit(enum.IntFlag):
    """The status word."""

    RUNNING = 1 << 5
    TRIPPED = 1 << 9
    REMOTE = 1 << 13


@dataclass(frozen=True)
class AcmeVariant(Variant):
    """One Acme."""

    most: str = choice('400', '50', text='the greatest set-point that is followed (Hz)')


class AcmeControlUnit(ControlUnit):
    """Takes the control word."""

    def __init__(self, memory: Memory, address: int, variant: AcmeVariant) -> None:
        super().__init__(memory, address, variant)
        self._most = float(variant.most)
        self._word = Word(0)

    def write(self, key: str, raw: int) -> bool:
        """Take a control word; a fault is acknowledged when its bit rises."""
        if key != 'bus.word':
            return False
        word = Word(raw)
        if word & ~self._word & Word.RESET:
            self.faults.acknowledge()
        self._word = word
        return True

    def show(self, key: str) -> int | None:
        """Return the control word, the status word and the status code."""
        if key == 'bus.word':
            return int(self._word)
        if key == 'bus.code':
            return self.status_code
        if key != 'bus.status':
            return None
        remote = StatusBit.REMOTE if self._word & Word.REMOTE else StatusBit(0)
        running = StatusBit.RUNNING if self.motor.driven else StatusBit(0)
        return int(remote | running | (StatusBit.TRIPPED if self.faults else StatusBit(0)))

    @property
    def status_code(self) -> int:
        """The fault, else who has control and whether the motor is driven."""
        if not self._word & Word.REMOTE:
            return self.faults.shown or 1
        return self.faults.shown or (3 if self.motor.driven else 2)

    def settle(self) -> None:
        """Run the motor, or let it go."""
        run = Word.REMOTE | Word.RUN
        self.motor.accel = self.motor.retard = self.memory.number('ramp.up')
        if self._word & run == run and self.run_input and not self.faults:
            sign = -1 if self.memory.raw('bus.turn') else 1
            self.motor.energise()
            self.motor.demand = sign * min(self.memory.number('bus.size'), self._most)
        else:
            self.motor.release()

    @property
    def settled(self) -> bool:
        """Always: it has no clock of its own."""
        return True

    def restart(self) -> None:
        """Forget the control word."""
        self._word = Word(0)

    def report(self) -> dict[str, Any]:
        """Return what it shows."""
        return {'code': self.status_code, 'word': int(self._word)}


INJECTIONS = {
    'heat': Injection(
        'let it be too hot',
        lambda at, given: at.drive.trip(70, cause_present=given.lasts),
        argument('--lasts', 'it stays so', action='store_true'),
    )
}

FAMILY = SimulatedFamily(
    control_unit=AcmeControlUnit,
    variant=AcmeVariant,
    factory={'ramp.up': 1.0},
    injections=INJECTIONS,
)
