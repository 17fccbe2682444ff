# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Nothing turns by itself: what the laws of test_laws.py do not show of every connection."""

from __future__ import annotations

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd

OVERLOAD = 5


@pytest.mark.parametrize('poll_rate', [20.0, 0.02])
def test_a_stop_that_a_fault_kept_from_the_drive_is_given_when_another_master_ends_the_fault(
    poll_rate: float,
) -> None:
    with Rig(poll_rate=poll_rate) as rig:
        rig.turn()
        rig.far.trip(OVERLOAD)
        # it refuses every command now, and its run command stands
        rig.wait_until(lambda: rig.drive.state.control.blocked)
        rig.far.faults.acknowledge()
        rig.far.control_unit.settle()
        rig.wait_until(lambda: rig.far.control_unit.scmd == Scmd.STOP, 2.0)
        rig.assert_only_enable_helps()


def test_a_fault_that_no_poll_shows_ends_a_run() -> None:
    # it comes and is acknowledged between two polls, by what stops it, too
    with Rig() as rig:
        rig.turn()
        rig.far.trip(OVERLOAD)
        rig.far.faults.acknowledge()
        rig.far.control_unit.command(Scmd.STOP)
        rig.far.control_unit.settle()
        rig.assert_only_enable_helps()


def test_a_control_mode_that_is_changed_at_the_keypad_ends_a_run() -> None:
    with Rig() as rig:
        rig.turn()
        rig.far.set_from_keypad('control.mode', 'Speed')
        rig.wait_until(lambda: not rig.drive.following, 10.0)
        assert rig.notes.said('the control mode was changed to Speed', Severity.WARNING)
        rig.pass_time(1.0)
        assert not rig.far.motor.driven


def test_a_drive_that_its_terminals_start_after_power_on_is_left_to_them() -> None:
    with Rig(parameters={'control.auto_start': True}) as rig:
        rig.turn()
        rig.far.power_cycle(0.1)
        rig.pass_time(3.0)
        assert not rig.drive.following
        assert rig.far.control_unit.mode is Mode.EXT and rig.far.motor.driven


def test_a_motor_that_the_terminals_run_is_left_alone() -> None:
    with Rig() as rig:
        rig.far.control_unit.press('ext')
        rig.connect()
        rig.pass_time(2.0)
        assert rig.far.motor.driven
        assert rig.written('fieldbus.scmd') == rig.written('fieldbus.mode') == []


@pytest.mark.parametrize('earlier', [True, False])
def test_a_motor_that_another_master_runs_is_stopped(earlier: bool) -> None:
    with Rig() as rig:
        if not earlier:
            rig.connect()
            rig.send(20.0)
        for key, raw in (
            ('fieldbus.mode', Mode.BUS), ('status.frq_set', 200), ('fieldbus.scmd', Scmd.FIELDBUS)
        ):
            rig.far.write_raw(key, raw)
        assert rig.far.motor.driven
        if earlier:
            rig.connect()
        rig.pass_time(2.0)
        assert earlier or rig.notes.said(Cause.RUNS_UNASKED, Severity.WARNING)
        assert not rig.drive.stop_unconfirmed and not rig.far.motor.driven
        assert rig.far.memory.raw('status.frq_set') == 0


def test_a_run_command_that_a_fault_holds_does_not_keep_the_driver_from_connecting() -> None:
    # the stop that is refused must leave the line to others, although nothing is polled yet
    with Rig() as rig:
        rig.far.write_raw('fieldbus.mode', Mode.BUS)
        rig.far.write_raw('fieldbus.scmd', Scmd.FIELDBUS)
        rig.far.trip(OVERLOAD)
        rig.connect()
        rig.acknowledged = 1
        rig.result(rig.drive.acknowledge())
        rig.pass_time(1.0)
        assert rig.far.control_unit.scmd == Scmd.STOP and not rig.drive.stop_unconfirmed


def test_a_stop_during_the_start_delay_ends_the_enable() -> None:
    with Rig(parameters={'control.run_dly': 20}) as rig:
        rig.connect()
        enable, unit = rig.drive.enable(), rig.far.control_unit
        rig.wait_until(lambda: unit.inv_st == unit.delayed)
        rig.send(20.0)
        rig.result(rig.drive.stop())
        assert rig.answer(enable) == 'it was stopped while it was being enabled'
        rig.pass_time(30.0)
        assert not rig.far.motor.driven


@pytest.mark.parametrize('exits', [False, True])
def test_a_stop_while_the_drive_restarts_is_carried_out_when_it_is_back(exits: bool) -> None:
    # it gets no answer and then refusals, for the bus has lost control; at an exit nothing polls
    with Rig() as rig:
        rig.turn()
        rig.far.power_cycle(5.0)
        stop = rig.drive.disconnect(0.1) if exits else rig.drive.stop()
        assert 'NOT confirmed' in rig.answer(stop)
        rig.pass_time(8.0)
        assert not rig.drive.stop_unconfirmed and not rig.drive.following
        assert not rig.far.motor.driven
        assert rig.drive.snapshot.connected is not exits
