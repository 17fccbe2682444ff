# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a G2 and an Optimal share: who commands, and what their status says of it."""

import pytest

from nfo_sinus_driver.simulator.drive import describe
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Reason

#: While the start is delayed [M0 table 19], [M1].
DELAYED = {'sinus_g2': 25, 'sinus_optimal': 54}
each = pytest.mark.parametrize('model', DELAYED)


@each
def test_the_status_says_who_commands_and_what_the_motor_does(model, make_bench):
    bench = make_bench(model, run_input=False)
    shown = [bench.shown()]
    bench.mode(2)
    shown.append(bench.shown())
    assert bench.drive.control_unit.mode_ext_writes == 1 and not bench.running
    for active in (True, False):
        bench.drive.set_run_input(active)
        shown += [bench.shown(), bench.shown(6.0)]
    assert shown == [24, 33, 35, 34, 36, 33] and not bench.drive.motor.turning
    bench.drive.control_unit.press('start')
    shown = [bench.shown(), bench.shown(6.0)]
    bench.drive.control_unit.press('stop')
    assert [*shown, bench.shown()] == [31, 30, 24]
    bench = make_bench(model)
    bench.mode(3)
    shown = [bench.shown()]
    bench.run(30.0)
    shown += [bench.shown(1.0), bench.shown(5.0)]
    bench.setpoint(20.0)
    shown += [bench.shown(0.1), bench.shown(5.0)]
    bench.scmd(0)
    assert [*shown, bench.shown(), bench.shown(5.0)] == [37, 39, 38, 40, 38, 40, 37]
    assert not bench.drive.motor.turning


@each
def test_who_takes_control_ends_the_run_command(model, make_bench):
    for key, shown in ((None, 34), ('ext', 34), ('stop', 24), ('start', 30)):
        bench = make_bench(model)
        bench.run(20.0, 6.0)
        if key:
            bench.drive.control_unit.press(key)
        else:
            bench.mode(2)
        assert bench.shown(20.0) == shown
        with bench.refuses(Reason.STATE):
            bench.scmd(0x101)
        bench.mode(3)
        assert bench.shown(20.0) == 37, 'it stops, and waits for a new one'


@each
def test_a_start_is_delayed_again_after_a_lost_run_input_and_a_fault(model, make_bench):
    bench = make_bench(model, settings={'control.run_dly': 3}, run_command_in_fault='keeps')
    bench.run(20.0)
    assert bench.shown(2.9) == DELAYED[model] and not bench.running
    assert bench.shown(0.2) == 39
    bench.drive.set_run_input(False)
    bench.drive.set_run_input(True)
    assert bench.shown(2.9) == DELAYED[model] and bench.shown(0.2) in (38, 39)
    bench.drive.trip(5)
    assert bench.shown(10.0) == 5
    bench.drive.read_raw('fieldbus.inv_st_with_ack')
    assert bench.shown(2.9) == DELAYED[model] and bench.shown(0.2) == 39


@each
def test_a_limit_and_the_chopper_are_shown_in_place_of_what_it_does(model, make_bench):
    bench = make_bench(model)
    bench.drive.motor.load = 0.05
    bench.run(50.0, 8.0)
    before = bench.drive.counters.brake_time
    bench.drive.set_from_keypad('control.retard', 0.4)
    bench.setpoint(0.0)
    assert 26 in {bench.shown(0.005) for _ in range(100)}
    assert 0 < bench.drive.counters.brake_time - before < 0.5
    bench.setpoint(40.0)
    bench.shown(8.0)
    bench.drive.motor.load = 5.0
    assert bench.shown(1.0) == 27
    assert bench.drive.control_unit.status_word & 1 << 11


@each
def test_released_it_coasts_and_shows_no_speed(model, make_bench):
    bench = make_bench(model, settings={'control.st_mode': 'Release'})
    bench.run(30.0, 6.0)
    bench.scmd(0)
    assert not bench.running and bench.shown(0.1) == 37
    assert bench.drive.motor.turning and bench.drive.motor.speed == 0


@each
def test_with_autostart_the_terminals_start_it_after_power_on(model, make_bench):
    for run_input, shown in ((True, 35), (False, 33)):
        bench = make_bench(model, run_input=run_input, settings={'control.auto_start': True})
        bench.mode(1)
        bench.drive.power_cycle(0.5)
        assert (bench.shown(0.6), bench.running) == (shown, run_input)


@each
def test_faults_of_the_line_take_the_run_command(model, make_bench):
    for code in (14, 15):
        bench = make_bench(model, run_command_in_fault='keeps')
        bench.run(20.0, 2.0)
        bench.drive.trip(code)
        assert bench.read('fieldbus.mode') == 1
        bench.drive.read_raw('fieldbus.inv_st_with_ack')
        # Sio Fail of a G2 goes by MODE = Stop, or with SioErr [C99]
        kept = model == 'sinus_g2' and code == 14
        assert bench.shown(20.0) == (14 if kept else 24) and not bench.running
        if kept:
            bench.mode(1)
            assert bench.shown() == 24


def test_both_report_the_same_of_themselves():
    g2, optimal = (describe(simulated_drive(model)) for model in DELAYED)
    assert g2.keys() == optimal.keys()
