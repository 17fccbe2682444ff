# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The ends of each of the 120 settings of the NFO Sinus G2, copied by hand from the manuals.

A second witness beside the catalog: nothing here is computed, or read or copied from it. Names and
order are those of the public interface; registers, words and steps those of Modbus [M0 table 4];
ranges those of [M2 table 1], its raw Classic counts turned into engineering values [C33]. Where the
manuals print no range [C21], or one that depends on the inverter [C34], the end is that of the
Modbus type. The scaled groups have their default scaling [C16].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

Value: TypeAlias = float | int | str | bool

_BOTH = 'M0 table 4, M2 table 1'


@dataclass(frozen=True)
class Ends:
    """One setting and the two ends of its range; a row below has the fields in this order."""

    name: str
    #: Modbus base register, the zero-based address of the PDU [C47]; None: not on Modbus.
    register: int | None
    #: How many registers it has.
    words: int
    classic: tuple[str, ...]
    #: Ends as ROS values and as registers, low word first; of a list, the first and last printed.
    low: Value
    low_words: tuple[int, ...]
    high: Value
    high_words: tuple[int, ...]
    #: One step beyond each end, or a label that does not exist; None for a bool.
    below: Value | None
    above: Value | None
    #: A value between two steps, and these two; None where every value of the type is a step.
    between: float | int | None
    neighbours: tuple[float | int, float | int] | None
    #: As printed; `Unit` is that of parameter Unit, whichever it is.
    unit: str
    #: Whether it can be written with the motor stopped only: `Init`.
    stopped: bool = False
    read_only: bool = False
    note: str = _BOTH
    #: Of a list: each label and its code, as the manual orders them.
    codes: tuple[tuple[str, int], ...] = ()


_MODE = (('Freque', 0), ('PI-Reg', 1), ('Torque', 2), ('Speed', 3))
_AIN_SET = (
    ('0-20mA', 3), ('4-20mA', 4), ('+/-20mA', 5),
    ('0-10V', 6), ('2-10V', 7), ('+/-10V', 8), ('Pot 10k', 9),
)
_ST_MODE = (('Release', 0), ('Brake', 1))
_OP_MODE = (
    ('Terminal', 0x0081), ('Analog F', 0x0003), ('Analog R', 0x0005),
    ('Fix-1 F', 0x000B), ('Fix-2 F', 0x0013), ('Fix-3 F', 0x001B), ('Fix-4 F', 0x0023),
    ('Fix-5 F', 0x002B), ('Fix-6 F', 0x0033), ('Fix-7 F', 0x003B),
    ('Fix-1 R', 0x000D), ('Fix-2 R', 0x0015), ('Fix-3 R', 0x001D), ('Fix-4 R', 0x0025),
    ('Fix-5 R', 0x002D), ('Fix-6 R', 0x0035), ('Fix-7 R', 0x003D),
)
_REG_OP_MODE = (*_OP_MODE, ('Temp F', 0x0102), ('Temp R', 0x0103))
_UNIT = (
    ('None', 0), ('Pa', 1), ('kPa', 2), ('bar', 3), ('rpm', 4), ('m³/s', 5), ('l/s', 6),
    ('m³/h', 7), ('l/h', 8), ('ppm', 9), ('%', 10), ('V', 11), ('Hz', 12),
)
_AIN_ACT = (('0-10V', 0), ('2-10V', 1), ('+/-10V', 2))
_RE_MODE = (
    ('Disable', 0), ('Running', 1), ('Run Fwd', 2),
    ('Run Rev', 3), ('Run Setp', 4), ('Run Freq', 5),
)
_OUTPUT = (('Disable', 0), ('Freque', 1), ('Speed', 2), ('Torque', 3))
_BUS_TYPE = (('None', 0), ('NFO', 1), ('MbusAsc', 2), ('MbusRtu', 3), ('ABCC', 4))
_SI_BAUD = (
    ('1200bps', 16), ('2400bps', 32), ('4800bps', 64), ('9600bps', 128),
    ('19200bps', 256), ('38400 bps', 512), ('57600 bps', 768),
)
_SI_PROT = (
    ('7b Ep 1s', 0), ('7b Op 1s', 1), ('7b Np 2s', 2),
    ('8b Ep 1s', 4), ('8b Op 1s', 5), ('8b Np 2s', 6),
)
_ON_FAULT = (('Disable', 0), ('Ind', 64), ('Alarm', 128), ('Error', 192))

