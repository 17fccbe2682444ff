# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The processes of a measurement: the simulated line, and whoever drives it."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from dataclasses import dataclass
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import time

import resources
import trace_file
from trace_file import Frame, Line

from nfo_sinus_driver.demo.bench import own_domain

#: A process that has not done by then what it should never will, s.
PATIENCE = 60.0
#: The same for each drive on the line, s.
_PATIENCE_DRIVE = 15.0
#: How much of the log is told, characters.
_TOLD = 2000
#: Where these programs are.
FOLDER = Path(__file__).parent
#: What this process keeps until it ends.
_KEPT = contextlib.ExitStack()


def use_domain(chosen: int | None) -> None:
    """Use a ROS domain that was chosen, or one of its own: nobody else's drives may hear this."""
    number = _KEPT.enter_context(own_domain()) if chosen is None else chosen
    os.environ['ROS_DOMAIN_ID'] = str(number)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'


@dataclass(frozen=True)
class Window:
    """
    What happened in a while.

    :ivar core: how much of one core the watched process took.
    :ivar others: how much everybody took who has nothing to do with the measurement.
    :ivar stalls: from when to when a core of the machine stood still, s.
    """

    frames: list[Frame]
    seconds: float
    core: float
    others: float
    stalls: list[tuple[float, float]]

    def figures(self) -> dict[str, float]:
        """Return what was taken of the processor: % of a core, and ms for each transaction."""
        count = trace_file.transactions(self.frames)
        cost = {'cpu': 100 * self.core, 'others': 100 * self.others}
        if count:
            cost['cpu_transaction'] = 1e3 * self.core * self.seconds / count
        return cost

    def stood_still(self, start: float, seconds: float) -> float:
        """Return for how long at most a core stood still meanwhile, s."""
        end = start + seconds
        return max([0.0, *(min(b, end) - max(a, start) for a, b in self.stalls)])


class Rig(contextlib.ExitStack):
    """A simulated line, paced and traced; ends all that it started."""

    def __init__(
        self, baud_rate: int, drives: int, char_format: str, protocol: str = 'modbus_rtu'
    ) -> None:
        super().__init__()
        folder = self.enter_context(tempfile.TemporaryDirectory(prefix='nfo_sinus_bench_'))
        self.line = Line(baud_rate, protocol)
        self.drives = drives
        self.folder = Path(folder)
        self.port = str(Path(folder, 'line'))
        self._trace = Path(folder, 'trace')
        self._log = Path(folder, 'log')
        self._stalls = Path(folder, 'stalls')
        self._processes: list[subprocess.Popen[str]] = []
        addresses = [f'--address={number}' for number in range(1, drives + 1)]
        with contextlib.ExitStack() as failing:
            failing.push(self)
            simulator = self.start(
                *(executable('simulator'), '--link', self.port, '--baud-rate', str(baud_rate)),
                *('--char-format', char_format, '--paced', '--trace', str(self._trace)),
                *('--protocol', protocol, '--model', self.line.model),
                *('--boot-time', '0', *addresses),
            )
            self.wait_for(lambda: 'serving' in self.log, simulator)
            with self._stalls.open('ab') as stalls:
                for core in os.sched_getaffinity(0):
                    self.start_script('stalls.py', str(core), stdout=stalls.fileno())
            failing.pop_all()

    @property
    def log(self) -> str:
        """What all processes said."""
        return self._log.read_text(errors='replace')

    def start(self, *command: str, stdout: int | None = None) -> subprocess.Popen[str]:
        """Start a process that ends with the rig."""
        with self._log.open('ab') as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log if stdout is None else stdout,
                stderr=log,
                text=True,
                start_new_session=True,
            )
        self._processes.append(process)
        self.callback(_end, process)
        return process

    def start_script(self, name: str, *arguments: str, **how: int) -> subprocess.Popen[str]:
        """Start one of the programs beside this one."""
        return self.start(sys.executable, str(FOLDER / name), *arguments, **how)

    def watch(self, process: subprocess.Popen[str], seconds: float) -> Window:
        """Let time pass; return what the line carried and what the process cost meanwhile."""
        watched_since = self.begin_watch(process)
        time.sleep(seconds)
        return watched_since()

    def begin_watch(self, process: subprocess.Popen[str]) -> Callable[[], Window]:
        """Return what tells later what happened from now on."""
        start, cost, others = time.monotonic(), resources.of_process(process.pid), self._others()

        def watched() -> Window:
            now = time.monotonic()
            if process.poll() is not None:
                raise RuntimeError(f'a process has ended:\n{self.log[-_TOLD:]}')
            return Window(
                trace_file.frames_of(self._trace, start, now),
                now - start,
                (resources.of_process(process.pid) - cost) / (now - start),
                (self._others() - others) / (now - start),
                self.stalls(),
            )

        return watched

    def _others(self) -> float:
        return resources.of_all_but([os.getpid(), *(process.pid for process in self._processes)])

    def end(self, process: subprocess.Popen[str]) -> None:
        """End a process before the rig ends."""
        _end(process)
        self._processes.remove(process)

    def frames(self, start: float = 0.0) -> list[Frame]:
        """Return all that the line has carried since a moment, s."""
        return trace_file.frames_of(self._trace, start)

    def stalls(self) -> list[tuple[float, float]]:
        """Return from when to when a core of the machine stood still, s."""
        # the last line may not be whole yet
        lines = self._stalls.read_text().split('\n')[:-1]
        return [(float(begin), float(end)) for begin, end in map(str.split, lines)]

    def requests(self) -> list[float]:
        """Return when each request began on the line, be it as noisy as it may."""
        return trace_file.requests_of(self._trace)

    def wait_for(self, condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
        """
        Wait for what a process should bring about.

        :raises RuntimeError: it ended, or that never came; says what was logged.
        """
        # all of them start one after another on one line
        deadline = time.monotonic() + PATIENCE + _PATIENCE_DRIVE * self.drives
        while not condition():
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f'it does not do as it should:\n{self.log[-_TOLD:]}')
            time.sleep(0.05)


def executable(name: str) -> str:
    """Return the path of one of the package's programs."""
    path = shutil.which(name)
    if path is None:
        raise SystemExit(f'there is no {name}: run this by make bench, or by tools/run')
    return path


def _end(process: subprocess.Popen[str]) -> None:
    """End a process, gently first."""
    if process.poll() is None:
        # SIGINT is ignored by all that a background job starts
        process.terminate()
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
