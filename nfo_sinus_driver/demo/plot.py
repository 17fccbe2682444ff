# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Draws recorded runs: one of a drive, or those of all drives of a line."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
import itertools
import math
from pathlib import Path

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator, MultipleLocator
from matplotlib.transforms import BboxBase, Transform, blended_transform_factory

from nfo_sinus_driver.demo.recorded import Curve, Recording, Span, read

#: The picture of a drive, inches and dots per inch: 1600 x 1000; that of a line is higher with each
#: drive. What is above and below the panels, and what one drive of several has.
_WIDTH, _HEIGHT = 16.0, 10.0
_DPI = 100
_HEAD, _FOOT = 1.58, 0.85
_OF_DRIVE = 2.6
_LEFT, _RIGHT = 0.075, 0.98
#: A text is made smaller rather than left out.
_SPAN_SIZES = (13, 12, 11, 10)
#: How much of the length of a span its name may take.
_OF_SPAN = 0.96

# the colours of Okabe and Ito, which are distinct without seeing red or green
_ORANGE = '#E69F00'
_DARK_ORANGE = '#8F6300'
_SKY_BLUE = '#56B4E9'
_GREEN = '#009E73'
_BLUE = '#0072B2'
_VERMILION = '#D55E00'
_PURPLE = '#AA4499'
_DARK_RED = '#8C1C13'
_INK = '#222222'
_SOFT = '#555555'
_GREY = '#8A8A8A'
_PALE = '#D9D9D9'

_PHASES = {
    'standby': (_PALE, _INK),
    'running': (_GREEN, 'white'),
    'stopping': (_SKY_BLUE, _INK),
    'fault': (_VERMILION, 'white'),
    'lost': (_SOFT, 'white'),
}
_STYLE = {
    'font.family': 'DejaVu Sans',
    'font.size': 13,
    'text.color': _INK,
    'axes.labelcolor': _INK,
    'axes.edgecolor': _GREY,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'xtick.color': _INK,
    'ytick.color': _INK,
    'grid.color': '#E6E6E6',
    'legend.frameon': False,
}
#: What a unit is of.
_QUANTITIES = {'Hz': 'frequency', 'rpm': 'speed', '%': 'torque', 'm/s': 'speed'}
#: Drawn in place of several states that are each too short for their names; these never are.
_SEVERAL = '…'
_ALWAYS_DRAWN = ('fault', 'lost')
#: How long a set-point stands that is named: s, and as a part of the picture; and how many are.
_STANDS_FOR, _STANDS_FOR_SHARE = 1.0, 1 / 40
_MOST_SETPOINTS = 10
#: The names of faults: how high each is of a panel, and how many there are one above the other.
_FAULT_HEIGHT, _MOST_FAULTS = 0.27, 3
_BOX = {'facecolor': 'white', 'alpha': 0.85, 'linewidth': 0, 'pad': 1.0}
#: Between publications that are further apart nothing was asked, s.
_SILENCE = 0.5


# --- the picture ------------------------------------------------------------------------------


def draw(bag: Path, picture: Path, *drives: str) -> None:
    """
    Draw what a bag says of a drive into a PNG file; of several, what they did beside each other.

    :raises ValueError: there is nothing of one of them in it.
    """
    runs = read(bag, drives)
    with matplotlib.rc_context(_STYLE):
        figure = _picture_of(runs[0]) if len(runs) == 1 else _picture_of_line(runs)
        picture.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(picture, dpi=_DPI)


def _figure(height: float) -> Figure:
    # no window, and no state that is shared: the figure is drawn for the file alone
    figure = Figure(figsize=(_WIDTH, height), dpi=_DPI, facecolor='white')
    FigureCanvasAgg(figure)
    return figure


def _picture_of(run: Recording) -> Figure:
    figure = _figure(_HEIGHT)
    grid = figure.add_gridspec(
        4, 1, height_ratios=(1.0, 4.2, 2.3, 2.3), hspace=0.16,
        left=_LEFT, right=_RIGHT, top=1 - _HEAD / _HEIGHT, bottom=_FOOT / _HEIGHT,
    )
    states, frequency, speed, current = (figure.add_subplot(cell) for cell in grid)
    for axes in (states, frequency, speed, current):
        _set_time(axes, run.length, shown=axes is current)
        _mark(axes, run)
    _draw_states(states, run)
    _name_moments(states, [(call.time, f'▼ {call.name}') for call in run.calls], 1.06, 0.3)
    _draw_frequency(frequency, run)
    _draw_quantity(speed, run.speed, 'motor speed (rpm)', _GREEN)
    _draw_quantity(current, run.current, 'output current (A)', _PURPLE, marker='o')
    current.set_ylim(bottom=0.0)
    _name_faults(frequency, run)
    _name_unknown(frequency, run)
    _name_stops(speed, run)
    figure.align_ylabels([frequency, speed, current])
    title, name = run.remarks.get('title', 'A test run'), run.remarks.get('drive', run.drive)
    _draw_title(figure, run, title, [name, *run.identity], _lines_of(frequency))
    return figure


