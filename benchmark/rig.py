# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The one rig of all measurements: a simulated line, a master on it, and clients of that master.

The line is a pseudo-terminal, for masters are measured as they are installed: processes with
serial ports of their own. Its bytes take the time that they take on a wire.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import contextlib
import ctypes
from dataclasses import dataclass
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

from nfo_sinus_msgs.msg import DriveStatus, InvSt, Telemetry
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float32
from std_srvs.srv import SetBool
import trace_file
from trace_file import Frame, Line

DRIVER, PEER = 'driver', 'peer'
#: A process that has not done by then what it should never will, s; and more for each drive.
PATIENCE = 60.0
_PATIENCE_DRIVE = 15.0
#: From the moment that every drive is polled until nothing is special any more, s.
_SETTLE = 2.0
#: How much of the log is shown, characters.
_SHOWN = 2000
_FOLDER = Path(__file__).parent
_FORMATS = {'modbus_rtu': '8E1', 'classic': '7E1', 'movitrac': '8N1'}
#: The five topics of a drive that both masters publish.
TOPICS = {
    'status': DriveStatus,
    'inv_st': InvSt,
    'telemetry': Telemetry,
    'actual_speed': Float32,
    'actual_frequency': Float32,
}
_libc = ctypes.CDLL(None, use_errno=True)


def cpu_time(pid: int) -> float:
    """Return the time that all threads of a process have taken, s, to the nanosecond."""
    clock = ctypes.c_int()
    error = _libc.clock_getcpuclockid(pid, ctypes.byref(clock))
    if error:
        raise OSError(error, f'process {pid} has no clock: {os.strerror(error)}')
    return time.clock_gettime(clock.value)


def memory(pid: int) -> float:
    """Return what a process has in memory, shared parts divided among all who share them, MB."""
    lines = Path(f'/proc/{pid}/smaps_rollup').read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith('Pss:'))


@dataclass(frozen=True)
class Window:
    """What happened in a while: the frames of the line, and the share of a core of the master."""

    frames: list[Frame]
    seconds: float
    core: float

    def figures(self) -> dict[str, float]:
        """Return what was taken of the processor: % of a core, and ms for each transaction."""
        count = sum(frame.is_request for frame in self.frames)
        return {
            'cpu': 100 * self.core,
            'cpu_transaction': 1e3 * self.core * self.seconds / max(count, 1),
        }


class Listener(Node):
    """
    A client of the master, and an audience to everything that flows, as a plotting tool would be.

    The audience is a node that is never spun: its messages arrive, and are dropped. So it costs
    the master what any subscriber costs, and the benchmark next to nothing.
    """

    def __init__(self, master: str, names: Sequence[str], context: Context) -> None:
        super().__init__(f'bench_listener_{master}', context=context)
        self.audience = Node(f'bench_audience_{master}', context=context)
        #: Of which drives something was measured.
        self.active: set[str] = set()
        for name in names:
            for topic, kind in TOPICS.items():
                self.audience.create_subscription(kind, f'/{name}/{topic}', lambda _: None, 10)
            self.create_subscription(
                Float32, f'/{name}/actual_frequency', lambda _, name=name: self.active.add(name), 10
            )

    def leave(self) -> None:
        """Subscribe to nothing any more."""
        for node in (self, self.audience):
            for subscription in list(node.subscriptions):
                node.destroy_subscription(subscription)

    def call(self, kind: type, service: str, **fields: object) -> Any:
        """Call a service once; return its response."""
        client = self.create_client(kind, service)
        try:
            if not client.wait_for_service(PATIENCE):
                raise RuntimeError(f'there is no service {service}')
            response = client.call(kind.Request(**fields), timeout_sec=PATIENCE)
        finally:
            self.destroy_client(client)
        if response is None:
            raise RuntimeError(f'{service} does not answer')
        return response


