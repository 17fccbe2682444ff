# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The pieces of pymodbus that the simulator uses: of 3.6.9, which Ubuntu 24.04 has, and of 3.8 on.

The constructors of its PDUs changed names and order of arguments. Made without arguments and
filled by attributes they are the same in both.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import struct
from typing import Any

try:
    from pymodbus.framer import FramerAscii, FramerRTU, FramerSocket
    from pymodbus.pdu import ExceptionResponse, mei_message, register_message as reads

    writes: Any = reads
except ImportError:
    from pymodbus import (  # type: ignore[attr-defined, no-redef]
        mei_message,
        register_read_message as reads,
        register_write_message as writes,
    )
    from pymodbus.message.ascii import MessageAscii as FramerAscii  # type: ignore
    from pymodbus.message.rtu import MessageRTU as FramerRTU  # type: ignore
    from pymodbus.message.socket import MessageSocket as FramerSocket  # type: ignore
    from pymodbus.pdu import ExceptionResponse

#: The answers that are registers, by their functions.
_REGISTERS: Mapping[int, Any] = {
    3: reads.ReadHoldingRegistersResponse,
    4: reads.ReadInputRegistersResponse,
    23: reads.ReadWriteMultipleRegistersResponse,
}
# without their constructors: what those want differs, and encoding needs none of it
_ASCII, _TCP = (framer.__new__(framer) for framer in (FramerAscii, FramerSocket))


def crc(data: bytes) -> bytes:
    """Return the two CRC bytes of an RTU frame, in the order they go over the line."""
    # most significant byte first is that order: pymodbus swaps them
    return FramerRTU.compute_CRC(data).to_bytes(2, 'big')


def lrc(data: bytes) -> int:
    """Return the LRC of the bytes of an ASCII frame."""
    return FramerAscii.compute_LRC(data)


def ascii_frame(address: int, pdu: bytes) -> bytes:
    """Return the ASCII frame of a PDU."""
    return _ASCII.encode(pdu, address, 0)


def tcp_frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    """Return the TCP frame of a PDU."""
    return _TCP.encode(pdu, unit, transaction)


def decode_read(data: bytes) -> tuple[int, int]:
    """Decode what follows function 03 or 04: register and count."""
    request = _decoded(reads.ReadHoldingRegistersRequest(), data)
    return request.address, request.count


def decode_write_single(data: bytes) -> tuple[int, int]:
    """Decode what follows function 06: register and word (ValueError: malformed)."""
    request = _decoded(writes.WriteSingleRegisterRequest(), data)
    word = request.value if hasattr(request, 'value') else request.registers[0]
    return request.address, word


def decode_write_multiple(data: bytes) -> tuple[int, int, tuple[int, ...]]:
    """Decode what follows function 16: register, count, words (ValueError: malformed)."""
    request = _decoded(writes.WriteMultipleRegistersRequest(), data)
    words = request.values if hasattr(request, 'values') else request.registers
    return request.address, request.count, tuple(words)


def decode_write_and_read(data: bytes) -> tuple[int, int, int, int, tuple[int, ...]]:
    """Decode what follows function 23: what to read, then what to write."""
    request = _decoded(reads.ReadWriteMultipleRegistersRequest(), data)
    source = (request.read_address, request.read_count)
    return *source, request.write_address, request.write_count, tuple(request.write_registers)


def decode_device(data: bytes) -> tuple[int, int]:
    """Decode what follows function 43 with MEI type 14: read device ID code and object."""
    request = _decoded(mei_message.ReadDeviceInformationRequest(), data)
    return request.read_code, request.object_id


def encode_registers(function: int, words: Sequence[int]) -> bytes:
    """Return the answer PDU of function 03, 04 or 23."""
    return _encoded(_REGISTERS[function](), registers=list(words))


def encode_write_single(register: int, word: int) -> bytes:
    """Return the answer PDU of function 06."""
    response = writes.WriteSingleRegisterResponse()
    return _encoded(response, address=register, value=word, registers=[word])


def encode_write_multiple(register: int, count: int) -> bytes:
    """Return the answer PDU of function 16."""
    return _encoded(writes.WriteMultipleRegistersResponse(), address=register, count=count)


def encode_device(code: int, conformity: int, objects: Mapping[int, bytes]) -> bytes:
    """Return the answer PDU of function 43 with MEI type 14."""
    response = mei_message.ReadDeviceInformationResponse()
    return _encoded(response, read_code=code, conformity=conformity, information=dict(objects))


def encode_exception(function: int, code: int) -> bytes:
    """Return the answer PDU that refuses a request."""
    return _encoded(ExceptionResponse(function & 0x7F, code))


def _decoded(request: Any, data: bytes) -> Any:
    try:
        request.decode(data)
    except (struct.error, IndexError) as error:
        raise ValueError(f'malformed request: {error}') from error
    return request


def _encoded(response: Any, **fields: object) -> bytes:
    for name, value in fields.items():
        setattr(response, name, value)
    pdu: bytes = bytes([response.function_code]) + response.encode()
    return pdu
