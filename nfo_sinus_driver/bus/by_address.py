# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of a drive by its own addresses: PNU 1000 to 1003, each by the mailbox [M3 §10].

The address goes to 1000, a value to be written to 1001, 0 to 1003, and the command to 1002, which
begins it. 1003 says when it is over, and 1001 then has a value that was read.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
import math

from nfo_sinus_driver.bus.worker import Bus
from nfo_sinus_driver.link import MailboxSilent, Refused, Reply, Unconfirmed

_ADDRESS, _DATA, _COMMAND, _ACKNOWLEDGE = range(1000, 1004)
_WRITE, _READ = 1, 2
_OK, _NOT_OK = b'\0\1', b'\0\2'
#: How often an access is checked for its end, and how long that is waited for, s.
_PERIOD = 0.02
_TIME = 1.0

#: Reads a PNU, or writes a word to it.
Ask = Callable[[int, 'int | None'], Awaitable[Reply]]


class ByAddress:
    """The parameters of one drive by address, one at a time, for coroutines on the bus."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        #: When another access may begin, s; an earlier driver's may still be at work.
        self._free_at = bus.now() + _TIME

    async def access(self, address: int, data: int | None, ask: Ask) -> Reply:
        """
        Read the word at an address, or write ``data`` to it.

        :raises Refused: the drive has not done it.
        :raises MailboxSilent: the drive did not end it; Unconfirmed: likewise a write.
        :raises LinkError: as the link does.
        """
        while self._bus.now() < self._free_at:
            await self._bus.sleep(_PERIOD)
        self._free_at = math.inf
        at_work = False
        try:
            await ask(_ADDRESS, address)
            if data is not None:
                await ask(_DATA, data)
            await ask(_ACKNOWLEDGE, 0)
            at_work = True
            await ask(_COMMAND, _READ if data is None else _WRITE)
            done = await self._wait(f'{address:04X}h', data is not None, ask)
            at_work = False
            if not done:
                raise Refused(
                    Refused.DEVICE_FAILURE,
                    f'the drive refused the access to its address {address:04X}h (PNU 1003 is 2): '
                    'check drive_addresses, and the value',
                )
            if data is None:
                return await ask(_DATA, None)
            return Reply(b'', self._bus.now(), requests=0)
        finally:
            # its end would pass for that of the next one
            self._free_at = self._bus.now() + _TIME if at_work else -math.inf

    async def _wait(self, place: str, writes: bool, ask: Ask) -> bool:
        """Wait for the end of an access; return whether the drive has done it."""
        until = self._bus.now() + _TIME
        while (state := (await ask(_ACKNOWLEDGE, None)).data) not in (_OK, _NOT_OK):
            if self._bus.now() >= until:
                text = f'the drive did not end the access to its address {place} (PNU 1003 is 0)'
                raise Unconfirmed(text) if writes else MailboxSilent(text)
            await self._bus.sleep(_PERIOD)
        return state == _OK
