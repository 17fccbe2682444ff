# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What only a node can say of its objects: how long values are, where arrays begin [C102]."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from nfo_sinus_driver.link import sdo_abort
from nfo_sinus_driver.link.interface import Address, DamagedAnswer, Refused
from nfo_sinus_driver.link.sdo_abort import Aborted

#: How many bytes a number may have on CANopen.
_LENGTHS = (1, 2, 4, 8)
#: The sub-index of the second value of an array that is numbered from 1. Asking for it first tells
#: how an array is numbered: where there is none, that value has the sub-index before. To ask for
#: the first value would do, in the other case, what nobody asked for: it acknowledges a fault.
SECOND = 2


class ObjectShapes:
    """
    What is known of the objects of all nodes of a line; without I/O.

    Arrays are numbered from 1 in the addresses of the catalog. A node may number them from 0.
    """

    def __init__(self) -> None:
        #: How many bytes each number has, by node, index and sub-index of the node.
        self._lengths: dict[tuple[int, int, int], int] = {}
        #: What has to be taken off the sub-indices of an array.
        self._offsets: dict[tuple[int, int], int] = {}

    def clear(self) -> None:
        """Forget everything."""
        self._lengths.clear()
        self._offsets.clear()

    def sub_index(self, unit: int, address: Address) -> int | None:
        """Return the sub-index of the node; ``None``: how it numbers the array is not known yet."""
        if not address.sub_index or address.signed is None:
            return address.sub_index or 0
        offset = self._offsets.get((unit, address.index))
        return None if offset is None else address.sub_index - offset

    def note_array(self, unit: int, index: int, refusal: Refused | None) -> None:
        """
        Take note of what a node answers to a question for the :data:`SECOND` value of an array.

        :raises Refused: that does not tell how the array is numbered.
        """
        if refusal is None:
            self._offsets[unit, index] = 0
        elif isinstance(refusal, Aborted) and refusal.abort == sdo_abort.NO_SUB_INDEX:
            self._offsets[unit, index] = 1
        else:
            raise refusal

    def fit_read(self, unit: int, address: Address, sub_index: int, data: bytes) -> bytes:
        """
        Return a value in as many bytes as the catalog has for it; note how many the node has.

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
        Write a value in as many bytes as the node has for it.

        Where no reading has told, and it says that they are too many or too few, it has done
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
    """Return which other lengths may be right, the likeliest first."""
    if abort == sdo_abort.TOO_LONG:
        return [other for other in reversed(_LENGTHS) if other < length]
    if abort == sdo_abort.TOO_SHORT:
        return [other for other in _LENGTHS if other > length]
    if abort != sdo_abort.WRONG_LENGTH:
        return ()
    return [other for other in (2, 4, 1, 8) if other != length]


def _fitted(data: bytes, length: int, *, signed: bool) -> bytes | None:
    """Return a number in so many bytes; ``None``: it has more."""
    number = int.from_bytes(data, 'little', signed=signed)
    try:
        return number.to_bytes(length, 'little', signed=signed)
    except OverflowError:
        return None


def _resized(data: bytes, length: int, *, signed: bool) -> bytes:
    """Return a number in so many bytes (Refused: it has more)."""
    fitted = _fitted(data, length, signed=signed)
    if fitted is None:
        number = int.from_bytes(data, 'little', signed=signed)
        raise Refused(
            Refused.ILLEGAL_VALUE, f'the drive has {length} bytes for it, {number} takes more'
        )
    return fitted
