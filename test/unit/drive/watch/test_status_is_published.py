# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the driver knows of a drive and acts on is published when it changes, however seldom it polls.

Measured values alone wait for the next poll.
"""

from __future__ import annotations

from collections.abc import Callable
import math

import pytest
from support.chosen import KINDS
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.drive import Cause, Snapshot

#: Far less often than any of these tests lasts.
SELDOM = 0.001
#: How soon a change has to be published, s: the status is read five times a second.
SOON = 0.5

Shows = Callable[[Snapshot], bool]


def seldom(connection: str, **settings: float) -> Rig:
    """A motor that turns, of a drive that is polled once when it is connected."""
    return Rig(connection, **{'poll_rate': SELDOM, 'telemetry_rate': 0.0, **settings}).turn()


def shown(rig: Rig) -> Snapshot:
    """What subscribers have got last."""
    assert rig.notes.snapshot is not None
    return rig.notes.snapshot


def fault(rig: Rig) -> None:
    rig.far.trip(rig.a_fault)


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_a_motor_that_turns_is_shown_as_enabled_with_its_set_point(connection: str) -> None:
    with seldom(connection) as rig:
        rig.pass_time(SOON)
        assert shown(rig).enabled
        status = shown(rig).status
        assert status is not None and status.driven
        if rig.drive.settings.follows_setpoints:
            assert shown(rig).setpoint == pytest.approx(20.0 * rig.connection.hertz, rel=0.01)
            rig.send(10.0)
            rig.pass_time(SOON)
            assert shown(rig).setpoint == pytest.approx(10.0 * rig.connection.hertz, rel=0.01)


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_what_ends_a_run_is_shown_with_it(connection: str) -> None:
    with seldom(connection) as rig:
        fault(rig)
        rig.wait_until(lambda: not rig.drive.following, 2.0)
        rig.pass_time(0.1)
        assert not shown(rig).enabled and shown(rig).stop is not None
        assert shown(rig).kind is Kind.FAULT


@pytest.mark.parametrize('connection', KINDS)
def test_a_stop_is_shown_at_once(connection: str) -> None:
    with seldom(connection) as rig:
        stopped = rig.drive.stop()
        rig.pass_time(0.02)
        assert not shown(rig).enabled
        why = shown(rig).stop
        assert why is not None and why.cause is Cause.STOP_REQUESTED
        rig.answer(stopped)
        # nothing but a command reads it from now on
        rig.wait_until(lambda: not rig.far.motor.driven, 5.0)


@pytest.mark.parametrize('connection', ['rtu', 'optimal', 'canopen'])
def test_a_set_point_time_out_and_its_end_are_shown(connection: str) -> None:
    with seldom(connection, setpoint_timeout=1.0) as rig:
        rig.send(None)
        rig.wait_until(lambda: rig.notes.said(Cause.SETPOINT_TIMED_OUT), 3.0)
        rig.pass_time(SOON)
        assert shown(rig).enabled and shown(rig).setpoint == 0
        assert shown(rig).stop is not None
        rig.send(15.0)
        rig.pass_time(SOON)
        assert shown(rig).stop is None and shown(rig).setpoint == pytest.approx(15.0, rel=0.01)


@pytest.mark.parametrize('connection', KINDS)
def test_a_drive_that_is_there_again_is_shown_so_and_measured(connection: str) -> None:
    with seldom(connection) as rig:
        rig.far.power_cycle(4.0)
        rig.wait_until(lambda: not shown(rig).connected, 10.0)
        before = len(rig.notes.snapshots)
        rig.wait_until(lambda: rig.drive.state.contact.connected, 20.0)
        rig.pass_time(SOON)
        assert shown(rig).connected and shown(rig).status is not None
        later = rig.notes.snapshots[before:]
        assert any(snapshot.connected and snapshot.polled for snapshot in later)


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'optimal', 'canopen, ds402'])
def test_what_a_command_has_read_of_an_idle_drive_is_shown(connection: str) -> None:
    with Rig(connection, idle_poll_rate=SELDOM, poll_rate=10.0, telemetry_rate=0.0) as rig:
        rig.connect()
        fault(rig)
        rig.acknowledged += 1
        answer = rig.answer(rig.drive.acknowledge())
        assert 'acknowledged' in answer, answer
        rig.pass_time(0.1)
        assert shown(rig).kind is Kind.STATUS
        fault(rig)
        assert 'enabled' not in rig.answer(rig.drive.enable())
        rig.pass_time(0.1)
        assert shown(rig).kind is Kind.FAULT


def test_what_did_not_change_is_not_published_again() -> None:
    with seldom('rtu') as rig:
        rig.pass_time(SOON)
        before = len(rig.notes.snapshots)
        rig.pass_time(10.0)
        assert len(rig.notes.snapshots) == before
    with Rig('rtu', poll_rate=10.0).turn() as often:
        before = len(often.notes.snapshots)
        often.pass_time(10.0)
        assert 95 <= len(often.notes.snapshots) - before <= 101


def test_between_two_polls_nothing_is_said_to_be_measured() -> None:
    with seldom('rtu') as rig:
        shown = rig.notes.snapshots
        (poll,) = [snapshot for snapshot in shown if snapshot.polled and snapshot.connected]
        rest = [snapshot for snapshot in shown if not snapshot.polled and snapshot.at > poll.at]
        assert rest and {snapshot.frequency_at for snapshot in rest} == {poll.frequency_at}


# what a PLC shows is as old as its last exchange with the drive, whenever it is read
@pytest.mark.parametrize('connection', [name for name in KINDS if 'telegram1' not in name])
def test_nothing_from_before_a_pause_of_the_driver_is_published_with_what_changes_after_it(
    connection: str,
) -> None:
    with Rig(connection, drives=2, poll_rate=5.0, drive_timeout=0.0, setpoint_timeout=0.0) as rig:
        rig.connect()
        rig.enable()
        resumed: list[float] = []

        def resume() -> None:
            resumed.append(rig.clock.now)
            rig.notes.snapshots.clear()
            rig.drive.stop()

        at = rig.clock.now + 0.05
        rig.line.stand_still(at, 2.5)
        rig.line.later(at + 2.5, resume)
        rig.pass_time(4.0)
        statuses = [snapshot.status for snapshot in rig.notes.snapshots]
        read_at = [status.at for status in statuses if status is not None]
        assert read_at and min(read_at) >= resumed[0]


def test_a_stop_after_a_pause_of_the_driver_is_shown_before_the_next_poll_is_over() -> None:
    # on a slow line that takes a while
    with Rig(drives=16, line={'baud': 19200}, drive_timeout=0.0, setpoint_timeout=0.0) as rig:
        rig.turn()
        at = rig.clock.now + 0.05
        rig.line.stand_still(at, 1.0)
        rig.pass_time(1.2)
        rig.notes.snapshots.clear()
        assert 'stop' in rig.answer(rig.drive.stop())
        rig.pass_time(0.1)
        assert not rig.drive.snapshot.enabled and rig.drive.snapshot.status is not None
        # what was measured before is not shown with it
        for snapshot in rig.notes.snapshots:
            assert snapshot.frequency_at >= at + 1.0 or math.isnan(snapshot.frequency)


@pytest.mark.parametrize('connection', ['classic', 'movitrac'])
def test_a_drive_that_is_enabled_before_its_first_poll_is_shown(connection: str) -> None:
    # on a slow line that takes a while
    with Rig(connection, drives=16) as rig:
        rig.connect()
        rig.enable()
        rig.pass_time(0.1)
        assert all(drive.snapshot.enabled for drive in rig.drives.values())
        assert all(notes.snapshots[-1].enabled for notes in rig.notes_of.values())
