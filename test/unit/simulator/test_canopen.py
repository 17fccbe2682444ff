# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Simulated drives on a CAN bus: services, faults of the bus, and what the manual leaves open."""

from can_bus_bench import Bus
import pytest

from nfo_sinus_driver.simulator.can_frames import Frame, bits

READ_VENDOR, READ_DATA = '4018100100000000', bytes.fromhex('4018100100000000')
VENDOR = '431810011b000000'
MODE, SCMD, INV_ST, ACCEL, FRQ_SET = 0x2022, 0x2023, 0x2026, 0x201C, 0x207C
PRODUCER, CONSUMER, GUARD_TIME, LIFE_FACTOR = 0x1017, 0x1016, 0x100C, 0x100D
RUN = b'\x01\x01'
EXT_FAIL, BUS_FAIL, SIO_FAIL = 5, 15, 14
WATCHED = {'serial.auto_stop': True}


def heartbeat(node, state):
    return Frame(0x700 + node, bytes((state,)))


def consumer(node, ms):
    return (node << 16 | ms).to_bytes(4, 'little')


def guard(bus, node=1):
    return bus.send(0x700 + node, bytes(1), remote=True)


def running(node=1, **options):
    """Return a bus with a drive that runs at 10 Hz."""
    bus = Bus(**options)
    run(bus, node)
    return bus


def run(bus, node=1):
    assert bus.write(FRQ_SET, 0, b'\x64\x00', node) == bus.write(SCMD, 0, RUN, node) == ''
    bus.wait(0.5)
    assert bus.drives[node].motor.driven


# ---- network management ----


def test_each_node_answers_for_itself_and_to_no_other_frame():
    bus = Bus((1, 2, 127))
    for node in (1, 2, 127):
        answer = Frame(0x580 + node, bytes.fromhex(VENDOR))
        assert bus.send(0x600 + node, READ_DATA) == [answer]
    for identifier, remote in (
        (0x603, False), (0x601, True), (0x581, False), (0x201, False), (0x080, False)
    ):
        assert bus.send(identifier, READ_DATA, remote=remote) == []
    assert bus.say(b'T000006018' + READ_VENDOR.encode() + b'\r') == b'Z\r', 'an extended one'


def test_boot_up_is_sent_once_the_drive_is_up_under_its_new_number():
    bus = Bus((1, 2))
    assert bus.write(0x2071, 0, b'\x07\x00') == ''
    assert bus.sdo(READ_VENDOR) == VENDOR, 'it counts from power-on'
    bus.drives[1].power_cycle()
    assert bus.wait(1.9) == []
    assert bus.send(0x601, READ_DATA) == []
    assert bus.wait(0.2) == [heartbeat(7, 0)]
    assert bus.sdo(READ_VENDOR) == '' and bus.sdo(READ_VENDOR, 7) == VENDOR
    bus.drives[2].memory.set('serial.bus_type', 'MbusRtu')
    bus.drives[2].power_cycle(0.1)
    assert bus.wait(1.0) == []
    assert bus.sdo(READ_VENDOR, 2) == '', 'on another bus type it is no node'


def test_what_a_node_does_in_its_states():
    bus = Bus((1, 2))
    states = {}
    for command in (0x01, 0x02, 0x80):
        bus.send(0x000, bytes((command, 1)))
        states[command] = (bus.sdo(READ_VENDOR), guard(bus)[0].data)
    # guarding toggles its bit
    assert states == {0x01: (VENDOR, b'\x05'), 0x02: ('', b'\x84'), 0x80: (VENDOR, b'\x7f')}
    for data in (b'', b'\x01', b'\x01\x01\x00', b'\x01\x03', b'\x55\x01'):
        bus.send(0x000, data)
        assert guard(bus)[0].data[0] & 0x7F == 0x7F, 'no command'
    bus.send(0x000, b'\x02\x00')
    assert bus.sdo(READ_VENDOR) == bus.sdo(READ_VENDOR, 2) == ''


