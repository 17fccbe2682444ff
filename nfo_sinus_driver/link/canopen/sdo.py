# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Service data objects of CANopen, the side of the client, without I/O (CiA 301 §7.2.4).

A :class:`Transfer` gives what to send, and takes what came, until it is over. Up to four bytes go
in one exchange, *expedited*; longer values in segments of seven bytes, each confirmed, whose
toggle bit distinguishes each from the one before. An answer is recognised by its *kind*: its
command and its object; only segments name no object. A server ends a transfer by an abort code.
:class:`ObjectShapes` is what only a node knows of its objects: how long values are, where arrays
begin [C102].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence, Set as AbstractSet
import struct
from typing import NamedTuple

from nfo_sinus_driver.link.interface import Address, DamagedAnswer, Refused

#: The abort of a client after a time-out.
TIMED_OUT = 0x0504_0000
#: The object has no such sub-index.
NO_SUB_INDEX = 0x0609_0011
#: The value has another length there: any other, a shorter one, a longer one.
WRONG_LENGTH, TOO_LONG, TOO_SHORT = 0x0607_0010, 0x0607_0012, 0x0607_0013


class Aborted(Refused):
    """
    The node has ended the transfer.

    :ivar abort: the code, one of :data:`ABORT_CODES`.
    """

    def __init__(self, abort: int, kind: int, reason: str) -> None:
        super().__init__(kind, reason)
        self.abort = abort


_FUNCTION = Refused.ILLEGAL_FUNCTION
_NO_SUCH = Refused.ILLEGAL_ADDRESS
_VALUE = Refused.ILLEGAL_VALUE
_STATE = Refused.DEVICE_FAILURE

#: The meaning of an abort code: the code of :class:`Refused` that means the same, and a text.
ABORT_CODES: Mapping[int, tuple[int, str]] = {
    0x0503_0000: (_STATE, 'the toggle bit did not alternate'),
    TIMED_OUT: (_STATE, 'the next segment did not arrive in time'),
    0x0504_0001: (_FUNCTION, 'the drive does not know this command'),
    0x0504_0002: (_FUNCTION, 'invalid block size'),
    0x0504_0003: (_FUNCTION, 'invalid sequence number'),
    0x0504_0004: (_STATE, 'a check sum was wrong'),
    0x0504_0005: (_STATE, 'the drive is out of memory'),
    0x0601_0000: (_NO_SUCH, 'the object does not support this access'),
    0x0601_0001: (_NO_SUCH, 'the object can only be written'),
    0x0601_0002: (_NO_SUCH, 'the object can only be read'),
    0x0602_0000: (_NO_SUCH, 'the drive has no such object'),
    0x0604_0041: (_STATE, 'the object cannot be mapped to the process data'),
    0x0604_0042: (_STATE, 'the process data would be too long'),
    0x0604_0043: (_STATE, 'the parameters do not fit together'),
    0x0604_0047: (_STATE, 'the drive is not compatible within itself'),
    0x0606_0000: (_STATE, 'a hardware error of the drive'),
    WRONG_LENGTH: (_VALUE, 'the value has the wrong length'),
    TOO_LONG: (_VALUE, 'the value is too long'),
    TOO_SHORT: (_VALUE, 'the value is too short'),
    NO_SUB_INDEX: (_NO_SUCH, 'the object has no such sub-index'),
    0x0609_0030: (_VALUE, 'the drive does not accept this value'),
    0x0609_0031: (_VALUE, 'the value is too large'),
    0x0609_0032: (_VALUE, 'the value is too small'),
    0x0609_0036: (_VALUE, 'the maximum is less than the minimum'),
    0x060A_0023: (_STATE, 'what it takes is not available'),
    0x0800_0000: (_STATE, 'the drive refused'),
    0x0800_0020: (_STATE, 'the drive cannot transfer or store the value'),
    0x0800_0021: (_STATE, 'the drive cannot do this: it is under local control'),
    0x0800_0022: (_STATE, 'the drive cannot do this in its present state'),
    0x0800_0023: (_STATE, 'the drive has no list of its objects'),
    0x0800_0024: (_STATE, 'there is no value'),
}
_UNKNOWN = (_STATE, 'the drive refused')


def refusal(code: int) -> Aborted:
    """Return the refusal of an abort code."""
    kind, meaning = ABORT_CODES.get(code, _UNKNOWN)
    return Aborted(code, kind, f'{meaning} (SDO abort {code:08X}h)')


