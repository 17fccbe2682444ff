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

"""What a poll reads each time, what it reads now and then, and when that has to be read at once."""

from __future__ import annotations

from collections import Counter
import dataclasses
import itertools

from any_order_rig import Notes
from neighbour import neighbour
import pytest
from support.addresses import register
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.simulator.sinus.control_unit import NOTHING

STATUS, INV_ST, FREQUENCY, SPEED, TORQUE = 0x258, 0x2A5, 0x400, 0x264, 0x40C
OVERLOAD = 5
#: What a user may see late at most, s.
LATEST = 0.2


class Kept(Notes):
    """Keeps all snapshots, and when each came."""

    def __init__(self, rig: VirtualRig) -> None:
        super().__init__(rig.clock)
        self.told: list[tuple[float, Snapshot]] = []

    def on_snapshot(self, snapshot: Snapshot) -> None:
        super().on_snapshot(snapshot)
        self.told.append((self._clock.now, snapshot))


def keep(rig: VirtualRig) -> Kept:
    """Keep the snapshots from now on."""
    kept = Kept(rig)
    kept.snapshot = rig.notes.snapshot
    rig.drive.inverter.listener = rig.notes = kept
    return kept


def reads(rig: VirtualRig, begun: int = 0) -> Counter[int]:
    """How often each register was read since so many frames."""
    frames = [bytes.fromhex(one['hex']) for one in rig.link.frames[begun:]]
    return Counter(int.from_bytes(one[2:4], 'big') for one in frames if one[1] == 3)


def fast(make_virtual: MakeVirtual, **settings: object) -> VirtualRig:
    """A drive that is polled as fast as the line allows."""
    return make_virtual(
        variant={'refuses_in_fault': NOTHING},
        poll_rate=0.0,
        telemetry_rate=0.0,
        **settings,
    )


def full_line(rig: VirtualRig) -> None:
    """Let as many others be read as a full line has."""
    voltage = register(rig.register('status.u_rms'))
    for _ in range(31):
        rig.bus.run(neighbour(rig.bus, voltage))


def per_poll(rig: VirtualRig, seconds: float) -> float:
    """How many transactions there are for one status."""
    begun = len(rig.link.frames)
    rig.pass_time(seconds)
    return (len(rig.link.frames) - begun) / reads(rig, begun)[STATUS]


@pytest.mark.parametrize('runs', [False, True], ids=['stands', 'runs'])
def test_a_poll_takes_two_transactions_in_place_of_four(
    make_virtual: MakeVirtual, runs: bool
) -> None:
    rig = fast(make_virtual)
    if runs:
        rig.ride()
    else:
        rig.connect()
    assert per_poll(rig, 5.0) <= 0.60 * 4


def test_a_poll_takes_two_transactions_on_a_full_line_too(make_virtual: MakeVirtual) -> None:
    rig = fast(make_virtual)
    rig.ride()
    voltage = rig.register('status.u_rms')
    full_line(rig)
    rig.pass_time(2.0)
    begun = len(rig.link.frames)
    rig.pass_time(30.0)
    asked = reads(rig, begun)
    ours = sum(asked.values()) - asked[voltage]
    assert ours / asked[STATUS] <= 0.60 * 4
    assert asked[SPEED] >= asked[STATUS] / 8
    assert asked[INV_ST] >= asked[STATUS] / 8


@pytest.mark.parametrize(
    ('mode', 'every', 'others'),
    [
        ('Freque', FREQUENCY, (SPEED,)),
        ('Speed', SPEED, (FREQUENCY,)),
        ('Torque', TORQUE, (FREQUENCY, SPEED)),
    ],
)
def test_what_the_control_mode_is_about_is_measured_with_every_poll(
    make_virtual: MakeVirtual, mode: str, every: int, others: tuple[int, ...]
) -> None:
    rig = fast(make_virtual, parameters={'control.mode': mode})
    rig.connect()
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.send(10.0 if mode == 'Torque' else 600.0 if mode == 'Speed' else 20.0)
    rig.pass_time(1.0)
    begun = len(rig.link.frames)
    kept = keep(rig)
    rig.pass_time(2.0)
    asked = reads(rig, begun)
    assert abs(asked[every] - len(kept.told)) <= 1
    for other in others:
        assert 2.0 / LATEST <= asked[other] < len(kept.told) / 3


