# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
A CAN bus with nodes on it, and the adapter through which a master is there.

Knows no clock of its own: it is given the time, so that tests can make it up. Of the frames that
wait for the bus the one with the least identifier goes first; the adapter sends its own in order. A
frame that no node takes (no node has power, a line that carries nothing, another bit rate) is not
sent again later.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import enum
import itertools

from nfo_sinus_driver.simulator import can_frames
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.canopen import ANSWERS, Server
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.lawicel import Adapter
from nfo_sinus_driver.simulator.line import Trace
from nfo_sinus_driver.simulator.line_faults import LineFaults
from nfo_sinus_driver.simulator.ports import Port
from nfo_sinus_driver.simulator.timing import Timing
from nfo_sinus_driver.simulator.wire import Wire

_NAME = 'canopen'


class _Else(enum.Enum):
    """Who sends frames beside the nodes."""

    MASTER = enum.auto()
    FOREIGN = enum.auto()


#: What others send each other: process data, a heartbeat, an answer to another master.
_FOREIGN = (
    Frame(0x1FA, bytes.fromhex('37060000F4010000')),
    Frame(0x2FB, bytes.fromhex('1F00E803')),
    Frame(0x77A, b'\x05'),
    Frame(0x5FB, bytes.fromhex('4B26200225000000')),
)
#: Those that a busy machine was late for are made up for, but not for longer than this (s).
_MOST_LATE = 0.1


@dataclass(frozen=True)
class _Waiting:
    """A frame that waits for the bus: since when, whose, and what is wrong with it."""

    since: float
    order: int
    frame: Frame
    sender: Server | _Else
    note: str

    @property
    def precedence(self) -> tuple[int, int]:
        """The least is sent first."""
        # of a standard identifier the bits are compared first
        identifier = self.frame.identifier << (0 if self.frame.extended else 18)
        return identifier << 1 | self.frame.extended, self.order


