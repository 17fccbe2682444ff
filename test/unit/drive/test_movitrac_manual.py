# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every row of the parameter list of a MOVITRAC 31 [M4 §4] through the wire, by its index."""

from __future__ import annotations

from typing import Any

import pytest
from support.movitrac_ends import COUNTS, ENDS, Ends
from support.rig import Rig

#: What has to be on for a setting to be switched on [M4 §2.1.2].
NEEDED = {f'control.hoist_{number}': f'special.four_quadrant_{number}' for number in (1, 2)}
#: P802: On only by the keypad.
ONE_WAY = 'special.user_menu'
#: Indices that are only read, as the manual has them, and the option card that they need.
BCD = {
    '': """
        0 status.frequency, 4 status.heat_sink_temperature, 18 status.external_current_limit,
        17 status.speed, 2 status.dc_link_voltage, 1 status.motor_voltage,
        5 status.apparent_current, 6 status.inverter_utilization, 308 status.motor_utilization_1,
        309 status.motor_utilization_2,
        8 status.fault_t0, 9 status.fault_t1, 10 status.fault_t2, 11 status.fault_t3,
        12 status.fault_t4,
        298 status.stop_setpoint_1_n2, 299 status.start_hysteresis_1_n2,
        300 status.stop_setpoint_2_n2, 301 status.start_hysteresis_2_n2
    """,
    'ffi': '611 status.fieldbus_baud_rate, 612 status.fieldbus_address',
    'fpi': '706 ipos.instruction_pointer, 723 ipos.feedforward',
    'frs': '256 control.frs_offset_1, 257 control.frs_offset_2, 258 control.frs_offset_3',
}
WORDS = {
    '': """
        13 status.terminals, 237 status.options, 197 status.manual_control_word,
        284 fieldbus.inverter_status, 215 special.software_system
    """,
    'ffi': """
        613 status.po1_setpoint, 614 status.po2_setpoint, 615 status.po3_setpoint,
        616 status.pi1_actual_value, 617 status.pi2_actual_value, 618 status.pi3_actual_value,
        214 special.eprom_fieldbus
    """,
}
LONG = {
    'fpi': """
        1000 ipos.reference_offset, 1001 ipos.limit_switch_cw, 1002 ipos.limit_switch_ccw,
        1004 ipos.x_setpoint, 1009 ipos.actual_position, 1010 ipos.code_value,
        1011 ipos.data_value, 1012 ipos.pc_position_setpoint, 1017 ipos.lag_distance
    """,
    'frs': '254 control.frs_slave_counter',
}
#: What is never negative.
SIZES = {'ipos.lag_distance'}
#: And those that have a text for each code: the code, and what it means.
TEXTS = {
    '': """
        271 status.inverter_type 3100 MOVITRAC 31.., 306 status.output_stage 33 31C011-503-4-00
    """,
    'ffi': """
        600 status.process_data_configuration 4 3PD+parameter,
        610 status.fieldbus_type 2 INTERBUS-S
    """,
    'fpi': """
        704 fieldbus.ipos_programs 1 Save to EEPROM, 705 fieldbus.ipos_operating_mode 4 Manual mode
    """,
}


def fitted(card: str, **settings: Any) -> Rig:
    """Return a drive with an option card, on RS-232, where its address does not matter."""
    options = {'option_card': card or 'none', 'interface': 'rs232'}
    return Rig('movitrac', options=options, telemetry_rate=0.0, **settings)


def last(rig: Rig, start: str) -> str:
    """Return the last frame that starts so, without its sum, in hexadecimal."""
    frames = [frame['hex'] for frame in rig.line.frames]
    return next(frame[:-2] for frame in reversed(frames) if frame.startswith(start))


# --- what is set ----------------------------------------------------------------------------------


