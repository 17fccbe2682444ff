# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive without a status word: only its inverter status tells what it does [C21]."""

from __future__ import annotations

import pytest
from support.rig import Rig
from support.said import raises

from nfo_sinus_driver.catalog import Fact, Kind, Role
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.simulator.sinus_g2.classic import Server

WAY = 'classic v5.0'
LIMIT = 27


def show(rig: Rig, patch: pytest.MonkeyPatch, code: int | None, *, driven: bool = False) -> None:
    """
    Have the drive say this of itself, whatever it does; ``None``: what it does.

    :param driven: only while the motor is driven.
    """
    patch.undo()
    unit = type(rig.far.control_unit)
    true = unit.inv_st
    if code is not None:
        patch.setattr(
            unit,
            'inv_st',
            property(lambda self: true.fget(self) if driven and not self.motor.driven else code),
        )


def test_stop_down_a_long_ramp_is_confirmed_and_said_once() -> None:
    with Rig(WAY, parameters={'control.retard': 20.0}).turn(40.0) as rig:
        assert rig.answer(rig.drive.stop()) == 'stopping: it ramps down'
        rig.pass_time(5.0)
        assert rig.far.motor.driven
        assert not rig.notes.said(Cause.RUNS_UNASKED)
        assert not rig.notes.said(Cause.CANNOT_STOP)
        assert not rig.drive.stop_unconfirmed


def test_torque_has_the_decimals_of_its_firmware() -> None:
    # one decimal on firmware of the v5.0 dialect, none on others [C115]
    for way, chosen in ((WAY, 'v5.0'), (WAY, ''), ('classic', 'v2.03'), ('classic', '')):
        with Rig(way, classic_dialect=chosen) as rig:
            rig.far.motor.torque = 0.6
            rig.result(rig.drive.connect())
            assert rig.result(rig.drive.measure('status.trq_act')) == 60.0, (way, chosen)


# --- who controls, where only the inverter status tells -------------------------------------------


@pytest.mark.parametrize('code', [26, LIMIT])
def test_a_chopper_and_a_current_limit_are_no_take_over(
    monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    with Rig(WAY).turn() as rig:
        show(rig, monkeypatch, code)
        rig.pass_time(1.0)
        assert rig.drive.armed and rig.turns, rig.notes.events
        status = rig.drive.snapshot.status
        assert status.code == code and status.runs_by_bus and status.driven
        assert Fact.NETWORK_CONTROL | Fact.OPERATION_ENABLED in status.facts
        show(rig, monkeypatch, None)
        rig.pass_time(1.0)
        assert rig.drive.armed, rig.notes.events


@pytest.mark.parametrize('press', ['start', 'ext', 'stop'])
def test_a_take_over_behind_a_current_limit_is_noticed(
    monkeypatch: pytest.MonkeyPatch, press: str
) -> None:
    with Rig(WAY).turn() as rig:
        show(rig, monkeypatch, LIMIT)
        rig.pass_time(0.5)
        assert rig.drive.armed
        rig.far.control_unit.press(press)
        rig.pass_time(2.0)
        assert not rig.drive.armed
        text = 'keypad or terminals have control now and run the motor (27 Cur Limt)'
        assert rig.notes.said(text)


def test_a_motor_that_starts_against_its_current_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    with Rig(WAY).connect() as rig:
        show(rig, monkeypatch, LIMIT, driven=True)
        rig.enable()
        assert rig.drive.armed


def test_a_stop_is_not_confirmed_by_a_current_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    with Rig(WAY).turn() as rig:
        show(rig, monkeypatch, LIMIT)
        monkeypatch.setattr(type(rig.far.control_unit), 'command', lambda self, scmd: None)
        with raises(Cause.STOP_UNCONFIRMED):
            rig.result(rig.drive.stop())
        monkeypatch.undo()
        rig.pass_time(3.0)
        assert not rig.drive.stop_unconfirmed and not rig.far.motor.driven


@pytest.mark.parametrize('press', ['start', 'ext'])
def test_a_motor_that_others_run_is_seen_to_run_and_left_alone(press: str) -> None:
    with Rig(WAY).connect() as rig:
        rig.far.control_unit.press(press)
        rig.pass_time(1.0)
        status = rig.drive.snapshot.status
        assert status.driven and not status.runs_by_bus
        with raises(Cause.RUN_BY_OTHERS):
            rig.result(rig.drive.stop())
        rig.pass_time(1.0)
        assert not rig.notes.said(Cause.RUNS_UNASKED)
        assert rig.far.motor.driven


def test_current_limit_is_no_stop() -> None:
    # its code stands in for the one that says who runs the motor
    with Rig(WAY).turn() as rig:
        rig.far.motor.load = 6.0
        rig.pass_time(3.0)
        status = rig.drive.snapshot.status
        assert rig.drive.snapshot.text == 'Cur Limt' and rig.drive.armed
        assert status.runs_by_bus and status.kind is Kind.ALARM
        assert sum('the current limit' in one.text for one in rig.notes.events) == 1
        assert rig.answer(rig.drive.stop()).startswith('stop')
        # one that takes it away is noticed all the same
        rig.far.motor.load = 0.3
        rig.pass_time(1.0)
        assert not rig.far.motor.driven
        rig.enable()
        rig.far.control_unit.press('stop')
        rig.pass_time(1.0)
        assert not rig.drive.armed


def test_counters_have_24_bits_over_classic(monkeypatch: pytest.MonkeyPatch) -> None:
    enquiry = Server.enquiry

    def filled(self: Server, number: int) -> int:
        word = enquiry(self, number)
        # no manual says what the rest of the second word of a counter has [C26]
        return word | 0xA500 if number in (0x0127, 0x0128, 0x00DE) else word

    monkeypatch.setattr(Server, 'enquiry', filled)
    with Rig(WAY).connect() as rig:
        rig.pass_time(10.0)
        values = rig.notes.telemetry[-1].values
        assert values[Role.OPERATING_TIME] == pytest.approx(1234.5, abs=0.2)
        assert 0 <= values[Role.RUNNING_TIME] < 1e5
        assert 0 <= values[Role.BRAKE_TIME] < 1e5
