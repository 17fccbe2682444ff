# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The rows of the tables of all families: golden values, addresses, and what a row may be."""

from __future__ import annotations

import ast
from collections import Counter
import csv
from fractions import Fraction
import math
from pathlib import Path
import re

import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import (
    Access,
    Family,
    Parameter,
    Role,
    example_setting,
    families,
    load_family,
    usual_family,
)
from nfo_sinus_driver.families.sinus_g2.words import Scmd

G2, OPTIMAL = load_family('sinus_g2'), load_family('sinus_optimal')
MOVITRAC = load_family('movitrac31')
FAMILIES = {name: load_family(name) for name in families()}
NAMES = Path(__file__).resolve().parents[4] / 'shared' / 'design' / 'parameter_names.csv'

#: Written off the manuals by hand: key, address, codec, unit (-: none), bytes, value. Of the upper
#: half of Drive Status nothing is said [C24], nor of more than 24 bits of an operating time [C26].
GOLDEN = {
    ('sinus_g2', 'modbus'): """
        status.frq_set 03FC sint16_be Hz FF38 -20.0
        status.spd_set 025C sint16_be rpm 05A0 1440.0
        status.trq_set 0408 sint16_be % FF38 -200.0
        status.reg_set 0410 sint16_be - 007D 12.5
        status.u_rms 03E8 sint16_be V 00E7 231
        status.i_rms 03EC sint32_ws A 0CB20000 3.25
        status.p_out 03F0 sint32_ws W FA24FFFF -1500
        status.pf 03F4 sint16_be - 0334 0.82
        status.dc_link 03F8 sint16_be V 0235 565.0
        status.frq_act 0400 sint16_be Hz FFFF -0.1
        status.spd_act 0264 sint16_be rpm FA60 -1440.0
        status.trq_act 040C sint16_be % 0064 100.0
        status.pt1000 0418 sint16_be °C FF83 -12.5
        status.m_temp 041C sint16_be % 036B 87.5
        status.op_time 02A8 sint32_ws h E2400001 12345.6
        status.br_time 0420 sint32_ws s 00000001 65536
        status.e_out 05B0 sint32_ws kWh 04D20000 1.234
        status.sigma_e_out 05B4 sint32_ws kWh 05F00000 1520
        fieldbus.mode 0294 uint16_be - 0003 3
        fieldbus.scmd 0298 uint16_be - 0101 257
        fieldbus.drive_control 0254 uint16_be - C07F 49279
        fieldbus.drive_status 0258 uint32_ws[0:15] - 03370000 823
        fieldbus.sw_ver 02B0 uint16_be - 01AC 4.28
        fieldbus.nfo_ver 02B4 uint16_be - 0FB2 4018
        fieldbus.inv_st 02A5 uint16_be - 0025 37
        fieldbus.inv_st_with_ack 02A4 uint16_be - 0005 5
        fieldbus.spd_scl_numerator 0268 sint32_ws - 00010000 1
        fieldbus.spd_scl_denominator 026A sint32_ws - 00010000 1
        motor.l_main 0240 uint32_ws H 7E400005 0.36
        control.retard 0282 sint32_ws s A1200007 500.0
        pi_reg.r_fix7 037C sint16_be - B1E0 -2000.0
    """,
    ('sinus_g2', 'classic'): """
        status.i_rms 0095 sint16_be A 0145 3.25
        status.pf 00DB sint16_be - 0052 0.82
        status.dc_link 0014 sint16_be V 1617 565.5
        status.frq_act 00B6 sint16_be Hz FFFF -0.1
        status.op_time 0027.0127 uint32_ws[0:23] h E2400001 12345.6
        status.br_time 00DD.00DE uint32_ws[0:23] s 00000001 65536
        fieldbus.spd_scl_numerator 00E2.00E1 sint32_ws - 00010000 1
        fieldbus.drive_status 007D uint16_be - 0337 823
        fieldbus.inv_st_with_ack 00E8 uint16_be - 0005 5
        fieldbus.inv_st 00E9 uint16_be - 0025 37
        serial.auto_reset 002F uint16_be - 0001 True
        serial.auto_stop 00D8 uint16_be - 0000 False
    """,
    # types and units of CiA 402: [M0 table 11] prints names and indices
    ('sinus_g2', 'canopen'): """
        fieldbus.error_code 603F uint16_le - 1032 0x3210
        fieldbus.control_word 6040 uint16_le - 7F00 0x7F
        fieldbus.status_word 6041 uint16_le - 3706 0x0637
        fieldbus.vl_target_velocity 6042 sint16_le rpm 60FA -1440
        fieldbus.vl_velocity_demand 6043 sint16_le rpm A005 1440
        fieldbus.vl_velocity_actual_value 6044 sint16_le rpm FFFF -1
        fieldbus.vl_velocity_min_amount 6046.0001 uint32_le rpm 1E000000 30
        fieldbus.vl_velocity_max_amount 6046.0002 uint32_le rpm 28230000 9000
        fieldbus.vl_velocity_acceleration_delta_speed 6048.0001 uint32_le rpm DC050000 1500
        fieldbus.vl_velocity_acceleration_delta_time 6048.0002 uint16_le s 0500 5
        fieldbus.vl_velocity_deceleration_delta_speed 6049.0001 uint32_le rpm DC050000 1500
        fieldbus.vl_velocity_deceleration_delta_time 6049.0002 uint16_le s 0500 5
        fieldbus.vl_dimension_factor_numerator 604C.0001 sint32_le - 01000000 1
        fieldbus.vl_dimension_factor_denominator 604C.0002 sint32_le - 01000000 1
        fieldbus.shutdown_option_code 605B sint16_le - 0100 'Brake'
        fieldbus.disable_operation_code 605C sint16_le - 0000 'Release'
        fieldbus.modes_of_operation 6060 sint8 - 02 'Speed'
        fieldbus.modes_of_operation_display 6061 sint8 - 04 'Torque'
        fieldbus.target_torque 6071 sint16_le % 0CFE -50.0
        fieldbus.motor_rated_current 6075 uint32_le A 480D0000 3.4
        fieldbus.motor_rated_torque 6076 uint32_le Nm 10270000 10.0
        fieldbus.torque_actual_value 6077 sint16_le % E803 100.0
        fieldbus.torque_slope 6087 uint32_le %/s E8030000 100.0
        fieldbus.motor_type 6402 uint16_le - 0700 7
        fieldbus.supported_drive_modes 6502 uint32_le - 0A000000 10
    """,
    ('sinus_optimal', 'modbus'): """
        status.i_rms 03EC sint32_ws A 11EB0001 70.123
        status.p_out 03F0 sint32_ws W EE90FFFE -70000
        status.pf 03F4 sint16_be - FCAE -0.85
        status.frq_act 0400 sint16_be Hz FE0D -49.9
        status.control_freq 0518 sint16_be Hz 01F4 50.0
        status.spd_act 0264 sint16_be rpm FA38 -1480
        status.control_speed 0260 sint16_be rpm 05DC 1500
        status.op_time 02A8 uint32_ws h E2400001 1234.56
        status.rn_time 02AC uint32_ws h FFFFFFFF 42949672.95
        fieldbus.mode 0294 uint16_be - 0003 3
        fieldbus.smode 0298 uint16_be - 0101 257
        fieldbus.input_freq_setpoint 03FC sint16_be Hz 007D 12.5
        fieldbus.input_speed_setpoint 025C sint16_be rpm FFFF -1
        fieldbus.inv_st_with_ack 02A4 uint16_be - 000C 12
        fieldbus.inv_st 02A5 uint16_be - 003F 63
        fieldbus.drive_control 0254 uint16_be - 4009 16393
        fieldbus.drive_status 0258 uint16_be - 8207 33287
    """,
    # the examples of the manual: §2.4.3, §2.4.4, figure 23 [C106]
    ('movitrac31', 'movitrac'): """
        status.heat_sink_temperature 0004 sbcd32 °C 00002550 25.5
        ramp.t11_up 0019 bcd32 s 00000370 3.7
        control.frs_master_gear_ratio 0107 uint32_hb - 0000000108060A00 100000
        special.software_system 00D7 uint32_be - 211234A1 0x211234A1
        status.inverter_type 010F bcd32 - 00310000 'MOVITRAC 31..'
        serial.control_mode 00CD bcd32 - 00000200 'Remote control'
        frequency.f_base_1 0050 bcd32 Hz 00000300 104
        motor.pwm_frequency_1 0110 bcd32 - 00000400 '16 kHz'
        special.parameter_lock 00CA bcd32 - 00000100 True
        special.save_to_eeprom 00EC bcd32 - 00000100 'Off'
        terminal.input_43 0097 bcd32 - 00001700 'No function (17)'
        status.fault_t0 0008 bcd32 - 00004500 45.0
        fieldbus.function_bits 0119 uint32_be - 00000105 0x105
        fieldbus.inverter_status 011C uint32_be - 2D010110 0x2D010110
        fieldbus.remote_setpoint 00DF bcd32 Hz 00040000 400.0
        ipos.actual_position 03F1 sint32_hb Inc 0F0F0F0F0F0F0F0E -2
    """,
}


