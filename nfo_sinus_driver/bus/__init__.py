# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is sent next on one line: the scheduler, its tasks, and its counters."""

from nfo_sinus_driver.bus.statistics import Statistics
from nfo_sinus_driver.bus.tasks import Cancelled, Exchange, LatestValue, Priority, Task
from nfo_sinus_driver.bus.worker import Bus

__all__ = ['Bus', 'Cancelled', 'Exchange', 'LatestValue', 'Priority', 'Statistics', 'Task']
