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
"""The library canopen as a foreign master: it makes sense of the simulated node."""

from __future__ import annotations

from collections.abc import Iterator
import queue
import struct
from types import SimpleNamespace

import can
import canopen
from canopen import objectdictionary
from canopen.sdo import SdoClient
from hypothesis import given
from hypothesis import strategies as st
import pytest

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.canopen import Server
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.sdo import Server as SdoServer
from nfo_sinus_driver.simulator.simulator import Simulator

MODEL = load_family('sinus_g2')
PLACED = [one for one in MODEL.values() if 'canopen' in one.addresses]
SETTINGS = [one for one in PLACED if one.is_setting and not one.key.startswith('serial.')]
#: The library's data types, by how many bytes and whether there is a sign.
TYPES = {
    (1, False): objectdictionary.UNSIGNED8,
    (2, False): objectdictionary.UNSIGNED16,
    (4, False): objectdictionary.UNSIGNED32,
    (2, True): objectdictionary.INTEGER16,
    (4, True): objectdictionary.INTEGER32,
}
#: Generous: nothing here is about speed.
PATIENCE = 10.0


def variable(index: int, sub_index: int, data_type: int) -> objectdictionary.ODVariable:
    found = objectdictionary.ODVariable(f'{index:04X}.{sub_index}', index, sub_index)
    found.data_type = data_type
    return found


def dictionary() -> objectdictionary.ObjectDictionary:
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
                arrays[place.index] = objectdictionary.ODRecord(
                    f'{place.index:04X}', place.index
                )
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


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator([1, 2], protocol='canopen', boot_time=0.3) as simulator:
        yield simulator


@pytest.fixture
def network(simulator: Simulator) -> Iterator[canopen.Network]:
    bus = can.Bus(
        interface='slcan', channel=simulator.port, bitrate=125_000, sleep_after_open=0.0
    )
    with canopen.Network(bus) as network:
        network.connect()
        yield network


def node_of(network: canopen.Network, number: int) -> canopen.RemoteNode:
    node = network.add_node(number, dictionary())
    node.sdo.RESPONSE_TIMEOUT = PATIENCE
    return node


def test_it_commands_a_drive(simulator: Simulator, network: canopen.Network) -> None:
    node = node_of(network, 2)
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


def test_it_sees_boot_up_heartbeat_and_states(
    simulator: Simulator, network: canopen.Network
) -> None:
    node = node_of(network, 1)
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


def test_it_finds_the_nodes(network: canopen.Network) -> None:
    heard: queue.SimpleQueue[int] = queue.SimpleQueue()
    nodes = [node_of(network, number) for number in (1, 2)]
    for number in (1, 2):
        # after its client, which would take them for answers to what it asks
        network.subscribe(0x580 + number, lambda identifier, *_: heard.put(identifier))
    network.scanner.search(3)
    assert {heard.get(timeout=PATIENCE) for _ in nodes} == {0x581, 0x582}
    assert [node.sdo[0x1001].raw for node in nodes] == [0, 0]
    assert sorted(network.scanner.nodes) == [1, 2]


def test_it_hears_an_emergency(simulator: Simulator, network: canopen.Network) -> None:
    node = node_of(network, 1)
    # a heartbeat of 127 every 0.2 s, of which there is one only
    node.sdo.download(0x1016, 1, struct.pack('<I', 127 << 16 | 200))
    network.send_message(0x77F, b'\x05')
    assert node.emcy.wait(0x8130, PATIENCE).register == 0x11


# ---- without a line: its client and our server ----


class Here(SdoClient):
    """The library's client, whose messages are answered at once."""

    def __init__(self, server: SdoServer) -> None:
        super().__init__(0x601, 0x581, objectdictionary.ObjectDictionary())
        self.network = SimpleNamespace(send_message=self._send)
        self._server = server
        self.RESPONSE_TIMEOUT = 0.01

    def _send(self, identifier: int, data: bytes) -> None:
        if answer := self._server.answer(bytes(data)):
            self.on_response(0x581, answer, 0.0)


class Bytes:
    """One object of bytes."""

    def __init__(self, value: bytes) -> None:
        self.value = value

    def read(self, index: int, sub_index: int) -> bytes:
        return self.value

    def admit(self, index: int, sub_index: int, size: int | None) -> int:
        return len(self.value)

    def write(self, index: int, sub_index: int, data: bytes) -> None:
        self.value = data


@given(st.binary(max_size=300), st.booleans())
def test_its_client_reads_and_writes_any_value(value: bytes, segments: bool) -> None:
    objects = Bytes(value)
    client = Here(SdoServer(objects))
    assert client.upload(0x2000, 0) == value
    objects.value = bytes(len(value))
    if value:
        client.download(0x2000, 0, value, force_segment=segments)
        assert objects.value == value


def asked(drive: Server, data: bytes) -> bytes:
    answers = list(drive.receive(Frame(0x601, data), 0.0))
    return answers[0].data if answers else b''


DRIVE = simulated_drive('sinus_g2')


@given(st.sampled_from(SETTINGS), st.data())
def test_what_it_writes_is_what_the_drive_has(parameter, data: st.DataObject) -> None:
    place = parameter.at('canopen')
    low, high = place.number.minimum, place.number.maximum
    raw = data.draw(
        st.sampled_from(sorted(map(int, parameter.labels)))
        if parameter.labels
        else st.integers(low, high)
    )
    node = DRIVE.servers['canopen']
    client = Here(SimpleNamespace(answer=lambda request: asked(node, request)))
    number = client.upload(place.index, place.sub_index or 0)
    assert parameter.decode(number, 'canopen') == pytest.approx(DRIVE.peek(parameter.key))
    what = variable(place.index, place.sub_index or 0, TYPES[place.codec.size, place.number.signed])
    try:
        client.download(place.index, place.sub_index or 0, what.encode_raw(raw))
    except canopen.SdoAbortedError as refused:
        assert refused.code == 0x06090030
        assert client.upload(place.index, place.sub_index or 0) == number
    else:
        assert what.decode_raw(client.upload(place.index, place.sub_index or 0)) == raw
        shown = parameter.decode(what.encode_raw(raw), 'canopen')
        if parameter.kind is float:
            # Modbus, whose numbers the drive keeps, may be coarser
            assert DRIVE.peek(parameter.key) == pytest.approx(shown, abs=0.51)
        else:
            assert DRIVE.peek(parameter.key) == shown


def test_every_parameter_that_can_be_read_is_read() -> None:
    node = simulated_drive('sinus_g2').servers['canopen']
    client = Here(SimpleNamespace(answer=lambda request: asked(node, request)))
    for one in PLACED:
        place = one.at('canopen')
        if one.access is Access.WRITE:
            with pytest.raises(canopen.SdoAbortedError) as refused:
                client.upload(place.index, place.sub_index or 0)
            assert refused.value.code == 0x06010001
        else:
            assert len(client.upload(place.index, place.sub_index or 0)) == place.codec.size
