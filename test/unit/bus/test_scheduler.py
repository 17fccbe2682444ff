# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Whose turn it is, without a line, a clock or a thread."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
import functools
from typing import Any, cast

import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus.scheduler import BACKGROUND_SHARE, Scheduler, Waiting
from nfo_sinus_driver.bus.tasks import LatestValue, Priority, Request, Task
from nfo_sinus_driver.link import Read, Write

_SLOT = 'slot'
_BACKGROUND = (Priority.TELEMETRY, Priority.REFRESH)
#: A read at 57600 bit/s takes this long, s.
_READ = 0.0064
_TURNS = 4000


class _Named(str):
    """A task in name alone."""

    requests = 0
    stops = False


#: The same each time.
named = functools.cache(_Named)


def entry(kind: object, name: str = '') -> LatestValue | Waiting:
    """Something that waits; a name stands for its task."""
    if kind == _SLOT:
        return LatestValue(1, lambda: None, lambda written, error: None)
    request = Request(1, Read(register(1)), cast(Priority, kind))
    return Waiting(cast(Task, named(name)), request)


def kind_of(taken: LatestValue | Waiting | None) -> object:
    """What was taken out: ``slot``, a priority, or ``None``."""
    if isinstance(taken, Waiting):
        return taken.request.priority
    return None if taken is None else _SLOT


def without_end(kinds: Iterable[object], took: dict[object, float]) -> list[object]:
    """Return who goes when each asks again as soon as it has been on the line."""
    scheduler = Scheduler()
    for kind in kinds:
        scheduler.add(entry(kind))
    went = []
    for _ in range(_TURNS):
        kind = kind_of(scheduler.next_entry())
        scheduler.took(took.get(kind, _READ))
        went.append(kind)
        scheduler.add(entry(kind))
    return went


def share(went: list[object], took: dict[object, float]) -> dict[Any, float]:
    """Return the part of the time that each had."""
    total = sum(took.get(kind, _READ) for kind in went)
    return {
        kind: count * took.get(kind, _READ) / total for kind, count in Counter(went).items()
    }


def test_most_urgent_goes_first() -> None:
    scheduler = Scheduler()
    for kind in (*sorted(Priority, reverse=True), _SLOT):
        scheduler.add(entry(kind))
    went = []
    while (taken := scheduler.next_entry()) is not None:
        went.append(kind_of(taken))
        scheduler.took(0.0)
    assert went[:7] == [
        Priority.STOP,
        Priority.LOOK,
        _SLOT,
        Priority.SETPOINT,
        Priority.SERVICE,
        Priority.POLL,
        Priority.TELEMETRY,
    ]
    assert went[7:] == [Priority.REFRESH]


@pytest.mark.parametrize('kind', [*Priority, _SLOT])
def test_equals_go_in_the_order_they_came(kind: object) -> None:
    scheduler = Scheduler()
    entries = [entry(kind, str(number)) for number in range(5)]
    for waiting in entries:
        scheduler.add(waiting)
    assert [scheduler.next_entry() for _ in range(6)] == [*entries, None]


def test_a_stop_goes_before_a_look_whether_a_motor_stops() -> None:
    scheduler = Scheduler()
    look = entry(Priority.LOOK, 'look')
    write = Write(register(1), packed(0))
    stops = [
        Waiting(cast(Task, named(name)), Request(1, write, Priority.STOP))
        for name in ('1', '2')
    ]
    for waiting in (look, *stops):
        scheduler.add(waiting)
    assert [scheduler.next_entry() for _ in range(3)] == [*stops, look]


# --- the background -------------------------------------------------------------------------------


@pytest.mark.parametrize('background', [_READ, 0.023])
@pytest.mark.parametrize('foreground', [_READ, 0.023, 0.2])
@pytest.mark.parametrize('kind', [Priority.SETPOINT, Priority.SERVICE, Priority.POLL])
def test_background_has_a_sixth_of_the_time_each(
    kind: Priority, foreground: float, background: float
) -> None:
    took = {kind: foreground, **dict.fromkeys(_BACKGROUND, background)}
    went = without_end((kind, *_BACKGROUND), took)
    found = share(went, took)
    assert found[Priority.TELEMETRY] == pytest.approx(BACKGROUND_SHARE, rel=0.02)
    assert found[Priority.REFRESH] == pytest.approx(BACKGROUND_SHARE, rel=0.02)


