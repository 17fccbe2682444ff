# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameter files, which ``dump`` writes, ``load`` and ``diff`` read; names and values as typed.

They are ROS parameter files at the same time. In front stands a header in comments, which says
whose parameters these are; a file without one, such as ``ros2 param dump`` writes, is read too.
"""

from __future__ import annotations

import argparse
from collections.abc import Collection, Iterable, Iterator, Mapping
import contextlib
from dataclasses import dataclass, field
from decimal import Decimal
import difflib
import errno
import os
from pathlib import Path
import re
import sys
from typing import Any

import yaml

from nfo_sinus_driver.catalog import Access, Family, Parameter, Value
from nfo_sinus_driver.cli.console import CliError, listed, put
from nfo_sinus_driver.drive.known.changes import show

#: What the header says, in this order.
HEADER = ('model', 'product', 'firmware', 'serial number', 'address', 'date', 'written by')

_PARAMETERS = 'ros__parameters'
STANDARD = '-'
#: What ROS itself gives to nodes, below names with dots.
_ROS_OWN = ('qos_overrides.',)
_TITLE = '# Parameters of a drive; also a ROS parameter file.'
_HEADER_LINE = re.compile(rf'# ({"|".join(HEADER)}): (.*)')


@dataclass(frozen=True)
class ParameterFile:
    """
    The parameters in a file.

    :ivar name: of the file.
    :ivar header: what its header says, as text; empty without one.
    :ivar values: the parameters of the drive, by name.
    :ivar skipped: names that belong to the driver's node and not to the drive.
    """

    name: str
    values: Mapping[str, Value]
    header: Mapping[str, str] = field(default_factory=dict)
    skipped: tuple[str, ...] = ()


def format_file(header: Mapping[str, str], values: Mapping[str, Value], model: Family) -> str:
    """Return the text of a parameter file, with units in comments."""
    lines = [_TITLE, '#']
    said = {what: _one_line(header.get(what, '')) for what in HEADER}
    lines += [f'# {what}: {text}' for what, text in said.items() if text]
    lines += ['/**:', f'  {_PARAMETERS}:']
    for group in dict.fromkeys(key.partition('.')[0] for key in values):
        lines.append(f'    {group}:')
        for key, value in values.items():
            if key.partition('.')[0] == group:
                remark = f'  # {model[key].unit}' if key in model and model[key].unit else ''
                lines.append(f'      {key.partition(".")[2]}: {_scalar(value)}{remark}')
    return '\n'.join(lines) + '\n'


def write_file(name: str, text: str) -> None:
    """Write a parameter file; ``-`` is the standard output (CliError: it cannot be written)."""
    if name == STANDARD:
        put(text.removesuffix('\n'))
        return
    path = Path(name)
    try:
        if not path.name:
            # of such a path none beside it can be made
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        partial = path.with_name(f'{path.name}.{os.urandom(8).hex()}.part')
        if not path.exists() or path.is_file():
            # an older file is replaced by a whole one, or not at all
            with contextlib.ExitStack() as undo:
                file = undo.enter_context(partial.open('x', encoding='utf-8'))
                undo.callback(partial.unlink, missing_ok=True)
                file.write(text)
                file.close()
                partial.replace(path)
        else:
            path.write_text(text, encoding='utf-8')
    except OSError as error:
        raise CliError(f"{name or repr('')} cannot be written: {error.strerror}") from error


def read_file(name: str) -> ParameterFile:
    """
    Read a parameter file; ``-`` is the standard input.

    :raises CliError: it cannot be read, or is none.
    """
    if name == STANDARD and sys.stdin is None:
        raise CliError('the standard input cannot be read: it is closed')
    try:
        text = sys.stdin.read() if name == STANDARD else Path(name).read_text(encoding='utf-8')
    except OSError as error:
        raise CliError(f"{name or repr('')} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise CliError(f'{name} is no text in UTF-8: is it a parameter file?') from error
    return parse_file(text, 'the standard input' if name == STANDARD else name)


def parse_file(text: str, name: str) -> ParameterFile:
    """Return what a parameter file says, or a CliError."""
    try:
        # behind the mark of some editors its header would be none
        return _parse(text.removeprefix('\ufeff'), name)
    except RecursionError as error:
        why = 'one thing stands in the other, too deep'
        raise CliError(f'{name} is no parameter file: {why}') from error


def _parse(text: str, name: str) -> ParameterFile:
    try:
        tree = yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError) as error:
        raise CliError(f'{name} is no parameter file: {_one_line(str(error))}') from error
    except (ArithmeticError, AttributeError, LookupError, TypeError) as error:
        # what PyYAML raises without a word for people: !!timestamp x, !!bool x, an escape
        why = 'a value in it is none of its tag (!!), or an escape in it is no character'
        raise CliError(f'{name} is no parameter file: {why}') from error
    header = dict(_header(text))
    found = {}
    skipped: dict[str, None] = {}
    for section, parameters in _sections(tree):
        drive, own = _split(_flatten(parameters, name))
        skipped.update(dict.fromkeys(own))
        if drive:
            found[section] = drive
    if len(found) > 1:
        raise CliError(
            f'{name} has parameters of several drives ({", ".join(found)}): leave one of them in it'
        )
    if not found:
        raise CliError(f'{name} has no parameters of a drive, below {_PARAMETERS} of a node')
    return ParameterFile(name, next(iter(found.values())), header, tuple(skipped))


class _Loader(yaml.SafeLoader):
    """Like the safe loader, but a name that stands twice is no riddle with two answers."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Return a mapping whose names are unique."""
        names = [key.value for key, _ in node.value]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f'{name} stands twice in it')
        return super().construct_mapping(node, deep)


