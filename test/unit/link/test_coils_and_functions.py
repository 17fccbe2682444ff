# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Coils, input registers, and registers that only function 16 writes.

The frames are the examples of the Modbus Application Protocol Specification V1.1b3, chapter 6.
"""

from __future__ import annotations

import pytest

from nfo_sinus_driver.link import Address, Refused
from nfo_sinus_driver.link.modbus.pdu import encode, read_of, understand, write_of

COILS = Address('coil', 0x13, None, 3)
INPUT = Address('input', 8, None, 2)


@pytest.mark.parametrize(
    ('request_', 'asked', 'answer', 'means'),
    [
        # 6.4: input register 9
        (read_of(1, INPUT), '01 04 0008 0001', '01 04 02 000A', b'\x00\x0a'),
        # 6.5: coil 173 on
        (
            write_of(1, Address('coil', 0xAC, None, 1), b'\x01'),
            '01 05 00AC FF00', '01 05 00AC FF00', b'',
        ),
        (
            write_of(1, Address('coil', 0xAC, None, 1), b'\x00'),
            '01 05 00AC 0000', '01 05 00AC 0000', b'',
        ),
        # 6.12, with one register
        (
            write_of(1, Address('register_16', 1, None, 2), b'\x00\x0a'),
            '01 10 0001 0001 02 000A', '01 10 0001 0001', b'',
        ),
        (
            write_of(1, Address('register', 1, None, 2), b'\x00\x0a'),
            '01 06 0001 000A', '01 06 0001 000A', b'',
        ),
        (read_of(1, Address('coil', 0x13, None, 1)), '01 01 0013 0001', '01 01 01 FD', b'\x01'),
        (read_of(1, COILS), '01 01 0013 0018', '01 01 03 CD6B05', bytes.fromhex('CD6B05')),
    ],
)
def test_a_request_and_its_answer(request_, asked, answer, means) -> None:
    assert encode(request_) == bytes.fromhex(asked)
    assert understand(request_, bytes.fromhex(answer)) == means
    assert request_.measure(b'') == len(bytes.fromhex(answer))


def test_the_answer_to_another_request_is_none() -> None:
    coil_on = write_of(1, Address('coil', 0xAC, None, 1), b'\x01')
    for other in ('01 05 00AC 0000', '01 06 00AC FF00', '01 05 00AD FF00', '02 05 00AC FF00'):
        assert understand(coil_on, bytes.fromhex(other)) is None
    with pytest.raises(Refused):
        understand(read_of(1, COILS), bytes.fromhex('01 81 02'))
    assert read_of(1, INPUT) != read_of(1, INPUT._replace(space='register'))
