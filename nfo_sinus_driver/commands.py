# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The commands that are installed, by what is called for each.

Where something that a command needs is not installed, it says so in a sentence: after ``pip
install`` of this package alone ROS and the libraries are missing. Nothing is loaded before the
command: the driver takes its signals first.
"""

from __future__ import annotations

import functools
import importlib
import sys

#: The module and the function of each command.
COMMANDS = {
    'driver': ('nfo_sinus_driver.node.__main__', 'main'),
    'families': ('nfo_sinus_driver.cli.families', 'main'),
    'monitor': ('nfo_sinus_driver.node.monitor', 'main'),
    'nfo-sinus': ('nfo_sinus_driver.cli.main', 'command'),
    'plot': ('nfo_sinus_driver.demo.record', 'plot'),
    'record': ('nfo_sinus_driver.demo.record', 'main'),
    'simulator': ('nfo_sinus_driver.simulator.main', 'main'),
}
#: What is no part of ROS; the names of the packages for apt are made of these.
_LIBRARIES = ('argcomplete', 'pymodbus', 'serial', 'tqdm', 'yaml')
_NOT_STARTED = 2
_INTERRUPTED = 130


def start(name: str) -> int | None:
    """Run a command; return its exit status: 2 if what it needs is missing, 130 after Ctrl-C."""
    module, function = COMMANDS[name]
    try:
        status: int | None = getattr(importlib.import_module(module), function)()
    except ModuleNotFoundError as error:
        missing = (error.name or '').partition('.')[0]
        if missing in ('', 'nfo_sinus_driver'):
            raise
        print(f'{name}: {_why_not(name, missing)}', file=sys.stderr)
        return _NOT_STARTED
    except KeyboardInterrupt:
        # while it was loaded: what drives a motor holds its signals
        return _INTERRUPTED
    return status


def _why_not(name: str, missing: str) -> str:
    """Return what a command needs and how it is installed."""
    if missing in _LIBRARIES:
        extra = 'simulator' if name == 'simulator' else 'cli'
        return (
            f'needs the library {missing} (apt install python3-{missing}; without apt, in the '
            f"clone of nfo_sinus_driver: pip install '.[{extra}]')"
        )
    return (
        f'needs ROS 2 (there is no {missing}): source /opt/ros/jazzy/setup.bash and the '
        'install/setup.bash of the workspace that has both packages'
    )


driver, families, monitor, nfo_sinus, plot, record, simulator = (
    functools.partial(start, name) for name in COMMANDS
)
