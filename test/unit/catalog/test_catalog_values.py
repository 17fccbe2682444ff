# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""Raw bytes to values and back, for every parameter on both buses."""

from __future__ import annotations

from fractions import Fraction
import struct

from hypothesis import example, given, strategies as st
import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import Parameter, load_family
from nfo_sinus_driver.catalog.codec import BitField

G2 = load_family('sinus_g2')
PLACES = [(row, protocol) for row in G2.values() for protocol in row.addresses]
WORD = st.integers(0, 0xFFFF)


def data_of(row: Parameter, protocol: str, *words: int) -> bytes:
    """Words as the bytes of a parameter; 0 where those of a bit field do not count."""
    codec = row.at(protocol).number
    data = packed(*words)[: codec.size]
    return codec.encode(codec.decode(data)) if isinstance(codec, BitField) else data


def check_there_and_back(row: Parameter, protocol: str, data: bytes) -> None:
    """Decode bytes and encode the value again; the same comes back, or a clear refusal."""
    raw = row.at(protocol).number.decode(data)
    if row.labels and raw not in row.labels and row.kind is not str:
        # a code that means neither on nor off, neither -1 nor 1
        with pytest.raises(ValueError, match=f'code {raw}'):
            row.decode(data, protocol)
        return
    value = row.decode(data, protocol)
    assert type(value) is row.kind
    if row.labels:
        if raw in row.labels:
            assert row.encode(value, protocol) == data
        else:
            # the drive is right: a code the manual does not list is shown as it is [C19]
            assert value == str(raw)
            with pytest.raises(ValueError, match='is none of'):
                row.encode(value, protocol)
        return
    exact = raw * row.factor(protocol)
    assert value == float(exact)
    too_low = row.minimum is not None and exact < row.minimum
    too_high = row.maximum is not None and exact > row.maximum
    if too_low or too_high:
        for encode in (row.encode, row.quantise):
            with pytest.raises(ValueError, match='is out of range'):
                encode(value, protocol)
    else:
        assert row.encode(value, protocol) == data
        assert row.quantise(value, protocol) == data


@given(WORD, WORD)
@example(0, 0)
@example(0xFFFF, 0xFFFF)
@example(0x8000, 0x8000)
@example(0x7FFF, 0x7FFF)
@example(0x7FFF, 0xFFFF)
@example(0xFFFF, 0x7FFF)
@example(0, 0x8000)
def test_every_parameter_there_and_back(low: int, high: int) -> None:
    for row, protocol in PLACES:
        check_there_and_back(row, protocol, data_of(row, protocol, low, high))


@pytest.mark.parametrize(
    ('row', 'protocol'), PLACES, ids=[f'{row.key}-{protocol}' for row, protocol in PLACES]
)
def test_the_edges_of_every_range(row: Parameter, protocol: str) -> None:
    codec = row.at(protocol).number
    factor = row.factor(protocol)
    edges = {0, 1, *row.labels, *(code + 1 for code in row.labels)}
    for bound in (row.minimum, row.maximum):
        if bound is not None:
            edges |= {round(bound / factor) + step for step in (-1, 0, 1)}
    tried = {raw for raw in edges if codec.fits(raw)}
    for raw in tried:
        check_there_and_back(row, protocol, codec.encode(raw))
    assert tried


def as_float32(value: float) -> float:
    """What is left of a number after a tool that computes with single precision."""
    return float(struct.unpack('<f', struct.pack('<f', value))[0])


def check_through_float32(row: Parameter, protocol: str, data: bytes) -> None:
    """Decode bytes, round the value to a float32, and encode that: the same comes back."""
    raw = row.at(protocol).number.decode(data)
    exact = raw * row.factor(protocol)
    low, high = row.span(protocol)
    if row.labels or not low <= exact <= high:
        return
    single = as_float32(float(exact))
    if single.is_integer() or row.kind is float:
        if abs(raw) <= 2**23:
            assert row.encode(single, protocol) == data, row.key
        elif low <= Fraction(single) <= high:
            # one float32 stands for several steps: one of them it has to be
            again = row.decode(row.encode(single, protocol), protocol)
            assert isinstance(again, (int, float))
            assert as_float32(again) == single, row.key


@given(WORD, WORD)
@example(0, 0)
@example(0xFFFF, 0)
@example(0xFFFF, 0xFFFF)
@example(0x7FFF, 0x007F)
@example(0xFFFF, 0x7FFF)
@example(0x86A0, 1)
def test_every_parameter_through_a_float32(low: int, high: int) -> None:
    for row, protocol in PLACES:
        for upper in (high, high & 0x7F):
            check_through_float32(row, protocol, data_of(row, protocol, low, upper))


@given(st.integers(2, 5000))
def test_seconds_as_a_person_types_them(tenths: int) -> None:
    # 0.1 + 0.2 is not 0.3: neither that nor a text of one decimal may be refused
    for seconds in (tenths / 10, tenths * 0.1, float(f'{tenths / 10:.1f}')):
        raw = tenths * 100
        assert G2['control.accel'].encode(seconds) == packed(raw & 0xFFFF, raw >> 16)
        assert G2['control.accel'].encode(seconds, 'classic') == packed(tenths)


