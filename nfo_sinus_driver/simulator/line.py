# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The far end of a line: requests come in, drives carry them out, answers go back, in their time.

Knows no clock of its own: it is given the time, so that tests can make it up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
import heapq
import itertools
import json
from typing import TextIO

from nfo_sinus_driver.simulator.line_faults import LineFaults, Reply
from nfo_sinus_driver.simulator.ports import Port
from nfo_sinus_driver.simulator.protocol import Protocol, Station
from nfo_sinus_driver.simulator.timing import Timing
from nfo_sinus_driver.simulator.wire import Wire

#: By how much an RTU frame is shorter than the same one of Modbus TCP.
_SHORTER = 4
#: Whose echo is.
_NO_UNIT = -1


@dataclass
class _Answer:
    """An answer on its way: whose, what is left of it, and when it began."""

    address: int
    reply: Reply
    sent: int = 0
    began: float = 0.0
    is_echo: bool = False


@dataclass(order=True)
class _Delivery:
    """The moment at which an answer's bytes up to ``until`` have arrived at the master."""

    at: float
    order: int
    answer: _Answer = field(compare=False)
    until: int = field(compare=False)


class Line(Wire):
    """
    One line with several stations on it: drives, or what stands before them.

    :param paced: bytes take the time that they take on a real line, never less.
    :param turnaround: time a drive takes before it answers (s).
    :param echo: whatever comes in goes out again, as from a half-duplex adapter.
    :param always_heard: the drives hear it whatever protocol, speed and format they are set to.
    :param clock: for the stamps of bytes that go out (s); everything else is given the time.

    :ivar any_counts: any whole message on the line counts for the own time-out of each drive, and
        not only one to it; no manual says [C127].
    """

    def __init__(
        self,
        port: Port,
        protocol: Protocol,
        stations: Sequence[Station],
        timing: Timing,
        clock: Callable[[], float],
        *,
        paced: bool = False,
        turnaround: float = 0.0,
        echo: bool = False,
        always_heard: bool = False,
        trace: Trace | None = None,
    ) -> None:
        super().__init__(port, timing, LineFaults(int(timing.char_format[0])))
        self.protocol = protocol
        self.stations = stations
        self.name = protocol.name
        self.speed = f'{timing.baud} {timing.char_format}'
        self._clock = clock
        self._trace = trace
        self.any_counts = False
        self._echo = echo
        self._always_heard = always_heard
        character = timing.character if paced else 0.0
        self._character = character if protocol.serial else 0.0
        #: Of the line behind a gateway.
        self._character_behind = 0.0 if protocol.serial else character
        self._pause = max(turnaround, protocol.gap(timing) if paced else 0.0)
        self._receiver = Receiver(protocol, self._character, protocol.patience(timing))
        self._echo_end = float('-inf')
        self._deliveries: list[_Delivery] = []
        self._order = itertools.count()

    def receive(self, data: bytes, now: float) -> None:
        """Take bytes that were read at ``now``."""
        if self._echo:
            self._send_back(data, now)
        for arrived in self._receiver.feed(data, now):
            self._handle(arrived)

    def _act(self, now: float) -> None:
        for arrived in self._receiver.take_frames(now):
            self._handle(arrived)
        while self._deliveries and self._deliveries[0].at <= now:
            self._deliver(heapq.heappop(self._deliveries), now)

    @property
    def _due(self) -> float:
        arrives = self._receiver.due
        delivers = self._deliveries[0].at if self._deliveries else float('inf')
        return delivers if arrives is None else min(arrives, delivers)

    def _unplugged(self) -> None:
        self._receiver.clear()
        self._deliveries.clear()

    def _handle(self, arrived: Arrived) -> None:
        request = self.protocol.unwrap(arrived.data)
        dead = self.faults.dead(arrived.last)
        if self._trace is not None:
            rubbish = request is None or not request.whole
            note = 'lost' if dead else 'rubbish' if rubbish else ''
            self._trace.record('request', arrived.data, arrived.first, arrived.last, note)
        if dead or request is None:
            return
        there = answered = False
        for station in self.stations:
            if not self.protocol.concerns(station, request):
                if self.any_counts and request.whole:
                    station.advance_to(arrived.last)
                    if self._hears(station):
                        station.note_frame()
                continue
            there = True
            station.advance_to(arrived.last)
            if not self._hears(station):
                continue
            # carrying it out may change them
            address, wait = station.address, station.response_time
            if request.whole:
                station.note_frame()
            frame = self.protocol.answer(station, request)
            if frame:
                answered = True
                instead = self.protocol.instead(request, there)
                replies = self.faults.alter(address, frame, instead)
                self._send(address, replies, arrived, wait)
        if not answered:
            refusal = self.protocol.instead(request, there)
            self._send(request.address, [refusal] if refusal else [], arrived)

    def _hears(self, station: Station) -> bool:
        if not station.listening:
            return False
        return self._always_heard or station.hears(self.protocol.spoken, self.timing)

    def _send(
        self, address: int, replies: Sequence[Reply], asked: Arrived, wait: float = 0.0
    ) -> None:
        for reply in replies:
            length = len(reply.data)
            start = asked.last + max(self._pause, wait) + reply.delay
            if self._character_behind:
                # both ways in RTU frames, which are shorter than those of TCP
                both = len(asked.data) + length - 2 * _SHORTER
                start += both * self._character_behind
            self._on_its_way(_Answer(address, reply), max(start, self._free(address)))

    def _on_its_way(self, answer: _Answer, begin: float) -> None:
        length = len(answer.reply.data)
        if self._character:
            self._schedule(begin + self._character, answer, 1)
        self._schedule(begin + length * self._character, answer, length)

    def _send_back(self, data: bytes, now: float) -> None:
        begin = max(now, self._echo_end)
        self._echo_end = begin + len(data) * self._character
        self._on_its_way(_Answer(_NO_UNIT, Reply(data), is_echo=True), begin)

    def _free(self, address: int) -> float:
        """Return when a drive that has answers on their way may begin the next, a new frame."""
        ends = (delivery.at for delivery in self._deliveries if delivery.answer.address == address)
        return max(ends, default=float('-inf')) + self.timing.t35

    def _schedule(self, at: float, answer: _Answer, until: int) -> None:
        heapq.heappush(self._deliveries, _Delivery(at, next(self._order), answer, until))

    def _deliver(self, delivery: _Delivery, now: float) -> None:
        answer = delivery.answer
        data = answer.reply.data
        stamp = self._clock()
        if not answer.sent:
            answer.began = stamp
        # the adapter hears itself on a dead line, too
        dead = self.faults.dead(now) and not answer.is_echo
        if not dead:
            self.port.send(data[answer.sent : delivery.until])
        answer.sent = delivery.until
        if delivery.until == len(data) and self._trace is not None and not answer.is_echo:
            note = 'lost' if dead else answer.reply.note
            self._trace.record('answer', data, answer.began, stamp, note)


