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
"""Simulated drives as nodes on a bus: network management, boot-up, heartbeats, guarding, faults."""

from __future__ import annotations

from can_bus_bench import Bus
import pytest

from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.can_frames import bits

READ_VENDOR = '4018100100000000'
VENDOR = '431810011b000000'
MODE, SCMD, SPEED_SET, INV_ST = 0x2022, 0x2023, 0x2014, 0x2026
FRQ_SET, AUTO_STOP, SIO_TOT = 0x207C, 0x2076, 0x2074
PRODUCER, CONSUMER, GUARD_TIME, LIFE_FACTOR = 0x1017, 0x1016, 0x100C, 0x100D
RUN = b'\x01\x01'
BUS_FAIL, SIO_FAIL = 15, 14


def heartbeat(node: int, state: int) -> Frame:
    return Frame(0x700 + node, bytes((state,)))


def consumer(node: int, ms: int) -> bytes:
    return (node << 16 | ms).to_bytes(4, 'little')


def running(bus: Bus, node: int = 1) -> None:
    """Let a drive run by the bus at 10 Hz."""
    assert bus.write(FRQ_SET, 0, b'\x64\x00', node) == ''
    assert bus.write(SCMD, 0, RUN, node) == ''
    bus.wait(0.5)
    assert bus.drives[node].motor.driven


# ---- whom it is for ----


def test_each_node_answers_for_itself() -> None:
    bus = Bus((1, 2, 127))
    for node in (1, 2, 127):
        assert bus.send(0x600 + node, bytes.fromhex(READ_VENDOR)) == [
            Frame(0x580 + node, bytes.fromhex(VENDOR))
        ]
    assert bus.send(0x603, bytes.fromhex(READ_VENDOR)) == []


@pytest.mark.parametrize(
    ('identifier', 'remote'), [(0x601, True), (0x581, False), (0x201, False), (0x080, False)]
)
def test_other_frames_are_for_nobody(identifier: int, remote: bool) -> None:
    assert Bus().send(identifier, bytes.fromhex(READ_VENDOR), remote=remote) == []


def test_an_extended_frame_is_for_nobody() -> None:
    bus = Bus()
    assert bus.say(b'T000006018' + READ_VENDOR.encode() + b'\r') == b'Z\r'


# ---- network management ----


def test_boot_up_is_told_once_the_drive_is_up() -> None:
    bus = Bus((1, 2))
    bus.drives[1].power_cycle()
    assert bus.wait(1.9) == []
    assert bus.send(0x601, bytes.fromhex(READ_VENDOR)) == []
    assert bus.wait(0.2) == [heartbeat(1, 0)]
    assert bus.sdo(READ_VENDOR) == VENDOR


def test_what_a_node_does_in_its_states() -> None:
    bus = Bus((1, 2))
    states = {}
    for command in (0x01, 0x02, 0x80):
        bus.send(0x000, bytes((command, 1)))
        states[command] = (bus.sdo(READ_VENDOR), bus.send(0x701, bytes(1), remote=True)[0].data)
    # guarding toggles its bit
    assert states == {
        0x01: (VENDOR, b'\x05'),
        0x02: ('', b'\x84'),
        0x80: (VENDOR, b'\x7f'),
    }
    bus.send(0x000, b'\x02\x00')
    assert bus.sdo(READ_VENDOR) == bus.sdo(READ_VENDOR, 2) == ''


@pytest.mark.parametrize('command', [0x81, 0x82])
def test_a_reset_forgets_what_was_set(command: int) -> None:
    bus = Bus()
    bus.write(PRODUCER, 0, b'\x64\x00')
    assert bus.send(0x000, bytes((command, 1))) == [heartbeat(1, 0)]
    assert bus.wait(1.0) == []
    assert bus.read(PRODUCER) == b'\x00\x00'


@pytest.mark.parametrize('data', [b'', b'\x01', b'\x01\x01\x00', b'\x01\x03', b'\x55\x01'])
def test_commands_that_are_none(data: bytes) -> None:
    bus = Bus()
    bus.send(0x000, data)
    assert bus.send(0x701, bytes(1), remote=True) == [heartbeat(1, 0x7F)]


# ---- heartbeats ----


