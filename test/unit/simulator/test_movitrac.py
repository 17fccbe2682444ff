# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A MOVITRAC 31.. that is commanded: ramps, terminals, keypad, its faults, and its variants."""

import movitrac_drive_bench as m
from movitrac_drive_bench import ACK, CCW, CW, ENABLE, FREQUENCY, RESET, SETPOINT, MovitracBench
import pytest

OVERCURRENT, EXTERNAL, LINE = 1, 27, 45
RESET_FUNCTION, EXTERNAL_FAULT_FUNCTION, INHIBIT_FUNCTION = 5, 12, 11


@pytest.fixture
def bench():
    return MovitracBench()


@pytest.fixture
def running(bench):
    bench.run(25.0)
    return bench


def trip(bench, fault, **more):
    bench.drive.trip(100 + fault, **more)


# ---- what it does ----


def test_ramps_are_for_50_hz_and_go_through_zero(bench):
    bench.set(t11_up=2.0, t11_down=2.0)
    assert bench.write(27, 4.0) == ACK
    bench.run(50.0, seconds=1.0)
    assert bench.read(FREQUENCY) == pytest.approx(25.0, abs=0.2)
    bench.wait(1.5)
    bench.bits(ENABLE)
    bench.wait(1.0)
    assert bench.number == m.NORMAL_STOP
    assert bench.read(FREQUENCY) == pytest.approx(25.0, abs=0.2)
    bench.bits(CW | ENABLE)
    bench.wait(1.5)
    bench.bits(CCW | ENABLE)
    bench.wait(0.1)
    assert bench.number == m.CHANGE_DIRECTION and bench.clockwise
    bench.until(lambda: bench.number == m.ENABLED)
    assert not bench.clockwise
    bench.bits(ENABLE)
    bench.until(lambda: not bench.running)
    bench.bits(CW | ENABLE | m.SECOND_RAMP)
    bench.wait(1.0)
    assert bench.read(FREQUENCY) == pytest.approx(12.5, abs=0.2)
    bench.bits(CW | CCW | ENABLE)
    assert bench.number == m.NORMAL_STOP, 'both directions'


def test_the_set_of_parameters_that_is_chosen_has_its_limits(bench):
    bench.write(84, 30.0)  # f_max 2
    bench.run(50.0, bits=CW | ENABLE | m.SECOND_SET)
    assert bench.read(FREQUENCY) == 50.0
    assert bench.write(116, 1) == ACK, 'the selection of a set is enabled'
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 30.0
    assert bench.ask(m.STATUS)[3] & 0x08
    bench = MovitracBench()
    # V/f pattern 3 is one for both
    assert bench.write(88, 0) == ACK
    assert bench.write(85, 8.0) == bench.write(86, 100) == bench.write(87, 90.0) == ACK
    bench.run(400.0, seconds=3.0)
    assert bench.read(FREQUENCY) == 90.0
    assert bench.read(1) == pytest.approx(360, abs=5), 'it is 400 V at 100 Hz'
    bench.write(SETPOINT, 0)
    bench.wait(3.0)
    assert bench.read(FREQUENCY) == 8.0


def test_magnetization_dc_braking_holding_and_heating_current(bench):
    for index in (277, 278):
        assert bench.write(index, 300) == ACK
    bench.run(25.0, seconds=0.2)
    assert (bench.number, bench.read(FREQUENCY)) == (2, 0)
    bench.wait(0.2)
    assert bench.number == m.ENABLED
    bench.bits(ENABLE)
    bench.until(lambda: bench.number == 3)
    bench.wait(0.35)
    assert bench.number == m.NO_ENABLE
    bench = MovitracBench()
    assert bench.write(180, 1) == bench.write(181, 0.5) == bench.write(182, 20) == ACK
    bench.run(25.0)
    bench.bits(ENABLE)
    assert bench.number == 6
    bench.wait(1.0)
    assert (bench.number, bench.running, bench.drive.motor.turning) == (7, True, False)
    bench.terminal(43, False)
    assert not bench.running
    bench = MovitracBench()
    assert bench.write(186, 1) == ACK
    for closed, number in ((False, 5), (True, m.NO_ENABLE)):
        bench.terminal(43, closed)
        assert (bench.number, bench.running) == (number, not closed)


# ---- terminals and keypad ----


def test_terminals_command_beside_the_line(bench):
    bench.terminal(41, True)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 25.0, 'half of f_max, by the analog input'
    bench.terminal(47, True)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 5.0, 'the fixed set-point n11'
    bench.terminal(47, False)
    bench.take(10.0)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 10.0, 'that of the line'
    bench.bits(CCW | ENABLE)
    assert bench.number == m.NORMAL_STOP, 'with the terminal it is both'
    bench.write(m.CONTROL_MODE, m.FIELDBUS)
    bench.until(lambda: not bench.running)
    bench.write(m.CONTROL_MODE, m.STANDARD)
    assert bench.running, 'another control mode can start the motor'
    bench.terminal(41, False)
    bench.set(input_42=9)
    bench.terminal(42, True)
    bench.until(lambda: not bench.running)
    assert bench.write(m.INPUT_42, 0) == ACK
    assert bench.running, 'its function counts, not its number'
    assert bench.write(m.INPUT_47, INHIBIT_FUNCTION) == ACK
    assert bench.number == m.CONTROLLER_INHIBIT, 'it acts while it is open'
    bench.terminal(47, True)
    assert bench.number == m.ENABLED


