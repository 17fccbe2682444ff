# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A simulated line with two drives, and the command that is tried on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from pathlib import Path
import signal
from typing import Any

from cli_bench import ROOT, Bench, Done, MakeBench
import pytest

from nfo_sinus_driver.cli.main import main


@pytest.fixture
def make_bench(tmp_path: Path) -> Iterator[MakeBench]:
    """Makes a line with drives at addresses 1 and 2, started."""
    with contextlib.ExitStack() as stack:

        def make(**options: Any) -> Bench:
            return stack.enter_context(Bench(tmp_path / 'trace', **options))

        yield make


@pytest.fixture
def bench(make_bench: MakeBench) -> Bench:
    """A line as most tests need it."""
    return make_bench()


@pytest.fixture
def nfo(
    bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> Callable[..., Done]:
    """Runs the command in this process, on the line, unless another port is named."""
    monkeypatch.chdir(ROOT)

    def run(*arguments: object) -> Done:
        capsys.readouterr()
        try:
            status = main([*bench.options, *map(str, arguments)])
        except SystemExit as end:
            status = int(str(end.code))
        said = capsys.readouterr()
        return Done(status, said.out, said.err)

    return run


@pytest.fixture(autouse=True)
def remembered_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No test finds what another one has left in a drive of the same serial number."""
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path / 'state'))


@pytest.fixture(autouse=True)
def signals_as_before() -> Iterator[None]:
    """The command leaves the signals as it found them."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    assert [signal.getsignal(number) for number in numbers] == before
