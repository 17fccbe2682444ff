# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How the driver bears noise: stops a minute, and the longest gaps of the line and of the status.

One simulated drive on a line that takes its time, run by the driver in a process of its own; every
case of noise at two bit rates. Prints a table in Markdown; docs/performance.md explains it.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import pairwise
import signal
import sys
import threading
import time

from driver_rig import DriverRig
from nfo_sinus_msgs.msg import DriveStatus
import page
from rig import PATIENCE, use_domain
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.simulator.control import Client

_BAUD_RATES = (57600, 19200)
_POLL_RATE = 20.0
_SETPOINT_PERIOD = 0.1
#: The case that has to last without a stop, and how often bursts come, s.
_LASTING = 0.03
_BURST_PERIOD = 5.0
#: How late answers are, and the share of late, doubled ones and of those behind stray bytes.
_LATE = 0.15
_SHARE = 0.01
#: The same answers suffer in every run.
_SEED = 11


@dataclass(frozen=True)
class Case:
    """
    One kind of noise.

    :ivar verb: what is injected, and with what.
    """

    title: str
    verb: tuple[object, ...]


CASES = (
    Case('none', ()),
    *(
        Case(f'damaged answers, {100 * share:g} %', ('noise-rate', 'damage', share, _SEED))
        for share in (0.001, 0.01, _LASTING, 0.1)
    ),
    *(
        Case(f'bursts of {milliseconds} ms', ('burst', milliseconds / 1000, _BURST_PERIOD))
        for milliseconds in (50, 100, 200, 300, 500, 800, 1000)
    ),
    Case(f'late answers, {100 * _SHARE:g} %', ('noise-rate', 'delay', _SHARE, _SEED, _LATE)),
    Case(f'doubled answers, {100 * _SHARE:g} %', ('noise-rate', 'double', _SHARE, _SEED)),
    Case(f'stray bytes, {100 * _SHARE:g} %', ('noise-rate', 'noise', _SHARE, _SEED)),
)
_QUICK = (CASES[0], CASES[3], CASES[10])


class _Run(threading.Thread):
    """Keeps a drive enabled with set-points, and notes what its status says."""

    def __init__(self, rig: DriverRig) -> None:
        super().__init__(daemon=True)
        self._rig = rig
        name = rig.names[0]
        node = rig.listener
        self._publisher = node.create_publisher(Float32, f'/{name}/setpoint', 1)
        self._enable = node.create_client(SetBool, f'/{name}/enable')
        self._acknowledge = node.create_client(Trigger, f'/{name}/fault_ack')
        node.create_subscription(DriveStatus, f'/{name}/status', self._on_status, 50)
        #: When each status came, and when the drive was stopped.
        self.heard: list[float] = []
        self.stopped: list[float] = []
        self._enabled = False
        self._ended = threading.Event()

    def _on_status(self, message: DriveStatus) -> None:
        now = time.monotonic()
        self.heard.append(now)
        if self._enabled and not message.enabled:
            self.stopped.append(now)
        self._enabled = message.enabled

    def enable(self) -> None:
        """
        Let the drive run.

        :raises RuntimeError: it does not.
        """
        deadline = time.monotonic() + PATIENCE
        while not self._enabled:
            if time.monotonic() > deadline:
                raise RuntimeError(f'it cannot be enabled:\n{self._rig.log}')
            self._try_to_enable()
            time.sleep(0.2)

    def run(self) -> None:
        """Publish set-points, and enable the drive again after each stop."""
        due = 0.0
        while not self._ended.wait(_SETPOINT_PERIOD):
            self._publisher.publish(Float32(data=20.0))
            if not self._enabled and time.monotonic() >= due:
                self._try_to_enable()
                due = time.monotonic() + 1.0

    def _try_to_enable(self) -> None:
        for client, request in (
            (self._acknowledge, Trigger.Request()),
            (self._enable, SetBool.Request(data=True)),
        ):
            if client.wait_for_service(PATIENCE):
                client.call(request, timeout_sec=PATIENCE)

    def end(self) -> None:
        """End."""
        self._ended.set()
        self.join()


def main() -> None:
    """Measure and print the table."""
    options = _parser().parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    use_domain(options.domain)
    cases = _QUICK if options.quick else CASES
    rows = []
    for baud_rate in options.baud or _BAUD_RATES:
        for case in cases:
            lasting = case.verb[:3] == ('noise-rate', 'damage', _LASTING)
            seconds = 60 * options.minutes if lasting else options.seconds
            rows.append(_measure(case, baud_rate, 10.0 if options.quick else seconds))
            print(rows[-1], file=sys.stderr, flush=True)
    titles = ('noise', 'bit/s', 's', 'stops', 'stops a minute', 'line unused, s', 'no status, s')
    lines = [f'| {" | ".join(titles)} |', '|---' + '|---:' * (len(titles) - 1) + '|', *rows]
    text = '\n'.join(lines)
    print(text)
    if options.write:
        page.write(text, 'noise')


def _measure(case: Case, baud_rate: int, seconds: float) -> str:
    """Return the row of a case."""
    with DriverRig(baud_rate, 1, poll_rate=_POLL_RATE) as rig, Client.at_link(rig.port) as drives:
        run = _Run(rig)
        run.enable()
        run.start()
        time.sleep(2.0)
        if case.verb:
            drives.inject(*case.verb)
        begin = time.monotonic()
        time.sleep(seconds)
        end = time.monotonic()
        run.end()
        stops = sum(begin <= at < end for at in run.stopped)
        silence = _longest_gap(rig.requests(), begin, end)
        gap = _longest_gap(run.heard, begin, end)
    rate = f'{60 * stops / (end - begin):.1f}'
    figures = (f'{seconds:.0f}', str(stops), rate, f'{silence:.2f}', f'{gap:.2f}')
    return f'| {" | ".join((case.title, str(baud_rate), *figures))} |'


def _longest_gap(moments: list[float], begin: float, end: float) -> float:
    """Return the longest time between two moments, or to the ends, s."""
    within = [begin, *(at for at in moments if begin < at < end), end]
    return max(after - before for before, after in pairwise(within))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    add = parser.add_argument
    add('--seconds', type=float, default=60.0, help='how long each case lasts (default: 60)')
    add(
        '--minutes',
        type=float,
        default=10.0,
        help=f'how long {100 * _LASTING:g} %% of damaged answers last (default: 10)',
    )
    add('--baud', type=int, nargs='+', help='bit rates (default: both)')
    add('--quick', action='store_true', help='few cases for a moment, to see that it works')
    add('--write', action='store_true', help=f'put the table into docs/{page.PAGE.name}')
    add('--domain', type=int, metavar='ID', help='ROS domain (default: one of its own)')
    return parser


if __name__ == '__main__':
    main()
