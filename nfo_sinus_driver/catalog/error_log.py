# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Where the error log of a drive stands: an area of entries, not parameters of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
import math

from nfo_sinus_driver.catalog.codec import Number

#: The operating time of an entry.
_TICKS = 0xFFFFFF
#: Its step, h ([M0 §8.4], [M2 §9]); what is shown is cut off, not rounded.
TICK = 0.1
#: The status code of an entry that is none; a message has one byte for it.
_UNKNOWN = 255


@dataclass(frozen=True)
class ErrorLogArea:
    """
    The error log on one bus, the newest entry first; code 0 ends it.

    Either the low 24 bits of an entry are the operating time of the error in 0.1 h and the high
    byte is the code of :class:`StatusCode` [M2 §9], or it is a fault code alone, without a time.

    :ivar protocol: the protocol that reaches it.
    :ivar space: which numbering of that protocol ``first`` counts in.
    :ivar first: where the newest entry stands.
    :ivar stride: from an entry to the next older one.
    :ivar entries: how many every drive has.
    :ivar limit: how many some drives have; beyond ``entries`` stop at code 0 or a refusal [C4].
    :ivar sub_stride: from the sub-index of an entry to that of the next older one, which all stand
        at :attr:`first`; the newest is the fault that is active, and empty while none is. What
        stands between are the faults that came before it was acknowledged, the next one first;
        code 0 ends them. ``None``: entries have no sub-index.
    :ivar elsewhere: where the newest entry stands if there is none at ``first``; ``None``: nowhere.
    :ivar codec: how the bytes of an entry are read.
    :ivar factor: of entries that are a code alone: the code of one raw count.
    :ivar above: of those, too: what status codes of faults begin above; ``None``: they have a time.
    :ivar readings: what the drive has kept of an entry: what it is, and the parameter, with ``{}``
        for the number of the entry, 0 being the newest.
    """

    protocol: str
    space: str
    first: int
    stride: int
    entries: int
    limit: int
    codec: Number
    factor: Fraction = Fraction(1)
    above: int | None = None
    readings: tuple[tuple[str, str], ...] = ()
    elsewhere: int | None = None
    sub_stride: int | None = None

    @property
    def timed(self) -> bool:
        """It reports when an error happened."""
        return self.above is None

    def code(self, entry: int) -> int:
        """Return the status code of an entry, 0 if it is empty, 255 if it is unknown."""
        if self.above is None:
            return entry >> 24
        code = self.above + entry * self.factor
        # the drive prints codes without decimals: what has some is none [C119]
        whole = code.denominator == 1 and code < _UNKNOWN
        return (int(code) if whole else _UNKNOWN) if entry else 0

    def unknown(self, entry: int) -> str:
        """Return what to call an entry that is no code; ``''`` if it is one."""
        is_none = self.above is not None and self.code(entry) == _UNKNOWN
        return f'unknown code (raw {entry})' if is_none else ''

    def hours(self, entry: int) -> float:
        """Return the operating time of an entry as it stands in the drive, h; NaN if none."""
        return (entry & _TICKS) * TICK if self.timed else math.nan

    def readings_of(self, entry: int) -> Sequence[tuple[str, str]]:
        """Return what the drive has kept of an entry, 0 being the newest, and the parameters."""
        return [(what, key.format(entry)) for what, key in self.readings]

    def address(self, entry: int) -> int:
        """Return where an entry begins, 0 being the newest; an IndexError beyond the last."""
        if not 0 <= entry < self.limit:
            raise IndexError(f'the error log has {self.limit} entries, not {entry + 1}')
        return self.first + self.stride * entry

    @property
    def messages(self) -> int:
        """How many faults an entry may have."""
        return self.sub_stride or 1

    def place(self, entry: int, message: int = 0) -> tuple[str, int, int | None, int]:
        """
        Return where a link finds an entry: space, index, sub-index and size in bytes.

        :param message: which of its faults, 0 being the first.
        """
        index = self.address(entry)
        # on Classic the high word has the next id
        sub_index = index + 1 if self.space == 'id' else None
        if self.sub_stride is not None:
            sub_index = self.sub_stride * entry + message
        return self.space, index, sub_index, self.codec.size
