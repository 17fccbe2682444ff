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

"""
Noise is waited out: nothing is stopped by it that answers again within ``lost_after``.

Over a real link in virtual time, so that what the link believes counts too.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator

from noise_rig import Kind
from noise_rig import NoiseRig
from noise_rig import modbus_rtu
from noise_rig import movitrac
import pytest

MakeNoise = Callable[..., NoiseRig]

_MINUTES = 10 * 60.0
#: How often the status is polled, Hz: enough for some 20 000 requests in all that time.
_POLLS_ALONE = {'poll_rate': 5.0, 'telemetry_rate': 0.0}
#: A MOVITRAC is the hardest to follow where its status says Enable all the time.
LINES = {
    'modbus 57600': modbus_rtu(57600),
    'modbus 19200': modbus_rtu(19200),
    'movitrac': movitrac(stop_status='enable', status_numbers='bcd', timeout_stop='ramps'),
}
_each_line = pytest.mark.parametrize('line', LINES.values(), ids=LINES)


@pytest.fixture
def make_noise() -> Iterator[MakeNoise]:
    """Makes a rig, as often as it is asked for; the one before ends."""
    rigs: list[NoiseRig] = []

    def end() -> None:
        while rigs:
            rigs.pop().close()

    def make(line: Kind | None = None, **settings: float) -> NoiseRig:
        end()
        rigs.append(NoiseRig(line, **settings))
        return rigs[-1]

    yield make
    end()


@_each_line
@pytest.mark.slow
def test_three_per_cent_of_damaged_answers_stop_nothing(make_noise: MakeNoise, line: Kind) -> None:
    rig = make_noise(line, seed=line.settings.baud_rate, drive_timeout=1.5, **_POLLS_ALONE)
    rig.ride()
    rig.line.damage = 0.03
    rig.pass_time(_MINUTES)
    assert not rig.ends
    assert rig.drive.armed
    assert not rig.far.faults


@_each_line
@pytest.mark.slow
def test_ten_per_cent_of_damaged_answers_stop_at_most_once(
    make_noise: MakeNoise, line: Kind
) -> None:
    rig = make_noise(line, seed=line.settings.baud_rate, drive_timeout=1.5, **_POLLS_ALONE)
    rig.ride()
    rig.line.damage = 0.1
    stops = 0
    end = rig.clock.now + _MINUTES
    while rig.clock.now < end:
        rig.pass_time(10.0)
        if rig.ends:
            stops += 1
            rig.line.damage = 0.0
            rig.pass_time(3.0)
            rig.enable()
            rig.line.damage = 0.1
    assert stops <= 1


@_each_line
@pytest.mark.parametrize('length', [0.3, 0.8, 0.99])
def test_a_burst_shorter_than_lost_after_stops_nothing(
    make_noise: MakeNoise, line: Kind, length: float
) -> None:
    # the time-out of the drive itself is the shortest there may be
    rig = make_noise(line, drive_timeout=1.5)
    rig.ride()
    for number in range(20):
        # at another moment of the round each time
        begin = rig.clock.now + 0.1 + 0.0077 * number
        rig.line.bursts = [(begin, begin + length)]
        rig.pass_time(2.0)
        assert not rig.ends
        assert rig.drive.armed
        assert not rig.far.faults


@pytest.mark.parametrize('length', [0.05, 0.1, 0.2, 0.4, 0.7, 1.0])
@_each_line
def test_after_a_burst_the_first_request_goes_out_and_the_first_status_comes_at_once(
    make_noise: MakeNoise, line: Kind, length: float
) -> None:
    rig = make_noise(line, drive_timeout=2.0)
    rig.ride()
    for number in range(12):
        begin = rig.clock.now + 0.1 + 0.0117 * number
        end = begin + length
        rig.line.bursts = [(begin, end)]
        rig.pass_time(length + 2.0)
        asked = min(at for at in rig.line.sent if at >= end)
        told = min(at for at, _ in rig.notes.published if at >= asked)
        assert asked - end <= line.wait + 0.05
        assert told - asked <= 0.2
        assert not rig.ends


def test_a_drive_that_is_lost_is_asked_again_before_its_own_time_out_strikes(
    make_noise: MakeNoise
) -> None:
    rig = make_noise(drive_timeout=2.5)
    rig.ride()
    for number in range(10):
        begin = rig.clock.now + 0.1 + 0.003 * number
        rig.line.bursts = [(begin, begin + 2.2)]
        rig.pass_time(5.0)
        assert rig.ends and rig.ends[0].startswith('lost: ')
        assert not rig.far.faults
        rig.enable()


def test_without_an_answer_it_is_lost_after_the_time_set(make_noise: MakeNoise) -> None:
    for lost_after in (0.5, 1.0, 3.0):
        rig = make_noise(lost_after=lost_after)
        rig.ride()
        begin = rig.clock.now
        rig.line.bursts = [(begin, begin + 10.0)]
        rig.pass_time(lost_after + 1.0)
        (lost_at,) = [at for at, _, text in rig.notes.events if text.startswith('lost: ')]
        # from the first answer that is missing to the end of the request that is under way then
        assert lost_after + 0.2 <= lost_at - begin <= lost_after + 0.45
        assert not rig.drive.armed


def test_one_damaged_answer_in_each_round_is_no_loss(make_noise: MakeNoise) -> None:
    # 81 of 84 requests were answered, and the drive was "lost"
    rig = make_noise(setpoint_timeout=0.0)
    rig.ride()
    frequency, speed = rig.register('status.frq_act'), rig.register('status.spd_act')
    asked: list[int] = []
    spoiled = [0]

    def spoil(frame: bytes) -> bytes | None:
        register = int.from_bytes(frame[2:4], 'big')
        if frame[1] == 3 and register in (frequency, speed):
            asked.append(register)
        # the speed of each round, but not when that one read is repeated
        if asked[-2:] == [frequency, speed] and register == speed:
            spoiled[0] += 1
            return b'\x01\x03\x02\x00\x00\xff\xff'
        return None

    rig.line.meet = spoil
    before = len(rig.notes.published)
    rig.pass_time(6.0)
    assert spoiled[0] > 10
    assert not rig.ends
    # and each round was told, with the speed
    told = [snapshot for _, snapshot in rig.notes.published[before:]]
    assert len(told) >= spoiled[0] - 1
    assert all(snapshot.speed == snapshot.speed for snapshot in told)


@pytest.mark.parametrize('key', ['status.frq_act', 'fieldbus.inv_st'])
def test_one_read_that_never_comes_whole_leaves_no_motor_unwatched(
    make_noise: MakeNoise, key: str
) -> None:
    rig = make_noise()
    rig.ride()
    register = rig.register(key)
    spoilt = b'\x01\x03\x02\x00\x00\xff\xff'
    rig.line.meet = lambda frame: (
        spoilt if frame[1] == 3 and int.from_bytes(frame[2:4], 'big') == register else None
    )
    # all else is answered, so it is never silent
    rig.pass_time(0.3)
    rig.send(0.0)
    rig.pass_time(5.0)
    assert abs(rig.far.motor.frequency) < 0.2
    rig.send(20.0)
    rig.far.trip(3)
    rig.pass_time(5.0)
    assert not rig.drive.armed


def test_a_stop_that_is_never_answered_leaves_the_line_to_others_too(make_noise: MakeNoise) -> None:
    rig = make_noise()
    rig.ride()
    # none of its steps is
    rig.line.meet = lambda frame: b'\x00\x11' if frame[1] in (6, 16) else None
    stop = rig.drive.stop()
    rig.pass_time(3.0)
    assert stop.exception() is not None
    polls = len(rig.notes.published)
    rig.pass_time(5.0)
    assert len(rig.notes.published) >= polls + 5
    rig.line.meet = lambda frame: None
    rig.pass_time(1.0)
    assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('poll_rate', [0.2, 0.5, 2.0])
def test_a_drive_that_is_seldom_asked_is_not_lost_for_that(
    make_noise: MakeNoise, poll_rate: float
) -> None:
    rig = make_noise(poll_rate=poll_rate, telemetry_rate=0.0)
    rig.answer(rig.drive.connect())
    rig.drive.activate()
    rig.pass_time(0.3)
    rig.notes.events.clear()
    for number in range(8):
        # some of them take a poll, others none
        begin = rig.clock.now + 0.11 * number
        rig.line.bursts = [(begin, begin + 0.7)]
        rig.pass_time(7.0)
    assert not rig.ends
    # silence is another thing, and counts from the first request without an answer
    begin = rig.clock.now
    rig.line.bursts = [(begin, begin + 60.0)]
    rig.pass_time(1 / poll_rate + 1.5)
    assert len(rig.ends) == 1
