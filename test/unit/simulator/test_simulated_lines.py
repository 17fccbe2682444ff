# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Lines in made-up time, by every serial protocol and TCP: pace, echo, faults, silence, trace."""

from dataclasses import dataclass
import io
import json

from classic_bench import enquiry, reply
import movitrac_drive_bench as movitrac
import pytest

from nfo_sinus_driver.simulator.endpoints import Endpoint
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Trace
from nfo_sinus_driver.simulator.line_faults import LineFaults, Reply
from nfo_sinus_driver.simulator.modbus_frames import ModbusAscii, ModbusRtu, ModbusTcp

READ = bytes.fromhex('0302940001')
STOP = bytes.fromhex('03020001')
MODE_BUS = bytes.fromhex('0602940003')


@dataclass(frozen=True)
class Words:
    """A question to drive 1, its answer, and a character of the default format, in bits."""

    ask: bytes
    answer: bytes
    bits: int
    gap: float = 0.0
    model: str = 'sinus_g2'


WORDS = {
    'modbus_rtu': Words(ModbusRtu.wrap(1, READ), ModbusRtu.wrap(1, STOP), 11, 3.5),
    'modbus_ascii': Words(b':01030294000165\r\n', b':0103020001F9\r\n', 10),
    'classic': Words(enquiry('E0029'), reply('E0029', 1), 10),
    'movitrac': Words(
        movitrac.enquiry(4, 1), movitrac.data(4, bytes.fromhex('00002550')), 10,
        model='movitrac31',
    ),
    'modbus_tcp': Words(ModbusTcp.wrap(7, 1, READ), ModbusTcp.wrap(7, 1, STOP), 11),
}
every = pytest.mark.parametrize('protocol', WORDS)
serial = pytest.mark.parametrize('protocol', [name for name in WORDS if name != 'modbus_tcp'])
NO_PATH = bytes.fromhex('0007 0000 0003 01 83 0A')
NO_ANSWER = bytes.fromhex('0007 0000 0003 01 83 0B')


class FakePort:
    """A port whose other end is a list of (time, bytes)."""

    name = 'nowhere'

    def __init__(self, clock):
        self.clock = clock
        self.sent = []

    def send(self, data):
        self.sent.append((self.clock(), data))

    def hang_up(self):
        self.send(b'gone')

    def come_back(self):
        self.send(b'back')


class Rig:
    """A line whose time is a number, with drives that are set to it."""

    def __init__(
        self, protocol='modbus_rtu', *, addresses=(1,), wait=0.25, baud=None, set_to_it=True,
        drive=None, **options,
    ):  # fmt: skip
        self.now = 100.0
        way = Endpoint(protocol, baud=baud)
        self.words, self.timing = WORDS[protocol], way.timing
        model = self.words.model
        self.drives = [simulated_drive(model, address, **(drive or {})) for address in addresses]
        for simulated in self.drives:
            if set_to_it:
                simulated.control_unit.set_to([(way.spoken, way.timing)])
            simulated.advance_to(self.now)
        self.port = FakePort(lambda: self.now)
        self.stream = io.StringIO()
        self.line = way.wire(
            self.port, self.drives, self.drives, lambda: self.now,
            gateway_timeout=wait, trace=Trace(self.stream), **options,
        )

    def ask(self, frame=None, seconds=0.0):
        """Send a frame, the usual one if none is given; let time pass."""
        self.line.receive(self.words.ask if frame is None else frame, self.now)
        self.line.act(self.now)
        self.wait(seconds)

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
    def trace(self):
        return [json.loads(line) for line in self.stream.getvalue().splitlines()]

    @property
    def notes(self):
        return [frame['note'] for frame in self.trace]


def rtu(pdu, address=1):
    return ModbusRtu.wrap(address, pdu)


# ---- pace ----


@every
def test_without_pace_the_answer_comes_at_once_or_after_the_turnaround(protocol):
    for turnaround in (0.0, 0.02):
        rig = Rig(protocol, turnaround=turnaround)
        rig.ask(seconds=1.0)
        assert rig.port.sent == [(pytest.approx(100 + turnaround), rig.words.answer)]


