# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The account of contact, walked with a model of a line, in every run.

The account and the silences that it is fed by are those of the driver. Line, drives and plugs are a
model: the line is cut and mended, the drive is switched off, another one is put in its place, which
takes longer than a swap can, the port is lost and is back in its place or another, the process
stands still. Times go by seconds. From the beginning on every state is visited that can be reached,
the nearest first, as many as a run has time for; every step from it is judged.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
import copy
import itertools
import math

from nfo_sinus_driver.bus import SWAP_TIME
from nfo_sinus_driver.bus.silences import Silences
from nfo_sinus_driver.drive import Cause, DriveError
from nfo_sinus_driver.drive.known.contact import (
    STATUS,
    TRANSITIONS,
    Contact,
    ContactEvent as Event,
    ContactState as State,
    Recognition,
)
from nfo_sinus_driver.link import LinkError, NoAnswer

_STEP = 1.0
_LOST_AFTER = 2.0
#: A drive that is polled is asked no later than so long after the last time, s.
_ASKED_WITHIN = 1.0
#: To put another drive in its place takes a swap, and that much longer until it is noticed.
_EXCHANGED_AFTER = SWAP_TIME + _ASKED_WITHIN + _STEP
_UNIT, _NEIGHBOUR = 1, 2
_OURS, _OTHER, _NONE = 'ours', 'other', ''
#: How many states are visited.
_STATES = 30_000
#: Ages above this are alike, s.
_OLD = 6.0


class World:
    """What the driver knows of the line, and what is so."""

    def __init__(self) -> None:
        self.time = 0.0
        self.paused = 0.0
        self.silences = Silences()
        for unit in (_UNIT, _NEIGHBOUR):
            self.silences.watch(unit, _LOST_AFTER)
        self.contact = Contact(self, _UNIT, _lost_after, '')  # type: ignore[arg-type]
        #: What is at the address, and since when it is not ours.
        self.drive, self.away_since = _OURS, math.inf
        self.is_cut = False
        #: How often the present stop was written without an answer, and when it became due.
        self.blind, self.due_at = 0, -math.inf
        self.is_stopping = False

    def now(self) -> float:
        return self.time

    @property
    def running(self) -> float:
        return self.time - self.paused

    def key(self) -> tuple[object, ...]:
        """All that can make a difference from now on: ages, and which of two came first."""
        contact, line = vars(self.contact), vars(self.silences)
        its = self.silences._of(_UNIT)
        ages = (
            self.away_since, self.due_at, contact['_stop_due_at'], line['_any_frame_at'],
            line['_silent'].get(_UNIT, math.inf), its.gone_since, its.asked_at,
        )
        there_since = max(line['_line_since'], its.there_since)
        return (
            *(_age(self.time, at) for at in ages),
            contact['_recognised_at'] >= there_since,
            contact['_looked_at'] >= there_since,
            math.isnan(contact['_looked_at']),
            self.contact.was_here,
            self.contact.since_port_opened,
            contact['_stop_due_at'] >= line['away_at'],
            self.contact.state,
            contact['_blind_left'],
            self.paused - contact['_paused'] > SWAP_TIME,
            self.drive,
            self.is_cut,
            self.blind,
            self.is_stopping,
        )

    @property
    def is_reached(self) -> bool:
        return self.drive != _NONE and not self.is_cut

    # --- what the driver does -----------------------------------------------------------------

    def _ask(self, unit: int, *, is_answered: bool) -> LinkError | None:
        error = None if is_answered else NoAnswer()
        seconds = 0.0 if is_answered else _STEP
        self.time += seconds
        self.silences.note_request(unit, self.time, error, seconds)
        return error

    def poll(self) -> None:
        """As the poller does, where there is nothing to recognise."""
        contact = self.contact
        error = self._ask(_UNIT, is_answered=self.is_reached)
        if error is None:
            contact.read_answered(STATUS)
            contact.note_poll()
            contact.poll_passed()
            return
        contact.count(error)
        contact.dispatch(Event.MISSED)
        if contact.read_failed(STATUS, error) and contact.poll_failed(error):
            contact.dispatch(Event.LOST)

    def recognise(self) -> None:
        """Read all that tells which drive it is."""
        if self._ask(_UNIT, is_answered=self.is_reached) is not None:
            return
        if self.drive == _OURS:
            self.contact.recognised()
            self.contact.dispatch(Event.CONNECTED)
            return
        self.contact.another_answers()
        if self.contact.poll_failed(DriveError(Cause.ANOTHER_DRIVE, title='', why='')):
            self.contact.dispatch(Event.LOST)

    def look(self) -> None:
        """Look once, before a stop."""
        if self._ask(_UNIT, is_answered=self.is_reached) is not None:
            return
        if self.drive == _OURS:
            self.contact.seen_again()
        else:
            self.contact.another_answers()

    def begin_stop(self) -> None:
        self.contact.stop_begins()
        self.is_stopping, self.blind, self.due_at = True, 0, self.time

    def write_stop(self) -> None:
        if self.is_reached:
            self._ask(_UNIT, is_answered=True)
            self.is_stopping = False
            return
        knows = self.contact.recognition in (Recognition.HOLDS, Recognition.FOR_STOP)
        self.blind += not knows
        self.contact.stop_in_vain()
        self._ask(_UNIT, is_answered=False)

    def ask_neighbour(self) -> None:
        self._ask(_NEIGHBOUR, is_answered=not self.is_cut)

    # --- what happens to it -------------------------------------------------------------------

    def wait(self) -> None:
        self.time += _STEP

    def stand_still(self) -> None:
        """The process does not run for longer than a swap takes."""
        seconds = _EXCHANGED_AFTER
        self.time += seconds
        self.paused += seconds
        self.silences.paused(seconds)

    def cut(self) -> None:
        self.is_cut = not self.is_cut

    def take_away(self) -> None:
        self.drive, self.away_since = _NONE, self.time

    def put_back(self) -> None:
        self.drive, self.away_since = _OURS, math.inf

    def exchange(self) -> None:
        self.drive = _OTHER

    def open_port(self) -> None:
        self.time += _STEP
        self.silences.opened(self.time, same_place=True)

    def move_port(self) -> None:
        """Another place: there may be another drive at once."""
        self.time += _STEP
        self.silences.opened(self.time, same_place=False)
        self.drive, self.away_since = _OTHER, self.time

    def steps(self) -> Iterator[str]:
        """What can happen next."""
        asked_at = self.silences.asked_at(_UNIT)
        yield 'poll' if self.contact.connected else 'recognise'
        if self.contact.connected and not self.contact.is_recognised:
            yield 'recognise'
        if self.is_stopping:
            yield 'write_stop' if self.contact.may_stop else 'look'
        else:
            yield 'begin_stop'
        if self.time - asked_at < _ASKED_WITHIN:
            yield 'ask_neighbour'
            yield 'wait'
            yield 'stand_still'
        yield 'cut'
        if self.drive == _OURS:
            yield 'take_away'
        elif self.drive == _NONE:
            yield 'put_back'
            if self.time - self.away_since >= _EXCHANGED_AFTER:
                yield 'exchange'
        yield 'open_port'
        if self.drive != _OTHER:
            yield 'move_port'


