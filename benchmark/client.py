# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Publishes set-points, or calls stops, at random moments and says when; a process of its own.

Each drive in its turn. Prints one JSON list: moment (s of the steady clock), number of the drive,
value. With ``steady`` all drives get the same set-point again and again, until it is ended.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
import json
import random
import time
from typing import Any

import rclpy
from rclpy.client import Client
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float32
from std_srvs.srv import SetBool, Trigger

#: How long the master may take to listen, and to answer, s.
_PATIENCE = 60.0
#: Hz. No value comes again before all others were published.
_VALUES = [5.0 + 0.5 * step for step in range(61)]
#: The set-point that does not change, Hz, and how often each drive gets it, s.
_SAME = 20.0
_SAME_PERIOD = 0.1
_Called = tuple[float, int, float]


def main() -> None:
    """Do it, and print when."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('what', choices=_WHAT)
    parser.add_argument('count', type=int)
    parser.add_argument('names', nargs='+')
    options = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node('bench_client')
    print(json.dumps(list(_WHAT[options.what](node, options.names, options.count))), flush=True)


def _publishers(node: Node, names: list[str]) -> list[Any]:
    made = [
        node.create_publisher(Float32, f'/{name}/setpoint', QoSProfile(depth=1)) for name in names
    ]
    deadline = time.monotonic() + _PATIENCE
    while not all(publisher.get_subscription_count() for publisher in made):
        if time.monotonic() > deadline:
            raise SystemExit('not every drive listens to its set-points')
        time.sleep(0.05)
    return made


def _setpoints(node: Node, names: list[str], count: int) -> Iterator[_Called]:
    publishers = _publishers(node, names)
    for number in range(count):
        time.sleep(random.uniform(0.05, 0.1))
        drive, value = number % len(names), _VALUES[number % len(_VALUES)]
        at = time.monotonic()
        publishers[drive].publish(Float32(data=value))
        yield at, drive, value
    time.sleep(1.0)


def _steady(node: Node, names: list[str], count: int) -> Iterator[_Called]:
    publishers = _publishers(node, names)
    while True:
        for publisher in publishers:
            publisher.publish(Float32(data=_SAME))
        time.sleep(_SAME_PERIOD)
    yield


def _stops(node: Node, names: list[str], count: int) -> Iterator[_Called]:
    # no more drives than it takes: each client is one more for the master
    chosen = random.sample(range(len(names)), min(count, len(names)))
    clients = {
        drive: (
            node.create_client(Trigger, f'/{names[drive]}/stop'),
            node.create_client(SetBool, f'/{names[drive]}/enable'),
        )
        for drive in chosen
    }
    # the first request of a new client waits until the master knows it
    for _, enable in clients.values():
        _call(node, enable, SetBool.Request(data=True))
    for number in range(count):
        drive = chosen[number % len(chosen)]
        stop, enable = clients[drive]
        time.sleep(random.uniform(0.1, 0.6))
        at = time.monotonic()
        _call(node, stop, Trigger.Request())
        yield at, drive, 0.0
        _call(node, enable, SetBool.Request(data=True))


def _call(node: Node, client: Client, request: Any) -> None:
    if not client.wait_for_service(_PATIENCE):
        raise SystemExit(f'there is no service {client.srv_name}')
    future = client.call_async(request)
    rclpy.spin_until_future_complete(node, future, timeout_sec=_PATIENCE)
    response = future.result()
    if response is None or not response.success:
        raise SystemExit(f'{client.srv_name}: {response}')


_WHAT: dict[str, Callable[[Node, list[str], int], Iterator[_Called]]] = {
    'setpoints': _setpoints, 'steady': _steady, 'stops': _stops
}

if __name__ == '__main__':
    main()
