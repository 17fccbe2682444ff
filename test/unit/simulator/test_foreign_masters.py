# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Masters that this project did not write: they make sense of the simulated drives.

Ports are real here: the masters know no others.
"""

import queue
import re
import shutil
import socket
import struct
import subprocess
from types import SimpleNamespace

import can
import canopen
from canopen import objectdictionary
from canopen.sdo import SdoClient
from hypothesis import given, strategies as st
import minimalmodbus
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
import pytest
import serial

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.sdo import Server as SdoServer
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
            pymodbus_client(*one) for one in zip(protocols, simulator.ports[1:], strict=True)
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


# ---- CANopen: the libraries canopen and python-can ----

PLACED = [one for one in load_family('sinus_g2').values() if 'canopen' in one.addresses]
SETTINGS = [one for one in PLACED if one.is_setting and not one.key.startswith('serial.')]
#: The library's data types, by how many bytes and whether there is a sign.
TYPES = {
    (1, False): objectdictionary.UNSIGNED8,
    (1, True): objectdictionary.INTEGER8,
    (2, False): objectdictionary.UNSIGNED16,
    (4, False): objectdictionary.UNSIGNED32,
    (2, True): objectdictionary.INTEGER16,
    (4, True): objectdictionary.INTEGER32,
}


def variable(index, sub_index, data_type):
    found = objectdictionary.ODVariable(f'{index:04X}.{sub_index}', index, sub_index)
    found.data_type = data_type
    return found


def dictionary():
    """Return the objects of a G2 as the library wants them, by the tables."""
    found = objectdictionary.ObjectDictionary()
    arrays = {}
    for one in PLACED:
        place = one.at('canopen')
        what = TYPES[place.codec.size, place.number.signed]
        if place.sub_index is None:
            found.add_object(variable(place.index, 0, what))
        else:
            if place.index not in arrays:
                name = f'{place.index:04X}'
                arrays[place.index] = objectdictionary.ODRecord(name, place.index)
                found.add_object(arrays[place.index])
            arrays[place.index].add_member(variable(place.index, place.sub_index, what))
    for index, what in (
        (0x1000, objectdictionary.UNSIGNED32),
        (0x1001, objectdictionary.UNSIGNED8),
        (0x1008, objectdictionary.VISIBLE_STRING),
        (0x1017, objectdictionary.UNSIGNED16),
    ):
        found.add_object(variable(index, 0, what))
    return found


def test_canopen_commands_nodes_and_hears_them():
    with Simulator([1, 2], protocol='canopen', boot_time=0.3) as simulator:
        bus = can.Bus(
            interface='slcan', channel=simulator.port, bitrate=125_000, sleep_after_open=0.0
        )
        with canopen.Network(bus) as network:
            network.connect()
            first, node = (network.add_node(number, dictionary()) for number in (1, 2))
            first.sdo.RESPONSE_TIMEOUT = node.sdo.RESPONSE_TIMEOUT = PATIENCE
            it_commands(node, simulator)
            it_finds(network)
            it_sees_states(first, simulator)
            # a heartbeat of 127 every 0.2 s, of which there is one only
            first.sdo.download(0x1016, 1, struct.pack('<I', 127 << 16 | 200))
            network.send_message(0x77F, b'\x05')
            assert first.emcy.wait(0x8130, PATIENCE).register == 0x11


def it_commands(node, simulator):
    assert node.sdo[0x1000].raw == 0x10192
    assert node.sdo[0x1008].raw == 'NFO Sinus'
    assert struct.unpack('<I', node.sdo.upload(0x1018, 1))[0] == 0x1B
    assert node.sdo[0x2022].raw == 3, 'bus mode'
    node.sdo[0x207C].raw = 123
    node.sdo[0x2023].raw = 0x101
    state = simulator.state(2)
    assert state['setpoint'] == 12.3 and state['scmd'] == 0x101
    assert not simulator.state(1)['turning']
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo.upload(0x2FFF, 0)
    assert refused.value.code == 0x06020000
    with pytest.raises(canopen.SdoAbortedError) as refused:
        node.sdo[0x2024].raw = 9
    assert refused.value.code == 0x06090030
    node.sdo[0x2023].raw = 0


def it_finds(network):
    heard = queue.SimpleQueue()
    for number in (1, 2):
        # after its client, which would take them for answers to what it asks
        network.subscribe(0x580 + number, lambda identifier, *_: heard.put(identifier))
    network.scanner.search(3)
    assert {heard.get(timeout=PATIENCE) for _ in range(2)} == {0x581, 0x582}
    assert sorted(network.scanner.nodes) == [1, 2]


def it_sees_states(node, simulator):
    states = []
    node.nmt.add_heartbeat_callback(states.append)
    node.sdo[0x1017].raw = 50
    assert node.nmt.wait_for_heartbeat(PATIENCE) == 'PRE-OPERATIONAL'
    node.nmt.state = 'OPERATIONAL'
    while node.nmt.wait_for_heartbeat(PATIENCE) != 'OPERATIONAL':
        continue
    assert states[-1] == 5
    simulator.inject('power-cycle', 0.3, address=1)
    node.nmt.wait_for_bootup(PATIENCE)
    assert node.sdo[0x1017].raw == 0


class Here(SdoClient):
    """The library's client, whose messages are answered at once, without a line."""

    def __init__(self, answer):
        super().__init__(0x601, 0x581, objectdictionary.ObjectDictionary())
        self.network = SimpleNamespace(send_message=self._send)
        self._answer = answer
        self.RESPONSE_TIMEOUT = 0.01

    def _send(self, identifier, data):
        if answer := self._answer(bytes(data)):
            self.on_response(0x581, answer, 0.0)


