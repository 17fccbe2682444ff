# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A motor that takes much current and hardly turns is jammed: that is told, or stops it."""

from __future__ import annotations

from collections.abc import Mapping
import dataclasses
from typing import Any

import hypothesis
from hypothesis import strategies as st
import pytest
from support.rig import CONNECTIONS, Connection, Rig
from support.said import raises
from support.variants import ramps, shipped

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause, DriveSettings, Report, Severity, StopReason

#: A load that holds every motor, at the current limit of its drive.
BLOCKED = 60.0
#: Connections over which both are measured: lines, families, and by what a drive shows its state.
MEASURED = [
    'rtu', 'classic', 'canopen', 'canopen, ds402', 'rtu, control word', 'optimal', 'described',
    'described, by states', 'telegram1 g2, mailbox', 'telegram1 sinus_h, mailbox',
]
#: By a mailbox a value is there half a second after the other.
_LATE = 2.0


def rig_with(connection: str = 'rtu', slow: float = 8.0, **settings: Any) -> Rig:
    """Return a rig whose drives watch for a jam at less than so many Hz; they stop in one."""
    jam = {
        'jam_current': 4.0, 'jam_speed': slow * CONNECTIONS[connection].hertz, 'jam_time': 2.0,
        'on_jam': 'stop', 'telemetry_rate': 2.0, 'setpoint_timeout': 0.0,
    }
    return Rig(connection, **{**jam, **settings})


def run(rig: Rig, frequency: float = 20.0) -> None:
    """Turn the motor until it has been at its speed for a while."""
    rig.turn(abs(frequency))
    rig.send(frequency)
    rig.pass_time(4.0)
    assert abs(rig.far.motor.frequency) > 0.9 * abs(frequency)


def stops_in_jam(rig: Rig, patience: float) -> float:
    """Wait until the motor is stopped because of a jam; return how long that took, s."""
    begun = rig.clock.now
    rig.wait_until(lambda: not rig.drive.following, patience)
    took = rig.clock.now - begun
    rig.pass_time(1.0)
    assert rig.drive.snapshot.stop_reason is StopReason.JAM
    return took


def change(rig: Rig, **settings: Any) -> None:
    """Change settings while the drive is connected."""
    rig.drive.settings = dataclasses.replace(rig.drive.settings, **settings)


# --- a jam ---


@pytest.mark.parametrize('connection', MEASURED)
def test_a_motor_that_is_blocked_is_stopped_until_the_next_enable(connection: str) -> None:
    with rig_with(connection) as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        assert stops_in_jam(rig, 8.0 + _LATE) > 1.9
        assert rig.notes.said(Cause.JAMMED, Severity.WARNING) and not rig.turns
        rig.far.motor.load = 0.3
        rig.assert_only_enable_helps()


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'described'])
def test_a_motor_that_is_blocked_in_reverse_is_stopped(connection: str) -> None:
    with rig_with(connection) as rig:
        run(rig, -20.0)
        rig.far.motor.load = BLOCKED
        stops_in_jam(rig, 8.0)


def test_what_was_measured_and_what_to_do_is_said() -> None:
    with rig_with() as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        stops_in_jam(rig, 8.0)
        (event,) = [noted for noted in rig.notes.events if Cause.JAMMED in noted.text.causes]
        assert event.text.startswith('stopped: its motor has taken 5.1 A at ')
        assert '(jam_current 4 A, jam_speed 8 Hz): free what is stuck; ' in event.text
        assert event.text.endswith('then call ~/enable to go on')


def test_the_current_alone_is_no_jam_nor_is_the_speed() -> None:
    with rig_with(jam_current=5.5) as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        rig.pass_time(15.0)
        assert rig.drive.following and abs(rig.far.motor.frequency) < 8.0
    with rig_with(jam_current=0.5) as rig:
        run(rig)
        rig.far.motor.load = 0.9
        rig.pass_time(15.0)
        assert rig.drive.following and rig.far.motor.current > 0.5


@pytest.mark.parametrize('connection', ['rtu', 'described, by states'])
def test_a_motor_that_is_blocked_at_the_start_is_stopped_once_no_ramp_can_be(
    connection: str,
) -> None:
    with rig_with(connection) as rig:
        rig.connect()
        rig.far.motor.load = BLOCKED
        rig.enable()
        rig.send(20.0)
        assert stops_in_jam(rig, 14.0) > 5.0


