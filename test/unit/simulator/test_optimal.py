# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What an Optimal alone does, against its manual [M1]: registers, MODE = Manual, Drive Control."""

import struct

import optimal_bench as o
from optimal_bench import DRIVE_CONTROL, INPUT_FREQUENCY, MODE, SMODE, STATUS_WITH_ACK, OptimalBench
import pytest

from nfo_sinus_driver.families.sinus_optimal import words
from nfo_sinus_driver.simulator.drive import describe

ALARMS = [7, 53, 55, 56, 57]
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
    # codes that there are not, and those of SMODE before MODE = Bus
    **{f'06 0294 {code:04X}': '86 03' for code in (0, 4, 0x101, 0xFFFF)},
    **{f'06 0298 {code:04X}': '86 03' for code in (1, 0x41, 0x80, 0x100, 0x201, 0x800, 0xFFFF)},
    **{f'06 0298 {code:04X}': '86 04' for code in (0, 0x081, 0x101)},
}


def test_every_request_is_answered_by_the_manual():
    for treatment in ('known', 'refused'):
        found = {
            request: OptimalBench(newer_functions=treatment).ask(request).hex(' ')
            for request in ANSWERS
        }
        assert found == {asked: bytes.fromhex(answer).hex(' ') for asked, answer in ANSWERS.items()}
    assert (set(words.Mode), set(words.Smode)) == ({1, 2, 3}, {0, 0x081, 0x101})


def test_everything_that_the_manual_lists_can_be_read(optimal):
    single = (0x3F4, 0x400, 0x518, 0x264, 0x260, 0x294, 0x3FC, 0x25C, 0x2A4, 0x2A5, 0x254, 0x258)
    for register in (*single, 0x3EC, 0x3F0, 0x2A8, 0x2AC):
        count = 1 if register in single else 2
        for function in (3, 4):
            answer = optimal.ask(struct.pack('>BHH', function, register, count))
            assert answer[:2] == bytes((function, 2 * count)), hex(register)


# ---- MODE and SMODE; what it has in common with a G2 is in test_sinus.py ----


def test_mode_manual_is_no_stop(optimal):
    optimal.run(40, 10)
    optimal.write(MODE, o.MANUAL)
    assert optimal.text == 'Decel', 'to the reference of the keypad'
    optimal.wait(10)
    assert (optimal.text, optimal.running) == ('Final Freq', True)
    optimal.drive.control_unit.press('stop')
    optimal.wait(10)
    assert not optimal.drive.motor.turning
    for mode in (o.BUS, o.MANUAL):
        optimal.write(MODE, mode)
    assert (optimal.text, optimal.running) == ('Stop', False), 'it leaves a standing motor alone'


def test_each_phase_of_a_run_has_its_bits():
    for run_input, steady in ((True, 0), (False, o.DISABLED)):
        optimal = OptimalBench(run_input=run_input)
        assert optimal.bits == o.READY | o.BRAKE | steady
        optimal.run(-20)
        steady |= o.READY | o.FROM_BUS | o.BRAKE
        optimal.wait(1)
        running = (o.SWITCHED_ON | o.REVERSE) * run_input
        assert optimal.bits == steady | running
        optimal.wait(5)
        assert optimal.bits == steady | running | o.REACHED * run_input
        optimal.write(SMODE, o.STOP)
        optimal.wait(0.1)
        assert optimal.bits == steady | running | o.STOPPING * run_input
        optimal.wait(5)
        assert optimal.bits == steady
    assert not OptimalBench(settings={'control.st_mode': 'Release'}).bits & o.BRAKE


def test_the_active_setpoint_is_another_register_than_the_input_and_has_a_limit(optimal):
    for raw, active in ((-200, -200), (3000, 1500), (-3000, -1500)):
        optimal.run(raw / 10, 1)
        assert optimal.read(INPUT_FREQUENCY) == raw
        assert optimal.read(o.CONTROL_FREQUENCY) == active
        assert optimal.read(o.CONTROL_SPEED) == 3 * active
    optimal.write(SMODE, o.RUN_TERMINAL)
    assert optimal.read(o.CONTROL_FREQUENCY) == 250
    optimal.write(SMODE, o.STOP)
    assert (optimal.read(INPUT_FREQUENCY), optimal.read(o.CONTROL_FREQUENCY)) == (-3000, 0)


