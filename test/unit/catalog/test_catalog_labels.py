# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""The enumerations: what the manual prints, no more and no less."""

from __future__ import annotations

import pytest
from support.addresses import packed

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.families.sinus_g2.words import Scmd

G2 = load_family('sinus_g2')
SWITCH = {0: 'OFF', 1: 'ON'}
REACTIONS = {0: 'Disable', 64: 'Ind', 128: 'Alarm', 192: 'Error'}
QUANTITIES = {0: 'Disable', 1: 'Freque', 2: 'Speed', 3: 'Torque'}
SOURCES = {
    129: 'Terminal',
    3: 'Analog F',
    5: 'Analog R',
    11: 'Fix-1 F',
    19: 'Fix-2 F',
    27: 'Fix-3 F',
    35: 'Fix-4 F',
    43: 'Fix-5 F',
    51: 'Fix-6 F',
    59: 'Fix-7 F',
    13: 'Fix-1 R',
    21: 'Fix-2 R',
    29: 'Fix-3 R',
    37: 'Fix-4 R',
    45: 'Fix-5 R',
    53: 'Fix-6 R',
    61: 'Fix-7 R',
}

#: The enumerations, as [M0 table 4] prints them; [M2 table 1] has the codes in decimal.
LABELS = {
    'control.mode': {0: 'Freque', 1: 'PI-Reg', 2: 'Torque', 3: 'Speed'},
    'control.ain_set': {
        3: '0-20mA',
        4: '4-20mA',
        5: '+/-20mA',
        6: '0-10V',
        7: '2-10V',
        8: '+/-10V',
        9: 'Pot 10k',
    },
    'control.auto_start': SWITCH,
    'control.energy_save': SWITCH,
    'control.st_mode': {0: 'Release', 1: 'Brake'},
    'control.any_bus': {3: 'PPO3'},
    'pi_reg.unit': {
        0: 'None',
        1: 'Pa',
        2: 'kPa',
        3: 'bar',
        4: 'rpm',
        5: 'm³/s',
        6: 'l/s',
        7: 'm³/h',
        8: 'l/h',
        9: 'ppm',
        10: '%',
        11: 'V',
        12: 'Hz',
    },
    'serial.bus_type': {0: 'None', 1: 'NFO', 2: 'MbusAsc', 3: 'MbusRtu', 4: 'ABCC'},
    'serial.si_baud': {
        16: '1200bps',
        32: '2400bps',
        64: '4800bps',
        128: '9600bps',
        256: '19200bps',
        512: '38400 bps',
        768: '57600 bps',
    },
    # the s that the manual lost in '8b Op 1' is put back [C5]
    'serial.si_prot': {
        0: '7b Ep 1s',
        1: '7b Op 1s',
        2: '7b Np 2s',
        4: '8b Ep 1s',
        5: '8b Op 1s',
        6: '8b Np 2s',
    },
    'serial.auto_reset': SWITCH,
    'serial.auto_stop': SWITCH,
    'freque.op_mode': SOURCES,
    'speed.op_mode': SOURCES,
    'torque.op_mode': SOURCES,
    'pi_reg.op_mode': SOURCES | {258: 'Temp F', 259: 'Temp R'},
    'pi_reg.reg_amp': {-1: '-1', 1: '1'},
    'pi_reg.ain_act': {0: '0-10V', 1: '2-10V', 2: '+/-10V'},
    # 'Running', for 1 is 'Freque' in [M0] by a slip from the rows below it [C18]
    'output.re_mode': {
        0: 'Disable',
        1: 'Running',
        2: 'Run Fwd',
        3: 'Run Rev',
        4: 'Run Setp',
        5: 'Run Freq',
    },
    'output.v_out': QUANTITIES,
    'output.f_out': QUANTITIES,
    'error.ac_fail_mode': REACTIONS,
    'error.ac_fail_it_gnd': SWITCH,
    'error.ptc_temp_mode': REACTIONS,
    'error.overload_mode': REACTIONS,
    'error.ain_fail_mode': REACTIONS,
    'error.gnd_fail_mode': REACTIONS,
    'error.imagn_low_mode': REACTIONS,
    'error.cur_low_mode': REACTIONS,
    'error.cur_high_mode': REACTIONS,
    'error.run_fail_mode': REACTIONS,
}


def test_enumerations_are_those_of_the_manual() -> None:
    assert {key: row.labels for key, row in G2.items() if row.labels} == LABELS
    assert len(LABELS) == 31


@pytest.mark.parametrize('key', LABELS)
def test_enumeration_is_well_formed(key: str) -> None:
    row = G2[key]
    labels = list(row.labels.values())
    assert (row.unit, row.scale, row.decimals) == ('', '', 0)
    assert len(set(labels)) == len(labels)
    assert all(label and label == ' '.join(label.split()) for label in labels)
    # lists are written with commas between the labels
    assert not any(',' in label or '|' in label for label in labels)
    for protocol, place in row.addresses.items():
        assert place.factor == 1
        assert place.codec.size == 2
        for code, label in row.labels.items():
            assert place.number.fits(code)
            data = row.encode(row.kind(label) if row.kind is not bool else label, protocol)
            assert place.number.decode(data) == code


def test_type_of_enumerations() -> None:
    # the two values of RegAmp are numbers, one of them negative [C46]
    printed = set(LABELS) - {'pi_reg.reg_amp'}
    for key in printed - {'control.any_bus'}:
        assert {G2[key].at(bus).codec.name for bus in ('modbus', 'classic')} == {'uint16_be'}
    assert all(G2[key].minimum is G2[key].maximum is None for key in printed)
    assert {key for key in LABELS if G2[key].kind is bool} == {
        key for key, labels in LABELS.items() if labels == SWITCH
    }


@pytest.mark.parametrize('key', ['freque.op_mode', 'speed.op_mode'])
def test_any_bus_is_read_and_never_offered(key: str) -> None:
    # 193 is in [M2 table 1] only [C19]
    assert G2[key].decode(packed(193)) == '193'
    with pytest.raises(ValueError, match="'AnyBus' is none of Terminal"):
        G2[key].encode('AnyBus')


def test_sources_of_the_setpoint_are_start_commands_too() -> None:
    commands = {code.value for code in Scmd}
    for key in ('freque.op_mode', 'speed.op_mode', 'torque.op_mode'):
        assert set(G2[key].labels) <= commands
    # but not those of the regulator's temperatures: one of them would stop the motor [C20]
    assert set(G2['pi_reg.op_mode'].labels) - commands == {0x102, 0x103}


@pytest.mark.parametrize('protocol', ['modbus', 'classic'])
def test_amplification_is_one_of_two_numbers(protocol: str) -> None:
    row = G2['pi_reg.reg_amp']
    assert row.kind is int
    assert row.encode(-1, protocol) == packed(0xFFFF)
    assert row.encode(1, protocol) == packed(1)
    assert row.decode(packed(0xFFFF), protocol) == -1
    for value in (0, -2, 2, 0.5, float('nan'), float('inf'), True):
        with pytest.raises(ValueError, match=r'^pi_reg\.reg_amp: .* is none of -1, 1$'):
            row.encode(value, protocol)
