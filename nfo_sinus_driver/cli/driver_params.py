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

"""A parameter file for the driver, made of what a scan has found."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from datetime import datetime
import json
from pathlib import Path

from nfo_sinus_driver.cli.errors import CliError
from nfo_sinus_driver.cli.options import DEFAULTS
from nfo_sinus_driver.cli.parameter_file import STANDARD

_HEAD = """\
# {count} found by nfo-sinus scan on {date}.
#
#   ros2 launch nfo_sinus_driver driver.launch.py params_file:=FILE
#   ros2 run nfo_sinus_driver driver --ros-args --params-file FILE
#
# Rename the drives as you like, in `drives` and in front of their sections. Every parameter is
# listed in docs/interface.md; what is left out here keeps its default. This one is worth a thought:
# each drive stops by itself when it has heard nothing for so long, s. It is written to the drives.
#
# /**:
#   ros__parameters:
#     drive_timeout: 2.0

/**/nfo_sinus_bus:
  ros__parameters:
"""
_DRIVE = """
# {who}
/**/{name}:
  ros__parameters:
    address: {address}
    model: {model}
"""
#: What is written only if it is not what the driver takes by itself.
_IF_OTHER = ('response_timeout', 'retries')


def require_new(name: str, *, force: bool) -> None:
    """
    See to it that no file is replaced that somebody may have edited since.

    :raises CliError: there is one.
    """
    if name != STANDARD and not force and Path(name).exists():
        raise CliError(f'{name} exists already: choose another name, or say --force to replace it')


def driver_params(
    options: argparse.Namespace,
    baud_rate: int,
    char_format: str,
    found: Mapping[int, Mapping[str, str]],
) -> str:
    """
    Return the text of a parameter file with which the driver starts as it is.

    :param baud_rate: 0 behind a gateway, whose line is its own.
    :param found: what each drive says of itself, by address.
    """
    names = {address: f'drive_{address}' for address in sorted(found)}
    line: dict[str, object] = {'port': options.port, 'protocol': options.protocol}
    if baud_rate:
        line |= {'baud_rate': baud_rate, 'char_format': char_format}
    for name in _IF_OTHER:
        # a scan is content with less time than the driver should give
        if getattr(options, name) > DEFAULTS[name]:
            line[name] = getattr(options, name)
    line['drives'] = list(names.values())
    count = 'one drive' if len(names) == 1 else f'{len(names)} drives'
    date = f'{datetime.now().astimezone():%Y-%m-%d %H:%M %z}'
    # what JSON has is YAML, too
    settings = [f'    {name}: {json.dumps(value)}\n' for name, value in line.items()]
    drives = [
        _DRIVE.format(who=_who(facts), name=names[address], address=address, model=facts['model'])
        for address, facts in sorted(found.items())
    ]
    return ''.join((_HEAD.format(count=count, date=date), *settings, *drives))


def _who(facts: Mapping[str, str]) -> str:
    """Return what a drive says of itself, fit for a comment."""
    told = {'': facts['product'], 'firmware ': facts['firmware'], 'serial ': facts['serial number']}
    text = ', '.join(f'{name}{value}' for name, value in told.items() if value)
    return ''.join(char if char.isprintable() else ' ' for char in text)