@serial
def test_paced_it_takes_what_the_line_takes(protocol):
    for baud in (9600,) if protocol == 'movitrac' else (1200, 9600, 57600):
        for turnaround in (0.0, 0.1):
            rig = Rig(protocol, baud=baud, paced=True, turnaround=turnaround)
            rig.ask(seconds=10)
            words, character = rig.words, rig.words.bits / baud
            gap = 0.00175 if words.gap and baud > 19200 else words.gap * character
            asked = 100 + len(words.ask) * character
            start = asked + max(gap, turnaround)
            (first, begun), (last, rest) = rig.port.sent
            assert (first, begun) == (pytest.approx(start + character), words.answer[:1])
            assert begun + rest == words.answer
            assert last == pytest.approx(start + len(words.answer) * character)
            request, answer = rig.trace
            assert (request['first'], request['last']) == (100, pytest.approx(asked))
            assert (answer['first'], answer['last']) == (first, last)


def test_paced_a_gateway_takes_what_the_line_behind_it_takes():
    rig = Rig('modbus_tcp', paced=True)
    rig.ask(seconds=10)
    # 8 characters, t3.5, 7 characters
    assert rig.port.sent == [(pytest.approx(100 + 18.5 * 11 / 19200), rig.words.answer)]


def test_the_response_time_of_a_movitrac_delays_the_answer():
    character = 10 / 9600
    for paced in (False, True):
        drive = {'settings': {'serial.response_time': 120}}
        rig = Rig('movitrac', paced=paced, drive=drive)
        rig.ask(seconds=1.0)
        assert rig.port.sent[-1][0] == pytest.approx(100.12 + 13 * character * paced)
    rig = Rig('movitrac')
    rig.ask(movitrac.select(207, movitrac.bcd(50), 1))
    rig.ask(seconds=1.0)
    times = [at for at, _ in rig.port.sent]
    assert times == [100.0, pytest.approx(100.05)], 'it counts from the next request on'


# ---- which drives hear it ----


def test_each_drive_answers_for_itself_and_none_for_another():
    rig = Rig(addresses=(1, 247))
    for address in (247, 3, 248, 1):
        rig.ask(rtu(READ, address), 1.0)
    assert rig.heard == rtu(STOP, 247) + rtu(STOP)
    rig = Rig('movitrac', addresses=(0, 12), drive={'option_card': 'fea'})
    value = movitrac.bcd
    rig.ask(movitrac.select(25, value(3.7), 12))
    for address in (0, 12, 13):
        rig.ask(movitrac.enquiry(25, address), 1.0)
    heard = movitrac.ACK + movitrac.data(25, value(1.0)) + movitrac.data(25, value(3.7))
    assert rig.heard == heard
    rig.ask(movitrac.select(212, value(1)))
    rig.ask(movitrac.enquiry(25), 1.0)
    assert rig.heard == heard + movitrac.ACK, 'in master-slave operation it hears no master'


def test_a_drive_set_to_another_line_is_deaf_from_power_on():
    for protocol in ('modbus_rtu', 'modbus_ascii', 'classic', 'modbus_tcp'):
        for key, value in [
            ('serial.si_baud', '1200bps'), ('serial.si_prot', '8b Np 2s'),
            ('serial.bus_type', 'NFO' if protocol != 'classic' else 'MbusRtu'),
            ('serial.address', 5),
        ]:
            rig = Rig(protocol)
            rig.drives[0].memory.set(key, value)
            rig.ask()
            assert rig.heard == rig.words.answer, 'not before it counts'
            rig.drives[0].power_cycle(0.0)
            rig.ask(seconds=5)
            there = NO_PATH if key == 'serial.address' else NO_ANSWER
            nothing = there if protocol == 'modbus_tcp' else b''
            assert rig.heard == rig.words.answer + nothing, (protocol, key)
            rig = Rig(protocol, always_heard=True)
            rig.drives[0].memory.set('serial.si_baud', '1200bps')
            rig.drives[0].power_cycle(0.0)
            rig.ask()
            assert rig.heard == rig.words.answer, 'it may be heard all the same'


@every
def test_a_silent_drive_neither_answers_nor_obeys(protocol):
    rig = Rig(protocol, addresses=(1, 2))
    rig.drives[0].silence(5)
    frame = {
        'modbus_rtu': rtu(MODE_BUS), 'modbus_ascii': ModbusAscii.wrap(1, MODE_BUS),
        'modbus_tcp': ModbusTcp.wrap(7, 1, MODE_BUS),
    }.get(protocol, rig.words.ask)
    rig.ask(frame, 5.1)
    assert rig.heard == (NO_ANSWER.replace(b'\x83', b'\x86') if protocol == 'modbus_tcp' else b'')
    rig.ask()
    assert rig.heard.endswith(rig.words.answer)