def test_a_node_sends_its_heartbeat_until_it_is_reset_or_it_is_ended():
    bus = Bus()
    for reset in (b'\x81\x01', b'\x82\x01', b''):
        assert bus.write(PRODUCER, 0, b'\x64\x00') == ''
        began = bus.now
        assert bus.wait(1.05) == 10 * [heartbeat(1, 0x7F)]
        times = [began + 0.1 * beat for beat in range(1, 11)]
        assert [at for at, _ in bus.frames[-10:]] == pytest.approx(times)
        if reset:
            assert bus.send(0x000, reset) == [heartbeat(1, 0)]
            assert bus.read(PRODUCER) == b'\x00\x00'
        else:
            bus.send(0x000, b'\x01\x01')
            assert bus.wait(0.1) == [heartbeat(1, 0x05)]
            assert guard(bus) == [], 'it is guarded no more'
            assert bus.write(PRODUCER, 0, bytes(2)) == ''
        assert bus.wait(1.0) == []


def test_the_first_heartbeat_of_a_master_begins_the_watch():
    bus = running(settings=WATCHED)
    assert bus.write(CONSUMER, 1, consumer(127, 300)) == ''
    assert bus.read(CONSUMER, 1) == consumer(127, 300)
    bus.wait(1.0)
    assert bus.drive.faults.shown == 0
    for _ in range(5):
        bus.send(0x77F, b'\x05')
        bus.wait(0.25)
    # neither boot-up nor another node counts, nor what is no heartbeat
    for data in ((0x77F, b'\x00'), (0x77E, b'\x05'), (0x77F, b'\x05\x05')):
        bus.send(*data)
    assert bus.drive.faults.shown == 0
    (emergency,) = bus.wait(0.1)
    assert emergency.identifier == 0x081 and emergency.data[:3] == bytes.fromhex('308111')
    assert bus.drive.faults.shown == BUS_FAIL and not bus.drive.motor.driven
    assert bus.send(0x77F, b'\x05') == [Frame(0x081, bytes.fromhex('0000010000000000'))]
    assert bus.send(0x77F, b'\x05') == []
    for value in ('2c018000', '2c017f01'):
        assert bus.write(CONSUMER, 1, bytes.fromhex(value)) == '06090030', 'there is no such node'


def test_without_auto_stop_or_with_a_watch_that_is_ended_it_runs_on():
    # [M0 §5.3.5], [C91]
    for ended in (False, True):
        bus = running(settings={'serial.auto_stop': ended})
        bus.write(CONSUMER, 1, consumer(127, 300))
        bus.send(0x77F, b'\x05')
        if ended:
            bus.write(CONSUMER, 1, bytes(4))
        emergencies = bus.wait(2.0)
        assert bool(emergencies) is not ended
        assert bus.drive.faults.shown == 0 and bus.drive.motor.driven
        if not ended:
            assert bus.send(0x77F, b'\x05')[0].data[:2] == bytes(2), 'the emergency has ended'


def test_guarding_begins_with_the_first_request_and_takes_a_node_out_of_operation():
    for settings, fault in ((WATCHED, BUS_FAIL), ({}, 0)):
        bus = running(settings=settings)
        bus.write(GUARD_TIME, 0, (100).to_bytes(2, 'little'))
        bus.write(LIFE_FACTOR, 0, b'\x03')
        bus.send(0x000, b'\x01\x01')
        bus.wait(1.0)
        heard = []
        for _ in range(4):
            heard += guard(bus)
            bus.wait(0.25)
        assert heard == 2 * [heartbeat(1, 0x05), heartbeat(1, 0x85)]
        assert bus.drive.faults.shown == 0
        assert [frame.data[:2] for frame in bus.wait(0.1)] == [b'\x30\x81']
        assert bus.drive.faults.shown == fault
        # the end of the emergency has precedence
        assert guard(bus)[1] == heartbeat(1, 0x7F)


# ---- bus mode ----


