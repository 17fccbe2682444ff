# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The laws of the house, each over every connection to a drive, in virtual time.

Laws 1, 4, 5 and 6 are judged besides in every test that has a rig, by all frames on its line; law 9
stands in test_drive_timeout.py, too. A new connection is one line in
:data:`support.rig.CONNECTIONS`; a new law is one test here.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import dataclasses
import itertools
import math
from typing import Any

import pytest
from support.drive_timeout import TIMED, by_default
from support.rig import CONNECTIONS, Rig
from support.variants import ramps

from nfo_sinus_driver.catalog import Fact, Kind, is_described
from nfo_sinus_driver.drive import Cause, Drive, Severity

#: How soon a loss has to be noticed and the motor has to be stopped, beyond lost_after, s.
_SOON = 1.5
#: After so long each setting was read again, s.
_ROUND = 12.0
#: The set-point of a run, Hz.
_SPEED = 20.0

STOPS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'rapid stop': lambda drive: drive.rapid_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'disconnect': lambda drive: drive.disconnect(4.0),
    'exit': lambda drive: drive.stop_for_good(4.0),
}
every_connection = pytest.mark.parametrize('connection', CONNECTIONS)
every_stop = pytest.mark.parametrize('stop', STOPS)
#: Those whose drives have no status word: no status reports the direction.
WITHOUT_DIRECTION = ('classic v5.0', 'canopen, no DriveStatus', 'made up')
#: Where the motor follows set-points of the bus.
following = pytest.mark.parametrize(
    'connection', [name for name, kind in CONNECTIONS.items() if kind.reference == 'fieldbus']
)


def give_setpoints(rig: Rig) -> None:
    """Have a program give set-points, where they count."""
    rig.send(_SPEED if rig.drive.settings.follows_setpoints else None)


def acknowledge(rig: Rig) -> None:
    """Have a fault acknowledged; at the keypad, where the drive ignores the line for that."""
    rig.acknowledged += 1
    answer = rig.answer(rig.drive.acknowledge())
    if rig.connection.closed:
        assert 'reset it at the keypad or by a terminal' in answer
        rig.far.control_unit.press('reset')
        rig.pass_time(1.0)
    else:
        assert 'acknowledged' in answer
    assert not rig.far.faults


def assert_only_enable_helps(rig: Rig) -> None:
    """Nothing turns although set-points arrive, until it is enabled."""
    give_setpoints(rig)
    rig.pass_time(1.0)
    assert not rig.drive.following and not rig.turns
    rig.enable()
    rig.wait_until(lambda: abs(rig.far.motor.frequency) > 0.5 * _SPEED, 5.0)


# --- 1: what only looks writes nothing ------------------------------------------------------------


@every_connection
def test_1_polling_writes_nothing(connection: str) -> None:
    with by_default(connection) as rig:
        rig.connect(parameters=True)
        # what holds a drive in the mode of the bus is commanded to stop as soon as it is found
        rig.asked.clear()
        rig.pass_time(3.0)
        assert [key for _, key, data in rig.asked if data is not None] == []
        assert not rig.far.writes and not rig.turns


# --- 2: the motor turns only when it was enabled since, and a fresh set-point came after that -----