def test_a_motor_that_blocks_as_it_turns_round_is_stopped() -> None:
    with rig_with() as rig:
        run(rig)
        rig.send(-20.0)
        rig.far.motor.load = BLOCKED
        stops_in_jam(rig, 14.0)


def test_set_points_that_vary_do_not_hide_a_jam() -> None:
    with rig_with() as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        rig.keep(lambda: rig.drive.set_setpoint(25.0 + 8.0 * (rig.clock.now * 7 % 1)))
        stops_in_jam(rig, 8.0)


def test_what_stops_with_a_jammed_drive_is_stopped() -> None:
    with rig_with(drives=2) as rig:
        rig.drive.on_stop(
            lambda why: rig.drives[2].stop_beside(
                Report(Cause.STOPPED_WITH, drive='/drive1', why=why)
            )
        )
        run(rig)
        rig.far.motor.load = BLOCKED
        stops_in_jam(rig, 8.0)
        assert rig.drives[2].snapshot.stop_reason is StopReason.STOP_WITH


# --- a warning ---


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'described'])
def test_a_jam_can_be_a_warning_that_comes_once_and_lasts(connection: str) -> None:
    with rig_with(connection, on_jam='warn') as rig:
        run(rig)
        assert rig.drive.jammed is None
        rig.far.motor.load = BLOCKED
        rig.pass_time(30.0)
        assert rig.drive.following and rig.drive.jammed is not None
        seen = [noted for noted in rig.notes.events if Cause.JAM_SEEN in noted.text.causes]
        assert [noted.severity for noted in seen] == [Severity.WARNING]
        rig.far.motor.load = 0.3
        rig.pass_time(2.0)
        assert rig.drive.jammed is None
        # and again, for it has been over for long
        rig.pass_time(12.0)
        rig.far.motor.load = BLOCKED
        rig.pass_time(8.0)
        assert len([note for note in rig.notes.events if Cause.JAM_SEEN in note.text.causes]) == 2
        change(rig, on_jam='stop')
        stops_in_jam(rig, 2.0)
        assert rig.drive.jammed is None


def test_a_motor_that_was_stopped_is_jammed_no_more() -> None:
    with rig_with(on_jam='warn') as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        rig.wait_until(lambda: rig.drive.jammed, 8.0)
        rig.answer(rig.drive.stop())
        assert rig.drive.jammed is None


def test_it_can_be_turned_on_and_off_while_the_motor_runs() -> None:
    with rig_with(jam_current=0.0) as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        rig.pass_time(15.0)
        assert rig.drive.following
        change(rig, jam_current=4.0)
        stops_in_jam(rig, 9.0)
    with rig_with(on_jam='warn') as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        rig.wait_until(lambda: rig.drive.jammed, 8.0)
        change(rig, jam_current=0.0, on_jam='stop')
        rig.pass_time(10.0)
        assert rig.drive.following and rig.drive.jammed is None


# --- no jam ---


@pytest.mark.parametrize('setpoint', [0.0, 7.9, -7.9])
def test_a_motor_that_is_asked_to_be_slow_is_not_jammed(setpoint: float) -> None:
    with rig_with() as rig:
        run(rig)
        rig.send(setpoint)
        rig.pass_time(2.0)
        rig.far.motor.load = BLOCKED
        rig.pass_time(20.0)
        assert rig.drive.following


@pytest.mark.parametrize(('setpoint', 'slow'), [(45.0, 8.0), (20.0, 19.0)])
def test_a_motor_that_its_load_only_slows_down_is_not_jammed(setpoint: float, slow: float) -> None:
    # above jam_speed, or not far below its set-point
    with rig_with(slow=slow) as rig:
        run(rig, setpoint)
        rig.far.motor.load = 4.0
        rig.pass_time(15.0)
        assert rig.drive.following and rig.far.motor.limited
        assert 11.0 < rig.far.motor.frequency < 18.5


@pytest.mark.parametrize('setpoints', [(50.0,), (50.0, -50.0), (-50.0, 50.0)])
def test_a_motor_on_its_ramp_is_not_jammed(setpoints: tuple[float, ...]) -> None:
    # the slowest of this drive: 0.1 Hz in a second, longer than the time of a jam
    slow = ramps('sinus_g2', 500.0, 5.0)
    jam = {'jam_current': 0.5, 'jam_time': 0.5, 'telemetry_rate': 10.0}
    with rig_with(**jam, parameters=slow) as rig:
        rig.connect()
        rig.enable()
        for setpoint in setpoints:
            rig.send(setpoint)
            rig.pass_time(60.0)
            assert rig.drive.following and rig.far.motor.current > 0.5
            assert 4.0 < abs(rig.far.motor.frequency) < 8.0


