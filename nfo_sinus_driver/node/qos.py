# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The quality of service of the driver's topics and services."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

#: For streams: status, actual values, telemetry, statistics.
RELIABLE = QoSProfile(depth=10)
#: For what changes rarely, where late joiners need the last value.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: For what happens rarely, where late joiners need the last few.
KEPT = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: For set-points: only the newest counts, and every publisher matches.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
#: For calls that command a drive: many may come at once, and every one of them is answered.
COMMANDS = QoSProfile(depth=1000)
