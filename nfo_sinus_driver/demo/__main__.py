# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``make demo``: starts a simulated drive and the driver, goes through the sequence, and ends both.

What the topics say goes to a bag, and what the bag says to a plot. It ends with 0 only if every
step happened.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
import contextlib
import os
from pathlib import Path
import shutil
import signal
import sys
import tempfile
import time
from typing import IO

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from nfo_sinus_driver.demo.bench import Bench, handle_signals, own_domain
from nfo_sinus_driver.demo.record import why_no_picture
from nfo_sinus_driver.demo.recording import Recorder, RecordingError, replay_warning
from nfo_sinus_driver.demo.sequence import (
    HEADING,
    PATIENCE,
    DemoSequence,
    DomainTakenError,
    StepError,
)
from nfo_sinus_driver.node.bags import bags
from nfo_sinus_driver.node.ros.executor import spinning

#: More often than by default, for a smooth curve.
_DRIVER_SETTINGS = ('-p', 'telemetry_rate:=5.0')
#: How many are tried before the demo fails because there is another driver in each.
_DOMAINS = 3
_INTERRUPTED = 130
_REMARKS = {'title': 'Forward, backward, a fault, and on again', 'drive': 'simulated drive'}


def main() -> int:
    """Start everything, go through the sequence, end everything, and draw."""
    handle_signals(signal.default_int_handler)
    folder = _output_folder()
    no_bag = bags.why_none()
    missing = [why for why in (no_bag, why_no_picture()) if why]
    bag = None if no_bag else folder / 'ride'
    if missing:
        what = 'no plot' if bag else 'neither a bag nor a plot'
        print(f'There will be {what} of the run: {", ".join(missing)}', flush=True)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    with tempfile.TemporaryFile() as log:
        try:
            _run_alone(bag, log)
        except (StepError, RecordingError, RuntimeError) as error:
            log.seek(0)
            print(f'\nWhat driver and simulator said:\n{log.read().decode()}', file=sys.stderr)
            print(f'FAILED: {error}', file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print('ended before the run was done', file=sys.stderr)
            return _INTERRUPTED
    print('The run is done: every step happened.')
    if bag:
        print(f'Its bag: {bag}; {replay_warning("/nfo_sinus")}')
    if not missing:
        from nfo_sinus_driver.demo.plot import draw

        picture = folder / 'ride.png'
        draw(bag, picture, '/nfo_sinus')
        print(f'Its picture: {picture}')
    return 0


def _run_alone(bag: Path | None, log: IO[bytes]) -> None:
    """
    Go through the sequence in a ROS domain that no other driver is in.

    :raises StepError: a step did not happen.
    """
    for attempts_left in reversed(range(_DOMAINS)):
        with own_domain() as domain:
            os.environ['ROS_DOMAIN_ID'] = str(domain)
            try:
                _run(bag, log)
                return
            except DomainTakenError as error:
                if bag is not None:
                    shutil.rmtree(bag)
                if not attempts_left:
                    raise
                print(f'{error}: the demo begins again in another domain', flush=True)


def _run(bag: Path | None, log: IO[bytes]) -> None:
    with Bench(log) as bench:
        try:
            print(bench.start_simulator())
            with _sequence(bag) as sequence:
                driver = bench.start_driver(*_DRIVER_SETTINGS)
                print(HEADING, flush=True)
                sequence.run(bench)
                driver.send_signal(signal.SIGINT)
                if driver.wait(PATIENCE) != 0:
                    raise StepError('the driver did not end as it should')
        except KeyboardInterrupt:
            # what the bench now ends is not cut short
            handle_signals(signal.SIG_IGN)
            raise


@contextlib.contextmanager
def _sequence(bag: Path | None) -> Iterator[DemoSequence]:
    """Have a sequence, and a recorder if there is to be a bag, on a thread of their own."""
    with contextlib.ExitStack() as stack:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.shutdown)
        executor = SingleThreadedExecutor()
        # before anything is there to be heard
        if bag is not None:
            recorder = stack.enter_context(Recorder(bag, ['/nfo_sinus'], _REMARKS))
            executor.add_node(recorder)
        sequence = DemoSequence()
        stack.callback(sequence.destroy_node)
        executor.add_node(sequence)
        stack.enter_context(spinning(executor))
        yield sequence
        if bag is not None:
            recorder.catch_up()


def _output_folder() -> Path:
    parser = argparse.ArgumentParser(
        prog='demo', description='A short run of a simulated drive, recorded and drawn.',
    )
    parser.add_argument(
        '--output', type=Path, metavar='DIR',
        help='where bag (DIR/ride) and plot (DIR/ride.png) go; '
        'demo_output/<date and time> in the current directory if not given',
    )
    given: Path | None = parser.parse_args().output
    folder = given or Path('demo_output', time.strftime('%Y-%m-%d_%H-%M-%S'))
    if (folder / 'ride').exists():
        parser.error(f'{folder / "ride"} is there already, and is not written over')
    return folder.resolve()


if __name__ == '__main__':
    sys.exit(main())
