# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The judge of traces sees each kind of violation, and nothing in a good run."""

from __future__ import annotations

import struct

import pytest
from support.trace_laws import violations
from support.wire import crc

_GAP = 0.00175
_PROTOCOLS = ('modbus_rtu', 'modbus_ascii', 'modbus_tcp')


def _request(text: str, gap: float = 0.002, protocol: str = 'modbus_rtu') -> dict:
    """Return a request in a trace, from its message in Modbus."""
    return {
        'direction': 'request', 'hex': _frame(bytes.fromhex(text), protocol).hex(), 'gap': gap
    }


def _frame(message: bytes, protocol: str) -> bytes:
    if protocol == 'modbus_rtu':
        return message + crc(message).to_bytes(2, 'little')
    if protocol == 'modbus_tcp':
        return struct.pack('>HHH', 7, 0, len(message)) + message
    return b':%s%02X\r\n' % (message.hex().upper().encode(), -sum(message) % 256)


def _classic(unit: int, number: int, word: int | None = None) -> dict:
    """Return a request of Classic in a trace."""
    head = b'\x04' + bytes((0x20 + unit,))
    if word is None:
        return _raw(head + b'E%04X\x05' % number)
    body = b'E%04X=%04X\x03' % (number, word)
    check_sum = 0
    for char in body:
        check_sum ^= char
    return _raw(head + b'\x02' + body + bytes((check_sum,)))


def _raw(data: bytes) -> dict:
    return {'direction': 'request', 'hex': data.hex(), 'gap': 0.0}


_ANSWER = {'direction': 'answer', 'hex': '0103020025799f', 'gap': 0.003}
_POLL, _ZERO, _MODE = '01 03 0258 0002', '01 06 03FC 0000', '01 06 0294 0003'
_RUN, _STOP = '01 06 0298 0101', '01 06 0298 0000'
_WHO = ['01 2B 0E02 00', '01 11']
_GOOD = [_POLL, *_WHO, _MODE, _ZERO, _RUN, _POLL, _STOP, '02 10 0250 0002 04 FFFE 0000']


@pytest.mark.parametrize('protocol', _PROTOCOLS)
def test_a_good_run_has_nothing_to_complain_of(protocol: str) -> None:
    frames = [frame for text in _GOOD for frame in (_request(text, 0.002, protocol), _ANSWER)]
    assert violations(frames, _GAP, protocol=protocol) == []


@pytest.mark.parametrize('protocol', _PROTOCOLS)
@pytest.mark.parametrize(
    ('bad', 'complaint'),
    [
        (['01 03 02A4 0001'], 'acknowledges'),
        ([_STOP, '01 06 0254 C076'], 'by the control word, and was by SCMD'),
        (['01 10 0250 0002 04 FFF6 0000', _STOP], 'by SCMD, and was by the control word'),
        (['01 03 02A5 0002'], 'not exactly one parameter'),
        (['01 03 0258 0001'], 'not exactly one parameter'),
        (['01 03 0211 0001'], 'not exactly one parameter'),
        (['01 10 027E 0001 02 0001'], 'not exactly one parameter'),
        (['01 06 0294 0002'], 'MODE = 2'),
        (['01 06 0254 2008'], 'both directions'),
        (['01 10 0250 0002 04 FFFF 2008'], 'both directions'),
        ([_RUN], 'without set-point 0'),
        (['02 06 03FC 0000', _RUN], 'without set-point 0'),
        ([_ZERO, '01 06 03FC 0064', _RUN], 'without set-point 0'),
        ([_ZERO, _RUN, _STOP, _RUN], 'without set-point 0'),
        (['01 2B 0E01 0000'], 'not for parameters'),
        (['01 2B 0E03 00'], 'not for parameters'),
        (['01 2B 0E02 07'], 'not for parameters'),
        (['01 2B 0D02 00'], 'not for parameters'),
        (['01 11 00'], 'not for parameters'),
        (['01 08 0001 0000'], 'not for parameters'),
        (['01 17 0400 0001 0294 0001 02 0003'], 'not for parameters'),
        (['01 17 02A4 0001 03FC 0001 02 0064'], 'acknowledges'),
        (['01 17 0258 0001 03FC 0001 02 0064'], 'not exactly one parameter'),
        ([_ZERO, '01 17 0258 0002 03FC 0001 02 0064', _RUN], 'without set-point 0'),
        ([_ZERO, *_WHO, _RUN, *_WHO, _RUN], 'without set-point 0'),
    ],
)
def test_a_bad_run_is_found_out(protocol: str, bad: list[str], complaint: str) -> None:
    found = violations([_request(text, 0.002, protocol) for text in bad], _GAP, protocol=protocol)
    assert len(found) == 1
    assert complaint in found[0]


@pytest.mark.parametrize('text', ['01 03 0400 0001', '01 11'])
def test_a_gap_that_is_too_short_is_found_out(text: str) -> None:
    (found,) = violations([_request(_POLL), _request(text, gap=0.0017)], _GAP)
    assert 't3.5 is not kept' in found


