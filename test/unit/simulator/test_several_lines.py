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

"""The running simulator by every protocol, and the same drive by several, to other masters."""

import json
import os
from pathlib import Path
import re
import shutil
import socket
import subprocess
import sys

from classic_bench import ACK
from classic_bench import NAK
from classic_bench import enquiry
from classic_bench import reply
from classic_bench import select as select_
import minimalmodbus
from pymodbus.client import ModbusSerialClient
from pymodbus.client import ModbusTcpClient
import pytest
import serial

from nfo_sinus_driver.simulator.main import main
from nfo_sinus_driver.simulator.modbus_frames import ModbusTcp
from nfo_sinus_driver.simulator.ports import PortError
from nfo_sinus_driver.simulator.simulator import Simulator

try:
    from pymodbus.framer import Framer as FramerType
except ImportError:
    from pymodbus import FramerType

ROOT = Path(__file__).parents[3]
PROTOCOLS = ('modbus_rtu', 'modbus_ascii', 'modbus_tcp', 'classic')
ACCEL = 0x27E
READ_MODE = bytes.fromhex('0302940001')
READ_INV_ST = bytes.fromhex('0302A50001')
TIMEOUT = 5.0


class Master:
    """Reads and writes Accel in 0.1 s, by any protocol, each in its own way."""

    def __init__(self, protocol, port):
        self.protocol = protocol
        if protocol == 'modbus_tcp':
            host, _, number = port.partition(':')
            self.client = ModbusTcpClient(host, port=int(number), timeout=TIMEOUT)
        elif protocol == 'classic':
            self.line = serial.Serial(port, timeout=TIMEOUT)
            return
        else:
            framer = FramerType.RTU if protocol == 'modbus_rtu' else FramerType.ASCII
            self.client = ModbusSerialClient(port, framer=framer, timeout=TIMEOUT)
        assert self.client.connect()

    def read(self):
        if self.protocol == 'classic':
            self.line.write(enquiry('E001D'))
            return int(self.line.read(14)[8:12], 16)
        return self._words(self.client.read_holding_registers(ACCEL, count=2, **self._unit()))

    def write(self, tenths):
        if self.protocol == 'classic':
            self.line.write(select_('E001D', tenths))
            assert self.line.read(2) == ACK
            return
        words = [100 * tenths & 0xFFFF, 100 * tenths >> 16]
        assert not self.client.write_registers(ACCEL, words, **self._unit()).isError()

    def close(self):
        (self.line if self.protocol == 'classic' else self.client).close()

    def _words(self, answer):
        assert not answer.isError(), answer
        low, high = answer.registers
        return (high << 16 | low) // 100

    def _unit(self):
        # its name changed with pymodbus 3.10
        names = ModbusTcpClient.read_holding_registers.__kwdefaults__ or {}
        return {'device_id': 1} if 'device_id' in names else {'slave': 1}


@pytest.fixture
def master():
    masters = []

    def master_(protocol, port):
        masters.append(Master(protocol, port))
        return masters[-1]

    yield master_
    for one in masters:
        one.close()


@pytest.mark.parametrize('first', PROTOCOLS)
def test_one_drive_by_every_protocol(first, master):
    others = [name for name in PROTOCOLS if name != first]
    with Simulator(protocol=first, also=others) as simulator:
        assert simulator.port == simulator.ports[0]
        masters = [
            master(*one) for one in zip((first, *others), simulator.ports, strict=True)
        ]
        for number, writer in enumerate(masters):
            writer.write(50 + number)
            assert [reader.read() for reader in masters] == [50 + number] * 4
        state = simulator.state()
        assert state['parameters']['control.accel'] == 5.3
        assert state['writes'] == {'control.accel': 4}
        simulator.inject('set', 'control.accel', 6.1)
        assert [reader.read() for reader in masters] == [61] * 4


@pytest.mark.parametrize('protocol', ['modbus_rtu', 'modbus_ascii', 'modbus_tcp'])
def test_the_optimal(protocol, master):
    with Simulator(model='sinus_optimal', protocol=protocol) as simulator:
        client = master(protocol, simulator.port).client
        unit = Master._unit(None)
        answer = client.read_holding_registers(0x2A5, count=1, **unit)
        assert answer.registers == [24]
        assert client.read_holding_registers(ACCEL, count=2, **unit).isError()


