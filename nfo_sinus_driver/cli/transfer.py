# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verbs that have to do with files: ``dump``, ``load`` and ``diff``."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from importlib import metadata
import signal
import sys

from nfo_sinus_driver.catalog import Family, Role, Value, load_family
from nfo_sinus_driver.cli.console import (
    CliError,
    Interrupted,
    UsageError,
    as_json,
    can_ask,
    listed,
    progress,
    put,
    put_columns,
    remark,
    say,
    signals_handled,
    signals_noted,
)
from nfo_sinus_driver.cli.options import Verb, add_allow, add_flag, address, command_line
from nfo_sinus_driver.cli.parameter_file import (
    NOTHING,
    ParameterFile,
    format_file,
    is_barred,
    read_file,
    require_names,
    require_settings,
    same,
    shown,
    write_file,
)
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import DriveError, Identity
from nfo_sinus_driver.drive.change.parameter_writer import ParameterError
from nfo_sinus_driver.drive.known.changes import ParameterChange, shown_raw


class Dump(Verb):
    """Save all settings of the drive."""

    json = False

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            'file', nargs='?', default='-', metavar='FILE', help='default: standard output',
        )

    def main(self, options: argparse.Namespace) -> int:
        """Save all settings of the drive."""
        with Session(options) as session:
            drive = session.drive()
            identity = drive.identify()
            values = drive.read()
            lost = [key for key in drive.parameters.data if key not in values]
        write_file(options.file, format_file(_header(drive, identity), values, drive.model))
        where = '' if options.file == '-' else f' saved in {options.file}'
        named = ', '.join(filter(None, (str(drive), str(identity))))
        remark(f'{len(values)} parameters of {named}{where}')
        if lost:
            remark(listed('NOT saved, for the drive has a code that means nothing there:', lost))
        return int(bool(lost))


class Load(Verb):
    """Put saved settings into the drive; only what differs is written."""

    json = False

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument('file', metavar='FILE', help='- is the standard input')
        add_flag(parser, '--dry-run', 'only show what would change; write nothing')
        add_allow(parser)
        after = parser.add_mutually_exclusive_group()
        add_flag(
            after, '--put-back', 'if it fails half-way, put back what was written without asking',
        )
        add_flag(after, '--keep', 'if it fails half-way, leave what was written')

    def main(self, options: argparse.Namespace) -> int:
        """Put saved settings into the drive; only what differs is written."""
        file = read_file(options.file)
        # what another model has is refused before anything is asked of the drive
        model = load_family(options.model)
        require_settings(file.values, model)
        file = _meant(file, model)
        with Session(options, writes=not options.dry_run) as session:
            drive = session.drive()
            identity = drive.identify()
            for note in _notes(file, drive, identity):
                remark(note)
            values = drive.read(file.values)
            require_names(file.values, drive.parameters.data, str(drive), NOTHING)
            data = _differing(file, drive, options)
            for key in data:
                # as bytes where they mean nothing
                old = values.get(key, shown_raw(drive.parameters.data[key]))
                new = drive.params.value(key, data[key])
                put(str(ParameterChange(key, old, new, drive.model[key].unit)))
            count = 'one parameter' if len(data) == 1 else f'{len(data)} parameters'
            if not data:
                remark(f'nothing to write: {drive} has all of it already')
                return 0
            _require_standstill(drive, data)
            if options.dry_run:
                remark(f'a dry run: {count} would be written, nothing was')
                return 0
            Loading(drive, data, options).run()
        remark(f'{count} written and read back')
        return 0


def _meant(file: ParameterFile, model: Family) -> ParameterFile:
    """Return a file with its values as they were meant for a model."""
    values = {
        key: model[key].meant(value) if key in model else value
        for key, value in file.values.items()
    }
    return replace(file, values=values)


def _header(drive: OfflineDrive, identity: Identity) -> dict[str, str]:
    try:
        version = metadata.version('nfo_sinus_driver')
    except metadata.PackageNotFoundError:
        version = ''
    return {
        'model': drive.model.name,
        'product': identity.model,
        'firmware': identity.versions,
        'serial number': identity.serial,
        'address': str(drive.address),
        'date': f'{datetime.now().astimezone():%Y-%m-%d %H:%M:%S %z}',
        'written by': f'nfo-sinus {version}'.strip(),
    }