def test_a_small_set_point_lets_it_sleep():
    optimal = OptimalBench(settings={'control.f_sleep': 10})
    optimal.run(20, 5)
    optimal.write(INPUT_FREQUENCY, 50)
    optimal.wait(5)
    assert (optimal.code, optimal.text, optimal.running) == (29, 'Sleep', False)
    assert optimal.bits == o.READY | o.FROM_BUS | o.SLEEP | o.BRAKE
    optimal.write(INPUT_FREQUENCY, 200)
    optimal.wait(0.1)
    assert optimal.running
    assert not optimal.bits & o.SLEEP


# ---- faults and alarms ----


def test_commands_are_taken_in_a_fault_and_hold(optimal):
    for command, runs in ((o.RUN_INPUT, True), (o.STOP, False)):
        optimal.drive.trip(5)
        optimal.run(20)
        optimal.write(SMODE, command)
        assert not optimal.running
        assert optimal.bits & (o.FAULT | o.READY | o.SWITCHED_ON) == o.FAULT
        assert optimal.read(o.CONTROL_FREQUENCY) == 0
        optimal.read(STATUS_WITH_ACK)
        assert optimal.running is runs


def test_an_alarm_stops_nothing_and_a_fault_is_shown_before_it(optimal):
    optimal.run(20, 5)
    for code in ALARMS:
        optimal.drive.trip(code, cause_present=True)
        assert (optimal.running, optimal.code) == (True, code)
        assert optimal.bits & (o.ALARM | o.FAULT | o.READY) == o.ALARM | o.READY
        state = describe(optimal.drive)
        assert (state['fault'], state['alarms']) == (0, [code])
        optimal.drive.faults.end_causes()
        assert optimal.read(STATUS_WITH_ACK) == code
        assert (optimal.text, optimal.bits & o.ALARM) == ('Bus Run', 0)
    optimal.drive.trip(53, cause_present=True)
    optimal.drive.trip(5)
    assert optimal.code == 5
    optimal.read(STATUS_WITH_ACK)
    assert optimal.code == 53


# ---- Drive Control ----


def test_the_example_of_the_manual(optimal):
    optimal.write(INPUT_FREQUENCY, 400)
    steady = o.READY | o.FROM_BUS | o.BRAKE
    for word, bits, text in (
        (CONTROL, steady, 'Bus Stby'),
        (ENABLE, steady | o.ENABLED, 'Bus Stby'),
        (ON, steady | o.ENABLED | o.SWITCHED_ON, 'Bus Acc'),
    ):
        assert not optimal.running
        optimal.write(DRIVE_CONTROL, word)
        optimal.wait(0.1)
        assert (optimal.bits, optimal.text, optimal.read(MODE)) == (bits, text, o.BUS)
    optimal.wait(5)
    assert optimal.bits == steady | o.ENABLED | o.SWITCHED_ON | o.REACHED
    assert optimal.read(o.STATOR_FREQUENCY) == 250, 'by the terminals'
    optimal.write(DRIVE_CONTROL, ENABLE)
    assert (optimal.bits, optimal.text) == (steady | o.SWITCHED_ON | o.STOPPING, 'Bus Ret')
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
    optimal = OptimalBench()
    optimal.write(MODE, o.BUS)
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.write(DRIVE_CONTROL, ENABLE)
    optimal.wait(1)
    assert not optimal.bits & o.ENABLED, 'control by MODE does not stand in for the answer'