class CanLine(Wire):
    """
    One bus with several drives on it.

    :param adapter: what a master is there by.
    :param paced: frames take the time that they take on a real bus.
    :param turnaround: time a drive takes before it answers (s).
    :param always_heard: the drives hear it whatever they are set to.
    """

    name = _NAME

    def __init__(
        self,
        port: Port,
        adapter: Adapter,
        drives: Sequence[SimulatedDrive],
        timing: Timing,
        *,
        paced: bool = False,
        turnaround: float = 0.0,
        always_heard: bool = False,
        trace: Trace | None = None,
    ) -> None:
        self._bit = 1 / timing.baud if paced else 0.0
        super().__init__(port, timing, LineFaults(whole=True))
        self.speed = f'{timing.baud} bit/s'
        self._adapter = adapter
        self._drives = drives
        self._servers = [(drive.control_unit, _server_of(drive)) for drive in drives]
        self._turnaround = turnaround
        self._always_heard = always_heard
        self._trace = trace
        self._waiting: list[_Waiting] = []
        self._order = itertools.count()
        #: Until when a frame is on the bus.
        self._busy_until = float('-inf')
        #: When the last answer of each node was ready: it answers in order.
        self._answered: dict[int, float] = {}
        self._foreign = itertools.cycle(_FOREIGN)
        self._foreign_gap = 0.0
        self._foreign_at = float('inf')

    def set_traffic(self, rate: float, now: float) -> None:
        """Let others send frames that are for no node here; 0 ends it."""
        if not 0 <= rate <= self.timing.baud:
            raise ValueError(f'{rate:g} frames a second are not possible at {self.speed}')
        self._foreign_gap = 1 / rate if rate else 0.0
        self._foreign_at = now if rate else float('inf')

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that were read at ``now``."""
        for said in self._adapter.take_bytes(data):
            if isinstance(said, Frame):
                # every node that has power acknowledges it, also one that is not meant
                sent = self._carries(now) and any(drive.listening for drive in self._drives)
                if sent:
                    self._put(said, now, _Else.MASTER)
                elif self._trace is not None:
                    self._trace.record('request', _raw(said), now, now, 'lost')
                self.port.send(self._adapter.tried(said, sent=sent))
            else:
                self.port.send(said)
        self._act(now)

    def _act(self, now: float) -> None:
        for node in self._nodes():
            for frame in node.act(now):
                self._put(frame, now, node)
        self._foreign_at = max(self._foreign_at, now - _MOST_LATE)
        while self._foreign_at <= now:
            self._put(next(self._foreign), self._foreign_at, _Else.FOREIGN)
            self._foreign_at += self._foreign_gap
        while (next_ := self._next()) is not None:
            waiting, end = next_
            if end > now:
                return
            self._waiting.remove(waiting)
            self._busy_until = end
            self._carry(waiting, end)

    @property
    def _due(self) -> float:
        next_ = self._next()
        times = [self._foreign_at, *(node.due for node in self._nodes())]
        return min([*times, *([next_[1]] if next_ else [])])

    def _unplugged(self) -> None:
        self._adapter.restart()
        self._waiting = [waiting for waiting in self._waiting if waiting.sender is not _Else.MASTER]

    # ---- inside ----

    def _nodes(self) -> Iterator[Server]:
        """Give the nodes that take part in the bus."""
        for unit, server in self._servers:
            if self._always_heard or unit.hears(_NAME, self.timing):
                yield server

    def _carries(self, now: float) -> bool:
        """Return whether frames come from the adapter to the nodes, and the other way."""
        return self._adapter.on_bus(self.timing.baud) and not self.faults.dead(now)

    def _put(
        self, frame: Frame, since: float, sender: Server | _Else, note: str = ''
    ) -> None:
        self._waiting.append(_Waiting(since, next(self._order), frame, sender, note))

    def _next(self) -> tuple[_Waiting, float] | None:
        """Return which frame gets the bus next, and when its end is there."""
        if not self._waiting:
            return None
        begin = max(self._busy_until, min(waiting.since for waiting in self._waiting))
        # the adapter sends in order: of its frames only the first takes part
        of_master = (waiting for waiting in self._waiting if waiting.sender is _Else.MASTER)
        masters = next(of_master, None)
        ready = (
            waiting
            for waiting in self._waiting
            if waiting.since <= begin and (waiting.sender is not _Else.MASTER or waiting is masters)
        )
        first = min(ready, key=lambda waiting: waiting.precedence)
        bits = can_frames.bits(first.frame)
        # each time that it is damaged, an error frame is in its place, and it comes again
        again = first.note.count('damaged') * (bits + can_frames.ERROR_BITS)
        return first, begin + (bits + again) * self._bit

    def _carry(self, waiting: _Waiting, end: float) -> None:
        """Let a frame arrive everywhere."""
        frame, sender = waiting.frame, waiting.sender
        dead = self.faults.dead(end)
        if self._trace is not None and sender is not _Else.FOREIGN:
            direction = 'request' if sender is _Else.MASTER else 'answer'
            note = 'lost' if dead else waiting.note
            begin = end - can_frames.bits(frame) * self._bit
            self._trace.record(direction, _raw(frame), begin, end, note)
        if dead:
            return
        if sender is not _Else.MASTER and self._carries(end):
            noise = self.faults.noise() if 'noise' in waiting.note else b''
            self.port.send(noise + self._adapter.text_of(frame, end))
        for node in self._nodes():
            if node is not sender:
                self._arrive(node, frame, end)

    def _arrive(self, node: Server, frame: Frame, end: float) -> None:
        """Let a frame arrive at a node, and what it sends for it wait for the bus."""
        drive = node.drive
        drive.advance_to(end)
        if not drive.listening:
            return
        # carrying it out may change it
        address, wait = node.node, drive.control_unit.response_time
        ready = end + max(self._turnaround, wait)
        for answer in node.receive(frame, end):
            if answer.identifier != ANSWERS + address:
                self._put(answer, ready, node)
                continue
            for reply in self.faults.alter(address, answer.data):
                since = max(ready + reply.delay, self._answered.get(address, ready))
                self._answered[address] = since
                self._put(answer._replace(data=reply.data), since, node, reply.note)


def _server_of(drive: SimulatedDrive) -> Server:
    """Return what answers for a drive on a CAN bus."""
    server = drive.servers[_NAME]
    assert isinstance(server, Server)
    return server


def _raw(frame: Frame) -> bytes:
    """Return what is written down of a frame: its identifier in two or four bytes, its data."""
    identifier = frame.identifier.to_bytes(4 if frame.extended else 2, 'big')
    return identifier + (b'' if frame.remote else frame.data)
