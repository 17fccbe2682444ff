# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Between bytes and numbers: golden values of every codec, there and back, and steps."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
import struct

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import (
    Address,
    Number,
    Parameter,
    Text,
    codec_of,
    load_family,
    to_bytes,
    to_words,
)

#: A codec, a raw number, and its bytes as they go over the bus, written down by hand.
GOLDEN = [
    ('uint8', 200, 'C8'),
    ('sint8', -2, 'FE'),
    ('uint16_be', 0x1234, '12 34'),
    ('uint16_le', 0x1234, '34 12'),
    ('sint16_be', -200, 'FF 38'),
    ('sint16_le', -200, '38 FF'),
    ('uint32_be', 0x12345678, '12 34 56 78'),
    ('uint32_le', 0x12345678, '78 56 34 12'),
    # P-Nom = 100 kW on Modbus: the words 86A0h and 0001h [M0 §6.2.3]
    ('uint32_ws', 100_000, '86 A0 00 01'),
    ('sint32_ws', -1500, 'FA 24 FF FF'),
    ('sint32_be', -1500, 'FF FF FA 24'),
    ('sint32_le', -1500, '24 FA FF FF'),
    # the 8-byte format of the MOVITRAC, by its printed example [C106]
    ('uint32_hb', 100_000, '00 00 00 01 08 06 0A 00'),
    ('sint32_hb', -1, '0F 0F 0F 0F 0F 0F 0F 0F'),
    ('uint16_hb', 0x1F0A, '01 0F 00 0A'),
    ('bcd8', 27, '27'),
    ('bcd16', 1999, '19 99'),
    ('bcd32', 2700, '00 00 27 00'),
    ('bcd32', 99_999_999, '99 99 99 99'),
    ('uint8[0:3]', 5, '05'),
    ('uint8[4:7]', 5, '50'),
    ('uint16_be[8:8]', 1, '01 00'),
    ('uint16_le[8:8]', 1, '00 01'),
    ('uint32_ws[16:23]', 0xAB, '00 00 00 AB'),
    ('string4', 'G2', '47 32 00 00'),
    ('string4', 'SEWA', '53 45 57 41'),
    ('string4', '', '00 00 00 00'),
]
NUMBERS = sorted({name for name, raw, _ in GOLDEN if isinstance(raw, int)})
#: The same again, by the standard library.
LAYOUTS = {'uint16': 'H', 'sint16': 'h', 'uint32': 'I', 'sint32': 'i'}


def number(name: str) -> Number:
    """A codec of numbers."""
    codec = codec_of(name)
    assert isinstance(codec, Number)
    return codec


def refused(call: object, *arguments: object) -> str:
    """What is said against a call."""
    assert callable(call)
    with pytest.raises(ValueError) as refusal:
        call(*arguments)
    return str(refusal.value)


def test_golden_values() -> None:
    for name, raw, printed in GOLDEN:
        codec, data = codec_of(name), bytes.fromhex(printed)
        found = codec.encode(raw), codec.decode(data), codec.size, codec.name
        assert found == (data, raw, len(data), name)


@given(st.data())
def test_every_number_there_and_back(data: st.DataObject) -> None:
    for name in NUMBERS:
        codec = number(name)
        raw = data.draw(st.integers(codec.minimum, codec.maximum))
        assert codec.fits(raw)
        assert len(codec.encode(raw)) == codec.size
        assert codec.decode(codec.encode(raw)) == raw


@given(st.binary(min_size=8, max_size=8))
def test_all_bytes_are_a_number_or_refused(received: bytes) -> None:
    for name in NUMBERS:
        codec = number(name)
        part = received[: codec.size]
        try:
            raw = codec.decode(part)
        except ValueError as error:
            assert str(error).endswith((f'is no {name}', 'are no half-bytes'))
            assert 'bcd' in name or '_hb' in name
            continue
        assert codec.fits(raw)
        # of the bits around a field nothing is known
        assert '[' in name or codec.encode(raw) == part


def test_ends() -> None:
    for name in NUMBERS:
        codec = number(name)
        assert codec.signed == (codec.minimum < 0) == name.startswith('s')
        for end in (codec.minimum, codec.maximum):
            assert codec.decode(codec.encode(end)) == end
        for raw in (codec.minimum - 1, codec.maximum + 1):
            assert not codec.fits(raw)
            assert refused(codec.encode, raw) == f'{raw} does not fit {name}'
        for size in {0, 1, 2, 3, 4, 5, 8, 9} - {codec.size}:
            said = refused(codec.decode, bytes(size))
            assert said == f'{name} takes {codec.size} bytes, not {size}'


