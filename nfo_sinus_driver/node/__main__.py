# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The ``driver`` command, also as ``python -m nfo_sinus_driver.node``.

ROS takes a second to load. Signals are held before that, for a signal without a handler would end
the process as if it had been killed.
"""

from __future__ import annotations

import os
import sys

from nfo_sinus_driver.node.ros.nonblocking_stdio import open_closed_streams
from nfo_sinus_driver.signals import HeldSignals, ros2_parent


def main(args: list[str] | None = None) -> int:
    """Run the driver until a signal ends it; returns 1 if a stop was not confirmed."""
    open_closed_streams()
    signals = HeldSignals()
    # to the end, so that none cuts the end of the process short
    signals.hold()
    # as early as possible: a parent that has ended before it was looked for is not noticed
    parent = ros2_parent(os.getppid())
    from nfo_sinus_driver.node.process import main as process

    return process.main(signals, parent, args)


if __name__ == '__main__':
    sys.exit(main())
