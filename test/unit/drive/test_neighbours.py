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

"""Drives that are unplugged, or only stand, leave the line to their neighbours."""

from __future__ import annotations

from line_rig import LineRig
from line_rig import MakeLine
import pytest

#: What the neighbours keep of the rate that they would have alone on the line.
_KEPT = 0.9
#: From when on a drive that is unplugged is asked seldom, s.
_SETTLED = 5.0
#: How much longer than its reads alone the start of many drives may take.
_START = 1.2


def _ride(rig: LineRig) -> None:
    """Enable all drives, and have a program that keeps on sending set-points to each."""
    rig.enable()
    rig.keep(lambda: rig.give_all(20.0))
    rig.pass_time(2.0)


def _alone(
    make_line: MakeLine, count: int, seconds: float, *, ride: bool = False, **settings: object
) -> float:
    """How many statuses of each drive come when they are alone on the line."""
    rig = make_line(count, **settings)
    rig.connect()
    if ride:
        _ride(rig)
    polls = rig.polls(seconds)
    return sum(polls.values()) / count


@pytest.mark.parametrize('protocol', ['modbus_rtu', 'classic'])
@pytest.mark.parametrize(('count', 'gone'), [(8, 2), (16, 4)])
def test_neighbours_keep_their_rate_with_a_quarter_of_the_drives_unplugged(
    make_line: MakeLine, protocol: str, count: int, gone: int
) -> None:
    kept = _alone(make_line, count - gone, 20.0, protocol=protocol)
    rig = make_line(count, protocol=protocol)
    rig.connect()
    missing = range(count - gone + 1, count + 1)
    rig.line.unplugged.update(missing)
    rig.pass_time(_SETTLED)
    polls = rig.polls(30.0)
    for address in range(1, count - gone + 1):
        assert polls[address] / 30.0 >= _KEPT * kept / 20.0
    assert not any(polls[address] for address in missing)
    # and each of them is found again
    rig.line.unplugged.clear()
    rig.pass_time(10.0)
    assert all(drive.snapshot.connected for drive in rig.drives.values())


def test_drives_that_were_unplugged_while_they_ran_take_no_more(make_line: MakeLine) -> None:
    kept = _alone(make_line, 6, 20.0, ride=True)
    rig = make_line(8)
    rig.connect()
    _ride(rig)
    rig.line.unplugged.update((7, 8))
    rig.pass_time(_SETTLED)
    polls = rig.polls(30.0)
    assert all(polls[address] / 30.0 >= _KEPT * kept / 20.0 for address in range(1, 7))
    assert all(rig.drives[address].armed for address in range(1, 7))
    # their stops are not confirmed, and tried on: those that come back are stopped
    assert all(rig.drives[address].stop_unconfirmed for address in (7, 8))
    rig.line.unplugged.clear()
    rig.pass_time(10.0)
    assert not any(rig.drives[address].stop_unconfirmed for address in (7, 8))


def test_a_limited_rate_is_kept_too(make_line: MakeLine) -> None:
    rig = make_line(16, poll_rate=2.0, telemetry_rate=0.0)
    rig.connect()
    before = rig.polls(20.0)
    rig.line.unplugged.update((13, 14, 15, 16))
    rig.pass_time(_SETTLED)
    polls = rig.polls(20.0)
    assert all(polls[address] >= _KEPT * before[address] for address in range(1, 13))


def test_a_stop_of_a_drive_that_is_lost_goes_out_at_once(make_line: MakeLine) -> None:
    rig = make_line(8)
    rig.connect()
    rig.line.unplugged.add(8)
    rig.pass_time(10.0)
    sent = len(rig.line.frames)
    asked_at = rig.clock.now
    stop = rig.drives[8].stop()
    rig.pass_time(0.5)
    stops = [at for at, frame in rig.line.frames[sent:] if frame[0] == 8 and frame[1] == 6]
    # behind the transaction on the line, which may be one without a response
    assert stops and stops[0] - asked_at < 0.3
    assert 'NOT confirmed' in rig.answer(stop)


def test_a_drive_alone_on_its_line_is_asked_as_often_as_before(make_line: MakeLine) -> None:
    rig = make_line(1)
    rig.connect()
    rig.line.unplugged.add(1)
    rig.pass_time(8.0)
    sent = len(rig.line.frames)
    rig.pass_time(20.0)
    # every four seconds, and the time without a response
    assert len(rig.line.frames) - sent >= 4


