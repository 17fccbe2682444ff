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

"""What the tests of the parameters do to the drive at the far end."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

from drive_rig import PATIENCE
from drive_rig import Rig
import pytest

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive import parameters as parameters_module
from nfo_sinus_driver.drive.parameter_writer import ParameterError
from nfo_sinus_driver.drive.parameters import Parameters
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused

#: What stands at the far end of a quick rig, s; see ``QUICK``.
ACCEL = 0.2
SILENCE = 3600
#: Read registers, and who are you.
_ONLY_READ = {3, 17, 43}

#: What is written together, and what was there before.
THREE = {'control.accel': 7.0, 'control.retard': 7.0, 'freque.f_fix1': 7.0}
THREE_BEFORE = [ACCEL, ACCEL, 10.0]

#: Called with a key and a raw number in place of what the drive does; and what it does.
Store = Callable[[str, int], None]


def connect(rig: Rig) -> Parameters:
    """Connect and read the parameters; they are watched from then on."""
    rig.drive.connect(parameters=True).result(PATIENCE)
    rig.drive.activate()
    return rig.drive.parameters


def far(rig: Rig, *keys: str) -> list[Value]:
    """What the drive has."""
    with rig.simulator.lock:
        return [rig.far.peek(key) for key in keys]


def at_keypad(rig: Rig, key: str, value: Value) -> None:
    """Change a parameter at the drive."""
    with rig.simulator.lock:
        rig.far.set_from_keypad(key, value)


def put_raw(rig: Rig, key: str, raw: int) -> None:
    """Give the drive what nobody can set."""
    with rig.simulator.lock:
        rig.far.memory.put(key, raw)


def on_write(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, work: Callable[[Store, str, int], None]
) -> None:
    """Let ``work`` decide what becomes of a write to a setting."""
    write = rig.far.write_raw

    def write_raw(key: str, raw: int) -> None:
        if key in rig.far.settings:
            work(write, key, raw)
        else:
            write(key, raw)

    with rig.simulator.lock:
        monkeypatch.setattr(rig.far, 'write_raw', write_raw)


def on_read(rig: Rig, monkeypatch: pytest.MonkeyPatch, work: Callable[[str], None]) -> None:
    """Let ``work`` see, and refuse, the reading of a setting."""
    read = rig.far.read_raw

    def read_raw(key: str) -> int:
        if key in rig.far.settings:
            work(key)
        return read(key)

    with rig.simulator.lock:
        monkeypatch.setattr(rig.far, 'read_raw', read_raw)


def bound_magn_by_limt(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the drive refuse whatever would make I-magn greater than I-limt [C34]."""

    def work(write: Store, key: str, raw: int) -> None:
        current = {name: rig.far.memory.raw(name) for name in ('motor.i_magn', 'motor.i_limt')}
        current[key] = raw
        if current['motor.i_magn'] > current['motor.i_limt']:
            raise Refused(Reason.VALUE, 'I-magn is at most I-limt')
        write(key, raw)

    on_write(rig, monkeypatch, work)


def watch_only(rig: Rig, monkeypatch: pytest.MonkeyPatch, *keys: str) -> None:
    """Have the drive read these again and again, as fast as the line can."""
    monkeypatch.setattr(parameters_module, '_ROUND', 0.0)
    monkeypatch.setattr(parameters_module, '_WAIT', 0.01)
    rig.drive.parameters._keys = keys


def written(rig: Rig) -> Mapping[str, int]:
    """How often each setting was written."""
    with rig.simulator.lock:
        return dict(rig.far.writes)


def news(rig: Rig) -> list[str]:
    """What was told of changes by somebody else."""
    return [text for _, text in rig.notes.events if text.startswith('changed at the drive')]


def only_read(rig: Rig) -> bool:
    """Whether nothing was ever written, not even a command."""
    requests = [frame for frame in rig.trace() if frame['direction'] == 'request']
    return {bytes.fromhex(frame['hex'])[1] for frame in requests} <= _ONLY_READ


def error_of(future: Future[Any]) -> ParameterError:
    with pytest.raises(ParameterError) as error:
        future.result(PATIENCE)
    return error.value
