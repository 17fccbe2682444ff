# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One impossible value stops no motor and is published by nobody; one that stays is the drive's."""

from __future__ import annotations

from collections.abc import Callable
import math

import pytest
from support.addresses import packed
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.drive import Telemetry
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.link import Reply

#: What the drive cannot have, as its words: no such pattern in table 16, no such code, no such
#: label; 2621.4 Hz, 26214 rpm.
IMPOSSIBLE = {
    'fieldbus.drive_status': (0xFFFF, 0),
    'fieldbus.inv_st': (920,),
    'control.mode': (920,),
    'status.frq_act': (26214,),
    'status.spd_act': (26214,),
}


class Spoiler:
    """Has some reads of a parameter answered with other words."""

    def __init__(self, rig: VirtualRig, key: str, words: tuple[int, ...], times: float) -> None:
        self._register = rig.register(key)
        self._words = words
        self.left = times
        self._read = rig.link.read
        rig.link.read = self._answer  # type: ignore[method-assign]

    def _answer(self, unit: int, address: Address) -> Reply:
        reply = self._read(unit, address)
        if self.left and address.index == self._register:
            self.left -= 1
            return reply._replace(data=packed(*self._words))
        return reply


def published(rig: VirtualRig) -> list[Snapshot]:
    """Every snapshot from now on."""
    told: list[Snapshot] = []
    take: Callable[[Snapshot], None] = rig.notes.on_snapshot

    def keep(snapshot: Snapshot) -> None:
        told.append(snapshot)
        take(snapshot)

    rig.notes.on_snapshot = keep  # type: ignore[method-assign]
    return told


def measured(rig: VirtualRig) -> list[Telemetry]:
    """All telemetry from now on."""
    told: list[Telemetry] = []
    rig.notes.on_telemetry = told.append  # type: ignore[method-assign]
    return told


@pytest.mark.parametrize('key', IMPOSSIBLE)
def test_one_impossible_value_stops_nothing_and_is_not_published(
    make_virtual: MakeVirtual, key: str
) -> None:
    rig = make_virtual()
    rig.ride()
    told = published(rig)
    for _ in range(3):
        spoiler = Spoiler(rig, key, IMPOSSIBLE[key], 1)
        rig.pass_time(1.5)
        assert not spoiler.left
    assert rig.drive.armed
    assert not rig.notes.events
    assert told
    for snapshot in told:
        assert snapshot.connected
        assert snapshot.status is not None
        assert snapshot.status.code != 920
        assert snapshot.status.word is not None and snapshot.status.word != 0xFFFF
        assert snapshot.control_mode == 'Freque'
        assert abs(snapshot.frequency) < 50
        assert abs(snapshot.speed) < 3000


@pytest.mark.parametrize('key', ['status.frq_act', 'status.spd_act'])
def test_a_measured_value_that_stays_impossible_is_nan_and_told_once(
    make_virtual: MakeVirtual, key: str
) -> None:
    rig = make_virtual()
    rig.ride()
    told = published(rig)
    Spoiler(rig, key, IMPOSSIBLE[key], math.inf)
    rig.pass_time(2.0)
    assert rig.drive.armed
    assert len(told) > 10
    name = 'frequency' if key == 'status.frq_act' else 'speed'
    # what was read before, and once more while it is read again
    assert all(math.isnan(getattr(snapshot, name)) for snapshot in told[2:])
    lines = [text for _, grave, text in rig.notes.events if grave is Severity.WARNING]
    assert len(lines) == 1
    assert key in lines[0]


def test_a_code_that_stays_unlisted_is_published_as_it_is(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    told = published(rig)
    Spoiler(rig, 'fieldbus.inv_st', (92,), math.inf)
    rig.pass_time(1.0)
    assert [snapshot.text for snapshot in told[-3:]] == ['Code 92'] * 3
    # the status word says that it runs all the same
    assert rig.drive.armed


def test_a_fault_is_believed_at_once(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.ride()
    asked: list[int] = []
    rig.before = lambda register, words: asked.append(register) if words is None else None
    rig.far.trip(5)
    while rig.drive.armed:
        rig.pass_time(0.001)
    status = (rig.register('fieldbus.drive_status'), rig.register('fieldbus.inv_st'))
    assert sum(register in status for register in asked) <= 5


def test_a_value_that_was_busy_is_measured_again(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(telemetry_rate=5.0)
    rig.ride()
    told = measured(rig)
    rig.be_busy(rig.register('status.dc_link'), 11)
    rig.pass_time(2.0)
    assert any(math.isnan(one.values[Role.DC_LINK_VOLTAGE]) for one in told)
    assert told[-1].values[Role.DC_LINK_VOLTAGE] > 100


@pytest.mark.parametrize('code', [Refused.DEVICE_FAILURE, Refused.ILLEGAL_ADDRESS])
def test_a_value_that_was_refused_once_is_measured_again(
    make_virtual: MakeVirtual, code: int
) -> None:
    rig = make_virtual(telemetry_rate=5.0)
    rig.ride()
    told = measured(rig)
    register, left = rig.register('status.dc_link'), [1]

    def refuse(asked: int, words: object) -> None:
        if asked == register and left[0]:
            left[0] -= 1
            raise Refused(code)

    rig.before = refuse
    rig.pass_time(2.0)
    assert math.isnan(told[0].values[Role.DC_LINK_VOLTAGE])
    assert told[-1].values[Role.DC_LINK_VOLTAGE] > 100


def test_a_value_that_the_drive_does_not_have_is_not_asked_for_ever(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual(telemetry_rate=5.0)
    rig.connect()
    register = rig.register('status.dc_link')
    asked: list[int] = []

    def refuse(wanted: int, words: object) -> None:
        if wanted == register:
            asked.append(wanted)
            raise Refused(Refused.ILLEGAL_ADDRESS)

    rig.before = refuse
    rig.pass_time(4.0)
    assert 2 <= len(asked) <= 4
