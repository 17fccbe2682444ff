# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A slave that was written by hand from the manual of a VFD-EL, and not from our file of it.

The VFD-EL User Manual, group 9: 2000H and 2001H are commands, 2002H resets, 2100H and 2101H are the
status, 2102H on what is measured; GGnnH is parameter nn of group GG. pymodbus serves it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
import contextlib
import threading
import time
from typing import Any

from pymodbus import datastore
from pymodbus.server import ModbusTcpServer
import pytest
from support import ports
from support.described import SHIPPED
from support.rig import Notes
from support.rig_line import Clock
from support.said import said

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive, DriveSettings
from nfo_sinus_driver.link import BusSettings

_CONTEXT = getattr(datastore, 'ModbusBaseSlaveContext', None)
pytestmark = pytest.mark.skipif(_CONTEXT is None, reason='newer pymodbus has another server')

#: Hz in a second.
_RAMP = 40.0
_PATIENCE = 60.0


class VfdEl(_CONTEXT or object):  # type: ignore[misc]
    """The registers of one drive, and what it does with them."""

    def __init__(self) -> None:
        self.registers = {0x0100: 6000, 0x0101: 5000, 0x0109: 100, 0x010A: 100}
        self.registers |= {0x0200: 3, 0x0201: 3, 0x0900: 1, 0x0902: 3, 0x0903: 0}
        self.registers |= dict.fromkeys((*range(0x2000, 0x2003), *range(0x2100, 0x210B)), 0)
        self.hertz = 0.0
        self.runs = self.back = False
        self.fault = 0
        self._at = time.monotonic()
        self._lock = threading.Lock()

    def validate(self, fc: int, address: int, count: int = 1) -> bool:
        return all(number in self.registers for number in range(address, address + count))

    def getValues(self, fc: int, address: int, count: int = 1) -> list[int]:  # noqa: N802
        with self._lock:
            self._go_on()
            return [self.registers[number] for number in range(address, address + count)]

    def setValues(self, fc: int, address: int, values: list[int]) -> None:  # noqa: N802
        with self._lock:
            self._go_on()
            for number, value in enumerate(values, address):
                self.registers[number] = value
                self._take(number, value)

    def trip(self, code: int) -> None:
        with self._lock:
            self.fault, self.hertz = code, 0.0

    def _take(self, number: int, value: int) -> None:
        if number == 0x2000:
            # bits 0 and 1: 1 stop, 2 run; bits 4 and 5: 1 forward, 2 reverse
            self.runs = {1: False, 2: True}.get(value & 3, self.runs)
            self.back = {1: False, 2: True}.get(value >> 4 & 3, self.back)
        elif number == 0x2002 and value & 2:
            self.fault = 0

    def _go_on(self) -> None:
        now = time.monotonic()
        step, self._at = (now - self._at) * _RAMP, now
        wanted = self.registers[0x2001] / 100 if self.runs and not self.fault else 0.0
        wanted = -wanted if self.back else wanted
        self.hertz = min(wanted, self.hertz + step) if wanted > self.hertz else max(
            wanted, self.hertz - step
        )
        lights = 3 if self.runs else 1 if self.hertz else 0
        turn = 3 << 3 if self.back else 0
        self.registers |= {
            0x2100: self.fault,
            0x2101: (0 if self.fault else lights) | turn | 1 << 8 | 1 << 10,
            0x2102: self.registers[0x2001],
            0x2103: round(abs(self.hertz) * 100),
            0x2104: 12 if self.runs else 0,
            0x2108: 5650,
        }


@contextlib.contextmanager
def served(slave: VfdEl) -> Iterator[int]:
    """Serve a slave as unit 1; yield the port."""
    loop = asyncio.new_event_loop()
    started = threading.Event()
    context = datastore.ModbusServerContext(slaves={1: slave}, single=False)

    async def serve(port: int) -> None:
        server = ModbusTcpServer(context, address=('127.0.0.1', port))
        loop.call_later(0.2, started.set)
        with contextlib.suppress(asyncio.CancelledError):
            await server.serve_forever()

    with ports.reserved() as port:
        task = loop.create_task(serve(port))
        thread = threading.Thread(target=loop.run_until_complete, args=(task,), daemon=True)
        thread.start()
        assert started.wait(_PATIENCE)
        yield port
        loop.call_soon_threadsafe(task.cancel)
        thread.join(_PATIENCE)


class Driven:
    """A driver of it, with the worker of its bus."""

    def __init__(self, port: int) -> None:
        link = BusSettings(port=f'127.0.0.1:{port}', protocol='modbus_tcp').open()
        self.bus = Bus(link)
        self.notes = Notes(Clock())
        settings = DriveSettings(family=str(SHIPPED['delta_vfd_el']), setpoint_timeout=0.0)
        self.drive = Drive(self.bus, settings, self.notes)

    def __enter__(self) -> Driven:
        self.bus.start()
        self.drive.connect(parameters=True).result(_PATIENCE)
        self.drive.activate()
        return self

    def __exit__(self, *_: object) -> None:
        self.drive.stop_for_good(2.0).result(_PATIENCE)
        self.bus.close()

    def answer(self, future: Any) -> str:
        try:
            return str(said(future.result(_PATIENCE)))
        except Exception as error:
            return str(said(error))

    def turn_at(self, slave: VfdEl, frequency: float) -> None:
        self.drive.set_setpoint(frequency)
        self.wait_until(lambda: abs(slave.hertz - frequency) < 0.1)
        self.wait_until(lambda: abs(self.drive.snapshot.frequency - frequency) < 0.1)

    def wait_until(self, condition: Any) -> None:
        end = time.monotonic() + _PATIENCE
        while not condition():
            assert time.monotonic() < end, self.notes.events
            time.sleep(0.02)


def test_it_is_driven() -> None:
    slave = VfdEl()
    with served(slave) as port, Driven(port) as driven:
        drive = driven.drive
        assert drive.parameters.values['ramp.accel'] == 10.0
        assert 'enabled' in driven.answer(drive.enable())
        assert slave.runs and slave.registers[0x2001] == 0
        driven.turn_at(slave, 20.0)
        driven.turn_at(slave, -12.5)
        drive.parameters.change({'ramp.accel': 2.5}).result(_PATIENCE)
        assert slave.registers[0x0109] == 25
        assert 'stop' in driven.answer(drive.stop())
        assert not slave.runs
        driven.wait_until(lambda: slave.hertz == 0)

        driven.answer(drive.enable())
        driven.turn_at(slave, 30.0)
        slave.trip(8)
        driven.wait_until(lambda: not drive.following and not slave.runs)
        assert driven.notes.said('External fault')
        assert driven.answer(drive.acknowledge()) == 'acknowledged 8 EF'
        assert slave.fault == 0 and not slave.runs

        slave.registers[0x0200] = 1
        assert 'set 02.00 to 3' in driven.answer(drive.enable())
    assert not slave.runs
