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

"""A simulated drive on Classic: what it refuses, its faults, and what older firmware lacks."""

from classic_bench import ACK
from classic_bench import NAK
from classic_bench import RUN
from classic_bench import SIO_FAIL
from classic_bench import ClassicBench
from classic_bench import enquiry
from classic_bench import select
import pytest

from nfo_sinus_driver.simulator.modbus import server

BLOCKED, CHECK_SUM, STRUCTURE, TIMEOUT, PREFIX = 0x1, 0x4, 0x8, 0x10, 0x20
NOT_PERMITTED, UNKNOWN, UNREADABLE, UNWRITABLE, OUT_OF_RANGE = 0x40, 0x80, 0x100, 0x200, 0x400

both = pytest.mark.parametrize('dialect', ['2.03', '5.0'])


@both
@pytest.mark.parametrize(
    ('frame', 'flag'),
    [
        (enquiry('E0019'), UNKNOWN),
        (select('E0019', 100), UNKNOWN),
        (enquiry('E0240'), UNKNOWN),
        (enquiry('E00AD'), UNREADABLE),
        (select('E00E9', 0), UNWRITABLE),
        (select('E00AC', 0), UNWRITABLE),
        (select('E0027', 0), UNWRITABLE),
        (select('E00DA', 0), UNWRITABLE),
        (select('E0200', 0), UNKNOWN),
        (select('E001D', 1), OUT_OF_RANGE),
        (select('E001D', 5001), OUT_OF_RANGE),
        (select('E002C', -1), OUT_OF_RANGE),
        (select('E0030', 4), OUT_OF_RANGE),
        (select('E0029', 0), OUT_OF_RANGE),
        (select('E001E', 1501), OUT_OF_RANGE),
        (select('E00A9', 96), OUT_OF_RANGE),
        (select('E00AD', RUN), NOT_PERMITTED),
        (b'\x04!F0029\x05', PREFIX),
    ],
)
def test_a_refusal_has_its_reason(dialect, frame, flag):
    bench = ClassicBench(dialect)
    if frame == enquiry('E0240') and dialect == '5.0':
        assert bench.read('E0240') == 0
        return
    if flag == OUT_OF_RANGE and dialect == '5.0' and frame != select('E0029', 0):
        flag = NOT_PERMITTED
    assert bench.say(frame) == NAK
    assert bench.flags == flag
    assert bench.drive.control_unit.status_code == 24, 'nobody has control, so it is no fault'
    assert bench.read('E00AC') == flag
    assert bench.read('E00AC') == 0
    assert bench.drive.control_unit.sio_err_reads == 2


def test_older_firmware_changes_nothing_but_mode_before_the_bus_has_control():
    bench = ClassicBench('5.0')
    for frame in [select('E001D', 20), select('E001E', 0), select('E00AD', 0)]:
        assert bench.say(frame) == NAK
        assert bench.read('E00AC') == NOT_PERMITTED
    assert bench.drive.control_unit.status_code == 24, 'nobody has control, so it is no fault'
    assert not bench.drive.writes
    for mode in (2, 1, 3):
        assert bench.write('E0029', mode) == ACK
    assert bench.write('E001D', 20) == ACK
    assert bench.read('E001D') == 20
    assert bench.write('E0029', 2) == ACK
    assert bench.write('E001D', 30) == NAK
    assert bench.read('E001D') == 20


def test_newer_firmware_takes_settings_from_whoever_has_control():
    bench = ClassicBench('2.03')
    for mode in (1, 2, 3):
        assert bench.write('E0029', mode) == ACK
        assert bench.write('E001D', 20 + mode) == ACK


@both
def test_while_it_tunes_mode_and_every_command_but_stop_are_refused(dialect):
    bench = ClassicBench(dialect)
    bench.write('E0029', 3)
    assert bench.write('E00AD', 0x201) == ACK
    for id_, value in [('E0029', 1), ('E0029', 3), ('E00AD', RUN)]:
        assert bench.write(id_, value) == NAK
    assert bench.write('E001D', 20) == (NAK if dialect == '5.0' else ACK)
    assert bench.flags == NOT_PERMITTED
    code = bench.drive.control_unit.status_code
    assert code == 28, 'no serial fault: the bus does not control the motor'
    assert bench.write('E00AD', 0) == ACK
    assert bench.drive.control_unit.status_code == 37


@both
def test_a_drive_that_refuses_a_stop_while_it_tunes(dialect):
    bench = ClassicBench(dialect, stop_in_tuning='refused')
    bench.write('E0029', 3)
    bench.write('E00AD', 0x201)
    assert bench.write('E00AD', 0) == NAK
    assert bench.flags == NOT_PERMITTED
    assert bench.drive.control_unit.status_code == 28
    bench.drive.advance(10)
    assert bench.write('E00AD', 0) == ACK
    assert bench.drive.control_unit.status_code == 37


