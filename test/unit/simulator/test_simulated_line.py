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

"""A line in made-up time: pace, faults, and what the trace says."""

import io
import json

import pytest

from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Line
from nfo_sinus_driver.simulator.line import Trace
from nfo_sinus_driver.simulator.modbus_frames import ModbusRtu
from nfo_sinus_driver.simulator.sinus.serial_side import BAUD_CODES
from nfo_sinus_driver.simulator.timing import Timing

RTU = ModbusRtu()
READ_MODE = bytes.fromhex('0302940001')
MODE_IS_STOP = RTU.wrap(1, bytes.fromhex('03020001'))


class FakePort:
    """A port whose other end is a list of (time, bytes)."""

    name = 'nowhere'

    def __init__(self, clock):
        self.clock = clock
        self.sent = []
        self.present = True

    def filenos(self):
        return []

    def receive(self):
        return b''

    def send(self, data):
        self.sent.append((self.clock(), data))

    def hang_up(self):
        self.present = False

    def come_back(self):
        self.present = True

    def close(self):
        pass


class Rig:
    """A line whose time is a number."""

    def __init__(self, *, addresses=(1,), baud=19200, **options):
        self.now = 100.0
        settings = {'serial.si_baud': f'{baud}bps'} if baud == 19200 else {}
        self.drives = [simulated_drive(address=address, settings=settings) for address in addresses]
        self.port = FakePort(lambda: self.now)
        self.stream = io.StringIO()
        self.timing = Timing(baud)
        self.line = Line(
            self.port,
            RTU,
            self.drives,
            self.timing,
            lambda: self.now,
            trace=Trace(self.stream),
            **options,
        )

    def ask(self, address=1, pdu=READ_MODE):
        self.send(RTU.wrap(address, pdu))

    def send(self, data):
        self.line.receive(data, self.now)
        self.line.act(self.now)

    def wait(self, seconds):
        """Let time pass, and the line act exactly when it has to."""
        end = self.now + seconds
        while self.line.due <= end:
            self.now = max(self.now, self.line.due)
            self.line.act(self.now)
        self.now = end

    @property
    def answers(self):
        return [data for _, data in self.port.sent]

    @property
    def trace(self):
        return [json.loads(line) for line in self.stream.getvalue().splitlines()]


def test_without_pace_the_answer_comes_at_once():
    rig = Rig()
    rig.ask()
    assert rig.port.sent == [(100.0, MODE_IS_STOP)]


def test_a_drive_may_take_its_time():
    rig = Rig(turnaround=0.02)
    rig.ask()
    assert not rig.answers
    rig.wait(1)
    assert rig.port.sent == [(pytest.approx(100.02), MODE_IS_STOP)]


@pytest.mark.parametrize('baud', [1200, 9600, 19200, 57600])
@pytest.mark.parametrize('turnaround', [0.0, 0.1])
def test_paced_it_takes_exactly_what_the_line_takes(baud, turnaround):
    rig = Rig(baud=baud, paced=True, turnaround=turnaround)
    rig.drives[0].memory.put('serial.si_baud', BAUD_CODES[baud])
    rig.drives[0].power_cycle(0.0)
    rig.ask()
    rig.wait(10)
    character = 11 / baud
    t35 = 0.00175 if baud > 19200 else 3.5 * character
    start = 100 + 8 * character + max(t35, turnaround)
    (first, one), (last, rest) = rig.port.sent
    assert first == pytest.approx(start + character)
    assert last == pytest.approx(start + 7 * character)
    assert (one, rest) == (MODE_IS_STOP[:1], MODE_IS_STOP[1:])
    request, answer = rig.trace
    assert request['first'] == 100
    assert request['last'] == pytest.approx(100 + 8 * character)
    assert answer['first'] == first
    assert answer['last'] == last


def test_the_trace_shows_every_frame_and_the_gaps():
    rig = Rig()
    rig.ask()
    rig.wait(0.25)
    rig.ask(7)
    rig.wait(0.5)
    rig.send(b'\x01\x02\x03')
    rig.wait(0.5)
    assert [(one['direction'], one['note'], one['gap']) for one in rig.trace] == [
        ('request', '', None),
        ('answer', '', 0),
        ('request', '', 0.25),
        ('request', 'rubbish', 0.5),
    ]
    assert [one['hex'] for one in rig.trace[:2]] == ['010302940001c45e', MODE_IS_STOP.hex()]


