# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``record``: what drives do goes to a bag until Ctrl-C, and then to a picture.

``plot`` draws what is in a bag already, recorded by this or by ``ros2 bag record``, or explains it.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import contextlib
import importlib
import math
import os
from pathlib import Path
import signal
import sys
import threading
import time

from nfo_sinus_msgs.msg import DriveStatus
import rclpy
from rclpy.exceptions import InvalidTopicNameException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
import rclpy.utilities
from rclpy.validate_full_topic_name import validate_full_topic_name

from nfo_sinus_driver.cli.console import OutputLost, put
from nfo_sinus_driver.demo.bench import handle_signals
from nfo_sinus_driver.demo.recording import Recorder, RecordingError, replay_warning
from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.node.bags.type_definitions import name_of
from nfo_sinus_driver.node.ros.executor import spinning
from nfo_sinus_driver.node.ros.start import init_ros
from nfo_sinus_driver.version import VERSION

#: When it is time to say that there is no driver, s.
_PATIENCE = 5.0
#: No other drive comes when none has for so long, s.
_QUIET = 2.0
#: How long a signal may wait that came to another thread: Python handles it in the main one, but
#: does not wake it (s). That is where it comes when the process was suspended.
_POLL_SIGNALS = 0.2
#: The folder of the bag in that of a recording.
_BAG = 'ride'


