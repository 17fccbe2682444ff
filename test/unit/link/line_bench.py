# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The link of each protocol of a serial line, on a line in virtual time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import classic_far_end as classic
from identify_bench import G2, device_answer, g2_answer, write_and_read_answer
import movitrac_far_end as movitrac
import pymodbus_opinion as opinion
import pytest
from support.addresses import classic_id, packed, register, words_of
from virtual_wire import AsciiWire, Asked, FarEnd, Fate, Wire

from nfo_sinus_driver.catalog import Access, load_family
from nfo_sinus_driver.link.interface import (
    Address,
    LineSettings,
    LinkError,
    Read,
    Refused,
    Reply,
)
from nfo_sinus_driver.link.modbus.ascii import AsciiLink
from nfo_sinus_driver.link.modbus.rtu import RtuLink
from nfo_sinus_driver.link.pairs.classic import ClassicLink
from nfo_sinus_driver.link.pairs.movitrac import MovitracLink
from nfo_sinus_driver.link.request_link import RequestLink

UNIT = 1


def same(frame: bytes) -> bytes:
    """What an adapter that echoes makes of a request."""
    return frame


def tell_as_a_drive_does(link: Any, family: str) -> None:
    """Tell a link what is safe to read of each drive, and why it refuses, by its family."""
    model, protocol = load_family(family), link.protocol.addressing
    ask = model.profile.why_refused

    def at(key: str) -> Address:
        return Address(*model[key].at(protocol).place)

    def there(key: str) -> Read:
        return Read(at(key), model[key].access is Access.ACKNOWLEDGE)

    def why(read: Callable[[Read], int], before: int | None) -> tuple[int, str]:
        assert ask is not None
        return ask(lambda key: read(there(key)), before)

    reads = [at(key) for key in model.profile.resync_reads[protocol]]
    for unit in link.protocol.units:
        link.use_resync_reads(unit, reads, ask and why)


class Bench:
    """
    A link and its drives; everything done with it happens in virtual time.

    :ivar settings: of the line.
    :ivar A: a parameter, ``B`` another whose answer looks the same.
    :ivar VALUE: what is written.
    :ivar lost: what is asked for when it is A that is read, and nothing is ever answered.
    :ivar patience: after so many time-outs the answer of a drive that is not known is late.
    :ivar names_it: a value names its parameter, and the answer to a write names nothing; else it
        is the other way round.
    :ivar most: how many requests a write takes at most, and a read.
    :ivar units: two drives.
    """

    link_class: type[RequestLink[Any]]
    wire_class: type[Wire] = Wire
    far_class: type[FarEnd]
    settings: LineSettings
    A: Address
    B: Address
    VALUE: bytes
    lost: tuple[int, ...]
    patience = 1.0
    names_it = True
    most = (2, 2)
    units = (UNIT, 2)

    def __init__(self, *fates: Fate, settings: LineSettings | None = None) -> None:
        self.line = settings or self.settings
        self.wire = self.wire_class(self.line)
        self.drive: Any = self.far_class(self.wire)
        self.drive.heal(*fates)
        self.link: Any = self.link_class(self.wire, self.line, self.wire.monotonic)
        self.wire.gap = self.link._gap
        self.tell(self.link)
        self.link.open()

    @staticmethod
    def tell(link: Any) -> None:
        """Tell a link what it has to know of its drives."""

    def read(self, address: Address, unit: int = UNIT) -> Reply:
        reply: Reply = self.link.read(unit, address)
        return reply

    def write(self, address: Address, data: bytes = b'', unit: int = UNIT) -> Reply:
        reply: Reply = self.link.write(unit, address, data or self.VALUE)
        return reply

    def read_then_write(self, source: Address, address: Address) -> Reply:
        reply: Reply = self.link.read_then_write(self.units[0], source, address, self.VALUE)
        return reply

    def expect(
        self, error: type[LinkError] | tuple[type[LinkError], ...], action: Callable[[], object]
    ) -> LinkError:
        with pytest.raises(error) as raised:
            action()
        return raised.value

    @property
    def asked(self) -> list[int]:
        """The parameters of all requests so far."""
        return [request.place for request in self.requests]

    @property
    def requests(self) -> list[Asked]:
        """All requests that arrived."""
        requests: list[Asked] = self.drive.requests
        return requests

    @property
    def sent_at(self) -> list[float]:
        """When each of them was sent."""
        return [at for at, _ in self.wire.sent]

    def answer_of(self, number: int = -1) -> bytes:
        """What the drive answers to the request with this number."""
        number %= len(self.asked)
        request = self.requests[number]
        value: bytes = self.drive.value(request.place, request.size, number)
        return value

    def is_refusal_of(self, refused: Refused, number: int) -> bool:
        """Whether the drive has refused the request with this number so."""
        return self.requests[number].fate.startswith('refuse')

    @staticmethod
    def distinct(fates: Iterable[Fate]) -> Iterator[Fate]:
        """Leave out what this protocol cannot distinguish from what is right."""
        return iter(fates)


