# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Frames of a CAN bus, what carries them, and a CAN interface of Linux (SocketCAN)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import errno
from pathlib import Path
import select
import socket
import struct
import time
from typing import NamedTuple, Protocol

from nfo_sinus_driver.link.interface import PortError
from nfo_sinus_driver.link.place import place_of_interface

#: The most bytes that a frame carries.
MOST_DATA = 8
#: The identifiers of standard frames; CANopen has no others.
IDENTIFIERS = range(0x800)
#: The bits of an identifier that are compared where only its function code counts.
FUNCTION_CODE = 0x780


class Frame(NamedTuple):
    """
    A standard frame.

    :ivar identifier: which of :data:`IDENTIFIERS`; the least has precedence.
    :ivar remote: it has no data, but requests some of the same length; only ever sent.
    """

    identifier: int
    data: bytes
    remote: bool = False


#: The message when frames do not leave.
CANNOT_SEND = 'frames do not leave: is any other node on the bus, with this bit rate?'


class CanPort(Protocol):
    """What carries frames."""

    @property
    def place(self) -> str:
        """Where it is; see :attr:`.interface.Link.place`."""

    @property
    def trouble(self) -> str:
        """What keeps frames off the bus, as far as it knows; ``''``: nothing."""

    def open(self) -> None:
        """
        Open it; where it is open, close it before, and discard what has not left.

        :raises PortError: it is absent, not permitted, in use, or unable to do the settings.
        """

    def close(self) -> None:
        """Close it; harmless when it is closed already."""

    def send(self, frame: Frame) -> None:
        """
        Hand a frame over; :attr:`trouble` says where it could not leave.

        :raises PortError: it is gone.
        """

    def receive(self, until: float) -> Sequence[Frame]:
        """
        Return what has come; wait for the first frame until a moment of the clock, s.

        :returns: none when the time is over, or when what came was no whole frame.
        :raises PortError: it is gone.
        """


#: struct can_frame and struct can_filter (linux/can.h).
_FRAME = struct.Struct('=IB3x8s')
#: How many frames are taken at once: on a full bus more keep coming.
_MOST_AT_ONCE = 1000
_FILTER = struct.Struct('=II')
#: Extended, remote and error frames: in the identifier.
_OTHER_FRAMES = 0xE000_0000
#: The second of them alone.
_REMOTE = 0x4000_0000
#: The type of a network interface that is a CAN bus (linux/if_arp.h).
_IS_CAN = '280'
_INTERFACES = Path('/sys/class/net')
#: What Linux shows of an interface in bus-off; one with ``restart-ms`` leaves it by itself.
_NO_CARRIER = '0'


class SocketCan:
    """
    One CAN interface.

    :param name: of the interface, such as ``can0``.
    :param filters: identifiers, and by which of their bits frames are let in.
    """

    def __init__(self, name: str, filters: Iterable[tuple[int, int]]) -> None:
        self._name = name
        self._filters = b''.join(
            _FILTER.pack(identifier, mask | _OTHER_FRAMES) for identifier, mask in filters
        )
        self._socket: socket.socket | None = None
        self.place = ''
        #: The queue is full, for no node acknowledges.
        self._is_full = False

    def open(self) -> None:
        """
        Open the interface; one that is open is closed before.

        :raises PortError: there is no such interface, or the kernel has no CAN.
        """
        self.close()
        try:
            bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        except OSError as error:
            raise PortError(f'this kernel has no SocketCAN ({error.strerror})') from error
        try:
            bus.setblocking(False)
            bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, self._filters)
            bus.bind((self._name,))
        except OSError as error:
            bus.close()
            raise self._lost(error) from error
        self._socket = bus
        self._is_full = False
        self.place = place_of_interface(self._name)

    @property
    def trouble(self) -> str:
        """What keeps frames off the bus; ``''``: nothing that is known."""
        name = self._name
        try:
            # a frame that is sent then is dropped, and no error says so
            carrier = (_INTERFACES / name / 'carrier').read_text('ascii')
        except OSError:
            # it is down or gone, which sending reports
            carrier = ''
        if carrier.strip() == _NO_CARRIER:
            return (
                f'{name} is in bus-off after too many errors: check wires, terminators and bit '
                f'rate; where it does not restart by itself, sudo ip link set {name} down, then '
                f'sudo ip link set {name} up type can restart-ms 100'
            )
        return CANNOT_SEND if self._is_full else ''

    def close(self) -> None:
        """Close it; harmless when it is closed already."""
        bus, self._socket = self._socket, None
        if bus is not None:
            bus.close()

    def send(self, frame: Frame) -> None:
        """
        Hand a frame over.

        :raises PortError: the interface is gone or down.
        """
        data = frame.data.ljust(MOST_DATA, b'\0')
        try:
            flags = _REMOTE if frame.remote else 0
            self._bus.send(_FRAME.pack(frame.identifier | flags, len(frame.data), data))
        except OSError as error:
            if error.errno not in (errno.ENOBUFS, errno.EAGAIN):
                raise self._lost(error) from error
            self._is_full = True

    def receive(self, until: float) -> Sequence[Frame]:
        """
        Return what has come; wait for the first frame until a moment of ``time.monotonic``, s.

        :raises PortError: the interface is gone or down.
        """
        bus = self._bus
        found: list[Frame] = []
        try:
            if not select.select((bus,), (), (), max(0.0, until - time.monotonic()))[0]:
                return found
            while len(found) < _MOST_AT_ONCE:
                identifier, length, data = _FRAME.unpack(bus.recv(_FRAME.size))
                if identifier in IDENTIFIERS and length <= MOST_DATA:
                    found.append(Frame(identifier, data[:length]))
                    self._is_full = False
        except BlockingIOError:
            pass
        except OSError as error:
            raise self._lost(error) from error
        return found

    @property
    def _bus(self) -> socket.socket:
        if self._socket is None:
            raise PortError(f'{self._name} is not open')
        return self._socket

    def _lost(self, error: OSError) -> PortError:
        name = self._name
        if error.errno == errno.ENODEV:
            there = ', '.join(interfaces()) or 'none'
            return PortError(f'there is no CAN interface {name}: is the adapter plugged in? '
                             f'Interfaces there are: {there}')
        if error.errno == errno.ENETDOWN:
            return PortError(
                f'{name} is down: sudo ip link set {name} up type can bitrate 125000 '
                'restart-ms 100, with the bit rate of the drives'
            )
        return PortError(f'{name} was lost ({error.strerror})')


def interfaces() -> Sequence[str]:
    """Return the names of all CAN interfaces."""
    types = sorted(_INTERFACES.glob('*/type'))
    return [path.parent.name for path in types if path.read_text('ascii').strip() == _IS_CAN]
