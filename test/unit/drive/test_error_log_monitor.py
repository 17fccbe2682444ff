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

"""New entries of the error log, told by a driver that watches it, and when they came."""

from __future__ import annotations

import math
import time

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.addresses import packed
from virtual_rig import MakeVirtual

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import error_log
from nfo_sinus_driver.drive.error_log import OperatingClock
from nfo_sinus_driver.link import Address
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.link import Reply
from nfo_sinus_driver.simulator.faults import LogEntry

LOG = 0xC000
#: Where the drive's hours begin.
HOURS = 1234.5


def connect(rig: Rig) -> None:
    """Connect, and wait until the log was looked at."""
    rig.connect()
    wait_until(lambda: rig.drive._error_log_monitor._known is not None)


def trip(rig: Rig, code: int = 5, *, acknowledge: bool = False) -> None:
    """Have a fault come, and go at once as if somebody acknowledged it between two polls."""
    with rig.simulator.lock:
        rig.far.trip(code)
        if acknowledge:
            rig.far.faults.acknowledge()
            rig.far._settle()


def look(rig: Rig) -> None:
    """Have the log looked at now, as it is now and then without a fault."""
    rig.bus.call(lambda: rig.bus.wake(rig.drive._error_log_monitor._task))


def told(rig: Rig, count: int = 1) -> list:
    wait_until(lambda: len(rig.notes.entries) >= count)
    return rig.notes.entries


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control', 'monitor'])
def test_the_entry_of_a_fault_is_told(make_rig: MakeRig, method: str) -> None:
    rig = make_rig(control_method=method)
    connect(rig)
    began = time.monotonic()
    trip(rig)
    (entry,) = told(rig)
    assert (entry.code, entry.text, entry.operating_time) == (5, 'Overload', HOURS)
    assert began <= entry.at <= time.monotonic()
    rig.notes.wait_for('error log: 5 Overload at 1234.5 h', Severity.INFO)
    assert rig.drive.last_error == entry
    # and who asks for the log is told the same
    assert rig.drive.error_log().result(PATIENCE)[0].at == entry.at
    rig.next_snapshots(20)
    assert rig.notes.entries == [entry]
    assert rig.far.control_unit.ack_reads == 0
    if method == 'monitor':
        assert rig.far.command_writes == {} == rig.far.writes


def test_the_motor_is_stopped_first(rig: Rig) -> None:
    rig.turn()
    wait_until(lambda: rig.drive._error_log_monitor._known is not None)
    trip(rig)
    told(rig)
    reads = [
        number
        for number, frame in enumerate(rig.trace())
        if frame['direction'] == 'request' and bytes.fromhex(frame['hex'])[1:4] == b'\x03\xc0\x00'
    ]
    stops = [
        number
        for number, frame in enumerate(rig.trace())
        if bytes.fromhex(frame['hex'])[1:6] == b'\x06\x02\x98\x00\x00'
    ]
    assert min(stops) < reads[-1]
    wait_until(lambda: not rig.drive.armed)


def test_what_is_older_than_the_driver_is_no_news(rig: Rig) -> None:
    with rig.simulator.lock:
        rig.far.faults.log[:] = [LogEntry(3, 1200.0), LogEntry(4, 1100.0)]
    connect(rig)
    assert rig.drive.last_error is not None and rig.drive.last_error.code == 3
    trip(rig, 12)
    told(rig)
    assert [entry.code for entry in rig.notes.entries] == [12]
    assert not any(grave is Severity.WARNING for grave, text in rig.notes.events if 'log' in text)


def test_a_fault_that_stands_already_is_told_but_nobody_knows_since_when(rig: Rig) -> None:
    trip(rig)
    rig.connect()
    (entry,) = told(rig)
    assert entry.code == 5
    assert math.isnan(entry.at)
    assert entry.wall_time.endswith(' or before')


def test_a_fault_that_no_poll_saw(rig: Rig) -> None:
    connect(rig)
    began = time.monotonic()
    with rig.simulator.lock:
        for code in (7, 8):
            rig.far.faults.trip(code, rig.far.counters.operating_time, cause_present=False)
        rig.far.faults.acknowledge()
    look(rig)
    entries = told(rig, 2)
    # the older one first
    assert [entry.code for entry in entries] == [7, 8]
    assert all(began - 1 < entry.at <= time.monotonic() for entry in entries)
    rig.notes.wait_for('8 DC High at 1234.5 h', Severity.WARNING)


