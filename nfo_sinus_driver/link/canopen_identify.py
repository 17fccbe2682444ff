# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The objects by which a node of CANopen tells who it is (CiA 301 §7.5.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from nfo_sinus_driver.link.interface import Address, Identification, LinkError, NotReady, Reply

_SPACE = 'object'
#: The longest text that is expected.
_TEXT = 64


def _number(data: bytes) -> str:
    return str(int.from_bytes(data, 'little'))


def _text(data: bytes) -> str:
    """Return a text as the drive has it; what cannot be printed is left out."""
    text = data.decode('ascii', errors='replace').partition('\0')[0]
    return ''.join(char for char in text if char.isascii() and char.isprintable()).strip()


#: What is asked, index and sub-index, for which field, and what is made of the bytes.
_QUESTIONS: tuple[tuple[int, int, int, str, Callable[[bytes], str]], ...] = (
    (0x1018, 1, 4, 'vendor', _number),
    (0x1018, 2, 4, 'product_code', _number),
    (0x1018, 4, 4, 'serial', _number),
    (0x1008, 0, _TEXT, 'product', _text),
    (0x100A, 0, _TEXT, 'revision', _text),
)


class CanopenInquiry:
    """
    Questions to a node about itself, one by one.

    :param read: reads an object of a node.
    """

    def __init__(self, unit: int, read: Callable[[int, Address], Reply]) -> None:
        self._unit = unit
        self._read = read
        self._left = list(_QUESTIONS)
        self.found = Identification()

    @property
    def done(self) -> bool:
        """There is nothing left to ask."""
        return not self._left

    def ask(self) -> Reply:
        """
        Ask the next question: one transaction.

        A question that failed is not asked again; only after :class:`NotReady` it still is to be.

        :raises LinkError: as its subclasses say.
        """
        index, sub_index, size, field, value_of = self._left[0]
        try:
            reply = self._read(self._unit, Address(_SPACE, index, sub_index, size))
        except NotReady:
            raise
        except LinkError:
            del self._left[0]
            raise
        del self._left[0]
        self.found = replace(self.found, **{field: value_of(reply.data)})
        return reply
