# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""The simulated Sinus Optimal against its manual [M1]: registers, MODE and SMODE, faults."""

import struct

from optimal_bench import ALARM
from optimal_bench import AUTO
from optimal_bench import BRAKE
from optimal_bench import BUS
from optimal_bench import CONTROL_FREQUENCY
from optimal_bench import CONTROL_SPEED
from optimal_bench import DISABLED
from optimal_bench import DRIVE_CONTROL
from optimal_bench import DRIVE_STATUS
from optimal_bench import FAULT
from optimal_bench import FROM_BUS
from optimal_bench import INPUT_FREQUENCY
from optimal_bench import INPUT_SPEED
from optimal_bench import LIMIT
from optimal_bench import MANUAL
from optimal_bench import MODE
from optimal_bench import REACHED
from optimal_bench import READY
from optimal_bench import REVERSE
from optimal_bench import ROTOR_SPEED
from optimal_bench import RUN_INPUT
from optimal_bench import RUN_TERMINAL
from optimal_bench import SLEEP
from optimal_bench import SMODE
from optimal_bench import STATOR_FREQUENCY
from optimal_bench import STATUS
from optimal_bench import STATUS_WITH_ACK
from optimal_bench import STOP
from optimal_bench import STOPPING
from optimal_bench import SWITCHED_ON
from optimal_bench import OptimalBench
import pytest

from nfo_sinus_driver.simulator.drive import describe
from nfo_sinus_driver.simulator.main import main
from nfo_sinus_driver.simulator.simulator import Simulator

SLAVE_DEVICE_FAILURE = 4
ILLEGAL_VALUE = 3


@pytest.fixture
def optimal():
    return OptimalBench()


# ---- the bus ----


@pytest.mark.parametrize(
    ('request_', 'answer'),
    [
        # MODE, by both read functions, and both words of a 32-bit value
        ('03 0294 0001', '03 02 0001'),
        ('04 0294 0001', '04 02 0001'),
        ('03 03EC 0002', '03 04 0000 0000'),
        ('04 03F0 0002', '04 04 0000 0000'),
        # 1234.5 h and 321 h at 36 s a tick, the low word first
        ('03 02A8 0002', '03 04 E23A 0001'),
        ('03 02AC 0002', '03 04 7D64 0000'),
        ('06 03FC FF9C', '06 03FC FF9C'),
        ('10 0294 0001 02 0003', '10 0294 0001'),
        # no such function: only 03, 04, 06 and 16
        *((f'{code:02X} 0294 0001', f'{code | 0x80:02X} 01') for code in (1, 2, 5, 15, 22, 24)),
        ('17 0294 0001 0294 0001 02 0003', '97 01'),
        ('2B 0E 01 00', 'AB 01'),
        ('11', '91 01'),
        # one ADI with its own length
        ('03 03EC 0001', '83 02'),
        ('03 03ED 0001', '83 02'),
        ('03 0294 0002', '83 02'),
        ('04 02A4 0002', '84 02'),
        ('03 0295 0001', '83 02'),
        # registers that the manual does not list, settings of the G2 among them
        ('03 027E 0002', '83 02'),
        ('03 0234 0001', '83 02'),
        ('03 0250 0002', '83 02'),
        ('04 0294 0000', '84 03'),
        # read only
        ('06 0400 0001', '86 02'),
        ('06 0518 0001', '86 02'),
        ('06 0260 0001', '86 02'),
        ('06 0258 0001', '86 02'),
        ('06 02A4 0001', '86 02'),
        ('10 02A8 0002 04 0000 0000', '90 02'),
    ],
)
def test_answer(optimal, request_, answer):
    assert optimal.ask(request_) == bytes.fromhex(answer)


@pytest.mark.parametrize('treatment', ['known', 'refused'])
def test_it_never_has_the_functions_of_the_g2(treatment):
    optimal = OptimalBench(newer_functions=treatment)
    assert optimal.ask('11') == bytes.fromhex('91 01')


@pytest.mark.parametrize(
    ('register', 'count'),
    [
        *((register, 2) for register in (0x3EC, 0x3F0, 0x2A8, 0x2AC)),
        *((register, 1) for register in (0x3F4, 0x400, 0x518, 0x264, 0x260, 0x294, 0x3FC)),
        *((register, 1) for register in (0x25C, 0x2A4, 0x2A5, 0x254, 0x258)),
    ],
)
def test_everything_that_the_manual_lists_can_be_read(optimal, register, count):
    for function in (3, 4):
        answer = optimal.ask(struct.pack('>BHH', function, register, count))
        assert answer[:2] == bytes((function, 2 * count))


