# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``make run``: a simulated drive and the driver, up until Ctrl-C, for one's own commands."""

from __future__ import annotations

import shutil
import signal
import sys

from nfo_sinus_driver.demo.bench import Bench, handle_signals

_WITH_ROS2 = """
The driver is up. In another terminal (`. tools/env.sh`, or your own Jazzy), try:

  ros2 service call /nfo_sinus/enable std_srvs/srv/SetBool '{data: true}'
  ros2 topic pub -r 10 /nfo_sinus/setpoint std_msgs/msg/Float32 '{data: 25.0}'
  ros2 topic echo /nfo_sinus/actual_speed
  ros2 service call /nfo_sinus/stop std_srvs/srv/Trigger
  simulator inject --link %s fault 5
  ros2 topic echo --once /nfo_sinus/inv_st
  ros2 service call /nfo_sinus/fault_ack std_srvs/srv/Trigger

After that nothing turns until the next enable.

Ctrl-C stops the motor and ends both.
"""
_WITHOUT_ROS2 = """
The driver is up. The ros2 tool is not installed here. In other terminals try without it:

  tools/run python examples/ride.py
  tools/run monitor
  tools/run record
  tools/run simulator inject --link %s fault 5
  tools/run python examples/ride.py --acknowledge

Ctrl-C stops the motor and ends both.
"""


def main() -> int:
    """Run both until one of them ends or a signal comes; then the driver is ended first."""
    handle_signals(signal.default_int_handler)
    with Bench() as bench:
        try:
            print(bench.start_simulator(), flush=True)
            bench.start_driver('-p', 'drive_timeout:=2.0')
            text = _WITHOUT_ROS2 if shutil.which('ros2') is None else _WITH_ROS2
            print(text % bench.port, flush=True)
            return bench.wait()
        except KeyboardInterrupt:
            handle_signals(signal.SIG_IGN)
            return 0


if __name__ == '__main__':
    sys.exit(main())
