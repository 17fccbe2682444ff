# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The settings whose ends or steps are others on Classic, copied by hand from the manuals.

The complement of `parameter_ends.py`, whose other settings have the same ends and the same raw
numbers on both buses. Types are those of [M0 table 2], ranges and decimals those of [M2 table 1].
Where that one prints no range, or one that depends on the inverter [C34], the end is that of a
SINT16, but never below zero where Modbus has no sign [C23].
"""

from __future__ import annotations

import dataclasses

from support.parameter_ends import Ends

#: Low end and its word, high end and its word, one step beyond each, a value between two steps and
#: these two.
_OTHERS = {
    # 1 - 10000, two decimals
    'motor.p_nom': (0.01, 0x0001, 100.0, 0x2710, 0.0, 100.01, 1.505, (1.5, 1.51)),
    # 1 - (*), one decimal
    'motor.i_nom': (0.1, 0x0001, 3276.7, 0x7FFF, 0.0, 3276.8, 3.45, (3.4, 3.5)),
    # 1 - 100, two decimals
    'motor.cos_phi': (0.01, 0x0001, 1.0, 0x0064, 0.0, 1.01, 0.855, (0.85, 0.86)),
    # 1 - (*), two decimals
    'motor.r_stat': (0.01, 0x0001, 327.67, 0x7FFF, 0.0, 327.68, 2.105, (2.1, 2.11)),
    'motor.r_rot': (0.01, 0x0001, 327.67, 0x7FFF, 0.0, 327.68, 1.205, (1.2, 1.21)),
    # (*), four decimals
    'motor.l_main': (0.0, 0x0000, 3.2767, 0x7FFF, -0.0001, 3.2768, 0.12345, (0.1234, 0.1235)),
    # 0 - (I-limt - 1), two decimals
    'motor.i_magn': (0.0, 0x0000, 327.67, 0x7FFF, -0.01, 327.68, 1.605, (1.6, 1.61)),
    # (I-magn + 1) - (*), two decimals
    'motor.i_limt': (0.01, 0x0001, 327.67, 0x7FFF, 0.0, 327.68, 5.205, (5.2, 5.21)),
    # 2 - 5000, one decimal
    'control.accel': (0.2, 0x0002, 500.0, 0x1388, 0.1, 500.1, 5.05, (5.0, 5.1)),
    'control.retard': (0.2, 0x0002, 500.0, 0x1388, 0.1, 500.1, 7.05, (7.0, 7.1)),
    # 1 - (*), two decimals
    'control.kp_spd': (0.01, 0x0001, 327.67, 0x7FFF, 0.0, 327.68, 0.125, (0.12, 0.13)),
    # no range, C21
    'control.f_sleep': (0.0, 0x0000, 3276.7, 0x7FFF, -0.1, 3276.8, 12.35, (12.3, 12.4)),
    # 1 to 94 of Classic [M0 §6.1.2], C10
    'serial.address': (1, 0x0001, 94, 0x005E, 0, 95, None, None),
    # no range, C21
    'error.short_c_err_cnt': (0, 0x0000, 32767, 0x7FFF, -1, 32768, None, None),
}
OTHER_ON_CLASSIC = frozenset(_OTHERS)


def on_classic(ends: Ends, dialect: str) -> Ends:
    """Return the ends of a setting on Classic, as the manual of that version has it."""
    if dialect == '5.0' and ends.name == 'pi_reg.unit':
        # 12 = Hz is in M0 alone, C21
        return dataclasses.replace(ends, high='V', high_words=(0x000B,), codes=ends.codes[:-1])
    if ends.name not in _OTHERS:
        return ends
    low, low_word, high, high_word, below, above, between, neighbours = _OTHERS[ends.name]
    return dataclasses.replace(
        ends, low=low, low_words=(low_word,), high=high, high_words=(high_word,),
        below=below, above=above, between=between, neighbours=neighbours,
    )
