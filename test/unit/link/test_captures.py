# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Frames of real drives, and those that makers print, are understood, and made alike.

``captures.csv`` has them with their places. The rows of its table are others' words; what follows
from their bytes is worked out here without the codec. Makers print wrong check sums, too: such a
frame is none.
"""

from __future__ import annotations

import csv
from pathlib import Path
import struct
from typing import Any, NamedTuple

import pytest
from support.described import SHIPPED

from nfo_sinus_driver.catalog.declared import read
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.link.modbus import ascii as ascii_frames, pdu, rtu
from nfo_sinus_driver.link.modbus.link import ReadDevice
from nfo_sinus_driver.simulator.family import simulated_drive

#: Functions that the driver asks nothing by: the loopback.
_NOT_SPOKEN = frozenset((8,))
#: What is printed there with a wrong check sum, and without one.
_MISPRINTED = frozenset((17, 19, 34, 35))
_NO_SUM = frozenset((45, 46, 77))


class Capture(NamedTuple):
    """One exchange; bytes without those that a protocol adds."""

    number: int
    protocol: str
    request: bytes
    response: bytes

    @property
    def message(self) -> bytes:
        """The request without its check sum."""
        if self.number in _NO_SUM:
            return self.request
        return _message(self.protocol, self.request)


def _bytes(text: str) -> bytes:
    return (text + '\r\n').encode() if text.startswith(':') else bytes.fromhex(text)


def _message(protocol: str, frame: bytes) -> bytes:
    return bytes.fromhex(frame[1:-4].decode()) if protocol == 'modbus_ascii' else frame[:-2]


def _captures() -> list[Capture]:
    with (Path(__file__).parent / 'captures.csv').open(newline='', encoding='utf-8') as file:
        return [
            Capture(
                int(row['id']), row['protocol'], _bytes(row['request']), _bytes(row['response'])
            )
            for row in csv.DictReader(file)
            if row['protocol'].startswith('modbus')
        ]


CAPTURES = {capture.number: capture for capture in _captures()}


def request_of(message: bytes) -> Any:
    """Return the driver's request that a message makes, by its own fields."""
    unit, function = message[:2]
    if function == 0x2B:
        return ReadDevice(unit, message[3], message[4])
    at, value = struct.unpack('>HH', message[2:6])
    if function in (1, 3, 4):
        kind = {1: pdu.ReadCoils, 3: pdu.Read, 4: pdu.ReadInput}[function]
        return kind(unit, at, value)
    if function in (5, 6):
        kind_of_write = {5: pdu.WriteCoil, 6: pdu.Write}[function]
        return kind_of_write(unit, at, message[4:6])
    assert function == 16 and message[6] == 2 * value == len(message) - 7
    return pdu.Write(unit, at, message[7:], multiple=True)


def encoded(capture: Capture) -> bytes:
    frames = ascii_frames if capture.protocol == 'modbus_ascii' else rtu
    return frames.encode(request_of(capture.message))


def read_by(capture: Capture, data: bytes) -> Any:
    """Return what the driver reads in bytes that come one by one; ``None``: no answer."""
    kind = ascii_frames.AsciiReader if capture.protocol == 'modbus_ascii' else rtu.RtuReader
    reader = kind(request_of(capture.message))
    for byte in data:
        if (answer := reader.feed(bytes((byte,)))) is not None:
            return answer
    return None


SPOKEN = [
    capture for capture in CAPTURES.values()
    if capture.request and capture.request[1] not in _NOT_SPOKEN
]  # fmt: skip
ANSWERED = [capture for capture in SPOKEN if capture.response]


def _named(capture: Capture) -> str:
    return str(capture.number)


def test_the_table_is_there() -> None:
    assert len(CAPTURES) == 55 and len(SPOKEN) > 40 and len(ANSWERED) > 35
    assert set(CAPTURES) > _MISPRINTED | _NO_SUM


@pytest.mark.parametrize('capture', SPOKEN, ids=_named)
def test_a_request_is_made_alike(capture: Capture) -> None:
    if capture.number in _MISPRINTED:
        assert encoded(capture)[:-2] == capture.message
        assert encoded(capture) != capture.request
    elif capture.number in _NO_SUM:
        assert encoded(capture)[:-2] == capture.request
    else:
        assert encoded(capture) == capture.request


@pytest.mark.parametrize('capture', ANSWERED, ids=_named)
def test_an_answer_is_understood(capture: Capture) -> None:
    answer = _message(capture.protocol, capture.response)
    if answer[1] & 0x80:
        with pytest.raises(Refused) as refused:
            read_by(capture, capture.response)
        assert refused.value.code == answer[2]
        return
    found = read_by(capture, capture.response)
    if answer[1] == 0x2B:
        texts = [text for _, text in found.objects]
        assert texts == [b'TOSHIBA', b'VFS15-2037PM', b'0100']
    elif answer[1] == 1:
        # of two coils the other six bits of the byte are nothing, whatever is in them
        assert found == bytes((answer[3] & 0b11,))
    else:
        assert found == (answer[3:] if answer[1] in (3, 4) else b'')
    # a byte that is damaged makes it none
    for at in range(len(capture.response) - 2):
        damaged = bytearray(capture.response)
        damaged[at] ^= 1
        assert read_by(capture, bytes(damaged)) is None, at


