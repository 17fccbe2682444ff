# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The view as a program for a whole terminal: every drive in a table, one of them in full."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Sequence
import contextlib
from datetime import datetime
import itertools
import math
import re
import signal
import textwrap
from typing import ClassVar

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container, Vertical
from textual.css.query import NoMatches
from textual.events import Resize
from textual.widgets import DataTable, Footer, RichLog, Static

from nfo_sinus_driver.view.picture import (
    Condition,
    DriveView,
    Level,
    LineView,
    Measured,
    Note,
    Picture,
    Source,
)

#: How often it is looked, s.
_PERIOD = 0.25
#: How many looks a column of a plot stands for, and how many columns are remembered.
_LOOKS_A_COLUMN = 4
_REMEMBERED = 600
#: From this width on the drive in full stands beside the table.
_WIDE = 120
_PLOT_HEIGHT = 3
#: What is older is shown as old, s.
_FRESH = 4.0

#: What stands before a status, so that colours are not needed, and its style.
_MARKS = {
    Condition.GONE: ('·', 'dim'),
    Condition.SILENT: ('?', 'bold magenta'),
    Condition.FAULT: ('✗', 'bold red'),
    Condition.ALARM: ('▲', 'bold yellow'),
    Condition.RUNS: ('►', 'bold green'),
    Condition.STANDS: ('■', ''),
}
_TROUBLE = (Condition.SILENT, Condition.FAULT, Condition.ALARM, Condition.GONE)
_LEVELS = {Level.INFO: '', Level.WARNING: 'yellow', Level.ERROR: 'bold red'}

#: What can be plotted: its name, its unit, its decimals, and the least that the axis shows.
_QUANTITIES: dict[str, tuple[str, str, int, float]] = {
    'output_current': ('current', 'A', 2, 1.0),
    'frequency': ('frequency', 'Hz', 1, 10.0),
    'speed': ('speed', 'rpm', 0, 100.0),
    'torque': ('torque', '%', 0, 20.0),
}


def _number(value: float, decimals: int, unit: str = '') -> str:
    # no minus before a zero
    text = f'{round(value, decimals) + 0.0:.{decimals}f}' if math.isfinite(value) else '-'
    return f'{text} {unit}'.rstrip()


#: Units in which a tenth is fine enough; of others, such as m/s, three digits are shown.
_COARSE = ('Hz', 'rpm', '%', '')
_MOST_DECIMALS = 4


def _in_unit(value: float, unit: str, width: int = 1000) -> str:
    """Return a value in a unit that may be the operator's own, without it where it does not fit."""
    decimals = 1
    if unit not in _COARSE and math.isfinite(value) and value:
        decimals = min(_MOST_DECIMALS, max(0, 2 - math.floor(math.log10(abs(value)))))
    text = _number(value, decimals, unit)
    return text if len(text) <= width else _number(value, decimals)


def _status(drive: DriveView) -> Text:
    mark, style = _MARKS[drive.condition]
    style = 'dim' if drive.age > _FRESH else style
    return Text(f'{mark} {drive.status}', style, no_wrap=True, overflow='ellipsis')


def short_names(names: Sequence[str], width: int) -> dict[str, str]:
    """Return names without the namespace that all of them are in, and cut at the left."""
    spaces = {name[: name.rfind('/') + 1] for name in names}
    common = len(spaces.pop()) if len(names) > 1 and len(spaces) == 1 else 0
    return {
        name: text if len(text) <= width else f'…{text[len(text) - width + 1 :]}'
        for name, text in ((name, name[common:]) for name in names)
    }


_NAME_WIDTH = 16
#: The columns: heading, width, what stands in it, and whether it is to the right.
_Cell = Callable[[DriveView], 'str | Text']
_Column = tuple[str, int, _Cell, bool]
_COLUMNS: tuple[_Column, ...] = (
    ('status', 18, _status, False),
    ('set', 10, lambda drive: _in_unit(drive.setpoint, drive.unit, 10), True),
    ('actual', 10, lambda drive: _in_unit(drive.actual, drive.unit, 10), True),
    ('rpm', 6, lambda drive: _number(drive.measured.speed, 0), True),
    ('A', 6, lambda drive: _number(drive.measured.output_current, 2), True),
)


def natural(name: str) -> list[tuple[int, int, str]]:
    """Return what sorts ``drive_2`` before ``drive_10``."""
    parts = re.findall(r'\d+|\D+', name)
    return [(0, int(part), '') if part.isdigit() else (1, 0, part) for part in parts]