#: Added to the address of a node, the identifiers of its requests, and of its answers.
REQUESTS = 0x600
ANSWERS = 0x580
#: The longest value that is taken or sent, bytes.
LONGEST_VALUE = 1024

#: How many bytes each message has, used or not.
_LENGTH = 8
#: How many bytes go in one exchange, and in a segment.
_EXPEDITED, _SEGMENT = 4, 7
#: Command, index and sub-index, and up to four bytes.
_HEAD = struct.Struct('<BHB')
_SIZE = struct.Struct('<I')

#: Commands, of the client and of the server, in the three high bits.
_COMMAND = 0xE0
_DOWNLOAD_SEGMENT = 0x00
_DOWNLOAD = 0x20
_UPLOAD = 0x40
_UPLOAD_SEGMENT = 0x60
_ABORT = 0x80
_UPLOADED_SEGMENT = 0x00
_DOWNLOADED_SEGMENT = 0x20
_UPLOADED = 0x40
_DOWNLOADED = 0x60
#: In the low bits: the value is here, its size is known, this segment is another, or the last one.
_IS_EXPEDITED, _HAS_SIZE, _TOGGLE, _LAST = 0x02, 0x01, 0x10, 0x01
#: Commands of a server that name the object.
_NAMING = (_UPLOADED, _DOWNLOADED, _ABORT)


class Kind(NamedTuple):
    """
    What distinguishes an answer from others.

    :ivar command: that of the server.
    :ivar index: the object; -1: a segment does not name it.
    """

    command: int
    index: int = -1  # type: ignore[assignment]  # hides a method of tuples that is never called
    sub_index: int = -1


#: The kinds of segments.
SEGMENTS = (Kind(_UPLOADED_SEGMENT), Kind(_DOWNLOADED_SEGMENT))
#: An abort of the last transfer.
_ANY_ABORT = Kind(_ABORT)


def kind(message: bytes) -> Kind | None:
    """Return the kind of an answer; ``None`` if it is no answer."""
    if len(message) != _LENGTH:
        return None
    command = message[0] & _COMMAND
    if command in _NAMING:
        _, index, sub_index = _HEAD.unpack_from(message)
        return Kind(command, index, sub_index)
    return Kind(command) if Kind(command) in SEGMENTS else None


def kinds_asked_for(request: bytes) -> frozenset[Kind]:
    """Return the kinds of answers to a request of a client; none where it ends a transfer."""
    if len(request) != _LENGTH:
        return frozenset()
    command = request[0] & _COMMAND
    if command == _ABORT:
        return frozenset()
    if command not in (_UPLOAD, _DOWNLOAD):
        return frozenset((*SEGMENTS, _ANY_ABORT))
    _, index, sub_index = _HEAD.unpack_from(request)
    begun = _UPLOADED if command == _UPLOAD else _DOWNLOADED
    return frozenset((Kind(begun, index, sub_index), Kind(_ABORT, index, sub_index)))


def is_among(found: Kind, kinds: AbstractSet[Kind]) -> bool:
    """Return whether an answer may be one of some kinds."""
    return found in kinds or (found.command == _ABORT and _ANY_ABORT in kinds)


class Transfer(ABC):
    """
    One value, read or written.

    :ivar unit: the node.
    :ivar request: the message to be sent now; ``None``: it is over.
    """

    #: The command of the server's first answer.
    _begun: int

    def __init__(self, unit: int, index: int, sub_index: int) -> None:
        self.unit = unit
        self.index = index
        self.sub_index = sub_index
        self.request: bytes | None = None
        #: The kind of its answer, if it is not refused.
        self._expected = Kind(self._begun, index, sub_index)
        self._toggle = 0

    @property
    def kinds(self) -> tuple[Kind, Kind]:
        """The kinds of answers that the present request may have."""
        return self._expected, Kind(_ABORT, self.index, self.sub_index)

    @property
    def has_begun(self) -> bool:
        """The server has begun with segments, and waits for the next one."""
        return self._expected in SEGMENTS and self.request is not None

    def take_message(self, message: bytes) -> bool:
        """
        Take a message from the node.

        :returns: whether it is the answer to the present request; else nothing has changed.
        :raises Refused: the server has ended the transfer; it is over.
        :raises DamagedAnswer: the answer makes no sense.
        """
        found = kind(message)
        if self.request is None or found not in self.kinds:
            return False
        if found is not None and found.command == _ABORT:
            self.request = None
            raise refusal(_SIZE.unpack_from(message, 4)[0])
        if self._expected in SEGMENTS:
            if message[0] & _TOGGLE != self._toggle:
                return False
            self._toggle ^= _TOGGLE
        self._go_on(message)
        return True

    def abort(self) -> bytes:
        """Return the message that ends the transfer in the server; it has no answer."""
        return self._message(_ABORT, _SIZE.pack(TIMED_OUT))

    @abstractmethod
    def _go_on(self, message: bytes) -> None:
        """Take the answer to the present request, and prepare the next one."""

    def _message(self, command: int, data: bytes) -> bytes:
        """Return a message that names the object."""
        head = _HEAD.pack(command, self.index, self.sub_index)
        return (head + data).ljust(_LENGTH, b'\0')


