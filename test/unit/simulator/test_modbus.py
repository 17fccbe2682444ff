# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Modbus of the simulated G2: requests and answers, registers, identification."""


from hypothesis import given, settings, strategies as st
import pytest
from support.examples import examples

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.simulator.drive import describe
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii, ModbusRtu, ModbusTcp

ON_MODBUS = [row for row in load_family('sinus_g2').values() if 'modbus' in row.addresses]
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
    assert found == {request: bytes.fromhex(other).hex(' ') for request, other in ANSWERS.items()}


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


def test_init_parameters_change_only_while_the_motor_stands(bench):
    values = {row.key: bench.read(row.key) for row in ON_MODBUS if row.stopped}
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
