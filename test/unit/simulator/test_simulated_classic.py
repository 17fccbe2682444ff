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

"""A simulated drive on Classic: whom a message is for, values, set-points and commands."""

from classic_bench import ACK
from classic_bench import NAK
from classic_bench import RUN
from classic_bench import ClassicBench
from classic_bench import bcc
from classic_bench import enquiry
from classic_bench import reply
from classic_bench import select
import pytest
from support.addresses import packed

from nfo_sinus_driver.simulator.modbus import server

BLOCKED, CHECK_SUM, STRUCTURE, TIMEOUT, PREFIX = 0x1, 0x4, 0x8, 0x10, 0x20
NOT_PERMITTED, UNKNOWN, UNREADABLE, UNWRITABLE, OUT_OF_RANGE = 0x40, 0x80, 0x100, 0x200, 0x400

both = pytest.mark.parametrize('dialect', ['2.03', '5.0'])


@both
def test_its_own_address_and_no_other(dialect):
    bench = ClassicBench(dialect, address=7)
    assert bench.say(enquiry('E0029', 7)) == reply('E0029', 1, 7)
    for other in (1, 6, 8, 94):
        assert bench.say(enquiry('E0029', other)) == b''
        assert bench.say(select('E0029', 3, other)) == b''
    assert bench.drive.control_unit.mode == 1


def test_the_answer_to_address_0_comes_from_there_or_from_the_drives_own():
    new, old = ClassicBench('2.03', address=7), ClassicBench('5.0', address=7)
    assert new.say(enquiry('E0029', 0)) == reply('E0029', 1, 0)
    assert old.say(enquiry('E0029', 0)) == reply('E0029', 1, 7)
    assert new.say(select('E0029', 3, 0)) == b' \x06'
    assert old.say(select('E0029', 3, 0)) == b"'\x06"
    assert old.say(enquiry('EFFFF', 0)) == b"'\x15"


@both
def test_a_select_to_all_is_obeyed_and_not_answered(dialect):
    bench = ClassicBench(dialect, address=7)
    assert bench.say(select('E0029', 3, 95)) == b''
    assert bench.drive.control_unit.mode == 3
    assert bench.say(select('EFFFF', 3, 95)) == b''
    assert bench.say(enquiry('E0029', 95)) == b''
    assert bench.flags & UNKNOWN


def test_an_address_left_from_modbus_cannot_be_reached():
    bench = ClassicBench(address=247)
    assert bench.read('E0029', 0) == 1
    assert all(not bench.say(enquiry('E0029', address)) for address in range(1, 95))


def test_upper_and_lower_case():
    new, old = ClassicBench('2.03'), ClassicBench('5.0')
    assert new.say(b'\x04!E00AB\x05') == reply('E00AB', 0)
    assert old.say(b'\x04!E00AB\x05') == b'!\x02E00ab=0000\x03' + bcc(b'E00ab=0000\x03')
    assert old.say(b'\x04!E00ab\x05') == b'!\x02E00ab=0000\x03' + bcc(b'E00ab=0000\x03')
    assert new.say(b'\x04!E00ab\x05') == b''
    assert new.flags == STRUCTURE


@pytest.mark.parametrize(
    ('id_', 'key', 'coarse', 'value'),
    [
        ('E0008', 'motor.p_nom', 75, 0.75),
        ('E0011', 'motor.i_nom', 21, 2.1),
        ('E0015', 'motor.cos_phi', 77, 0.77),
        ('E0002', 'motor.r_stat', 1234, 12.34),
        ('E0004', 'motor.l_main', 4321, 0.4321),
        ('E0005', 'motor.i_magn', 123, 1.23),
        ('E001D', 'control.accel', 123, 12.3),
        ('E001C', 'control.retard', 5000, 500),
        ('E0049', 'pi_reg.t_min', -100, -100),
        ('E0052', 'pi_reg.reg_amp', -1, -1),
        ('E000A', 'pi_reg.unit', 3, 'bar'),
        ('E005E', 'output.f_max', 32000, 32000),
    ],
)
def test_a_coarse_value_is_kept_and_read_back(id_, key, coarse, value):
    bench = ClassicBench()
    assert bench.write(id_, coarse) == ACK
    assert bench.read(id_) == coarse & 0xFFFF
    assert bench.drive.peek(key) == pytest.approx(value)
    assert bench.drive.writes[key] == 1