def test_bus_mode_begins_with_the_first_request_and_stays():
    # [M0 §6.4]
    bus = Bus()
    bus.drive.control_unit.press('ext')
    bus.wait(1.0)
    assert bus.drive.motor.driven and bus.drive.control_unit.mode == 2
    bus.sdo(READ_VENDOR)
    bus.wait(10.0)
    assert not bus.drive.motor.driven
    for key in ('stop', 'ext', 'start', ''):
        run(bus)
        if key:
            bus.drive.control_unit.press(key)
        else:
            assert bus.write(MODE, 0, b'\x01\x00') == ''
        assert bus.read(MODE) == b'\x03\x00'
        bus.wait(10.0)
        assert not bus.drive.motor.driven and not bus.drive.motor.turning
    bus.drive.power_cycle()
    bus.wait(3.0)
    assert bus.drive.control_unit.mode == 1, 'power-off ends it'
    bus = Bus(canopen_bus_mode='free')
    bus.sdo(READ_VENDOR)
    for code in (b'\x01\x00', b'\x03\x00', b'\x01\x00'):
        bus.write(MODE, 0, code)
        assert bus.read(MODE) == code


def test_sio_tot_counts_here_too():
    bus = running(settings={'serial.auto_stop': True, 'serial.sio_tot': 1.0})
    for _ in range(10):
        bus.sdo(READ_VENDOR)
        bus.wait(0.9)
    assert bus.drive.faults.shown == 0
    bus.sdo(READ_VENDOR)
    bus.wait(1.1)
    assert bus.drive.faults.shown == SIO_FAIL and bus.drive.control_unit.mode == 1
    # it is held in bus mode again once the fault is acknowledged [M0 §6.1.5]
    assert bus.write(MODE, 0, b'\x01\x00') == ''
    assert bus.drive.faults.shown == 0 and bus.read(MODE) == b'\x03\x00'
    assert not bus.drive.motor.driven


# ---- the adapter and the bus ----


def test_an_adapter_that_is_closed_or_at_another_bit_rate_hears_nothing():
    line = b't6018' + READ_VENDOR.encode() + b'\r'
    bus = Bus(is_open=False)
    bus.drive.power_cycle(0.1)
    bus.wait(1.0)
    assert (bus.frames, bus.say(line)) == ([], b'\a')
    for digit in (0, 1, 2, 3, 5, 6, 7, 8):
        bus = Bus(is_open=False)
        bus.say(b'S%d\rO\r' % digit)
        assert [bus.say(line) for _ in range(10)] == 8 * [b'z\r'] + 2 * [b'\a'], digit
        assert bus.say(b'F\r') != b'F00\r'
        assert bus.drive.control_unit.mode == 1, 'it was not heard'
    for rate, digit in ((10_000, 0), (250_000, 5), (1_000_000, 8)):
        bus = Bus(is_open=False, rate=rate)
        bus.say(b'S%d\rO\r' % digit)
        assert bus.sdo(READ_VENDOR) == VENDOR
    bus.line.hang_up(bus.now + 1.0)
    bus.wait(1.1)
    assert bus.say(line) == b'\a', 'an adapter that was pulled out comes back closed'
    bus.say(b'S8\rO\r')
    assert bus.sdo(READ_VENDOR) == VENDOR


def test_a_frame_takes_its_bits_its_turnaround_and_where_it_is_damaged_another():
    request, answer = Frame(0x601, READ_DATA), Frame(0x581, bytes.fromhex(VENDOR))
    for paced, turnaround, damage, taken in (
        (True, 0.003, False, (bits(request) + bits(answer)) / 125_000 + 0.003),
        (True, 0.0, True, (bits(request) + 2 * bits(answer) + 23) / 125_000),
        (False, 0.05, False, 0.05),
        (False, 0.003, False, 0.003),
    ):
        bus = Bus(paced=paced, turnaround=turnaround)
        if damage:
            bus.line.faults.add('damage')
        began = bus.now
        assert bus.send(*request[:2]) == []
        assert bus.wait(0.1) == [answer]
        assert bus.frames[-1][0] - began == pytest.approx(taken)


def test_paced_the_least_identifier_goes_first_and_the_adapter_in_order():
    bus = Bus((1, 2, 3), paced=True, turnaround=0.01)
    for node in (3, 2, 1):
        bus.say(b't60%d8' % node + READ_VENDOR.encode() + b'\r')
    # each has 10 ms, in which the others are asked
    assert [frame.identifier for frame in bus.wait(0.1)] == [0x583, 0x582, 0x581]
    bus = Bus((1, 2, 3), paced=True)
    bus.say(b'r7033\rr7023\rr7013\r')
    # each request goes before the answers to those before it, and of these the least
    assert [frame.identifier for frame in bus.wait(0.1)] == [0x701, 0x702, 0x703]


