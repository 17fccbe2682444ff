# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Frames of a CAN bus, what carries them, and a CAN interface of Linux (SocketCAN)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import contextlib
import errno
from pathlib import Path
import select
import socket
import struct
import time
from typing import NamedTuple, Protocol

from nfo_sinus_driver.link.canopen.netlink import restart_ms
from nfo_sinus_driver.link.interface import PortError
from nfo_sinus_driver.link.ports.place import place_of_interface
from nfo_sinus_driver.link.ports.trace import Trace

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
        """Where it is; see :attr:`~..interface.Link.place`."""

    @property
    def trouble(self) -> str:
        """What keeps frames off the bus, as far as it knows; ``''``: nothing."""

    @property
    def remark(self) -> str:
        """What is to be set otherwise, although it works; ``''``: nothing."""

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


class TracedCan:
    """A port whose frames are traced, each as its identifier in two bytes, then its data."""

    def __init__(self, port: CanPort, trace: Trace) -> None:
        self._port = port
        self._trace = trace

    @property
    def place(self) -> str:
        """Where it is."""
        return self._port.place

    @property
    def trouble(self) -> str:
        """What keeps frames off the bus."""
        return self._port.trouble

    @property
    def remark(self) -> str:
        """What is to be set otherwise."""
        return self._port.remark

    def open(self) -> None:
        """Open it."""
        self._port.open()

    def close(self) -> None:
        """Close it."""
        self._trace.flush()
        self._port.close()

    def send(self, frame: Frame) -> None:
        """Hand a frame over."""
        self._trace.sent(_traced(frame))
        self._port.send(frame)

    def receive(self, until: float) -> Sequence[Frame]:
        """Return what has come; each frame is an answer of its own."""
        frames = self._port.receive(until)
        for frame in frames:
            self._trace.came(_traced(frame))
            self._trace.flush()
        return frames


def _traced(frame: Frame) -> bytes:
    return frame.identifier.to_bytes(2, 'big') + frame.data


#: struct can_frame and struct can_filter (linux/can.h).
_FRAME = struct.Struct('=IB3x8s')
#: How many frames are taken at once: on a full bus more keep coming.
_MOST_AT_ONCE = 1000
_FILTER = struct.Struct('=II')
#: Extended and remote frames: in the identifier. In a filter the bit of error frames lets in these,
#: and nothing else.
_OTHER_FRAMES = 0xC000_0000
#: The second of them alone.
_REMOTE = 0x4000_0000
#: What a client of CANopen sends and none has to answer: commands to nodes, and requests for their
#: state (CiA 301 §7.2.8).
_COMMANDS = (0x000, 0x7FF)
_STATE_REQUESTS = (_REMOTE | 0x700, FUNCTION_CODE)
_ON = struct.pack('=i', 1)
#: A frame leaves within this time, s, on a bus that is not full and where any node listens.
_LEAVES_IN = 0.1
#: For how long one waits for that of the one before, s: it is of no use later.
_WAITS_FOR = 0.2
#: How often it is looked meanwhile whether the bus is back, s.
_LOOK_PERIOD = 0.02
#: After how long one that was not returned counts as lost where the interface is opened again
#: because no node answers, s: an adapter may forget to return one, and a stop must not wait for it.
_LOST_AFTER = 10.0
#: The type of a network interface that is a CAN bus (linux/if_arp.h).
_IS_CAN = '280'
_INTERFACES = Path('/sys/class/net')
#: What Linux shows of an interface in bus-off, and of one that works.
_NO_CARRIER, _CARRIER = '0', '1'


class _Queued(NamedTuple):
    """A frame that the interface has, since when, s, and by which socket."""

    raw: bytes
    since: float
    sender: socket.socket


