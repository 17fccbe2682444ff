# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated drive on Classic: messages byte by byte, values, refusals, and older firmware."""

from classic_bench import ACK, NAK, RUN, SIO_FAIL, ClassicBench, bcc, enquiry, reply, select
from hypothesis import given, settings, strategies as st
import pytest
from support.examples import examples

from nfo_sinus_driver.simulator import classic as classic_frames
from nfo_sinus_driver.simulator.classic import Classic, LineError, Message
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.modbus import server

#: "A SELECT message to address 1 which gives parameter 25 the value of 100" ([M0 §6.1.3], [M2 §5]).
EXAMPLE = bytes.fromhex('04 21 02 45 30 30 31 39 3D 30 30 36 34 03 71')
BLOCKED, CHECK_SUM, STRUCTURE, TIMEOUT, PREFIX = 0x1, 0x4, 0x8, 0x10, 0x20
NOT_PERMITTED, UNKNOWN, UNREADABLE, UNWRITABLE, OUT_OF_RANGE = 0x40, 0x80, 0x100, 0x200, 0x400
DAMAGED = select('E0029', 3)[:-1] + b'\x00'

both = pytest.mark.parametrize('dialect', ['2.03', '5.0'])


def benches(**options):
    """One drive with newer firmware, one with older."""
    return ClassicBench('2.03', **options), ClassicBench('5.0', **options)


# ---- messages ----


def test_messages_of_the_manuals():
    assert classic_frames.parse(EXAMPLE) == Message(id=0x19, value=100)
    assert select('E0019', 100) == EXAMPLE
    assert reply('E0019', 100) == bytes.fromhex('21 02') + EXAMPLE[3:]
    asked = bytes.fromhex('04 7E 45 30 30 45 39 05')
    assert asked == enquiry('E00E9', 94)
    assert (Classic.unwrap(EXAMPLE).address, Classic.unwrap(asked).address) == (1, 94)
    assert classic_frames.parse(asked) == Message(id=0xE9)
    # 21 02 E0019=0064 03 71
    assert classic_frames.reply(1, 0x19, 100, small_letters=False) == b'!\x02E0019=0064\x03q'
    assert classic_frames.reply(94, 0xAC, 0xABCD, small_letters=True) == b'~\x02E00ac=abcd\x03' + (
        bcc(b'E00ac=abcd\x03')
    )
    assert classic_frames.acknowledge(0, True) == b' \x06'
    assert classic_frames.acknowledge(1, False) == b'!\x15'


def test_what_is_wrong_with_a_message():
    for frame, wrong in (
        (EXAMPLE[:-1] + b'\x72', LineError.CHECK_SUM),
        (EXAMPLE.replace(b'0064', b'0065'), LineError.CHECK_SUM),
        (EXAMPLE.replace(b'=', b'-'), LineError.STRUCTURE),
        (EXAMPLE.replace(b'\x03', b'\x17'), LineError.STRUCTURE),
        (EXAMPLE.replace(b'0064', b'00G4'), LineError.STRUCTURE),
        (EXAMPLE[:-2], LineError.STRUCTURE),
        (b'\x04!E0019\x06', LineError.STRUCTURE),
        (b'\x04!E001\x05', LineError.STRUCTURE),
        (b'\x04!F0019\x05', LineError.PREFIX),
        (b'\x04!\x02F0019=0064\x03' + bcc(b'F0019=0064\x03'), LineError.PREFIX),
    ):
        assert classic_frames.parse(frame).wrong is wrong, frame
    for frame in (b'', b'\x04', b'\x04\x1f', b'\x04\x80', b'!E0019\x05'):
        assert Classic.unwrap(frame) is None, 'to no drive'
        assert Classic.unwrap(frame) is None


@given(st.binary(max_size=30), st.sampled_from([4.21, 4.38]))
@settings(max_examples=examples(200))
def test_whatever_comes_the_answer_is_one_of_the_three(data, sw_ver):
    drive = simulated_drive(settings={'fieldbus.sw_ver': sw_ver})
    answer = Classic().answer(drive, Classic.unwrap(b'\x04 ' + data))
    assert answer in (b'', b' \x15', b'!\x15') or (len(answer) == 14 and answer[1] == 2)
    if not answer:
        assert drive.faults.sio_err


# ---- which drive a message is for ----


