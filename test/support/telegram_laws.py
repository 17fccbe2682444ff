# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Judges the control words in the block of a PLC, by the tables of the manuals and nothing else.

It knows no profile: which bit may come when is written down here once more, as [M1], [M3 §6, §7.2]
and [M0 tables 14 to 16] print it, with [C107], [C109] and [C111].
"""

from __future__ import annotations

import abc
from collections.abc import Iterable, Iterator, Mapping
import dataclasses
from itertools import groupby
import struct
from typing import Any

#: For how long the PLC takes a word for valid whose life counter stands still, s [C108].
_PLC_TIME = 1.0


@dataclasses.dataclass(frozen=True)
class Exchange:
    """What was written in one transaction, when, and what had been read before: ZSW1, flags."""

    at: float
    stw1: int
    setpoint: int
    life: int
    zsw1: int | None
    flags: int


def exchanges(frames: Iterable[Mapping[str, Any]], unit: int, start: int = 0) -> Iterator[Exchange]:
    """Return what was written to a block, from the frames of a trace on Modbus TCP."""
    zsw1, flags = None, 0
    #: What is on its way: whether the block is read, and what is written.
    asked: dict[bytes, tuple[bool, Exchange | None]] = {}
    for frame in frames:
        data = bytes.fromhex(frame['hex'])
        # what was lost on its way was written nowhere
        unheard = frame['direction'] == 'request' and frame.get('note') == 'lost'
        if len(data) < 8 or data[6] != unit or unheard or _of_mailbox(frame, data, start):
            continue
        number, function = data[:2], data[7]
        if frame['direction'] == 'request':
            # of what was not answered nothing is known
            for _, unanswered in asked.values():
                if unanswered is not None:
                    yield unanswered
            words = struct.unpack_from('>HH', data, 8) if function in (3, 16, 23) else ()
            at = {
                23: 17 if function == 23 and struct.unpack_from('>HH', data, 12) == (start + 8, 3)
                else 0,
                16: 13 if words == (start + 8, 3) else 0,
            }.get(function, 0)
            assert at or function in (3, 43, 17), f'function {function} at a block'
            reads = function in (3, 23) and words in ((start, 5), (start, 8))
            command = struct.unpack_from('>3H', data, at) if at else ()
            written = Exchange(frame['first'], *command, zsw1, flags) if at else None
            asked = {number: (reads, written)}
        elif number in asked:
            reads, written = asked.pop(number)
            if function & 0x80:
                continue
            if written is not None:
                yield written
            if reads:
                received, _, _, received_flags, version = struct.unpack_from('>5H', data, 9)
                # a PLC that has just started shows nothing yet
                if version:
                    zsw1, flags = received, received_flags


#: The registers of the mailbox in a block.
_MAILBOX = range(16, 28)
#: The operation command of a Sinus H, by its address [M3 §7.2.1].
_OPERATION_COMMAND = 0x0382
#: What of SCMD goes by the mailbox, for it has no other way [M0 §7, table 18].
PROCEDURES = frozenset((0x201, 0x301, 0x401, 0x501, 0x800, 0x900))
#: MODE, SCMD, DriveControl with its mask, ProfidriveControl and the set-points of a G2
#: [M0 tables 9, 10]: commands, which are the telegram's.
COMMANDS = frozenset((1034, 1035, 1018, 1017, 1003, 1020, 1124, 1127, 1129))


def _of_mailbox(frame: Mapping[str, Any], data: bytes, start: int) -> bool:
    """Return whether a request is to the mailbox alone; its answer is asked for by nothing else."""
    if frame['direction'] != 'request' or data[7] not in (3, 16, 23):
        return False
    return struct.unpack_from('>H', data, 8)[0] - start in _MAILBOX


def mailbox_complaints(
    frames: Iterable[Mapping[str, Any]], model: str, unit: int = 1, start: int = 0
) -> Iterator[str]:
    """Yield what is wrong with what was written to the mailbox of a block."""
    asked = b''
    given: set[int] = set()
    for frame in frames:
        data = bytes.fromhex(frame['hex'])
        if len(data) < 8 or data[6] != unit or not _of_mailbox(frame, data, start):
            continue
        at = {16: 8, 23: 12}.get(data[7])
        if at is None:
            continue
        register, count = struct.unpack_from('>HH', data, at)
        written = data[at + 5 :]
        place = register - start
        if (place, count) == (17, 5):
            asked, given = written, set()
            command, pnu, _, _, value = struct.unpack('>5H', asked)
            by_address = model == 'sinus_h' and pnu == 1000 and value == _OPERATION_COMMAND
            is_command = pnu in COMMANDS and not (pnu == 1035 and value in PROCEDURES)
            if command == 2 and (by_address if model == 'sinus_h' else is_command):
                yield f'PNU {pnu} is a command, and was written by the mailbox'
            continue
        if (place, count) != (16, 1):
            yield f'{count} registers were written from +{place} on'
            continue
        given.add(int.from_bytes(written, 'big'))
        if not asked or 0 in given or len(given) > 1:
            yield f'request {asked.hex()} has the numbers {sorted(given)}'


def words(frames: Iterable[Mapping[str, Any]], unit: int = 1) -> list[int]:
    """Return the control words that were written to a block, each once in a row."""
    return [word for word, _ in groupby(exchange.stw1 for exchange in exchanges(frames, unit))]


class Judge(abc.ABC):
    """Hears the words to one drive, one after another; complains of what the tables forbid."""

    #: Bits of STW1 that mean something, and of ZSW1: control.
    known: int
    run: int
    control = 1 << 9
    #: What the PLC leaves of the word of a driver that it does not hear, and a begin goes on from.
    left = 0

    def __init__(self) -> None:
        self._before: Exchange | None = None

    def complaints(self, now: Exchange) -> Iterator[str]:
        """Take what was written; yield what is wrong with it."""
        before, self._before = self._before, now
        shown = f'STW1 {now.stw1:04X}h after ZSW1 {now.zsw1 or 0:04X}h'
        if now.zsw1 is None:
            yield f'{shown}: written before anything was read'
            return
        if before is not None and now.life == before.life:
            yield f'{shown}: the life counter stood still'
        stood = before.stw1 if before is not None else 0
        if before is not None and now.at - before.at >= _PLC_TIME:
            # the PLC stops the motor of a driver that it does not hear
            stood &= self.left
        if now.stw1 & ~self.known:
            yield f'{shown}: bits that are not known'
        if now.setpoint and not now.stw1 & self.run:
            yield f'{shown}: set-point {now.setpoint} beside no run command'
        rises = now.stw1 & ~stood
        if rises & self.run and now.setpoint:
            yield f'{shown}: the run command comes with a set-point'
        if rises & self.run and not now.flags & 2:
            yield f'{shown}: run without the release of the PLC'
        if rises & 1 << 7 and now.stw1 & self.run:
            yield f'{shown}: a fault is acknowledged beside a run command'
        if rises & 1 << 7 and not now.zsw1 & 1 << 3:
            yield f'{shown}: there is no fault to acknowledge'
        for wrong in self.order(now.stw1, stood, now.zsw1):
            yield f'{shown} (it was {stood:04X}h): {wrong}'

    @abc.abstractmethod
    def order(self, word: int, stood: int, zsw1: int) -> Iterator[str]:
        """Yield what is wrong with the order of the bits."""


class OptimalJudge(Judge):
    """[M1]: PLC control, Enable, Switch on; each precedes the next, and is confirmed."""

    known = 1 << 0 | 1 << 3 | 1 << 7 | 1 << 10
    run = 1 << 0
    # "Switch on" alone is cleared (docs/plc.md): without Enable the motor would coast
    left = 1 << 3 | 1 << 10

    def order(self, word: int, stood: int, zsw1: int) -> Iterator[str]:
        """Yield what is wrong with the order of the bits."""
        rises, falls = word & ~stood, stood & ~word
        if rises & 1 << 3 and not (stood & 1 << 10 and zsw1 & self.control):
            yield 'Enable before PLC control was confirmed'
        if rises & 1 << 0 and not (stood & 1 << 3 and zsw1 & 1 << 2):
            yield 'Switch on before Enable was confirmed'
        if falls & 1 << 3 and zsw1 & (1 << 1 | 1 << 15):
            yield 'Enable is taken from a motor that is driven: it coasts'
        if falls & 1 << 10:
            yield 'PLC control is given away'
        if word & 1 << 0 and not word & 1 << 3:
            yield 'Switch on without Enable'


class HJudge(Judge):
    """[M3 §6, §7.2.1]."""

    known = 0x04FF
    run = 1 << 3

    def order(self, word: int, stood: int, zsw1: int) -> Iterator[str]:
        """Yield what is wrong with the order of the bits."""
        rises, falls = word & ~stood, stood & ~word
        pattern = zsw1 & 0x47
        if not word & 1 << 10:
            yield 'without bit 10 all of it is ignored [C107]'
        # OperationDisable is also the stop where nothing stands, as after a port that was gone,
        # whatever ZSW1 shows [C116]: in a fault, or while switching on is inhibited
        idle = zsw1 & (1 << 3 | 1 << 6)
        if rises & 1 << 0 and stood and not idle and pattern not in (0x01, 0x03, 0x07):
            yield 'SwitchON before S2 was shown'
        if rises & 1 << 3 and pattern != 0x03:
            yield 'OperationEnable before S3 was shown'
        if word & 1 << 3 and word & 0x07 != 0x07:
            yield 'bit 3 without bits 0 to 2'
        if falls & 1 << 0 and word & 0x06 == 0x06 and pattern == 0x07:
            yield 'SwitchOFF is no way out of S4 [C107]'


class G2Judge(Judge):
    """PROFIdrive, standard telegram 1 [C111]."""

    known = 0x04FF
    run = 1 << 0

    def order(self, word: int, stood: int, zsw1: int) -> Iterator[str]:
        """Yield what is wrong with the order of the bits."""
        rises, falls = word & ~stood, stood & ~word
        pattern = zsw1 & 0x47
        if not word & 1 << 10:
            yield 'without bit 10 all of it is ignored'
        if rises & 1 << 0 and pattern != 0x01:
            yield 'ON before "ready to switch on" was shown'
        if word & 1 << 0 and rises & 1 << 3 and pattern != 0x03:
            yield 'operation enabled before "switched on" was shown'
        if word & 1 << 1 and falls & 1 << 3 and zsw1 & 1 << 2:
            yield 'operation is taken from a motor that is driven: it coasts'


class DriveControlJudge(Judge):
    """[M0 tables 14 to 16]."""

    known = 0xE8FF
    run = 1 << 0 | 1 << 3 | 1 << 13

    def order(self, word: int, stood: int, zsw1: int) -> Iterator[str]:
        """Yield what is wrong with the order of the bits."""
        rises = word & ~stood
        directions = 1 << 3 | 1 << 13
        # one direction for the other, in operation
        turns = rises & directions and stood & directions and not rises & ~directions
        stopping = zsw1 & 1 << 15
        if word & 1 << 3 and word & 1 << 13:
            yield 'both directions mean no change [C36]'
        if rises & 1 << 0 and not (zsw1 & 0x4F == 0x01 or stopping):
            yield 'bit 0 before READY_TO_SWITCH_ON was shown'
        if rises & directions and not (turns or zsw1 & 0x4F == 0x03 or stopping):
            yield 'a direction before SWITCHED_ON was shown'
        if rises & 1 << 0 and rises & directions:
            yield 'bit 0 and a direction at once'
        if not word & 1 << 14:
            yield 'control is asked for no more'


JUDGES: Mapping[str, type[Judge]] = {
    'sinus_optimal': OptimalJudge,
    'sinus_h': HJudge,
    'sinus_g2': G2Judge,
    'drivecontrol': DriveControlJudge,
}


def violations(
    frames: Iterable[Mapping[str, Any]], model: str, unit: int = 1, start: int = 0
) -> list[str]:
    """Return what is wrong with all that was written to the block of a unit."""
    judge = JUDGES[model]()
    frames = list(frames)
    found = [
        wrong
        for exchange in exchanges(frames, unit, start)
        for wrong in judge.complaints(exchange)
    ]
    return [*found, *mailbox_complaints(frames, model, unit, start)]