@pytest.mark.parametrize(('fine', 'coarse'), [(5.004, 50), (5.05, 51), (5.149, 51), (4.951, 50)])
def test_a_finer_value_is_rounded(fine, coarse):
    bench = ClassicBench(settings={'control.accel': fine})
    assert bench.read('E001D') == coarse
    assert bench.drive.peek('control.accel') == fine


def test_every_parameter_agrees_with_the_catalog():
    bench = ClassicBench()
    for key, parameter in bench.drive.model.items():
        if 'classic' not in parameter.addresses or parameter.access.value not in ('r', 'rw'):
            continue
        place = parameter.at('classic')
        words = [bench.read(f'E{id_:04X}') for id_ in place.numbers]
        value = bench.drive.peek(key)
        if isinstance(value, float):
            step = float(parameter.factor('classic')) + 1e-9
            if 'modbus' in parameter.addresses:
                step = max(step, float(parameter.factor('modbus')))
            shown = parameter.decode(packed(*words), 'classic')
            assert shown == pytest.approx(value, abs=step), key
        else:
            assert parameter.decode(packed(*words), 'classic') == value, key


def test_what_is_measured_is_as_fine_as_classic_is():
    bench = ClassicBench()
    bench.drive.motor.dc_link = 543.21
    assert bench.read('E0014') == 5432
    assert server(bench.drive).read(0x3F8, 1) == (543,)


def test_what_does_not_fit_is_the_most_that_does():
    bench = ClassicBench(settings={'motor.r_stat': 1000})
    assert bench.read('E0002') == 0x7FFF


def test_firmware():
    assert ClassicBench().read('E0075') == 438
    assert ClassicBench().read('E0076') == 4018


def test_a_counter_is_two_parameters():
    bench = ClassicBench()
    bench.drive.counters.operating_time = 20000.05
    assert (bench.read('E0027'), bench.read('E0127')) == (200000 & 0xFFFF, 200000 >> 16)


def test_its_halves_can_be_torn():
    bench = ClassicBench()
    bench.drive.counters.operating_time = 6553.5
    low = bench.read('E0027')
    bench.drive.advance(400)
    assert (low, bench.read('E0127')) == (0xFFFF, 1)


@pytest.mark.parametrize(
    ('low', 'high'),
    [('E0027', 'E0127'), ('E0028', 'E0128'), ('E00DD', 'E00DE'), ('E00FA', 'E00FB')],
)
def test_they_are_torn_on_request(low, high):
    bench = ClassicBench()
    true = bench.read(high) << 16 | bench.read(low)
    bench.drive.servers['classic'].tears = 1
    first, torn, second = bench.read(high), bench.read(low), bench.read(high)
    assert (first, torn, second) == (true >> 16, 0, (true >> 16) + 1)
    assert bench.read(high) == second, 'once was asked for'
    bench.drive.servers['classic'].tears = 1
    bench.read('E0029')
    bench.read('E00E2')
    assert bench.drive.servers['classic'].tears == 1, 'only counters go on'


def test_older_firmware_counts_in_24_bits():
    new, old = ClassicBench('2.03'), ClassicBench('5.0')
    for bench in (new, old):
        bench.drive.counters.operating_time = 0x1234567 / 10
    assert (new.read('E0127'), old.read('E0127')) == (0x123, 0x23)


