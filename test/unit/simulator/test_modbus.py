# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus of the simulated G2: requests and answers, registers, identification, frames."""

import itertools

from hypothesis import given, settings, strategies as st
import pytest
from support.examples import examples

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.drive import describe
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Receiver
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii, ModbusRtu, ModbusTcp
from nfo_sinus_driver.simulator.protocol import Request

ON_MODBUS = [one for one in load_family('sinus_g2').values() if 'modbus' in one.addresses]
RTU, ASCII, TCP = ModbusRtu(), ModbusAscii(), ModbusTcp(0.25)

# ---- requests ----

#: What is asked of a drive that has just been switched on, and the answer.
ANSWERS = {
    # read MODE
    '03 0294 0001': '03 02 0001',
    # Accel, low word first: 5000 ms
    '03 027E 0002': '03 04 1388 0000',
    # write MODE = Bus, one register
    '06 0294 0003': '06 0294 0003',
    # write Accel = 70 s: 00011170h
    '10 027E 0002 04 1170 0001': '10 027E 0002',
    # 01: functions that it does not have
    '04 0294 0001': '84 01',
    '83': '83 01',
    '': '80 01',
    # 02: nothing there, a part, too much, not that way
    '03 0000 0001': '83 02',
    '03 027E 0001': '83 02',
    '03 027F 0001': '83 02',
    '03 0294 0002': '83 02',
    '03 02A4 0002': '83 02',
    '03 0298 0001': '83 02',
    '06 027E 0001': '86 02',
    '06 02A5 0001': '86 02',
    '10 027E 0001 02 1388': '90 02',
    # 03: counts and lengths that the standard forbids, and values the drive does not take
    '03 0294 0000': '83 03',
    '03 0294 007E': '83 03',
    '03 0294': '83 03',
    '06 0294': '86 03',
    '10 0294 0001 02': '90 03',
    '10 0294 0000 00': '90 03',
    '10 0294 0001 04 0003 0003': '90 03',
    '10 0294 0002 02 0003': '90 03',
    '10 0294 0001 02 0003 FF': '90 03',
    '06 0294 0003 FF': '86 03',
    '06 0294 0000': '86 03',
    '06 0298 0102': '86 03',
    '10 027E 0002 04 0000 0000': '90 03',
    # 04: not now
    '06 0298 0101': '86 04',
    # write and read in one: what is read is what was written just before
    '17 0294 0001 0294 0001 02 0003': '17 02 0003',
    '17 027E 0002 027E 0002 04 1170 0001': '17 04 1170 0001',
    '17 0294 0001 027E 0002 04 1170 0001': '17 02 0001',
    '17 0000 0001 0294 0001 02 0003': '97 02',
    '17 0298 0001 0294 0001 02 0003': '97 02',
    '17 027E 0001 0294 0001 02 0003': '97 02',
    '17 0294 0001 0000 0001 02 0003': '97 02',
    '17 0294 0001 02A5 0001 02 0003': '97 02',
    '17 0294 0000 0294 0001 02 0003': '97 03',
    '17 0294 007E 0294 0001 02 0003': '97 03',
    '17 0294 0001 0294 0000 00': '97 03',
    '17 0294 0001 0294 0001 04 0003 0003': '97 03',
    '17 0294 0001 0294 0001 02 0003 00': '97 03',
    '17 0294 0001 0294 0001 02': '97 03',
    '17 0294 0001': '97 03',
    '17': '97 03',
    '17 0294 0001 0294 0001 02 0000': '97 03',
    '17 0294 0001 0298 0001 02 0101': '97 04',
    # identification: no such object, no such code, another MEI type, wrong lengths
    '2B 0E 04 07': 'AB 02',
    '2B 0E 03 00': 'AB 03',
    '2B 0E 00 00': 'AB 03',
    '2B 0D 01 00': 'AB 01',
    '2B': 'AB 01',
    '2B 0E 01': 'AB 03',
    '2B 0E 01 00 00': 'AB 03',
    '11 00': '91 03',
}