def _notes(file: ParameterFile, drive: OfflineDrive, identity: Identity) -> list[str]:
    """Return what the operator should know before a file goes into a drive."""
    notes = []
    if file.skipped:
        notes.append(f'left out, for the drive has none such: {", ".join(file.skipped)}')
    saved = file.header
    if saved.get('model', drive.model.name) != drive.model.name:
        notes.append(f'{file.name} is of a {saved["model"]}, this is a {drive.model.name}')
    serial = saved.get('serial number', '')
    if serial and identity.serial and serial != identity.serial:
        notes.append(f'cloning from serial number {serial} to {identity.serial}')
    product = saved.get('product', '')
    if product and identity.model and product != identity.model:
        notes.append(f'{file.name} is of a {product}, this is a {identity.model}')
    if saved.get('firmware', identity.versions) != identity.versions:
        notes.append(f'saved with firmware {saved["firmware"]}, this one has {identity.versions}')
    return notes


def _differing(
    file: ParameterFile, drive: OfflineDrive, options: argparse.Namespace
) -> dict[str, bytes]:
    """Return what has to be written; all that cannot be is listed in a CliError."""
    found: dict[str, bytes] = {}
    wrong, kept = [], []
    for key, value in file.values.items():
        if same(value, drive.parameters.values.get(key)):
            continue
        try:
            data = drive.params.encode(key, value)
            if data == drive.parameters.data[key]:
                continue
            if is_barred(key, drive.model, options):
                kept.append(key)
                continue
            if not options.dry_run:
                drive.parameters.validate(key, value)
        except (ParameterError, ValueError) as error:
            wrong.append(say(error))
        else:
            found[key] = data
    if wrong:
        raise CliError(listed(f'{file.name} has what this drive cannot have{NOTHING}:', wrong))
    if kept:
        remark(_left_as_it_is(file, drive, kept))
    return found


def _left_as_it_is(file: ParameterFile, drive: OfflineDrive, keys: list[str]) -> str:
    lines = [
        f'{key}: {shown(drive.parameters.values.get(key), "")}, not {shown(file.values[key], "")}'
        for key in keys
    ]
    head = 'settings of the line stay as they are without --allow-communication-changes:'
    return listed(head, lines)


def _require_standstill(drive: OfflineDrive, data: Mapping[str, bytes]) -> None:
    """Ensure that what only a standing motor allows is not tried while it runs."""
    keys = [key for key in data if drive.model.needs_standstill(key)]
    if keys and drive.read_status().driven:
        head = f'the motor runs ({drive.state.describe()}), and these need it stopped{NOTHING}:'
        raise CliError(listed(head, keys))


