# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A line and a slave in virtual time: nothing here ever waits."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
import heapq
import itertools

import pymodbus_opinion as opinion

from nfo_sinus_driver.link.interface import LineSettings

#: Functions of Modbus that write.
_WRITING = (6, 16, 23)
#: A line that has had no gap for so long keeps no write from being sent, s.
_TALKATIVE = 0.02
#: More looks at the clock than any honest transaction takes: the link hangs.
_PATIENCE = 100_000


class Wire:
    """
    The port of a :class:`SerialLink`, and the clock that it sees.

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

    :ivar delay: how long the slave takes, in time-outs.
    :ivar what: ``answer``, ``refuse``, ``drop`` (carried out, not answered), ``damage``,
        ``double``, ``refuse twice``.
    :ivar again: how much later the second of two answers comes, in time-outs.
    """

    delay: float = 0.0
    what: str = 'answer'
    lump: bool = False
    again: float = 0.0


GOOD = Fate()


class Slave:
    """
    Answers in order, each request as its fate says; a value tells which request it answers.

    :ivar requests: every request that arrived: unit, function, register, count.
    """

    def __init__(self, wire: Wire, fates: Iterator[Fate] | None = None) -> None:
        self._wire = wire
        self._fates = fates or itertools.repeat(GOOD)
        self._free = 0.0
        self.requests: list[tuple[int, int, int, int]] = []
        wire.far_end = self._take

    def heal(self, *fates: Fate) -> None:
        """Answer from now on, but for the next requests' fates."""
        self._fates = iter(fates)

    def identified(self, frame: bytes) -> bytes:
        """What it says to functions 17 and 43/14: it does not have them; nothing if empty."""
        return opinion.exception(frame[0], frame[1], 1)

    @staticmethod
    def words(register: int, count: int, number: int) -> tuple[int, ...]:
        """What a register holds when the request with this number is carried out."""
        return tuple((register * 7 + number * 131 + word * 57) & 0xFFFF for word in range(count))

    @staticmethod
    def code(number: int) -> int:
        """With which code the request with this number is refused."""
        return number % 200 + 20

    def _take(self, frame: bytes, end: float) -> None:
        number = len(self.requests)
        if frame[1] in (17, 43):
            unit, function, register, count, words = frame[0], frame[1], 0, 0, ()
        else:
            unit, function, register, count, words = opinion.decoded(frame)
        self.requests.append((unit, function, register, count))
        fate = next(self._fates, GOOD)
        if fate.what == 'drop':
            return
        if fate.what.startswith('refuse'):
            answer = opinion.exception(unit, function, self.code(number))
        elif function in (17, 43):
            answer = self.identified(frame)
        elif function == 3:
            answer = opinion.read_answer(unit, self.words(register, count, number))
        else:
            answer = opinion.write_answer(unit, register, words)
        if not answer:
            return
        answer = self._wire.pack(answer)
        if fate.what == 'damage':
            answer = answer[:-1] + bytes((answer[-1] ^ 1,))
        timeout = self._wire.settings.response_timeout
        start = max(self._free, end + fate.delay * timeout)
        twice = fate.what in ('double', 'refuse twice')
        if twice and not fate.again:
            answer += answer
        self._free = self._wire.arrive(start, answer, lump=fate.lump)
        if twice and fate.again:
            again = self._free + fate.again * timeout
            self._free = self._wire.arrive(again, answer, lump=fate.lump)