def test_control_taken_by_one_is_seen_by_the_other(folder, open_master):
    links = [str(folder / name) for name in ('nfo0', 'nfo1')]
    with Simulator(protocol='classic', link=links[0], also=[f'modbus_rtu:{links[1]}']) as simulator:
        assert simulator.ports == tuple(links)
        with serial.Serial(links[0], timeout=TIMEOUT) as classic:
            modbus = open_master(links[1])
            for write in ('0602940003', '0603FC00FA'):
                assert len(modbus.ask(1, bytes.fromhex(write), 8)) == 8
            classic.write(enquiry('E001E'))
            assert classic.read(14) == reply('E001E', 250)
            classic.write(select_('E00AD', 0x101))
            assert classic.read(2) == ACK
            assert modbus.ask(1, READ_INV_ST, 7)[4] in (38, 39)
            classic.write(enquiry('EFFFF'))
            assert classic.read(2) == NAK
            assert modbus.ask(1, READ_INV_ST, 7)[4] == 14
            assert modbus.ask(1, READ_MODE, 7)[4] == 1


@pytest.mark.parametrize('mode', ['rtu', 'ascii'])
def test_minimalmodbus(mode):
    with Simulator(protocol=f'modbus_{mode}') as simulator:
        instrument = minimalmodbus.Instrument(simulator.port, 1, mode)
        instrument.serial.timeout = TIMEOUT
        low_word_first = minimalmodbus.BYTEORDER_LITTLE_SWAP
        instrument.write_long(ACCEL, 70_000, byteorder=low_word_first)
        assert instrument.read_long(ACCEL, byteorder=low_word_first) == 70_000
        # it waits for all that a reading would bring
        instrument.serial.timeout = 0.2
        with pytest.raises(minimalmodbus.IllegalRequestError):
            instrument.read_register(0)
        instrument.serial.close()


@pytest.mark.skipif(shutil.which('mbpoll') is None, reason='mbpoll is not installed')
@pytest.mark.parametrize('protocol', ['modbus_rtu', 'modbus_tcp'])
def test_mbpoll(protocol):
    """It has no Modbus ASCII, for libmodbus has none: minimalmodbus and pymodbus speak that."""
    with Simulator(protocol=protocol) as simulator:
        if protocol == 'modbus_tcp':
            host, _, port = simulator.port.partition(':')
            way, place = ['-m', 'tcp', '-p', port], host
        else:
            way, place = ['-m', 'rtu', '-b', '19200', '-P', 'even'], simulator.port

        def mbpoll(register, type_, *values):
            # once, and registers are counted from 0
            command = ['mbpoll', '-1', '-0', '-a', '1', '-o', str(TIMEOUT), '-t', f'4{type_}']
            command += [*way, '-r', str(register), place, *map(str, values)]
            done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
            return done.returncode, done.stdout + done.stderr

        status, said = mbpoll(0x294, '')
        assert status == 0, said
        assert re.search(r'\[660\]:\s+1\b', said), 'MODE'
        # 32 bits have their low word first
        status, said = mbpoll(ACCEL, ':int', 70_000)
        assert status == 0, said
        assert simulator.state()['parameters']['control.accel'] == 70.0
        status, said = mbpoll(ACCEL, ':int')
        assert re.search(r'\[638\]:\s+70000\b', said), said
        _, said = mbpoll(0, '')
        assert 'Illegal' in said, said


def test_a_gateway_in_real_time():
    with Simulator([1], protocol='modbus_tcp', gateway_timeout=0.1) as simulator:
        host, _, port = simulator.port.partition(':')
        with socket.create_connection((host, int(port)), timeout=TIMEOUT) as master:

            def ask(transaction, unit, pdu=READ_MODE):
                master.sendall(ModbusTcp.wrap(transaction, unit, pdu))
                return master.recv(100)

            assert ask(1, 1).hex() == '0001000000050103020001'
            assert ask(2, 2).hex() == '00020000000302830a'
            simulator.inject('silence', 60)
            assert ask(3, 1).hex() == '00030000000301830b'


def test_every_line_is_looked_after(master):
    with Simulator(protocol='classic', also=['modbus_tcp:0', 'modbus_rtu']) as simulator:
        one, other = map(master, ('modbus_tcp', 'modbus_rtu'), simulator.ports[1:])
        assert one.read() == 50
        simulator.inject('hangup', 60)
        assert other.read() == 50, 'a hang-up is of the first line'


