# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that answers, but whose status cannot be read."""

from __future__ import annotations

from collections.abc import Collection
import itertools
import math
from typing import Any

import pytest
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.link import Reply

#: How often a drive is polled, s.
_POLL = 0.1
#: How long the frames of a transaction take at most, s.
_FRAMES = 0.1
#: A MOVITRAC may be set to answer so much later (P843), s.
_LATER = 0.2
#: When the set-point 0 comes, before any of the losses, s.
_ZERO_AT = 0.3
#: Functions of Modbus.
_READ, _WRITE_AND_READ = 3, 23
_MEASURED = (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED, Role.ACTUAL_TORQUE)

following = pytest.mark.parametrize(
    'connection', [name for name, kind in CONNECTIONS.items() if kind.reference == 'fieldbus']
)


def function(frame: bytes, protocol: str) -> int:
    """Return the function of Modbus in a request."""
    if protocol == 'modbus_ascii':
        return int(frame[3:5], 16)
    return frame[7] if protocol == 'modbus_tcp' else frame[1]


class Hidden:
    """
    Has answers damaged from now on, and notes when a set-point is written.

    :param keys: the parameters whose readings are damaged.
    :param functions: those of Modbus whose answers are.
    """

    def __init__(self, rig: Rig, keys: Collection[str], functions: Collection[int] = ()) -> None:
        self.written: list[float] = []
        self.begun = rig.clock.now
        protocol = rig.connection.protocol
        # a damaged frame of CAN is no frame
        damaged = 'drop' if protocol == 'canopen' else 'damage'
        places = rig._keys[1]
        setpoints = {places[address[:3]] for address in rig.drive.setpoint._keys}

        def meet(key: str, data: bytes | None) -> str | None:
            if data is not None and key in setpoints:
                self.written.append(rig.clock.now)
            return damaged if data is None and key in keys else None

        rig.meet = meet
        if protocol.startswith('modbus'):
            rig.line.plan = (
                lambda frame: damaged if function(frame, protocol) in functions else None
            )


def hide_status(rig: Rig) -> Hidden:
    """Have each answer damaged that has a status in it; to all else the drive answers."""
    state = rig.drive.state
    hidden = {state.reader.word_key, state.model.key(Role.STATUS_CODE)}
    return Hidden(rig, hidden, {_WRITE_AND_READ})


def hide_block(rig: Rig) -> None:
    """Have each answer of a PLC damaged that has a status and comes to a set-point."""
    combined = rig.link.write_and_read

    def write_and_read(*args: Any) -> Reply:
        rig.line.spoil('damage')
        return combined(*args)

    rig.link.write_and_read = write_and_read  # type: ignore[method-assign]


def hide_reads(rig: Rig) -> Hidden:
    """Have each answer of functions 03 and 23 damaged."""
    return Hidden(rig, (), {_READ, _WRITE_AND_READ})


def timeout(rig: Rig) -> float:
    """How long a request may take, s."""
    later = _LATER if rig.connection.protocol == 'movitrac' else 0.0
    return rig.line.settings.response_timeout + later + _FRAMES


def lost_after(rig: Rig, hidden: Hidden) -> float:
    """Return how soon the drive is reported as lost, s; set-point 0 is given before."""
    rig.pass_time(_ZERO_AT)
    rig.send(0.0)
    rig.wait_until(lambda: rig.notes.said(Cause.LOST_IN_USE), 30.0)
    lost = next(event for event in rig.notes.events if Cause.LOST_IN_USE in event.text.causes)
    return lost.at - hidden.begun


@pytest.mark.parametrize('patience', [0.5, 1.0, 3.0])
@following
def test_it_is_lost_as_soon_as_a_silent_one(connection: str, patience: float) -> None:
    with Rig(connection, lost_after=patience, setpoint_timeout=0.0) as rig:
        rig.turn()
        if rig.line.plc is not None:
            hide_block(rig)
        took = lost_after(rig, hide_status(rig))
        # the first answer that does not come, and the request that is on its way then
        assert took <= patience + _POLL + 2 * timeout(rig)


