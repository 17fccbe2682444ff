# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Draws a recorded run: reads it back from its bag as curves and spans."""

from __future__ import annotations

from collections.abc import Callable, Iterable
import dataclasses
from dataclasses import dataclass, field
from datetime import datetime
import math
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.text import Text
from matplotlib.ticker import MaxNLocator, MultipleLocator
from matplotlib.transforms import Transform, blended_transform_factory

from nfo_sinus_driver.demo import bags

_EVENT = '/_service_event'
_STATUS = 'nfo_sinus_msgs/msg/DriveStatus'
#: The topics of a drive that are drawn, besides its service events.
_DRAWN = ('status', 'setpoint', 'actual_speed', 'telemetry', 'inv_st')
#: What the states of DriveStatus mean for the motor.
_PHASE_OF_STATE = {
    'OPERATION_ENABLED': 'running',
    'STOPPING': 'stopping',
    'QUICK_STOP': 'stopping',
    'FAULT_REACTION_ACTIVE': 'fault',
    'FAULTED': 'fault',
}
#: The picture, inches and dots per inch: 1600 x 1000.
_SIZE = (16.0, 10.0)
_DPI = 100
_LEFT, _RIGHT = 0.075, 0.98
#: A text is made smaller rather than left out.
_SPAN_SIZES = (13, 12, 11, 10)

# the colours of Okabe and Ito, which are distinct without seeing red or green
_ORANGE = '#E69F00'
_DARK_ORANGE = '#8F6300'
_SKY_BLUE = '#56B4E9'
_GREEN = '#009E73'
_BLUE = '#0072B2'
_VERMILION = '#D55E00'
_PURPLE = '#AA4499'
_INK = '#222222'
_SOFT = '#555555'
_GREY = '#8A8A8A'
_PALE = '#D9D9D9'

_PHASES = {
    'standby': (_PALE, _INK),
    'running': (_GREEN, 'white'),
    'stopping': (_SKY_BLUE, _INK),
    'fault': (_VERMILION, 'white'),
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
#: Between publications that are further apart nothing was asked, s.
_SILENCE = 0.5


# --- what the bag says ------------------------------------------------------------------------


@dataclass
class Curve:
    """Values over time, s since the run began."""

    times: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)

    def add(self, time: float, value: float) -> None:
        """Append a point."""
        self.times.append(time)
        self.values.append(value)


@dataclass(frozen=True)
class Span:
    """Something that held for a while, s since the run began; a fault has a code."""

    begin: float
    end: float
    what: str
    code: int = 0


@dataclass(frozen=True)
class Recording:
    """
    What a bag says of a run.

    :ivar began: when the drive was connected; times are counted from there, s.
    :ivar source: the bag, its messages and its topics.
    :ivar unit: of the set-point and of what follows it.
    :ivar identity: model, serial number and firmware, as far as the drive reports them.
    :ivar phases: what the motor did: standby, running, stopping or fault.
    :ivar texts: what the drive's display said.
    :ivar faults: of the texts, those that name a fault.
    :ivar enabled: when the driver followed set-points.
    :ivar calls: which services were called, and when.
    """

    began: datetime
    length: float
    remarks: dict[str, str]
    source: str
    unit: str
    identity: list[str]
    setpoint: Curve
    actual: Curve
    speed: Curve
    current: Curve
    phases: list[Span]
    texts: list[Span]
    faults: list[Span]
    enabled: list[Span]
    calls: list[tuple[float, str]]


def read(folder: Path, drive: str = '/nfo_sinus') -> Recording:
    """Read the run of a drive from a bag; a ValueError if it was never connected."""
    messages: dict[str, list[tuple[int, Any]]] = {}
    for topic, stamp, message in bags.read(folder, lambda topic: _is_of(drive, topic)):
        messages.setdefault(topic, []).append((stamp, message))
    connected = [m for _, m in messages.get(f'{drive}/status', ()) if m.connected]
    if not connected:
        raise ValueError(f'{drive} was never connected')
    start = _nanoseconds(connected[0].header.stamp)

    def since(nanoseconds: int) -> float:
        return (nanoseconds - start) / 1e9

    def measured(topic: str) -> list[tuple[float, Any]]:
        """Messages by the time that they carry themselves."""
        found = messages.get(f'{drive}/{topic}', ())
        return [(since(_nanoseconds(m.header.stamp)), m) for _, m in found]

    def received(topic: str) -> Curve:
        found = messages.get(f'{drive}/{topic}', ())
        return Curve([since(stamp) for stamp, _ in found], [m.data for _, m in found])

    length = since(_nanoseconds(connected[-1].header.stamp))
    statuses = [(time, status) for time, status in measured('status') if status.connected]
    currents = measured('telemetry')
    texts = measured('inv_st')
    shown = _spans([(time, m.text) for time, m in texts], length)
    # a fault is named a moment before the drive's state is one
    faults = {m.text: m.code for _, m in texts if m.kind == m.FAULT}
    described = bags.metadata(folder)
    return Recording(
        began=datetime.fromtimestamp(start / 1e9),
        length=length,
        remarks=dict(described.get('custom_data') or {}),
        source=f'{folder.name}: {described["message_count"]} messages on '
        f'{len(bags.topics(folder))} topics',
        unit=next((m.unit for m in reversed(connected) if m.unit), 'Hz'),
        identity=_identity((m for _, m in messages.get('/diagnostics', ())), drive),
        setpoint=received('setpoint'),
        actual=Curve([time for time, _ in statuses], [m.actual for _, m in statuses]),
        speed=received('actual_speed'),
        current=Curve([time for time, _ in currents], [m.output_current for _, m in currents]),
        phases=_spans([(time, _phase(m)) for time, m in statuses], length),
        texts=shown,
        faults=[
            dataclasses.replace(span, code=faults[span.what])
            for span in shown
            if span.what in faults
        ],
        enabled=[
            span
            for span in _spans([(time, 'enabled' * m.enabled) for time, m in statuses], length)
            if span.what
        ],
        calls=sorted(_calls(messages, drive, since)),
    )


