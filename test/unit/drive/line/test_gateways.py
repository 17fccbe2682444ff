# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Gateways of Modbus TCP: a connection that stays open and mute, and what no gateway should do.

Beside a mute connection another one is opened, and stops the motor. A strange gateway is named in
words, with what to do.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, DriveError
from nfo_sinus_driver.link.ports.tcp_connection import Connection


def muted(rig: Rig) -> None:
    """Turn, and have the connection go mute."""
    rig.turn()
    rig.line.sessions[-1].mute = True


def test_another_connection_stops_the_motor_and_the_mute_one_carries_nothing_later() -> None:
    with Rig('tcp') as rig:
        muted(rig)
        (old,) = rig.line.sessions
        rig.pass_time(0.5)
        assert old.stuck
        rig.pass_time(1.0 + rig.drive.settings.lost_after)
        assert rig.far.motor.frequency == 0
        assert len(rig.line.sessions) == 2 and rig.bus.statistics().reconnects == 1
        assert rig.notes.said(Cause.LOST_IN_USE) and rig.drive.snapshot.connected
        assert not old.stuck
        old.heal()
        rig.pass_time(1.0)
        assert rig.far.motor.frequency == 0


def test_a_connection_that_answers_again_is_kept() -> None:
    with Rig('tcp') as rig:
        muted(rig)
        rig.line.lost = True
        rig.pass_time(0.5 + rig.drive.settings.lost_after)
        old, new = rig.line.sessions
        old.heal()
        rig.pass_time(3.0)
        assert rig.drive.snapshot.connected
        assert new._is_closed and not old._is_closed


@pytest.mark.parametrize('how', ['lost', 'refuses'])
def test_the_motor_stops_as_soon_as_a_connection_can_be_made(how: str) -> None:
    with Rig('tcp') as rig:
        muted(rig)
        setattr(rig.line, how, True)
        rig.pass_time(6.0)
        assert rig.far.motor.frequency > 0
        setattr(rig.line, how, False)
        rig.pass_time(2.0)
        assert rig.far.motor.frequency == 0


def test_the_thread_of_the_line_is_free_while_it_connects() -> None:
    with Rig('tcp') as rig:
        muted(rig)
        rig.line.lost = True
        rig.pass_time(2.0 + rig.drive.settings.lost_after)
        steps: list[float] = []
        rig.bus.call(lambda: steps.append(rig.clock.now))
        before = rig.clock.now
        rig.pass_time(0.3)
        assert steps and steps[0] - before < 0.25


def test_the_stop_at_exit_takes_another_connection() -> None:
    with Rig('tcp') as rig:
        muted(rig)
        rig.send(None)
        rig.answer(rig.drive.disconnect(rig.drive.settings.shutdown_timeout))
        rig.pass_time(0.5)
        assert rig.far.motor.frequency == 0 and len(rig.line.sessions) == 2


def test_connections_that_stay_mute_are_made_more_and_more_seldom() -> None:
    with Rig('tcp') as rig:
        muted(rig)
        connect = rig.link._make

        def mute(host: str, port: int) -> Connection:
            connection = connect(host, port)
            rig.line.sessions[-1].mute = True
            return connection

        rig.link._make = mute
        rig.pass_time(60.0)
        assert 8 < len(rig.line.sessions) < 14
        rig.link._make = connect
        rig.pass_time(10.0)
        assert rig.far.motor.frequency == 0


@pytest.mark.parametrize('lost_after', [1.0, 3.0])
def test_a_drive_that_is_silent_to_its_gateway_takes_no_connection(lost_after: float) -> None:
    with Rig('tcp', lost_after=lost_after) as rig:
        rig.turn()
        # the gateway answers for it, with exception 11
        rig.line.unplug(1)
        rig.pass_time(10.0)
        assert len(rig.line.sessions) == 1