#: By row: the shipped file, the register, and what its maker says that it is.
MEANT = {
    1: ('toshiba_vf_s11', 0xFD00, 60.0),
    3: ('toshiba_vf_s11', 0xFA01, 60.0),
    21: ('hitachi_wj200', 0x0011, 3),
    27: ('hitachi_wj200', 0x0000, 1),
    30: ('delta_ms300', 0x0100, 60.0),
    41: ('delta_vfd_el', 0x2000, 0x12),
    42: ('delta_vfd_el', 0x2000, 0x01),
    43: ('delta_vfd_el', 0x2001, 0.1),
    45: ('siemens_v20', 99, 0x0C7F),
    46: ('siemens_v20', 99, 0x0C7E),
    62: ('invt_gd20', 0x0004, 50.0),
    63: ('invt_gd20', 0x000B, 10.0),
    65: ('invt_gd20', 0x2000, 1),
    66: ('invt_gd20', 0x2000, 2),
    67: ('invt_gd20', 0x2000, 5),
    69: ('powtran_pi500', 0x2000, 7),
}


@pytest.mark.parametrize(('number', 'name', 'register', 'value'), [
    (number, *meant) for number, meant in MEANT.items()
])
def test_a_shipped_file_means_what_the_maker_says(
    number: int, name: str, register: int, value: float
) -> None:
    capture = CAPTURES[number]
    message = capture.message
    assert int.from_bytes(message[2:4], 'big') == register
    answer = _message(capture.protocol, capture.response)
    # of a coil one bit
    coil = bytes((message[4:6] == b'\xff\x00',))
    word = {3: answer[3:5], 5: coil, 6: message[4:6], 16: message[7:9]}[message[1]]
    found = {
        key: parameter.decode(word, 'modbus')
        for key, parameter in read(SHIPPED[name]).parameters.items()
        if parameter.at('modbus').index == register
        and (parameter.at('modbus').space == 'coil') is (message[1] == 5)
    }
    assert value in found.values(), found


def test_a_shipped_file_names_the_trip_that_the_maker_prints() -> None:
    """The registers behind it, what the drive did as it tripped, are none that the driver reads."""
    number = int.from_bytes(CAPTURES[21].response[3:5], 'big')
    assert read(SHIPPED['hitachi_wj200']).faults[number].text == 'E03'


@pytest.mark.parametrize('number', [3, 27, 30, 41, 42, 43, 62, 63, 65, 66, 67, 69])
def test_a_simulated_drive_answers_a_write_alike(number: int) -> None:
    name, _, _ = MEANT[number]
    drive = simulated_drive(str(SHIPPED[name]))
    server = drive.servers['modbus']
    answer = server.answer(CAPTURES[number].message[1:])
    assert answer == _message('modbus_rtu', CAPTURES[number].response)[1:]


@pytest.mark.parametrize(('name', 'number'), [('yaskawa_v1000', 11), ('delta_ms300', 34)])
def test_a_simulated_drive_loops_back_alike(name: str, number: int) -> None:
    server = simulated_drive(str(SHIPPED[name])).servers['modbus']
    capture = CAPTURES[number]
    assert server.answer(capture.message[1:]) == capture.response[1:-2]


def test_a_simulated_drive_shows_the_set_point_at_standstill_alike() -> None:
    server = simulated_drive(str(SHIPPED['delta_ms300'])).servers['modbus']
    server.write(0x2001, (0x1770,))
    for number in (29, 31):
        capture = CAPTURES[number]
        answer = _message(capture.protocol, capture.response)
        assert server.answer(capture.message[1:]) == answer[1:]


def test_a_simulated_drive_shows_four_registers_of_a_run_alike() -> None:
    """Its status has two bits more there: outputs, of which the file says nothing."""
    drive = simulated_drive(str(SHIPPED['yaskawa_v1000']))
    for required in read(SHIPPED['yaskawa_v1000']).requires:
        drive.set_from_keypad(required.key, required.value)
    server = drive.servers['modbus']
    server.write(0x0002, (0x01F4,))
    server.write(0x0001, (0x0001,))
    drive.advance(10.0)
    capture = CAPTURES[9]
    answer, printed = server.answer(capture.message[1:]), capture.response[1:-2]
    outputs = 0x0060
    assert int.from_bytes(answer[2:4], 'big') == int.from_bytes(printed[2:4], 'big') & ~outputs
    assert answer[:2] + answer[4:] == printed[:2] + printed[4:]


def test_a_simulated_drive_obeys_words_that_programs_write_to_a_gd20() -> None:
    drive = simulated_drive(str(SHIPPED['invt_gd20']))
    server = drive.servers['modbus']
    server.write(0x2001, (2500,))
    for number, frequency in ((65, 25), (66, -25), (67, 0)):
        server.answer(CAPTURES[number].message[1:])
        drive.advance(60.0)
        assert round(drive.motor.frequency) == frequency


@pytest.mark.parametrize(('number', 'turns'), [(45, True), (46, False)])
def test_a_simulated_drive_obeys_words_of_fluidnc(number: int, turns: bool) -> None:
    drive = simulated_drive(str(SHIPPED['siemens_v20']))
    server = drive.servers['modbus']
    server.write(100, (0x2000,))
    for word in (0x047E, 0x047F):
        server.write(99, (word,))
    server.answer(CAPTURES[number].message[1:])
    drive.advance(60.0)
    # bit 11 of the first is reverse
    assert round(drive.motor.frequency) == (-25 if turns else 0)


def test_a_simulated_drive_shows_60_hz_alike() -> None:
    drive = simulated_drive(str(SHIPPED['toshiba_vf_s11']))
    drive.set_from_keypad(read(SHIPPED['toshiba_vf_s11']).setpoint.limit, 60.0)
    server = drive.servers['modbus']
    server.answer(CAPTURES[3].message[1:])
    server.write(0xFA00, (0xC400,))
    drive.advance(60.0)
    for number in (1, 2):
        capture = CAPTURES[number]
        assert server.answer(capture.message[1:]) == capture.response[1:-2]
