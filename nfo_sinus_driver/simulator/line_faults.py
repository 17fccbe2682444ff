# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What can go wrong between a drive and the master, on request."""

from __future__ import annotations

from dataclasses import dataclass, replace
import random

#: Faults of the next answers.
ANSWER_FAULTS = ('noise', 'damage', 'delay', 'drop', 'double')
#: Those that an answer does not survive where a gateway reads it, and what the trace calls them.
_NOTES = {'noise': 'noise', 'damage': 'damaged', 'drop': 'lost'}
#: How long each is, how far it is from one to the next, and since when (s).
_NO_BURSTS = (0.0, 1.0, 0.0)


@dataclass
class _Fault:
    """What happens to some answers: to so many of a drive or of any, or to a share by chance."""

    what: str
    seconds: float
    address: int | None = None
    left: int = 0
    share: float = 0.0
    chance: random.Random | None = None

    def strikes(self, address: int) -> bool:
        """Whether it happens to the next answer of a drive."""
        if self.chance is not None:
            return self.chance.random() < self.share
        strikes = self.left > 0 and self.address in (None, address)
        self.left -= strikes
        return strikes


@dataclass(frozen=True)
class Reply:
    """An answer as it goes on the line: what, how much later than usual, what is wrong with it."""

    data: bytes
    delay: float = 0.0
    note: str = ''


class LineFaults:
    """
    The faults that wait for the next answers, and those that come by chance or by the clock.

    :param bits: of a byte on the line.
    :param whole: noise and damage are noted alone, and leave answers as they are: of a CAN bus,
        whose frames have a check sum. A damaged one is sent again at once, so damage only takes
        time; noise is what comes out of a serial adapter beside its lines. The line sees to both.
    """

    def __init__(self, bits: int = 8, seed: int = 0, *, whole: bool = False) -> None:
        self._bits = bits
        self._whole = whole
        self.dead_until = float('-inf')
        self._bursts = _NO_BURSTS
        self._rates: dict[str, _Fault] = {}
        self._pending: list[_Fault] = []
        self._random = random.Random(seed)

    def add(
        self, what: str, times: int = 1, address: int | None = None, seconds: float = 0.0
    ) -> None:
        """Spoil the next answers, of one drive or any, by one of :data:`ANSWER_FAULTS`."""
        self._pending.append(_Fault(what, seconds, address, times))

    def set_rate(
        self, what: str, share: float, seed: int | None = None, seconds: float = 0.0
    ) -> None:
        """
        Spoil answers by chance from now on, each on its own.

        :param what: one of :data:`ANSWER_FAULTS`; one after the other, they add up.
        :param share: of all answers, 0 to 1; 0 ends it.
        :param seed: makes the same answers of a run suffer in every run; for ``None`` the line's.
        :param seconds: how late the answers come, for ``delay``.
        :raises ValueError: no share.
        """
        if not 0.0 <= share <= 1.0:
            raise ValueError(f'a share of {share:g}: it is 0 to 1')
        chance = self._random if seed is None else random.Random(seed)
        self._rates[what] = _Fault(what, seconds, share=share, chance=chance)

    def set_bursts(self, seconds: float, period: float, now: float) -> None:
        """Let the line carry nothing for so long in every period, first after one of them."""
        if not 0.0 <= seconds <= period:
            raise ValueError(f'bursts of {seconds:g} s every {period:g} s: they would never end')
        self._bursts = (seconds, period, now) if seconds else _NO_BURSTS

    def dead(self, now: float) -> bool:
        """Whether the line carries nothing now."""
        seconds, period, since = self._bursts
        return now < self.dead_until or (now - since) % period >= period - seconds

    def heal(self) -> None:
        """Forget them all."""
        self._pending.clear()
        self._rates.clear()
        self._bursts = _NO_BURSTS
        self.dead_until = float('-inf')

    def alter(self, address: int, frame: bytes, instead: Reply | None = None) -> list[Reply]:
        """Return what goes on the line for an answer; ``instead`` of none what a gateway says."""
        replies = [Reply(frame)]
        for fault in [*self._pending, *self._rates.values()]:
            if fault.strikes(address):
                replies = [new for reply in replies for new in self._spoiled(fault, reply, instead)]
        self._pending = [fault for fault in self._pending if fault.left]
        return replies

    def noise(self) -> bytes:
        """Return some bytes that were not sent."""
        noise = self._random.randbytes(self._random.randint(1, 5))
        mask = (1 << self._bits) - 1
        return bytes(byte & mask for byte in noise)

    def _spoiled(self, fault: _Fault, reply: Reply, instead: Reply | None) -> list[Reply]:
        if fault.what in _NOTES and instead is not None:
            delay = reply.delay + instead.delay
            return [replace(instead, delay=delay, note=_noted(reply, _NOTES[fault.what]))]
        if fault.what == 'drop':
            return []
        if fault.what == 'double':
            return [reply, replace(reply, note=_noted(reply, 'double'))]
        if fault.what == 'delay':
            note = _noted(reply, 'delayed')
            return [replace(reply, delay=reply.delay + fault.seconds, note=note)]
        data = reply.data
        if not self._whole:
            data = self.noise() + data if fault.what == 'noise' else self._damaged(data)
        return [replace(reply, data=data, note=_noted(reply, _NOTES[fault.what]))]

    def _damaged(self, data: bytes) -> bytes:
        """Return bytes with a flipped bit."""
        damaged = bytearray(data)
        damaged[self._random.randrange(len(damaged))] ^= 1 << self._random.randrange(self._bits)
        return bytes(damaged)


def _noted(reply: Reply, note: str) -> str:
    return f'{reply.note}, {note}' if reply.note else note
