# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Telegram 1 behind a PLC or gateway: a block of registers, one telegram each way.

The PLC is the controller of the drive on its fieldbus and offers the driver a block of its own
holding registers, five to be read and three to be written. Every transaction carries all of them
(function 23, or 16 and 03 where that is refused), so that the status and the command are of one
moment, and a life counter each way shows that the other end is alive.

The command words are written with every transaction: our counter moves while the driver lives, and
so the PLC knows that they are still valid. After :data:`PLC_TIME` without a new count the PLC stops
the drive, and would let it go on at the next write that moves the counter [C108]. So all words are
forgotten after such a gap, or with the connection: nothing is written then until a command begins
anew. Before that, the block is only read.

A word reaches the drive when the PLC exchanges the next telegram with it, and the answer to that
one is in the block when the PLC's life counter has moved twice [C117]. A status from before has the
time of the last one before the word, so that it is never taken for an answer to it.
"""

from __future__ import annotations

import struct

from nfo_sinus_driver.link.interface import (
    MAILBOX,
    Address,
    Clock,
    InProgress,
    Interrupted,
    LinkError,
    NoData,
    NoPath,
    NotSent,
    Refused,
    Reply,
)
from nfo_sinus_driver.link.plc.mailbox import Mailbox, Registers

#: The addressing of parameters in a block, and their space; the sub-index is the part of the block,
#: as follows.
ADDRESSING = 'telegram1'
#: To be read: ZSW1, and in the higher word the flags of the PLC, bit 0: valid, 1: released.
STATUS = 0
#: The actual value.
ACTUAL = 1
#: To be written: STW1 and the set-point, with which no motor may run. It is always written.
BEGIN = 2
#: The same, with which one may run: it follows on the words before, and is refused after a gap.
NEXT = 3
#: The bits of the present STW1 to be cleared, so that no motor may run, with the set-point;
#: refused where there is none.
CLEAR = 4
#: The set-point alone; refused where there is no STW1.
SETPOINT = 5
#: To be read: three words of a longer telegram, from here on; refused where there are none.
MORE = 6

#: How long after the last new count from us the PLC stops the drive, s.
PLC_TIME = 1.0
#: How often the life counter of the PLC moves until a word has reached the drive, and the drive's
#: answer the block [C117].
_MOVES = 2
#: How long the actual value is that of the status read before it, s; the block has both.
_SHARED_FOR = 0.1
#: The known layouts of the block; the second one has a mailbox for parameters.
LAYOUTS = (1, 2)
#: The first register that the driver writes.
WRITTEN_FROM = 8

#: How many registers are read, by the layout.
_SHOWN = {0: 5, 1: 5, 2: 8}
_COMMANDED = struct.Struct('>3H')
_VALID = 1 << 0
_MORE_VALID = 1 << 2
_NO_MAILBOX = (
    'the block of the PLC has layout 1, which has no mailbox for parameters: see layout 2 in '
    'docs/plc.md'
)
_NO_MORE = 'the PLC does not show the longer telegram (bit 2 of register +3 of its block is 0)'
_NO_CONTROL_WORD = (
    'no control word of this driver is in the block: it has not been written yet, or the PLC '
    f'was not reached for longer than its time, {PLC_TIME:g} s; enable again'
)

#: A write.
_Written = tuple[Address, bytes]
#: The registers that were read, and a moment.
_Shown = tuple[tuple[int, ...], float]


class Block:
    """
    One block: its content, and how old that is.

    :param registers: reads registers of a PLC, see :meth:`ModbusLink.transfer`.
    :param now: the clock of these moments, s.
    :param unit: the unit of the PLC.
    :param start: its first register.
    """

    def __init__(self, registers: Registers, now: Clock, unit: int, start: int) -> None:
        self._transact = registers
        self._now = now
        self._unit = unit
        self._start = start
        #: STW1 and set-point as they are written with every transaction; ``None``: nothing is.
        self._command: tuple[int, int] | None = None
        #: A motor may run by them.
        self._live = False
        #: When the last answered transaction with them began.
        self._sent_at = 0.0
        self._count = 0
        #: The STW1 that the PLC has acknowledged last.
        self._acknowledged: int | None = None
        #: The PLC's life counter, and how often it has to move until a status is new.
        self._life: int | None = None
        self._moves = 0
        #: When the present content of the block first came.
        self._life_at = 0.0
        #: The content with the last status, and when; ``None`` once its actual value was taken.
        self._beside: tuple[_Shown, float] | None = None
        #: The layout that was read; 0: none yet.
        self._layout = 0
        #: The last reading, and when.
        self._last: tuple[_Shown, float] | None = None
        self._mailbox = Mailbox(registers, now, unit, start)

    def forget(self) -> None:
        """Write nothing any more, only read: the connection is a new one."""
        self._layout = 0
        self._mailbox.forget()
        self._command, self._live = None, False
        self._acknowledged = None

    def read(self, address: Address) -> Reply:
        """
        Read a part of it; ``arrived`` is when the PLC first had it from the drive.

        The actual value is that of the status that was read just before: the two are of one
        telegram, and one request is enough.
        """
        if address.space == MAILBOX:
            return self._access(address)
        shared = self._shared_with(address)
        if shared is not None:
            return Reply(self._part(shared[0], address), shared[1], requests=0)
        shown, arrived = self._swap()
        reply = Reply(self._part(shown, address), arrived)
        if address.sub_index == STATUS:
            self._beside = (shown, arrived), self._now()
        return reply

    def _shared_with(self, address: Address) -> _Shown | None:
        """Return the last reading, if it has this part of the same telegram."""
        beside, self._beside = self._beside, None
        part = address.sub_index
        shared = self._last if part is not None and part >= MORE else beside
        if shared is None or part == STATUS or self._now() - shared[1] > _SHARED_FOR:
            return None
        return shared[0]

    def write(self, address: Address, data: bytes) -> Reply:
        """Write a part of it."""
        if address.space == MAILBOX:
            return self._access(address, data)
        _, arrived = self._swap((address, data))
        return Reply(b'', arrived)

    def write_and_read(self, address: Address, data: bytes, source: Address) -> Reply:
        """Write a part of it and read another; empty where the PLC has no valid data."""
        shown, arrived = self._swap((address, data))
        try:
            reply = Reply(self._part(shown, source), arrived)
        except NoData:
            # it was written all the same
            return Reply(b'', arrived)
        self._beside = (shown, arrived), self._now()
        return reply

    def _access(self, address: Address, data: bytes | None = None) -> Reply:
        """Do the next step to read or write a parameter by the mailbox."""
        if not self._layout:
            self._look()
            raise InProgress(self._now())
        if self._layout == 1:
            raise NotSent(Refused.ILLEGAL_ADDRESS, _NO_MAILBOX)
        return self._mailbox.access(address, data)

    def _part(self, shown: tuple[int, ...], address: Address) -> bytes:
        word, actual, _, flags = shown[:4]
        part = address.sub_index
        if not flags & _VALID:
            raise NoData(
                f'the PLC has no valid data from the drive (bit 0 of register {self._start + 3} of '
                f'unit {self._unit} is 0): check the fieldbus between them and that the drive has '
                'power'
            )
        if part is not None and part >= MORE:
            if not flags & _MORE_VALID:
                raise Refused(Refused.ILLEGAL_ADDRESS, _NO_MORE)
            return _word(shown[5 + part - MORE])
        return struct.pack('>HH', word, flags) if part == STATUS else _word(actual)

    def _swap(self, write: _Written | None = None) -> _Shown:
        """Carry out a transaction; return what was read, and when it first came."""
        began = self._now()
        self._beside = None
        if self._command is not None and began - self._sent_at > PLC_TIME:
            live = self._live
            self._command, self._live = None, False
            if live and (write is None or write[0].sub_index != BEGIN):
                raise self._interrupted(began - self._sent_at, maybe_done=False)
        if write is None and self._command is None:
            return self._look()
        if not self._layout:
            # nothing is written to registers that may have another meaning
            self._look()
            began = self._now()
        command, live = self._command_after(write)
        # it may be carried out even if no answer comes
        before = self._sent_at, self._live, self._command
        last, was_live, stood = before
        self._command, self._live = command, live
        if stood is None or (live and not was_live):
            last = self._sent_at = began
        self._count = self._count % 0xFFFF + 1
        try:
            shown, arrived = self._send(_COMMANDED.pack(*command, self._count))
        except (Refused, NoPath):
            if live:
                # a refused word is not written again with the next transaction
                self._sent_at, self._live, self._command = before
            raise
        self._sent_at = began
        taken = self._take(shown, arrived)
        if command[0] != self._acknowledged:
            self._acknowledged, self._moves = command[0], _MOVES
        if live and arrived - last > PLC_TIME:
            # the PLC may have stopped the drive before it came, and let it go on now
            self._command, self._live = None, False
            raise self._interrupted(arrived - last, maybe_done=True)
        return taken

    def _command_after(self, write: _Written | None) -> tuple[tuple[int, int], bool]:
        """Return the new STW1 and set-point, and whether a motor may run by them."""
        if write is None:
            assert self._command is not None
            return self._command, self._live
        address, data = write
        part = address.sub_index
        if part == BEGIN or (part == NEXT and self._command is not None):
            word, setpoint = struct.unpack('>HH', data)
            return (word, setpoint), part == NEXT
        if self._command is None:
            raise NotSent(Refused.DEVICE_FAILURE, _NO_CONTROL_WORD)
        word, _ = self._command
        value = int.from_bytes(data, 'big')
        if part == CLEAR:
            return (word & ~value, 0), False
        assert part == SETPOINT, part
        return (word, value), self._live

    def _look(self) -> _Shown:
        """Only read."""
        count = _SHOWN[self._layout]
        try:
            data, arrived = self._transact(self._unit, self._start, count, 0, b'')
        except Refused as refusal:
            raise self._of_block(refusal) from None
        return self._take(_words(data), arrived)

    def _send(self, data: bytes) -> _Shown:
        """Write and read."""
        at, count = self._start + WRITTEN_FROM, _SHOWN[self._layout]
        try:
            answer, arrived = self._transact(self._unit, self._start, count, at, data)
        except Refused as refusal:
            raise self._of_block(refusal) from None
        return _words(answer), arrived

    def _take(self, shown: tuple[int, ...], arrived: float) -> _Shown:
        version = shown[4]
        self._layout = version if version in LAYOUTS else 0
        if not self._layout:
            raise NoPath(
                f'register {self._start + 4} of unit {self._unit} is {version} and not 1 or 2, '
                'the version of the layout of the block: check block_address, and that the '
                'program of the PLC is that of docs/plc.md'
            )
        if shown[2] != self._life:
            self._life = shown[2]
            self._moves = max(self._moves - 1, 0)
            if not self._moves:
                self._life_at = arrived
        # the first reading does not know yet how many registers there are
        self._last = ((shown, self._life_at), self._now()) if len(shown) > 5 else None
        return shown, self._life_at

    def _of_block(self, refusal: Refused) -> LinkError:
        if refusal.code != Refused.ILLEGAL_ADDRESS:
            return refusal
        return NoPath(
            f'unit {self._unit} has no registers {self._start} to {self._start + 10} '
            f'(exception {refusal.code}): check block_address, and the program of the PLC'
        )

    def _interrupted(self, seconds: float, *, maybe_done: bool) -> Interrupted:
        error = Interrupted(
            f'the PLC was not reached for {seconds:.1f} s, and stops the drive after {PLC_TIME:g} s'
        )
        error.maybe_done = maybe_done
        return error


class Blocks:
    """The blocks of one line, by unit and first register."""

    def __init__(self, registers: Registers, now: Clock) -> None:
        self._transact = registers
        self._now = now
        self._blocks: dict[tuple[int, int], Block] = {}

    def __call__(self, unit: int, address: Address) -> Block:
        """Return the block of a parameter."""
        assert address.block is not None
        place = unit, address.block
        if place not in self._blocks:
            self._blocks[place] = Block(self._transact, self._now, *place)
        return self._blocks[place]

    def forget(self) -> None:
        """Note that the connection is a new one."""
        for block in self._blocks.values():
            block.forget()


def _words(data: bytes) -> tuple[int, ...]:
    return struct.unpack(f'>{len(data) // 2}H', data)


def _word(value: int) -> bytes:
    return value.to_bytes(2, 'big')