def test_answers_that_are_lost_late_double_damaged_or_noisy():
    bus = Bus()
    faults = bus.line.faults
    faults.add('drop')
    assert bus.sdo(READ_VENDOR) == ''
    faults.add('double')
    assert len(bus.send(0x601, READ_DATA)) == 2
    faults.add('delay', seconds=0.5)
    assert bus.sdo(READ_VENDOR) == ''
    # what the same node answers later waits for it
    assert bus.sdo('4000100000000000') == ''
    assert [frame.data[1:4].hex() for frame in bus.wait(1.0)] == ['181001', '001000']
    faults.add('damage')
    assert bus.sdo(READ_VENDOR) == VENDOR, 'a damaged frame is sent again'
    for _ in range(20):
        faults.add('noise')
        said = bus.say(b't6018' + READ_VENDOR.encode() + b'\r')
        before, line, rest = said.partition(b't5818' + VENDOR.upper().encode() + b'\r')
        assert line and not rest and before.startswith(b'z\r') and 3 <= len(before) <= 7


def test_a_dead_line_and_a_silent_drive():
    bus = Bus((1, 2))
    bus.write(PRODUCER, 0, b'\x64\x00')
    bus.line.faults.dead_until = bus.now + 1.0
    assert bus.sdo(READ_VENDOR) == bus.sdo(READ_VENDOR, 2) == ''
    assert bus.wait(0.9) == []
    assert len(bus.wait(0.25)) in (1, 2)
    assert bus.sdo(READ_VENDOR) == VENDOR
    bus.drives[1].silence(1.0)
    assert bus.wait(0.9) == []
    assert bus.sdo(READ_VENDOR) == '' and bus.sdo(READ_VENDOR, 2) == VENDOR
    assert bus.wait(1.0)[0] == heartbeat(1, 0x7F), 'no boot-up: it was not off'


def test_frames_of_others_keep_the_bus_busy():
    bus = Bus()
    bus.line.set_traffic(1000, bus.now)
    heard = bus.wait(1.0)
    assert 990 <= len(heard) <= 1001
    assert {frame.identifier for frame in heard}.isdisjoint({0x081, 0x581, 0x701})
    assert bus.sdo(READ_VENDOR) == VENDOR
    bus.line.set_traffic(0, bus.now)
    bus.wait(0.1)
    assert bus.wait(1.0) == []
    with pytest.raises(ValueError, match='are not possible'):
        bus.line.set_traffic(1e6, bus.now)
    bus = Bus(paced=True)
    bus.line.set_traffic(500, bus.now)
    answers = []
    for _ in range(20):
        bus.frames.clear()
        began = bus.now
        bus.send(0x601, READ_DATA)
        bus.wait(0.05)
        answers += [at - began for at, frame in bus.frames if frame.identifier == 0x581]
    assert len(answers) == 20 and max(answers) > min(answers) + 0.0005


# ---- what the manual leaves open ----


def there(bus, index, sub_index=0):
    """Return whether an object can be read."""
    request = b'\x40' + index.to_bytes(2, 'little') + bytes((sub_index, 0, 0, 0, 0))
    return not bus.sdo(request.hex()).startswith('80')


ALWAYS = [(0x1000, 0), (0x1001, 0), (0x1017, 0), (0x1018, 0), (0x1018, 1)]
MORE = [(0x1008, 0), (0x1009, 0), (0x100A, 0), (0x1014, 0), (0x1018, 4), (0x1200, 0), (0x1200, 2)]
WATCHING = {'heartbeat': [(0x1016, 0), (0x1016, 1)], 'guarding': [(0x100C, 0), (0x100D, 0)]}


