# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Raw bytes to values and back, for every parameter of every family on each of its buses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
import itertools
import math
import re
import struct

from hypothesis import given, settings, strategies as st
import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import Parameter, Value, families, load_family, load_profile

G2 = load_family('sinus_g2')
PLACES = [
    (row, protocol)
    for name in families()
    for row in load_family(name).values()
    for protocol in row.addresses
]
#: As many bits as the widest parameter has; the lower ones are taken for those that have fewer.
BITS = st.integers(0, 2**32 - 1)
_EDGES = (0, 2**32 - 1, 2**31, 2**31 - 1, 0xFFFF, 0x8000, 0x7FFF, 0x7FFFFF, 99_999_999)


def refusal(call: Callable[..., object], *arguments: object) -> str:
    """What is said against a call; ``''``: nothing."""
    try:
        call(*arguments)
    except ValueError as refused:
        return str(refused)
    return ''


def mistakes(row: Parameter, protocol: str, raw: int) -> Iterator[str]:
    """Decode a raw number and encode the value again: the same comes back, or a clear refusal."""
    data = row.at(protocol).number.encode(raw)
    exact = raw * row.factor(protocol)
    code = int(exact)
    unlisted = bool(row.labels) and code not in row.labels
    if (unlisted and row.kind is not str) or (row.labels and code != exact):
        # a code that means neither on nor off, neither -1 nor 1
        if 'has code' not in refusal(row.decode, data, protocol):
            yield 'a code that is none is decoded'
        return
    value = row.decode(data, protocol)
    if type(value) is not row.kind:
        yield f'{value!r} is no {row.kind}'
    refused = refusal(row.encode, value, protocol)
    if unlisted:
        # the drive is right: a code the manual does not list is shown as it is [C19]
        if value != str(code) or 'is none of' not in refused:
            yield f'unlisted code {code}: {value!r}, {refused}'
        return
    low, high = row.span(protocol)
    if not row.labels and value != float(exact):
        yield f'{value!r} is not {exact}'
    if not row.labels and not low <= exact <= high:
        said = refusal(row.quantise, float(exact), protocol)
        # between two steps, too, where there are some
        if 'is out of range' not in said or not refused:
            yield f'{value!r}: {refused!r}, {said!r}'
    elif not row.labels and not row.on_step(float(exact)):
        if 'between two steps' not in refused:
            yield f'{value!r}: {refused!r}'
    elif refused or row.encode(value, protocol) != data:
        yield f'{value!r} does not come back: {refused}'
    elif not row.labels and row.quantise(float(value), protocol) != data:
        yield f'{value!r} is rounded to another step'


def raw_of(row: Parameter, protocol: str, bits: int) -> int:
    """A raw number that a parameter can have."""
    codec = row.at(protocol).number
    raw = codec.minimum + bits % (codec.maximum - codec.minimum + 1)
    # a sign in BCD is only read
    return raw if codec.fits(raw) else -raw


@settings(max_examples=8, deadline=None)
@given(BITS)
def test_every_parameter_there_and_back(bits: int) -> None:
    found = [
        (row.key, protocol, mistake)
        for row, protocol in PLACES
        for mistake in mistakes(row, protocol, raw_of(row, protocol, bits))
    ]
    assert found == []


def test_the_edges_of_every_range_and_type() -> None:
    found = []
    for row, protocol in PLACES:
        codec, factor = row.at(protocol).number, row.factor(protocol)
        codes = {int(code / factor) for code in row.labels}
        edges = {0, 1, *codes, *(code + 1 for code in codes)}
        edges |= {raw_of(row, protocol, bits) for bits in _EDGES}
        for bound in (row.minimum, row.maximum):
            if bound is not None:
                if (bound / factor).denominator != 1:
                    found.append((row.key, protocol, f'{bound} is between two counts'))
                edges |= {round(bound / factor) + step for step in (-1, 0, 1)}
        edges = {raw for raw in edges if codec.fits(raw)}
        tried = [mistakes(row, protocol, raw) for raw in edges]
        found += [(row.key, protocol, mistake) for mistake in itertools.chain(*tried)]
        lost = [raw for raw in edges if lost_in_a_float32(row, protocol, raw)]
        found += [(row.key, protocol, f'{raw} is lost in a float32') for raw in lost]
    assert found == []


