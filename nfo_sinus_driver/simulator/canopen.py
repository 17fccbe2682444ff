# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
A simulated drive as a node of CANopen (CiA 301): objects, network management, who watches whom.

What stands in the manufacturer's part of the object dictionary is the family's business, and what
a lost bus means to the drive.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Iterator, Mapping, Sequence
import contextlib
from dataclasses import dataclass
import enum
import functools

from nfo_sinus_driver.simulator import sdo
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.sdo import Abort, AbortCode

#: The node ids, and what is added to them for the identifiers of a node's frames.
NODES = range(1, 128)
EMERGENCIES, ANSWERS, REQUESTS, ERROR_CONTROL = 0x080, 0x580, 0x600, 0x700
_NETWORK_MANAGEMENT = 0x000

_EVERY_NODE = 0
_MILLISECOND = 0.001
_NEVER = float('inf')
#: The emergencies: the watched node is silent, and an end of it.
_WATCHED_IS_SILENT, _NO_ERROR = 0x8130, 0x0000
#: Bits of the error register (1001h).
_GENERIC, _COMMUNICATION = 0x01, 0x10


class State(enum.IntEnum):
    """The states of a node, as it reports them; the one after its boot-up it leaves by itself."""

    BOOTED = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


#: By what they permit, the least first.
_BY_POWER = (State.STOPPED, State.PRE_OPERATIONAL, State.OPERATIONAL)


class Command(enum.IntEnum):
    """What a node has to do."""

    START = 0x01
    STOP = 0x02
    ENTER_PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


_ENTERED = {
    Command.START: State.OPERATIONAL,
    Command.STOP: State.STOPPED,
    Command.ENTER_PRE_OPERATIONAL: State.PRE_OPERATIONAL,
}
_REASONS = {
    Reason.FUNCTION: AbortCode.NO_OBJECT,
    Reason.ADDRESS: AbortCode.NO_OBJECT,
    Reason.VALUE: AbortCode.VALUE,
    Reason.STATE: AbortCode.STATE,
}


@dataclass(frozen=True)
class Entry:
    """
    One value of the object dictionary.

    :ivar size: how many bytes it has, when it is written.
    :ivar read: gives it; ``None``: it can only be written.
    :ivar write: takes it; ``None``: it can only be read.
    """

    size: int = 0
    read: Callable[[], bytes] | None = None
    write: Callable[[bytes], None] | None = None


#: The entries of the object dictionary, by index and sub-index.
Entries = dict[tuple[int, int], Entry]


@dataclass(frozen=True)
class Identity:
    """
    Who a node says that it is (1000h, 1018h, 1008h to 100Ah).

    :ivar texts: by their indices.
    """

    device_type: int
    vendor: int
    product: int
    revision: int
    serial: int
    texts: Mapping[int, str]


@dataclass(frozen=True)
class Profile301:
    """
    What a node has of the communication profile.

    :ivar mandatory: device type, error register, vendor, and the heartbeat that it sends.
    :ivar optional: the rest of the identity, texts, SDO parameters, emergencies.
    :ivar consumes_heartbeats: it has 1016h.
    :ivar guards: it has 100Ch and 100Dh.
    """

    mandatory: bool = True
    optional: bool = True
    consumes_heartbeats: bool = True
    guards: bool = True


@dataclass
class _Settings:
    """
    What a node forgets when it restarts.

    :ivar beat: how often it sends its heartbeat, s; 0: never.
    :ivar beat_at: when the next one is due.
    :ivar watched: the node whose heartbeat it watches over.
    :ivar silence: how long that one may be silent, s; 0: for ever.
    :ivar guard_ms: how often it expects to be guarded, ms.
    :ivar life_factor: how many times that it may be left alone.
    :ivar toggle: the bit that changes with each answer to guarding.
    :ivar watch_until: when the silence of the watched node has lasted too long.
    :ivar is_lost: it has.
    """

    beat: float = 0.0
    beat_at: float = _NEVER
    watched: int = 0
    silence: float = 0.0
    guard_ms: int = 0
    life_factor: int = 0
    toggle: int = 0
    watch_until: float = _NEVER
    is_lost: bool = False


