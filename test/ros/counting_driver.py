# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The driver, which also counts how often it is woken by ROS; a process of its own.

Appends one byte to the file that is its first argument whenever a wait set of rclpy returns. The
second argument is the command that it stands for.
"""

from __future__ import annotations

import os
import sys

from rclpy.impl.implementation_singleton import rclpy_implementation

from nfo_sinus_driver.node.__main__ import main


def run() -> int:
    """Run the driver until it ends."""
    count = os.open(sys.argv.pop(1), os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    sys.argv.pop(1)

    class CountingWaitSet(rclpy_implementation.WaitSet):
        def wait(self, timeout: int) -> None:
            super().wait(timeout)
            os.write(count, b'.')

    rclpy_implementation.WaitSet = CountingWaitSet
    return main()


if __name__ == '__main__':
    sys.exit(run())