def test_nobody_answers_for_a_drive_that_is_not_there():
    rig = Rig(addresses=(1, 2))
    rig.ask(3)
    rig.ask(248)
    rig.wait(1)
    assert not rig.answers


def test_each_drive_answers_for_itself():
    rig = Rig(addresses=(1, 247))
    rig.ask(247)
    rig.ask(1)
    assert [answer[0] for answer in rig.answers] == [247, 1]


def test_a_damaged_request_is_met_with_silence():
    rig = Rig()
    rig.send(RTU.wrap(1, READ_MODE)[:-1] + b'\x00')
    rig.wait(1)
    assert not rig.answers
    rig.ask()
    assert rig.answers == [MODE_IS_STOP]


def test_everybody_obeys_a_broadcast_and_nobody_answers():
    rig = Rig(addresses=(1, 2))
    rig.ask(0, bytes.fromhex('06 0294 0003'))
    rig.wait(1)
    assert not rig.answers
    assert [drive.control_unit.mode for drive in rig.drives] == [3, 3]


def test_a_broadcast_read_does_nothing():
    rig = Rig()
    rig.ask(0, bytes.fromhex('03 02A4 0001'))
    rig.wait(1)
    assert not rig.answers
    assert rig.drives[0].control_unit.ack_reads == 0


def test_a_drive_set_to_another_speed_or_protocol_or_address_is_deaf():
    for key, value in [
        ('serial.si_baud', '9600bps'),
        ('serial.si_prot', '8b Np 2s'),
        ('serial.bus_type', 'NFO'),
        ('serial.address', 5),
    ]:
        rig = Rig()
        rig.drives[0].memory.set(key, value)
        rig.ask()
        assert rig.answers == [MODE_IS_STOP]
        rig.drives[0].power_cycle(0.0)
        rig.ask()
        rig.wait(1)
        assert len(rig.answers) == 1


def test_only_what_the_drive_hears_keeps_it_from_timing_out():
    rig = Rig()
    drive = rig.drives[0]
    drive.memory.set('serial.sio_tot', 1.0)
    drive.memory.set('serial.auto_stop', True)
    drive.advance_to(rig.now)
    rig.ask(1, bytes.fromhex('06 0294 0003'))
    for _ in range(4):
        rig.wait(0.6)
        rig.ask(1, bytes.fromhex('03 0000 0001'))  # refused, and yet heard
    assert drive.control_unit.status_code == 37
    for _ in range(2):
        rig.wait(0.6)
        rig.ask(2)
        rig.send(RTU.wrap(1, READ_MODE)[:-1] + b'\x00')
    rig.wait(0.1)
    rig.ask()
    assert drive.control_unit.status_code == 14


# ---- faults ----


def test_noise_comes_before_the_answer():
    rig = Rig()
    rig.line.faults.add('noise', 1)
    rig.ask()
    rig.ask()
    assert len(rig.answers[0]) > len(MODE_IS_STOP)
    assert rig.answers[0].endswith(MODE_IS_STOP)
    assert rig.answers[1] == MODE_IS_STOP
    assert rig.trace[1]['note'] == 'noise'


def test_damage_flips_one_bit():
    rig = Rig()
    rig.line.faults.add('damage', 3)
    for _ in range(4):
        rig.ask()
    for answer in rig.answers[:3]:
        differing = int.from_bytes(answer, 'big') ^ int.from_bytes(MODE_IS_STOP, 'big')
        assert bin(differing).count('1') == 1
    assert rig.answers[3] == MODE_IS_STOP


@pytest.mark.parametrize('paced', [False, True])
def test_a_late_answer_comes_after_those_to_later_requests(paced):
    rig = Rig(addresses=(1, 2), paced=paced)
    rig.line.faults.add('delay', 1, seconds=0.5)
    rig.ask(1)
    rig.wait(0.2)
    rig.ask(2)
    rig.wait(0.2)
    assert b''.join(rig.answers)[0] == 2
    rig.wait(1)
    assert b''.join(rig.answers)[-7:] == MODE_IS_STOP
    assert [one['note'] for one in rig.trace] == ['', '', '', 'delayed']
    assert rig.trace[3]['last'] >= 100.5


