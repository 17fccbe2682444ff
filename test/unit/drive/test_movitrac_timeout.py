# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The PC time-out of a MOVITRAC 31: it strikes when the driver dies, and at no other time."""

from __future__ import annotations

from movitrac import STOPS, make, succeeded, switched
import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.simulator.movitrac31.codes import PC_TIMEOUT

KEY = 'serial.pc_timeout'


def be_gone(rig: Rig, seconds: float) -> None:
    """End the driver without a word, and let time pass for the drive."""
    rig.kill()
    rig.line.go_to(rig.clock.now + seconds)


@pytest.mark.parametrize('timeout_stop', ['coasts', 'ramps'])
def test_the_pc_time_out_strikes_when_the_driver_dies(timeout_stop: str) -> None:
    with switched({'timeout_stop': timeout_stop}, drive_timeout=1.5, setpoint_timeout=0.0) as rig:
        rig.turn()
        rig.pass_time(20.0)
        # without set-points it is kept alive, too
        rig.send(None)
        rig.pass_time(5.0)
        assert rig.drive.armed and not rig.far.faults
        be_gone(rig, 1.0)
        assert not rig.far.faults
        be_gone(rig, 1.0)
        assert rig.far.faults.codes == [PC_TIMEOUT]
        be_gone(rig, 2.0)
        assert not rig.far.motor.driven


def test_a_pc_time_out_that_is_found_is_acknowledged_by_command_alone() -> None:
    with switched({'bits_in_fault': 'kept'}, drive_timeout=1.5) as rig:
        rig.turn()
        be_gone(rig, 5.0)
        rig.begin()
        rig.connect()
        rig.pass_time(3.0)
        assert rig.notes.said('145 PC time out') or rig.notes.said('fault 145')
        assert '145 PC time out' in rig.answer(rig.drive.enable())
        assert rig.far.faults.codes == [PC_TIMEOUT]
        rig.acknowledged += 1
        assert 'acknowledged 145 PC time out' in rig.answer(rig.drive.acknowledge())
        rig.assert_only_enable_helps()


@pytest.mark.parametrize('found', [0.0, 5.0])
@pytest.mark.parametrize('end', [['disconnect'], ['exit', 'disconnect']])
def test_a_clean_end_leaves_the_pc_time_out_as_it_was_found(found: float, end: list[str]) -> None:
    with make(parameters={KEY: found}, drive_timeout=1.5) as rig:
        rig.turn()
        assert rig.far.memory.number(KEY) == 1.5
        # set again and changed: what was found stays what it was
        rig.answer(rig.drive.set_drive_timeout(2.0))
        for name in end:
            assert succeeded(rig, STOPS[name](rig.drive)), name
        assert rig.far.memory.number(KEY) == found
        assert rig.notes.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING) == bool(found)
        be_gone(rig, 20.0)
        assert bool(rig.far.faults) == bool(found)


def test_a_clean_end_turns_the_pc_time_out_off_when_the_motor_has_stopped() -> None:
    with make(drive_timeout=1.5) as rig:
        rig.turn()
        frequencies: list[float] = []

        def meet(key: str, data: bytes | None) -> None:
            if key == KEY and data is not None:
                frequencies.append(rig.far.motor.frequency)

        rig.meet = meet
        assert succeeded(rig, rig.drive.disconnect(5.0))
        assert frequencies == [0.0]


def test_a_clean_end_during_a_long_ramp_leaves_no_fault() -> None:
    with make(parameters={'ramp.t11_down': 60.0}, drive_timeout=1.5) as rig:
        rig.turn()
        assert succeeded(rig, rig.drive.disconnect(0.5))
        be_gone(rig, 1.0)
        assert rig.far.motor.frequency > 10
        be_gone(rig, 60.0)
        assert not rig.far.faults and not rig.far.motor.turning


@pytest.mark.parametrize('seconds', [0.0, 4.0])
def test_a_pc_time_out_that_another_has_set_is_left_alone(seconds: float) -> None:
    with make(drive_timeout=1.5) as rig:
        rig.turn()
        rig.far.set_from_keypad(KEY, seconds)
        rig.pass_time(1.0)
        written = len(rig.written(KEY))
        assert succeeded(rig, rig.drive.disconnect(1.0))
        assert len(rig.written(KEY)) == written
        assert rig.far.memory.number(KEY) == seconds


def test_a_pc_time_out_that_cannot_be_ended_is_reported() -> None:
    with make(drive_timeout=1.5) as rig:
        rig.turn()
        rig.far.set_from_keypad('special.parameter_lock', True)
        # the motor stands all the same
        assert succeeded(rig, rig.drive.disconnect(1.0))
        assert rig.far.motor.frequency == 0
        assert rig.notes.said(Cause.OWN_TIMEOUT_LEFT, Severity.WARNING)


def test_a_drive_that_answers_late_is_followed_all_the_same() -> None:
    with make(
        parameters={'serial.response_time': 200.0}, drive_timeout=3.0,
        line={'response_timeout': 0.5},
    ) as rig:
        rig.turn()
        rig.pass_time(30.0)
        assert rig.drive.armed and not rig.far.faults
        assert succeeded(rig, rig.drive.stop())


@pytest.mark.parametrize('count', [4, 8])
def test_several_at_one_line_are_kept_alive_while_others_are_enabled(count: int) -> None:
    # an enable asks some forty times, and no set-points come yet
    with Rig('movitrac', drives=count, drive_timeout=1.5) as rig:
        rig.connect()
        rig.enable()
        assert not any(far.faults for far in rig.fars.values())
        rig.send(20.0)
        rig.pass_time(10.0)
        assert not any(far.faults for far in rig.fars.values())
        assert all(drive.armed for drive in rig.drives.values())
        assert all(far.motor.frequency > 19 for far in rig.fars.values())
        for stop in [drive.stop() for drive in rig.drives.values()]:
            assert succeeded(rig, stop)
        rig.pass_time(3.0)
        assert not any(far.motor.turning for far in rig.fars.values())