def test_its_own_address_address_0_and_all():
    for bench, answers_from in zip(benches(address=7), (0, 7), strict=True):
        assert bench.say(enquiry('E0029', 7)) == reply('E0029', 1, 7)
        for other in (1, 6, 8, 94):
            assert bench.say(enquiry('E0029', other)) == b''
            assert bench.say(select('E0029', 3, other)) == b''
        assert bench.drive.control_unit.mode == 1
        assert bench.say(enquiry('E0029', 0)) == reply('E0029', 1, answers_from)
        assert bench.say(select('E0029', 1, 0)) == bytes((32 + answers_from, 6))
        assert bench.say(enquiry('EFFFF', 0)) == bytes((32 + answers_from, 0x15))
        assert bench.say(select('E0029', 3, 95)) == b''
        assert bench.drive.control_unit.mode == 3
        assert bench.say(select('EFFFF', 3, 95)) == bench.say(enquiry('E0029', 95)) == b''
        assert bench.flags & UNKNOWN
    bench = ClassicBench(address=247)
    assert bench.read('E0029', 0) == 1, 'an address left from Modbus cannot be reached'
    assert all(not bench.say(enquiry('E0029', address)) for address in range(1, 95))


def test_upper_and_lower_case():
    new, old = benches()
    assert new.say(b'\x04!E00AB\x05') == reply('E00AB', 0)
    for frame in (b'\x04!E00AB\x05', b'\x04!E00ab\x05'):
        assert old.say(frame) == b'!\x02E00ab=0000\x03' + bcc(b'E00ab=0000\x03')
    assert (new.say(b'\x04!E00ab\x05'), new.flags) == (b'', STRUCTURE)


# ---- values ----


def test_a_value_that_is_finer_than_the_protocol_is_rounded():
    for fine, coarse in ((5.004, 50), (5.05, 51), (5.149, 51), (4.951, 50)):
        bench = ClassicBench(settings={'control.accel': fine})
        assert bench.read('E001D') == coarse
        assert bench.drive.peek('control.accel') == fine


def test_firmware_and_what_is_measured():
    bench = ClassicBench(settings={'motor.r_stat': 1000})
    assert (bench.read('E0075'), bench.read('E0076')) == (438, 4018)
    assert bench.read('E0002') == 0x7FFF, 'what does not fit is the most that does'
    bench.drive.motor.dc_link = 543.21
    assert bench.read('E0014') == 5432
    assert server(bench.drive).read(0x3F8, 1) == (543,), 'Modbus is coarser'


def test_a_counter_is_two_parameters_that_can_be_torn():
    new, old = benches()
    for bench in (new, old):
        bench.drive.counters.operating_time = 0x1234567 / 10
    assert (new.read('E0127'), old.read('E0127')) == (0x123, 0x23), '24 bits'
    new.drive.counters.operating_time = 6553.5
    low = new.read('E0027')
    new.drive.advance(400)
    assert (low, new.read('E0127')) == (0xFFFF, 1)
    for low, high in (
        ('E0027', 'E0127'), ('E0028', 'E0128'), ('E00DD', 'E00DE'), ('E00FA', 'E00FB')
    ):
        bench = ClassicBench()
        true = bench.read(high) << 16 | bench.read(low)
        bench.drive.servers['classic'].tears = 1
        first, torn, second = bench.read(high), bench.read(low), bench.read(high)
        assert (first, torn, second) == (true >> 16, 0, (true >> 16) + 1)
        assert bench.read(high) == second, 'once was asked for'
        bench.drive.servers['classic'].tears = 1
        bench.read('E0029')
        assert bench.drive.servers['classic'].tears == 1, 'only counters go on'


def test_the_setpoint_is_that_of_the_control_mode():
    for mode, (id_, raw) in enumerate(
        (('E0020', 250), ('E004E', -250), ('E0021', 50), ('E0096', -1440))
    ):
        new, old = benches()
        for bench, answer in ((new, ACK), (old, NAK)):
            bench.write('E0029', 3)
            assert bench.write('E0030', mode) == bench.write('E001E', raw) == ACK
            assert bench.read('E001E') == bench.read(id_) == raw & 0xFFFF
            assert bench.write(id_, 7) == answer
        assert new.read('E001E') == 7
        assert old.flags == UNWRITABLE


@both
def test_who_has_control_is_shown_by_the_codes_and_texts_of_the_firmware(dialect):
    bench = ClassicBench(dialect)
    bench.write('E0029', 3)
    assert bench.read('E00E9') == 37
    assert bench.drive.control_unit.status_text == {'2.03': 'Bus Stby', '5.0': 'Sio Stby'}[dialect]
    server(bench.drive).write(0x294, [3])
    assert bench.read('E00E9') == {'2.03': 37, '5.0': 41}[dialect], 'over Modbus'


