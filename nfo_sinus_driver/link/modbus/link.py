# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What every Modbus link does: its requests, and the identity of a unit [M0 §6.2.4]."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
import math
import re
from typing import TypeVar

from nfo_sinus_driver.link.interface import (
    Address,
    Ask,
    Identification,
    InProgress,
    LineProtocol,
    LinkError,
    NoAnswer,
    Plan,
    Refused,
    Remarks,
    Reply,
)
from nfo_sinus_driver.link.modbus.pdu import (
    Read,
    Request,
    Write,
    WriteAndRead,
    read_of,
    write_and_read_of,
    write_of,
)
from nfo_sinus_driver.link.thread_clock import ThreadClock

_T = TypeVar('_T')


class ModbusLink(ABC):
    """A Modbus master, whatever carries its requests."""

    protocol: LineProtocol
    remarks: Remarks
    supervision = None
    _patience = math.inf
    clock: ThreadClock

    @cached_property
    def _combines(self) -> dict[int, bool]:
        """Whether a unit writes and reads in one transaction (function 23), if that is known."""
        return {}

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        """Read one parameter (function 03; 04 for input registers, 01 for coils)."""
        return Reply(*self._ask(read_of(unit, address), once))

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter (function 06 for one register, 16 for several, 05 for a coil)."""
        return Reply(*self._ask(write_of(unit, address, data)))

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """
        Write one parameter and read another, in one transaction, or only write it.

        :raises InProgress: the unit refuses to do both: what is to be written by now goes alone.
        """
        combined = self._combines.get(unit, True)
        answer = self._combined(write_and_read_of(unit, address, data, source))
        if answer is not None:
            return Reply(*answer)
        if combined and not self._combines.get(unit, True):
            raise InProgress(self.clock())
        return self.write(unit, address, data)

    def transfer(
        self, unit: int, first: int, count: int, at: int, data: bytes
    ) -> tuple[bytes, float]:
        """
        Read registers of a PLC, in the same transaction as ``data`` is written to others.

        It takes two where the unit refuses that; with no data nothing is written.

        :raises LinkError: as its subclasses say; :attr:`LinkError.maybe_done` once it was written.
        """
        # its program is known: it refuses a function by its name
        self._combines.setdefault(unit, True)
        if data:
            answer = self._combined(WriteAndRead(unit, at, data, first, count))
            if answer is not None:
                return answer
            self._ask(Write(unit, at, data, multiple=True))
        try:
            return self._ask(Read(unit, first, count))
        except LinkError as error:
            error.maybe_done |= bool(data)
            raise

    def _combined(self, request: WriteAndRead) -> tuple[bytes, float] | None:
        """
        Write and read in one transaction; ``None``: nothing was done, each has to go by itself.

        A unit that has never done it may refuse it with any code, or not answer a function that it
        does not know.
        """
        unit = request.unit
        if not self._combines.get(unit, True):
            return None
        try:
            answer = self._write_and_read(request)
        except (NoAnswer, Refused) as error:
            code = error.code if isinstance(error, Refused) else None
            untried = unit not in self._combines and code != Refused.BUSY
            if untried or code == Refused.ILLEGAL_FUNCTION:
                self._combines[unit] = False
            if code is None or self._combines.get(unit, True):
                raise
            return None
        if answer is not None:
            self._combines[unit] = True
        return answer

    def _write_and_read(self, request: WriteAndRead) -> tuple[bytes, float] | None:
        """Return the answer to a request, if it could be believed; else nothing was sent."""
        return self._ask(request)

    def identify(self, unit: int) -> Plan[Identification]:
        """Have a unit identify itself (functions 43/14 and 17): it may be another one."""
        self._combines.pop(unit, None)
        return questions(unit, self._ask)

    @abstractmethod
    def _ask(self, request: Request[_T], once: bool = False) -> tuple[_T, float]:
        """Return the answer to a request, sent ``once`` at most, and when its last byte came."""


REPORT_SLAVE_ID = 17
ENCAPSULATED_INTERFACE = 43
#: The MEI type of Read Device Identification.
_DEVICE_IDENTIFICATION = 14

#: Read device ID codes: the first three objects, all that are standard, one by its number.
BASIC, REGULAR, SPECIFIC = 1, 2, 4

#: The longest message there is.
_LONGEST = 254
#: The offset of the objects in an answer: behind unit, function, MEI type, code, conformity level,
#: more follows, next object and number of objects.
_OBJECTS_AT = 8
_MORE_FOLLOWS = {0x00: False, 0xFF: True}

#: The fields of the objects, by number.
_FIELDS = ('vendor', 'product_code', 'revision', 'url', 'product', 'model', 'application')
_TEXT = re.compile(rb'[ -~]+')


@dataclass(frozen=True)
class DeviceObjects:
    """An answer of function 43/14: contents by number, and the next object, if there is more."""

    objects: tuple[tuple[int, bytes], ...]
    next_object: int | None = None


@dataclass(frozen=True)
class ReadDevice:
    """Read the identification of a unit, from an object on, by one of the three codes above."""

    unit: int
    code: int = REGULAR
    first: int = 0

    function = ENCAPSULATED_INTERFACE
    answer_length = _LONGEST

    @property
    def body(self) -> bytes:
        """The request without unit and function."""
        return bytes((_DEVICE_IDENTIFICATION, self.code, self.first))

    @property
    def answer_head(self) -> bytes:
        """The beginning of the answer, as far as it is known."""
        return bytes((self.unit, self.function, _DEVICE_IDENTIFICATION, self.code))

    def measure(self, beginning: bytes) -> int:
        """Return the least length of an answer that begins like this."""
        at = _OBJECTS_AT
        if len(beginning) >= at:
            for _ in range(beginning[at - 1]):
                # number, length, content; of one that has not come, number and length at least
                at += 2 + (beginning[at + 1] if len(beginning) > at + 1 else 0)
        return at

    def decode(self, message: bytes) -> DeviceObjects | None:
        """Return the content of a whole message; ``None`` if it is no answer after all."""
        more = _MORE_FOLLOWS.get(message[5])
        objects = []
        at = _OBJECTS_AT
        for _ in range(message[at - 1]):
            end = at + 2 + message[at + 1]
            objects.append((message[at], message[at + 2 : end]))
            at = end
        if more is None:
            return None
        if self.code == SPECIFIC and [number for number, _ in objects] != [self.first]:
            return None
        return DeviceObjects(tuple(objects), message[6] if more else None)


@dataclass(frozen=True)
class ReportSlaveId:
    """Read what a unit reports of itself (function 17)."""

    unit: int

    function = REPORT_SLAVE_ID
    answer_length = _LONGEST
    body = b''

    @property
    def answer_head(self) -> bytes:
        """The beginning of the answer, as far as it is known."""
        return bytes((self.unit, self.function))

    def measure(self, beginning: bytes) -> int:
        """Return the least length of an answer that begins like this."""
        return 3 + (beginning[2] if len(beginning) > 2 else 0)

    def decode(self, message: bytes) -> bytes:
        """Return the data, without their count."""
        return message[3:]


def text(data: bytes) -> str:
    """Return the printable ASCII of a text: nothing else may come into a log."""
    return ' '.join(part.decode('ascii').strip() for part in _TEXT.findall(data)).strip()


def revision(data: bytes) -> str:
    """Return a revision such as ``4.30 / 4018``, however it is padded [C45]."""
    parts = (part.strip() for part in text(data).split('/'))
    return ' / '.join(part for part in parts if part)


def serial_number(report: bytes) -> str:
    """
    Return the serial number in the answer of function 17.

    A G2 reports 16 characters and nothing else; the standard has an id, a run indicator (00 or
    FF) and additions of the maker, so the longest text is taken [C94].
    """
    return max((part.strip() for part in _TEXT.findall(report)), key=len, default=b'').decode()


def questions(
    unit: int, ask: Callable[[Request[object]], tuple[object, float]]
) -> Plan[Identification]:
    """
    Have a unit identify itself.

    All objects that fit into one answer are read at once, then the serial number. A question that
    is refused or not answered is never repeated: many devices do not know it [C57].

    :param ask: sends a request; returns its answer and when that came.
    """
    found: dict[str, str] = {}
    answer: object = None

    def question(request: Request[object]) -> Ask:
        def answered() -> Reply:
            nonlocal answer
            answer, arrived = ask(request)
            return Reply(b'', arrived)

        return Ask(answered)

    request: ReadDevice | None = ReadDevice(unit)
    while request is not None and (yield question(request)):
        assert isinstance(answer, DeviceObjects)
        for number, content in answer.objects:
            if number < len(_FIELDS):
                name = _FIELDS[number]
                found[name] = revision(content) if name == 'revision' else text(content)
        # only forward: a unit that always has more must not keep this going
        following, least = answer.next_object or 0, request.first + 1
        forward = following in range(least, len(_FIELDS))
        request = ReadDevice(unit, REGULAR, following) if forward else None
    if (yield question(ReportSlaveId(unit))):
        assert isinstance(answer, bytes)
        found['serial'] = serial_number(answer)
    return Identification(**found)
