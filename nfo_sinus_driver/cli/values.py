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

"""Names and values as a person types and reads them."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from collections.abc import Mapping
import difflib

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.cli.console import CliError
from nfo_sinus_driver.cli.console import listed
from nfo_sinus_driver.drive.parameter_writer import show

_SWITCH = {'on': True, 'true': True, 'off': False, 'false': False}
_MEASURED = 'Status'
#: Why a setting of the line is left alone.
BARRED = (
    'settings of the line are changed with --allow-communication-changes alone, '
    'for the drive may not be heard any more'
)


def shown(value: Value | None, unit: str) -> str:
    """Return a value with its unit; ``-`` where there is none."""
    return '-' if value is None else f'{show(value)} {unit}'.rstrip()


def same(one: Value | None, other: Value | None) -> bool:
    """Tell whether two values are the same; 5 is 5.0, but on is not 1."""
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    return one == other


def is_barred(key: str, model: Family, options: argparse.Namespace) -> bool:
    """Tell whether a setting must not be changed without being asked for by an option."""
    return key in model.communication and not options.allow_communication_changes


def parse_value(parameter: Parameter, text: str) -> Value:
    """Turn what was typed for a parameter into its value; a ValueError says what can be."""
    if parameter.kind is bool and text.lower() in _SWITCH:
        return _SWITCH[text.lower()]
    if parameter.labels:
        labels = {label.lower(): label for label in parameter.labels.values()}
        if text.lower() not in labels:
            choices = ', '.join(parameter.labels.values())
            raise ValueError(f'{parameter.key}: {text!r} is none of {choices}')
        label = labels[text.lower()]
        return int(label) if parameter.kind is int else label
    try:
        return int(text, 10)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        raise ValueError(f'{parameter.key}: {text!r} is not a number') from None


def measured(model: Family) -> tuple[Parameter, ...]:
    """Return what a drive measures, where reading it has no effect."""
    return tuple(
        parameter
        for parameter in model.values()
        if parameter.group == _MEASURED and parameter.access is Access.READ
    )


def readable(model: Family) -> Mapping[str, Parameter]:
    """Return what this tool shows when asked for it by name: settings and measured values."""
    return {parameter.key: parameter for parameter in (*model.settings, *measured(model))}


def require_names(names: Iterable[str], known: Iterable[str], whose: str, end: str = '') -> None:
    """See to it that all names are known; those that are not are listed."""
    known = list(known)
    strange = [name for name in dict.fromkeys(names) if name not in known]
    if strange:
        what = 'no parameter of this name' if len(strange) == 1 else 'no parameters of these names'
        lines = (f'{name}{_did_you_mean(name, known)}' for name in strange)
        raise CliError(listed(f'{whose} has {what}{end}:', lines))


def _did_you_mean(name: str, known: list[str]) -> str:
    bare = _bare(name)
    close = [key for key in known if _bare(key) == bare]
    close = close or difflib.get_close_matches(name.lower(), known, n=2)
    return f' (did you mean {" or ".join(close)}?)' if close else ''


def _bare(name: str) -> str:
    """Return a name without its group, and as people write it who know the manual's names."""
    return name.rpartition('.')[2].lower().replace('-', '').replace('_', '')
