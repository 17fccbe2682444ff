# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Masters that this project did not write: they make sense of the simulated drives.

Ports are real here: the masters know no others.
"""

import re
import shutil
import socket
import subprocess

from pymodbus.client import ModbusSerialClient, ModbusTcpClient
import pytest
import serial

from nfo_sinus_driver.simulator.simulator import Simulator

try:
    from pymodbus.framer import Framer as FramerType
except ImportError:
    from pymodbus import FramerType

ACCEL = 0x27E
#: Generous: nothing here is about speed.
PATIENCE = 10.0
# its name changed with pymodbus 3.10
_NAMES = ModbusTcpClient.read_holding_registers.__kwdefaults__ or {}
UNIT = {'device_id': 1} if 'device_id' in _NAMES else {'slave': 1}

# ---- Modbus ----


def pymodbus_client(protocol, port):
    if protocol == 'modbus_tcp':
        host, _, number = port.partition(':')
        client = ModbusTcpClient(host, port=int(number), timeout=PATIENCE)
    else:
        framer = FramerType.RTU if protocol == 'modbus_rtu' else FramerType.ASCII
        client = ModbusSerialClient(port, framer=framer, timeout=PATIENCE)
    assert client.connect()
    return client


def test_pymodbus_reads_and_writes_one_drive_by_every_protocol():
    protocols = ('modbus_rtu', 'modbus_ascii', 'modbus_tcp')
    with Simulator(protocol='classic', also=protocols) as simulator:
        clients = [
            pymodbus_client(*place) for place in zip(protocols, simulator.ports[1:], strict=True)
        ]
        for tenths, writer in enumerate(clients, 50):
            assert not writer.write_registers(ACCEL, [100 * tenths, 0], **UNIT).isError()
            for reader in clients:
                answer = reader.read_holding_registers(ACCEL, count=2, **UNIT)
                assert not answer.isError() and answer.registers == [100 * tenths, 0]
        state = simulator.state()
        assert state['parameters']['control.accel'] == 5.2
        assert state['writes'] == {'control.accel': 3}
        for client in clients:
            client.close()


def test_pymodbus_reads_an_optimal():
    with Simulator(model='sinus_optimal') as simulator:
        client = pymodbus_client('modbus_rtu', simulator.port)
        assert client.read_holding_registers(0x2A5, count=1, **UNIT).registers == [24]
        assert client.read_input_registers(0x2A5, count=1, **UNIT).registers == [24]
        assert client.read_holding_registers(ACCEL, count=2, **UNIT).isError()
        client.close()


@pytest.mark.parametrize('mode', ['rtu', 'ascii'])
def test_minimalmodbus(mode):
    minimalmodbus = pytest.importorskip('minimalmodbus', reason='minimalmodbus is not installed')
    with Simulator(protocol=f'modbus_{mode}') as simulator:
        instrument = minimalmodbus.Instrument(simulator.port, 1, mode)
        instrument.serial.timeout = PATIENCE
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
            place, _, port = simulator.port.partition(':')
            way = ['-m', 'tcp', '-p', port]
        else:
            way, place = ['-m', 'rtu', '-b', '19200', '-P', 'even'], simulator.port

        def mbpoll(register, type_, *values):
            # once, and registers are counted from 0
            command = ['mbpoll', '-1', '-0', '-a', '1', '-o', str(PATIENCE), '-t', f'4{type_}']
            command += [*way, '-r', str(register), place, *map(str, values)]
            done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
            return done.stdout + done.stderr

        assert re.search(r'\[660\]:\s+1\b', mbpoll(0x294, '')), 'MODE'
        # 32 bits have their low word first
        mbpoll(ACCEL, ':int', 70_000)
        assert simulator.state()['parameters']['control.accel'] == 70.0
        assert re.search(r'\[638\]:\s+70000\b', mbpoll(ACCEL, ':int'))
        assert 'Illegal' in mbpoll(0, '')


def test_a_socket_speaks_to_a_gateway():
    with (
        Simulator(protocol='modbus_tcp', gateway_timeout=0.1) as simulator,
        socket.create_connection(simulator.port.split(':'), timeout=PATIENCE) as master,
    ):

        def ask(request):
            master.sendall(bytes.fromhex(request))
            return master.recv(100).hex()

        assert ask('0001 0000 0006 01 03 0294 0001') == '0001000000050103020001'
        assert ask('0002 0000 0006 02 03 0294 0001') == '00020000000302830a'
        simulator.inject('silence', 60)
        assert ask('0003 0000 0006 01 03 0294 0001') == '00030000000301830b'


def test_pyserial_with_seven_bits_and_parity_speaks_classic():
    with (
        Simulator(protocol='classic') as simulator,
        serial.Serial(simulator.port, 9600, 7, 'E', 1, timeout=PATIENCE) as line,
    ):
        line.write(b'\x04!E0029\x05')
        assert line.read(14) == b'!\x02E0029=0001\x03q'