class Upload(Transfer):
    """
    A value that is read.

    :ivar value: the bytes that have come.
    """

    _begun = _UPLOADED

    def __init__(self, unit: int, index: int, sub_index: int) -> None:
        super().__init__(unit, index, sub_index)
        self.value = b''
        self._size: int | None = None
        self.request = self._message(_UPLOAD, b'')

    def _go_on(self, message: bytes) -> None:
        if self._expected in SEGMENTS:
            self._take_segment(message)
            return
        flags, data = message[0], message[4:]
        if flags & _IS_EXPEDITED:
            unused = flags >> 2 & 0x03 if flags & _HAS_SIZE else 0
            self.value = data[: _EXPEDITED - unused]
            self.request = None
            return
        self._size = _SIZE.unpack(data)[0] if flags & _HAS_SIZE else None
        self._expected = Kind(_UPLOADED_SEGMENT)
        self._require_size(self._size or 0, LONGEST_VALUE)
        self._ask_segment()

    def _take_segment(self, message: bytes) -> None:
        flags = message[0]
        data = message[1 : 1 + _SEGMENT - (flags >> 1 & 0x07)]
        if not data and not flags & _LAST:
            raise DamagedAnswer(f'unit {self.unit}: a segment without data, and not the last')
        self.value += data
        self._require_size(len(self.value), LONGEST_VALUE if self._size is None else self._size)
        if not flags & _LAST:
            self._ask_segment()
            return
        self.request = None
        if self._size is not None:
            self._require_size(self._size, len(self.value))

    def _ask_segment(self) -> None:
        self.request = bytes((_UPLOAD_SEGMENT | self._toggle,)).ljust(_LENGTH, b'\0')

    def _require_size(self, size: int, most: int) -> None:
        if size > most:
            where = f'object {self.index:04X}h, sub-index {self.sub_index}'
            raise DamagedAnswer(f'unit {self.unit}, {where}: {size} bytes instead of {most}')


class Download(Transfer):
    """A value that is written."""

    _begun = _DOWNLOADED

    def __init__(self, unit: int, index: int, sub_index: int, value: bytes) -> None:
        """
        Prepare to write a value.

        :raises ValueError: it has no byte, or more than :data:`LONGEST_VALUE`.
        """
        super().__init__(unit, index, sub_index)
        if not 0 < len(value) <= LONGEST_VALUE:
            raise ValueError(f'a value of {len(value)} bytes cannot be written')
        self._segments: Iterator[bytes] = iter(())
        if len(value) <= _EXPEDITED:
            flags = (_EXPEDITED - len(value)) << 2 | _IS_EXPEDITED | _HAS_SIZE
            self.request = self._message(_DOWNLOAD | flags, value)
        else:
            self._segments = _segments(value)
            self.request = self._message(_DOWNLOAD | _HAS_SIZE, _SIZE.pack(len(value)))

    def _go_on(self, message: bytes) -> None:
        self._expected = Kind(_DOWNLOADED_SEGMENT)
        self.request = next(self._segments, None)


def _segments(value: bytes) -> Iterator[bytes]:
    """Yield the messages that carry a value, in segments."""
    toggle = 0
    for begin in range(0, len(value), _SEGMENT):
        data = value[begin : begin + _SEGMENT]
        is_last = _LAST if begin + _SEGMENT >= len(value) else 0
        flags = toggle | (_SEGMENT - len(data)) << 1 | is_last
        yield bytes((_DOWNLOAD_SEGMENT | flags,)) + data.ljust(_SEGMENT, b'\0')
        toggle ^= _TOGGLE


