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
    :ivar says: what PNU 1003 is after a command.
    :ivar done: what went by the mailbox: PNU, and the word that was written.
    """

    time: float = 1000.0
    values: dict[int, int] = field(default_factory=lambda: {ACC_TIME: 50})
    says: int = 1
    done: list[tuple[int, int | None]] = field(default_factory=list)
    fails: Callable[[], LinkError | None] = lambda: None
    pnus: dict[int, int] = field(default_factory=dict)

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
        if word is None:
            return Reply(self.pnus[pnu].to_bytes(2, 'big'), self.time)
        self.pnus[pnu] = word
        if pnu == 1002:
            self.pnus[1003] = self.says
            if word == 1:
                self.values[self.pnus[1000]] = self.pnus[1001]
            else:
                self.pnus[1001] = self.values.get(self.pnus[1000], 0)
        return Reply(b'', self.time)


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
    began = drive.now()
    with pytest.raises(MailboxSilent if word is None else Unconfirmed, match='did not end'):
        asked(by_address, drive, word)
    assert 1.0 <= drive.now() - began < 1.5
    drive.says = 1
    assert asked(by_address, drive, word) == (b'\0\x32' if word is None else b'')


def test_another_access_waits(drive: Drive, by_address: ByAddress) -> None:
    async def both() -> list[Reply]:
        accesses = (by_address.access(one, None, drive.ask) for one in (ACC_TIME, OTHER))
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