def test_counters_tick_every_36_seconds(optimal):
    optimal.run(20, 3600)
    assert optimal.ask('03 02A8 0002') == bytes.fromhex('03 04 E29E 0001')
    assert optimal.ask('03 02AC 0002') == bytes.fromhex('03 04 7DC8 0000')


def test_a_frame_over_a_real_line(open_master, make_frame):
    with Simulator([7], model='sinus_optimal') as simulator:
        master = open_master(simulator.port)
        assert master.ask(7, bytes.fromhex('0402940001'), 7) == make_frame(
            7, bytes.fromhex('04020001')
        )
        assert master.ask(7, bytes.fromhex('11'), 5) == make_frame(7, bytes.fromhex('9101'))
        state = simulator.state()
    assert (state['model'], state['inv_st_text']) == ('sinus_optimal', 'Stop')


# ---- MODE ----


@pytest.mark.parametrize('code', [0, 4, 0x101, 0xFFFF])
def test_mode_takes_no_other_code(optimal, code):
    assert optimal.refusal(MODE, code) == ILLEGAL_VALUE


def test_after_power_on_it_stands(optimal):
    assert (optimal.read(MODE), optimal.text) == (MANUAL, 'Stop')
    assert optimal.bits == READY | BRAKE
    optimal.wait(10)
    assert not optimal.running


def test_mode_auto_starts_the_motor_when_run_is_active(optimal):
    optimal.write(MODE, AUTO)
    assert (optimal.read(MODE), optimal.text) == (AUTO, 'Ext Acc')
    assert not optimal.bits & FROM_BUS
    optimal.wait(6)
    assert (optimal.text, optimal.read(STATOR_FREQUENCY)) == ('Ext Run', 250)
    optimal.drive.set_run_input(False)
    assert optimal.text == 'Ext Ret'
    optimal.wait(6)
    assert optimal.text == 'Ext Stby'
    assert optimal.drive.control_unit.mode_ext_writes == 1


def test_mode_auto_waits_for_run():
    optimal = OptimalBench(run_input=False)
    optimal.write(MODE, AUTO)
    assert (optimal.text, optimal.running) == ('Ext Stby', False)
    optimal.drive.set_run_input(True)
    assert optimal.running


def test_autostart_is_off_by_default_and_starts_when_on():
    assert not OptimalBench().running
    assert OptimalBench(settings={'control.auto_start': True}).text == 'Ext Acc'


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
    assert optimal.read(MODE) == MANUAL
    assert optimal.text == 'Decel', 'towards the reference of the keypad'
    optimal.wait(10)
    assert (optimal.text, optimal.running) == ('Final Freq', True)
    optimal.drive.control_unit.press('stop')
    assert optimal.text == 'Stop'
    optimal.wait(10)
    assert not optimal.drive.motor.turning


def test_mode_manual_leaves_a_standing_motor_alone(optimal):
    optimal.run(20, 5)
    optimal.write(SMODE, STOP)
    optimal.wait(10)
    optimal.write(MODE, MANUAL)
    assert (optimal.text, optimal.running) == ('Stop', False)


def test_texts_of_manual_mode(optimal):
    optimal.drive.control_unit.press('start')
    assert (optimal.text, optimal.read(MODE)) == ('Accel', MANUAL)
    optimal.wait(6)
    assert optimal.text == 'Final Freq'
    optimal.drive.control_unit.press('ext')
    assert optimal.read(MODE) == AUTO


# ---- SMODE ----


@pytest.mark.parametrize('code', [1, 0x41, 0x80, 0x100, 0x201, 0x800, 0x900, 0xFFFF])
def test_smode_takes_no_other_code(optimal, code):
    optimal.write(MODE, BUS)
    assert optimal.refusal(SMODE, code) == ILLEGAL_VALUE


@pytest.mark.parametrize('mode', [MANUAL, AUTO])
def test_smode_needs_mode_bus(mode):
    optimal = OptimalBench(run_input=False)
    optimal.write(MODE, mode)
    for code in (STOP, RUN_TERMINAL, RUN_INPUT):
        assert optimal.refusal(SMODE, code) == SLAVE_DEVICE_FAILURE


