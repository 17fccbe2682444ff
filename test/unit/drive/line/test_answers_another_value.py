# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that answers a write with another value than was written: it has that one (law 7)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from support.rig import CONNECTIONS, Connection, Rig
from support.said import says
from support.variants import shipped

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.simulator.modbus import Requests

#: Those whose set-point is one register, written by function 06, whose answer names the value.
_DELTA = shipped('delta_vfd_el')
SINGLE: dict[str, Connection] = {
    'optimal': CONNECTIONS['optimal'],
    'optimal ascii': CONNECTIONS['optimal ascii'],
    'described': CONNECTIONS['described'],
    'described, ascii': Connection('modbus_ascii', _DELTA, 'custom'),
    'described, tcp': Connection('modbus_tcp', _DELTA, 'custom'),
}
every_connection = pytest.mark.parametrize('connection', SINGLE)
#: The greatest set-point that the drive takes, Hz.
_MOST = 10.0


class Clamping:
    """Takes set-points up to a limit, and answers with what it has taken."""

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self.most = float('inf')
        server = rig.far.servers['modbus']
        assert isinstance(server, Requests)
        self._write: Callable[[bytes], bytes] = server._write_single
        server._write_single = self._write_clamped  # type: ignore[method-assign]

    def _write_clamped(self, data: bytes) -> bytes:
        rig = self._rig
        drive = rig.drive
        target = drive.model.profile.setpoints[drive.snapshot.control_mode or 'Freque']
        register = drive.params.address(target.at or target.key).index
        if int.from_bytes(data[:2], 'big') == register:
            _, most = drive.params.target(target.writes(min(self.most, 400.0))[-1])
            limit = int.from_bytes(most, 'big')
            value = min(int.from_bytes(data[2:], 'big'), limit)
            data = data[:2] + value.to_bytes(2, 'big')
        return self._write(data)


def clamp(rig: Rig) -> Clamping:
    """Turn the motor at 5 Hz, and have the drive take no more than 10 from then on."""
    clamping = Clamping(rig)
    rig.turn(5.0)
    rig.asked.clear()
    clamping.most = _MOST
    return clamping


def said_of_others(rig: Rig) -> list[Any]:
    return [
        text for text in (*rig.bus.remarks, *(event.text for event in rig.notes.events))
        if says(text, 'master') or says(text, 'opened again') or says(text, 'gateway')
    ]


@every_connection
def test_the_value_that_it_answers_is_its_set_point(connection: str) -> None:
    with Rig(SINGLE[connection]) as rig:
        clamp(rig)
        opened = len(rig.line.opened)
        rig.send(20.0)
        rig.pass_time(1.5)
        snapshot = rig.drive.snapshot
        assert snapshot.setpoint == pytest.approx(_MOST, abs=0.1)
        assert rig.far.motor.frequency == pytest.approx(_MOST, abs=0.5)
        assert rig.notes.said(Cause.SETPOINT_HELD)
        begun = len(rig.asked)
        rig.pass_time(20.0)
        assert rig.drive.following
        writes = [request for request in rig.asked[begun:] if request[2] is not None]
        assert len(writes) <= 6, 'it is written again as any other'
        assert sum(says(event.text, Cause.SETPOINT_HELD) for event in rig.notes.events) == 1
        assert not said_of_others(rig)
        assert len(rig.line.opened) == opened


@every_connection
def test_a_set_point_that_goes_on_to_change_beyond_it_stops_nothing(connection: str) -> None:
    with Rig(SINGLE[connection]) as rig:
        clamp(rig)
        values = iter(range(10**6))
        rig.keep(lambda: rig.drive.set_setpoint(12.0 + 0.1 * (next(values) % 80)))
        rig.pass_time(10.0)
        assert rig.drive.following
        assert rig.drive.snapshot.setpoint == pytest.approx(_MOST, abs=0.1)
        assert not said_of_others(rig)


@every_connection
def test_what_it_takes_again_is_its_set_point_again(connection: str) -> None:
    with Rig(SINGLE[connection]) as rig:
        clamping = clamp(rig)
        rig.send(20.0)
        rig.pass_time(2.0)
        rig.send(8.0)
        rig.pass_time(1.0)
        assert rig.drive.snapshot.setpoint == pytest.approx(8.0, abs=0.1)
        rig.send(20.0)
        rig.pass_time(2.0)
        assert rig.drive.snapshot.setpoint == pytest.approx(_MOST, abs=0.1)
        clamping.most = 400.0
        # the next time that it is written again
        rig.pass_time(6.0)
        assert rig.drive.snapshot.setpoint == pytest.approx(20.0, abs=0.1)
        assert rig.drive.following


@every_connection
def test_a_late_answer_to_an_earlier_set_point_is_not_what_it_has(connection: str) -> None:
    with Rig(SINGLE[connection]) as rig:
        rig.turn(5.0)
        rig.line.plan = lambda frame: None
        values = iter([7.0, 9.0] * 1000)
        rig.line.state = 'late'
        rig.keep(lambda: rig.drive.set_setpoint(next(values)))
        rig.pass_time(0.8)
        rig.line.mend()
        rig.send(20.0)
        rig.pass_time(1.0)
        assert not rig.notes.said(Cause.SETPOINT_HELD)
