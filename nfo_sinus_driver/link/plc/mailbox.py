# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The mailbox of a PLC: parameters of a drive on its fieldbus, one at a time, by PNU and sub-index.

A request is written to registers +17 to +21 of the block before its number is written to +16,
alone. The PLC passes it to the drive, which is slow, and writes that number to +24 last. So a
request is several transactions, and others go between: each ends with :class:`InProgress`, until
the last one.

An answer is believed if its number and the request in the mailbox are still ours. A request without
an answer in :data:`TIME` is given up. A number that may have been lost is read before it is written
again: the PLC does nothing twice for one number, and a write never gets a second one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import enum
import struct
from typing import NamedTuple, NoReturn

from nfo_sinus_driver.link.interface import (
    Address,
    Clock,
    InProgress,
    LinkError,
    MailboxSilent,
    NoPath,
    NotReady,
    PortError,
    Refused,
    Reply,
    Unconfirmed,
)

#: The first register of a mailbox in its block.
FIRST = 16
#: How long an answer is waited for, s.
TIME = 1.0
#: How often the mailbox is read meanwhile, s.
_PERIOD = 0.02
#: Within what time a request that waits for its turn is repeated by its caller, s.
_WAITS_FOR = 0.2
#: How long a request that was given up is distinguished from a new one that is the same, s.
_REMEMBERED = 1.0

_LAYOUT = struct.Struct('>12H')
_REQUEST = struct.Struct('>3HL')
_READ, _WRITE = 1, 2
#: The values of +25.
_DONE, _REFUSED, _NONE_SUCH, _BUSY, _NO_ACCESS = range(5)
#: The error numbers of PROFIdrive that mean the same as an exception code of Modbus: read-only, and
#: value not allowed.
_CODES = {
    0x01: Refused.ILLEGAL_FUNCTION,
    0x02: Refused.ILLEGAL_VALUE,
    0x14: Refused.ILLEGAL_VALUE,
}

#: Reads registers of a unit: the first and how many, with what is written from which one on.
Registers = Callable[[int, int, int, int, bytes], tuple[bytes, float]]


class _Stage(enum.Enum):
    """The next step of a request."""

    PREPARE = enum.auto()
    ASK = enum.auto()
    WAIT = enum.auto()


class _Wanted(NamedTuple):
    """The parameter to be read, or written."""

    address: Address
    data: bytes | None

    @property
    def writes(self) -> bool:
        """It writes."""
        return self.data is not None

    @property
    def place(self) -> str:
        """The parameter, as the manuals name it."""
        pnu, sub_index = self.address.index, self.address.sub_index
        return f'PNU {pnu}' if sub_index is None else f'PNU {pnu}.{sub_index}'

    @property
    def registers(self) -> bytes:
        """The registers +17 to +21."""
        address = self.address
        where = address.index, address.sub_index or 0
        if self.data is None:
            return _REQUEST.pack(_READ, *where, 0)
        value = int.from_bytes(self.data, 'big', signed=bool(address.signed))
        return _REQUEST.pack(_WRITE, *where, value & 0xFFFF_FFFF)


@dataclass
class _Pending:
    """
    A request that is under way.

    :ivar number: 0 until it has one.
    :ivar until: when it is given up, s.
    """

    wanted: _Wanted
    until: float
    number: int = 0
    stage: _Stage = _Stage.PREPARE


class _Shown(NamedTuple):
    """The registers +16 to +27, and when they came."""

    data: bytes
    arrived: float

    @property
    def words(self) -> tuple[int, ...]:
        """The registers as numbers."""
        return _LAYOUT.unpack(self.data)

    @property
    def number(self) -> int:
        """The number of the last request."""
        return self.words[0]

    @property
    def request(self) -> bytes:
        """The request of that number."""
        return self.data[2:12]

    @property
    def answered(self) -> int:
        """The number of the request that is answered."""
        return self.words[8]

    @property
    def result(self) -> int:
        """The result of that request."""
        return self.words[9]

    @property
    def error(self) -> int:
        """The error number of the drive."""
        return self.words[11]


