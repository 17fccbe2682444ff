# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated Sinus Optimal against its manual [M1]: registers, MODE and SMODE, Drive Control."""

import struct

from optimal_bench import (
    ALARM,
    AUTO,
    BRAKE,
    BUS,
    CONTROL_FREQUENCY,
    CONTROL_SPEED,
    DISABLED,
    DRIVE_CONTROL,
    DRIVE_STATUS,
    ENABLED,
    FAULT,
    FROM_BUS,
    INPUT_FREQUENCY,
    INPUT_SPEED,
    LIMIT,
    MANUAL,
    MODE,
    REACHED,
    READY,
    REVERSE,
    ROTOR_SPEED,
    RUN_INPUT,
    RUN_TERMINAL,
    SLEEP,
    SMODE,
    STATOR_FREQUENCY,
    STATUS,
    STATUS_WITH_ACK,
    STOP,
    STOPPING,
    SWITCHED_ON,
    OptimalBench,
)
import pytest

from nfo_sinus_driver.families.sinus_optimal import words
from nfo_sinus_driver.simulator.drive import describe

SLAVE_DEVICE_FAILURE = 4
ILLEGAL_VALUE = 3
FAULTS = [*range(1, 7), *range(8, 24), 48, 49, 50, 51]
ALARMS = [7, 53, 55, 56, 57]
SIO_FAIL, BUS_FAIL = 14, 15
#: Words of Drive Control.
CONTROL = 0x4000
ENABLE = CONTROL | 0x0008
ON = ENABLE | 0x0001


@pytest.fixture
def optimal():
    return OptimalBench()


# ---- the bus ----

#: What is asked, and the answer.
ANSWERS = {
    # MODE, by both read functions, and both words of a 32-bit value
    '03 0294 0001': '03 02 0001',
    '04 0294 0001': '04 02 0001',
    '03 03EC 0002': '03 04 0000 0000',
    '04 03F0 0002': '04 04 0000 0000',
    # 1234.5 h and 321 h at 36 s a tick, the low word first
    '03 02A8 0002': '03 04 E23A 0001',
    '03 02AC 0002': '03 04 7D64 0000',
    '06 03FC FF9C': '06 03FC FF9C',
    '10 0294 0001 02 0003': '10 0294 0001',
    # no such function: only 03, 04, 06 and 16
    **{f'{code:02X} 0294 0001': f'{code | 0x80:02X} 01' for code in (1, 2, 5, 15, 22, 24)},
    '17 0294 0001 0294 0001 02 0003': '97 01',
    '2B 0E 01 00': 'AB 01',
    '11': '91 01',
    # one ADI with its own length
    '03 03EC 0001': '83 02',
    '03 03ED 0001': '83 02',
    '03 0294 0002': '83 02',
    '04 02A4 0002': '84 02',
    '03 0295 0001': '83 02',
    # registers that the manual does not list, settings of the G2 among them
    '03 027E 0002': '83 02',
    '03 0234 0001': '83 02',
    '03 0250 0002': '83 02',
    '04 0294 0000': '84 03',
    # read only
    **{f'06 {register} 0001': '86 02' for register in ('0400', '0518', '0260', '0258', '02A4')},
    '10 02A8 0002 04 0000 0000': '90 02',
}


def test_every_request_is_answered_by_the_manual():
    for treatment in ('known', 'refused'):
        found = {
            request: OptimalBench(newer_functions=treatment).ask(request).hex(' ')
            for request in ANSWERS
        }
        assert found == {one: bytes.fromhex(other).hex(' ') for one, other in ANSWERS.items()}


def test_everything_that_the_manual_lists_can_be_read(optimal):
    single = (0x3F4, 0x400, 0x518, 0x264, 0x260, 0x294, 0x3FC, 0x25C, 0x2A4, 0x2A5, 0x254, 0x258)
    for register in (*single, 0x3EC, 0x3F0, 0x2A8, 0x2AC):
        count = 1 if register in single else 2
        for function in (3, 4):
            answer = optimal.ask(struct.pack('>BHH', function, register, count))
            assert answer[:2] == bytes((function, 2 * count)), hex(register)


