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

"""Lines in made-up time, by every protocol: pace, echo, faults, and drives that keep silent."""

from dataclasses import dataclass
import io
import json

from classic_bench import enquiry
from classic_bench import reply
import pytest

from nfo_sinus_driver.simulator.endpoints import endpoint
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Line
from nfo_sinus_driver.simulator.line import Trace
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii
from nfo_sinus_driver.simulator.modbus_frames import ModbusRtu
from nfo_sinus_driver.simulator.modbus_frames import ModbusTcp
from nfo_sinus_driver.simulator.sinus.serial_side import BAUD_CODES
from nfo_sinus_driver.simulator.sinus.serial_side import BUS_TYPES

READ = bytes.fromhex('0302940001')
STOP = bytes.fromhex('03020001')


@dataclass(frozen=True)
class Words:
    """A question for MODE, the answer "Stop", and a character of the default format, in bits."""

    ask: bytes
    answer: bytes
    bits: int
    gap: float = 0.0


#: Of drive 1.
WORDS = {
    'modbus_rtu': Words(ModbusRtu.wrap(1, READ), ModbusRtu.wrap(1, STOP), 11, 3.5),
    'modbus_ascii': Words(b':01030294000165\r\n', b':0103020001F9\r\n', 10),
    'classic': Words(enquiry('E0029'), reply('E0029', 1), 10),
    'modbus_tcp': Words(ModbusTcp.wrap(7, 1, READ), ModbusTcp.wrap(7, 1, STOP), 11),
}
ON_WIRES = [name for name in WORDS if name != 'modbus_tcp']
serial = pytest.mark.parametrize('protocol', ON_WIRES)
every = pytest.mark.parametrize('protocol', list(WORDS))


class FakePort:
    """A port whose other end is a list of (time, bytes)."""

    name = 'nowhere'

    def __init__(self, clock):
        self.clock = clock
        self.sent = []

    def send(self, data):
        self.sent.append((self.clock(), data))

    def hang_up(self):
        self.sent.append((self.clock(), b'gone'))

    def come_back(self):
        self.sent.append((self.clock(), b'back'))


class Rig:
    """A line whose time is a number, with a drive that is set to it."""

    def __init__(self, protocol, *, addresses=(1,), wait=0.25, set_to_it=True, **options):
        self.now = 100.0
        way = endpoint(protocol, **{key: options.pop(key) for key in ('baud',) if key in options})
        self.timing = way.timing
        self.drives = [simulated_drive(address=address) for address in addresses]
        if set_to_it:
            for drive in self.drives:
                drive.memory.put('serial.bus_type', BUS_TYPES[way.spoken])
                drive.memory.put('serial.si_baud', BAUD_CODES[self.timing.baud])
                drive.memory.put('serial.si_prot', {'8E1': 4, '7E1': 0}[self.timing.char_format])
                drive.power_cycle(0.0)
                drive.advance_to(self.now)
        self.port = FakePort(lambda: self.now)
        self.stream = io.StringIO()
        self.line = Line(
            self.port,
            way.make(wait),
            self.drives,
            self.timing,
            lambda: self.now,
            trace=Trace(self.stream),
            **options,
        )
        self.words = WORDS[protocol]

    def ask(self, frame=None):
        self.line.receive(self.words.ask if frame is None else frame, self.now)
        self.line.act(self.now)

    def wait(self, seconds):
        """Let time pass, and the line act exactly when it has to."""
        end = self.now + seconds
        while self.line.due <= end:
            self.now = max(self.now, self.line.due)
            self.line.act(self.now)
        self.now = end

    @property
    def heard(self):
        """Everything that came back."""
        return b''.join(data for _, data in self.port.sent)

    @property
    def notes(self):
        return [json.loads(line)['note'] for line in self.stream.getvalue().splitlines()]


@every
def test_without_pace_the_answer_comes_at_once(protocol):
    rig = Rig(protocol)
    rig.ask()
    assert rig.port.sent == [(100.0, rig.words.answer)]


@serial
@pytest.mark.parametrize('baud', [1200, 9600, 57600])
def test_paced_it_takes_what_the_line_takes(protocol, baud):
    rig = Rig(protocol, baud=baud, paced=True)
    rig.ask()
    rig.wait(10)
    words, character = rig.words, rig.words.bits / baud
    gap = 0.00175 if words.gap and baud > 19200 else words.gap * character
    start = 100 + len(words.ask) * character + gap
    (first, one), (last, _) = rig.port.sent
    assert (first, one) == (pytest.approx(start + character), words.answer[:1])
    assert last == pytest.approx(start + len(words.answer) * character)