class Rig(contextlib.ExitStack):
    """A simulated line with a master on it, settled; ends all that it started."""

    def __init__(
        self,
        master: str,
        baud_rate: int,
        drives: int,
        protocol: str = 'modbus_rtu',
        **settings: float,
    ) -> None:
        super().__init__()
        self.line = Line(baud_rate, protocol)
        #: Unlike any other drive's name: what is said to these must never reach a motor.
        self.names = [f'simulated_for_bench_{master}_{n}' for n in range(1, drives + 1)]
        folder = Path(self.enter_context(tempfile.TemporaryDirectory(prefix='nfo_sinus_bench_')))
        self.port = str(folder / 'line')
        self._trace = folder / 'trace'
        self._log = folder / 'log'
        with contextlib.ExitStack() as failing:
            failing.push(self)
            self._start_line(baud_rate)
            self.listener = self._start_listener(master)
            if master == PEER:
                self.master = self.script('peer.py', self.port, str(baud_rate), *self.names)
            else:
                self.master = self._start_driver(settings)
            everyone = set(self.names)
            self.wait_for(lambda: self.listener.active >= everyone, self.master)
            time.sleep(_SETTLE)
            failing.pop_all()

    @property
    def drives(self) -> int:
        """How many drives are on the line."""
        return len(self.names)

    def _start_line(self, baud_rate: int) -> None:
        simulator = self._start(
            *(_executable('simulator'), '--link', self.port, '--baud-rate', str(baud_rate)),
            *('--char-format', _FORMATS[self.line.protocol], '--paced'),
            *('--trace', str(self._trace), '--protocol', self.line.protocol),
            *('--model', self.line.model, '--boot-time', '0'),
            *(f'--address={number}' for number in range(1, self.drives + 1)),
        )
        self.wait_for(lambda: 'serving' in self._log.read_text(errors='replace'), simulator)

    def _start_driver(self, settings: dict[str, float]) -> subprocess.Popen[str]:
        parameters: dict[str, object] = {
            'port': self.port,
            'protocol': self.line.protocol,
            'model': self.line.model,
            'baud_rate': self.line.baud_rate,
            **settings,
            'drives': f'[{",".join(self.names)}]',
            **{f'{name}:address': number for number, name in enumerate(self.names, start=1)},
        }
        words = (word for name, value in parameters.items() for word in ('-p', f'{name}:={value}'))
        return self._start(_executable('driver'), '--ros-args', *words)

    def _start_listener(self, master: str) -> Listener:
        context = Context()
        rclpy.init(context=context)
        self.callback(context.try_shutdown)
        listener = Listener(master, self.names, context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(listener)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        self.callback(listener.destroy_node)
        self.callback(listener.audience.destroy_node)
        self.callback(thread.join)
        self.callback(executor.shutdown)
        return listener

    def script(self, name: str, *arguments: str, **how: int) -> subprocess.Popen[str]:
        """Start one of the programs beside this one; it ends with the rig."""
        return self._start(sys.executable, str(_FOLDER / name), *arguments, **how)

    def _start(self, *command: str, stdout: int | None = None) -> subprocess.Popen[str]:
        with self._log.open('ab') as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log if stdout is None else stdout,
                stderr=log,
                text=True,
                start_new_session=True,
            )
        self.callback(end, process)
        return process

    def lose_audience(self) -> None:
        """Go on without a subscriber, until nothing is special about that any more."""
        self.listener.leave()
        time.sleep(_SETTLE)

    def enable_all(self) -> None:
        """Let every drive run and follow set-points."""
        for name in self.names:
            response = self.listener.call(SetBool, f'/{name}/enable', data=True)
            if not response.success:
                raise RuntimeError(f'{name}: {response.message}')

    def begin_watch(self) -> Callable[[], Window]:
        """Return what reports later what happened from now on."""
        start, cost = time.monotonic(), cpu_time(self.master.pid)

        def watched() -> Window:
            now = time.monotonic()
            frames = [frame for frame in self.frames() if start <= frame.first < now]
            core = (cpu_time(self.master.pid) - cost) / (now - start)
            return Window(frames, now - start, core)

        return watched

    def frames(self) -> list[Frame]:
        """Return all that the line has carried."""
        return trace_file.frames_of(self._trace)

    def requests(self) -> list[float]:
        """Return when each request began on the line, be it as noisy as it may."""
        return trace_file.requests_of(self._trace)

    def wait_for(self, condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
        """
        Wait for what a process should bring about.

        :raises RuntimeError: it ended, or that never came; says what was logged.
        """
        deadline = time.monotonic() + PATIENCE + _PATIENCE_DRIVE * self.drives
        while not condition():
            if process.poll() is not None or time.monotonic() > deadline:
                log = self._log.read_text(errors='replace')
                raise RuntimeError(f'it does not do as it should:\n{log[-_SHOWN:]}')
            time.sleep(0.05)


def end(process: subprocess.Popen[str]) -> None:
    """End a process, gently first."""
    if process.poll() is None:
        # SIGINT is ignored by all that a background job starts
        process.terminate()
    try:
        process.wait(20.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _executable(name: str) -> str:
    path = shutil.which(name)
    if path is None:
        raise SystemExit(f'there is no {name}: run this by make bench, or by tools/run')
    return path