def test_counters_tick_every_36_seconds(optimal):
    optimal.run(20, 360)
    assert optimal.ask('03 02A8 0002') == bytes.fromhex('03 04 E244 0001')
    assert optimal.ask('03 02AC 0002') == bytes.fromhex('03 04 7D6E 0000')


# ---- MODE and SMODE ----


def test_codes_that_are_none_and_codes_at_the_wrong_time():
    optimal = OptimalBench(run_input=False)
    assert [optimal.refusal(MODE, code) for code in (0, 4, 0x101, 0xFFFF)] == 4 * [ILLEGAL_VALUE]
    for mode in (MANUAL, AUTO):
        optimal.write(MODE, mode)
        for code in (STOP, RUN_TERMINAL, RUN_INPUT):
            assert optimal.refusal(SMODE, code) == SLAVE_DEVICE_FAILURE
    optimal.write(MODE, BUS)
    for code in (1, 0x41, 0x80, 0x100, 0x201, 0x800, 0x900, 0xFFFF):
        assert optimal.refusal(SMODE, code) == ILLEGAL_VALUE, code
    assert (set(words.Mode), set(words.Smode)) == ({1, 2, 3}, {STOP, RUN_TERMINAL, RUN_INPUT})


def test_after_power_on_it_stands_unless_autostart_is_on(optimal):
    assert (optimal.read(MODE), optimal.text) == (MANUAL, 'Stop')
    assert optimal.bits == READY | BRAKE
    optimal.wait(10)
    assert not optimal.running
    assert OptimalBench(settings={'control.auto_start': True}).text == 'Ext Acc'


def test_mode_auto_starts_the_motor_when_run_is_active():
    optimal = OptimalBench(run_input=False)
    optimal.write(MODE, AUTO)
    assert (optimal.text, optimal.running) == ('Ext Stby', False)
    optimal.drive.set_run_input(True)
    assert (optimal.read(MODE), optimal.text) == (AUTO, 'Ext Acc')
    assert not optimal.bits & FROM_BUS
    optimal.wait(6)
    assert (optimal.text, optimal.read(STATOR_FREQUENCY)) == ('Ext Run', 250)
    optimal.drive.set_run_input(False)
    assert optimal.text == 'Ext Ret'
    optimal.wait(6)
    assert optimal.text == 'Ext Stby'
    assert optimal.drive.control_unit.mode_ext_writes == 1


def test_mode_bus_takes_over_and_stops(optimal):
    optimal.write(MODE, AUTO)
    optimal.wait(6)
    optimal.write(MODE, BUS)
    assert optimal.text == 'Bus Ret'
    optimal.wait(6)
    assert (optimal.text, optimal.running) == ('Bus Stby', False)


def test_mode_manual_is_no_stop(optimal):
    optimal.run(40, 10)
    optimal.write(MODE, MANUAL)
    assert (optimal.read(MODE), optimal.text) == (MANUAL, 'Decel'), 'to the reference of the keypad'
    optimal.wait(10)
    assert (optimal.text, optimal.running) == ('Final Freq', True)
    optimal.drive.control_unit.press('stop')
    assert optimal.text == 'Stop'
    optimal.wait(10)
    assert not optimal.drive.motor.turning
    for mode in (BUS, MANUAL):
        optimal.write(MODE, mode)
    assert (optimal.text, optimal.running) == ('Stop', False), 'it leaves a standing motor alone'
    optimal.drive.control_unit.press('start')
    assert (optimal.text, optimal.read(MODE)) == ('Accel', MANUAL)
    optimal.drive.control_unit.press('ext')
    assert optimal.read(MODE) == AUTO


