# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A MOVITRAC 31.. that is commanded: by line, terminals and keypad; its faults, its variants."""

from hypothesis import given, settings, strategies as st
import movitrac_drive_bench as m
from movitrac_drive_bench import ACK, CCW, CW, ENABLE, FREQUENCY, RESET, SETPOINT, MovitracBench
import pytest
from support.examples import examples

from nfo_sinus_driver.simulator.family import load

OVERCURRENT, OVERHEATING, EXTERNAL, LINE = 1, 6, 27, 45
RESET_FUNCTION, EXTERNAL_FAULT_FUNCTION = 5, 12
OPTIONS = load('movitrac31').options


@pytest.fixture
def bench():
    return MovitracBench()


# ---- the line ----


def test_it_stands_until_a_direction_is_given_and_shows_sizes():
    for direction, clockwise in ((CW, True), (CCW, False)):
        bench = MovitracBench()
        assert bench.number == m.NO_ENABLE
        bench.run(30.0, bits=ENABLE)
        assert (bench.running, bench.number) == (False, m.NO_ENABLE)
        bench.bits(direction | ENABLE)
        assert (bench.running, bench.number) == (True, m.ENABLED)
        bench.wait(2.0)
        assert bench.read(FREQUENCY) == 30.0
        assert bench.read(m.SPEED) == pytest.approx(890, abs=10)
        assert bench.clockwise is clockwise
        assert (bench.drive.motor.rotor > 0) is clockwise


def test_ramps_are_for_50_hz(bench):
    bench.set(t11_up=2.0, t11_down=2.0)
    assert bench.write(27, 4.0) == ACK
    bench.run(50.0, seconds=1.0)
    assert bench.read(FREQUENCY) == pytest.approx(25.0, abs=0.2)
    bench.wait(1.5)
    bench.bits(ENABLE)
    bench.wait(1.0)
    assert bench.number == m.NORMAL_STOP
    assert bench.read(FREQUENCY) == pytest.approx(25.0, abs=0.2)
    bench.wait(1.5)
    assert (bench.number, bench.running) == (m.NO_ENABLE, False)
    bench.bits(CW | ENABLE | m.SECOND_RAMP)
    bench.wait(1.0)
    assert bench.read(FREQUENCY) == pytest.approx(12.5, abs=0.2)
    bench.bits(CW | CCW | ENABLE)
    assert bench.number == m.NORMAL_STOP, 'both directions'


def test_a_lost_enable_is_a_rapid_stop_and_one_that_comes_back_starts_the_motor(bench):
    bench.set(t11_down=20.0, t13_stop=0.8)
    bench.run(25.0)
    bench.terminal(43, False)
    assert bench.number == m.RAPID_STOP
    bench.wait(0.2)
    assert bench.read(FREQUENCY) == pytest.approx(12.5, abs=0.5)
    bench.until(lambda: bench.number == m.NO_ENABLE)
    assert not bench.running
    bench.terminal(43, True)
    assert bench.running, 'by the bits that are there'
    for mode in (0, 1, 2, 3):
        bench = MovitracBench()
        bench.run(25.0)
        bench.write(m.CONTROL_MODE, mode)
        bench.terminal(41, mode != 2)
        bench.wait(0.5)
        bench.drive.set_run_input(False)
        bench.wait(2.0)
        assert not bench.drive.motor.turning, mode
        bench.drive.set_run_input(True)
        assert bench.running is (mode != 3)
    assert not MovitracBench(run_input=False).drive.control_unit.run_input


def test_another_direction_goes_through_zero(bench):
    bench.run(25.0)
    bench.bits(CCW | ENABLE)
    bench.wait(0.1)
    assert bench.number == m.CHANGE_DIRECTION
    assert bench.clockwise
    bench.until(lambda: bench.number == m.ENABLED)
    assert not bench.clockwise
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 25.0
    assert bench.drive.motor.rotor < 0


def test_the_controller_inhibit_lets_the_motor_coast(bench):
    bench.run(50.0)
    bench.bits(CW | ENABLE | m.INHIBIT)
    assert (bench.number, bench.running) == (m.CONTROLLER_INHIBIT, False)
    assert bench.drive.motor.turning
    assert bench.read(FREQUENCY) == 0
    bench.bits(CW | ENABLE)
    assert bench.number == m.ENABLED
    assert bench.write(m.INPUT_47, 11) == ACK
    assert bench.number == m.CONTROLLER_INHIBIT, 'its terminal is open'
    bench.terminal(47, True)
    assert bench.number == m.ENABLED


