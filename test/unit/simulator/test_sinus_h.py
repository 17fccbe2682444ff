# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The simulated Sinus H by the tables of its manual, typed in here by hand [M3]."""

import pytest
from telegram_bench import TelegramBench

S1, S2, S3, S4 = 'S1', 'S2', 'S3', 'S4'
BY_PLC = 0x0400
RAMP = 0x0070
# bits 3 to 0: OperationEnable is 1111, OperationDisable 0111, SwitchON x111, SwitchOFF x110
ENABLE, DISABLE, OFF, QUICK, COAST = 0xF, 0x7, 0x6, 0xB, 0xD
#: The patterns of bits 6 and 2 to 0 of ZSW1 [M3 §7.2.2].
PATTERN = {S1: 0x40, S2: 0x01, S3: 0x03, S4: 0x07}
#: Words that lead from power-on to each state.
WAY = {S1: (), S2: (OFF,), S3: (OFF, DISABLE), S4: (OFF, DISABLE, ENABLE)}


def table(state, bits):
    """What the table of [M3 §6] says of four bits of STW1 in a state."""
    quick, coast = not bits & 0x4, not bits & 0x2
    neither = not quick and not coast
    if state == S1:
        return S2 if neither and not bits & 1 else S1
    if state == S2:
        if quick or coast:
            return S1
        return S3 if bits & 1 else S2
    if state == S3:
        if neither and not bits & 1:
            return S2
        return S4 if bits == 0xF else S3
    if quick or coast:
        return S1
    return S3 if bits == 0x7 else S4


class Bench(TelegramBench):
    """One drive behind a fieldbus."""

    def __init__(self, settings=None, **options):
        super().__init__('sinus_h', settings, **options)

    def bits(self, low, setpoint=None):
        self.send(BY_PLC | RAMP | low, setpoint)

    def go(self, state, setpoint=2000, seconds=0.0):
        for low in WAY[state]:
            self.bits(low, setpoint)
        assert self.state == state
        self.wait(seconds)


@pytest.fixture
def bench():
    return Bench()


# --- the states ---


def test_every_word_leads_where_the_table_says_and_none_without_bit_10():
    wrong = []
    for state in WAY:
        for bits in range(16):
            bench = Bench()
            bench.go(state)
            bench.send(RAMP | bits)
            if bench.state != state:
                wrong.append((state, bits, 'without bit 10', bench.state))
            bench.bits(bits)
            if (bench.state, bench.zsw1 & 0x47) != (table(state, bits), PATTERN[bench.state]):
                wrong.append((state, bits, bench.state, bench.zsw1))
    assert not wrong


def test_neither_a_word_of_zero_nor_switching_off_stops_the_motor(bench):
    bench.go(S4, seconds=4.0)
    for word in (0x0000, 0x0001, 0x000F, BY_PLC | RAMP | OFF):
        bench.send(word)
        bench.wait(3.0)
        assert bench.state == S4 and bench.motor.driven, word
        assert bench.actual == pytest.approx(2000, abs=1), word


def test_unlisted_exits_can_be_there():
    for state, bits, target in ((S3, QUICK, S1), (S3, COAST, S1), (S4, OFF, S2)):
        bench = Bench(unlisted_exits='profidrive')
        bench.go(state)
        bench.bits(bits)
        assert bench.state == target


def test_one_telegram_is_one_transition(bench):
    bench.go(S2)
    for state in (S3, S4):
        bench.bits(ENABLE)
        assert bench.state == state


# --- what the motor does ---


def test_motor_runs_in_operation_alone_at_hundredths_of_a_hertz(bench):
    bench.go(S3, seconds=1.0)
    assert not bench.motor.driven
    bench.bits(ENABLE, 2345)
    bench.wait(6.0)
    assert bench.actual == pytest.approx(2345, abs=1)
    assert bench.zsw1 & 0x100, 'the set-point is reached'
    bench.bits(ENABLE, -1000)
    bench.wait(8.0)
    assert bench.actual == pytest.approx(6000, abs=1), 'it has no sign: 0xFC18 is 645.36 Hz'


def test_coast_stop_releases_the_motor_even_on_the_way_down(bench):
    bench.go(S4, seconds=4.0)
    bench.bits(DISABLE)
    bench.wait(0.2)
    assert bench.motor.driven
    bench.bits(ENABLE)
    bench.wait(4.0)
    assert bench.actual == pytest.approx(2000, abs=1), 'a motor that brakes is caught'
    bench.bits(DISABLE)
    bench.wait(0.2)
    bench.bits(COAST)
    bench.wait(0.02)
    assert (bench.motor.driven, bench.motor.turning) == (False, True)
    assert bench.actual == 0, 'what it shows is the output'