class Mailbox:
    """
    The mailbox of one block.

    :param registers: reads registers of a PLC, see :meth:`ModbusLink.transfer`.
    :param now: the clock of these moments, s.
    :param unit: the unit of the PLC.
    :param start: the first register of the block.
    """

    def __init__(self, registers: Registers, now: Clock, unit: int, start: int) -> None:
        self._transact = registers
        self._now = now
        self._unit = unit
        self._first = start + FIRST
        self._pending: _Pending | None = None
        #: A write that was given up while another request was wanted.
        self._unconfirmed: _Pending | None = None
        #: What waits for its turn, in order, and when its caller last repeated it.
        self._waiting: dict[_Wanted, float] = {}

    def forget(self) -> None:
        """Note that the connection is a new one."""
        self._pending = self._unconfirmed = None
        self._waiting.clear()

    def access(self, address: Address, data: bytes | None = None) -> Reply:
        """
        Do the next step to read a parameter, or to write ``data`` to it.

        :raises InProgress: there are more.
        :raises NotReady: another request is under way.
        :raises MailboxSilent: a read was given up.
        :raises Unconfirmed: a write was given up.
        :raises Refused: the drive refused, or has no such parameter; BUSY: nothing was done.
        :raises NoPath: the PLC does not reach the parameters of the drive.
        """
        pending = self._pending_for(_Wanted(address, data))
        try:
            shown = self._step(pending)
        except LinkError as error:
            error.maybe_done = pending.wanted.writes and pending.stage is not _Stage.PREPARE
            if isinstance(error, (PortError, Refused, NoPath)):
                self._pending = None
            raise
        if shown is None:
            raise InProgress(self._now())
        return self._answer(pending, shown)

    def _pending_for(self, wanted: _Wanted) -> _Pending:
        """Return the request that is under way for this, or begin one."""
        now, pending = self._now(), self._pending
        if pending is not None and now <= pending.until:
            if pending.wanted == wanted:
                return pending
            self._wait(wanted, now)
        for late in (pending, self._unconfirmed):
            if late and late.wanted == wanted and now <= late.until + _REMEMBERED and late.number:
                self.forget()
                raise self._unanswered(wanted)
        if self._first_waiting(now) not in (None, wanted):
            self._wait(wanted, now)
        self._waiting.pop(wanted, None)
        if pending is not None and pending.number and pending.wanted.writes:
            self._unconfirmed = pending
        self._pending = _Pending(wanted, now + TIME)
        return self._pending

    def _wait(self, wanted: _Wanted, now: float) -> NoReturn:
        self._waiting[wanted] = now
        raise NotReady(now + _PERIOD)

    def _first_waiting(self, now: float) -> _Wanted | None:
        """Return what has waited longest, and still waits."""
        waiting = self._waiting.items()
        self._waiting = {known: at for known, at in waiting if now - at <= _WAITS_FOR}
        return next(iter(self._waiting), None)

    def _step(self, pending: _Pending) -> _Shown | None:
        """Do the next step; return the content of the mailbox, once the number was written."""
        if pending.stage is _Stage.PREPARE:
            shown = self._swap(1, pending.wanted.registers)
            pending.number = _unlike(shown.number, shown.answered)
            pending.stage = _Stage.ASK
            return None
        if pending.stage is _Stage.WAIT:
            return self._swap()
        # it may be written, whether the answer comes or not
        pending.stage = _Stage.WAIT
        pending.until = self._now() + TIME
        return self._swap(0, pending.number.to_bytes(2, 'big'))

    def _answer(self, pending: _Pending, shown: _Shown) -> Reply:
        """Return the answer of the mailbox to a request, if it has one."""
        wanted = pending.wanted
        if shown.request != wanted.registers:
            self._pending = None
            raise self._disturbed(wanted)
        if shown.number != pending.number:
            # the write of the number was lost
            pending.stage = _Stage.ASK
            raise InProgress(self._now())
        if shown.answered != pending.number:
            raise InProgress(self._now() + _PERIOD)
        self._pending = None
        if shown.result != _DONE:
            raise self._refused(wanted, shown)
        if wanted.writes:
            return Reply(b'', shown.arrived)
        return Reply(shown.data[-wanted.address.size :], shown.arrived)

    def _swap(self, offset: int = 0, data: bytes = b'') -> _Shown:
        """Write registers, if any, and read all."""
        at, count = self._first, _LAYOUT.size // 2
        try:
            return _Shown(*self._transact(self._unit, at, count, at + offset, data))
        except Refused as refusal:
            raise self._of_registers(refusal) from None

    # --- errors -----------------------------------------------------------------------------------

    def _refused(self, wanted: _Wanted, shown: _Shown) -> LinkError:
        if shown.result == _BUSY:
            return Refused(Refused.BUSY)
        if shown.result == _NONE_SUCH:
            return Refused(Refused.ILLEGAL_ADDRESS, f'the drive has no {wanted.place}')
        if shown.result == _REFUSED:
            code = _CODES.get(shown.error, Refused.DEVICE_FAILURE)
            place, number = wanted.place, shown.error
            return Refused(code, f'the drive refused {place} (PROFIdrive error {number:02X}h)')
        return NoPath(
            f'the PLC does not reach {wanted.place} of the drive (register +25 of its block is '
            f'{shown.result}): check the fieldbus, and FB_RosParameter in the program of the PLC'
        )

    def _unanswered(self, wanted: _Wanted) -> LinkError:
        text = (
            f'the PLC did not answer for {wanted.place} within {TIME:g} s (register +24 of its '
            'block): check that its program calls FB_RosMailbox and FB_RosParameter in each cycle'
        )
        return self._lost(wanted, text)

    def _disturbed(self, wanted: _Wanted) -> LinkError:
        text = (
            f'another client has written to the mailbox of the PLC while {wanted.place} was asked '
            'for, or the PLC has restarted: only one client may use a mailbox'
        )
        return self._lost(wanted, text)

    @staticmethod
    def _lost(wanted: _Wanted, text: str) -> LinkError:
        return Unconfirmed(text) if wanted.writes else MailboxSilent(text)

    def _of_registers(self, refusal: Refused) -> LinkError:
        if refusal.code != Refused.ILLEGAL_ADDRESS:
            return refusal
        return NoPath(
            f'unit {self._unit} has no registers {self._first} to {self._first + 11} (exception '
            f'{refusal.code}), the mailbox of layout 2: check the program of the PLC'
        )


def _unlike(*numbers: int) -> int:
    """Return the number of a request: none of these, and not 0."""
    number = numbers[0]
    while number in (0, *numbers):
        number = number % 0xFFFF + 1
    return number
