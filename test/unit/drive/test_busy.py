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


"""A drive that is busy (Modbus exception 06) has done nothing, and is asked again."""

from __future__ import annotations

import time

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import SCMD
from drive_rig import Rig
from drive_rig import wait_until

from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.link import Words

ACCEL = 0x2B0
FREQUENCY = 0x3FC


class Busy:
    """Has the drive say that it is busy, so many times for each register that was named."""

    def __init__(self, rig: Rig, times: int, *registers: int, writes: bool = False) -> None:
        self._left = dict.fromkeys(registers, times)
        self._writes = writes
        self.said = 0
        rig.tap.before = self

    def __call__(self, register: int, words: Words | None) -> None:
        if self._left.get(register, 0) > 0 and (words is not None or not self._writes):
            self._left[register] -= 1
            self.said += 1
            raise Refused(Refused.BUSY)


def test_a_command_is_given_again(rig: Rig) -> None:
    rig.connect()
    busy = Busy(rig, 2, MODE, SCMD)
    rig.enable()
    assert busy.said == 4
    assert rig.drive.armed
    assert rig.writes(SCMD).count(0x101) == 1


def test_a_value_is_read_again(rig: Rig) -> None:
    rig.connect()
    busy = Busy(rig, 3, 0x2A5, 0x258)
    rig.next_snapshots(5)
    assert busy.said == 6
    assert rig.drive.snapshot.connected
    assert not rig.notes.told('lost')


def test_one_that_is_busy_for_ever_is_told_of(rig: Rig) -> None:
    rig.connect()
    Busy(rig, 10_000, MODE)
    began = time.monotonic()
    assert 'the drive is busy (exception 6)' in rig.refused(rig.drive.enable())
    assert time.monotonic() - began < 10.0


def test_a_stop_is_tried_on(rig: Rig) -> None:
    rig.turn()
    busy = Busy(rig, 3, SCMD)
    assert rig.drive.stop().result(PATIENCE).startswith(('stopping', 'stopped'))
    assert busy.said == 3
    rig.wait_until_still()


def test_a_setpoint_is_written_again(rig: Rig) -> None:
    rig.turn(20.0)
    register = rig.drive._registers.address('status.frq_set').numbers[0]
    busy = Busy(rig, 3, register, writes=True)
    rig.publish(10.0)
    rig.wait_for_frequency(10.0)
    assert busy.said == 3
    assert rig.drive.armed


def test_a_drive_that_takes_no_setpoint_for_long_is_stopped(rig: Rig) -> None:
    rig.turn(20.0)
    register = rig.drive._registers.address('status.frq_set').numbers[0]
    Busy(rig, 10_000, register, writes=True)
    rig.publish(10.0)
    wait_until(lambda: not rig.drive.armed)
    reason = 'refused set-point 10: the drive is busy'
    wait_until(lambda: rig.notes.told(reason, Severity.WARNING))
    rig.tap.before = lambda register, words: None
    rig.wait_until_still()
