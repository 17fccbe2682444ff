# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is counted of a drive, from what the driver really reports, over every connection."""

from __future__ import annotations

from collections.abc import Callable
import dataclasses
import math
import time

import pytest
from support.chosen import KINDS
from support.rig import CONNECTIONS, Notes, Rig

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause, Report, Snapshot, StopReason, Telemetry
from nfo_sinus_driver.operating_record.counting import Counting
from nfo_sinus_driver.operating_record.figures import (
    MJ_OF_KWH,
    NS_OF_HOUR,
    EnergySource,
    Record,
    decoded,
)

#: The wall time of moment 0 of the rig, s since 1970.
BEGAN = 1_700_000_000.0
FOLLOWING = [name for name, kind in CONNECTIONS.items() if kind.reference == 'fieldbus']


def fresh() -> Counting:
    return Counting(Record.begun('a drive', '1', BEGAN), lambda at: BEGAN + at)


def counted(notes: Notes, counting: Counting | None = None) -> Record:
    """Count all that a listener was told, in its order."""
    counting = counting or fresh()
    told: list[Snapshot | Telemetry] = [*notes.snapshots, *notes.telemetry]
    for what in sorted(told, key=lambda one: one.at):
        if isinstance(what, Snapshot):
            counting.take_status(what)
        else:
            counting.take_telemetry(what)
    return counting.record


