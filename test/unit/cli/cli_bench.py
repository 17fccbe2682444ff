# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated line, and what was said on it; the command as a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import contextlib
import json
import os
from pathlib import Path
import pty
import re
import select
import subprocess
import sys
import threading
import time
from typing import Any, NamedTuple

from support.variants import hardest

from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.simulator import Simulator

ROOT = Path(__file__).resolve().parents[3]
#: No honest wait takes this long, on any machine, s.
PATIENCE = 60.0
#: The functions that write [M0 §6.2.3].
WRITES = {6, 16, 23}
_PROGRAM = 'from nfo_sinus_driver.commands import nfo_sinus; exit(nfo_sinus())'
COMMAND = (sys.executable, '-c', _PROGRAM)
#: As a shell starts its background jobs.
BACKGROUND = ('env', '--ignore-signal=INT,QUIT')


MakeBench = Callable[..., 'Bench']


class Done(NamedTuple):
    """How the command ended and what it said."""

    status: int
    out: str
    err: str


#: Short ramps: a test does not wait long for a motor; but its stop is to be seen.
QUICK = {'control.accel': 0.2, 'control.retard': 2.5}
_RUN = 0x101
_BUS = 3


def wait_until(condition: Callable[[], object]) -> None:
    """Wait until a condition holds; fail when it does not in time."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, 'it never came true'
        time.sleep(0.005)


def signals_until_it_ends(process: subprocess.Popen[str], number: int) -> tuple[str, str]:
    """Send a signal again and again, as an impatient operator does; return its output."""
    ended = threading.Event()

    def send() -> None:
        while not ended.wait(0.02):
            process.send_signal(number)

    sender = threading.Thread(target=send)
    sender.start()
    try:
        return process.communicate(timeout=PATIENCE)
    finally:
        ended.set()
        sender.join()



class Bench:
    """Simulated drives at addresses 1 and 2, with a trace of all that is said."""

    def __init__(self, trace: Path, **options: Any) -> None:
        self._trace = trace
        makes_it_hard = hardest(options.get('model', 'sinus_g2'))
        options = {'serial_numbers': ['NFO1001', 'NFO1002'], **makes_it_hard, **options}
        self.simulator = Simulator([1, 2], trace=str(trace), boot_time=0.1, **options)
        self.options = ('--port', self.simulator.port, '--response-timeout', '2.0')
        for name in ('protocol', 'model'):
            if name in options:
                self.options += (f'--{name}', options[name])

    def __enter__(self) -> Bench:
        self.simulator.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self.simulator.__exit__(*error)

    def drive(self, address: int = 1) -> SimulatedDrive:
        return self.simulator.drives[address]

    def value(self, key: str, address: int = 1) -> object:
        """What a drive has."""
        with self.simulator.lock:
            return self.drive(address).peek(key)

    def set(self, key: str, value: object, address: int = 1) -> None:
        """Change a parameter at the keypad."""
        self.simulator.inject('set', key, value, address=address)

    def state(self) -> dict[str, Any]:
        """Everything about the drive at address 1, as it is now."""
        return self.simulator.state(1)

    @property
    def stopped(self) -> bool:
        """The motor stands, and no master has control of it."""
        state = self.state()
        return not state['driven'] and not state['turning'] and state['source'] == 'stop'

    def run_by_bus(self, hertz: float = 10.0) -> None:
        """Let the motor run as if another master had commanded it, until it turns that fast."""
        self.command_by_bus(hertz)
        # no longer on its ramp, which may bring it to its current limit
        wait_until(lambda: abs(self.state()['frequency'] - hertz) < 0.1)

    def command_by_bus(self, hertz: float) -> None:
        """Command the motor as another master would."""
        with self.simulator.lock:
            drive = self.drive()
            drive.write_raw('fieldbus.mode', _BUS)
            optimal = drive.model.name == 'sinus_optimal'
            drive.memory.set(drive.control_unit.setpoint_key, hertz)
            drive.write_raw('fieldbus.smode' if optimal else 'fieldbus.scmd', _RUN)

    def writes(self) -> list[bytes]:
        """Every request so far that writes."""
        requests = self.requests()
        assert requests
        return [request for request in requests if request[1] in WRITES]

    def requests(self) -> list[bytes]:
        """Every request so far."""
        lines = self._trace.read_text(encoding='utf-8').splitlines(keepends=True)
        frames = [json.loads(line) for line in lines if line.endswith('\n')]
        return [bytes.fromhex(f['hex']) for f in frames if f['direction'] == 'request']

    def on_write(self, key: str, act: Callable[[], None], address: int = 1) -> None:
        """Let something happen just before the bus writes a parameter, every time."""
        drive = self.drive(address)
        write_raw = drive.write_raw

        def write(written: str, raw: int) -> None:
            if written == key:
                act()
            write_raw(written, raw)

        drive.write_raw = write  # type: ignore[method-assign]

    def on_read(self, key: str, act: Callable[[], None], address: int = 1) -> None:
        """Let something happen just before the bus reads a parameter, every time."""
        drive = self.drive(address)
        read_raw = drive.read_raw

        def read(asked: str) -> int:
            if asked == key:
                act()
            return read_raw(asked)

        drive.read_raw = read  # type: ignore[method-assign]

    def refuse(self, key: str, reason: Reason = Reason.VALUE) -> None:
        """Let a drive refuse a parameter whatever its value."""

        def act() -> None:
            raise Refused(reason, 'refused by the test')

        self.on_write(key, act)

    def run(self, *arguments: object, text: str | None = None) -> Done:
        """Run the command as a process of its own."""
        done = subprocess.run(
            [*COMMAND, *self.options, *map(str, arguments)],
            cwd=ROOT,
            input=text,
            capture_output=True,
            text=True,
            # a machine that is busy elsewhere makes it take a quarter of this
            timeout=4 * PATIENCE,
            check=False,
        )
        return Done(done.returncode, done.stdout, done.stderr)

    def begin(
        self, *arguments: object, through: tuple[str, ...] = ()
    ) -> subprocess.Popen[str]:
        """Begin to run it, by way of another command if need be."""
        return subprocess.Popen(
            [*through, *COMMAND, *self.options, *map(str, arguments)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    @contextlib.contextmanager
    def begun(self, *arguments: object) -> Iterator[subprocess.Popen[str]]:
        """Begin to run it; the process is gone afterwards, come what may."""
        process = self.begin(*arguments)
        try:
            yield process
        finally:
            process.kill()
            process.wait()
            for stream in (process.stdout, process.stderr):
                assert stream is not None
                stream.close()

    @contextlib.contextmanager
    def running(self, *arguments: object) -> Iterator[subprocess.Popen[str]]:
        """The motor turns by the command, at 10 Hz."""
        with self.begun('run', 10, *arguments) as process:
            wait_until(lambda: process.poll() is not None or self.state()['frequency'])
            assert process.poll() is None, process.communicate()
            yield process

    def on_terminal(
        self,
        *arguments: object,
        ask: str = '',
        answer: str = '',
        answers: Sequence[tuple[str, str | Callable[[], str] | None]] = (),
    ) -> Done:
        """
        Run it on a terminal, and answer what it asks.

        :param answers: what it asks, one after the other, and what is answered, or done first;
            ``None``: the terminal is closed.
        """
        left = list(answers or ([(ask, answer)] if ask else []))
        process, terminal = pty.fork()
        if not process:
            os.chdir(ROOT)
            os.environ['TERM'] = 'xterm'
            command = [*COMMAND, *self.options, *map(str, arguments)]
            os.execv(command[0], command)
        said, seen = '', 0
        deadline = time.monotonic() + PATIENCE
        while True:
            wait = deadline - time.monotonic()
            assert wait > 0 and select.select([terminal], [], [], wait)[0], said
            try:
                data = os.read(terminal, 4096)
            except OSError:
                # how a terminal of Linux ends
                data = b''
            if not data:
                break
            said += data.decode(errors='replace')
            while left and (at := said.find(left[0][0], seen)) >= 0:
                wanted, gives = left.pop(0)
                seen = at + len(wanted)
                if gives is None:
                    os.close(terminal)
                    return Done(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), said, said)
                os.write(terminal, (gives if isinstance(gives, str) else gives()).encode())
                deadline = time.monotonic() + PATIENCE
        os.close(terminal)
        status = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        return Done(status, re.sub(r'[^\n]*\r(?!\n)', '', said.replace('\r\n', '\n')), said)