class SocketCan:
    """
    One CAN interface.

    Opening the socket of an interface does not end bus-off, and closing it does not empty the queue
    of the interface: what stands there leaves when the bus is back, a set-point seconds old, too.
    So one frame at most is handed over. Linux returns it when it has left, and then the next one
    is; what waits for that too long never leaves. One that is not returned has left or is lost
    where others have come since, or where the interface was in bus-off meanwhile. A driver of Linux
    that returns none, though nodes answer, is not waited for.

    :param name: of the interface, such as ``can0``.
    :param filters: identifiers, and by which of their bits frames are let in.
    """

    def __init__(self, name: str, filters: Iterable[tuple[int, int]]) -> None:
        self._name = name
        self._wanted = tuple(filters)
        # what this end sends has to be let in, too
        self._filters = b''.join(
            _FILTER.pack(identifier, mask | _OTHER_FRAMES)
            for identifier, mask in (*self._wanted, _COMMANDS, _STATE_REQUESTS)
        )
        self._socket: socket.socket | None = None
        self.place = ''
        #: The queue of the interface is full.
        self._is_full = False
        #: The frame of ours that the interface has; it outlasts the socket.
        self._queued: _Queued | None = None
        #: The driver of the interface returns what has left.
        self._returns = True
        #: Those that wait for it, and until when, s.
        self._waiting: dict[bytes, float] = {}
        #: What has come and was not taken yet.
        self._come: list[Frame] = []
        #: How often the interface had gone into bus-off, or out of it, when that was read last.
        self._changes = ''
        #: After how long it leaves bus-off by itself, ms; ``None``: not known.
        self._restart_ms: int | None = None

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
            bus.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_RECV_OWN_MSGS, _ON)
            bus.bind((self._name,))
        except OSError as error:
            bus.close()
            raise self._lost(error) from error
        self._socket = bus
        self._is_full = False
        if self._queued_for >= _LOST_AFTER and self._read('carrier') != _NO_CARRIER:
            self._queued = None
        if self._queued is None:
            self._changes = self._read('carrier_changes')
        self._restart_ms = restart_ms(self._name)
        self.place = place_of_interface(self._name)

    @property
    def trouble(self) -> str:
        """What keeps frames off the bus; ``''``: nothing that is known."""
        # a frame that is sent then is dropped, and no error says so. It may be down or gone, too,
        # which sending reports
        if self._read('carrier') == _NO_CARRIER:
            text = f'{self._name} is in bus-off after too many errors: check wires, terminators '
            if self._restart_ms:
                return f'{text}and bit rate; it restarts by itself every {self._restart_ms} ms'
            return f'{text}and bit rate; {self._restart}'
        return CANNOT_SEND if self._is_full or self._queued_for >= _LEAVES_IN else ''

    @property
    def remark(self) -> str:
        """What is to be set otherwise; ``''``: nothing."""
        if self._restart_ms != 0:
            return ''
        return (
            f'{self._name} stays in bus-off for good after too many errors, as by a short circuit '
            f'of the wires, and no motor can be stopped then: {self._restart}'
        )

    @property
    def _restart(self) -> str:
        """What to do so that it leaves bus-off."""
        name = self._name
        unless = '' if self._restart_ms == 0 else 'where it does not restart by itself, '
        return (
            f'{unless}sudo ip link set {name} down, then sudo ip link set {name} up type can '
            'restart-ms 100'
        )

    def close(self) -> None:
        """Close it; harmless when it is closed already."""
        bus, self._socket = self._socket, None
        if bus is not None:
            bus.close()
        self._waiting.clear()
        self._come.clear()

    def send(self, frame: Frame) -> None:
        """
        Hand a frame over, or have it wait for the one before.

        :raises PortError: the interface is gone or down.
        """
        data = frame.data.ljust(MOST_DATA, b'\0')
        flags = _REMOTE if frame.remote else 0
        raw = _FRAME.pack(frame.identifier | flags, len(frame.data), data)
        # once, however often it is due meanwhile
        self._waiting[raw] = time.monotonic() + _WAITS_FOR
        self._take_in()

    def receive(self, until: float) -> Sequence[Frame]:
        """
        Return what has come; wait for the first frame until a moment of ``time.monotonic``, s.

        :raises PortError: the interface is gone or down.
        """
        self._take_in()
        while not self._come and (left := until - time.monotonic()) > 0:
            wait = min(left, _LOOK_PERIOD) if self._waiting else left
            select.select((self._bus,), (), (), wait)
            self._take_in()
        found, self._come = self._come, []
        return found

    def _take_in(self) -> None:
        """Take what is there without waiting for it, and hand over what may leave now."""
        bus = self._bus
        try:
            for _ in range(_MOST_AT_ONCE):
                raw, _, flags, _ = bus.recvmsg(_FRAME.size)
                self._take(raw, flags)
        except BlockingIOError:
            pass
        except OSError as error:
            raise self._lost(error) from error
        self._go_on()

    def _take(self, raw: bytes, flags: int) -> None:
        """Take a frame: of others, or one of ours that has left."""
        queued = self._queued
        self._is_full = False
        is_ours = bool(flags & socket.MSG_CONFIRM)
        if queued is not None and raw == queued.raw:
            # of a socket that was closed meanwhile nothing is said
            is_ours = is_ours or queued.sender is not self._socket
            self._queued = None if is_ours else queued
        if is_ours:
            self._returns = True
            return
        identifier, length, data = _FRAME.unpack(raw)
        if queued is not None and _node(raw) == _node(queued.raw):
            # an answer to it
            self._returns = False
        if self._queued_for >= _LEAVES_IN:
            # the bus works, so it has left, or never will
            self._queued = None
        is_wanted = any((identifier ^ wanted) & mask == 0 for wanted, mask in self._wanted)
        if identifier in IDENTIFIERS and length <= MOST_DATA and is_wanted:
            self._come.append(Frame(identifier, data[:length]))

    def _go_on(self) -> None:
        """Hand over what waits, as far as nothing of ours is in the queue of the interface."""
        now = time.monotonic()
        self._waiting = {raw: until for raw, until in self._waiting.items() if until >= now}
        while self._waiting and self._is_free:
            raw = next(iter(self._waiting))
            del self._waiting[raw]
            self._queued = None
            try:
                self._bus.send(raw)
            except OSError as error:
                if error.errno not in (errno.ENOBUFS, errno.EAGAIN):
                    raise self._lost(error) from error
                self._is_full = True
            else:
                self._queued = _Queued(raw, now, self._bus)

    @property
    def _queued_for(self) -> float:
        """For how long the interface has had a frame of ours, s; 0: it has none."""
        return 0.0 if self._queued is None else time.monotonic() - self._queued.since

    @property
    def _is_free(self) -> bool:
        """The queue of the interface has nothing of ours, as far as that can be known."""
        return self._queued is None or not self._returns or self._was_in_bus_off

    @property
    def _was_in_bus_off(self) -> bool:
        """The interface works, and was in bus-off since it got a frame that has not come back."""
        if self._queued_for < _LEAVES_IN or self._read('carrier') != _CARRIER:
            return False
        before, self._changes = self._changes, self._read('carrier_changes')
        return self._changes != before

    def _read(self, what: str) -> str:
        """Return what Linux shows of the interface; ``''``: nothing."""
        try:
            return (_INTERFACES / self._name / what).read_text('ascii').strip()
        except OSError:
            return ''

    @property
    def _bus(self) -> socket.socket:
        if self._socket is None:
            raise PortError(f'{self._name} is not open')
        return self._socket

    def _lost(self, error: OSError) -> PortError:
        name = self._name
        if error.errno in (errno.ENODEV, errno.ENETDOWN):
            # its queue is empty then
            self._queued = None
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


def _node(raw: bytes) -> int:
    """Return the node that a frame is for, or from."""
    identifier: int = _FRAME.unpack(raw)[0]
    return identifier & ~FUNCTION_CODE & IDENTIFIERS[-1]


def interfaces() -> Sequence[str]:
    """Return the names of all CAN interfaces."""
    found = []
    for path in sorted(_INTERFACES.glob('*/type')):
        # one may go away meanwhile
        with contextlib.suppress(OSError):
            if path.read_text('ascii').strip() == _IS_CAN:
                found.append(path.parent.name)
    return found