def test_paced_a_gateway_takes_what_the_line_behind_it_takes():
    rig = Rig('modbus_tcp', paced=True)
    rig.ask()
    rig.wait(10)
    # 8 characters, t3.5, 7 characters
    (at, data), = rig.port.sent
    assert (at, data) == (pytest.approx(100 + 18.5 * 11 / 19200), rig.words.answer)


@every
def test_a_drive_set_to_another_protocol_is_deaf(protocol):
    rig = Rig(protocol)
    (drive,) = rig.drives
    code = drive.memory.raw('serial.bus_type')
    drive.memory.put('serial.bus_type', 0)
    rig.ask()
    assert rig.heard == rig.words.answer, 'not before it counts'
    drive.power_cycle(0.0)
    rig.ask()
    rig.wait(5)
    silence = bytes.fromhex('0007 0000 0003 01 83 0B') if protocol == 'modbus_tcp' else b''
    assert rig.heard == rig.words.answer + silence
    drive.memory.put('serial.bus_type', code)
    drive.power_cycle(0.0)
    rig.ask()
    assert rig.heard.endswith(rig.words.answer)


@every
def test_another_line_is_heard_whatever_the_drive_is_set_to(protocol):
    rig = Rig(protocol, set_to_it=False, always_heard=True)
    rig.drives[0].memory.put('serial.si_baud', 16)
    rig.drives[0].power_cycle(0.0)
    rig.ask()
    assert rig.heard == rig.words.answer


# ---- echo ----


@serial
def test_an_echo_comes_before_the_answer(protocol):
    rig = Rig(protocol, echo=True)
    rig.ask()
    assert rig.heard == rig.words.ask + rig.words.answer
    assert rig.notes == ['', ''], 'it is not written down'


@serial
def test_a_paced_echo_is_as_slow_as_what_it_echoes(protocol):
    rig = Rig(protocol, echo=True, paced=True)
    words, character = rig.words, rig.timing.character
    rig.ask(words.ask[:3])
    rig.wait(5 * character)
    rig.ask(words.ask[3:])
    rig.wait(10)
    assert rig.heard == words.ask + words.answer
    done = [at for at, _ in rig.port.sent]
    assert done == sorted(done)
    assert done[1] == pytest.approx(100 + 3 * character)
    assert done[3] == pytest.approx(100 + (5 + len(words.ask) - 3) * character)


@serial
def test_it_echoes_whatever_it_hears_even_on_a_dead_line(protocol):
    rig = Rig(protocol, echo=True)
    rig.line.faults.dead_until = rig.now + 5
    rig.ask()
    rig.ask(b'\x00\xff')
    rig.wait(2)
    assert rig.heard == rig.words.ask + b'\x00\xff'


# ---- faults ----


@serial
def test_noise_has_the_bits_of_the_line(protocol):
    rig = Rig(protocol)
    rig.line.faults.add('noise', 50)
    for _ in range(50):
        rig.ask()
    assert rig.heard.count(rig.words.answer) == 50
    assert len(rig.heard) > 51 * len(rig.words.answer)
    high = any(byte > 0x7F for byte in rig.heard.replace(rig.words.answer, b''))
    assert high == (protocol == 'modbus_rtu')


@serial
def test_damage_flips_a_bit_that_the_line_has(protocol):
    rig = Rig(protocol)
    rig.line.faults.add('damage', 50)
    for _ in range(50):
        rig.ask()
    for _, answer in rig.port.sent:
        flipped = int.from_bytes(answer, 'big') ^ int.from_bytes(rig.words.answer, 'big')
        assert bin(flipped).count('1') == 1
    if protocol != 'modbus_rtu':
        assert max(rig.heard) < 0x80


@serial
def test_lost_late_and_double_answers(protocol):
    rig = Rig(protocol)
    for what in ('drop', 'double', 'delay'):
        rig.line.faults.add(what, 1, seconds=0.5)
        rig.ask()
        rig.wait(0.3)
    assert rig.heard == 2 * rig.words.answer
    rig.wait(0.3)
    assert rig.heard == 3 * rig.words.answer
    assert rig.notes == ['', '', '', 'double', '', 'delayed']


@every
def test_a_dead_line_carries_nothing(protocol):
    rig = Rig(protocol)
    rig.line.faults.dead_until = rig.now + 5
    rig.ask()
    rig.wait(4)
    assert rig.heard == b''
    assert rig.notes == ['lost']
    rig.wait(1.1)
    rig.ask()
    assert rig.heard == rig.words.answer


