# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The ends of each setting of the MOVITRAC 31, from the text of [M4 §4].

A second witness beside the catalog: names are those of the public interface, P numbers and indices,
ranges and steps those of the manual, and nothing is read or computed from the tables of the driver.
The raw numbers are the four bytes of the frame: eight decimal digits, two of them decimals
[M4 §3.1], or the eight of a long one. An enumeration has its code times 100 [C106].

Without an option card a drive has 149 settings. The others are those of the cards that the
simulated drive can have.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

Value: TypeAlias = float | int | str | bool


class Ends(NamedTuple):
    """
    One setting and the two ends of its range.

    :ivar number: the P number on the keypad; ``''``: it has none.
    :ivar card: the option card that it needs, ``''``: none.
    :ivar low: the low end as a ROS value, and its four bytes; likewise the high end.
    :ivar below: one step beyond an end, or what is no label; ``None`` of a switch.
    :ivar between: a value between two steps, and these two; ``None`` of what has labels.
    :ivar codes: of what has labels each with its four bytes, as the manual orders them.
    """

    number: str
    name: str
    index: int
    card: str
    low: Value
    low_raw: str
    high: Value
    high_raw: str
    below: Value | None
    above: Value | None
    between: float | None = None
    neighbours: tuple[float, float] | None = None
    codes: tuple[tuple[Value, str], ...] = ()


_NO, _YES = '00000000', '00000100'

