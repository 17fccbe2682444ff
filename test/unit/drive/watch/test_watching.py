# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What happens to a drive is noticed within two polls, published, reported once, and ends the run.

That nothing restarts by itself is a law (test_laws.py); here it is what is said, and when.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from dataclasses import dataclass

import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import Fact, Kind
from nfo_sinus_driver.drive import Severity, Snapshot
from nfo_sinus_driver.simulator.memory import Reason, Refused

OVERLOAD, DC_LOW = 5, 7
#: The status is read, what is polled beside it is measured: an event may fall in between.
POLLS = 2
TIMEOUT = 0.2

G2, G2_WORD, OPTIMAL = 'rtu', 'rtu, control word', 'optimal'
CONNECTIONS = (G2, G2_WORD, OPTIMAL, 'optimal, control word')

Act = Callable[[Rig], None]
Tells = Callable[[Snapshot], bool]


def facts(shown: Snapshot) -> Fact:
    return Fact(0) if shown.status is None else shown.status.facts


def write(key: str, raw: int) -> Act:
    """Another master writes."""
    return lambda rig: rig.far.write_raw(key, raw)


@dataclass(frozen=True)
class Event:
    """
    Something that happens.

    :ivar cause: what the log says of it; :ivar remedy: what it says to do about it.
    :ivar tells: whether a snapshot tells it.
    """

    act: Act
    cause: str
    remedy: str
    tells: Tells = lambda shown: shown.connected


def lost_control(shown: Snapshot) -> bool:
    return Fact.NETWORK_CONTROL not in facts(shown)


EVENTS = {
    'run input lost': Event(
        lambda rig: rig.far.set_run_input(False), 'RUN input (DIN1)', 'close'
    ),
    'STOP at the keypad': Event(
        lambda rig: rig.far.control_unit.press('stop'),
        'the bus has lost control (24 Stop). STOP was pressed at the keypad, or another',
        'find out which',
        lambda shown: lost_control(shown) and shown.text == 'Stop',
    ),
    'START at the keypad': Event(
        lambda rig: rig.far.control_unit.press('start'),
        'the keypad has control now and runs the motor',
        'press STOP there',
        lost_control,
    ),
    'MODE = Ext by another master': Event(
        write('fieldbus.mode', 2),
        'the terminals have control now',
        'press STOP at the drive',
        lost_control,
    ),
    'fault': Event(
        lambda rig: rig.far.trip(OVERLOAD),
        'fault 5 Overload: ',
        'Reduce the load',
        lambda shown: shown.kind is Kind.FAULT and shown.requires_ack and bool(shown.remedy),
    ),
    'restart': Event(
        lambda rig: rig.far.power_cycle(0.1),
        'the drive did not answer for a moment, and the bus has lost control (24 Stop)',
        'check its mains',
        lost_control,
    ),
    # MODE = Bus stops a running motor [M0 table 17]; so does a control word without bit 0
    'MODE = Bus by another master': Event(
        write('fieldbus.mode', 3), 'or another master stopped it', 'close the input'
    ),
    'control word 0 by another master': Event(
        write('fieldbus.drive_control', 0xC076), 'or another master stopped it', 'close the input'
    ),
}
#: What only one connection has.
ONLY = {'MODE = Bus by another master': G2, 'control word 0 by another master': G2_WORD}


@contextlib.contextmanager
def turning(connection: str, **settings: float) -> Iterator[Rig]:
    """A motor that turns steadily, on ramps that do not take it to its current limit."""
    ramps = {'control.accel': 0.4, 'control.retard': 0.4}
    with Rig(connection, parameters=ramps, options={'boot_time': 0.1}, **settings) as rig:
        yield rig.turn(25.0)


def polls_until(rig: Rig, act: Act, tells: Tells) -> int:
    """Let something happen; return how many polls it took until a snapshot reported it."""
    before = len(rig.notes.snapshots)
    act(rig)
    rig.wait_until(lambda: any(map(tells, rig.notes.snapshots[before:])), 5.0)
    return [tells(snapshot) for snapshot in rig.notes.snapshots[before:]].index(True) + 1


def warnings(rig: Rig) -> list[str]:
    """What the log has that an operator should look at."""
    return [event.text for event in rig.notes.events if event.severity is not Severity.INFO]


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_what_ends_a_run_is_shown_and_reported_once_with_a_remedy(connection: str) -> None:
    for name, event in EVENTS.items():
        if ONLY.get(name, connection) != connection:
            continue
        with turning(connection) as rig:

            def shown(snapshot: Snapshot, tells: Tells = event.tells) -> bool:
                return tells(snapshot) and not snapshot.enabled

            polls = polls_until(rig, event.act, shown)
            assert polls <= POLLS, (name, polls)
            rig.pass_time(1.0)
            lines = warnings(rig)
            assert len(lines) == 1, (name, lines)
            for part in ('stopped: ', event.cause, event.remedy, '~/enable to go on'):
                assert part in lines[0], (name, lines)
            assert ('~/fault_ack' in lines[0]) is (name == 'fault'), lines


