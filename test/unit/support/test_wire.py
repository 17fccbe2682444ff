# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the judge of traces makes of requests to MOVITRACs."""

from __future__ import annotations

import pytest
from support.wire import Request, understand


@pytest.mark.parametrize(
    ('frame', 'request_'),
    [
        # [M4 §2.4.3], [M4 §2.4.4]; 100 000 as half-bytes [C106]
        ('B5 00 00 04 B9', Request(0, 4, 1, None)),
        ('A9 00 00 19 00 00 03 70 35', Request(0, 25, 1, (0, 0x0370))),
        ('AD 0C 01 07 00 00 00 01 08 06 0A 00 DA', Request(12, 263, 1, (0, 1, 0x0806, 0x0A00))),
    ],
)
def test_requests_to_a_movitrac(frame: str, request_: Request) -> None:
    assert understand(bytes.fromhex(frame), 'movitrac') == request_


@pytest.mark.parametrize(
    ('frame', 'complaint'),
    [
        ('B5 00 00 04 B8', 'has a wrong sum'),
        ('A9 00 00 19 00 00 03 70 36', 'has a wrong sum'),
        ('B5 40 00 04 F9', 'is for address 64'),
        ('B5 00 00 04', 'is neither'),
        ('D2 D2', 'is neither'),
        ('C8 00 04 00 00 25 50 41', 'is neither'),
        ('A9 00 01 07 00 00 00 01 08 06 0A 00 CA', 'is neither'),
    ],
)
def test_no_request_to_a_movitrac(frame: str, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        understand(bytes.fromhex(frame), 'movitrac')