def test_an_option_card_brings_terminals(bench):
    with pytest.raises(ValueError, match='no binary input 54'):
        bench.terminal(54, True)
    bench = MovitracBench(option_card='fio')
    assert bench.write(323, 1) == ACK  # terminal 54: enable
    bench.terminal(43, False)
    bench.terminal(54, True)
    assert bench.word(m.TERMINALS) & 0x40000
    bench.run(10.0)
    assert bench.running
    assert bench.word(m.TERMINALS) & 0x300 == 0x300, 'brake released, ready'


def test_the_keypad_takes_over_and_gives_back(bench):
    bench.unit.press('cw')
    assert not bench.running, 'automatic operation has no use for it'
    bench.run(25.0)
    bench.unit.press('manual')
    assert bench.read(m.MANUAL_OPERATION) == 1
    assert bench.number == m.NORMAL_STOP, 'no key has chosen a direction'
    bench.until(lambda: not bench.running)
    bench.unit.press('ccw')
    bench.wait(2.0)
    assert bench.word(197) == 1
    assert bench.drive.motor.rotor < 0
    bench.unit.press('stop')
    bench.until(lambda: not bench.running)
    bench.unit.press('automatic')
    assert bench.running, 'the bits are still there'
    bench.unit.press('manual')
    bench.unit.press('cw')
    bench.drive.power_cycle(0.0)
    assert (bench.read(m.MANUAL_OPERATION), bench.running) == (1, False)


# ---- faults; those that are remembered are in test_movitrac_manual.py ----


def test_a_rising_bit_resets_in_remote_control_alone(running):
    assert running.read(m.FAULT_T0) == 0
    trip(running, OVERCURRENT)
    trip(running, OVERCURRENT)
    assert running.read(m.FAULT_T1) == 0, 'remembered once'
    running.bits(RESET)
    assert running.fault == 0
    trip(running, OVERCURRENT)
    running.bits(RESET)
    assert running.fault == OVERCURRENT, 'it was set before'
    running.bits(0)
    running.bits(CW | ENABLE | RESET)
    assert (running.fault, running.running) == (0, True), 'run bits start the motor with it'
    running.bits(0)
    running.set(control_mode=m.STANDARD)
    trip(running, OVERCURRENT)
    running.bits(RESET)
    assert running.fault == OVERCURRENT, 'in another control mode it is not read'


def test_it_remembers_five_faults_through_power_off(running):
    for fault in (1, 2, 3, 4, 5, 6):
        trip(running, fault)
        running.unit.press('reset')
    running.drive.power_cycle(0.0)
    assert [running.read(index) for index in range(8, 13)] == [6, 5, 4, 3, 2]


def test_terminal_and_keypad_reset_where_they_may(running):
    trip(running, OVERCURRENT)
    running.terminal(47, True)
    running.set(input_47=RESET_FUNCTION)
    assert running.fault == OVERCURRENT, 'an edge of the terminal it is that resets'
    running.terminal(47, False)
    running.terminal(47, True)
    assert (running.fault, running.running) == (0, True), 'the bits are still there'
    trip(running, OVERCURRENT)
    for allowed in (0, 1):
        assert running.fault == OVERCURRENT
        assert running.write(166, allowed) == ACK
        running.unit.press('reset')
        assert running.fault == (0 if allowed else OVERCURRENT)


def test_auto_reset_starts_the_motor_again_after_a_while(running):
    assert running.write(168, 1) == running.write(167, 3) == ACK
    trip(running, OVERCURRENT, cause_present=True)
    running.wait(5.0)
    running.drive.faults.end_causes()
    running.wait(2.9)
    assert running.fault == OVERCURRENT, 'it counts from when the cause has gone'
    running.wait(0.2)
    assert (running.fault, running.running) == (0, True)


def test_an_external_fault_lasts_as_long_as_its_terminal_is_open(running):
    running.terminal(47, True)
    running.set(input_47=EXTERNAL_FAULT_FUNCTION)
    assert running.running
    for closed in (False, True):
        running.terminal(47, closed)
        assert running.fault == EXTERNAL
        running.bits(0)
        running.bits(RESET)
        assert running.fault == (0 if closed else EXTERNAL)


def test_a_silent_line_is_fault_45_until_it_speaks_and_where_it_has_a_say(running):
    running.set(pc_timeout=1.0)
    running.wait(1.1)
    running.unit.press('reset')
    assert running.drive.faults.codes == [100 + LINE], 'the line is silent'
    assert running.fault == LINE
    running.bits(0)
    running.bits(RESET)
    assert running.fault == 0
    for mode, timeout in ((m.STANDARD, 0.1), (m.REMOTE_CONTROL, 0.0)):
        running.set(control_mode=mode, pc_timeout=timeout)
        running.wait(60.0)
        assert running.fault == 0