class Bytes:
    """One object of bytes."""

    def __init__(self, value):
        self.value = value

    def read(self, index, sub_index):
        return self.value

    def admit(self, index, sub_index, size):
        return len(self.value)

    def write(self, index, sub_index, data):
        self.value = data


@given(st.binary(max_size=300), st.booleans())
def test_its_client_reads_and_writes_any_value(value, segments):
    objects = Bytes(value)
    client = Here(SdoServer(objects).answer)
    assert client.upload(0x2000, 0) == value
    objects.value = bytes(len(value))
    if value:
        client.download(0x2000, 0, value, force_segment=segments)
        assert objects.value == value


DRIVE = simulated_drive('sinus_g2')


def asked(data):
    answers = list(DRIVE.servers['canopen'].receive(Frame(0x601, data), 0.0))
    return answers[0].data if answers else b''


@given(st.sampled_from(SETTINGS), st.data())
def test_what_its_client_writes_is_what_the_drive_has(parameter, data):
    place = parameter.at('canopen')
    raw = data.draw(
        st.sampled_from(sorted(map(int, parameter.labels)))
        if parameter.labels
        else st.integers(place.number.minimum, place.number.maximum)
    )
    client, where = Here(asked), (place.index, place.sub_index or 0)
    number = client.upload(*where)
    assert parameter.decode(number, 'canopen') == pytest.approx(DRIVE.peek(parameter.key))
    what = variable(*where, TYPES[place.codec.size, place.number.signed])
    try:
        client.download(*where, what.encode_raw(raw))
    except canopen.SdoAbortedError as refused:
        assert refused.code == 0x06090030
        assert client.upload(*where) == number
    else:
        assert what.decode_raw(client.upload(*where)) == raw
        shown = parameter.decode(what.encode_raw(raw), 'canopen')
        # Modbus, whose numbers the drive keeps, may be coarser
        expected = pytest.approx(shown, abs=0.51) if parameter.kind is float else shown
        assert DRIVE.peek(parameter.key) == expected


def test_its_client_reads_every_parameter_that_can_be_read():
    client = Here(asked)
    for one in PLACED:
        place = one.at('canopen')
        # "not yet implemented" [M0 table 11]
        refusal = 0x06020000 if place.index in (0x6076, 0x6087) else 0x06010001
        if one.access is Access.WRITE or refusal == 0x06020000:
            with pytest.raises(canopen.SdoAbortedError) as refused:
                client.upload(place.index, place.sub_index or 0)
            assert refused.value.code == refusal
        else:
            assert len(client.upload(place.index, place.sub_index or 0)) == place.codec.size
