# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The tables of the MOVITRAC 31: what there is, and values as bytes, by the manual [M4]."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
import math

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.catalog import Access, Kind, Meaning, Parameter, load_family

MOVITRAC = load_family('movitrac31')
BUS = 'movitrac'
BY_CODEC: dict[str, list[Parameter]] = {}
for _row in MOVITRAC.values():
    BY_CODEC.setdefault(_row.at(BUS).codec.name, []).append(_row)
#: Every value that the bytes of packed digits can have.
COUNTS = st.integers(0, 99_999_999)

#: What the driver writes to command the drive, or never.
NO_SETTINGS = {
    'fieldbus.remote_setpoint': 223,
    'fieldbus.function_bits': 281,
    'fieldbus.factory_setting': 203,
    'fieldbus.ipos_programs': 704,
    'fieldbus.ipos_operating_mode': 705,
}
#: What ends or disturbs the communication, and how long it may be silent.
COMMUNICATION = {196, 205, 206, 207, 212, 285}
#: Options without which none of a whole chapter does anything: IPOS (index 700 to 1017), the
#: synchronous operation (P550 to P557, P760 to P769), the fieldbus (P560 to P572).
CHAPTERS = {'FPI', 'FRS', 'FFI or FFP'}


def index(row: Parameter) -> int:
    """Where a parameter stands."""
    return row.at(BUS).index


def test_how_many_there_are() -> None:
    assert len(MOVITRAC) == 315
    assert {len(row.addresses) for row in MOVITRAC.values()} == {1}
    access = Counter(row.access for row in MOVITRAC.values())
    # 239 are printed as writable: of those 13 have eight bytes and 5 more can be negative
    assert access == {Access.READ_WRITE: 239 - 13 - 5, Access.READ: 76 + 13 + 5}
    settings = {row.key for row in MOVITRAC.settings}
    assert len(settings) == 221 - len(NO_SETTINGS)


def test_what_commands_or_resets_is_no_setting() -> None:
    for key, number in NO_SETTINGS.items():
        assert index(MOVITRAC[key]) == number
        assert MOVITRAC[key].access is Access.READ_WRITE
        assert not MOVITRAC[key].is_setting


def test_what_disturbs_the_communication_is_guarded() -> None:
    assert {index(MOVITRAC[key]) for key in MOVITRAC.communication} == COMMUNICATION


def test_what_may_be_negative_or_has_eight_bytes_is_only_read() -> None:
    for row in MOVITRAC.values():
        negative = row.minimum is not None and row.minimum < 0
        if negative or row.at(BUS).codec.size == 8:
            assert row.access is Access.READ, row.key
    eight = [row for row in MOVITRAC.values() if row.at(BUS).codec.size == 8]
    assert len(eight) == 15


def test_what_needs_no_option_card() -> None:
    # 239 less the 30 of IPOS, the 18 of synchronous operation, the 9 of the fieldbus and the two
    # process values are 180
    basic = [row for row in MOVITRAC.values() if row.option not in CHAPTERS]
    writable = {row.key for row in basic if row.access is Access.READ_WRITE}
    writable |= {'setpoint.n2_offset'}  # printed as writable, and may be negative
    assert len(writable - {'fieldbus.remote_setpoint', 'fieldbus.function_bits'}) == 180
    # of these some are about terminals, encoders and interfaces that only a card has
    cards = Counter(row.option for row in MOVITRAC.settings)
    assert cards == {
        '': 149,
        'FEA': 5,
        'FIO': 7,
        'FEA or FIO': 9,
        'FEN or FPI': 8,
        'FFI or FFP': 9,
        'FRS': 10,
        'FPI': 19,
    }


def test_number_and_index_are_told_before_the_meaning() -> None:
    for row in MOVITRAC.values():
        told, _, meaning = row.description.partition(': ')
        assert meaning, row.key
        assert told.lower().endswith(f'index {index(row)}'), row.key
        assert told.startswith(('P', 'Index ')), row.key


@pytest.mark.parametrize(
    ('key', 'data', 'value'),
    [
        # the examples of the manual: §2.4.3, §2.4.4, figure 23 [C106]
        ('status.heat_sink_temperature', '00002550', 25.5),
        ('ramp.t11_up', '00000370', 3.7),
        ('control.frs_master_gear_ratio', '000000010806 0A00', 100_000),
        # 821 123 4.11 and 821 123 X.11
        ('special.software_system', '21123411', 0x21123411),
        ('special.software_system', '211234A1', 0x211234A1),
        ('status.inverter_type', '00310000', 'MOVITRAC 31..'),
        ('serial.control_mode', '00000200', 'Remote control'),
        ('frequency.f_base_1', '00000300', 104),
        ('motor.pwm_frequency_1', '00000400', '16 kHz'),
        ('special.parameter_lock', '00000100', True),
        ('special.save_to_eeprom', '00000100', 'Off'),
        ('terminal.input_43', '00001600', 'CW/Stop'),
        ('terminal.input_43', '00001700', 'No function (17)'),
        ('status.fault_t0', '00004500', 45.0),
        ('status.fault_t0', '00000000', 0.0),
        ('fieldbus.function_bits', '00000105', 0x105),
        ('fieldbus.inverter_status', '2D010110', 0x2D010110),
        ('fieldbus.remote_setpoint', '00040000', 400.0),
        ('ipos.actual_position', '0F0F0F0F0F0F0F0E', -2),
    ],
)
def test_golden_values(key: str, data: str, value: float | int | str | bool) -> None:
    row = MOVITRAC[key]
    found = row.decode(bytes.fromhex(data), BUS)
    assert found == value
    assert type(found) is type(value) is row.kind
    assert row.encode(value, BUS) == bytes.fromhex(data)


