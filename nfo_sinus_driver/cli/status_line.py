# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One moment of a drive that is commanded, for a person and for a script."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
import json
import math

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Snapshot

#: What is measured beside the status: its name, its unit and its decimals.
_VALUES = {
    Role.OUTPUT_CURRENT: ('output_current', 'A', 2),
    Role.OUTPUT_POWER: ('output_power', 'W', 0),
    Role.ACTUAL_TORQUE: ('torque', '%', 0),
}


def as_line(seen: Snapshot, values: Mapping[Role, float], more: str = '') -> str:
    """
    Return what a drive does, in one line.

    :param values: what was measured.
    :param more: what stands behind the time.
    """
    when = f'{datetime.now().astimezone():%H:%M:%S}'
    cells = [when, more] if more else [when]
    if seen.status is None:
        return '  '.join((*cells, 'not connected'))
    cells.append(f'{f"{seen.status.code} {seen.text}":<11}')
    cells.append(f'set {_number(seen.setpoint, 1):>5} {seen.unit}')
    if seen.control_mode in ('Torque', 'PI-Reg'):
        cells.append(f'actual {_number(seen.actual, 1):>5} {seen.unit}')
    cells += [f'{_number(seen.frequency, 1):>5} Hz', f'{_number(seen.speed, 0):>5} rpm']
    cells += [
        f'{_number(values.get(role, math.nan), decimals):>4} {unit}'
        for role, (_, unit, decimals) in _VALUES.items()
    ]
    return '  '.join(cells)


def as_json(seen: Snapshot, values: Mapping[Role, float]) -> str:
    """Return the same as a JSON document of one line; the names are those of the messages."""
    facts: dict[str, object] = {
        'time': datetime.now().astimezone().isoformat(),
        'connected': seen.connected,
        'enabled': seen.enabled,
    }
    if seen.status is not None:
        facts |= {
            'code': seen.status.code,
            'text': seen.text,
            'kind': seen.kind.value,
            'state': seen.status.state.name,
            'control_mode': seen.control_mode,
            'unit': seen.unit,
            'setpoint': _known(seen.setpoint),
            'actual': _known(seen.actual),
            'frequency': _known(seen.frequency),
            'speed': _known(seen.speed),
        }
        facts |= {
            name: _known(values.get(role, math.nan)) for role, (name, _, _) in _VALUES.items()
        }
    return json.dumps(facts, ensure_ascii=False)


def _number(value: float, decimals: int) -> str:
    return '-' if math.isnan(value) else f'{value:.{decimals}f}'


def _known(value: float) -> float | None:
    # JSON has no NaN
    return None if math.isnan(value) else value