def test_run_from_the_input_setpoint(optimal):
    optimal.write(MODE, BUS)
    assert (optimal.text, optimal.bits) == ('Bus Stby', READY | FROM_BUS | BRAKE)
    optimal.write(INPUT_FREQUENCY, 300)
    assert not optimal.running
    optimal.write(SMODE, RUN_INPUT)
    optimal.wait(1)
    assert optimal.text == 'Bus Acc'
    assert optimal.bits == READY | SWITCHED_ON | FROM_BUS | BRAKE
    optimal.wait(5)
    assert optimal.text == 'Bus Run'
    assert optimal.read(STATOR_FREQUENCY) == 300
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
    optimal.run(-20)
    assert optimal.read(INPUT_FREQUENCY) == optimal.read(CONTROL_FREQUENCY) == -200
    assert optimal.read(CONTROL_SPEED) == -600
    optimal.write(SMODE, STOP)
    assert optimal.read(INPUT_FREQUENCY) == -200
    assert optimal.read(CONTROL_FREQUENCY) == 0


@pytest.mark.parametrize('raw', [3000, -3000])
def test_the_active_setpoint_is_limited_to_150_hz(optimal, raw):
    optimal.run(raw / 10, 1)
    assert optimal.read(INPUT_FREQUENCY) == raw
    assert optimal.read(CONTROL_FREQUENCY) == raw / 2


def test_run_in_speed_mode():
    optimal = OptimalBench(settings={'control.mode': 'Speed'})
    optimal.run(40)
    assert optimal.read(CONTROL_SPEED) == 0, 'the input for Frequency mode'
    optimal.write(INPUT_SPEED, -900)
    optimal.wait(6)
    assert optimal.read(ROTOR_SPEED) == optimal.read(CONTROL_SPEED) == -900
    assert optimal.text == 'Bus Run'


def test_a_negative_setpoint_turns_in_reverse(optimal):
    optimal.run(-20, 5)
    assert optimal.bits & REVERSE
    optimal.write(INPUT_FREQUENCY, 200)
    optimal.wait(10)
    assert not optimal.bits & REVERSE


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


def test_start_delay_shows_its_own_code():
    optimal = OptimalBench(settings={'control.run_dly': 3})
    optimal.run(20, 1)
    assert (optimal.code, optimal.text, optimal.running) == (54, 'Delay Run', False)
    optimal.wait(2.1)
    assert optimal.running


def test_sleep_suspends_the_output_until_the_setpoint_rises():
    optimal = OptimalBench(settings={'control.f_sleep': 10})
    optimal.run(20, 5)
    optimal.write(INPUT_FREQUENCY, 50)
    assert optimal.running
    optimal.wait(5)
    assert (optimal.code, optimal.text, optimal.running) == (29, 'Sleep', False)
    assert optimal.bits == READY | FROM_BUS | SLEEP | BRAKE
    optimal.write(INPUT_FREQUENCY, 200)
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

FAULTS = [*range(1, 7), *range(8, 24), 48, 49, 50, 51]
ALARMS = [7, 53, 55, 56, 57]
SIO_FAIL, BUS_FAIL = 14, 15


@pytest.mark.parametrize('code', FAULTS)
def test_a_fault_releases_the_motor_and_reading_02a4_acknowledges(optimal, code):
    optimal.run(20, 5)
    optimal.drive.trip(code)
    assert not optimal.running
    assert optimal.drive.motor.turning
    assert optimal.bits & (FAULT | READY | SWITCHED_ON) == FAULT
    assert optimal.read(CONTROL_FREQUENCY) == optimal.read(CONTROL_SPEED) == 0
    optimal.wait(20)
    assert optimal.read(STATUS) == code, 'reading the other register acknowledges nothing'
    assert optimal.read(STATUS) == code
    assert optimal.read(STATUS_WITH_ACK) == code
    assert not optimal.bits & FAULT
    assert optimal.code < 40 and optimal.code not in FAULTS
    assert optimal.running is (code not in (SIO_FAIL, BUS_FAIL)), 'the run command stood'


def test_a_fault_whose_cause_lasts_is_not_acknowledged(optimal):
    optimal.drive.trip(3, cause_present=True)
    assert optimal.read(STATUS_WITH_ACK) == 3
    assert optimal.bits & FAULT
    optimal.drive.end_fault_causes()
    assert optimal.read(STATUS_WITH_ACK) == 3
    assert not optimal.bits & FAULT


