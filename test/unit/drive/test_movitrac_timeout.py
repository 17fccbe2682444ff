# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The PC time-out of a MOVITRAC 31: it strikes when the driver dies, and at no other time."""

from __future__ import annotations

from movitrac import STOPS, make, succeeded
import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Severity

KEY = 'serial.pc_timeout'


def be_gone(rig: Rig, seconds: float) -> None:
    """End the driver without a word, and let time pass for the drive."""
    rig.kill()
    rig.line.go_to(rig.clock.now + seconds)


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
