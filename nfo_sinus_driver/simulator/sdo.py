# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
Service data objects of CANopen, the side of the server, without I/O (CiA 301 §7.2.4).

One server has one transfer at a time: up to four bytes go in one exchange, more in segments of
seven. Block transfer is not supported.
"""

from __future__ import annotations

from dataclasses import dataclass
import enum
import struct
from typing import Protocol

_LENGTH = 8
_HEAD = struct.Struct('<BHB')
_SIZE = struct.Struct('<I')
_EXPEDITED, _SEGMENT = 4, 7
#: Bits of the first byte.
_IS_EXPEDITED, _HAS_SIZE, _TOGGLE, _LAST = 0x02, 0x01, 0x10, 0x01


class AbortCode(enum.IntEnum):
    """Why a transfer ends."""

    TOGGLE = 0x0503_0000
    COMMAND = 0x0504_0001
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUB_INDEX = 0x0609_0011
    VALUE = 0x0609_0030
    STATE = 0x0800_0022


class Abort(Exception):
    """The server ends a transfer; the code goes over the line."""

    def __init__(self, code: AbortCode) -> None:
        super().__init__(code.name)
        self.code = code


class Objects(Protocol):
    """What can be read and written."""

    def read(self, index: int, sub_index: int) -> bytes:
        """Return the value of an object (Abort: it cannot be read)."""

    def validate(self, index: int, sub_index: int, size: int | None) -> int:
        """
        Look whether an object may be written.

        :param size: with how many bytes; ``None``: the client does not say.
        :returns: how many it takes.
        :raises Abort: it may not be.
        """

    def write(self, index: int, sub_index: int, data: bytes) -> None:
        """Write an object (Abort: it cannot be written)."""


@dataclass
class _Upload:
    """A value of which the client fetches segments."""

    left: bytes
    toggle: int = 0


@dataclass
class _Download:
    """A value of which segments are to come, and how many bytes it has to have."""

    size: int
    data: bytes = b''
    toggle: int = 0


class Server:
    """The server of one client."""

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        #: The object of the last transfer, which an abort names.
        self._place = (0, 0)
        self._transfer: _Upload | _Download | None = None

    def reset(self) -> None:
        """Forget the transfer that was going on."""
        self._place = (0, 0)
        self._transfer = None

    def answer(self, request: bytes) -> bytes:
        """Return the answer to a message; empty: there is none."""
        if len(request) != _LENGTH:
            return b''
        command = request[0] >> 5
        if command == 4:
            self._transfer = None
            return b''
        try:
            if command in (1, 2):
                _, index, sub_index = _HEAD.unpack_from(request)
                self._place = index, sub_index
                self._transfer = None
                return self._download(request) if command == 1 else self._upload()
            if command == 0:
                return self._take_segment(request)
            if command == 3:
                return self._give_segment(request)
            raise Abort(AbortCode.COMMAND)
        except Abort as abort:
            self._transfer = None
            return self._named(0x80, _SIZE.pack(abort.code))

    def _upload(self) -> bytes:
        value = self._objects.read(*self._place)
        if 0 < len(value) <= _EXPEDITED:
            unused = _EXPEDITED - len(value)
            return self._named(0x40 | unused << 2 | _IS_EXPEDITED | _HAS_SIZE, value)
        self._transfer = _Upload(value)
        return self._named(0x40 | _HAS_SIZE, _SIZE.pack(len(value)))

    def _give_segment(self, request: bytes) -> bytes:
        upload = self._transfer
        if not isinstance(upload, _Upload):
            raise Abort(AbortCode.COMMAND)
        if request[0] & _TOGGLE != upload.toggle:
            raise Abort(AbortCode.TOGGLE)
        data, upload.left = upload.left[:_SEGMENT], upload.left[_SEGMENT:]
        last = 0 if upload.left else _LAST
        head = upload.toggle | _SEGMENT - len(data) << 1 | last
        upload.toggle ^= _TOGGLE
        if last:
            self._transfer = None
        return (bytes((head,)) + data).ljust(_LENGTH, b'\0')

    def _download(self, request: bytes) -> bytes:
        flags = request[0]
        if flags & _IS_EXPEDITED:
            size_said = _EXPEDITED - (flags >> 2 & 3) if flags & _HAS_SIZE else None
            size = self._objects.validate(*self._place, size_said)
            if size > _EXPEDITED:
                raise Abort(AbortCode.TOO_SHORT)
            self._objects.write(*self._place, request[4 : 4 + size])
        else:
            size_said = _SIZE.unpack_from(request, 4)[0] if flags & _HAS_SIZE else None
            self._transfer = _Download(self._objects.validate(*self._place, size_said))
        return self._named(0x60, b'')

    def _take_segment(self, request: bytes) -> bytes:
        download = self._transfer
        if not isinstance(download, _Download):
            raise Abort(AbortCode.COMMAND)
        if request[0] & _TOGGLE != download.toggle:
            raise Abort(AbortCode.TOGGLE)
        download.data += request[1 : _LENGTH - (request[0] >> 1 & 7)]
        if len(download.data) > download.size:
            raise Abort(AbortCode.TOO_LONG)
        if request[0] & _LAST:
            self._transfer = None
            if len(download.data) < download.size:
                raise Abort(AbortCode.TOO_SHORT)
            self._objects.write(*self._place, download.data)
        answer = bytes((0x20 | download.toggle,)).ljust(_LENGTH, b'\0')
        download.toggle ^= _TOGGLE
        return answer

    def _named(self, command: int, data: bytes) -> bytes:
        """Return a message that names the object."""
        return (_HEAD.pack(command, *self._place) + data).ljust(_LENGTH, b'\0')
