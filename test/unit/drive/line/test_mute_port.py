# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A port that is open and mute is opened again, over every protocol.

The adapter, or the device server, passes nothing until then: the operating system reports no error,
and the motor runs on. A line that was never heard, or whose drive is switched off, looks the same.
"""

from __future__ import annotations

import itertools

import pytest
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive.broadcast import broadcast_stop

#: Behind a gateway the connection is another one: test_gateways.py.
BY_PORT = [
    name for name, kind in CONNECTIONS.items() if kind.protocol not in ('modbus_tcp', 'telegram1')
]


class Reports:
    """What the bus reports of its port."""

    def __init__(self, rig: Rig) -> None:
        self.all: list[float] = []
        rig.bus.on_mute(self.all.append)


@pytest.mark.parametrize('connection', BY_PORT)
def test_a_mute_port_is_opened_again_and_the_motor_stops(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        reports = Reports(rig)
        rig.line.state = 'mute'
        rig.pass_time(4.0)
        assert not rig.turns and len(rig.line.opened) == 2
        # one that may have been off is stopped before it is lost
        again = rig.drive.model.profile.may_run_again
        said = Cause.MAY_HAVE_RESTARTED if again else Cause.LOST_IN_USE
        assert rig.drive.snapshot.connected and rig.notes.said(said)
        # once, and again when it speaks
        silent, speaks = reports.all
        assert silent >= rig.drive.settings.lost_after and speaks == 0
        if rig.drive.settings.follows_setpoints:
            rig.assert_only_enable_helps()


def test_it_is_opened_again_and_again_at_growing_intervals() -> None:
    with Rig() as rig:
        rig.turn()
        reports = Reports(rig)
        rig.line.state, rig.line.mute_for = 'mute', 8
        rig.pass_time(25.0)
        assert rig.far.motor.frequency > 0
        _, *again = rig.line.opened
        pauses = [later - before for before, later in itertools.pairwise(again)]
        assert pauses == pytest.approx([2, 4, 8, 8, 8, 8, 8][: len(pauses)], abs=1.5)
        assert len(pauses) > 2
        rig.wait_until(lambda: rig.line.state == 'whole')
        rig.pass_time(2.0)
        assert not rig.turns
        assert len(reports.all) == 2


#: How long what is behind the port takes to start after each opening, s: what is opened again in
#: that time restarts. The last is the longest pause while a stop is owed.
STARTS = 3.0, 7.0, 8.0


def go_mute(rig: Rig) -> None:
    """Have nothing pass from now on, until the port was opened again."""
    if rig.connection.protocol == 'modbus_tcp':
        rig.line.sessions[-1].mute = True
    else:
        rig.line.state = 'mute'


@pytest.mark.parametrize('seconds', STARTS)
@pytest.mark.parametrize('connection', ['rtu', 'classic', 'tcp', 'canopen'])
def test_what_starts_when_it_is_opened_has_the_time_for_it(connection: str, seconds: float) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.line.boots_for = seconds
        go_mute(rig)
        # the last pause is the first that is long enough: after 1, 2, 4 s and 8 s of starting
        rig.pass_time(1 + 2 + 4 + 8 + 5)
        assert not rig.turns and rig.drive.snapshot.connected
        rig.assert_only_enable_helps()


@pytest.mark.parametrize('seconds', [14.0, 29.0])
@pytest.mark.parametrize('connection', ['rtu', 'tcp'])
def test_what_takes_longer_has_that_where_no_stop_waits(connection: str, seconds: float) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.line.boots_for = seconds
        go_mute(rig)
        rig.pass_time(1 + 2 + 4 + 8 + 15 + 30 + 6)
        assert rig.drive.snapshot.connected


@pytest.mark.parametrize('connection', ['rtu', 'tcp'])
def test_what_takes_longer_is_heard_in_the_end_although_a_stop_waits(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.line.boots_for = 25.0
        go_mute(rig)
        rig.wait_until(lambda: not rig.turns, 1 + 2 + 4 + 10 * 8 + 25 + 15)
        rig.wait_until(lambda: rig.drive.snapshot.connected, 2.0)


@pytest.mark.parametrize('openings', [1, 2, 3, 4])
@pytest.mark.parametrize('connection', ['rtu', 'optimal', 'canopen', 'described'])
def test_the_stop_goes_out_at_once_after_an_opening(connection: str, openings: int) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.line.state, rig.line.mute_for = 'mute', openings
        rig.wait_until(lambda: not rig.turns)
        assert len(rig.line.opened) == 1 + openings
        # what is read before, so that no other drive is stopped, included
        assert rig.clock.now - rig.line.opened[-1] < 0.4


@pytest.mark.parametrize('seconds', [7.0, 12.0])
def test_a_port_that_says_anything_is_not_opened_again_meanwhile(seconds: float) -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.boots_for, rig.line.banner = seconds, b'ready soon\r\n'
        rig.line.state = 'mute'
        rig.pass_time(1 + seconds + 3)
        assert not rig.turns and len(rig.line.opened) == 2


def test_a_port_that_says_nothing_else_is_opened_again_all_the_same() -> None:
    """Its rate may be another one until it is opened again."""
    with Rig() as rig:
        rig.turn()
        rig.line.banner, rig.line.mute_for = b'\xff\x55', 2
        rig.line.state, rig.line.boots_for = 'mute', 0.001
        rig.pass_time(38.0)
        assert not rig.turns and len(rig.line.opened) == 3


def test_noise_opens_nothing() -> None:
    with Rig() as rig:
        rig.connect()
        rig.line.state = 'noise'
        rig.pass_time(10.0)
        assert len(rig.line.opened) == 1


def test_it_is_opened_at_once_when_it_goes_mute_anew() -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state, rig.line.mute_for = 'mute', 5
        rig.pass_time(30.0)
        rig.enable()
        rig.pass_time(1.0)
        assert rig.far.motor.frequency > 10
        rig.line.state = 'mute'
        rig.pass_time(2.0)
        assert not rig.turns


def test_a_port_with_any_drive_that_answers_stays_open() -> None:
    with Rig(drives=2) as rig:
        rig.turn()
        rig.line.unplug(2)
        rig.pass_time(60.0)
        assert rig.far.motor.frequency > 19
        assert len(rig.line.opened) == 1


def test_the_longest_lost_after_of_the_line_counts() -> None:
    with Rig(drives=2, poll_rate=20.0, own={2: {'lost_after': 5.0}}) as rig:
        rig.turn()
        rig.line.state = 'mute'
        rig.pass_time(4.9)
        assert len(rig.line.opened) == 1
        rig.pass_time(2.5)
        assert len(rig.line.opened) == 2
        assert not any(far.motor.driven and far.motor.demand for far in rig.fars.values())


def test_a_broadcast_is_no_sign_of_life() -> None:
    with Rig('classic') as rig:
        rig.turn()
        rig.line.state, rig.line.mute_for = 'mute', 10
        rig.keep(lambda: broadcast_stop(rig.bus, [rig.drive]) and None)
        rig.pass_time(3.0)
        assert len(rig.line.opened) > 1


def test_a_drive_that_is_switched_off_costs_little() -> None:
    with Rig() as rig:
        rig.connect()
        reports = Reports(rig)
        rig.line.unplug(1)
        rig.pass_time(600.0)
        assert 20 < len(rig.line.opened) < 30
        assert len(reports.all) == 1
        rig.line.unplug()
        rig.pass_time(10.0)
        assert rig.drive.snapshot.connected
        assert reports.all[1:] == [0.0]


def test_a_line_that_was_never_heard_costs_less_and_is_not_reported() -> None:
    with Rig() as rig:
        reports = Reports(rig)
        rig.line.unplug(1)
        rig.keep(lambda: None)
        for _ in range(30):
            rig.answer(rig.drive.connect())
            rig.pass_time(4.0)
        assert rig.clock.now > 1100 and 2 < len(rig.line.opened) < 6
        assert not reports.all


def test_an_address_that_never_answered_opens_nothing() -> None:
    """As a scan asks one after the other."""
    with Rig(drives=2) as rig:
        rig.line.unplug(2)
        rig.result(rig.drives[1].identify())
        for _ in range(30):
            rig.answer(rig.drives[2].identify())
        assert rig.clock.now > 1005 and len(rig.line.opened) == 1


@pytest.mark.parametrize('lost_after', [1.0, 20.0])
@pytest.mark.parametrize('connection', ['rtu', 'canopen', 'classic'])
def test_an_end_opens_it_once_more_before_it_gives_up(connection: str, lost_after: float) -> None:
    with Rig(connection, lost_after=lost_after) as rig:
        rig.turn()
        rig.line.state = 'mute'
        answer = rig.answer(rig.drive.stop_for_good(rig.drive.settings.shutdown_timeout))
        assert 'NOT' not in answer and not rig.turns
        assert len(rig.line.opened) == 2


@pytest.mark.parametrize(('patience', 'seconds'), [(6.0, 3.0), (16.0, 7.0)])
def test_an_end_opens_it_only_once(patience: float, seconds: float) -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state, rig.line.boots_for = 'mute', seconds
        answer = rig.answer(rig.drive.stop_for_good(patience))
        assert 'NOT' not in answer and not rig.turns
        assert len(rig.line.opened) == 2


@pytest.mark.parametrize('connection', ['rtu', 'described'])
def test_a_time_out_that_runs_is_not_fed_for_the_next_opening(connection: str) -> None:
    with Rig(connection, drive_timeout=8.0) as rig:
        rig.turn()
        begun = rig.clock.now
        # the drive hears reads alone, and no answer comes
        rig.line.plan = lambda frame: 'drop' if frame[1] == 0x03 else 'unheard'
        rig.wait_until(lambda: not rig.turns)
        assert rig.clock.now - begun < 12.0


def test_an_end_without_patience() -> None:
    with Rig() as rig:
        rig.turn()
        future = rig.drive.stop_for_good(0.0)
        rig.pass_time(1.0)
        assert future.done() and len(rig.line.opened) == 1


def test_an_end_does_not_wait_for_the_next_try() -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state, rig.line.mute_for = 'mute', 100
        rig.pass_time(60.0)
        rig.wait_until(lambda: rig.clock.now - rig.line.opened[-1] < 0.7)
        rig.line.mute_for = 1
        answer = rig.answer(rig.drive.stop_for_good(rig.drive.settings.shutdown_timeout))
        assert 'NOT' not in answer and not rig.turns


def test_an_adapter_that_has_left_the_can_bus_is_taken_onto_it_again() -> None:
    with Rig('canopen') as rig:
        rig.turn()
        rig.line.state = 'bus_off'
        rig.pass_time(4.0)
        assert not rig.turns and rig.drive.snapshot.connected
        # what the adapter itself says
        assert rig.notes.said('adapter: A4, error warning, error passive, bus error')


@pytest.mark.parametrize('watch', ['heartbeat', 'guarding'])
@pytest.mark.parametrize('state', ['mute', 'bus_off'])
def test_a_node_that_watches_the_driver_goes_on_watching_it(state: str, watch: str) -> None:
    with Rig('canopen', options={'canopen_watch': watch}, drive_timeout=2.0) as rig:
        rig.turn()
        rig.line.state = state
        rig.pass_time(1.9)
        # before its time-out
        assert not rig.turns and not rig.far.faults
        rig.enable()
        rig.pass_time(5.0)
        assert rig.far.motor.frequency > 19
        rig.kill()
        rig.line.go_to(rig.clock.now + 5.0)
        assert rig.far.faults and not rig.turns


@pytest.mark.parametrize('seconds', [0.3, 1.5])
def test_all_stops_go_out_at_once_when_a_lost_port_is_back(seconds: float) -> None:
    with Rig(drives=4) as rig:
        rig.turn()
        rig.line.state = 'gone'
        rig.pass_time(seconds)
        rig.line.state = 'whole'
        rig.wait_until(
            lambda: not any(far.motor.driven and far.motor.demand for far in rig.fars.values())
        )
        assert rig.clock.now - rig.line.opened[-1] < 0.5


def test_what_takes_the_port_meanwhile_is_named() -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state, rig.line.mute_for = 'mute', 2
        rig.wait_until(lambda: len(rig.line.opened) == 2)
        rig.line.state = 'gone'
        rig.pass_time(3.0)
        assert str(rig.bus.port_error) == 'the port is gone'
        rig.line.state = 'whole'
        rig.pass_time(2.0)
        assert not rig.turns
