# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The view as rows of text: every drive in a table, one of them in full; nothing is drawn here."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime
import itertools
import math
import re
import unicodedata

from nfo_sinus_driver.view.picture import (
    Condition,
    DriveView,
    Figures,
    Level,
    Measured,
    Note,
    Picture,
    Source,
)
from nfo_sinus_driver.view.plot import plot, span

#: How often the source should be asked, s.
PERIOD = 0.25
#: How many pictures a column of a plot stands for, and how many columns are remembered.
_PICTURES_A_COLUMN = 4
_REMEMBERED = 600
_MOST_NOTES = 50
#: From here on it is said why a line is so busy, as a share of it.
_FULL = 0.9
#: From this width on the drive in full stands beside the table, which has so much of it.
_WIDE = 120
_TABLE_WIDTH = 79
_PLOT_HEIGHT = 3
#: How many lines of the log there are, where the screen has room for so many.
_LOG_HEIGHT = 6
#: What is older is shown as old, s.
_FRESH = 4.0

#: Pieces of text, each with its style: names of attributes and colours, separated by blanks.
Row = list[tuple[str, str]]

#: What stands before a status, so that colours are not needed, and its style; the worst first.
_MARKS = {
    Condition.GONE: ('·', 'dim'),
    Condition.SILENT: ('?', 'bold magenta'),
    Condition.FAULT: ('✗', 'bold red'),
    Condition.ALARM: ('▲', 'bold yellow'),
    Condition.RUNS: ('►', 'bold green'),
    Condition.STANDS: ('■', ''),
}
_FINE = (Condition.RUNS, Condition.STANDS)
_ALERT = 'bold red reverse'
_LEVELS = {Level.INFO: '', Level.WARNING: 'yellow', Level.ERROR: 'bold red'}

#: What can be plotted: its name, its unit, its decimals, and the least that the axis shows.
_QUANTITIES: dict[str, tuple[str, str, int, float]] = {
    'output_current': ('current', 'A', 2, 1.0),
    'frequency': ('frequency', 'Hz', 1, 10.0),
    'speed': ('speed', 'rpm', 0, 100.0),
    'torque': ('torque', '%', 0, 20.0),
}

#: Units in which a tenth is fine enough; of others, such as m/s, three digits are shown.
_COARSE = ('Hz', 'rpm', '%', '')
_MOST_DECIMALS = 4


def _number(value: float, decimals: int, unit: str = '') -> str:
    # no minus before a zero
    text = f'{round(value, decimals) + 0.0:.{decimals}f}' if math.isfinite(value) else '-'
    return f'{text} {unit}'.rstrip()


def _in_unit(value: float, unit: str, width: int = 1000) -> str:
    """Return a value in a unit that may be the operator's own, without it where it does not fit."""
    decimals = 1
    if unit not in _COARSE and math.isfinite(value) and value:
        decimals = min(_MOST_DECIMALS, max(0, 2 - math.floor(math.log10(abs(value)))))
    text = _number(value, decimals, unit)
    return text if len(text) <= width else _number(value, decimals)


#: The columns behind the name: heading, width, and what stands in it, to the right.
_NAME_WIDTH, _STATUS_WIDTH = 16, 18
_COLUMNS: tuple[tuple[str, int, Callable[[DriveView], str]], ...] = (
    ('set', 10, lambda drive: _in_unit(drive.setpoint, drive.unit, 10)),
    ('actual', 10, lambda drive: _in_unit(drive.actual, drive.unit, 10)),
    ('rpm', 6, lambda drive: _number(drive.measured.speed, 0)),
    ('A', 6, lambda drive: _number(drive.measured.output_current, 2)),
)


def fitted(row: Row, width: int, *, fill: bool = False) -> Row:
    """Return a row that is no wider, nor narrower with ``fill``, without control characters."""
    fits: Row = []
    left = width
    for text, style in row:
        # what a drive or an operator has named may be anything
        text = ''.join(character if character.isprintable() else ' ' for character in text)
        wide = [_columns_of(character) for character in text]
        if sum(wide) > left:
            kept = sum(end < left for end in itertools.accumulate(wide))
            fits.append((f'{text[:kept]}…'[:left], style))
            left -= min(left, sum(wide[:kept]) + 1)
            break
        fits.append((text, style))
        left -= sum(wide)
    return [*fits, (' ' * left, '')] if fill else fits