CONDITIONS = {
    'current limit': Event(
        lambda rig: setattr(rig.far.motor, 'load', 6.0),
        'the current limit holds the motor back (27 Cur Lim',
        'Reduce the load',
        lambda shown: Fact.LIMIT_ACTIVE in facts(shown) and shown.kind is Kind.ALARM,
    ),
    # only the Optimal tells an alarm by a bit, or that it sleeps
    'alarm': Event(
        lambda rig: rig.far.trip(DC_LOW),
        'alarm 7 DC Low: Internal undervoltage warning',
        'Check the mains voltage',
        lambda shown: Fact.ALARM in facts(shown) and bool(shown.remedy),
    ),
    'sleep': Event(
        lambda rig: rig.far.set_from_keypad('control.f_sleep', 40.0),
        'the drive sleeps (29 Sleep)',
        'a greater one wakes it',
        lambda shown: Fact.SLEEPING in facts(shown),
    ),
}


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_what_stops_nothing_is_shown_and_reported_once(connection: str) -> None:
    for name, event in CONDITIONS.items():
        if name != 'current limit' and not connection.startswith(OPTIMAL):
            continue
        with turning(connection) as rig:
            polls = polls_until(rig, event.act, event.tells)
            # the limit comes with the speed that the load takes
            assert polls <= POLLS + (name == 'current limit'), (name, polls)
            rig.pass_time(0.5)
            texts = [report.text for report in rig.notes.events]
            assert len(texts) == 1, (name, texts)
            assert event.cause in texts[0] and event.remedy in texts[0], texts
            assert rig.drive.following and rig.drive.snapshot.enabled
            if name == 'sleep':
                assert not rig.far.motor.driven
                rig.far.set_from_keypad('control.f_sleep', 0.0)
                rig.wait_until(lambda rig=rig: abs(rig.far.motor.frequency - 25) < 0.5, 5.0)
                assert len(rig.notes.events) == 1


@pytest.mark.parametrize('connection', [G2, G2_WORD, OPTIMAL])
def test_set_points_that_stop_coming_are_reported_and_the_next_is_followed(connection: str) -> None:
    with turning(connection, setpoint_timeout=TIMEOUT) as rig:
        rig.send(None)
        last = rig.drive.setpoint._request[1]
        rig.wait_until(lambda: rig.notes.snapshots[-1].setpoint == 0.0, 5.0)
        after = [snapshot for snapshot in rig.notes.snapshots if snapshot.at > last + TIMEOUT]
        late = [snapshot for snapshot in after if snapshot.setpoint]
        assert len(late) + 1 <= POLLS
        rig.pass_time(2.0)
        assert rig.far.motor.at_zero
        (line,) = warnings(rig)
        assert line == (
            'no set-point for 0.2 s: the motor ramps to a stop until the next one arrives; '
            'check what publishes them'
        )
        # this is no stop
        assert rig.drive.following
        rig.send(10.0)
        rig.wait_until(lambda: abs(rig.far.motor.frequency - 10) < 0.2, 5.0)


def test_a_fault_that_shows_first_as_a_refused_set_point_is_reported_as_the_fault() -> None:
    # a G2 with a fault refuses every write [M0 §6.1.5], and set-points may come before a poll
    with turning(G2) as rig:
        rig.send(None)
        answered = rig.far.write_raw

        def trip_first(key: str, raw: int) -> None:
            if key == 'status.frq_set' and raw and not rig.far.faults:
                rig.far.trip(OVERLOAD)
            answered(key, raw)

        rig.far.write_raw = trip_first  # type: ignore[method-assign]
        rig.drive.set_setpoint(20.0)
        rig.pass_time(1.0)
        (line,) = warnings(rig)
        assert line.startswith('stopped: fault 5 Overload: ')
        assert not rig.drive.following


def test_a_drive_that_was_off_for_long_is_reported_lost_and_found_without_control() -> None:
    with Rig(G2, retries=0) as rig:
        rig.turn(10.0)
        rig.far.power_cycle(5.0)
        rig.pass_time(12.0)
        assert rig.drive.snapshot.connected
        lost, cannot_stop, meanwhile = warnings(rig)
        assert lost.startswith('lost: ')
        assert 'check the cable and that the drive has power' in lost
        assert 'then call ~/enable to go on' in lost
        assert 'the bus has lost control meanwhile (24 Stop)' in meanwhile
        assert 'was switched off and on' in meanwhile
        assert cannot_stop.startswith('CANNOT STOP')


def test_a_condition_that_comes_and_goes_is_not_reported_each_time() -> None:
    with turning(OPTIMAL) as rig:
        for _ in range(3):
            rig.far.trip(DC_LOW)
            rig.wait_until(lambda: Fact.ALARM in facts(rig.drive.snapshot), 5.0)
            rig.far.faults.acknowledge()
            rig.wait_until(lambda: Fact.ALARM not in facts(rig.drive.snapshot), 5.0)
        assert len(rig.notes.events) == 1


def test_a_refused_set_point_does_not_end_the_run_after_it() -> None:
    with turning(G2, poll_rate=1.0) as rig:
        rig.send(None)
        answered = rig.far.write_raw

        def refuse(key: str, raw: int) -> None:
            if key == 'status.frq_set' and raw == 300:
                raise Refused(Reason.VALUE, 'as the test wants it')
            answered(key, raw)

        rig.far.write_raw = refuse  # type: ignore[method-assign]
        rig.drive.set_setpoint(30.0)
        rig.wait_until(lambda: not rig.drive.following, 5.0)
        rig.answer(rig.drive.stop())
        # before the next poll
        rig.enable()
        rig.pass_time(2.0)
        assert rig.drive.following
        (line,) = warnings(rig)
        assert 'it refused set-point 30: ' in line