@pytest.mark.parametrize('paced', [False, True])
def test_no_answer_of_a_drive_overtakes_an_earlier_one(paced):
    rig = Rig(paced=paced)
    rig.line.faults.add('delay', 1, seconds=0.5)
    rig.ask(1)
    rig.wait(0.2)
    rig.ask(1, bytes.fromhex('06 0294 0003'))
    rig.wait(0.2)
    assert not b''.join(rig.answers)
    assert rig.drives[0].control_unit.mode == 3, 'only the answer waits'
    rig.wait(1)
    taken = RTU.wrap(1, bytes.fromhex('06 0294 0003'))
    assert b''.join(rig.answers) == MODE_IS_STOP + taken
    late, next_one = rig.trace[2:]
    assert (late['note'], next_one['note']) == ('delayed', '')
    assert next_one['first'] - late['last'] > 0.99 * rig.timing.t35, 'a frame of its own'
    rig.ask(1)
    rig.wait(0.2)
    assert len(rig.trace) == 6, 'nothing waits for what has been delivered'


def test_a_dropped_answer_is_still_an_obeyed_request():
    rig = Rig()
    rig.line.faults.add('drop', 1)
    rig.ask(1, bytes.fromhex('06 0294 0003'))
    rig.wait(1)
    assert not rig.answers
    assert rig.drives[0].control_unit.mode == 3


def test_an_answer_may_come_twice():
    rig = Rig(paced=True)
    rig.line.faults.add('double', 1)
    rig.ask()
    rig.wait(1)
    assert b''.join(rig.answers) == 2 * MODE_IS_STOP
    assert rig.trace[2]['gap'] == pytest.approx(rig.timing.t35 + rig.timing.character)


def test_faults_may_be_meant_for_one_drive():
    rig = Rig(addresses=(1, 2))
    rig.line.faults.add('drop', 1, address=2)
    rig.ask(1)
    rig.ask(2)
    rig.ask(2)
    assert [answer[0] for answer in rig.answers] == [1, 2]


def test_faults_may_come_together():
    rig = Rig()
    rig.line.faults.add('delay', 1, seconds=0.1)
    rig.line.faults.add('damage', 1)
    rig.line.faults.add('double', 1)
    rig.ask()
    rig.wait(1)
    assert [one['note'] for one in rig.trace] == [
        '',
        'delayed, damaged',
        'delayed, damaged, double',
    ]


def test_a_dead_line_carries_nothing_either_way():
    rig = Rig(turnaround=0.1)
    rig.ask()
    rig.line.faults.dead_until = rig.now + 5
    rig.wait(1)
    rig.ask(1, bytes.fromhex('06 0294 0003'))
    rig.wait(3.9)
    assert not rig.answers
    assert rig.drives[0].control_unit.mode == 1
    assert [one['note'] for one in rig.trace] == ['', 'lost', 'lost']
    rig.wait(0.2)
    rig.ask()
    rig.wait(1)
    assert rig.answers == [MODE_IS_STOP]


def test_a_silent_drive_does_not_even_obey():
    rig = Rig(addresses=(1, 2))
    for drive in rig.drives:
        drive.advance_to(rig.now)
    rig.drives[0].silence(5)
    rig.ask(1, bytes.fromhex('06 0294 0003'))
    rig.ask(2)
    assert [answer[0] for answer in rig.answers] == [2]
    assert rig.drives[0].control_unit.mode == 1
    rig.wait(5.1)
    rig.ask(1)
    assert rig.answers[-1] == MODE_IS_STOP


def test_healing_ends_them_all():
    rig = Rig()
    rig.line.faults.add('damage', 100)
    rig.line.faults.dead_until = rig.now + 100
    rig.line.faults.heal()
    rig.ask()
    assert rig.answers == [MODE_IS_STOP]


def test_a_hung_up_port_comes_back_without_old_answers():
    rig = Rig(turnaround=0.1)
    rig.ask()
    rig.line.hang_up(rig.now + 2)
    rig.wait(0)
    assert not rig.port.present
    rig.wait(1.9)
    assert not rig.port.present
    rig.wait(0.2)
    assert rig.port.present
    assert not rig.answers
