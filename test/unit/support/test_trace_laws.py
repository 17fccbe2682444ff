# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The judge of traces applies each of its rules, and complains of nothing in a good run."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from support.trace_laws import violations
from support.wire import crc

_GAP = 0.00175
_POLL, _ZERO, _MODE = '01 03 0258 0002', '01 06 03FC 0000', '01 06 0294 0003'
_RUN, _STOP = '01 06 0298 0101', '01 06 0298 0000'
_GOOD = (
    *(_POLL, '01 2B 0E02 00', '01 11', _MODE, _ZERO, _RUN, _POLL, _STOP),
    '02 10 0250 0002 04 FFFE 0000',
)


def _request(message: str, gap: float = 0.002, protocol: str = 'modbus_rtu') -> dict[str, Any]:
    """Return a request in a trace, from its message in Modbus."""
    data = bytes.fromhex(message)
    frame = {
        'modbus_rtu': data + crc(data).to_bytes(2, 'little'),
        'modbus_ascii': b':%s%02X\r\n' % (data.hex().upper().encode(), -sum(data) % 256),
        'modbus_tcp': struct.pack('>HHH', 7, 0, len(data)) + data,
    }[protocol]
    return {'direction': 'request', 'hex': frame.hex(), 'gap': gap}


def _classic(unit: int, number: int, word: int | None = None) -> bytes:
    """Return a request of Classic."""
    head = b'\x04' + bytes((0x20 + unit,))
    if word is None:
        return head + b'E%04X\x05' % number
    body = b'E%04X=%04X\x03' % (number, word)
    check_sum = 0
    for char in body:
        check_sum ^= char
    return head + b'\x02' + body + bytes((check_sum,))


def _complaints(protocol: str, *frames: bytes) -> list[str]:
    trace = [{'direction': 'request', 'hex': data.hex(), 'gap': 0.0} for data in frames]
    return violations(trace, 0.0, protocol=protocol)


@pytest.mark.parametrize('protocol', ['modbus_rtu', 'modbus_ascii', 'modbus_tcp'])
def test_a_good_run_has_nothing_to_complain_of(protocol: str) -> None:
    answer = {'direction': 'answer', 'hex': '0103020025799f', 'gap': 0.003}
    frames = [frame for text in _GOOD for frame in (_request(text, 0.002, protocol), answer)]
    assert violations(frames, _GAP, protocol=protocol) == []


@pytest.mark.parametrize(
    ('bad', 'complaint'),
    [
        (['01 03 02A4 0001'], 'acknowledges'),
        (['01 17 02A4 0001 03FC 0001 02 0064'], 'acknowledges'),
        ([_STOP, '01 06 0254 C076'], 'by the control word, and was by SCMD'),
        (['01 03 02A5 0002'], 'not exactly one parameter'),
        (['01 17 0258 0001 03FC 0001 02 0064'], 'not exactly one parameter'),
        (['01 17 0400 0001 0294 0001 02 0003'], 'not for parameters'),
        (['01 2B 0E03 00'], 'not for parameters'),
        (['01 06 0294 0002'], 'MODE = 2'),
        (['01 06 0254 2008'], 'both directions'),
        (['01 10 0250 0002 04 FFFF 2008'], 'both directions'),
        (['01 10 0250 0002 04 0008 0008'], 'another direction beside a set-point'),
        ([_ZERO, '01 10 0250 0002 04 0001 0001'], 'a mask switches on'),
        (['02 06 03FC 0000', _RUN], 'without set-point 0'),
        ([_ZERO, '01 06 03FC 0064', _RUN], 'without set-point 0'),
        ([_ZERO, _RUN, _STOP, _RUN], 'without set-point 0'),
    ],
)
def test_each_rule_is_applied(bad: list[str], complaint: str) -> None:
    (found,) = violations([_request(text) for text in bad], _GAP)
    assert complaint in found


