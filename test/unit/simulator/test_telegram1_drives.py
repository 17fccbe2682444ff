# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated Optimal and G2 on a fieldbus: telegram 1 by their manuals ([M1], [M0 §7])."""

import pytest
from telegram_bench import TelegramBench as Bench

# Optimal: bits of STW1 and ZSW1, copied from [M1]
SWITCH_ON, ENABLE, ACK, PLC = 1 << 0, 1 << 3, 1 << 7, 1 << 10
READY, OPERATING, ENABLED, FAULT = 1 << 0, 1 << 1, 1 << 2, 1 << 3
DISABLED, CONTROLLED = 1 << 6, 1 << 9
FULL = 8192

# G2: DriveControl [M0 table 14] and the masks of [M0 table 16]
G2_CONTROLLED = 0xC000 | 0x70
G2_STANDBY = G2_CONTROLLED | 0x06
G2_ON = G2_STANDBY | 0x01
G2_FORWARD = G2_ON | 0x08


def running_optimal(setpoint=FULL // 2, seconds=6.0, **settings):
    bench = Bench('sinus_optimal', settings)
    bench.step(PLC)
    bench.step(PLC | ENABLE)
    bench.step(PLC | ENABLE | SWITCH_ON, setpoint)
    bench.wait(seconds)
    return bench


# --- Optimal: the sequence of its manual ---


def test_each_bit_is_confirmed_before_the_next():
    bench = Bench('sinus_optimal')
    bench.send(0)
    assert bench.zsw1 & (READY | CONTROLLED | ENABLED | OPERATING) == READY
    bench.send(PLC)
    assert not bench.zsw1 & CONTROLLED, 'it takes its time'
    assert bench.step(PLC) & (CONTROLLED | ENABLED | OPERATING) == CONTROLLED
    assert bench.step(PLC | ENABLE) & (CONTROLLED | ENABLED | OPERATING) == CONTROLLED | ENABLED
    assert bench.step(PLC | ENABLE | SWITCH_ON, FULL) & OPERATING


def test_a_bit_that_comes_too_early_does_nothing():
    for words in (
        (PLC | ENABLE,),
        (PLC | ENABLE | SWITCH_ON,),
        (PLC, PLC | SWITCH_ON),
        (PLC, PLC | ENABLE | SWITCH_ON),
        (ENABLE, ENABLE | SWITCH_ON),
        (SWITCH_ON,),
    ):
        bench = Bench('sinus_optimal')
        for word in words:
            bench.step(word, FULL)
        bench.wait(3.0)
        assert not bench.zsw1 & OPERATING and not bench.motor.driven, words


def test_bits_1_and_2_are_echoes():
    bench = Bench('sinus_optimal')
    for sent, shown in ((1 << 1, 1 << 4), (1 << 2, 1 << 5), (0x6, 0x30), (0, 0)):
        bench.step(PLC | sent)
        assert bench.zsw1 & 0x30 == shown


def test_the_setpoint_has_a_limit():
    bench = running_optimal(0, 0.0, **{'control.accel': 1.0})
    for setpoint, frequency in ((1, 50 / FULL), (24576, 150), (32767, 150), (-32768, -150)):
        bench.send(bench.word, setpoint)
        bench.wait(0.1)
        assert bench.motor.demand == pytest.approx(frequency, rel=1e-6)


def test_who_takes_control_at_the_drive_keeps_it():
    for key in ('stop', 'ext', 'run input'):
        bench = running_optimal()
        bench.drive.set_run_input(key == 'stop')
        if key != 'run input':
            bench.drive.control_unit.press(key)
        bench.wait(6.0)
        assert not bench.motor.driven, key
        assert bool(bench.zsw1 & CONTROLLED) == (key == 'run input')
        assert bool(bench.zsw1 & DISABLED) == (key != 'stop')


def test_a_fault_is_acknowledged_by_an_edge_and_then_it_stands():
    for bench, acknowledge in ((running_optimal(), PLC | ACK), (running_g2(), G2_STANDBY | ACK)):
        bench.drive.trip(12)
        bench.wait(1.0)
        bench.step(acknowledge & ~ACK)
        assert bench.zsw1 & FAULT
        assert not bench.step(acknowledge) & FAULT
        bench.wait(2.0)
        assert not bench.motor.driven
        bench.drive.trip(12)
        bench.wait(0.1)
        assert bench.zsw1 & FAULT, 'a bit that still stands is no edge'


def test_after_a_power_cycle_a_standing_word_does_nothing():
    for bench in (running_optimal(), running_g2()):
        bench.drive.power_cycle(0.5)
        bench.drive.advance(0.5)
        bench.wait(3.0)
        assert not bench.motor.driven


def test_lost_fieldbus_goes_by_auto_stop():
    for run in (running_optimal, running_g2):
        for auto_stop in (False, True):
            bench = run(**{'serial.auto_stop': auto_stop})
            bench.wait(0.1, telegrams=False)
            assert bench.motor.driven
            bench.wait(3.0, telegrams=False)
            assert bench.motor.driven == (not auto_stop)
            assert bench.drive.faults.codes == ([15] if auto_stop else [])
            bench.wait(3.0)
            assert bench.motor.driven == (not auto_stop), 'what stood does not start it again'


# --- G2 ---


def running_g2(word=G2_FORWARD, setpoint=200, **settings):
    bench = Bench('sinus_g2', settings, telegram_words='drivecontrol')
    bench.step(G2_STANDBY)
    bench.step(G2_ON)
    bench.step(word, setpoint)
    bench.wait(6.0)
    return bench


def test_g2_needs_a_positive_edge_of_bit_0():
    for words, run in (('drivecontrol', G2_FORWARD), ('profidrive', 0x047F)):
        bench = Bench('sinus_g2', telegram_words=words)
        bench.step(run, 200)
        bench.wait(3.0)
        assert not bench.motor.driven and bench.zsw1 & 0x40, words


def test_g2_speaks_profidrive():
    # standard telegram 1: STW1 0476h, 0477h, 047Fh lead through S1 to S4 [C111]
    bench = Bench('sinus_g2')
    assert bench.step(0) & 0x247 == 0x40
    assert bench.step(0x0476) & 0x277 == 0x231
    assert bench.step(0x0477) & 0x047 == 0x03
    assert bench.step(0x047F, 100) & 0x8047 == 0x8007, 'bit 15: pulses enabled'
    bench.wait(4.0)
    assert bench.actual == 100 and bench.zsw1 & 0x100
    bench.step(0, 0)
    bench.wait(2.0)
    assert bench.actual == 100 and bench.motor.driven, 'without control by PLC nothing counts'
    bench.step(0x047F, -100)
    bench.wait(6.0)
    assert bench.actual == -100, 'the sign reverses'
    # OFF1 goes down the ramp, S5
    assert bench.step(0x047E) & 0x8007 == 0x8003 and bench.motor.driven
    bench.wait(4.0)
    assert bench.zsw1 & 0x8047 == 0x0001 and not bench.motor.driven


def test_commands_count_by_level_where_that_is_chosen():
    for model, word in (
        ('sinus_optimal', PLC | ENABLE | SWITCH_ON), ('sinus_g2', 0x047F), ('sinus_h', 0x047F)
    ):
        option = {'unlisted_exits': 'levels'} if model == 'sinus_h' else {'commands': 'levels'}
        bench = Bench(model, **option)
        bench.wait(0.2)
        bench.step(word, 1000)
        bench.wait(2.0)
        assert bench.motor.driven, model
