# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the kernel tells of a CAN interface; the request itself goes to the real kernel."""

from __future__ import annotations

import socket
import struct

import pytest

from nfo_sinus_driver.link.canopen import netlink
from nfo_sinus_driver.link.canopen.netlink import restart_ms


def attribute(kind: int, data: bytes) -> bytes:
    """Return a struct rtattr and its data as linux/rtnetlink.h has them."""
    length = 4 + len(data)
    return struct.pack('=HH', length, kind) + data + bytes(-length % 4)


def answer(kind: bytes = b'can\0', restart: bytes = struct.pack('=I', 250)) -> bytes:
    """Return what the kernel answers of an interface of a kind."""
    state, bit_timing = attribute(4, struct.pack('=I', 3)), attribute(1, bytes(32))
    # nested ones have a flag in some kernels
    about = attribute(1, kind) + attribute(0x8000 | 2, bit_timing + state + attribute(6, restart))
    body = bytes(16) + attribute(3, b'can0\0') + attribute(0x8000 | 18, about)
    return struct.pack('=IHHII', 16 + len(body), 16, 0, 1, 0) + body


class Kernel:
    """The socket of netlink, with one answer."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self.asked = b''

    def __enter__(self) -> Kernel:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def settimeout(self, seconds: float) -> None:
        assert seconds > 0

    def send(self, data: bytes) -> None:
        self.asked = data

    def recv(self, size: int) -> bytes:
        return self._data[:size]


def told(data: bytes, monkeypatch: pytest.MonkeyPatch) -> tuple[int | None, bytes]:
    """Return what is found in an answer, and what was asked."""
    kernel = Kernel(data)
    monkeypatch.setattr(netlink.socket, 'socket', lambda *_: kernel)
    monkeypatch.setattr(netlink.socket, 'if_nametoindex', lambda name: 7)
    return restart_ms('can0'), kernel.asked


@pytest.mark.parametrize('milliseconds', [0, 100, 250])
def test_the_time_of_a_can_interface(milliseconds: int, monkeypatch: pytest.MonkeyPatch) -> None:
    found, asked = told(answer(restart=struct.pack('=I', milliseconds)), monkeypatch)
    assert found == milliseconds
    # struct nlmsghdr and struct ifinfomsg: RTM_GETLINK of interface 7
    expected = struct.pack('=IHHII', 32, 18, 1, 1, 0) + struct.pack('=BBHiII', 0, 0, 0, 7, 0, 0)
    assert asked == expected


@pytest.mark.parametrize(
    'data',
    [
        b'',
        answer(kind=b'vcan\0'),
        answer(restart=b''),
        answer()[:40],
        # an error
        struct.pack('=IHHII', 36, 2, 0, 1, 0) + bytes(20),
        # lengths that cannot be
        answer()[:32] + struct.pack('=HH', 2, 18),
        answer()[:32] + struct.pack('=HH', 500, 18),
    ],
)
def test_what_does_not_tell_it(data: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    assert told(data, monkeypatch)[0] is None


def test_the_real_kernel_answers() -> None:
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as kernel:
        kernel.settimeout(10.0)
        kernel.send(netlink._request(socket.if_nametoindex('lo')))
        data = kernel.recv(65536)
    assert struct.unpack_from('=IH', data) == (len(data), 16)
    assert dict(netlink._attributes(data[32:]))[3] == b'lo\0'
    assert restart_ms('lo') is None and restart_ms('not there') is None