def test_a_node_sends_its_heartbeat() -> None:
    bus = Bus()
    assert bus.write(PRODUCER, 0, b'\x64\x00') == ''
    began = bus.now
    assert bus.wait(1.05) == 10 * [heartbeat(1, 0x7F)]
    assert [at for at, _ in bus.frames[-10:]] == pytest.approx(
        [began + 0.1 * beat for beat in range(1, 11)]
    )
    bus.send(0x000, b'\x01\x01')
    assert bus.wait(0.1) == [heartbeat(1, 0x05)]
    assert bus.send(0x701, bytes(1), remote=True) == [], 'it is guarded no more'
    assert bus.write(PRODUCER, 0, bytes(2)) == ''
    assert bus.wait(1.0) == []


def test_the_first_heartbeat_begins_the_watch() -> None:
    bus = Bus(settings={'serial.auto_stop': True})
    running(bus)
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


def test_without_auto_stop_it_runs_on() -> None:
    # [M0 §5.3.5], [C91]
    bus = Bus()
    running(bus)
    bus.write(CONSUMER, 1, consumer(127, 300))
    bus.send(0x77F, b'\x05')
    bus.wait(2.0)
    assert bus.drive.faults.shown == 0 and bus.drive.motor.driven
    assert bus.send(0x77F, b'\x05')[0].data[:2] == bytes(2), 'an emergency has ended'


def test_a_watch_that_is_ended() -> None:
    bus = Bus(settings={'serial.auto_stop': True})
    running(bus)
    bus.write(CONSUMER, 1, consumer(127, 300))
    bus.send(0x77F, b'\x05')
    bus.write(CONSUMER, 1, bytes(4))
    assert bus.wait(2.0) == []
    assert bus.drive.faults.shown == 0


@pytest.mark.parametrize('value', ['2c018000', '2c017f01'])
def test_a_consumer_of_nobody_is_refused(value: str) -> None:
    bus = Bus()
    assert bus.write(CONSUMER, 1, bytes.fromhex(value)) == '06090030'


# ---- guarding ----


def test_guarding_begins_with_the_first_request() -> None:
    bus = Bus(settings={'serial.auto_stop': True})
    running(bus)
    bus.write(GUARD_TIME, 0, (100).to_bytes(2, 'little'))
    bus.write(LIFE_FACTOR, 0, b'\x03')
    bus.wait(1.0)
    told = []
    for _ in range(4):
        told += bus.send(0x701, bytes(1), remote=True)
        bus.wait(0.25)
    assert told == 2 * [heartbeat(1, 0x7F), heartbeat(1, 0xFF)]
    assert bus.drive.faults.shown == 0
    bus.wait(0.1)
    assert bus.drive.faults.shown == BUS_FAIL


def test_a_lost_master_takes_a_node_out_of_operation() -> None:
    bus = Bus()
    bus.write(GUARD_TIME, 0, (100).to_bytes(2, 'little'))
    bus.write(LIFE_FACTOR, 0, b'\x01')
    bus.send(0x000, b'\x01\x01')
    assert bus.send(0x701, bytes(1), remote=True) == [heartbeat(1, 0x05)]
    assert [frame.data[:2] for frame in bus.wait(0.2)] == [b'\x30\x81']
    # the end of the emergency has precedence
    assert bus.send(0x701, bytes(1), remote=True)[1] == heartbeat(1, 0xFF)


# ---- bus mode ----


def test_bus_mode_begins_with_the_first_request_and_stays() -> None:
    # [M0 §6.4]
    bus = Bus()
    bus.drive.control_unit.press('ext')
    bus.wait(1.0)
    assert bus.drive.motor.driven and bus.drive.control_unit.mode == 2
    bus.sdo(READ_VENDOR)
    bus.wait(10.0)
    assert not bus.drive.motor.driven
    running(bus)
    for key in ('stop', 'ext', 'start'):
        running(bus)
        bus.drive.control_unit.press(key)
        assert bus.read(MODE) == b'\x03\x00'
        bus.wait(10.0)
        assert not bus.drive.motor.driven and not bus.drive.motor.turning
    running(bus)
    assert bus.write(MODE, 0, b'\x01\x00') == ''
    assert bus.read(MODE) == b'\x03\x00'
    bus.wait(10.0)
    assert not bus.drive.motor.driven