@given(st.binary(min_size=4, max_size=4))
def test_orders_as_the_standard_library_has_them(data: bytes) -> None:
    for name, layout in LAYOUTS.items():
        part = data[: struct.calcsize(f'={layout}')]
        assert number(f'{name}_be').decode(part) == struct.unpack(f'>{layout}', part)[0]
        assert number(f'{name}_le').decode(part) == struct.unpack(f'<{layout}', part)[0]
    # the low word first, in words of which the high byte is first
    low, high = struct.unpack('>2H', data)
    assert number('uint32_ws').decode(data) == high << 16 | low
    assert to_words(data) == (low, high)
    assert to_bytes((low, high)) == data


def test_bytes_that_are_no_number() -> None:
    # how a sign stands is not known [C105]
    for data in ('F0023700', '000A0000', '8000000F'):
        said = refused(codec_of('bcd32').decode, bytes.fromhex(data))
        assert said == f'{data.lower()} is no bcd32'
    said = refused(codec_of('uint16_hb').decode, bytes.fromhex('00 10 00 00'))
    assert said == '00 10 00 00 are no half-bytes'


def test_a_sign_is_read_where_the_drive_shows_how_it_codes_it_and_never_written() -> None:
    # -237.0 mV, the value of figure 20, each way that its missing digits may have been [C105]
    codec = number('sbcd32')
    for printed, raw in (
        ('00 02 37 00', 23_700), ('F0 02 37 00', -23_700), ('80 02 37 00', -23_700),
        ('10 02 37 00', -23_700), ('09 99 99 99', 9_999_999), ('F9 99 99 99', -9_999_999),
    ):
        assert codec.decode(bytes.fromhex(printed)) == raw
    for printed in ('20 02 37 00', '99 97 63 00', 'FF FF A3 6C', '00 0A 00 00', 'F0 0A 00 00'):
        data = bytes.fromhex(printed)
        assert refused(codec.decode, data) == f'{data.hex()} is no sbcd32'
    assert codec.encode(23_700) == bytes.fromhex('00 02 37 00')
    assert codec.signed
    for raw in (-1, 10_000_000):
        assert not codec.fits(raw)


@given(st.text(st.characters(max_codepoint=127, exclude_characters='\0'), max_size=12))
def test_text_there_and_back(text: str) -> None:
    codec = codec_of('string12')
    assert isinstance(codec, Text)
    kept = text.rstrip(' ')
    assert codec.decode(codec.encode(kept)) == kept
    if kept != text:
        assert refused(codec.encode, text) == f'{text} does not fit string12'


def test_text_as_devices_fill_it_up() -> None:
    codec = codec_of('string8')
    for data in (b'NFO\0\0\0\0\0', b'NFO     ', b'NFO\0junk', b'NFO  \0\0\0'):
        assert codec.decode(data) == 'NFO'
    assert refused(codec.decode, b'NF\xd6 G2  ') == "b'NF\\xd6 G2  ' is no string8"
    assert refused(codec.decode, b'NFO') == 'string8 takes 8 bytes, not 3'
    # what would not come back
    for text in ('too long', 'µ', 'a\0b', 'a '):
        assert refused(codec_of('string4').encode, text) == f'{text} does not fit string4'


def test_name_of_no_codec() -> None:
    for name in (
        *('', 'int16_be', 'uint16', 'uint8_be', 'uint24_be', 'uint16_bE', 'uint16_be ', 'float32'),
        *('bcd', 'bcd0', 'string0', 'string', 'uint16_be[3]', 'uint16_be[0:16]', 'uint16_be[2:1]'),
        *('sint16_be[0:3]', 'bcd32[0:3]', 'uint16_ws', 'bcd12', 'bcd32_be'),
    ):
        field = name.partition('[')[2].strip(']').replace(':', ' to ')
        said = refused(codec_of, name)
        assert said == f'{name!r} is no codec' or said.endswith(f' has no bits {field}')


# --- as a parameter has them: what a drive takes only some values of ------------------------------


def made(codec: str = 'bcd32', **changed: object) -> Parameter:
    """A parameter in packed decimal digits with two decimals, the rest as given."""
    place = Address('modbus', 'register', 0, None, codec_of(codec), HUNDREDTH, '')
    plain = replace(
        load_family('sinus_g2')['control.accel'],
        key='ramp.up',
        addresses={'modbus': place},
        minimum=None,
        maximum=None,
    )
    return replace(plain, **changed)