def tolerant_benches():
    """Drives to which a refused message is no serial fault."""
    for bench in benches():
        unit = bench.drive.control_unit
        unit.serial_error = lambda flag, unit=unit: setattr(unit.faults, 'sio_err', flag)
        yield bench


def test_commands_of_newer_and_of_older_firmware():
    for command, of_new, of_old in ((0x02, NAK, ACK), (0x100, NAK, ACK), (0x900, ACK, NAK)):
        for bench, answer in zip(tolerant_benches(), (of_new, of_old), strict=True):
            bench.run()
            bench.drive.advance(1)
            if command == 0x900:
                bench.write('E0029', 3)
            assert bench.write('E00AD', command) == answer
            if command != 0x900:
                assert bench.drive.control_unit.scmd == (RUN if answer == NAK else 0)


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
    assert server(bench.drive).read(0xC000, 2) == (0xABCD, 0x0801), 'over Modbus'
    size = {'2.03': 32, '5.0': 128}[dialect]
    assert bench.read(f'E{0x200 + 2 * size - 1:04X}') == 0
    assert bench.say(enquiry(f'E{0x200 + 2 * size:04X}')) == NAK
    for _ in range(size):
        bench.drive.trip(5)
        bench.drive.faults.acknowledge()
    assert len(bench.drive.faults.log) == size, 'the oldest are gone'


# ---- refusals ----


@both
def test_a_refusal_has_its_reason(dialect):
    for frame, flag in (
        (enquiry('E0019'), UNKNOWN),
        (select('E0019', 100), UNKNOWN),
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
    ):
        bench = ClassicBench(dialect)
        if flag == OUT_OF_RANGE and dialect == '5.0' and frame != select('E0029', 0):
            flag = NOT_PERMITTED
        assert (bench.say(frame), bench.flags) == (NAK, flag), frame
        assert bench.drive.control_unit.status_code == 24, 'the bus has no control, so no fault'
        assert (bench.read('E00AC'), bench.read('E00AC')) == (flag, 0)
        assert bench.drive.control_unit.sio_err_reads == 2


def test_older_firmware_changes_nothing_but_mode_before_the_bus_has_control():
    new, old = benches()
    for frame in [select('E001D', 20), select('E001E', 0), select('E00AD', 0)]:
        assert old.say(frame) == NAK
        assert old.read('E00AC') == NOT_PERMITTED
    assert old.drive.control_unit.status_code == 24
    assert not old.drive.writes
    for mode in (2, 1, 3):
        for bench in (new, old):
            assert bench.write('E0029', mode) == ACK
            taken = bench is new or mode == 3
            assert bench.write('E001D', 20 + mode) == (ACK if taken else NAK)
            assert bench.read('E001D') == (20 + mode if taken else 50)


@both
def test_while_it_tunes_a_stop_alone_is_taken_or_is_refused(dialect):
    for refused in (False, True):
        bench = ClassicBench(dialect, **({'stop_in_tuning': 'refused'} if refused else {}))
        bench.write('E0029', 3)
        assert bench.write('E00AD', 0x201) == ACK
        for id_, value in [('E0029', 1), ('E0029', 3), ('E00AD', RUN)]:
            assert bench.write(id_, value) == NAK
        assert bench.write('E001D', 20) == (NAK if dialect == '5.0' else ACK)
        assert bench.write('E00AD', 0) == (NAK if refused else ACK)
        assert bench.flags == NOT_PERMITTED
        # no serial fault: the bus does not control the motor
        assert bench.drive.control_unit.status_code == (28 if refused else 37)
        bench.drive.advance(10)
        assert bench.write('E00AD', 0) == ACK
        assert bench.drive.control_unit.status_code == 37


@both
def test_a_damaged_message(dialect):
    bench = ClassicBench(dialect)
    assert bench.say(select('E0029', 3, 2)[:-1] + b'\x00') == b''
    assert bench.flags == 0, 'it was for another'
    assert bench.say(DAMAGED) == {'2.03': b'', '5.0': NAK}[dialect]
    assert bench.flags == CHECK_SUM
    assert bench.drive.control_unit.mode == 1
    assert bench.say(b'\x04!E0029\x06') == b''
    assert bench.flags == CHECK_SUM | STRUCTURE
    assert bench.say(select('E0029', 3, 95)[:-1] + b'\x00') == b''
    bench.drive.power_cycle(0.0)
    assert bench.flags == 0