def test_run_from_the_input_setpoint(optimal):
    optimal.write(MODE, BUS)
    assert (optimal.text, optimal.bits) == ('Bus Stby', READY | FROM_BUS | BRAKE)
    optimal.write(INPUT_FREQUENCY, 300)
    assert not optimal.running
    optimal.write(SMODE, RUN_INPUT)
    optimal.wait(1)
    assert (optimal.text, optimal.bits) == ('Bus Acc', READY | SWITCHED_ON | FROM_BUS | BRAKE)
    optimal.wait(5)
    assert (optimal.text, optimal.read(STATOR_FREQUENCY)) == ('Bus Run', 300)
    assert 850 < optimal.read(ROTOR_SPEED) < 900
    assert optimal.bits == READY | SWITCHED_ON | FROM_BUS | REACHED | BRAKE
    optimal.write(INPUT_FREQUENCY, 200)
    optimal.wait(0.1)
    assert optimal.text == 'Bus Ret'
    optimal.wait(5)
    optimal.write(SMODE, STOP)
    assert optimal.text == 'Bus Ret'
    assert optimal.bits == READY | SWITCHED_ON | FROM_BUS | BRAKE | STOPPING
    optimal.wait(5)
    assert (optimal.text, optimal.bits) == ('Bus Stby', READY | FROM_BUS | BRAKE)
    assert not optimal.drive.motor.turning


def test_run_from_the_terminals(optimal):
    optimal.write(MODE, BUS)
    optimal.write(INPUT_FREQUENCY, 400)
    optimal.write(SMODE, RUN_TERMINAL)
    optimal.wait(6)
    assert optimal.read(STATOR_FREQUENCY) == optimal.read(CONTROL_FREQUENCY) == 250
    assert optimal.read(INPUT_FREQUENCY) == 400


def test_the_active_setpoint_is_another_register_than_the_input(optimal):
    optimal.run(-20, 5)
    assert optimal.read(INPUT_FREQUENCY) == optimal.read(CONTROL_FREQUENCY) == -200
    assert optimal.read(CONTROL_SPEED) == -600
    assert optimal.bits & REVERSE
    for raw in (3000, -3000):
        optimal.write(INPUT_FREQUENCY, raw)
        optimal.wait(1)
        assert optimal.read(INPUT_FREQUENCY) == raw
        assert optimal.read(CONTROL_FREQUENCY) == raw / 2, 'it is limited to 150 Hz'
    optimal.write(INPUT_FREQUENCY, 200)
    optimal.wait(20)
    assert not optimal.bits & REVERSE
    optimal.write(SMODE, STOP)
    assert (optimal.read(INPUT_FREQUENCY), optimal.read(CONTROL_FREQUENCY)) == (200, 0)


def test_run_in_speed_mode():
    optimal = OptimalBench(settings={'control.mode': 'Speed'})
    optimal.run(40)
    assert optimal.read(CONTROL_SPEED) == 0, 'the input for Frequency mode'
    optimal.write(INPUT_SPEED, -900)
    optimal.wait(6)
    assert optimal.read(ROTOR_SPEED) == optimal.read(CONTROL_SPEED) == -900
    assert optimal.text == 'Bus Run'


def test_a_stop_may_coast():
    optimal = OptimalBench(settings={'control.st_mode': 'Release'})
    optimal.run(20, 5)
    assert not optimal.bits & BRAKE
    optimal.write(SMODE, STOP)
    assert not optimal.running
    assert optimal.drive.motor.turning
    assert not optimal.bits & (SWITCHED_ON | STOPPING)


def test_without_run_nothing_runs_and_the_command_stands():
    optimal = OptimalBench(run_input=False)
    optimal.run(20, 5)
    assert optimal.bits == READY | FROM_BUS | DISABLED | BRAKE
    assert (optimal.text, optimal.running) == ('Bus Stby', False)
    optimal.drive.set_run_input(True)
    assert optimal.running
    assert not optimal.bits & DISABLED
    optimal.wait(5)
    optimal.drive.set_run_input(False)
    assert optimal.bits & (DISABLED | STOPPING) == DISABLED | STOPPING
    optimal.wait(5)
    assert not optimal.drive.motor.turning


def test_start_delay_and_sleep_show_their_own_codes():
    optimal = OptimalBench(settings={'control.run_dly': 3, 'control.f_sleep': 10})
    optimal.run(20, 1)
    assert (optimal.code, optimal.text, optimal.running) == (54, 'Delay Run', False)
    optimal.wait(7)
    assert optimal.running
    optimal.write(INPUT_FREQUENCY, 50)
    optimal.wait(5)
    assert (optimal.code, optimal.text, optimal.running) == (29, 'Sleep', False)
    assert optimal.bits == READY | FROM_BUS | SLEEP | BRAKE
    optimal.drive.set_from_keypad('control.run_dly', 0)
    optimal.write(INPUT_FREQUENCY, 200)
    optimal.wait(0.1)
    assert optimal.running
    assert not optimal.bits & SLEEP