def test_an_echo_in_real_time(open_master, make_frame):
    with Simulator(echo=True, also=['classic']) as simulator:
        master = open_master(simulator.port)
        frame = make_frame(1, READ_MODE)
        assert master.ask(1, READ_MODE, 15) == frame + bytes.fromhex('01030200017984')
        other = open_master(simulator.ports[1])
        other.send(enquiry('E0029'))
        assert other.receive(14) == reply('E0029', 1)


def test_a_trace_of_each_line(folder, open_master):
    trace = folder / 'trace'
    with Simulator(trace=str(trace), also=['classic']) as simulator:
        other = open_master(simulator.ports[1])
        other.send(enquiry('E0029'))
        other.receive(14)
    assert trace.read_text() == ''
    frames = [json.loads(line) for line in (folder / 'trace.2').read_text().splitlines()]
    assert [frame['direction'] for frame in frames] == ['request', 'answer']
    assert frames[0]['hex'] == enquiry('E0029').hex()


def test_the_format_is_the_protocols(open_master):
    timings = {}
    for protocol in PROTOCOLS:
        with Simulator(protocol=protocol) as simulator:
            timings[protocol] = (simulator.timing.baud, simulator.timing.char_format)
            assert simulator.state()['parameters']['serial.bus_type'] == {
                'modbus_rtu': 'MbusRtu',
                'modbus_ascii': 'MbusAsc',
                'modbus_tcp': 'MbusRtu',
                'classic': 'NFO',
            }[protocol]
    assert timings == {
        'modbus_rtu': (19200, '8E1'),
        'modbus_ascii': (19200, '7E1'),
        'modbus_tcp': (19200, '8E1'),
        'classic': (9600, '7E1'),
    }


def test_a_master_that_sets_seven_bits_and_parity_is_heard():
    with (
        Simulator(protocol='classic') as simulator,
        serial.Serial(simulator.port, 9600, 7, 'E', 1, timeout=TIMEOUT) as line,
    ):
        line.write(enquiry('E0029'))
        assert line.read(14) == reply('E0029', 1)


@pytest.mark.parametrize(
    ('options', 'text'),
    [
        ({'protocol': 'classic', 'addresses': (95,)}, '1 to 94'),
        ({'also': ['classic'], 'addresses': (95,)}, '1 to 94'),
        ({'protocol': 'classic', 'model': 'sinus_optimal'}, 'does not speak classic'),
        ({'also': ['classic'], 'model': 'sinus_optimal'}, 'does not speak classic'),
        ({'protocol': 'modbus_ascii', 'char_format': '8E1'}, '7 data bits'),
        ({'protocol': 'modbus_tcp', 'link': '/tmp/x'}, 'needs a TCP port'),
        ({'protocol': 'modbus_tcp', 'echo': True}, 'has no echo'),
        ({'protocol': 'classic', 'dialect': '5.0', 'baud': 19200}, '9600 at most'),
        ({'protocol': 'classic', 'dialect': '5.0', 'char_format': '8E1'}, '7E1, 8N1'),
        ({'protocol': 'classic', 'char_format': '8N1'}, '8N2'),
        ({'char_format': '8N1'}, '8N2'),
        ({'dialect': '4.0'}, '2.03, 5.0'),
        ({'dialect': '5.0', 'settings': {'fieldbus.sw_ver': 4.38}}, 'not that of firmware'),
        ({'dialect': '5.0', 'model': 'sinus_optimal'}, 'no option dialect'),
        ({'also': ['profinet']}, 'choose one of modbus_rtu'),
        ({'also': ['modbus_tcp:/tmp/x']}, 'needs a TCP port'),
        ({'also': ['modbus_tcp:70000']}, '65535'),
    ],
)
def test_impossible_simulators(options, text):
    with pytest.raises(ValueError, match=text):
        Simulator(**options)


