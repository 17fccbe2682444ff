# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One law over every connection to a drive: after a stop it is known why the motor stopped."""

from __future__ import annotations

from collections.abc import Callable, Collection
from concurrent.futures import Future
from typing import Any, NamedTuple

import pytest
from support.rig import CONNECTIONS, Rig
from support.said import said
from support.variants import ramps

from nfo_sinus_driver.drive import Cause, Drive, Procedure, Report, StopReason
from nfo_sinus_driver.drive.known.stop_reason import reason_of

_SPEED = 20.0
_BY = '/teach_pendant'
#: Where the motor follows set-points; where the drive counts the frames of the driver itself.
FOLLOWING = {name for name, kind in CONNECTIONS.items() if kind.reference == 'fieldbus'}
TIMED = {
    name for name, connection in CONNECTIONS.items()
    if connection.protocol not in ('telegram1', 'canopen')
    and connection.model not in ('sinus_optimal', 'acme')
}
SERIAL_G2 = {
    name
    for name, connection in CONNECTIONS.items()
    if connection.protocol in ('modbus_rtu', 'modbus_ascii', 'classic')
    and connection.model == 'sinus_g2'
}
#: Older firmware shows running until its set-point is 0, so that more is said of it after the stop.
DISOBEDIENT = FOLLOWING - {'classic v5.0'}
#: Where an input enables; else the PLC does, or the bit of the bus.
WIRED = {name for name in CONNECTIONS if not name.startswith(('telegram1 sinus_h', 'movitrac'))}


def command(cause: Cause, give: Callable[[Drive, Report], Future[Any]]) -> Callable[[Rig], None]:
    """Have a client stop the motor."""
    return lambda rig: rig.answer(give(rig.drive, Report(cause, by=_BY)))


def lose_line(rig: Rig) -> None:
    rig.line.state = 'silent'


def lose_power(rig: Rig) -> None:
    rig.far.power_cycle(boot_time=2.0)


def is_setpoint(rig: Rig, key: str) -> bool:
    targets = rig.drive.model.profile.setpoints.values()
    return key.endswith('setpoint') or any(key in (target.key, target.at) for target in targets)


def refuse_setpoint(rig: Rig) -> None:
    rig.meet = lambda key, data: 'refused' if is_setpoint(rig, key) and data else None
    rig.send(_SPEED / 2)


def ignore_setpoint(rig: Rig) -> None:
    """Have the drive take set-point 0 and go on turning."""
    rig.meet = lambda key, data: 'ignored' if is_setpoint(rig, key) and data else None
    rig.send(None)


def suspend(rig: Rig) -> None:
    """Have the driver sleep for longer than the drive waits for it."""
    rig.line.go_to(rig.clock.now + 4.0)


def restart_driver(rig: Rig) -> None:
    """End the driver without a stop: the next one finds a motor that runs."""
    rig.kill()
    rig.pass_time(0.3)
    rig.begin()
    rig.connect()


class Stop(NamedTuple):
    """
    Something that stops the motor.

    :ivar reasons: what may be said of it: more than one where some drives do not tell them apart.
    :ivar connections: over which it can happen.
    :ivar seconds: after which it is known, and nothing more comes of it, s.
    """

    happen: Callable[[Rig], object]
    reasons: Collection[StopReason]
    connections: Collection[str] = tuple(CONNECTIONS)
    seconds: float = 2.5


_R = StopReason
STOPS = {
    'stop': Stop(command(Cause.STOP_REQUESTED, Drive.stop), {_R.STOP}),
    'disable': Stop(command(Cause.DISABLE_REQUESTED, Drive.stop), {_R.DISABLE}),
    'quick stop': Stop(command(Cause.QUICK_STOP_REQUESTED, Drive.quick_stop), {_R.QUICK_STOP}),
    'all drives': Stop(command(Cause.STOP_ALL_REQUESTED, Drive.stop), {_R.STOP_ALL}),
    'deactivate': Stop(command(Cause.TRANSITION_REQUESTED, Drive.deactivate), {_R.LIFECYCLE}),
    'exit': Stop(
        command(Cause.DRIVER_ENDS, lambda drive, why: drive.stop_for_good(4.0, why)),
        {_R.DRIVER_ENDS},
    ),
    'no set-points': Stop(lambda rig: rig.send(None), {_R.SETPOINT_TIMEOUT}, FOLLOWING),
    'fault': Stop(lambda rig: rig.far.trip(rig.a_fault), {_R.FAULT}),
    'run input': Stop(
        lambda rig: rig.far.set_run_input(False), {_R.RUN_INPUT, _R.BY_ITSELF}, WIRED
    ),
    'keypad': Stop(
        lambda rig: rig.far.control_unit.press('stop'), {_R.CONTROL_TAKEN}, SERIAL_G2
    ),
    'silent line': Stop(lose_line, {_R.DRIVE_LOST}, seconds=5.0),
    # one that keeps its mode, or a PLC, does not tell it from a loss
    'power cycle': Stop(lose_power, {_R.POWER_CYCLE, _R.DRIVE_LOST}, seconds=5.0),
    'refused set-point': Stop(refuse_setpoint, {_R.SETPOINT_REFUSED}, DISOBEDIENT, 5.0),
    'ignored set-point': Stop(ignore_setpoint, {_R.NOT_FOLLOWING}, DISOBEDIENT, 8.0),
    'sleeping driver': Stop(suspend, {_R.DRIVE_TIMEOUT}, TIMED, 5.0),
    'killed driver': Stop(restart_driver, {_R.NOT_ENABLED}, seconds=5.0),
}
_CASES = [
    (name, stop) for name in CONNECTIONS for stop, how in STOPS.items() if name in how.connections
]


