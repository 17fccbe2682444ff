# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line in virtual time, and drives at its far end: nothing here ever waits."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from dataclasses import dataclass
import heapq
import itertools
from typing import NamedTuple

import pymodbus_opinion as opinion
from support import golden

from nfo_sinus_driver.link.interface import LineSettings

#: Functions of Modbus that write.
_WRITING = (6, 16, 23)
#: A line that has had no gap for so long keeps no write from being sent, s.
_TALKATIVE = 0.02
#: More looks at the clock than any honest transaction takes: the link hangs.
_PATIENCE = 100_000


class Wire:
    """
    The port of a link, and the clock that it sees.

    :ivar gap: the silence before a frame, s.
    :ivar sent: every frame sent, and when it began.
    :ivar seen: when bytes were read, and how many.
    :ivar far_end: called with each frame, as RTU has it, and the time at which its last byte is
        sent.
    """

    def __init__(self, settings: LineSettings) -> None:
        self.settings = settings
        self.gap = settings.frame_gap
        self.now = 1000.0
        self.sent: list[tuple[float, bytes]] = []
        golden.keep(self.sent)
        self.seen: list[tuple[float, int]] = []
        self.far_end: Callable[[bytes, float], None] = lambda frame, end: None
        self.is_open = False
        self._arrivals: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()
        self._looks = 0

    def monotonic(self) -> float:
        self._looks += 1
        assert self._looks < _PATIENCE, 'the link hangs'
        return self.now

    def pack(self, frame: bytes) -> bytes:
        """What goes over this line for an RTU frame."""
        return frame

    def unpack(self, data: bytes) -> bytes:
        """The RTU frame for what went over this line."""
        return data

    def arrive(self, at: float, data: bytes, *, lump: bool = False) -> float:
        """Let bytes come, the first one's end a character after ``at``; return the last's."""
        char_time = self.settings.char_time
        end = at + len(data) * char_time
        if lump:
            self._put(end, data)
        else:
            for number, byte in enumerate(data, start=1):
                self._put(at + number * char_time, bytes((byte,)))
        return end

    def _put(self, at: float, data: bytes) -> None:
        heapq.heappush(self._arrivals, (at, next(self._order), data))

    def open(self) -> None:
        self.is_open = True

    def close(self) -> None:
        self.is_open = False

    def write(self, data: bytes) -> None:
        self.sent.append((self.now, data))
        self._looks = 0
        self.far_end(self.unpack(data), self.now + len(data) * self.settings.char_time)

    def read(self, until: float) -> bytes:
        if not self._arrivals or self._arrivals[0][0] > max(until, self.now):
            self.now = max(until, self.now)
            return b''
        self.now = max(self.now, self._arrivals[0][0])
        data = b''
        while self._arrivals and self._arrivals[0][0] <= self.now:
            data += heapq.heappop(self._arrivals)[2]
        self.seen.append((self.now, len(data)))
        return data

    def check_gaps(self) -> None:
        """
        Every frame must begin a gap after whatever was on the line before, as far as seen.

        But a write into a line that has had none for a while, for it may be a stop.
        """
        ends = [(at + len(frame) * self.settings.char_time, at) for at, frame in self.sent]
        ends += [(at, at) for at, _ in self.seen]
        for start, frame in self.sent:
            before = [end for end, began in ends if began < start]
            if self.unpack(frame)[1] in _WRITING and self._without_gap(start) >= _TALKATIVE:
                continue
            if before:
                assert start - max(before) >= self.gap - 1e-9

    def _without_gap(self, until: float) -> float:
        """Return for how long bytes had come without a gap between them, s."""
        began = until
        for at in sorted((at for at, _ in self.seen if at <= until), reverse=True):
            if began - at >= self.gap:
                break
            began = at
        return until - began


def run_late(wire: Wire) -> None:
    """Have the process that reads not run for a moment whenever it has read something."""
    read = wire.read

    def late(until: float) -> bytes:
        data = read(until)
        wire.now += 0.1 if data else 0.0
        return data

    wire.read = late  # type: ignore[method-assign]