def test_without_one_of_the_bits_or_run_the_motor_stops():
    for word in (CONTROL, CONTROL | 1, 0x0009, 0, None):
        optimal = OptimalBench()
        optimal.switch_on(5)
        if word is None:
            optimal.drive.set_run_input(False)
        else:
            optimal.write(DRIVE_CONTROL, word)
        assert optimal.bits & o.STOPPING, word
        optimal.wait(6)
        assert not optimal.drive.motor.turning
        has_control = word is None or bool(word & CONTROL)
        assert bool(optimal.bits & o.FROM_BUS) is has_control
        assert optimal.read(MODE) == (o.BUS if has_control else o.MANUAL)
    optimal.drive.set_run_input(True)
    assert optimal.running, 'the run command stood'
    optimal.drive.power_cycle(0.0)
    optimal.wait(1)
    assert optimal.read(DRIVE_CONTROL) == 0 and not optimal.running


def test_bits_that_are_echoed_and_bits_that_are_not_used(optimal):
    for word, echo in ((2, 1 << 4), (4, 1 << 5), (6, 3 << 4), (0, 0)):
        optimal.write(DRIVE_CONTROL, word)
        assert optimal.bits & (3 << 4) == echo
    optimal.write(DRIVE_CONTROL, 0xBF70)
    optimal.wait(1)
    assert optimal.bits == o.READY | o.BRAKE


def test_a_fault_is_acknowledged_when_bit_7_rises(optimal):
    optimal.write(DRIVE_CONTROL, CONTROL | 0x80)
    optimal.wait(0.1)
    optimal.drive.trip(5)
    for word in (CONTROL | 0x80, CONTROL):
        optimal.write(DRIVE_CONTROL, word)
        assert optimal.bits & o.FAULT, 'it did not rise'
    optimal.write(DRIVE_CONTROL, ENABLE | 0x80)
    optimal.wait(1)
    assert optimal.bits & (o.FAULT | o.ENABLED) == 0, 'an enable is not taken in a fault'


def test_the_run_command_stands_through_a_fault_or_is_dropped():
    for variant, runs in (({}, True), ({'run_command_in_fault': 'drops'}, False)):
        optimal = OptimalBench(**variant)
        optimal.switch_on(5)
        optimal.drive.trip(5)
        assert optimal.bits & (o.ENABLED | o.SWITCHED_ON) == 0
        optimal.wait(10)
        optimal.write(DRIVE_CONTROL, ON | 0x80)
        optimal.wait(1)
        assert (optimal.running, bool(optimal.bits & o.ENABLED)) == (runs, True), variant
    for word in (ENABLE, ON):
        optimal.write(DRIVE_CONTROL, word)
        optimal.wait(0.1)
    assert optimal.running


def test_who_takes_control_away_ends_the_commands(optimal):
    for mode in (o.MANUAL, o.AUTO):
        optimal.write(DRIVE_CONTROL, 0)
        optimal.write(DRIVE_CONTROL, CONTROL)
        optimal.wait(0.1)
        optimal.write(MODE, mode)
        optimal.write(DRIVE_CONTROL, ENABLE)
        optimal.wait(1)
        assert optimal.read(MODE) == mode
        assert not optimal.bits & (o.FROM_BUS | o.ENABLED)
    optimal = OptimalBench()
    optimal.switch_on(5)
    optimal.drive.control_unit.press('stop')
    optimal.wait(10)
    optimal.write(DRIVE_CONTROL, ON)
    optimal.wait(1)
    assert not optimal.running, 'the word that stood has no effect any more'


def test_mixed_methods_do_not_stop_each_other(optimal):
    optimal.switch_on(5)
    optimal.write(SMODE, o.STOP)
    optimal.wait(10)
    assert optimal.running
    optimal.write(DRIVE_CONTROL, 0)
    optimal.write(MODE, o.BUS)
    optimal.write(SMODE, o.RUN_INPUT)
    optimal.write(DRIVE_CONTROL, CONTROL)
    optimal.wait(1)
    optimal.write(DRIVE_CONTROL, 0)
    optimal.wait(10)
    assert optimal.running
