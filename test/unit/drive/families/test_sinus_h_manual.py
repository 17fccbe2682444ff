# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a Sinus H offers by its telegrams and parameters, each as its manual prints it [M3]."""

from __future__ import annotations

import pytest
from support.rig import Rig
from support.telegram_laws import exchanges, words

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog.status import Fact, State

STANDARD, VENDOR = 'telegram1 sinus_h', 'telegram1 sinus_h, mailbox'
OVERHEAT = 15
#: The trips of [M3 §9].
TRIPS = {
    1: 'Overload Trip', 2: 'Underload Trip', 3: 'Inverter Overload Trip', 4: 'E-Thermal Trip',
    5: 'Ground Fault Trip', 6: 'Missing Output Phase Trip', 7: 'Missing Input Phase Trip',
    10: 'NTC Trip', 11: 'Overcurrent Trip', 12: 'Overvoltage Trip', 13: 'External Trip',
    14: 'Arm Short', 15: 'Overheat Trip', 16: 'Fuse Open Trip', 17: 'MC Fail Trip',
    19: 'PTC (Thermal sensor) Trip', 20: 'FAN Trip', 22: 'Parameter Write Error',
    23: 'Pre PID Fail', 24: 'IO Board Connection Fault', 25: 'External Brake Trip',
    26: 'No Motor Trip', 27: 'Option Card Connection Fault', 29: 'Safety A Trip',
    30: 'Safety B Trip', 33: 'BX', 34: 'LV', 35: 'Lost Command', 36: 'Keypad Lost Command',
    49: 'ADC Error', 50: 'EEPROM Error', 51: 'Watchdog-1 Error', 52: 'Watchdog-2 Error',
    54: 'QueueFull',
    64: 'Internal Communication Error between the Inverter and the Option Card',
}


def facts(rig: Rig) -> Fact:
    """Return what the status reports, of what is valid."""
    status = rig.drive.snapshot.status
    assert status is not None
    return status.facts & status.valid


# --- the status word ------------------------------------------------------------------------------


def test_each_of_its_four_states_is_shown_with_its_bits() -> None:
    # bits 6 and 2 to 0 of ZSW1 [M3 §7.2.2]
    ready, enabled, inhibited = Fact.READY, Fact.OPERATION_ENABLED, Fact.SWITCH_ON_DISABLED
    wrong = []
    with Rig(STANDARD) as rig:
        rig.connect()

        def require(pattern: int, state: State, shown: Fact) -> None:
            rig.pass_time(1.0)
            status = rig.drive.snapshot.status
            found = status.shown_word & 0x47, status.state
            found = *found, facts(rig) & (ready | enabled | inhibited)
            if found != (pattern, state, shown):
                wrong.append((found, pattern, state, shown))

        require(0x40, State.SWITCH_ON_DISABLED, inhibited)
        rig.enable()
        require(0x07, State.OPERATION_ENABLED, ready | enabled)
        # OperationDisable, then QuickStop out of S4
        rig.answer(rig.drive.stop())
        require(0x03, State.SWITCHED_ON, ready)
        rig.enable()
        rig.answer(rig.drive.rapid_stop())
        require(0x40, State.SWITCH_ON_DISABLED, inhibited)
        rig.enable()
        rig.answer(rig.drive.stop_for_good(4.0))
        require(0x01, State.READY_TO_SWITCH_ON, ready)
    assert wrong == []


def test_fault_and_warning_and_a_speed_that_is_reached_are_shown() -> None:
    with Rig(STANDARD, parameters={'drv.acc_time': 4.0}) as rig:
        rig.turn(20.0)
        rig.pass_time(1.0)
        assert facts(rig) & (Fact.SETPOINT_REACHED | Fact.FAULT | Fact.ALARM) == (
            Fact.SETPOINT_REACHED
        )
        rig.send(40.0)
        rig.pass_time(0.5)
        assert Fact.SETPOINT_REACHED not in facts(rig)
        rig.far.motor.load = 5.0
        rig.wait_until(lambda: Fact.ALARM in facts(rig), 5.0)
        assert rig.drive.snapshot.kind is Kind.ALARM and rig.drive.following
        rig.far.trip(OVERHEAT)
        rig.wait_until(lambda: Fact.FAULT in facts(rig), 5.0)
        assert rig.drive.snapshot.kind is Kind.FAULT and not rig.drive.following


