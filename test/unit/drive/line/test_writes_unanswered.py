# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Writes that get no answer while reads do: what is not acknowledged has not happened (law 13).

So does a gateway that was put into read-only mode, a filter, or a line that carries one way.
"""

from __future__ import annotations

import pytest
from support.drive_timeout import by_default
from support.rig import CONNECTIONS, Rig
from support.said import says
from support.variants import ramps
from support.writes import is_write

from nfo_sinus_driver.drive import Cause, Severity

#: Where the motor follows set-points of the bus.
FOLLOWING = [name for name, kind in CONNECTIONS.items() if kind.reference == 'fieldbus']
#: Where one frame writes and another one reads: to a PLC all goes in one, and it is lost.
APART = [name for name in FOLLOWING if CONNECTIONS[name].protocol != 'telegram1']
every_connection = pytest.mark.parametrize('connection', APART)
#: By when a set-point that is not acknowledged has failed, s, with the default of ``lost_after``;
#: and where others have turns between.
_FAILED, _FAILED_OF_SEVERAL = 1.6, 2.8
#: By when after that a stop that fails as well is told, s.
_TOLD = 2.6


def lose_writes(rig: Rig, *addresses: int) -> None:
    """Let no write arrive from now on, at some drives or at all."""
    protocol = rig.connection.protocol
    rig.line.plan = lambda frame: (
        'unheard' if is_write(protocol, frame) and _unit(rig, frame) in (addresses or rig.fars)
        else None
    )


def failed(rig: Rig) -> float:
    """Return by when a set-point has failed, s."""
    return _FAILED_OF_SEVERAL if len(rig.fars) > 1 else _FAILED


def _unit(rig: Rig, frame: bytes) -> int:
    match rig.connection.protocol:
        case 'canopen':
            return int(frame[1:4], 16) & 0x7F
        case 'classic':
            return frame[1] - 0x20
        case 'movitrac':
            return frame[1]
        case 'modbus_tcp':
            return frame[6]
        case 'modbus_ascii':
            return int(frame[1:3], 16)
        case _:
            return frame[0]


def assert_failed(rig: Rig, address: int = 1) -> None:
    """The set-point counts as failed, and the stop is told to fail, too; nothing else is told."""
    notes = rig.notes_of[address]
    assert not rig.drives[address].following
    # where the stops of all drives are in vain, reads of one may have no turn for long enough
    lost = notes.said(Cause.LOST_IN_USE) or notes.said(Cause.LOST)
    assert notes.said(Cause.SETPOINT_UNACKNOWLEDGED) or lost
    assert notes.said(Cause.CANNOT_STOP, Severity.ERROR)
    snapshot = notes.snapshot
    assert snapshot is not None and not snapshot.enabled
    assert snapshot.connected or (lost and len(rig.fars) > 1)
    assert not any(says(event.text, 'ramps to a stop') for event in notes.events)


@every_connection
@pytest.mark.parametrize('value', [0.0, 10.0, -20.0])
@pytest.mark.parametrize('drives', [1, 3])
def test_a_set_point_that_is_not_acknowledged_has_failed(
    connection: str, value: float, drives: int
) -> None:
    with by_default(connection, drives=drives) as rig:
        rig.turn()
        lose_writes(rig, 1)
        rig.send(value)
        rig.pass_time(failed(rig))
        assert not rig.drive.following
        rig.pass_time(_TOLD)
        assert_failed(rig)
        for other in range(2, drives + 1):
            assert rig.drives[other].following
            events = rig.notes_of[other].events
            assert not [event for event in events if event.severity is Severity.ERROR]
        # the stop goes on, and is done as soon as a write arrives
        rig.line.plan = lambda frame: None
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 2.0)
        assert not rig.turns


@every_connection
@pytest.mark.parametrize('drives', [1, 3])
def test_the_set_point_0_of_a_time_out_that_is_not_acknowledged_has_failed(
    connection: str, drives: int
) -> None:
    with by_default(connection, drives=drives, setpoint_timeout=2.5) as rig:
        rig.turn()
        lose_writes(rig)
        rig.send(None)
        rig.pass_time(2.5 + failed(rig))
        assert not any(drive.following for drive in rig.drives.values())
        rig.pass_time(_TOLD)
        for address in rig.fars:
            assert_failed(rig, address)


@every_connection
def test_a_set_point_that_is_only_written_again_has_failed(connection: str) -> None:
    # the way to the drive is gone, whatever is to be said
    with by_default(connection) as rig:
        rig.turn()
        lose_writes(rig)
        rig.pass_time(5.0 + failed(rig) + _TOLD)
        assert_failed(rig)


@every_connection
def test_a_set_point_that_changes_all_the_time_has_failed(connection: str) -> None:
    with by_default(connection) as rig:
        rig.turn()
        lose_writes(rig)
        steps = iter(range(10**6))
        rig.keep(
            lambda: rig.drive.set_setpoint(
                rig.connection.hertz * (10.0 + 0.1 * (next(steps) % 80))
            )
        )
        rig.pass_time(failed(rig) + _TOLD)
        assert_failed(rig)


@every_connection
@pytest.mark.parametrize('seed', range(3))
def test_noise_is_no_failed_write(connection: str, seed: int) -> None:
    with by_default(connection) as rig:
        rig.turn()
        rig.line.make_noise(0.1, seed)
        steps = iter(range(10**6))
        rig.keep(
            lambda: rig.drive.set_setpoint(
                rig.connection.hertz * (10.0 + 0.1 * (next(steps) % 80))
            )
        )
        rig.pass_time(20.0)
        assert not rig.notes.said(Cause.SETPOINT_UNACKNOWLEDGED)
        assert rig.drive.following or rig.notes.said(Cause.LOST_IN_USE)


# --- acknowledged, and not done -------------------------------------------------------------------


@every_connection
@pytest.mark.parametrize('value', [0.0, -20.0])
def test_what_is_acknowledged_and_changes_nothing_is_no_set_point(
    connection: str, value: float
) -> None:
    # such as a proxy that answers writes itself, and reads from its cache
    with by_default(connection) as rig:
        rig.turn()
        rig.meet = lambda key, data: None if data is None else 'ignored'
        rig.send(value)
        rig.pass_time(4.8)
        assert rig.drive.following
        rig.pass_time(0.9)
        assert not rig.drive.following
        assert rig.notes.said(Cause.NOTHING_CHANGES)
        rig.pass_time(2.0 + _TOLD)
        assert rig.notes.said(Cause.CANNOT_STOP, Severity.ERROR)
        rig.meet = lambda key, data: None
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 12.0)
        assert not rig.turns


@every_connection
@pytest.mark.parametrize('through', [(0.0, -20.0), (0.0, -5.0, 0.0)])
def test_set_points_that_go_on_to_change_do_not_hide_it(
    connection: str, through: tuple[float, ...]
) -> None:
    with by_default(connection) as rig:
        rig.turn()
        rig.meet = lambda key, data: None if data is None else 'ignored'
        for value in through:
            rig.send(value)
            rig.pass_time(1.5)
        rig.pass_time(5.7 - 1.5 * len(through))
        assert rig.notes.said(Cause.NOTHING_CHANGES)
        assert not rig.drive.following


@every_connection
@pytest.mark.parametrize('ramp', [20.0, 60.0])
def test_a_drive_that_follows_slowly_changes(connection: str, ramp: float) -> None:
    with by_default(connection) as rig:
        rig.turn()
        for key in ramps(rig.connection.model, ramp, ramp):
            rig.far.set_from_keypad(key, ramp)
        for value in (0.0, 20.0, -20.0, 0.0, -5.0):
            rig.send(value)
            rig.pass_time(6.5)
            assert rig.drive.following, rig.notes.events


@every_connection
def test_a_current_limit_is_no_set_point_that_is_not_followed(connection: str) -> None:
    with by_default(connection) as rig:
        rig.turn()
        rig.far.motor.load = 3.0
        rig.pass_time(1.0)
        for value in (0.0, 20.0, -20.0):
            rig.send(value)
            rig.pass_time(6.0)
            assert not rig.notes.said(Cause.NOTHING_CHANGES)


# --- slow lines -----------------------------------------------------------------------------------


@pytest.mark.parametrize('value', [0.0, 10.0])
def test_a_set_point_that_waits_for_a_slow_line_has_not_failed(value: float) -> None:
    # one round of set-points takes longer than lost_after
    with Rig('described', drives=16, line={'baud': 2400}, lost_after=0.5) as rig:
        rig.turn()
        rig.send(value)
        rig.pass_time(5.0)
        for address, drive in rig.drives.items():
            assert drive.following, rig.notes_of[address].events
            assert abs(rig.fars[address].motor.demand - value) < 0.1