@pytest.mark.parametrize('setpoint', [_READ, 0.023])
def test_set_points_without_end_halve_the_turns_of_polls_and_background_alike(
    setpoint: float,
) -> None:
    # at 1000 Hz they took three of four turns from the polls: half the line, and the background its
    # shares of the whole out of the other half
    took: dict[object, float] = {_SLOT: setpoint}
    without = Counter(without_end((Priority.POLL, *_BACKGROUND), took))
    among = Counter(without_end((_SLOT, Priority.POLL, *_BACKGROUND), took))
    assert among[_SLOT] == _TURNS // 2
    for kind in (Priority.POLL, *_BACKGROUND):
        assert among[kind] == pytest.approx(without[kind] / 2, rel=0.02)


def test_polls_of_units_that_do_not_answer_have_half_the_time() -> None:
    silent, timeout = {7, 8}, 0.2
    scheduler = Scheduler(silent.__contains__)
    polls = {unit: Request(unit, Read(register(1)), Priority.POLL) for unit in (1, 2, 7, 8)}
    for request in polls.values():
        scheduler.add(Waiting(cast(Task, named('')), request))
    took: Counter[int] = Counter()
    gaps, gap = [], 0.0
    while sum(took.values()) < 60.0:
        taken = scheduler.next_entry()
        assert isinstance(taken, Waiting)
        unit = taken.request.unit
        seconds = timeout if unit in silent else _READ
        scheduler.took(seconds)
        took[unit] += seconds
        gap = gap + seconds if unit in silent else 0.0
        gaps.append(gap)
        scheduler.add(taken)
    assert took[7] + took[8] == pytest.approx(30.0, rel=0.02)
    assert took[7] == pytest.approx(took[8], rel=0.02)
    # and one time-out at a time
    assert max(gaps) == pytest.approx(timeout)


def test_the_request_with_which_a_unit_falls_silent_is_of_that_half_too() -> None:
    silent: set[int] = set()
    scheduler = Scheduler(silent.__contains__)
    for unit in (7, 8, 1):
        scheduler.add(poll_of(unit))
    for unit in (7, 8):
        taken = scheduler.next_entry()
        assert isinstance(taken, Waiting) and taken.request.unit == unit
        silent.add(unit)
        scheduler.took(0.2)
        scheduler.add(taken)
    assert cast(Waiting, scheduler.next_entry()).request.unit == 1


def test_units_that_do_not_answer_do_not_wait_when_no_other_waits() -> None:
    scheduler = Scheduler(lambda unit: True)
    for _ in range(10):
        scheduler.add(entry(Priority.POLL))
        assert kind_of(scheduler.next_entry()) == Priority.POLL
        scheduler.took(0.2)


def test_what_only_a_part_of_the_background_wants_goes_to_no_other() -> None:
    found = share(without_end((Priority.POLL, Priority.REFRESH), {}), {})
    assert found[Priority.REFRESH] == pytest.approx(BACKGROUND_SHARE, rel=0.02)


def test_an_idle_background_is_owed_little() -> None:
    scheduler = Scheduler()
    for _ in range(1000):
        scheduler.add(entry(Priority.POLL))
        scheduler.next_entry()
        scheduler.took(0.2)
    for kind in (Priority.POLL, *_BACKGROUND):
        scheduler.add(entry(kind))
    went = []
    for _ in range(3):
        went.append(kind_of(scheduler.next_entry()))
        scheduler.took(_READ)
    # one request of each
    assert set(went[:2]) == set(_BACKGROUND)
    assert went[2] == Priority.POLL


def test_background_that_waited_long_does_not_keep_the_line_for_long() -> None:
    scheduler = Scheduler()
    for kind in (*[Priority.STOP] * 1000, *[Priority.TELEMETRY] * 1000, Priority.POLL):
        scheduler.add(entry(kind))
    for _ in range(1000):
        scheduler.next_entry()
        scheduler.took(_READ)
    passed = 0.0
    while kind_of(scheduler.next_entry()) != Priority.POLL:
        scheduler.took(_READ)
        passed += _READ
    # what it earns in half a second
    assert passed <= 0.1 + _READ


def test_background_on_an_idle_line_makes_no_debt() -> None:
    scheduler = Scheduler()
    for _ in range(1000):
        scheduler.add(entry(Priority.TELEMETRY))
        scheduler.next_entry()
        scheduler.took(_READ)
    scheduler.add(entry(Priority.TELEMETRY))
    went = []
    for _ in range(10):
        scheduler.add(entry(Priority.POLL))
        went.append(kind_of(scheduler.next_entry()))
        scheduler.took(_READ)
    assert went.index(Priority.TELEMETRY) <= 7


# --- set-points -----------------------------------------------------------------------------------


