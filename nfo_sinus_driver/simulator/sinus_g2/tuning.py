# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""Tuning: a drive measures its motor, or calculates it [M0 table 18]; no manual tells how."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
import math

from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.memory import Memory


@dataclass(frozen=True)
class Procedure:
    """
    What one SCMD does.

    :ivar seconds: how long it takes; real drives take minutes.
    :ivar measures: the power stage works meanwhile, so RUN must be active.
    :ivar done: InvSt when it is finished [M0 table 19]; that of the full tuning is also that of the
        basic one, which has none of its own.
    :ivar finds: the parameters that it changes.
    """

    seconds: float
    measures: bool
    done: int
    finds: tuple[str, ...]


_MODEL = ('motor.r_rot', 'motor.l_main', 'motor.sigma', 'motor.i_magn')
PROCEDURES: Mapping[int, Procedure] = {
    Scmd.FULL_TUNING: Procedure(4.0, True, 45, ('motor.r_stat', *_MODEL)),
    Scmd.BASIC_TUNING: Procedure(2.0, True, 45, ('motor.r_stat', 'motor.sigma')),
    Scmd.RS_MEASURE: Procedure(1.0, True, 46, ('motor.r_stat',)),
    Scmd.PAR_CALC: Procedure(0.3, False, 47, _MODEL),
}
#: What InvSt says when one has failed: calculation overflow, measurement fault.
FAILURES = frozenset({16, 17})


@dataclass
class Tuning:
    """One procedure that is going on."""

    procedure: Procedure
    left: float

    @classmethod
    def begun(cls, scmd: int) -> Tuning:
        """Return the one that a command starts."""
        procedure = PROCEDURES[scmd]
        return cls(procedure, procedure.seconds)

    def store(self, memory: Memory) -> None:
        """Put what was found into the memory: a motor of the usual proportions."""
        impedance = memory.number('motor.u_nom') / math.sqrt(3) / memory.number('motor.i_nom')
        reactance = 2 * math.pi * memory.number('motor.f_nom')
        found = {
            'motor.r_stat': round(0.055 * impedance, 2),
            'motor.r_rot': round(0.045 * impedance, 2),
            'motor.l_main': round(1.7 * impedance / reactance, 4),
            'motor.sigma': 0.075,
            'motor.i_magn': round(0.5 * memory.number('motor.i_nom'), 2),
        }
        for key in self.procedure.finds:
            memory.set(key, found[key])