def not_set(rig: Rig, ends: Ends) -> list[object]:
    """Set both ends of a setting and put back what was there; return what was not as it must be."""
    wrong: list[object] = []
    parameters, long = rig.drive.parameters, len(ends.low_raw) > 8
    before = parameters.values[ends.name]
    two = [(ends.low, ends.low_raw), (ends.high, ends.high_raw)]
    if ends.name == ONE_WAY:
        two = two[1:]
    # what is there already is not written
    for value, raw in sorted(two, key=lambda one: one[0] == before):
        if value == parameters.values[ends.name]:
            continue
        rig.result(parameters.change({ends.name: value}))
        sent = last(rig, 'ad' if long else 'a9')
        if sent != f'{"ad" if long else "a9"}01{ends.index:04x}{raw.lower()}':
            wrong.append((value, sent))
        shown = last(rig, f'{"ac" if long else "c8"}{ends.index:04x}')
        if not shown.endswith(raw.lower()):
            wrong.append((value, shown))
        if not rig.far.peek(ends.name) == parameters.values[ends.name] == value:
            wrong.append((value, rig.far.peek(ends.name), parameters.values[ends.name]))
    if ends.name != ONE_WAY:
        rig.result(parameters.change({ends.name: before}))
    return wrong


@pytest.mark.parametrize('card', COUNTS)
def test_both_ends_of_every_setting_are_written_and_read_as_the_manual_has_them(card: str) -> None:
    with fitted(card, allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        change = rig.drive.parameters.change
        wrong, done = {}, 0
        for ends in (one for one in ENDS if one.card == card):
            needed = NEEDED.get(ends.name)
            if needed:
                rig.result(change({needed: True}))
            wrong[ends.name] = not_set(rig, ends)
            if needed:
                rig.result(change({needed: False}))
            done += 1
        assert {name: found for name, found in wrong.items() if found} == {}
        assert done == COUNTS[card]
        # an owner may set P841 as the driver itself never does
        assert all('another P841' in one for one in rig.violations())
        rig.line.frames.clear()


# --- what is only read ----------------------------------------------------------------------------


def rows(table: dict[str, str], card: str) -> list[list[str]]:
    listed = table.get(card, '').split(',')
    return [one.split(maxsplit=3) for one in listed if one.strip()]


def shown(
    rig: Rig, key: str, index: int, raw: int, *, long: bool = False
) -> tuple[object, str]:
    """Have the drive remember a number, and read it; return its value and the bytes of it."""
    # what is measured or comes from terminals and keys stays what it is
    rig.far.memory.put(key, raw)
    value = rig.result(rig.drive.measure(key))
    start = f'{"ac" if long else "c8"}{index:04x}'
    return value, last(rig, start).removeprefix(start)


@pytest.mark.parametrize('card', ['', 'ffi', 'fpi', 'frs'])
def test_everything_that_is_only_read_is_shown_as_the_manual_codes_it(card: str) -> None:
    wrong: list[object] = []
    with fitted(card) as rig:
        rig.turn(30.0)
        rig.drive.deactivate()
        for index, key in rows(BCD, card):
            value, data = shown(rig, key, int(index), 1200 + 50 * int(index))
            # eight decimal digits, two of them decimals [M4 §3.1]
            if value != int(data) / 100:
                wrong.append((key, value, data))
        for index, key in rows(WORDS, card):
            value, data = shown(rig, key, int(index), 0x1234 + int(index))
            if value != int(data, 16):
                wrong.append((key, value, data))
        for index, key in rows(LONG, card):
            raw = -70_000 - int(index)
            value, data = shown(rig, key, int(index), abs(raw) if key in SIZES else raw, long=True)
            # a half-byte in each [M4 §3.3]
            number = int(data[1::2], 16)
            if (data[::2], value) != ('0' * 8, number - (number >> 31 << 32)):
                wrong.append((key, value, data))
        for index, key, code, text in rows(TEXTS, card):
            value, data = shown(rig, key, int(index), 100 * int(code))
            if (value, int(data)) != (text.strip(), 100 * int(code)):
                wrong.append((key, value, data))
    assert wrong == []
