# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The real link of a MOVITRAC over a line that is none, in virtual time.

Its answers name no drive, and ACK and NACK nothing at all: what the link believes of them is half
of what the driver does after a disturbance, so nothing stands in its place.
"""

from __future__ import annotations

from collections.abc import Callable
import heapq
import itertools
from typing import Any

from any_order_rig import DirectLink, FaultyLine, Rig
from support.wire import understand

from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.movitrac_link import MovitracLink
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.movitrac import Movitrac

#: How its line is set [M4 §2.3.3].
SETTINGS = LineSettings(9600, '8N1')
#: What a drive takes to answer at least, s.
_TURNAROUND = 0.002
#: How late an answer comes that nobody waits for any more, s; it is given up after 0.4 s at last.
_LATE = 0.45


def link_of(far: SimulatedDrive) -> Callable[[Rig], Any]:
    """Return what makes the line to a drive: over Modbus its frames matter to nobody here."""
    return DirectLink if 'modbus' in far.servers else FramedLink


class FramedLink(FaultyLine, MovitracLink):
    """The link, and the port that it has, with the simulated drive behind it."""

    def __init__(self, rig: Rig) -> None:
        FaultyLine.__init__(self, rig)
        MovitracLink.__init__(self, _Port(self, rig), SETTINGS, rig.clock.monotonic)

    def open(self) -> None:
        """Open the port."""
        self._require_port()
        super().open()

    def begin(self, frame: bytes) -> None:
        """
        Judge a request that goes out, and take note of it.

        :raises PortError: the port is gone.
        """
        self._require_port()
        request = understand(frame, 'movitrac')
        words = None if request is None else request.words
        if request is not None and words is not None:
            self._rig.judge(lambda: self._rig.wrote(request.place, words))
        self._begin_request(frame)

    def answers(self, frame: bytes) -> list[tuple[float, bytes]]:
        """Let the drive hear a request; return what it answers, and how much later than at once."""
        protocol, far = Movitrac(), self._rig.far
        request = protocol.unwrap(frame)
        assert request is not None and protocol.concerns(far, request)
        if not self._is_heard():
            return []
        answer = protocol.answer(far, request)
        if not self.passes:
            return self._spoilt(answer)
        if self._random.random() < self.noise:
            return [(0.0, self._damaged(answer))] if self._random.random() < 0.5 else []
        return [(0.0, answer)]

    def _spoilt(self, answer: bytes) -> list[tuple[float, bytes]]:
        if self.doubled:
            self.doubled -= 1
            return [(0.0, answer), (0.0, answer)]
        if self.losses:
            self.losses -= 1
            return []
        if self.state == 'noise':
            return [(0.0, self._damaged(answer))]
        return [(_LATE, answer)] if self.state == 'late' else []

    def _damaged(self, answer: bytes) -> bytes:
        place = self._random.randrange(len(answer))
        spoilt = answer[place] ^ 1 << self._random.randrange(8)
        return answer[:place] + bytes((spoilt,)) + answer[place + 1 :]


class _Port:
    """What carries the bytes; whole frames come in one piece."""

    def __init__(self, link: FramedLink, rig: Rig) -> None:
        self._link = link
        self._rig = rig
        #: Frames by the moment of their last byte; those to the drive, and those from it.
        self._coming: list[tuple[float, int, bool, bytes]] = []
        self._order = itertools.count()

    def open(self) -> None:
        pass

    def close(self) -> None:
        self._coming.clear()

    def write(self, data: bytes) -> None:
        self._link.begin(data)
        self._put(self._rig.clock.now, data, to_drive=True)

    def read(self, until: float) -> bytes:
        rig = self._rig
        while self._coming and self._coming[0][0] <= max(until, rig.clock.now):
            at, _, to_drive, frame = heapq.heappop(self._coming)
            rig.elapse(max(0.0, at - rig.clock.now))
            if not to_drive:
                return frame
            self._carry_out(frame)
        rig.elapse(max(0.0, until - rig.clock.now))
        return b''

    def _carry_out(self, frame: bytes) -> None:
        # what P843 says counts from when the request has come
        response_time = self._rig.far.control_unit.response_time
        begin = self._rig.clock.now + max(_TURNAROUND, response_time)
        for later, answer in self._link.answers(frame):
            begin = self._put(begin + later, answer, to_drive=False)

    def _put(self, begin: float, frame: bytes, *, to_drive: bool) -> float:
        """Send a frame; return when its last byte comes."""
        end = begin + len(frame) * SETTINGS.char_time
        heapq.heappush(self._coming, (end, next(self._order), to_drive, frame))
        return end
