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

"""A connection that stays open and mute: another one is opened beside it, and stops the motor."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from support.said import says
from tcp_rig import TcpRig

from nfo_sinus_driver.drive import Cause


@pytest.fixture
def rig() -> Iterator[TcpRig]:
    rig = TcpRig()
    rig.run()
    yield rig
    rig.close()


def test_the_motor_is_stopped_by_another_connection(rig: TcpRig) -> None:
    old = rig.gateway.sessions[-1]
    old.mute = True
    rig.pass_time(1.5 + rig.settings.lost_after)
    assert rig.far.motor.frequency == 0
    assert len(rig.gateway.sessions) == 2
    assert any(says(text, Cause.LOST_IN_USE) for _, _, text in rig.notes.events)
    assert rig.drive.snapshot.connected
    assert rig.bus.statistics().reconnects == 1


def test_what_the_mute_connection_has_never_arrives_later(rig: TcpRig) -> None:
    old = rig.gateway.sessions[-1]
    old.mute = True
    rig.pass_time(1.5 + rig.settings.lost_after)
    count = len(old.requests)
    old.heal()
    rig.pass_time(1.0)
    assert len(old.requests) == count
    assert rig.far.motor.frequency == 0


def test_a_connection_that_answers_again_is_kept(rig: TcpRig) -> None:
    old = rig.gateway.sessions[-1]
    old.mute = rig.gateway.lost = True
    rig.pass_time(0.5 + rig.settings.lost_after)
    assert len(rig.gateway.sessions) == 2
    old.heal()
    rig.pass_time(3.0)
    assert rig.drive.snapshot.connected
    assert rig.gateway.sessions[-1]._is_closed and not old._is_closed


@pytest.mark.parametrize('how', ['lost', 'refuses'])
def test_the_motor_stops_as_soon_as_a_connection_can_be_made(rig: TcpRig, how: str) -> None:
    rig.gateway.sessions[-1].mute = True
    setattr(rig.gateway, how, True)
    rig.pass_time(6.0)
    assert rig.far.motor.frequency > 0
    setattr(rig.gateway, how, False)
    rig.pass_time(2.0)
    assert rig.far.motor.frequency == 0


def test_the_thread_of_the_line_is_free_while_it_connects(rig: TcpRig) -> None:
    rig.gateway.sessions[-1].mute = rig.gateway.lost = True
    rig.pass_time(2.0 + rig.settings.lost_after)
    steps = []
    rig.bus.call(lambda: steps.append(rig.clock.now))
    before = rig.clock.now
    rig.pass_time(0.3)
    assert steps and steps[0] - before < 0.25


def test_the_stop_at_exit_takes_another_connection(rig: TcpRig) -> None:
    rig.gateway.sessions[-1].mute = True
    rig.send(None)
    rig.answer(rig.drive.disconnect(rig.settings.shutdown_timeout))
    rig.pass_time(0.5)
    assert rig.far.motor.frequency == 0
    assert len(rig.gateway.sessions) == 2


@pytest.mark.parametrize('settings', [{}, {'lost_after': 3.0}])
def test_a_drive_that_is_silent_to_its_gateway_takes_no_connection(
    settings: dict[str, Any]
) -> None:
    rig = TcpRig(**settings)
    rig.run()
    rig.gateway.answer = lambda message: message[:1] + bytes((message[1] | 0x80, 11))
    rig.pass_time(10.0)
    assert len(rig.gateway.sessions) == 1
    rig.close()
