# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What happens to a drive is noticed within two polls, published, told once, and nothing restarts.

Every event over every control method: it happens in the simulated drive at one moment, and from
then on polls are counted.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from drive_rig import PATIENCE, MakeRig, Rig, wait_until
import pytest
from support.said import said

from nfo_sinus_driver.catalog import Fact, Kind
from nfo_sinus_driver.drive import Severity, Snapshot
from nfo_sinus_driver.simulator.memory import Reason, Refused

OVERLOAD = 5
DC_LOW = 7
#: The status is read, what is polled beside it is measured: an event may fall in between.
POLLS = 2
TIMEOUT = 0.2

WAYS = [
    ('sinus_g2', 'mode_scmd', 'fieldbus'),
    ('sinus_g2', 'drive_control', 'fieldbus'),
    ('sinus_optimal', 'mode_scmd', 'fieldbus'),
    ('sinus_optimal', 'drive_control', 'terminal'),
]

pytestmark = pytest.mark.usefixtures('hasty')

Act = Callable[[Rig], None]
Tells = Callable[[Snapshot], bool]


def facts(told: Snapshot) -> Fact:
    return Fact(0) if told.status is None else told.status.facts


def inject(*what: object) -> Act:
    return lambda rig: rig.simulator.inject(*what)


def write(key: str, raw: int) -> Act:
    """Another master writes."""
    return lambda rig: rig.far.write_raw(key, raw)


def acknowledge(rig: Rig) -> None:
    rig.acknowledged += 1
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 5 Overload'


def keypad_stop(rig: Rig) -> None:
    rig.next_snapshots(3)
    assert rig.far.motor.driven, 'whoever runs it is not disturbed'
    rig.simulator.inject('keypad', 'stop')


def nothing(rig: Rig) -> None:
    pass


@dataclass(frozen=True)
class Event:
    """
    Something that ends a ride.

    :ivar tells: whether a snapshot tells it.
    :ivar cause: what the log says of it.
    :ivar remedy: what it says to do about it.
    :ivar undo: takes the cause away again.
    """

    act: Act
    cause: str
    remedy: str
    tells: Tells = lambda told: told.connected
    undo: Act = nothing


EVENTS = {
    'run_input_lost': Event(
        inject('run', 'off'), 'RUN input (DIN1)', 'close', undo=inject('run', 'on')
    ),
    'stop_at_the_keypad': Event(
        inject('keypad', 'stop'),
        'the bus has lost control (24 Stop). STOP was pressed at the keypad, or another',
        'find out who',
        tells=lambda told: Fact.NETWORK_CONTROL not in facts(told) and told.text == 'Stop',
    ),
    'take_over_at_the_keypad': Event(
        inject('keypad', 'start'),
        'the keypad has control now and runs the motor',
        'press STOP there',
        tells=lambda told: Fact.NETWORK_CONTROL not in facts(told),
        undo=keypad_stop,
    ),
    'mode_2_by_somebody_else': Event(
        write('fieldbus.mode', 2),
        'the terminals have control now',
        'press STOP at the drive',
        tells=lambda told: Fact.NETWORK_CONTROL not in facts(told),
        undo=keypad_stop,
    ),
    'fault': Event(
        inject('fault', OVERLOAD),
        'fault 5 Overload: ',
        'Reduce the load',
        tells=lambda told: told.kind is Kind.FAULT and told.requires_ack and bool(told.remedy),
        undo=acknowledge,
    ),
    'restart': Event(
        inject('power-cycle'),
        'the drive did not answer for a moment, and the bus has lost control (24 Stop)',
        'check its mains',
        tells=lambda told: Fact.NETWORK_CONTROL not in facts(told),
    ),
}


def turning(make_rig: MakeRig, model: str, method: str, reference: str, **settings: float) -> Rig:
    """A motor that turns steadily, on ramps that do not take it to its current limit."""
    rig = make_rig(
        model=model,
        control_method=method,
        reference=reference,
        parameters={'control.accel': 0.4, 'control.retard': 0.4},
        boot_time=0.1,
        **settings,
    )
    rig.connect()
    assert rig.enable().startswith('enabled')
    if reference == 'fieldbus':
        rig.publish(25.0)
    rig.wait_for_frequency(25.0)
    rig.wait_until_it_shows()
    rig.notes.events.clear()
    return rig


def happens(rig: Rig, act: Act) -> int:
    """Let something happen between two moments of the drive; how many polls were told before."""
    with rig.simulator.lock:
        act(rig)
        return len(rig.notes.snapshots)


def polls_until(rig: Rig, before: int, tells: Tells) -> int:
    """How many polls it took until a snapshot told it."""
    wait_until(lambda: any(map(tells, rig.notes.snapshots[before:])))
    told = [tells(one) for one in rig.notes.snapshots[before:]]
    return told.index(True) + 1