def instance(row: Parameter) -> int:
    """The number that all buses of the G2 count from (ADI)."""
    return row.at('profibus').index - 1000


def kind_of(row: Parameter, protocol: str) -> str:
    return row.at(protocol).codec.name.partition('_')[0]


def lacking(family: Family, protocol: str) -> set[str]:
    return {key for key, row in family.items() if protocol not in row.addresses}


@pytest.mark.parametrize(('family', 'protocol'), GOLDEN)
def test_golden_rows(family: str, protocol: str) -> None:
    wrong = []
    for line in GOLDEN[family, protocol].strip().splitlines():
        key, address, codec, unit, data, printed = line.split(maxsplit=5)
        row, value = FAMILIES[family][key], ast.literal_eval(printed)
        place = row.at(protocol)
        found = row.decode(bytes.fromhex(data), protocol)
        shown = '.'.join(f'{number:04X}' for number in place.numbers)
        encoded = row.encode(value, protocol).hex().upper()
        ours = shown, place.codec.name, row.unit or '-', encoded, found, type(found)
        if ours != (address, codec, unit, data, value, row.kind):
            wrong.append((key, *ours))
    assert wrong == []


def test_how_many_parameters_each_family_has() -> None:
    counts = {name: (len(family), len(family.settings)) for name, family in FAMILIES.items()}
    assert counts == {
        'sinus_g2': (180, 120),
        'sinus_optimal': (17, 0),
        'sinus_h': (21, 0),
        'movitrac31': (317, 221),
    }
    # 239 are printed as writable: of those 13 can be negative, of which 8 have eight bytes
    access = Counter(row.access for row in MOVITRAC.values())
    assert access == {Access.READ_WRITE: 239 - 13, Access.READ: 78 + 13}