def test_not_while_it_runs():
    bench = ClassicBench(lenient=True)
    bench.run()
    assert bench.write('E0008', 200) == NAK
    assert bench.flags == NOT_PERMITTED
    assert bench.write('E001D', 20) == ACK
    assert bench.running


@both
def test_a_damaged_message(dialect):
    bench = ClassicBench(dialect)
    answer = bench.say(select('E0029', 3)[:-1] + b'\x00')
    assert answer == {'2.03': b'', '5.0': NAK}[dialect]
    assert bench.flags == CHECK_SUM
    assert bench.drive.control_unit.mode == 1
    assert bench.say(b'\x04!E0029\x06') == b''
    assert bench.flags == CHECK_SUM | STRUCTURE
    assert bench.say(select('E0029', 3, 95)[:-1] + b'\x00') == b''


def test_a_damaged_message_to_another_is_not_its_business():
    bench = ClassicBench()
    bench.say(select('E0029', 3, 2)[:-1] + b'\x00')
    assert bench.flags == 0


@pytest.mark.parametrize('refused', ['all', 'scmd', 'nothing'])
def test_a_fault_blocks_every_select_and_no_enquiry(refused):
    bench = ClassicBench(refuses_in_fault=refused)
    bench.run()
    bench.drive.trip(5)
    for frame in [select('E0029', 1), select('E0029', 3), select('E00AD', 0), select('E001D', 20)]:
        assert bench.say(frame) == NAK
    assert bench.flags == BLOCKED
    assert bench.read('E00E9') == 5
    assert bench.drive.control_unit.ack_reads == 0
    assert bench.read('E00E8') == 5
    assert bench.drive.control_unit.ack_reads == 1
    assert bench.read('E00E9') not in (5, SIO_FAIL)
    assert bench.write('E0029', 1) == ACK


@pytest.mark.parametrize(
    ('frame', 'flag'),
    [
        (select('E001E', 2000), OUT_OF_RANGE),
        (enquiry('E0019'), UNKNOWN),
        (select('E0019', 100), UNKNOWN),
        (select('E0008', 100), NOT_PERMITTED),
        (select('E0029', 3)[:-1] + b'\x00', CHECK_SUM),
        (b'\x04!E0029\x06', STRUCTURE),
    ],
)
@both
def test_under_bus_control_it_is_a_serial_fault(dialect, frame, flag):
    bench = ClassicBench(dialect)
    bench.run()
    bench.drive.advance(1)
    assert bench.running
    bench.say(frame)
    assert not bench.running, 'the motor coasts'
    assert bench.read('E00E9') == SIO_FAIL
    assert bench.read('E0029') == 1, 'MODE is Stop'
    assert bench.read('E00E8') == SIO_FAIL
    assert bench.read('E00E9') == SIO_FAIL, 'not to be acknowledged by InvSt'
    assert bench.write('E00AD', 0) == NAK
    assert bench.read('E00AC') == flag | BLOCKED
    assert bench.read('E00E9') == 24
    assert bench.read('E00AC') == 0
    bench.run()


@pytest.mark.parametrize('frame', [enquiry, lambda id_: select(id_, 1)], ids=['read', 'write'])
@pytest.mark.parametrize('id_', ['E007D', 'E0075', 'E00FA'])
def test_what_older_firmware_does_not_know_is_a_serial_fault_too(id_, frame):
    assert ClassicBench('2.03').read(id_) is not None
    bench = ClassicBench('5.0')
    bench.run()
    bench.drive.advance(1)
    assert bench.say(frame(id_)) == NAK
    assert not bench.running
    assert bench.read('E00E9') == SIO_FAIL
    assert bench.read('E00AC') == UNKNOWN


@pytest.mark.parametrize('frame', [select('E001E', 2000), enquiry('E0019'), select('E00E9', 0)])
def test_a_lenient_drive_only_notes_refusals(frame):
    bench = ClassicBench(lenient=True)
    bench.run()
    assert bench.say(frame) == NAK
    assert bench.running
    assert bench.flags
    bench.say(b'\x04!E0029\x06')
    assert bench.read('E00E9') == SIO_FAIL


def test_stop_in_spite_of_a_serial_fault():
    bench = ClassicBench('2.03')
    bench.run()
    bench.write('E001E', 2000)
    assert bench.write('E0029', 3) == NAK
    assert bench.write('E0029', 1) == ACK
    assert bench.read('E00E9') == 24
    assert bench.flags == 0


