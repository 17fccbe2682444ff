# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who a unit is, and function 23, in frames of pymodbus's."""

from __future__ import annotations

import pymodbus_opinion as opinion
from support.addresses import words_of

from nfo_sinus_driver.link.interface import Identification
from nfo_sinus_driver.link.modbus.pdu import WriteAndRead

if opinion.OLD:
    from pymodbus import mei_message, other_message

    SlaveRequest = other_message.ReportSlaveIdRequest
    SlaveResponse = other_message.ReportSlaveIdResponse
else:
    from pymodbus.pdu import mei_message, other_message

    SlaveRequest = other_message.ReportDeviceIdRequest
    SlaveResponse = other_message.ReportDeviceIdResponse

SERIAL = b'0123456789ABCDEF'
#: What M0 §6.2.4 prints.
G2 = {
    0: b'NFO Drives AB',
    1: b'',
    2: b' 4.30 / 4018     ',
    3: b'http://www.nfo.se',
    4: b'NFO Sinus',
    5: b'1.50/400',
    6: b'',
}
KNOWN = Identification(
    vendor='NFO Drives AB',
    revision='4.30 / 4018',
    url='http://www.nfo.se',
    product='NFO Sinus',
    model='1.50/400',
    serial='0123456789ABCDEF',
)

# --- pymodbus's opinion ---------------------------------------------------------------------------


def device_request(unit: int, code: int, first: int) -> bytes:
    request = mei_message.ReadDeviceInformationRequest()
    return opinion._frame(unit, request, read_code=code, object_id=first)


def device_answer(unit: int, code: int, objects: dict[int, bytes]) -> bytes:
    """The frame with the objects; with as many of them as fit, and the rest follows."""
    answer = mei_message.ReadDeviceInformationResponse()
    return opinion._frame(unit, answer, read_code=code, information=objects)


def slave_request(unit: int) -> bytes:
    return opinion._frame(unit, SlaveRequest())


def slave_answer(unit: int, identifier: bytes, running: bool) -> bytes:
    """The frame with an id and the run indicator of the standard."""
    return opinion._frame(unit, SlaveResponse(), identifier=identifier, status=running)


def g2_answer(unit: int, report: bytes = SERIAL) -> bytes:
    """The frame as M0 §6.2.4 has it: nothing but the characters, which pymodbus cannot."""
    frame = bytes((unit, 17, len(report))) + report
    return frame + opinion.crc(frame)


def write_and_read_request(request: WriteAndRead) -> bytes:
    return opinion._frame(
        request.unit,
        opinion.read_message.ReadWriteMultipleRegistersRequest(),
        read_address=request.source,
        read_count=request.count,
        write_address=request.register,
        write_count=len(request.data) // 2,
        write_byte_count=len(request.data),
        write_registers=list(words_of(request.data)),
    )


def write_and_read_answer(unit: int, words: tuple[int, ...]) -> bytes:
    answer = opinion.read_message.ReadWriteMultipleRegistersResponse()
    return opinion._frame(unit, answer, registers=list(words))


def spoil(frame: bytes, bit: int) -> bytes:
    """The frame with one bit wrong."""
    damaged = bytearray(frame)
    damaged[bit // 8 % len(frame)] ^= 1 << bit % 8
    return bytes(damaged)
