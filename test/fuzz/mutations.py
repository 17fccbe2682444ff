# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What becomes of real frames on a bad line, and how the bytes come in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from random import Random

#: Most bytes of pure rubbish in a row.
_MOST_RUBBISH = 40


class Mutator:
    """
    Spoils frames, always in the same way for the same random numbers.

    :param random: where all its decisions come from.
    """

    def __init__(self, random: Random) -> None:
        self._random = random
        self._ways = (
            self._flip,
            self._flip,
            self._burst,
            self._cut,
            self._hole,
            self._double,
            self._splice,
            self._insert,
            self._swap,
            self._count,
        )

    def rubbish(self) -> bytes:
        """Return random bytes."""
        return self._random.randbytes(1 + int(self._random.random() * _MOST_RUBBISH))

    def frame(
        self, message: bytes, others: Sequence[bytes], seal: Callable[[bytes], bytes]
    ) -> bytes:
        """
        Return a spoiled frame.

        :param message: what the frame carries.
        :param others: frames that parts may come from.
        :param seal: makes a message a frame, with a check sum that is right.
        """
        way = self._random.choice(self._ways)
        if self._random.random() < 0.3:
            # a length or a byte that is wrong, under a check sum that is right
            return seal(way(message, others) or b'\0')
        spoiled = way(seal(message), others)
        return self.frame(spoiled, others, bytes) if self._random.random() < 0.2 else spoiled

    def pieces(self, stream: bytes) -> Iterator[bytes]:
        """Hand a stream over in random pieces: whole, byte by byte, or in lumps."""
        longest = self._random.choice((1, 3, 8, 30, len(stream) or 1))
        begin = 0
        while begin < len(stream):
            end = begin + 1 + int(self._random.random() * longest)
            yield stream[begin:end]
            begin = end

    # --- ways to spoil one: each takes a frame and others, and returns what is left of it ---------

    def _at(self, frame: bytes) -> int:
        return int(self._random.random() * len(frame))

    def _flip(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        if not frame:
            return frame
        at = self._at(frame)
        bit = 1 << int(self._random.random() * 8)
        return frame[:at] + bytes((frame[at] ^ bit,)) + frame[at + 1 :]

    def _burst(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        at = self._at(frame)
        length = 1 + int(self._random.random() * 4)
        return frame[:at] + self._random.randbytes(length) + frame[at + length :]

    def _cut(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        at = self._at(frame)
        return frame[:at] if self._random.random() < 0.5 else frame[at:]

    def _hole(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        at = self._at(frame)
        return frame[:at] + frame[at + 1 + int(self._random.random() * 3) :]

    def _double(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        at = self._at(frame)
        return frame + frame if self._random.random() < 0.5 else frame[: at + 1] + frame[at:]

    def _splice(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        other = self._random.choice(others)
        return frame[: self._at(frame)] + other[self._at(other) :]

    def _insert(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        at = self._at(frame)
        middle = self._random.choice(others) if self._random.random() < 0.5 else self.rubbish()[:4]
        return frame[:at] + middle + frame[at:]

    def _swap(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        begin, end = sorted((self._at(frame), self._at(frame)))
        return frame[:begin] + frame[end:] + frame[begin:end]

    def _count(self, frame: bytes, others: Sequence[bytes]) -> bytes:
        """Change one byte a little: where it is a length or a count, that is wrong now."""
        if not frame:
            return frame
        at = self._at(frame[:8])
        step = self._random.choice((-2, -1, 1, 2, 16, 128))
        return frame[:at] + bytes((frame[at] + step & 0xFF,)) + frame[at + 1 :]
