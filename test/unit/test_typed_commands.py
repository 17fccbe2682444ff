# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every ``nfo-sinus`` and ``simulator`` command of the documentation runs as it is typed."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import itertools
from pathlib import Path
import re
import shlex
import signal
import socket
import subprocess
import sys

import pytest
from support.typed import Typed, typed

from nfo_sinus_driver.cli.main import main, parse

pytestmark = pytest.mark.slow

_CLI = 'import sys; from nfo_sinus_driver.cli.main import main; sys.exit(main())'
_SIMULATOR = 'nfo_sinus_driver.simulator'
_PATIENCE = 120.0
_ROOT = Path(__file__).resolve().parents[2]
#: How long a scan may take at most, s.
_SCAN = 20.0
#: What belongs to a page that shows how something is made, and is not there.
_MADE_UP = re.compile('acme|my_drive')
#: What is answered on the line of a page that does not say what has been connected.
_ADDRESSES = (1, 2)

#: What a line of the output looks like that follows a command.
_OUTPUT = re.compile(r'^nfo-sinus: ')


def commands(program: str) -> list[Typed]:
    found = [command for command in typed(program) if not _MADE_UP.search(command.text)]
    return [command for command in found if not _OUTPUT.match(command.text)]


def by_page(found: list[Typed]) -> list[list[Typed]]:
    """Those of a page belong together: one uses the file that another leaves."""
    return [list(group) for _, group in itertools.groupby(found, key=lambda command: command.page)]


def _simulator(arguments: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, '-m', _SIMULATOR, *arguments], cwd=_ROOT,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )


@contextlib.contextmanager
def simulated(arguments: list[str]) -> Iterator[subprocess.Popen[str]]:
    """A simulator that serves."""
    process = _simulator(arguments)
    try:
        assert process.stdout is not None
        first = process.stdout.readline()
        assert 'serving' in first, first + process.stdout.read()
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=_PATIENCE)


def test_there_are_such_commands() -> None:
    verbs = {parse(shlex.split(command.text)[1:]).verb for command in commands('nfo-sinus')}
    assert {'scan', 'info', 'set', 'dump', 'load', 'run', 'monitor', 'ack'} <= verbs
    assert len(commands('simulator')) > 5


@pytest.mark.parametrize('page', by_page(commands('nfo-sinus')), ids=lambda page: page[0].page)
def test_the_command_line_of_a_page_runs_as_it_is_typed(
    page: list[Typed],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    # those over one line after the other, on a line of their own
    for number, (protocol, model) in enumerate(dict.fromkeys(map(_line_of, page))):
        mine = [command for command in page if _line_of(command) == (protocol, model)]
        link = str(tmp_path / f'line{number}')
        named = {parse(shlex.split(command.text)[1:]).address for command in mine}
        arguments = ['--protocol', protocol, '--model', model, '--link', link]
        if protocol == 'canopen':
            arguments += ['--baud-rate', '125000']
        for address in sorted({*_ADDRESSES, *named}):
            arguments += ['--address', str(address)]
        with simulated(arguments):
            for command in mine:
                _run(command, link, capsys)


def _line_of(command: Typed) -> tuple[str, str]:
    options = parse(shlex.split(command.text)[1:])
    return options.protocol, options.model


def _run(command: Typed, link: str, capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(command.text)[1:]
    options = parse(words)
    extra = ['--port', link]
    if options.protocol == 'canopen':
        extra += ['--baud-rate', '125000']
    # all answer on a machine that may be busy for a while, but for most of those that a scan asks
    asked = len(options.addresses) if options.verb == 'scan' else 1
    extra += ['--response-timeout', str(min(2.0, _SCAN / asked))]
    if getattr(options, 'yes', None) is False:
        # there is no terminal to ask at
        extra += ['--yes']
    if options.verb == 'monitor' and not options.count:
        _begin_and_interrupt([*words, *extra])
        return
    status = main([*words, *extra])
    said = capsys.readouterr()
    assert not status, f'{command}\n{said.out}{said.err}'
    assert 'Traceback' not in said.err, f'{command}\n{said.err}'


def _begin_and_interrupt(words: list[str]) -> None:
    process = subprocess.Popen(
        [sys.executable, '-c', _CLI, *words], cwd=_ROOT,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    out, said = process.communicate(timeout=_PATIENCE)
    assert process.returncode == 0 and 'Traceback' not in said, f'{words}\n{out}{said}'


@pytest.mark.parametrize('page', by_page(commands('simulator')), ids=lambda page: page[0].page)
def test_the_simulators_of_a_page_start_as_typed(page: list[Typed], tmp_path: Path) -> None:
    free = str(_free())
    with contextlib.ExitStack() as running:
        for command in page:
            # not where another program may have one
            text = command.text.replace('/tmp/', f'{tmp_path}/')
            text = re.sub(r'(--tcp |modbus_tcp:)\d+', lambda found: f'{found[1]}{free}', text)
            words = shlex.split(text)[1:]
            if words[0] == 'inject':
                # into the one above
                done = _simulator(words)
                out, _ = done.communicate(timeout=_PATIENCE)
                assert done.returncode == 0, f'{command}\n{out}'
                continue
            running.close()
            running.enter_context(simulated(words))


def _free() -> int:
    with socket.create_server(('127.0.0.1', 0)) as server:
        number: int = server.getsockname()[1]
        return number
