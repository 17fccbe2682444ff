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

"""What the nodes of one process share: the bus, the outbox, and who is who."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import contextlib
from dataclasses import dataclass
from dataclasses import field
import threading
from typing import TYPE_CHECKING

from rclpy.qos import DurabilityPolicy
from rclpy.qos import HistoryPolicy
from rclpy.qos import QoSProfile
from rclpy.qos import ReliabilityPolicy

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.node.listener import Listener
from nfo_sinus_driver.node.outbox import Outbox

if TYPE_CHECKING:
    from nfo_sinus_driver.node.drive_node import DriveNode

#: How long the bus waits for what is to begin at once, s; no drive times out by then.
_LONGEST_GATHERING = 0.1

#: For what flows: status, actual values, telemetry, statistics.
RELIABLE = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)
#: For what changes rarely and late comers want to know.
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: For what happens rarely, where late comers want to know the last few.
KEPT = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
#: For set-points: only the newest counts, and every publisher matches.
NEWEST = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
#: For calls that command a drive: many may come at once, and every one of them is answered.
COMMANDS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=1000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)


@dataclass
class Line:
    """
    One bus and the nodes on it.

    :ivar retries: how often a request that nobody answered is repeated.
    """

    bus: Bus
    outbox: Outbox
    retries: int
    drives: list[DriveNode] = field(default_factory=list)
    listener: Listener = field(default_factory=Listener)

    def say(self, log: Callable[[str], object], text: str) -> None:
        """Log a line from the outbox, for the bus must not wait for a log."""
        self.outbox.put(lambda: log(text))

    @contextlib.contextmanager
    def at_once(self) -> Iterator[None]:
        """Have all that is asked of the bus meanwhile begin together, between two transactions."""
        complete = threading.Event()
        self.bus.call(lambda: complete.wait(_LONGEST_GATHERING))
        try:
            yield
        finally:
            complete.set()

    def rival_of(self, owner: DriveNode, address: int) -> DriveNode | None:
        """Return another node whose drive would answer to an address, too."""
        alone = self.bus.protocol.point_to_point
        for node in self.drives:
            theirs = node.settings.address
            if node is not owner and (theirs == address or alone in (theirs, address)):
                return node
        return None
