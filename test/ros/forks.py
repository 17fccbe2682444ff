# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Forks of a process that has imported what driver and simulator import.

A test starts both, and what they import is a third of what it costs. Threads do not come along with
a fork: rclpy has two, in which its tracing waits for a tracer, and they are not missed.

Run as a program, it forks for each line of JSON that it reads, and the fork runs the script of that
command from its beginning to its end, as a process of its own would.
"""

from __future__ import annotations

import atexit
import ctypes
import faulthandler
import functools
import importlib
import json
import os
from pathlib import Path
import runpy
import signal
import subprocess
import sys
import threading
import time
import traceback

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.simulator.family import every_option

_MODULES = (
    'nfo_sinus_driver.link.modbus.rtu',
    'nfo_sinus_driver.node.process.main',
    'nfo_sinus_driver.simulator.main',
    'numpy',
    'rosidl_generator_py',
    'yaml',
)
#: In the environment: how patient the driver takes a PLC for, s, on a machine that may rest for
#: longer than a PLC waits.
PLC_TIME = 'PLC_TIME_OF_TESTS'
#: What makes a fork tell where each of its threads is; the driver takes others for a wish to end.
TELL_STACKS = signal.SIGURG
_SET_CHILD_SUBREAPER = 36
_SET_PARENT_DEATH_SIGNAL = 1
#: How often it is looked whether one has ended, s.
_PERIOD = 0.005


class Fork:
    """What tests need of ``subprocess.Popen``, for a process that was forked elsewhere."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        if self.returncode is None:
            ended, status = os.waitpid(self.pid, os.WNOHANG)
            if ended:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        deadline = None if timeout is None else time.monotonic() + timeout
        while self.poll() is None:
            if deadline is not None and time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f'process {self.pid}', timeout)
            time.sleep(_PERIOD)
        return self.returncode

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


def start(command: list[str], environment: dict[str, str], log: Path) -> Fork:
    """Start a Python script; what it says goes to the end of a file."""
    server = _server()
    log.touch()
    request = {'command': command, 'environment': environment, 'log': str(log)}
    server.stdin.write(json.dumps(request) + '\n')
    server.stdin.flush()
    return Fork(int(server.stdout.readline()))


@functools.cache
def _server() -> subprocess.Popen[str]:
    # a process that loses its parent, as the forks do, becomes our child: we see how it ends
    assert ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0) == 0
    return subprocess.Popen(
        [sys.executable, __file__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # numpy would begin threads, too
        env={**os.environ, 'OPENBLAS_NUM_THREADS': '1'},
    )


def _serve() -> None:
    for module in _MODULES:
        importlib.import_module(module)
    # both are kept
    load_family('sinus_g2')
    every_option()
    for line in sys.stdin:
        reading, writing = os.pipe()
        if os.fork() == 0:
            between = os.getpid()
            pid = os.fork()
            if pid == 0:
                os.close(reading)
                os.close(writing)
                _end_with_parent_after(between)
                _become(**json.loads(line))
                return
            os.write(writing, b'%d\n' % pid)
            os._exit(0)
        # from now on it is the child of who asked
        os.wait()
        os.write(sys.stdout.fileno(), os.read(reading, 100))
        os.close(reading)
        os.close(writing)


def _end_with_parent_after(between: int) -> None:
    """Be killed with who asked: a test that is killed leaves no driver and no drive behind."""
    # not before: the end of the process between would be taken for it, and nothing tells of it
    while os.getppid() == between:
        time.sleep(0.001)
    assert ctypes.CDLL(None).prctl(_SET_PARENT_DEATH_SIGNAL, signal.SIGKILL, 0, 0, 0) == 0


def _become(command: list[str], environment: dict[str, str], log: str) -> None:
    os.setsid()
    os.environ.clear()
    os.environ.update(environment)
    ends = (0, os.devnull, os.O_RDONLY), (1, log, os.O_WRONLY | os.O_APPEND)
    for descriptor, path, flags in ends:
        opened = os.open(path, flags)
        os.dup2(opened, descriptor)
        os.close(opened)
    os.dup2(1, 2)
    # to the log itself, whatever becomes of the output
    faulthandler.register(TELL_STACKS, os.dup(1))
    if PLC_TIME in environment:
        importlib.import_module('nfo_sinus_driver.link.plc.telegram').PLC_TIME = float(
            environment[PLC_TIME]
        )
    sys.argv = command
    status = 1
    try:
        runpy.run_path(command[0], run_name='__main__')
    except SystemExit as end:
        status = int(end.code or 0)
    except BaseException:
        traceback.print_exc()
    # as Python ends, but for the libraries: rclpy's tracing would end threads that are not here
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    os._exit(status)


if __name__ == '__main__':
    _serve()