def ask(drive, request):
    return server(drive).answer(bytes.fromhex(request))


def test_every_request_is_answered_as_the_standard_says():
    found = {request: ask(simulated_drive(), request).hex(' ') for request in ANSWERS}
    assert found == {one: bytes.fromhex(other).hex(' ') for one, other in ANSWERS.items()}


def test_nothing_is_written_when_there_is_nothing_to_read():
    drive = simulated_drive()
    assert ask(drive, '17 0000 0001 027E 0002 04 1170 0001') == bytes.fromhex('97 02')
    assert not drive.writes


@given(st.binary(max_size=40))
@settings(max_examples=examples(200))
def test_any_pdu_is_answered(pdu):
    answer = server(simulated_drive()).answer(pdu)
    assert 2 <= len(answer) <= 253
    assert answer[0] & 0x7F == (pdu[0] & 0x7F if pdu else 0)


@given(
    st.sampled_from([3, 6, 16]),
    st.integers(0x200, 0x430),
    st.integers(0, 3),
    st.lists(st.integers(0, 0xFFFF), max_size=3),
)
@settings(max_examples=examples(200))
def test_requests_that_are_nearly_right_are_answered(function, register, count, words):
    data = bytes([function]) + register.to_bytes(2, 'big')
    if function == 6:
        data += (words or [0])[0].to_bytes(2, 'big')
    else:
        data += count.to_bytes(2, 'big')
    if function == 16:
        data += bytes([2 * len(words)]) + b''.join(word.to_bytes(2, 'big') for word in words)
    answer = server(simulated_drive()).answer(data)
    assert answer[0] == function or (answer[0] == function | 0x80 and 1 <= answer[1] <= 4)


# ---- registers ----


def test_it_comes_as_from_the_factory(bench):
    expected = {
        'fieldbus.sw_ver': 4.38, 'fieldbus.nfo_ver': 4018, 'fieldbus.mode': 1,
        'fieldbus.inv_st': 24, 'motor.p_nom': 1.5, 'motor.n_nom': 1440,
        'control.mode': 'Freque', 'control.accel': 5.0, 'control.retard': 5.0,
        'control.auto_start': False, 'control.st_mode': 'Brake', 'serial.bus_type': 'MbusRtu',
        'serial.address': 1, 'serial.si_baud': '19200bps', 'serial.sio_tot': 0.0,
        'serial.auto_stop': False, 'fieldbus.spd_scl_numerator': 1,
        'fieldbus.spd_scl_denominator': 1,
    }
    assert {key: bench.read(key) for key in expected} == expected
    assert not bench.running
    for parameter in ON_MODBUS:
        if parameter.access is Access.READ_WRITE:
            # one that it would take
            bench.drive.memory.check(parameter, bench.drive.memory.raw(parameter.key))


def outcome(what, *arguments):
    """Return the words that are read or written, or why not."""
    try:
        return what(*arguments)
    except Refused as refused:
        return refused.reason


def test_every_register_of_the_catalog_answers_whole_and_as_its_access_says(bench):
    modbus, wrong = server(bench.drive), []
    for parameter in ON_MODBUS:
        place = parameter.at('modbus')
        count = place.codec.size // 2
        words = outcome(modbus.read, place.index, count)
        if (words is Reason.ADDRESS) is not (parameter.access is Access.WRITE):
            wrong.append((parameter.key, 'read', words))
        elif parameter.access is Access.READ:
            if outcome(modbus.write, place.index, words) is not Reason.ADDRESS:
                wrong.append((parameter.key, 'written'))
        elif not parameter.key.startswith('fieldbus.') and len(words) == count:
            modbus.write(place.index, words)
            if modbus.read(place.index, count) != words:
                wrong.append((parameter.key, 'read back'))
        for register, part in (
            (place.index, count + 1), (place.index, count - 1), (place.index + 1, count - 1)
        ):
            # the other InvSt begins there
            if (register, part) == (0x2A5, 1):
                continue
            if outcome(modbus.read, register, part) is not Reason.ADDRESS:
                wrong.append((parameter.key, 'a part is read'))
            if outcome(modbus.write, register, [0] * part) is not Reason.ADDRESS:
                wrong.append((parameter.key, 'a part is written'))
    assert not wrong


