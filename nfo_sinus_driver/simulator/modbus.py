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

"""Modbus as a simulated drive speaks it, in whatever frames ([M0 §6.2.3, §6.2.4], [M1])."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Mapping

from nfo_sinus_driver.simulator import pymodbus_compat
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.identification import KNOWN
from nfo_sinus_driver.simulator.identification import REFUSED
from nfo_sinus_driver.simulator.identification import SILENT
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused

_READ = 3
_READ_INPUT = 4
_WRITE_SINGLE = 6
_WRITE_MULTIPLE = 16
_REPORT_SLAVE_ID = 17
_WRITE_AND_READ = 23
_ENCAPSULATED = 43
_DEVICE_IDENTIFICATION = 14
#: Read device ID codes: basic, regular, specific; and which objects belong to each.
_BASIC, _REGULAR, _SPECIFIC = 1, 2, 4
_STREAMS = {_BASIC: range(3), _REGULAR: range(7)}
#: Regular identification, as a stream and object by object.
_CONFORMITY = 0x82
#: The standard's limits of registers in one message.
_MOST_READ = 125
_MOST_WRITTEN = 123
_MOST_WRITTEN_WITH_READ = 121


def answer(drive: SimulatedDrive, pdu: bytes) -> bytes:
    """Let the drive carry out a request PDU and return the answer PDU; empty if it stays silent."""
    function = pdu[0] if pdu else 0
    treated = drive.newer_functions if function in _NEWER else KNOWN
    if treated == SILENT:
        return b''
    try:
        if treated == REFUSED:
            raise Refused(Reason.FUNCTION, f'function {function} came with a newer firmware')
        if function not in _FUNCTIONS[drive.model.name]:
            raise Refused(Reason.FUNCTION, f'function {function} is not supported')
        try:
            return _HANDLERS[function](drive, pdu[1:])
        except ValueError as error:
            raise Refused(Reason.VALUE, str(error)) from error
    except Refused as refused:
        return pymodbus_compat.encode_exception(function, refused.reason)


def is_write(pdu: bytes) -> bool:
    """Whether a request only writes, so that it may go to everybody."""
    return pdu[:1] in (bytes([_WRITE_SINGLE]), bytes([_WRITE_MULTIPLE]))


def _read(drive: SimulatedDrive, data: bytes) -> bytes:
    return pymodbus_compat.encode_read(_words(drive, data))


def _read_input(drive: SimulatedDrive, data: bytes) -> bytes:
    # the same registers by another function [M1]
    return pymodbus_compat.encode_read_input(_words(drive, data))


def _words(drive: SimulatedDrive, data: bytes) -> tuple[int, ...]:
    register, count = pymodbus_compat.decode_read(data)
    if not 1 <= count <= _MOST_READ or len(data) != 4:
        raise Refused(Reason.VALUE, f'a request for {count} registers is malformed')
    return drive.read(register, count)


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


def _write_and_read(drive: SimulatedDrive, data: bytes) -> bytes:
    source, wanted, register, count, words = pymodbus_compat.decode_write_and_read(data)
    right = 1 <= count <= _MOST_WRITTEN_WITH_READ and len(words) == count and data[8] == 2 * count
    if not right or not 1 <= wanted <= _MOST_READ or len(data) != 9 + 2 * count:
        raise Refused(Reason.VALUE, f'a write of {count} and read of {wanted} is malformed')
    return pymodbus_compat.encode_write_and_read(
        drive.write_and_read(register, words, source, wanted)
    )


def _report_slave_id(drive: SimulatedDrive, data: bytes) -> bytes:
    if data:
        raise Refused(Reason.VALUE, 'a request of a wrong length')
    # not pymodbus's, which puts the standard's run indicator behind it [C94]
    report = drive.serial_number.encode('ascii')
    return bytes((_REPORT_SLAVE_ID, len(report))) + report


def _identify(drive: SimulatedDrive, data: bytes) -> bytes:
    if data[:1] != bytes((_DEVICE_IDENTIFICATION,)):
        raise Refused(Reason.FUNCTION, 'only MEI type 14 is supported')
    code, first = pymodbus_compat.decode_device(data)
    if len(data) != 3:
        raise Refused(Reason.VALUE, 'a request of a wrong length')
    objects = drive.identification
    if code == _SPECIFIC:
        if first not in objects:
            raise Refused(Reason.ADDRESS, f'there is no object {first}')
        return pymodbus_compat.encode_device(code, _CONFORMITY, {first: objects[first]})
    if code not in _STREAMS:
        raise Refused(Reason.VALUE, f'read device ID code {code} is not supported')
    stream = _STREAMS[code]
    # from an object that is not there the standard begins anew
    wanted = stream[first if first in stream else 0 :]
    return pymodbus_compat.encode_device(
        code, _CONFORMITY, {number: objects[number] for number in wanted}
    )


_HANDLERS: Mapping[int, Callable[[SimulatedDrive, bytes], bytes]] = {
    _READ: _read,
    _READ_INPUT: _read_input,
    _WRITE_SINGLE: _write_single,
    _WRITE_MULTIPLE: _write_multiple,
    _REPORT_SLAVE_ID: _report_slave_id,
    _WRITE_AND_READ: _write_and_read,
    _ENCAPSULATED: _identify,
}
#: What only the newer firmware of a G2 has.
_NEWER = frozenset((_REPORT_SLAVE_ID, _WRITE_AND_READ, _ENCAPSULATED))
#: The functions of each family [C57].
_BASIC_FUNCTIONS = frozenset((_READ, _WRITE_SINGLE, _WRITE_MULTIPLE))
_FUNCTIONS: Mapping[str, frozenset[int]] = {
    'sinus_g2': _BASIC_FUNCTIONS | _NEWER,
    'sinus_optimal': _BASIC_FUNCTIONS | {_READ_INPUT},
}