def test_the_ramps_are_settings_of_the_machine():
    optimal = OptimalBench(settings={'control.accel': 10})
    optimal.run(20, 2)
    assert optimal.read(STATOR_FREQUENCY) == 100
    optimal.drive.set_from_keypad('control.accel', 2.5)
    optimal.wait(0.5)
    assert optimal.read(STATOR_FREQUENCY) == 200


# ---- faults and alarms ----


def test_a_fault_releases_the_motor_and_reading_02a4_acknowledges():
    for code in FAULTS:
        optimal = OptimalBench()
        optimal.run(20, 2)
        optimal.drive.trip(code, cause_present=True)
        assert not optimal.running
        assert optimal.drive.motor.turning
        assert optimal.bits & (FAULT | READY | SWITCHED_ON) == FAULT
        assert optimal.read(CONTROL_FREQUENCY) == optimal.read(CONTROL_SPEED) == 0
        optimal.wait(2)
        assert optimal.read(STATUS_WITH_ACK) == optimal.read(STATUS) == code, 'its cause lasts'
        optimal.drive.faults.end_causes()
        assert optimal.read(STATUS) == optimal.read(STATUS) == code
        assert optimal.read(STATUS_WITH_ACK) == code
        assert not optimal.bits & FAULT
        assert optimal.code < 40 and optimal.code not in FAULTS
        assert optimal.running is (code not in (SIO_FAIL, BUS_FAIL)), 'the run command stood'
    for code in (0, 24, 37, 54, 64):
        with pytest.raises(ValueError, match='no fault of sinus_optimal'):
            optimal.drive.trip(code)


def test_commands_are_taken_in_a_fault_and_hold(optimal):
    for command, runs in ((RUN_INPUT, True), (STOP, False)):
        optimal.drive.trip(5)
        optimal.write(MODE, BUS)
        optimal.write(INPUT_FREQUENCY, 200)
        optimal.write(SMODE, command)
        assert not optimal.running
        optimal.read(STATUS_WITH_ACK)
        assert optimal.running is runs


def test_an_alarm_stops_nothing_and_a_fault_is_shown_before_it(optimal):
    optimal.run(20, 5)
    for code in ALARMS:
        optimal.drive.trip(code, cause_present=True)
        assert (optimal.running, optimal.code) == (True, code)
        assert optimal.bits & (ALARM | FAULT | READY) == ALARM | READY
        state = describe(optimal.drive)
        assert (state['fault'], state['alarms']) == (0, [code])
        optimal.drive.faults.end_causes()
        assert optimal.read(STATUS_WITH_ACK) == code
        assert (optimal.text, optimal.bits & ALARM) == ('Bus Run', 0)
    optimal.drive.trip(53, cause_present=True)
    optimal.drive.trip(5)
    assert optimal.code == 5
    optimal.read(STATUS_WITH_ACK)
    assert optimal.code == 53


def test_the_current_limit_is_an_alarm(optimal):
    optimal.drive.motor.load = 3.0
    optimal.run(50, 5)
    assert optimal.text == 'Cur Limit'
    assert optimal.bits & (LIMIT | ALARM) == LIMIT | ALARM


def test_a_silent_bus_stops_the_motor():
    settings = {'serial.sio_tot': 1.0, 'serial.auto_stop': True}
    optimal = OptimalBench(settings=settings)
    optimal.run(20, 0.9)
    assert optimal.running
    optimal.wait(0.2)
    assert (optimal.text, optimal.read(MODE), optimal.running) == ('Sio Fail', MANUAL, False)


