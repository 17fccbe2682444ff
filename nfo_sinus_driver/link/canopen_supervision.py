# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How nodes of CANopen notice that this client is gone, and this client that a node has restarted.

Three messages are sent beside requests and answers (CiA 301 §7.2.8): the client's heartbeat, which
a node watches by its object 1016h; the client's request for the state of a node that is guarded
(100Ch, 100Dh); and the boot-up message of a node. The thread that sends requests serves all of
them, so they end with it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence, Set as AbstractSet
import math
from typing import NamedTuple

from nfo_sinus_driver.link.can import CanPort, Frame
from nfo_sinus_driver.link.interface import Address, Clock, Refused, Reply

#: Added to the address of a node, the identifier of its boot-up and of its heartbeat.
HEARTBEATS = 0x700
#: The node ids.
NODES = range(1, 128)

_COMMANDS = 0x000
_START = 0x01
_BOOTED, _OPERATIONAL = b'\x00', b'\x05'

#: How often the heartbeat is sent, s, and how often at least within the time-out of a node.
_HEARTBEAT = 0.1
_BEATS = 4
#: How often a line without requests is read, s.
_LISTENING = 0.1
#: How long unrequested frames are taken, s: on a full bus more keep coming.
LONGEST_DRAIN = 0.1
#: How many requests in a row a guarded node may miss: its life time factor.
_LIFE_FACTOR = 4
#: How many entries for heartbeats of a node are tried.
_ENTRIES = 8
#: The longest time-out of an entry, ms.
_LONGEST = 0xFFFF

HEARTBEAT_MEANS = 'consumer heartbeat, object 1016h'
GUARDING_MEANS = 'node guarding, objects 100Ch and 100Dh'


def heartbeat(client: int) -> Frame:
    """Return the heartbeat of a client, which has this node id for the nodes that watch it."""
    return Frame(HEARTBEATS + client, _OPERATIONAL)


def guarding_request(unit: int) -> Frame:
    """Return the request for the state of a node; a guarded node notices when they cease."""
    return Frame(HEARTBEATS + unit, bytes(1), remote=True)


def start(unit: int) -> Frame:
    """Return the command that makes a node operational; it has no answer."""
    return Frame(_COMMANDS, bytes((_START, unit)))


def booted(frame: Frame) -> int | None:
    """Return which node has restarted; ``None``: the frame is no boot-up."""
    unit = frame.identifier - HEARTBEATS
    return unit if unit in NODES and frame.data == _BOOTED else None


class _Guarding(NamedTuple):
    """How often the state of a node is requested, s, and when next."""

    period: float
    due: float