def test_every_row_is_one_that_may_be() -> None:
    wrong = []
    for name, family in FAMILIES.items():
        for key, row in family.items():
            group, _, own = key.partition('.')
            labels = list(row.labels.values())
            numbers = [number for place in row.addresses.values() for number in place.numbers]
            # lists are written with commas between the labels
            plain = [label for label in labels if label == ' '.join(label.split()) != '']
            right = (
                row.key == key and own == own.lower() != '',
                name == 'sinus_h' or group == row.group.lower().replace(' ', '_'),
                row.description and re.match(r'M\d ', row.source),
                all(0 <= number <= 0xFFFF for number in numbers),
                all(place.source[0] == 'M' for place in row.addresses.values()),
                # the drive reports what is possible of what can only be read
                row.access is not Access.READ or name == 'movitrac31' or row.minimum is None,
                plain == labels and not any(',' in label or '|' in label for label in labels),
                not labels or name == 'movitrac31' or (row.unit, row.decimals) == ('', 0),
            )
            if not all(right):
                wrong.append((name, key, right))
    assert wrong == []


def test_names_are_still_those_of_the_design() -> None:
    if not NAMES.exists():
        pytest.skip('the list of names is not beside this clone')
    with NAMES.open(encoding='utf-8', newline='') as stream:
        _, *lines = csv.reader(stream)
    types = {float: 'double', int: 'integer', str: 'string', bool: 'bool'}
    assert lines == [[row.group, row.name, row.key, types[row.kind]] for row in G2.settings]


# --- what is read, written, commanded -------------------------------------------------------------