def test_the_set_point_is_followed_within_f_min_and_f_max(bench):
    bench.run(400.0)
    for setpoint, frequency in ((400.0, 50.0), (25.0, 25.0), (10.05, 10.05), (0.0, 5.0)):
        bench.write(m.F_MIN, 5.0)
        assert bench.write(SETPOINT, setpoint) == ACK
        bench.wait(2.0)
        assert bench.read(FREQUENCY) == frequency
        if frequency >= 25.0:
            assert bench.read(m.MOTOR_VOLTAGE) == pytest.approx(8 * frequency, abs=5)


def test_the_second_set_counts_where_its_selection_is_enabled(bench):
    bench.write(84, 30.0)  # f_max 2
    bench.run(50.0, bits=CW | ENABLE | m.SECOND_SET)
    assert bench.read(FREQUENCY) == 50.0
    assert bench.write(116, 1) == ACK
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 30.0
    assert bench.ask(284)[3] & 0x08


def test_v_over_f_pattern_3_has_limits_of_its_own(bench):
    assert bench.write(88, 0) == ACK
    assert bench.write(85, 8.0) == bench.write(86, 100) == bench.write(87, 90.0) == ACK
    bench.run(400.0, seconds=3.0)
    assert bench.read(FREQUENCY) == 90.0
    assert bench.read(1) == pytest.approx(360, abs=5), 'it is 400 V at 100 Hz'
    bench.write(SETPOINT, 0)
    bench.wait(3.0)
    assert bench.read(FREQUENCY) == 8.0


def test_magnetization_dc_braking_holding_and_heating_current():
    bench = MovitracBench()
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


# ---- what commands it ----


def test_the_terminals_command_in_standard_mode(bench):
    bench.terminal(41, True)
    bench.drive.power_cycle(0.0)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 25.0, 'half of f_max, by the analog input'
    bench.terminal(47, True)
    bench.wait(2.0)
    assert bench.read(FREQUENCY) == 5.0, 'the fixed set-point n11'
    bench.terminal(41, False)
    bench.terminal(42, True)
    bench.until(lambda: not bench.clockwise)
    bench.terminal(43, False)
    bench.until(lambda: not bench.running)


def test_the_set_point_alone_comes_from_the_line_in_remote_set_point(bench):
    bench.terminal(41, True)
    bench.write(m.CONTROL_MODE, m.REMOTE_SETPOINT)
    bench.write(SETPOINT, 12.0)
    bench.bits(CCW)
    bench.wait(3.0)
    assert bench.read(FREQUENCY) == 12.0
    assert bench.clockwise and bench.running


def test_a_direction_terminal_turns_the_motor_in_remote_control(bench):
    bench.terminal(41, True)
    bench.take(10.0)
    bench.wait(1.0)
    assert bench.read(FREQUENCY) == 10.0
    bench.bits(CCW | ENABLE)
    assert bench.number == m.NORMAL_STOP, 'with the terminal it is both'
    bench.write(m.CONTROL_MODE, m.FIELDBUS)
    bench.until(lambda: not bench.running)
    bench.write(m.CONTROL_MODE, m.STANDARD)
    assert bench.running, 'another control mode can start the motor'


def test_a_reassigned_terminal_42_turns_nothing(bench):
    bench.take(10.0)
    bench.set(input_42=9)
    bench.terminal(42, True)
    assert not bench.running
    assert bench.write(m.INPUT_42, 0) == ACK
    assert bench.running


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


def test_the_terminals_are_shown_and_there_are_more_with_an_option_card(bench):
    outputs = 0x0100 | 0x0200
    assert bench.word(m.TERMINALS) & 0xFF == 0b0100
    for number in (41, 42, 47):
        bench.terminal(number, True)
    assert bench.word(m.TERMINALS) & 0xFF == 0b1111
    bench.terminal(42, False)
    assert bench.running
    assert bench.word(m.TERMINALS) & outputs == outputs, 'brake released, ready'
    with pytest.raises(ValueError, match='no binary input 54'):
        bench.terminal(54, True)
    bench = MovitracBench(option_card='fio')
    assert bench.write(323, 1) == ACK  # terminal 54: enable
    bench.terminal(43, False)
    bench.terminal(54, True)
    assert bench.word(m.TERMINALS) & 0x40000
    bench.run(10.0)
    assert bench.running


