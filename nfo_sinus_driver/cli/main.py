# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The command ``nfo-sinus``: looks after drives from the command line; needs no ROS."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
import contextlib
import io
import os
import signal
import sys
import threading

from nfo_sinus_driver.cli.console import CliError, UsageError, put, remark, say
from nfo_sinus_driver.cli.monitor import monitor
from nfo_sinus_driver.cli.options import parse
from nfo_sinus_driver.cli.read import errors, get, info, list_, set_
from nfo_sinus_driver.cli.run import run
from nfo_sinus_driver.cli.scan import scan
from nfo_sinus_driver.cli.stop import ack, stop
from nfo_sinus_driver.cli.transfer import diff, dump, load
from nfo_sinus_driver.cli.tune import tune
from nfo_sinus_driver.drive import DriveError


def completion(options: argparse.Namespace) -> int:
    """Print what makes a shell complete what is typed."""
    from argcomplete.shell_integration import shellcode

    put(shellcode(['nfo-sinus'], shell=options.shell))
    return 0


VERBS: dict[str, Callable[[argparse.Namespace], int]] = {
    'scan': scan,
    'info': info,
    'list': list_,
    'get': get,
    'set': set_,
    'dump': dump,
    'load': load,
    'diff': diff,
    'errors': errors,
    'monitor': monitor,
    'ack': ack,
    'run': run,
    'stop': stop,
    'tune': tune,
    'completion': completion,
}

_FAILED = 1
_USAGE = 2
#: Of diff, whose 1 means that there are differences.
_DIFF_FAILED = 2
_INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status, 0 only when the drive did it."""
    for stream in (sys.stdout, sys.stderr):
        # what the locale cannot write, such as a unit, must not end what drives a motor
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='replace')
    options = parse(sys.argv[1:] if argv is None else argv)
    failed = _DIFF_FAILED if options.verb == 'diff' else _FAILED
    try:
        with _signals_that_interrupt():
            return VERBS[options.verb](options)
    except UsageError as error:
        remark(str(error))
        return _USAGE
    except (CliError, DriveError) as error:
        remark(say(error))
        return failed
    except BrokenPipeError:
        # who read the output has gone, and Python would complain of it once more at the end
        with open(os.devnull, 'w', encoding='utf-8') as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
        return failed
    except KeyboardInterrupt:
        return _INTERRUPTED


@contextlib.contextmanager
def _signals_that_interrupt() -> Iterator[None]:
    """
    Let SIGTERM and SIGHUP end it as Ctrl-C does, so that everything is cleaned up.

    Whatever was inherited: a shell lets its background jobs ignore Ctrl-C.
    """
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, signal.default_int_handler) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
