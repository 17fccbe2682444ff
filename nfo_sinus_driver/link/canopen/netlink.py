# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What Linux tells of a CAN interface by netlink alone (linux/rtnetlink.h, linux/can/netlink.h)."""

from __future__ import annotations

from collections.abc import Iterator
import socket
import struct

#: Length, type, flags, number and sender of a message; the request for one interface by its index.
_HEADER = struct.Struct('=IHHII')
_INTERFACE = struct.Struct('=BxHiII')
#: Length and type of an attribute.
_ATTRIBUTE = struct.Struct('=HH')
_NETLINK_ROUTE = 0
_RTM_NEWLINK, _RTM_GETLINK = 16, 18
_NLM_F_REQUEST = 1
#: Of an interface, of what kind it is, and of a CAN interface; the last one is a number of ms.
_IFLA_LINKINFO, _IFLA_INFO_KIND, _IFLA_INFO_DATA, _IFLA_CAN_RESTART_MS = 18, 1, 2, 6
#: The bits of a type that are no flags.
_TYPE = 0x3FFF
_CAN = b'can\0'
#: How long an answer is waited for, s: the kernel gives it at once.
_PATIENCE = 1.0


def restart_ms(name: str) -> int | None:
    """
    Return after how long a CAN interface leaves bus-off by itself, ms; 0: it never does.

    No privilege is needed for it. ``None``: that is not told, as of a virtual interface.
    """
    try:
        index = socket.if_nametoindex(name)
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, _NETLINK_ROUTE) as kernel:
            kernel.settimeout(_PATIENCE)
            kernel.send(_request(index))
            return _restart_ms(kernel.recv(65536))
    except OSError:
        return None


def _request(index: int) -> bytes:
    length = _HEADER.size + _INTERFACE.size
    header = _HEADER.pack(length, _RTM_GETLINK, _NLM_F_REQUEST, 1, 0)
    return header + _INTERFACE.pack(socket.AF_UNSPEC, 0, index, 0, 0)


def _restart_ms(answer: bytes) -> int | None:
    """Return what an answer says of it."""
    if len(answer) < _HEADER.size or _HEADER.unpack_from(answer)[1] != _RTM_NEWLINK:
        return None
    interface = dict(_attributes(answer[_HEADER.size + _INTERFACE.size :]))
    kind = dict(_attributes(interface.get(_IFLA_LINKINFO, b'')))
    if kind.get(_IFLA_INFO_KIND) != _CAN:
        return None
    data = dict(_attributes(kind.get(_IFLA_INFO_DATA, b''))).get(_IFLA_CAN_RESTART_MS, b'')
    # in the order of the computer, as all of it
    return struct.unpack('=I', data)[0] if len(data) == 4 else None


def _attributes(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield types and contents; each attribute begins at a multiple of four bytes."""
    while len(data) >= _ATTRIBUTE.size:
        length, kind = _ATTRIBUTE.unpack_from(data)
        if not _ATTRIBUTE.size <= length <= len(data):
            return
        yield kind & _TYPE, data[_ATTRIBUTE.size : length]
        data = data[(length + 3) & ~3 :]
