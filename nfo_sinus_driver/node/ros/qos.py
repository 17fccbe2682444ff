# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The quality of service of the driver's topics and services."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy


def newest(
    depth: int,
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE,
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE,
) -> QoSProfile:
    """Return a profile that keeps the newest messages; no policy of it is left to the vendor."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=reliability,
        durability=durability,
    )


#: For streams: status, actual values, telemetry, statistics.
RELIABLE = newest(10)
#: For what changes rarely, where late joiners need the last value.
LATCHED = newest(1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: For what happens rarely, where late joiners need the last few.
KEPT = newest(10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: For set-points: only the newest counts, and every publisher matches.
NEWEST = newest(1, reliability=ReliabilityPolicy.BEST_EFFORT)
#: For calls that command a drive: many may come at once, and every one of them is answered.
COMMANDS = newest(1000)
#: For reading /rosout: what was logged before is read, too.
ROSOUT = newest(1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
