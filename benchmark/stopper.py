# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Stops drives at random moments by their service and says when; a process of its own.

Each drive is stopped in its turn and enabled again. Prints one JSON list: moment of the call (s of
the steady clock), number of the drive, how long the middleware took to send the request (s). Then
it waits to be ended.
"""

from __future__ import annotations

import argparse
import json
import random
import signal
import time
from typing import Any

import rclpy
from rclpy.client import Client
from std_srvs.srv import SetBool, Trigger

#: How long the driver may take to be there, and to answer, s.
_PATIENCE = 60.0
#: Between two stops, s.
_PAUSES = (0.1, 0.6)


def main() -> None:
    """Stop drives in turn and say when."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('count', type=int)
    parser.add_argument('names', nargs='+')
    options = parser.parse_args()
    rclpy.init()
    node = rclpy.create_node('bench_stopper')
    # no more drives than it takes: each client is one more for the driver
    names = random.sample(options.names, min(options.count, len(options.names)))
    drives = [
        (
            options.names.index(name),
            node.create_client(Trigger, f'/{name}/stop'),
            node.create_client(SetBool, f'/{name}/enable'),
        )
        for name in names
    ]
    for _, *clients in drives:
        for client in clients:
            if not client.wait_for_service(_PATIENCE):
                raise SystemExit(f'there is no service {client.srv_name}')
    # the first request of a new client waits until the driver knows it
    for _, _, enable in drives:
        _call(node, enable, SetBool.Request(data=True))
    called = []
    for number in range(options.count):
        drive, stop, enable = drives[number % len(drives)]
        time.sleep(random.uniform(*_PAUSES))
        at = time.monotonic()
        called.append((at, drive, _call(node, stop, Trigger.Request()) - at))
        _call(node, enable, SetBool.Request(data=True))
    print(json.dumps(called), flush=True)
    # whoever reads it wants to know what this process has cost
    signal.pause()


def _call(node: rclpy.node.Node, client: Client, request: Any) -> float:
    """Call a service; return when the request was sent."""
    future = client.call_async(request)
    sent_at = time.monotonic()
    rclpy.spin_until_future_complete(node, future, timeout_sec=_PATIENCE)
    response = future.result()
    if response is None or not response.success:
        raise SystemExit(f'{client.srv_name}: {response}')
    return sent_at


if __name__ == '__main__':
    main()
