# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""One numbering behind all buses: the addresses of a parameter check each other."""

from __future__ import annotations

from collections import Counter

import pytest

from nfo_sinus_driver.catalog import Parameter, load_family

G2 = load_family('sinus_g2')
MODBUS = [parameter for parameter in G2.values() if 'modbus' in parameter.addresses]
CLASSIC = [parameter for parameter in G2.values() if 'classic' in parameter.addresses]

#: How many parameters each group has, counted on paper in [M0 table 4] and, for the field bus,
#: [M0 table 3] and [M0 table 5]; Tuning is no parameter but a command.
COUNTS = {
    'Motor': 12,
    'Control': 15,  # AnyBus is in [M0 table 2] only
    'Freque': 10,
    'Speed': 10,
    'Torque': 11,
    'PI Reg': 21,
    'Output': 6,
    'Serial': 7,
    'Status': 20,
    'Error': 28,  # without the error log
    'Fieldbus': 15,  # without the four set-points of Status, and without what is to be defined
}

#: ParameterAccess that are not the first of their instance, and by how many.
OFFSETS = {
    'control.accel': 2,  # the time of a ramp, behind its speed [C46]
    'control.retard': 2,
    'fieldbus.inv_st': 1,  # beside the one that acknowledges
    'fieldbus.spd_scl_denominator': 2,  # behind the numerator
}

#: Two that are one object on PROFIBUS and CANopen, told apart by its sub-index [M0 table 10].
ONE_OBJECT = {
    1038: ['fieldbus.inv_st_with_ack', 'fieldbus.inv_st'],
    1023: ['fieldbus.spd_scl_numerator', 'fieldbus.spd_scl_denominator'],
}

#: What only Classic has, so there is no instance [M0 table 2, table 3].
CLASSIC_ONLY = {'control.any_bus', 'fieldbus.sio_err', 'fieldbus.setpoint'}

#: What Classic lacks: to be defined, says the manual [C27].
MODBUS_ONLY = {
    'fieldbus.drv_ctrl_write_mask',
    'fieldbus.profidrive_control',
    'fieldbus.profidrive_status',
}


def instance(parameter: Parameter) -> int:
    """The number that all buses count from (ADI)."""
    return parameter.at('profibus').index - 1000


def test_count_of_every_group() -> None:
    assert Counter(row.group for row in G2.values()) == COUNTS
    assert sum(COUNTS.values()) == len(G2) == 155


def test_keys_and_addresses_are_unique() -> None:
    registers = [
        register
        for parameter in MODBUS
        for register in range(
            parameter.at('modbus').index,
            parameter.at('modbus').index + parameter.at('modbus').codec.size // 2,
        )
    ]
    ids = [number for p in CLASSIC for number in p.at('classic').numbers]
    assert len(set(registers)) == len(registers)
    assert len(set(ids)) == len(ids)
    assert len({(parameter.group, parameter.name) for parameter in G2.values()}) == len(G2)


def test_numbers_of_profibus_and_canopen_are_unique() -> None:
    for protocol, first in (('profibus', 0), ('canopen', 1)):
        keys: dict[int, list[str]] = {}
        for key, row in G2.items():
            if protocol in row.addresses:
                keys.setdefault(row.at(protocol).index, []).append(key)
        shared = [names for names in keys.values() if len(names) > 1]
        assert sorted(shared) == sorted(ONE_OBJECT.values())
        for names in shared:
            # the elements of an array count from 0 on PROFIBUS, on CANopen 0 is their number
            parts = [G2[key].at(protocol).sub_index for key in names]
            assert parts == [first, first + 1]


#: Two words that count at the same moment: no transfer of CANopen writes two objects.
MASK = 'fieldbus.drv_ctrl_write_mask'


@pytest.mark.parametrize('parameter', MODBUS, ids=lambda parameter: parameter.key)
def test_the_three_formulas(parameter: Parameter) -> None:
    number = instance(parameter)
    assert number >= 1
    # PNU = 1000 + ADI, index = 2000h + ADI, register = 210h + 4 (ADI - 1)
    if parameter.key != MASK:
        assert parameter.at('canopen').index == 0x2000 + number
    base = 0x210 + 4 * (number - 1)
    offset = OFFSETS.get(parameter.key, 0)
    place = parameter.at('modbus')
    assert place.index == base + offset
    # no parameter reaches into the next instance
    assert offset + place.codec.size // 2 <= 4


def test_what_only_one_bus_has() -> None:
    assert {row.key for row in CLASSIC if row not in MODBUS} == CLASSIC_ONLY
    assert {row.key for row in MODBUS if row not in CLASSIC} == MODBUS_ONLY
    def lacking(protocol: str) -> set[str]:
        return {key for key, row in G2.items() if protocol not in row.addresses}

    assert lacking('profibus') == CLASSIC_ONLY
    assert lacking('canopen') == CLASSIC_ONLY | {MASK}


def test_times_of_the_ramps_are_not_the_speeds_before_them() -> None:
    # the speed half of a ramp stands at the base and must never be written [C46]
    taken = {number for p in MODBUS for number in p.at('modbus').occupied}
    assert taken.isdisjoint({(0x27C,), (0x27D,), (0x280,), (0x281,)})
    assert G2['control.accel'].factor('modbus') * 1000 == 1


def test_ids_of_words_that_belong_together() -> None:
    # the one pair that the manual prints the high word first [C25]; the default 1 tells
    descending = {
        row.key
        for row in CLASSIC
        if list(row.at('classic').numbers)
        != sorted(row.at('classic').numbers)
    }
    assert descending == {'fieldbus.spd_scl_numerator', 'fieldbus.spd_scl_denominator'}


def test_error_log_is_where_no_parameter_is() -> None:
    modbus, classic = G2.error_logs['modbus'], G2.error_logs['classic']
    # C000h is instance 12157, P13157 on PROFIBUS [M0 table 4, table 9]
    assert modbus.address(0) == 0x210 + 4 * (13157 - 1000 - 1) == 0xC000
    assert [modbus.address(entry) for entry in (1, 30, 31)] == [0xC004, 0xC078, 0xC07C]
    assert [classic.address(entry) for entry in (0, 1, 30, 31)] == [0x200, 0x202, 0x23C, 0x23E]
    # the last of 128, of which the older manual speaks [C4]
    assert classic.address(127) == 0x2FE
    assert modbus.entries == classic.entries == 32
    assert G2.error_logs['profibus'].address(31) == 13188
    # on Classic each word has an id of its own
    assert modbus.place(1) == ('register', 0xC004, None, 4)
    assert classic.place(1) == ('id', 0x202, 0x203, 4)
    for area, rows, protocol in (
        (modbus, MODBUS, 'modbus'),
        (classic, CLASSIC, 'classic'),
    ):
        taken = {number for row in rows for number in row.at(protocol).occupied}
        words = range(area.codec.size // 2)
        log = {(area.address(n) + word,) for n in range(area.limit) for word in words}
        assert taken.isdisjoint(log)
        for entry in (-1, area.limit):
            with pytest.raises(IndexError, match=f'the error log has {area.limit} entries'):
                area.address(entry)