@pytest.mark.parametrize(
    ('options', 'firmware'),
    [
        ({}, 4.38),
        ({'dialect': '2.03'}, 4.38),
        ({'dialect': '5.0'}, 4.21),
        ({'dialect': '5.0', 'settings': {'fieldbus.sw_ver': 4.27}}, 4.27),
        ({'settings': {'fieldbus.sw_ver': 4.27}}, 4.27),
    ],
)
def test_dialect_and_firmware(options, firmware, open_master):
    with Simulator(protocol='classic', **options) as simulator:
        assert simulator.state()['parameters']['fieldbus.sw_ver'] == firmware
        master = open_master(simulator.port)
        master.send(enquiry('E0029', 0))
        new = firmware > 4.27
        assert master.receive(14) == reply('E0029', 1, 0 if new else 1)


def test_what_was_opened_is_closed_when_another_line_cannot_be(folder):
    link = folder / 'nfo0'
    (folder / 'file').write_text('precious')
    with pytest.raises(PortError, match='no link of a simulator'):
        Simulator(link=str(link), also=[f'classic:{folder / "file"}'])
    assert not os.path.lexists(link)


def test_sio_errors_and_torn_counters_on_request(open_master):
    with Simulator(protocol='classic') as simulator:
        master = open_master(simulator.port)
        simulator.inject('sio-error', 1)
        assert simulator.state()['sio_err'] == 2
        assert simulator.state()['fault'] == 0
        for frame in (select_('E0029', 3), enquiry('E0127'), enquiry('E00AC')):
            simulator.inject('torn')
            master.send(frame)
            master.receive(2 if frame[2] == 2 else 14)
        assert simulator.state()['parameters']['status.op_time'] == 6553.6
        assert simulator.state()['sio_err_reads'] == 1
        simulator.inject('sio-error', 14)
        assert simulator.state()['fault'] == 14
        assert simulator.state()['mode'] == 1
        with pytest.raises(ValueError, match='no bit 12'):
            simulator.inject('sio-error', 12)


# ---- the command ----


@pytest.fixture
def start(folder):
    # the folder goes after what runs in it, which may put something there until its end
    running = []

    def start_(*arguments):
        command = [sys.executable, '-m', 'nfo_sinus_driver.simulator', *arguments]
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
        running.append(process)
        return process.stdout.readline().rstrip('\n')

    yield start_
    for process in running:
        process.terminate()
        try:
            process.communicate(timeout=5)
        finally:
            process.kill()


def test_the_command(start, folder, open_master):
    links = [str(folder / name) for name in ('nfo0', 'nfo1')]
    line = start(
        *('--protocol', 'classic', '--link', links[0], '--also', f'modbus_ascii:{links[1]}'),
        *('--also', 'modbus_tcp:0', '--dialect', '5.0', '--lenient', '--echo', '--paced'),
        *('--gateway-timeout', '0.5'),
    )
    assert re.fullmatch(
        f'serving classic at 9600 7E1 on {links[0]}, drive 1; control {links[0]}.control; '
        rf'also modbus_ascii at 19200 7E1 on {links[1]}; '
        r'also modbus_tcp at 19200 8E1 on 127\.0\.0\.1:\d+',
        line,
    )
    master = open_master(links[0])
    master.send(enquiry('E0029', 0))
    assert master.receive(22) == enquiry('E0029', 0) + reply('E0029', 1, 1)
    other = open_master(links[1])
    other.send(b':01030294000165\r\n')
    assert other.receive(15) == b':0103020001F9\r\n'


def test_modbus_tcp_needs_no_port(start, capsys):
    line = start('--protocol', 'modbus_tcp')
    port = re.search(r'serving modbus_tcp at 19200 8E1 on 127\.0\.0\.1:(\d+), drive 1;', line)[1]
    assert main(['inject', '--tcp', port, 'sio-error', '4']) == 0
    assert main(['inject', '--tcp', port, 'torn']) == 0
    assert main(['inject', '--tcp', port, 'state']) == 0
    assert json.loads(capsys.readouterr().out)['1']['sio_err'] == 16


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (['--protocol', 'classic', '--address', '100'], '1 to 94'),
        (['--also', 'bus:1'], 'choose one of'),
        (['--dialect', '3'], '2.03'),
        (['--protocol', 'classic', '--baud-rate', '57600', '--dialect', '5.0'], '9600 at most'),
        (['--protocol', 'modbus_tcp', '--link', 'x'], 'needs a TCP port'),
    ],
)
def test_wrong_arguments(capsys, arguments, text):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 2
    assert text in capsys.readouterr().err
