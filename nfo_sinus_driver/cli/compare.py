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

"""The verb ``diff``: a drive with a file, two files, or two drives."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
import json

from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli.console import UsageError
from nfo_sinus_driver.cli.console import columns
from nfo_sinus_driver.cli.console import put
from nfo_sinus_driver.cli.console import remark
from nfo_sinus_driver.cli.parameter_file import ParameterFile
from nfo_sinus_driver.cli.parameter_file import read_file
from nfo_sinus_driver.cli.session import Remote
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.cli.values import same
from nfo_sinus_driver.cli.values import shown

_ABSENT = 'absent'


@dataclass(frozen=True)
class _Side:
    """
    One of the two that are compared.

    :ivar address: of the drive, as text; ``''`` where it is not known.
    """

    name: str
    values: Mapping[str, Value]
    address: str = ''


def diff(options: argparse.Namespace) -> int:
    """Compare; 1 if there are differences, as diff(1) does."""
    left, right = _sides(options)
    differing = [
        key
        for key in (*left.values, *(key for key in right.values if key not in left.values))
        if not same(left.values.get(key), right.values.get(key))
    ]
    model = load_family(options.model)
    own = model.key(Role.BUS_ADDRESS)
    if own in differing and left.address != right.address and left.address and right.address:
        # two drives on one line cannot have the same
        differing.remove(own)
    if options.json:
        table = {
            key: {'left': left.values.get(key), 'right': right.values.get(key)} for key in differing
        }
        put(json.dumps(table, ensure_ascii=False, indent=2))
    elif differing:
        rows = [(key, _cell(left, key, model), _cell(right, key, model)) for key in differing]
        for line in columns([('', left.name, right.name), *rows]):
            put(line)
    return int(bool(differing))


def _sides(options: argparse.Namespace) -> tuple[_Side, _Side]:
    files, against = options.files, options.against
    if len(files) == 2 and against is None:
        one, other = (read_file(name) for name in files)
        return _side(one), _side(other)
    if len(files) == 1 and against is None:
        return _with_drive(read_file(files[0]), options)
    if not files and against is not None:
        if against == options.address:
            raise UsageError(f'--against {against}: that is the same drive')
        with Session(options) as session:
            return _read(session.drive()), _read(session.drive(against))
    raise UsageError('diff takes one file, or two, or --against ADDRESS')


def _with_drive(file: ParameterFile, options: argparse.Namespace) -> tuple[_Side, _Side]:
    with Session(options) as session:
        drive = _read(session.drive())
    missing = [key for key in drive.values if key not in file.values]
    if missing:
        remark(f'{file.name} says nothing of {len(missing)} parameters of the drive')
    values = {key: value for key, value in drive.values.items() if key in file.values}
    return _side(file), _Side(drive.name, values, drive.address)


def _side(file: ParameterFile) -> _Side:
    return _Side(file.name, file.values, file.header.get('address', ''))


def _read(drive: Remote) -> _Side:
    drive.identify(thoroughly=False)
    return _Side(f'address {drive.address}', drive.read(), str(drive.address))


def _cell(side: _Side, key: str, model: Family) -> str:
    if key not in side.values:
        return _ABSENT
    return shown(side.values[key], model[key].unit if key in model else '')