def test_a_drive_that_is_free_leaves_bus_mode() -> None:
    bus = Bus(canopen_bus_mode='free')
    bus.sdo(READ_VENDOR)
    assert bus.read(MODE) == b'\x01\x00'
    bus.write(MODE, 0, b'\x03\x00')
    assert bus.read(MODE) == b'\x03\x00'
    bus.write(MODE, 0, b'\x01\x00')
    assert bus.read(MODE) == b'\x01\x00'


def test_power_off_ends_bus_mode() -> None:
    bus = Bus()
    bus.sdo(READ_VENDOR)
    bus.drive.power_cycle()
    bus.wait(3.0)
    assert bus.drive.control_unit.mode == 1


def test_sio_tot_counts_here_too() -> None:
    bus = Bus(settings={'serial.auto_stop': True, 'serial.sio_tot': 1.0})
    running(bus)
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


def test_a_closed_adapter_hears_nothing() -> None:
    bus = Bus(is_open=False)
    bus.drive.power_cycle(0.1)
    bus.wait(1.0)
    assert bus.frames == []
    assert bus.say(b't6018' + READ_VENDOR.encode() + b'\r') == b'\a'


@pytest.mark.parametrize('digit', [0, 1, 2, 3, 5, 6, 7, 8])
def test_another_bit_rate_hears_nothing(digit: int) -> None:
    bus = Bus(is_open=False)
    bus.say(b'S%d\rO\r' % digit)
    said = [bus.say(b't6018' + READ_VENDOR.encode() + b'\r') for _ in range(10)]
    assert said == 8 * [b'z\r'] + 2 * [b'\a']
    assert bus.say(b'F\r') != b'F00\r'
    assert bus.drive.control_unit.mode == 1, 'nobody was asked'


@pytest.mark.parametrize(('rate', 'digit'), [(10_000, 0), (250_000, 5), (1_000_000, 8)])
def test_other_bit_rates(rate: int, digit: int) -> None:
    bus = Bus(is_open=False, rate=rate)
    bus.say(b'S%d\rO\r' % digit)
    assert bus.sdo(READ_VENDOR) == VENDOR


def test_paced_a_frame_takes_its_bits() -> None:
    bus = Bus(paced=True, turnaround=0.003)
    request, answer = (
        Frame(identifier, bytes.fromhex(data))
        for identifier, data in ((0x601, READ_VENDOR), (0x581, VENDOR))
    )
    began = bus.now
    assert bus.send(*request[:2]) == []
    assert bus.wait(0.1) == [answer]
    taken = (bits(request) + bits(answer)) / 125_000 + 0.003
    assert bus.frames[-1][0] - began == pytest.approx(taken)


def test_paced_the_least_identifier_goes_first_and_the_adapter_in_order() -> None:
    bus = Bus((1, 2, 3), paced=True, turnaround=0.01)
    for node in (3, 2, 1):
        bus.say(b't60%d8' % node + READ_VENDOR.encode() + b'\r')
    # each has 10 ms, in which the others are asked
    assert [frame.identifier for frame in bus.wait(0.1)] == [0x583, 0x582, 0x581]
    bus = Bus((1, 2, 3), paced=True)
    bus.say(b'r7033\rr7023\rr7013\r')
    # each request goes before the answers to those before it, and of these the least
    assert [frame.identifier for frame in bus.wait(0.1)] == [0x701, 0x702, 0x703]


@pytest.mark.parametrize('turnaround', [0.003, 0.05])
def test_turnaround(turnaround: float) -> None:
    bus = Bus(turnaround=turnaround)
    began = bus.now
    assert bus.send(0x601, bytes.fromhex(READ_VENDOR)) == []
    bus.wait(0.1)
    assert [at for at, _ in bus.frames] == [pytest.approx(began + turnaround)]