def test_a_damaged_request_gets_no_answer_and_does_not_count():
    for protocol, key, heard_until in (
        ('modbus_rtu', 'serial.sio_tot', 14), ('movitrac', 'serial.pc_timeout', 145)
    ):
        settings = {key: 1.0}
        if protocol == 'movitrac':
            settings['serial.control_mode'] = 'Remote control'
        else:
            settings['serial.auto_stop'] = True
        rig = Rig(protocol, drive={'settings': settings})
        (drive,) = rig.drives
        if protocol == 'modbus_rtu':
            rig.ask(rtu(MODE_BUS))
        for _ in range(4):
            rig.ask(seconds=0.6)
        assert drive.faults.codes == []
        answers = rig.heard
        wrong = rig.words.ask[:-1] + bytes([rig.words.ask[-1] ^ 1])
        other = rtu(READ, 2) if protocol == 'modbus_rtu' else movitrac.enquiry(4, 7)
        for _ in range(4):
            rig.ask(wrong, 0.15)
            rig.ask(other, 0.15)
        assert rig.heard == answers
        drive.advance_to(rig.now)
        assert drive.faults.codes == [heard_until], protocol


def test_a_movitrac_frame_comes_in_pieces_and_its_rest_is_not_waited_for():
    for begin, pause in ((b'', 0.0), (b'\x00\xff', 0.0), (WORDS['movitrac'].ask[:3], 0.2)):
        rig = Rig('movitrac')
        rig.ask(begin, pause)
        for byte in rig.words.ask:
            rig.ask(bytes([byte]), 0.01)
        assert rig.heard == rig.words.answer


def test_every_drive_obeys_a_broadcast_and_none_answers():
    for protocol, frame in (
        ('modbus_rtu', rtu(MODE_BUS, 0)), ('modbus_tcp', ModbusTcp.wrap(7, 0, MODE_BUS))
    ):
        rig = Rig(protocol, addresses=(1, 2))
        rig.ask(frame, 2)
        assert rig.heard == b''
        assert [drive.control_unit.mode for drive in rig.drives] == [3, 3]
        rig.ask(rtu(bytes.fromhex('03 02A4 0001'), 0), 1)
        assert rig.drives[0].control_unit.ack_reads == 0, 'a broadcast read does nothing'
    rig = Rig('classic', addresses=(1, 2), paced=True)
    for drive in rig.drives:
        drive.write_raw('fieldbus.mode', 3)
    rig.ask(b'\x04\x7f\x02E0029=0001\x03q', 1)
    assert rig.heard == b''
    assert [drive.control_unit.mode for drive in rig.drives] == [1, 1]
    # all answer to address 0, over each other
    rig.ask(enquiry('E0029', 0), 1)
    answer = reply('E0029', 1, 0)
    assert len(rig.heard) == 2 * len(answer) and rig.heard != 2 * answer


# ---- trace ----


def test_the_trace_shows_every_frame_and_the_gaps():
    rig = Rig()
    rig.ask(seconds=0.25)
    rig.ask(rtu(READ, 7), 0.5)
    rig.ask(b'\x01\x02\x03', 0.5)
    assert [(frame['direction'], frame['note'], frame['gap']) for frame in rig.trace] == [
        ('request', '', None), ('answer', '', 0), ('request', '', 0.25),
        ('request', 'rubbish', 0.5),
    ]  # fmt: skip
    assert [frame['hex'] for frame in rig.trace[:2]] == ['010302940001c45e', rtu(STOP).hex()]
    rig = Rig('classic')
    rig.ask(b'\x04!\x02E0029=0001\x03r')
    rig.ask()
    assert rig.notes == ['rubbish', '', '']


# ---- echo ----


@serial
def test_an_echo_comes_before_the_answer_at_the_pace_of_the_line(protocol):
    rig = Rig(protocol, echo=True)
    rig.ask()
    assert rig.heard == rig.words.ask + rig.words.answer
    assert rig.notes == ['', ''], 'it is not written down'
    rig.line.faults.dead_until = rig.now + 5
    rig.ask()
    rig.ask(b'\x00\xff', 2)
    assert rig.heard == rig.words.ask + rig.words.answer + rig.words.ask + b'\x00\xff'
    rig = Rig(protocol, echo=True, paced=True)
    words, character = rig.words, rig.timing.character
    rig.ask(words.ask[:3], 5 * character)
    rig.ask(words.ask[3:], 10)
    assert rig.heard == words.ask + words.answer
    done = [at for at, _ in rig.port.sent]
    assert done == sorted(done)
    assert done[1] == pytest.approx(100 + 3 * character)
    assert done[3] == pytest.approx(100 + (5 + len(words.ask) - 3) * character)


