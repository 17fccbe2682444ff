# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a MOVITRAC 31.. measures: its display values, as raw numbers of the line [M4 §4]."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from nfo_sinus_driver.simulator.motor import Motor

#: By how much the motor's own warmth, 0 to 100, warms the heat sink (°C).
_WARMING = 0.4
#: The temperature around a drive at first (°C): that of the example in [M4 §2.1.3.1].
AMBIENT = 25.5


def _whole(value: float, most: int) -> int:
    """Return a number without decimals, of hundredths."""
    return 100 * min(round(abs(value)), most)


def _frequency(motor: Motor) -> int:
    """Return the size of the frequency in steps of 0.05 Hz, of hundredths."""
    return 5 * round(20 * abs(motor.frequency))


def _current(motor: Motor) -> int:
    return _whole(100 * motor.current / motor.plate.current, 200)


def _utilization(motor: Motor) -> int:
    return _whole(100 * (motor.current / motor.plate.current) ** 2, 125)


def heat_sink(motor: Motor, ambient: float) -> int:
    """Return its temperature in half degrees, of hundredths; it may be negative."""
    return 50 * round(2 * (ambient + _WARMING * motor.temperature))


DISPLAYS: Mapping[str, Callable[[Motor], int]] = {
    'status.frequency': _frequency,
    'status.speed': lambda motor: _whole(motor.speed, 9999),
    'status.dc_link_voltage': lambda motor: _whole(motor.dc_link, 1000),
    'status.motor_voltage': lambda motor: _whole(motor.voltage, 1000),
    'status.apparent_current': _current,
    'status.inverter_utilization': _utilization,
    'status.motor_utilization_1': _utilization,
}


def readings(motor: Motor, ambient: float) -> Mapping[str, int]:
    """Return what the fault memory keeps of it, by what it is called there."""
    return {
        'dc_link_voltage': DISPLAYS['status.dc_link_voltage'](motor),
        'heat_sink_temperature': heat_sink(motor, ambient),
        'frequency': _frequency(motor),
        'apparent_current': _current(motor),
        'utilization': _utilization(motor),
    }
