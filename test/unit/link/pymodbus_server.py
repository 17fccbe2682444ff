# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Pymodbus's own servers, of 3.6.9 and of today, in a thread of their own."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
import contextlib
import logging
import os
import select
import threading
import tty
from typing import Any

from pymodbus.server import ModbusSerialServer, ModbusTcpServer

try:
    from pymodbus.device import ModbusDeviceIdentification
except ImportError:
    from pymodbus.pdu.device import ModbusDeviceIdentification
from pymodbus import datastore, framer as framers
from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext
from support import ports

OLD = hasattr(datastore, 'ModbusSlaveContext')
PATIENCE = 20
#: The registers that it has; each begins with its own number as its value.
REGISTERS = range(0x200, 0x500)
#: Units that it has.
UNITS = (1, 2)

logging.getLogger('pymodbus').setLevel(logging.CRITICAL)


def _context() -> ModbusServerContext:
    def unit() -> Any:
        # the library counts from 1
        block = ModbusSequentialDataBlock(REGISTERS[0] + 1, list(REGISTERS))
        if OLD:
            return datastore.ModbusSlaveContext(hr=block)
        return datastore.ModbusDeviceContext(hr=block)

    units = {number: unit() for number in UNITS}
    if OLD:
        return ModbusServerContext(slaves=units, single=False)
    return ModbusServerContext(devices=units, single=False)


def _identity() -> ModbusDeviceIdentification:
    return ModbusDeviceIdentification(
        info_name={
            'VendorName': 'NFO Drives AB',
            'ProductCode': '',
            'MajorMinorRevision': '4.30 / 4018',
            'VendorUrl': 'http://www.nfo.se',
            'ProductName': 'NFO Sinus',
            'ModelName': '1.50/400',
        }
    )


@contextlib.contextmanager
def _served(make: Any) -> Iterator[None]:
    loop = asyncio.new_event_loop()
    listening = threading.Event()
    failed: list[BaseException] = []

    async def serve() -> None:
        try:
            server = make()
            serving = asyncio.ensure_future(server.serve_forever())
            while not server.transport and not serving.done():
                await asyncio.sleep(0.01)
            listening.set()
            await stopped.wait()
            await server.shutdown()
            with contextlib.suppress(asyncio.CancelledError):
                await serving
        except BaseException as error:
            failed.append(error)
            listening.set()

    stopped = asyncio.Event()
    thread = threading.Thread(target=loop.run_until_complete, args=(serve(),), daemon=True)
    thread.start()
    assert listening.wait(PATIENCE)
    assert not failed, failed
    try:
        yield
    finally:
        loop.call_soon_threadsafe(stopped.set)
        thread.join(PATIENCE)
        assert not thread.is_alive()
        loop.close()


@contextlib.contextmanager
def tcp_server() -> Iterator[int]:
    """A TCP server; the number of its port."""
    with ports.reserved() as port:
        address = ('127.0.0.1', port)
        with _served(lambda: ModbusTcpServer(_context(), identity=_identity(), address=address)):
            yield port


@contextlib.contextmanager
def serial_server(framer: str) -> Iterator[str]:
    """A serial server at the far end of a null modem cable; the path of the near end."""
    with null_modem() as (near, far):

        def make() -> ModbusSerialServer:
            kinds = framers.Framer if OLD else framers.FramerType
            kind = kinds.ASCII if framer == 'ascii' else kinds.RTU
            return ModbusSerialServer(_context(), framer=kind, identity=_identity(), port=far)

        with _served(make):
            yield near


@contextlib.contextmanager
def null_modem() -> Iterator[tuple[str, str]]:
    """Two pseudo-terminals; what goes into one comes out of the other."""
    ends = [os.openpty() for _ in range(2)]
    for near, far in ends:
        tty.setraw(near)
        tty.setraw(far)
    stop = threading.Event()
    first, second = ends[0][0], ends[1][0]

    def carry() -> None:
        while not stop.is_set():
            for fd in select.select([first, second], [], [], 0.02)[0]:
                os.write(second if fd == first else first, os.read(fd, 1000))

    thread = threading.Thread(target=carry, daemon=True)
    thread.start()
    try:
        yield os.ttyname(ends[0][1]), os.ttyname(ends[1][1])
    finally:
        stop.set()
        thread.join(PATIENCE)
        for pair in ends:
            for fd in pair:
                os.close(fd)
