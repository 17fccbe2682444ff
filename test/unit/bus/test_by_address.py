# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters by PNU 1000 to 1003: the steps of the manual, refusals, losses [M3 §10]."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from nfo_sinus_driver.bus.by_address import ByAddress
from nfo_sinus_driver.link import (
    LinkError,
    MailboxSilent,
    NoAnswer,
    PortError,
    Refused,
    Reply,
    Unconfirmed,
)

ACC_TIME, OTHER = 0x1105, 0x1106


@dataclass
class Drive:
    """
    The four PNUs of a drive, by a mailbox that answers at once; and the bus.

    :ivar values: what it has by address.
    :ivar says: what PNU 1003 is after a command, and after how long, s.
    :ivar done: what went by the mailbox: PNU, and the word that was written.
    """

    time: float = 1000.0
    values: dict[int, int] = field(default_factory=lambda: {ACC_TIME: 50})
    says: int = 1
    takes: float = 0.0
    done: list[tuple[int, int | None]] = field(default_factory=list)
    fails: Callable[[], LinkError | None] = lambda: None
    pnus: dict[int, int] = field(default_factory=dict)
    pending: list[tuple[float, int, int, int]] = field(default_factory=list)

    def now(self) -> float:
        return self.time

    async def sleep(self, seconds: float) -> None:
        self.time += seconds
        await asyncio.sleep(0)

    async def ask(self, pnu: int, word: int | None) -> Reply:
        await self.sleep(0.01)
        error = self.fails()
        if error is not None:
            raise error
        self.done.append((pnu, word))
        self.end()
        if word is None:
            return Reply(self.pnus[pnu].to_bytes(2, 'big'), self.time)
        self.pnus[pnu] = word
        if pnu == 1002:
            address, data = self.pnus[1000], self.pnus.get(1001, 0)
            self.pending.append((self.time + self.takes, word, address, data))
            self.end()
        return Reply(b'', self.time)

    def end(self) -> None:
        """End what was begun long enough ago."""
        while self.pending and self.pending[0][0] <= self.time:
            _, command, address, data = self.pending.pop(0)
            self.pnus[1003] = self.says
            if command == 1:
                self.values[address] = data
            else:
                self.pnus[1001] = self.values.get(address, 0)


@pytest.fixture
def drive() -> Drive:
    return Drive()


@pytest.fixture
def by_address(drive: Drive) -> ByAddress:
    return ByAddress(drive)  # type: ignore[arg-type]


def asked(by_address: ByAddress, drive: Drive, word: int | None = None) -> bytes:
    return asyncio.run(by_address.access(ACC_TIME, word, drive.ask)).data


def test_reading_goes_by_the_steps_of_the_manual(drive: Drive, by_address: ByAddress) -> None:
    assert asked(by_address, drive) == b'\0\x32'
    assert drive.done == [
        (1000, 0x1105), (1003, 0), (1002, 2), (1003, None), (1001, None),
    ]


def test_writing_goes_by_the_steps_of_the_manual(drive: Drive, by_address: ByAddress) -> None:
    assert asked(by_address, drive, 0x4B) == b''
    assert drive.done == [
        (1000, 0x1105), (1001, 0x4B), (1003, 0), (1002, 1), (1003, None),
    ]
    assert drive.values[0x1105] == 0x4B


def test_not_ok_is_a_refusal(drive: Drive, by_address: ByAddress) -> None:
    drive.says = 2
    for word in (None, 1):
        with pytest.raises(Refused, match='refused the access to its address 1105h'):
            asked(by_address, drive, word)


@pytest.mark.parametrize('word', [None, 1])
def test_what_does_not_end_is_given_up(
    drive: Drive, by_address: ByAddress, word: int | None
) -> None:
    drive.says = 0
    drive.time += 1.0
    began = drive.now()
    with pytest.raises(MailboxSilent if word is None else Unconfirmed, match='did not end'):
        asked(by_address, drive, word)
    assert 1.0 <= drive.now() - began < 1.5
    drive.says = 1
    assert asked(by_address, drive, word) == (b'\0\x32' if word is None else b'')


def test_what_an_earlier_driver_began_ends_before_the_first_access(drive: Drive) -> None:
    drive.takes = 0.5
    before = ByAddress(drive)  # type: ignore[arg-type]

    async def cut_short() -> None:
        task = asyncio.ensure_future(before.access(ACC_TIME, 7, drive.ask))
        while (1002, 1) not in drive.done:
            await asyncio.sleep(0)
        task.cancel()

    asyncio.run(cut_short())
    drive.values[OTHER] = 9
    here = ByAddress(drive)  # type: ignore[arg-type]
    reply = asyncio.run(here.access(OTHER, None, drive.ask))
    assert reply.data == b'\0\x09'
    assert drive.values[ACC_TIME] == 7


def test_another_access_waits(drive: Drive, by_address: ByAddress) -> None:
    async def both() -> list[Reply]:
        accesses = (by_address.access(row, None, drive.ask) for row in (ACC_TIME, OTHER))
        return await asyncio.gather(*accesses)

    assert [reply.data for reply in asyncio.run(both())] == [b'\0\x32', b'\0\0']
    assert [pnu for pnu, _ in drive.done] == 2 * [1000, 1003, 1002, 1003, 1001]


@pytest.mark.parametrize('at', range(5))
@pytest.mark.parametrize('error', [NoAnswer, PortError, Unconfirmed])
def test_after_a_lost_step_the_next_access_begins_anew(
    drive: Drive, by_address: ByAddress, error: type[LinkError], at: int
) -> None:
    left = iter([None] * at + [error('lost')])
    drive.fails = lambda: next(left, None)
    with pytest.raises(error):
        asked(by_address, drive, 1)
    assert drive.done.count((1002, 1)) == (at > 3)
    assert asked(by_address, drive) == (b'\0\1' if at > 3 else b'\0\x32')


@pytest.mark.parametrize('asks', range(1, 9))
def test_the_late_end_of_one_that_was_cancelled_is_not_that_of_the_next(
    drive: Drive, by_address: ByAddress, asks: int
) -> None:
    drive.values[OTHER] = 7
    drive.takes = 0.06

    async def cancelled() -> None:
        first = asyncio.ensure_future(by_address.access(OTHER, None, drive.ask))
        while len(drive.done) < asks and not first.done():
            await asyncio.sleep(0)
        first.cancel()
        await asyncio.gather(first, return_exceptions=True)
        await by_address.access(ACC_TIME, 0x4B, drive.ask)
        assert (await by_address.access(ACC_TIME, None, drive.ask)).data == b'\0\x4b'

    asyncio.run(cancelled())
    assert drive.values == {ACC_TIME: 0x4B, OTHER: 7}