def warnings(rig: Rig) -> list[str]:
    """What the log has that a person should look at."""
    return [text for grave, text in rig.notes.events if grave is not Severity.INFO]


@pytest.mark.parametrize('name', EVENTS)
@pytest.mark.parametrize(('model', 'method', 'reference'), WAYS, ids=map('-'.join, WAYS))
def test_what_ends_a_ride(
    make_rig: MakeRig, name: str, model: str, method: str, reference: str
) -> None:
    event = EVENTS[name]
    rig = turning(make_rig, model, method, reference)
    if name == 'restart':
        rig.set_response_timeout(0.2)
    before = happens(rig, event.act)

    # noticed and published: what happened, and that it does not follow us any more
    polls = polls_until(rig, before, lambda told: event.tells(told) and not told.enabled)
    rig.set_response_timeout(rig.line.response_timeout)
    assert polls <= POLLS
    assert not rig.drive.armed

    # told once, with cause and remedy
    rig.next_snapshots(5)
    lines = warnings(rig)
    assert len(lines) == 1, lines
    assert lines[0].startswith('stopped: ')
    assert event.cause in lines[0]
    assert event.remedy in lines[0]
    assert '~/enable to go on' in lines[0]
    assert ('~/fault_ack' in lines[0]) is (name == 'fault')

    # and nothing turns again by itself, whatever becomes of the cause
    event.undo(rig)
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.wait_until_still()
    rig.next_snapshots(5)
    assert not rig.far.motor.driven
    assert warnings(rig) == lines
    assert rig.enable().startswith('enabled')
    rig.wait_for_frequency(25.0)


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
def test_what_ends_a_ride_by_a_stop_of_somebody_else(make_rig: MakeRig, method: str) -> None:
    # MODE = Bus stops a running motor [M0 table 17]; so does a control word without bit 0
    rig = turning(make_rig, 'sinus_g2', method, 'fieldbus')
    stop = write('fieldbus.mode', 3) if method == 'mode_scmd' else write(
        'fieldbus.drive_control', 0xC076
    )
    before = happens(rig, stop)
    assert polls_until(rig, before, lambda told: not told.enabled) <= POLLS
    rig.next_snapshots(5)
    lines = warnings(rig)
    assert len(lines) == 1, lines
    assert 'or another master stopped it' in lines[0], lines
    assert '~/enable to go on' in lines[0]
    rig.wait_until_still()


def limits(rig: Rig) -> None:
    rig.far.motor.load = 6.0
    rig.skip(0.05)
    assert rig.far.motor.limited


def wakes(rig: Rig) -> None:
    rig.far.set_from_keypad('control.f_sleep', 0.0)


CONDITIONS = {
    'current_limit': Event(
        limits,
        'the current limit holds the motor back (27 Cur Lim',
        'Reduce the load',
        tells=lambda told: Fact.LIMIT_ACTIVE in facts(told) and told.kind is Kind.ALARM,
    ),
    'alarm': Event(
        inject('fault', DC_LOW),
        'alarm 7 DC Low: Internal undervoltage warning',
        'Check the mains voltage',
        tells=lambda told: Fact.ALARM in facts(told) and bool(told.remedy),
    ),
    'sleep': Event(
        lambda rig: rig.far.set_from_keypad('control.f_sleep', 40.0),
        'the drive sleeps (29 Sleep)',
        'a greater one wakes it',
        tells=lambda told: Fact.SLEEPING in facts(told),
        undo=wakes,
    ),
}
#: Only the Optimal tells an alarm by a bit, or that it sleeps.
HAVE = [
    (name, *way)
    for name in CONDITIONS
    for way in WAYS
    if name == 'current_limit' or way[0] == 'sinus_optimal'
]


@pytest.mark.parametrize(('name', 'model', 'method', 'reference'), HAVE, ids=map('-'.join, HAVE))
def test_what_stops_nothing(
    make_rig: MakeRig, name: str, model: str, method: str, reference: str
) -> None:
    event = CONDITIONS[name]
    rig = turning(make_rig, model, method, reference)
    before = happens(rig, event.act)
    assert polls_until(rig, before, event.tells) <= POLLS
    rig.next_snapshots(10)
    texts = [text for _, text in rig.notes.events]
    assert len(texts) == 1, texts
    assert event.cause in texts[0]
    assert event.remedy in texts[0]
    assert rig.drive.armed
    assert rig.drive.snapshot.enabled
    if name == 'sleep':
        assert not rig.far.motor.driven
        with rig.simulator.lock:
            event.undo(rig)
        rig.wait_for_frequency(25.0)
        assert len(rig.notes.events) == 1