# ---- what the manual leaves open ----


def test_fault_45_alone_can_ramp_the_motor_down():
    bench = MovitracBench(timeout_stop='ramps')
    bench.set(t13_stop=1.0)
    bench.run(25.0)
    bench.set(pc_timeout=1.0)
    bench.wait(1.1)
    assert (bench.fault, bench.number, bench.running) == (LINE, m.RAPID_STOP, True)
    assert 10.0 < bench.read(FREQUENCY) < 25.0
    bench.wait(0.9)
    assert (bench.fault, bench.number, bench.running) == (LINE, m.CONTROLLER_INHIBIT, False)
    bench.bits(0)
    bench.bits(RESET)
    bench.run(25.0, seconds=0.9)
    bench.wait(0.15)
    assert bench.running and bench.fault == LINE
    trip(bench, OVERCURRENT)
    assert not bench.running, 'another fault lets it coast'


def test_how_status_and_fault_stand_in_their_bytes():
    for numbers, stop, fault in (('binary', 12, 45), ('bcd', 0x12, 0x45)):
        bench = MovitracBench(status_numbers=numbers)
        bench.run(25.0)
        bench.bits(ENABLE)
        assert bench.number == stop
        trip(bench, LINE)
        assert bench.fault == fault
        assert bench.read(m.FAULT_T0) == 45, 'the fault memory is decimal in any case'


def test_the_enable_bit_and_the_enable_terminal():
    for enable_bit, without_bit, without_terminal in (
        ('ored', True, False), ('anded', False, False), ('either', True, True)
    ):
        bench = MovitracBench(enable_bit=enable_bit)
        bench.run(25.0)
        bench.bits(CW)
        assert bench.number == (m.ENABLED if without_bit else m.RAPID_STOP), enable_bit
        bench.wait(3.0)
        assert bench.running is without_bit, enable_bit
        bench.bits(CW | ENABLE)
        bench.wait(1.0)
        assert bench.running
        bench.terminal(43, False)
        bench.wait(3.0)
        assert bench.running is without_terminal, enable_bit
        bench.bits(CW)
        bench.wait(3.0)
        assert not bench.running


def test_what_the_mode_has_no_use_for_is_ignored_refused_or_followed_later():
    for treatment, answer, kept in (
        ('ignored', ACK, False), ('refused', m.nack(0x1B), False), ('taken', ACK, True)
    ):
        bench = MovitracBench(outside_remote_control=treatment)
        trip(bench, OVERCURRENT)
        assert bench.bits(RESET) == bench.bits(0) == answer
        assert bench.fault == OVERCURRENT, 'a bit that waits for the mode is no edge'
        bench.unit.press('reset')
        assert bench.write(SETPOINT, 20.0) == bench.bits(CW | ENABLE) == answer
        assert bench.read(SETPOINT) == 20.0 * kept
        assert bench.word(281) == (CW | ENABLE) * kept
        bench.write(m.CONTROL_MODE, m.REMOTE_SETPOINT)
        assert bench.write(SETPOINT, 20.0) == ACK, treatment
        assert bench.bits(CW | ENABLE) == answer
        bench.write(m.CONTROL_MODE, m.REMOTE_CONTROL)
        assert bench.running is kept
        bench.write(m.CONTROL_MODE, m.STANDARD)
        assert bench.write(SETPOINT, 20.0) == answer


def test_what_is_shown_with_an_enable_and_no_direction():
    for stop_status, on_the_way, standing in (
        ('no_enable', m.NORMAL_STOP, m.NO_ENABLE),
        ('normal_stop', m.NORMAL_STOP, m.NORMAL_STOP),
        ('enable', m.ENABLED, m.ENABLED),
    ):
        bench = MovitracBench(stop_status=stop_status)
        bench.run(25.0)
        bench.bits(ENABLE)
        assert bench.number == on_the_way
        bench.until(lambda bench=bench: not bench.running)
        assert bench.number == standing
        bench.terminal(43, False)
        assert bench.number == m.NO_ENABLE


def test_bits_and_set_point_after_power_on_and_after_a_fault():
    for after, kept in (('cleared', False), ('kept', True)):
        bench = MovitracBench(bits_after_power_on=after)
        bench.run(25.0, bits=CCW | ENABLE)
        bench.drive.power_cycle(1.0)
        bench.wait(2.0)
        assert bench.read(m.CONTROL_MODE) == m.REMOTE_CONTROL
        assert bench.word(281) == (CCW | ENABLE) * kept
        assert bench.read(SETPOINT) == 25.0 * kept
        assert bench.running is kept
        bench = MovitracBench(bits_in_fault=after)
        bench.run(25.0)
        trip(bench, OVERCURRENT)
        assert bench.word(281) == (CW | ENABLE) * kept
