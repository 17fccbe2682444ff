# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""What a drive takes only some values of, and enumerations whose codes are values."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
import re

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import Address, Parameter, codec_of, load_family

BUS = 'modbus'
HUNDREDTH = Fraction(1, 100)
#: The ramp of a drive that takes fewer values the longer it is.
STEPS = ((0, '0.05'), (10, '0.5'), (100, '5'), (1000, '10'))
TAKEN = [
    Fraction(count, 20)
    for first, last, step in ((0, 200, 1), (200, 2000, 10), (2000, 20000, 100), (20000, 40001, 200))
    for count in range(first, last, step)
]


def made(**changed: object) -> Parameter:
    """A parameter in packed decimal digits with two decimals, the rest as given."""
    place = Address(BUS, 'register', 0, None, codec_of('bcd32'), HUNDREDTH, '')
    plain = replace(
        load_family('sinus_g2')['control.accel'],
        key='ramp.up',
        addresses={BUS: place},
        unit='s',
        minimum=None,
        maximum=None,
    )
    return replace(plain, **changed)  # type: ignore[arg-type]


RAMP = made(
    minimum=Fraction(0),
    maximum=Fraction(2000),
    steps=tuple((Fraction(start), Fraction(step)) for start, step in STEPS),
)


@given(st.sampled_from(TAKEN))
def test_what_is_on_a_step_comes_back(value: Fraction) -> None:
    assert RAMP.decode(RAMP.encode(float(value))) == float(value)


@pytest.mark.parametrize(
    ('value', 'below', 'above'),
    [
        (0.01, '0', '0.05'),
        (3.72, '3.7', '3.75'),
        (9.96, '9.95', '10'),
        (10.05, '10', '10.5'),
        (99.75, '99.5', '100'),
        (101, '100', '105'),
        (1999, '1990', '2000'),
    ],
)
def test_what_is_between_two_is_refused_with_both(value: float, below: str, above: str) -> None:
    said = f'ramp.up: {value} lies between two steps of the drive, {below} and {above}'
    with pytest.raises(ValueError, match=re.escape(said) + '$'):
        RAMP.encode(value)


def test_what_is_out_of_range_is_said_to_be_that() -> None:
    with pytest.raises(ValueError, match='2001 is out of range, 0 to 2000 s'):
        RAMP.encode(2001)


@given(st.floats(0, 2000))
def test_a_set_point_goes_to_the_nearest_step(value: float) -> None:
    nearest = min(abs(value - float(taken)) for taken in TAKEN)
    kept = RAMP.decode(RAMP.quantise(value))
    assert isinstance(kept, float)
    assert Fraction(kept).limit_denominator(100) in TAKEN
    assert abs(kept - value) <= nearest + 1e-9


def test_what_the_steps_are_is_told() -> None:
    assert RAMP.step() == Fraction('0.05')
    assert made().step() == HUNDREDTH
    assert RAMP.shown_steps == '0.05, 0.5 from 10, 5 from 100, 10 from 1000'


def test_what_is_on_a_step() -> None:
    assert all(map(RAMP.on_step, (0, 0.05, 9.95, 10, 10.5, 2000)))
    assert not any(map(RAMP.on_step, (-0.05, 0.01, 10.05, 102)))
    assert made().on_step(0.001)


def test_steps_need_not_begin_at_zero() -> None:
    low = Fraction('0.1')
    gain = made(minimum=low, maximum=Fraction(9), steps=((low, 20 * HUNDREDTH),))
    assert gain.decode(gain.encode(0.3)) == 0.3
    with pytest.raises(ValueError, match=r'0\.1 and 0\.3'):
        gain.encode(0.2)


@pytest.mark.parametrize(
    ('labels', 'value', 'code'),
    [
        ({0: 'Coast', 1: 'Ramp'}, 'Ramp', '00000100'),
        ({0: 'No', 1: 'Yes'}, True, '00000100'),
        ({0: 'No', 1: 'Yes'}, False, '00000000'),
        ({0: 'On', 1: 'Off'}, 'Off', '00000100'),
        ({0: '50', 3: '104'}, 104, '00000300'),
    ],
)
def test_the_value_of_an_enumeration_is_its_code(
    labels: dict[int, str], value: bool | int | str, code: str
) -> None:
    row = made(labels=labels)
    assert row.encode(value) == bytes.fromhex(code)
    assert row.decode(bytes.fromhex(code)) == value
    assert type(value) is row.kind


def test_a_code_that_is_none() -> None:
    with pytest.raises(ValueError, match=r'has code 1\.5, which is none of Coast, Ramp'):
        made(labels={0: 'Coast', 1: 'Ramp'}).decode(bytes.fromhex('00000150'))
    with pytest.raises(ValueError, match='has code 2, which is none of No, Yes'):
        made(labels={0: 'No', 1: 'Yes'}).decode(bytes.fromhex('00000200'))
    assert made(labels={0: 'Coast', 1: 'Ramp'}).decode(bytes.fromhex('00000700')) == '7'


@pytest.mark.parametrize(
    ('family', 'key', 'span', 'step'),
    [
        ('movitrac31', 'frequency.f_base_1', (50, 120), 1),
        ('movitrac31', 'control.pulses_per_revolution', (128, 2048), 128),
        # one of two numbers, with nothing between them [C46]
        ('sinus_g2', 'pi_reg.reg_amp', (-1, 1), 2),
    ],
)
def test_labels_that_are_numbers_have_a_span_and_a_step(
    family: str, key: str, span: tuple[int, int], step: int
) -> None:
    parameter = load_family(family)[key]
    protocol = next(iter(parameter.addresses))
    assert parameter.span(protocol) == span
    assert parameter.step(protocol) == step
