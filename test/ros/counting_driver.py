# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