# ---- faults ----


@serial
def test_noise_and_damage_have_the_bits_of_the_line(protocol):
    rig = Rig(protocol)
    rig.line.faults.add('noise', 50)
    for _ in range(50):
        rig.ask()
    answer = rig.words.answer
    assert all(data.endswith(answer) for _, data in rig.port.sent)
    assert len(rig.heard) > 51 * len(answer)
    eight_bits = protocol in ('modbus_rtu', 'movitrac')
    assert any(byte > 0x7F for byte in rig.heard.replace(answer, b'')) == eight_bits
    rig = Rig(protocol)
    rig.line.faults.add('damage', 50)
    for _ in range(51):
        rig.ask()
    *spoilt, (_, last) = rig.port.sent
    assert last == answer
    for _, data in spoilt:
        flipped = int.from_bytes(data, 'big') ^ int.from_bytes(answer, 'big')
        assert bin(flipped).count('1') == 1
    assert eight_bits or max(rig.heard) < 0x80


@serial
def test_lost_late_and_double_answers_of_one_drive_or_all(protocol):
    rig = Rig(protocol)
    rig.line.faults.add('drop', 1, address=2)
    for what in ('', 'drop', 'double', 'delay'):
        if what:
            rig.line.faults.add(what, 1, seconds=0.5)
        rig.ask(seconds=0.3)
    assert rig.heard == 3 * rig.words.answer
    rig.wait(0.3)
    assert rig.heard == 4 * rig.words.answer
    assert rig.notes == ['', '', '', '', '', 'double', '', 'delayed']
    for what in ('delay', 'damage', 'double'):
        rig.line.faults.add(what, 1, seconds=0.1)
    rig.ask(seconds=1)
    assert rig.notes[8:] == ['', 'delayed, damaged', 'delayed, damaged, double']


def test_a_dropped_answer_is_still_an_obeyed_request_and_a_double_one_is_a_frame_of_its_own():
    rig = Rig(paced=True)
    rig.line.faults.add('drop', 1)
    rig.ask(rtu(MODE_BUS), 1)
    assert (rig.heard, rig.drives[0].control_unit.mode) == (b'', 3)
    rig.line.faults.add('double', 1)
    rig.ask(seconds=1)
    assert rig.trace[-1]['gap'] == pytest.approx(rig.timing.t35 + rig.timing.character)


def test_a_late_answer_comes_after_those_of_other_drives_and_before_those_of_its_own():
    for paced in (False, True):
        rig = Rig(addresses=(1, 2), paced=paced)
        rig.line.faults.add('delay', 1, seconds=0.5)
        rig.ask(seconds=0.2)
        rig.ask(rtu(MODE_BUS), 0.1)
        rig.ask(rtu(READ, 2), 0.1)
        assert rig.heard == rtu(STOP, 2)
        assert rig.drives[0].control_unit.mode == 3, 'only the answer waits'
        rig.wait(1)
        assert rig.heard == rtu(STOP, 2) + rtu(STOP) + rtu(MODE_BUS)
        late, next_one = rig.trace[-2:]
        assert (late['note'], next_one['note']) == ('delayed', '')
        assert late['last'] >= 100.5
        assert next_one['first'] - late['last'] > 0.99 * rig.timing.t35, 'a frame of its own'
        rig.ask(seconds=0.2)
        assert len(rig.trace) == 8, 'nothing waits for what has been delivered'


@every
def test_a_dead_line_carries_nothing_either_way(protocol):
    rig = Rig(protocol, turnaround=0.1)
    rig.ask()
    rig.line.faults.dead_until = rig.now + 5
    rig.wait(1)
    rig.ask(seconds=3)
    assert (rig.heard, rig.notes) == (b'', ['', 'lost', 'lost'])
    rig.wait(1.1)
    rig.ask(seconds=1)
    assert rig.heard == rig.words.answer