def test_the_same_fault_twice_within_a_tick_is_told_twice(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(error_log, '_SOON', 0.0)
    connect(rig)
    trip(rig)
    told(rig)
    wait_until(lambda: rig.drive.snapshot.text == 'Overload')
    with rig.simulator.lock:
        rig.far.faults.acknowledge()
        rig.far._settle()
    wait_until(lambda: rig.drive.snapshot.text != 'Overload')
    trip(rig)
    first, second = told(rig, 2)
    assert first.operating_time == second.operating_time
    assert second.at > first.at
    entries = rig.drive.error_log().result(PATIENCE)
    assert [entry.at for entry in entries] == [second.at, first.at]


def test_a_drive_that_writes_its_log_late(rig: Rig) -> None:
    connect(rig)
    with rig.simulator.lock:
        rig.far.trip(5)
        late = list(rig.far.faults.log)
        rig.far.faults.log.clear()
    wait_until(lambda: rig.drive._error_log_monitor._tries < error_log._TRIES)
    assert rig.notes.entries == []
    with rig.simulator.lock:
        rig.far.faults.log[:] = late
    (entry,) = told(rig)
    assert entry.code == 5 and not math.isnan(entry.at)


def test_what_came_while_the_drive_was_not_reached(
    rig: Rig, hasty: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(error_log, '_PERIOD', 0.1)
    monkeypatch.setattr(error_log, '_WAIT', 0.05)
    connect(rig)
    with rig.simulator.lock:
        rig.far.power_cycle(3600.0)
        rig.far.faults.log.insert(0, LogEntry(7, HOURS))
        # a day later, of which the drive knows nothing
        rig.far.counters.operating_time += 0.001
    rig.set_response_timeout(0.05)
    wait_until(lambda: not rig.drive.snapshot.connected)
    rig.set_response_timeout(2.0)
    rig.drive._error_log_monitor._looked_at = -math.inf
    rig.boot()
    (entry,) = told(rig)
    assert entry.code == 7
    assert math.isnan(entry.at)


def test_a_drive_that_has_no_log_is_asked_once(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(error_log, '_PERIOD', 0.0)
    asked = []

    def refuse(register: int, words) -> None:
        if register >= LOG:
            asked.append(register)
            raise Refused(Refused.ILLEGAL_ADDRESS)

    rig.tap.before = refuse
    rig.connect()
    rig.notes.wait_for(Cause.LOG_NOT_WATCHED)
    rig.next_snapshots(20)
    assert asked == [LOG]
    assert rig.drive.snapshot.connected


def test_the_optimal_is_not_asked(make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(error_log, '_PERIOD', 0.0)
    rig = make_rig(model='sinus_optimal')
    asked = []
    rig.tap.before = lambda register, words: asked.append(register)
    rig.connect()
    trip(rig)
    wait_until(lambda: rig.drive.snapshot.text == 'Overload')
    rig.next_snapshots(10)
    assert max(asked) < LOG
    assert rig.drive.last_error is None


# --- the clock ----------------------------------------------------------------------------------


def cut(hours: float) -> float:
    """The operating time as a drive shows it."""
    return math.floor(hours * 10 + 1e-6) / 10


@given(
    start=st.floats(0, 1e5),
    steps=st.lists(st.floats(1.0, 7200.0), min_size=1, max_size=40),
    when=st.floats(0, 1),
)
def test_a_drive_with_power_all_the_time(start: float, steps: list[float], when: float) -> None:
    clock = OperatingClock()
    at = 1000.0
    clock.note(cut(start), at)
    for step in steps:
        at += step
        clock.note(cut(start + (at - 1000.0) / 3600), at)
    assert clock.since == cut(start)
    moment = 1000.0 + when * (at - 1000.0)
    hours = cut(start + (moment - 1000.0) / 3600)
    mapped = clock.moment(hours)
    if hours == clock.since:
        assert math.isnan(mapped)
    else:
        assert mapped == pytest.approx(moment, abs=400.0)


@given(start=st.floats(0, 1e5), off=st.floats(0.25, 1e4), on=st.floats(0.15, 100.0))
def test_a_drive_that_was_off(start: float, off: float, on: float) -> None:
    clock = OperatingClock()
    clock.note(cut(start), 0.0)
    later = start + on
    clock.note(cut(later), (off + on) * 3600)
    assert clock.since == cut(later)
    assert math.isnan(clock.moment(cut(start + 0.1)))


def test_many_readings_are_finer_than_a_tick() -> None:
    clock = OperatingClock()
    for second in range(0, 1000, 10):
        clock.note(cut(50.0 + second / 3600), float(second))
    # hour 50.1 begins at 360 s, and lasts for 360 s
    assert clock.moment(50.1) == pytest.approx(540.0, abs=10.0)


def test_before_the_first_reading_nothing_is_known() -> None:
    assert math.isnan(OperatingClock().moment(1.0))


def test_an_operating_time_that_cannot_be_does_not_end_the_watch(
    make_virtual: MakeVirtual, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make_virtual()
    rig.connect()
    rig.pass_time(3.0)
    read, hours = rig.link.read, rig.register('status.op_time')

    def absurd(unit: int, address: Address) -> Reply:
        reply = read(unit, address)
        if address.index != hours:
            return reply
        return Reply(packed(0xFFFF, 0x7FFF), reply.arrived)

    monkeypatch.setattr(rig.link, 'read', absurd)
    # nobody looked for long, so that only the hours tell when the entry came
    rig.drive._error_log_monitor._looked_at = -math.inf
    for code, name in ((5, 'Overload'), (1, 'Par Fail')):
        rig.far.trip(code)
        rig.far.end_fault_causes()
        rig.far.faults.acknowledge()
        rig.pass_time(31.0)
        assert rig.said(f'error log: {code} {name} at 1234.5 h')
        assert not rig.said('or before')
    # nor is there anything in the way of who asks for the log
    log = rig.drive.error_log()
    rig.answer(log)
    assert [str(entry).split(' at ')[0] for entry in log.result()] == ['1 Par Fail', '5 Overload']