#: What several settings have in common: from the low end on.
_RAMP = (0.0, '00000000', 2000.0, '00200000', -0.05, 2010.0, 0.025, (0.0, 0.05))
_SETPOINT = (0.0, '00000000', 400.0, '00040000', -0.05, 400.05, 0.025, (0.0, 0.05))
_HYSTERESIS = (1.0, '00000100', 9.0, '00000900', 0.0, 10.0, 1.5, (1.0, 2.0))
_DELAY = (0.0, '00000000', 9.0, '00000900', -1.0, 10.0, 0.5, (0.0, 1.0))
_SLIP = (0.0, '00000000', 10.0, '00001000', -0.05, 10.05, 0.025, (0.0, 0.05))
_BOOST = (0.0, '00000000', 200.0, '00020000', -1.0, 201.0, 0.5, (0.0, 1.0))
#: In the 8-byte format, a half-byte in each [M4 §3.3].
_GEAR_RATIO = (1, '0000000000000001', 3_999_999_999, '0E0E060B02070F0F', 0, 4_000_000_000)
_MAGNETIZATION = (0.0, '00000000', 300.0, '00030000', -10.0, 310.0, 5.0, (0.0, 10.0))
_RESPONSE = (0.1, '00000010', 9.0, '00000900', 0.0, 9.1, 0.15, (0.1, 0.2))
_CURRENT = (0.0, '00000000', 50.0, '00005000', -1.0, 51.0, 0.5, (0.0, 1.0))
_SPEED = (0.0, '00000000', 5000.0, '00500000', -1.0, 5001.0, 0.5, (0.0, 1.0))
_F_MAX = (5.0, '00000500', 150.0, '00015000', 4.95, 150.05, 5.025, (5.0, 5.05))
_FACTOR = (0.1, '00000010', 3.0, '00000300', 0.09, 3.01, 0.105, (0.1, 0.11))
_BYTE = (0.0, '00000000', 255.0, '00025500', -1.0, 256.0, 0.5, (0.0, 1.0))
#: In the order of the fields of :class:`Ends`.
_NUMBERS: tuple[tuple[Any, ...], ...] = (
    ('P101', 'setpoint.n1_gain_factor', 22, '', 0.1, '00000010', 10.0, '00001000', 0.0, 10.1, 0.15,
     (0.1, 0.2)),
    ('P102', 'setpoint.n1_offset_factor', 23, '', 0.1, '00000010', 10.0, '00001000', 0.0, 10.1,
     0.15, (0.1, 0.2)),
    ('P120', 'ramp.t11_up', 25, '', *_RAMP),
    ('P121', 'ramp.t11_down', 26, '', *_RAMP),
    ('P122', 'ramp.t11_s_pattern', 29, '', 0.0, '00000000', 3.0, '00000300', -1.0, 4.0, 0.5,
     (0.0, 1.0)),
    ('P123', 'ramp.t21_up', 230, '', *_RAMP),
    ('P124', 'ramp.t21_down', 231, '', *_RAMP),
    ('P125', 'ramp.t21_s_pattern', 234, '', 0.0, '00000000', 3.0, '00000300', -1.0, 4.0, 0.5,
     (0.0, 1.0)),
    ('P130', 'ramp.t12_up_down', 27, '', *_RAMP),
    ('P131', 'ramp.t22_up_down', 232, '', *_RAMP),
    ('P140', 'ramp.t13_stop', 28, '', 0.0, '00000000', 9.95, '00000995', -0.05, 10.0, 0.025,
     (0.0, 0.05)),
    ('P141', 'ramp.t23_stop', 233, '', 0.0, '00000000', 9.95, '00000995', -0.05, 10.0, 0.025,
     (0.0, 0.05)),
    ('P151', 'setpoint.t4_up', 31, '', 1.0, '00000100', 60.0, '00006000', 0.0, 61.0, 1.5,
     (1.0, 2.0)),
    ('P152', 'setpoint.t4_down', 32, '', 1.0, '00000100', 60.0, '00006000', 0.0, 61.0, 1.5,
     (1.0, 2.0)),
    ('P160', 'setpoint.n11', 35, '', *_SETPOINT),
    ('P161', 'setpoint.n12', 36, '', *_SETPOINT),
    ('P162', 'setpoint.n13', 37, '', *_SETPOINT),
    ('P170', 'setpoint.n21', 39, '', *_SETPOINT),
    ('P171', 'setpoint.n22', 40, '', *_SETPOINT),
    ('P172', 'setpoint.n23', 41, '', *_SETPOINT),
    ('P181', 'setpoint.stop_setpoint_1', 292, '', 0.0, '00000000', 25.0, '00002500', -0.05, 25.05,
     0.025, (0.0, 0.05)),
    ('P182', 'setpoint.start_hysteresis_1', 293, '', 0.0, '00000000', 5.0, '00000500', -0.05, 5.05,
     0.025, (0.0, 0.05)),
    ('P184', 'setpoint.stop_setpoint_2', 295, '', 0.0, '00000000', 25.0, '00002500', -0.05, 25.05,
     0.025, (0.0, 0.05)),
    ('P185', 'setpoint.start_hysteresis_2', 296, '', 0.0, '00000000', 5.0, '00000500', -0.05, 5.05,
     0.025, (0.0, 0.05)),
    ('P200', 'frequency.f_min_1', 79, '', 0.0, '00000000', 40.0, '00004000', -0.05, 40.05, 0.025,
     (0.0, 0.05)),
    ('P202', 'frequency.f_max_1', 81, '', *_F_MAX),
    ('P210', 'frequency.f_min_2', 82, '', 0.0, '00000000', 40.0, '00004000', -0.05, 40.05, 0.025,
     (0.0, 0.05)),
    ('P212', 'frequency.f_max_2', 84, '', *_F_MAX),
    ('P220', 'frequency.f_min_3', 85, '', 0.0, '00000000', 150.0, '00015000', -0.05, 150.05, 0.025,
     (0.0, 0.05)),
    ('P221', 'frequency.f_base_3', 86, '', 5.0, '00000500', 400.0, '00040000', 4.0, 401.0, 5.5,
     (5.0, 6.0)),
    ('P222', 'frequency.f_max_3', 87, '', 5.0, '00000500', 400.0, '00040000', 4.95, 400.05, 5.025,
     (5.0, 5.05)),
    ('P231', 'frequency.window_centre', 91, '', *_F_MAX),
    ('P232', 'frequency.window_width', 92, '', 2.0, '00000200', 9.0, '00000900', 1.0, 10.0, 2.5,
     (2.0, 3.0)),
    ('P260', 'frequency.start_stop_1', 96, '', *_SLIP),
    ('P261', 'frequency.start_stop_2', 97, '', *_SLIP),
    ('P310', 'motor.rated_current_1', 310, '', 20.0, '00002000', 200.0, '00020000', 19.0, 201.0,
     20.5, (20.0, 21.0)),
    ('P320', 'motor.i_max_1', 102, '', 20.0, '00002000', 150.0, '00015000', 19.0, 151.0, 20.5,
     (20.0, 21.0)),
    ('P321', 'motor.boost_1', 103, '', *_BOOST),
    ('P322', 'motor.ixr_1', 104, '', *_BOOST),
    ('P323', 'motor.slip_1', 105, '', *_SLIP),
    ('P324', 'motor.pole_pairs_1', 106, '', 1.0, '00000100', 6.0, '00000600', 0.0, 7.0, 1.5,
     (1.0, 2.0)),
    ('P326', 'motor.premagnetization_time_1', 277, '', *_MAGNETIZATION),
    ('P327', 'motor.postmagnetization_time_1', 278, '', *_MAGNETIZATION),
    ('P329', 'motor.voltage_1', 286, '', 200.0, '00020000', 600.0, '00060000', 199.0, 601.0, 200.5,
     (200.0, 201.0)),
    ('P330', 'motor.rated_current_2', 311, '', 20.0, '00002000', 200.0, '00020000', 19.0, 201.0,
     20.5, (20.0, 21.0)),
    ('P340', 'motor.i_max_2', 111, '', 20.0, '00002000', 150.0, '00015000', 19.0, 151.0, 20.5,
     (20.0, 21.0)),
    ('P341', 'motor.boost_2', 112, '', *_BOOST),
    ('P342', 'motor.ixr_2', 113, '', *_BOOST),
    ('P343', 'motor.slip_2', 114, '', *_SLIP),
    ('P344', 'motor.pole_pairs_2', 115, '', 1.0, '00000100', 6.0, '00000600', 0.0, 7.0, 1.5,
     (1.0, 2.0)),
    ('P346', 'motor.premagnetization_time_2', 279, '', *_MAGNETIZATION),
    ('P347', 'motor.postmagnetization_time_2', 280, '', *_MAGNETIZATION),
    ('P349', 'motor.voltage_2', 287, '', 200.0, '00020000', 600.0, '00060000', 199.0, 601.0, 200.5,
     (200.0, 201.0)),
    ('P400', 'reference_values.frequency_1', 117, '', 2.0, '00000200', 150.0, '00015000', 1.0,
     151.0, 2.5, (2.0, 3.0)),
    ('P401', 'reference_values.frequency_hysteresis_1', 118, '', *_HYSTERESIS),
    ('P402', 'reference_values.frequency_delay_1', 119, '', *_DELAY),
    ('P410', 'reference_values.frequency_2', 120, '', 2.0, '00000200', 150.0, '00015000', 1.0,
     151.0, 2.5, (2.0, 3.0)),
    ('P411', 'reference_values.frequency_hysteresis_2', 121, '', *_HYSTERESIS),
    ('P412', 'reference_values.frequency_delay_2', 122, '', *_DELAY),
    ('P430', 'reference_values.setpoint_hysteresis', 126, '', *_HYSTERESIS),
    ('P450', 'reference_values.current_1', 129, '', 10.0, '00001000', 150.0, '00015000', 9.0, 151.0,
     10.5, (10.0, 11.0)),
    ('P451', 'reference_values.current_hysteresis_1', 130, '', *_HYSTERESIS),
    ('P452', 'reference_values.current_delay_1', 131, '', *_DELAY),
    ('P460', 'reference_values.current_2', 133, '', 10.0, '00001000', 150.0, '00015000', 9.0, 151.0,
     10.5, (10.0, 11.0)),
    ('P461', 'reference_values.current_hysteresis_2', 134, '', *_HYSTERESIS),
    ('P462', 'reference_values.current_delay_2', 135, '', *_DELAY),
    ('P471', 'reference_values.i_max_delay', 138, '', *_DELAY),
    ('P501', 'monitoring.frequency_reference_3', 139, '', 10.0, '00001000', 99.0, '00009900', 9.0,
     100.0, 10.5, (10.0, 11.0)),
    ('P511', 'monitoring.motor_response_time_1', 142, '', *_RESPONSE),
    ('P513', 'monitoring.motor_response_time_2', 144, '', *_RESPONSE),
    ('P521', 'monitoring.regenerative_response_time_1', 146, '', *_RESPONSE),
    ('P523', 'monitoring.regenerative_response_time_2', 148, '', *_RESPONSE),
    ('P550', 'monitoring.frs_alert', 302, 'frs', 50, '0000000000000302', 99_999_999,
     '00050F050E000F0F', 49, 100_000_000),
    ('P551', 'monitoring.frs_lag_error', 304, 'frs', 100, '0000000000000604', 99_999_999,
     '00050F050E000F0F', 99, 100_000_000),
    ('P552', 'monitoring.frs_hold_time', 260, 'frs', 1.0, '00000100', 99.0, '00009900', 0.0,
     100.0, 1.5, (1.0, 2.0)),
    ('P554', 'monitoring.frs_positional_tolerance', 247, 'frs', 10.0, '00001000', 32768.0,
     '03276800', 9.0, 32769.0, 10.5, (10.0, 11.0)),
    ('P555', 'monitoring.frs_led_counter', 248, 'frs', 10.0, '00001000', 32768.0,
     '03276800', 9.0, 32769.0, 10.5, (10.0, 11.0)),
    ('P556', 'monitoring.frs_position_time_constant', 251, 'frs', 1.0, '00000100', 2000.0,
     '00200000', 0.0, 2001.0, 1.5, (1.0, 2.0)),
    ('P571', 'monitoring.fieldbus_timeout', 608, 'ffi', 0.01, '00000001', 650.0, '00065000', 0.0,
     650.01, 0.015, (0.01, 0.02)),
    ('P631', 'terminal.analog_output_1_factor', 163, 'fea', *_FACTOR),
    ('P633', 'terminal.analog_output_2_factor', 165, 'fea', *_FACTOR),
    ('P635', 'terminal.measurement_output_factor', 275, '', *_FACTOR),
    ('P721', 'control.excitation_current_1', 175, '', 10.0, '00001000', 50.0, '00005000', 9.0,
     51.0, 10.5, (10.0, 11.0)),
    ('P722', 'control.excitation_duration_1', 176, '', 3.0, '00000300', 180.0, '00018000', 2.0,
     181.0, 3.5, (3.0, 4.0)),
    ('P724', 'control.excitation_current_2', 178, '', 10.0, '00001000', 50.0, '00005000', 9.0,
     51.0, 10.5, (10.0, 11.0)),
    ('P725', 'control.excitation_duration_2', 179, '', 3.0, '00000300', 180.0, '00018000', 2.0,
     181.0, 3.5, (3.0, 4.0)),
    ('P731', 'control.dc_braking_time_1', 181, '', 0.1, '00000010', 30.0, '00003000', 0.0, 30.1,
     0.15, (0.1, 0.2)),
    ('P732', 'control.dc_holding_current_1', 182, '', *_CURRENT),
    ('P734', 'control.dc_braking_time_2', 184, '', 0.1, '00000010', 30.0, '00003000', 0.0, 30.1,
     0.15, (0.1, 0.2)),
    ('P735', 'control.dc_holding_current_2', 185, '', *_CURRENT),
    ('P741', 'control.dc_heating_current_1', 187, '', *_CURRENT),
    ('P743', 'control.dc_heating_current_2', 189, '', *_CURRENT),
    ('P769', 'control.frs_kp', 259, 'frs', 1.0, '00000100', 200.0, '00020000', 0.0, 201.0, 1.5,
     (1.0, 2.0)),
    ('P771', 'control.speed_p_gain', 210, 'fen', 0.1, '00000010', 60.0, '00006000', 0.0, 60.1,
     0.15, (0.1, 0.2)),
    ('P772', 'control.speed_time_constant', 211, 'fen', 0.0, '00000000', 500.0, '00050000', -1.0,
     501.0, 0.5, (0.0, 1.0)),
    ('P777', 'control.p_gain_feedforward', 262, 'fen', 0.0, '00000000', 60.0, '00006000', -0.1,
     60.1, 0.05, (0.0, 0.1)),
    ('P778', 'control.setpoint_filter', 208, 'fen', 0.0, '00000000', 100.0, '00010000', -1.0,
     101.0, 0.5, (0.0, 1.0)),
    ('P779', 'control.p_gain_hold', 261, 'fen', 0.0, '00000000', 60.0, '00006000', -0.1, 60.1,
     0.05, (0.0, 0.1)),
    ('P842', 'serial.inverter_address', 206, '', 0.0, '00000000', 63.0, '00006300', -1.0, 64.0,
     0.5, (0.0, 1.0)),
    ('P843', 'serial.response_time', 207, '', 0.0, '00000000', 200.0, '00020000', -10.0, 210.0,
     5.0, (0.0, 10.0)),
    ('P861', 'special.restart_time', 167, '', 3.0, '00000300', 30.0, '00003000', 2.0, 31.0, 3.5,
     (3.0, 4.0)),
    ('P762', 'control.frs_master_gear_ratio', 263, 'frs', *_GEAR_RATIO),
    ('P763', 'control.frs_slave_gear_ratio', 265, 'frs', *_GEAR_RATIO),
    ('P882', 'special.master_slave_weighting', 226, 'fio', 0.1, '00000010', 10.0, '00001000', 0.09,
     10.01, 0.105, (0.1, 0.11)),
    ('', 'serial.pc_timeout', 285, '', 0.0, '00000000', 10.0, '00001000', -0.1, 10.1, 0.05,
     (0.0, 0.1)),
    ('', 'ipos.reference_speed_1', 700, 'fpi', *_SPEED),
    ('', 'ipos.reference_speed_2', 701, 'fpi', *_SPEED),
    ('', 'ipos.breakpoint', 707, 'fpi', *_BYTE),
    ('', 'ipos.position_window', 708, 'fpi', 0.0, '00000000', 32767.0, '03276700', -1.0, 32768.0,
     0.5, (0.0, 1.0)),
    ('', 'ipos.teach_terminal', 710, 'fpi', 0.0, '00000000', 15.0, '00001500', -1.0, 16.0, 0.5,
     (0.0, 1.0)),
    ('', 'ipos.timeout_period', 712, 'fpi', 0.0, '00000000', 32767.0, '03276700', -1.0, 32768.0,
     0.5, (0.0, 1.0)),
    ('', 'ipos.n_setpoint', 713, 'fpi', 0.0, '00000000', 3000.0, '00300000', -0.01, 3000.01, 0.005,
     (0.0, 0.01)),
    ('', 'ipos.code_pointer', 714, 'fpi', *_BYTE),
    ('', 'ipos.data_pointer', 715, 'fpi', *_BYTE),
    ('', 'ipos.x_controller_gain', 716, 'fpi', 0.1, '00000010', 32.0, '00003200', 0.05, 32.05,
     0.125, (0.1, 0.15)),
    ('', 'ipos.positioning_ramp', 717, 'fpi', 0.0, '00000000', 10.0, '00001000', -0.02, 10.5, 0.01,
     (0.0, 0.02)),
    ('', 'ipos.travel_speed_cw', 718, 'fpi', *_SPEED),
    ('', 'ipos.travel_speed_ccw', 719, 'fpi', *_SPEED),
    ('', 'ipos.lag_error_window', 1003, 'fpi', 0, '0000000000000000', 2_147_483_647,
     '070F0F0F0F0F0F0F', -1, 2_147_483_648),
)
#: 0.00 = No, 1.00 = Yes, or Off and On.
_SWITCHES = (
    ('P150', 'setpoint.motorized_potentiometer', 30, ''),
    ('P153', 'setpoint.save_last_position', 33, ''),
    ('P154', 'setpoint.motor_pot_plus_external', 34, ''),
    ('P163', 'setpoint.mix_1', 38, ''),
    ('P173', 'setpoint.mix_2', 42, ''),
    ('P180', 'setpoint.stop_function_1', 291, ''),
    ('P183', 'setpoint.stop_function_2', 294, ''),
    ('P230', 'frequency.window_skip', 90, ''),
    ('P311', 'motor.pwm_fix_1', 329, ''),
    ('P328', 'motor.size_up_1', 267, ''),
    ('P331', 'motor.pwm_fix_2', 330, ''),
    ('P348', 'motor.size_up_2', 269, ''),
    ('P350', 'motor.enable_set_selection', 116, ''),
    ('P500', 'monitoring.deceleration', 140, ''),
    ('P510', 'monitoring.motor_speed_1', 141, ''),
    ('P512', 'monitoring.motor_speed_2', 143, ''),
    ('P520', 'monitoring.regenerative_speed_1', 145, ''),
    ('P522', 'monitoring.regenerative_speed_2', 147, ''),
    ('P530', 'monitoring.mains_voltage', 149, ''),
    ('P557', 'monitoring.frs_cable_brake', 268, 'frs'),
    ('P570', 'monitoring.enable_fieldbus_setpoints', 607, 'ffi'),
    ('P710', 'control.hoist_1', 170, ''),
    ('P712', 'control.hoist_2', 172, ''),
    ('P720', 'control.rapid_start_1', 174, ''),
    ('P723', 'control.rapid_start_2', 177, ''),
    ('P730', 'control.dc_braking_1', 180, ''),
    ('P733', 'control.dc_braking_2', 183, ''),
    ('P740', 'control.dc_heating_1', 186, ''),
    ('P742', 'control.dc_heating_2', 188, ''),
    ('P760', 'control.synchronous_operation', 249, 'frs'),
    ('P774', 'control.sxr_preselection', 235, 'fen'),
    ('P800', 'special.parameter_lock', 202, ''),
    ('P860', 'special.auto_reset', 168, ''),
    ('P862', 'special.keypad_reset', 166, ''),
    ('P870', 'serial.manual_operation', 196, ''),
    ('P880', 'serial.master_slave', 212, 'fio'),
    ('P890', 'special.four_quadrant_1', 194, ''),
    ('P891', 'special.four_quadrant_2', 195, ''),
    ('', 'ipos.override', 709, 'fpi'),
    ('', 'ipos.axis_referencing', 720, 'fpi'),
    ('', 'ipos.reference_point_defined', 721, 'fpi'),
)