class Trace:
    """
    Writes one JSON object a line and flushes it, so that it can be read while it grows.

    ``first`` and ``last`` are the times of the frame's first and last byte at the simulator (s,
    steady clock, the same in every process), ``direction`` is ``request`` or ``answer``, ``hex``
    the bytes, ``gap`` the silence since the last byte before it (s, ``null`` for the first), and
    ``note`` says what was wrong with it, if anything: ``rubbish``, ``lost``, ``damaged`` ….

    A request's first byte is stamped when it was read and an answer's just before it is written,
    so a gap after an answer is never shown shorter than the master kept it.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._end: float | None = None

    def record(
        self, direction: str, data: bytes, first: float, last: float, note: str = ''
    ) -> None:
        """Write one frame down."""
        gap = None if self._end is None else first - self._end
        self._end = last if self._end is None else max(self._end, last)
        frame = {
            'first': first,
            'last': last,
            'direction': direction,
            'hex': data.hex(),
            'gap': gap,
            'note': note,
        }
        self._stream.write(json.dumps(frame) + '\n')
        self._stream.flush()


#: More than any frame has: rubbish is not collected for ever.
_MOST = 600


@dataclass(frozen=True)
class Arrived:
    """A frame, or rubbish, and when its first and last byte arrived (s)."""

    data: bytes
    first: float
    last: float


class Receiver:
    """
    Collects bytes; a frame is there when its last byte has had time to arrive.

    :param protocol: knows how long a frame is.
    :param character: time of one character on the line (s); 0 on a line without pace.
    :param silence: the silence that ends what is no whole frame (s).
    """

    def __init__(self, protocol: Protocol, character: float, silence: float) -> None:
        self._protocol = protocol
        self._character = character
        self._silence = silence
        self._buffer = b''
        self._first = 0.0
        #: When the byte at the buffer's beginning began, and when its last one ends, on the wire.
        self._begin = self._end = float('-inf')

    def clear(self) -> None:
        """Forget what has not become a frame."""
        self._buffer = b''

    def feed(self, data: bytes, now: float) -> Iterator[Arrived]:
        """Take bytes that were read at ``now``; return what is complete by then."""
        # what the silence before these bytes has ended does not belong to them
        yield from self.take_frames(now)
        begin = max(now, self._end)
        if not self._buffer:
            self._first = now
            self._begin = begin
        self._end = begin + len(data) * self._character
        self._buffer += data
        yield from self.take_frames(now)

    def take_frames(self, now: float) -> Iterator[Arrived]:
        """Return what is complete at ``now``."""
        while self._buffer:
            length, end = self._next()
            if end > now:
                return
            yield Arrived(self._buffer[:length], self._first, end)
            self._buffer = self._buffer[length:]
            # bytes right behind a frame are the next one, as from a hasty master
            self._begin = self._first = end

    @property
    def due(self) -> float | None:
        """When :meth:`take_frames` will have something; ``None`` while nothing has arrived."""
        return self._next()[1] if self._buffer else None

    def _next(self) -> tuple[int, float]:
        """How much of the buffer comes out next, and when."""
        have = len(self._buffer)
        length = self._protocol.cut(self._buffer)
        if length:
            whole = length == have
            return length, self._end if whole else self._begin + length * self._character
        return have, self._end if have > _MOST else self._end + self._silence