def only_drive(folder: Path) -> str:
    """Return the name of the drive that is in a bag; a ValueError if there is none, or several."""
    drives = sorted(
        topic.removesuffix('/status')
        for topic, type_ in bags.topics(folder)
        if type_ == _STATUS and topic.endswith('/status')
    )
    if len(drives) == 1:
        return drives[0]
    if drives:
        raise ValueError(f'it has several drives: choose one by --drive: {", ".join(drives)}')
    raise ValueError('it has no drive: no topic ~/status was recorded')


def _is_of(drive: str, topic: str) -> bool:
    """Tell whether a topic is one of those that are drawn."""
    if topic == '/diagnostics':
        return True
    name = topic.removeprefix(f'{drive}/')
    return name != topic and (topic.endswith(_EVENT) or name in _DRAWN)


def _calls(
    messages: dict[str, list[tuple[int, Any]]], drive: str, since: Callable[[int], float]
) -> Iterable[tuple[float, str]]:
    for topic, events in messages.items():
        if topic.startswith(drive) and topic.endswith(_EVENT):
            name = topic.removesuffix(_EVENT).rpartition('/')[2]
            for _, event in events:
                if event.info.event_type == event.info.REQUEST_SENT:
                    off = not getattr(event.request[0], 'data', True)
                    yield since(_nanoseconds(event.info.stamp)), f'{name} off' if off else name


def _identity(arrays: Iterable[Any], drive: str) -> list[str]:
    """Return what diagnostics report of the identity of the drive."""
    mine = f'{drive.lstrip("/")}: drive'
    for array in arrays:
        for status in array.status:
            values = {pair.key: pair.value for pair in status.values}
            if status.name == mine and values.get('firmware'):
                named = {
                    '': values.get('model', ''),
                    'serial ': values.get('serial number', ''),
                    'firmware ': values['firmware'],
                }
                return [name + value for name, value in named.items() if value]
    return []


def _phase(status: Any) -> str:
    for name, phase in _PHASE_OF_STATE.items():
        if status.state == getattr(status, name):
            return phase
    return 'standby'


def _spans(points: list[tuple[float, str]], end: float) -> list[Span]:
    """Join equal neighbours to spans that follow each other up to the end."""
    changes: list[tuple[float, str]] = []
    for time, what in points:
        if not changes or what != changes[-1][1]:
            changes.append((time, what))
    ends = [*(time for time, _ in changes[1:]), end]
    # what is latched may have been published before the first status that was received
    return [
        Span(max(begin, 0.0), until, what)
        for (begin, what), until in zip(changes, ends, strict=False)
        if until > 0
    ]


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


# --- the picture ------------------------------------------------------------------------------