@pytest.mark.parametrize('patience', [0.5, 1.0, 3.0])
@pytest.mark.parametrize('connection', ['rtu', 'ascii', 'tcp', 'optimal', 'described'])
def test_it_is_lost_as_soon_where_nothing_can_be_read(connection: str, patience: float) -> None:
    with Rig(connection, lost_after=patience, setpoint_timeout=0.0) as rig:
        rig.turn()
        took = lost_after(rig, hide_reads(rig))
        # each read is preceded by one of another kind, which is answered
        assert took <= patience + _POLL + 3 * timeout(rig)


@following
def test_newer_set_points_are_on_the_wire_at_once(connection: str) -> None:
    with Rig(connection, lost_after=8.0, setpoint_timeout=0.0) as rig:
        rig.turn()
        hidden = hide_status(rig)
        rig.pass_time(_ZERO_AT)
        for wanted in (15.0, 10.0, 0.0):
            given = rig.clock.now
            hidden.written.clear()
            rig.send(wanted)
            rig.wait_until(lambda: hidden.written, 5.0)
            assert hidden.written[0] - given <= timeout(rig)
            rig.pass_time(0.5)
            assert rig.far.motor.frequency == pytest.approx(wanted, abs=0.5)
        assert rig.drive.following


@following
def test_a_status_is_read_as_often_while_a_measured_value_cannot_be(connection: str) -> None:
    with Rig(connection, lost_after=3.0, setpoint_timeout=0.0) as rig:
        rig.turn()
        state = rig.drive.state
        status, beside = state.status, state.model.key(state.measurements.turning.role)
        measured = {state.model.key(role) for role in _MEASURED}
        if connection == 'described, by states':
            # the register of its speed has its direction, too
            measured -= {state.model.key(Role.ACTUAL_SPEED)}
        # it is a part of the status
        Hidden(rig, measured if math.isnan(status.frequency) else measured - {beside})
        times: list[float] = []
        rig.looked = lambda: times.append(state.status.at)
        rig.pass_time(4.0)
        seen = sorted(set(times))
        assert max(after - before for before, after in itertools.pairwise(seen)) <= 5 * timeout(rig)
        assert rig.drive.following


def test_a_control_mode_that_cannot_be_read_is_a_loss() -> None:
    with Rig('rtu', lost_after=1.0, setpoint_timeout=0.0) as rig:
        rig.turn()
        hidden = Hidden(rig, {rig.drive.state.model.key(Role.CONTROL_MODE)})
        times: list[float] = []
        rig.looked = lambda: times.append(rig.drive.state.status.at)
        took = lost_after(rig, hidden)
        # it is read once a second
        assert took <= 1.0 + 1.0 + _POLL + 2 * timeout(rig)
        seen = sorted(set(times))
        assert max(after - before for before, after in itertools.pairwise(seen)) <= 4 * timeout(rig)


def test_set_points_of_a_drive_that_is_unplugged_leave_the_line_to_others() -> None:
    with Rig('rtu', drives=4, line={'baud': 19200}, lost_after=5.0, setpoint_timeout=0.0) as rig:
        rig.turn()
        wanted = itertools.cycle((5.0, 6.0, 7.0))
        rig.send(None)
        rig.keep(lambda: rig.drive.set_setpoint(next(wanted)))

        def polls() -> list[int]:
            before = [len(rig.notes_of[address].snapshots) for address in (2, 3, 4)]
            rig.pass_time(4.0)
            after = [len(rig.notes_of[address].snapshots) for address in (2, 3, 4)]
            return [new - old for old, new in zip(before, after, strict=True)]

        usual = polls()
        rig.line.unplug(1)
        assert all(now > before / 2 for now, before in zip(polls(), usual, strict=True))