def test_a_run_command_is_taken_in_a_fault_and_holds(optimal):
    optimal.drive.trip(5)
    optimal.run(20)
    assert not optimal.running
    optimal.read(STATUS_WITH_ACK)
    assert optimal.running


def test_a_stop_is_taken_in_a_fault(optimal):
    optimal.run(20, 5)
    optimal.drive.trip(5)
    optimal.write(SMODE, STOP)
    optimal.read(STATUS_WITH_ACK)
    assert not optimal.running


@pytest.mark.parametrize('code', ALARMS)
def test_an_alarm_stops_nothing(optimal, code):
    optimal.run(20, 5)
    optimal.drive.trip(code, cause_present=True)
    assert optimal.running
    assert optimal.code == code
    assert optimal.bits & (ALARM | FAULT | READY) == ALARM | READY
    state = describe(optimal.drive)
    assert (state['fault'], state['alarms']) == (0, [code])
    optimal.drive.end_fault_causes()
    assert optimal.read(STATUS_WITH_ACK) == code
    assert (optimal.text, optimal.bits & ALARM) == ('Bus Run', 0)


def test_a_fault_is_shown_before_an_alarm(optimal):
    optimal.drive.trip(53, cause_present=True)
    optimal.drive.trip(5)
    assert optimal.code == 5
    optimal.read(STATUS_WITH_ACK)
    assert optimal.code == 53


@pytest.mark.parametrize('code', [0, 24, 37, 54, 64])
def test_what_is_only_a_status_does_not_happen_as_a_fault(optimal, code):
    with pytest.raises(ValueError, match='no fault of sinus_optimal'):
        optimal.drive.trip(code)


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
    optimal.run(20, 5)
    optimal.drive.power_cycle(1.0)
    assert not optimal.drive.listening
    optimal.wait(1.1)
    assert optimal.drive.listening
    assert (optimal.read(MODE), optimal.running) == (MANUAL, False)
    assert optimal.read(INPUT_FREQUENCY) == 200, 'a set-point stands through a power cycle'
    assert optimal.read(DRIVE_CONTROL) == 0


# ---- the command and the state ----


def test_the_state_has_the_keys_of_the_g2(optimal, bench):
    assert describe(optimal.drive).keys() == describe(bench.drive).keys()


def test_the_state_tells_the_truth(optimal):
    optimal.run(20, 5)
    state = describe(optimal.drive)
    expected = {
        'model': 'sinus_optimal',
        'mode': BUS,
        'source': 'scmd',
        'scmd': RUN_INPUT,
        'inv_st': 38,
        'inv_st_text': 'Bus Run',
        'state': 'OPERATION_ENABLED',
        'setpoint': 20.0,
        'setpoint_key': 'fieldbus.input_freq_setpoint',
        'turning': True,
        'ack_reads': 0,
        'writes': {},
        'command_writes': {
            'fieldbus.mode': 1,
            'fieldbus.smode': 1,
            'fieldbus.input_freq_setpoint': 1,
        },
    }
    assert {key: state[key] for key in expected} == expected
    assert state['status_word'] == optimal.read(DRIVE_STATUS) & 0xFFFF
    assert state['parameters']['status.control_freq'] == 20.0
    assert state['parameters']['control.accel'] == 5.0


@pytest.mark.parametrize(
    ('key', 'value'), [('control.mode', 'Torque'), ('freque.f_fix1', 5), ('control.accel', 0)]
)
def test_a_setting_that_it_does_not_have(key, value):
    with pytest.raises(ValueError, match=key):
        OptimalBench(settings={key: value})


def test_the_command_knows_its_settings(capsys):
    with pytest.raises(SystemExit):
        main(['--model', 'sinus_optimal', '--set', 'control.acel=1'])
    assert 'did you mean control.accel' in capsys.readouterr().err


def test_what_can_be_injected_into_a_g2_can_be_into_an_optimal():
    with Simulator([1, 2], model='sinus_optimal', settings={'control.retard': 2}) as simulator:
        simulator.inject('fault', 5, address=2)
        simulator.inject('run', False, address=1)
        simulator.inject('set', 'control.accel', '7', address=1)
        first, second = simulator.state(1), simulator.state(2)
        assert (first['run_input'], first['parameters']['control.accel']) == (False, 7.0)
        assert (second['state'], second['fault']) == ('FAULTED', 5)
        simulator.inject('power-cycle', 0, address=2)
        assert simulator.state(2)['fault'] == 0
