# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``record``: what a drive does goes to a bag until Ctrl-C, and then to a picture.

``plot`` draws what is in a bag already, recorded by this or by ``ros2 bag record``.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
import contextlib
import importlib
import math
import os
from pathlib import Path
import signal
import sys
import threading
import time

import rclpy
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
import rclpy.utilities
from rclpy.validate_full_topic_name import validate_full_topic_name

from nfo_sinus_driver.demo import bags
from nfo_sinus_driver.demo.bench import handle_signals
from nfo_sinus_driver.demo.recording import Recorder, RecordingError, replay_warning
from nfo_sinus_driver.node.executor import spinning
from nfo_sinus_driver.version import VERSION

#: When it is time to say that there is no driver, s.
_PATIENCE = 5.0
#: How long what was sent before the end may be on its way, s.
_ON_ITS_WAY = 0.5
#: How long a signal may wait that came to another thread: Python handles it in the main one, but
#: does not wake it (s). That is where it comes when the process was suspended.
_POLL_SIGNALS = 0.2


def main(args: Sequence[str] | None = None) -> int:
    """Record a drive until Ctrl-C or a signal, then draw it; return the exit status."""
    given = list(sys.argv[1:] if args is None else args)
    parser = _record_parser()
    options = parser.parse_args(rclpy.utilities.remove_ros_args(['', *given])[1:])
    folder: Path = (options.output or Path(time.strftime('ride_%Y-%m-%d_%H-%M-%S'))).resolve()
    bag = folder / 'ride'
    if bag.exists():
        parser.error(f'{bag} is there already, and is not written over')
    if no_bag := bags.why_none():
        print(f'record: cannot write a bag: {no_bag}', file=sys.stderr)
        return 1
    handle_signals(signal.default_int_handler)
    try:
        with _recorder(bag, options.drive, given) as recorder:
            print(f'record: {options.drive} goes to {bag}; Ctrl-C ends it', flush=True)
            _wait(recorder, options.drive, options.seconds)
    except RecordingError as error:
        print(f'record: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        # before there was anything to be kept
        return 130
    print(f'record: the bag is {bag}; {replay_warning(options.drive)}')
    if no_picture := why_no_picture():
        print(f'record: no picture: {no_picture}', file=sys.stderr)
        return 0
    return _draw('record', bag, options.drive, folder / 'ride.png')


def plot(args: Sequence[str] | None = None) -> int:
    """Draw the run of a drive that is in a bag; return the exit status."""
    options = _plot_parser().parse_args(args)
    if missing := [why for why in (bags.why_none(), why_no_picture()) if why]:
        print(f'plot: {"; ".join(missing)}', file=sys.stderr)
        return 1
    bag: Path = options.bag.resolve()
    return _draw('plot', bag, options.drive, options.output or bag.with_name(f'{bag.name}.png'))


def why_no_picture() -> str:
    """Return why none can be drawn here, and what to do; empty: it can."""
    try:
        importlib.import_module('matplotlib')
    except ImportError as error:
        return f'{error} (apt install python3-matplotlib)'
    return ''


def _draw(command: str, bag: Path, drive: str | None, picture: Path) -> int:
    # here and not above: a recorder has no use for it before
    from nfo_sinus_driver.demo.picture import draw, only_drive

    try:
        draw(bag, picture, drive or only_drive(bag))
    except (OSError, ValueError) as error:
        print(f'{command}: cannot draw {bag}: {error}', file=sys.stderr)
        return 1
    print(f'{command}: the picture is {picture}')
    return 0


@contextlib.contextmanager
def _recorder(bag: Path, drive: str, arguments: Sequence[str]) -> Iterator[Recorder]:
    """Record on a thread of its own; nothing is received any more when the bag is closed."""
    with contextlib.ExitStack() as stack:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        recorder = stack.enter_context(
            Recorder(bag, drive, {'drive': drive}, lambda: _report_heard(drive))
        )
        executor = SingleThreadedExecutor()
        executor.add_node(recorder)
        stack.enter_context(spinning(executor))
        yield recorder


def _report_heard(drive: str) -> None:
    print(f'record: {drive} is heard', flush=True)


def _wait(recorder: Recorder, drive: str, seconds: float) -> None:
    """Wait until the time is over, or a signal ends it."""
    end = time.monotonic() + seconds
    with contextlib.suppress(KeyboardInterrupt):
        _sleep_until(min(end, time.monotonic() + _PATIENCE))
        if not recorder.hears_drive:
            domain = os.environ.get('ROS_DOMAIN_ID', '0')
            print(
                f'record: nothing is heard of {drive} yet: does the driver run, with this name '
                f'and in this ROS_DOMAIN_ID ({domain})?',
                file=sys.stderr, flush=True,
            )
        _sleep_until(end)
    # what was recorded is now closed and drawn, and that must not be cut short
    handle_signals(signal.SIG_IGN)
    # the end overtakes messages: a subscriber does not know which are yet to come
    time.sleep(_ON_ITS_WAY)


def _sleep_until(end: float) -> None:
    """Sleep in pieces: between them a signal is handled that came to another thread."""
    while (left := end - time.monotonic()) > 0:
        time.sleep(min(left, _POLL_SIGNALS))


def _record_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='record', description='Records what a drive does until Ctrl-C, and draws it.',
    )
    parser.add_argument(
        'drive', nargs='?', type=_node, default='/nfo_sinus', metavar='DRIVE',
        help='the full name of the drive node (default: /nfo_sinus)',
    )
    parser.add_argument(
        '--output', type=Path, metavar='DIR',
        help='where bag (DIR/ride) and picture (DIR/ride.png) go; '
        'ride_<date and time> in the current directory if not given',
    )
    parser.add_argument(
        '--for', type=_seconds, default=math.inf, dest='seconds', metavar='SECONDS',
        help=f'end it after so long, and {_ON_ITS_WAY:g} s for what is on its way then',
    )
    parser.add_argument('--version', action='version', version=f'nfo_sinus_driver {VERSION}')
    return parser


def _plot_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='plot', description='Draws what a bag tells of the ride of a drive.',
    )
    parser.add_argument('bag', type=Path, metavar='BAG', help='the folder of the bag')
    parser.add_argument(
        '--drive', type=_node, metavar='DRIVE',
        help='the full name of the drive node; needed if the bag has several',
    )
    parser.add_argument('--output', type=Path, metavar='PNG', help='the picture (default: BAG.png)')
    parser.add_argument('--version', action='version', version=f'nfo_sinus_driver {VERSION}')
    return parser


def _node(text: str) -> str:
    name = f'/{text.strip("/")}'
    try:
        validate_full_topic_name(f'{name}/status')
    except InvalidTopicNameException as error:
        raise argparse.ArgumentTypeError(' '.join(str(error).split())) from None
    return name


def _seconds(text: str) -> float:
    with contextlib.suppress(ValueError):
        seconds = float(text)
        if 0 < seconds <= threading.TIMEOUT_MAX:
            return seconds
    raise argparse.ArgumentTypeError(f'{text!r} is no time in s')


if __name__ == '__main__':
    sys.exit(main())
