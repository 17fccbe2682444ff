# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A component of LinuxCNC's HAL as a master: what it is told by its pins, and what it shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
from pathlib import Path
import shutil
import signal
import subprocess
import time

import pytest

#: Machines are shared and slow, s.
_PATIENCE = 30.0
#: How often a pin is looked at, s.
_LOOKS = 0.05
_HALCMD = 'halcmd'


def require(program: str) -> None:
    """Skip a test whose master is not installed."""
    for needed in (program, _HALCMD):
        if shutil.which(needed) is None:
            pytest.skip(f'{needed} is not installed: it is in linuxcnc-uspace')


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Wait for something that a master brings about."""
    deadline = time.monotonic() + _PATIENCE
    while not condition():
        assert time.monotonic() < deadline, f'not within {_PATIENCE:g} s: {what}'
        time.sleep(_LOOKS)


class Component:
    """A component that runs, and its pins."""

    def __init__(self, name: str) -> None:
        self._name = name

    def set(self, **pins: float) -> None:
        """Set pins; an underscore stands for a hyphen."""
        for pin, value in pins.items():
            _halcmd('setp', f'{self._name}.{pin.replace("_", "-")}', f'{float(value):g}')

    def get(self, pin: str) -> float:
        """Return what a pin has."""
        said = _halcmd('getp', f'{self._name}.{pin}').strip()
        return float({'TRUE': '1', 'FALSE': '0'}.get(said, said))


@contextlib.contextmanager
def component(
    program: str, arguments: Sequence[str], name: str, ready: str, log: Path
) -> Iterator[Component]:
    """
    Run a component.

    :param name: of its own: that of one which was killed stays taken.
    :param ready: a pin that it has when it is up.
    """
    with log.open('w') as said, subprocess.Popen(
        [program, *arguments], stdin=subprocess.DEVNULL, stdout=said, stderr=said
    ) as process:
        found = Component(name)
        try:
            wait_until(lambda: _has(f'{name}.{ready}'), f'{program} is up: {log.read_text()}')
            yield found
        finally:
            process.send_signal(signal.SIGTERM)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_PATIENCE)
            if process.poll() is None:
                process.kill()


def write_ini(path: Path, sections: Mapping[str, Mapping[str, object]]) -> Path:
    """Write the file that a component reads."""
    lines = []
    for section, entries in sections.items():
        lines += [f'[{section}]', *(f'{key}={value}' for key, value in entries.items())]
    path.write_text('\n'.join(lines) + '\n')
    return path


def _has(pin: str) -> bool:
    done = subprocess.run(
        [_HALCMD, 'getp', pin], capture_output=True, text=True, timeout=_PATIENCE, check=False
    )
    return done.returncode == 0


def _halcmd(*arguments: str) -> str:
    return subprocess.run(
        [_HALCMD, *arguments], capture_output=True, text=True, timeout=_PATIENCE, check=True
    ).stdout
