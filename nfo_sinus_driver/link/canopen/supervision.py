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

from collections.abc import Callable, Sequence, Set as AbstractSet
import math
from typing import NamedTuple

from nfo_sinus_driver.link.canopen.can import CanPort, Frame
from nfo_sinus_driver.link.interface import Address, Clock, Plan, Read, Write

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
    """

    def __init__(
        self,
        port: CanPort,
        now: Clock,
        take: Callable[[float], Sequence[Frame]],
    ) -> None:
        self._port = port
        self.now = now
        self._take = take
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

    def watch(self, unit: int, seconds: float) -> Plan[str]:
        """
        Have a node watch this client, with a time-out, s; 0: no longer.

        :returns: the first means that reads back; ``''``: it does not watch.
        """
        if not seconds:
            return self._end(unit)
        return self._begin(unit, min(round(seconds * 1000), _LONGEST))

    @property
    def client(self) -> int:
        """The node id of this client for those that watch it; one that no node has."""
        if self._client:
            return self._client
        free = [unit for unit in reversed(NODES) if unit not in self._addressed]
        return free[0] if free else NODES[-1]

    def _show_heartbeat(self, unit: int, seconds: float, entry: int) -> None:
        """Send the heartbeat for a node with a time-out, s, in an entry of object 1016h."""
        self._client = self.client
        self._watching[unit] = seconds, entry
        self._beat_due = 0.0

    def _begin(self, unit: int, milliseconds: int) -> Plan[str]:
        if (yield from self._begin_heartbeat(unit, milliseconds)):
            return HEARTBEAT_MEANS
        return GUARDING_MEANS if (yield from self._begin_guarding(unit, milliseconds)) else ''

    def _begin_heartbeat(self, unit: int, milliseconds: int) -> Plan[bool]:
        client = self.client
        wanted = (client << 16 | milliseconds).to_bytes(4, 'little')
        for entry in range(1, _ENTRIES + 1):
            place = _object(0x1016, entry, 4)
            reply = yield Read(place)
            if reply is None or len(reply.data) != len(wanted):
                return False
            number = int.from_bytes(reply.data, 'little')
            if number & _LONGEST and number >> 16 & 0x7F not in (0, client):
                # it watches another node by this one
                continue
            self._show_heartbeat(unit, milliseconds / 1000, entry)
            if (yield from _write_and_check(place, wanted)):
                # it watches from the first heartbeat on: send one before any motor runs
                self._show_heartbeat(unit, milliseconds / 1000, entry)
                return True
            # another time than this is of no use
            yield Write(place, bytes(4))
            self._forget(unit)
            return False
        return False

    def _begin_guarding(self, unit: int, milliseconds: int) -> Plan[bool]:
        time_place, factor_place = _object(0x100C, 0, 2), _object(0x100D, 0, 1)
        period = milliseconds // _LIFE_FACTOR
        values = {
            time_place: period.to_bytes(2, 'little'), factor_place: bytes((_LIFE_FACTOR,)),
        }
        # to be ended from now on, and requested only when it is set up
        self._guarded.setdefault(unit, _Guarding(period / 1000, math.inf))
        for place, value in values.items():
            if not (yield from _write_and_check(place, value)):
                # one of both alone is of no use
                yield Write(time_place, bytes(2))
                self._guarded.pop(unit, None)
                return False
        # it watches from the first request on, which is now
        self._guarded[unit] = _Guarding(period / 1000, 0.0)
        return True

    def _end(self, unit: int) -> Plan[str]:
        _, entry = self._watching.get(unit, (0.0, 0))
        if entry:
            yield Write(_object(0x1016, entry, 4), bytes(4))
        if unit in self._guarded:
            yield Write(_object(0x100C, 0, 2), bytes(2))
            yield Write(_object(0x100D, 0, 1), bytes(1))
        self._forget(unit)
        return ''

    def _forget(self, unit: int) -> None:
        """End heartbeat and guarding for a node."""
        self._watching.pop(unit, None)
        self._guarded.pop(unit, None)


def _write_and_check(place: Address, data: bytes) -> Plan[bool]:
    """Write an object and read it back; return whether it was taken."""
    if (yield Write(place, data)) is None:
        return False
    reply = yield Read(place)
    return reply is not None and reply.data == data


def _object(index: int, sub_index: int, size: int) -> Address:
    return Address('object', index, sub_index, size)