@pytest.mark.parametrize(
    ('model', 'method'),
    [way[:2] for way in WAYS if way[2] == 'fieldbus'],
    ids=['-'.join(way[:2]) for way in WAYS if way[2] == 'fieldbus'],
)
def test_set_points_that_stop_coming(make_rig: MakeRig, model: str, method: str) -> None:
    rig = turning(make_rig, model, method, 'fieldbus', setpoint_timeout=TIMEOUT)
    rig.stop_publishing()
    last = rig.drive.setpoint._request[1]
    wait_until(lambda: rig.notes.snapshots[-1].setpoint == 0.0)
    # the time had passed when these were asked for, and they do not tell it yet
    late = [one for one in rig.notes.snapshots if one.at > last + TIMEOUT and one.setpoint]
    assert len(late) + 1 <= POLLS
    rig.wait_for_frequency(0.0)
    rig.next_snapshots(5)
    lines = warnings(rig)
    assert len(lines) == 1, lines
    assert lines[0].startswith('no set-point for 0.2 s: the motor ramps to a stop')
    assert lines[0].endswith('until the next one arrives; check what publishes them')
    # this is no stop: the next one is followed
    assert rig.drive.armed
    rig.publish(10.0)
    rig.wait_for_frequency(10.0)


def test_fault_that_shows_first_as_a_refused_set_point(make_rig: MakeRig) -> None:
    # a G2 with a fault refuses every write [M0 §6.1.5], and set-points may come before a poll
    rig = turning(make_rig, 'sinus_g2', 'mode_scmd', 'fieldbus')
    rig.stop_publishing()
    answered = rig.far.write_raw

    def trip_first(key: str, raw: int) -> None:
        if key == 'status.frq_set' and raw and not rig.far.faults:
            rig.far.trip(OVERLOAD)
        answered(key, raw)

    rig.far.write_raw = trip_first  # type: ignore[method-assign]
    rig.drive.set_setpoint(20.0)
    wait_until(lambda: rig.drive.snapshot.kind is Kind.FAULT)
    rig.next_snapshots(5)
    lines = warnings(rig)
    assert len(lines) == 1, lines
    assert lines[0].startswith('stopped: fault 5 Overload: ')
    assert not rig.drive.armed


def test_drive_that_was_off_for_long(make_rig: MakeRig) -> None:
    rig = make_rig(retries=0)
    rig.turn(10.0)
    rig.notes.events.clear()
    rig.set_response_timeout(0.05)
    rig.simulator.inject('power-cycle', 3600)
    wait_until(lambda: not rig.drive.snapshot.connected)
    rig.set_response_timeout(2.0)
    rig.boot()
    wait_until(lambda: rig.drive.snapshot.connected)
    rig.next_snapshots(3)
    lines = warnings(rig)
    lost, *more = [text for text in lines if text.startswith('lost: ')] or lines
    assert not more, lines
    assert 'check the cable and that the drive has power' in lost
    assert 'then call ~/enable to go on' in lost
    meanwhile = [text for text in lines if 'the bus has lost control meanwhile (24 Stop)' in text]
    assert len(meanwhile) == 1
    assert 'was switched off and on' in meanwhile[0]
    rig.assert_stays_still()


def test_condition_that_comes_and_goes_is_not_told_each_time(make_rig: MakeRig) -> None:
    rig = turning(make_rig, 'sinus_optimal', 'mode_scmd', 'fieldbus')
    for _ in range(3):
        rig.simulator.inject('fault', DC_LOW)
        wait_until(lambda: Fact.ALARM in facts(rig.drive.snapshot))
        with rig.simulator.lock:
            rig.far.faults.acknowledge()
        wait_until(lambda: Fact.ALARM not in facts(rig.drive.snapshot))
    assert len(rig.notes.events) == 1


def test_refused_set_point_does_not_end_the_ride_after_it(make_rig: MakeRig) -> None:
    # whoever enables it before the next poll
    rig = turning(make_rig, 'sinus_g2', 'mode_scmd', 'fieldbus', poll_rate=1.0)
    rig.stop_publishing()
    answered = rig.far.write_raw

    def refuse(key: str, raw: int) -> None:
        if key == 'status.frq_set' and raw == 300:
            raise Refused(Reason.VALUE, 'as the test wants it')
        answered(key, raw)

    rig.far.write_raw = refuse  # type: ignore[method-assign]
    rig.drive.set_setpoint(30.0)
    wait_until(lambda: not rig.drive.armed)
    rig.drive.stop().result(PATIENCE)
    assert rig.enable().startswith('enabled')
    rig.next_snapshots(2)
    assert rig.drive.armed
    lines = warnings(rig)
    assert len(lines) == 1, lines
    assert 'it refused set-point 30: ' in lines[0]