@following
def test_2_a_set_point_from_before_enable_is_not_taken_over(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.drive.set_setpoint(_SPEED)
        rig.enable()
        rig.pass_time(1.5)
        assert rig.drive.following
        assert rig.far.motor.demand == 0 or not rig.far.motor.driven


@following
def test_2_without_enable_set_points_turn_nothing(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.send(_SPEED)
        rig.pass_time(2.0)
        assert not rig.turns and not rig.drive.following


@following
def test_2_the_motor_turns_as_its_set_points_say(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.enable()
        for wanted in (_SPEED, -_SPEED, 0.0, -10.0, 10.0, 0.0, 10.0):
            rig.send(wanted)
            rig.pass_time(2.0)
            # such as a Sinus H, which takes no reverse by its telegram [C60]
            mode = rig.drive.snapshot.control_mode
            forward_only = rig.drive.model.profile.setpoints[mode].forward_only
            turns = 0.0 if wanted < 0 and forward_only else wanted
            # a speed and a frequency differ by the slip
            assert rig.far.motor.frequency == pytest.approx(turns, abs=0.5)
            snapshot = rig.drive.snapshot
            assert snapshot.setpoint == pytest.approx(turns * rig.connection.hertz, rel=1e-3)
            # by frequency it has its slip
            slip = 0.5 * rig.connection.hertz
            turning = pytest.approx(turns * rig.connection.hertz, rel=0.02, abs=slip)
            assert snapshot.actual == turning
            status = snapshot.status
            # at 0 the set-point of some is no run command
            assert status is not None and (status.runs or (not turns and status.may_run))
            assert Fact.REVERSE in status.valid or connection in WITHOUT_DIRECTION
            if Fact.REVERSE in status.valid and turns:
                assert (Fact.REVERSE in status.facts) == (turns < 0)
        assert rig.drive.following


@following
def test_2_a_set_point_that_is_written_again_gives_no_run_command_again(connection: str) -> None:
    # which could let a motor run that a fault or another master has stopped meanwhile
    with Rig(connection) as rig:
        rig.turn()
        begun = len(rig.asked)
        rig.pass_time(6.0)
        assert len({key for _, key, data in rig.asked[begun:] if data is not None}) <= 1


def lose_line(rig: Rig) -> None:
    rig.line.state = 'silent'
    rig.pass_time(3.0)
    rig.line.mend()


def lose_port(rig: Rig) -> None:
    rig.line.state = 'gone'
    rig.pass_time(3.0)
    rig.line.mend()


def lose_power(rig: Rig) -> None:
    rig.far.power_cycle(boot_time=2.0)
    rig.pass_time(3.0)


def blink(rig: Rig) -> None:
    """Take the mains away for less than lost_after; a brake holds the motor, the ramp is slow."""
    rig.far.set_from_keypad(next(iter(ramps(rig.connection.model, 0.3, 0.3))), 5.0)
    rig.far.power_cycle(boot_time=0.5)
    rig.far.motor.rotor = 0.0
    rig.pass_time(1.5)


def restart_driver(rig: Rig) -> None:
    """End the driver without a stop: the next one finds a motor that runs."""
    rig.kill()
    rig.pass_time(0.3)
    rig.begin()
    rig.connect()


def open_run_input(rig: Rig) -> None:
    """Open the input, and close it before the motor stands."""
    rig.far.set_run_input(False)
    # of a drive without a run command it shows by a motor that stands against its set-points
    patience = 4.0 if rig.drive.model.profile.status_word.runs_by_turning else 1.0
    rig.wait_until(lambda: not rig.drive.following, patience)
    rig.far.set_run_input(True)


def acknowledge_beside(rig: Rig) -> None:
    """Have another master acknowledge a fault, while the run command may stand."""
    rig.far.trip(rig.a_fault)
    rig.pass_time(0.5)
    rig.far.faults.acknowledge()
    rig.far.control_unit.settle()


def fail_to_listen(rig: Rig) -> None:
    """Have what listens to the driver fail for a while."""

    def fail(*_: object) -> None:
        raise ZeroDivisionError

    rig.notes.on_snapshot = rig.notes.on_event = fail  # type: ignore[method-assign]
    rig.pass_time(rig.drive.settings.lost_after + _SOON)
    assert not rig.turns
    del rig.notes.on_snapshot, rig.notes.on_event
    rig.pass_time(1.0)
    rig.notes.events.clear()


LOSSES = {
    'line': lose_line, 'port': lose_port, 'power': lose_power, 'mains for a moment': blink,
    'driver': restart_driver, 'run input': open_run_input, 'fault': acknowledge_beside,
    'listener': fail_to_listen,
}


@pytest.mark.parametrize(
    ('connection', 'loss'),
    [
        pytest.param(connection, loss, marks=[pytest.mark.provokes] * (loss == 'listener'))
        for connection, loss in itertools.product(CONNECTIONS, LOSSES)
        # there the PLC, or the bit of the bus, enables in place of an input
        if loss != 'run input' or not connection.startswith(('telegram1 sinus_h', 'movitrac'))
    ],
)
def test_2_after_a_loss_nothing_turns_until_it_is_enabled_again(connection: str, loss: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        LOSSES[loss](rig)
        rig.wait_until(
            lambda: rig.drive.snapshot.connected and not rig.drive.stop_unconfirmed, 10.0
        )
        assert_only_enable_helps(rig)


@every_connection
def test_2_after_a_fault_and_its_acknowledgement_nothing_turns(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.far.trip(rig.a_fault)
        rig.pass_time(1.0)
        assert not rig.drive.following
        assert rig.notes.snapshot.kind is Kind.FAULT
        acknowledge(rig)
        assert_only_enable_helps(rig)


@every_connection
@every_stop
def test_2_a_stop_ends_an_enable_that_was_requested_before(connection: str, stop: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        enable = rig.drive.enable()
        stopped = STOPS[stop](rig.drive)
        rig.answer(enable)
        rig.answer(stopped)
        if stop not in ('disconnect', 'exit'):
            give_setpoints(rig)
        rig.pass_time(1.0)
        assert not rig.turns and not rig.drive.following


@every_connection
def test_2_a_stop_at_any_moment_of_an_enable_ends_it(connection: str) -> None:
    with Rig(connection, poll_rate=2.0, telemetry_rate=0.0) as rig:
        rig.connect()
        give_setpoints(rig)
        kinds = ('stop', 'quick stop', 'deactivate')
        for moment in itertools.count():
            requests, stops = itertools.count(), []

            def meet(key: str, data: bytes | None) -> None:
                if next(requests) == moment:  # noqa: B023  # it is set anew for each
                    stops.append(STOPS[kinds[moment % 3]](rig.drive))  # noqa: B023

            rig.meet = meet
            enable = rig.drive.enable()
            rig.wait_until(enable.done)
            rig.meet = lambda key, data: None
            if not stops:
                break
            rig.answer(stops[0])
            assert not rig.drive.following and not rig.drive.stop_unconfirmed, moment
            rig.pass_time(0.3)
            assert not rig.turns, moment
            rig.drive.activate()
        assert moment >= 2, 'enabling takes more requests than that'
        assert rig.drive.following


@every_connection
def test_2_an_enable_that_comes_while_a_stop_is_on_its_way_is_refused(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        requested_at = rig.clock.now
        stops, enable = rig.drive.stop(), rig.drive.enable()
        assert 'a stop is on its way' in rig.answer(enable)
        rig.answer(stops)
        # it was not asked for after the stop, although it arrives there
        assert 'a stop was confirmed after' in rig.answer(rig.drive.enable(requested_at))
        assert_only_enable_helps(rig)


# --- 3: every way out stops the motor, and no success is reported that was not confirmed ----------


@every_connection
@every_stop
def test_3_every_way_out_stops_the_motor(connection: str, stop: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        begun = len(rig.asked)
        future = STOPS[stop](rig.drive)
        rig.answer(future)
        # ahead of polls and set-points
        assert any(data is not None for _, _, data in rig.asked[begun : begun + 2])
        assert not rig.turns and not rig.drive.following and not rig.drive.stop_unconfirmed
        rig.pass_time(1.0)
        assert not rig.turns


@every_connection
@every_stop
def test_3_a_stop_on_a_dead_line_is_said_and_carried_out_when_it_is_back(
    connection: str, stop: str
) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.line.state = 'silent'
        answer = rig.answer(STOPS[stop](rig.drive))
        assert 'NOT confirmed' in answer, answer
        rig.pass_time(2.0)
        assert rig.drive.stop_unconfirmed
        assert rig.notes.said(Cause.CANNOT_STOP, Severity.ERROR)
        assert rig.notes.said('emergency stop')
        rig.line.mend()
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 10.0)
        assert not rig.turns and not rig.drive.following


@following
def test_3_without_fresh_set_points_it_stops(connection: str) -> None:
    with Rig(connection, setpoint_timeout=1.0) as rig:
        rig.turn()
        rig.send(None)
        rig.pass_time(3.0)
        assert rig.notes.said(Cause.SETPOINT_TIMED_OUT, Severity.WARNING)
        assert not rig.turns and not rig.far.motor.turning


# --- 4 to 6: settings are written on change alone, and one control method commands a drive --------


@every_connection
def test_4_a_run_writes_no_setting_but_what_control_needs(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.result(rig.drive.disconnect(4.0))
        first = dict(rig.far.writes)
        rig.connect()
        rig.enable()
        rig.pass_time(1.0)
        rig.result(rig.drive.disconnect(4.0))
        # what stands so already is not written again
        assert dict(rig.far.writes) == first
        assert len(first) <= 1


@every_connection
def test_4_what_the_driver_writes_is_no_change_at_the_drive(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.pass_time(_ROUND)
        rig.result(rig.drive.stop())
        rig.result(rig.drive.deactivate())
        rig.pass_time(_ROUND)
        assert not rig.notes.said(Cause.CHANGED_AT_DRIVE), rig.notes.events


@every_connection
def test_6_the_control_method_of_a_session_never_changes(connection: str) -> None:
    with Rig(connection) as rig:
        for changed in ({'control_method': 'monitor', 'telegram_words': ''}, {'address': 2}):
            with pytest.raises(ValueError, match='cannot change within a session'):
                rig.drive.settings = dataclasses.replace(rig.drive.settings, **changed)


# --- 7 and 8: what is reported is true ------------------------------------------------------------


@every_connection
def test_7_what_is_not_known_any_more_is_shown_as_such(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        assert rig.notes.snapshot.connected and not math.isnan(rig.notes.snapshot.actual)
        rig.line.state = 'silent'
        rig.pass_time(rig.drive.settings.lost_after + _SOON)
        lost = rig.notes.snapshot
        assert not lost.connected and lost.status is None
        assert math.isnan(lost.frequency) and math.isnan(lost.speed)


@every_connection
@pytest.mark.parametrize('trouble', ['noise', 'late', 'double'])
def test_8_a_bad_line_makes_no_false_reading(connection: str, trouble: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        before = len(rig.notes.snapshots)
        frequency = rig.far.motor.frequency
        if trouble == 'noise':
            rig.line.make_noise(0.15, seed=3)
            rig.pass_time(8.0)
        else:
            for _ in range(8):
                rig.line.spoil({'late': 'delay'}.get(trouble, trouble))
                # a MOVITRAC is listened to for long after an answer that is late
                rig.pass_time(2.0 if connection.startswith('movitrac') else 0.5)
        found = [snapshot.frequency for snapshot in rig.notes.snapshots[before:]]
        assert len(found) > 10
        assert [shown for shown in found if abs(shown - frequency) > 1.0] == []
        assert rig.drive.following


# --- 9 and 10: a dead line; a motor is not stopped without a reason ------------------------------


@pytest.mark.parametrize('connection', TIMED)
def test_9_on_a_dead_line_the_drive_stops_by_itself_and_wants_acknowledging(
    connection: str,
) -> None:
    with Rig(connection, drive_timeout=2.0) as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(4.0)
        assert not rig.turns
        # of some drives no manual tells which fault that leaves
        faulted = bool(rig.far.faults)
        assert faulted or is_described(rig.connection.model)
        rig.line.mend()
        rig.wait_until(lambda: rig.drive.snapshot.connected)
        if faulted:
            acknowledge(rig)
        assert_only_enable_helps(rig)


@every_connection
def test_10_a_few_lost_answers_stop_nothing_and_a_silence_does(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        for what in ('unheard', 'drop', 'damage', 'double'):
            rig.line.spoil(what)
            rig.pass_time(1.0)
            assert rig.drive.following, what
        rig.line.state = 'silent'
        rig.pass_time(rig.drive.settings.lost_after + _SOON)
        assert not rig.drive.following and not rig.drive.snapshot.connected