def test_the_slow_values_are_never_old(make_virtual: MakeVirtual) -> None:
    rig = fast(make_virtual)
    rig.ride()
    kept = keep(rig)
    rig.send(40.0)
    rig.pass_time(2.0)
    assert rig.answer(rig.drive.stop()).startswith('stop')
    rig.pass_time(2.0)
    for at, snapshot in kept.told:
        assert snapshot.status is not None
        assert at - snapshot.speed_at < LATEST
        assert at - snapshot.frequency_at < LATEST
        assert at - snapshot.status.code_at < LATEST


def test_a_motor_that_comes_to_a_stop_is_told_to_stand_in_both_units_at_once(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual(poll_rate=5.0, parameters={'control.mode': 'Speed'})
    rig.connect()
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.send(600.0)
    rig.pass_time(1.0)
    rig.send(None)
    # where a turn takes long
    full_line(rig)
    rig.drive.stop()
    kept = keep(rig)
    rig.pass_time(10.0)
    stands = [snapshot for _, snapshot in kept.told if snapshot.speed == 0]
    assert stands
    assert all(snapshot.frequency == 0 for snapshot in stands)


@pytest.mark.parametrize('rate', [0.0, 20.0, 5.0, 0.5])
def test_a_speed_is_told_at_any_poll_rate(make_virtual: MakeVirtual, rate: float) -> None:
    rig = make_virtual(poll_rate=rate)
    rig.ride()
    kept = keep(rig)
    rig.pass_time(6.0)
    measured = {snapshot.speed_at for _, snapshot in kept.told}
    assert len(measured) >= min(6 * rate or 30, 30) - 1


def test_the_standstill_of_the_shaft_is_told_at_once(make_virtual: MakeVirtual) -> None:
    rig = fast(make_virtual)
    rig.ride()
    rig.send(None)
    rig.drive.stop()
    kept = keep(rig)
    while rig.far.motor.driven:
        rig.pass_time(0.01)
    rig.pass_time(LATEST)
    snapshot = kept.told[-1][1]
    assert abs(snapshot.speed) < 1
    assert abs(snapshot.frequency) < 0.1


def test_another_status_word_is_never_told_with_an_older_inverter_status(
    make_virtual: MakeVirtual,
) -> None:
    rig = fast(make_virtual)
    rig.ride()
    kept = keep(rig)
    rig.send(40.0)
    rig.pass_time(1.0)
    rig.far.trip(OVERLOAD)
    rig.pass_time(1.0)
    assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.pass_time(1.0)
    rig.answer(rig.drive.stop())
    rig.pass_time(1.0)
    statuses = [one.status for _, one in kept.told if one.status is not None]
    changes = 0
    for before, now in itertools.pairwise(statuses):
        if now.word != before.word:
            changes += 1
            assert now.code_at > before.at
    assert changes > 5
    first = next(one for _, one in kept.told if one.kind is Kind.FAULT)
    assert first.status is not None
    assert first.status.code == OVERLOAD


def test_an_alarm_is_read_again_with_every_poll(make_virtual: MakeVirtual) -> None:
    rig = fast(make_virtual)
    rig.ride()
    rig.far.motor.load = 6.0
    rig.pass_time(0.2)
    assert rig.far.motor.limited
    begun = len(rig.link.frames)
    rig.pass_time(0.5)
    asked = reads(rig, begun)
    assert abs(asked[INV_ST] - asked[STATUS]) <= 1


@pytest.mark.parametrize('what', ['starts', 'ramps to a stop'])
def test_what_is_on_its_way_is_read_with_every_poll(make_virtual: MakeVirtual, what: str) -> None:
    rig = fast(make_virtual, parameters={'control.retard': 5.0, 'control.run_dly': 1})
    rig.connect()
    if what == 'starts':
        enabled = rig.drive.enable()
        rig.pass_time(0.3)
        assert not enabled.done()
    else:
        assert 'enabled' in rig.answer(rig.drive.enable())
        rig.send(40.0)
        rig.pass_time(1.0)
        rig.answer(rig.drive.stop())
    begun = len(rig.link.frames)
    rig.pass_time(0.5)
    asked = reads(rig, begun)
    assert asked[STATUS] > 10
    assert abs(asked[INV_ST] - asked[STATUS]) <= 1


def test_after_a_lost_answer_the_inverter_status_is_read(make_virtual: MakeVirtual) -> None:
    rig = fast(make_virtual)
    rig.ride()
    rig.pass_time(0.05)
    for steps in range(20):
        # at another moment of the poll each time
        for _ in range(steps):
            rig.bus.step()
        rig.link.losses = 1
        while rig.link.losses:
            rig.bus.step()
        begun = len(rig.link.frames)
        while not reads(rig, begun)[STATUS]:
            rig.bus.step()
        rig.bus.step()
        if rig.link.frames[begun]['hex'][4:8] != '0258':
            # it was the answer of a measured value
            continue
        assert reads(rig, begun)[INV_ST] == 1
        break
    else:
        pytest.fail('no status was lost')


def test_a_changed_inverter_status_that_the_word_does_not_show_is_told_soon(
    make_virtual: MakeVirtual,
) -> None:
    rig = fast(make_virtual, parameters={'control.accel': 20.0, 'control.retard': 20.0})
    rig.connect()
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.send(40.0)
    rig.pass_time(2.0)
    rig.send(1.0)
    rig.pass_time(0.3)
    # from speeding up to slowing down, under the same status word
    before = rig.drive.snapshot.status
    assert before is not None
    assert before.code == rig.far.control_unit.status_code


def polls(rig: VirtualRig, seconds: float) -> int:
    """How many snapshots come meanwhile."""
    kept = keep(rig)
    rig.pass_time(seconds)
    return len(kept.told)


def test_a_drive_that_stands_is_polled_at_the_idle_rate(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(poll_rate=20.0, idle_poll_rate=2.0, telemetry_rate=0.0)
    rig.connect()
    assert 19 <= polls(rig, 10.0) <= 21
    assert 'enabled' in rig.answer(rig.drive.enable())
    begun = rig.clock.now
    kept = keep(rig)
    rig.pass_time(1.0)
    assert kept.told[0][0] - begun < 0.05
    assert 18 <= len(kept.told) <= 22
    assert 180 <= polls(rig, 10.0) <= 202
    rig.answer(rig.drive.stop())
    rig.pass_time(1.0)
    assert 19 <= polls(rig, 10.0) <= 21


def test_a_motor_that_ramps_or_that_somebody_else_runs_is_not_idle(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual({'control.retard': 20.0}, poll_rate=20.0, idle_poll_rate=1.0)
    rig.ride(40.0)
    rig.send(None)
    rig.answer(rig.drive.stop())
    assert rig.far.motor.driven
    assert polls(rig, 2.0) > 30
    rig.pass_time(30.0)
    assert polls(rig, 5.0) < 7
    rig.far.control_unit.press('start')
    rig.pass_time(1.2)
    assert polls(rig, 2.0) > 30


def test_the_idle_rate_keeps_the_time_out_of_the_drive_from_striking(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual(poll_rate=20.0, idle_poll_rate=0.1, drive_timeout=1.5)
    rig.connect()
    rig.pass_time(10.0)
    assert polls(rig, 10.0) >= 20


def test_a_change_of_the_idle_rate_counts_at_once(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(poll_rate=20.0, idle_poll_rate=0.0, telemetry_rate=0.0)
    rig.connect()
    assert polls(rig, 2.0) >= 38
    rig.drive.settings = dataclasses.replace(rig.drive.settings, idle_poll_rate=2.0)
    rig.pass_time(0.5)
    assert polls(rig, 5.0) <= 11


def test_a_drive_that_stands_is_kept_alive_by_its_polls_alone(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(poll_rate=0.1, telemetry_rate=0.0, drive_timeout=2.0)
    rig.ride()
    rig.send(None)
    assert rig.answer(rig.drive.stop()).startswith('stop')
    rig.pass_time(25.0)
    assert rig.drive.snapshot.status is not None
    assert rig.drive.snapshot.status.from_bus, 'control is still ours, and that makes this a test'
    assert not rig.drive.snapshot.status.faulted
    assert 'enabled' in rig.answer(rig.drive.enable())
