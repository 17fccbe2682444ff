# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated drive that makes it hardest for the driver, where the manuals leave it open."""

from __future__ import annotations

from collections.abc import Mapping
import functools
from pathlib import Path
from typing import Any

from nfo_sinus_driver import families
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.catalog.declared import SUFFIX, Description, read

_HARDEST = {
    'sinus_g2': {'run_command_in_fault': 'keeps', 'refuses_in_fault': 'all'},
    'movitrac31': {
        'status_numbers': 'bcd',
        'enable_bit': 'either',
        'timeout_stop': 'ramps',
        'outside_remote_control': 'taken',
        'stop_status': 'enable',
        'bits_after_power_on': 'kept',
        'bits_in_fault': 'kept',
    },
}
_RAMPS = {
    'sinus_g2': ('control.accel', 'control.retard'),
    'sinus_optimal': ('control.accel', 'control.retard'),
    'movitrac31': ('ramp.t11_up', 'ramp.t11_down'),
    'acme': ('ramp.up', 'ramp.up'),
    'sinus_h': ('drv.acc_time', 'drv.dec_time'),
}


def shipped(name: str) -> str:
    """Return the path of a shipped file that describes a drive."""
    (path,) = Path(families.__path__[0]).rglob(f'{name}{SUFFIX}')
    return str(path)


@functools.cache
def _file(path: str) -> Description:
    return read(Path(path))


def hardest(model: str = 'sinus_g2') -> Mapping[str, str]:
    """Return its options for a drive family; none where drives of it are so anyway."""
    return _HARDEST.get(model, {})


def ramps(model: str, up: float, down: float) -> dict[str, float]:
    """Return the settings of a drive family for its ramps, s; of a file those that it names."""
    if model.endswith(SUFFIX):
        simulated = _file(model).simulated
        found = ((simulated.accel, up), (simulated.decel, down))
        return {key: time for key, time in found if key}
    return dict(zip(_RAMPS[model], (up, down), strict=True))


def stopping_at_timeout(model: str, method: str) -> dict[str, Any]:
    """Return the settings of a drive by which its own time-out stops the motor."""
    conditions = load_family(model, method).profile.timeout_conditions
    return {key: values[0] for key, values in conditions.items()}


def stop_registers(model: str) -> frozenset[tuple[str, int]]:
    """Return what the stop of a file writes, by the keys of the parameters."""
    file = _file(model)
    if file.run_by:
        return frozenset({(file.setpoint.key, 0)})
    return frozenset((step.key, int(step.value)) for step in file.stop)