class Server(abc.ABC):
    """
    One node.

    :param drive: the drive that it is the node of; its address is the node id.
    :param profile: what it has of the communication profile.

    :ivar state: its state.
    """

    def __init__(self, drive: SimulatedDrive, profile: Profile301) -> None:
        self.drive = drive
        self.state = State.BOOTED
        self._profile = profile
        self._sdo = sdo.Server(self)
        self._set = _Settings()
        #: How often the drive had started when the node last did.
        self._boots = 0

    @functools.cached_property
    def _entries(self) -> Entries:
        # most drives are on another line, and asked for none
        return {**self._communication(), **self.entries()}

    # ---- what a family says ----

    @abc.abstractmethod
    def entries(self) -> Entries:
        """Return what it has beside the communication profile."""

    @abc.abstractmethod
    def identity(self) -> Identity:
        """Return who it is."""

    @abc.abstractmethod
    def established(self) -> None:
        """Record that a client talks to it."""

    @abc.abstractmethod
    def lost(self) -> None:
        """Record that the client it watched over is silent, or that it left the bus by itself."""

    # ---- the bus ----

    @property
    def node(self) -> int:
        """Its node id."""
        return self.drive.address

    def act(self, now: float) -> Iterator[Frame]:
        """Do what is due; give the frames that it sends."""
        if self.drive.boots != self._boots:
            self._boots = self.drive.boots
            yield self._boot_up(now)
        if not self.drive.listening:
            return
        if self._set.watch_until <= now:
            self._set.watch_until = _NEVER
            self._set.is_lost = True
            self.state = min(self.state, State.PRE_OPERATIONAL, key=_BY_POWER.index)
            self.lost()
            yield from self._emergency(_WATCHED_IS_SILENT)
        if self._set.beat_at <= now:
            # after a pause of the machine none is made up for
            self._set.beat_at = max(self._set.beat_at, now - self._set.beat) + self._set.beat
            yield self._tell(self.state)

    @property
    def due(self) -> float:
        """When :meth:`act` has something to do; infinity when nothing is to come."""
        return min(self._set.beat_at, self._set.watch_until) if self.drive.listening else _NEVER

    def receive(self, frame: Frame, now: float) -> Iterator[Frame]:
        """Take a frame from the bus; give the frames that it sends for it."""
        if frame.extended:
            return
        if frame.identifier == _NETWORK_MANAGEMENT and not frame.remote:
            yield from self._obey(frame.data, now)
        elif frame.identifier == ERROR_CONTROL + self.node and frame.remote:
            yield from self._guarded(now)
        elif frame.identifier - ERROR_CONTROL in NODES and not frame.remote:
            yield from self._heard(frame.identifier - ERROR_CONTROL, frame.data, now)
        elif frame.identifier == REQUESTS + self.node and not frame.remote:
            yield from self._asked(frame.data, now)

    def _asked(self, request: bytes, now: float) -> Iterator[Frame]:
        if self.state is State.STOPPED:
            return
        self.drive.note_frame()
        self.established()
        answer = self._sdo.answer(request)
        # a write may have begun the heartbeat, or ended it
        self._schedule(now)
        if answer:
            yield Frame(ANSWERS + self.node, answer)

    def _obey(self, data: bytes, now: float) -> Iterator[Frame]:
        if len(data) != 2 or data[1] not in (_EVERY_NODE, self.node):
            return
        if data[0] in (Command.RESET_NODE, Command.RESET_COMMUNICATION):
            self.lost()
            yield self._boot_up(now)
        elif data[0] in _ENTERED:
            self.drive.note_frame()
            self.state = _ENTERED[Command(data[0])]

    def _boot_up(self, now: float) -> Frame:
        self._set = _Settings()
        self._sdo.reset()
        self.state = State.PRE_OPERATIONAL
        return self._tell(State.BOOTED)

    def _tell(self, state: int) -> Frame:
        return Frame(ERROR_CONTROL + self.node, bytes((state,)))

    def _emergency(self, code: int) -> Iterator[Frame]:
        if self._profile.optional:
            data = code.to_bytes(2, 'little') + bytes((self._error_register(),)) + bytes(5)
            yield Frame(EMERGENCIES + self.node, data)

    # ---- watching ----

    def _schedule(self, now: float) -> None:
        """Begin or end the heartbeat, as it has just been set."""
        if not self._set.beat:
            self._set.beat_at = _NEVER
        elif self._set.beat_at == _NEVER:
            self._set.beat_at = now + self._set.beat

    def _heard(self, node: int, data: bytes, now: float) -> Iterator[Frame]:
        """Take the heartbeat of another node; the first one begins the watch."""
        boots = data == bytes((State.BOOTED,))
        if node != self._set.watched or not self._set.silence or len(data) != 1 or boots:
            return
        self._set.watch_until = now + self._set.silence
        yield from self._recovered()

    def _guarded(self, now: float) -> Iterator[Frame]:
        """Answer a guarding request; the first one begins the watch over the next ones."""
        life = self._set.guard_ms * self._set.life_factor * _MILLISECOND
        if life and not self._set.beat:
            self._set.watch_until = now + life
        self.drive.note_frame()
        if self._set.beat or not self._profile.guards:
            # heartbeat and guarding exclude each other
            return
        yield self._tell(self._set.toggle | self.state)
        self._set.toggle ^= 0x80
        yield from self._recovered()

    def _recovered(self) -> Iterator[Frame]:
        if self._set.is_lost:
            self._set.is_lost = False
            yield from self._emergency(_NO_ERROR)

    # ---- objects ----

    def read(self, index: int, sub_index: int) -> bytes:
        """Return the value of an object."""
        entry = self._find(index, sub_index)
        if entry.read is None:
            raise Abort(AbortCode.WRITE_ONLY)
        with _refusals():
            return entry.read()

    def validate(self, index: int, sub_index: int, size: int | None) -> int:
        """Look whether an object may be written with so many bytes; return how many it takes."""
        entry = self._find(index, sub_index)
        if entry.write is None:
            raise Abort(AbortCode.READ_ONLY)
        if size is not None and size != entry.size:
            raise Abort(AbortCode.TOO_LONG if size > entry.size else AbortCode.TOO_SHORT)
        return entry.size

    def write(self, index: int, sub_index: int, data: bytes) -> None:
        """Write an object."""
        write = self._find(index, sub_index).write
        assert write is not None
        with _refusals():
            write(data)

    def _find(self, index: int, sub_index: int) -> Entry:
        entry = self._entries.get((index, sub_index))
        if entry is None:
            known = any(index == other for other, _ in self._entries)
            raise Abort(AbortCode.NO_SUB_INDEX if known else AbortCode.NO_OBJECT)
        return entry

    def _error_register(self) -> int:
        lost = _COMMUNICATION | _GENERIC if self._set.is_lost else 0
        return lost | (_GENERIC if self.drive.faults else 0)

    def _communication(self) -> Entries:
        """Return the entries of the communication profile."""
        profile, who = self._profile, self.identity()
        found: Entries = {}
        if profile.mandatory:
            found[0x1000, 0] = constant(who.device_type, 4)
            found[0x1001, 0] = Entry(1, lambda: bytes((self._error_register(),)))
            numbers = (who.vendor, who.product, who.revision, who.serial)
            found |= array(0x1018, [constant(number, 4) for number in numbers])
            if not profile.optional:
                found[0x1018, 0] = constant(1, 1)
                for sub_index in (2, 3, 4):
                    del found[0x1018, sub_index]
            found[0x1017, 0] = Entry(
                2, lambda: number(round(self._set.beat / _MILLISECOND), 2), self._set_beat
            )
        if profile.optional:
            for index, text in who.texts.items():
                found[index, 0] = Entry(read=text.encode)
            found[0x1014, 0] = self._identifier(EMERGENCIES)
            found |= array(0x1200, [self._identifier(what) for what in (REQUESTS, ANSWERS)])
        if profile.consumes_heartbeats:
            found |= array(0x1016, [Entry(4, self._consumer, self._set_consumer)])
        if profile.guards:
            found[0x100C, 0] = Entry(2, lambda: number(self._set.guard_ms, 2), self._set_guard)
            found[0x100D, 0] = Entry(1, lambda: number(self._set.life_factor, 1), self._set_life)
        return found

    def _identifier(self, first: int) -> Entry:
        return Entry(4, lambda: number(first + self.node, 4))

    def _set_beat(self, data: bytes) -> None:
        self._set.beat = int.from_bytes(data, 'little') * _MILLISECOND
        self._set.beat_at = _NEVER

    def _consumer(self) -> bytes:
        return number(self._set.watched << 16 | round(self._set.silence / _MILLISECOND), 4)

    def _set_consumer(self, data: bytes) -> None:
        value = int.from_bytes(data, 'little')
        if value >> 24 or (value >> 16 and value >> 16 not in NODES):
            raise Abort(AbortCode.VALUE)
        self._set.watched, self._set.silence = value >> 16, (value & 0xFFFF) * _MILLISECOND
        self._set.watch_until = _NEVER
        self._set.is_lost = False

    def _set_guard(self, data: bytes) -> None:
        self._set.guard_ms = int.from_bytes(data, 'little')
        self._set.watch_until = _NEVER

    def _set_life(self, data: bytes) -> None:
        self._set.life_factor = data[0]
        self._set.watch_until = _NEVER


@contextlib.contextmanager
def _refusals() -> Iterator[None]:
    """Let what the drive refuses end the transfer."""
    try:
        yield
    except Refused as refused:
        raise Abort(_REASONS[refused.reason]) from refused


def number(value: int, size: int) -> bytes:
    """Return the bytes of an unsigned number."""
    return value.to_bytes(size, 'little')


def constant(value: int, size: int) -> Entry:
    """Return the entry of a number that never changes."""
    data = number(value, size)
    return Entry(size, lambda: data)


def array(index: int, entries: Sequence[Entry]) -> Entries:
    """Return entries that count from sub-index 1, and before them how many they are."""
    counted = {(index, 1 + place): entry for place, entry in enumerate(entries)}
    return {(index, 0): constant(len(entries), 1), **counted}
