# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The driver, where no library for bags is installed; a process of its own.

The argument is the command that it stands for.
"""

from __future__ import annotations

import sys

from nfo_sinus_driver.node.__main__ import main


def run() -> int:
    """Run the driver until it ends."""
    sys.argv.pop(1)
    # what is None there cannot be imported, nor found
    sys.modules.update(dict.fromkeys(('rosbag2_py', 'rosbags')))
    return main()


if __name__ == '__main__':
    sys.exit(run())