@pytest.mark.parametrize(
    ('protocol', 'baud'),
    [('modbus_rtu', 57600), ('modbus_rtu', 19200), ('classic', 57600), ('movitrac', 9600)],
)
def test_32_drives_start_in_the_time_of_their_reads(
    make_line: MakeLine, protocol: str, baud: int
) -> None:
    alone = make_line(1, protocol=protocol, baud=baud).start()
    rig = make_line(32, protocol=protocol, baud=baud)
    # nodes are made one after the other
    assert rig.start(apart=0.03) <= _START * 32 * alone


def test_drives_that_stand_are_polled_seldom_while_another_is_read_for_the_first_time(
    make_line: MakeLine,
) -> None:
    rig = make_line(5)
    rig.start(1, 2, 3, 4)
    rig.pass_time(_SETTLED)
    measured = rig.measured()
    reading = rig.drives[5].connect(parameters=True)
    polls = rig.polls(0.8)
    assert not reading.done()
    # what had begun already comes to its end
    assert all(polls[address] <= 2 for address in range(1, 5))
    assert all(rig.measured()[address] - measured[address] <= 1 for address in range(1, 5))
    rig.answer(reading)
    # and then as often as before
    rig.pass_time(2.0)
    measured = rig.measured()
    polls = rig.polls(5.0)
    assert all(polls[address] > 50 for address in range(1, 5))
    assert all(rig.measured()[address] - measured[address] > 1 for address in range(1, 5))


def test_a_drive_that_runs_is_polled_and_measured_as_always_while_another_is_read(
    make_line: MakeLine,
) -> None:
    rig = make_line(3, baud=19200)
    rig.start(1, 2)
    rig.enable(1)
    rig.keep(lambda: rig.drives[1].set_setpoint(20.0))
    rig.pass_time(_SETTLED)
    measured = rig.measured()
    reading = rig.drives[3].connect(parameters=True)
    polls = rig.polls(1.5)
    assert not reading.done()
    assert polls[1] > 10
    assert rig.measured()[1] - measured[1] >= 2
    assert polls[2] <= 2
    # a stop is confirmed and told as always
    asked_at = rig.clock.now
    stop = rig.drives[1].stop()
    rig.polls(0.5)
    assert not reading.done()
    assert 'stop' in rig.answer(stop, 2.0)
    assert rig.clock.now - asked_at < 1.5


def test_a_drive_is_enabled_as_always_while_another_is_read_for_the_first_time(
    make_line: MakeLine,
) -> None:
    rig = make_line(2, baud=1200)
    rig.start(1)
    reading = rig.drives[2].connect(parameters=True)
    rig.pass_time(3.0)
    rig.enable(1)
    rig.keep(lambda: rig.drives[1].set_setpoint(20.0))
    polls = rig.polls(5.0)
    assert not reading.done()
    # a poll takes three transactions, and a set-point goes between
    assert polls[1] >= 5
    assert rig.drives[1].snapshot.frequency > 0


def test_settings_that_are_read_again_slow_nobody(make_line: MakeLine) -> None:
    rig = make_line(2, baud=19200)
    rig.start()
    rig.answer(rig.drives[2].disconnect(1.0))
    rig.pass_time(_SETTLED)
    reading = rig.drives[2].connect(parameters=True)
    polls = rig.polls(1.0)
    assert not reading.done()
    assert polls[1] > 4


def test_a_drive_that_goes_silent_while_it_is_read_slows_nobody(make_line: MakeLine) -> None:
    rig = make_line(2)
    rig.start(1)
    reading = rig.drives[2].connect(parameters=True)
    rig.pass_time(0.5)
    rig.line.unplugged.add(2)
    rig.answer(reading)
    rig.pass_time(_SETTLED)
    assert rig.polls(5.0)[1] > 100


def test_a_drive_that_nobody_finds_slows_nobody(make_line: MakeLine) -> None:
    rig = make_line(2)
    rig.start(1)
    rig.line.unplugged.add(2)
    rig.answer(rig.drives[2].connect(patient=False, parameters=True))
    rig.pass_time(_SETTLED)
    assert rig.polls(5.0)[1] > 100
