# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Laws of an operating record: totals never fall, a shift is never more, a file gives the same."""

from __future__ import annotations

import copy
import dataclasses
import json
import math
from typing import Any

from hypothesis import given, settings, strategies as st
import pytest
from support.examples import examples
from support.rig import Rig

from nfo_sinus_driver.catalog import Kind, Role
from nfo_sinus_driver.drive import Cause, Report, Snapshot, Telemetry
from nfo_sinus_driver.operating_record.counting import Counting
from nfo_sinus_driver.operating_record.figures import Fault, Figures, Record, decoded

FLOATS = st.floats(-1e6, 1e6) | st.just(math.nan)
STOPS = [None, Report(Cause.FAULT), Report(Cause.STOP_REQUESTED, by='a'), Report(Cause.LOST)]
_kept: dict[str, Snapshot] = {}


def seen() -> dict[str, Snapshot]:
    """Some statuses of a drive, as the driver has published them."""
    if not _kept:
        with Rig('rtu').turn() as rig:
            rig.pass_time(2.0)
            _kept['runs'] = rig.notes.snapshots[-1]
            rig.answer(rig.drive.stop())
            rig.pass_time(2.0)
            _kept['stands'] = rig.notes.snapshots[-1]
            rig.far.trip(rig.a_fault)
            rig.pass_time(2.0)
            _kept['faulted'] = rig.notes.snapshots[-1]
        assert _kept['runs'].status and _kept['runs'].status.driven
        assert _kept['faulted'].kind is Kind.FAULT
    return _kept


ACTIONS = st.one_of(
    st.tuples(
        st.just('status'),
        st.sampled_from(['runs', 'stands', 'faulted', 'lost']),
        st.sampled_from(STOPS),
        FLOATS,
    ),
    st.tuples(
        st.just('telemetry'),
        st.dictionaries(
            st.sampled_from([
                Role.TOTAL_ENERGY, Role.ENERGY, Role.OUTPUT_POWER, Role.ACTUAL_TORQUE,
                Role.PT1000_TEMPERATURE, Role.MOTOR_TEMPERATURE, Role.OUTPUT_CURRENT,
            ]),
            FLOATS,
        ),
    ),
    st.tuples(st.just('errors'), st.integers(0, 10**6)),
    st.tuples(st.just('shift')),
    st.tuples(st.just('restart')),
)
HISTORIES = st.lists(st.tuples(st.floats(0, 200), ACTIONS), max_size=40)


def act(counting: Counting, at: float, action: tuple[Any, ...]) -> Counting:
    match action:
        case ('status', 'lost', stop, _):
            counting.take_status(Snapshot(at, False, False, '', stop=stop))
        case ('status', which, stop, frequency):
            shown = dataclasses.replace(seen()[which], at=at, stop=stop, frequency=frequency)
            counting.take_status(shown)
        case ('telemetry', values):
            counting.take_telemetry(Telemetry(at, values))
        case ('errors', count):
            counting.take_line_errors(count)
        case ('shift',):
            counting.record.begin_shift(at)
        case ('restart',):
            return Counting(decoded(counting.record.encoded()), lambda at: at)
    return counting


def is_more(less: Figures, more: Figures) -> bool:
    """Whether no figure is less."""
    faults = {code: fault.count for code, fault in more.faults.items()}
    return (
        all(
            getattr(less, name) <= getattr(more, name)
            for name in (
                'powered', 'running', 'starts', 'reversals', 'line_errors', 'longest_silence',
            )
        )
        and all(more.stops[name] >= count for name, count in less.stops.items())
        and all(faults.get(code, 0) >= fault.count for code, fault in less.faults.items())
        and (less.energy is None or (more.energy is not None and less.energy <= more.energy))
        and all(more.highest.get(name, -math.inf) >= high for name, high in less.highest.items())
    )


@settings(max_examples=examples(150), deadline=None)
@given(HISTORIES)
def test_totals_never_fall_and_a_shift_is_never_more(
    history: list[tuple[float, tuple[Any, ...]]]
) -> None:
    counting, at = Counting(Record.begun('a drive', '', 0.0), lambda at: at), 0.0
    for passed, action in history:
        at += passed
        before = copy.deepcopy(counting.record.total)
        counting = act(counting, at, action)
        record = counting.record
        assert is_more(before, record.total)
        assert is_more(record.shift, record.total)
        assert record.total.running <= record.total.powered
        assert decoded(record.encoded()) == record