def test_power_cycle(optimal):
    for begin in (lambda: optimal.run(20, 2), lambda: optimal.switch_on(2)):
        begin()
        optimal.drive.power_cycle(1.0)
        assert not optimal.drive.listening
        optimal.wait(1.1)
        assert optimal.drive.listening
        assert (optimal.read(MODE), optimal.running) == (MANUAL, False)
        assert optimal.read(INPUT_FREQUENCY) == 200, 'a set-point stands through a power cycle'
        assert optimal.read(DRIVE_CONTROL) == 0


def test_the_state_has_the_truth_by_the_keys_of_the_g2(optimal, bench):
    assert describe(optimal.drive).keys() == describe(bench.drive).keys()
    optimal.run(20, 5)
    state = describe(optimal.drive)
    expected = {
        'model': 'sinus_optimal', 'mode': BUS, 'source': 'scmd', 'scmd': RUN_INPUT,
        'inv_st': 38, 'inv_st_text': 'Bus Run', 'state': 'OPERATION_ENABLED',
        'setpoint': 20.0, 'setpoint_key': 'fieldbus.input_freq_setpoint', 'turning': True,
        'ack_reads': 0, 'writes': {},
        'command_writes': {
            'fieldbus.mode': 1, 'fieldbus.smode': 1, 'fieldbus.input_freq_setpoint': 1,
        },
        'status_word': optimal.read(DRIVE_STATUS) & 0xFFFF,
    }
    assert {key: state[key] for key in expected} == expected
    assert state['parameters']['status.control_freq'] == 20.0
    for key, value in (('control.mode', 'Torque'), ('freque.f_fix1', 5), ('control.accel', 0)):
        with pytest.raises(ValueError, match=key):
            OptimalBench(settings={key: value})


# ---- Drive Control ----


def test_the_example_of_the_manual(optimal):
    optimal.write(INPUT_FREQUENCY, 400)
    steady = READY | FROM_BUS | BRAKE
    for word, bits, text in (
        (CONTROL, steady, 'Bus Stby'),
        (ENABLE, steady | ENABLED, 'Bus Stby'),
        (ON, steady | ENABLED | SWITCHED_ON, 'Bus Acc'),
    ):
        assert not optimal.running
        optimal.write(DRIVE_CONTROL, word)
        optimal.wait(0.1)
        assert (optimal.bits, optimal.text, optimal.read(MODE)) == (bits, text, BUS)
    optimal.wait(5)
    assert optimal.bits == steady | ENABLED | SWITCHED_ON | REACHED
    assert (optimal.text, optimal.read(STATOR_FREQUENCY)) == ('Bus Run', 250), 'by the terminals'
    optimal.write(DRIVE_CONTROL, ENABLE)
    assert (optimal.bits, optimal.text) == (steady | SWITCHED_ON | STOPPING, 'Bus Ret')
    optimal.wait(1)
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(5)
    assert not optimal.running, 'a start command counts when the motor has stopped'
    for word, running in ((ENABLE, False), (ON, True)):
        optimal.write(DRIVE_CONTROL, word)
        optimal.wait(0.1)
        assert optimal.running is running


def test_a_command_that_comes_too_early_does_nothing():
    for words_, pause in (
        # all at once, and again
        ((ON, ON, ON), 1),
        # without one of them
        ((0x0008, 0x0009), 1),
        ((CONTROL, CONTROL | 1), 1),
        ((0x0001, 0x0009), 1),
        # the wrong order, as on a G2
        ((CONTROL, CONTROL | 1, ON), 1),
        ((0x0008, ENABLE, ON), 1),
        ((CONTROL, ON), 1),
        # without waiting for the answer
        ((CONTROL, ENABLE, ON), 0.01),
    ):
        optimal = OptimalBench()
        for word in words_:
            optimal.write(DRIVE_CONTROL, word)
            optimal.wait(pause)
        optimal.wait(1)
        assert not optimal.running, words_
        assert optimal.read(DRIVE_CONTROL) == words_[-1], 'it is read as it was written'
        optimal.write(DRIVE_CONTROL, 0)
        optimal.wait(1)
        optimal.switch_on()
        assert optimal.running, 'it can be given again'


def test_control_by_mode_does_not_stand_in_for_the_answer(optimal):
    optimal.write(MODE, BUS)
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.wait(1)
    assert optimal.bits & (FROM_BUS | ENABLED) == FROM_BUS


