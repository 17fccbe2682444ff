# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the launch files share: the checks of their arguments, and their exit status.

Without ROS: the launch files give what they have been given.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
import json
from pathlib import Path
import tempfile
from typing import Any

Sections = dict[str, dict[str, dict[str, Any]]]


#: As many as a line with RS-485 has addresses for.
MOST_DRIVES = 247
#: How much longer than shutdown_timeout the end of a driver may take, s.
LEAST_EXIT = 10.0
#: The levels of a log, as ROS has them.
LEVELS = ('debug', 'info', 'warn', 'error', 'fatal')


def number(name: str, given: str, *, whole: bool = False) -> float:
    """
    Return the number that an argument is.

    :raises ValueError: it is none, or negative; the message names it.
    """
    try:
        value = int(given, 10) if whole else float(given)
    except ValueError:
        value = -1
    if not 0 <= value < float('inf'):
        kind = 'a whole number' if whole else 'a number'
        raise ValueError(f'{name}:={given}: write {kind}')
    return value


def exit_timeout(given: str) -> float:
    """
    Return how long the driver may take to stop its motors, s.

    :raises ValueError: that is no number, or less than the driver may need to answer; the message
        says what to write.
    """
    seconds = number('exit_timeout', given)
    if seconds < LEAST_EXIT:
        raise ValueError(
            f'exit_timeout:={given}: write at least {LEAST_EXIT:g} more than the parameter '
            'shutdown_timeout: launch kills a driver that takes longer, and its motors run on'
        )
    return seconds


def log_level(given: str) -> str:
    """
    Return a level of the log, or NAME:=LEVEL for one logger.

    :raises ValueError: there is no such level; the message names those that there are.
    """
    if given.rpartition(':=')[2].lower() not in LEVELS:
        raise ValueError(f'log_level:={given}: write {", ".join(LEVELS[:-1])} or {LEVELS[-1]}')
    return given


def switch(name: str, given: str) -> bool:
    """
    Return what a switch is, written as ``ros2 launch`` and YAML have it.

    :raises ValueError: it is neither on nor off; the message names it.
    """
    if given.lower() not in ('true', 'false'):
        raise ValueError(f'{name}:={given}: write true or false')
    return given.lower() == 'true'


def parameter_file(given: str, config: Path) -> str:
    """
    Return the path of a parameter file; a relative one may be one of the package's own.

    :param config: the folder of those, with folders in it.
    :raises ValueError: there is no such file; the message says where it was looked for.
    """
    path = Path(given).expanduser()
    if path.is_file():
        return str(path)
    own = config / path
    if own.is_file():
        return str(own)
    looked = [str(path.absolute())]
    if not path.is_absolute():
        names = ', '.join(sorted(str(file.relative_to(config)) for file in config.rglob('*.yaml')))
        looked.append(f'{config}, which has {names}')
    raise ValueError(f'params_file:={given}: there is no such file; looked in {"; ".join(looked)}')


def simulated_drives(given: str) -> Sections:
    """
    Return the sections of a parameter file for so many drives, named as ``nfo-sinus scan`` does.

    One drive needs none: it has the default name and address.

    :raises ValueError: it is not a number of drives; the message names the argument.
    """
    try:
        count = int(number('drives', given, whole=True))
    except ValueError:
        count = 0
    if not 1 <= count <= MOST_DRIVES:
        raise ValueError(f'drives:={given}: write a whole number from 1 to {MOST_DRIVES}')
    if count == 1:
        return {}
    names = {f'drive_{address}': address for address in range(1, count + 1)}
    return {
        '/**/nfo_sinus_bus': {'ros__parameters': {'drives': list(names)}},
        **{
            f'/**/{name}': {'ros__parameters': {'address': address}}
            for name, address in names.items()
        },
    }


def written(sections: Sections) -> list[str]:
    """
    Return the name of a new parameter file with these sections, in a list; empty if there are none.

    Not a dictionary for launch_ros: it puts that under ``/**``, which a section for a node in
    another parameter file would overrule. And JSON: in plain YAML 8E1 is a number.
    """
    if not sections:
        return []
    with tempfile.NamedTemporaryFile('w', prefix='nfo_sinus_', delete=False) as file:
        json.dump(sections, file)
    return [file.name]


def fail_with_driver(event: Any, context: Any) -> None:
    """
    Have launch end with 1 where the driver has ended with another status than 0.

    It has no other status, and no action for it: it counts what reaches the exception handler of
    its event loop. What else it has started goes on.

    :param event: the end of the driver, a ``launch.events.process.ProcessExited``.
    :param context: that of launch.
    """
    if event.returncode:
        message = f'the driver has ended with status {event.returncode}, so launch will end with 1'
        context.asyncio_loop.call_exception_handler({'message': message})


def require_packages(needed: Mapping[str, str], find: Callable[[str], object]) -> None:
    """
    Ensure that all packages are installed before any of them is started.

    :param needed: what each is for, by its name.
    :param find: raises a LookupError where there is no package of a name.
    :raises ValueError: some are missing; the message says how to install them.
    """
    missing = []
    for name in needed:
        try:
            find(name)
        except LookupError:
            missing.append(name)
    if missing:
        listed = ', '.join(f'{name} ({needed[name]})' for name in missing)
        debs = ' '.join(f'ros-jazzy-{name.replace("_", "-")}' for name in missing)
        raise ValueError(f'packages are missing: {listed}; sudo apt install {debs}')