def test_ramp_and_setpoint_have_to_be_enabled_and_the_ramp_can_be_frozen():
    for missing in (0x10, 0x20, 0x40):
        bench = Bench()
        bench.go(S4, seconds=1.0)
        bench.send(BY_PLC | RAMP & ~missing | ENABLE)
        held = bench.actual if missing == 0x20 else 0
        bench.wait(5.0)
        assert bench.state == S4
        assert bench.actual == pytest.approx(held, abs=20)
        assert bool(bench.actual) == (missing == 0x20)


# --- the status word ---


def test_echo_bits_are_those_of_the_word(bench):
    for sent, shown in ((0x0000, 0), (0x0002, 0x10), (0x0004, 0x20), (BY_PLC, 0x200)):
        bench.send(sent)
        assert bench.zsw1 & 0x230 == shown
    bench = Bench(echo_bits='word')
    bench.bits(ENABLE)
    assert (bench.state, bench.zsw1 & 0x47) == (S1, 0x46), 'bits 1 and 2 can be echoes too'


def test_it_says_operation_although_the_keypad_commands():
    bench = Bench({'drv.cmd_source': 'Keypad', 'drv.freq_ref_src': 'Keypad-1', 'drv.frequency': 10})
    bench.go(S4, seconds=2.0)
    assert (bench.zsw1 & 0x47, bench.actual, bench.motor.driven) == (0x07, 0, False)
    bench = Bench({'drv.cmd_source': 'Keypad', 'drv.freq_ref_src': 'Keypad-1', 'drv.frequency': 10})
    bench.unit.press('start')
    bench.wait(3.0)
    assert bench.actual == pytest.approx(1000, abs=1)
    bench.unit.press('stop')
    bench.wait(5.0)
    assert not bench.motor.driven


def test_the_other_telegram_is_no_exchange():
    assert Bench().server.online
    assert not Bench({'com.opt_para_13': 'Vendor Specific Telegram'}).server.online


# --- faults ---


def test_fault_coasts_and_wants_one_edge_of_bit_7(bench):
    bench.go(S4, seconds=4.0)
    bench.drive.trip(11)
    bench.wait(0.1)
    assert (bench.state, bench.zsw1 & 0x48, bench.motor.driven) == (S1, 0x48, False)
    bench.bits(OFF)
    assert bench.state == S1, 'a fault inhibits it'
    bench.send(0x0080)
    assert bench.zsw1 & 0x08, 'it needs control by the PLC'
    bench.bits(ENABLE)
    bench.bits(ENABLE | 0x80)
    bench.wait(2.0)
    assert (bench.zsw1 & 0x08, bench.state, bench.motor.driven) == (0, S1, False)
    bench.drive.trip(12)
    bench.wait(0.1)
    assert bench.zsw1 & 0x08, 'the bit that still stands is no edge'


# --- keypad, power, lost command ---


def test_stop_at_the_keypad_or_a_power_cycle_leads_to_s1():
    for what, state in (('stop', S1), ('power', S1), ('ignored', S4)):
        bench = Bench(keypad_stop='ignored') if what == 'ignored' else Bench()
        bench.go(S4, seconds=4.0)
        if what == 'power':
            bench.drive.power_cycle(0.0)
        else:
            bench.unit.press('stop')
        bench.wait(5.0)
        assert (bench.state, bench.motor.driven) == (state, state == S4), what


def lost(mode, **settings):
    bench = Bench({'prt.lost_cmd_mode': mode, **settings})
    bench.go(S4, seconds=5.0)
    bench.wait(0.9, telegrams=False)
    assert bench.motor.driven
    assert bench.motor.frequency == pytest.approx(20, abs=0.1)
    return bench


def test_lost_command_runs_on_or_stops_by_its_mode_and_its_time():
    for mode, frequency in (
        ('None', 20.0), ('Hold Input', 20.0), ('Hold Output', 20.0), ('Lost Preset', 7.5),
    ):
        bench = lost(mode, **{'prt.lost_preset_f': 7.5})
        bench.wait(5.0, telegrams=False)
        assert bench.motor.frequency == pytest.approx(frequency, abs=0.1), mode
        assert bool(bench.unit.status_word & 0x80) == (mode != 'None')
        bench.bits(ENABLE, 1000)
        assert not bench.zsw1 & 0x80
        bench.wait(3.0)
        assert bench.actual == pytest.approx(1000, abs=1), mode
    for mode, seconds in (('Free-Run', 1.0), ('Dec', 1.0), ('Free-Run', 3.0)):
        bench = lost(mode, **{'prt.lost_cmd_time': seconds})
        bench.wait(seconds - 1.0, telegrams=False)
        assert bench.motor.driven
        bench.wait(0.4, telegrams=False)
        assert bench.motor.driven == (mode == 'Dec')
        assert bench.motor.trend < 0 or mode == 'Free-Run'
        bench.wait(3.0, telegrams=False)
        assert (bench.motor.driven, bench.drive.faults.codes) == (False, [35]), mode