class ModbusDrives(FarEnd):
    """
    Drives that speak Modbus RTU.

    :ivar identity: what they say when asked for it: ``says``, ``refuses``, or nothing.
    """

    identity = 'says'

    def value(self, place: int, size: int, number: int) -> bytes:
        count = range(size // 2)
        return packed(*((place * 7 + number * 131 + word * 57) & 0xFFFF for word in count))

    def parsed(self, frame: bytes) -> Asked:
        if frame[1] in (17, 43):
            return Asked(frame[0], frame[1], 0)
        if frame[1] == 23:
            source, count = words_of(frame[2:6])
            return Asked(frame[0], source, 2 * count, frame[11:-2])
        unit, function, place, count, words = opinion.decoded(frame)
        return Asked(unit, place, 2 * count, None if function == 3 else packed(*words))

    def answer(self, asked: Asked, frame: bytes, number: int) -> bytes:
        unit, function = frame[:2]
        if function == 17 and self.identity == 'says':
            return g2_answer(unit)
        if function == 43 and self.identity == 'says':
            # all of it, or one object [M0 §6.2.4]
            wanted = {frame[4]: G2[frame[4]]}
            return device_answer(unit, frame[3], wanted if frame[3] == 4 else G2)
        if not asked.size:
            return opinion.exception(unit, function, 1) if self.identity else b''
        words = words_of(self.value(asked.place, asked.size, number))
        if function == 23:
            return write_and_read_answer(unit, words)
        if asked.written is not None:
            return opinion.write_answer(unit, asked.place, words_of(asked.written))
        return opinion.read_answer(unit, words)

    @staticmethod
    def code(number: int) -> int:
        """With which code the request with this number is refused."""
        return number % 200 + 20

    def refusal(self, asked: Asked, frame: bytes, number: int) -> bytes:
        return opinion.exception(*frame[:2], self.code(number))


class SameWords(ModbusDrives):
    """Say the same whatever they are asked, so that answers cannot be distinguished."""

    def value(self, place: int, size: int, number: int) -> bytes:
        return bytes(size)


class Rtu(Bench):
    """Modbus RTU, behind a line that has sent something twice before."""

    link_class = RtuLink
    far_class = ModbusDrives
    settings = LineSettings(19200, '8E1', 0.1)
    A = register(0x400)
    B = register(0x264)
    #: Two of two words.
    C = register(0x3EC, 2)
    D = register(0x2A8, 2)
    #: Resync reads of one word and of two, as a drive has them.
    ONE = register(0x2A5)
    TWO = register(0x258, 2)
    VALUE = packed(7)
    lost = (A.index, TWO.index, 17, 43, A.index)
    names_it = False
    most = (1, 2)

    def __init__(
        self,
        *fates: Fate,
        settings: LineSettings | None = None,
        resync: tuple[Address, ...] = (ONE, TWO),
        trusted: bool = False,
    ) -> None:
        super().__init__(*fates, settings=settings)
        if not trusted:
            self.link._late.note_unrequested(self.wire.now)
        self.link.use_resync_reads(UNIT, resync)

    @property
    def functions(self) -> list[int]:
        """The functions of all requests so far."""
        return [self.wire.unpack(frame)[1] for _, frame in self.wire.sent]

    def is_refusal_of(self, refused: Refused, number: int) -> bool:
        return refused.code == self.drive.code(number)

    @staticmethod
    def distinct(fates: Iterable[Fate]) -> Iterator[Fate]:
        """Double no answer that comes in a lump late: nothing distinguishes it from the right."""
        for fate in fates:
            twice = fate.what in ('double', 'refuse twice')
            yield Fate(fate.delay, fate.what, fate.lump and not twice, fate.again)


class Ascii(Rtu):
    """Modbus ASCII, of drives that refuse to identify themselves [C57]."""

    link_class = AsciiLink
    wire_class = AsciiWire

    def __init__(self, *fates: Fate, **more: Any) -> None:
        super().__init__(*fates, **more)
        self.drive.identity = 'refuses'


class OldRtu(Rtu):
    """Modbus RTU, of drives that do not even refuse what they do not know."""

    def __init__(self, *fates: Fate, **more: Any) -> None:
        super().__init__(*fates, **more)
        self.drive.identity = ''


class Classic(Bench):
    """Classic; where an answer that comes twice cannot pass for the next it wants no gap."""

    link_class = ClassicLink
    far_class = classic.Drives
    settings = LineSettings(9600, '7E1', 0.1)
    A = classic_id(0x1E)
    B = classic_id(0xB6)
    INV_ST = classic_id(classic.INV_ST)
    MODE = classic_id(0x29)
    VALUE = packed(7)
    lost = (0x1E, classic.INV_ST, 0x29, 0x30, 0x1E)
    most = (3, 5)

    @staticmethod
    def tell(link: Any) -> None:
        tell_as_a_drive_does(link, 'sinus_g2')


def at(index: int, size: int = 4) -> Address:
    """Return the address of a parameter of a MOVITRAC."""
    return Address('index', index, None, size)


class Movitrac(Bench):
    """The protocol of the MOVITRAC, whose drives are waited for 0.2 s longer (P843)."""

    link_class = MovitracLink
    far_class = movitrac.Drives
    settings = LineSettings(9600, '8N1', 0.2)
    A = at(0x19)
    B = at(0x11C)
    LONG = at(0x107, 8)
    VALUE = bytes.fromhex('00000370')
    lost = (0x19, 206, 207, 0x19)
    patience = 2.0

    @staticmethod
    def tell(link: Any) -> None:
        tell_as_a_drive_does(link, 'movitrac31')

    def __init__(self, *fates: Fate, settings: LineSettings | None = None) -> None:
        super().__init__(*fates, settings=settings)
        self.drive.sizes[self.LONG.index] = 8


WAYS = {way.__name__.lower(): way for way in (Rtu, Ascii, Classic, Movitrac)}
#: A test for each protocol.
of_each = pytest.mark.parametrize('way', WAYS.values(), ids=WAYS)
#: For those whose drives are asked for another value where an answer is in doubt.
of_named = pytest.mark.parametrize('way', [Classic, Movitrac])
of_modbus = pytest.mark.parametrize('way', [Rtu, Ascii])
