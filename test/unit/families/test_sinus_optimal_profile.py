# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""What the Optimal is told, step by step, where it differs from the G2."""

from __future__ import annotations

from typing import Any

import pytest
from support.steps import REFUSED, Wait, play, status

from nfo_sinus_driver.catalog import Holder, NotPossible, Refusal, Removal, load_family
from nfo_sinus_driver.catalog.profile import Acknowledge, AcknowledgeThenWrite, Read, Write

OPTIMAL = load_family('sinus_optimal')
MODE, SMODE, WORD = 'fieldbus.mode', 'fieldbus.smode', 'fieldbus.drive_control'
STATUS, ACK = 'fieldbus.drive_status', 'fieldbus.inv_st_with_ack'
MANUAL, AUTO, BUS = 1, 2, 3
FREQUENCY, SPEED = 'fieldbus.input_freq_setpoint', 'fieldbus.input_speed_setpoint'
BUS_CONTROL, ENABLE, SWITCH_ON, FROM_BUS = 1 << 14, 1 << 3, 1 << 0, 1 << 9
OVERLOAD, SIO_FAIL = OPTIMAL.status_code(5), OPTIMAL.status_code(14)

smode = OPTIMAL.profile.methods['mode_scmd']('fieldbus', OPTIMAL.__contains__)
control = OPTIMAL.profile.methods['drive_control']('terminal', OPTIMAL.__contains__)
FREQUENCY_0 = ((Write(FREQUENCY, 0.0), None), (Read(FREQUENCY), 0.0))
SPEED_0 = ((Write(SPEED, 0.0), None), (Read(SPEED), 0.0))
STAYS = ((Write(FREQUENCY, 0.0), None), (Read(FREQUENCY), 3.0))


@pytest.mark.parametrize(
    ('mode', 'holder'),
    [
        (MANUAL, Holder.LOCAL),
        (AUTO, Holder.LOCAL),
        (BUS, Holder.BUS),
        (0, Holder.UNKNOWN),
    ],
)
def test_who_has_control(mode: int, holder: Holder) -> None:
    assert play(smode.holder(), (Read(MODE), mode)) is holder


def test_no_way_releases_the_motor_at_once() -> None:
    assert not smode.coasts
    assert not control.coasts
    stop = Write(SMODE, 0, once=True)
    zero = [(Write(key, 0.0, once=True), None) for key in (FREQUENCY, SPEED)]
    play(smode.quick_stop('Freque'), (stop, None), *zero)
    word = Read(WORD, once=True)
    play(control.quick_stop('Freque'), (word, 0x4009), (Write(WORD, 0x4008, once=True), None))


def test_control_is_taken_and_given_to_the_keypad() -> None:
    play(
        smode.take_control(),
        (Read(MODE), MANUAL),
        (Write(MODE, BUS), None),
        (Write(SMODE, 0, head=True), None),
    )
    play(smode.run(), (Write(SMODE, 0x101, once=True), None))
    stop_first = (Write(SMODE, 0), None), (Write(MODE, MANUAL), None)
    play(smode.release(), (Read(MODE), BUS), *stop_first)
    play(smode.release(), (Read(MODE), AUTO))
    with pytest.raises(Refusal):
        play(smode.release(), (Read(MODE), BUS), (Write(SMODE, 0), REFUSED))


@pytest.mark.parametrize('control_mode', ['Freque', 'Speed', ''])
def test_every_set_point_is_0_before_it_runs(control_mode: str) -> None:
    play(smode.zero_setpoint(control_mode), *FREQUENCY_0, *SPEED_0)
    with pytest.raises(NotPossible, match='keeps a set-point of 3'):
        play(smode.zero_setpoint(control_mode), *STAYS)


@pytest.mark.parametrize(
    ('command', 'setpoint', 'removed'),
    [
        (None, FREQUENCY_0, Removal.COMMAND),
        (REFUSED, FREQUENCY_0, Removal.SETPOINT),
        # both are written even if the first one is not taken
        (REFUSED, STAYS, Removal.NOTHING),
        (REFUSED, ((Write(FREQUENCY, 0.0), REFUSED),), Removal.NOTHING),
    ],
)
def test_mode_is_left_where_something_is_removed(
    command: Any, setpoint: Any, removed: Removal
) -> None:
    script = ((Write(SMODE, 0), command), *setpoint, *SPEED_0)
    assert play(smode.remove('Freque'), *script) is removed


