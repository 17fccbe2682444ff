# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verbs for one drive: ``info``, ``list``, ``get``, ``set`` and ``errors``."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
import math

from nfo_sinus_driver.catalog import Parameter, Role, Value, example_setting
from nfo_sinus_driver.cli.console import (
    CliError,
    OutputLost,
    UsageError,
    as_json,
    columns,
    listed,
    progress,
    put,
    put_columns,
    remark,
    require_yes,
    say,
    signals_noted,
)
from nfo_sinus_driver.cli.control_session import control_session
from nfo_sinus_driver.cli.options import Verb, add_allow, add_flag, change, count
from nfo_sinus_driver.cli.parameter_file import (
    BARRED,
    NOTHING,
    is_barred,
    parse_value,
    readable,
    require_names,
    require_settings,
    same,
    shown,
)
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import DriveError, LogEntry
from nfo_sinus_driver.drive.change.parameter_writer import ParameterError
from nfo_sinus_driver.link import Refused

_NAMEPLATE = (
    Role.NOMINAL_POWER,
    Role.NOMINAL_VOLTAGE,
    Role.NOMINAL_FREQUENCY,
    Role.NOMINAL_SPEED,
    Role.NOMINAL_CURRENT,
)
_COUNTERS = {Role.OPERATING_TIME: 'operating time', Role.RUNNING_TIME: 'running time'}


class Info(Verb):
    """Show who the drive is and how it is doing."""

    def main(self, options: argparse.Namespace) -> int:
        """Show who the drive is and how it is doing."""
        with Session(options) as session:
            drive = session.drive()
            identity = drive.identify()
            if not drive.identifies:
                remark(
                    'recognised by nothing of its own: any drive with the same registers is taken '
                    'for one'
                )
            status = drive.read_status()
            mode = _measure_roles(drive, [Role.CONTROL_MODE])
            nameplate = _measure_roles(drive, _NAMEPLATE)
            hours = _measure_roles(drive, _COUNTERS)
            words = drive.model.profile.module
            found = _measure(drive, filter(drive.params.reaches, words))
            module = ', '.join(words[key](value) for key, value in found.items())
            facts = {
                'address': str(drive.address),
                'port': options.port,
                'model': drive.model.name,
                'family': drive.model.profile.title,
                'product': identity.model,
                'vendor': identity.vendor,
                'firmware': identity.versions,
                'serial number': identity.serial,
                **({'module': module} if words else {}),
                'status': f'{drive.state.describe()} ({status.listed.description})',
                'state': status.state.name.lower().replace('_', ' '),
                'control mode': ''.join(mode.values()),
                'motor': ', '.join(nameplate.values()),
                **{_COUNTERS[role]: text for role, text in hours.items()},
            }
        if options.json:
            put(as_json(facts, indent=2))
        else:
            put_columns([(name, fact or '-') for name, fact in facts.items()])
        return 0


class List(Verb):
    """Show all settings of the drive."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            '--group', metavar='GROUP',
            help='only this one, such as Motor; Status are the measured values',
        )

    def main(self, options: argparse.Namespace) -> int:
        """Show all settings of the drive, or one group."""
        with Session(options) as session:
            drive = session.drive()
            if options.group is None:
                wanted = {parameter.key: parameter for parameter in drive.model.settings}
            else:
                wanted = _of_group(drive, options.group)
            values = _read(drive, wanted)
        wanted = {key: parameter for key, parameter in wanted.items() if key in values}
        if options.json:
            _put_values(wanted, values)
            return 0
        rows = [
            (f'  {key}', _spelled(drive, parameter, values[key]), parameter.description)
            for key, parameter in wanted.items()
        ]
        group = ''
        for line, parameter in zip(columns(rows), wanted.values(), strict=True):
            if parameter.group != group:
                put(f'{chr(10) if group else ""}{parameter.group}')
                group = parameter.group
            put(line)
        return 0


class Get(Verb):
    """Show some parameters."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        setting, _ = example_setting()
        parser.add_argument('names', nargs='+', metavar='NAME', help=f'such as {setting}')

    def main(self, options: argparse.Namespace) -> int:
        """Show some parameters."""
        with Session(options) as session:
            drive = session.drive()
            known = readable(drive.model)
            require_names(options.names, known, drive.model.name)
            wanted = {name: known[name] for name in options.names}
            values = _read(drive, wanted)
        require_names(options.names, values, str(drive))
        if options.json:
            _put_values(wanted, values)
            return 0
        put_columns([(key, _spelled(drive, wanted[key], values[key])) for key in wanted])
        return 0


