# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``history``: the operating records that drivers have kept on this computer."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import csv
from datetime import datetime
import io
import math
from typing import NamedTuple

from nfo_sinus_driver.cli.console import CliError, put, put_columns, remark
from nfo_sinus_driver.cli.options import Verb, add_flag
from nfo_sinus_driver.operating_record import files
from nfo_sinus_driver.operating_record.figures import HIGHEST, EnergySource, Figures, Record

_SOURCES = {
    EnergySource.NONE: '',
    EnergySource.COUNTER: 'by the counter of the drive',
    EnergySource.POWER: 'by its measured power',
}
_COLUMNS = (
    'drive', 'serial_number', 'period', 'since', 'figure', 'detail', 'value', 'unit', 'last',
)


class _Row(NamedTuple):
    """
    One figure of one period.

    :ivar detail: of which reason or fault, or where it comes from.
    :ivar last: when it came last, s since 1970; NaN: nothing tells it.
    """

    figure: str
    detail: str
    value: float
    unit: str
    last: float = math.nan


class History(Verb):
    """Show what drives have done: the operating records that drivers keep on this computer."""

    json = False

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Take the form."""
        add_flag(parser, '--csv', 'print a table of comma-separated values, for a script')

    def main(self, options: argparse.Namespace) -> int:
        """Show them; one that cannot be read is a failure."""
        try:
            found = list(files.records())
        except OSError as error:
            raise CliError(str(error)) from None
        kept = [record for record in found if isinstance(record, Record)]
        wrong = [why for why in found if isinstance(why, str)]
        if options.csv:
            put(_csv(kept))
        for record in () if options.csv else kept:
            _put_record(record)
        for why in wrong:
            remark(why)
        if not found:
            remark(
                f'there is no operating record in {files.folder()}: a driver that runs as another '
                'user or service keeps them in its own state folder; set XDG_STATE_HOME to that'
            )
        return int(bool(wrong) or not found)


def _rows(record: Record, figures: Figures) -> Iterator[_Row]:
    yield _Row('powered_time', '', figures.powered_time, 'h')
    yield _Row('running_time', '', figures.running_time, 'h')
    yield _Row('starts', '', figures.starts, '')
    yield _Row('reversals', '', figures.reversals, '')
    for name, count in sorted(figures.stops.items()):
        yield _Row('stops', name, count, '')
    for code, fault in sorted(figures.faults.items()):
        yield _Row('faults', f'{code} {fault.text}'.strip(), fault.count, '', fault.last)
    yield _Row('energy', _SOURCES[record.energy_source], figures.energy_kwh, 'kWh')
    for name, unit in HIGHEST.items():
        yield _Row(f'highest_{name}', '', figures.highest.get(name, math.nan), unit)
    yield _Row('line_errors', '', figures.line_errors, '')
    yield _Row('longest_silence', '', figures.longest_silence, 's')


def _csv(kept: list[Record]) -> str:
    text = io.StringIO()
    table = csv.writer(text, lineterminator='\n')
    table.writerow(_COLUMNS)
    for record in kept:
        for period, figures in (('total', record.total), ('shift', record.shift)):
            since = _local(figures.since, 'seconds')
            for row in _rows(record, figures):
                value = '' if math.isnan(row.value) else f'{row.value:.15g}'
                last = '' if math.isnan(row.last) else _local(row.last, 'seconds')
                table.writerow((
                    record.drive, record.serial, period, since,
                    row.figure, row.detail, value, row.unit, last,
                ))
    return text.getvalue().rstrip('\n')


def _put_record(record: Record) -> None:
    """Print a record as a table for a person."""
    place = '' if record.serial else ' (by its place, for no serial number can be read)'
    shift = {(row.figure, row.detail): row for row in _rows(record, record.shift)}
    rows = [
        (
            ' '.join(filter(None, (row.figure.replace('_', ' '), row.detail))),
            _shown(row),
            _shown(shift[row.figure, row.detail]) if (row.figure, row.detail) in shift else '-',
            '' if math.isnan(row.last) else f'last {_local(row.last)}',
        )
        for row in _rows(record, record.total)
    ]
    since = (f'since {_local(figures.since)}' for figures in (record.total, record.shift))
    put(f'{record.drive}{place}')
    put_columns([('', 'total', 'shift', ''), ('', *since, ''), *rows])
    put('')


def _shown(row: _Row) -> str:
    if math.isnan(row.value):
        return '-'
    number = f'{row.value:,.3g}' if row.unit in ('%', 'degC') else f'{row.value:,.2f}'
    number = number if row.unit else f'{row.value:,.0f}'
    return f'{number} {row.unit}'.strip()


def _local(seconds: float, precision: str = 'minutes') -> str:
    """Return the local time of a moment, s since 1970, with its offset where it has seconds."""
    moment = datetime.fromtimestamp(seconds)
    if precision == 'minutes':
        return moment.isoformat(' ', precision)
    return moment.astimezone().isoformat('T', precision)
