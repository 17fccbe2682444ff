# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Who a unit is, in frames of pymodbus's, and a unit that tells it on a line in virtual time."""

from __future__ import annotations

from collections.abc import Callable

import pymodbus_opinion as opinion
from support.addresses import register, words_of
from support.plans import followed
from virtual_wire import Wire

from nfo_sinus_driver.link.interface import (
    Address,
    Identification,
    LineSettings,
)
from nfo_sinus_driver.link.modbus_pdu import WriteAndRead
from nfo_sinus_driver.link.rtu import RtuLink

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


# --- a unit on a line in virtual time -------------------------------------------------------------

TIMEOUT = 0.1
SETTINGS = LineSettings(baud_rate=19200, response_timeout=TIMEOUT)
ONE = register(0x2A5)
TWO = register(0x258, 2)


class Unit:
    """
    A link on a virtual line, and a unit that answers each function as the test says, in order.

    :ivar late: by how much the answer to a function is late, in time-outs.
    """

    def __init__(self, settings: LineSettings = SETTINGS) -> None:
        self.wire = Wire(settings)
        self.wire.far_end = self._take
        self.link = RtuLink(self.wire, settings, self.wire.monotonic)
        self.link.use_resync_reads(1, (ONE, TWO))
        self.answers: dict[int, Callable[[bytes], bytes]] = {
            3: lambda frame: opinion.read_answer(1, [len(self.functions)] * frame[5]),
            17: lambda frame: g2_answer(1),
            6: lambda frame: frame,
            23: lambda frame: write_and_read_answer(1, (len(self.functions),) * frame[5]),
            43: lambda frame: device_answer(1, frame[3], G2),
        }
        self.late: dict[int, float] = {}
        self.functions: list[int] = []
        self._free = 0.0
        self.link.open()

    def _take(self, frame: bytes, end: float) -> None:
        self.functions.append(frame[1])
        answer = self.answers[frame[1]](frame)
        start = max(self._free, end + self.late.get(frame[1], 0) * TIMEOUT)
        self._free = self.wire.arrive(start, answer)

    def identify(self) -> Identification:
        return followed(self.link.identify(1))

    def read(self, address: Address = ONE) -> bytes:
        return self.link.read(1, address).data


def silent(frame: bytes) -> bytes:
    return b''


def refuses(frame: bytes) -> bytes:
    return opinion.exception(1, frame[1], 1)