class Errors(Verb):
    """Show the error log, newest entry first."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            '--count', type=count, default=0, metavar='TIMES',
            help='at most so many entries; more than 32 where a drive has them (default: 0, which '
            'is all, or 32)',
        )
        add_flag(parser, '--erase', 'erase it, after it was shown')

    def main(self, options: argparse.Namespace) -> int:
        """Show the error log, or erase it."""
        with Session(options) as session:
            drive = session.drive()
            drive.identify(thoroughly=False)
            entries = drive.error_log(0 if options.erase else options.count)
            if options.erase and drive.read_status().driven:
                raise CliError(f'the motor runs ({drive.state.describe()}): stop it first')
        rows = [_as_row(entry) for entry in entries]
        if not options.json:
            _put_entries(entries)
        if options.erase:
            return _erase(options, entries, rows)
        if options.json:
            put(as_json(rows, indent=2))
        elif not entries:
            put('the error log is empty')
        return 0


def _put_entries(entries: Sequence[LogEntry]) -> None:
    def hours(value: float, unit: str) -> str:
        return '-' if math.isnan(value) else f'{value:.1f} {unit}'

    rows = [
        (
            hours(entry.operating_time, 'h'),
            str(entry.code),
            entry.full_text,
            hours(entry.age, 'operating hours ago'),
            entry.wall_time,
        )
        for entry in entries
    ]
    put_columns(rows, right=(0, 1))


def _as_row(entry: LogEntry) -> dict[str, object]:
    return {
        'code': entry.code,
        'text': entry.full_text,
        'operating_time': round(entry.operating_time, 1),
        'age': round(entry.age, 1),
        'time': entry.wall_time,
    }


def _put_values(wanted: Mapping[str, Parameter], values: Mapping[str, Value]) -> None:
    """Print parameters with their units, for a script."""
    shown_ = {key: {'value': values[key], 'unit': wanted[key].unit} for key in wanted}
    put(as_json(shown_, indent=2))


def _spelled(drive: OfflineDrive, parameter: Parameter, value: Value) -> str:
    """Return a value with its unit, and as the display of the drive shows it."""
    text = shown(value, parameter.unit)
    spelled = drive.model.spelled(parameter.key, value)
    return f'{text} ({spelled})' if spelled else text


def _of_group(drive: OfflineDrive, name: str) -> dict[str, Parameter]:
    every = readable(drive.model).values()
    found = {
        parameter.key: parameter
        for parameter in every
        if name.lower() in (parameter.group.lower(), parameter.key.partition('.')[0])
    }
    if not found:
        groups = dict.fromkeys(parameter.group for parameter in every)
        raise CliError(f'there is no group {name!r}: choose one of {", ".join(groups)}')
    return found


def _read(drive: OfflineDrive, wanted: Mapping[str, Parameter]) -> Mapping[str, Value]:
    """Return the values of settings and measured values, without those that the drive lacks."""
    drive.identify(thoroughly=False)
    settings = [key for key, parameter in wanted.items() if parameter.is_setting]
    values = dict(drive.read(settings)) if settings or not wanted else {}
    others = [key for key in wanted if key not in settings and drive.state.nameplate.has(key)]
    values.update(_measure(drive, others))
    return values


def _measure_roles(drive: OfflineDrive, roles: Iterable[Role]) -> dict[Role, str]:
    keys = {role: drive.model.key(role) for role in roles}
    found = _measure(drive, filter(drive.params.reaches, keys.values()))
    return {
        role: shown(found[key], drive.model[key].unit) for role, key in keys.items() if key in found
    }


def _measure(drive: OfflineDrive, keys: Iterable[str]) -> dict[str, Value]:
    keys = list(keys)
    found = {}
    with progress(f'reading {drive}', len(keys)) as step:
        for key in keys:
            try:
                found[key] = drive.measure(key)
            except DriveError as error:
                # what the drive refuses to show is not there
                if not isinstance(error.__cause__, Refused):
                    raise
            step()
    return found


def _erase(options: argparse.Namespace, entries: Sequence[LogEntry], rows: object) -> int:
    """Erase the error log, whose entries are ``rows`` for a script; see that it is empty."""
    count = '1 entry' if len(entries) == 1 else f'{len(entries)} entries'
    if entries:
        require_yes(options, f'Erase the error log ({count}) of address {options.address}?')
        with control_session(options) as control:
            drive = control.command()
            control.finish(drive.connect())
            control.finish(drive.erase_error_log())
    if options.json:
        put(as_json({'erased': rows}, indent=2))
    else:
        put(f'erased: {count}' if entries else 'the error log is empty already')
    return 0


class Set(Verb):
    """Change parameters, all of them or none."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        setting, value = example_setting()
        parser.add_argument(
            'changes', nargs='+', type=change, metavar='NAME=VALUE',
            help=f'such as {setting}={value:g}',
        )
        add_allow(parser)

    def main(self, options: argparse.Namespace) -> int:
        """Change parameters, all of them or none."""
        times = Counter(name for name, _ in options.changes)
        twice = [name for name, count in times.items() if count > 1]
        if twice:
            raise UsageError(f'{", ".join(twice)} is given twice')
        with Session(options, writes=True) as session:
            drive = session.drive()
            settings = require_settings(times, drive.model)
            wanted, wrong = {}, []
            for name, text in options.changes:
                try:
                    wanted[name] = parse_value(settings[name], text)
                except ValueError as error:
                    wrong.append(str(error))
            if not wrong:
                drive.identify(thoroughly=False)
                values = drive.read(wanted)
                require_names(wanted, values, str(drive), NOTHING)
                for name, value in wanted.items():
                    try:
                        exact = drive.parameters.coerce(name, value)
                        barred = is_barred(name, drive.model, options)
                        if barred and not same(exact, values.get(name)):
                            wrong.append(f'{name}: {BARRED}')
                        else:
                            drive.parameters.validate(name, value)
                    except ParameterError as error:
                        wrong.append(say(error))
            if wrong:
                raise CliError(listed('nothing was written:', wrong))
            # what is half-way is not all or none: a signal waits until it is done
            with signals_noted(to_the_end=True):
                changes = drive.parameters.change(wanted).result()
            values = drive.parameters.values
        try:
            if options.json:
                _put_values({name: settings[name] for name in wanted}, values)
                return 0
            changed = {made.key: made for made in changes}
            for name in wanted:
                as_it_was = f'{name}: {shown(values[name], settings[name].unit)}, as it was'
                put(str(changed.get(name, as_it_was)))
        except OutputLost as error:
            # that it failed would be taken for "nothing was written"
            raise CliError(listed(f'{error}; written are:', map(str, changes))) from error
        return 0


