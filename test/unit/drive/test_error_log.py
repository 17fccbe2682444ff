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


"""The error log and the kWh counter, against the simulated drive's own."""

from __future__ import annotations

import math

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import SCMD
from drive_rig import MakeRig
from drive_rig import Rig
import pytest
from support.said import said

from nfo_sinus_driver.simulator.faults import LogEntry


def fill(rig: Rig, count: int) -> None:
    """Put entries into the drive's log, the newest first, one an hour."""
    with rig.simulator.lock:
        rig.far.faults.log[:] = [LogEntry(1 + n % 12, 1234.0 - n) for n in range(count)]


def test_an_empty_log(rig: Rig) -> None:
    rig.connect()
    assert rig.drive.error_log().result(PATIENCE) == ()


@pytest.mark.parametrize('count', [1, 3, 32])
def test_newest_first_with_text_and_age(rig: Rig, count: int) -> None:
    rig.connect()
    fill(rig, count)
    entries = rig.drive.error_log().result(PATIENCE)
    assert [entry.code for entry in entries] == [1 + n % 12 for n in range(count)]
    assert [entry.operating_time for entry in entries] == [1234.0 - n for n in range(count)]
    assert entries[0].text == 'Par Fail'
    # the drive's hours begin at 1234.5
    assert [entry.age for entry in entries] == pytest.approx(
        [0.5 + n for n in range(count)], abs=0.1
    )


def test_as_many_as_wanted(rig: Rig) -> None:
    rig.connect()
    fill(rig, 10)
    assert len(rig.drive.error_log(4).result(PATIENCE)) == 4
    fill(rig, 32)
    assert len(rig.drive.error_log(1000).result(PATIENCE)) == 32


def test_an_entry_that_comes_in_meanwhile(rig: Rig) -> None:
    rig.connect()
    fill(rig, 5)

    def trip(register: int, words) -> None:
        if register == 0xC000 + 4 * 3:
            rig.tap.before = lambda register, words: None
            with rig.simulator.lock:
                rig.far.faults.log.insert(0, LogEntry(12, 1234.4))

    rig.tap.before = trip
    entries = rig.drive.error_log().result(PATIENCE)
    assert [entry.code for entry in entries] == [12, 1, 2, 3, 4, 5]


def test_a_time_to_come_has_no_age(rig: Rig) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.faults.log[:] = [LogEntry(5, 2000.0)]
    (entry,) = rig.drive.error_log().result(PATIENCE)
    assert math.isnan(entry.age)
    assert str(entry) == '5 Overload at 2000.0 h'


def test_reading_writes_nothing_and_works_in_monitor(make_rig: MakeRig) -> None:
    rig = make_rig(control_method='monitor')
    rig.connect()
    fill(rig, 2)
    assert len(rig.drive.error_log().result(PATIENCE)) == 2
    assert rig.far.command_writes == {} == rig.far.writes


def test_a_motor_that_runs_runs_on(rig: Rig) -> None:
    rig.turn()
    fill(rig, 32)
    assert len(rig.drive.error_log().result(PATIENCE)) == 32
    assert rig.drive.armed and rig.far.motor.driven


def test_the_optimal_has_none_that_is_documented(make_rig: MakeRig) -> None:
    rig = make_rig(model='sinus_optimal')
    rig.connect()
    assert 'not documented' in rig.refused(rig.drive.error_log())


def test_not_connected(make_rig: MakeRig) -> None:
    rig = make_rig()
    for future in (rig.drive.error_log(), rig.drive.erase_error_log(), rig.drive.reset_energy()):
        assert 'is not connected' in rig.refused(future)


@pytest.mark.parametrize('found', [1, 3])
def test_erasing(rig: Rig, found: int) -> None:
    rig.connect()
    fill(rig, 5)
    if found == 3:
        with rig.simulator.lock:
            rig.far.write_raw('fieldbus.mode', 3)
    assert said(rig.drive.erase_error_log().result(PATIENCE)) == 'the error log is erased'
    assert rig.far.faults.log == []
    assert rig.far.control_unit.mode == found
    assert rig.drive.error_log().result(PATIENCE) == ()


def test_a_log_that_is_not_empty_after_all(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.connect()
    fill(rig, 5)

    def immortal(register: int, words) -> None:
        if register == SCMD and words == (0x800,):
            return
        with rig.simulator.lock:
            if not rig.far.faults.log:
                rig.far.faults.log[:] = [LogEntry(5, 1.0)]

    rig.tap.before = immortal
    assert 'not empty' in rig.refused(rig.drive.erase_error_log())


def test_the_energy_counter(rig: Rig) -> None:
    rig.connect()
    assert rig.far.counters.energy > 1
    total = rig.far.counters.total_energy
    answer = said(rig.drive.reset_energy().result(PATIENCE))
    assert answer == 'status.e_out: 1.234 -> 0.000 kWh'
    assert rig.far.counters.energy == 0
    assert rig.far.counters.total_energy == total
    assert rig.far.control_unit.mode == 1


def test_older_firmware_cannot_reset_it(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'fieldbus.sw_ver': 4.37})
    rig.connect()
    message = rig.refused(rig.drive.reset_energy())
    assert 'firmware 4.38' in message and '4.37' in message
    assert rig.writes(SCMD) == rig.writes(MODE) == []


def test_nothing_is_taken_by_a_driver_that_ends(rig: Rig) -> None:
    rig.connect()
    rig.drive.stop_for_good(1.0).result(PATIENCE)
    assert 'is ending' in rig.refused(rig.drive.erase_error_log())
    assert 'is ending' in rig.refused(rig.drive.reset_energy())
    assert rig.far.control_unit.mode == 1


@pytest.mark.parametrize('command', ['erase_error_log', 'reset_energy'])
def test_refused_while_the_motor_is_enabled(rig: Rig, command: str) -> None:
    rig.turn()
    fill(rig, 5)
    assert 'stop it first' in rig.refused(getattr(rig.drive, command)())
    assert rig.drive.armed
    assert not {0x800, 0x900} & set(rig.writes(SCMD))
