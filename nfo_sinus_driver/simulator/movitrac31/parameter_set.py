# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The two parameter sets of a MOVITRAC 31..: what each says of frequencies, ramps and stops."""

from __future__ import annotations

from dataclasses import dataclass

from nfo_sinus_driver.simulator.memory import Memory

#: The least time of a ramp that the simulation can follow (s).
_SHORTEST = 0.01
#: The change of frequency that the ramps are for (Hz).
_RAMP_SPAN = 50.0
_MILLI = 0.001


@dataclass(frozen=True)
class ParameterSet:
    """
    What one set says.

    :ivar number: 1 or 2.
    :ivar f_min: the least frequency that it runs at (Hz).
    :ivar f_base: where the full voltage is reached (Hz).
    :ivar f_max: the greatest (Hz).
    :ivar up: how long the motor takes to f_base (s).
    :ivar down: how long back, and for a normal stop (s).
    :ivar stop: how long for a rapid stop (s).
    :ivar premagnetization: how long current flows before it turns (s).
    :ivar postmagnetization: how long after it has stopped (s).
    :ivar dc_braking: how long DC braking takes (s); 0: it is off.
    :ivar holds: direct current holds the motor as long as there is an enable.
    :ivar heats: direct current heats it while there is none.
    """

    number: int
    f_min: float
    f_base: float
    f_max: float
    up: float
    down: float
    stop: float
    premagnetization: float
    postmagnetization: float
    dc_braking: float
    holds: bool
    heats: bool

    def limited(self, setpoint: float) -> float:
        """Return what it runs at for a set-point (Hz)."""
        return min(max(setpoint, self.f_min), self.f_max)


def parameter_set(memory: Memory, number: int, second_ramp: bool) -> ParameterSet:
    """Return what a set says (second_ramp: ramp 2 is chosen, which is one for both ways)."""
    get = memory.number
    # V/f pattern 3 is one for both sets
    pattern = number if get(f'frequency.vf_pattern_{number}') else 3
    f_base = float(memory.get(f'frequency.f_base_{pattern}'))
    braking = bool(get(f'control.dc_braking_{number}'))

    def ramp(name: str) -> float:
        return max(get(f'ramp.t{number}{name}') * f_base / _RAMP_SPAN, _SHORTEST)

    return ParameterSet(
        number=number,
        f_min=get(f'frequency.f_min_{pattern}'),
        f_base=f_base,
        f_max=get(f'frequency.f_max_{pattern}'),
        up=ramp('2_up_down' if second_ramp else '1_up'),
        down=ramp('2_up_down' if second_ramp else '1_down'),
        stop=ramp('3_stop'),
        premagnetization=_MILLI * get(f'motor.premagnetization_time_{number}'),
        postmagnetization=_MILLI * get(f'motor.postmagnetization_time_{number}'),
        dc_braking=get(f'control.dc_braking_time_{number}') if braking else 0.0,
        holds=braking and get(f'control.dc_holding_current_{number}') > 0,
        heats=bool(get(f'control.dc_heating_{number}')),
    )