def test_a_value_that_the_manual_forbids_is_refused(bench):
    before = describe(bench.drive)['parameters']
    for register, words in (
        (0x3FC, [1501]),  # 150.1 Hz
        (0x3FC, [0x10000 - 1501]),
        (0x25C, [9001]),
        (0x408, [201]),
        (0x27E, [199, 0]),  # 0.199 s
        (0x27E, [0xFFFF, 0xFFFF]),
        (0x29C, [4]),
        (0x3D4, [17]),
        (0x3D0, [248]),
        (0x3DC, [251]),
    ):
        assert outcome(server(bench.drive).write, register, words) is Reason.VALUE, hex(register)
    assert describe(bench.drive)['parameters'] == before


def test_writes_are_counted_and_settings_apart_from_commands(bench):
    bench.write('control.accel', 7.0)
    bench.write('control.accel', 7.0)
    bench.run(10)
    with bench.refuses(Reason.VALUE):
        server(bench.drive).write(0x27E, [0, 0])
    assert bench.drive.writes == {'control.accel': 2}
    commands = {'fieldbus.mode': 1, 'fieldbus.scmd': 1, 'status.frq_set': 1}
    assert bench.drive.command_writes == commands


def test_init_parameters_change_only_while_the_motor_stands(bench):
    values = {one.key: bench.read(one.key) for one in ON_MODBUS if one.stopped}
    assert len(values) > 10

    def refused():
        return {key for key, value in values.items() if outcome(bench.write, key, value)}

    assert not refused()
    bench.run(20, 1.0)
    assert refused() == values.keys()
    bench.mode(1)
    bench.drive.advance(0.5)
    assert not bench.running
    assert refused() == values.keys(), 'it still coasts'
    bench.drive.advance(10)
    assert not refused()


def test_another_nameplate_is_another_motor(bench):
    bench.write('motor.n_nom', 2880)
    bench.run(25, 6)
    assert bench.drive.motor.rotor_speed == pytest.approx(1475, abs=15)


def test_counters_advance(bench):
    before = describe(bench.drive)['parameters']
    bench.run(50, 720)
    after = describe(bench.drive)['parameters']
    for key in ('status.op_time', 'status.rn_time'):
        assert after[key] - before[key] == pytest.approx(0.2, abs=0.11)
    assert 0.02 < after['status.e_out'] - before['status.e_out'] < 0.4
    bench.mode(1)
    bench.drive.advance(720)
    assert bench.read('status.rn_time') == pytest.approx(after['status.rn_time'], abs=0.11)


def test_catching_up_with_a_clock(bench):
    for now, passed in ((1000.0, 0), (1002.5, 2.5), (1001.0, 2.5)):
        bench.drive.advance_to(now)
        assert bench.drive.time == pytest.approx(passed)


def test_the_setpoint_of_classic_goes_where_the_mode_says(bench):
    bench.drive.write_raw('fieldbus.setpoint', -123)
    assert bench.read('status.frq_set') == -12.3
    bench.write('control.mode', 'Speed')
    bench.drive.write_raw('fieldbus.setpoint', 500)
    assert bench.read('status.spd_set') == bench.drive.read_raw('fieldbus.setpoint') == 500


# ---- identification ----

#: What M0 §6.2.4 prints, the revision in its 17 characters.
OBJECTS = (
    b'NFO Drives AB', b'', b' 4.38 / 4018     ', b'http://www.nfo.se', b'NFO Sinus',
    b'1.50/400', b'',
)