def test_a_gap_is_kept_but_to_an_answer_that_comes_late() -> None:
    short = _request(_POLL, gap=0.0017)
    (found,) = violations([_request(_POLL), short], _GAP)
    assert 't3.5 is not kept' in found
    times = [(0.0, 0.001), (0.202, 0.203), (0.2025, 0.2035)]
    kinds = ['request', 'request', 'answer']
    frames = [
        {**_request(_POLL, gap=0.01), 'direction': kind, 'first': first, 'last': last}
        for kind, (first, last) in zip(kinds, times, strict=True)
    ]
    frames.append({**short, 'first': 0.2034, 'last': 0.2044})
    assert violations(frames, _GAP) == []
    # an answer in time does not excuse it
    frames[1]['first'] = 0.1
    assert len(violations(frames, _GAP)) == 1
    # it was read before that, or with the request before
    for frames[-1]['gap'] in (-0.0001, 0.0):
        assert len(violations(frames, _GAP)) == 1
        assert violations(frames, _GAP, may_stand_still=True) == []


#: Ids of Classic [M0 table 3].
_MODE_ID, _SCMD, _SETPOINT = 0x0029, 0x00AD, 0x001E
_ONE_RUNS = [_classic(1, _SETPOINT, 0), _classic(1, _SCMD, 0x101)]
_BOTH_RUN = [*_ONE_RUNS, _classic(2, _SETPOINT, 0), _classic(2, _SCMD, 0x101)]
_ZERO_FOR_ALL, _FOR_ALL = _classic(95, _SETPOINT, 0), _classic(95, _SETPOINT, 1)


def test_a_good_run_over_classic_has_nothing_to_complain_of() -> None:
    good = [_classic(1, 0x00E9), _classic(1, _MODE_ID, 3), *_BOTH_RUN, _FOR_ALL]
    good += [_ZERO_FOR_ALL, _classic(1, _SCMD, 0x101)]
    good += [_classic(95, _MODE_ID, 1), _classic(0, 0x00E9), _classic(1, 0x0200 + 2 * 127 + 1)]
    assert _complaints('classic', *good) == []


@pytest.mark.parametrize(
    ('bad', 'complaint'),
    [
        ([_classic(1, 0x00E8)], 'acknowledges'),
        ([_classic(1, _SETPOINT, 1), _classic(1, _SCMD, 0x101)], 'without set-point 0'),
        ([_classic(95, _MODE_ID, 3)], 'neither a stop nor a set-point'),
        ([*_BOTH_RUN, _classic(3, 0x00E9), _FOR_ALL], '[3] are not enabled'),
        ([*_BOTH_RUN, _classic(2, _SCMD, 0), _FOR_ALL], '[2] are not enabled'),
        ([*_BOTH_RUN, _classic(95, _MODE_ID, 1), _FOR_ALL], '[1, 2] are not enabled'),
        ([*_ONE_RUNS, _ZERO_FOR_ALL, _FOR_ALL, _classic(1, _SCMD, 0x101)], 'without set-point'),
    ],
)
def test_each_rule_is_applied_over_classic(bad: list[bytes], complaint: str) -> None:
    (found,) = _complaints('classic', *bad)
    assert complaint in found


@pytest.mark.parametrize(
    ('protocol', 'data', 'complaint'),
    [
        ('modbus_rtu', bytes.fromhex('0103025800020000'), 'CRC'),
        ('modbus_ascii', b':010302580002A1\r\n', 'LRC'),
        ('modbus_ascii', b':0111ee\r\n', 'upper-case'),
        ('modbus_tcp', bytes.fromhex('0007 0000 0007 0103 0258 0002'), 'head'),
        ('classic', b'\x04\x21E00e9\x05', 'neither'),
        ('classic', b'\x04\x21\x02E0029=0003\x03\x00', 'BCC'),
    ],
)
def test_a_frame_that_is_none_is_found_out(protocol: str, data: bytes, complaint: str) -> None:
    (found,) = _complaints(protocol, data)
    assert complaint in found