@given(st.integers(-1500, 1500))
def test_setpoint_of_a_float32_message(tenths: int) -> None:
    (single,) = struct.unpack('f', struct.pack('f', tenths / 10))
    assert G2['status.frq_set'].encode(single) == packed(tenths & 0xFFFF)
    assert G2['status.frq_set'].quantise(single) == packed(tenths & 0xFFFF)


@given(st.floats(-150, 150))
def test_setpoint_goes_to_the_nearest_step(value: float) -> None:
    row = G2['status.frq_set']
    got = row.decode(row.quantise(value))
    assert isinstance(got, float)
    assert abs(got - value) <= 0.05 + 1e-9


@pytest.mark.parametrize(
    ('key', 'value', 'message'),
    [
        ('control.accel', 0.1, 'control.accel: 0.1 is out of range, 0.2 to 500 s'),
        ('control.accel', 500.1, 'control.accel: 500.1 is out of range, 0.2 to 500 s'),
        ('motor.u_nom', 0, 'motor.u_nom: 0 is out of range, 1 to 1000 V'),
        ('motor.sigma', 2, 'motor.sigma: 2 is out of range, 0.001 to 1'),
        ('motor.i_nom', 0.05, 'motor.i_nom: 0.05 is out of range, at least 0.1 A'),
        ('serial.sio_tot', 25.1, 'serial.sio_tot: 25.1 is out of range, 0 to 25 s'),
        ('status.frq_set', -150.1, 'status.frq_set: -150.1 is out of range, -150 to 150 Hz'),
        ('serial.sio_tot', 2.55, '2.55 lies between two steps of the drive, 2.5 and 2.6'),
        ('motor.u_nom', 230.5, '230.5 lies between two steps of the drive, 230 and 231'),
        ('status.frq_set', -0.05, '-0.05 lies between two steps of the drive, -0.1 and 0'),
        ('control.mode', 'Frequency', "'Frequency' is none of Freque, PI-Reg, Torque, Speed"),
        ('control.mode', '', "'' is none of Freque"),
        ('control.mode', '3', "'3' is none of Freque"),
        ('control.mode', 3, '3 is none of Freque'),
        ('control.mode', True, 'True is none of Freque'),
        ('serial.auto_stop', 'yes', "'yes' is none of OFF, ON"),
        ('serial.auto_stop', 1, '1 is none of OFF, ON'),
        ('serial.si_baud', '9600', "'9600' is none of 1200bps"),
        ('control.accel', 'fast', "control.accel: 'fast' is not a number"),
        ('control.accel', True, 'control.accel: True is not a number'),
        ('control.accel', float('nan'), 'control.accel: nan is not finite'),
        ('control.accel', float('inf'), 'control.accel: inf is not finite'),
        ('motor.u_nom', float('-inf'), 'motor.u_nom: -inf is not finite'),
    ],
)
def test_refusal_says_what_would_be_right(key: str, value: float | str, message: str) -> None:
    with pytest.raises(ValueError) as refusal:
        G2[key].encode(value)
    assert message in str(refusal.value)
    assert str(refusal.value).startswith(f'{key}: ')


@pytest.mark.parametrize('value', [float('nan'), float('inf'), float('-inf'), 150.2, -151.0])
def test_setpoint_that_is_none(value: float) -> None:
    with pytest.raises(ValueError, match=r'status\.frq_set: '):
        G2['status.frq_set'].quantise(value)


def test_value_that_does_not_fit_the_raw_type() -> None:
    # only the raw type bounds a value that has no range
    assert G2['control.f_sleep'].encode(6553.5) == packed(65535)
    with pytest.raises(ValueError, match=r'6553\.6 is out of range, 0 to 6553\.5 Hz'):
        G2['control.f_sleep'].encode(6553.6)
    with pytest.raises(ValueError, match=r'-0\.1 is out of range, at least 0 Hz'):
        G2['control.f_sleep'].encode(-0.1)
    assert G2['motor.p_nom'].encode(100, 'classic') == packed(10000)


def test_switches_are_booleans() -> None:
    row = G2['control.auto_start']
    assert row.decode(packed(0)) is False
    assert row.decode(packed(1)) is True
    assert row.encode(False) == row.encode('OFF') == packed(0)
    assert row.encode(True) == row.encode('ON') == packed(1)


def test_unlisted_code_is_shown_as_its_number() -> None:
    assert G2['control.mode'].decode(packed(4)) == '4'
    assert G2['serial.si_baud'].decode(packed(0)) == '0'


@pytest.mark.parametrize('size', [0, 1, 3, 4, 6])
def test_wrong_number_of_bytes(size: int) -> None:
    with pytest.raises(ValueError, match='sint16_be takes 2 bytes'):
        G2['status.frq_act'].decode(bytes(size))


def test_scale_parameters_of_the_drive() -> None:
    # FrqScl and its like are the factors of whole groups [M0 §8.3], [C16]
    scales = {row.scale for row in G2.values()}
    assert scales == {'', 'FrqScl', 'SpdScl', 'TrqScl', 'RegScl'}
    assert {row.scale: row.factor('modbus') for row in G2.values() if row.scale} == {
        'FrqScl': Fraction(1, 10),
        'SpdScl': 1,
        'TrqScl': 1,
        'RegScl': Fraction(1, 10),
    }
    for row in G2.values():
        if row.scale:
            assert len({place.factor for place in row.addresses.values()}) == 1
            # it may be set finer, so whole numbers would be too few
            assert row.kind is float
