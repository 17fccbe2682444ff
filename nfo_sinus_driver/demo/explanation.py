# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Says in text what a bag says of a drive: when, who, and why it stopped."""

from __future__ import annotations

from collections.abc import Iterator

from nfo_sinus_driver.demo.recorded import Recording, Stop

#: A drive that is no longer enabled was stopped by what is noted within this, s.
_SAME = 1.5
#: How the answer to a stop begins that the drive has confirmed.
_DONE = ('stopped (', 'stopping (')
#: It is no stop: the next set-point moves the motor.
_TIME_OUT = 'setpoint timeout'


def explanation(run: Recording) -> Iterator[str]:
    """Yield the lines of the explanation of a drive, with times in s."""
    yield f'{run.drive}, times in s from {run.began:%d %B %Y, %H:%M:%S} on:'
    if why := run.remarks.get('why'):
        yield f'kept because of {why}'
    moments = [*_answers(run), *_calls(run), *_enabled(run), *_faults(run), *_stops(run)]
    # what was done comes before what came of it in the same moment
    for time, text in sorted(moments, key=lambda moment: moment[0]):
        yield f'{time:9.2f}  {text}'
    yield f'{run.length:9.2f}  the end of the recording'


def _answers(run: Recording) -> Iterator[tuple[float, str]]:
    for span in run.connected:
        yield span.begin, ', '.join(('connected', *run.identity))
        if span.end < run.length and not _stopped(run, span.end, 'drive lost', 'power cycle'):
            yield span.end, 'the drive is lost'


def _calls(run: Recording) -> Iterator[tuple[float, str]]:
    """Yield calls: as the log has them, with who called; else as the services have."""
    for call in run.logged or run.calls:
        named = any(stop.text.endswith(call.name) for stop in _stops_at(run, call.time))
        if named and call.answer.startswith(_DONE):
            # the stop tells it
            continue
        yield call.time, f'{call.name}: {call.answer}' if call.answer else call.name


def _enabled(run: Recording) -> Iterator[tuple[float, str]]:
    for span in run.enabled:
        calls = (call for call in run.logged or run.calls if abs(call.time - span.begin) < _SAME)
        if not any(call.answer.startswith('enabled') for call in calls):
            yield span.begin, 'enabled'
        if span.end < run.length and not _stops_at(run, span.end):
            yield span.end, 'no longer enabled; this bag does not say why'


def _faults(run: Recording) -> Iterator[tuple[float, str]]:
    for span in run.faults:
        if not _stopped(run, span.begin, 'fault'):
            yield span.begin, f'the drive shows fault {span.code} {span.what}'


def _stops_at(run: Recording, moment: float) -> list[Stop]:
    return [stop for stop in run.stops if abs(stop.time - moment) < _SAME]


def _stopped(run: Recording, moment: float, *reasons: str) -> bool:
    """Return whether a stop tells the same."""
    return any(stop.reason in reasons for stop in _stops_at(run, moment))


def _stops(run: Recording) -> Iterator[tuple[float, str]]:
    for stop in run.stops:
        # at a time-out of the set-points the drive stays enabled
        what = 'SET TO 0' if stop.reason == _TIME_OUT else 'STOPPED'
        yield stop.time, f'{what}, {stop.reason}: {stop.text}'
