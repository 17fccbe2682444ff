# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A set-point and the status in one transaction, where the drive has it (function 23)."""

from __future__ import annotations

from typing import Any

import pytest
from support.rig import Rig
from support.wire import understand

from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.modbus import server

SETPOINT, STATUS, INV_ST = 'status.frq_set', 'fieldbus.drive_status', 'fieldbus.inv_st'
SCMD = 'fieldbus.scmd'
SETPOINT_REGISTER = 0x3FC
OVERLOAD = 5
WRITE, WRITE_SEVERAL, BOTH = 6, 16, 23


def functions(rig: Rig, since: int = 0) -> list[int]:
    """Return by which functions the set-point was written since so many frames, in order."""
    return [
        frame[1]
        for frame in (bytes.fromhex(request['hex']) for request in requests(rig, since))
        if (message := understand(frame, 'modbus_rtu')) is not None
        and message.words is not None
        and message.place == SETPOINT_REGISTER
    ]


def _plain(frame: dict[str, Any]) -> Any:
    """Return what a frame writes, unless it reads at the same time."""
    data = bytes.fromhex(frame['hex'])
    return understand(data, 'modbus_rtu') if data[1] in (WRITE, WRITE_SEVERAL) else None


def requests(rig: Rig, since: int = 0) -> list[dict[str, Any]]:
    return [frame for frame in rig.line.frames[since:] if frame['direction'] == 'request']


def asked(rig: Rig, since: int = 0) -> list[tuple[str, int | None]]:
    """Return what was read and written since so many requests."""
    return [
        (key, None if data is None else rig.number(data)) for _, key, data in rig.asked[since:]
    ]


def quiet(**settings: Any) -> Rig:
    """Return a motor that turns, so seldom polled that nothing waits for the line."""
    rig = Rig(
        options={'refuses_in_fault': 'nothing'}, poll_rate=1.0, telemetry_rate=0.0, **settings
    )
    rig.turn()
    rig.send(None)
    return rig


def refuse_both(rig: Rig, code: int) -> list[int]:
    """Have it refuse the function; return how much had been asked, each time."""
    tried: list[int] = []

    def refuse(*_: Any) -> tuple[int, ...]:
        tried.append(len(rig.asked))
        raise Refused(Reason(code), 'it does not like it')

    server(rig.far).write_and_read = refuse  # type: ignore[method-assign]
    return tried


def test_a_direction_that_changes_without_a_size_goes_by_itself() -> None:
    with Rig('rtu, control word') as rig:
        rig.turn(-20.0)
        rig.send(0.0)
        rig.pass_time(1.0)
        begun = len(rig.line.frames)
        # less than a step of the drive, in the other direction
        rig.send(0.004)
        rig.pass_time(1.0)
        sent = [bytes.fromhex(frame['hex'])[1] for frame in requests(rig, begun)]
        assert WRITE_SEVERAL in sent and BOTH not in sent
        assert rig.far.control_unit.machine.direction == 1


def test_a_set_point_and_the_status_are_one_transaction_but_zero_of_a_stop() -> None:
    with quiet() as rig:
        begun = len(rig.line.frames)
        rig.drive.set_setpoint(25.0)
        rig.pass_time(0.05)
        sent = [
            understand(bytes.fromhex(frame['hex']), 'modbus_rtu') for frame in requests(rig, begun)
        ]
        understood = [message for message in sent if message is not None]
        assert [message[1:] for message in understood if message.words is not None] == [
            (SETPOINT_REGISTER, 1, (250,), (0x258, 2))
        ]
        rig.pass_time(1.0)
        assert abs(rig.far.motor.frequency - 25.0) < 0.2
        assert rig.answer(rig.drive.stop()).startswith('stop')
        assert functions(rig)[-1] == WRITE


def test_the_optimal_is_never_asked_for_it() -> None:
    with Rig('optimal') as rig:
        rig.turn()
        assert functions(rig) and BOTH not in functions(rig)
        assert rig.drive.following