def test_device_identification():
    for request, head, numbers in (
        ('2B 0E 01 00', '2B 0E 01 82 00 00 03', range(3)),
        ('2B 0E 01 02', '2B 0E 01 82 00 00 01', (2,)),
        ('2B 0E 02 00', '2B 0E 02 82 00 00 07', range(7)),
        ('2B 0E 02 05', '2B 0E 02 82 00 00 02', (5, 6)),
        # from an object that is not there it begins anew, as the standard says
        ('2B 0E 01 03', '2B 0E 01 82 00 00 03', range(3)),
        ('2B 0E 02 80', '2B 0E 02 82 00 00 07', range(7)),
        *((f'2B 0E 04 {n:02X}', '2B 0E 04 82 00 00 01', (n,)) for n in range(7)),
    ):
        objects = b''.join(bytes((n, len(OBJECTS[n]))) + OBJECTS[n] for n in numbers)
        answer = ask(simulated_drive(), request)
        assert answer == bytes.fromhex(head) + objects, request
        assert len(RTU.wrap(1, answer)) <= 256


def test_objects_are_those_of_the_drive():
    for power, voltage, model in (
        (1.5, 400, b'1.50/400'), (3, 230, b'3.00/230'), (11, 400, b'11.0/400'),
        (100, 400, b'100/400 '),
    ):
        drive = simulated_drive(
            settings={'motor.p_nom': power, 'motor.u_nom': voltage, 'fieldbus.sw_ver': 4.3}
        )
        objects = server(drive).device_objects()
        assert (objects[5], objects[2]) == (model, b' 4.30 / 4018     ')


def test_serial_number_is_all_that_is_reported():
    # 16 characters and no run indicator [C94]
    drive = simulated_drive(serial_number='0123456789ABCDEF')
    assert ask(drive, '11') == b'\x11\x100123456789ABCDEF'
    assert ask(simulated_drive(serial_number='7'), '11') == b'\x11\x107' + b' ' * 15
    numbers = {ask(simulated_drive(address=address), '11')[2:] for address in range(1, 40)}
    assert (len(numbers), {len(number) for number in numbers}) == (39, {16})
    for number in ('0123456789ABCDEFG', 'Ä', 'a\nb'):
        with pytest.raises(ValueError, match='serial number'):
            simulated_drive(serial_number=number)


def test_functions_that_older_drives_do_not_have():
    for request in ('11', '2B 0E 02 00', '17 0294 0001 0294 0001 02 0003'):
        refusal = bytes((int(request[:2], 16) | 0x80, 1))
        for treatment, answer in (('refused', refusal), ('silent', b'')):
            drive = simulated_drive(newer_functions=treatment)
            assert ask(drive, request) == answer
            assert ask(drive, '03 0294 0001') == bytes.fromhex('03 02 0001')
            assert not drive.command_writes


# ---- frames ----

READ = bytes.fromhex('0302940001')
STOP = bytes.fromhex('03020001')
READ_ASCII = b':01030294000165\r\n'
READ_TCP = bytes.fromhex('1234 0000 0006 01 03 0294 0001')
FRAMES = {RTU: RTU.wrap(1, READ), ASCII: READ_ASCII, TCP: READ_TCP}


def test_frames_of_the_standards_examples():
    assert pymodbus_compat.crc(bytes.fromhex('0207')) == bytes.fromhex('4112')
    assert pymodbus_compat.crc(bytes.fromhex('010302940001')) == bytes.fromhex('C45E')
    assert ASCII.wrap(2, b'\x07') == b':0207F7\r\n', 'the LRC of 02 07 is F7'
    answers = {
        RTU: RTU.wrap(1, STOP),
        ASCII: b':0103020001F9\r\n',
        TCP: bytes.fromhex('1234 0000 0005 01 03 02 0001'),
    }
    for protocol, frame in FRAMES.items():
        request = protocol.unwrap(frame)
        assert request.address == 1
        assert protocol.answer(simulated_drive(), request) == answers[protocol]