class Loading:
    """Writes what differs into one drive; the options say what to do when it fails half-way."""

    def __init__(
        self, drive: OfflineDrive, data: Mapping[str, bytes], options: argparse.Namespace
    ) -> None:
        self._drive = drive
        self._data = data
        self._options = options
        #: What the drive had, to be put back.
        self._before = {key: drive.parameters.data[key] for key in data}
        self._written: dict[str, ParameterChange] = {}

    def run(self) -> None:
        """Write all of it; if that fails, say what was written and what not, or put it back."""
        # a second Ctrl-C does not keep the first from being answered
        with signals_noted(to_the_end=True):
            self._run()

    def _run(self) -> None:
        try:
            self._write('writing', self._data, self._written)
        except (DriveError, Interrupted) as error:
            doubtful = error.left if isinstance(error, ParameterError) else ()
            self._tell_how_far(error)
            stained = list(dict.fromkeys((*self._written, *doubtful)))
            raise CliError(self._clean_up(stained)) from error

    def _write(
        self, what: str, data: Mapping[str, bytes], written: dict[str, ParameterChange]
    ) -> None:
        """
        Write, and keep account of it; a signal ends it after the parameter on its way.

        It does not end the putting back, which would leave the drive with a half of each.
        """
        puts_back = written is not self._written
        with signals_noted() as came, progress(f'{what} {self._drive}', len(data)) as step:

            def wrote(change: ParameterChange) -> None:
                written[change.key] = change
                step()
                if came() and not puts_back and len(written) < len(data):
                    raise Interrupted

            self._drive.parameters.write_each(data, wrote).result()

    def _tell_how_far(self, error: Exception) -> None:
        """Say what was written and what was not."""
        left = [key for key in self._data if key not in self._written]
        refused = error.key if isinstance(error, ParameterError) else ''
        failed = [key for key in left if key == refused]
        left = [key for key in left if key != refused]
        remark(say(error))
        if self._written:
            remark(listed('written:', map(str, self._written.values())))
        if failed:
            remark(listed('tried without success:', failed))
        if left:
            remark(listed('not written:', left))

    def _clean_up(self, stained: list[str]) -> str:
        """Put back what was written, if that is wanted; return what the drive has then."""
        if not stained:
            return 'not loaded: the drive is as it was'
        if not self._options.put_back and not self._wants_it_back():
            if self._written:
                remark(f'to put it back:\n  {self._how_to_put_back()}')
            return f'not loaded: {len(self._written)} of {len(self._data)} were written'
        back: dict[str, ParameterChange] = {}
        try:
            self._write('putting back', {key: self._before[key] for key in stained}, back)
        except DriveError as error:
            if back:
                remark(listed('put back:', map(str, back.values())))
            lost = (key for key in stained if key not in back)
            head = f'NOT all put back, {say(error)}; not as it was:'
            return listed(head, map(self._state, lost))
        return f'not loaded: all that was written is put back ({len(back)}), the drive is as it was'

    def _wants_it_back(self) -> bool:
        if self._options.keep or not can_ask():
            return False
        print('Put back what was written? [Y/n] ', end='', file=sys.stderr, flush=True)
        try:
            with signals_handled(signal.default_int_handler):
                answer = sys.stdin.readline()
        except KeyboardInterrupt:
            answer = ''
        # the end of the input is no answer
        return answer.endswith('\n') and answer.strip().lower() in ('', 'y', 'yes')

    def _state(self, key: str) -> str:
        """Return what is known of a parameter that could not be put back."""
        change = self._written.get(key)
        if change is None:
            return f'{key}, of which nothing is known'
        return f'{key}: {shown(change.new, change.unit)}, was {shown(change.old, change.unit)}'

    def _how_to_put_back(self) -> str:
        words = [f'{key}={shown(change.old, "")}' for key, change in self._written.items()]
        if not self._drive.model.communication.isdisjoint(self._written):
            words.insert(0, '--allow-communication-changes')
        return command_line(self._options, 'set', *words)


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


class Diff(Verb):
    """Compare a drive with a file, two files, or two drives."""

    #: 1 is: there are differences.
    failed = 2

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            'files', nargs='*', metavar='FILE', help='with the drive, or two of them',
        )
        parser.add_argument(
            '--against', type=address, metavar='N', help='compare with the drive at this address',
        )

    def main(self, options: argparse.Namespace) -> int:
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
            sides = {'left': left.values, 'right': right.values}
            table = {
                key: {side: values.get(key) for side, values in sides.items()} for key in differing
            }
            put(as_json(table, indent=2))
        elif differing:
            rows = [(key, _cell(left, key, model), _cell(right, key, model)) for key in differing]
            put_columns([('', left.name, right.name), *rows])
        return int(bool(differing))


def _sides(options: argparse.Namespace) -> tuple[_Side, _Side]:
    files, against = options.files, options.against
    model = load_family(options.model)
    if len(files) == 2 and against is None:
        first, other = (_meant(read_file(name), model) for name in files)
        return _side(first), _side(other)
    if len(files) == 1 and against is None:
        return _with_drive(_meant(read_file(files[0]), model), options)
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


def _read(drive: OfflineDrive) -> _Side:
    drive.identify(thoroughly=False)
    return _Side(f'address {drive.address}', drive.read(), str(drive.address))


def _cell(side: _Side, key: str, model: Family) -> str:
    if key not in side.values:
        return _ABSENT
    return shown(side.values[key], model[key].unit if key in model else '')
