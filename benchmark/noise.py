# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How the driver bears noise: stops a minute, and the longest gaps of the line and of the status.

One drive that runs, and every case of noise at two bit rates.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
import threading
import time

from nfo_sinus_msgs.msg import DriveStatus
from rig import DRIVER, PATIENCE, Rig
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.simulator.control import Client

_BAUD_RATES = (57600, 19200)
_POLL_RATE = 20.0
_SETPOINT_PERIOD = 0.1
#: How often bursts come, s.
_BURST_PERIOD = 5.0
#: How late answers are, and the share of late, doubled ones and of those behind stray bytes.
_LATE = 0.15
_SHARE = 0.01
#: The same answers suffer in every run.
_SEED = 11
#: What is injected, by its title.
CASES: dict[str, tuple[object, ...]] = {
    'none': (),
    **{
        f'damaged answers, {100 * share:g} %': ('noise-rate', 'damage', share, _SEED)
        for share in (0.001, 0.01, 0.03, 0.1)
    },
    **{
        f'bursts of {milliseconds} ms': ('burst', milliseconds / 1000, _BURST_PERIOD)
        for milliseconds in (50, 100, 200, 300, 500, 800, 1000)
    },
    f'late answers, {100 * _SHARE:g} %': ('noise-rate', 'delay', _SHARE, _SEED, _LATE),
    f'doubled answers, {100 * _SHARE:g} %': ('noise-rate', 'double', _SHARE, _SEED),
    f'stray bytes, {100 * _SHARE:g} %': ('noise-rate', 'noise', _SHARE, _SEED),
}
COLUMNS = (
    ('stops', 'stops', 0),
    ('stops a minute', 'rate', 1),
    ('line unused, s', 'unused', 2),
    ('no status, s', 'no_status', 2),
)


class _Run(threading.Thread):
    """Keeps a drive enabled with set-points, and notes what its status says."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(daemon=True)
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
                raise RuntimeError('it cannot be enabled')
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


def measure(seconds: float, cases: int = len(CASES)) -> Iterator[tuple[str, dict[str, float]]]:
    """Yield the title and the figures of each row; each case lasts so many seconds."""
    for baud_rate in _BAUD_RATES:
        for title, injected in list(CASES.items())[:cases]:
            yield f'{title}, {baud_rate} bit/s', _measure(baud_rate, injected, seconds)


def _measure(baud_rate: int, injected: tuple[object, ...], seconds: float) -> dict[str, float]:
    settings = {'poll_rate': _POLL_RATE}
    with Rig(DRIVER, baud_rate, 1, **settings) as rig, Client.at_link(rig.port) as drives:
        run = _Run(rig)
        run.enable()
        run.start()
        time.sleep(2.0)
        if injected:
            drives.inject(*injected)
        begin = time.monotonic()
        time.sleep(seconds)
        end = time.monotonic()
        run.end()
        stops = sum(begin <= at < end for at in run.stopped)
        return {
            'stops': stops,
            'rate': 60 * stops / (end - begin),
            'unused': _longest_gap(rig.requests(), begin, end),
            'no_status': _longest_gap(run.heard, begin, end),
        }


def _longest_gap(moments: list[float], begin: float, end: float) -> float:
    """Return the longest time between two moments, or to the ends, s."""
    within = [begin, *(at for at in moments if begin < at < end), end]
    return max(after - before for before, after in pairwise(within))
