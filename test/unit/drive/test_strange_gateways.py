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

"""What a gateway does that no gateway should: it is said in words, with what to do."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from tcp_rig import TcpRig


@pytest.fixture
def rig() -> Iterator[TcpRig]:
    rig = TcpRig()
    yield rig
    rig.close()


def complaint(rig: TcpRig) -> str:
    """What the driver says of a drive that it cannot connect to."""
    return rig.answer(rig.drive.connect())


@pytest.mark.parametrize('number', [lambda number: 0, lambda number: number ^ 0x100])
def test_another_transaction_number_is_said(rig: TcpRig, number: object) -> None:
    rig.gateway.number = number  # type: ignore[assignment]
    text = complaint(rig)
    assert 'transaction number' in text and 'update or replace the gateway' in text
    assert 'response_timeout' not in text


def test_another_unit_is_said(rig: TcpRig) -> None:
    right = rig.gateway.answer
    rig.gateway.answer = lambda message: b'\xff' + right(message)[1:]
    text = complaint(rig)
    assert 'as unit 255 and not as unit 1' in text and 'baud rate' not in text


def test_a_gateway_that_closes_after_each_answer_is_used_all_the_same(rig: TcpRig) -> None:
    rig.gateway.closes = True
    rig.run()
    assert rig.drive.armed
    (remark,) = rig.bus.remarks
    assert 'closes the connection after each answer' in remark and 'settings' in remark
    rig.pass_time(5.0)
    assert rig.drive.armed and rig.far.motor.frequency > 19
    rig.answer(rig.drive.stop())
    rig.pass_time(1.0)
    assert rig.far.motor.frequency == 0


def test_a_connection_that_is_closed_once_is_no_habit(rig: TcpRig) -> None:
    rig.run()
    rig.gateway.closes = True
    rig.pass_time(0.06)
    rig.gateway.closes = False
    rig.pass_time(5.0)
    assert rig.bus.remarks == ()
    sessions = len(rig.gateway.sessions)
    rig.pass_time(2.0)
    assert len(rig.gateway.sessions) == sessions and rig.drive.snapshot.connected