def test_a_motor_that_is_free_again_and_becomes_faster_is_not_jammed() -> None:
    # it is held for less than jam_time, and needs longer than that to be fast enough
    with rig_with(slow=15.0, jam_current=0.5) as rig:
        run(rig, 40.0)
        rig.far.memory.set('control.accel', 100.0)
        rig.far.motor.load = BLOCKED
        rig.pass_time(1.2)
        assert rig.far.motor.frequency < 8.0
        rig.far.motor.load = 0.3
        rig.pass_time(10.0)
        assert rig.drive.following and 5.0 < rig.far.motor.frequency < 15.0


def test_a_drive_that_brakes_its_motor_before_the_start_is_not_jammed() -> None:
    braking = {'control.dc_brk': 12.0}
    options = {'shown_in_dc_brk': 'running'}
    with rig_with(jam_current=0.5, parameters=braking, options=options) as rig:
        rig.connect()
        rig.enable()
        rig.send(20.0)
        # held by what holds it from the first moment: that of the braking does not count
        rig.far.motor.load = BLOCKED
        assert stops_in_jam(rig, 30.0) > 15.0


@hypothesis.settings(max_examples=12, deadline=None)
@hypothesis.given(
    connection=st.sampled_from(['rtu', 'classic', 'described', 'optimal']),
    setpoints=st.lists(
        st.tuples(st.floats(-50.0, 50.0), st.floats(0.1, 12.0)), min_size=2, max_size=6
    ),
    load=st.floats(0.0, 1.2),
    ramp=st.sampled_from([0.3, 1.5, 10.0, 60.0]),
    slow=st.floats(0.5, 30.0),
)
def test_no_jam_is_told_while_the_motor_follows(
    connection: str,
    setpoints: list[tuple[float, float]],
    load: float,
    ramp: float,
    slow: float,
) -> None:
    # any current is too much
    model = CONNECTIONS[connection].model
    times = ramps(model, ramp, ramp)
    with rig_with(connection, slow, jam_current=0.05, parameters=times) as rig:
        rig.connect()
        rig.enable()
        rig.far.motor.load = load
        for frequency, seconds in setpoints:
            rig.send(frequency)
            rig.pass_time(seconds)
            assert rig.drive.following and not rig.notes.said(Cause.JAMMED)


# --- what is not measured ---


@pytest.mark.parametrize('wrong', ['refused', 'drop'])
def test_a_value_that_is_missing_in_between_is_a_break(wrong: str) -> None:
    with rig_with() as rig:
        run(rig)
        asked = [0]

        def meet(key: str, data: bytes | None) -> str | None:
            asked[0] += key == 'status.i_rms'
            return wrong if key == 'status.i_rms' and asked[0] % 3 == 0 else None

        rig.meet = meet
        rig.far.motor.load = BLOCKED
        rig.pass_time(20.0)
        assert asked[0] > 20 and rig.drive.following
        rig.meet = lambda key, data: None
        stops_in_jam(rig, 6.0)


def test_two_values_that_cannot_be_stop_no_motor() -> None:
    # on this line they come further apart than jam_time
    with rig_with('classic', jam_time=1.0, poll_rate=0.0) as rig:
        run(rig)
        rig.far.motor.load = BLOCKED
        begun = len(rig.notes.telemetry)
        stops_in_jam(rig, 20.0)
        measured = rig.notes.telemetry[begun:]
        assert measured[1].at - measured[0].at > 1.0
        assert sum(told.values[Role.OUTPUT_CURRENT] > 4.0 for told in measured) >= 3


def test_that_nothing_can_be_judged_is_said_once() -> None:
    with rig_with() as rig:
        run(rig)
        rig.meet = lambda key, data: 'busy' if key == 'status.i_rms' else None
        rig.far.motor.load = BLOCKED
        rig.pass_time(40.0)
        unseen = [noted for noted in rig.notes.events if Cause.JAM_UNSEEN in noted.text.causes]
        assert len(unseen) == 1 and rig.drive.following


def test_on_a_line_too_full_to_judge_no_jam_is_told_and_that_is_said() -> None:
    with rig_with('classic', drives=3, jam_time=1.0, poll_rate=0.0) as rig:
        rig.turn()
        rig.far.motor.load = BLOCKED
        rig.pass_time(30.0)
        times = [told.at for told in rig.notes.telemetry]
        assert times[-1] - times[-2] > 1.0
        assert rig.drive.following and rig.notes.said(Cause.JAM_UNSEEN)


