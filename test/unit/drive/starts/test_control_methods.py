# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What single control methods and references do beside the laws, which hold for all of them."""

from __future__ import annotations

from typing import Any

import pytest
from support.rig import Connection, Rig
from support.said import raises

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Fact, State
from nfo_sinus_driver.drive import Cause, DriveSettings
from nfo_sinus_driver.simulator.sinus_optimal import control_unit

#: Bits of the Optimal's Drive Status [M1].
ENABLED, FROM_BUS = 1 << 2, 1 << 9
OPTIMAL_WORD = Connection('modbus_rtu', 'sinus_optimal', 'drive_control', 'terminal')


@pytest.mark.parametrize(
    ('model', 'method', 'reference'),
    [
        ('sinus_g2', 'mode_scmd', 'terminal'),
        ('sinus_g2', 'mode_scmd', 'fix3'),
        ('sinus_g2', 'mode_scmd', 'fix3_reverse'),
        ('sinus_g2', 'drive_control', 'terminal'),
        ('sinus_optimal', 'mode_scmd', 'terminal'),
        ('sinus_optimal', 'drive_control', 'terminal'),
    ],
    ids=lambda text: text,
)
def test_a_drive_follows_its_own_reference_and_no_set_point(
    model: str, method: str, reference: str
) -> None:
    with Rig(Connection('modbus_rtu', model, method, reference)) as rig:
        for stop in (rig.drive.stop, rig.drive.quick_stop):
            rig.connect()
            rig.enable()
            with raises(Cause.OWN_REFERENCE):
                rig.drive.set_setpoint(1.0)
            rig.pass_time(3.0)
            # and none is missed
            assert rig.drive.following
            assert abs(rig.far.motor.frequency) > 10
            assert (rig.far.motor.frequency < 0) is reference.endswith('reverse')
            answer = rig.answer(stop())
            rig.pass_time(2.0)
            assert not rig.far.motor.driven
        coasts = answer == 'released: the motor coasts'
        assert coasts if model == 'sinus_g2' else 'no quick stop' in answer


@pytest.mark.parametrize(
    ('real', 'assumed', 'register'),
    [
        ('Speed', '', 'fieldbus.input_speed_setpoint'),
        ('Freque', 'Speed', 'fieldbus.input_freq_setpoint'),
    ],
)
def test_an_old_set_point_of_a_mode_that_is_not_known_does_not_turn_the_motor(
    real: str, assumed: str, register: str
) -> None:
    with Rig(
        'optimal', parameters={'control.mode': real}, expected_control_mode=assumed
    ) as rig:
        rig.far.memory.put(register, 300)
        rig.connect()
        rig.enable()
        assert rig.far.memory.raw(register) == 0
        rig.pass_time(1.0)
        assert rig.far.motor.at_zero