class CanopenSupervision:
    """
    The heartbeat and guarding of this client on one line, and the boot-ups of nodes.

    :param take: takes what has come until a moment, and hands it to :meth:`take_frames`.
    :param read: reads an object of a node; ``write`` writes one.
    """

    def __init__(
        self,
        port: CanPort,
        now: Clock,
        take: Callable[[float], Sequence[Frame]],
        read: Callable[[int, Address], Reply],
        write: Callable[[int, Address, bytes], Reply],
    ) -> None:
        self._port = port
        self.now = now
        self._take = take
        self._read = read
        self._write = write
        #: The nodes that got a request.
        self._addressed: set[int] = set()
        self._restarted: set[int] = set()
        #: The nodes that watch the heartbeat: their time-out, s, and in which entry.
        self._watching: dict[int, tuple[float, int]] = {}
        self._guarded: dict[int, _Guarding] = {}
        #: The node id of this client for those that watch it; 0: it is not settled.
        self._client = 0
        #: It has written something, so that a node may need its heartbeat.
        self._commands = False
        self._beat_due = self._listen_due = 0.0

    # --- for the link -----------------------------------------------------------------------------

    def note_request(self, unit: int, *, writes: bool) -> None:
        """Note a request to a node."""
        self._addressed.add(unit)
        self._commands |= writes

    def opened(self) -> None:
        """Note that the port was opened: nodes may have missed heartbeat and guarding for long."""
        self._beat_due = self._listen_due = 0.0
        for unit, guarding in self._guarded.items():
            self._guarded[unit] = guarding._replace(due=0.0)

    def closed(self) -> None:
        """Note that the port is closed: heartbeat and guarding go on when it is open."""
        self._addressed.clear()
        self._restarted.clear()
        self._commands = False

    def take_frames(self, frames: Sequence[Frame]) -> AbstractSet[int]:
        """Take what has come; return which nodes have restarted."""
        started = {unit for unit in map(booted, frames) if unit is not None}
        self._restarted |= started
        return started

    @property
    def sign_due(self) -> float:
        """When the next heartbeat or guarding is due, s of ``time.monotonic``; or infinity."""
        beats = self._commands or self._watching
        asking = (guarding.due for guarding in self._guarded.values())
        return min(self._beat_due if beats else math.inf, *asking, math.inf)

    def send_due(self, now: float) -> None:
        """Send what is due (PortError: the port is lost)."""
        if (self._commands or self._watching) and now >= self._beat_due:
            self._port.send(heartbeat(self.client))
            shortest = min((seconds for seconds, _ in self._watching.values()), default=math.inf)
            self._beat_due = now + min(_HEARTBEAT, shortest / _BEATS)
        for unit, guarding in self._guarded.items():
            if now >= guarding.due:
                self._port.send(guarding_request(unit))
                self._guarded[unit] = guarding._replace(due=now + guarding.period)

    # --- for the thread that has the line ---------------------------------------------------------

    @property
    def due(self) -> float:
        """When :meth:`serve` has to be called again, s of ``time.monotonic``; or infinity."""
        return min(self.sign_due, self._listen_due if self._addressed else math.inf)

    def serve(self) -> None:
        """Send what is due, and take what came unrequested (PortError: the port is lost)."""
        now = self.now()
        self.send_due(now)
        while self._take(0.0) and self.now() < now + LONGEST_DRAIN:
            continue
        self._listen_due = now + _LISTENING

    def take_restarted(self) -> AbstractSet[int]:
        """Return the nodes that have restarted since the last call."""
        if not self._restarted:
            return frozenset()
        restarted, self._restarted = self._restarted, set()
        return restarted

    def watch(self, unit: int, seconds: float) -> CanopenWatch:
        """Return how a node is made to watch this client, with a time-out, s; 0: no longer."""
        return CanopenWatch(self, unit, seconds, self._read, self._write)

    # --- for what sets it up ----------------------------------------------------------------------

    @property
    def client(self) -> int:
        """The node id of this client for those that watch it; one that no node has."""
        if self._client:
            return self._client
        free = [unit for unit in reversed(NODES) if unit not in self._addressed]
        return free[0] if free else NODES[-1]

    def show_heartbeat(self, unit: int, seconds: float, entry: int) -> None:
        """Send the heartbeat for a node with a time-out, s, in an entry of object 1016h."""
        self._client = self.client
        self._watching[unit] = seconds, entry
        self._beat_due = 0.0

    def guard(self, unit: int, period: float) -> None:
        """Request the state of a node once in each period, s."""
        self._guarded[unit] = _Guarding(period, 0.0)

    def entry_of(self, unit: int) -> int:
        """Return the entry of object 1016h by which a node watches; 0: it does not."""
        return self._watching.get(unit, (0.0, 0))[1]

    def is_guarded(self, unit: int) -> bool:
        """Return whether the state of a node is requested."""
        return unit in self._guarded

    def end(self, unit: int) -> None:
        """End heartbeat and guarding for a node."""
        self._watching.pop(unit, None)
        self._guarded.pop(unit, None)


class _Request(NamedTuple):
    """A read, or a write if there are data."""

    address: Address
    data: bytes | None = None


