# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The parameter table of the NFO Sinus G2, row by row."""

from __future__ import annotations

from fractions import Fraction

import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import Access, Family, Parameter, Value, load_family

G2 = load_family('sinus_g2')
ROWS = pytest.mark.parametrize('parameter', list(G2.values()), ids=list(G2))

#: The types that the manual prints.
CODECS = {
    'UINT16': 'uint16_be',
    'ENUM': 'uint16_be',
    'SINT16': 'sint16_be',
    'UINT32': 'uint32_ws',
    'SINT32': 'sint32_ws',
    # of which the upper half is described nowhere [C24]
    'UINT32, low half': 'uint32_ws[0:15]',
    # of which nobody says what more than these bits have over Classic [C26]
    'SINT32, 24 bits': 'uint32_ws[0:23]',
}

#: Written off the manual by hand: key, register, type, unit, value, words on Modbus.
GOLDEN = [
    ('motor.p_nom', 0x220, 'UINT32', 'kW', 1.5, (1500, 0)),
    ('motor.p_nom', 0x220, 'UINT32', 'kW', 100.0, (0x86A0, 1)),
    ('motor.u_nom', 0x224, 'UINT16', 'V', 400, (400,)),
    ('motor.f_nom', 0x228, 'UINT16', 'Hz', 50, (50,)),
    ('motor.n_nom', 0x22C, 'UINT16', 'rpm', 1440, (1440,)),
    ('motor.i_nom', 0x230, 'UINT32', 'A', 3.4, (3400, 0)),
    ('motor.cos_phi', 0x234, 'UINT16', '', 0.82, (820,)),
    ('motor.r_stat', 0x238, 'UINT32', 'Ω', 4.2, (4200, 0)),
    ('motor.l_main', 0x240, 'UINT32', 'H', 0.36, (0x7E40, 5)),
    ('motor.sigma', 0x244, 'UINT16', '', 0.08, (80,)),
    ('motor.i_limt', 0x24C, 'UINT32', 'A', 70.0, (4464, 1)),
    ('control.mode', 0x29C, 'ENUM', '', 'Speed', (3,)),
    ('control.accel', 0x27E, 'SINT32', 's', 5.0, (5000, 0)),
    ('control.retard', 0x282, 'SINT32', 's', 60.0, (60000, 0)),
    ('control.retard', 0x282, 'SINT32', 's', 500.0, (0xA120, 7)),
    ('control.run_dly', 0x2BC, 'UINT16', 's', 3600, (3600,)),
    ('control.st_mode', 0x290, 'ENUM', '', 'Brake', (1,)),
    ('control.kp_spd', 0x2D0, 'UINT16', '', 2.0, (200,)),
    ('control.f_sleep', 0x2D8, 'UINT16', 'Hz', 2.5, (25,)),
    ('freque.op_mode', 0x2E4, 'ENUM', '', 'Terminal', (0x81,)),
    ('freque.f_fix7', 0x300, 'UINT16', 'Hz', 150.0, (1500,)),
    ('freque.fr_max', 0x308, 'SINT16', 'Hz', 52.5, (525,)),
    ('speed.c_fix3', 0x318, 'UINT16', 'rpm', 1450.0, (1450,)),
    ('speed.sp_max', 0x330, 'SINT16', 'rpm', 9000.0, (9000,)),
    ('torque.t_fix1', 0x338, 'UINT16', '%', 1.0, (1,)),
    ('torque.tq_max', 0x358, 'UINT16', '%', 200.0, (200,)),
    ('torque.max_fr', 0x35C, 'UINT16', 'Hz', 80.0, (800,)),
    ('pi_reg.op_mode', 0x360, 'ENUM', '', 'Temp R', (0x103,)),
    ('pi_reg.r_fix7', 0x37C, 'SINT16', '', -2000.0, (0xB1E0,)),
    ('pi_reg.actmax', 0x38C, 'SINT16', '', 12.5, (125,)),
    ('pi_reg.t_min', 0x390, 'SINT16', '°C', -40, (0xFFD8,)),
    ('pi_reg.reg_amp', 0x398, 'SINT16', '', -1, (0xFFFF,)),
    ('pi_reg.reg_amp', 0x398, 'SINT16', '', 1, (1,)),
    ('pi_reg.reg_kp', 0x39C, 'UINT16', '', 0.75, (75,)),
    ('pi_reg.reg_ti', 0x3A0, 'UINT16', 's', 200.0, (2000,)),
    ('pi_reg.unit', 0x3AC, 'ENUM', '', 'm³/h', (7,)),
    ('output.re_freq', 0x3B8, 'UINT16', 'Hz', 0.5, (5,)),
    ('output.v_max', 0x3C0, 'UINT16', 'V', 10.0, (1000,)),
    ('output.f_max', 0x3C8, 'UINT16', 'Hz', 32000, (32000,)),
    ('serial.address', 0x3D0, 'UINT16', '', 247, (247,)),
    ('serial.si_baud', 0x3D4, 'ENUM', '', '57600 bps', (768,)),
    ('serial.sio_tot', 0x3DC, 'UINT16', 's', 25.0, (250,)),
    ('serial.auto_stop', 0x3E4, 'ENUM', '', True, (1,)),
    ('error.rst_dly', 0x424, 'UINT16', 's', 3600, (3600,)),
    ('error.ac_fail_mode', 0x42C, 'ENUM', '', 'Alarm', (128,)),
    ('error.ac_fail_delay', 0x430, 'UINT16', 's', 25.5, (255,)),
    ('error.ac_fail_it_gnd', 0x438, 'ENUM', '', True, (1,)),
    ('error.overload_f_cool', 0x450, 'UINT16', '', 10000, (10000,)),
    ('error.overload_s_temp', 0x454, 'SINT16', '°C', -25, (0xFFE7,)),
    ('error.short_c_err_cnt', 0x5AC, 'UINT16', '', 3, (3,)),
    ('error.cur_high_err_cnt', 0x484, 'UINT16', '', 255, (255,)),
    ('status.frq_set', 0x3FC, 'SINT16', 'Hz', -20.0, (0xFF38,)),
    ('status.spd_set', 0x25C, 'SINT16', 'rpm', 1440, (1440,)),
    ('status.trq_set', 0x408, 'SINT16', '%', -200, (0xFF38,)),
    ('status.reg_set', 0x410, 'SINT16', '', 12.5, (125,)),
    ('fieldbus.mode', 0x294, 'UINT16', '', 3, (3,)),
    ('fieldbus.scmd', 0x298, 'UINT16', '', 0x101, (0x101,)),
    ('fieldbus.drive_control', 0x254, 'UINT16', '', 0xC07F, (0xC07F,)),
]