@every
def test_the_port_hangs_up_and_comes_back(protocol):
    rig = Rig(protocol, turnaround=0.1)
    rig.ask()
    rig.line.hang_up(rig.now + 2)
    rig.wait(3)
    assert rig.heard == b'goneback'
    rig.ask()
    rig.wait(1)
    assert rig.heard == b'goneback' + rig.words.answer


@serial
def test_nobody_answers_for_one_who_is_silent_or_not_there(protocol):
    rig = Rig(protocol, addresses=(2,))
    rig.ask()
    rig.drives[0].memory.put('serial.address', 1)
    rig.drives[0].power_cycle(0.0)
    rig.drives[0].silence(1)
    rig.ask()
    rig.wait(5)
    assert rig.heard == b''


# ---- a gateway ----

NO_PATH = bytes.fromhex('0007 0000 0003 01 83 0A')
NO_ANSWER = bytes.fromhex('0007 0000 0003 01 83 0B')


def test_a_gateway_has_no_path_to_a_drive_that_is_not_there():
    rig = Rig('modbus_tcp', addresses=(2,))
    rig.ask()
    assert rig.port.sent == [(100.0, NO_PATH)]


def test_a_gateway_waits_for_a_drive_that_is_silent():
    rig = Rig('modbus_tcp', wait=0.5)
    rig.drives[0].silence(1)
    rig.ask()
    rig.wait(2)
    assert rig.port.sent == [(pytest.approx(100.5), NO_ANSWER)]


def test_a_gateway_does_not_answer_for_everybody():
    rig = Rig('modbus_tcp')
    rig.ask(ModbusTcp.wrap(7, 0, bytes.fromhex('0602940003')))
    rig.wait(2)
    assert rig.heard == b''
    assert rig.drives[0].control_unit.mode == 3


@pytest.mark.parametrize(
    ('what', 'note'), [('noise', 'noise'), ('damage', 'damaged'), ('drop', 'lost')]
)
def test_a_gateway_keeps_a_spoilt_answer_to_itself(what, note):
    rig = Rig('modbus_tcp')
    rig.line.faults.add(what, 1)
    rig.ask(ModbusTcp.wrap(7, 1, bytes.fromhex('0602940003')))
    rig.wait(2)
    assert rig.port.sent == [(pytest.approx(100.25), NO_ANSWER.replace(b'\x83', b'\x86'))]
    assert rig.drives[0].control_unit.mode == 3, 'it is carried out'
    assert rig.notes == ['', note]


def test_a_late_or_double_answer_of_a_gateway_keeps_its_number():
    rig = Rig('modbus_tcp')
    rig.line.faults.add('delay', 1, seconds=0.5)
    rig.line.faults.add('double', 1)
    rig.ask(ModbusTcp.wrap(0x1234, 1, READ))
    rig.wait(2)
    assert rig.heard == 2 * ModbusTcp.wrap(0x1234, 1, STOP)


def test_a_gateway_answers_for_a_drive_that_keeps_silent_about_a_function():
    rig = Rig('modbus_tcp')
    rig.drives[0].control_unit.newer_functions = 'silent'
    rig.ask(ModbusTcp.wrap(7, 1, b'\x11'))
    rig.wait(2)
    assert rig.heard == NO_ANSWER.replace(b'\x83', b'\x91')


# ---- Classic with several drives ----


def test_all_answer_to_address_0_over_each_other():
    rig = Rig('classic', addresses=(1, 2), paced=True)
    rig.ask(enquiry('E0029', 0))
    rig.wait(1)
    answer = reply('E0029', 1, 0)
    assert len(rig.heard) == 2 * len(answer)
    assert rig.heard != 2 * answer
    assert rig.notes == ['', '', '']


def test_a_stop_to_all():
    rig = Rig('classic', addresses=(1, 2))
    for drive in rig.drives:
        drive.write_raw('fieldbus.mode', 3)
    rig.ask(b'\x04\x7f\x02E0029=0001\x03q')
    rig.wait(1)
    assert rig.heard == b''
    assert [drive.control_unit.mode for drive in rig.drives] == [1, 1]


def test_a_damaged_message_is_written_down_as_rubbish():
    rig = Rig('classic')
    rig.ask(b'\x04!\x02E0029=0001\x03r')
    rig.ask(enquiry('E0029'))
    assert rig.notes == ['rubbish', '', '']
    assert ModbusAscii.unwrap(b':01\r\n') is None