@pytest.mark.parametrize('connection', FOLLOWING)
def test_a_run_and_its_stop(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.pass_time(5.0)
        stood = counted(rig.notes).total
        assert (stood.starts, stood.running) == (0, 0)
        assert dict(stood.stops) == {}
        rig.turn()
        rig.pass_time(20.0)
        rig.answer(rig.drive.stop(Report(Cause.STOP_REQUESTED, by='a client')))
        rig.pass_time(5.0)
        total = counted(rig.notes).total
    assert total.starts == 1
    assert dict(total.stops) == {'STOP': 1}
    assert 20.0 <= total.running / 1e9 < 24.0
    assert 29.0 <= total.powered / 1e9 < 36.0
    assert total.faults == {} and total.reversals == 0
    assert total.longest_silence == 0


def fault(rig: Rig) -> None:
    rig.far.trip(rig.a_fault)


def cut(rig: Rig) -> None:
    rig.line.state = 'silent'


def silence(rig: Rig) -> None:
    rig.send(None)


ENDS: dict[str, tuple[Callable[[Rig], None], StopReason]] = {
    'fault': (fault, StopReason.FAULT),
    'loss': (cut, StopReason.DRIVE_LOST),
    'no set-points': (silence, StopReason.SETPOINT_TIMEOUT),
}


@pytest.mark.parametrize('connection', FOLLOWING)
@pytest.mark.parametrize('end', ENDS)
def test_a_run_has_one_stop_with_its_reason(connection: str, end: str) -> None:
    cause, reason = ENDS[end]
    own = {'setpoint_timeout': 1.0} if end == 'no set-points' else {}
    with Rig(connection, **own).turn() as rig:
        rig.pass_time(2.0)
        cause(rig)
        rig.pass_time(8.0)
        rig.line.state = 'up'
        rig.pass_time(8.0)
        record = counted(rig.notes)
    assert record.total.starts == 1
    if end == 'fault' and rig.notes.said(Cause.FAULT_APPEARED):
        # one that a stop does not name
        assert record.total.faults
    assert dict(record.total.stops) == {reason.name: 1}


def test_a_motor_that_is_started_on_its_ramp_to_a_stop_has_two_starts() -> None:
    slow = {'control.accel': 5.0, 'control.retard': 20.0}
    with Rig('rtu', parameters=slow).turn() as rig:
        rig.pass_time(3.0)
        rig.answer(rig.drive.stop())
        rig.enable()
        rig.pass_time(2.0)
        rig.answer(rig.drive.stop())
        rig.pass_time(20.0)
        total = counted(rig.notes).total
    assert total.starts == 2 and dict(total.stops) == {'STOP': 2}


@pytest.mark.parametrize('connection', KINDS)
def test_a_fault_is_counted_once_over_a_restart_of_the_driver(connection: str) -> None:
    with Rig(connection).turn() as rig:
        rig.pass_time(1.0)
        fault(rig)
        rig.pass_time(8.0)
        record = counted(rig.notes)
        (code,) = record.total.faults
        kept = record.total.faults[code]
        assert kept.count == 1 and kept.text
        assert BEGAN < kept.last <= BEGAN + rig.clock.now
        # while it is active the driver is killed, and begins again from the file
        rig.kill()
        rig.begin()
        rig.connect()
        rig.pass_time(3.0)
        again = Counting(decoded(record.encoded()), lambda at: BEGAN + at)
        assert counted(rig.notes, again).total.faults == record.total.faults
        rig.acknowledged = 1
        rig.result(rig.drive.acknowledge())
        rig.pass_time(1.0)
        fault(rig)
        rig.pass_time(8.0)
        assert counted(rig.notes, again).total.faults[code].count == 2


@pytest.mark.parametrize('connection', ['rtu', 'optimal', 'movitrac', 'telegram1 g2', 'canopen'])
def test_reversals(connection: str) -> None:
    with Rig(connection).turn(20.0) as rig:
        rig.pass_time(3.0)
        assert counted(rig.notes).total.reversals == 0
        for value in (-20.0, 20.0):
            rig.send(value * rig.connection.hertz)
            rig.pass_time(4.0)
        assert counted(rig.notes).total.reversals == 2


def test_a_motor_that_others_run_is_counted_without_a_reason() -> None:
    with Rig('rtu', control_method='monitor') as rig:
        rig.connect()
        rig.pass_time(1.0)
        rig.far.control_unit.press('start')
        rig.pass_time(5.0)
        rig.far.control_unit.press('stop')
        rig.pass_time(5.0)
        total = counted(rig.notes).total
    assert total.starts == 1 and dict(total.stops) == {'NONE': 1}


def test_the_driver_that_finds_a_motor_running_counts_that_stop() -> None:
    with Rig('rtu').turn() as rig:
        rig.pass_time(1.0)
        rig.kill()
        rig.begin()
        rig.connect()
        rig.pass_time(5.0)
        total = counted(rig.notes).total
    assert total.starts == 0 and dict(total.stops) == {'NOT_ENABLED': 1}


def status(at: float, **more: object) -> Snapshot:
    return Snapshot(at, True, False, '', **more)  # type: ignore[arg-type]


def telemetry(at: float, **values: float) -> Telemetry:
    return Telemetry(at, {Role[name.upper()]: value for name, value in values.items()})


def test_energy_is_what_the_counter_of_the_drive_says_if_it_has_one() -> None:
    counting = fresh()
    assert counting.record.energy_source is EnergySource.NONE
    assert math.isnan(counting.record.total.energy_kwh)
    counting.take_telemetry(telemetry(0.0, total_energy=100.0, energy=3.0, output_power=9e9))
    assert counting.record.total.energy == 0
    counting.take_telemetry(telemetry(1.0, total_energy=100.25, energy=0.0, output_power=9e9))
    assert counting.record.total.energy_kwh == 0.25
    # a value that was not read is none; one that fell was reset
    counting.take_telemetry(telemetry(2.0, energy=50.0))
    counting.take_telemetry(telemetry(3.0, total_energy=2.0))
    counting.take_telemetry(telemetry(4.0, total_energy=2.5))
    assert counting.record.total.energy_kwh == 0.75
    assert counting.record.energy_source is EnergySource.COUNTER
    # also over a restart
    again = Counting(decoded(counting.record.encoded()), lambda at: at)
    again.take_telemetry(telemetry(9.0, total_energy=3.5))
    assert again.record.total.energy_kwh == 1.75


def test_without_a_counter_it_is_the_power_over_time() -> None:
    counting = fresh()
    for second in range(0, 3601, 2):
        counting.take_telemetry(telemetry(float(second), output_power=1000.0))
    assert counting.record.total.energy_kwh == pytest.approx(1.0)
    assert counting.record.energy_source is EnergySource.POWER
    before = counting.record.total.energy
    # what is given back, a pause, and what is not known count as nothing
    for at, power in ((3602.0, -500.0), (3604.0, -500.0), (9000.0, 1000.0), (9002.0, math.nan)):
        counting.take_telemetry(telemetry(at, output_power=power))
    counting.take_telemetry(telemetry(9004.0, output_power=5000.0))
    added = (counting.record.total.energy or 0) - (before or 0)
    assert added / MJ_OF_KWH == pytest.approx(1000.0 / 3600 / 1000)


def test_the_highest_of_each_value() -> None:
    counting = fresh()
    counting.take_telemetry(telemetry(0.0, pt1000_temperature=-20.0, actual_torque=-80.0))
    counting.take_telemetry(telemetry(1.0, pt1000_temperature=-5.0, actual_torque=60.0))
    counting.record.begin_shift(BEGAN + 1)
    counting.take_telemetry(telemetry(2.0, pt1000_temperature=math.nan, actual_torque=10.0))
    assert counting.record.total.highest == {'pt1000_temperature': -5.0, 'torque': 80.0}
    assert counting.record.shift.highest == {'torque': 10.0}


def test_a_long_pause_of_the_driver_counts_as_nothing() -> None:
    with Rig('rtu') as rig:
        rig.connect()
        rig.pass_time(1.0)
        (first, *_) = [one for one in rig.notes.snapshots if one.connected]
    counting = fresh()
    for at in (0.0, 1.0, 500.0, 501.0):
        counting.take_status(dataclasses.replace(first, at=at))
    assert counting.record.total.powered == 2 * 10**9
    assert counting.record.total.powered_time == 2 * 10**9 / NS_OF_HOUR


def test_errors_of_the_line_count_while_the_drive_is_connected() -> None:
    with Rig('rtu') as rig:
        rig.connect()
        rig.pass_time(1.0)
        (first, *_) = [one for one in rig.notes.snapshots if one.connected]
    counting = fresh()
    # before it was connected
    counting.take_line_errors(1000)
    counting.take_status(first)
    counting.take_line_errors(1003)
    counting.record.begin_shift(BEGAN)
    counting.take_line_errors(1004)
    counting.take_status(Snapshot(first.at + 1, False, False, ''))
    counting.take_line_errors(9000)
    counting.take_status(dataclasses.replace(first, at=first.at + 100))
    # of another unit
    counting.take_line_errors(7)
    counting.take_line_errors(9)
    assert (counting.record.total.line_errors, counting.record.shift.line_errors) == (6, 3)


def test_a_silence_is_a_time_without_a_status_in_which_a_request_was_in_vain() -> None:
    with Rig('rtu') as rig:
        rig.connect()
        rig.pass_time(1.0)
        (first, *_) = [one for one in rig.notes.snapshots if one.connected]
    counting = fresh()

    def take(at: float, errors: int) -> float:
        counting.take_line_errors(errors)
        counting.take_status(dataclasses.replace(first, at=at))
        return counting.record.total.longest_silence

    # polled seldom
    assert [take(0.0, 0), take(5.0, 0), take(6.0, 1), take(6.5, 2), take(9.0, 2)] == [0, 0, 1, 1, 1]
    counting.take_line_errors(4)
    counting.take_status(Snapshot(10.5, False, False, ''))
    assert counting.record.total.longest_silence == 1.5
    # without power for a night: the record says nothing of it
    assert take(30_000.0, 9000) == 1.5
    assert counting.record.total.line_errors == 4


def test_a_status_costs_some_microseconds() -> None:
    with Rig('rtu').turn() as rig:
        rig.pass_time(1.0)
        newest = rig.notes.snapshots[-1]
    counting = fresh()
    statuses = [dataclasses.replace(newest, at=newest.at + 0.02 * n) for n in range(5000)]
    begun = time.process_time()
    for one in statuses:
        counting.take_status(one)
    each = (time.process_time() - begun) / len(statuses)
    print(f'{1e6 * each:.1f} us a status')
    # ten times of what it takes: a machine may be slow
    assert each < 100e-6