def _lost_after() -> float:
    return _LOST_AFTER


def _age(now: float, at: float) -> float:
    return at if math.isinf(at) else min(now - at, _OLD)


def walk(most: int) -> Iterator[tuple[World, str, World]]:
    """Every step from every state, the nearest first."""
    first = World()
    seen, waiting = {first.key()}, deque([first])
    while waiting and len(seen) < most:
        before = waiting.popleft()
        for name in before.steps():
            after = copy.deepcopy(before)
            getattr(after, name)()
            yield before, name, after
            if after.key() not in seen:
                seen.add(after.key())
                waiting.append(after)


def test_nothing_is_written_to_another_drive_and_every_state_is_reached() -> None:
    reached = set()
    for before, name, world in walk(_STATES):
        contact, recognition = world.contact, world.contact.recognition
        reached.add((contact.state, recognition))
        story = f'{before.key()} -> {name}'
        if world.drive == _OTHER:
            assert recognition not in (Recognition.HOLDS, Recognition.FOR_STOP), story
        if before.drive == _OTHER and before.is_reached and name in ('recognise', 'look'):
            assert recognition is Recognition.NONE, story
        if recognition is Recognition.HOLDS:
            assert contact.may_stop and contact.was_here, story
        # blind, a stop is written twice, and soon
        assert world.blind <= 2, story
        if name == 'write_stop' and world.blind > before.blind:
            longest = SWAP_TIME + world.silences.round_in_vain
            assert before.time - world.due_at <= longest, story
        silent = world.time - world.silences.last_frame_at(_UNIT)
        if name == 'poll' and silent >= _LOST_AFTER + _STEP and contact.is_silent_for_long:
            assert not contact.connected, story
    assert reached == set(itertools.product(State, Recognition))


def test_the_table_says_what_came_last() -> None:
    for length in range(1, 6):
        for events in itertools.product(Event, repeat=length):
            state = State.LOST
            for event in events:
                state = TRANSITIONS.get((state, event), state)
            found = [i for i, event in enumerate(events) if event is Event.CONNECTED]
            lost = [i for i, event in enumerate(events) if event is Event.LOST]
            connected = bool(found) and found[-1] > max(lost, default=-1)
            assert (state is not State.LOST) == connected
            since = [event for event in events if event is not Event.LOST]
            answers = connected and since[-1] is not Event.MISSED
            assert (state is State.ANSWERS) == answers