def test_what_acknowledges_and_what_can_only_be_written() -> None:
    assert {
        (name, row.access.value, key)
        for name, family in FAMILIES.items()
        for key, row in family.items()
        if row.access in (Access.ACKNOWLEDGE, Access.WRITE)
    } == {
        ('sinus_g2', 'ack', 'fieldbus.inv_st_with_ack'),
        ('sinus_g2', 'ack', 'fieldbus.sio_err'),
        ('sinus_g2', 'w', 'fieldbus.scmd'),
        ('sinus_g2', 'w', 'fieldbus.drv_ctrl_write_mask'),
        ('sinus_optimal', 'ack', 'fieldbus.inv_st_with_ack'),
        ('sinus_optimal', 'w', 'fieldbus.smode'),
        *(('sinus_h', 'w', f'telegram.{own}') for own in ('begin', 'next', 'clear', 'setpoint')),
    }


def test_what_commands_or_resets_is_no_setting_and_what_disturbs_the_line_is_guarded() -> None:
    assert {row.group for row in G2.values() if not row.is_setting} == {'Status', 'Fieldbus'}
    numbers = {
        row.at('movitrac').index
        for row in MOVITRAC.values()
        if row.access is Access.READ_WRITE and not row.is_setting
    }
    # set-point, function bits, factory setting, the programs of IPOS and their start
    assert numbers == {223, 281, 203, 704, 705}
    guarded = {MOVITRAC[key].at('movitrac').index for key in MOVITRAC.communication}
    assert guarded == {196, 205, 206, 207, 212, 285}


def test_what_may_be_negative_is_only_read() -> None:
    for row in MOVITRAC.values():
        if row.minimum is not None and row.minimum < 0:
            assert row.access is Access.READ, row.key
    eight = [row for row in MOVITRAC.values() if row.at('movitrac').codec.size == 8]
    assert len(eight) == 15 and sum(row.is_setting for row in eight) == 5


def test_what_needs_no_option_card() -> None:
    # without IPOS, synchronous operation and fieldbus
    basic = [row for row in MOVITRAC.values() if row.option not in ('FPI', 'FRS', 'FFI or FFP')]
    writable = {row.key for row in basic if row.access is Access.READ_WRITE}
    writable |= {'setpoint.n2_offset'}  # printed as writable, and may be negative
    # 239 less the 30, 18 and 9 of these and the two process values
    assert len(writable - {'fieldbus.remote_setpoint', 'fieldbus.function_bits'}) == 180


def test_the_example_is_a_setting_of_the_usual_family() -> None:
    key, value = example_setting()
    parameter = load_family(usual_family())[key]
    assert parameter.is_setting
    assert parameter.decode(parameter.encode(value)) == value


def test_sources_of_the_setpoint_are_start_commands_too() -> None:
    commands = {code.value for code in Scmd}
    for key in ('freque.op_mode', 'speed.op_mode', 'torque.op_mode'):
        assert set(G2[key].labels) <= commands
    # but not those of the regulator's temperatures: one of them would stop the motor [C20]
    assert set(G2['pi_reg.op_mode'].labels) - commands == {0x102, 0x103}


# --- one numbering behind all buses of the G2 -----------------------------------------------------

#: Rows that are not the first of their instance, and by how many.
OFFSETS = {
    'control.accel': 2,  # the time of a ramp, behind its speed [C46]
    'control.retard': 2,
    'fieldbus.inv_st': 1,  # beside the one that acknowledges
    'fieldbus.spd_scl_denominator': 2,  # behind the numerator
}
#: Two words that count at the same moment: no transfer of CANopen writes two objects.
MASK = 'fieldbus.drv_ctrl_write_mask'


def test_what_only_one_bus_has() -> None:
    # so there is no instance [M0 table 2, table 3]
    classic_only = {'control.any_bus', 'fieldbus.sio_err', 'fieldbus.setpoint'}
    # nor of the drive profile of CANopen [M0 table 11]
    profile = {row.key for row in G2.values() if row.source.startswith('M0 table 11')}
    assert lacking(G2, 'modbus') == lacking(G2, 'profibus') == classic_only | profile
    assert lacking(G2, 'canopen') == classic_only | {MASK}
    # to be defined, says the manual [C27]
    profidrive = {'fieldbus.profidrive_control', 'fieldbus.profidrive_status'}
    assert lacking(G2, 'classic') == profidrive | {MASK} | profile
    with pytest.raises(KeyError, match=r'control\.any_bus cannot be reached over modbus'):
        G2['control.any_bus'].at('modbus')