class MonitorApp(App[None]):
    """
    Shows what a source reports, four times a second, until the operator ends it.

    :param source: asked by the thread that draws.
    """

    TITLE = 'nfo_sinus monitor'
    ENABLE_COMMAND_PALETTE = False
    CSS = """
    * { scrollbar-size-vertical: 1; overflow-x: hidden; }
    #head {
        height: auto; max-height: 3; background: $panel; padding: 0 1;
        text-wrap: nowrap; text-overflow: ellipsis;
    }
    #body { layout: vertical; height: 1fr; }
    #drives { height: auto; max-height: 45%; }
    #full { height: 1fr; border-top: solid $panel-lighten-2; padding: 0 1; }
    #drive, #plots, #line { height: auto; }
    #log { height: 7; border-top: solid $panel-lighten-2; padding: 0 1; }
    .wide #body { layout: horizontal; }
    .wide #drives { width: 80; height: 100%; max-height: 100%; }
    .wide #full {
        width: 1fr; height: 100%;
        border-top: none; border-left: solid $panel-lighten-2;
    }
    .low #head { max-height: 2; }
    .low #log { height: 5; }
    #stops { height: auto; max-height: 4; padding: 0 1; background: $error; color: $text; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding('s', 'stop', 'stop this drive'),
        Binding('a', 'stop_all', 'stop ALL'),
        Binding('n', 'next_trouble', 'next trouble'),
        Binding('p', 'next_quantity', 'plot'),
        Binding('q', 'quit', 'quit'),
        Binding('ctrl+c', 'quit', show=False, priority=True),
    ]

    def __init__(self, source: Source) -> None:
        super().__init__()
        self._source = source
        self._picture = Picture((), (), ())
        self._history: dict[str, deque[Measured]] = {}
        self._looks = 0
        self._rows: list[str] = []
        self._cells: dict[tuple[str, str], tuple[str, str]] = {}
        self._quantity = next(iter(_QUANTITIES))

    def compose(self) -> ComposeResult:
        """Return what there is to see, from top to bottom."""
        yield Static(id='head')
        with Container(id='body'):
            yield DataTable(id='drives', cursor_type='row', zebra_stripes=True)
            with Vertical(id='full'):
                yield Static(id='drive')
                yield Static(id='plots')
                yield Static(id='line')
        yield Static(id='stops')
        yield RichLog(id='log', max_lines=500, min_width=20, wrap=True)
        yield Footer()

    def on_mount(self) -> None:
        """Begin."""
        self.query_one('#log', RichLog).can_focus = False
        table = self._table
        table.add_column('drive', width=_NAME_WIDTH, key='drive')
        for heading, width, _, right in _COLUMNS:
            table.add_column(Text(heading, justify='right' if right else 'left'), width=width,
                             key=heading)
        table.focus()
        # however it is ended, the terminal is put back
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            loop.add_signal_handler(number, self.exit)
        self.set_interval(_PERIOD, self._look)
        self._look()

    def on_resize(self, event: Resize) -> None:
        """Put the drive in full where there is room for it."""
        self.screen.set_class(event.size.width >= _WIDE, 'wide')
        self.screen.set_class(event.size.height < 30, 'low')
        with contextlib.suppress(NoMatches):
            self._show_drive()

    def on_data_table_row_highlighted(self) -> None:
        """Show the drive that was chosen."""
        with contextlib.suppress(NoMatches):
            self._show_drive()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Offer no stop where the source has none."""
        return not (action in ('stop', 'stop_all') and self._source.only_looks)

    # --- keys ---------------------------------------------------------------------------------

    def action_stop(self) -> None:
        """Stop the drive that is chosen."""
        drive = self._chosen()
        if drive is not None:
            self._source.stop(drive.name)
            self._look()

    def action_stop_all(self) -> None:
        """Stop all drives."""
        self._source.stop_all()
        self._look()

    def action_next_trouble(self) -> None:
        """Choose the next drive that needs attention."""
        table, drives = self._table, {drive.name: drive for drive in self._picture.drives}
        for step in range(1, len(self._rows) + 1):
            row = (table.cursor_row + step) % len(self._rows)
            if drives[self._rows[row]].condition in _TROUBLE:
                table.move_cursor(row=row)
                return

    def action_next_quantity(self) -> None:
        """Plot the next quantity."""
        names = list(_QUANTITIES)
        self._quantity = names[(names.index(self._quantity) + 1) % len(names)]
        self._show_drive()

    # --- what is shown ------------------------------------------------------------------------

    @property
    def _table(self) -> DataTable[str | Text]:
        return self.query_one('#drives', DataTable)

    def _look(self) -> None:
        # while it is being taken down what it draws on goes part by part
        with contextlib.suppress(NoMatches):
            self._draw()

    def _draw(self) -> None:
        self._picture = picture = self._source.look()
        for drive in picture.drives:
            past = self._history.setdefault(drive.name, deque(maxlen=_REMEMBERED))
            if past and self._looks % _LOOKS_A_COLUMN:
                past.pop()
            past.append(drive.measured)
        self._looks += 1
        self.query_one('#head', Static).update(self._head(picture))
        self._show_table(sorted(picture.drives, key=lambda drive: natural(drive.name)))
        self._show_drive()
        stops = self.query_one('#stops', Static)
        stops.display = bool(picture.stops)
        stops.update(Text('\n'.join(picture.stops), 'bold'))
        log = self.query_one('#log', RichLog)
        for note in picture.notes:
            log.write(_line_of(note), expand=True)

    def _head(self, picture: Picture) -> Text:
        number = len(picture.drives)
        head = Text(f'{number or "no"} drive{"s" * (number != 1)}')
        # the worst first: what there is no room for is cut off
        for condition, (mark, style) in _MARKS.items():
            count = sum(drive.condition is condition for drive in picture.drives)
            if count:
                head.append(f'  {mark} {count} {condition.value}', style)
        if self._source.only_looks:
            head.append(f'  {self._source.only_looks}', 'dim')
        head.append(f'  {self._source.title}', 'dim')
        for line in sorted(picture.lines, key=lambda line: -(line.timeouts + line.damaged)):
            head.append(f'\n{line.name}: {_figures(line)}', 'dim')
        return head

    def _show_table(self, drives: Iterable[DriveView]) -> None:
        table = self._table
        shown = list(drives)
        names = [drive.name for drive in shown]
        if names != self._rows:
            chosen = self._chosen()
            table.clear()
            self._cells.clear()
            for name, short in short_names(names, _NAME_WIDTH).items():
                table.add_row(Text(short), *('' for _ in _COLUMNS), key=name)
            self._rows = names
            if chosen is not None and chosen.name in names:
                table.move_cursor(row=names.index(chosen.name))
        for drive in shown:
            for heading, width, cell, right in _COLUMNS:
                # nothing that a drive or an operator has named is markup
                content = cell(drive)
                text = content if isinstance(content, Text) else Text(content, no_wrap=True)
                if right:
                    text.align('right', width)
                shown_text = text.plain, str(text.style)
                if self._cells.get((drive.name, heading)) != shown_text:
                    self._cells[drive.name, heading] = shown_text
                    table.update_cell(drive.name, heading, text)

    def _chosen(self) -> DriveView | None:
        row = self._table.cursor_row
        name = self._rows[row] if 0 <= row < len(self._rows) else None
        return next((drive for drive in self._picture.drives if drive.name == name), None)

    def _show_drive(self) -> None:
        drive = self._chosen()
        full, plots, line = (self.query_one(name, Static) for name in ('#drive', '#plots', '#line'))
        if drive is None:
            full.update(Text('' if self._picture.drives else self._source.advice))
            plots.update('')
            line.update('')
            return
        text = _in_full(drive, full.size.width)
        full.update(Text('\n').join(text))
        line.update('' if drive.line is None else Text(f'line: {_figures(drive.line)}', 'dim'))
        # what the text leaves, the line of figures in two rows
        free = self.query_one('#full').content_size.height - len(text) - 2
        plots.update(Text('\n').join(self._plots(drive, free)))

    def _plots(self, drive: DriveView, rows: int) -> list[Text]:
        """Return the plot that was chosen, and the next ones where there is room for them."""
        height = max(1, min(_PLOT_HEIGHT, rows - 1))
        room = max(1, rows // (height + 1))
        names = list(_QUANTITIES)
        chosen = names.index(self._quantity)
        drawn = (self._plot(drive, name, height) for name in (*names[chosen:], *names[:chosen]))
        return list(itertools.chain.from_iterable([one for one in drawn if one][:room]))

    def _plot(self, drive: DriveView, quantity: str, height: int) -> list[Text]:
        name, unit, decimals, least = _QUANTITIES[quantity]
        width = self.query_one('#full').content_size.width - 10
        values = [getattr(measured, quantity) for measured in self._history[drive.name]]
        values = values[-max(width, 0) :]
        if width < 10 or all(math.isnan(value) for value in values):
            return []
        low, high = axis = span(values, least)
        lines = plot(values, width, height, axis)
        labels = [_number(high, decimals), *[''] * (height - 2), _number(low, decimals)][:height]
        shown = [
            Text.assemble((f'{label:>8} ', 'dim'), (line, 'cyan'))
            for label, line in zip(labels, lines, strict=True)
        ]
        now = _number(values[-1], decimals, unit)
        seconds = f'{len(values) * _LOOKS_A_COLUMN * _PERIOD:.0f} s'
        return [Text.assemble((f'{name} {now}', 'bold'), (f', the last {seconds}', 'dim')), *shown]


def _in_full(drive: DriveView, width: int) -> list[Text]:
    """Return which drive it is, how it is, why, what to do, and what is measured."""
    _, style = _MARKS[drive.condition]
    first = Text.assemble((drive.name, 'bold'), '  ', _status(drive))
    if drive.age > _FRESH:
        first.append(f'  as of {drive.age:.0f} s ago', 'yellow')
    if drive.enabled:
        first.append('  enabled', 'green')
    if drive.requires_ack:
        first.append('  to be acknowledged', style)
    lines = [first]
    if drive.cause:
        lines.append(Text.assemble(('why: ', 'dim'), drive.cause))
    if drive.remedy:
        lines.append(Text.assemble(('do: ', 'dim'), (drive.remedy, 'bold')))
    measured = drive.measured
    frequency = measured.frequency if drive.unit != 'Hz' else math.nan
    cells = (
        ('', frequency, 1, 'Hz'),
        ('', measured.speed, 0, 'rpm'),
        ('', measured.output_current, 2, 'A'),
        ('', measured.output_voltage, 0, 'V'),
        ('', measured.output_power, 0, 'W'),
        ('torque ', measured.torque, 0, '%'),
        ('DC link ', measured.dc_link_voltage, 0, 'V'),
        ('motor ', measured.motor_temperature, 0, '%'),
    )
    values = [
        *(
            f'{name} {_in_unit(value, drive.unit)}'
            for name, value in (('set', drive.setpoint), ('actual', drive.actual))
            if not math.isnan(value)
        ),
        *(
            f'{name}{_number(value, decimals, unit)}'
            for name, value, decimals, unit in cells
            if not math.isnan(value)
        ),
    ]
    values = [cell.replace(' ', '\N{NO-BREAK SPACE}') for cell in values]
    # only where a value ends
    lines += map(Text, textwrap.wrap('  '.join(values), max(width, 20)))
    return lines


def _figures(line: LineView) -> str:
    """Return how a line is doing, the worst first."""
    parts = [
        f'{count} {what}'
        for count, what in (
            (line.timeouts, 'without answer'),
            (line.damaged, 'damaged'),
            (line.refused, 'refused'),
            (line.retries, 'repeated'),
            (line.reconnects, 'reconnected'),
        )
        if count
    ]
    if not math.isnan(line.utilisation):
        parts.append(f'{100 * line.utilisation:.0f} % used')
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


def _line_of(note: Note) -> Text:
    when = _when(note.at)
    style = _LEVELS[note.level]
    return Text.assemble((when, 'dim'), ' ', (note.who, 'bold'), ' ', (note.text, style))


# --- the running plot, made of text ---------------------------------------------------------------

#: An eighth of a character's height each.
_EIGHTHS = ' ▁▂▃▄▅▆▇█'


def span(values: Sequence[float], least: float = 0.0) -> tuple[float, float]:
    """
    Return where the axis begins and ends: zero is always on it.

    :param least: how much the axis shows at least, so that noise is not drawn as an event.
    """
    known = [value for value in values if math.isfinite(value)]
    low, high = min((0.0, *known)), max((0.0, *known))
    if high - low < least:
        high = low + least if high > 0 or low == 0 else high
        low = low if high > 0 else high - least
    return low, high


def plot(
    values: Sequence[float], width: int, height: int, axis: tuple[float, float]
) -> list[str]:
    """
    Return columns from the bottom of the axis up to each value, newest at the right, as lines.

    :param values: oldest first; NaN leaves a gap. More than ``width`` are cut off at the left.
    """
    low, high = axis
    size = high - low
    shown = list(values)[-width:] if width else []
    # without a size there is but the value zero
    heights = [_height((value - low) / (size or 1.0), height) for value in shown]
    blank = ' ' * (width - len(shown))
    return [
        blank + ''.join(_EIGHTHS[min(8, max(0, eighths - 8 * row))] for eighths in heights)
        for row in reversed(range(height))
    ]


def _height(share: float, height: int) -> int:
    """Return how many eighths of a character a share of the axis is; a value has one at least."""
    if not math.isfinite(share):
        return 0
    return max(1, min(8 * height, round(share * 8 * height)))