def draw(bag: Path, picture: Path, drive: str = '/nfo_sinus') -> None:
    """
    Draw what a bag says of a run into a PNG file.

    :raises ValueError: there is nothing of the drive in it.
    """
    run = read(bag, drive)
    with matplotlib.rc_context(_STYLE):
        # no window, and no state that is shared: the figure is drawn for the file alone
        figure = Figure(figsize=_SIZE, dpi=_DPI, facecolor='white')
        FigureCanvasAgg(figure)
        grid = figure.add_gridspec(
            4, 1, height_ratios=(1.0, 4.2, 2.3, 2.3), hspace=0.16,
            left=_LEFT, right=_RIGHT, top=0.842, bottom=0.085,
        )
        states, frequency, speed, current = (figure.add_subplot(cell) for cell in grid)
        for axes in (states, frequency, speed, current):
            axes.set_xlim(-0.2, run.length + 0.2)
            axes.xaxis.set_major_locator(MultipleLocator(_step(max(run.length, 1.0))))
            axes.tick_params(axis='x', labelbottom=axes is current, length=0)
            _mark(axes, run)
        _draw_states(states, run)
        _name_calls(states, run)
        _draw_frequency(frequency, run)
        _draw_quantity(speed, run.speed, 'motor speed (rpm)', _GREEN)
        _draw_quantity(current, run.current, 'output current (A)', _PURPLE, marker='o')
        current.set_ylim(bottom=0.0)
        current.set_xlabel('time (s)', labelpad=8)
        _name_faults(frequency, run)
        figure.align_ylabels([frequency, speed, current])
        _draw_title(figure, run, frequency.get_legend_handles_labels()[0])
        picture.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(picture, dpi=_DPI)


def _draw_title(figure: Figure, run: Recording, lines: list[Artist]) -> None:
    facts = [run.remarks.get('drive', ''), *run.identity, f'{run.began:%d %B %Y, %H:%M}']
    figure.text(_LEFT, 0.944, run.remarks.get('title', 'A test run'), size=25, weight='bold')
    figure.text(_LEFT, 0.904, '   ·   '.join(filter(None, facts)), size=14, color=_SOFT)
    figure.text(
        _RIGHT, 0.018, f'drawn from the bag {run.source}', size=11, color=_SOFT, ha='right'
    )
    phases = [Patch(color=colour, label=phase) for phase, (colour, _) in _PHASES.items()]
    for y, handles in ((0.976, phases), (0.948, lines)):
        figure.legend(
            handles=handles, loc='upper right', bbox_to_anchor=(_RIGHT, y), ncols=len(handles),
            fontsize=12, borderaxespad=0.0, borderpad=0.0, handlelength=1.8, columnspacing=1.4,
        )


# --- panels -----------------------------------------------------------------------------------


def _draw_states(axes: Axes, run: Recording) -> None:
    axes.set_ylim(0.0, 2.0)
    axes.set_yticks([0.48, 1.52], ['display', 'motor'])
    axes.tick_params(axis='y', length=0)
    axes.spines[:].set_visible(False)
    for span in run.phases:
        colour, ink = _PHASES[span.what]
        _draw_span(axes, span, 1.04, colour, ink, bold=True)
    faulty = {span.what for span in run.faults}
    for span in run.texts:
        fault = span.what in faulty
        _draw_span(axes, span, 0.0, '#F9DCCB' if fault else '#F0F0F0', _INK, bold=fault)


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
        if _width(text) < 0.96 * length:
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
    """Draw calls and faults through a panel."""
    for time, _ in run.calls:
        axes.axvline(time, color=_INK, linewidth=1.0, linestyle=(0, (4, 4)), zorder=2)
    for span in run.faults:
        axes.axvspan(span.begin, span.end, color=_VERMILION, alpha=0.10, linewidth=0, zorder=0)
        axes.axvline(span.begin, color=_VERMILION, linewidth=2.2, zorder=5)


def _name_calls(axes: Axes, run: Recording) -> None:
    """Name the calls above the panel, one above the other where they would overlap."""
    ends: list[float] = []
    for time, name in run.calls:
        text = axes.text(
            time, 0.0, f'▼ {name}', transform=_at_height(axes), ha='left', va='bottom', size=13
        )
        row = next((row for row, end in enumerate(ends) if end < time), len(ends))
        ends[row : row + 1] = [time + _width(text)]
        text.set_y(1.06 + 0.3 * row)


def _name_setpoints(axes: Axes, followed: Curve, unit: str) -> None:
    named = math.nan
    for time, value in zip(followed.times, followed.values, strict=True):
        # NaN, where nothing is followed, is neither near nor far
        if value == value and value not in (named, 0.0):
            axes.annotate(
                f'{value:+g} {unit}'.replace('-', '\N{MINUS SIGN}'), (time, value),
                (4, 5 if value >= 0 else -5), textcoords='offset points', ha='left',
                va='bottom' if value >= 0 else 'top', color=_DARK_ORANGE, weight='bold', zorder=6,
            )
        if value == value:
            named = value


def _name_faults(axes: Axes, run: Recording) -> None:
    for span in run.faults:
        offset = {'textcoords': 'offset points', 'xycoords': _at_height(axes), 'zorder': 6}
        where = (span.begin, 0.985)
        axes.annotate(
            span.what, where, (8, 0), va='top', size=18, weight='bold', color=_VERMILION, **offset
        )
        text = f'fault {span.code}, {span.begin:.1f} s\nmotor released,\nspeed unknown'
        axes.annotate(text, where, (8, -26), va='top', size=11.5, color=_INK, **offset)


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
