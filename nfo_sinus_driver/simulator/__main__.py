# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``python -m nfo_sinus_driver.simulator`` is the ``simulator`` command."""

import sys

from nfo_sinus_driver.simulator.main import main

if __name__ == '__main__':
    sys.exit(main())