def _picture_of_line(runs: Sequence[Recording]) -> Figure:
    height = _HEAD + _FOOT + _OF_DRIVE * len(runs)
    figure = _figure(height)
    grid = figure.add_gridspec(
        2 * len(runs), 1, height_ratios=(1.0, 4.2) * len(runs), hspace=0.3,
        left=_LEFT, right=_RIGHT, top=1 - _HEAD / height, bottom=_FOOT / height,
    )
    length = max(run.length for run in runs)
    panels = [figure.add_subplot(cell) for cell in grid]
    for run, states, frequency in zip(runs, panels[::2], panels[1::2], strict=True):
        for axes in (states, frequency):
            _set_time(axes, length, shown=axes is panels[-1])
            _mark(axes, run)
        _set_bars(states, {0.48: 'motor'})
        _draw_phases(states, run, 0.0)
        _draw_frequency(frequency, run)
        frequency.set_ylabel(f'{run.drive.rpartition("/")[2]}\n({run.unit})')
        _name_stops(frequency, run)
    figure.align_ylabels(panels[1::2])
    line = runs[0].drive.rpartition('/')[0] or '/'
    _draw_title(figure, runs[0], f'The line {line}', [f'{len(runs)} drives'], _lines_of(panels[1]))
    return figure


def _set_time(axes: Axes, length: float, *, shown: bool) -> None:
    axes.set_xlim(-0.2, length + 0.2)
    axes.xaxis.set_major_locator(MultipleLocator(_step(max(length, 1.0))))
    axes.tick_params(axis='x', labelbottom=shown, length=0)
    if shown:
        axes.set_xlabel('time (s)', labelpad=8)


def _lines_of(axes: Axes) -> list[Artist]:
    return axes.get_legend_handles_labels()[0]


def _draw_title(
    figure: Figure, run: Recording, title: str, facts: Sequence[str], lines: list[Artist]
) -> None:
    def at(inches: float) -> float:
        """Return how high that is, so far below the top."""
        return 1 - inches / float(figure.get_figheight())

    headline = '   ·   '.join(filter(None, (*facts, f'{run.began:%d %B %Y, %H:%M}')))
    figure.text(_LEFT, at(0.56), title, size=25, weight='bold')
    figure.text(_LEFT, at(0.96), headline, size=14, color=_SOFT)
    figure.text(
        _RIGHT, 1 - at(0.18), f'drawn from the bag {run.source}', size=11, color=_SOFT, ha='right'
    )
    phases = [Patch(color=colour, label=phase) for phase, (colour, _) in _PHASES.items()]
    for inches, handles in ((0.24, phases), (0.52, lines)):
        figure.legend(
            handles=handles, loc='upper right', bbox_to_anchor=(_RIGHT, at(inches)),
            ncols=len(handles), fontsize=12, borderaxespad=0.0, borderpad=0.0, handlelength=1.8,
            columnspacing=1.4,
        )


# --- panels -----------------------------------------------------------------------------------


def _draw_states(axes: Axes, run: Recording) -> None:
    _set_bars(axes, {0.48: 'display', 1.52: 'motor'})
    _draw_phases(axes, run, 1.04)
    faulty = {span.what for span in run.faults}
    for span in _merged(axes, run.texts, faulty):
        fault = span.what in faulty
        _draw_span(axes, span, 0.0, '#F9DCCB' if fault else '#F0F0F0', _INK, bold=fault)


def _set_bars(axes: Axes, names: dict[float, str]) -> None:
    axes.set_ylim(0.0, float(len(names)))
    axes.set_yticks(list(names), list(names.values()))
    axes.tick_params(axis='y', length=0)
    axes.spines[:].set_visible(False)


def _draw_phases(axes: Axes, run: Recording, bottom: float) -> None:
    for span in _merged(axes, run.phases, _ALWAYS_DRAWN):
        colour, ink = _PHASES.get(span.what, ('#F0F0F0', _INK))
        _draw_span(axes, span, bottom, colour, ink, bold=True)