def test_the_three_formulas() -> None:
    wrong = {}
    for key, row in G2.items():
        if 'modbus' not in row.addresses:
            continue
        number, place, offset = instance(row), row.at('modbus'), OFFSETS.get(key, 0)
        # PNU = 1000 + ADI, index = 2000h + ADI, register = 210h + 4 (ADI - 1)
        right = (
            place.index == 0x210 + 4 * (number - 1) + offset,
            key == MASK or row.at('canopen').index == 0x2000 + number,
            key == MASK or kind_of(row, 'canopen') == kind_of(row, 'modbus'),
            # no parameter reaches into the next instance
            number >= 1 and offset + place.codec.size // 2 <= 4,
        )
        if not all(right):
            wrong[key] = right
    assert wrong == {}
    # the same registers on the Optimal; its two status words are one instance, too
    for row in OPTIMAL.values():
        adi = re.search(r'M1 ADI (\d+)', row.source)
        beside = row.key == 'fieldbus.inv_st'
        assert adi and row.at('modbus').index == 0x210 + 4 * (int(adi[1]) - 1) + beside, row.key


def test_two_that_are_one_object_are_distinguished_by_the_sub_index() -> None:
    # the elements of an array count from 0 on PROFIBUS, on CANopen 0 is their number
    for protocol, first in (('profibus', 0), ('canopen', 1)):
        keys: dict[int, list[tuple[str, int | None]]] = {}
        for key, row in G2.items():
            if protocol in row.addresses and not row.source.startswith('M0 table 11'):
                place = row.at(protocol)
                keys.setdefault(place.index, []).append((key, place.sub_index))
        assert [names for names in keys.values() if len(names) > 1] == [
            [('fieldbus.inv_st_with_ack', first), ('fieldbus.inv_st', first + 1)],
            [('fieldbus.spd_scl_numerator', first), ('fieldbus.spd_scl_denominator', first + 1)],
        ]


def test_scale_parameters_of_the_drive() -> None:
    # FrqScl and its like are the factors of whole groups [M0 §8.3], [C16]
    factors = {(row.scale, address.factor) for row in G2.values() if row.scale
               for address in row.addresses.values()}
    tenth = Fraction(1, 10)
    assert factors == {('FrqScl', tenth), ('SpdScl', 1), ('TrqScl', 1), ('RegScl', tenth)}
    # it may be set finer, so whole numbers would be too few
    assert {row.kind for row in G2.values() if row.scale} == {float}


@pytest.mark.parametrize(
    ('protocol', 'data'),
    [
        ('modbus', packed(0x0337, 0xA5A5)),
        ('classic', packed(0x0337)),
        ('profibus', bytes.fromhex('A5A50337')),
        ('canopen', bytes.fromhex('3703A5A5')),
    ],
)
def test_the_upper_half_of_the_status_word_counts_on_no_bus(protocol: str, data: bytes) -> None:
    assert G2['fieldbus.drive_status'].decode(data, protocol) == 0x0337


def test_the_same_thing_has_the_same_key_on_g2_and_optimal() -> None:
    # but for what only looks alike [C52] [C53]
    g2 = {row.at('modbus').index: row for row in G2.values() if 'modbus' in row.addresses}
    shared = {row.key: g2.get(row.at('modbus').index) for row in OPTIMAL.values()}
    assert {key: row and row.key for key, row in shared.items() if not row or row.key != key} == {
        'status.control_freq': None,
        'status.control_speed': None,
        'fieldbus.smode': 'fieldbus.scmd',
        'fieldbus.input_freq_setpoint': 'status.frq_set',
        'fieldbus.input_speed_setpoint': 'status.spd_set',
    }
    assert not [key for key, row in shared.items() if row and row.unit != OPTIMAL[key].unit]
    # 36 s a tick against a tenth of an hour: ten times wrong if mixed [C48]
    for key in ('status.op_time', 'status.rn_time'):
        assert (OPTIMAL[key].decode(packed(100, 0)), G2[key].decode(packed(100, 0))) == (1, 10)
    # of Classic [M1] says nothing, nor of ranges, scales and labels
    for row in OPTIMAL.values():
        assert set(row.addresses) == {'modbus'}
        assert not (row.minimum or row.maximum or row.scale or row.labels or row.since), row.key


# --- roles and error logs -------------------------------------------------------------------------


