# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the tests of a MOVITRAC 31 share: its switches, the ways to stop it, what to look at."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

from support.rig import Rig

from nfo_sinus_driver.drive import Drive, DriveError
from nfo_sinus_driver.simulator.family import load
from nfo_sinus_driver.simulator.movitrac31.commands import CONTROL_MODE, FUNCTION_BITS
from nfo_sinus_driver.simulator.movitrac31.parameters import Bit

OVERCURRENT = 101
DIRECTIONS = Bit.CW | Bit.CCW
REMOTE = {CONTROL_MODE: 'Remote control'}
#: What the manual leaves open.
_OPTIONS = [
    option for option in load('movitrac31').variant.options() if option.name != 'option_card'
]
#: Each switch of the simulated drive, turned alone.
SWITCHES: Mapping[str, Mapping[str, str]] = {
    'as the manual says': {},
    **{
        f'{option.name} {choice}': {option.name: choice}
        for option in _OPTIONS
        for choice in option.choices[1:]
    },
}
STOPS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'rapid stop': lambda drive: drive.rapid_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'disconnect': lambda drive: drive.disconnect(1.0),
    'exit': lambda drive: drive.stop_for_good(1.0),
}


def make(switch: str = 'as the manual says', **more: Any) -> Rig:
    """Return a rig; P841 is Remote control already where nothing could set it."""
    return switched(SWITCHES[switch], **more)


def switched(
    switch: Mapping[str, str],
    parameters: Mapping[str, Any] | None = None,
    options: Mapping[str, str] | None = None,
    connection: str = 'movitrac',
    **more: Any,
) -> Rig:
    """Return a rig with these switches turned, and no others."""
    if 'settings_need' in switch:
        parameters = {**REMOTE, **(parameters or {})}
    plain = {option.name: option.choices[0] for option in _OPTIONS}
    options = {**plain, **switch, **(options or {})}
    return Rig(connection, options=options, parameters=parameters, **more)


def bits(rig: Rig) -> int:
    return rig.far.memory.raw(FUNCTION_BITS)


def succeeded(rig: Rig, future: Future[Any]) -> bool:
    """Wait for an answer; return whether it is a success."""
    rig.wait_until(future.done)
    error = future.exception()
    assert error is None or isinstance(error, DriveError), repr(error)
    return error is None