@pytest.mark.parametrize(
    ('mode', 'id_', 'raw'),
    [(0, 'E0020', 250), (1, 'E004E', -250), (2, 'E0021', 50), (3, 'E0096', -1440)],
)
def test_the_setpoint_is_that_of_the_control_mode(mode, id_, raw):
    bench = ClassicBench()
    assert bench.write('E0030', mode) == ACK
    assert bench.write('E001E', raw) == ACK
    assert bench.read('E001E') == bench.read(id_) == raw & 0xFFFF
    assert bench.write(id_, 7) == ACK
    assert bench.read('E001E') == 7
    old = ClassicBench('5.0')
    old.write('E0029', 3)
    old.write('E0030', mode)
    old.write('E001E', raw)
    assert old.read(id_) == raw & 0xFFFF
    assert old.write(id_, 7) == NAK
    assert old.flags == UNWRITABLE


@both
def test_a_ride(dialect):
    bench = ClassicBench(dialect)
    assert bench.read('E00E9') == 24
    bench.run(250)
    bench.drive.advance(1)
    assert bench.read('E00E9') == 39
    bench.drive.advance(10)
    assert bench.read('E00E9') == 38
    assert bench.read('E00B6') == 250
    assert bench.write('E00AD', 0) == ACK
    bench.drive.advance(10)
    assert bench.read('E00E9') == 37
    assert bench.drive.control_unit.status_text == {'2.03': 'Bus Stby', '5.0': 'Sio Stby'}[dialect]
    assert bench.write('E0029', 1) == ACK
    assert bench.read('E00E9') == 24


def test_older_firmware_takes_every_even_command_for_stop():
    for command in (0x02, 0x100, 0x40):
        new, old = ClassicBench('2.03', lenient=True), ClassicBench('5.0', lenient=True)
        for bench in (new, old):
            bench.run()
            bench.drive.advance(1)
        assert new.write('E00AD', command) == NAK
        assert old.write('E00AD', command) == ACK
        assert new.drive.control_unit.scmd == RUN
        assert old.drive.control_unit.scmd == 0


def test_the_energy_counter_is_reset_by_newer_firmware():
    new, old = ClassicBench('2.03', lenient=True), ClassicBench('5.0', lenient=True)
    for bench, answer in [(new, ACK), (old, NAK)]:
        bench.write('E0029', 3)
        assert bench.write('E00AD', 0x900) == answer


def test_drive_control_acknowledges_in_spite_of_a_fault():
    bench = ClassicBench()
    bench.drive.trip(5)
    bench.drive.advance(1)
    assert bench.write('E007C', 0x4006) == ACK
    assert bench.write('E007C', 0x4086) == ACK
    assert bench.read('E00E9') != 5
    assert bench.read('E007D') & 8 == 0


@both
def test_the_error_log(dialect):
    bench = ClassicBench(dialect)
    assert bench.read('E0200') == bench.read('E0201') == 0
    for code in (7, 5):
        bench.drive.trip(code)
        bench.read('E00E8')
    bench.drive.counters.operating_time = 0x1ABCD / 10
    bench.drive.trip(8)
    assert (bench.read('E0200'), bench.read('E0201')) == (0xABCD, 0x0801)
    assert [bench.read(f'E{0x201 + 2 * entry:04X}') >> 8 for entry in range(4)] == [8, 5, 7, 0]
    size = {'2.03': 32, '5.0': 128}[dialect]
    assert bench.read(f'E{0x200 + 2 * size - 1:04X}') == 0
    assert bench.say(enquiry(f'E{0x200 + 2 * size:04X}')) == NAK


def test_the_same_log_over_modbus():
    bench = ClassicBench()
    bench.drive.counters.operating_time = 0x1ABCD / 10
    bench.drive.trip(8)
    assert server(bench.drive).read(0xC000, 2) == (0xABCD, 0x0801)
    assert server(bench.drive).read(0xC07C, 2) == (0, 0)