HUNDREDTH = Fraction(1, 100)
#: The ramp of a drive that takes fewer values the longer it is.
STEPS = ((0, '0.05'), (10, '0.5'), (100, '5'), (1000, '10'))
TAKEN = [
    Fraction(count, 20)
    for first, last, step in ((0, 200, 1), (200, 2000, 10), (2000, 20000, 100), (20000, 40001, 200))
    for count in range(first, last, step)
]
RAMP = made(
    minimum=Fraction(0),
    maximum=Fraction(2000),
    steps=tuple((Fraction(start), Fraction(step)) for start, step in STEPS),
)


@given(st.sampled_from(TAKEN), st.floats(0, 2000))
def test_a_set_point_goes_to_the_nearest_step(step: Fraction, value: float) -> None:
    assert RAMP.decode(RAMP.encode(float(step))) == float(step)
    nearest = min(abs(value - float(taken)) for taken in TAKEN)
    kept = RAMP.decode(RAMP.quantise(value))
    assert isinstance(kept, float)
    assert Fraction(kept).limit_denominator(100) in TAKEN
    assert abs(kept - value) <= nearest + 1e-9


def test_what_is_between_two_steps_is_refused_with_both() -> None:
    for value, below, above in (
        *((0.01, '0', '0.05'), (3.72, '3.7', '3.75'), (9.96, '9.95', '10'), (10.05, '10', '10.5')),
        *((99.75, '99.5', '100'), (101, '100', '105'), (1999, '1990', '2000')),
    ):
        said = f'ramp.up: {value} lies between two steps of the drive, {below} and {above}'
        assert refused(RAMP.encode, value) == said
    assert refused(RAMP.encode, 2001) == 'ramp.up: 2001 is out of range, 0 to 2000 s'


def test_what_the_steps_are() -> None:
    assert (RAMP.step(), made().step()) == (Fraction('0.05'), HUNDREDTH)
    assert RAMP.shown_steps == '0.05, 0.5 from 10, 5 from 100, 10 from 1000'
    assert all(map(RAMP.on_step, (0, 0.05, 9.95, 10, 10.5, 2000)))
    assert not any(map(RAMP.on_step, (-0.05, 0.01, 10.05, 102)))
    assert made().on_step(0.001)
    # they need not begin at zero
    low = Fraction('0.1')
    gain = made(minimum=low, maximum=Fraction(9), steps=((low, 20 * HUNDREDTH),))
    assert gain.decode(gain.encode(0.3)) == 0.3
    assert '0.1 and 0.3' in refused(gain.encode, 0.2)


def test_the_value_of_an_enumeration_is_its_code() -> None:
    for labels, value, code in (
        ({0: 'Coast', 1: 'Ramp'}, 'Ramp', '00000100'),
        ({0: 'No', 1: 'Yes'}, True, '00000100'),
        ({0: 'No', 1: 'Yes'}, False, '00000000'),
        ({0: 'On', 1: 'Off'}, 'Off', '00000100'),
        ({0: '50', 3: '104'}, 104, '00000300'),
    ):
        row = made(labels=labels)
        assert row.encode(value) == bytes.fromhex(code)
        assert row.decode(bytes.fromhex(code)) == value
        assert type(value) is row.kind
    ramp, switch = made(labels={0: 'Coast', 1: 'Ramp'}), made(labels={0: 'No', 1: 'Yes'})
    said = refused(ramp.decode, bytes.fromhex('00000150'))
    assert said.endswith('has code 1.5, which is none of Coast, Ramp')
    said = refused(switch.decode, bytes.fromhex('00000200'))
    assert said.endswith('has code 2, which is none of No, Yes')
    assert ramp.decode(bytes.fromhex('00000700')) == '7'


def test_labels_that_are_numbers_have_a_span_and_a_step() -> None:
    for family, key, span, step in (
        ('movitrac31', 'frequency.f_base_1', (50, 120), 1),
        ('movitrac31', 'control.pulses_per_revolution', (128, 2048), 128),
        # one of two numbers, with nothing between them [C46]
        ('sinus_g2', 'pi_reg.reg_amp', (-1, 1), 2),
    ):
        row = load_family(family)[key]
        protocol = next(iter(row.addresses))
        assert (row.span(protocol), row.step(protocol)) == (span, step), key


def test_value_that_is_a_text() -> None:
    row = made('string8')
    assert row.kind is str
    assert row.decode(b'4018 A\0\0') == '4018 A'
    assert row.encode('4018 B') == b'4018 B\0\0'
    assert refused(row.encode, 'longer than that') == 'longer than that does not fit string8'
    assert not row.never_negative
    assert refused(row.span) == 'string8 is no number'