#: The labels of the codes 0.00, 1.00 ... in the order of the manual.
_CHARACTERISTIC = ('Gain', 'Offset')
_SIGNAL = ('0...10V or 0...20mA', '-10...+10V or 4...20mA')
_F_BASE = (50, 60, 87, 104, 120)
_PATTERN_1 = ('V/f pattern 3', 'V/f pattern 1')
_PATTERN_2 = ('V/f pattern 3', 'V/f pattern 2')
_PWM = ('No function', '4 kHz', '8 kHz', '12 kHz', '16 kHz')
_FREQUENCY_1 = ('f < fref 1', 'f > fref 1')
_FREQUENCY_2 = ('f < fref 2', 'f > fref 2')
_AT_SETPOINT = ('act. value=setpoint', 'act. value≠setpoint')
_CURRENT_1 = ('I < Iref 1', 'I > Iref 1')
_CURRENT_2 = ('I < Iref 2', 'I > Iref 2')
_I_MAX = ('I < Imax', 'I > Imax')
_PROTECTION = ('OFF', 'Warning', 'Switch off')
_COOLING = ('fan-cooled', 'ext. cooled')
_PO = ('No function', 'Speed', 'Current', 'Position low', 'Position high', 'Max. Speed',
    'Max. Current', 'Slip', 'Ramp', 'Control word 1', 'Control word 2', 'Speed [%]')