def test_what_is_no_frame():
    for frame in (
        b'', b':\r\n', b':0165\r\n', READ_ASCII.replace(b'65', b'66'),
        READ_ASCII.replace(b'94', b'95'), READ_ASCII.replace(b'0294', b'029g'),
        READ_ASCII.replace(b'01030294000165', b'0103029400016'),
        b':0103029A00015F\r\n'.lower(), READ_ASCII[:-1], READ_ASCII[1:],
    ):
        assert ASCII.unwrap(frame) is None, frame
    for frame in (
        '', '1234 0000 0006 01', '1234 0001 0006 01 03 0294 0001', '1234 0000 0007 01 03 0294 0001'
    ):
        assert TCP.unwrap(bytes.fromhex(frame)) is None, frame


@pytest.mark.parametrize('protocol', [RTU, ASCII])
@given(st.integers(0, 255), st.binary(min_size=1, max_size=30), st.data())
def test_a_flipped_bit_is_noticed(protocol, address, pdu, data):
    frame = bytearray(protocol.wrap(address, pdu))
    assert protocol.unwrap(bytes(frame)) == Request(address, pdu)
    bits = st.integers(0, 6 if protocol is ASCII else 7)
    frame[data.draw(st.integers(0, len(frame) - 1))] ^= 1 << data.draw(bits)
    assert protocol.unwrap(bytes(frame)) is None


def test_only_writes_are_obeyed_by_every_drive_and_not_answered():
    for protocol in (RTU, TCP):
        drive = simulated_drive(address=7)
        write = Request(0, bytes.fromhex('0602940003'))
        if protocol is TCP:
            write = TCP.unwrap(bytes.fromhex('0001 0000 0006 00 06 0294 0003'))
            read = TCP.unwrap(bytes.fromhex('0001 0000 0006 00 03 0294 0001'))
            assert TCP.instead(read, False) is None
        else:
            read = Request(0, READ)
            assert not RTU.concerns(drive, Request(1, b'\x06'))
            assert RTU.answer(drive, Request(7, bytes.fromhex('0602940002')))
        assert protocol.concerns(drive, write) and not protocol.concerns(drive, read)
        assert protocol.answer(drive, write) == b''
        assert drive.control_unit.mode == 3


def test_what_the_gateway_says():
    request = TCP.unwrap(READ_TCP)
    silent, absent = TCP.instead(request, True), TCP.instead(request, False)
    assert (silent.data, silent.delay) == (bytes.fromhex('1234 0000 0003 01 83 0B'), 0.25)
    assert (absent.data, absent.delay) == (bytes.fromhex('1234 0000 0003 01 83 0A'), 0.0)


# ---- cutting bytes into frames ----

CHARACTER = 11 / 19200
T35 = 3.5 * CHARACTER
WRITE = RTU.wrap(1, bytes.fromhex('10027E00020413880000'))


def receiver(protocol=RTU, character=0.0):
    return Receiver(protocol, character, T35 + 0.002 if protocol is RTU else 1.0)


def arrived(protocol, *chunks, pause=0.001):
    receive = receiver(protocol)
    out = []
    for number, chunk in enumerate(chunks):
        out += receive.feed(chunk, pause * number)
    out += receive.take(1000)
    return [one.data for one in out]