@every
def test_the_port_hangs_up_and_comes_back_without_old_answers(protocol):
    rig = Rig(protocol, turnaround=0.1)
    rig.ask()
    rig.line.hang_up(rig.now + 2)
    rig.wait(1.9)
    assert rig.heard == b'gone'
    rig.wait(1.1)
    assert rig.heard == b'goneback'
    rig.ask(seconds=1)
    assert rig.heard == b'goneback' + rig.words.answer


# ---- a gateway ----


def test_a_gateway_answers_in_place_of_a_drive_that_does_not():
    rig = Rig('modbus_tcp', addresses=(2,))
    rig.ask()
    assert rig.port.sent == [(100.0, NO_PATH)]
    rig = Rig('modbus_tcp', wait=0.5)
    rig.drives[0].silence(1)
    rig.ask(seconds=2)
    assert rig.port.sent == [(pytest.approx(100.5), NO_ANSWER)]
    rig = Rig('modbus_tcp', drive={'newer_functions': 'silent'})
    rig.ask(ModbusTcp.wrap(7, 1, b'\x11'), 2)
    assert rig.heard == NO_ANSWER.replace(b'\x83', b'\x91')
    for what, note in (('noise', 'noise'), ('damage', 'damaged'), ('drop', 'lost')):
        rig = Rig('modbus_tcp')
        rig.line.faults.add(what, 1)
        rig.ask(ModbusTcp.wrap(7, 1, MODE_BUS), 2)
        spoilt = NO_ANSWER.replace(b'\x83', b'\x86')
        assert rig.port.sent == [(pytest.approx(100.25), spoilt)], 'it keeps it to itself'
        assert rig.drives[0].control_unit.mode == 3, 'it is carried out'
        assert rig.notes == ['', note]


def test_a_late_or_double_answer_of_a_gateway_keeps_its_number():
    rig = Rig('modbus_tcp')
    rig.line.faults.add('delay', 1, seconds=0.5)
    rig.line.faults.add('double', 1)
    rig.ask(ModbusTcp.wrap(0x1234, 1, READ), 2)
    assert rig.heard == 2 * ModbusTcp.wrap(0x1234, 1, STOP)


# ---- faults by chance ----

FRAME = bytes(range(8))
MANY = 3000


def test_a_share_of_the_answers_is_spoiled_by_chance_and_by_the_seed():
    right = {
        'noise': lambda some: some[0].data != FRAME,
        'damage': lambda some: some[0].data != FRAME,
        'delay': lambda some: (some[0].data, some[0].delay) == (FRAME, 0.2),
        'drop': lambda some: some == [],
        'double': lambda some: [frame.data for frame in some] == [FRAME, FRAME],
    }
    for what, is_spoilt in right.items():
        fates = []
        for _ in range(2):
            faults = LineFaults()
            faults.set_rate(what, 0.1, seed=1, seconds=0.2)
            fates.append([faults.alter(1, FRAME) != [Reply(FRAME)] for _ in range(MANY)])
        assert fates[0] == fates[1], 'the same seed spoils the same'
        assert 0.08 * MANY < sum(fates[0]) < 0.12 * MANY, what
        found = [faults.alter(1, FRAME) for _ in range(MANY)]
        assert all(is_spoilt(some) for some in found if some != [Reply(FRAME)]), what
        faults.set_rate(what, 0.0)
        assert faults.alter(1, FRAME) == [Reply(FRAME)]
    faults.set_rate('double', 1.0)
    faults.set_rate('delay', 1.0, seconds=0.1)
    both = [Reply(FRAME, 0.1, 'delayed'), Reply(FRAME, 0.1, 'double, delayed')]
    assert faults.alter(1, FRAME) == both, 'of several each counts'


def test_bursts_come_again_until_all_is_healed():
    faults = LineFaults()
    faults.set_bursts(0.8, 5.0, now=100.0)
    moments = {100.1: False, 104.1: False, 104.3: True, 104.9: True, 105.1: False, 109.5: True}
    assert {now: faults.dead(now) for now in moments} == moments
    faults.set_rate('drop', 1.0)
    faults.add('damage', 100)
    faults.dead_until = 200.0
    faults.heal()
    assert not faults.dead(104.9) and faults.alter(1, FRAME) == [Reply(FRAME)]
    with pytest.raises(ValueError, match='never end'):
        faults.set_bursts(6.0, 5.0, now=0.0)
    for share in (-0.1, 1.1):
        with pytest.raises(ValueError, match='0 to 1'):
            faults.set_rate('drop', share)