def test_a_fault_is_acknowledged_by_an_edge_of_bit_7() -> None:
    with Rig(STANDARD) as rig:
        rig.turn()
        rig.far.trip(OVERHEAT)
        rig.pass_time(1.0)
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        rig.pass_time(1.0)
        assert words(rig.line.frames)[-3:] == [0x0476, 0x04F6, 0x0476]
        assert not rig.far.faults and Fact.FAULT not in facts(rig)


# --- set-point and actual value -------------------------------------------------------------------


def test_set_point_and_actual_value_are_hundredths_of_a_hertz() -> None:
    with Rig(STANDARD) as rig:
        rig.turn(20.0)
        for hertz, count in ((12.34, 1234), (0.01, 1), (45.67, 4567)):
            rig.send(hertz)
            rig.pass_time(2.0)
            assert list(exchanges(rig.line.frames, 1))[-1].setpoint == count
            assert rig.far.motor.frequency == pytest.approx(hertz, abs=0.005)
            assert rig.drive.snapshot.frequency == rig.drive.snapshot.actual == hertz


# --- what more there is with the vendor's telegram and by the parameters --------------------------


def test_the_alarm_information_tells_a_trip_from_a_warning() -> None:
    with Rig(VENDOR) as rig:
        rig.turn(20.0)

        def shown() -> object:
            rig.pass_time(0.5)
            return rig.result(rig.drive.measure('telegram.alarm_info'))

        assert shown() == 0
        rig.far.motor.load = 5.0
        rig.wait_until(lambda: Fact.ALARM in facts(rig), 5.0)
        # bit 4 is the warning information [M3 §7.2.5]
        assert shown() == 0x10
        rig.far.motor.load = 0.0
        rig.far.trip(OVERHEAT)
        assert shown() == 0x01


def test_the_parameters_of_the_module_are_read_by_their_numbers() -> None:
    with Rig(VENDOR) as rig:
        rig.turn(20.0)

        def shown(name: str) -> object:
            return rig.result(rig.drive.measure(f'profidrive.{name}'))

        # PNU 922, 964.0 to 964.4, 965 [M3 §8]
        expected = {
            'telegram': 'Vendor specific telegram', 'manufacturer': 849, 'device_type': 1,
            'version': 102, 'firmware_year': 2015, 'firmware_day': 2512, 'profile': 0x0328,
        }
        assert {name: shown(name) for name in expected} == expected
        # PNU 967 and 968: STW1 in operation, and ZSW1 as the block has it
        assert shown('control_word') == 0x047F
        assert shown('status_word') == rig.drive.snapshot.status.shown_word
        # PNU 944 and 953
        assert (shown('fault_counter'), shown('warning_word')) == (0, 0)
        rig.far.motor.load = 5.0
        rig.wait_until(lambda: Fact.ALARM in facts(rig), 5.0)
        assert shown('warning_word') != 0
        rig.far.trip(OVERHEAT)
        assert shown('fault_counter') == 1


def test_each_of_the_35_trips_is_named_with_its_remedy_and_logged() -> None:
    assert len(TRIPS) == 35
    wrong = {}
    with Rig(VENDOR) as rig:
        rig.connect()
        for code, text in TRIPS.items():
            rig.far.trip(code)
            rig.wait_until(lambda text=text: rig.drive.snapshot.text == text, 3.0)
            shown = rig.drive.snapshot
            entry = rig.result(rig.drive.error_log(1))[0]
            if not shown.remedy or (entry.code, entry.text) != (code, text):
                wrong[code] = shown.remedy, entry
            assert f'acknowledged {code} {text}' in rig.answer(rig.drive.acknowledge())
            rig.pass_time(0.5)
        # of the eight situations of PNU 947 the present one is empty
        log = [entry.code for entry in rig.result(rig.drive.error_log())]
        assert log == list(TRIPS)[:-8:-1]
    assert wrong == {}