def test_set_point_goes_before_all_that_the_background_is_owed() -> None:
    scheduler = Scheduler()
    for kind in (Priority.POLL, *[Priority.TELEMETRY] * 10):
        scheduler.add(entry(kind))
    scheduler.next_entry()
    scheduler.took(10.0)
    scheduler.next_entry()
    scheduler.took(_READ)
    scheduler.add(entry(_SLOT))
    assert kind_of(scheduler.next_entry()) == _SLOT
    scheduler.took(_READ)
    # and then it goes on with what it is owed
    scheduler.add(entry(_SLOT))
    scheduler.add(entry(Priority.POLL))
    assert kind_of(scheduler.next_entry()) == Priority.TELEMETRY


@pytest.mark.parametrize('kind', [Priority.SERVICE, Priority.POLL])
def test_set_points_without_end_leave_every_other_turn_to_the_others(kind: Priority) -> None:
    scheduler = Scheduler()
    for _ in range(20):
        scheduler.add(entry(_SLOT))
        scheduler.add(entry(kind))
    went = []
    for _ in range(10):
        went.append(kind_of(scheduler.next_entry()))
        scheduler.took(_READ)
    assert went == [_SLOT, kind] * 5


def test_stop_goes_before_a_set_point() -> None:
    scheduler = Scheduler()
    scheduler.add(entry(_SLOT))
    scheduler.add(entry(Priority.STOP))
    assert kind_of(scheduler.next_entry()) == Priority.STOP


def test_set_point_that_was_not_sent_had_no_turn() -> None:
    scheduler = Scheduler()
    for kind in (_SLOT, _SLOT, Priority.POLL):
        scheduler.add(entry(kind))
    # the first has nothing to say any more
    scheduler.next_entry()
    assert kind_of(scheduler.next_entry()) == _SLOT


def stop_of(unit: int, *, stops: bool = True) -> Waiting:
    """A stop that waits, or a set-point 0."""
    request = Request(unit, Write(register(1), packed(0)), Priority.STOP)
    task = _Named(f'stop {unit}')
    task.stops = stops
    return Waiting(cast(Task, task), request)


def test_a_stop_that_is_not_answered_gives_way_to_others_once() -> None:
    silent, poll, other = stop_of(2), entry(Priority.POLL), stop_of(3)
    scheduler = Scheduler(lambda unit: unit == 2)
    scheduler.add(silent)
    assert scheduler.next_entry() is silent
    scheduler.took(0.2)
    for waiting in (silent, poll):
        scheduler.add(waiting)
    assert scheduler.next_entry() is poll
    scheduler.took(_READ)
    assert scheduler.next_entry() is silent
    scheduler.took(0.2)
    # nothing else waits
    scheduler.add(silent)
    assert scheduler.next_entry() is silent
    scheduler.took(0.2)
    # a stop of another unit goes first of all
    for waiting in (silent, poll, other):
        scheduler.add(waiting)
    assert scheduler.next_entry() is other


@pytest.mark.parametrize('kind', [Priority.POLL, Priority.SERVICE, Priority.SETPOINT])
def test_between_two_stops_without_an_answer_the_most_urgent_has_its_turn(
    kind: Priority,
) -> None:
    scheduler = Scheduler({2, 4}.__contains__)
    urgent, silent = entry(kind), stop_of(2)
    retry = Waiting(cast(Task, named('retry')), Request(4, Read(register(1)), Priority.POLL))
    for waiting in (retry, *map(entry, _BACKGROUND)):
        scheduler.add(waiting)
    # it costs so much that every other request has a claim on the line
    for _ in range(5):
        scheduler.add(silent)
        assert scheduler.next_entry() is silent
        scheduler.took(0.2)
        scheduler.add(urgent)
        assert scheduler.next_entry() is urgent
        scheduler.took(_READ)


@pytest.mark.parametrize('kind', [Priority.POLL, Priority.SERVICE])
def test_set_points_without_end_leave_turns_between_stops_without_an_answer(
    kind: Priority,
) -> None:
    scheduler = Scheduler(lambda unit: unit == 2)
    for waiting in (stop_of(2), entry(_SLOT), entry(kind)):
        scheduler.add(waiting)
    went = []
    for _ in range(9):
        taken = scheduler.next_entry()
        assert taken is not None
        went.append(kind_of(taken))
        scheduler.took(0.2 if went[-1] == Priority.STOP else _READ)
        scheduler.add(taken)
    assert went == [*[Priority.STOP, _SLOT, Priority.STOP, kind] * 2, Priority.STOP]