def test_a_fault_blocks_every_select_and_no_enquiry():
    for refused in ('all', 'scmd', 'nothing'):
        bench = ClassicBench(refuses_in_fault=refused)
        bench.run()
        bench.drive.trip(5)
        for id_, value in (('E0029', 1), ('E0029', 3), ('E00AD', 0), ('E001D', 20)):
            assert bench.write(id_, value) == NAK
        assert bench.flags == BLOCKED
        assert (bench.read('E00E9'), bench.drive.control_unit.ack_reads) == (5, 0)
        assert (bench.read('E00E8'), bench.drive.control_unit.ack_reads) == (5, 1)
        assert bench.read('E00E9') not in (5, SIO_FAIL)
        assert bench.write('E0029', 1) == ACK


def test_drive_control_acknowledges_in_spite_of_a_fault():
    bench = ClassicBench()
    bench.drive.trip(5)
    bench.drive.advance(1)
    assert bench.write('E007C', 0x4006) == bench.write('E007C', 0x4086) == ACK
    assert bench.read('E00E9') != 5


@both
def test_under_bus_control_a_refusal_is_a_serial_fault(dialect):
    for frame, flag in (
        (select('E001E', 2000), OUT_OF_RANGE),
        (enquiry('E0019'), UNKNOWN),
        (select('E0019', 100), UNKNOWN),
        (select('E0008', 100), NOT_PERMITTED),
        (DAMAGED, CHECK_SUM),
        (b'\x04!E0029\x06', STRUCTURE),
    ):
        bench = ClassicBench(dialect)
        bench.run()
        bench.drive.advance(1)
        bench.say(frame)
        assert not bench.running, 'the motor coasts'
        assert (bench.read('E00E9'), bench.read('E0029')) == (SIO_FAIL, 1), 'MODE is Stop'
        assert bench.read('E00E8') == SIO_FAIL
        assert bench.read('E00E9') == SIO_FAIL, 'not to be acknowledged by InvSt'
        assert bench.write('E00AD', 0) == NAK
        assert bench.read('E00AC') == flag | BLOCKED
        assert (bench.read('E00E9'), bench.read('E00AC')) == (24, 0)
        bench.run()


def test_stop_in_spite_of_a_serial_fault():
    for bench, address, answers in zip(benches(), (1, 95), ((NAK, ACK), (b'', b'')), strict=True):
        bench.run()
        bench.write('E001E', 2000)
        if address == 95:
            assert bench.write('E0029', 1) == NAK, 'older firmware obeys only a stop to all'
        assert bench.write('E0029', 3, address) == answers[0]
        assert bench.read('E00E9') == SIO_FAIL
        assert bench.write('E0029', 1, address) == answers[1]
        assert (bench.read('E00E9'), bench.flags) == (24, 0)
    bench.drive.trip(SIO_FAIL, cause_present=True)
    for inv_st in (SIO_FAIL, 24):
        bench.read('E00AC')
        assert bench.read('E00E9') == inv_st
        bench.drive.faults.end_causes()


@both
def test_silence_is_a_serial_fault(dialect):
    bench = ClassicBench(dialect, settings={'serial.sio_tot': 1.0, 'serial.auto_stop': True})
    bench.run()
    bench.drive.advance(1.1)
    assert bench.read('E00E9') == SIO_FAIL
    assert (bench.read('E00AC'), bench.read('E00E9')) == (TIMEOUT, 24)
    for frame, flags in [(select('E0029', 1), 0), (DAMAGED, TIMEOUT)]:
        bench.read('E00AC')
        bench.drive.advance(0.9)
        bench.say(frame)
        bench.drive.faults.take_sio_err()
        bench.drive.advance(0.2)
        assert bench.flags == flags, 'a damaged message does not count as heard'


# ---- older firmware ----


def test_older_firmware_does_not_know_it():
    ids = 'E0075', 'E0076', 'E007A', 'E00DC', 'E00FA', 'E00FC', 'E00F9', 'E007C', 'E007D', 'E00E1'
    for id_ in ids:
        new, old = benches()
        new.read(id_)
        assert (old.say(enquiry(id_)), old.flags) == (NAK, UNKNOWN), id_
        old = ClassicBench('5.0')
        old.run()
        assert old.say(select(id_, 1)) == NAK
        assert not old.running, 'a serial fault too'
        assert (old.read('E00E9'), old.read('E00AC')) == (SIO_FAIL, UNKNOWN)
    bench = ClassicBench(settings={'fieldbus.sw_ver': 4.3})
    assert bench.read('E0075') == 430
    assert (bench.say(enquiry('E00F9')), bench.flags) == (NAK, UNKNOWN), 'it came later'


def test_line_settings_of_older_firmware():
    new, old = tolerant_benches()
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
    old = ClassicBench('5.0')
    assert old.write('E0029', 3) == old.write('E00A9', 9) == ACK, 'the old address answers'
    assert old.read('E0029', 9) == 3
