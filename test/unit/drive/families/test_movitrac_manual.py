# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every row of the parameter list of a MOVITRAC 31 [M4 §4] through the wire, by its index."""

from __future__ import annotations

from typing import Any

import pytest
from support.ends import Ends, of_movitrac
from support.rig import Rig

from nfo_sinus_driver.catalog import Role, load_family

#: What has to be on for a setting to be switched on [M4 §2.1.2].
NEEDED = {f'control.hoist_{number}': f'special.four_quadrant_{number}' for number in (1, 2)}
#: P802: On only by the keypad.
ONE_WAY = 'special.user_menu'
#: How many settings there are with a card, and without one.
COUNTS = {'': 149, 'frs': 14, 'fio': 16, 'fea': 14, 'fen': 8, 'fpi': 28, 'ffi': 9}
#: Indices that are only read, as the manual has them, and the option card that they need.
BCD = {
    '': """
        0 status.frequency, 4 status.heat_sink_temperature, 18 status.external_current_limit,
        17 status.speed, 2 status.dc_link_voltage, 1 status.motor_voltage,
        5 status.apparent_current, 6 status.inverter_utilization, 308 status.motor_utilization_1,
        309 status.motor_utilization_2,
        8 status.fault_t0, 9 status.fault_t1, 10 status.fault_t2, 11 status.fault_t3,
        12 status.fault_t4, 98 setpoint.n2_offset,
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
        271 status.inverter_type 3100 MOVITRAC 31.., 306 status.output_stage 33 31C011-503-4-00,
        157 terminal.output_61 33 Brake released
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
    parameters, (index,) = rig.drive.parameters, ends.places
    select, sent_back = ('ad', 'ac') if ends.long else ('a9', 'c8')
    before = parameters.values[ends.name]
    two = [ends.high] if ends.name == ONE_WAY else [ends.low, ends.high]
    # P880: On only by the keypad
    cut_off = rig.drive.model.profile.cuts_off.get(ends.name)
    two = [value for value in two if value != cut_off]
    # what is there already is not written
    for value in sorted(two, key=lambda value: value == before):
        if value == parameters.values[ends.name]:
            continue
        rig.result(parameters.change({ends.name: value}))
        sent = last(rig, select)
        if sent != f'{select}01{index:04x}{ends.data(value)}':
            wrong.append((value, sent))
        shown = last(rig, f'{sent_back}{index:04x}')
        if not shown.endswith(ends.data(value)):
            wrong.append((value, shown))
        if not rig.far.peek(ends.name) == parameters.values[ends.name] == value:
            wrong.append((value, rig.far.peek(ends.name), parameters.values[ends.name]))
    if ends.name != ONE_WAY:
        rig.result(parameters.change({ends.name: before}))
    return wrong


def needs(name: str, card: str) -> bool:
    """Whether a setting is there with this card, and ``''``: without any."""
    cards = load_family('movitrac31')[name].option.lower()
    return card in cards.split(' or ') if card else not cards


@pytest.mark.parametrize('card', COUNTS)
def test_both_ends_of_every_setting_are_written_and_read_as_the_manual_has_them(card: str) -> None:
    with fitted(card, allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        change = rig.drive.parameters.change
        wrong = {}
        for ends in of_movitrac().values():
            if not needs(ends.name, card):
                continue
            needed = NEEDED.get(ends.name)
            if needed:
                rig.result(change({needed: True}))
            wrong[ends.name] = not_set(rig, ends)
            if needed:
                rig.result(change({needed: False}))
        assert {name: found for name, found in wrong.items() if found} == {}
        assert len(wrong) == COUNTS[card]
        # an owner may set P841 as the driver itself never does
        assert all('another P841' in violation for violation in rig.violations())
        rig.line.frames.clear()


def test_a_value_between_two_steps_is_read_as_it_is() -> None:
    with Rig('movitrac') as rig:
        rig.connect()
        # P111 = -237.0 mV, the example of the manual [M4 §3.1]
        rig.far.servers['movitrac'].select(98, bytes.fromhex('F0023700'))
        assert rig.result(rig.drive.measure('setpoint.n2_offset')) == -237.0


# --- what is only read ----------------------------------------------------------------------------


def rows(table: dict[str, str], card: str) -> list[list[str]]:
    listed = table.get(card, '').split(',')
    return [line.split(maxsplit=3) for line in listed if line.strip()]


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


def test_what_is_measured_is_that_of_the_motor() -> None:
    with Rig('movitrac', telemetry_rate=2.0) as rig:
        rig.turn()
        motor = rig.far.motor
        for hertz in (20.0, -35.0):
            rig.send(hertz)
            rig.pass_time(4.0)
            # P000 and P004 have no sign
            assert rig.drive.snapshot.frequency == pytest.approx(hertz, abs=0.05)
            assert rig.drive.snapshot.speed == pytest.approx(motor.speed, abs=1.0)
            measured = rig.notes.telemetry[-1]
            # P010, P011, P020
            # it ripples
            assert measured.values[Role.DC_LINK_VOLTAGE] == pytest.approx(motor.dc_link, abs=2.0)
            assert measured.values[Role.OUTPUT_VOLTAGE] == pytest.approx(motor.voltage, abs=1.0)
            current = 100 * motor.current / motor.plate.current
            assert measured.measured['status.apparent_current'] == pytest.approx(current, abs=2.0)
            # P003
            assert measured.measured['status.external_current_limit'] == 100.0


def test_each_terminal_has_its_bit() -> None:
    # 41 to 43 and 47 to 51, then 61 to 64 and 69 to 72, then 52 to 54 [M4 §4 P030 to P043]
    inputs = dict(enumerate((41, 42, 43, 47, 48, 49, 50, 51))) | {16: 52, 17: 53, 18: 54}
    outputs = {f'terminal.output_{number}': 'No function' for number in (63, 64, 69, 70, 71)}
    outputs |= {f'terminal.output_{number}': 'Brake applied' for number in (62, 72)}
    with fitted('fio', parameters={**outputs, 'terminal.input_42': 'No function'}) as rig:
        rig.connect()

        def shown() -> int:
            return int(rig.result(rig.drive.measure('status.terminals')))

        for bit, number in inputs.items():
            found = []
            for closed in (False, True):
                rig.far.control_unit.switch(number, closed)
                found.append(shown() >> bit & 1)
            rig.far.control_unit.switch(number, False)
            assert found == [0, 1], number
        # the brake holds the motor
        assert shown() & 0xFF00 == 1 << 9 | 1 << 15


# --- inverter status ------------------------------------------------------------------------------


def test_byte_2_and_3_of_the_inverter_status_are_the_status_word() -> None:
    # option cards FEN at X21 and none at X20; clockwise, set 2, voltage signal [M4 §4 index 284]
    settings = {'motor.enable_set_selection': True, 'terminal.input_42': 'Parameter set select.'}
    with fitted('fen', parameters=settings) as rig:
        for hertz, closed, word in (
            (20.0, False, 0x1914), (20.0, True, 0x191C), (-20.0, True, 0x190C)
        ):
            rig.far.control_unit.switch(42, closed)
            rig.turn(abs(hertz))
            rig.send(hertz)
            rig.pass_time(2.0)
            status = rig.drive.snapshot.status
            assert status is not None and f'{status.shown_word:04X}' == f'{word:04X}'
            # the number, and no fault, above
            whole = rig.result(rig.drive.measure('fieldbus.inverter_status'))
            assert int(whole) == 0x100000 | word
            rig.result(rig.drive.stop())
            rig.pass_time(1.0)


def test_every_fault_of_the_list_is_named_with_its_remedy_and_logged() -> None:
    faults = [code for code in load_family('movitrac31').status_codes.values() if code.code >= 100]
    assert len(faults) > 40
    wrong = {}
    with Rig('movitrac', options={'status_numbers': 'binary'}) as rig:
        rig.connect()
        for fault in faults:
            rig.far.trip(fault.code)
            rig.wait_until(lambda fault=fault: rig.drive.snapshot.text == fault.text, 3.0)
            shown = rig.drive.snapshot
            entry = rig.result(rig.drive.error_log(1))[0]
            found = shown.status.code, shown.remedy, entry.code, entry.text
            if not fault.remedy or found != (fault.code, fault.remedy, fault.code, fault.text):
                wrong[fault.code] = found
            rig.far.control_unit.reset()
            rig.pass_time(0.3)
    assert wrong == {}


# --- fault memory ---------------------------------------------------------------------------------

#: What is kept of each fault, by how far its index is from the first of them.
KEPT = {
    0: 'dc_link_voltage', 2: 'heat_sink_temperature', 3: 'frequency', 4: 'apparent_current',
    6: 'utilization', 7: 'inverter_status', 8: 'terminal_status',
}


def test_all_that_is_kept_of_each_of_five_faults_is_read() -> None:
    wrong: list[object] = []
    with Rig('movitrac') as rig:
        rig.turn(20.0)
        kept = rig.far.control_unit._fault_memory.raw
        newest_first: list[float] = []
        # the first of six is not kept
        for warmer, fault in enumerate((104, 101, 107, 106, 103, 102)):
            rig.far.control_unit.ambient = 20.0 + warmer
            rig.far.trip(fault)
            rig.far.control_unit.reset()
            newest_first.insert(0, kept('status.fault_t0_heat_sink_temperature') / 100)
        for number, first in enumerate((400, 409, 418, 427, 436)):
            for offset, name in KEPT.items():
                key = f'status.fault_t{number}_{name}'
                value = rig.result(rig.drive.measure(key))
                data = last(rig, f'c8{first + offset:04x}')[6:]
                number_of = int(data, 16) if offset > 6 else int(data) / 100
                ours = kept(key) if offset > 6 else kept(key) / 100
                if not value == number_of == ours:
                    wrong.append((key, value, data, ours))
        warm = [
            rig.result(rig.drive.measure(f'status.fault_t{number}_heat_sink_temperature'))
            for number in range(5)
        ]
        assert len({*newest_first}) == 6 and warm == newest_first[:5]
        (newest, *_) = rig.result(rig.drive.error_log())
        for part in ('DC link ', 'heat sink ', 'frequency ', 'apparent current ', 'utilization '):
            assert any(reading.startswith(part) for reading in newest.readings), part
    assert wrong == []


def test_no_row_of_the_list_is_left_out() -> None:
    read = [row[1] for table in (BCD, WORDS, LONG, TEXTS) for card in table
            for row in rows(table, card)]
    read += [f'status.fault_t{number}_{name}' for number in range(5) for name in KEPT.values()]
    # P050 and P051 are parts of index 237: test_movitrac_identity.py; set-point and function bits
    # are commands; P830 is never written
    aside = {
        'status.option_x20', 'status.option_x21', 'fieldbus.remote_setpoint',
        'fieldbus.function_bits', 'fieldbus.factory_setting',
    }
    every = [*read, *of_movitrac(), *aside]
    assert sorted(every) == sorted(load_family('movitrac31'))
