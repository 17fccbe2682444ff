# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a poll reads each time, what it reads now and then, and when that has to be read at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
import dataclasses
import itertools
from typing import Any

from neighbour import neighbour
import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.drive import Snapshot

STATUS, INV_ST = 'fieldbus.drive_status', 'fieldbus.inv_st'
FREQUENCY, SPEED, TORQUE = 'status.frq_act', 'status.spd_act', 'status.trq_act'
VOLTAGE = 'status.u_rms'
OVERLOAD = 5
#: What a user may see late at most, s.
LATEST = 0.2


class Kept(list[tuple[float, Snapshot]]):
    """The snapshots from now on, and when each came."""

    def __init__(self, rig: Rig) -> None:
        super().__init__()
        whole = rig.notes.on_snapshot

        def on_snapshot(snapshot: Snapshot) -> None:
            whole(snapshot)
            self.append((rig.clock.now, snapshot))

        rig.notes.on_snapshot = on_snapshot  # type: ignore[method-assign]


def reads(rig: Rig, begun: int = 0) -> Counter[str]:
    """How often each was read since so much was asked."""
    return Counter(key for _, key, data in rig.asked[begun:] if data is None)


def fast(parameters: Mapping[str, Any] | None = None) -> Rig:
    """Return a drive that is polled as fast as the line allows."""
    return Rig(
        parameters=parameters,
        options={'refuses_in_fault': 'nothing'},
        poll_rate=0.0,
        telemetry_rate=0.0,
    )


def full_line(rig: Rig) -> None:
    """Let as many others be read as a full line has."""
    for _ in range(31):
        rig.bus.run(neighbour(rig.bus, rig.drive.params.address(VOLTAGE)))


def stop(rig: Rig) -> None:
    rig.send(None)
    assert rig.answer(rig.drive.stop()).startswith('stop')


def test_a_poll_takes_two_transactions_in_place_of_four() -> None:
    with fast() as rig:
        rig.connect()
        for lead in (lambda: None, rig.turn, lambda: full_line(rig)):
            lead()
            rig.pass_time(5.0)
            begun = len(rig.asked)
            rig.pass_time(20.0)
            asked = reads(rig, begun)
            assert (sum(asked.values()) - asked[VOLTAGE]) / asked[STATUS] < 2.5
        assert min(asked[SPEED], asked[INV_ST]) >= asked[STATUS] / 8


@pytest.mark.parametrize(
    ('mode', 'every', 'others'),
    [
        ('Freque', FREQUENCY, (SPEED,)),
        ('Speed', SPEED, (FREQUENCY,)),
        ('Torque', TORQUE, (FREQUENCY, SPEED)),
    ],
)
def test_what_the_control_mode_is_about_is_measured_with_every_poll(
    mode: str, every: int, others: tuple[int, ...]
) -> None:
    with fast({'control.mode': mode}) as rig:
        rig.connect()
        rig.enable()
        rig.send(10.0 if mode == 'Torque' else 600.0 if mode == 'Speed' else 20.0)
        rig.pass_time(1.0)
        begun = len(rig.asked)
        kept = Kept(rig)
        rig.pass_time(2.0)
        asked = reads(rig, begun)
        assert abs(asked[every] - len(kept)) <= 1
        for other in others:
            assert 2.0 / LATEST <= asked[other] < len(kept) / 3


def test_the_slow_values_are_never_old() -> None:
    with fast() as rig:
        rig.turn()
        kept = Kept(rig)
        rig.send(40.0)
        rig.pass_time(2.0)
        rig.send(None)
        rig.drive.stop()
        rig.wait_until(lambda: not rig.far.motor.driven)
        rig.pass_time(LATEST)
        # the standstill of the shaft at once
        assert abs(kept[-1][1].speed) < 1 and abs(kept[-1][1].frequency) < 0.1
        for at, snapshot in kept:
            assert snapshot.status is not None
            assert at - snapshot.speed_at < LATEST
            assert at - snapshot.frequency_at < LATEST
            assert at - snapshot.status.code_at < LATEST


def test_a_motor_that_comes_to_a_stop_is_shown_to_stand_in_both_units_at_once() -> None:
    with Rig(poll_rate=5.0, parameters={'control.mode': 'Speed'}) as rig:
        rig.connect()
        rig.enable()
        rig.send(600.0)
        rig.pass_time(1.0)
        rig.send(None)
        # where a turn takes long
        full_line(rig)
        rig.drive.stop()
        kept = Kept(rig)
        rig.pass_time(10.0)
        stands = [snapshot for _, snapshot in kept if snapshot.speed == 0]
        assert stands
        assert all(snapshot.frequency == 0 for snapshot in stands)


@pytest.mark.parametrize('rate', [0.0, 20.0, 5.0, 0.5])
def test_a_speed_is_published_at_any_poll_rate(rate: float) -> None:
    with Rig(poll_rate=rate) as rig:
        rig.turn()
        kept = Kept(rig)
        rig.pass_time(6.0)
        measured = {snapshot.speed_at for _, snapshot in kept}
        assert len(measured) >= min(6 * rate or 30, 30) - 1