#: What several settings have in common: from the low end to the unit.
_HZ = (0.0, (0x0000,), 150.0, (0x05DC,), -0.1, 150.1, 12.35, (12.3, 12.4), 'Hz')
_TRIES = (0, (0x0000,), 255, (0x00FF,), -1, 256, None, None, '')
_RPM = (0.0, (0x0000,), 9000.0, (0x2328,), -1.0, 9001.0, 1500.5, (1500.0, 1501.0), 'rpm')
_TORQUE = (1.0, (0x0001,), 200.0, (0x00C8,), 0.0, 201.0, 50.5, (50.0, 51.0), '%')
_ON_FAULT_ENDS = ('Disable', (0x0000,), 'Error', (0x00C0,), 'Off', 'Fault', None, None, '')
_PROCESS = (-2000.0, (0xB1E0,), 2000.0, (0x4E20,), -2000.1, 2000.1, 123.45, (123.4, 123.5), 'Unit')
_SWITCH = (False, (0x0000,), True, (0x0001,), None, None, None, None, '')
_HOUR = (0, (0x0000,), 3600, (0x0E10,), -1, 3601, None, None, 's')
_SCALE = (-2000.0, (0xB1E0,), 2000.0, (0x4E20,), -2000.1, 2000.1, -123.45, (-123.5, -123.4), 'Unit')
_CELSIUS = (-100, (0xFF9C,), 100, (0x0064,), -101, 101, None, None, '°C')
_OUTPUT_ENDS = ('Disable', (0x0000,), 'Torque', (0x0003,), 'Off', 'Power', None, None, '')
_DELAY = (0.0, (0x0000,), 25.5, (0x00FF,), -0.1, 25.6, 2.45, (2.4, 2.5), 's')
_C17 = 'M0 table 4, M2 table 1, C17'
_C23 = 'M0 table 4, M2 table 1, C23'