_PI = ('No function', 'Speed', 'Apparent current', 'Active current', 'Position low',
    'Position high', 'Status word 1', 'Status word 2', 'Speed [%]')
_TIMEOUT_RESPONSE = ('Rapid stop', 'Emergency stop', 'Immediate switch-off', 'Rapid stop/fault',
    'Emergency stop/fault', 'Immediate switch-off/fault', 'Standard mode', 'No response')
_INPUT = ('CCW/Stop', 'Enable/Stop', 'Parameter set select.', 'n11 (n21)', 'n12 (n22)', 'Reset',
    'Motor. pot. UP', 'Motor. pot. DOWN', '/Deceleration mon.', 'No function', 'Ramp selection',
    '/Controller inhibit', '/External fault', 'FRS zero point', 'FRS Control', 'FRS slave start',
    'CW/Stop', 'No function (17)', 'Free running slave', '/Hold controller')
_OUTPUT = ('MOVITRAC ready', 'Rotating field on', 'Rotating field off', 'Brake applied',
    'Manual mode', 'Parameter set', '/Ixt-Warning', 'No function', '1st freq. ref.',
    '2nd freq. ref.', 'No function (10)', 'Act. value=Setpoint', 'No function (12)',
    'No function (13)', 'No function (14)', '1st current ref.', '2nd current ref.', 'Imax',
    '/Fault delay', '/Fault', '/External fault', '/Current>>', '/U DC-link>>', 'No function (23)',
    'No function (24)', '/Ixt>>', '/Temperature>>', 'No function (27)', 'Frequency skip',
    '/FRS alert', '/FRS lag error', 'Slave in position', '/Fault BRC', 'Brake released',
    'No function (34)', 'Zero speed', 'Motor warning 1', 'Motor warning 2', 'In position',
    'IPOS output 1', 'IPOS output 2', 'IPOS output 3', 'IPOS output 4', 'IPOS output 5',
    'IPOS output 6', 'IPOS output 7', 'IPOS output 8')