def test_older_firmware_obeys_only_a_stop_to_all():
    bench = ClassicBench('5.0')
    bench.run()
    bench.write('E001E', 2000)
    assert bench.write('E0029', 1) == NAK
    assert bench.read('E00E9') == SIO_FAIL
    assert bench.write('E0029', 3, 95) == b''
    assert bench.read('E00E9') == SIO_FAIL
    assert bench.write('E0029', 1, 95) == b''
    assert bench.read('E00E9') == 24
    assert bench.flags == 0


@both
def test_silence_is_a_serial_fault(dialect):
    bench = ClassicBench(dialect, settings={'serial.sio_tot': 1.0, 'serial.auto_stop': True})
    bench.run()
    for _ in range(4):
        bench.drive.advance(0.6)
        assert bench.read('E00E9') in (38, 39)
    bench.drive.advance(1.1)
    assert bench.read('E00E9') == SIO_FAIL
    assert bench.read('E0029') == 1
    assert bench.read('E00AC') == TIMEOUT
    assert bench.read('E00E9') == 24


def test_a_damaged_message_does_not_count_as_heard():
    bench = ClassicBench(settings={'serial.sio_tot': 1.0, 'serial.auto_stop': True})
    for frame, flags in [(select('E0029', 1), 0), (select('E0029', 1)[:-1] + b'\0', TIMEOUT)]:
        bench.read('E00AC')
        bench.drive.advance(0.9)
        bench.say(frame)
        bench.drive.faults.take_sio_err()
        bench.drive.advance(0.2)
        assert bench.flags == flags


def test_the_keypad_takes_over():
    bench = ClassicBench()
    bench.run()
    bench.drive.control_unit.press('stop')
    assert bench.read('E0029') == 1
    assert bench.write('E00AD', RUN) == NAK
    assert bench.flags == NOT_PERMITTED


def test_a_power_cycle_forgets_the_flags():
    bench = ClassicBench()
    bench.say(enquiry('E0019'))
    bench.drive.power_cycle(0.0)
    assert bench.flags == 0


def test_a_lasting_cause_of_sio_fail():
    bench = ClassicBench()
    bench.drive.trip(SIO_FAIL, cause_present=True)
    bench.read('E00AC')
    assert bench.read('E00E9') == SIO_FAIL
    bench.drive.end_fault_causes()
    bench.read('E00AC')
    assert bench.read('E00E9') == 24


@pytest.mark.parametrize(
    'id_',
    ['E0075', 'E0076', 'E007A', 'E00DC', 'E00FA', 'E00FC', 'E00F9', 'E007C', 'E007D', 'E00E1'],
)
def test_older_firmware_does_not_know_it(id_):
    new, old = ClassicBench('2.03'), ClassicBench('5.0')
    new.read(id_)
    assert old.say(enquiry(id_)) == NAK
    assert old.flags == UNKNOWN


def test_a_parameter_that_came_later():
    bench = ClassicBench(settings={'fieldbus.sw_ver': 4.3})
    assert bench.read('E0075') == 430
    assert bench.say(enquiry('E00F9')) == NAK
    assert bench.flags == UNKNOWN


def test_line_settings_of_older_firmware():
    new, old = ClassicBench('2.03', lenient=True), ClassicBench('5.0', lenient=True)
    for id_, code, of_new, of_old in [
        ('E0029', 3, ACK, ACK),
        ('E00A8', 256, ACK, NAK),
        ('E00A8', 64, ACK, ACK),
        ('E00AA', 4, ACK, NAK),
        ('E00AA', 1, ACK, ACK),
        ('E00A9', 95, NAK, ACK),
        ('E00A9', 94, ACK, ACK),
        ('E000A', 12, ACK, NAK),
    ]:
        assert new.say(select(id_, code, 0)) == of_new.replace(b'!', b' ')
        assert old.say(select(id_, code, 0))[1:] == of_old[1:]
    for bench, effective in [(new, (1, 256, 4)), (old, (94, 64, 1))]:
        side = bench.drive.control_unit.serial
        assert (side.address, side.baud, side.char_format) == effective


def test_the_answer_to_a_new_address_comes_from_the_old_one():
    bench = ClassicBench('5.0')
    assert bench.write('E0029', 3) == ACK
    assert bench.write('E00A9', 9) == ACK
    assert bench.read('E0029', 9) == 3


def test_who_controls_an_older_drive():
    bench = ClassicBench('5.0')
    server(bench.drive).write(0x294, [3])
    assert bench.read('E00E9') == 41
    assert bench.drive.control_unit.status_text == 'Bus Stby'
    bench.write('E0029', 3)
    assert bench.read('E00E9') == 37
    assert bench.drive.control_unit.status_text == 'Sio Stby'
