# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the bus share: jobs that ask, the owner of a slot, and what may be raised."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from fake_link import PATIENCE, Done, FakeLink, wait_until
import pytest
from support.addresses import packed, register

from nfo_sinus_driver.bus import Bus, Cancelled, LatestValue, Priority, Task
from nfo_sinus_driver.link import LinkError, Read, Write, Written

UNIT = 1
OTHER = 2

ANYTHING = [ValueError('no'), AssertionError(), SystemExit(1), KeyboardInterrupt(), Cancelled()]
RAISED = pytest.mark.parametrize('error', ANYTHING, ids=lambda error: type(error).__name__)


def ask(
    bus: Bus, number: int, priority: Priority, data: bytes | None = None, unit: int = UNIT
) -> Future[bytes]:
    """Let a coroutine read or write one register; the future has the bytes read."""

    async def job() -> bytes:
        if data is None:
            return (await bus.ask(unit, Read(register(number)), priority)).data
        return (await bus.ask(unit, Write(register(number), data), priority)).data

    return bus.run(job())


def result(future: Future[Any]) -> Any:
    return future.result(PATIENCE)


def failure(future: Future[Any]) -> BaseException | None:
    return future.exception(PATIENCE)


def hold(bus: Bus, link: FakeLink, priority: Priority = Priority.REFRESH) -> Future[bytes]:
    """Have a transaction kept on the line; to be used while the link is held."""
    future = ask(bus, 0, priority)
    link.wait_until_held()
    return future


class Writer:
    """The owner of a slot: what is wanted, what was sent, and what came of it."""

    def __init__(self, bus: Bus, number: int = 50, unit: int = UNIT) -> None:
        self.bus = bus
        self.wanted: int | None = None
        self.outcomes: list[tuple[bytes | None, LinkError | None]] = []
        self.slot = LatestValue(unit, self.make, self.done)
        self.address = register(number)
        self.unit = unit

    def want(self, value: int | None) -> None:
        self.wanted = value
        self.bus.request(self.slot)

    def make(self) -> Write | None:
        if self.wanted is None:
            return None
        return Write(self.address, packed(self.wanted))

    def done(self, written: Written, error: LinkError | None) -> None:
        self.outcomes.append((written.data, error))


def spawned(bus: Bus, coroutine: Any) -> Task:
    """Start a coroutine beside, from outside."""
    tasks: list[Task] = []
    bus.call(lambda: tasks.append(bus.spawn(coroutine)))
    wait_until(lambda: tasks)
    return tasks[0]


def raiser(error: BaseException) -> Callable[..., Any]:
    def function(*_: object) -> Any:
        raise error

    return function


class Clock:
    """A clock that only transactions move."""

    def __init__(self, took: dict[int, float]) -> None:
        self.start = self.now = 1000.0
        self.took = took

    def monotonic(self) -> float:
        return self.now


def take_time(link: FakeLink, took: dict[int, float]) -> Clock:
    """Let transactions take a time by their register, on a clock of their own."""
    clock = Clock(took)

    def answer(done: Done) -> bytes:
        clock.now += took.get(done.number, 0.0)
        return packed(done.number)

    link.answer, link.time = answer, clock.monotonic
    return clock