def test_what_there_is_of_the_communication_profile():
    for profile in ('full', 'minimal', 'bare'):
        for watch in ('by_shape', 'none', 'heartbeat', 'guarding', 'both'):
            bus = Bus(canopen_profile=profile, canopen_watch=watch)
            usual = 'both' if profile == 'full' else 'none'
            watches = {'by_shape': usual}.get(watch, watch)
            for objects, wanted in (
                (ALWAYS, profile != 'bare'),
                (MORE, profile == 'full'),
                (WATCHING['heartbeat'], watches in ('heartbeat', 'both')),
                (WATCHING['guarding'], watches in ('guarding', 'both')),
            ):
                found = [there(bus, *place) for place in objects]
                assert found == len(objects) * [wanted], (profile, watch)
            # the drive itself is there in any case, and sends its boot-up
            assert there(bus, INV_ST, 2)
            bus.drive.power_cycle(0.1)
            assert bus.wait(0.5)[0].data == b'\x00'


def test_identity_and_error_register():
    bus = Bus((3,), settings={'fieldbus.sw_ver': 4.38})
    serial = int(bus.drives[3].serial_number) & 0xFFFFFFFF
    for place, value, size in (
        ((0x1018, 0), 4, 1), ((0x1018, 3), 438, 4), ((0x1018, 4), serial, 4),
        ((0x1200, 1), 0x603, 4), ((0x1200, 2), 0x583, 4), ((0x1014, 0), 0x083, 4),
        ((0x1001, 0), 0, 1),
    ):
        assert bus.read(*place, 3) == value.to_bytes(size, 'little'), place
    bus.drive.trip(EXT_FAIL)
    assert bus.read(0x1001, 0, 3) == b'\x01'


def test_sizes_are_one_choice_and_no_other_size_is_taken():
    for types, mode in (('table', 2), ('narrow', 1), ('wide', 4)):
        bus = Bus(canopen_types=types)
        sizes = [len(bus.read(*place)) for place in ((0x2024, 0), (ACCEL, 2), (0x2005, 0))]
        assert sizes == [mode, 4, 4]
        for size in (1, 2, 4):
            code = bus.write(0x2024, 0, bytes((3,)).ljust(size, b'\0'))
            assert code == ('' if size == mode else '06070012' if size > mode else '06070013')
        assert bus.drive.peek('control.mode') == 'Speed'
        value = (-123).to_bytes(len(bus.read(FRQ_SET)), 'little', signed=True)
        assert bus.write(FRQ_SET, 0, value) == ''
        assert (bus.drive.peek('status.frq_set'), bus.read(FRQ_SET)) == (-12.3, value)
    assert bus.write(FRQ_SET, 0, (40_000).to_bytes(4, 'little')) == '06090030', 'it does not fit'


def test_arrays_begin_at_one_or_at_zero_and_one_element_acknowledges():
    bus = Bus()
    assert bus.read(INV_ST) == bus.read(ACCEL) == b'\x02'
    assert bus.sdo('4026200300000000') == '8026200311000906'
    assert bus.read(ACCEL, 2) == (5000).to_bytes(4, 'little')
    bus = Bus(canopen_sub_indices='from_zero')
    assert bus.sdo('4026200200000000') == '8026200211000906'
    assert bus.read(ACCEL, 1) == (5000).to_bytes(4, 'little')
    for options, other, acknowledges in (
        ({'canopen_sub_indices': 'from_zero'}, 1, 0),
        ({}, 2, 1),
    ):
        bus = Bus(**options)
        bus.drive.trip(EXT_FAIL)
        for sub_index, shown in ((other, EXT_FAIL), (acknowledges, 0)):
            assert bus.read(INV_ST, sub_index) == bytes((EXT_FAIL, 0))
            assert bus.drive.faults.shown == shown


def test_where_the_error_log_stands():
    for where in ('2F7C', '4F7D', 'none'):
        bus = Bus(canopen_error_log=where)
        bus.drive.trip(EXT_FAIL)
        for name in ('2F7C', '4F7D'):
            first = int(name, 16)
            assert there(bus, first) == there(bus, first + 31) == (where == name)
            assert not there(bus, first + 32)
            assert where != name or bus.read(first)[3] == EXT_FAIL


def test_what_younger_firmware_has_and_what_is_not_implemented_is_absent():
    for version, answer in ((4.38, '43'), (4.30, '80')):
        bus = Bus(settings={'fieldbus.sw_ver': version})
        assert bus.sdo('40e9200000000000')[:2] == answer
    for place in ((0x6045, 0), (0x6072, 0), (0x2FFF, 0)):
        assert not there(bus, *place)