def _merged(axes: Axes, spans: Sequence[Span], kept: Collection[str]) -> Iterator[Span]:
    """Yield spans; neighbours that are too short for their names become one, but for some."""
    widths = {what: _width_of(axes, what) for what in {span.what for span in spans}}

    def is_short(span: Span) -> bool:
        return span.what not in kept and _OF_SPAN * (span.end - span.begin) < widths[span.what]

    for short, group in itertools.groupby(spans, is_short):
        neighbours = list(group)
        if short and len(neighbours) > 1:
            yield Span(neighbours[0].begin, neighbours[-1].end, _SEVERAL)
        else:
            yield from neighbours


def _width_of(axes: Axes, what: str) -> float:
    """Return how wide the name of a state is at least, in units of the axis of time."""
    text = axes.text(0.0, 0.0, what, size=_SPAN_SIZES[-1])
    width = _width(text)
    text.remove()
    return width


def _draw_span(
    axes: Axes, span: Span, bottom: float, colour: str, ink: str, *, bold: bool
) -> None:
    length = span.end - span.begin
    axes.broken_barh(
        [(span.begin, length)], (bottom, 0.96),
        facecolors=colour, edgecolors='white', linewidth=1.5, zorder=6,
    )
    text = axes.text(
        span.begin + length / 2, bottom + 0.47, span.what, ha='center', va='center_baseline',
        color=ink, weight='bold' if bold else 'normal', zorder=7,
    )
    for size in _SPAN_SIZES:
        text.set_size(size)
        if _width(text) < _OF_SPAN * length:
            return
    # the colour has to do
    text.remove()


def _draw_frequency(axes: Axes, run: Recording) -> None:
    followed, ignored = Curve(), Curve()
    last = -math.inf
    for time, value in zip(run.setpoint.times, run.setpoint.values, strict=True):
        if time - last > _SILENCE:
            followed.add(last, math.nan)
            ignored.add(last, math.nan)
        enabled = any(span.begin <= time <= span.end for span in run.enabled)
        followed.add(time, value if enabled else math.nan)
        ignored.add(time, math.nan if enabled else value)
        last = time
    axes.step(
        followed.times, followed.values, where='post', color=_ORANGE, linewidth=3.2,
        label='set-point', zorder=3,
    )
    axes.step(
        ignored.times, ignored.values, where='post', color=_ORANGE, linewidth=2.2,
        linestyle=(0, (1, 1.5)), label='ignored: not enabled', zorder=3,
    )
    axes.plot(
        run.actual.times, run.actual.values, color=_BLUE, linewidth=2.4,
        label=f'actual {_quantity(run)}', zorder=4,
    )
    axes.set_ylabel(f'{_quantity(run)} ({run.unit})')
    _finish(axes)
    # room for names above all that is drawn
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.1 * (high - low))
    _name_setpoints(axes, followed, run.unit)


def _quantity(run: Recording) -> str:
    return _QUANTITIES.get(run.unit, 'value')


def _draw_quantity(axes: Axes, curve: Curve, name: str, colour: str, marker: str = '') -> None:
    axes.plot(
        curve.times, curve.values, color=colour, linewidth=2.2, marker=marker, markersize=4.5,
        zorder=4,
    )
    axes.fill_between(curve.times, curve.values, color=colour, alpha=0.12, linewidth=0, zorder=2)
    axes.set_ylabel(name)
    _finish(axes)


def _finish(axes: Axes) -> None:
    axes.margins(y=0.14)
    axes.axhline(0.0, color=_GREY, linewidth=1.0, zorder=2)
    axes.grid()
    axes.yaxis.set_major_locator(MaxNLocator(nbins=7, steps=[1, 2, 5, 10]))


# --- marks ------------------------------------------------------------------------------------


def _mark(axes: Axes, run: Recording) -> None:
    """Draw calls, stops and faults through a panel."""
    for call in run.calls:
        axes.axvline(call.time, color=_INK, linewidth=1.0, linestyle=(0, (4, 4)), zorder=2)
    for stop in run.stops:
        axes.axvline(stop.time, color=_DARK_RED, linewidth=1.4, linestyle=(0, (1, 1)), zorder=5)
    for span in run.faults:
        axes.axvspan(span.begin, span.end, color=_VERMILION, alpha=0.10, linewidth=0, zorder=0)
        axes.axvline(span.begin, color=_VERMILION, linewidth=2.2, zorder=5)


def _name_stops(axes: Axes, run: Recording) -> None:
    named = [(stop.time, f'■ {stop.reason}') for stop in run.stops]
    for text in _name_moments(axes, named, 0.04, 0.13):
        text.set(color=_DARK_RED, weight='bold', zorder=8)
        text.set_bbox(_BOX)