#: The same for what can only be read.
GOLDEN_READ = [
    ('status.u_rms', 0x3E8, 'SINT16', 'V', 231, (231,)),
    ('status.i_rms', 0x3EC, 'SINT32', 'A', 3.25, (3250, 0)),
    ('status.p_out', 0x3F0, 'SINT32', 'W', -1500, (0xFA24, 0xFFFF)),
    ('status.pf', 0x3F4, 'SINT16', '', 0.82, (820,)),
    ('status.dc_link', 0x3F8, 'SINT16', 'V', 565, (565,)),
    ('status.frq_act', 0x400, 'SINT16', 'Hz', -0.1, (0xFFFF,)),
    ('status.frq_act', 0x400, 'SINT16', 'Hz', 49.9, (499,)),
    ('status.spd_act', 0x264, 'SINT16', 'rpm', -1440, (0xFA60,)),
    ('status.trq_act', 0x40C, 'SINT16', '%', 100, (100,)),
    ('status.pt1000', 0x418, 'SINT16', '°C', -12.5, (0xFF83,)),
    ('status.m_temp', 0x41C, 'SINT16', '%', 87.5, (875,)),
    ('status.op_time', 0x2A8, 'SINT32', 'h', 12345.6, (0xE240, 1)),
    ('status.br_time', 0x420, 'SINT32', 's', 65536, (0, 1)),
    ('status.e_out', 0x5B0, 'SINT32', 'kWh', 1.234, (1234, 0)),
    ('status.sigma_e_out', 0x5B4, 'SINT32', 'kWh', 1520, (1520, 0)),
    ('fieldbus.sw_ver', 0x2B0, 'UINT16', '', 4.28, (428,)),
    ('fieldbus.nfo_ver', 0x2B4, 'UINT16', '', 4018, (4018,)),
    ('fieldbus.inv_st', 0x2A5, 'UINT16', '', 37, (37,)),
    ('fieldbus.inv_st_with_ack', 0x2A4, 'UINT16', '', 5, (5,)),
    ('fieldbus.drive_status', 0x258, 'UINT32, low half', '', 0x0337, (0x0337, 0)),
    ('fieldbus.spd_scl_numerator', 0x268, 'SINT32', '', 1, (1, 0)),
    ('fieldbus.spd_scl_denominator', 0x26A, 'SINT32', '', 1, (1, 0)),
]

