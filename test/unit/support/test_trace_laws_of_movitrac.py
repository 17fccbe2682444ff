# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The judge of traces sees what is wrong with the commands to a MOVITRAC."""

from __future__ import annotations

import pytest
from support.trace_laws import violations

#: Frames without their sums: set-point 0, function bits 0, P841 = Remote control, run, 20 Hz.
_ZERO, _NO_BITS, _REMOTE = 'a9 01 00df 00000000', 'a9 01 0119 00000000', 'a9 01 00cd 00000200'
_RUN, _TWENTY, _REVERSE = 'a9 01 0119 00000005', 'a9 01 00df 00002000', 'a9 01 0119 00000006'
_STATUS, _STOP = 'b5 01 011c', 'a9 01 0119 00000004'
_GOOD = (
    _STATUS, _NO_BITS, _ZERO, _REMOTE, _NO_BITS, _ZERO, _RUN, _TWENTY, _STATUS,
    _ZERO, _REVERSE, _TWENTY, _REVERSE, _ZERO, _STOP, 'b5 01 0000', 'a9 01 0119 00000040',
    _NO_BITS,
)


def _complaints(*requests: str) -> list[str]:
    frames = [bytes.fromhex(text) for text in requests]
    return violations(
        [
            {'direction': 'request', 'hex': (frame + bytes((sum(frame) % 256,))).hex(), 'gap': 0.01}
            for frame in frames
        ],
        0.0,
        'movitrac31',
        'movitrac',
    )


def test_a_good_run_has_nothing_to_complain_of() -> None:
    assert _complaints(*_GOOD) == []
    # an enable that failed half-way, with no direction at the terminals and the motor at rest
    put_back = 'a9 01 00cd 00000100', _ZERO, 'b5 01 000d', 'b5 01 0000', 'a9 01 00cd 00000000'
    assert _complaints(*put_back) == []


@pytest.mark.parametrize(
    ('bad', 'complaint'),
    [
        ([_RUN], 'a direction without set-point 0 before it'),
        ([_ZERO, _TWENTY, _RUN], 'a direction without set-point 0 before it'),
        ([_ZERO, _RUN, _TWENTY, _REVERSE], 'a direction without set-point 0 before it'),
        # what was written to another says nothing of this one
        (['a9 02 00df 00000000', _RUN], 'a direction without set-point 0 before it'),
        ([_ZERO, 'a9 01 0119 00000007'], 'both directions'),
        ([_ZERO, 'a9 01 0119 00000044'], 'a reset beside other bits'),
        (['a9 01 0119 01000000'], 'bits that have no meaning'),
        (['a9 01 00cd 00000000'], 'another P841'),
        (['b5 01 000d', 'b5 01 0000', 'a9 01 00cd 00000000'], 'another P841'),
        (['a9 01 00cd 00000100', 'b5 01 0000', 'a9 01 00cd 00000000'], 'another P841'),
        (['a9 01 00cd 00000100', _ZERO, _TWENTY], 'while P841 is Remote setpoint'),
        (['a9 01 00cb 00000100'], 'index 203 is written'),
        (['a9 01 02c0 00000100'], 'index 704 is written'),
        (['a9 01 00df 00040001'], 'the set-point 00040001 is none'),
        (['a9 01 00df f0002000'], 'the set-point f0002000 is none'),
        (['b5 01 0400'], 'there is no index 1024'),
        (['ad 01 00df 0000000000000000'], 'index 223 has 4 bytes'),
        (['b5 40 0000'], 'is for address 64'),
    ],
)  # fmt: skip
def test_a_bad_run_is_found_out(bad: list[str], complaint: str) -> None:
    found = _complaints(*bad)
    assert len(found) == 1
    assert complaint in found[0]