#: How many bytes a number may have on CANopen.
_LENGTHS = (1, 2, 4, 8)
#: The sub-index of the second value of an array that is numbered from 1. Reading it first shows how
#: an array is numbered: where it does not exist, that value has the sub-index before. Reading the
#: first value could have an effect that was not requested: it acknowledges a fault.
SECOND = 2


class ObjectShapes:
    """
    The shapes of the objects of all nodes of a line; without I/O.

    Arrays are numbered from 1 in the addresses of the catalog. A node may number them from 0.
    """

    def __init__(self) -> None:
        #: How many bytes each number has, by node, index and sub-index of the node.
        self._lengths: dict[tuple[int, int, int], int] = {}
        #: What is subtracted from the sub-indices of an array.
        self._offsets: dict[tuple[int, int], int] = {}

    def clear(self) -> None:
        """Forget everything."""
        self._lengths.clear()
        self._offsets.clear()

    def sub_index(self, unit: int, address: Address) -> int | None:
        """Return the sub-index in the node; ``None``: how it numbers the array is not known."""
        if not address.sub_index or address.signed is None:
            return address.sub_index or 0
        offset = self._offsets.get((unit, address.index))
        return None if offset is None else address.sub_index - offset

    def note_array(self, unit: int, index: int, refusal: Refused | None) -> None:
        """
        Note the answer of a node to a read of the :data:`SECOND` value of an array.

        :raises Refused: it does not show how the array is numbered.
        """
        if refusal is None:
            self._offsets[unit, index] = 0
        elif isinstance(refusal, Aborted) and refusal.abort == NO_SUB_INDEX:
            self._offsets[unit, index] = 1
        else:
            raise refusal

    def fit_read(self, unit: int, address: Address, sub_index: int, data: bytes) -> bytes:
        """
        Return a value in the length of the catalog; note its length in the node.

        :raises DamagedAnswer: it is no such number.
        """
        if address.signed is None:
            return data
        if len(data) in _LENGTHS:
            self._lengths[unit, address.index, sub_index] = len(data)
            fitted = _fitted(data, address.size, signed=address.signed)
            if fitted is not None:
                return fitted
        raise DamagedAnswer(
            f'unit {unit}, object {address.index:04X}h, sub-index {sub_index}: '
            f'{data.hex(" ") or "nothing"} is no number of {address.size} bytes'
        )

    def write(
        self,
        unit: int,
        address: Address,
        sub_index: int,
        data: bytes,
        send: Callable[[bytes], float],
    ) -> float:
        """
        Write a value in the length that it has in the node.

        Where no reading has shown that, and the node answers that the length is wrong, it has done
        nothing, and others are tried.

        :param send: writes bytes; returns when it was confirmed.
        :raises LinkError: as ``send`` does.
        """
        if address.signed is None:
            return send(data)
        place = unit, address.index, sub_index
        length = self._lengths.get(place, len(data))
        try:
            return send(_resized(data, length, signed=address.signed))
        except Aborted as refusal:
            for other in _others(refusal.abort, length):
                fitted = _fitted(data, other, signed=address.signed)
                if fitted is None:
                    continue
                try:
                    arrived = send(fitted)
                except Aborted:
                    continue
                self._lengths[place] = other
                return arrived
            raise


def _others(abort: int, length: int) -> Sequence[int]:
    """Return the other lengths that may be right, the likeliest first."""
    if abort == TOO_LONG:
        return [other for other in reversed(_LENGTHS) if other < length]
    if abort == TOO_SHORT:
        return [other for other in _LENGTHS if other > length]
    if abort != WRONG_LENGTH:
        return ()
    return [other for other in (2, 4, 1, 8) if other != length]


def _fitted(data: bytes, length: int, *, signed: bool) -> bytes | None:
    """Return a number in ``length`` bytes; ``None``: it needs more."""
    number = int.from_bytes(data, 'little', signed=signed)
    try:
        return number.to_bytes(length, 'little', signed=signed)
    except OverflowError:
        return None


def _resized(data: bytes, length: int, *, signed: bool) -> bytes:
    """Return a number in ``length`` bytes (Refused: it needs more)."""
    fitted = _fitted(data, length, signed=signed)
    if fitted is None:
        number = int.from_bytes(data, 'little', signed=signed)
        raise Refused(
            Refused.ILLEGAL_VALUE, f'the drive has {length} bytes for it, {number} takes more'
        )
    return fitted