# ---- faults ----


@pytest.fixture
def running(bench):
    bench.run(25.0)
    return bench


def trip(bench, fault, **more):
    bench.drive.trip(100 + fault, **more)


def test_a_fault_lets_the_motor_coast_and_a_rising_bit_resets(running):
    for bits, fault in ((0, 1), (RESET, 0)):
        trip(running, OVERCURRENT)
        assert (running.fault, running.number) == (OVERCURRENT, m.CONTROLLER_INHIBIT)
        assert not running.running
        running.bits(bits)
        assert running.fault == fault
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


def test_no_reset_while_the_cause_lasts(running):
    for fault in (OVERHEATING, EXTERNAL):
        trip(running, fault, cause_present=True)
        running.bits(RESET)
        assert running.fault == fault
        running.bits(0)
        running.drive.faults.end_causes()
        assert running.fault == fault
        running.bits(RESET)
        assert running.fault == 0
        running.bits(0)


def test_terminal_and_keypad_reset_where_they_may(running):
    trip(running, OVERCURRENT)
    running.terminal(47, True)
    running.set(input_47=RESET_FUNCTION)
    assert running.fault == OVERCURRENT, 'an edge of the terminal it is that resets'
    running.terminal(47, False)
    running.terminal(47, True)
    assert (running.fault, running.running) == (0, True), 'the bits are still there'
    trip(running, OVERCURRENT)
    running.terminal(41, True)
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


def test_it_remembers_five_faults_and_what_was_measured(running):
    assert running.read(m.FAULT_T0) == 0
    trip(running, OVERCURRENT)
    trip(running, OVERCURRENT)
    assert (running.read(m.FAULT_T0), running.read(m.FAULT_T1)) == (OVERCURRENT, 0), 'once'
    assert running.read(403) == 25.0, 'the frequency'
    assert running.read(402) == running.read(m.HEAT_SINK)
    assert running.read(400) == pytest.approx(560, abs=20)
    assert running.word(407) >> 24 == OVERCURRENT
    assert running.word(408) & 0xFF == 0b0100
    for fault in (2, 3, 4, 5, 6):
        running.bits(0)
        running.bits(RESET)
        trip(running, fault)
    assert [running.read(index) for index in range(8, 13)] == [6, 5, 4, 3, 2]
    assert running.read(412) == 0
    running.drive.power_cycle(0.0)
    assert (running.read(m.FAULT_T0), running.fault) == (6, 0), 'that is the memory'


# ---- PC time-out ----


def test_a_silent_line_is_fault_45(running):
    running.set(pc_timeout=1.0)
    running.wait(0.9)
    assert running.fault == 0
    running.wait(0.9)
    assert running.running, 'asking has kept it alive'
    running.wait(0.2)
    assert not running.running
    running.unit.press('reset')
    assert running.drive.faults.codes == [100 + LINE], 'the line is silent'
    assert running.fault == LINE
    running.bits(0)
    running.bits(RESET)
    assert running.fault == 0, 'the line speaks again, so the cause is gone'
    for mode, timeout in ((m.STANDARD, 0.1), (m.REMOTE_CONTROL, 0.0)):
        running.set(control_mode=mode, pc_timeout=timeout)
        running.wait(60.0)
        assert running.fault == 0, 'the line has no say, or there is no time'


def test_fault_45_can_ramp_the_motor_down():
    bench = MovitracBench(timeout_stop='ramps')
    bench.set(t13_stop=1.0)
    bench.run(25.0)
    bench.set(pc_timeout=1.0)
    bench.wait(1.1)
    assert (bench.fault, bench.number, bench.running) == (LINE, m.RAPID_STOP, True)
    assert 10.0 < bench.read(FREQUENCY) < 25.0
    bench.wait(0.9)
    assert (bench.fault, bench.number, bench.running) == (LINE, m.CONTROLLER_INHIBIT, False)
    bench = MovitracBench(timeout_stop='ramps')
    bench.run(25.0)
    bench.set(pc_timeout=1.0)
    bench.wait(1.05)
    assert bench.running
    trip(bench, OVERCURRENT)
    assert not bench.running, 'another fault lets it coast'