def test_a_drive_that_was_lost_is_judged_from_its_next_enable_on() -> None:
    with rig_with() as rig:
        run(rig)
        rig.line.state = 'silent'
        rig.pass_time(4.0)
        rig.line.mend()
        rig.wait_until(lambda: rig.drive.snapshot.connected, 20.0)
        rig.pass_time(3.0)
        assert rig.drive.snapshot.stop_reason is not StopReason.JAM
        rig.far.motor.load = BLOCKED
        rig.enable()
        assert stops_in_jam(rig, 14.0) > 5.0


def test_where_no_speed_is_controlled_no_jam_is_told_and_that_is_said() -> None:
    with rig_with(parameters={'control.mode': 'Torque'}) as rig:
        rig.connect()
        rig.enable()
        rig.send(30.0)
        rig.far.motor.load = BLOCKED
        rig.pass_time(20.0)
        assert rig.drive.following and rig.notes.said(Cause.JAM_NOT_JUDGED, Severity.WARNING)


# --- what is refused ---

_ON = {'jam_current': 4.0, 'jam_speed': 5.0}
_REFUSED: Mapping[str, tuple[Mapping[str, Any], str]] = {
    'no speed': ({'jam_speed': 0.0}, 'needs jam_speed'),
    'no telemetry': ({'telemetry_rate': 0.0}, 'needs telemetry_rate'),
    'short': ({'jam_time': 0.9}, 'at least 1 s'),
    'seldom polled': ({'poll_rate': 0.5}, 'at least 4 s'),
    'monitor': ({'control_method': 'monitor'}, 'does not run this motor'),
    'own reference': ({'reference': 'analog'}, 'reference analog'),
    'no speed controlled': ({'expected_control_mode': 'Torque'}, 'no speed is controlled'),
    'MOVITRAC': ({'model': 'movitrac31'}, 'measures no current;'),
    'telegram 1': (
        {'model': 'sinus_optimal', 'control_method': 'telegram1'}, 'measures no current;'
    ),
    'described': ({'model': shipped('toshiba_vf_s11')}, 'measures no current;'),
    'what is done': ({'on_jam': 'reverse'}, "choose one of 'warn', 'stop'"),
}


@pytest.mark.parametrize('case', _REFUSED)
def test_what_cannot_be_judged_is_refused_with_the_reason(case: str) -> None:
    settings, reason = _REFUSED[case]
    with pytest.raises(ValueError, match='jam') as refused:
        DriveSettings(**{**_ON, **settings})
    assert reason in str(refused.value)
    # off, it refuses nothing
    if case != 'what is done':
        DriveSettings(**{**settings, 'jam_current': 0.0})


@pytest.mark.parametrize(
    'connection',
    [
        'telegram1 sinus_h', 'telegram1 g2',
        Connection('modbus_rtu', shipped('delta_ms300'), 'custom'),
    ],
    ids=['no longer telegram', 'no mailbox', 'refused register'],
)
def test_a_drive_that_does_not_tell_its_current_is_not_connected(
    connection: str | Connection,
) -> None:
    jam = {'jam_current': 4.0, 'jam_speed': 5.0, 'telemetry_rate': 2.0}
    with Rig(connection, **jam) as rig:
        key = rig.drive.model.key(Role.OUTPUT_CURRENT)
        rig.meet = lambda asked, data: 'none such' if asked == key else None
        with raises(Cause.JAM_NOT_MEASURED):
            rig.result(rig.drive.connect())
        assert not rig.drive.snapshot.connected


@pytest.mark.parametrize(
    'connection', ['rtu', 'classic', Connection('modbus_rtu', shipped('delta_ms300'), 'custom')],
    ids=['rtu', 'classic', 'described'],
)
def test_a_motor_that_is_found_running_is_stopped_though_its_drive_is_refused(
    connection: str | Connection,
) -> None:
    with Rig(connection, jam_current=4.0, jam_speed=5.0, telemetry_rate=2.0) as rig:
        rig.turn()
        rig.kill()
        rig.begin()
        key = rig.drive.model.key(Role.OUTPUT_CURRENT)
        rig.meet = lambda asked, data: 'none such' if asked == key else None
        with raises(Cause.JAM_NOT_MEASURED):
            rig.result(rig.drive.connect())
        rig.wait_until(lambda: not rig.turns, 3.0)
