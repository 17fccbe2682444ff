# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How nodes of CANopen notice that this client is gone, and this client that one has started anew.

Three things live on the line beside questions and answers (CiA 301 §7.2.8). The client's heartbeat,
over which a node watches by its object 1016h; the client's asking for the state of a node that is
guarded (100Ch, 100Dh); and the message with which a node says that it has started. The thread that
asks serves all of them, so they end with it.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence, Set as AbstractSet
import math
from typing import NamedTuple

from nfo_sinus_driver.link.can import CanPort, Frame
from nfo_sinus_driver.link.interface import Address, Clock, Refused, Reply

#: Added to the address of a node, the identifier of its boot-up and of its heartbeat.
HEARTBEATS = 0x700
#: The node ids that there are.
NODES = range(1, 128)

_COMMANDS = 0x000
_START = 0x01
_BOOTED, _OPERATIONAL = b'\x00', b'\x05'

#: How often nodes hear the heartbeat, s, and how often at least in the time that one watches for.
_HEARTBEAT = 0.1
_BEATS = 4
#: How often it is listened to a line without requests, s.
_LISTENING = 0.1
#: How long frames are taken that came unasked, s: on a full bus more come all the while.
LONGEST_DRAIN = 0.1
#: How many times in a row a guarded node may miss that it is asked: its life time factor.
_LIFE_FACTOR = 4
#: Of how many clients a node may watch over the heartbeats, as far as it is looked.
_ENTRIES = 8
#: The longest time that there is for it, ms.
_LONGEST = 0xFFFF

HEARTBEAT_MEANS = 'consumer heartbeat, object 1016h'
GUARDING_MEANS = 'node guarding, objects 100Ch and 100Dh'


def heartbeat(client: int) -> Frame:
    """Return what a client sends for as long as it is there; it is this node to those who watch."""
    return Frame(HEARTBEATS + client, _OPERATIONAL)


def guarding_request(unit: int) -> Frame:
    """Return what asks a node for its state; one that is asked no more notices."""
    return Frame(HEARTBEATS + unit, bytes(1), remote=True)


def start(unit: int) -> Frame:
    """Return what makes a node operational; there is no answer to it."""
    return Frame(_COMMANDS, bytes((_START, unit)))


def booted(frame: Frame) -> int | None:
    """Return which node has started anew; ``None``: the frame says nothing of the kind."""
    unit = frame.identifier - HEARTBEATS
    return unit if unit in NODES and frame.data == _BOOTED else None


class _Guarding(NamedTuple):
    """How often a node is asked for its state, s, and when next."""

    period: float
    due: float


class CanopenSupervision:
    """
    What this client shows on one line, and what it hears there unasked.

    :param take: takes what has come until a moment, and hands it to :meth:`heard`.
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
        #: The nodes that were asked anything.
        self._asked: set[int] = set()
        self._restarted: set[int] = set()
        #: The nodes that watch over the heartbeat: for how long, s, and in which entry.
        self._watching: dict[int, tuple[float, int]] = {}
        self._guarded: dict[int, _Guarding] = {}
        #: Which node this client is to those that watch over it; 0: it is not settled.
        self._client = 0
        #: It has written something, so that its presence may be of interest.
        self._commands = False
        self._beat_due = self._listen_due = 0.0

    # --- for the link -----------------------------------------------------------------------------

    def asks(self, unit: int, *, writes: bool) -> None:
        """Take note that a node is asked something."""
        self._asked.add(unit)
        self._commands |= writes

    def closed(self) -> None:
        """Take note that the port is closed: what a node watches over is shown when it is open."""
        self._asked.clear()
        self._restarted.clear()
        self._commands = False
        self._beat_due = self._listen_due = 0.0

    def heard(self, frames: Sequence[Frame]) -> AbstractSet[int]:
        """Take what has come; return which nodes have started anew."""
        started = {unit for unit in map(booted, frames) if unit is not None}
        self._restarted |= started
        return started

    @property
    def sign_due(self) -> float:
        """When the next sign of life has to be sent, s of ``time.monotonic``; or infinity."""
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
        return min(self.sign_due, self._listen_due if self._asked else math.inf)

    def serve(self) -> None:
        """Send what is due, and take what came unasked (PortError: the port is lost)."""
        now = self.now()
        self.send_due(now)
        while self._take(0.0) and self.now() < now + LONGEST_DRAIN:
            continue
        self._listen_due = now + _LISTENING

    def take_restarted(self) -> AbstractSet[int]:
        """Return the nodes that have started anew since this was asked last."""
        if not self._restarted:
            return frozenset()
        restarted, self._restarted = self._restarted, set()
        return restarted

    def watch(self, unit: int, seconds: float) -> CanopenWatch:
        """Return how a node is made to notice a silence of so long, s; 0: nothing any more."""
        return CanopenWatch(self, unit, seconds, self._read, self._write)

    # --- for what sets it up ----------------------------------------------------------------------

    @property
    def client(self) -> int:
        """The node that this client is to those that watch over it; none that is asked."""
        if self._client:
            return self._client
        free = [unit for unit in reversed(NODES) if unit not in self._asked]
        return free[0] if free else NODES[-1]

    def show_heartbeat(self, unit: int, seconds: float, entry: int) -> None:
        """Show a heartbeat to a node that watches for so long, s, by an entry of object 1016h."""
        self._client = self.client
        self._watching[unit] = seconds, entry
        self._beat_due = 0.0

    def guard(self, unit: int, period: float) -> None:
        """Ask a node for its state so often, s."""
        self._guarded[unit] = _Guarding(period, 0.0)

    def entry_of(self, unit: int) -> int:
        """Return the entry of object 1016h by which a node watches; 0: it does not."""
        return self._watching.get(unit, (0.0, 0))[1]

    def is_guarded(self, unit: int) -> bool:
        """Tell whether a node is asked for its state."""
        return unit in self._guarded

    def end(self, unit: int) -> None:
        """Show nothing more to a node."""
        self._watching.pop(unit, None)
        self._guarded.pop(unit, None)


class _Request(NamedTuple):
    """What is read, or written if there are data."""

    address: Address
    data: bytes | None = None


#: Yields requests; is given what was read, empty for a write, or ``None`` if that is refused.
_Plan = Generator[_Request, bytes | None, None]


def _object(index: int, sub_index: int, size: int) -> Address:
    return Address('object', index, sub_index, size)


class CanopenWatch:
    """
    Has a node watch over this client by the first means that reads back, or ends that.

    :ivar means: by what it watches; ``''``: it does not.
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
                # it watches from the first heartbeat on that it hears: none may run before that
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
                # half of it is nothing
                yield _Request(time_place, bytes(2))
                return
        # it watches from the first time on that it is asked, which is now
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