@pytest.mark.parametrize('connection', ['rtu', 'rtu, control word'])
def test_a_stop_is_confirmed_in_a_control_mode_that_no_manual_lists(
    connection: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.enable()
        inverter = rig.drive.state

        async def read(priority: Priority = Priority.SERVICE, *, retry: bool = True) -> str:
            inverter.control_mode = '7'
            return inverter.control_mode

        monkeypatch.setattr(inverter, 'read_control_mode', read)
        rig.wait_until(lambda: not rig.drive.following)
        assert rig.answer(rig.drive.stop()).startswith('stop')
        assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('mode', ['Torque', 'PI-Reg'])
def test_the_optimal_is_expected_in_no_mode_that_it_lacks(mode: str) -> None:
    with pytest.raises(ValueError, match='expected_control_mode'):
        DriveSettings(model='sinus_optimal', expected_control_mode=mode)


# --- the control word of the Optimal --------------------------------------------------------------


def test_each_step_of_the_optimal_is_confirmed_before_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(control_unit, '_RESPONSE', 0.3)
    with Rig(OPTIMAL_WORD) as rig:
        rig.connect()
        confirmed: list[tuple[int, int]] = []

        def note(key: str, data: bytes | None) -> None:
            if key == 'fieldbus.drive_control' and data is not None:
                status = rig.far.control_unit.status_word & (FROM_BUS | ENABLED)
                confirmed.append((rig.number(data), status))

        rig.meet = note
        rig.enable()
        assert confirmed == [
            (0x4000, 0), (0x4008, FROM_BUS), (0x4009, FROM_BUS | ENABLED)
        ]


#: What each bit of its status says [M1]; 2 is Enabled, 4 and 5 are echoes, 8 is not used.
SAYS = {
    0: Fact.READY,
    1: Fact.SWITCHED_ON | Fact.OPERATION_ENABLED,
    3: Fact.FAULT,
    6: Fact.RUN_INPUT_MISSING,
    7: Fact.ALARM,
    9: Fact.NETWORK_CONTROL,
    10: Fact.SETPOINT_REACHED,
    11: Fact.LIMIT_ACTIVE,
    # it starts again by itself
    12: Fact.SLEEPING | Fact.OPERATION_ENABLED,
    13: Fact.STOP_MODE_BRAKE,
    14: Fact.REVERSE,
    15: Fact.STOPPING,
}


@pytest.mark.parametrize('connection', ['optimal', 'telegram1 optimal'])
def test_every_bit_of_the_status_of_an_optimal_is_published(
    connection: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Rig(connection, poll_rate=50.0).connect() as rig:
        shown = 0
        unit = control_unit.OptimalControlUnit
        monkeypatch.setattr(unit, 'status_word', property(lambda _: shown))
        for bit in range(16):
            shown = 1 << bit
            rig.pass_time(0.2)
            status = rig.drive.snapshot.status
            assert status.shown_word == shown
            assert status.facts == SAYS.get(bit, Fact(0)), bit
            assert not status.facts & ~status.valid
            assert (status.state is State.SWITCHED_ON) == (bit == 2), bit


@pytest.mark.parametrize('key', ['stop', 'start', 'ext'])
def test_an_optimal_is_enabled_again_after_its_keypad(key: str) -> None:
    # the bit that asks for control still stands in its word, and has to rise anew
    with Rig(OPTIMAL_WORD) as rig:
        rig.turn(25.0)
        rig.far.control_unit.press(key)
        rig.wait_until(lambda: not rig.drive.following and not rig.drive.stop_unconfirmed)
        rig.enable()


def test_an_optimal_that_stays_under_bus_control_says_so() -> None:
    with Rig(OPTIMAL_WORD) as rig:
        rig.turn(25.0)
        answer = rig.answer(rig.drive.disconnect(10.0))
        assert Cause.CONTROL_KEPT in answer.causes
        assert 'the bus keeps control: from the terminals an active RUN input' in answer
        assert rig.far.read_raw('fieldbus.drive_control') == 0x4000
        assert rig.far.control_unit.status_word & FROM_BUS


# --- another method -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    'connection', [Connection('modbus_rtu'), Connection('modbus_rtu', 'sinus_optimal')]
)
def test_another_method_waits_until_the_motor_stands(connection: Connection) -> None:
    with Rig(connection, parameters={'control.retard': 60.0}) as rig:
        rig.turn()
        assert 'left to its ramp' in rig.answer(rig.drive.disconnect(0.1))
        answer = rig.answer(rig.drive.require_standing())
        assert 'the motor still runs by control_method mode_scmd (40 Bus Ret)' in answer
        rig.pass_time(70.0)
        rig.result(rig.drive.require_standing())


def test_another_method_need_not_wait_for_one_that_only_watched() -> None:
    only: dict[str, Any] = {'control_method': 'monitor'}
    with Rig('rtu', **only) as rig:
        rig.far.control_unit.press('ext')
        rig.connect()
        rig.result(rig.drive.require_standing())