def test_stops_of_several_units_that_do_not_answer_leave_every_other_turn_to_the_others() -> None:
    silent = {2, 3, 4}
    scheduler = Scheduler(silent.__contains__)
    stops, poll = [stop_of(unit) for unit in silent], entry(Priority.POLL)
    for waiting in (poll, *stops):
        scheduler.add(waiting)
    # the first of each goes at once
    went = []
    for _ in range(13):
        taken = scheduler.next_entry()
        assert isinstance(taken, Waiting)
        went.append(taken)
        scheduler.took(_READ if taken is poll else 0.2)
        scheduler.add(taken)
    assert went == [*stops, *[task for stop in 2 * stops for task in (poll, stop)][:10]]


@pytest.mark.parametrize('kind', [Priority.POLL, *_BACKGROUND])
def test_what_waits_for_a_unit_that_falls_silent_is_ranked_again(kind: Priority) -> None:
    silent: set[int] = set()
    scheduler = Scheduler(silent.__contains__)
    falls_silent = Waiting(cast(Task, named('asks')), Request(7, Read(register(1)), kind))
    other = Waiting(cast(Task, named('asks')), Request(1, Read(register(1)), kind))
    for waiting in (falls_silent, other):
        scheduler.add(waiting)
    silent.add(7)
    assert [scheduler.next_entry() for _ in range(3)] == [other, falls_silent, None]


def test_the_first_stop_of_a_unit_is_not_held_back_by_its_service_that_was_in_vain() -> None:
    scheduler = Scheduler({2}.__contains__)
    stop, poll = stop_of(2), entry(Priority.POLL)
    asked = Request(2, Read(register(1)), Priority.SERVICE)
    service = Waiting(cast(Task, named('service')), asked)
    for waiting in (service, poll):
        scheduler.add(waiting)
    assert scheduler.next_entry() is service
    scheduler.took(0.2)
    for waiting in (service, stop):
        scheduler.add(waiting)
    assert [scheduler.next_entry() for _ in range(2)] == [stop, poll]


def test_a_stop_that_is_answered_gives_way_to_none() -> None:
    scheduler = Scheduler(lambda unit: False)
    stops = [stop_of(2), stop_of(2)]
    for waiting in (*stops, entry(Priority.POLL)):
        scheduler.add(waiting)
    for stop in stops:
        assert scheduler.next_entry() is stop
        scheduler.took(_READ)


# --- leaving --------------------------------------------------------------------------------------


def poll_of(unit: int) -> Waiting:
    """A poll of one unit."""
    return Waiting(cast(Task, named('poll')), Request(unit, Read(register(1)), Priority.POLL))


def test_what_is_for_a_missing_unit_waits_until_it_may_go_and_goes_first_then() -> None:
    missing, other = poll_of(7), poll_of(1)
    scheduler = Scheduler({7}.__contains__, {7}.__contains__)
    assert not scheduler.missing_wait
    scheduler.add(missing)
    scheduler.add(other)
    assert scheduler.missing_wait
    assert scheduler.next_entry(missing=False) is other
    assert scheduler.next_entry(missing=False) is None
    scheduler.add(other)
    assert scheduler.next_entry() is missing
    assert not scheduler.missing_wait


@pytest.mark.parametrize('kind', [Priority.POLL, *_BACKGROUND])
def test_what_waits_for_a_unit_that_goes_missing_waits_with_the_others_then(
    kind: Priority,
) -> None:
    missing: set[int] = set()
    scheduler = Scheduler(missing.__contains__, missing.__contains__)
    waiting = Waiting(cast(Task, named('asks')), Request(7, Read(register(1)), kind))
    scheduler.add(waiting)
    missing.add(7)
    assert scheduler.next_entry(missing=False) is None
    assert scheduler.missing_wait
    assert scheduler.next_entry() is waiting
    scheduler.add(waiting)
    missing.clear()
    # it answers again, and is nothing special any more
    assert scheduler.next_entry() is waiting


def test_the_first_stop_of_a_missing_unit_goes_ahead_and_its_repetitions_wait() -> None:
    silent: set[int] = {7}
    scheduler = Scheduler(silent.__contains__, silent.__contains__)
    first, again, other = stop_of(7), stop_of(7), stop_of(2)
    scheduler.add(first)
    assert scheduler.next_entry(missing=False) is first
    scheduler.took(0.2)
    scheduler.add(again)
    scheduler.add(other)
    assert scheduler.next_entry(missing=False) is other
    scheduler.took(_READ)
    assert scheduler.next_entry(missing=False) is None
    assert scheduler.next_entry() is again
    scheduler.took(0.2)
    # it has been back meanwhile: this stop is a first one again
    silent.clear()
    scheduler.add(poll_of(7))
    assert scheduler.next_entry(missing=False) is not None
    scheduler.took(_READ)
    silent.add(7)
    scheduler.add(again)
    assert scheduler.next_entry(missing=False) is again