def test_roles() -> None:
    # pole pairs follow from its nominal values, and no setting of it is a keypad's control
    # and it brakes no motor that has stopped [M2 table 1]
    own = {Role.POLE_PAIRS, Role.LOCAL_OPERATION, Role.STOP_BRAKING}
    # behind a PLC
    assert set(Role) - set(G2.roles) == own | {Role.TELEGRAM, Role.FAULT_CODE}
    assert set(G2.roles) > set(OPTIMAL.roles)
    assert G2.key(Role.ACTUAL_SPEED) == 'status.spd_act'
    assert G2.key(Role.COMMUNICATION_TIMEOUT) == 'serial.sio_tot'
    assert G2.role_of['status.spd_act'] is Role.ACTUAL_SPEED
    # a role that no parameter has is a feature that is missing
    assert OPTIMAL.key(Role.COMMUNICATION_TIMEOUT) == ''
    roles = {role.value: MOVITRAC[key].at('movitrac').index for role, key in MOVITRAC.roles.items()}
    assert roles == {
        **{'status_word': 284, 'control_source': 205, 'local_operation': 196},
        **{'actual_frequency': 0, 'actual_speed': 17, 'output_voltage': 1, 'dc_link_voltage': 2},
        **{'pole_pairs': 106, 'communication_timeout': 285, 'bus_address': 206},
    }


def test_the_error_log_of_the_g2_is_where_no_parameter_is() -> None:
    modbus, classic = G2.error_logs['modbus'], G2.error_logs['classic']
    # C000h is instance 12157, P13157 on PROFIBUS [M0 table 4, table 9]
    assert modbus.address(0) == 0x210 + 4 * (13157 - 1000 - 1) == 0xC000
    assert [modbus.address(entry) for entry in (1, 31)] == [0xC004, 0xC07C]
    # the last of 128, of which the older manual speaks [C4]
    assert [classic.address(entry) for entry in (0, 1, 31, 127)] == [0x200, 0x202, 0x23E, 0x2FE]
    assert modbus.entries == classic.entries == 32
    assert G2.error_logs['profibus'].address(31) == 13188
    # on Classic each word has an id of its own
    assert modbus.place(1) == ('register', 0xC004, None, 4)
    assert classic.place(1) == ('id', 0x202, 0x203, 4)
    for area in (modbus, classic):
        rows = [row for row in G2.values() if area.protocol in row.addresses]
        taken = {number for row in rows for number in row.at(area.protocol).occupied}
        log = {(area.address(n) + word,) for n in range(area.limit) for word in (0, 1)}
        assert taken.isdisjoint(log)
        for entry in (-1, area.limit):
            with pytest.raises(IndexError, match=f'the error log has {area.limit} entries'):
                area.address(entry)


def test_the_error_log_of_the_movitrac_are_five_codes_and_what_was_kept_of_each() -> None:
    def index(key: str) -> int:
        return MOVITRAC[key].at('movitrac').index

    area = MOVITRAC.error_logs['movitrac']
    # P060 to P064
    keys = [f'status.fault_t{number}' for number in range(5)]
    assert [area.address(number) for number in range(5)] == [index(key) for key in keys]
    assert [area.code(count) for count in (0, 100, 4500, 8700)] == [0, 101, 145, 187]
    assert not any(map(area.unknown, (0, 100, 4500, 8700)))
    # only whole numbers are fault codes, and InvSt has one byte for one
    for raw in (1, 45, 99, 4501, 15_500, 99_999_900):
        assert (area.code(raw), area.unknown(raw)) == (255, f'unknown code (raw {raw})')
    assert not area.timed
    assert math.isnan(area.hours(4500))
    for number, first in enumerate((400, 409, 418, 427, 436)):
        kept = [index(key) - first for _, key in area.readings_of(number)]
        assert kept == [0, 2, 3, 4, 6, 7, 8]
        rows = [row for row in MOVITRAC.values() if row.name.startswith(f'Fault t-{number} ')]
        assert [index(row.key) - first for row in rows] == [0, 2, 3, 4, 6, 7, 8]
        names = [row.at('movitrac').codec.name for row in rows]
        # inverter status and terminals are not decoded [C77]
        assert names == ['bcd32', 'sbcd32', *['bcd32'] * 3, *['uint32_be'] * 2]
