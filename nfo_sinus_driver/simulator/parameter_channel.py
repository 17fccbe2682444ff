# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Parameters of a simulated drive by the records of PROFIdrive (base mode parameter access).

A master writes a request, and fetches the response later ([M0 §6.3.4], [M3 §8]): one parameter in
one request, its value as a byte, word or double word. Which there are, by PNU and sub-index, the
family says.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import enum
import functools

from nfo_sinus_driver.catalog import Access, Parameter
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused

_READ, _CHANGE, _FAILED = 0x01, 0x02, 0x80
_VALUE, _ERROR_FORMAT = 0x10, 0x44
_HEADER, _ADDRESS, _FORMAT = 4, 10, 12


class ErrorNumber(enum.IntEnum):
    """Why a drive refuses a request."""

    NO_PARAMETER = 0x00
    NOT_CHANGEABLE = 0x01
    OUT_OF_RANGE = 0x02
    FAULTY_SUB_INDEX = 0x03
    NOT_IN_THIS_STATE = 0x11
    FORMAT = 0x17


_NUMBERS = {
    Reason.FUNCTION: ErrorNumber.NO_PARAMETER,
    Reason.ADDRESS: ErrorNumber.NOT_CHANGEABLE,
    Reason.VALUE: ErrorNumber.OUT_OF_RANGE,
    Reason.STATE: ErrorNumber.NOT_IN_THIS_STATE,
}
#: The formats of unsigned and signed numbers, by their bytes.
_UNSIGNED, _SIGNED = {1: 0x05, 2: 0x06, 4: 0x07}, {1: 0x02, 2: 0x03, 4: 0x04}


@dataclass(frozen=True)
class ParameterEntry:
    """
    One value of a parameter.

    :ivar read: gives it; ``None``: it can only be written.
    :ivar write: takes it, with its sign; ``None``: it can only be read.
    """

    read: Callable[[], int] | None
    write: Callable[[int], None] | None = None
    size: int = 2
    signed: bool = False

    @property
    def format(self) -> int:
        """The format of its value in a record."""
        return (_SIGNED if self.signed else _UNSIGNED)[self.size]


#: By PNU and sub-index.
Entries = Mapping[tuple[int, int], ParameterEntry]


class ParameterChannel:
    """
    What a drive does with requests for parameters.

    :ivar entries: its parameters.
    :ivar written: PNU and sub-index of each that was changed, in this order.
    """

    def __init__(self, entries: Entries) -> None:
        self.entries = entries
        self.written: list[tuple[int, int]] = []
        self._numbers = {number for number, _ in entries}

    def answer(self, record: bytes) -> bytes:
        """Return the response to a request."""
        reference, request, axis = record[:3]
        try:
            data = self._carry_out(record)
        except _Failed as failed:
            error = bytes((_ERROR_FORMAT, 1)) + failed.number.to_bytes(2, 'big')
            return bytes((reference, request | _FAILED, axis, 1)) + error
        return bytes((reference, request, axis, 1)) + data

    def _carry_out(self, record: bytes) -> bytes:
        place = int.from_bytes(record[6:8], 'big'), int.from_bytes(record[8:10], 'big')
        if place not in self.entries:
            known = place[0] in self._numbers
            raise _Failed(ErrorNumber.FAULTY_SUB_INDEX if known else ErrorNumber.NO_PARAMETER)
        entry = self.entries[place]
        if record[3:6] != bytes((1, _VALUE, 1)):
            raise _Failed(ErrorNumber.FORMAT)
        try:
            if record[1] == _CHANGE:
                self._change(entry, record)
                self.written.append(place)
                return b''
            if entry.read is None:
                raise Refused(Reason.FUNCTION, 'it can only be written')
            value = entry.read().to_bytes(entry.size, 'big', signed=entry.signed)
        except Refused as refused:
            raise _Failed(_NUMBERS[refused.reason]) from refused
        return bytes((entry.format, 1)) + value

    @staticmethod
    def _change(entry: ParameterEntry, record: bytes) -> None:
        if entry.write is None:
            raise Refused(Reason.ADDRESS, 'it can only be read')
        if record[_ADDRESS:_FORMAT] != bytes((entry.format, 1)):
            raise _Failed(ErrorNumber.FORMAT)
        data = record[_FORMAT : _FORMAT + entry.size]
        entry.write(int.from_bytes(data, 'big', signed=entry.signed))


class _Failed(Exception):
    """A request is not carried out."""

    def __init__(self, number: ErrorNumber) -> None:
        super().__init__(number.name)
        self.number = number


def entries_of(drive: SimulatedDrive, protocol: str) -> Entries:
    """Return the parameters of a drive as the tables of its family have them for a protocol."""
    found = {}
    for parameter in drive.model.values():
        if protocol in parameter.addresses and drive.has(parameter):
            address = parameter.at(protocol)
            found[address.index, address.sub_index or 0] = _entry(drive, parameter, protocol)
    return found


def read_only(words: Mapping[int, Sequence[int | Callable[[], int]]]) -> Entries:
    """
    Return parameters that can only be read, of each PNU one for each sub-index from 0 on.

    :param words: what each is, or what gives it.
    """
    return {
        (pnu, sub): ParameterEntry(word if callable(word) else functools.partial(int, word))
        for pnu, given in words.items()
        for sub, word in enumerate(given)
    }


def _entry(drive: SimulatedDrive, parameter: Parameter, protocol: str) -> ParameterEntry:
    codec = parameter.at(protocol).number
    read = functools.partial(drive.read_over, protocol, parameter)
    write = functools.partial(drive.write_over, protocol, parameter)
    return ParameterEntry(
        None if parameter.access is Access.WRITE else read,
        write if parameter.is_writable else None,
        codec.size,
        codec.signed,
    )
