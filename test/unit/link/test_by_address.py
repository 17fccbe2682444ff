# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters by PNU 1000 to 1003: the steps of the manual, refusals, losses [M3 §10]."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from nfo_sinus_driver.link import (
    Address,
    InProgress,
    LinkError,
    MailboxSilent,
    NoAnswer,
    NotReady,
    PortError,
    Refused,
    Reply,
    Unconfirmed,
)
from nfo_sinus_driver.link.by_address import ByAddress

ACC_TIME = Address('drive_address', 0x1105, None, 2, False, 100)
OTHER = Address('drive_address', 0x1106, None, 2, False, 100)


@dataclass
class Drive:
    """
    The four PNUs of a drive, by a mailbox that answers at once.

    :ivar values: what it has by address.
    :ivar says: what PNU 1003 is after a command.
    :ivar done: what went by the mailbox: PNU, and the word that was written.
    """

    now: float = 1000.0
    values: dict[int, int] = field(default_factory=lambda: {0x1105: 50})
    says: int = 1
    done: list[tuple[int, int | None]] = field(default_factory=list)
    fails: Callable[[], LinkError | None] = lambda: None
    pnus: dict[int, int] = field(default_factory=dict)

    def access(self, address: Address, data: bytes | None = None) -> Reply:
        assert (address.space, address.block, address.size) == ('pnu', 100, 2)
        self.now += 0.01
        error = self.fails()
        if error is not None:
            raise error
        if data is None:
            self.done.append((address.index, None))
            return Reply(self.pnus[address.index].to_bytes(2, 'big'), self.now)
        word = int.from_bytes(data, 'big')
        self.done.append((address.index, word))
        self.pnus[address.index] = word
        if address.index == 1002:
            self.pnus[1003] = self.says
            if word == 1:
                self.values[self.pnus[1000]] = self.pnus[1001]
            else:
                self.pnus[1001] = self.values.get(self.pnus[1000], 0)
        return Reply(b'', self.now)


@pytest.fixture
def drive() -> Drive:
    return Drive()


@pytest.fixture
def access(drive: Drive) -> ByAddress:
    return ByAddress(drive, lambda: drive.now)  # type: ignore[arg-type]


def asked(access: ByAddress, drive: Drive, address: Address, data: bytes | None = None) -> bytes:
    while True:
        try:
            return access.access(address, data).data
        except NotReady as error:
            drive.now = max(drive.now, error.until)


def test_reading_goes_by_the_steps_of_the_manual(drive: Drive, access: ByAddress) -> None:
    assert asked(access, drive, ACC_TIME) == b'\0\x32'
    assert drive.done == [
        (1000, 0x1105), (1003, 0), (1002, 2), (1003, None), (1001, None),
    ]


def test_writing_goes_by_the_steps_of_the_manual(drive: Drive, access: ByAddress) -> None:
    assert asked(access, drive, ACC_TIME, b'\0\x4b') == b''
    assert drive.done == [
        (1000, 0x1105), (1001, 0x4B), (1003, 0), (1002, 1), (1003, None),
    ]
    assert drive.values[0x1105] == 0x4B


def test_not_ok_is_a_refusal(drive: Drive, access: ByAddress) -> None:
    drive.says = 2
    for data in (None, b'\0\1'):
        with pytest.raises(Refused, match='refused the access to its address 1105h'):
            asked(access, drive, ACC_TIME, data)


@pytest.mark.parametrize('data', [None, b'\0\1'])
def test_what_does_not_end_is_given_up(drive: Drive, access: ByAddress, data: bytes | None) -> None:
    drive.says = 0
    began = drive.now
    with pytest.raises(MailboxSilent if data is None else Unconfirmed, match='did not end') as lost:
        asked(access, drive, ACC_TIME, data)
    assert 1.0 <= drive.now - began < 1.5
    assert lost.value.maybe_done == (data is not None)
    drive.says = 1
    assert asked(access, drive, ACC_TIME, data) == (b'\0\x32' if data is None else b'')


def test_another_access_waits(drive: Drive, access: ByAddress) -> None:
    with pytest.raises(InProgress):
        access.access(ACC_TIME)
    with pytest.raises(NotReady) as waits:
        access.access(OTHER)
    assert type(waits.value) is NotReady
    assert asked(access, drive, ACC_TIME) == b'\0\x32'
    assert asked(access, drive, OTHER) == b'\0\0'


@pytest.mark.parametrize('at', range(5))
@pytest.mark.parametrize('error', [NoAnswer, PortError, Unconfirmed])
def test_a_lost_step_does_not_write_twice(
    drive: Drive, access: ByAddress, error: type[LinkError], at: int
) -> None:
    left = iter([None] * at + [error('lost')])
    drive.fails = lambda: next(left, None)
    with pytest.raises(error) as raised:
        asked(access, drive, ACC_TIME, b'\0\1')
    commands = drive.done.count((1002, 1))
    assert commands == (at > 3)
    assert raised.value.maybe_done or not commands
    if error is NoAnswer:
        # the same again goes on with it
        assert asked(access, drive, ACC_TIME, b'\0\1') == b''
        assert drive.done.count((1002, 1)) == 1