#: Yields requests; receives what was read, empty for a write, or ``None`` if that is refused.
_Plan = Generator[_Request, bytes | None, None]


def _object(index: int, sub_index: int, size: int) -> Address:
    return Address('object', index, sub_index, size)


class CanopenWatch:
    """
    Has a node watch this client by the first means that reads back, or ends that.

    :ivar means: the means; ``''``: it does not watch.
    """

    def __init__(
        self,
        supervision: CanopenSupervision,
        unit: int,
        seconds: float,
        read: Callable[[int, Address], Reply],
        write: Callable[[int, Address, bytes], Reply],
    ) -> None:
        self._supervision = supervision
        self._unit = unit
        self._read = read
        self._write = write
        self.means = ''
        self._plan = self._begin(seconds) if seconds else self._end()
        self._request = next(self._plan, None)

    @property
    def done(self) -> bool:
        """There is nothing left to do."""
        return self._request is None

    def step(self) -> Reply:
        """
        Do the next step: one transaction, which is done again after an error.

        :raises LinkError: as its subclasses say; a refusal is none.
        """
        request = self._request
        assert request is not None
        value: bytes | None = None
        reply = Reply(b'', self._supervision.now())
        try:
            if request.data is None:
                reply = self._read(self._unit, request.address)
            else:
                reply = self._write(self._unit, request.address, request.data)
            value = reply.data
        except Refused as refusal:
            if refusal.code == Refused.BUSY:
                raise
        try:
            self._request = self._plan.send(value)
        except StopIteration:
            self._request = None
        return reply

    def _begin(self, seconds: float) -> _Plan:
        milliseconds = min(round(seconds * 1000), _LONGEST)
        yield from self._begin_heartbeat(milliseconds)
        if not self.means:
            yield from self._begin_guarding(milliseconds)

    def _begin_heartbeat(self, milliseconds: int) -> _Plan:
        supervision, unit = self._supervision, self._unit
        client = supervision.client
        wanted = (client << 16 | milliseconds).to_bytes(4, 'little')
        for entry in range(1, _ENTRIES + 1):
            place = _object(0x1016, entry, 4)
            value = yield _Request(place)
            if value is None or len(value) != len(wanted):
                return
            number = int.from_bytes(value, 'little')
            if number & _LONGEST and number >> 16 & 0x7F not in (0, client):
                # it watches another node by this one
                continue
            supervision.show_heartbeat(unit, milliseconds / 1000, entry)
            if (yield _Request(place, wanted)) is not None and (yield _Request(place)) == wanted:
                # it watches from the first heartbeat on: send one before any motor runs
                supervision.show_heartbeat(unit, milliseconds / 1000, entry)
                self.means = HEARTBEAT_MEANS
            else:
                supervision.end(unit)
            return

    def _begin_guarding(self, milliseconds: int) -> _Plan:
        supervision, unit = self._supervision, self._unit
        time_place, factor_place = _object(0x100C, 0, 2), _object(0x100D, 0, 1)
        period = milliseconds // _LIFE_FACTOR
        values = {
            time_place: period.to_bytes(2, 'little'), factor_place: bytes((_LIFE_FACTOR,)),
        }
        for place, value in values.items():
            if (yield _Request(place, value)) is None or (yield _Request(place)) != value:
                # one of both alone is of no use
                yield _Request(time_place, bytes(2))
                return
        # it watches from the first request on, which is now
        supervision.guard(unit, period / 1000)
        self.means = GUARDING_MEANS

    def _end(self) -> _Plan:
        supervision, unit = self._supervision, self._unit
        entry = supervision.entry_of(unit)
        if entry:
            yield _Request(_object(0x1016, entry, 4), bytes(4))
        if supervision.is_guarded(unit):
            yield _Request(_object(0x100C, 0, 2), bytes(2))
            yield _Request(_object(0x100D, 0, 1), bytes(1))
        supervision.end(unit)
