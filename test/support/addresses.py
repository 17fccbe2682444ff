# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Addresses and bytes as the links take them, written as registers, ids and 16-bit words."""

from __future__ import annotations

import struct

from nfo_sinus_driver.link import Address

#: What some registers hold, the low word of a value first.
Words = tuple[int, ...]


def register(number: int, count: int = 1) -> Address:
    """So many Modbus registers from this one on."""
    return Address('register', number, None, 2 * count)


def classic_id(number: int, high: int | None = None) -> Address:
    """A Classic parameter of one word, or of two with the id of the high one."""
    return Address('id', number, high, 2 if high is None else 4)


def packed(*words: int) -> bytes:
    """Words as both protocols carry them, the high byte of each first."""
    return struct.pack(f'>{len(words)}H', *words)


def words_of(data: bytes) -> Words:
    """The words that bytes are made of."""
    return struct.unpack(f'>{len(data) // 2}H', data)
