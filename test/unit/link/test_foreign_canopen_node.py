# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""The library canopen as a foreign node: the driver's link makes sense of it."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.interface import Address, LineSettings, Refused

canopen = pytest.importorskip('canopen', reason='canopen is not installed')
objectdictionary = canopen.objectdictionary

UNIT = 5
NUMBERS = {
    0x2001: objectdictionary.UNSIGNED8,
    0x2002: objectdictionary.UNSIGNED16,
    0x2004: objectdictionary.UNSIGNED32,
    0x2012: objectdictionary.INTEGER16,
    0x2014: objectdictionary.INTEGER32,
    0x2008: objectdictionary.UNSIGNED64,
}
TEXT, READ_ONLY, WRITE_ONLY, ARRAY = 0x2020, 0x2021, 0x2022, 0x2023


def dictionary() -> objectdictionary.ObjectDictionary:
    found = objectdictionary.ObjectDictionary()
    kinds = {
        **NUMBERS,
        TEXT: objectdictionary.OCTET_STRING,
        READ_ONLY: objectdictionary.UNSIGNED16,
        WRITE_ONLY: objectdictionary.UNSIGNED16,
        0x1000: objectdictionary.UNSIGNED32,
        0x1001: objectdictionary.UNSIGNED8,
    }
    for index, kind in kinds.items():
        variable = objectdictionary.ODVariable(f'{index:04X}', index)
        variable.data_type = kind
        variable.default = 0 if kind != objectdictionary.OCTET_STRING else b''
        variable.access_type = {READ_ONLY: 'ro', WRITE_ONLY: 'wo'}.get(index, 'rw')
        found.add_object(variable)
    array = objectdictionary.ODRecord('array', ARRAY)
    for sub_index in (0, 1, 2):
        member = objectdictionary.ODVariable(f'member {sub_index}', ARRAY, sub_index)
        member.data_type = objectdictionary.INTEGER16
        member.default = 10 * sub_index
        array.add_member(member)
    found.add_object(array)
    return found


class Bridge:
    """A port of the link with the library's node on it; what it says is heard at once."""

    trouble = remark = ''

    def __init__(self) -> None:
        self.node = canopen.LocalNode(UNIT, dictionary())
        self._heard: list[Frame] = []
        network = canopen.Network()
        network.send_message = self._receive  # type: ignore[method-assign]
        network.send_periodic = self._repeated  # type: ignore[method-assign]
        self._network = network
        network.add_node(self.node)

    def _receive(self, identifier: int, data: bytes, remote: bool = False) -> None:
        self._heard.append(Frame(identifier, bytes(data)))

    def _repeated(self, *_: object, **__: object) -> SimpleNamespace:
        return SimpleNamespace(stop=lambda: None, update=lambda data: None)

    def open(self) -> None:
        """Nothing to open."""

    def close(self) -> None:
        """Nothing to close."""

    def send(self, frame: Frame) -> None:
        self._network.notify(frame.identifier, bytearray(frame.data), 0.0)

    def receive(self, until: float) -> Sequence[Frame]:
        frames, self._heard = self._heard, []
        return frames


def linked() -> tuple[CanopenLink, canopen.LocalNode]:
    bridge = Bridge()
    link = CanopenLink(bridge, LineSettings(baud_rate=125_000, response_timeout=0.05))
    link.open()
    return link, bridge.node


def at(index: int, sub_index: int | None = None, size: int = 2) -> Address:
    return Address('object', index, sub_index, size)


@given(st.data(), st.sampled_from(sorted(NUMBERS)))
def test_numbers_both_ways(data: st.DataObject, index: int) -> None:
    link, node = linked()
    variable = node.object_dictionary[index]
    size = len(variable) // 8
    value = data.draw(st.binary(min_size=size, max_size=size))
    link.write(UNIT, at(index, size=size), value)
    assert node.get_data(index, 0) == value
    assert link.read(UNIT, at(index, size=size)).data == value


@given(st.binary(min_size=1, max_size=200))
def test_values_of_any_length_both_ways(value: bytes) -> None:
    link, node = linked()
    link.write(UNIT, at(TEXT, size=200), value)
    assert node.data_store[TEXT][0] == value
    assert link.read(UNIT, at(TEXT, size=200)).data == value


@given(st.binary(max_size=4), st.sampled_from(sorted(NUMBERS)))
def test_a_wrong_length_is_refused_and_reported(value: bytes, index: int) -> None:
    link, node = linked()
    size = len(node.object_dictionary[index]) // 8
    if value and len(value) != size:
        with pytest.raises(Refused, match='06070010h'):
            link.write(UNIT, at(index, size=size), value)


@pytest.mark.parametrize(
    ('place', 'code'),
    [
        (at(0x2FFF), '06020000h'),
        (at(ARRAY, 3), '06090011h'),
        (at(WRITE_ONLY), '06010001h'),
    ],
)
def test_what_cannot_be_read(place: Address, code: str) -> None:
    link, _ = linked()
    with pytest.raises(Refused, match=code):
        link.read(UNIT, place)


def test_what_cannot_be_written() -> None:
    link, _ = linked()
    with pytest.raises(Refused, match='06010002h'):
        link.write(UNIT, at(READ_ONLY), bytes(2))


def test_sub_indices() -> None:
    link, _ = linked()
    found = [link.read(UNIT, at(ARRAY, sub_index)).data for sub_index in (0, 1, 2)]
    assert found == [(10 * sub_index).to_bytes(2, 'little') for sub_index in (0, 1, 2)]


def test_a_write_makes_it_operational_and_its_boot_up_is_noticed() -> None:
    link, node = linked()
    assert node.nmt.state == 'INITIALISING'
    link.read(UNIT, at(0x2002))
    assert node.nmt.state == 'INITIALISING', 'reading changes nothing'
    link.write(UNIT, at(0x2002), bytes(2))
    assert node.nmt.state == 'OPERATIONAL'
    node.nmt.send_command(129)
    link.read(UNIT, at(0x2002))
    link.write(UNIT, at(0x2002), bytes(2))
    assert node.nmt.state == 'OPERATIONAL'
