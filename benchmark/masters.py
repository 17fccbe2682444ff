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
"""
A Modbus master that reads the driver's cycle over and over; a process of its own.

The cycle is what the driver polls: status word, inverter status, frequency and speed, of each
drive. It runs until it is ended.
"""

from __future__ import annotations

import argparse
import asyncio
from collections.abc import Callable
import itertools
import time

import minimalmodbus
from pymodbus.client import AsyncModbusSerialClient
from pymodbus.client import ModbusSerialClient
from pymodbus.framer import FramerType
from pymodbus.pdu import ModbusPDU
from trace_file import Line

from nfo_sinus_driver.catalog import Protocol
from nfo_sinus_driver.catalog import load_model

STATUS = 'fieldbus.drive_status'
KEYS = (STATUS, 'fieldbus.inv_st', 'status.frq_act', 'status.spd_act')
#: Two stop bits for the parity: a character is as long, and a pseudo-terminal can do it. With
#: parity these libraries cannot even open it, for the C library says that it has none.
CHAR_FORMAT = '8N2'
_SERIAL = {'bytesize': 8, 'parity': 'N', 'stopbits': 2}
_TIMEOUT = 0.2

#: Unit, register, number of registers.
Read = tuple[int, int, int]


def place(key: str) -> tuple[int, int]:
    """Return register and number of registers of a parameter."""
    where = load_model('sinus_g2')[key].place(Protocol.MODBUS)
    return where.address, where.words


def reads(drives: int) -> list[Read]:
    """Return the reads of one cycle."""
    return [(unit, *place(key)) for unit in range(1, drives + 1) for key in KEYS]


def run_pymodbus(port: str, line: Line, cycle: list[Read]) -> None:
    """Read with pymodbus's synchronous client; the gap is ours, for it keeps none."""
    client = ModbusSerialClient(
        port, framer=FramerType.RTU, baudrate=line.baud_rate, timeout=_TIMEOUT, **_SERIAL
    )
    if not client.connect():
        raise SystemExit('pymodbus cannot open the port')
    for unit, register, count in itertools.cycle(cycle):
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
        for unit, register, count in itertools.cycle(cycle):
            _check(await client.read_holding_registers(register, count=count, device_id=unit))
            await asyncio.sleep(line.gap)

    asyncio.run(run())


def run_minimalmodbus(port: str, line: Line, cycle: list[Read]) -> None:
    """Read with minimalmodbus, which keeps the gap itself."""
    units = {unit: minimalmodbus.Instrument(port, unit) for unit, _, _ in cycle}
    # all share one port
    serial = units[cycle[0][0]].serial
    serial.baudrate, serial.timeout = line.baud_rate, _TIMEOUT
    for name, value in _SERIAL.items():
        setattr(serial, name, value)
    for unit, register, count in itertools.cycle(cycle):
        units[unit].read_registers(register, count)


def _check(answer: ModbusPDU) -> None:
    if answer.isError():
        raise SystemExit(f'no answer on a perfect line: {answer}')


MASTERS: dict[str, Callable[[str, Line, list[Read]], None]] = {
    'pymodbus sync + gap': run_pymodbus,
    'pymodbus async + gap': run_pymodbus_async,
    'minimalmodbus': run_minimalmodbus,
}


def main() -> None:
    """Run a master until somebody ends it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('master', choices=MASTERS)
    parser.add_argument('port')
    parser.add_argument('baud_rate', type=int)
    parser.add_argument('drives', type=int)
    options = parser.parse_args()
    MASTERS[options.master](options.port, Line(options.baud_rate), reads(options.drives))


if __name__ == '__main__':
    main()
