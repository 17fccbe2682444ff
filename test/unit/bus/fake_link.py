# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A link made of plain Python, and waiting without luck."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import contextlib
import math
import threading
import time
from typing import Any, NamedTuple

from support.addresses import packed

from nfo_sinus_driver.link import PROTOCOLS, Address, NoAnswer, Remarks, Reply, Supervision, Why
from nfo_sinus_driver.link.pauses import Pauses
from nfo_sinus_driver.link.thread_clock import ThreadClock

#: No honest wait takes this long, on any machine, s.
PATIENCE = 30.0


def wait_until(condition: Callable[[], object], timeout: float = PATIENCE) -> None:
    """Wait until a condition holds; fail when it does not in time."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, 'it never came true'
        time.sleep(0.001)


class Done(NamedTuple):
    """
    One transaction that the link saw; ``data`` is ``None`` for a read.

    :ivar source: what was read in the same transaction as the write.
    """

    unit: int
    number: int
    data: bytes | None
    source: int | None = None


class FakeLink:
    """
    A link that notes what it is asked and does as the test says.

    :ivar done: every transaction, in order.
    :ivar answer: called with each; returns the bytes, or raises.
    :ivar time: its steady clock; :ivar clock: the same for the worker.
    :ivar opening: called when the port is opened; may raise.
    """

    protocol = PROTOCOLS['modbus_rtu']
    remarks = Remarks()
    supervision: Supervision | None = None
    place = ''
    last_byte_at = -math.inf

    def __init__(self) -> None:
        self.done: list[Done] = []
        self.time: Callable[[], float] = time.monotonic
        self.clock = ThreadClock(self.now)
        self.pauses = Pauses(lambda text: None, lambda: -math.inf)
        self.answer: Callable[[Done], bytes] = lambda done: packed(done.number)
        self.opening: Callable[[], None] = lambda: None
        self.closing: Callable[[], None] = lambda: None
        self.opened = 0
        self.closed = 0
        self.resync_reads: dict[int, tuple[Address, ...]] = {}
        self._condition = threading.Condition()
        self._hold = self._holds = False

    def wait_at_most(self, seconds: float) -> None:
        pass

    def end_listening_if(self, stop_waits: Any) -> None:
        pass

    def answers_twice(self, unit: int) -> bool:
        return False

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Keep the next transaction on the line; inside, it has begun as soon as asked for."""
        with self._condition:
            self._hold = True
        try:
            yield
        finally:
            with self._condition:
                self._hold = False
                self._condition.notify_all()

    def wait_until_held(self) -> None:
        """Wait until a transaction is being kept."""
        with self._condition:
            assert self._condition.wait_for(lambda: self._holds, PATIENCE)

    @property
    def numbers(self) -> list[int]:
        """The registers asked for, in order."""
        return [done.number for done in self.done]

    def now(self) -> float:
        return self.time()

    def open(self) -> None:
        self.opening()
        self.opened += 1

    def close(self) -> None:
        self.closed += 1
        self.closing()

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        return self._transact(Done(unit, address.index, None))

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        return self._transact(Done(unit, address.index, data))

    def write_and_read(
        self, unit: int, address: Address, data: bytes, source: Address
    ) -> Reply:
        return self._transact(Done(unit, address.index, data, source.index))

    def read_then_write(
        self, unit: int, source: Address, address: Address, data: bytes
    ) -> Reply:
        with contextlib.suppress(NoAnswer):
            self.read(unit, source)
        return self.write(unit, address, data)

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        self.resync_reads[unit] = tuple(addresses)

    def _transact(self, done: Done) -> Reply:
        # as long as the test wants it to take
        self.clock.until(math.inf)
        with self._condition:
            self.done.append(done)
            while self._hold:
                self._holds = True
                self._condition.notify_all()
                assert self._condition.wait(PATIENCE)
            self._holds = False
        return Reply(self.answer(done), time.monotonic())