@settings(max_examples=examples(100), deadline=None)
@given(HISTORIES, HISTORIES)
def test_what_was_counted_before_a_file_could_be_read_is_not_lost(
    first: list[tuple[float, tuple[Any, ...]]], second: list[tuple[float, tuple[Any, ...]]]
) -> None:
    kept = Counting(Record.begun('a drive', '', 0.0), lambda at: at)
    beside = Counting(Record.begun('a drive', '', 1e6), lambda at: at)
    for counting, history, at in ((kept, first, 0.0), (beside, second, 1e6)):
        for passed, action in history:
            at += passed
            if action[0] != 'restart':
                act(counting, at, action)
    parts = [copy.deepcopy(one.record) for one in (kept, beside)]
    beside.continue_from(kept.record)
    whole = beside.record
    assert all(is_more(part.total, whole.total) for part in parts)
    assert whole.total.powered == sum(part.total.powered for part in parts)
    assert whole.total.stops.total() == sum(part.total.stops.total() for part in parts)
    assert is_more(whole.shift, whole.total)
    for code, fault in whole.total.faults.items():
        each = [part.total.faults.get(code, Fault()).count for part in parts]
        assert fault.count == sum(each)
    assert whole.total.since == parts[0].total.since


def test_a_shift_that_was_begun_before_the_file_could_be_read_goes_on() -> None:
    kept, beside = Record.begun('a drive', '', 0.0), Record.begun('a drive', '', 100.0)
    kept.shift.starts = kept.total.starts = 5
    beside.shift.starts = beside.total.starts = 2
    assert kept.followed_by(beside).shift.starts == 7
    beside.begin_shift(200.0)
    beside.shift.starts, beside.total.starts = 1, 3
    whole = kept.followed_by(beside)
    assert (whole.shift.since, whole.shift.starts, whole.total.starts) == (200.0, 1, 8)


def test_a_start_while_an_older_stop_is_shown_counts_once() -> None:
    counting = Counting(Record.begun('a drive', '', 0.0), lambda at: at)
    before, shown = STOPS[1], seen()
    history = [
        ('stands', before), ('runs', before), ('runs', None), ('runs', None), ('stands', STOPS[2])
    ]
    for at, (which, stop) in enumerate(history):
        counting.take_status(dataclasses.replace(shown[which], at=float(at), stop=stop))
    assert counting.record.total.starts == 1
    assert dict(counting.record.total.stops) == {'FAULT': 1, 'STOP': 1}


def test_a_file_of_another_version_lacks_a_figure_and_has_another() -> None:
    record = Record.begun('a drive', '1', 5.0)
    record.total.starts = 3
    facts = json.loads(record.encoded())
    del facts['total']['reversals'], facts['counters'], facts['fault']
    facts['new'] = facts['total']['also_new'] = {}
    found = decoded(json.dumps(facts).encode())
    assert found == record


@pytest.mark.parametrize(
    'content',
    [
        b'', b'null', b'[]', b'{', b'{}', b'\x00' * 100, b'\xff', b'9' * 5000, b'[' * 100_000,
        b'{"drive": 1, "serial": "", "total": {"since": 0}, "shift": {"since": 0}}',
        *(
            b'{"drive": "", "serial": "", "shift": {"since": 0}, "total": {"since": 0, %s}}' % wrong
            for wrong in (
                b'"starts": -1', b'"starts": 1.5', b'"starts": true', b'"energy": "1"',
                b'"starts": 1' + b'0' * 30, b'"since": NaN', b'"since": 1e99',
                b'"stops": {"STOP": -1}', b'"stops": 1', b'"faults": {"a": {}}', b'"faults": []',
                b'"faults": {"1": {"count": 1, "text": "a", "last": -1}}',
                b'"highest": {"torque": 1e300}', b'"highest": {"torque": Infinity}',
            )
        ),
    ],
)
def test_what_is_no_record_is_an_error(content: bytes) -> None:
    with pytest.raises(ValueError):
        decoded(content)
