# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the nodes of one process share: the bus, the publish queue, and the drives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
import contextlib
from dataclasses import dataclass, field
import logging
import threading
import time
from typing import Any, Protocol

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from std_msgs.msg import Float32

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Report
from nfo_sinus_driver.drive.change.memory import Memory
from nfo_sinus_driver.drive.known.settings import BLOCK_SIZE
from nfo_sinus_driver.node.bags.black_box import BlackBox
from nfo_sinus_driver.node.drive.graph_watch import PERIOD, GraphWatch
from nfo_sinus_driver.node.drive.managed_drive import ManagedDrive
from nfo_sinus_driver.node.drive.setpoint_checks import Origin
from nfo_sinus_driver.node.drive.setpoint_subscriber import SetpointSubscriber
from nfo_sinus_driver.node.ros.publish_queue import PublishQueue

_log = logging.getLogger(__name__)

#: How long the bus waits for commands that are to begin at once, s; no drive times out by then.
_LONGEST_GATHERING = 0.1


class JointInput(Protocol):
    """What takes the set-points of a joint of a line."""

    @property
    def joint_name(self) -> str:
        """Its name in messages."""

    @property
    def setpoint_timeout(self) -> float:
        """After how long a set-point is old, s; 0: never."""

    @property
    def follows(self) -> bool:
        """The motor follows set-points."""

    @property
    def how_to_enable(self) -> str:
        """What to call so that it does."""

    def setpoint(self, velocity: float) -> float:
        """Return the set-point for a velocity, rad/s; a ValueError says why there is none."""

    def take(self, value: float, origin: Origin) -> None:
        """Take a set-point in the unit of the drive."""


@dataclass
class BusContext:
    """
    One bus and the drives on it.

    :ivar retries: how often a request without an answer is repeated.
    :ivar memory: keeps what is to be put back in the drives.
    :ivar black_box: keeps the last minute of the line.
    :ivar introspection: what is published of calls that are no commands.
    :ivar bond: each drive's node has a bond while it is active.
    """

    bus: Bus
    retries: int
    memory: Memory
    black_box: BlackBox
    introspection: str
    bond: bool
    publish_queue: PublishQueue = field(default_factory=PublishQueue)
    setpoint_subscriber: SetpointSubscriber = field(default_factory=SetpointSubscriber)
    graph_watch: GraphWatch = field(default_factory=GraphWatch)
    #: The names of all drives of the line, those to come too.
    names: list[str] = field(default_factory=list)
    drives: list[ManagedDrive] = field(default_factory=list)
    #: The functions that take a set-point for all drives of the line, one for each drive.
    on_setpoint_all: list[Callable[[Float32, Origin], None]] = field(default_factory=list)
    #: What takes the set-points of each joint.
    joints: list[JointInput] = field(default_factory=list)
    #: The functions that return the diagnosis of each drive, called by the publish queue.
    diagnose: list[Callable[[], DiagnosticStatus]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.publish_queue.put_every(PERIOD, self.graph_watch.look_at_graph)

    def expect(self, names: Sequence[str]) -> None:
        """Note the names of the drives that will be added."""
        self.names += names

    def stop_beside(self, names: Collection[str], why: Report) -> None:
        """Stop the motors of drives because another one stops; called on the bus."""
        for managed in self.drives:
            if managed.name in names:
                managed.drive.stop_beside(why)

    def subscribe(
        self, node: Node, topics: Mapping[str, tuple[type, Callable[[Any, Origin], None]]]
    ) -> None:
        """Subscribe to topics, each of a type and for a function; warn of other types."""
        for topic, (type_, callback) in topics.items():
            self.setpoint_subscriber.subscribe(node, type_, topic, callback)
        self.graph_watch.add(node, {topic: type_ for topic, (type_, _) in topics.items()})

    def add(self, drive: ManagedDrive) -> None:
        """Add a drive."""
        self.drives.append(drive)

    def diagnoses(self) -> Iterator[DiagnosticStatus]:
        """Yield the diagnosis of every drive."""
        for diagnose in self.diagnose:
            try:
                yield diagnose()
            except Exception:
                # one that cannot be told must not silence the others
                _log.exception('a drive could not be diagnosed')
            # the bus may want to go on
            time.sleep(0)

    def log(self, log: Callable[[str], object], text: str) -> None:
        """Log a line from the publishing thread, for the bus must not wait for a log."""
        self.publish_queue.put(lambda: log(text))

    @contextlib.contextmanager
    def at_once(self) -> Iterator[None]:
        """Have all requests to the bus meanwhile begin together, between two transactions."""
        complete = threading.Event()
        self.bus.call(lambda: complete.wait(_LONGEST_GATHERING))
        try:
            yield
        finally:
            complete.set()

    def address_conflict(self, name: str, address: int, block: int) -> str | None:
        """
        Return the name of another drive that would answer to the address of this one, too.

        :param block: the first register of its block, behind a PLC; blocks may not overlap.
        """
        alone = self.bus.protocol.point_to_point
        for drive in self.drives:
            theirs = drive.settings.address
            apart = abs(drive.settings.block_address - block) >= BLOCK_SIZE
            same = theirs == address and not apart
            if drive.name != name and (same or alone in (theirs, address)):
                return drive.name
        return None
