# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Masters of others run the simulated G2 and Optimal from enable to reset, by the manuals' numbers.

MODE and SCMD of the G2 are [M0 tables 5, 17, 18], MODE and SMODE of the Optimal [M1].
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import re
import shutil
import subprocess
from typing import Any

from hal import wait_until
from pymodbus.client import ModbusSerialClient
import pytest

from nfo_sinus_driver.simulator.simulator import Simulator

MODE, COMMAND, SETPOINT, ACTUAL, STATUS, STATUS_WITH_ACK = 0x294, 0x298, 0x3FC, 0x400, 0x2A5, 0x2A4
BUS, RUN, STOP = 3, 0x101, 0
#: Overload, of both.
FAULT = 5
QUICK = {'control.accel': 0.5, 'control.retard': 0.5}
#: Generous: nothing here is about speed, s.
_PATIENCE = 10.0
# its name changed with pymodbus 3.10
_NAMES = ModbusSerialClient.read_holding_registers.__kwdefaults__ or {}
_UNIT = {'device_id': 1} if 'device_id' in _NAMES else {'slave': 1}

Read = Callable[[int], int]
Write = Callable[[int, int], object]


@contextlib.contextmanager
def pymodbus(port: str) -> Iterator[tuple[Read, Write]]:
    client: Any = ModbusSerialClient(port, timeout=_PATIENCE)
    assert client.connect()
    try:
        yield (
            lambda register: client.read_holding_registers(register, count=1, **_UNIT).registers[0],
            lambda register, word: client.write_register(register, word, **_UNIT),
        )
    finally:
        client.close()


@contextlib.contextmanager
def minimalmodbus(port: str) -> Iterator[tuple[Read, Write]]:
    module = pytest.importorskip('minimalmodbus', reason='minimalmodbus is not installed')
    instrument = module.Instrument(port, 1)
    instrument.serial.timeout = _PATIENCE
    try:
        yield (
            instrument.read_register,
            lambda register, word: instrument.write_register(register, word, functioncode=6),
        )
    finally:
        instrument.serial.close()


@contextlib.contextmanager
def mbpoll(port: str) -> Iterator[tuple[Read, Write]]:
    if shutil.which('mbpoll') is None:
        pytest.skip('mbpoll is not installed')

    def ask(register: int, *words: int) -> str:
        # once, and registers are counted from 0
        command = ['mbpoll', '-1', '-0', '-a', '1', '-o', str(_PATIENCE), '-t', '4', '-m', 'rtu']
        command += ['-b', '19200', '-P', 'even', '-r', str(register), port, *map(str, words)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=True)
        return done.stdout

    def read(register: int) -> int:
        found = re.search(rf'\[{register}\]:\s+(\d+)', ask(register))
        assert found is not None
        return int(found[1])

    yield read, ask


@pytest.mark.parametrize('model', ['sinus_g2', 'sinus_optimal'])
@pytest.mark.parametrize('master', [pymodbus, minimalmodbus, mbpoll], ids=lambda one: one.__name__)
def test_from_enable_to_reset(master: Any, model: str) -> None:
    with (
        Simulator(model=model, settings=QUICK if model == 'sinus_g2' else {}) as simulator,
        master(str(simulator.port)) as (read, write),
    ):

        def turns(tenths: int) -> bool:
            actual = read(ACTUAL)
            return abs((actual ^ 0x8000) - 0x8000 - tenths) <= 3

        write(MODE, BUS)
        write(SETPOINT, 200)
        write(COMMAND, RUN)
        wait_until(lambda: turns(200), 'it runs forward')
        write(SETPOINT, 300)
        wait_until(lambda: turns(300), 'it follows')
        write(SETPOINT, 0x10000 - 200)
        wait_until(lambda: turns(-200), 'it runs in reverse')
        write(COMMAND, STOP)
        wait_until(lambda: turns(0), 'it stops')
        write(COMMAND, RUN)
        wait_until(lambda: turns(-200), 'it runs again')
        simulator.inject('fault', FAULT)
        wait_until(lambda: read(STATUS) == FAULT, 'it shows the fault')
        wait_until(lambda: simulator.state()['frequency'] == 0, 'the motor is released')
        write(COMMAND, STOP)
        assert read(STATUS) == FAULT, 'reading it acknowledges nothing'
        read(STATUS_WITH_ACK)
        wait_until(lambda: read(STATUS) != FAULT, 'reading that acknowledges it')
        assert simulator.state()['frequency'] == 0