ENDS = (
    Ends('motor.p_nom', 0x0220, 2, ('E0008',), 0.01, (0x000A, 0x0000), 100.0, (0x86A0, 0x0001),
         0.009, 100.001, 1.5005, (1.5, 1.501), 'kW', stopped=True),
    Ends('motor.u_nom', 0x0224, 1, ('E0009',), 1, (0x0001,), 1000, (0x03E8,),
         0, 1001, None, None, 'V', stopped=True),
    Ends('motor.f_nom', 0x0228, 1, ('E000F',), 1, (0x0001,), 500, (0x01F4,),
         0, 501, None, None, 'Hz', stopped=True),
    Ends('motor.n_nom', 0x022C, 1, ('E0010',), 5, (0x0005,), 32765, (0x7FFD,),
         4, 32766, None, None, 'rpm', stopped=True),
    Ends('motor.i_nom', 0x0230, 2, ('E0011',), 0.1, (0x0064, 0x0000),
         4294967.295, (0xFFFF, 0xFFFF), 0.099, 4294967.296, 3.4005, (3.4, 3.401), 'A',
         stopped=True, note='M0 table 4, M2 table 1 (1 - (*)), C34'),
    Ends('motor.cos_phi', 0x0234, 1, ('E0015',), 0.01, (0x000A,), 1.0, (0x03E8,),
         0.009, 1.001, 0.8505, (0.85, 0.851), '', stopped=True),
    Ends('motor.r_stat', 0x0238, 2, ('E0002',), 0.01, (0x000A, 0x0000),
         4294967.295, (0xFFFF, 0xFFFF), 0.009, 4294967.296, 2.1005, (2.1, 2.101), 'Ω',
         stopped=True, note='M0 table 4, M2 table 1 (1 - (*)), C34'),
    Ends('motor.r_rot', 0x023C, 2, ('E0001',), 0.01, (0x000A, 0x0000),
         4294967.295, (0xFFFF, 0xFFFF), 0.009, 4294967.296, 1.2005, (1.2, 1.201), 'Ω',
         stopped=True, note='M0 table 4, M2 table 1 (1 - (*)), C34'),
    Ends('motor.l_main', 0x0240, 2, ('E0004',), 0.0, (0x0000, 0x0000),
         4294.967295, (0xFFFF, 0xFFFF), -0.000001, 4294.967296,
         0.1234565, (0.123456, 0.123457), 'H',
         stopped=True, note='M0 table 4, M2 table 1 ((*)), C34'),
    Ends('motor.sigma', 0x0244, 1, ('E0003',), 0.001, (0x0001,), 1.0, (0x03E8,),
         0.0, 1.001, 0.0505, (0.05, 0.051), '', stopped=True),
    Ends('motor.i_magn', 0x0248, 2, ('E0005',), 0.0, (0x0000, 0x0000),
         4294967.295, (0xFFFF, 0xFFFF), -0.001, 4294967.296, 1.6005, (1.6, 1.601), 'A',
         stopped=True, note='M0 table 4, M2 table 1 (0 - (I-limt - 1)), C34'),
    # I-magn is 0 or more, so I-magn + 1 is one count of Classic or more: 0.01 A.
    Ends('motor.i_limt', 0x024C, 2, ('E0018',), 0.01, (0x000A, 0x0000),
         4294967.295, (0xFFFF, 0xFFFF), 0.009, 4294967.296, 5.2005, (5.2, 5.201), 'A',
         stopped=True, note='M0 table 4, M2 table 1 ((I-magn + 1) - (*)), C34'),

    Ends('control.mode', 0x029C, 1, ('E0030',), 'Freque', (0x0000,), 'Speed', (0x0003,),
         'Stop', 'Vector', None, None, '', stopped=True, codes=_MODE),
    Ends('control.accel', 0x027E, 2, ('E001D',), 0.2, (0x00C8, 0x0000), 500.0, (0xA120, 0x0007),
         0.199, 500.001, 5.0005, (5.0, 5.001), 's', note='M0 table 4, M2 table 1, C46'),
    Ends('control.retard', 0x0282, 2, ('E001C',), 0.2, (0x00C8, 0x0000), 500.0, (0xA120, 0x0007),
         0.199, 500.001, 7.0005, (7.0, 7.001), 's', note='M0 table 4, M2 table 1, C46'),
    Ends('control.run_dly', 0x02BC, 1, ('E002C',), *_HOUR),
    Ends('control.dc_brk', 0x02C0, 1, ('E0088',), *_HOUR),
    Ends('control.ain_set', 0x02C4, 1, ('E0098',), '0-20mA', (0x0003,), 'Pot 10k', (0x0009,),
         'Off', 'Pot 5k', None, None, '', stopped=True, codes=_AIN_SET),
    Ends('control.auto_start', 0x02C8, 1, ('E0033',), *_SWITCH),
    Ends('control.energy_save', 0x02CC, 1, ('E00BB',), *_SWITCH),
    Ends('control.st_mode', 0x0290, 1, ('E0032',), 'Release', (0x0000,), 'Brake', (0x0001,),
         'Coast', 'Ramp', None, None, '', codes=_ST_MODE),
    Ends('control.kp_spd', 0x02D0, 1, ('E0006',), 0.01, (0x0001,), 655.35, (0xFFFF,),
         0.0, 655.36, 0.125, (0.12, 0.13), '', note='M0 table 4, M2 table 1 (1 - (*)), C34'),
    Ends('control.ti_spd', 0x02D4, 1, ('E0017',), 0.01, (0x0001,), 10.0, (0x03E8,),
         0.0, 10.01, 0.125, (0.12, 0.13), 's'),
    Ends('control.f_sleep', 0x02D8, 1, ('E00DC',), 0.0, (0x0000,), 6553.5, (0xFFFF,),
         -0.1, 6553.6, 12.35, (12.3, 12.4), 'Hz', note='M0 table 4 alone, C21'),
    Ends('control.byp_fr', 0x02DC, 1, ('E0051',), *_HZ),
    Ends('control.byp_bw', 0x02E0, 1, ('E0050',), *_HZ),
    # On no register: Modbus table 4 leaves it out. The words are those of Classic [M0 table 2].
    Ends('control.any_bus', None, 1, ('E0038',), 'PPO3', (0x0003,), 'PPO3', (0x0003,),
         'PPO2', 'PPO4', None, None, '', note='M0 table 2, M2 table 1',
         codes=(('PPO3', 3),)),

    # AnyBus = 193 in Freque and Speed is read, never offered [C19].
    Ends('freque.op_mode', 0x02E4, 1, ('E0031',), 'Terminal', (0x0081,), 'Fix-7 R', (0x003D,),
         'AnyBus', 'Temp F', None, None, '', note='M0 table 4, M2 table 1, C19', codes=_OP_MODE),
    Ends('freque.f_fix1', 0x02E8, 1, ('E0041',), *_HZ),
    Ends('freque.f_fix2', 0x02EC, 1, ('E0042',), *_HZ),
    Ends('freque.f_fix3', 0x02F0, 1, ('E0043',), *_HZ),
    Ends('freque.f_fix4', 0x02F4, 1, ('E0044',), *_HZ),
    Ends('freque.f_fix5', 0x02F8, 1, ('E0045',), *_HZ),
    Ends('freque.f_fix6', 0x02FC, 1, ('E0046',), *_HZ),
    Ends('freque.f_fix7', 0x0300, 1, ('E0047',), *_HZ),
    Ends('freque.fr_min', 0x0304, 1, ('E000D',), *_HZ, note=_C23),
    Ends('freque.fr_max', 0x0308, 1, ('E000B',), *_HZ, note=_C23),

    Ends('speed.op_mode', 0x030C, 1, ('E0089',), 'Terminal', (0x0081,), 'Fix-7 R', (0x003D,),
         'AnyBus', 'Temp F', None, None, '', note='M0 table 4, M2 table 1, C19', codes=_OP_MODE),
    Ends('speed.c_fix1', 0x0310, 1, ('E008A',), *_RPM),
    Ends('speed.c_fix2', 0x0314, 1, ('E008B',), *_RPM),
    Ends('speed.c_fix3', 0x0318, 1, ('E008C',), *_RPM),
    Ends('speed.c_fix4', 0x031C, 1, ('E008D',), *_RPM),
    Ends('speed.c_fix5', 0x0320, 1, ('E008E',), *_RPM),
    Ends('speed.c_fix6', 0x0324, 1, ('E008F',), *_RPM),
    Ends('speed.c_fix7', 0x0328, 1, ('E0090',), *_RPM),
    Ends('speed.sp_min', 0x032C, 1, ('E0091',), *_RPM, note=_C23),
    Ends('speed.sp_max', 0x0330, 1, ('E0092',), *_RPM, note=_C23),

    Ends('torque.op_mode', 0x0334, 1, ('E0035',), 'Terminal', (0x0081,), 'Fix-7 R', (0x003D,),
         'Fix-8 F', 'AnyBus', None, None, '', codes=_OP_MODE),
    Ends('torque.t_fix1', 0x0338, 1, ('E0061',), *_TORQUE),
    Ends('torque.t_fix2', 0x033C, 1, ('E0062',), *_TORQUE),
    Ends('torque.t_fix3', 0x0340, 1, ('E0063',), *_TORQUE),
    Ends('torque.t_fix4', 0x0344, 1, ('E0064',), *_TORQUE),
    Ends('torque.t_fix5', 0x0348, 1, ('E0065',), *_TORQUE),
    Ends('torque.t_fix6', 0x034C, 1, ('E0066',), *_TORQUE),
    Ends('torque.t_fix7', 0x0350, 1, ('E0067',), *_TORQUE),
    Ends('torque.tq_min', 0x0354, 1, ('E000E',), *_TORQUE),
    Ends('torque.tq_max', 0x0358, 1, ('E000C',), *_TORQUE),
    Ends('torque.max_fr', 0x035C, 1, ('E0026',), *_HZ),

    Ends('pi_reg.op_mode', 0x0360, 1, ('E0036',), 'Terminal', (0x0081,), 'Temp R', (0x0103,),
         'Fix-8 F', 'AnyBus', None, None, '', note='M0 table 4, M2 table 1, C20',
         codes=_REG_OP_MODE),
    Ends('pi_reg.r_fix1', 0x0364, 1, ('E0039',), *_PROCESS, note=_C17),
    Ends('pi_reg.r_fix2', 0x0368, 1, ('E003A',), *_PROCESS, note=_C17),
    Ends('pi_reg.r_fix3', 0x036C, 1, ('E003B',), *_PROCESS, note=_C17),
    Ends('pi_reg.r_fix4', 0x0370, 1, ('E003C',), *_PROCESS, note=_C17),
    Ends('pi_reg.r_fix5', 0x0374, 1, ('E003D',), *_PROCESS, note=_C17),
    Ends('pi_reg.r_fix6', 0x0378, 1, ('E003E',), *_PROCESS, note=_C17),
    Ends('pi_reg.r_fix7', 0x037C, 1, ('E003F',), *_PROCESS, note=_C17),
    Ends('pi_reg.setmin', 0x0380, 1, ('E004B',), *_SCALE, note=_C17),
    Ends('pi_reg.setmax', 0x0384, 1, ('E004C',), *_SCALE, note=_C17),
    Ends('pi_reg.actmin', 0x0388, 1, ('E009A',), *_SCALE, note=_C17),
    Ends('pi_reg.actmax', 0x038C, 1, ('E009B',), *_SCALE, note=_C17),
    Ends('pi_reg.t_min', 0x0390, 1, ('E0049',), *_CELSIUS),
    Ends('pi_reg.t_max', 0x0394, 1, ('E004A',), *_CELSIUS),
    # -1 or 1 and nothing between.
    Ends('pi_reg.reg_amp', 0x0398, 1, ('E0052',), -1, (0xFFFF,), 1, (0x0001,),
         -2, 2, 0, (-1, 1), '', note='M0 table 4, M2 table 1, C46'),
    Ends('pi_reg.reg_kp', 0x039C, 1, ('E0040',), 0.0, (0x0000,), 1.0, (0x0064,),
         -0.01, 1.01, 0.125, (0.12, 0.13), ''),
    Ends('pi_reg.reg_ti', 0x03A0, 1, ('E0048',), 1.0, (0x000A,), 200.0, (0x07D0,),
         0.9, 200.1, 12.35, (12.3, 12.4), 's'),
    Ends('pi_reg.min_fr', 0x03A4, 1, ('E009E',), *_HZ),
    Ends('pi_reg.max_fr', 0x03A8, 1, ('E0025',), *_HZ),
    Ends('pi_reg.unit', 0x03AC, 1, ('E000A',), 'None', (0x0000,), 'Hz', (0x000C,),
         'K', 'kHz', None, None, '', note='M0 table 4 (12 = Hz), M2 table 1, C21', codes=_UNIT),
    Ends('pi_reg.ain_act', 0x03B0, 1, ('E0034',), '0-10V', (0x0000,), '+/-10V', (0x0002,),
         'Off', '0-20mA', None, None, '', codes=_AIN_ACT),

    Ends('output.re_mode', 0x03B4, 1, ('E0059',), 'Disable', (0x0000,), 'Run Freq', (0x0005,),
         'Off', 'Run Torque', None, None, '', note='M0 table 4, M2 table 1, C18',
         codes=_RE_MODE),
    Ends('output.re_freq', 0x03B8, 1, ('E005A',), *_HZ),
    Ends('output.v_out', 0x03BC, 1, ('E005B',), *_OUTPUT_ENDS, codes=_OUTPUT),
    Ends('output.v_max', 0x03C0, 1, ('E005C',), 0.0, (0x0000,), 10.0, (0x03E8,),
         -0.01, 10.01, 5.005, (5.0, 5.01), 'V'),
    Ends('output.f_out', 0x03C4, 1, ('E005D',), *_OUTPUT_ENDS, codes=_OUTPUT),
    Ends('output.f_max', 0x03C8, 1, ('E005E',), 0, (0x0000,), 32000, (0x7D00,),
         -1, 32001, None, None, 'Hz'),

    Ends('serial.bus_type', 0x03CC, 1, ('E007A',), 'None', (0x0000,), 'ABCC', (0x0004,),
         'Off', 'MbusTcp', None, None, '', note='M0 table 4 alone, C21', codes=_BUS_TYPE),
    # Of Modbus [M0 §6.2.2]; Classic has 1 to 94 [M0 §6.1.2].
    Ends('serial.address', 0x03D0, 1, ('E00A9',), 1, (0x0001,), 247, (0x00F7,),
         0, 248, None, None, '', note='M0 table 4, M0 §6.2.2, C10'),
    Ends('serial.si_baud', 0x03D4, 1, ('E00A8',), '1200bps', (0x0010,), '57600 bps', (0x0300,),
         '600bps', '115200 bps', None, None, '', note='M0 table 4, C6', codes=_SI_BAUD),
    Ends('serial.si_prot', 0x03D8, 1, ('E00AA',), '7b Ep 1s', (0x0000,), '8b Np 2s', (0x0006,),
         '7b Np 1s', '8b Np 1s', None, None, '', note='M0 table 4, C5', codes=_SI_PROT),
    Ends('serial.sio_tot', 0x03DC, 1, ('E00AB',), 0.0, (0x0000,), 25.0, (0x00FA,),
         -0.1, 25.1, 2.45, (2.4, 2.5), 's'),
    Ends('serial.auto_reset', 0x03E0, 1, ('E002F',), *_SWITCH,
         note='M0 table 4, M2 table 1 (Bus Fail / Auto Reset), C22'),
    Ends('serial.auto_stop', 0x03E4, 1, ('E00D8',), *_SWITCH,
         note='M0 table 4, M2 table 1 (Bus Fail / Auto Stop), C22'),

    Ends('error.rst_dly', 0x0424, 1, ('E002A',), *_HOUR),
    Ends('error.tr_time', 0x0428, 1, ('E002B',), *_HOUR),
    Ends('error.ac_fail_mode', 0x042C, 1, ('E0037',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.ac_fail_delay', 0x0430, 1, ('E00A0',), *_DELAY),
    Ends('error.ac_fail_err_cnt', 0x0434, 1, ('E00A1',), *_TRIES),
    Ends('error.ac_fail_it_gnd', 0x0438, 1, ('E00B9',), *_SWITCH),
    Ends('error.temp_hi_err_cnt', 0x043C, 1, ('E009F',), *_TRIES),
    Ends('error.ptc_temp_mode', 0x0440, 1, ('E001B',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.ptc_temp_err_cnt', 0x0444, 1, ('E0072',), *_TRIES),
    Ends('error.overload_mode', 0x0448, 1, ('E0055',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.overload_err_cnt', 0x044C, 1, ('E00B7',), *_TRIES),
    Ends('error.overload_f_cool', 0x0450, 1, ('E0056',), 0, (0x0000,), 10000, (0x2710,),
         -1, 10001, None, None, ''),
    Ends('error.overload_s_temp', 0x0454, 1, ('E0057',), *_CELSIUS, note=_C23),
    Ends('error.ain_fail_mode', 0x0458, 1, ('E005F',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.ain_fail_err_cnt', 0x045C, 1, ('E00A2',), *_TRIES),
    Ends('error.dc_low_err_cnt', 0x0460, 1, ('E0022',), *_TRIES),
    Ends('error.dc_high_err_cnt', 0x0464, 1, ('E0023',), *_TRIES),
    Ends('error.gnd_fail_mode', 0x0468, 1, ('E00A3',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.short_c_err_cnt', 0x05AC, 1, ('E00F9',), 0, (0x0000,), 65535, (0xFFFF,),
         -1, 65536, None, None, '', note='M0 table 4 alone, C21'),
    Ends('error.imagn_low_mode', 0x046C, 1, ('E00A4',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.imagn_low_err_cnt', 0x0470, 1, ('E00A5',), *_TRIES),
    Ends('error.cur_low_mode', 0x0474, 1, ('E00A6',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.cur_low_err_cnt', 0x0478, 1, ('E00A7',), *_TRIES),
    Ends('error.cur_high_mode', 0x047C, 1, ('E00B2',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.cur_high_delay', 0x0480, 1, ('E00B5',), *_DELAY),
    Ends('error.cur_high_err_cnt', 0x0484, 1, ('E00B3',), *_TRIES),
    Ends('error.run_fail_mode', 0x0488, 1, ('E002E',), *_ON_FAULT_ENDS, codes=_ON_FAULT),
    Ends('error.run_fail_err_cnt', 0x048C, 1, ('E00AF',), *_TRIES),
)
