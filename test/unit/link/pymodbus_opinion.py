# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Pymodbus's opinion on RTU frames, in its words of 3.6.9 and of today."""

from __future__ import annotations

from collections.abc import Sequence
import logging
from typing import Any

try:
    from pymodbus.framer import FramerAscii, FramerRTU, FramerSocket
    from pymodbus.pdu import DecodePDU, ExceptionResponse, register_message as read_message

    write_message = read_message
    OLD = False
except ImportError:
    from pymodbus import (
        register_read_message as read_message,
        register_write_message as write_message,
    )
    from pymodbus.factory import ServerDecoder
    from pymodbus.framer.rtu_framer import ModbusRtuFramer
    from pymodbus.message.ascii import MessageAscii as FramerAscii
    from pymodbus.message.rtu import MessageRTU as FramerRTU
    from pymodbus.message.socket import MessageSocket as FramerSocket
    from pymodbus.pdu import ExceptionResponse

    OLD = True

logging.getLogger('pymodbus').setLevel(logging.CRITICAL)


def crc(data: bytes) -> bytes:
    """The check sum as it goes over the line."""
    checksum: int = FramerRTU.compute_CRC(data)
    return checksum.to_bytes(2, 'big')


def ascii_frame(message: bytes) -> bytes:
    """The ASCII frame of unit, function and data."""
    framer = FramerAscii() if OLD else FramerAscii(DecodePDU(False))
    packet: bytes = framer.encode(message[1:], message[0], 0)
    return packet


def tcp_frame(message: bytes, number: int) -> bytes:
    """The TCP frame of unit, function and data."""
    framer = FramerSocket() if OLD else FramerSocket(DecodePDU(False))
    packet: bytes = framer.encode(message[1:], message[0], number)
    return packet


def read_request(unit: int, register: int, count: int) -> bytes:
    """The frame that reads registers."""
    return _frame(unit, read_message.ReadHoldingRegistersRequest(), address=register, count=count)


def write_request(unit: int, register: int, words: Sequence[int]) -> bytes:
    """The frame that writes one register, or several."""
    if len(words) == 1:
        request = write_message.WriteSingleRegisterRequest()
        return _frame(unit, request, address=register, value=words[0], registers=list(words))
    return _frame(
        unit,
        write_message.WriteMultipleRegistersRequest(),
        address=register,
        count=len(words),
        byte_count=2 * len(words),
        values=list(words),
        registers=list(words),
    )


def read_answer(unit: int, words: Sequence[int]) -> bytes:
    """The frame with the registers read."""
    answer = read_message.ReadHoldingRegistersResponse()
    return _frame(unit, answer, registers=list(words))


def write_answer(unit: int, register: int, words: Sequence[int]) -> bytes:
    """The frame that says that registers were written."""
    if len(words) == 1:
        answer = write_message.WriteSingleRegisterResponse()
        return _frame(unit, answer, address=register, value=words[0], registers=list(words))
    answer = write_message.WriteMultipleRegistersResponse()
    return _frame(unit, answer, address=register, count=len(words))


def exception(unit: int, function: int, code: int) -> bytes:
    """The frame that refuses."""
    return _frame(unit, ExceptionResponse(function, code))


def decoded(frame: bytes) -> tuple[int, int, int, int, tuple[int, ...]]:
    """What pymodbus's server reads in a request: unit, function, register, count, words."""
    request = _decoded(frame)
    unit = request.slave_id if OLD else request.dev_id
    words: Sequence[int] = ()
    if request.function_code != 3:
        words = request.registers if not OLD else getattr(request, 'values', None) or ()
        if OLD and request.function_code == 6:
            words = (request.value,)
    count = 1 if request.function_code == 6 else request.count
    return unit, request.function_code, request.address, count, tuple(words)


def _frame(unit: int, message: Any, **fields: object) -> bytes:
    for name, value in fields.items():
        setattr(message, name, value)
    setattr(message, 'slave_id' if OLD else 'dev_id', unit)
    if OLD:
        message.transaction_id = 0
        packet: bytes = ModbusRtuFramer(None).buildPacket(message)
    else:
        packet = FramerRTU(DecodePDU(False)).buildFrame(message)
    return packet


def _decoded(frame: bytes) -> Any:
    if not OLD:
        used, request = FramerRTU(DecodePDU(True)).handleFrame(frame, 0, 0)
        assert used == len(frame)
        return request
    got: list[Any] = []
    ModbusRtuFramer(ServerDecoder()).processIncomingPacket(frame, got.append, [0])
    (request,) = got
    return request