#: The same on Classic: key, ids, type, value, words.
GOLDEN_CLASSIC = [
    ('motor.p_nom', (0x0008,), 'SINT16', 1.5, (150,)),
    ('motor.i_nom', (0x0011,), 'SINT16', 3.4, (34,)),
    ('motor.cos_phi', (0x0015,), 'SINT16', 0.82, (82,)),
    ('motor.l_main', (0x0004,), 'SINT16', 0.36, (3600,)),
    ('control.accel', (0x001D,), 'SINT16', 5.0, (50,)),
    ('control.retard', (0x001C,), 'SINT16', 60.0, (600,)),
    ('freque.f_fix7', (0x0047,), 'SINT16', 50.0, (500,)),
    ('torque.tq_min', (0x000E,), 'SINT16', 1.0, (1,)),
    ('pi_reg.setmin', (0x004B,), 'SINT16', -0.5, (0xFFFB,)),
    ('pi_reg.reg_amp', (0x0052,), 'SINT16', -1, (0xFFFF,)),
    ('output.v_max', (0x005C,), 'UINT16', 5.25, (525,)),
    ('serial.sio_tot', (0x00AB,), 'SINT16', 2.5, (25,)),
    ('error.short_c_err_cnt', (0x00F9,), 'SINT16', 3, (3,)),
    ('error.cur_high_delay', (0x00B5,), 'SINT16', 25.5, (255,)),
    ('status.i_rms', (0x0095,), 'SINT16', 3.25, (325,)),
    ('status.pf', (0x00DB,), 'SINT16', 0.82, (82,)),
    ('status.dc_link', (0x0014,), 'SINT16', 565.5, (5655,)),
    ('status.frq_act', (0x00B6,), 'SINT16', -0.1, (0xFFFF,)),
    ('status.op_time', (0x0027, 0x0127), 'SINT32, 24 bits', 12345.6, (0xE240, 1)),
    ('status.br_time', (0x00DD, 0x00DE), 'SINT32, 24 bits', 65536, (0, 1)),
    ('fieldbus.spd_scl_numerator', (0x00E2, 0x00E1), 'SINT32', 1, (1, 0)),
    ('fieldbus.drive_status', (0x007D,), 'UINT16', 0x0337, (0x0337,)),
]

#: The 13 parameters whose scale differs between the buses [C14].
SCALED_OTHERWISE = {
    'motor.p_nom',
    'motor.i_nom',
    'motor.cos_phi',
    'motor.r_stat',
    'motor.r_rot',
    'motor.l_main',
    'motor.i_magn',
    'motor.i_limt',
    'control.accel',
    'control.retard',
    'status.i_rms',
    'status.pf',
    'status.dc_link',
}


def bytes_of(parameter: Parameter, protocol: str, value: Fraction) -> bytes:
    """The bytes of an exact value; fails unless it is a whole number of counts that fits."""
    raw = value / parameter.factor(protocol)
    assert raw.denominator == 1, f'{parameter.key}: {value} is between two counts'
    return parameter.at(protocol).number.encode(raw.numerator)


