# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A simulated line with two drives, and the command that is tried on it."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import contextlib
from pathlib import Path
import signal
from typing import Any

from cli_bench import ROOT
from cli_bench import Bench
from cli_bench import Done
from cli_bench import MakeBench
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
def signals_as_before() -> Iterator[None]:
    """The command leaves the signals as it found them."""
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = [signal.getsignal(number) for number in numbers]
    yield
    assert [signal.getsignal(number) for number in numbers] == before