def test_only_modbus_rtu_has_a_gap() -> None:
    frames = [_request(_POLL, 0.0, 'modbus_ascii') for _ in range(2)]
    assert violations(frames, _GAP, protocol='modbus_ascii') == []


#: Ids of Classic [M0 table 3].
_MODE_ID, _SCMD, _SETPOINT, _CONTROL = 0x0029, 0x00AD, 0x001E, 0x007C
_BOTH_RUN = [
    _classic(unit, number, word)
    for unit in (1, 2)
    for number, word in ((_SETPOINT, 0), (_SCMD, 0x101))
]
_CLASSIC_GOOD = [
    _classic(1, 0x00E9),
    _classic(1, _MODE_ID, 3),
    _classic(1, _SETPOINT, 0),
    _classic(1, _SCMD, 0x101),
    _classic(1, _SETPOINT, 0x64),
    _classic(95, _SETPOINT, 0x64),
    _classic(1, _SCMD, 0),
    _classic(95, _MODE_ID, 1),
    _classic(0, 0x00E9),
    _classic(1, 0x0200 + 2 * 127 + 1),
]


def test_a_good_run_over_classic_has_nothing_to_complain_of() -> None:
    assert violations(_CLASSIC_GOOD, _GAP, protocol='classic') == []


@pytest.mark.parametrize(
    ('bad', 'complaint'),
    [
        ([_classic(1, 0x00E8)], 'acknowledges'),
        ([_classic(1, 0x00AC)], 'acknowledges'),
        ([_classic(1, 0xFFFF)], 'not exactly one parameter'),
        ([_classic(1, _MODE_ID, 2)], 'MODE = 2'),
        ([_classic(1, _SCMD, 0x101)], 'without set-point 0'),
        ([_classic(2, _SETPOINT, 0), _classic(1, _SCMD, 0x101)], 'without set-point 0'),
        ([_classic(1, _SETPOINT, 1), _classic(1, _SCMD, 0x101)], 'without set-point 0'),
        ([*_CLASSIC_GOOD, _classic(1, _SCMD, 0x101)], 'without set-point 0'),
        ([_classic(1, _CONTROL, 0x2008)], 'both directions'),
        ([_classic(95, _MODE_ID, 3)], 'neither a stop nor a set-point'),
        ([_classic(95, _SCMD, 0)], 'neither a stop nor a set-point'),
        ([*_BOTH_RUN, _classic(3, 0x00E9), _classic(95, _SETPOINT, 1)], '[3] are not enabled'),
        ([*_BOTH_RUN, _classic(2, _SCMD, 0), _classic(95, _SETPOINT, 1)], '[2] are not enabled'),
        ([*_BOTH_RUN, _classic(95, _SETPOINT, 1), _classic(1, _SCMD, 0x101)], 'without set-point'),
    ],
)
def test_a_bad_run_over_classic_is_found_out(bad: list[dict], complaint: str) -> None:
    (found,) = violations(bad, _GAP, protocol='classic')
    assert complaint in found


@pytest.mark.parametrize(
    ('protocol', 'data', 'complaint'),
    [
        ('modbus_rtu', bytes.fromhex('0103025800020000'), 'CRC'),
        ('modbus_ascii', b':010302580002A1\r\n', 'LRC'),
        ('modbus_ascii', b':01110e\r\n'[:3] + b'11ee\r\n', 'upper-case'),
        ('modbus_ascii', b':0111EE\n', 'upper-case'),
        ('modbus_tcp', bytes.fromhex('0007 0000 0007 0103 0258 0002'), 'head'),
        ('modbus_tcp', bytes.fromhex('0007 0001 0006 0103 0258 0002'), 'head'),
        ('classic', b'\x04\x21E00e9\x05', 'neither'),
        ('classic', b'\x04\x21\x02E0029=0003\x03\x00', 'BCC'),
        ('classic', b'\x04\x21E00E9\x05\x05', 'neither'),
    ],
)
def test_a_frame_that_is_none_is_found_out(protocol: str, data: bytes, complaint: str) -> None:
    (found,) = violations([_raw(data)], _GAP, protocol=protocol)
    assert complaint in found


def test_a_late_answer_keeps_no_gap_to_the_next_request() -> None:
    times = [(0.0, 0.001), (0.202, 0.203), (0.2025, 0.2035)]
    kinds = ['request', 'request', 'answer']
    frames = [
        {**_request(_POLL, gap=0.01), 'direction': kind, 'first': first, 'last': last}
        for kind, (first, last) in zip(kinds, times, strict=True)
    ]
    frames.append({**_request(_POLL, gap=-0.0001), 'first': 0.2034, 'last': 0.2044})
    assert violations(frames, _GAP) == []
    # an answer in time does not excuse it
    frames[1]['first'] = 0.1
    assert len(violations(frames, _GAP)) == 1