def _columns_of(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    return 1 + (unicodedata.east_asian_width(character) in 'WF')


def wrapped(row: Row, width: int) -> list[Row]:
    """Return a row as several, broken at blanks, or within what is too long for a row."""
    width = max(width, 20)
    rows: list[Row] = [[]]
    left = width
    for text, style in row:
        for blanks, word in re.findall(rf'([ \n]*)([^ \n]{{0,{width}}})', text):
            if len(blanks + word) > left:
                rows.append([])
                left, blanks = width, ''
            rows[-1].append((blanks + word, style))
            left -= len(blanks + word)
    return rows


def _filled(rows: list[Row], height: int) -> list[Row]:
    """Return rows of this number: the first ones, or empty ones besides."""
    return [*rows, *([] for _ in range(height))][:height]


def natural(name: str) -> list[tuple[int, int, str]]:
    """Return what sorts ``drive_2`` before ``drive_10``."""
    parts = re.findall(r'\d+|\D+', name)
    return [(0, int(part), '') if part.isdigit() else (1, 0, part) for part in parts]


def short_names(names: Sequence[str], width: int) -> dict[str, str]:
    """Return names without the namespace that all of them are in, and cut at the left."""
    spaces = {name[: name.rfind('/') + 1] for name in names}
    common = len(spaces.pop()) if len(names) > 1 and len(spaces) == 1 else 0
    return {
        name: text if len(text) <= width else f'…{text[len(text) - width + 1 :]}'
        for name, text in ((name, name[common:]) for name in names)
    }


class Layout:
    """
    What a source reports, as rows for a screen of any size, and what the keys do.

    :param source: asked by :meth:`take_picture`, which should be called every :data:`PERIOD`.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._picture = Picture((), {}, ())
        self._drives: list[DriveView] = []
        self._chosen = ''
        #: The first drive in the table, and how many there is room for.
        self._top = 0
        self._page = 1
        self._history: dict[str, deque[Measured]] = {}
        self._pictures = 0
        self._notes: deque[Note] = deque(maxlen=_MOST_NOTES)
        self._quantities = list(_QUANTITIES)
        #: The drive whose error log is shown, in the place of plots; '': none is.
        self._errors_of = ''

    def take_picture(self) -> None:
        """Take the next picture."""
        self._picture = picture = self._source.next_picture()
        self._drives = sorted(picture.drives, key=lambda drive: natural(drive.name))
        for drive in self._drives:
            past = self._history.setdefault(drive.name, deque(maxlen=_REMEMBERED))
            if past and self._pictures % _PICTURES_A_COLUMN:
                past.pop()
            past.append(drive.measured)
        self._pictures += 1
        self._notes.extend(picture.notes)
        self._choose(self._at)

    # --- keys ---------------------------------------------------------------------------------

    def press(self, key: str) -> None:
        """Do what a key is for; all but ``q`` are known here."""
        moves = {
            'up': -1, 'down': 1, 'page up': -self._page, 'page down': self._page,
            'home': -len(self._drives), 'end': len(self._drives),
        }
        if key in moves:
            self._choose(self._at + moves[key])
        elif key == 'n':
            self._choose_trouble()
        elif key == 'p':
            self._errors_of = ''
            self._quantities.append(self._quantities.pop(0))
        elif key == 'e' and self._drives:
            self._errors_of = '' if self._errors_of else self._chosen
            if self._errors_of:
                self._source.read_errors(self._chosen)
        elif key == 's' and self._drives and not self._source.only_looks:
            self._source.stop(self._chosen)
        elif key == 'a' and not self._source.only_looks:
            self._source.stop_all()
        elif key == 'k' and self._drives and not self._source.only_looks:
            self._source.acknowledge(self._chosen)

    @property
    def _at(self) -> int:
        names = [drive.name for drive in self._drives]
        return names.index(self._chosen) if self._chosen in names else 0

    def _choose(self, place: int) -> None:
        if self._drives:
            self._chosen = self._drives[max(0, min(place, len(self._drives) - 1))].name
        if self._errors_of not in ('', self._chosen):
            self._errors_of = self._chosen
            self._source.read_errors(self._chosen)

    def _choose_trouble(self) -> None:
        """Choose the next drive that needs attention."""
        number, at = len(self._drives), self._at
        for place in ((at + step) % number for step in range(1, number + 1)):
            if self._drives[place].condition not in _FINE:
                self._choose(place)
                return

    # --- rows ---------------------------------------------------------------------------------

    def rows(self, width: int, height: int) -> list[Row]:
        """Return all there is to see, from top to bottom."""
        rule: Row = [('─' * width, 'dim')]
        head = self._head()[: 2 + height // 40]
        stops = [row for why in self._picture.stops for row in wrapped([(why, _ALERT)], width)]
        log = self._log(width, max(height // 6, min(_LOG_HEIGHT, height // 4)))
        end = [*stops[:4], rule, *log, self._keys()]
        room = max(0, height - len(head) - len(end))
        if width >= _WIDE:
            left = _filled(self._table(room), room)
            right = _filled(self._full(width - _TABLE_WIDTH - 2, room), room)
            body = [
                [*fitted(row, _TABLE_WIDTH, fill=True), ('│ ', 'dim'), *other]
                for row, other in zip(left, right, strict=True)
            ]
        else:
            table = self._table(room * 45 // 100)
            body = [*table, rule, *self._full(width, room - len(table) - 1)]
        return [fitted(row, width) for row in (*head, *_filled(body, room), *end)][:height]

    def _head(self) -> list[Row]:
        number = len(self._drives)
        head = [(f'{number or "no"} drive{"s" * (number != 1)}', 'bold')]
        # the worst first: what there is no room for is cut off
        for condition, (mark, style) in _MARKS.items():
            count = sum(drive.condition is condition for drive in self._drives)
            if count:
                head.append((f'  {mark} {count} {condition.value}', style))
        if self._source.only_looks:
            head.append((f'  {self._source.only_looks}', 'dim'))
        head.append((f'  {self._source.title}', 'dim'))
        lines = sorted(
            self._picture.lines.items(), key=lambda line: -(line[1].timeouts + line[1].damaged)
        )
        return [head, *([(f'{name}: {_figures(line)}', 'dim')] for name, line in lines)]

    def _keys(self) -> Row:
        """Return what keys there are, without those that act where the source only looks."""
        acts = '' if self._source.only_looks else 's stop this  a stop ALL  k acknowledge  '
        return [(f'{acts}n next trouble  e errors  p plot  q quit', 'bold')]

    def _log(self, width: int, height: int) -> list[Row]:
        rows: deque[Row] = deque(maxlen=height)
        for note in self._notes:
            what = (note.text, _LEVELS[note.level])
            who = [(f'{_when(note.at)} ', 'dim'), (f'{note.who} ', 'bold')]
            rows.extend(wrapped([*who, what], width))
        return _filled(list(rows), height)

    def _table(self, height: int) -> list[Row]:
        """Return the drives around the one that is chosen, below their heading."""
        number = len(self._drives)
        self._page = page = max(1, min(height - 1, number))
        self._top = max(self._at - page + 1, min(self._top, self._at, number - page), 0)
        shown = self._drives[self._top : self._top + page]
        place = f' {self._top + 1}-{self._top + len(shown)}/{number}' if page < number else ''
        heading = f' {f"drive{place}":<{_NAME_WIDTH}}  {"status":<{_STATUS_WIDTH}}'
        heading += ''.join(f'  {title:>{width}}' for title, width, _ in _COLUMNS)
        names = short_names([drive.name for drive in self._drives], _NAME_WIDTH)
        return [[(heading, 'dim')], *(self._table_row(drive, names[drive.name]) for drive in shown)]

    def _table_row(self, drive: DriveView, name: str) -> Row:
        chosen = drive.name == self._chosen
        cells = ''.join(f'  {cell(drive):>{width}}' for _, width, cell in _COLUMNS)
        row = [
            (f'{">" if chosen else " "}{name:<{_NAME_WIDTH}}  ', ''),
            *fitted([_status(drive)], _STATUS_WIDTH, fill=True),
            (f'{cells} ', ''),
        ]
        return [(text, f'{style} reverse' if chosen else style) for text, style in row]

    def _full(self, width: int, height: int) -> list[Row]:
        if not self._drives:
            advice = self._source.advice.split('\n')
            return [row for line in advice for row in wrapped([(line, '')], width)]
        drive = self._drives[self._at]
        figures = '' if drive.line is None else f'line: {_figures(drive.line)}'
        line = wrapped([(figures, 'dim')], width)
        rows = [row for whole in _in_full(drive) for row in wrapped(whole, width)]
        if self._errors_of == drive.name:
            errors = drive.errors or ('being read',)
            entries = [[('error log: ', 'dim'), (text, '')] for text in errors]
            return [*rows, *(row for entry in entries for row in wrapped(entry, width)), *line]
        # a small plot rather than all figures of the line
        plots = self._plots(drive, width, max(2, height - len(rows) - len(line)))
        return [*rows, *plots, *line]

    def _plots(self, drive: DriveView, width: int, rows: int) -> Iterable[Row]:
        """Return the plot that was chosen, and the next ones where there is room for them."""
        height = max(1, min(_PLOT_HEIGHT, rows - 1))
        plots = (self._plot(drive, quantity, width - 10, height) for quantity in self._quantities)
        return itertools.chain(*[drawn for drawn in plots if drawn][: rows // (height + 1)])

    def _plot(self, drive: DriveView, quantity: str, width: int, height: int) -> list[Row]:
        name, unit, decimals, least = _QUANTITIES[quantity]
        values = [getattr(measured, quantity) for measured in self._history[drive.name]]
        values = values[-max(width, 0) :]
        if width < 10 or all(math.isnan(value) for value in values):
            return []
        low, high = axis = span(values, least)
        labels = [_number(high, decimals), *[''] * (height - 2), _number(low, decimals)][:height]
        seconds = f'{len(values) * _PICTURES_A_COLUMN * PERIOD:.0f} s'
        title = f'{name} {_number(values[-1], decimals, unit)}'
        return [
            [(title, 'bold'), (f', the last {seconds}', 'dim')],
            *(
                [(f'{label:>8} ', 'dim'), (line, 'cyan')]
                for label, line in zip(labels, plot(values, width, height, axis), strict=True)
            ),
        ]


def _status(drive: DriveView) -> tuple[str, str]:
    mark, style = _MARKS[drive.condition]
    return f'{mark} {drive.status}', 'dim' if drive.age > _FRESH else style


def _in_full(drive: DriveView) -> Iterator[Row]:
    """Yield which drive it is, how it is, why, what to do, and what is measured."""
    _, style = _MARKS[drive.condition]
    first = [(f'{drive.name}  ', 'bold'), _status(drive)]
    if drive.age > _FRESH:
        first.append((f'  as of {drive.age:.0f} s ago', 'yellow'))
    if drive.enabled:
        first.append(('  enabled', 'green'))
    if drive.requires_ack:
        first.append(('  to be acknowledged', style))
    yield first
    if drive.cause:
        yield [('why: ', 'dim'), (drive.cause, '')]
    if drive.remedy:
        yield [('do: ', 'dim'), (drive.remedy, 'bold')]
    measured = drive.measured
    frequency = measured.frequency if drive.unit != 'Hz' else math.nan
    cells = (
        ('set ', drive.setpoint, _in_unit(drive.setpoint, drive.unit)),
        ('actual ', drive.actual, _in_unit(drive.actual, drive.unit)),
        ('', frequency, _number(frequency, 1, 'Hz')),
        ('', measured.speed, _number(measured.speed, 0, 'rpm')),
        ('', measured.output_current, _number(measured.output_current, 2, 'A')),
        ('', measured.output_voltage, _number(measured.output_voltage, 0, 'V')),
        ('', measured.output_power, _number(measured.output_power, 0, 'W')),
        ('torque ', measured.torque, _number(measured.torque, 0, '%')),
        ('DC link ', measured.dc_link_voltage, _number(measured.dc_link_voltage, 0, 'V')),
        ('motor ', measured.motor_temperature, _number(measured.motor_temperature, 0, '%')),
    )
    known = [f'{name}{text}' for name, value, text in cells if not math.isnan(value)]
    # a row ends only where a value does
    yield [('  '.join(figure.replace(' ', '\N{NO-BREAK SPACE}') for figure in known), '')]


def _figures(line: Figures) -> str:
    """Return how a line is doing, the worst first."""
    counts = (
        (line.timeouts, 'without answer'),
        (line.damaged, 'damaged'),
        (line.refused, 'refused'),
        (line.retries, 'repeated'),
        (line.reconnects, 'reconnected'),
    )
    parts = [f'{count} {what}' for count, what in counts if count]
    if not math.isnan(line.utilisation):
        full = ' (polls fill the line by design)' if line.utilisation >= _FULL else ''
        parts.append(f'{100 * line.utilisation:.0f} % used{full}')
    if not math.isnan(line.cycle_time):
        parts.append(f'cycle {1000 * line.cycle_time:.0f} ms')
    if not math.isnan(line.round_trip_median):
        times = (line.round_trip_median, line.round_trip_p99, line.round_trip_max)
        median, p99, most = (_number(1000 * seconds, 1) for seconds in times)
        parts.append(f'round trip {median} ms, 99 % {p99}, max {most}')
    parts.append(f'{line.transactions} requests')
    return ', '.join(parts)


def _when(at: float) -> str:
    if math.isnan(at):
        return '--:--:--'
    moment = datetime.fromtimestamp(at)
    today = moment.date() == datetime.now().date()
    return moment.strftime('%H:%M:%S' if today else '%Y-%m-%d %H:%M')