# ---- what the manual leaves open ----


def test_how_status_and_fault_stand_in_their_bytes():
    for numbers, stop, fault in (('binary', 12, 45), ('bcd', 0x12, 0x45)):
        bench = MovitracBench(status_numbers=numbers)
        bench.run(25.0)
        bench.bits(ENABLE)
        assert bench.number == stop
        trip(bench, LINE)
        assert bench.fault == fault
        assert bench.read(8) == 45, 'the fault memory is decimal in any case'


def test_the_enable_bit_and_the_enable_terminal():
    for enable_bit, without_bit, without_terminal in (
        ('ored', True, False), ('anded', False, False), ('either', True, True)
    ):
        bench = MovitracBench(enable_bit=enable_bit)
        bench.run(25.0)
        assert bench.running
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
        bench.unit.press('reset')
        assert bench.running is kept


def test_a_switch_has_no_other_positions():
    for option in OPTIONS:
        for choice in option.choices:
            MovitracBench(**{option.name: choice})
        with pytest.raises(ValueError, match=option.name):
            MovitracBench(**{option.name: 'sideways'})


# ---- in any order ----

WRITES = {
    SETPOINT: (0, 5, 25, 400), m.CONTROL_MODE: (0, 1, 2, 2, 2, 3), m.PC_TIMEOUT: (0, 0.3, 5),
    m.INPUT_42: (0, 1, 9, 11, 12, 16), m.INPUT_47: (3, 5, 10, 11, 12), m.F_MIN: (0, 5),
    m.F_MAX: (20, 50), m.T13_STOP: (0, 0.5, 5), 116: (0, 1), 168: (0, 1), 180: (0, 1),
    186: (0, 1), 203: (0, 1), 277: (0, 100),
}
EVENTS = st.lists(
    st.one_of(
        st.sampled_from(sorted(WRITES)).flatmap(
            lambda index: st.tuples(
                st.just('write'), st.just(index), st.sampled_from(WRITES[index])
            )
        ),
        st.tuples(st.just('bits'), st.sampled_from([0, 1, 2, 5, 6, 7, 0x40, 0x105, 0x1005, 0xD])),
        st.tuples(st.just('terminal'), st.sampled_from([41, 42, 43, 47]), st.booleans()),
        st.tuples(
            st.just('press'),
            st.sampled_from(['manual', 'automatic', 'cw', 'ccw', 'stop', 'reset']),
        ),
        st.tuples(st.just('fault'), st.sampled_from([1, 6, 27, 45]), st.booleans()),
        st.tuples(st.just('cause gone')),
        st.tuples(st.just('power')),
    ),
    max_size=25,
)


def happen(bench, what, *values):
    if what in ('write', 'bits', 'terminal'):
        getattr(bench, what)(*values)
    elif what == 'press':
        bench.unit.press(*values)
    elif what == 'fault':
        trip(bench, values[0], cause_present=values[1])
    elif what == 'cause gone':
        bench.drive.faults.end_causes()
    else:
        bench.drive.power_cycle(0.0)


def judge(bench, switches):
    state, motor = bench.unit.report(), bench.drive.motor
    ramps = switches['timeout_stop'] == 'ramps' and bench.drive.faults.codes == [145]
    if (bench.drive.faults and not ramps) or state['inhibited'] or state['phase'] == 'off':
        assert not motor.driven
    assert abs(motor.demand) <= 50.0 or not motor.driven
    assert bool(bench.ask(m.STATUS)[0]) == bool(bench.drive.faults)
    assert 0 <= bench.read(FREQUENCY) <= 60.0
    assert bench.read(m.ADDRESS) == 0


@settings(max_examples=examples(120))
@given(
    st.fixed_dictionaries({option.name: st.sampled_from(option.choices) for option in OPTIONS}),
    st.lists(st.tuples(EVENTS, st.sampled_from([0.0, 0.02, 0.4, 3.0])), max_size=3),
)
def test_what_holds_whatever_happens(switches, rounds):
    bench = MovitracBench(**switches)
    for events, pause in rounds:
        for event in events:
            happen(bench, *event)
            judge(bench, switches)
        bench.wait(pause)
        judge(bench, switches)
