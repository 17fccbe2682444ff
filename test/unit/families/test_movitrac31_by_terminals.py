# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The requests to a MOVITRAC 31 that its terminals start, step by step, and its answers."""

from __future__ import annotations

from typing import Any

import pytest
from support.steps import REFUSED, play

from nfo_sinus_driver.catalog import Holder, Limits, NotPossible, Refusal, Removal, load_family
from nfo_sinus_driver.catalog.profile import Read, Write

MOVITRAC = load_family('movitrac31', 'remote_setpoint')
BITS, SIZE, MODE = 'fieldbus.function_bits', 'fieldbus.remote_setpoint', 'serial.control_mode'
WORD, TERMINALS, FREQUENCY = 'fieldbus.inverter_status', 'status.terminals', 'status.frequency'
STANDARD, REMOTE_SETPOINT, REMOTE_CONTROL = 'Standard', 'Remote setpoint', 'Remote control'
INHIBIT, RESET = 1 << 8, 1 << 6
TIMED_OUT = MOVITRAC.status_code(145)
SIZE_0 = ((Write(SIZE, 0.0), None), (Read(SIZE), 0.0))

method = MOVITRAC.profile.methods['remote_setpoint']('fieldbus', MOVITRAC.__contains__)
target = MOVITRAC.profile.setpoints['Freque']
NOTHING_ELSE = tuple(
    (Read(key), answer)
    for key, answer in (
        ('control.operating_mode', 'V/f mode'),
        ('control.synchronous_operation', REFUSED),
        ('serial.master_slave', False),
        ('serial.manual_operation', False),
        ('terminal.input_42', 'CCW/Stop'),
        ('terminal.input_43', 'Enable/Stop'),
        ('terminal.input_47', 'n11 (n21)'),
        *((f'terminal.input_{number}', REFUSED) for number in (48, 49, 50, 51, 52, 53, 54)),
    )
)
STILL = (
    (Read(WORD), 0x00010010),
    (Read('frequency.vf_pattern_1'), 'V/f pattern 1'),
    (Read('frequency.f_min_1'), 0.0),
)


def test_who_has_control() -> None:
    for mode, holder in (
        (STANDARD, Holder.LOCAL), (REMOTE_SETPOINT, Holder.BUS), (REMOTE_CONTROL, Holder.BUS),
        ('Fieldbus', Holder.LOCAL), ('9', Holder.UNKNOWN),
    ):
        assert play(method.holder(), (Read(MODE), mode)) is holder
        assert play(method.in_control(), (Read(MODE), mode)) is (holder is Holder.BUS)
        # the status tells it likewise
        assert MOVITRAC.profile.holders.get(mode, Holder.UNKNOWN) is holder


@pytest.mark.parametrize(('closed', 'reason'), [
    (0b101, ''), (0b110, ''),
    (0b100, r'no terminal with a direction is closed \(41 or 42\)'),
    (0b001, r'terminal 43 \(Enable/Stop\) is open'),
])
def test_the_terminals_have_to_start_it(closed: int, reason: str) -> None:
    looked = *NOTHING_ELSE, (Read(TERMINALS), closed)
    if not reason:
        play(method.require_startable(), *looked, (Read(MODE), REMOTE_SETPOINT), *STILL)
        return
    with pytest.raises(NotPossible, match=reason):
        play(method.require_startable(), *looked)


def test_a_motor_that_follows_a_set_point_of_the_terminals_is_left_alone() -> None:
    looked = *NOTHING_ELSE, (Read(TERMINALS), 0b101), (Read(MODE), STANDARD)
    with pytest.raises(NotPossible, match='follows a set-point of a fieldbus or of terminals'):
        play(method.require_startable(), *looked, (Read(FREQUENCY), 12.5))
    play(method.require_startable(), *looked, (Read(FREQUENCY), 0.0), *STILL)


def test_control_is_taken_with_set_point_0_and_nothing_is_left_to_be_followed() -> None:
    play(method.take_control(), (Read(MODE), REMOTE_SETPOINT), *SIZE_0)
    to_setpoint = Write(MODE, REMOTE_SETPOINT, stored=True), None
    for mode in (STANDARD, REMOTE_CONTROL):
        for early in (None, REFUSED):
            cleared = (Read(MODE), mode), (Write(BITS, 0), early), (Write(SIZE, 0.0), early)
            play(method.take_control(), *cleared, (Read(SIZE), 0.0), to_setpoint, *SIZE_0)
            for left in (20.0, REFUSED):
                with pytest.raises(NotPossible, match='a set-point stands in the drive'):
                    play(method.take_control(), *cleared, (Read(SIZE), left))


