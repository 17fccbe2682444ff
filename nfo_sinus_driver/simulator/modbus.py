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

"""Modbus as a simulated drive speaks it: functions 03, 06 and 16 over RTU frames [M0 §6.2]."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping

from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused

#: Everybody obeys a write to this address and nobody answers.
BROADCAST = 0
#: BusType of a drive that speaks Modbus RTU [M0 table 4].
BUS_TYPE_RTU = 3

_READ = 3
_WRITE_SINGLE = 6
_WRITE_MULTIPLE = 16
#: The standard's limits of registers in one message.
_MOST_READ = 125
_MOST_WRITTEN = 123

#: Length of a request's whole RTU frame by function: fixed, or what the byte count at an index
#: adds to the rest.
_FIXED = dict.fromkeys((1, 2, 3, 4, 5, 6, 8), 8) | {7: 4, 11: 4, 12: 4, 17: 4, 22: 10, 24: 6, 43: 7}
_COUNTED = {15: 6, 16: 6, 20: 2, 21: 2, 23: 10}


def answer(drive: SimulatedDrive, pdu: bytes) -> bytes:
    """Let the drive carry out a request PDU and return the answer PDU; it always has one."""
    function = pdu[0] if pdu else 0
    try:
        try:
            handler = _HANDLERS[function]
        except KeyError:
            raise Refused(Reason.FUNCTION, f'function {function} is not supported') from None
        try:
            return handler(drive, pdu[1:])
        except ValueError as error:
            raise Refused(Reason.VALUE, str(error)) from error
    except Refused as refused:
        return pymodbus_compat.encode_exception(function, refused.reason)


def _read(drive: SimulatedDrive, data: bytes) -> bytes:
    register, count = pymodbus_compat.decode_read(data)
    if not 1 <= count <= _MOST_READ or len(data) != 4:
        raise Refused(Reason.VALUE, f'a request for {count} registers is malformed')
    return pymodbus_compat.encode_read(drive.read(register, count))


def _write_single(drive: SimulatedDrive, data: bytes) -> bytes:
    register, word = pymodbus_compat.decode_write_single(data)
    if len(data) != 4:
        raise Refused(Reason.VALUE, 'a request of a wrong length')
    drive.write(register, [word])
    return pymodbus_compat.encode_write_single(register, word)


def _write_multiple(drive: SimulatedDrive, data: bytes) -> bytes:
    register, count, words = pymodbus_compat.decode_write_multiple(data)
    right = 1 <= count <= _MOST_WRITTEN and len(words) == count and data[4] == 2 * count
    if not right or len(data) != 5 + 2 * count:
        raise Refused(Reason.VALUE, f'a write of {count} registers is malformed')
    drive.write(register, words)
    return pymodbus_compat.encode_write_multiple(register, count)


_HANDLERS: Mapping[int, Callable[[SimulatedDrive, bytes], bytes]] = {
    _READ: _read,
    _WRITE_SINGLE: _write_single,
    _WRITE_MULTIPLE: _write_multiple,
}


class ModbusRtu:
    """RTU frames: where they end, whom they are for, and whether they arrived whole."""

    name = 'modbus_rtu'
    data_bits = 8

    @staticmethod
    def speaks(drive: SimulatedDrive) -> bool:
        """Whether the drive's parameter BusType is set to this protocol."""
        return drive.serial.bus_type == BUS_TYPE_RTU

    @staticmethod
    def length(buffer: bytes) -> int | None:
        """
        Return how long the request that begins the buffer is, CRC included.

        0 when more bytes are needed to tell, ``None`` when only silence can tell.
        """
        if len(buffer) < 2:
            return 0
        function = buffer[1]
        if function in _FIXED:
            return _FIXED[function]
        if function in _COUNTED:
            at = _COUNTED[function]
            return at + 1 + buffer[at] + 2 if len(buffer) > at else 0
        return None

    @staticmethod
    def unwrap(frame: bytes) -> tuple[int, bytes] | None:
        """Return address and PDU of a frame; ``None`` when it is damaged."""
        if len(frame) < 4 or pymodbus_compat.crc(frame[:-2]) != frame[-2:]:
            return None
        return frame[0], frame[1:-2]

    @staticmethod
    def wrap(address: int, pdu: bytes) -> bytes:
        """Return the frame of an answer."""
        body = bytes([address]) + pdu
        return body + pymodbus_compat.crc(body)

    @staticmethod
    def answer(drive: SimulatedDrive, pdu: bytes) -> bytes:
        """Let the drive carry out a request; return the answer's PDU."""
        return answer(drive, pdu)

    @staticmethod
    def broadcast(address: int, pdu: bytes) -> bool:
        """Whether every drive obeys the request and none answers."""
        return address == BROADCAST and pdu[0] in (_WRITE_SINGLE, _WRITE_MULTIPLE)
