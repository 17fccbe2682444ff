# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The requests to an Optimal, step by step, where it differs from the G2."""

from __future__ import annotations

import pytest
from support.steps import REFUSED, Wait, play, status

from nfo_sinus_driver.catalog import Holder, NotPossible, Refusal, Removal, load_family
from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    Acknowledge,
    AcknowledgeThenWrite,
    Read,
    Wait as Pause,
    Write,
)

OPTIMAL = load_family('sinus_optimal')
MODE, SMODE, WORD = 'fieldbus.mode', 'fieldbus.smode', 'fieldbus.drive_control'
STATUS, ACK = 'fieldbus.drive_status', 'fieldbus.inv_st_with_ack'
MANUAL, AUTO, BUS = 1, 2, 3
FREQUENCY, SPEED = 'fieldbus.input_freq_setpoint', 'fieldbus.input_speed_setpoint'
BUS_CONTROL, ENABLE, SWITCH_ON, FROM_BUS = 1 << 14, 1 << 3, 1 << 0, 1 << 9
ENABLED, STOPPING = 1 << 2, 1 << 15
OVERLOAD, SIO_FAIL = OPTIMAL.status_code(5), OPTIMAL.status_code(14)

smode = OPTIMAL.profile.methods['mode_scmd']('fieldbus', OPTIMAL.__contains__)
control = OPTIMAL.profile.methods['drive_control']('terminal', OPTIMAL.__contains__)
FREQUENCY_0 = ((Write(FREQUENCY, 0.0), None), (Read(FREQUENCY), 0.0))
SPEED_0 = ((Write(SPEED, 0.0), None), (Read(SPEED), 0.0))
STAYS = ((Write(FREQUENCY, 0.0), None), (Read(FREQUENCY), 3.0))


def test_who_has_control() -> None:
    for mode, holder in (
        (MANUAL, Holder.LOCAL), (AUTO, Holder.LOCAL), (BUS, Holder.BUS), (0, Holder.UNKNOWN)
    ):
        assert play(smode.holder(), (Read(MODE), mode)) is holder
    for word, holder in ((FROM_BUS, Holder.BUS), (0, Holder.LOCAL)):
        assert play(control.holder(), (Read(STATUS), word)) is holder
    assert not smode.procedures and not control.procedures


def test_no_way_releases_the_motor_at_once() -> None:
    assert not smode.coasts
    assert not control.coasts
    stop = Write(SMODE, 0, retry=False)
    zero = [(Write(key, 0.0, retry=False), None) for key in (FREQUENCY, SPEED)]
    play(smode.quick_stop('Freque'), (stop, None), *zero)
    word = Read(WORD, retry=False)
    play(control.quick_stop('Freque'), (word, 0x4009), (Write(WORD, 0x4008, retry=False), None))


def test_control_is_taken_and_given_to_the_keypad() -> None:
    play(
        smode.take_control(),
        (Read(MODE), MANUAL),
        (Write(MODE, BUS), None),
        (Write(SMODE, 0, head=True), None),
    )
    play(smode.run(), (Write(SMODE, 0x101, retry=False), None))
    stop_first = (Write(SMODE, 0), None), (Write(MODE, MANUAL), None)
    play(smode.release(), (Read(MODE), BUS), *stop_first)
    play(smode.release(), (Read(MODE), AUTO))
    with pytest.raises(Refusal):
        play(smode.release(), (Read(MODE), BUS), (Write(SMODE, 0), REFUSED))


def test_every_set_point_is_0_before_it_runs() -> None:
    for mode in ('Freque', 'Speed', ''):
        play(smode.zero_setpoint(mode), *FREQUENCY_0, *SPEED_0)
        with pytest.raises(NotPossible, match='keeps a set-point of 3'):
            play(smode.zero_setpoint(mode), *STAYS)


def test_mode_is_left_where_something_is_removed() -> None:
    for command, setpoint, removed in (
        (None, FREQUENCY_0, Removal.COMMAND),
        (REFUSED, FREQUENCY_0, Removal.SETPOINT),
        # both are written even if the first one is not taken
        (REFUSED, STAYS, Removal.NOTHING),
        (REFUSED, ((Write(FREQUENCY, 0.0), REFUSED),), Removal.NOTHING),
    ):
        script = ((Write(SMODE, 0), command), *setpoint, *SPEED_0)
        assert play(smode.remove('Freque'), *script) is removed