def test_without_one_of_the_bits_or_run_the_motor_stops():
    for word in (CONTROL, CONTROL | 1, 0x0009, 0, None):
        optimal = OptimalBench()
        optimal.switch_on(5)
        if word is None:
            optimal.drive.set_run_input(False)
        else:
            optimal.write(DRIVE_CONTROL, word)
        assert optimal.bits & STOPPING, word
        optimal.wait(6)
        assert not optimal.drive.motor.turning
        has_control = word is None or bool(word & CONTROL)
        assert bool(optimal.bits & FROM_BUS) is has_control
        assert optimal.read(MODE) == (BUS if has_control else MANUAL)
    optimal.drive.set_run_input(True)
    assert optimal.running, 'the run command stood'


def test_bits_that_are_echoed_and_bits_that_are_not_used(optimal):
    for word, echo in ((2, 1 << 4), (4, 1 << 5), (6, 3 << 4), (0, 0)):
        optimal.write(DRIVE_CONTROL, word)
        assert optimal.bits & (3 << 4) == echo
    optimal.write(DRIVE_CONTROL, 0xBF70)
    optimal.wait(1)
    assert optimal.bits == READY | BRAKE


def test_a_fault_is_acknowledged_when_bit_7_rises(optimal):
    optimal.write(DRIVE_CONTROL, CONTROL | 0x80)
    optimal.wait(0.1)
    optimal.drive.trip(5)
    optimal.write(DRIVE_CONTROL, CONTROL | 0x80)
    assert optimal.bits & FAULT, 'it did not rise'
    optimal.write(DRIVE_CONTROL, CONTROL)
    assert optimal.bits & FAULT
    optimal.write(DRIVE_CONTROL, ENABLE | 0x80)
    optimal.wait(1)
    assert optimal.bits & (FAULT | ENABLED) == 0, 'an enable is not taken in a fault'


def test_the_run_command_stands_through_a_fault_or_is_dropped():
    for variant, runs in (
        ({}, True), ({'refuses_in_fault': 'scmd'}, True), ({'run_command_in_fault': 'drops'}, False)
    ):
        optimal = OptimalBench(**variant)
        optimal.switch_on(5)
        optimal.drive.trip(5)
        assert optimal.bits & (ENABLED | SWITCHED_ON) == 0
        optimal.wait(10)
        optimal.write(DRIVE_CONTROL, ON | 0x80)
        optimal.wait(1)
        assert (optimal.running, bool(optimal.bits & ENABLED)) == (runs, True), variant
    for word in (ENABLE, ON):
        optimal.write(DRIVE_CONTROL, word)
        optimal.wait(0.1)
    assert optimal.running


def test_who_takes_control_away_ends_the_commands(optimal):
    for mode in (MANUAL, AUTO):
        optimal.write(DRIVE_CONTROL, 0)
        optimal.write(DRIVE_CONTROL, CONTROL)
        optimal.wait(0.1)
        optimal.write(MODE, mode)
        optimal.write(DRIVE_CONTROL, ENABLE)
        optimal.wait(1)
        assert optimal.read(MODE) == mode
        assert not optimal.bits & (FROM_BUS | ENABLED)
    optimal = OptimalBench()
    optimal.switch_on(5)
    optimal.drive.control_unit.press('stop')
    assert optimal.bits & STOPPING
    optimal.wait(10)
    assert (optimal.text, optimal.read(MODE)) == ('Stop', MANUAL)
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(1)
    assert not optimal.running, 'the word that stood has no effect any more'


def test_mixed_methods_do_not_stop_each_other(optimal):
    optimal.switch_on(5)
    optimal.write(SMODE, STOP)
    optimal.wait(10)
    assert optimal.running
    optimal.write(SMODE, RUN_INPUT)
    optimal.write(DRIVE_CONTROL, 0)
    optimal.write(MODE, BUS)
    optimal.write(SMODE, RUN_INPUT)
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.wait(1)
    optimal.write(DRIVE_CONTROL, 0)
    optimal.wait(10)
    assert optimal.running
