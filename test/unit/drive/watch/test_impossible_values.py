# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One impossible value stops no motor and is not published; one that stays is the drive's."""

from __future__ import annotations

import math

import pytest
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Severity, Snapshot
from nfo_sinus_driver.link import Address, Refused, Reply

#: What no drive can have, as each byte of it: no status, code or label; 2621.4 Hz, 26214 rpm.
IMPOSSIBLE = {
    Role.STATUS_WORD: 0xFF, Role.STATUS_CODE: 0xFF, Role.CONTROL_MODE: 0xFF,
    Role.ACTUAL_FREQUENCY: 0x66, Role.ACTUAL_SPEED: 0x66,
}  # fmt: skip
#: The bits of a telegram mean something each, and what a file describes knows few ends; what is
#: read does not depend on how it is commanded.
every_connection = pytest.mark.parametrize(
    'connection',
    [
        connection
        for connection in CONNECTIONS
        if not connection.startswith(('telegram1', 'described'))
        and 'control word' not in connection
    ],
)


class Spoiler:
    """Has reads of a parameter answered with other bytes, so many times or always."""

    def __init__(self, rig: Rig, role: Role, data: int, times: float = math.inf) -> None:
        self._rig = rig
        self.key = rig.drive.params.model.key(role)
        self._data = data
        self.left = times
        self._read = rig.link.read
        rig.link.read = self._answer  # type: ignore[method-assign]

    def _answer(self, unit: int, address: Address, once: bool) -> Reply:
        reply = self._read(unit, address, once)
        if self.left and self._rig.asked[-1][1] == self.key:
            self.left -= 1
            return reply._replace(data=bytes([self._data]) * len(reply.data))
        return reply


def shown(snapshot: Snapshot) -> tuple[object, ...]:
    """Return what does not change while a motor turns steadily."""
    status = snapshot.status
    assert status is not None
    return snapshot.connected, snapshot.control_mode, status.code, status.word, status.driven


@every_connection
def test_one_impossible_value_stops_nothing_and_is_not_published(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.asked.clear()
        rig.pass_time(1.0)
        usual = {shown(snapshot) for snapshot in rig.notes.snapshots[-15:]}
        before = len(rig.notes.snapshots)
        polled = {key for _, key, _ in rig.asked}
        for role, data in IMPOSSIBLE.items():
            spoiler = Spoiler(rig, role, data, 1)
            if spoiler.key in polled:
                rig.pass_time(2.5)
                assert not spoiler.left
            spoiler.left = 0
        found = rig.notes.snapshots[before:]
        assert rig.drive.following
        assert not rig.notes.events
        assert {shown(snapshot) for snapshot in found} <= usual
        assert all(abs(snapshot.frequency) < 50 for snapshot in found)
        tells_speed = rig.drive.model.key(Role.ACTUAL_SPEED)
        assert all(abs(snapshot.speed) < 3000 for snapshot in found if tells_speed)


@every_connection
def test_measured_values_that_stay_impossible_are_nan_and_reported_once(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        measured = (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED)
        spoilers = [Spoiler(rig, role, 0x66) for role in measured if rig.drive.model.key(role)]
        rig.pass_time(1.0)
        before = len(rig.notes.snapshots)
        rig.pass_time(1.0)
        found = rig.notes.snapshots[before:]
        assert rig.drive.following
        assert len(found) > 5
        assert all(
            math.isnan(snapshot.frequency) and math.isnan(snapshot.speed) for snapshot in found
        )
        warned = [event.text for event in rig.notes.events if event.severity is Severity.WARNING]
        assert len(warned) == len(spoilers)
        assert all(any(spoiler.key in text for text in warned) for spoiler in spoilers)


def test_a_code_that_stays_unlisted_is_published_as_it_is() -> None:
    with Rig() as rig:
        rig.turn()
        Spoiler(rig, Role.STATUS_CODE, 0x02)
        rig.pass_time(1.0)
        assert [snapshot.text for snapshot in rig.notes.snapshots[-3:]] == ['Code 514'] * 3
        # the status word says that it runs all the same
        assert rig.drive.following


def test_a_fault_is_believed_at_once() -> None:
    with Rig() as rig:
        rig.turn()
        rig.asked.clear()
        rig.far.trip(5)
        rig.wait_until(lambda: not rig.drive.following)
        status = ('fieldbus.drive_status', 'fieldbus.inv_st')
        assert sum(key in status for _, key, _ in rig.asked) <= 5


def test_a_value_that_was_refused_is_measured_again_unless_the_drive_has_none() -> None:
    with Rig(telemetry_rate=5.0) as rig:
        refused: list[int] = []

        def refuse(key: str, data: bytes | None) -> None:
            if key == 'status.dc_link' and refused:
                rig.line.go_to(rig.clock.now + 0.005)
                raise Refused(refused.pop())

        rig.connect()
        rig.meet = refuse
        for codes in ([Refused.BUSY] * 11, [Refused.DEVICE_FAILURE], [Refused.ILLEGAL_ADDRESS]):
            before = len(rig.notes.telemetry)
            refused += codes
            rig.pass_time(2.0)
            later = rig.notes.telemetry[before:]
            found = [telemetry.values[Role.DC_LINK_VOLTAGE] for telemetry in later]
            assert any(math.isnan(value) for value in found), codes
            assert found[-1] > 100, codes
        refused += [Refused.ILLEGAL_ADDRESS] * 100
        rig.pass_time(4.0)
        assert 96 <= len(refused) <= 98