@pytest.mark.parametrize(('answers', 'silent', 'first'), [(1, 9, 1), (9, 1, 2), (9, 8, 2)])
def test_in_noise_the_stop_with_the_fewest_requests_goes_first(
    answers: int, silent: int, first: int
) -> None:
    async def stop(unit: int) -> None:
        while True:
            await Request(unit, Write(register(1), packed(0)), Priority.STOP)

    scheduler = Scheduler(lambda unit: unit == 2, lambda unit: unit == 2)
    for unit, requests in ((1, answers), (2, silent)):
        task = Task(stop(unit), stops=True)
        awaited = [task.step(None, None) for _ in range(requests)]
        scheduler.add(Waiting(task, cast(Request, awaited[-1])))
    taken = scheduler.next_entry(in_noise=True)
    assert isinstance(taken, Waiting) and taken.request.unit == first


def test_what_a_task_waits_for_can_be_withdrawn() -> None:
    scheduler = Scheduler()
    slot = entry(_SLOT)
    for waiting in (
        entry(Priority.POLL, 'mine'),
        slot,
        entry(Priority.POLL, 'other'),
        entry(Priority.STOP, 'mine'),
        entry(Priority.POLL, 'mine'),
    ):
        scheduler.add(waiting)
    scheduler.withdraw(cast(Task, named('mine')))
    assert scheduler.next_entry() is slot
    left = scheduler.next_entry()
    assert isinstance(left, Waiting) and left.task == cast(Task, named('other'))
    assert scheduler.next_entry() is None


def test_everything_can_be_taken_out_at_once() -> None:
    scheduler = Scheduler()
    entries = [entry(kind, str(kind)) for kind in (*Priority, _SLOT)]
    for waiting in entries:
        scheduler.add(waiting)
    cleared = scheduler.clear()
    assert sorted(map(id, cleared)) == sorted(map(id, entries))
    assert scheduler.next_entry() is None


def test_a_stop_in_vain_goes_ahead_again_once_the_unit_answers() -> None:
    missing = {7}
    scheduler = Scheduler(missing.__contains__, missing.__contains__)
    scheduler.add(stop_of(7))
    scheduler.next_entry()
    scheduler.took(0.1)
    repeated, before, other = stop_of(7), poll_of(1), poll_of(1)
    scheduler.add(repeated)
    scheduler.add(before)
    assert scheduler.next_entry(missing=False) is before
    scheduler.took(_READ)
    scheduler.add(other)
    # it has been asked by another request meanwhile
    missing.clear()
    assert scheduler.next_entry(missing=False) is repeated
    assert scheduler.next_entry(missing=False) is other


def test_of_stops_in_vain_the_one_that_was_tried_least_goes_first() -> None:
    scheduler = Scheduler(lambda unit: True)

    def tried() -> int:
        """Have the next one tried in vain, and wait again behind all; return its unit."""
        taken = scheduler.next_entry()
        assert isinstance(taken, Waiting)
        scheduler.took(0.01)
        taken.task.requests += 1
        scheduler.add(taken)
        return taken.request.unit

    for unit in (1, 2):
        scheduler.add(stop_of(unit))
    assert [tried() for _ in range(4)] == [1, 2, 1, 2]
    scheduler.add(stop_of(3))
    assert [tried() for _ in range(4)] == [3, 3, 1, 2]


def test_the_set_point_0_that_was_in_vain_keeps_no_stop_of_its_unit_back() -> None:
    scheduler = Scheduler(lambda unit: True)
    zero, other = stop_of(1, stops=False), stop_of(2)
    for _ in range(3):
        scheduler.add(zero)
        assert scheduler.next_entry() is zero
        scheduler.took(0.01)
    scheduler.add(other)
    assert scheduler.next_entry() is other
    scheduler.took(0.01)
    stop = stop_of(1)
    scheduler.add(other)
    scheduler.add(stop)
    assert scheduler.next_entry() is stop


def test_a_new_stop_of_a_unit_keeps_no_other_back() -> None:
    scheduler = Scheduler(lambda unit: True)
    for unit in (1, 2):
        scheduler.add(stop_of(unit))
    went = []
    for _ in range(8):
        taken = scheduler.next_entry()
        assert isinstance(taken, Waiting)
        went.append(taken.request.unit)
        scheduler.took(0.01)
        # each of them made by another call
        scheduler.add(stop_of(taken.request.unit))
    assert went == [1, 2] * 4
