# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""Between bytes and numbers: golden values of every codec, and there and back."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
import struct

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import Number, Text, codec_of, load_family, to_bytes, to_words

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


@pytest.mark.parametrize(('name', 'raw', 'data'), GOLDEN)
def test_golden_value(name: str, raw: int | str, data: str) -> None:
    codec = codec_of(name)
    assert codec.encode(raw) == bytes.fromhex(data)  # type: ignore[arg-type]
    assert codec.decode(bytes.fromhex(data)) == raw
    assert codec.size == len(bytes.fromhex(data))
    assert codec.name == name


@pytest.mark.parametrize('name', NUMBERS)
@given(data=st.data())
def test_every_number_there_and_back(name: str, data: st.DataObject) -> None:
    codec = number(name)
    raw = data.draw(st.integers(codec.minimum, codec.maximum))
    assert codec.fits(raw)
    assert len(codec.encode(raw)) == codec.size
    assert codec.decode(codec.encode(raw)) == raw


@pytest.mark.parametrize('name', NUMBERS)
@given(data=st.data())
def test_all_bytes_are_a_number_or_refused(name: str, data: st.DataObject) -> None:
    codec = number(name)
    received = data.draw(st.binary(min_size=codec.size, max_size=codec.size))
    try:
        raw = codec.decode(received)
    except ValueError as error:
        assert str(error).endswith((f'is no {name}', 'are no half-bytes'))
        assert 'bcd' in name or '_hb' in name
        return
    assert codec.fits(raw)
    # of the bits around a field nothing is known
    assert '[' in name or codec.encode(raw) == received


@pytest.mark.parametrize('name', NUMBERS)
def test_ends(name: str) -> None:
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


def test_two_fields_of_one_number() -> None:
    data = bytes.fromhex('0B 40')
    assert number('uint16_be[0:7]').decode(data) == 0x40
    assert number('uint16_be[8:15]').decode(data) == 11
    assert number('uint16_be[6:6]').decode(data) == 1
    joined = (a | b for a, b in zip(
        number('uint16_be[0:7]').encode(0x40), number('uint16_be[8:15]').encode(11), strict=True
    ))
    assert bytes(joined) == data


@pytest.mark.parametrize('data', ['F0 02 37 00', '00 0A 00 00', '80 00 00 0F'])
def test_bytes_that_are_no_digits(data: str) -> None:
    # nobody knows how a sign stands [C105]
    said = refused(codec_of('bcd32').decode, bytes.fromhex(data))
    assert said == f'{data.replace(" ", "").lower()} is no bcd32'


def test_bytes_that_are_no_half_bytes() -> None:
    said = refused(codec_of('uint16_hb').decode, bytes.fromhex('00 10 00 00'))
    assert said == '00 10 00 00 are no half-bytes'


@given(st.text(st.characters(max_codepoint=127, exclude_characters='\0'), max_size=12))
def test_text_there_and_back(text: str) -> None:
    codec = codec_of('string12')
    assert isinstance(codec, Text)
    kept = text.rstrip(' ')
    assert codec.decode(codec.encode(kept)) == kept
    if kept != text:
        assert refused(codec.encode, text) == f'{text} does not fit string12'


@pytest.mark.parametrize('text', ['too long', 'µ', 'a\0b', 'a '])
def test_text_that_would_not_come_back(text: str) -> None:
    assert refused(codec_of('string4').encode, text) == f'{text} does not fit string4'


def test_text_as_devices_fill_it_up() -> None:
    codec = codec_of('string8')
    for data in (b'NFO\0\0\0\0\0', b'NFO     ', b'NFO\0junk', b'NFO  \0\0\0'):
        assert codec.decode(data) == 'NFO'
    assert refused(codec.decode, b'NF\xd6 G2  ') == "b'NF\\xd6 G2  ' is no string8"
    assert refused(codec.decode, b'NFO') == 'string8 takes 8 bytes, not 3'


@pytest.mark.parametrize(
    'name',
    [
        *('', 'int16_be', 'uint16', 'uint8_be', 'uint24_be', 'uint16_bE', 'uint16_be ', 'float32'),
        *('bcd', 'bcd0', 'string0', 'string', 'uint16_be[3]', 'uint16_be[0:16]', 'uint16_be[2:1]'),
        *('sint16_be[0:3]', 'bcd32[0:3]', 'uint16_ws', 'bcd12', 'bcd32_be'),
    ],
)
def test_name_of_no_codec(name: str) -> None:
    field = name.partition('[')[2].strip(']').replace(':', ' to ')
    said = refused(codec_of, name)
    assert said == f'{name!r} is no codec' or said.endswith(f' has no bits {field}')


# --- as a parameter has them ----------------------------------------------------------------------


def test_value_with_two_decimals() -> None:
    row = load_family('sinus_g2')['control.kp_spd']
    place = replace(row.addresses['modbus'], codec=codec_of('bcd32'), factor=Fraction(1, 100))
    row = replace(row, addresses={'modbus': place}, minimum=None)
    assert row.decode(bytes.fromhex('00 00 27 50')) == 27.5
    assert row.encode(123456.78) == bytes.fromhex('12 34 56 78')
    assert row.span() == (0, Fraction('999999.99'))
    assert refused(row.encode, 0.001).endswith('lies between two steps of the drive, 0 and 0.01')
    assert refused(row.encode, -1).endswith('is out of range, at least 0')


def test_value_that_is_a_text() -> None:
    row = load_family('sinus_g2')['fieldbus.nfo_ver']
    place = replace(row.addresses['modbus'], codec=codec_of('string8'))
    row = replace(row, addresses={'modbus': place})
    assert row.kind is str
    assert row.decode(b'4018 A\0\0') == '4018 A'
    assert row.encode('4018 B') == b'4018 B\0\0'
    assert refused(row.encode, 'longer than that') == 'longer than that does not fit string8'
    assert not row.never_negative
    assert refused(row.span) == 'string8 is no number'
