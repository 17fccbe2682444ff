# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The Optimal's registers, transcribed once more from [M1]."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from hypothesis import example, given, strategies as st
import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import Access, families, family, load_family
from nfo_sinus_driver.drive.settings import DriveSettings

G2 = load_family('sinus_g2')
OPTIMAL = load_family('sinus_optimal')
#: All registers that [M1] prints: key, ADI, first and last register, type, access, a value in its
#: unit and the words that mean it.
ROWS = [
    ('status.i_rms', 120, 0x3EC, 0x3ED, 'SINT32', 'r', 'A', 70.123, (0x11EB, 0x0001)),
    ('status.p_out', 121, 0x3F0, 0x3F1, 'SINT32', 'r', 'W', -70000, (0xEE90, 0xFFFE)),
    ('status.pf', 122, 0x3F4, 0x3F4, 'SINT16', 'r', '', -0.85, (0xFCAE,)),
    ('status.frq_act', 125, 0x400, 0x400, 'SINT16', 'r', 'Hz', -49.9, (0xFE0D,)),
    ('status.control_freq', 195, 0x518, 0x518, 'SINT16', 'r', 'Hz', 50.0, (500,)),
    ('status.spd_act', 22, 0x264, 0x264, 'SINT16', 'r', 'rpm', -1480, (0xFA38,)),
    ('status.control_speed', 21, 0x260, 0x260, 'SINT16', 'r', 'rpm', 1500, (1500,)),
    ('status.op_time', 39, 0x2A8, 0x2A9, 'UINT32', 'r', 'h', 1234.56, (0xE240, 0x0001)),
    ('status.rn_time', 40, 0x2AC, 0x2AD, 'UINT32', 'r', 'h', 42949672.95, (0xFFFF, 0xFFFF)),
    ('fieldbus.mode', 34, 0x294, 0x294, 'UINT16', 'rw', '', 3, (3,)),
    ('fieldbus.smode', 35, 0x298, 0x298, 'UINT16', 'w', '', 257, (0x101,)),
    ('fieldbus.input_freq_setpoint', 124, 0x3FC, 0x3FC, 'SINT16', 'rw', 'Hz', 12.5, (125,)),
    ('fieldbus.input_speed_setpoint', 20, 0x25C, 0x25C, 'SINT16', 'rw', 'rpm', -1, (0xFFFF,)),
    ('fieldbus.inv_st_with_ack', 38, 0x2A4, 0x2A4, 'UINT16', 'ack', '', 12, (12,)),
    ('fieldbus.inv_st', 38, 0x2A5, 0x2A5, 'UINT16', 'r', '', 63, (63,)),
    ('fieldbus.drive_control', 18, 0x254, 0x254, 'UINT16', 'rw', '', 0x4009, (0x4009,)),
    ('fieldbus.drive_status', 19, 0x258, 0x258, 'UINT16', 'r', '', 0x8207, (0x8207,)),
]
WORD = st.integers(0, 0xFFFF)


def test_all_that_the_manual_prints_and_nothing_else() -> None:
    assert list(OPTIMAL) == [row[0] for row in ROWS]


@pytest.mark.parametrize(
    ('key', 'adi', 'first', 'last', 'type_', 'access', 'unit', 'value', 'words'),
    ROWS,
    ids=[row[0] for row in ROWS],
)
def test_register(
    key: str,
    adi: int,
    first: int,
    last: int,
    type_: str,
    access: str,
    unit: str,
    value: float,
    words: tuple[int, ...],
) -> None:
    row = OPTIMAL[key]
    place = row.at('modbus')
    assert place.occupied == [(number,) for number in range(first, last + 1)]
    # the status without acknowledging is the second register of its ADI
    assert place.index == 0x210 + 4 * (adi - 1) + (key == 'fieldbus.inv_st')
    assert f'M1 ADI {adi}' in row.source.split('; ')
    assert place.codec.name == f'{type_.lower()}_{"ws" if last > first else "be"}'
    assert row.access is Access(access)
    assert row.unit == unit
    assert row.decode(packed(*words)) == pytest.approx(value, abs=1e-9)
    assert row.encode(value) == packed(*words)


def test_registers_are_used_once() -> None:
    used = [number for row in OPTIMAL.values() for number in row.at('modbus').occupied]
    assert max(Counter(used).values()) == 1
    assert len(used) == 21


def test_nothing_that_is_not_printed() -> None:
    for row in OPTIMAL.values():
        assert set(row.addresses) == {'modbus'}, row.key  # of Classic [M1] says nothing
        assert (row.minimum, row.maximum, row.since) == (None, None, None), row.key
        assert row.scale == '', row.key  # nor of FrqScl and its like
        assert not row.stopped, row.key
        assert not row.labels, row.key
        assert row.description, row.key


def test_the_same_thing_has_the_same_key() -> None:
    # the same register and the same key on both, but for what only looks alike [C52] [C53]
    modbus = [row for row in G2.values() if 'modbus' in row.addresses]
    g2 = {row.at('modbus').index: row.key for row in modbus}
    other = {
        0x518: ('status.control_freq', None),
        0x260: ('status.control_speed', None),
        0x298: ('fieldbus.smode', 'fieldbus.scmd'),
        0x3FC: ('fieldbus.input_freq_setpoint', 'status.frq_set'),
        0x25C: ('fieldbus.input_speed_setpoint', 'status.spd_set'),
    }
    for row in OPTIMAL.values():
        address = row.at('modbus').index
        mine, theirs = other.get(address, (row.key, row.key))
        assert (row.key, g2.get(address)) == (mine, theirs)
        assert theirs is None or row.unit == G2[theirs].unit


def test_counters_are_not_those_of_the_g2() -> None:
    # 36 s a tick against a tenth of an hour: ten times wrong if mixed [C48]
    for key in ('status.op_time', 'status.rn_time'):
        assert OPTIMAL[key].decode(packed(100, 0)) == 1
        assert G2[key].decode(packed(100, 0)) == 10
        assert OPTIMAL[key].decode(packed(0, 0x8000)) == pytest.approx(21474836.48)


@given(WORD, WORD)
@example(0, 0)
@example(0xFFFF, 0xFFFF)
@example(0x8000, 0x8000)
@example(0x7FFF, 0x7FFF)
@example(0x7FFF, 0xFFFF)
@example(0xFFFF, 0x7FFF)
def test_every_register_there_and_back(low: int, high: int) -> None:
    for row in OPTIMAL.values():
        place = row.at('modbus')
        data = packed(low, high)[: place.codec.size]
        value = row.decode(data)
        assert type(value) is row.kind
        assert isinstance(value, (int, float))
        assert value == float(place.number.decode(data) * row.factor('modbus'))
        assert row.encode(value) == data
        assert row.quantise(value) == data


def test_it_is_one_of_the_models() -> None:
    assert OPTIMAL.name == 'sinus_optimal'
    assert OPTIMAL.name in families()
    assert DriveSettings(model='sinus_optimal').model == OPTIMAL.name


def test_the_tables_have_the_columns_of_the_others() -> None:
    folder = Path(family.__file__).parents[1] / 'families'
    for name in ('parameters', 'addresses', 'status_codes', 'roles'):
        headers = set()
        for drive in families():
            with (folder / drive / f'{name}.csv').open(encoding='utf-8', newline='') as stream:
                columns = stream.readline().strip().split(',')
            # these two may be left out
            headers.add(tuple(one for one in columns if one not in ('steps', 'option')))
        assert len(headers) == 1, name