@pytest.mark.parametrize(
    ('changed', 'said', 'unsaid'),
    [
        (lambda data: bytes(2) + data[2:], 'transaction number', 'response_timeout'),
        (lambda data: bytes((data[0] ^ 1,)) + data[1:], 'transaction number', 'response_timeout'),
        (lambda data: data[:6] + b'\xff' + data[7:], 'as unit 255 and not as unit 1', 'baud rate'),
    ],
    ids=['number 0', 'another number', 'another unit'],
)
def test_a_wrong_answer_of_a_gateway_is_named(
    changed: Callable[[bytes], bytes], said: str, unsaid: str
) -> None:
    with Rig('tcp') as rig:
        send = rig.line.send
        rig.line.send = lambda data: send(changed(data))
        text = rig.answer(rig.drive.connect())
        assert said in text and unsaid not in text
        assert 'number' not in said or 'update or replace the gateway' in text


@pytest.mark.parametrize('length', [-3, -1, 1, 2, 50])
def test_a_wrong_length_over_tcp_is_not_blamed_on_a_serial_line(length: int) -> None:
    def changed(data: bytes) -> bytes:
        wrong = int.from_bytes(data[4:6], 'big') + length
        return data[:4] + wrong.to_bytes(2, 'big') + data[6:]

    with Rig('tcp') as rig:
        send = rig.line.send
        rig.line.send = lambda data: send(changed(data))
        text = str(rig.answer(rig.drive.connect()))
        for blamed in ('baud', 'parity', 'BusType', 'S5'):
            assert blamed not in text
        assert 'gateway' in text or 'protocol' in text


def test_a_gateway_that_closes_after_each_answer_is_used_all_the_same() -> None:
    with Rig('tcp') as rig:
        rig.line.closes = True
        rig.turn()
        (remark,) = rig.bus.remarks
        assert 'closes the connection after each answer' in remark and 'settings' in remark
        rig.pass_time(5.0)
        assert rig.drive.following and rig.far.motor.frequency > 19
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        assert rig.far.motor.frequency == 0


@pytest.mark.parametrize('connection', ['tcp', 'telegram1 g2'])
@pytest.mark.parametrize('functions', [{43}, {17}, {23}, {17, 23, 43}], ids=str)
def test_a_gateway_that_closes_at_a_function_that_it_does_not_know_is_used(
    connection: str, functions: set[int]
) -> None:
    with Rig(connection) as rig:
        closed: list[int] = []

        def plan(frame: bytes) -> str | None:
            if frame[7] not in functions:
                return None
            closed.append(frame[7])
            rig.line.sessions[-1]._hung_up = True
            return 'unheard'

        rig.line.plan = plan
        rig.wait_until(lambda: connected(rig), 20.0)
        rig.drive.activate()
        rig.send(20.0)
        rig.wait_until(lambda: 'enabled' in rig.answer(rig.drive.enable()), 20.0)
        rig.pass_time(2.0)
        if not rig.drive.following:
            rig.wait_until(lambda: 'enabled' in rig.answer(rig.drive.enable()), 20.0)
        rig.pass_time(10.0)
        assert rig.drive.following and rig.far.motor.frequency > 19
        assert all(closed.count(function) <= 2 for function in functions)
        assert not any('closes the connection after each' in text for text in rig.bus.remarks)
        assert all(f'at function {function}' in ' '.join(rig.bus.remarks) for function in closed)
        assert 'stop' in rig.answer(rig.drive.stop())


def connected(rig: Rig) -> bool:
    with contextlib.suppress(DriveError):
        rig.result(rig.drive.connect())
        return True
    return False


def test_a_connection_that_is_closed_once_is_no_habit() -> None:
    with Rig('tcp') as rig:
        rig.turn()
        rig.line.closes = True
        rig.pass_time(0.06)
        rig.line.closes = False
        rig.pass_time(5.0)
        assert rig.bus.remarks == ()
        sessions = len(rig.line.sessions)
        rig.pass_time(2.0)
        assert len(rig.line.sessions) == sessions and rig.drive.snapshot.connected
