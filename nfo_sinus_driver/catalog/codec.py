# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Between the bytes of a bus and a raw number or a text.

A codec is named in a table as ``uint16_be``, ``sint32_ws``, ``uint16_le[4:7]``, ``bcd32`` or
``string16``: a type with its length in bits (of a string: in characters), then how its bytes stand:

- ``be``, ``le``: the high or the low byte first; one byte needs neither. Whole words up to 128
  bits, where a status has several registers.
- ``ws``: 16-bit words, the low word first, the high byte of each first (Modbus, Classic).
- ``hb``: half-bytes, the high one first, each in a byte of its own (MOVITRAC's 8-byte format).

``[low:high]`` are the bits of an unsigned number that count, both included. ``bcd`` has two decimal
digits in each byte, the high ones first; two decimals are a factor of 0.01. In ``sbcd`` the first
digit is a sign, which is only read.
"""

from __future__ import annotations

import abc
from collections.abc import Callable, Mapping, Sequence
import functools
import re
import struct
from typing import Generic, TypeVar

Raw = TypeVar('Raw', int, str)


class Codec(abc.ABC, Generic[Raw]):
    """
    How one value stands in bytes.

    :ivar name: as the tables name it.
    :ivar size: how many bytes it takes.
    """

    def __init__(self, name: str, size: int) -> None:
        self.name = name
        self.size = size

    def decode(self, data: bytes) -> Raw:
        """Return what bytes mean, or a ValueError if there are not just enough, or none such."""
        if len(data) != self.size:
            raise ValueError(f'{self.name} takes {self.size} bytes, not {len(data)}')
        return self._unpack(data)

    def encode(self, raw: Raw) -> bytes:
        """Return the bytes of a value (ValueError: it does not fit)."""
        if not self.fits(raw):
            raise ValueError(f'{raw} does not fit {self.name}')
        return self._pack(raw)

    @abc.abstractmethod
    def fits(self, raw: Raw) -> bool:
        """Return whether a value has bytes."""

    @abc.abstractmethod
    def _unpack(self, data: bytes) -> Raw: ...

    @abc.abstractmethod
    def _pack(self, raw: Raw) -> bytes: ...


class Number(Codec[int]):
    """
    A whole number.

    :ivar minimum: the least that it can be.
    :ivar maximum: the greatest.
    """

    def __init__(self, name: str, size: int, minimum: int, maximum: int) -> None:
        super().__init__(name, size)
        self.minimum = minimum
        self.maximum = maximum

    def fits(self, raw: int) -> bool:
        """Return whether it is within the ends."""
        return self.minimum <= raw <= self.maximum

    @property
    def signed(self) -> bool:
        """It can be negative."""
        return self.minimum < 0


class Integer(Number):
    """A binary number whose bytes stand in some order."""

    def __init__(self, name: str, bits: int, signed: bool, order: str) -> None:
        span = 1 << bits
        low = -span // 2 if signed else 0
        self._spread, self._gather, times = _ORDERS[order]
        self._bytes = bits // 8
        super().__init__(name, self._bytes * times, low, low + span - 1)

    def _unpack(self, data: bytes) -> int:
        return int.from_bytes(self._gather(data), 'big', signed=self.signed)

    def _pack(self, raw: int) -> bytes:
        return self._spread(raw.to_bytes(self._bytes, 'big', signed=self.signed))


class BitField(Number):
    """Some bits of a number; a writer joins them with the others."""

    def __init__(self, name: str, whole: Integer, low: int, high: int) -> None:
        if whole.signed or not low <= high < whole.maximum.bit_length():
            raise ValueError(f'{whole.name} has no bits {low} to {high}')
        super().__init__(name, whole.size, 0, (1 << high - low + 1) - 1)
        self._whole = whole
        self._low = low

    def _unpack(self, data: bytes) -> int:
        return self._whole.decode(data) >> self._low & self.maximum

    def _pack(self, raw: int) -> bytes:
        return self._whole.encode(raw << self._low)


class Bcd(Number):
    """Packed decimal digits, never negative: how a sign would stand is not known [C105]."""

    def __init__(self, name: str, bits: int) -> None:
        super().__init__(name, bits // 8, 0, 10 ** (bits // 4) - 1)

    def _unpack(self, data: bytes) -> int:
        digits = data.hex()
        if not digits.isdecimal():
            raise ValueError(f'{digits} is no {self.name}')
        return int(digits)

    def _pack(self, raw: int) -> bytes:
        return bytes.fromhex(f'{raw:0{2 * self.size}}')


class SignedBcd(Number):
    """
    Packed decimal digits behind a sign: 0 of a positive number, F, 8 or 1 of a negative one.

    Which of the three, the drive shows by the number itself: with no other sign it has so many
    digits. It is not known before there is one, so none is written [C105].
    """

    def __init__(self, name: str, bits: int) -> None:
        self._whole = Bcd(f'bcd{bits}', bits)
        most = 10 ** (bits // 4 - 1) - 1
        super().__init__(name, bits // 8, -most, most)

    def fits(self, raw: int) -> bool:
        """Return whether it is within the ends, and not negative."""
        return 0 <= raw <= self.maximum

    def _unpack(self, data: bytes) -> int:
        sign, digits = data.hex()[0], data.hex()[1:]
        if sign not in _SIGNS or not digits.isdecimal():
            raise ValueError(f'{data.hex()} is no {self.name}')
        return _SIGNS[sign] * int(digits)

    def _pack(self, raw: int) -> bytes:
        return self._whole.encode(raw)


class Text(Codec[str]):
    """ASCII characters, filled up with zeros; blanks at the end do not count."""

    def fits(self, raw: str) -> bool:
        """Return whether it is short enough, and comes back as it was."""
        kept = raw.rstrip(' \0') == raw and '\0' not in raw
        return raw.isascii() and kept and len(raw) <= self.size

    def _unpack(self, data: bytes) -> str:
        text = data.partition(b'\0')[0]
        if not text.isascii():
            raise ValueError(f'{text!r} is no {self.name}')
        return text.decode().rstrip(' ')

    def _pack(self, raw: str) -> bytes:
        return raw.encode().ljust(self.size, b'\0')


@functools.cache
def codec_of(name: str) -> Number | Text:
    """Return the codec that a table names (ValueError: there is none of that name)."""
    if found := _BCD.fullmatch(name):
        bits = int(found['bits'])
        return SignedBcd(name, bits) if found['sign'] else Bcd(name, bits)
    if found := _STRING.fullmatch(name):
        return Text(name, int(found[1]))
    found = _INTEGER.fullmatch(name)
    if found is None or (found['order'] is None) != (found['bits'] == '8'):
        raise ValueError(f'{name!r} is no codec')
    order = found['order'] or 'be'
    whole = Integer(name, int(found['bits']), found['type'] == 'sint', order)
    if found['low'] is None:
        return whole
    return BitField(name, whole, int(found['low']), int(found['high']))


def to_bytes(words: Sequence[int]) -> bytes:
    """Return 16-bit words as they stand on Modbus, the high byte of each first."""
    return struct.pack(f'>{len(words)}H', *words)


def to_words(data: bytes) -> tuple[int, ...]:
    """Return the 16-bit words of bytes as they stand on Modbus."""
    return struct.unpack(f'>{len(data) // 2}H', data)


def _swapped(data: bytes) -> bytes:
    return data[2:] + data[:2]


def _halves(data: bytes) -> bytes:
    return bytes(int(digit, 16) for digit in data.hex())


def _joined(halves: bytes) -> bytes:
    if max(halves) > 0xF:
        raise ValueError(f'{halves.hex(" ")} are no half-bytes')
    return bytes(high << 4 | low for high, low in zip(halves[::2], halves[1::2], strict=True))


_Order = Callable[[bytes], bytes]
#: How the bytes of a number, the high one first, are put on the bus, how they are taken from it,
#: and how many come of one.
_ORDERS: Mapping[str, tuple[_Order, _Order, int]] = {
    'be': (bytes, bytes, 1),
    'le': (lambda data: data[::-1], lambda data: data[::-1], 1),
    'ws': (_swapped, _swapped, 1),
    'hb': (_halves, _joined, 2),
}
_INTEGER = re.compile(
    r'(?P<type>[us]int)(?P<bits>8|16|32|48|64|80|96|112|128)(_(?P<order>be|le|(?<=32_)ws|hb))?'
    r'(\[(?P<low>\d+):(?P<high>\d+)\])?'
)
_BCD = re.compile(r'(?P<sign>s)?bcd(?P<bits>8|16|32)')
#: What the first digit of a signed number says.
_SIGNS = {'0': 1, 'f': -1, '8': -1, '1': -1}
_STRING = re.compile(r'string([1-9]\d*)')