def test_another_status_word_never_comes_with_an_older_inverter_status() -> None:
    with fast() as rig:
        rig.turn()
        kept = Kept(rig)
        rig.send(40.0)
        rig.pass_time(1.0)
        rig.far.trip(OVERLOAD)
        rig.pass_time(1.0)
        rig.acknowledged += 1
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        rig.enable()
        rig.pass_time(1.0)
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        statuses = [snapshot.status for _, snapshot in kept if snapshot.status is not None]
        changes = 0
        for before, now in itertools.pairwise(statuses):
            if now.word != before.word:
                changes += 1
                assert now.code_at > before.at
        assert changes > 5
        first = next(status for _, status in kept if status.kind is Kind.FAULT)
        assert first.status is not None
        assert first.status.code == OVERLOAD


def test_an_alarm_is_read_again_with_every_poll() -> None:
    with fast() as rig:
        rig.turn()
        rig.far.motor.load = 6.0
        rig.pass_time(0.2)
        assert rig.far.motor.limited
        begun = len(rig.asked)
        rig.pass_time(0.5)
        asked = reads(rig, begun)
        assert abs(asked[INV_ST] - asked[STATUS]) <= 1


@pytest.mark.parametrize('what', ['starts', 'ramps to a stop'])
def test_what_is_on_its_way_is_read_with_every_poll(what: str) -> None:
    with fast({'control.retard': 5.0, 'control.run_dly': 1}) as rig:
        rig.connect()
        if what == 'starts':
            enabled = rig.drive.enable()
            rig.pass_time(0.3)
            assert not enabled.done()
        else:
            rig.enable()
            rig.send(40.0)
            rig.pass_time(1.0)
            rig.answer(rig.drive.stop())
        begun = len(rig.asked)
        rig.pass_time(0.5)
        asked = reads(rig, begun)
        assert asked[STATUS] > 10
        assert abs(asked[INV_ST] - asked[STATUS]) <= 1


def test_after_a_lost_answer_the_inverter_status_is_read() -> None:
    with fast() as rig:
        rig.turn()
        for _ in range(5):
            rig.pass_time(0.07)
            begun = len(rig.asked)
            rig.spoil('drop', STATUS, written=False)
            rig.pass_time(0.5)
            keys = [key for _, key, _ in rig.asked[begun:]]
            answered = keys.index(STATUS, keys.index(STATUS) + 1)
            assert keys[answered + 1] == INV_ST


def test_a_lost_answer_makes_nothing_else_older() -> None:
    # with nothing but the speed to measure
    with Rig('canopen, ds402', parameters={'control.mode': 'PI-Reg'}) as rig:
        rig.connect()
        rig.spoil('drop', SPEED, 2, written=False)
        rig.pass_time(0.7)
        begun = len(rig.asked)
        rig.pass_time(1.2)
        asked = reads(rig, begun)
        assert asked[SPEED] >= 4 and asked['fieldbus.modes_of_operation_display'] >= 1


def test_a_changed_inverter_status_that_the_word_does_not_show_is_published_soon() -> None:
    with fast({'control.accel': 20.0, 'control.retard': 20.0}) as rig:
        rig.connect()
        rig.enable()
        rig.send(40.0)
        rig.pass_time(2.0)
        rig.send(1.0)
        rig.pass_time(0.3)
        # from speeding up to slowing down, under the same status word
        before = rig.drive.snapshot.status
        assert before is not None
        assert before.code == rig.far.control_unit.status_code


def polls(rig: Rig, seconds: float) -> int:
    """How many snapshots come meanwhile."""
    kept = Kept(rig)
    rig.pass_time(seconds)
    return len(kept)


def test_a_drive_that_stands_is_polled_at_the_idle_rate() -> None:
    with Rig(poll_rate=20.0, idle_poll_rate=0.0, telemetry_rate=0.0) as rig:
        rig.connect()
        assert polls(rig, 2.0) >= 38
        # a change counts at once
        rig.drive.settings = dataclasses.replace(rig.drive.settings, idle_poll_rate=2.0)
        rig.pass_time(0.5)
        assert 19 <= polls(rig, 10.0) <= 21
        rig.enable()
        begun = rig.clock.now
        kept = Kept(rig)
        rig.pass_time(1.0)
        assert kept[0][0] - begun < 0.05
        assert 18 <= len(kept) <= 22
        assert 180 <= polls(rig, 10.0) <= 202
        rig.answer(rig.drive.stop())
        rig.pass_time(1.0)
        assert 19 <= polls(rig, 10.0) <= 21


def test_a_motor_that_ramps_or_that_another_master_runs_is_not_idle() -> None:
    with Rig(parameters={'control.retard': 20.0}, poll_rate=20.0, idle_poll_rate=1.0) as rig:
        rig.turn(40.0)
        rig.send(None)
        rig.answer(rig.drive.stop())
        assert rig.far.motor.driven
        assert polls(rig, 2.0) > 30
        rig.pass_time(30.0)
        assert polls(rig, 5.0) < 7
        rig.far.control_unit.press('start')
        rig.pass_time(1.2)
        assert polls(rig, 2.0) > 30


def test_the_idle_rate_keeps_the_time_out_of_the_drive_from_striking() -> None:
    with Rig(poll_rate=20.0, idle_poll_rate=0.1, drive_timeout=1.5) as rig:
        rig.connect()
        rig.enable()
        rig.answer(rig.drive.stop())
        rig.pass_time(10.0)
        assert polls(rig, 10.0) >= 20
