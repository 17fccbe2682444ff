# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the far end of the line saw: frames, cycles, gaps, and the least time they can take."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
import json
import math
from pathlib import Path
import statistics
import struct

#: Start, eight data, parity and stop bits, or two stop bits in place of the parity: Modbus RTU;
#: and with seven data bits: Modbus ASCII and Classic; without a parity: MOVITRAC.
_BITS = {'modbus_rtu': 11, 'modbus_ascii': 10, 'classic': 10, 'movitrac': 10}
READ_FUNCTIONS = (3, 4)
_WRITE_ONE, _WRITE_SEVERAL, _READ_AND_WRITE = 6, 16, 23
#: How a Classic ENQUIRY begins and ends; the address is a character from here on [M0 §6.1].
_EOT, _ENQ, _ADDRESS_ZERO = 4, 5, 0x20
#: How a MOVITRAC's ENQUIRY begins, and how many characters of silence are before it.
_ENQUIRY, _SWITCHING = 0xB5, 2
#: Less than this is what floating point makes of a time since the machine started, s.
_ROUNDING = 1e-7


@dataclass(frozen=True)
class Frame:
    """
    One frame as the simulator traced it.

    :ivar first: when its first byte arrived, s of the steady clock.
    :ivar gap: the silence before it, s; 0 for the first frame.
    """

    first: float
    last: float
    is_request: bool
    data: bytes
    gap: float


@dataclass(frozen=True)
class Line:
    """How fast a line is: the least time that anything takes on it."""

    baud_rate: int
    protocol: str = 'modbus_rtu'

    @property
    def character(self) -> float:
        """The time of one character, s."""
        return _BITS[self.protocol] / self.baud_rate

    @property
    def gap(self) -> float:
        """
        The silence before each request, s.

        Of Modbus RTU t3.5, fixed above 19200 bit/s; of MOVITRAC what the driver leaves the drive to
        switch its transmitter off.
        """
        if self.protocol == 'movitrac':
            return _SWITCHING * self.character
        if self.protocol != 'modbus_rtu':
            return 0.0
        return 0.00175 if self.baud_rate > 19200 else 3.5 * self.character

    @property
    def answer_gap(self) -> float:
        """The silence before each answer, s; of Modbus RTU alone."""
        return self.gap if self.protocol == 'modbus_rtu' else 0.0

    @property
    def model(self) -> str:
        """The family of the drives on it."""
        return 'movitrac31' if self.protocol == 'movitrac' else 'sinus_g2'

    @property
    def space(self) -> str:
        """How their tables name what addresses are counted in."""
        return self.protocol if self.protocol in ('classic', 'movitrac') else 'modbus'

    def limit(self, frames: Sequence[Frame]) -> float:
        """Return the time that frames and the gaps before them take at least, s."""
        characters = sum(len(frame.data) for frame in frames)
        gaps = sum(self.gap if frame.is_request else self.answer_gap for frame in frames)
        return characters * self.character + gaps


def frames_of(path: Path, start: float = 0.0, end: float = float('inf')) -> list[Frame]:
    """Return the frames whose first byte came between two moments."""
    frames = [_frame(entry) for entry in _entries(path)]
    return [frame for frame in frames if start <= frame.first < end]


def requests_of(path: Path) -> list[float]:
    """Return when the first byte of each request came, of those that were lost, too."""
    return [entry['first'] for entry in _entries(path) if entry['direction'] == 'request']


def _entries(path: Path) -> list[dict]:
    # the last line may not be whole yet
    return [json.loads(line) for line in path.read_text().split('\n')[:-1]]


def _frame(entry: dict) -> Frame:
    if entry['note']:
        raise RuntimeError(f'a frame on a perfect line was {entry["note"]}: {entry["hex"]}')
    return Frame(
        entry['first'],
        entry['last'],
        entry['direction'] == 'request',
        bytes.fromhex(entry['hex']),
        entry['gap'] or 0.0,
    )


