# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""A CAN interface of the kernel (SocketCAN): its frames come and go as structures of 16 bytes."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import re
import socket
import struct

from nfo_sinus_driver.simulator.can_frames import MOST_DATA, Frame
from nfo_sinus_driver.simulator.ports import PortError

#: Identifier with its flags, length, padding, data.
_STRUCT = struct.Struct('=IB3x8s')
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000
_STANDARD_BITS, _EXTENDED_BITS = 0x7FF, 0x1FFF_FFFF
#: The name of a network interface, which no path has.
_INTERFACE = re.compile(r'[^/:\s]+')
#: How many frames are taken at a time.
_MOST = 64


def is_interface(link: str | None) -> bool:
    """Tell whether a link names a network interface, such as ``can0``, and no path."""
    return link is not None and _INTERFACE.fullmatch(link) is not None


class CanPort:
    """
    A CAN interface; what the simulated nodes send goes out there.

    :param name: of the interface.
    :raises PortError: there is none, or the kernel has no CAN.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._socket: socket.socket | None = None
        self.come_back()

    def filenos(self) -> list[int]:
        """The descriptors to wait on for reading."""
        return [self._socket.fileno()] if self._socket is not None else []

    def receive(self) -> bytes:
        """Return the frames that have come, one structure after the other."""
        found = b''
        for _ in range(_MOST):
            if self._socket is None:
                break
            try:
                data = self._socket.recv(_STRUCT.size)
            except OSError:
                # nothing more, or the interface is down
                break
            # what is no structure would put those behind it out of step
            found += data if len(data) == _STRUCT.size else b''
        return found

    def send(self, data: bytes) -> None:
        """Send frames; what the interface does not take is lost."""
        for at in range(0, len(data), _STRUCT.size):
            with contextlib.suppress(OSError):
                if self._socket is not None:
                    self._socket.send(data[at : at + _STRUCT.size])

    def hang_up(self) -> None:
        """Be there no more; the interface itself stays."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def come_back(self) -> None:
        """Be there again."""
        if self._socket is not None:
            return
        if not hasattr(socket, 'AF_CAN'):
            raise PortError('this Python has no SocketCAN: serve a pseudo-terminal, --link PATH')
        try:
            opened = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        except OSError as error:
            raise PortError(
                f'this kernel has no SocketCAN ({error.strerror}): '
                'serve a pseudo-terminal, --link PATH'
            ) from error
        try:
            opened.bind((self.name,))
            opened.setblocking(False)
        except OSError as error:
            opened.close()
            raise PortError(
                f'cannot use the CAN interface {self.name} ({error.strerror}): see "ip link"; '
                'a pseudo-terminal has a / in its --link'
            ) from error
        self._socket = opened

    def close(self) -> None:
        """Close it."""
        self.hang_up()


class CanInterface:
    """The adapter behind such a port: always on the bus, with the bit rate that it was given."""

    is_serial = False

    def restart(self) -> None:
        """Nothing is kept."""

    @staticmethod
    def take(data: bytes) -> Iterator[bytes | Frame]:
        """Give the frames that came in."""
        for at in range(0, len(data) - _STRUCT.size + 1, _STRUCT.size):
            identifier, length, value = _STRUCT.unpack_from(data, at)
            if identifier & _ERROR or length > MOST_DATA:
                continue
            extended = bool(identifier & _EXTENDED)
            bits = _EXTENDED_BITS if extended else _STANDARD_BITS
            remote = bool(identifier & _REMOTE)
            yield Frame(identifier & bits, value[:length], remote, extended)

    @staticmethod
    def tried(frame: Frame, *, sent: bool) -> bytes:
        """Nothing is answered: the frame is on the bus already."""
        return b''

    @staticmethod
    def on_bus(rate: int) -> bool:
        """Always."""
        return True

    @staticmethod
    def told(frame: Frame, now: float) -> bytes:
        """Return the structure of a frame."""
        flags = (_EXTENDED if frame.extended else 0) | (_REMOTE if frame.remote else 0)
        return _STRUCT.pack(frame.identifier | flags, len(frame.data), frame.data)