@pytest.mark.parametrize('shown', [OVERLOAD, SIO_FAIL])
def test_no_fault_is_acknowledged_by_mode(shown: Any) -> None:
    refused = (
        (Write(SMODE, 0), REFUSED),
        (Write(FREQUENCY, 0.0), REFUSED),
        (Write(SPEED, 0.0), REFUSED),
    )
    stop = AcknowledgeThenWrite(ACK, Write(SMODE, 0))
    reads = [(Read('fieldbus.inv_st'), shown.code)] * 2 if shown is SIO_FAIL else []
    script = (*reads, (Read(MODE), BUS), *refused, (stop, REFUSED))
    assert play(smode.acknowledge(shown, 'Freque'), *script) == ''
    script = (*reads, (Read(MODE), AUTO), (Acknowledge(ACK), shown.code))
    assert play(smode.acknowledge(shown, 'Freque'), *script) == ''


def test_no_procedure_is_known() -> None:
    assert not smode.procedures
    assert not control.procedures


# --- Drive Control --------------------------------------------------------------------------------


@pytest.mark.parametrize(('word', 'holder'), [(FROM_BUS, Holder.BUS), (0, Holder.LOCAL)])
def test_who_has_control_by_drive_control(word: int, holder: Holder) -> None:
    assert play(control.holder(), (Read(STATUS), word)) is holder


def test_lost_control_is_asked_for_anew() -> None:
    ready = Write(WORD, BUS_CONTROL), None
    play(control.take_control(), (Read(STATUS), FROM_BUS), ready)
    play(control.take_control(), (Read(STATUS), 0), (Write(WORD, 0), None), ready)


def test_it_is_enabled_and_then_switched_on() -> None:
    enabled = BUS_CONTROL | ENABLE
    shown = Wait(status(word=1 << 2), not_by=[status(), status(word=1)])
    play(
        control.run(),
        (Write(WORD, enabled), None),
        (shown, None),
        (Write(WORD, enabled | SWITCH_ON, once=True), None),
    )


def test_switch_on_is_reset_and_the_others_left() -> None:
    read, low = (Read(WORD, once=True), 0x400F), Write(WORD, 0x400E, once=True)
    play(control.stop('Freque'), read, (low, None))
    play(control.stop('Freque'), read, (low, REFUSED), (Read(STATUS), 0))
    with pytest.raises(Refusal):
        play(control.stop('Freque'), read, (low, REFUSED), (Read(STATUS), FROM_BUS))


def test_enable_is_taken_back_and_the_bus_control_kept() -> None:
    play(control.release(), (Read(STATUS), FROM_BUS), (Write(WORD, BUS_CONTROL), None))
    play(control.release(), (Read(STATUS), 0))


@pytest.mark.parametrize(
    ('answer', 'removed'), [(None, Removal.COMMAND), (REFUSED, Removal.NOTHING)]
)
def test_what_is_removed(answer: Any, removed: Removal) -> None:
    script = (Read(WORD), 0x4009), (Write(WORD, 0x4008), answer)
    assert play(control.remove('Freque'), *script) is removed


def test_a_fault_is_acknowledged_by_an_edge() -> None:
    edge = [(Write(WORD, word), None) for word in (0x4008, 0x4088, 0x4008)]
    assert play(control.acknowledge(OVERLOAD, 'Freque'), (Read(WORD), 0x4089), *edge) == ''
    play(control.zero_setpoint('Freque'))


@pytest.mark.parametrize('from_bus', [True, False])
def test_in_charge(from_bus: bool) -> None:
    in_charge = OPTIMAL.profile.in_charge
    for seen in (None, status(from_bus=from_bus)):
        assert play(in_charge(seen), (Read(WORD), 0x4009)) == 'drive_control'
        assert play(in_charge(seen), (Read(WORD), 0x4008)) == 'mode_scmd'
