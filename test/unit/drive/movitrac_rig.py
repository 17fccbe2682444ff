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

"""What the tests of a MOVITRAC 31 share: its switches, the ways to stop it, what to look at."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping
from concurrent.futures import Future
from typing import Any

import pytest
from support.addresses import Words
from support.wire import understand
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.simulator.family import load
from nfo_sinus_driver.simulator.movitrac31.codes import Bit
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE
from nfo_sinus_driver.simulator.movitrac31.commands import FUNCTION_BITS

MODEL = 'movitrac31'
OVERCURRENT = 101
#: Indices [M4 §4].
BITS, SIZE, P841, STATUS, FREQUENCY, PC_TIMEOUT_INDEX = 281, 223, 205, 284, 0, 285
DIRECTIONS = Bit.CW | Bit.CCW
REMOTE = {CONTROL_MODE: 'Remote control'}

#: Each switch of the simulated drive, turned alone.
SWITCHES: Mapping[str, Mapping[str, str]] = {
    'as the manual says': {},
    **{
        f'{option.name} {choice}': {option.name: choice}
        for option in load(MODEL).options
        if option.name != 'option_card'
        for choice in option.choices[1:]
    },
}
each_switch = pytest.mark.parametrize('switch', SWITCHES.values(), ids=SWITCHES)

WAYS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'clean up': lambda drive: drive.disconnect(1.0),
    'exit': lambda drive: drive.stop_for_good(1.0),
}
each_way = pytest.mark.parametrize('way', WAYS.values(), ids=WAYS)


def make(
    make_virtual: MakeVirtual, switch: Mapping[str, str] | None = None, **settings: Any
) -> VirtualRig:
    """Make a rig; P841 is Remote control already where nothing could set it."""
    needs = switch is not None and 'settings_need' in switch
    return make_virtual(REMOTE if needs else {}, variant=switch, model=MODEL, **settings)


def bits(rig: VirtualRig) -> int:
    return rig.far.memory.raw(FUNCTION_BITS)


def turns(rig: VirtualRig) -> bool:
    """Tell whether the drive turns the motor, or is about to; it may coast."""
    return rig.far.motor.driven and rig.far.motor.demand != 0


def succeeded(rig: VirtualRig, future: Future[Any]) -> bool:
    """Wait for an answer; tell whether it is a success."""
    rig.answer(future)
    error = future.exception()
    assert error is None or isinstance(error, DriveError), repr(error)
    return error is None


def requests_since(rig: VirtualRig, frames: int) -> list[tuple[int, Words | None]]:
    """Return index and value of what was asked since so many frames."""
    asked = [understand(bytes.fromhex(one['hex']), 'movitrac') for one in rig.link.frames[frames:]]
    return [(one.place, one.words) for one in asked if one is not None]


def assert_only_enable_helps(rig: VirtualRig) -> None:
    """It stays still although set-points keep arriving, until somebody calls enable."""
    rig.send(20.0)
    rig.pass_time(1.5)
    assert not rig.drive.armed
    assert not turns(rig)
    assert not bits(rig) & DIRECTIONS
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.send(20.0)
    rig.pass_time(1.5)
    assert rig.far.motor.frequency > 19