def test_a_run_is_given_by_the_terminals_alone() -> None:
    play(method.run())


def test_set_points_are_sizes_up_to_fmax() -> None:
    assert target.writes(12.5) == (Write(SIZE, 12.5),)
    assert target.forward_only and not target.directed
    limits = play(
        target.read_limits(MOVITRAC.__contains__),
        (Read(WORD), 0x00010010),
        (Read('frequency.vf_pattern_1'), 'V/f pattern 1'),
        (Read('frequency.f_base_1'), '50'),
        (Read('frequency.f_max_1'), 70.0),
    )
    assert limits == Limits(0.0, 70.0, 50.0)


@pytest.mark.parametrize('late', [None, REFUSED])
def test_a_stop_is_set_point_0_first_whatever_the_bits_do(late: Any) -> None:
    zero = Write(SIZE, 0.0, retry=False)
    bits = (Read(BITS, retry=False), 0b101), (Write(BITS, 0b100, retry=False), late)
    play(method.stop('Freque'), (zero, None), *bits)
    assert not method.coasts
    # with another P841 the terminals have the motor
    play(method.stop('Freque'), (zero, REFUSED), (Read(MODE), STANDARD))
    with pytest.raises(Refusal):
        play(method.stop('Freque'), (zero, REFUSED), (Read(MODE), REMOTE_SETPOINT), *bits)


def test_what_else_there_is_takes_control_from_the_terminals_and_releases_the_motor() -> None:
    removed = (Write(BITS, 0), REFUSED), (Write(SIZE, 0.0), REFUSED)
    early = Write(BITS, INHIBIT), REFUSED
    to_control = Write(MODE, REMOTE_CONTROL), None
    begun = *removed, early, to_control
    inhibited = Write(BITS, INHIBIT), None
    assert play(method.force_stop('Freque'), *begun, inhibited, (Read(MODE), REMOTE_CONTROL))
    # the drive confirms it, but ignores it
    assert not play(
        method.force_stop('Freque'), *begun, inhibited, (Read(MODE), REMOTE_SETPOINT)
    )
    assert not play(method.force_stop('Freque'), *begun, (Write(BITS, INHIBIT), REFUSED))


def test_release_removes_the_set_point_and_never_writes_p841() -> None:
    zero = Write(SIZE, 0.0), None
    bits = (Read(BITS, retry=False), 0), (Write(BITS, 0, retry=False), REFUSED)
    play(method.release(), (Read(MODE), REMOTE_SETPOINT), zero, *bits)
    play(method.release(), (Read(MODE), STANDARD))
    assert 'P841' in method.control_retained


def test_a_fault_is_acknowledged_with_set_point_0_as_far_as_function_bits_count() -> None:
    edge = (Write(BITS, RESET), REFUSED), (Write(BITS, 0), REFUSED)
    cleared = (Write(BITS, 0), REFUSED), *SIZE_0, (Read(MODE), REMOTE_SETPOINT), *edge
    assert play(method.acknowledge(TIMED_OUT, 'Freque'), *cleared, (Read(WORD), 0x00010000)) == ''
    with pytest.raises(NotPossible, match='P841 is not Remote control'):
        play(method.acknowledge(TIMED_OUT, 'Freque'), *cleared, (Read(WORD), 0x2D010000))
    with pytest.raises(NotPossible, match='the drive keeps a set-point'):
        kept = (Write(BITS, 0), None), (Write(SIZE, 0.0), REFUSED)
        play(method.acknowledge(TIMED_OUT, 'Freque'), *kept)


def test_without_a_set_point_nothing_turns() -> None:
    refused = (Write(BITS, 0), REFUSED)
    assert play(method.remove('Freque'), refused, *SIZE_0) is Removal.COMMAND
    kept = play(method.remove('Freque'), refused, (Write(SIZE, 0.0), None), (Read(SIZE), 5.0))
    assert kept is Removal.NOTHING
