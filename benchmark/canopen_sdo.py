# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
SDO round trips a second over a LAWICEL adapter: the driver's link beside the library canopen.

Each reads four bytes of one object over and over, by turns, each turn in a process of its own. The
adapter is a process that answers every request at once, so that what is measured is the client. It
counts its answers: the driver does not believe one that is the same as the one before, and comes
sooner than two frames take on the bus, before it has waited for another.

    tools/run python benchmark/canopen_sdo.py [--seconds 2] [--turns 5]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import itertools
import json
import multiprocessing
import os
import re
import statistics
import subprocess
import sys
import time
import tty
from typing import Any

_UNIT, _INDEX = 5, 0x2013
_RATE = 1_000_000
_REQUEST = re.compile(rb't6([0-7][0-9A-F])840(.{6})0{8}\r', re.IGNORECASE)
_WARM_UP = 200
_PATIENCE = 2.0
_SIZE = 4


def serve(master: int) -> None:
    """Be an adapter with a node behind it that answers each read at once."""
    line = b''
    count = itertools.count()
    while True:
        *lines, line = (line + os.read(master, 4096)).split(b'\r')
        said = b''
        for one in lines:
            match = _REQUEST.fullmatch(one + b'\r')
            # SDO requests are 600h and the node, answers 580h and the node
            if match is not None:
                identifier = b'%03X' % (0x580 + int(match[1], 16))
                value = b'%08X' % next(count)
                said += b'z\rt' + identifier + b'843' + match[2] + value + b'\r'
            elif one:
                said += b'z\r' if one[:1] == b't' else b'\r'
        os.write(master, said)


def ours(port: str) -> Callable[[], bytes]:
    """Return what reads by the driver's link."""
    from nfo_sinus_driver.link.canopen_link import CanopenLink
    from nfo_sinus_driver.link.interface import Address, LineSettings

    link = CanopenLink.on_port(port, LineSettings(baud_rate=_RATE, response_timeout=_PATIENCE))
    link.open()
    address = Address('object', _INDEX, None, _SIZE)
    return lambda: link.read(_UNIT, address).data


def canopens(port: str) -> Callable[[], bytes]:
    """Return what reads by the library canopen, over python-can's slcan."""
    import can
    import canopen

    bus = can.Bus(interface='slcan', channel=port, bitrate=_RATE, sleep_after_open=0.0)
    network = canopen.Network(bus)
    network.connect()
    node = canopen.RemoteNode(_UNIT, canopen.ObjectDictionary())
    network.add_node(node)
    node.sdo.RESPONSE_TIMEOUT = _PATIENCE
    return lambda: node.sdo.upload(_INDEX, 0)


CLIENTS: dict[str, Callable[[str], Callable[[], bytes]]] = {'driver': ours, 'canopen': canopens}


def measure(name: str, seconds: float) -> dict[str, float]:
    """Read for some time; return round trips a second, and CPU time of each, ms."""
    master, slave = os.openpty()
    tty.setraw(slave)
    adapter = multiprocessing.get_context('fork').Process(
        target=serve, args=(master,), daemon=True
    )
    adapter.start()
    read = CLIENTS[name](os.ttyname(slave))
    for _ in range(_WARM_UP):
        assert len(read()) == _SIZE
    count, cpu, began = 0, time.process_time(), time.perf_counter()
    while time.perf_counter() < began + seconds:
        read()
        count += 1
    taken, cpu = time.perf_counter() - began, time.process_time() - cpu
    adapter.terminate()
    return {'rate': count / taken, 'cpu': 1000 * cpu / count}


def _in_a_process(name: str, seconds: float) -> Any:
    command = [sys.executable, __file__, '--only', name, '--seconds', str(seconds)]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


def main() -> None:
    """Measure by turns and print medians."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0])
    parser.add_argument('--seconds', type=float, default=2.0, help='of each turn (2)')
    parser.add_argument('--turns', type=int, default=5, help='of each client (5)')
    parser.add_argument('--only', choices=CLIENTS, help='one turn of one client, as JSON')
    options = parser.parse_args()
    if options.only:
        print(json.dumps(measure(options.only, options.seconds)), flush=True)
        # threads of a library may go on
        os._exit(0)
    found: dict[str, list[dict[str, float]]] = {name: [] for name in CLIENTS}
    for _ in range(options.turns):
        for name in CLIENTS:
            found[name].append(_in_a_process(name, options.seconds))
    rates = {}
    print('| client | SDO a second | least, most | CPU each (ms) |\n|---|---|---|---|')
    for name, turns in found.items():
        each = [turn['rate'] for turn in turns]
        rates[name] = statistics.median(each)
        cpu = statistics.median(turn['cpu'] for turn in turns)
        print(f'| {name} | {rates[name]:.0f} | {min(each):.0f}, {max(each):.0f} | {cpu:.2f} |')
    ratio = rates['driver'] / rates['canopen']
    print(f'\n{ratio:.2f} times canopen (aim: at least 2); load {os.getloadavg()[0]:.1f}')


if __name__ == '__main__':
    main()