def test_no_fault_is_acknowledged_by_mode() -> None:
    refused = [(Write(key, 0), REFUSED) for key in (SMODE, FREQUENCY, SPEED)]
    stop = AcknowledgeThenWrite(ACK, Write(SMODE, 0))
    for shown in (OVERLOAD, SIO_FAIL):
        reads = [(Read('fieldbus.inv_st'), shown.code)] * 2 if shown is SIO_FAIL else []
        script = (*reads, (Read(MODE), BUS), *refused, (stop, REFUSED))
        assert play(smode.acknowledge(shown, 'Freque'), *script) == ''
        script = (*reads, (Read(MODE), AUTO), (Acknowledge(ACK), shown.code))
        assert play(smode.acknowledge(shown, 'Freque'), *script) == ''


# --- Drive Control --------------------------------------------------------------------------------


def test_lost_control_is_asked_for_anew() -> None:
    ready, ramps = (Write(WORD, BUS_CONTROL), None), (Write(WORD, BUS_CONTROL | ENABLE), None)
    shown = status(word=FROM_BUS)
    others = [status(word=0), status(word=FROM_BUS | ENABLED)]
    taken = Wait(shown, not_by=others), None
    # no status shows when the bit is taken, or taken away
    blind = Pause(0.2), None
    for word, asked, script in (
        (FROM_BUS, BUS_CONTROL, (ready, taken)),
        (0, 0, (ready, taken)),
        (0, BUS_CONTROL, ((Write(WORD, 0), None), blind, ready, taken)),
        (FROM_BUS, 0, (ready, blind, taken)),
        (FROM_BUS | STOPPING, 0x4008, (ramps, (Wait(shown, others[1], not_by=others[:1]), None))),
        (STOPPING, 0x4008, ((Write(WORD, 0), None), blind, ready, taken)),
    ):
        play(control.take_control(), (Read(STATUS), word), (Read(WORD), asked), *script)


def test_it_is_enabled_and_then_switched_on() -> None:
    enabled = BUS_CONTROL | ENABLE
    ready = Wait(status(word=1), status(word=ENABLED), not_by=[status(), status(word=FROM_BUS)])
    shown = Wait(status(word=ENABLED), not_by=[status(), status(word=1)])
    play(
        control.run(),
        (ready, None),
        (Write(WORD, enabled), None),
        (shown, None),
        (Write(WORD, enabled | SWITCH_ON, retry=False), None),
    )


def test_switch_on_is_reset_and_the_others_left() -> None:
    read, low = (Read(WORD, retry=False), 0x400F), Write(WORD, 0x400E, retry=False)
    play(control.stop('Freque'), read, (low, None))
    play(control.stop('Freque'), read, (low, REFUSED), (Read(STATUS), 0))
    with pytest.raises(Refusal):
        play(control.stop('Freque'), read, (low, REFUSED), (Read(STATUS), FROM_BUS))


def test_enable_is_taken_back_and_the_bus_control_kept() -> None:
    play(control.release(), (Read(STATUS), FROM_BUS), (Write(WORD, BUS_CONTROL), None))
    play(control.release(), (Read(STATUS), 0))


def test_what_is_removed() -> None:
    for answer, removed in ((None, Removal.COMMAND), (REFUSED, Removal.NOTHING)):
        script = (Read(WORD), 0x4009), (Write(WORD, 0x4008), answer)
        assert play(control.remove('Freque'), *script) is removed


def test_a_fault_is_acknowledged_by_an_edge() -> None:
    low, high = (Write(WORD, 0x4008), None), (Write(WORD, 0x4088), None)
    edge = high, (FAULT_GONE, True), low
    assert play(control.acknowledge(OVERLOAD, 'Freque'), (Read(WORD), 0x4009), low, *edge) == ''
    # one that an acknowledgement has left has to fall first
    fallen = low, (Pause(0.2), None)
    assert play(control.acknowledge(OVERLOAD, 'Freque'), (Read(WORD), 0x4089), *fallen, *edge) == ''
    play(control.zero_setpoint('Freque'))


def test_active_method() -> None:
    for seen in (None, status(from_bus=True), status()):
        for word, method in ((0x4009, 'drive_control'), (0x4008, 'mode_scmd')):
            assert play(OPTIMAL.profile.active_method(seen), (Read(WORD), word)) == method
