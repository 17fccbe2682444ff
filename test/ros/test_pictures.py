# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A picture of any run can be read: what is named is named once, and no name cuts another."""

from __future__ import annotations

import dataclasses
from datetime import datetime
import itertools
import math
from random import Random
from typing import Any

from matplotlib.axes import Axes
from matplotlib.text import Text
from nfo_sinus_msgs.msg import DriveStatus
import pytest

from nfo_sinus_driver.demo import plot, recorded
from nfo_sinus_driver.demo.recorded import Call, Curve, Recording, Span, Stop

RATE = 20.0


def curve(length: float, value: Any) -> Curve:
    """A value as it is published."""
    times = [number / RATE for number in range(int(length * RATE))]
    return Curve(times, [value(time) for time in times])


def run_of(length: float, setpoint: Any, **more: Any) -> Recording:
    """A run in which the motor follows."""
    followed = curve(length, setpoint)
    parts: dict[str, Any] = {
        'drive': '/nfo_sinus', 'began': datetime(2026, 11, 29, 10, 0), 'length': length,
        'remarks': {}, 'source': 'a bag', 'unit': 'Hz', 'identity': ['NFO Sinus'],
        'setpoint': followed, 'actual': followed, 'speed': followed, 'current': followed,
        'connected': [Span(0, length, 'connected')], 'phases': [Span(0, length, 'running')],
        'texts': [Span(0, length, 'Bus Run')], 'faults': [], 'unknown': [],
        'enabled': [Span(0, length, 'enabled')], 'calls': [], 'logged': [], 'stops': [],
    }
    return Recording(**{**parts, **more})


def panels(run: Recording) -> list[Axes]:
    """The states, and below them set-point and speed."""
    return list(plot._picture_of(run).axes)


def names(axes: Axes, word: str = '') -> list[Text]:
    return [text for text in axes.texts if word in text.get_text()]


def cut(texts: list[Text]) -> list[tuple[str, str]]:
    """The pairs that lie one on the other."""
    boxes = [(text.get_text(), text.get_window_extent()) for text in texts]
    return [
        (text, other)
        for (text, box), (other, another) in itertools.combinations(boxes, 2)
        if box.overlaps(another)
    ]


SETPOINTS = {
    'sine': lambda time: 20 * math.sin(time),
    'ramp': lambda time: min(50.0, 2 * time),
    'stick': Random(1).gauss,
    'steps': lambda time: 5.0 * (time // 3 % 9),
    'many steps': lambda time: 1.0 + time // 1.2 % 40,
}


@pytest.mark.parametrize('length', [4.0, 30.0, 400.0])
@pytest.mark.parametrize('kind', SETPOINTS)
def test_some_set_points_are_named_and_can_be_read(kind: str, length: float) -> None:
    value = SETPOINTS[kind]
    run = run_of(length, (lambda _: value(20, 3)) if kind == 'stick' else value)
    named = names(panels(run)[1], ' Hz')
    assert len(named) <= 10
    assert not cut(named)
    for text in named:
        number = text.get_text().removesuffix(' Hz')
        assert len(number.lstrip('+\N{MINUS SIGN}').replace('.', '')) <= 3
    if kind == 'steps' and length == 30.0:
        assert {text.get_text() for text in named} >= {'+5 Hz', '+15 Hz', '+40 Hz'}
    if kind in ('sine', 'stick'):
        assert not named


def test_a_run_without_set_points_has_a_picture() -> None:
    run = dataclasses.replace(run_of(30.0, lambda time: 20.0), setpoint=Curve())
    assert not names(panels(run)[1], ' Hz')


@pytest.mark.parametrize('seed', range(5))
def test_names_of_faults_and_states_do_not_cut_each_other(seed: int) -> None:
    random = Random(seed)
    moments = sorted(random.uniform(0, 60) for _ in range(40))
    states = [
        Span(begin, end, random.choice(('Bus Run', 'Overload', 'Bus Stby', 'DC Over Voltage')))
        for begin, end in itertools.pairwise((0.0, *moments, 60.0))
    ]
    faults = [Span(span.begin, span.end, span.what, 7) for span in states if 'Over' in span.what]
    run = run_of(60.0, lambda time: 20.0, texts=states, faults=faults)
    bars, frequency = panels(run)[:2]
    assert not cut([text for text in bars.texts if text.get_position()[1] < 1])
    assert names(frequency, 'fault 7')
    named = [text for text in frequency.texts if ' Hz' not in text.get_text()]
    assert not cut(named)
    assert all(text.get_bbox_patch() is not None for text in named)
    edge = frequency.get_window_extent()
    assert all(text.get_window_extent().x1 < edge.x1 + 12 for text in named)


def test_states_shorter_than_their_names_become_one() -> None:
    states = [
        Span(number / 10, (number + 1) / 10, ('Bus Run', 'Bus Stby')[number % 2])
        for number in range(100)
    ]
    run = run_of(60.0, lambda time: 20.0, texts=[*states, Span(10.0, 60.0, 'Bus Run')])
    bars = panels(run)[0]
    assert sorted(text.get_text() for text in bars.texts) == ['Bus Run', 'running', '…']


def test_an_unknown_speed_is_said_whatever_made_it_so() -> None:
    stopped = run_of(
        30.0,
        lambda time: 20.0 if time < 10 else math.nan,
        unknown=[Span(10.0, 15.0, 'speed unknown')],
        stops=[Stop(10.0, 'keypad', 'STOP at the keypad')],
        calls=[Call(9.0, 'enable')],
    )
    assert names(panels(stopped)[1], 'speed unknown')


def spans_unknown(*states: tuple[int, float]) -> list[tuple[float, float]]:
    """From when to when it was unknown; a state and what the drive tells, for each second."""
    statuses = []
    for second, (state, actual) in enumerate(states):
        status = DriveStatus(connected=True, state=state, actual=actual)
        status.header.stamp.sec = second
        statuses.append((second * 10**9, status))
    reader = recorded._Reader({'/drive/status': statuses}, '/drive', 0)
    return [(span.begin, span.end) for span in reader._unknown(float(len(states)))]


RUNS, STOPS = DriveStatus.OPERATION_ENABLED, DriveStatus.STOPPING
FAULT, STANDS = DriveStatus.FAULTED, DriveStatus.SWITCH_ON_DISABLED


def test_the_speed_of_a_released_motor_is_unknown_until_it_runs_again() -> None:
    # by a fault, and by STOP at the keypad: the drive reports the 0 of its output
    for released in (FAULT, STANDS):
        told = spans_unknown((RUNS, 20.0), (released, 0.0), (STANDS, 0.0), (RUNS, 0.0), (RUNS, 9.0))
        assert told == [(1.0, 3.0)]
    assert not spans_unknown((RUNS, 20.0), (STOPS, 8.0), (STOPS, 0.4), (STANDS, 0.0), (STANDS, 0.0))
    assert spans_unknown((RUNS, 20.0), (RUNS, math.nan), (RUNS, 20.0)) == [(1.0, 2.0)]