def _name_moments(
    axes: Axes, named: Sequence[tuple[float, str]], lowest: float, above: float
) -> list[Text]:
    """Name moments at a part of a panel's height, one above the other where they would overlap."""
    ends: list[float] = []
    texts: list[Text] = []
    for time, name in named:
        text = axes.text(
            time, 0.0, name, transform=_at_height(axes), ha='left', va='bottom', size=13
        )
        row = next((row for row, end in enumerate(ends) if end < time), len(ends))
        ends[row : row + 1] = [time + _width(text)]
        text.set_y(lowest + above * row)
        texts.append(text)
    return texts


def _name_setpoints(axes: Axes, followed: Curve, unit: str) -> None:
    """Name the values that stand for a while, the longest of them, where there is room."""
    left, right = axes.get_xlim()
    least = max(_STANDS_FOR, _STANDS_FOR_SHARE * (right - left))
    standing = [span for span in _standing(followed, unit) if span.end - span.begin >= least]
    standing.sort(key=lambda span: span.begin - span.end)
    boxes: list[BboxBase] = []
    for span in standing[:_MOST_SETPOINTS]:
        value = followed.values[followed.times.index(span.begin)]
        text = axes.annotate(
            span.what.replace('-', '\N{MINUS SIGN}'), (span.begin, value),
            (4, 5 if value >= 0 else -5), textcoords='offset points', ha='left',
            va='bottom' if value >= 0 else 'top', color=_DARK_ORANGE, weight='bold', zorder=6,
        )
        box = text.get_window_extent()
        if any(box.overlaps(other) for other in boxes):
            text.remove()
        else:
            boxes.append(box)


def _standing(followed: Curve, unit: str) -> Iterator[Span]:
    """Yield the set-points but 0, rounded, and from when to when each was followed."""
    points = zip(followed.times, followed.values, strict=True)
    # NaN, where nothing is followed, is a value of its own
    groups = [
        (next(group)[0], what)
        for what, group in itertools.groupby(points, lambda point: f'{point[1]:+.3g}')
    ]
    ends = [*(time for time, _ in groups[1:]), *followed.times[-1:]]
    for (begin, what), end in zip(groups, ends, strict=True):
        if what not in ('+nan', '+0', '-0'):
            yield Span(begin, end, f'{what} {unit}')


def _name_faults(axes: Axes, run: Recording) -> None:
    """Name faults, one below the other where they would overlap, as long as there is room."""
    left, right = axes.get_xlim()
    rows: list[float] = []
    for span in run.faults:
        detail = f'fault {span.code}, {span.begin:.1f} s\nmotor released'
        texts = [
            axes.annotate(
                text, (span.begin, 0.0), (8, 0), textcoords='offset points',
                xycoords=_at_height(axes), va='top', size=size, weight=weight, color=colour,
                zorder=8, bbox=_BOX,
            )
            for text, size, weight, colour in (
                (span.what, 18, 'bold', _VERMILION), (detail, 11.5, 'normal', _INK),
            )
        ]
        width = max(map(_width, texts)) + 0.012 * (right - left)
        begin = span.begin
        if begin + width > right:
            begin -= width
            for text in texts:
                text.set(ha='right', position=(-8, 0))
        row = next((row for row, end in enumerate(rows) if end < begin), len(rows))
        if row >= _MOST_FAULTS:
            # the line stays, and its name in the row of states
            for text in texts:
                text.remove()
            continue
        rows[row : row + 1] = [begin + width]
        top = 0.985 - _FAULT_HEIGHT * row
        for text, below in zip(texts, (0.0, 0.115), strict=True):
            text.xy = span.begin, top - below


def _name_unknown(axes: Axes, run: Recording) -> None:
    """Say where the speed is not known, if there is room: after a fault, or STOP at the keypad."""
    for span in run.unknown:
        text = axes.annotate(
            span.what, (span.begin, 0.03), (8, 0), textcoords='offset points',
            xycoords=_at_height(axes), va='bottom', size=11.5, color=_INK, zorder=6, bbox=_BOX,
        )
        if _width(text) > span.end - span.begin:
            text.remove()


def _at_height(axes: Axes) -> Transform:
    """Return coordinates of time and of the part of a panel's height."""
    return blended_transform_factory(axes.transData, axes.transAxes)


def _width(text: Text) -> float:
    """Return how wide a text is, in units of the axis of time."""
    box = text.get_window_extent().transformed(text.axes.transData.inverted())
    return float(box.width)


def _step(length: float) -> float:
    """Return a round distance between ticks that gives about ten of them."""
    power = 10.0 ** math.floor(math.log10(length / 10))
    return next(power * step for step in (1, 2, 5, 10) if length / (power * step) <= 13)