def short_gaps(frames: Sequence[Frame], line: Line) -> int:
    """Return before how many requests the line was silent for less than t3.5."""
    # nothing came before the first
    requests = (frame for frame in frames[1:] if frame.is_request)
    return sum(frame.gap < line.gap - _ROUNDING for frame in requests)


def cycles(frames: Sequence[Frame], line: Line, place: int) -> dict[str, float]:
    """
    Return the cycles of all units: from one read of a parameter to the next, of the same unit.

    Whichever function reads it: one that writes something else as well counts, too.

    :param place: the register or the Classic id of the parameter.

    :returns: median and 99th percentile of the time (ms), and the median of time / wire time.
    """
    times, limits = [], []
    for numbers in _begins(frames, line, place).values():
        for begin, end in pairwise(numbers):
            times.append(frames[end].first - frames[begin].first)
            limits.append(line.limit(frames[begin:end]))
    return {
        'time': 1e3 * statistics.median(times),
        'p99': 1e3 * percentile(times, 99),
        'ratio': statistics.median(a / b for a, b in zip(times, limits, strict=True)),
    }


def units_with_cycles(frames: Sequence[Frame], line: Line, place: int) -> int:
    """Return from how many units a parameter was read twice at least."""
    return sum(len(numbers) > 1 for numbers in _begins(frames, line, place).values())


def _begins(frames: Sequence[Frame], line: Line, place: int) -> dict[int, list[int]]:
    """Return which frames ask for a parameter, by unit."""
    begins: dict[int, list[int]] = {}
    for number, frame in enumerate(frames):
        if frame.is_request:
            unit, what = _asks(frame, line.protocol)
            if what == place:
                begins.setdefault(unit, []).append(number)
    return begins


def _asks(frame: Frame, protocol: str) -> tuple[int, int | None]:
    """Return whom a request asks, and for which register or id, if it reads one."""
    data = frame.data
    if protocol == 'modbus_rtu':
        return data[0], read_register(data)
    if protocol == 'movitrac':
        index = int.from_bytes(data[2:4], 'big')
        return data[1], index if data[0] == _ENQUIRY else None
    enquires = data[0] == _EOT and data[-1] == _ENQ
    return data[1] - _ADDRESS_ZERO, int(data[3:-1], 16) if enquires else None


def read_register(request: bytes) -> int | None:
    """Return which register a Modbus RTU request reads, or ``None`` if it reads none."""
    _, function, register = struct.unpack('>BBH', request[:4].ljust(4, b'\0'))
    return register if function in (*READ_FUNCTIONS, _READ_AND_WRITE) else None


def writes(frames: Sequence[Frame], register: int) -> Iterator[tuple[float, int, int]]:
    """Return when a register was written by Modbus RTU, of which unit, and its (first) word."""
    for frame in frames:
        if frame.is_request:
            unit, where, word = written(frame.data)
            if where == register:
                yield frame.first, unit, word


def written(request: bytes) -> tuple[int, int | None, int]:
    """Return the unit, the register that a Modbus RTU request writes, if any, and the word."""
    unit, function = request[:2]
    if function == _WRITE_ONE:
        return unit, *struct.unpack('>HH', request[2:6])
    if function == _WRITE_SEVERAL:
        return unit, *struct.unpack('>H3xH', request[2:9])
    if function == _READ_AND_WRITE:
        return unit, *struct.unpack('>H3xH', request[6:13])
    return unit, None, 0


def longest_transaction(frames: Sequence[Frame], line: Line) -> float:
    """Return the longest time for which a transaction keeps the line, s."""
    return max(
        line.limit((request, answer))
        for request, answer in pairwise(frames)
        if request.is_request and not answer.is_request
    )


def percentile(values: Sequence[float], percent: float) -> float:
    """Return the value that so many percent of all do not exceed."""
    ordered = sorted(values)
    return ordered[math.ceil(len(ordered) * percent / 100) - 1]
