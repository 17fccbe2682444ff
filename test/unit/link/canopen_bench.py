# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A CANopen link on a bus in virtual time: nothing here ever waits."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
import heapq
import itertools
from typing import Any

from canopen_far_end import Server
import line_bench
from support import golden
from virtual_wire import DROP, GOOD, Asked, Fate

from nfo_sinus_driver.link.canopen.can import Frame
from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.interface import Address, LineSettings, Reply

TIMEOUT = 0.2
SETTINGS = LineSettings(baud_rate=125_000, char_format='8N1', response_timeout=TIMEOUT)
UNIT = 5
_PATIENCE = 100_000
#: How long a frame takes on the bus, s.
FRAME_TIME = 0.001


def at(index: int, sub_index: int = 0, size: int = 2) -> Address:
    """Return the address of an object."""
    return Address('object', index, sub_index, size)


A = at(0x2013)
B = at(0x2022)
TEXT = at(0x1008, size=64)
#: What every node has.
MANDATORY = {(0x1000, 0): bytes(4), (0x1001, 0): b'\0', (0x1018, 0): b'\4', (0x1018, 1): bytes(4)}


class Bus:
    """
    The port of a link, the clock that it sees, and the nodes; of a fate no ``damage``, no lump.

    :ivar sent: every message, and to which node.
    :ivar other: whatever else was sent, and when.
    :ivar begun: of the messages with which a transfer begins: node, index, sub-index, whether it
        writes, and its fate; ``begun_at``: and when.
    :ivar kept: the objects that hold what was written, and not what the test makes up.
    """

    def __init__(self, fates: Sequence[Fate]) -> None:
        self._fates = iter(fates)
        self.now = 1000.0
        self.trouble = ''
        self.remark = ''
        self.is_open = False
        self.servers = {
            unit: Server({**MANDATORY, (0x2013, 0): b'', (0x2022, 0): b'', (0x1008, 0): b''})
            for unit in (UNIT, 6)
        }
        self.sent: list[tuple[int, bytes]] = []
        golden.keep(self.sent)
        self.other: list[tuple[float, Frame]] = []
        self.begun: list[tuple[int, int, int, bool, str]] = []
        self.begun_at: list[float] = []
        self.gap = 0.0
        self.seen: list[tuple[float, int]] = []
        self.kept: set[tuple[int, int]] = set()
        self._free: dict[int, float] = {}
        self._arrivals: list[tuple[float, int, Frame]] = []
        self._order = itertools.count()
        self._looks = 0

    def heal(self, *fates: Fate) -> None:
        """Answer from now on, but for the next messages' fates."""
        self._fates = iter(fates)

    def monotonic(self) -> float:
        self._looks += 1
        assert self._looks < _PATIENCE, 'the link hangs'
        return self.now

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    @staticmethod
    def value(index: int, number: int) -> bytes:
        """What an object holds when the transfer with this number is begun."""
        if index == TEXT.index:
            return f'the text of transfer {number}'.encode()
        return (index * 7 + number * 131 & 0xFFFF).to_bytes(2, 'little')

    def arrive(self, at_time: float, frame: Frame) -> None:
        """Let a frame come."""
        heapq.heappush(self._arrivals, (at_time, next(self._order), frame))

    def send(self, frame: Frame) -> None:
        unit = frame.identifier - 0x600
        if not 0 < unit < 128:
            self.other.append((self.now, frame))
            return
        self.sent.append((unit, frame.data))
        self._looks = 0
        fate = next(self._fates, GOOD)
        server = self.servers.get(unit)
        if server is None:
            return
        command = frame.data[0] >> 5
        if command in (1, 2):
            index, sub_index = int.from_bytes(frame.data[1:3], 'little'), frame.data[3]
            known = (index, sub_index) in server.objects
            if command == 2 and known and (index, sub_index) not in self.kept:
                server.objects[index, sub_index] = self.value(index, len(self.begun))
            self.begun.append((unit, index, sub_index, command == 1, fate.what))
            self.begun_at.append(self.now)
        answer = server.answer(frame.data)
        if answer is None or fate.what == 'drop':
            return
        if fate.what == 'refuse' and command in (1, 2):
            answer = b'\x80' + frame.data[1:4] + (0x08000022).to_bytes(4, 'little')
        for _ in range(2 if fate.what == 'double' else 1):
            self.answer(unit, answer, fate.delay * TIMEOUT)

    def answer(self, unit: int, answer: bytes, delay: float = 0.0) -> None:
        """Let a node answer, behind what it answers already."""
        start = max(self._free.get(unit, 0.0), self.now + FRAME_TIME + delay) + FRAME_TIME
        self.arrive(start, Frame(0x580 + unit, answer))
        self._free[unit] = start

    def receive(self, until: float) -> Sequence[Frame]:
        if not self._arrivals or self._arrivals[0][0] > max(until, self.now):
            self.now = max(until, self.now)
            return []
        self.now = max(self.now, self._arrivals[0][0])
        found = []
        while self._arrivals and self._arrivals[0][0] <= self.now:
            found.append(heapq.heappop(self._arrivals)[2])
        self.seen.append((self.now, len(found)))
        return found


class Bench(line_bench.Bench):
    """A link on a virtual bus; everything done with it happens in virtual time."""

    line = SETTINGS
    A, B = A, B
    VALUE = b'\1\2'
    lost = (A.index, 0x1000, 0x1001, 0x1018, A.index)
    units = (UNIT, 6)

    def __init__(self, *fates: Fate) -> None:
        self.bus: Any = Bus(fates)
        self.wire = self.drive = self.bus
        self.link = CanopenLink(self.bus, SETTINGS, self.bus.monotonic)
        self.link.open()

    def read(self, address: Address, unit: int = UNIT) -> Reply:
        return super().read(address, unit)

    def write(self, address: Address, data: bytes = b'', unit: int = UNIT) -> Reply:
        return super().write(address, data, unit)

    @property
    def requests(self) -> list[Asked]:
        """All transfers; of what was written that it was."""
        return [
            Asked(unit, index, 2, b'' if writes else None, fate)
            for unit, index, _, writes, fate in self.bus.begun
        ]

    @property
    def sent_at(self) -> list[float]:
        at_times: list[float] = self.bus.begun_at
        return at_times

    def answer_of(self, number: int = -1) -> bytes:
        """What the node says to the transfer with this number."""
        number %= len(self.asked)
        value: bytes = self.bus.value(self.asked[number], number)
        return value

    @staticmethod
    def distinct(fates: Iterable[Fate]) -> Iterator[Fate]:
        """Let what was sent twice be followed by an answer at once; what is damaged is lost."""
        twice = False
        for fate in fates:
            if fate.what in ('damage', 'refuse twice'):
                fate = DROP
            yield GOOD if twice else fate
            twice = fate.what == 'double'
