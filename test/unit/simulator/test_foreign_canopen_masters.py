# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The libraries canopen and python-can, as masters, make sense of the simulated drives."""

import queue
import struct
from types import SimpleNamespace

import can
from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.sdo import Server as SdoServer
from nfo_sinus_driver.simulator.simulator import Simulator

canopen = pytest.importorskip('canopen', reason='canopen is not installed')
objectdictionary = canopen.objectdictionary
SdoClient = canopen.sdo.SdoClient

#: Generous: nothing here is about speed.
PATIENCE = 10.0

PLACED = [row for row in load_family('sinus_g2').values() if 'canopen' in row.addresses]
SETTINGS = [row for row in PLACED if row.is_setting and not row.key.startswith('serial.')]
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
    for parameter in PLACED:
        place = parameter.at('canopen')
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


def test_canopen_commands_nodes_and_receives_their_frames():
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

    def validate(self, index, sub_index, size):
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
    for parameter in PLACED:
        place = parameter.at('canopen')
        # "not yet implemented" [M0 table 11]
        refusal = 0x06020000 if place.index in (0x6076, 0x6087) else 0x06010001
        if parameter.access is Access.WRITE or refusal == 0x06020000:
            with pytest.raises(canopen.SdoAbortedError) as refused:
                client.upload(place.index, place.sub_index or 0)
            assert refused.value.code == refusal
        else:
            assert len(client.upload(place.index, place.sub_index or 0)) == place.codec.size
