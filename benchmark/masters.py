# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Libraries as a Modbus RTU master that makes the driver's reads over and over; a process of its own.

It runs until it is ended.
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable
import itertools
import struct
import time

import minimalmodbus
from pymodbus.client import AsyncModbusSerialClient, ModbusSerialClient
from pymodbus.framer import FramerType
from pymodbus.pdu import ModbusPDU
import recorded_cycle
from trace_file import READ_FUNCTIONS, Line

#: Two stop bits for the parity: a character is as long, and a pseudo-terminal can do it. With
#: parity these libraries cannot even open it, for the C library says that it has none.
_SERIAL = {'bytesize': 8, 'parity': 'N', 'stopbits': 2}
_TIMEOUT = 0.2

#: Unit, function, register, number of registers.
Read = tuple[int, int, int, int]


def reads(cycle: recorded_cycle.Cycle) -> list[Read]:
    """Return what a cycle reads."""
    found = (struct.unpack('>BBHH', request[:6].ljust(6, b'\0')) for request, _ in cycle)
    return [read for read in found if read[1] in READ_FUNCTIONS]


def run_pymodbus(port: str, line: Line, cycle: list[Read]) -> None:
    """Read with pymodbus's synchronous client; the gap is ours, for it keeps none."""
    client = ModbusSerialClient(
        port, framer=FramerType.RTU, baudrate=line.baud_rate, timeout=_TIMEOUT, **_SERIAL
    )
    if not client.connect():
        raise SystemExit('pymodbus cannot open the port')
    for unit, _, register, count in itertools.cycle(cycle):
        _check(client.read_holding_registers(register, count=count, device_id=unit))
        time.sleep(line.gap)


def run_pymodbus_async(port: str, line: Line, cycle: list[Read]) -> None:
    """Read with pymodbus's asynchronous client; the gap is ours, for it keeps none."""

    async def run() -> None:
        client = AsyncModbusSerialClient(
            port, framer=FramerType.RTU, baudrate=line.baud_rate, timeout=_TIMEOUT, **_SERIAL
        )
        if not await client.connect():
            raise SystemExit('pymodbus cannot open the port')
        for unit, _, register, count in itertools.cycle(cycle):
            _check(await client.read_holding_registers(register, count=count, device_id=unit))
            await asyncio.sleep(line.gap)

    asyncio.run(run())


def run_minimalmodbus(port: str, line: Line, cycle: list[Read]) -> None:
    """Read with minimalmodbus, which keeps the gap itself."""
    units = {unit: minimalmodbus.Instrument(port, unit) for unit, *_ in cycle}
    # all share one port
    serial = units[cycle[0][0]].serial
    serial.baudrate, serial.timeout = line.baud_rate, _TIMEOUT
    for name, value in _SERIAL.items():
        setattr(serial, name, value)
    for unit, function, register, count in itertools.cycle(cycle):
        units[unit].read_registers(register, count, function)


def _check(answer: ModbusPDU) -> None:
    if answer.isError():
        raise SystemExit(f'no answer on a perfect line: {answer}')


MASTERS: dict[str, Callable[[str, Line, list[Read]], None]] = {
    'minimalmodbus': run_minimalmodbus,
    'pymodbus sync + gap': run_pymodbus,
    'pymodbus async + gap': run_pymodbus_async,
}


def main() -> None:
    """Run a master until somebody ends it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('master', choices=MASTERS)
    parser.add_argument('port')
    parser.add_argument('baud_rate', type=int)
    parser.add_argument('cycle')
    options = parser.parse_args()
    cycle = reads(recorded_cycle.load(options.cycle))
    MASTERS[options.master](options.port, Line(options.baud_rate), cycle)


if __name__ == '__main__':
    main()