class AsciiWire(Wire):
    """The same for Modbus ASCII; whatever is at the far end speaks RTU."""

    def __init__(self, settings: LineSettings) -> None:
        super().__init__(settings)
        self.gap = 2 * settings.char_time

    def pack(self, frame: bytes) -> bytes:
        return opinion.ascii_frame(frame[:-2])

    def unpack(self, data: bytes) -> bytes:
        assert data[:1] == b':' and data[-2:] == b'\r\n' and data == data.upper()
        message = bytes.fromhex(data[1:-4].decode())
        return message + opinion.crc(message)


@dataclass(frozen=True)
class Fate:
    """
    What becomes of one request.

    :ivar delay: how long the drive takes, in time-outs.
    :ivar what: ``answer``, ``refuse``, ``drop`` (carried out, not answered), ``damage``,
        ``double``, ``refuse twice``.
    :ivar again: how much later the second of two answers comes, in time-outs.
    """

    delay: float = 0.0
    what: str = 'answer'
    lump: bool = False
    again: float = 0.0


GOOD = Fate()
DROP = Fate(what='drop')
REFUSE = Fate(what='refuse')


class Asked(NamedTuple):
    """
    A request that arrived.

    :ivar place: the number of the parameter.
    :ivar written: what is written; ``None``: it is read.
    :ivar fate: what became of it.
    """

    unit: int
    place: int
    size: int
    written: bytes | None = None
    fate: str = ''


class FarEnd(ABC):
    """
    Drives that answer in order, as each request's fate says; a value tells which it answers.

    :ivar requests: every request that arrived.
    :ivar response_time: how long every drive takes besides, s.
    :ivar pace: how long a request takes on the line, in the time that its characters need.
    :ivar echo: what comes back of a request.
    :ivar before: what comes before each answer; ``after``: and after it.
    """

    def __init__(self, wire: Wire) -> None:
        self._wire = wire
        self._fates: Iterable[Fate] = iter(())
        self._free: dict[int, float] = {}
        self.requests: list[Asked] = []
        self.response_time = 0.0
        self.pace = 1.0
        self.echo: Callable[[bytes], bytes] = lambda frame: b''
        self.before = self.after = b''
        wire.far_end = self.take

    def heal(self, *fates: Fate) -> None:
        """Answer from now on, but for the next requests' fates."""
        self.meet(fates)

    def meet(self, fates: Iterable[Fate]) -> None:
        """Meet the next requests with some fates, each decided when its request comes."""
        self._fates = iter(fates)

    def value(self, place: int, size: int, number: int) -> bytes:
        """What a parameter holds when the request with this number is carried out."""
        return (place * 7 + number * 131 & 0xFFFF).to_bytes(size, 'big')

    @abstractmethod
    def parsed(self, frame: bytes) -> Asked:
        """What a request asks for."""

    @abstractmethod
    def answer(self, asked: Asked, frame: bytes, number: int) -> bytes:
        """The frame that carries a value, or confirms; nothing if empty."""

    @abstractmethod
    def refusal(self, asked: Asked, frame: bytes, number: int) -> bytes:
        """The frame that refuses."""

    def take(self, frame: bytes, end: float) -> None:
        fate = next(iter(self._fates), GOOD)
        number = len(self.requests)
        asked = self.parsed(frame)._replace(fate=fate.what)
        self.requests.append(asked)
        wire, length = self._wire, len(self._wire.pack(frame)) * self._wire.settings.char_time
        wire.arrive(end - length, self.echo(wire.pack(frame)))
        if fate.what == 'drop':
            return
        refused = fate.what.startswith('refuse')
        answer = (self.refusal if refused else self.answer)(asked, frame, number)
        if not answer:
            return
        answer = wire.pack(answer)
        if fate.what == 'damage':
            answer = answer[:-1] + bytes((answer[-1] ^ 1,))
        twice = fate.what in ('double', 'refuse twice')
        if twice and not fate.again:
            answer += answer
        timeout = wire.settings.response_timeout
        start = end - (1 - self.pace) * length + self.response_time + fate.delay * timeout
        start = max(self._free.get(asked.unit, 0.0), start)
        stream = self.before + answer + self.after
        free = wire.arrive(start, stream, lump=fate.lump)
        if twice and fate.again:
            free = wire.arrive(free + fate.again * timeout, stream, lump=fate.lump)
        self._free[asked.unit] = free