@ROWS
def test_row_is_consistent(parameter: Parameter) -> None:
    group, _, name = parameter.key.partition('.')
    assert group == parameter.group.lower().replace(' ', '_')
    assert name and name == name.lower()
    assert parameter.description
    assert parameter.source.startswith('M0 ')
    if parameter.access is Access.READ:
        # the drive says what is possible, so there is nothing to check
        assert parameter.minimum is parameter.maximum is None
    for protocol, address in parameter.addresses.items():
        assert protocol == address.protocol
        assert all(0 <= number <= 0xFFFF for number in address.numbers)
        if protocol in ('modbus', 'classic'):
            assert len(address.numbers) == (address.codec.size // 2 if protocol == 'classic' else 1)
        assert address.source.startswith('M0 table ')
        assert address.factor > 0


@ROWS
def test_range_is_made_of_counts_that_fit(parameter: Parameter) -> None:
    for protocol in parameter.addresses:
        for bound in (parameter.minimum, parameter.maximum):
            if bound is not None:
                bytes_of(parameter, protocol, bound)
        for code in parameter.labels:
            codec = parameter.at(protocol).number
            assert codec.size == 2
            assert codec.decode(codec.encode(code)) == code


def test_parameters_that_are_scaled_differently_on_the_two_buses() -> None:
    both = [p for p in G2.values() if {'modbus', 'classic'} <= p.addresses.keys()]
    differ = {p.key for p in both if p.factor('modbus') != p.factor('classic')}
    assert differ == SCALED_OTHERWISE


def test_what_acknowledges_by_being_read() -> None:
    assert {key for key, row in G2.items() if row.access is Access.ACKNOWLEDGE} == {
        'fieldbus.inv_st_with_ack',
        'fieldbus.sio_err',
    }


def test_what_can_only_be_written() -> None:
    assert {key for key, row in G2.items() if row.access is Access.WRITE} == {
        'fieldbus.scmd',
        'fieldbus.drv_ctrl_write_mask',
    }


def test_what_needs_the_motor_to_stand() -> None:
    # type Init in [M2 table 1]: the motor's data, Mode and AinSet; all else is Init/Run
    motor = {key for key in G2 if key.startswith('motor.')}
    needs = {key for key, row in G2.items() if row.stopped}
    assert needs == motor | {'control.mode', 'control.ain_set'}


def test_words_of_the_bus_are_plain_numbers() -> None:
    words = [row for row in G2.values() if row.group == 'Fieldbus']
    for row in words:
        assert (row.unit, row.scale, row.minimum, row.maximum) == ('', '', None, None)
    assert {row.key: row.decimals for row in words if row.decimals} == {'fieldbus.sw_ver': 2}


def test_what_newer_firmware_has() -> None:
    since = {key: row.since for key, row in G2.items() if row.since is not None}
    assert since == {
        'error.short_c_err_cnt': Fraction('4.32'),
        'status.e_out': Fraction('4.38'),
        'status.sigma_e_out': Fraction('4.38'),
    }


@pytest.mark.parametrize(
    ('key', 'minimum', 'maximum'),
    [
        ('motor.p_nom', 0.01, 100),
        ('motor.u_nom', 1, 1000),
        ('motor.f_nom', 1, 500),
        ('motor.n_nom', 5, 32765),
        ('motor.i_nom', 0.1, None),
        ('motor.cos_phi', 0.01, 1),
        ('motor.l_main', None, None),
        ('motor.sigma', 0.001, 1),
        ('control.accel', 0.2, 500),
        ('control.retard', 0.2, 500),
        ('control.run_dly', 0, 3600),
        ('control.ti_spd', 0.01, 10),
        ('control.byp_fr', 0, 150),
        ('serial.sio_tot', 0, 25),
        ('serial.address', 1, 247),
        ('freque.f_fix1', 0, 150),
        ('speed.sp_min', 0, 9000),
        ('torque.t_fix7', 1, 200),
        ('pi_reg.r_fix1', -2000, 2000),
        ('pi_reg.t_max', -100, 100),
        ('pi_reg.reg_kp', 0, 1),
        ('pi_reg.reg_ti', 1, 200),
        ('output.v_max', 0, 10),
        ('output.f_max', 0, 32000),
        ('error.tr_time', 0, 3600),
        ('error.ac_fail_delay', 0, 25.5),
        ('error.overload_f_cool', 0, 10000),
        ('error.overload_s_temp', -100, 100),
        ('error.short_c_err_cnt', None, None),
        ('status.frq_set', -150, 150),
        ('status.spd_set', -9000, 9000),
        ('status.trq_set', -200, 200),
        ('status.reg_set', -2000, 2000),
    ],
)
def test_range_is_in_engineering_units(
    key: str, minimum: float | None, maximum: float | None
) -> None:
    # the manual prints raw counts of Classic [C33]
    row = G2[key]
    assert (row.minimum and float(row.minimum)) == minimum
    assert (row.maximum and float(row.maximum)) == maximum


@pytest.mark.parametrize(
    ('key', 'register', 'type_', 'unit', 'value', 'words'), GOLDEN + GOLDEN_READ
)
def test_golden_row(
    key: str, register: int, type_: str, unit: str, value: Value, words: tuple[int, ...]
) -> None:
    row = G2[key]
    place = row.at('modbus')
    assert (place.index, place.codec.name, row.unit) == (register, CODECS[type_], unit)
    assert row.decode(packed(*words)) == value
    assert row.encode(value) == packed(*words)


@pytest.mark.parametrize(('key', 'ids', 'type_', 'value', 'words'), GOLDEN_CLASSIC)
def test_golden_row_of_classic(
    key: str, ids: tuple[int, ...], type_: str, value: Value, words: tuple[int, ...]
) -> None:
    row = G2[key]
    place = row.at('classic')
    assert (place.numbers, place.codec.name) == (ids, CODECS[type_])
    assert row.decode(packed(*words), 'classic') == value
    assert row.encode(value, 'classic') == packed(*words)


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


def test_parameter_that_is_not_on_a_bus_says_so() -> None:
    with pytest.raises(KeyError, match=r'control\.any_bus cannot be reached over modbus'):
        G2['control.any_bus'].at('modbus')
    with pytest.raises(KeyError, match='cannot be reached over classic'):
        G2['fieldbus.profidrive_status'].decode(packed(0), 'classic')


def test_model_is_a_mapping_of_its_parameters() -> None:
    assert isinstance(G2, Family)
    assert G2.name == 'sinus_g2'
    assert len(G2) == len(list(G2)) == 155
    assert all(G2[key].key == key for key in G2)
    assert 'motor.nothing' not in G2
