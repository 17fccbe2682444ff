# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
What frames for others on a CAN bus cost the driver, and whether they delay a stop.

A simulated G2 behind a LAWICEL adapter, which hands every frame of the bus on; the driver's part
without ROS has it run and polls it a hundred times a second. By turns nobody else speaks, or
others send 1000 frames a second: processor time of the driver, status a second, and how long after
`stop` was called the request that stops the motor is on the bus.

    tools/run python benchmark/canopen_traffic.py [--seconds 10] [--turns 3] [--stops 10]
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
from pathlib import Path
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

_BIT_RATE = 500_000
_TRAFFIC = 1000
#: As often with others as without, so that only they make a difference, Hz.
_POLL_RATE = 100.0
_PATIENCE = 60.0
#: What a client asks of node 1, and that it writes: SDO requests are 600h and the node.
_ASKS = 0x601
_DOWNLOAD = 0x20
#: MODE and SCMD [M0 table 13].
_STOPPED_BY = (0x2022, 0x2023)


def drive(port: str, control: str, seconds: float, turns: int, stops: int) -> list[dict[str, Any]]:
    """Run the motor and measure; in a process of its own."""
    from nfo_sinus_driver.bus import Bus
    from nfo_sinus_driver.drive import Drive, DriveSettings
    from nfo_sinus_driver.link import BusSettings, open_link
    from nfo_sinus_driver.simulator.control import Client

    class Counting:
        """Counts what is polled; everything else is of no interest here."""

        polls = 0

        def on_snapshot(self, _: object) -> None:
            self.polls += 1

        def __getattr__(self, name: str) -> Any:
            return lambda *_: None

    listener = Counting()
    line = BusSettings(protocol='canopen', baud_rate=_BIT_RATE, response_timeout=1.0).line
    bus = Bus(open_link('canopen', port, line))
    bus.start()
    settings = DriveSettings(setpoint_timeout=0.0, poll_rate=_POLL_RATE)
    motor = Drive(bus, settings, listener)
    motor.connect().result(_PATIENCE)
    motor.activate()
    ended = threading.Event()

    def publish() -> None:
        while not ended.wait(0.05):
            motor.set_setpoint(20.0)

    threading.Thread(target=publish, daemon=True).start()
    found = []
    with Client(control) as simulated:
        for turn in range(2 * turns):
            traffic = _TRAFFIC if turn % 2 else 0
            simulated.inject('traffic', traffic)
            motor.enable().result(_PATIENCE)
            time.sleep(1.0)
            polls, cpu, began = listener.polls, time.process_time(), time.monotonic()
            time.sleep(seconds)
            taken = time.monotonic() - began
            used = {
                'traffic': traffic,
                'cpu': (time.process_time() - cpu) / taken,
                'polls': (listener.polls - polls) / taken,
                'stops': [],
            }
            for _ in range(stops):
                used['stops'].append(time.monotonic())
                motor.stop().result(_PATIENCE)
                motor.enable().result(_PATIENCE)
                time.sleep(0.2)
            motor.stop().result(_PATIENCE)
            found.append(used)
        simulated.inject('traffic', 0)
    ended.set()
    motor.disconnect(4.0).result(_PATIENCE)
    bus.close()
    return found


def stop_times(asked: list[float], trace: Path) -> list[float]:
    """Return how long after each stop was asked for its first request came in, s."""
    sent = []
    for line in trace.read_text().splitlines():
        frame = json.loads(line)
        data = bytes.fromhex(frame['hex'])
        if frame['direction'] != 'request' or int.from_bytes(data[:2], 'big') != _ASKS:
            continue
        index = int.from_bytes(data[3:5], 'little')
        if data[2] & 0xE0 == _DOWNLOAD and index in _STOPPED_BY:
            sent.append(frame['first'])
    return [min((at for at in sent if at >= one), default=math.nan) - one for one in asked]


def main() -> None:
    """Measure by turns and print medians."""
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0])
    parser.add_argument('--seconds', type=float, default=10.0, help='of each turn (10)')
    parser.add_argument('--turns', type=int, default=3, help='of each kind (3)')
    parser.add_argument('--stops', type=int, default=10, help='in each turn (10)')
    parser.add_argument('--drive', nargs=2, metavar='PATH', help='port and control; as JSON')
    options = parser.parse_args()
    measure = options.seconds, options.turns, options.stops
    if options.drive:
        print(json.dumps(drive(*options.drive, *measure)))
        return
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as running:
        folder = Path(name)
        port, control, trace = (str(folder / one) for one in ('port', 'control', 'trace'))
        simulator = subprocess.Popen(
            [
                sys.executable, '-m', 'nfo_sinus_driver.simulator', '--protocol', 'canopen',
                '--address', '1', '--baud-rate', str(_BIT_RATE), '--link', port, '--paced',
                '--control', control, '--trace', trace,
            ],
            stdout=subprocess.PIPE,
        )
        running.callback(simulator.wait)
        running.callback(simulator.terminate)
        assert simulator.stdout is not None and b'serving' in simulator.stdout.readline()
        words = ['--seconds', '--turns', '--stops']
        given = [text for pair in zip(words, map(str, measure), strict=True) for text in pair]
        done = subprocess.run(
            [sys.executable, __file__, '--drive', port, control, *given],
            check=True, stdout=subprocess.PIPE,
        )
        turns = json.loads(done.stdout)
        shares = {}
        print('| frames of others a second | CPU, % of a core | status a second '
              '| stop on the bus, ms: median | most |\n|---|---|---|---|---|')
        for traffic in (0, _TRAFFIC):
            mine = [turn for turn in turns if turn['traffic'] == traffic]
            times = [
                1000 * one
                for turn in mine
                for one in stop_times(turn['stops'], Path(trace))
            ]
            shares[traffic] = statistics.median(turn['cpu'] for turn in mine)
            polls = statistics.median(turn['polls'] for turn in mine)
            print(f'| {traffic} | {100 * shares[traffic]:.1f} | {polls:.0f} '
                  f'| {statistics.median(times):.1f} | {max(times):.1f} |')
        print(f'{100 * (shares[_TRAFFIC] - shares[0]):.1f} % of a core more; 5 is the aim')


if __name__ == '__main__':
    main()