def single(value: float) -> float:
    """What is left of a number after a message, or a tool that computes with single precision."""
    return float(struct.unpack('<f', struct.pack('<f', value))[0])


def lost_in_a_float32(row: Parameter, protocol: str, raw: int) -> bool:
    """Whether another value comes back of one that was rounded to a float32."""
    exact = raw * row.factor(protocol)
    low, high = row.span(protocol)
    value = single(float(exact))
    if row.labels or not (low <= exact <= high and row.on_step(float(exact))):
        return False
    if row.kind is not float and not value.is_integer():
        return False
    if abs(raw) <= 2**23:
        return row.encode(value, protocol) != row.at(protocol).number.encode(raw)
    if not low <= Fraction(value) <= high:
        return False
    # one float32 stands for several steps: one of them it has to be
    again = row.decode(row.encode(value, protocol), protocol)
    return isinstance(again, str) or single(again) != value


@settings(max_examples=8, deadline=None)
@given(BITS)
def test_every_parameter_through_a_float32(bits: int) -> None:
    found = [
        (row.key, protocol, raw)
        for row, protocol in PLACES
        for raw in {raw_of(row, protocol, word) for word in (bits, bits & 0x7FFFFF)}
        if lost_in_a_float32(row, protocol, raw)
    ]
    assert found == []


@given(st.integers(2, 5000))
def test_seconds_as_they_are_typed(tenths: int) -> None:
    # 0.1 + 0.2 is not 0.3: neither that nor a text of one decimal may be refused
    for seconds in (tenths / 10, tenths * 0.1, float(f'{tenths / 10:.1f}')):
        raw = tenths * 100
        assert G2['control.accel'].encode(seconds) == packed(raw & 0xFFFF, raw >> 16)
        assert G2['control.accel'].encode(seconds, 'classic') == packed(tenths)


@given(st.floats(-150, 150))
def test_a_set_point_goes_to_the_nearest_count(value: float) -> None:
    row = G2['status.frq_set']
    got = row.decode(row.quantise(value))
    assert isinstance(got, float)
    assert abs(got - value) <= 0.05 + 1e-9


#: A setting, a value that it cannot have, and what is said.
REFUSED: list[tuple[str, Value, str]] = [
    ('control.accel', 0.1, '0.1 is out of range, 0.2 to 500 s'),
    ('motor.u_nom', 0, '0 is out of range, 1 to 1000 V'),
    ('motor.sigma', 2, '2 is out of range, 0.001 to 1'),
    ('motor.i_nom', 0.05, '0.05 is out of range, at least 0.1 A'),
    ('status.frq_set', -150.1, '-150.1 is out of range, -150 to 150 Hz'),
    # only the raw type bounds a value that has no range
    ('control.f_sleep', 6553.6, '6553.6 is out of range, 0 to 6553.5 Hz'),
    ('control.f_sleep', -0.1, '-0.1 is out of range, at least 0 Hz'),
    ('serial.sio_tot', 2.55, '2.55 lies between two steps of the drive, 2.5 and 2.6'),
    ('motor.u_nom', 230.5, '230.5 lies between two steps of the drive, 230 and 231'),
    ('status.frq_set', -0.05, '-0.05 lies between two steps of the drive, -0.1 and 0'),
    ('control.mode', 'Frequency', "'Frequency' is none of Freque, PI-Reg, Torque, Speed"),
    ('control.mode', '3', "'3' is none of Freque, PI-Reg, Torque, Speed"),
    ('control.mode', 3, '3 is none of Freque, PI-Reg, Torque, Speed'),
    ('control.mode', True, 'True is none of Freque, PI-Reg, Torque, Speed'),
    ('serial.auto_stop', 'yes', "'yes' is none of OFF, ON"),
    ('serial.auto_stop', 1, '1 is none of OFF, ON'),
    # one of two numbers, with nothing between them [C46]
    *(('pi_reg.reg_amp', value, f'{value!r} is none of -1, 1') for value in (0, 2, 0.5, True)),
    ('pi_reg.reg_amp', math.nan, 'nan is none of -1, 1'),
    ('control.accel', 'fast', "'fast' is not a number"),
    ('control.accel', True, 'True is not a number'),
    ('control.accel', math.nan, 'nan is not finite'),
    ('control.accel', 10**400, 'inf is not finite'),
    ('motor.u_nom', -math.inf, '-inf is not finite'),
]