@pytest.mark.parametrize('code', [Reason.FUNCTION, Reason.VALUE, 0])
def test_one_that_does_not_have_the_function_is_given_up_for_the_connection(code: int) -> None:
    with Rig(telemetry_rate=0.0) as rig:
        rig.connect()
        both = server(rig.far).write_and_read
        tried = refuse_both(rig, code) if code else []
        if not code:
            # it does not know it, and is silent
            rig.line.plan = lambda frame: 'unheard' if frame[1] == BOTH else None
        rig.turn()
        assert (len(tried), functions(rig).count(BOTH)) == (bool(code), 1)
        # the plain write follows at once: a poll may have waited longer, and a stop might
        assert not code or (SETPOINT, 200) in asked(rig, tried[0])[:2]
        assert rig.drive.following and not rig.notes.events
        assert abs(rig.far.motor.frequency - 20.0) < 0.2
        # and is tried anew after another connection
        server(rig.far).write_and_read = both  # type: ignore[method-assign]
        rig.line.plan = lambda frame: None
        rig.line.state = 'silent'
        rig.pass_time(2.0)
        assert not rig.drive.snapshot.connected
        rig.line.mend()
        rig.pass_time(5.0)
        assert rig.drive.snapshot.connected
        begun = len(rig.line.frames)
        rig.enable()
        rig.pass_time(0.5)
        assert BOTH in functions(rig, begun)


def test_only_the_newest_set_point_is_written_to_one_that_does_not_have_it() -> None:
    with Rig(poll_rate=1.0, telemetry_rate=0.0) as rig:
        rig.connect()
        rig.enable()

        def refuse(*_: Any) -> tuple[int, ...]:
            rig.drive.set_setpoint(0.0)
            raise Refused(Reason.FUNCTION, 'it does not like it')

        server(rig.far).write_and_read = refuse  # type: ignore[method-assign]
        begun = len(rig.line.frames)
        rig.drive.set_setpoint(30.0)
        rig.pass_time(0.3)
        assert functions(rig, begun)[0] == BOTH
        plain = map(_plain, requests(rig, begun))
        written = [message.words for message in plain if message is not None]
        assert (300,) not in written, 'the newer one had come'
        assert rig.drive.following


def test_a_refused_set_point_stops() -> None:
    with quiet() as rig:
        refuse_both(rig, Reason.VALUE)
        rig.drive.set_setpoint(30.0)
        rig.pass_time(0.3)
        assert not rig.drive.following
        assert rig.notes.said('it refused set-point 30')
        assert not rig.drive.stop_unconfirmed


def test_a_lost_answer_is_looked_after_before_the_next_set_point() -> None:
    with quiet() as rig:
        rig.line.losses = 1
        rig.drive.set_setpoint(30.0)
        rig.pass_time(0.5)
        assert rig.drive.following
        first, again = [n for n, request in enumerate(asked(rig)) if request == (SETPOINT, 300)]
        assert (STATUS, None) in asked(rig)[first:again]
        assert functions(rig)[-2:] == [BOTH, BOTH]


def test_an_impossible_status_that_comes_with_a_set_point_stops_nothing() -> None:
    with quiet() as rig:
        whole = server(rig.far).write_and_read

        def spoil(*what: Any) -> tuple[int, ...]:
            whole(*what)
            return (0xFFFF, 0)

        server(rig.far).write_and_read = spoil  # type: ignore[method-assign]
        rig.drive.set_setpoint(25.0)
        rig.pass_time(1.5)
        assert rig.drive.following
        assert not rig.notes.events


def test_a_poll_that_waits_is_spared_what_the_set_point_brought() -> None:
    with Rig(poll_rate=0.0, telemetry_rate=0.0) as rig:
        rig.turn()
        # a new one before each step of the bus
        value, begun, frames = 20.0, len(rig.asked), len(rig.line.frames)
        for _ in range(40):
            value += 0.1
            rig.drive.set_setpoint(value)
            rig.bus.step()
        polls = asked(rig, begun).count((STATUS, None))
        brought = functions(rig, frames).count(BOTH)
        assert brought > 10
        assert polls < brought / 4
        assert rig.drive.following


@pytest.mark.parametrize(('timeout', 'period'), [(0.0, 5.0), (3.0, 1.0), (20.0, 5.0)])
def test_an_unchanged_set_point_is_written_no_more_often_than_needed(
    timeout: float, period: float
) -> None:
    with Rig(drive_timeout=timeout, poll_rate=2.0, telemetry_rate=0.0) as rig:
        rig.turn()
        begun = len(rig.written(SETPOINT))
        rig.pass_time(20.0)
        assert rig.drive.following
        # a program sends it ten times a second
        assert 20 / period * 0.8 <= len(rig.written(SETPOINT)) - begun <= 20 / period + 1


def test_a_set_point_that_another_master_changed_is_written_again() -> None:
    with Rig() as rig:
        rig.turn()
        server(rig.far).write(SETPOINT_REGISTER, (300,))
        rig.pass_time(6.0)
        assert abs(rig.far.motor.frequency - 20.0) < 0.2