def test_answers_that_are_lost_late_or_told_twice() -> None:
    bus = Bus()
    faults = bus.line.faults
    faults.add('drop')
    assert bus.sdo(READ_VENDOR) == ''
    faults.add('double')
    assert len(bus.send(0x601, bytes.fromhex(READ_VENDOR))) == 2
    faults.add('delay', seconds=0.5)
    assert bus.sdo(READ_VENDOR) == ''
    # what the same node answers later waits for it
    assert bus.sdo('4000100000000000') == ''
    assert [frame.data[1:4].hex() for frame in bus.wait(1.0)] == ['181001', '001000']
    faults.add('damage')
    assert bus.sdo(READ_VENDOR) == VENDOR, 'a damaged frame is sent again'


def test_noise_comes_before_the_line_of_an_answer() -> None:
    bus = Bus()
    for _ in range(20):
        bus.line.faults.add('noise')
        said = bus.say(b't6018' + READ_VENDOR.encode() + b'\r')
        before, line, rest = said.partition(b't5818' + VENDOR.upper().encode() + b'\r')
        assert line and not rest and before.startswith(b'z\r') and 3 <= len(before) <= 7


def test_damage_takes_the_time_of_another_frame() -> None:
    bus = Bus(paced=True)
    began = bus.now
    bus.line.faults.add('damage')
    bus.send(0x601, bytes.fromhex(READ_VENDOR))
    bus.wait(0.1)
    sent = bits(Frame(0x601, bytes.fromhex(READ_VENDOR)))
    told = bits(Frame(0x581, bytes.fromhex(VENDOR)))
    assert bus.frames[-1][0] - began == pytest.approx((sent + 2 * told + 23) / 125_000)


def test_a_dead_line_carries_nothing_and_nothing_comes_after_it() -> None:
    bus = Bus()
    bus.write(PRODUCER, 0, b'\x64\x00')
    bus.line.faults.dead_until = bus.now + 1.0
    assert bus.sdo(READ_VENDOR) == ''
    assert bus.wait(0.9) == []
    assert len(bus.wait(0.25)) in (1, 2)
    assert bus.sdo(READ_VENDOR) == VENDOR


def test_a_drive_that_is_held_silent_neither_hears_nor_tells() -> None:
    bus = Bus((1, 2))
    bus.write(PRODUCER, 0, b'\x64\x00')
    bus.drives[1].silence(1.0)
    assert bus.wait(0.9) == []
    assert bus.sdo(READ_VENDOR) == '' and bus.sdo(READ_VENDOR, 2) == VENDOR
    assert bus.wait(1.0)[0] == heartbeat(1, 0x7F), 'no boot-up: it was not off'


def test_an_adapter_that_is_pulled_out_comes_back_closed() -> None:
    bus = Bus()
    bus.line.hang_up(bus.now + 1.0)
    bus.wait(1.1)
    assert bus.say(b't6018' + READ_VENDOR.encode() + b'\r') == b'\a'
    bus.say(b'S4\rO\r')
    assert bus.sdo(READ_VENDOR) == VENDOR


def test_a_drive_on_another_bus_type_is_no_node() -> None:
    bus = Bus((1, 2))
    bus.drives[1].memory.set('serial.bus_type', 'MbusRtu')
    bus.drives[1].power_cycle(0.1)
    bus.wait(1.0)
    assert bus.sdo(READ_VENDOR) == '' and bus.sdo(READ_VENDOR, 2) == VENDOR


def test_another_node_id_counts_from_power_on() -> None:
    bus = Bus()
    assert bus.write(0x2071, 0, b'\x07\x00') == ''
    assert bus.sdo(READ_VENDOR) == VENDOR
    bus.drive.power_cycle(0.1)
    assert bus.wait(1.0) == [heartbeat(7, 0)]
    assert bus.sdo(READ_VENDOR) == '' and bus.sdo(READ_VENDOR, 7) == VENDOR


def test_frames_of_others() -> None:
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


def test_frames_of_others_keep_the_bus_busy() -> None:
    bus = Bus(paced=True)
    bus.line.set_traffic(500, bus.now)
    bus.wait(1.0)
    answers = []
    for _ in range(20):
        began = bus.now
        bus.send(0x601, bytes.fromhex(READ_VENDOR))
        bus.wait(0.05)
        answers += [at - began for at, frame in bus.frames if frame.identifier == 0x581]
        bus.frames.clear()
    assert len(answers) == 20 and max(answers) > min(answers) + 0.0005
