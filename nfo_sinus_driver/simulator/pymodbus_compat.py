# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The pieces of pymodbus that the simulator uses, the same from version 3.6.9 to the current one.

What changed on the way:

* The PDU classes moved: ``pymodbus.register_read_message`` and ``register_write_message`` (3.6),
  both below ``pymodbus.pdu`` (3.7), ``pymodbus.pdu.register_message`` (3.8 and later).
* Their constructors changed names and order of arguments (``slave``, ``dev_id``, ``values``,
  ``registers``). Made without arguments and filled by attributes they are the same everywhere.
* A register's value is ``value`` (06) or ``values`` (16) in old ones, ``registers`` in new ones.
* Old ones do not check counts while decoding; new ones raise ``ValueError``.
* The framers stand in ``pymodbus.message`` as ``MessageRTU`` (3.6.9) and its like, or in
  ``pymodbus.framer`` as ``FramerRTU``; new ones want a decoder, which encoding does not need.
  ``decode`` of each version returns something else, so it is not used.
* The CRC always comes byte-swapped: most significant byte first is the order on the line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
import importlib
import logging
import struct
from typing import Any

# some versions log every refusal as an error; here a refusal is an answer like any other
logging.getLogger('pymodbus').addHandler(logging.NullHandler())


def _first_of(modules: Sequence[str], name: str) -> Any:
    """Return the class ``name`` from the first of ``modules`` that has it."""
    for module in modules:
        try:
            return getattr(importlib.import_module(module), name)
        except (ImportError, AttributeError) as error:
            if isinstance(error, ModuleNotFoundError) and error.name == 'pymodbus':
                raise
    raise ImportError(f'this pymodbus has no {name} in any of {", ".join(modules)}')


_READ = (
    'pymodbus.pdu.register_message',
    'pymodbus.pdu.register_read_message',
    'pymodbus.register_read_message',
)
_WRITE = (
    'pymodbus.pdu.register_message',
    'pymodbus.pdu.register_write_message',
    'pymodbus.register_write_message',
)
_ReadRequest = _first_of(_READ, 'ReadHoldingRegistersRequest')
_WriteSingleRequest = _first_of(_WRITE, 'WriteSingleRegisterRequest')
_WriteSingleResponse = _first_of(_WRITE, 'WriteSingleRegisterResponse')
_WriteMultipleRequest = _first_of(_WRITE, 'WriteMultipleRegistersRequest')
_WriteMultipleResponse = _first_of(_WRITE, 'WriteMultipleRegistersResponse')
_WriteAndReadRequest = _first_of(_READ, 'ReadWriteMultipleRegistersRequest')
#: The answers that are registers, by their functions.
_REGISTERS = {
    3: _first_of(_READ, 'ReadHoldingRegistersResponse'),
    4: _first_of(_READ, 'ReadInputRegistersResponse'),
    23: _first_of(_READ, 'ReadWriteMultipleRegistersResponse'),
}
_MEI = ('pymodbus.pdu.mei_message', 'pymodbus.mei_message')
_DeviceRequest = _first_of(_MEI, 'ReadDeviceInformationRequest')
_DeviceResponse = _first_of(_MEI, 'ReadDeviceInformationResponse')
_ExceptionResponse = _first_of(
    ('pymodbus.pdu.exceptionresponse', 'pymodbus.pdu'), 'ExceptionResponse'
)


def _framer(name: str, kind: str) -> Any:
    try:
        return _first_of((f'pymodbus.framer.{name}', 'pymodbus.framer'), f'Framer{kind}')
    except ImportError:
        return _first_of((f'pymodbus.message.{name}',), f'Message{kind}')


_Rtu = _framer('rtu', 'RTU')
_Ascii = _framer('ascii', 'Ascii')
_Tcp = _framer('socket', 'Socket')


def crc(data: bytes) -> bytes:
    """Return the two CRC bytes of an RTU frame, in the order they go over the line."""
    checksum: int = _Rtu.compute_CRC(data)
    return checksum.to_bytes(2, 'big')


def lrc(data: bytes) -> int:
    """Return the LRC of the bytes of an ASCII frame."""
    checksum: int = _Ascii.compute_LRC(data)
    return checksum


def ascii_frame(address: int, pdu: bytes) -> bytes:
    """Return the ASCII frame of a PDU."""
    return _encoder(_Ascii)(pdu, address, 0)


def tcp_frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    """Return the TCP frame of a PDU."""
    return _encoder(_Tcp)(pdu, unit, transaction)


def decode_read(data: bytes) -> tuple[int, int]:
    """Decode what follows function 03 or 04: register and count."""
    request = _decoded(_ReadRequest(), data)
    return request.address, request.count


def decode_write_single(data: bytes) -> tuple[int, int]:
    """Decode what follows function 06: register and word (ValueError: malformed)."""
    request = _decoded(_WriteSingleRequest(), data)
    word = request.value if hasattr(request, 'value') else request.registers[0]
    return request.address, word


def decode_write_multiple(data: bytes) -> tuple[int, int, tuple[int, ...]]:
    """Decode what follows function 16: register, count, words (ValueError: malformed)."""
    request = _decoded(_WriteMultipleRequest(), data)
    words = request.values if hasattr(request, 'values') else request.registers
    return request.address, request.count, tuple(words)


def decode_write_and_read(data: bytes) -> tuple[int, int, int, int, tuple[int, ...]]:
    """Decode what follows function 23: what to read, then what to write."""
    request = _decoded(_WriteAndReadRequest(), data)
    source = (request.read_address, request.read_count)
    return *source, request.write_address, request.write_count, tuple(request.write_registers)


def decode_device(data: bytes) -> tuple[int, int]:
    """Decode what follows function 43 with MEI type 14: read device ID code and object."""
    request = _decoded(_DeviceRequest(), data)
    return request.read_code, request.object_id


def encode_registers(function: int, words: Sequence[int]) -> bytes:
    """Return the answer PDU of function 03, 04 or 23."""
    return _encoded(_REGISTERS[function](), registers=list(words))


def encode_write_single(register: int, word: int) -> bytes:
    """Return the answer PDU of function 06."""
    return _encoded(_WriteSingleResponse(), address=register, value=word, registers=[word])


def encode_write_multiple(register: int, count: int) -> bytes:
    """Return the answer PDU of function 16."""
    return _encoded(_WriteMultipleResponse(), address=register, count=count)


def encode_device(code: int, conformity: int, objects: Mapping[int, bytes]) -> bytes:
    """Return the answer PDU of function 43 with MEI type 14."""
    response = _DeviceResponse()
    return _encoded(response, read_code=code, conformity=conformity, information=dict(objects))


def encode_exception(function: int, code: int) -> bytes:
    """Return the answer PDU that refuses a request."""
    return _encoded(_ExceptionResponse(function & 0x7F, code))


def _encoder(framer: Any) -> Callable[[bytes, int, int], bytes]:
    # an object without its constructor: what that wants differs, and encoding needs none of it
    encode: Callable[[bytes, int, int], bytes] = framer.__new__(framer).encode
    return encode


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