_ANALOG_OUTPUT = ('Actual frequency', 'Actual speed', 'No function', 'Ramp', 'Motor voltage',
    'No function (5)', 'Ixt-value', 'Apparent current', 'Frequency setpoint')
_ANALOG_32_33 = ('No function', 'Setpoint n1')
_ANALOG_36_37 = ('No function', 'External current limit')
_OPERATING_MODE = ('V/f mode', 'Speed control', 'Positioning control')
_FRS_RESPONSE = ('0/1 signal', 'coast', 'stop', 'rapid stop')
_FRS_MODE = tuple(f'Mode {number}' for number in range(1, 8))
_PULSES = (128, 256, 512, 1024, 2048)
_SAVE = ('On', 'Off')
_USER_MENU = ('On only with FBG 31', 'Off')
_FACTORY_SELECTION = ('Standard', 'US')
_CONTROL_MODE = ('Standard', 'Remote setpoint', 'Remote control', 'Fieldbus')
_LANGUAGE = ('1st language', '2nd language', '3rd language')
_ROLE = ('Slave', 'Master')
_REFERENCE_TRAVEL = ('Type 0', 'Type 1', 'Type 2', 'Type 3', 'Type 4', 'Type 5')
_MANUAL_MODE = ('x control', 'n control')
_FIELDBUS_MODE = (
    'Bus position setpoint not used',
    'Bus position setpoint used as manual mode setpoint',
    'GOPA command is using the bus position setpoint',
)
_LISTS = (
    ('P100', 'setpoint.n1_characteristic', 21, '', _CHARACTERISTIC),
    ('P110', 'setpoint.n2_signal', 24, '', _SIGNAL),
    ('P201', 'frequency.f_base_1', 80, '', _F_BASE),
    ('P211', 'frequency.f_base_2', 83, '', _F_BASE),
    ('P250', 'frequency.vf_pattern_1', 88, '', _PATTERN_1),
    ('P251', 'frequency.vf_pattern_2', 89, '', _PATTERN_2),
    ('P325', 'motor.pwm_frequency_1', 272, '', _PWM),
    ('P345', 'motor.pwm_frequency_2', 273, '', _PWM),
    ('P403', 'reference_values.frequency_signal_1', 123, '', _FREQUENCY_1),
    ('P413', 'reference_values.frequency_signal_2', 124, '', _FREQUENCY_2),
    ('P431', 'reference_values.setpoint_signal', 127, '', _AT_SETPOINT),
    ('P453', 'reference_values.current_signal_1', 132, '', _CURRENT_1),
    ('P463', 'reference_values.current_signal_2', 136, '', _CURRENT_2),
    ('P470', 'reference_values.i_max_signal', 137, '', _I_MAX),
    ('P541', 'monitoring.motor_protection_1', 312, '', _PROTECTION),
    ('P542', 'monitoring.cooling_type_1', 314, '', _COOLING),
    ('P543', 'monitoring.motor_protection_2', 313, '', _PROTECTION),
    ('P544', 'monitoring.cooling_type_2', 315, '', _COOLING),
    ('P553', 'monitoring.frs_fault_response', 246, 'frs', _FRS_RESPONSE),
    ('P560', 'monitoring.po1_description', 601, 'ffi', _PO),
    ('P561', 'monitoring.pi1_description', 604, 'ffi', _PI),
    ('P562', 'monitoring.po2_description', 602, 'ffi', _PO),
    ('P563', 'monitoring.pi2_description', 605, 'ffi', _PI),
    ('P564', 'monitoring.po3_description', 603, 'ffi', _PO),
    ('P565', 'monitoring.pi3_description', 606, 'ffi', _PI),
    ('P572', 'monitoring.fieldbus_timeout_response', 609, 'ffi', _TIMEOUT_RESPONSE),
    ('P600', 'terminal.input_42', 150, '', _INPUT),
    ('P601', 'terminal.input_43', 151, '', _INPUT),
    ('P602', 'terminal.input_47', 152, '', _INPUT),
    ('P603', 'terminal.input_48', 153, 'fio', _INPUT),
    ('P604', 'terminal.input_49', 154, 'fio', _INPUT),
    ('P605', 'terminal.input_50', 155, 'fio', _INPUT),
    ('P606', 'terminal.input_51', 156, 'fio', _INPUT),
    ('P607', 'terminal.input_52', 321, 'fio', _INPUT),
    ('P608', 'terminal.input_53', 322, 'fio', _INPUT),
    ('P609', 'terminal.input_54', 323, 'fio', _INPUT),
    ('P611', 'terminal.output_62', 158, '', _OUTPUT),
    ('P612', 'terminal.output_63', 159, 'fio', _OUTPUT),
    ('P613', 'terminal.output_64', 160, 'fio', _OUTPUT),
    ('P614', 'terminal.output_69', 324, 'fio', _OUTPUT),
    ('P615', 'terminal.output_70', 325, 'fio', _OUTPUT),
    ('P616', 'terminal.output_71', 326, 'fio', _OUTPUT),
    ('P617', 'terminal.output_72', 327, 'fio', _OUTPUT),
    ('P630', 'terminal.analog_output_1', 162, 'fea', _ANALOG_OUTPUT),
    ('P632', 'terminal.analog_output_2', 164, 'fea', _ANALOG_OUTPUT),
    ('P634', 'terminal.measurement_output', 274, '', _ANALOG_OUTPUT),
    ('P640', 'terminal.analog_input_32_33', 110, '', _ANALOG_32_33),
    ('P641', 'terminal.analog_input_36_37', 252, 'fea', _ANALOG_36_37),
    ('P761', 'control.frs_role', 250, 'frs', _ROLE),
    ('P764', 'control.frs_mode', 253, 'frs', _FRS_MODE),
    ('P770', 'control.operating_mode', 209, 'fen', _OPERATING_MODE),
    ('P773', 'control.pulses_per_revolution', 225, 'fen', _PULSES),
    ('P801', 'special.save_to_eeprom', 236, '', _SAVE),
    ('P802', 'special.user_menu', 270, '', _USER_MENU),
    ('P831', 'special.factory_selection', 328, '', _FACTORY_SELECTION),
    ('P841', 'serial.control_mode', 205, '', _CONTROL_MODE),
    ('P850', 'special.language', 221, '', _LANGUAGE),
    ('P881', 'special.master_slave_role', 213, 'fio', _ROLE),
    ('', 'ipos.reference_travel_type', 702, 'fpi', _REFERENCE_TRAVEL),
    ('', 'ipos.manual_mode', 711, 'fpi', _MANUAL_MODE),
    ('', 'ipos.fieldbus_mode', 722, 'fpi', _FIELDBUS_MODE),
)


def _switch(number: str, name: str, index: int, card: str) -> Ends:
    return Ends(
        number, name, index, card, False, _NO, True, _YES, None, None,
        codes=((False, _NO), (True, _YES)),
    )


def _list(number: str, name: str, index: int, card: str, labels: tuple[Any, ...]) -> Ends:
    codes = tuple((label, f'{code:06}00') for code, label in enumerate(labels))
    wrong: tuple[Value, Value] = ('None', '17 kHz')
    if not isinstance(labels[0], str):
        wrong = labels[0] - 1, labels[-1] + 1
    (low, low_raw), (high, high_raw) = codes[0], codes[-1]
    return Ends(
        number, name, index, card, low, low_raw, high, high_raw, *wrong, codes=codes
    )


ENDS = (
    *(Ends(*row) for row in _NUMBERS),
    *(_switch(*row) for row in _SWITCHES),
    *(_list(*row) for row in _LISTS),
)
#: How many settings there are with a card, and without one.
COUNTS = {'': 149, 'frs': 14, 'fio': 16, 'fea': 5, 'fen': 8, 'fpi': 20, 'ffi': 9}