@pytest.mark.parametrize(('connection', 'stop'), _CASES)
def test_after_each_stop_it_is_known_why(connection: str, stop: str) -> None:
    settings = {'drive_timeout': 2.0} if stop == 'sleeping driver' else {}
    with Rig(connection, setpoint_timeout=1.0, **settings) as rig:
        rig.turn()
        assert rig.drive.snapshot.stop_reason is StopReason.NONE
        STOPS[stop].happen(rig)
        rig.pass_time(STOPS[stop].seconds)
        assert rig.drive.snapshot.stop_reason in STOPS[stop].reasons, said(rig.drive.snapshot.stop)


# the made-up drive has no ramp
@pytest.mark.parametrize('connection', [name for name in CONNECTIONS if name != 'made up'])
def test_a_ramp_that_a_lost_drive_was_given_is_no_run_of_an_earlier_session(
    connection: str,
) -> None:
    made = CONNECTIONS[connection]
    slow = {**ramps(made.model, 0.3, 20.0), **made.parameters}
    with Rig(connection, setpoint_timeout=0.0, parameters=slow) as rig:
        rig.turn()
        rig.line.state = 'gone'
        rig.pass_time(2.5)
        rig.line.mend()
        rig.pass_time(3.0)
        assert rig.drive.snapshot.connected and not rig.notes.said(Cause.FOUND_RUNNING)
        assert rig.drive.snapshot.stop_reason is _R.DRIVE_LOST


def test_it_is_said_who_requested_a_stop() -> None:
    with Rig() as rig:
        rig.turn()
        rig.answer(rig.drive.stop(Report(Cause.STOP_REQUESTED, by=_BY)))
        rig.pass_time(0.2)
        assert said(rig.drive.snapshot.stop) == 'a stop was requested: /teach_pendant'


def test_a_stop_of_what_does_not_run_explains_nothing() -> None:
    with Rig() as rig:
        rig.turn()
        rig.far.trip(rig.a_fault)
        rig.pass_time(1.0)
        for stop in (rig.drive.stop, rig.drive.quick_stop):
            rig.answer(stop())
        rig.pass_time(0.2)
        assert rig.drive.snapshot.stop_reason is StopReason.FAULT
        # a refused enable neither
        rig.answer(rig.drive.enable())
        rig.pass_time(0.2)
        assert rig.drive.snapshot.stop_reason is StopReason.FAULT


def test_why_it_stopped_holds_until_it_is_enabled_again() -> None:
    with Rig(setpoint_timeout=1.0) as rig:
        rig.turn()
        rig.send(None)
        rig.pass_time(2.0)
        assert rig.drive.snapshot.stop_reason is StopReason.SETPOINT_TIMEOUT
        rig.send(_SPEED)
        rig.pass_time(0.2)
        assert rig.drive.snapshot.stop_reason is StopReason.NONE
        rig.answer(rig.drive.stop())
        rig.pass_time(3.0)
        assert rig.drive.snapshot.stop_reason is StopReason.STOP
        rig.enable()
        rig.pass_time(0.2)
        assert rig.drive.snapshot.stop_reason is StopReason.NONE


def test_an_enable_that_fails_says_so() -> None:
    with Rig() as rig:
        rig.connect()
        rig.far.set_run_input(False)
        rig.answer(rig.drive.enable())
        rig.pass_time(0.2)
        assert rig.drive.snapshot.stop_reason is StopReason.ENABLE_FAILED
        assert 'RUN input' in said(rig.drive.snapshot.stop)


def test_the_end_of_a_tuning_is_a_stop_and_that_of_a_reset_is_none() -> None:
    with Rig() as rig:
        rig.connect()
        rig.answer(rig.drive.erase_error_log())
        rig.pass_time(0.2)
        assert rig.drive.snapshot.stop_reason is StopReason.NONE
        rig.answer(rig.drive.tune(Procedure.CALCULATE))
        rig.pass_time(0.2)
        assert rig.drive.snapshot.stop_reason is StopReason.PROCEDURE


def test_a_control_mode_changed_at_the_drive_is_reported_as_that() -> None:
    with Rig() as rig:
        rig.turn()
        rig.far.set_from_keypad('control.mode', 'Speed')
        rig.pass_time(2.0)
        assert rig.drive.snapshot.stop_reason is StopReason.CONTROL_MODE


def test_every_reason_is_that_of_some_cause() -> None:
    shown = {reason_of(Report(cause)) for cause in Cause}
    assert shown | {StopReason.NONE, StopReason.DRIVE_TIMEOUT} == set(StopReason)