def _header(text: str) -> Iterator[tuple[str, str]]:
    for line in text.splitlines():
        if line and not line.startswith('#'):
            return
        match = _HEADER_LINE.fullmatch(line)
        if match:
            yield match[1], match[2].strip()


def _sections(tree: Any, prefix: str = '') -> Iterator[tuple[str, Any]]:
    """Return the nodes of a parameter file and what stands below each."""
    if not isinstance(tree, dict):
        return
    for key, value in tree.items():
        name = f'{prefix}/{key}'.replace('//', '/') if prefix else str(key)
        if isinstance(value, dict) and _PARAMETERS in value:
            yield name, value[_PARAMETERS]
        else:
            yield from _sections(value, name)


def _flatten(tree: Any, file: str) -> dict[str, Any]:
    """Return parameters by their full names, each of which may stand only once."""
    found: dict[str, Any] = {}
    for key, value in tree.items() if isinstance(tree, dict) else ():
        below = _flatten(value, file) if isinstance(value, dict) else {'': value}
        for name, item in below.items():
            full = f'{key}.{name}' if name else str(key)
            if full in found:
                raise CliError(f'{file} is no parameter file: {full} stands twice in it')
            found[full] = item
    return found


def _split(parameters: Mapping[str, Any]) -> tuple[dict[str, Value], list[str]]:
    """Separate the parameters of the drive, which have a group, from those of the node."""
    own = [name for name in parameters if '.' not in name or name.startswith(_ROS_OWN)]
    drive = {name: value for name, value in parameters.items() if name not in own}
    strange = [name for name, value in drive.items() if not isinstance(value, Value)]
    if strange:
        raise CliError(listed('these have no value that a parameter can have:', strange))
    return drive, own


def _scalar(value: Value) -> str:
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        # neither an exponent nor a missing point: YAML and ROS do not take either for a double
        text = f'{Decimal(repr(value)):f}'
        return text if '.' in text else f'{text}.0'
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return str(value)


def _one_line(text: str) -> str:
    """Return a text of which nothing can be taken for more than a line of a comment."""
    return ' '.join(''.join(c if c.isprintable() else ' ' for c in text).split())


#: The end of what is said where nothing could be written.
NOTHING = ', nothing was written'
_SWITCH = {'on': True, 'true': True, 'off': False, 'false': False}
#: Why a setting of the line is left alone.
BARRED = (
    'settings of the line are changed with --allow-communication-changes alone, '
    'for the drive may not be heard any more'
)


def shown(value: Value | None, unit: str) -> str:
    """Return a value with its unit; ``-`` where there is none."""
    return '-' if value is None else f'{show(value)} {unit}'.rstrip()


def same(value: Value | None, other: Value | None) -> bool:
    """Return whether two values are the same; 5 is 5.0, but on is not 1."""
    if isinstance(value, bool) or isinstance(other, bool):
        return value is other
    return value == other


def is_barred(key: str, model: Family, options: argparse.Namespace) -> bool:
    """Return whether a setting must not be changed without being asked for by an option."""
    return key in model.communication and not options.allow_communication_changes


def parse_value(parameter: Parameter, text: str) -> Value:
    """Turn what was typed for a parameter into its value; a ValueError says what can be."""
    if parameter.kind is bool and text.lower() in _SWITCH:
        return _SWITCH[text.lower()]
    choices = ', '.join(parameter.labels.values())
    if parameter.labels and parameter.kind is not int:
        labels = {label.lower(): label for label in parameter.labels.values()}
        if text.lower() not in labels:
            raise ValueError(f'{parameter.key}: {text!r} is none of {choices}')
        return labels[text.lower()]
    try:
        return int(text, 10)
    except ValueError:
        pass
    try:
        return parameter.meant(float(text))
    except ValueError:
        wanted = f'none of {choices}' if choices else 'not a number'
        raise ValueError(f'{parameter.key}: {text!r} is {wanted}') from None


def readable(model: Family) -> Mapping[str, Parameter]:
    """Return what this tool shows when asked for it by name: what can be read without effect."""
    return {parameter.key: parameter for parameter in model.values() if parameter.is_readable}


def require_settings(names: Iterable[str], model: Family) -> Mapping[str, Parameter]:
    """Return the settings of a model by name; ensure that all names are of these, to be written."""
    settings = {parameter.key: parameter for parameter in model.settings}
    strange = [name for name in dict.fromkeys(names) if name not in settings]
    others = [model[name] for name in strange if name in model]
    if others:
        lines = (
            f'{parameter.key} is only read: nfo-sinus get shows it'
            if parameter.access is Access.READ
            else f'{parameter.key} is no setting: the driver itself writes it'
            for parameter in others
        )
        raise CliError(listed(f'nothing was written to the {model.name}:', lines))
    require_names(names, settings, model.name, NOTHING)
    return settings


def require_names(names: Iterable[str], known: Iterable[str], whose: str, end: str = '') -> None:
    """Ensure that all names are known; those that are not are listed."""
    known = list(known)
    strange = [name for name in dict.fromkeys(names) if name not in known]
    if strange:
        what = 'no parameter of this name' if len(strange) == 1 else 'no parameters of these names'
        lines = (f'{name}{did_you_mean(name, known)}' for name in strange)
        raise CliError(listed(f'{whose} has {what}{end}:', lines))


def did_you_mean(name: str, known: Collection[str]) -> str:
    """Return a question for the known names that are close to one; ``''``: there is none."""
    bare = _bare(name)
    close = [key for key in known if _bare(key) == bare]
    close = close or difflib.get_close_matches(name.lower(), known, n=2)
    return f' (did you mean {" or ".join(close)}?)' if close else ''


def _bare(name: str) -> str:
    """Return a name without its group, as it is written by those who know the manual."""
    return name.rpartition('.')[2].lower().replace('-', '').replace('_', '')