def test_cutting():
    rubbish = b'GET / HTTP/1.1\r\n'
    for protocol, pause, chunks, frames in (
        (RTU, 0.0001, [bytes([byte]) for byte in WRITE], [WRITE]),
        (ASCII, 0.9, [bytes([byte]) for byte in READ_ASCII], [READ_ASCII]),
        (TCP, 0.001, [bytes([byte]) for byte in READ_TCP], [READ_TCP]),
        *((one, 0.001, [frame + frame], [frame, frame]) for one, frame in FRAMES.items()),
        (ASCII, 0.001, [b'xx\r\n' + READ_ASCII], [b'xx\r\n', READ_ASCII]),
        (ASCII, 0.001, [b':0103' + READ_ASCII], [b':0103', READ_ASCII]),
        (ASCII, 1.1, [READ_ASCII[:6], READ_ASCII], [READ_ASCII[:6], READ_ASCII]),
        (ASCII, 1.1, [READ_ASCII[:6], READ_ASCII[6:]], [READ_ASCII[:6], READ_ASCII[6:]]),
        (ASCII, 0.001, [bytes(5)], [bytes(5)]),
        (TCP, 0.001, [rubbish, READ_TCP], [rubbish, READ_TCP]),
        (TCP, 0.001, [READ_TCP[:5] + b'\xff\x01'], [READ_TCP[:5] + b'\xff\x01']),
        (RTU, 0.001, [RTU.wrap(1, b'\x41abc')], [RTU.wrap(1, b'\x41abc')]),
    ):
        assert arrived(protocol, *chunks, pause=pause) == frames, chunks


def test_a_paced_frame_is_there_when_the_line_has_carried_it():
    receive = receiver(character=CHARACTER)
    frame = FRAMES[RTU]
    assert not list(receive.feed(frame + WRITE, 10.0))
    assert receive.due == pytest.approx(10 + 8 * CHARACTER)
    assert not list(receive.take(10 + 7.9 * CHARACTER))
    (first,) = receive.take(10 + 8 * CHARACTER)
    assert (first.data, first.first) == (frame, 10.0)
    assert first.last == pytest.approx(10 + 8 * CHARACTER)
    assert receive.due == pytest.approx(10 + (8 + len(WRITE)) * CHARACTER)
    (second,) = receive.take(11.0)
    assert (second.data, second.first) == (WRITE, pytest.approx(10 + 8 * CHARACTER))


def test_after_rubbish_silence_makes_a_fresh_start():
    frame = FRAMES[RTU]
    for rubbish in (
        b'\x00', b'\xff' * 7, frame[:5], frame[:-1] + b'\x00', bytes(300), b'\x01\x99abcdef'
    ):
        for character in (0.0, CHARACTER):
            receive = receiver(character=character)
            assert not list(receive.feed(rubbish, 0.0))
            later = len(rubbish) * character + T35 + 0.003
            assert receive.due <= later
            found = [*receive.feed(frame, later), *receive.take(later + 1)]
            assert [one.data for one in found] == [rubbish, frame]
            assert receive.due is None
    receive = receiver()
    out = sum(len(one.data) for n in range(100) for one in receive.feed(b'\xaa' * 100, n * 1e-4))
    assert out > 9000, 'endless rubbish is not collected'


@pytest.mark.parametrize(
    ('protocol', 'character'), [(RTU, 0.0), (RTU, CHARACTER), (ASCII, 0.0), (TCP, 0.0)]
)
@given(st.lists(st.tuples(st.binary(max_size=60), st.floats(0, 0.02)), max_size=20))
def test_no_byte_is_lost_or_made_up_and_a_frame_after_silence_is_found(
    protocol, character, chunks
):
    receive = receiver(protocol, character)
    now, found = 0.0, []
    for data, pause in chunks:
        found += receive.feed(data, now)
        now += pause
    found += receive.take(now + 100)
    assert b''.join(one.data for one in found) == b''.join(data for data, _ in chunks)
    for one in found:
        protocol.unwrap(one.data)
        assert one.first <= one.last
    for one, following in itertools.pairwise(found):
        assert one.last <= following.last
    out = [*receive.feed(FRAMES[protocol], now + 200), *receive.take(now + 300)]
    assert [one.data for one in out] == [FRAMES[protocol]]
