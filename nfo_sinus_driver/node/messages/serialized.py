# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Messages in the bytes in which they travel, made at once.

rclpy converts a message field by field, which takes longer than all else that a poll publishes. So
what is published with each poll is packed by a :class:`struct.Struct` that is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import functools
import struct
from typing import Any

from builtin_interfaces.msg import Time

#: Plain CDR in little-endian order, and no options.
_HEAD = b'\x00\x01\x00\x00'
_STRING = 's'
#: What struct calls each type; the length of a string stands before it.
_CODES = {
    'boolean': '?', 'uint8': 'B', 'uint32': 'I', 'float': 'f', 'double': 'd', 'string': _STRING
}
_FLOAT = struct.Struct('<4sf')


def float32(value: float) -> bytes:
    """Return a Float32 (OverflowError: it is too great for one)."""
    return _FLOAT.pack(_HEAD, value)


class Stamped:
    """
    Packs messages of one type: a header, and then numbers, bools and strings.

    :raises TypeError: it has other fields, too.
    """

    def __init__(self, type_: type) -> None:
        kinds = type_.get_fields_and_field_types()
        if kinds.pop('header', '') != 'std_msgs/Header' or not _CODES.keys() >= {*kinds.values()}:
            raise TypeError(f'{type_.__name__} has fields that cannot be packed')
        self._names = tuple(kinds)
        # the time and the name of the frame
        self._codes = 'iI' + _STRING + ''.join(map(_CODES.__getitem__, kinds.values()))
        self._defaults = [getattr(type_(), name) for name in self._names]
        self._struct = functools.lru_cache(64)(self._struct_for)

    def pack(self, stamp: Time, frame_id: str, fields: Mapping[str, Any]) -> bytes:
        """
        Return a message; what is not in ``fields`` has its default.

        :raises OverflowError: a number is too great for its field; or a struct.error.
        """
        values: list[Any] = [_HEAD, stamp.sec, stamp.nanosec]
        lengths = []
        given = map(fields.get, self._names, self._defaults)
        for value in (frame_id, *given):
            if isinstance(value, str):
                value = value.encode()
                values.append(len(value) + 1)
                lengths.append(len(value) + 1)
            values.append(value)
        return self._struct(tuple(lengths)).pack(*values)

    def _struct_for(self, lengths: tuple[int, ...]) -> struct.Struct:
        return struct.Struct('<4s' + ''.join(_aligned(self._codes, iter(lengths))))


def _aligned(codes: str, lengths: Iterator[int]) -> Iterator[str]:
    """Yield what struct needs for each field; a number begins at a multiple of its size."""
    at = 0
    for code in codes:
        number = 'I' if code == _STRING else code
        size = struct.calcsize(number)
        gap = -at % size
        at += gap + size
        yield f'{gap}x{number}'
        if code == _STRING:
            length = next(lengths)
            at += length
            yield f'{length}s'
