# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What the tool says to the operator: errors, questions, progress and remarks, columns of text.

Remarks go to standard error, so that the output stays what a script wants.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import contextlib
import json
import math
import os
import signal
import sys
import threading
from typing import Any, TextIO
import unicodedata

from tqdm import tqdm

from nfo_sinus_driver.drive import DriveError, Report
from nfo_sinus_driver.drive.known.events import Calls, sentence
from nfo_sinus_driver.signals import are_held_to_the_end

#: What takes less needs no bar, s.
_DELAY = 0.3
_FORMAT = '{desc} {bar} {n_fmt}/{total_fmt}, {remaining} left'

# its own watch thread and process lock are for more than one bar in one program
tqdm.monitor_interval = 0
tqdm.set_lock(threading.RLock())


@contextlib.contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a bar, if standard error is a terminal; what it yields is called for every step."""
    with tqdm(
        desc=what,
        total=total,
        bar_format=_FORMAT,
        delay=_DELAY,
        disable=None,
        dynamic_ncols=True,
        file=sys.stderr,
        leave=False,
    ) as bar:
        yield lambda: bar.update()


def flush_output() -> None:
    """Write what is left of the output; what is lost must not take the place of the exit status."""
    for stream in (sys.stdout, sys.stderr):
        if stream is None:
            continue
        try:
            stream.flush()
        except OSError:
            _write_no_more(stream)


def _write_no_more(stream: TextIO) -> None:
    """Lead a stream that is lost nowhere: what is left would be written at the end, in vain."""
    with open(os.devnull, 'w', encoding='utf-8') as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())


def remark(text: str) -> None:
    """Say something to the operator, above the bar if there is one."""
    if sys.stderr is None:
        return
    # what cannot be said must not end what is under way: settings are put back, too
    with contextlib.suppress(OSError):
        tqdm.write(f'nfo-sinus: {text}', file=sys.stderr)
        sys.stderr.flush()


def put(text: str) -> None:
    """
    Print a line of output, above the bar if there is one.

    :raises OutputLost: it cannot be written.
    """
    if sys.stdout is None:
        raise OutputLost('it is closed')
    try:
        tqdm.write(text, file=sys.stdout)
        sys.stdout.flush()
    except OSError as error:
        _write_no_more(sys.stdout)
        raise OutputLost(error.strerror or '') from error


def as_json(facts: Any, indent: int | None = None) -> str:
    """Return a JSON document; JSON has no NaN, so that it becomes null."""
    return json.dumps(_without_nan(facts), ensure_ascii=False, indent=indent)


def _without_nan(facts: Any) -> Any:
    if isinstance(facts, Mapping):
        return {name: _without_nan(fact) for name, fact in facts.items()}
    if isinstance(facts, (list, tuple)):
        return [_without_nan(fact) for fact in facts]
    return None if isinstance(facts, float) and math.isnan(facts) else facts


@contextlib.contextmanager
def signals_handled(
    handler: Callable[[int, Any], Any], *, to_the_end: bool = False
) -> Iterator[None]:
    """
    Handle the signals that would end this tool, if this is the main thread.

    Whatever was inherited: a shell lets its background jobs ignore Ctrl-C.

    :param to_the_end: ignore them afterwards, where this process is a command that ends then.
    """
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        ignored = to_the_end and are_held_to_the_end()
        for number, former in before.items():
            signal.signal(number, signal.SIG_IGN if ignored else former)


@contextlib.contextmanager
def signals_noted(*, to_the_end: bool = False) -> Iterator[Callable[[], bool]]:
    """
    Let signals that end the program wait; what it yields says whether one came.

    :param to_the_end: as for :func:`signals_handled`.
    """
    came = threading.Event()
    with signals_handled(lambda *_: came.set(), to_the_end=to_the_end):
        yield came.is_set


class CliError(Exception):
    """It was not done; the message says why and what to do."""


class OutputLost(CliError):
    """What was to be shown cannot be written."""

    def __init__(self, why: str) -> None:
        super().__init__(f'the output cannot be written: {why}')


class UsageError(Exception):
    """What was typed makes no sense; the message says what would."""


class Interrupted(Exception):
    """The operator or the system ended it."""

    def __init__(self) -> None:
        super().__init__('interrupted')


def listed(head: str, lines: Iterable[str]) -> str:
    """Return a text with a list below it."""
    return '\n  '.join((head, *lines))


def can_ask() -> bool:
    """Return whether there is a terminal to ask and to answer."""
    return all(stream is not None and stream.isatty() for stream in (sys.stdin, sys.stderr))


def require_yes(options: argparse.Namespace, question: str) -> None:
    """Ensure that the operator wants it, by asking or by ``--yes``; else an error."""
    if options.yes:
        return
    if not can_ask():
        raise UsageError(f'{question} There is no terminal to answer: say so with --yes')
    print(f'{question} [y/N] ', end='', file=sys.stderr, flush=True)
    answer = sys.stdin.readline()
    if not answer.endswith('\n'):
        print(file=sys.stderr)
    if answer.strip().lower() not in ('y', 'yes'):
        raise CliError('nothing was done')


def columns(rows: Sequence[Sequence[str]], *, right: Sequence[int] = ()) -> list[str]:
    """Return rows as lines with aligned columns, some of them to the ``right``."""

    def width(text: str) -> int:
        return sum(not unicodedata.combining(character) for character in text)

    widths = [max(map(width, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        padded = []
        for place, cell in enumerate(row):
            blank = ' ' * (widths[place] - width(cell))
            padded.append(blank + cell if place in right else cell + blank)
        lines.append('  '.join(padded).rstrip())
    return lines


def put_columns(rows: Sequence[Sequence[str]], *, right: Sequence[int] = ()) -> None:
    """Print rows with aligned columns."""
    for line in columns(rows, right=right):
        put(line)


_CALLS = Calls(
    acknowledge='type nfo-sinus ack',
    enable='run it again',
    # at its end a command restores what it has written
    quick_stop='release the motor by a terminal',
    program='command',
    drive_timeout='--drive-timeout',
    set_drive_timeout='give --drive-timeout',
    set_setpoint_max='give --setpoint-max',
    set_control_mode='give another --control-mode',
    set_model='give the right --model',
    set_method='give another --method',
)


def say(what: Report | Exception | None) -> str:
    """Return what there is to say; an error that is no drive's speaks for itself."""
    if what is None:
        return ''
    if isinstance(what, DriveError):
        what = what.report
    return sentence(what, _CALLS) if isinstance(what, Report) else str(what)
