# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of a drive by its own addresses: PNU 1000 to 1003, each by the mailbox [M3 §10].

The address goes to 1000, a value to be written to 1001, 0 to 1003, and the command to 1002, which
begins it. 1003 says when it is over, and 1001 then has a value that was read.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from nfo_sinus_driver.link.interface import (
    MAILBOX,
    Address,
    Clock,
    DamagedAnswer,
    InProgress,
    LinkError,
    MailboxSilent,
    NoAnswer,
    NotReady,
    Refused,
    Reply,
    Unconfirmed,
)
from nfo_sinus_driver.link.mailbox import TIME, Mailbox

_ADDRESS, _DATA, _COMMAND, _ACKNOWLEDGE = range(1000, 1004)
_WRITE, _READ = 1, 2
_NOT_YET, _OK, _NOT_OK = range(3)
#: How often an access is checked for its end, and how long another one waits, s.
_PERIOD = 0.02
#: How long an abandoned access blocks others, s.
_LONGEST = 5.0


@dataclass
class _Access:
    """
    One access.

    :ivar writes: what is still to be written: PNU and word.
    :ivar until: when others may go on, s.
    :ivar ends: when it has to be over, once it has begun, s.
    """

    address: Address
    data: bytes | None
    until: float
    writes: list[tuple[int, int]] = field(default_factory=list)
    ends: float = 0.0

    @property
    def place(self) -> str:
        """The address, as manuals print it."""
        return f'{self.address.index:04X}h'


class ByAddress:
    """The parameters of the drive behind one mailbox, by address, one at a time."""

    def __init__(self, mailbox: Mailbox, now: Clock) -> None:
        self._mailbox = mailbox
        self._now = now
        self._current: _Access | None = None

    def forget(self) -> None:
        """Note that the connection is a new one."""
        self._current = None

    def access(self, address: Address, data: bytes | None = None) -> Reply:
        """
        Do the next step to read a value at an address, or to write it.

        :raises InProgress: there are more.
        :raises NotReady: another access is under way.
        :raises LinkError: as :meth:`Mailbox.access`.
        """
        current = self._access_for(address, data)
        try:
            return self._step(current)
        except NotReady:
            raise
        except LinkError as error:
            begun = data is not None and not current.writes
            error.maybe_done = begun or (data is not None and error.maybe_done)
            if type(error) not in (NoAnswer, DamagedAnswer):
                self._current = None
            raise

    def _access_for(self, address: Address, data: bytes | None) -> _Access:
        now, current = self._now(), self._current
        if current is not None and now <= current.until:
            if (current.address, current.data) != (address, data):
                raise NotReady(now + _PERIOD)
            return current
        value = [] if data is None else [(_DATA, int.from_bytes(data, 'big'))]
        command = _READ if data is None else _WRITE
        writes = [(_ADDRESS, address.index), *value, (_ACKNOWLEDGE, 0), (_COMMAND, command)]
        self._current = _Access(address, data, now + _LONGEST, writes)
        return self._current

    def _step(self, current: _Access) -> Reply:
        if current.writes:
            pnu, word = current.writes[0]
            self._mailbox.access(_place(current, pnu), word.to_bytes(2, 'big'))
            del current.writes[0]
            current.ends = self._now() + TIME
            raise InProgress(self._now())
        if current.ends:
            self._require_over(current)
            current.ends = 0.0
            if current.data is None:
                raise InProgress(self._now())
        reply = self._mailbox.access(_place(current, _DATA)) if current.data is None else None
        self._current = None
        return reply or Reply(b'', self._now(), requests=0)

    def _require_over(self, current: _Access) -> None:
        """Make sure that the drive has done it."""
        reply = self._mailbox.access(_place(current, _ACKNOWLEDGE))
        state = int.from_bytes(reply.data, 'big')
        if state == _NOT_OK:
            raise Refused(
                Refused.DEVICE_FAILURE,
                f'the drive refused the access to its address {current.place} (PNU 1003 is 2): '
                'check drive_addresses, and the value',
            )
        if state == _OK:
            return
        if self._now() < current.ends:
            raise InProgress(self._now() + _PERIOD)
        text = f'the drive did not end the access to its address {current.place} (PNU 1003 is 0)'
        raise Unconfirmed(text) if current.data is not None else MailboxSilent(text)


def _place(current: _Access, pnu: int) -> Address:
    return Address(MAILBOX, pnu, None, 2, False, current.address.block)