def test_a_refusal_says_what_would_be_right() -> None:
    said = [refusal(G2[key].encode, value) for key, value, _ in REFUSED]
    assert said == [f'{key}: {text}' for key, _, text in REFUSED]
    for value in (math.nan, math.inf, -math.inf, 150.2, -151.0):
        assert refusal(G2['status.frq_set'].quantise, value).startswith('status.frq_set: ')


def test_switches_are_booleans_and_an_unlisted_code_is_a_number() -> None:
    row = G2['control.auto_start']
    assert (row.decode(packed(0)), row.decode(packed(1))) == (False, True)
    assert row.encode(False) == row.encode('OFF') == packed(0)
    assert row.encode(True) == row.encode('ON') == packed(1)
    assert G2['control.mode'].decode(packed(4)) == '4'
    # 193 is in [M2 table 1] only: AnyBus is read and never offered [C19]
    for key in ('freque.op_mode', 'speed.op_mode'):
        assert G2[key].decode(packed(193)) == '193'
        assert "'AnyBus' is none of Terminal" in refusal(G2[key].encode, 'AnyBus')


@pytest.mark.parametrize('size', [0, 1, 3, 4])
def test_wrong_number_of_bytes(size: int) -> None:
    with pytest.raises(ValueError, match='sint16_be takes 2 bytes'):
        G2['status.frq_act'].decode(bytes(size))


#: What the tables say of a number whose bits mean something each, or that a display shows in hex.
_OF_BITS = re.compile(
    r'bit field|\bbits?\b|one bit each|\(hex\)|(control|status) word|[SZ][TS]W1', re.I
)


@pytest.mark.parametrize('name', families())
def test_a_field_of_bits_is_shown_by_its_bits(name: str) -> None:
    for method in load_profile(name).methods:
        family = load_family(name, method)
        for row in family.values():
            of_bits = _OF_BITS.search(f'{row.name} {row.description}') and 'SCMD' not in row.name
            by_display = row.key in family.profile.spelled
            if row.is_readable and row.kind is int and not (row.labels or row.unit or by_display):
                assert bool(of_bits) == bool(family.spelled(row.key, 0)), row.key
    assert load_family('movitrac31').spelled('status.terminals', 1025) == '00000401h: bits 0, 10'


def test_the_bits_of_a_negative_number_and_of_none() -> None:
    assert G2.spelled('fieldbus.drive_status', 0) == '0000h'
    assert G2.spelled('fieldbus.drive_status', -32768) == '8000h: bit 15'
    assert G2.spelled('control.run_dly', 5) == ''


@pytest.mark.parametrize(
    ('key', 'given', 'meant'),
    [
        ('special.save_to_eeprom', True, 'On'),
        ('monitoring.motor_protection_1', False, 'OFF'),
        # no label of it means that
        ('monitoring.motor_protection_1', True, True),
        ('frequency.f_base_1', 50.0, 50),
        ('frequency.f_base_1', 50.5, 50.5),
        ('control.frs_master_gear_ratio', 400.0, 400),
        ('control.frs_master_gear_ratio', True, True),
        ('ramp.t11_up', 4, 4.0),
        ('control.dc_braking_1', True, True),
    ],
)
def test_what_yaml_makes_of_a_value_is_what_was_meant(
    key: str, given: Value, meant: Value
) -> None:
    found = load_family('movitrac31')[key].meant(given)
    assert (found, type(found)) == (meant, type(meant))
