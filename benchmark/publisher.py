# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Publishes set-points at random moments and says when; a process of its own.

Each drive gets one in its turn. Prints one JSON list: moment (s of the steady clock), number of
the drive, value, how long the call took (s). Then it waits to be ended. With a count of 0 all
drives get the same set-point again and again, until it is ended.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import time

import rclpy
from rclpy.qos import QoSProfile
from std_msgs.msg import Float32

#: How long drives may take to listen, s.
_PATIENCE = 30.0
#: Between two set-points, s: 10 to 20 a second.
_PERIODS = (0.05, 0.1)
#: Hz. No value comes again before all others were published.
VALUES = [5.0 + 0.5 * step for step in range(61)]
#: The set-point that does not change, Hz, and how often each drive gets it, s.
_SAME = 20.0
_SAME_PERIOD = 0.1


def main() -> None:
    """Wait until all drives listen, publish, and say when."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('count', type=int)
    parser.add_argument('names', nargs='+')
    options = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node('bench_publisher')
    publishers = [
        node.create_publisher(Float32, f'/{name}/setpoint', QoSProfile(depth=1))
        for name in options.names
    ]
    deadline = time.monotonic() + _PATIENCE
    while not all(publisher.get_subscription_count() for publisher in publishers):
        if time.monotonic() > deadline:
            raise SystemExit('not every drive listens to its set-points')
        time.sleep(0.05)
    while not options.count:
        for publisher in publishers:
            publisher.publish(Float32(data=_SAME))
        time.sleep(_SAME_PERIOD)
    chance = random.Random()
    published = []
    for number in range(options.count):
        time.sleep(chance.uniform(*_PERIODS))
        drive = number % len(publishers)
        message = Float32(data=VALUES[number % len(VALUES)])
        at = time.monotonic()
        publishers[drive].publish(message)
        published.append((at, drive, message.data, time.monotonic() - at))
    time.sleep(1.0)
    print(json.dumps(published), flush=True)
    # whoever reads it wants to know what this process has cost
    signal.pause()


if __name__ == '__main__':
    main()