@given(COUNTS)
def test_packed_digits_there_and_back(count: int) -> None:
    data = bytes.fromhex(f'{count:08d}')
    for row in BY_CODEC['bcd32']:
        if row.labels:
            continue
        value = row.decode(data, BUS)
        assert value == count / 100
        low, high = row.span(BUS)
        if low <= Fraction(count, 100) <= high and row.on_step(float(value)):
            assert row.encode(value, BUS) == data
        else:
            with pytest.raises(ValueError, match=r'out of range|between two steps'):
                row.encode(value, BUS)


@given(st.integers(0, 999))
def test_enumerations_there_and_back(code: int) -> None:
    data = bytes.fromhex(f'{code:06d}00')
    for row in BY_CODEC['bcd32']:
        if not row.labels:
            continue
        if code in row.labels:
            assert row.encode(row.decode(data, BUS), BUS) == data
        elif row.kind is str:
            assert row.decode(data, BUS) == str(code)
        else:
            with pytest.raises(ValueError, match=f'has code {code}, which is none of'):
                row.decode(data, BUS)


@given(st.integers(0, 0xFFFFFFFF))
def test_words_there_and_back(word: int) -> None:
    for row in BY_CODEC['uint32_be']:
        data = word.to_bytes(4, 'big')
        assert row.decode(data, BUS) == word
        assert row.encode(word, BUS) == data


@given(st.integers(0, 0xFFFFFFFF))
def test_eight_bytes_are_half_bytes(number: int) -> None:
    data = bytes(int(digit, 16) for digit in f'{number:08X}')
    for row in (*BY_CODEC['uint32_hb'], *BY_CODEC['sint32_hb']):
        signed = row.at(BUS).codec.name == 'sint32_hb'
        meant = number - (1 << 32) if signed and number >> 31 else number
        assert row.decode(data, BUS) == meant
    with pytest.raises(ValueError, match='no half-bytes'):
        row.decode(b'\x10' + data[1:], BUS)


@pytest.mark.parametrize('first', ['F', 'A'])
def test_a_sign_is_not_guessed(first: str) -> None:
    for key in ('setpoint.n2_offset', 'status.heat_sink_temperature'):
        with pytest.raises(ValueError, match='is no bcd32'):
            MOVITRAC[key].decode(bytes.fromhex(f'{first}0023700'), BUS)


def test_status_codes() -> None:
    numbers = [row for row in MOVITRAC.status_codes.values() if row.code < 100]
    faults = [row for row in MOVITRAC.status_codes.values() if row.code >= 100]
    assert [row.code for row in numbers] == list(range(20))
    assert {row.kind for row in numbers} == {Kind.STATUS}
    # 88 codes less the one that is no fault and the 37 without a function
    assert len(faults) == 88 - 1 - 37
    assert all(row.kind is Kind.FAULT and row.requires_ack for row in faults)
    assert all(row.description and row.remedy for row in faults)
    # who has control is told by P841 alone
    assert all(Meaning.ANONYMOUS in row.meanings for row in (*numbers, *faults))
    timed_out = [row.code for row in faults if Meaning.SERIAL_FAILURE in row.meanings]
    assert timed_out == [145]


def test_roles() -> None:
    indices = {role.value: index(MOVITRAC[key]) for role, key in MOVITRAC.roles.items()}
    assert indices == {
        'status_word': 284,
        'control_source': 205,
        'local_operation': 196,
        'actual_frequency': 0,
        'actual_speed': 17,
        'output_voltage': 1,
        'dc_link_voltage': 2,
        'pole_pairs': 106,
        'communication_timeout': 285,
        'bus_address': 206,
    }


@pytest.mark.parametrize('raw', [1, 45, 99, 4501, 15_500, 99_999_900])
def test_only_whole_numbers_are_fault_codes(raw: int) -> None:
    # InvSt has one byte for a code
    area = MOVITRAC.error_logs[BUS]
    assert area.code(raw) == 255
    assert area.unknown(raw) == f'unknown code (raw {raw})'


def test_error_log() -> None:
    area = MOVITRAC.error_logs[BUS]
    # P060 to P064
    keys = [f'status.fault_t{number}' for number in range(5)]
    assert [area.address(number) for number in range(5)] == [index(MOVITRAC[key]) for key in keys]
    assert [area.code(count) for count in (0, 100, 4500, 8700)] == [0, 101, 145, 187]
    assert not any(map(area.unknown, (0, 100, 4500, 8700)))
    assert not area.timed
    assert math.isnan(area.hours(4500))
    # the fault memory; inverter status and terminals are not decoded [C77]
    kept = [[index(MOVITRAC[key]) for _, key in area.readings_of(one)] for one in range(5)]
    assert kept[0] == [400, 402, 403, 404, 406]
    assert kept[4] == [436, 438, 439, 440, 442]


@pytest.mark.parametrize(('number', 'first'), list(enumerate((400, 409, 418, 427, 436))))
def test_fault_memory(number: int, first: int) -> None:
    kept = [row for row in MOVITRAC.values() if row.name.startswith(f'Fault t-{number} ')]
    assert [index(row) - first for row in kept] == [0, 2, 3, 4, 6, 7, 8]
    assert [row.at(BUS).codec.name for row in kept] == ['bcd32'] * 5 + ['uint32_be'] * 2
