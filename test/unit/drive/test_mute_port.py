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
    name for name, one in CONNECTIONS.items() if one.protocol not in ('modbus_tcp', 'telegram1')
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
        assert rig.drive.snapshot.connected and rig.notes.said(Cause.LOST_IN_USE)
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
        assert pauses[0] < 4.0 < pauses[-1] < 8.0 and pauses == sorted(pauses)
        rig.wait_until(lambda: rig.line.state == 'whole')
        rig.pass_time(2.0)
        assert not rig.turns
        assert len(reports.all) == 2


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
        assert 60 < len(rig.line.opened) < 110
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
        rig.wait_until(lambda: rig.clock.now - rig.line.opened[-1] < 0.1)
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