def main(args: Sequence[str] | None = None) -> int:
    """Record drives until Ctrl-C or a signal, then draw them; return the exit status."""
    given = list(sys.argv[1:] if args is None else args)
    parser = _record_parser()
    options = parser.parse_args(rclpy.utilities.remove_ros_args(['', *given])[1:])
    folder: Path = (options.output or Path(time.strftime('ride_%Y-%m-%d_%H-%M-%S'))).resolve()
    bag = folder / _BAG
    if bag.exists():
        parser.error(f'{bag} is there already, and is not written over')
    if no_bag := bags.why_none():
        print(f'record: cannot write a bag: {no_bag}', file=sys.stderr)
        return 1
    handle_signals(signal.default_int_handler)
    try:
        drives = _record(bag, options, given)
    except (RecordingError, ValueError) as error:
        print(f'record: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        # before there was anything to be kept
        return 130
    print(f'record: the bag is {bag}; {replay_warning(*drives)}')
    if no_picture := why_no_picture():
        print(f'record: no picture: {no_picture}', file=sys.stderr)
        return 0
    return _draw('record', bag, drives, folder / 'ride.png')


def plot(args: Sequence[str] | None = None) -> int:
    """Draw the runs of drives that are in a bag, or say what happened; return the exit status."""
    options = _plot_parser().parse_args(args)
    no_picture = '' if options.explain else why_no_picture()
    if missing := [why for why in (bags.why_none(), no_picture) if why]:
        print(f'plot: {"; ".join(missing)}', file=sys.stderr)
        return 1
    bag: Path = options.bag.resolve()
    if not (bag / 'metadata.yaml').exists() and (bag / _BAG).is_dir():
        # the folder that record was given
        bag /= _BAG
    drives = [options.drive] if options.drive else []
    if options.explain:
        return _explain(bag, drives)
    picture: Path = options.output or bag.with_name(f'{bag.name}.png')
    if not picture.suffix:
        # Matplotlib would add it, too, and not say so
        picture = picture.with_name(f'{picture.name}.png')
    return _draw('plot', bag, drives, picture)


def why_no_picture() -> str:
    """Return why none can be drawn here, and what to do; empty: it can."""
    try:
        importlib.import_module('matplotlib')
    except ImportError as error:
        return f'{error} (apt install python3-matplotlib)'
    return ''


def _draw(command: str, bag: Path, drives: Sequence[str], picture: Path) -> int:
    """Draw some drives, or all: one picture for each line."""
    # here and not above: a recorder has no use for it before
    from nfo_sinus_driver.demo.plot import draw
    from nfo_sinus_driver.demo.recorded import drives_in

    try:
        lines = _by_line(drives or drives_in(bag))
        for line, chosen in lines.items():
            path = picture if len(lines) == 1 else picture.with_stem(f'{picture.stem}_{line}')
            draw(bag, path, *chosen)
            print(f'{command}: the picture is {path}')
    except (OSError, ValueError) as error:
        print(f'{command}: cannot draw {bag}: {error}', file=sys.stderr)
        return 1
    return 0


def _by_line(drives: Sequence[str]) -> dict[str, list[str]]:
    """Return the drives of each line, by its namespace as a part of a file name."""
    lines: dict[str, list[str]] = {}
    for drive in drives:
        namespace = drive.rpartition('/')[0].strip('/')
        lines.setdefault(namespace.replace('/', '_') or 'root', []).append(drive)
    return lines


def _explain(bag: Path, drives: Sequence[str]) -> int:
    """Say what happened to some drives, or all."""
    from nfo_sinus_driver.demo.explanation import explanation
    from nfo_sinus_driver.demo.recorded import drives_in, read

    try:
        runs = read(bag, drives or drives_in(bag))
    except (OSError, ValueError) as error:
        print(f'plot: cannot read {bag}: {error}', file=sys.stderr)
        return 1
    try:
        for run in runs:
            put('\n'.join([*explanation(run), '']))
    except OutputLost as error:
        if not isinstance(error.__cause__, BrokenPipeError):
            print(f'plot: {error}', file=sys.stderr)
        return 1
    return 0


def _record(bag: Path, options: argparse.Namespace, arguments: Sequence[str]) -> list[str]:
    """Record on a thread of its own until the end; return the drives."""
    with contextlib.ExitStack() as stack:
        init_ros(arguments)
        stack.callback(rclpy.try_shutdown)
        drives = _drives_of_graph() if options.all else [options.drive or '/nfo_sinus']
        # nothing is received any more when the bag is closed
        recorder = Recorder(
            bag, drives, {}, lambda drive: print(f'record: {drive} is heard', flush=True)
        )
        stack.enter_context(recorder)
        executor = SingleThreadedExecutor()
        executor.add_node(recorder)
        stack.enter_context(spinning(executor))
        print(f'record: {", ".join(drives)} goes to {bag}; Ctrl-C ends it', flush=True)
        _wait(recorder, options.seconds)
    return drives


def _drives_of_graph() -> list[str]:
    """Return all drives, once no other one has come for a while; a RecordingError if none does."""
    node = Node('record_all', enable_rosout=False)
    try:
        drives: list[str] = []
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end:
            found = sorted(
                topic.removesuffix('/status')
                for topic, types in node.get_topic_names_and_types()
                if name_of(DriveStatus) in types and topic.endswith('/status')
                # one who only listens makes a topic, too
                and node.count_publishers(topic)
            )
            if found != drives:
                drives, end = found, time.monotonic() + _QUIET
            time.sleep(_POLL_SIGNALS)
    finally:
        node.destroy_node()
    if not drives:
        raise RecordingError(f'there is no drive {_where()}: does a driver run?')
    return drives


def _where() -> str:
    return f'in this ROS_DOMAIN_ID ({os.environ.get("ROS_DOMAIN_ID", "0")})'


def _wait(recorder: Recorder, seconds: float) -> None:
    """Wait until the time is over, or a signal ends it."""
    end = time.monotonic() + seconds
    with contextlib.suppress(KeyboardInterrupt):
        _sleep_until(min(end, time.monotonic() + _PATIENCE))
        if silent := ', '.join(recorder.silent):
            print(
                f'record: nothing is heard of {silent} yet: does the driver run, with this name '
                f'and {_where()}?',
                file=sys.stderr, flush=True,
            )
        _sleep_until(end)
    # what was recorded is now closed and drawn, and that must not be cut short
    handle_signals(signal.SIG_IGN)
    # the end overtakes messages: a subscriber does not know which are yet to come
    recorder.catch_up()


def _sleep_until(end: float) -> None:
    """Sleep in pieces: between them a signal is handled that came to another thread."""
    while (left := end - time.monotonic()) > 0:
        time.sleep(min(left, _POLL_SIGNALS))


def _record_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='record', description='Records what drives do until Ctrl-C, and draws it.',
    )
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument(
        'drive', nargs='?', type=_node, metavar='DRIVE',
        help='the full name of the drive node (default: /nfo_sinus)',
    )
    chosen.add_argument(
        '--all', action='store_true',
        help='every drive that is in the graph at the start; one picture for each line',
    )
    parser.add_argument(
        '--output', type=Path, metavar='DIR',
        help='where bag (DIR/ride) and picture (DIR/ride.png) go; '
        'ride_<date and time> in the current directory if not given',
    )
    parser.add_argument(
        '--for', type=_seconds, default=math.inf, dest='seconds', metavar='SECONDS',
        help='end it after so long, and once that is written which has come by then',
    )
    parser.add_argument('--version', action='version', version=f'nfo_sinus_driver {VERSION}')
    return parser


def _plot_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='plot', description='Draws what a bag tells of drives, and why they stopped.',
    )
    parser.add_argument('bag', type=Path, metavar='BAG', help='the folder of the bag')
    parser.add_argument(
        '--drive', type=_node, metavar='DRIVE',
        help='the full name of the drive node (default: all, one picture for each line)',
    )
    parser.add_argument(
        '--explain', action='store_true',
        help='say what happened, when, by whom and why, in place of a picture',
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
