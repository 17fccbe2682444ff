# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A server of SDOs, written from CiA 301 without the link's codec."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

NO_OBJECT, NO_SUB_INDEX, WRONG_LENGTH = 0x06020000, 0x06090011, 0x06070010
BAD_COMMAND, BAD_TOGGLE = 0x05040001, 0x05030000


@dataclass
class Server:
    """
    One node.

    :ivar objects: what it has, by index and sub-index.
    :ivar says_size: whether it says how long a value is.
    :ivar expedites: whether short values go in one answer.
    :ivar cut: how many bytes it puts into a segment, the last one aside.
    :ivar refuses: with which abort code it refuses what is asked of an object.
    :ivar constant: what it takes and does not keep.
    """

    objects: dict[tuple[int, int], bytes]
    says_size: bool = True
    expedites: bool = True
    cut: int = 7
    refuses: dict[tuple[int, int], int] = field(default_factory=dict)
    constant: set[tuple[int, int]] = field(default_factory=set)

    def __post_init__(self) -> None:
        self._name = bytes(3)
        self._toggle = 0
        self._to_send: list[bytes] | None = None
        self._coming: bytes | None = None
        self._coming_size = 0
        #: Transfers that the client has ended.
        self.ended: list[int] = []

    def answer(self, request: bytes) -> bytes | None:
        """Return what it says to a message of eight bytes."""
        assert len(request) == 8
        command = request[0] >> 5
        if command == 4:
            self._to_send = self._coming = None
            self.ended.append(int.from_bytes(request[4:], 'little'))
            return None
        if command in (1, 2):
            self._name = request[1:4]
            self._toggle = 0
            self._to_send = self._coming = None
            place = int.from_bytes(request[1:3], 'little'), request[3]
            if place in self.refuses:
                return self._abort(self.refuses[place])
            if place not in self.objects:
                known = any(index == place[0] for index, _ in self.objects)
                return self._abort(NO_SUB_INDEX if known else NO_OBJECT)
            return self._begin(command, place, request)
        if request[0] >> 4 & 1 != self._toggle:
            return self._abort(BAD_TOGGLE)
        if command == 3 and self._to_send is not None:
            return self._send()
        if command == 0 and self._coming is not None:
            return self._take(request)
        return self._abort(BAD_COMMAND)

    def _abort(self, code: int) -> bytes:
        return b'\x80' + self._name + code.to_bytes(4, 'little')

    def _begin(self, command: int, place: tuple[int, int], request: bytes) -> bytes:
        if command == 1:
            expedited, sized = request[0] & 2, request[0] & 1
            unused = request[0] >> 2 & 3
            if expedited:
                return self._store(request[4 : 8 - (unused if sized else 0)])
            self._coming = b''
            self._coming_size = int.from_bytes(request[4:], 'little') if sized else -1
            return b'\x60' + self._name + bytes(4)
        value = self.objects[place]
        if self.expedites and 0 < len(value) <= 4 and (self.says_size or len(value) == 4):
            flags = 0x43 | (4 - len(value)) << 2 if self.says_size else 0x42
            return bytes((flags,)) + self._name + value.ljust(4, b'\x00')
        cut = range(0, len(value), self.cut)
        self._to_send = [value[at : at + self.cut] for at in cut] or [b'']
        size = len(value) if self.says_size else 0
        return bytes((0x40 | self.says_size,)) + self._name + size.to_bytes(4, 'little')

    def _send(self) -> bytes:
        assert self._to_send
        data = self._to_send.pop(0)
        flags = self._toggle << 4 | (7 - len(data)) << 1 | (not self._to_send)
        self._toggle ^= 1
        if not self._to_send:
            self._to_send = None
        return bytes((flags,)) + data.ljust(7, b'\x00')

    def _take(self, request: bytes) -> bytes:
        assert self._coming is not None
        self._coming += request[1 : 8 - (request[0] >> 1 & 7)]
        flags = 0x20 | self._toggle << 4
        self._toggle ^= 1
        if request[0] & 1:
            value, self._coming = self._coming, None
            if self._coming_size not in (-1, len(value)):
                return self._abort(WRONG_LENGTH)
            self._store(value)
        return bytes((flags,)) + bytes(7)

    def _store(self, value: bytes) -> bytes:
        place = int.from_bytes(self._name[:2], 'little'), self._name[2]
        if place not in self.constant:
            self.objects[place] = value
        return b'\x60' + self._name + bytes(4)


def messages(*lines: str) -> Iterator[bytes]:
    """Return messages that are written in hexadecimal digits."""
    return (bytes.fromhex(line) for line in lines)
