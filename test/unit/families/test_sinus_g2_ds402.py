# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The commands to a G2 by its drive profile, step by step, whatever it answers."""

from __future__ import annotations

import pytest
from support.steps import REFUSED, Wait, play, status

from nfo_sinus_driver.catalog import Holder, NotPossible, Refusal, Removal, State, load_family
from nfo_sinus_driver.catalog.profile import (
    FAULT_GONE,
    Acknowledge,
    AcknowledgeThenWrite,
    Read,
    Step,
    Write,
)
from nfo_sinus_driver.families.sinus_g2.ds402.words import STATUS_WORD, error_text, state_of

G2, DS402 = load_family('sinus_g2'), load_family('sinus_g2', 'ds402')
MODE, WORD, STATUS = 'fieldbus.mode', 'fieldbus.control_word', 'fieldbus.status_word'
ERROR, ACK = 'fieldbus.error_code', 'fieldbus.inv_st_with_ack'
INHIBIT, STOP, EXT, BUS = range(4)
REMOTE = 0x0200
OVERLOAD = G2.status_code(5)
SHUTDOWN, NO_VOLTAGE, RESET = 0x76, 0x00, 0x80
METHOD = DS402.profile.methods['ds402']('fieldbus', lambda key: 'canopen' in G2[key].addresses)

TO_NOBODY = Write(MODE, STOP)
RELEASED = (Write(WORD, NO_VOLTAGE), None)
FROM_BUS, LOCAL = (Read(STATUS), REMOTE), (Read(STATUS), 0x0040)
TARGET = 'fieldbus.vl_target_velocity'
ZEROED = ((Write(TARGET, 0.0), None), (Read(TARGET), 0))
NO_ERROR = (Read(ERROR), 0)


def edge(answer: object = None) -> tuple[tuple[Step, object], ...]:
    """Return bit 7 rising, without voltage, and what the drive answers to that."""
    low, high = (Write(WORD, word, retry=False) for word in (NO_VOLTAGE, RESET))
    return (low, answer), (high, answer), (FAULT_GONE, True), (low, answer)


def test_it_shares_the_tables_and_has_roles_of_its_own() -> None:
    assert DS402.parameters is G2.parameters and DS402.status_codes is G2.status_codes
    differs = {role.value: key for role, key in DS402.roles.items() if G2.roles[role] != key}
    assert differs == {
        'status_word': 'fieldbus.status_word',
        'control_mode': 'fieldbus.modes_of_operation_display',
        'stop_mode': 'fieldbus.shutdown_option_code',
    }
    assert next(iter(G2.profile.methods)) == 'mode_scmd'


@pytest.mark.parametrize(
    ('word', 'state'),
    [
        # by hand from CiA 402: xxxx xxxx x0xx 0000 and so on, other bits set or not
        (0x0000, State.NOT_READY_TO_SWITCH_ON),
        (0xFFB0, State.NOT_READY_TO_SWITCH_ON),
        (0x0240, State.SWITCH_ON_DISABLED),
        (0x0270, State.SWITCH_ON_DISABLED),
        (0x0231, State.READY_TO_SWITCH_ON),
        (0x0233, State.SWITCHED_ON),
        (0x0637, State.OPERATION_ENABLED),
        (0xC6B7, State.OPERATION_ENABLED),
        (0x0217, State.QUICK_STOP),
        (0x023F, State.FAULT_REACTION_ACTIVE),
        (0x0208, State.FAULTED),
        (0x0228, State.FAULTED),
        (0x0002, State.UNKNOWN),
        (0x0061, State.UNKNOWN),
        (0x0067, State.UNKNOWN),
    ],
)
def test_the_states_of_status_word(word: int, state: State) -> None:
    assert state_of(word) is state
    assert STATUS_WORD.may_say(word) is (state is not State.UNKNOWN)


def test_what_error_code_says() -> None:
    assert error_text(0) == ''
    assert error_text(0x3210) == 'error code 3210h (voltage)'
    assert error_text(0xFF01) == 'error code FF01h'


def test_control_is_taken_without_a_run_command_and_not_while_it_tunes() -> None:
    shutdown = (Write(WORD, SHUTDOWN), None)
    play(METHOD.take_control(), (Read(MODE), BUS), FROM_BUS, shutdown)
    remote = Wait(status(word=REMOTE), not_by=[status(), status(word=0x0040)])
    for answer in (None, REFUSED):
        # before the bus has control it may not be processed, and what stood may count then
        first = (Write(WORD, SHUTDOWN, head=True), answer)
        taken = (Write(MODE, BUS), None), first, (remote, None)
        play(METHOD.take_control(), (Read(MODE), STOP), LOCAL, *taken, shutdown)
    with pytest.raises(NotPossible, match='Inhibit'):
        play(METHOD.take_control(), (Read(MODE), INHIBIT))
    holders = (Holder.INHIBITED, Holder.NOBODY, Holder.LOCAL, Holder.BUS)
    assert [play(METHOD.holder(), (Read(MODE), mode)) for mode in range(4)] == list(holders)
    # a module that has no MODE
    absent = (Read(MODE), REFUSED)
    assert play(METHOD.holder(), absent, FROM_BUS) is Holder.BUS
    assert play(METHOD.holder(), absent, LOCAL) is Holder.UNKNOWN
    play(METHOD.release(), FROM_BUS, (TO_NOBODY, REFUSED))


def test_each_step_of_a_run_waits_for_the_one_before() -> None:
    ready, on, runs, faulted = (
        status(state=state)
        for state in (
            State.READY_TO_SWITCH_ON, State.SWITCHED_ON, State.OPERATION_ENABLED, State.FAULTED
        )
    )
    play(
        METHOD.run(),
        (Wait(ready, runs, not_by=[on, faulted]), None),
        (Write(WORD, 0x77, retry=False), None),
        (Wait(on, runs, not_by=[ready, faulted]), None),
        (Write(WORD, 0x7F, retry=False), None),
    )


def test_a_refused_stop_is_reported_only_where_the_bus_may_have_control() -> None:
    stop = (Write(WORD, SHUTDOWN, retry=False), REFUSED)
    play(METHOD.stop('Speed'), stop, LOCAL)
    zero = (Write(TARGET, 0.0, retry=False), None)
    with pytest.raises(Refusal):
        play(METHOD.stop('Speed'), stop, FROM_BUS, zero)
    with pytest.raises(Refusal):
        play(METHOD.stop('Speed'), stop, (Read(STATUS), REFUSED), zero)


def test_what_is_removed_while_a_fault_is_active() -> None:
    refused = (Write(WORD, SHUTDOWN), REFUSED)
    shutdown = (Write(WORD, SHUTDOWN), None)
    assert play(METHOD.remove('Speed'), shutdown) is Removal.COMMAND
    released = play(METHOD.remove('Speed'), refused, (TO_NOBODY, None), LOCAL)
    assert released is Removal.COMMAND
    held = (refused, (TO_NOBODY, None), FROM_BUS)
    assert play(METHOD.remove('Speed'), *held, *ZEROED) is Removal.SETPOINT
    kept = ((Write(TARGET, 0.0), None), (Read(TARGET), 600))
    assert play(METHOD.remove('Speed'), *held, *kept) is Removal.NOTHING
    assert play(METHOD.remove('PI-Reg'), *held) is Removal.NOTHING


def test_a_fault_is_acknowledged_by_the_edge_or_by_reading() -> None:
    code = (Read(ERROR), 0x2310)
    said = play(METHOD.acknowledge(OVERLOAD, 'Speed'), code, *edge(), FROM_BUS)
    assert said == 'error code 2310h (current)'
    # not processed: the bus has no control
    not_ours = (*edge(), LOCAL, LOCAL, (Acknowledge(ACK), 5))
    assert play(METHOD.acknowledge(OVERLOAD, 'Speed'), (Read(ERROR), REFUSED), *not_ours) == ''
    refused = (edge(REFUSED)[0], FROM_BUS, (Write(WORD, SHUTDOWN), None), (Acknowledge(ACK), 5))
    play(METHOD.acknowledge(OVERLOAD, 'Speed'), NO_ERROR, *refused)
    nothing = (edge(REFUSED)[0], FROM_BUS, (Write(WORD, SHUTDOWN), REFUSED), (TO_NOBODY, REFUSED))
    last = AcknowledgeThenWrite(ACK, Write(WORD, NO_VOLTAGE))
    play(METHOD.acknowledge(OVERLOAD, 'Speed'), NO_ERROR, *nothing, *ZEROED, (last, None))


def test_the_set_point_is_refused_where_it_does_not_mean_rpm() -> None:
    above, below = (f'fieldbus.vl_dimension_factor_{part}' for part in ('numerator', 'denominator'))
    least = Read('fieldbus.vl_velocity_min_amount')
    play(METHOD.require_startable(), (Read(above), 1), (Read(below), 1), (least, 0))
    # without the objects there is neither a factor nor a limit
    absent = ((Read(above), REFUSED), (Read(below), REFUSED), (least, REFUSED))
    play(METHOD.require_startable(), *absent)
    with pytest.raises(NotPossible, match=r'6046h\) is 30 rpm'):
        play(METHOD.require_startable(), *absent[:2], (least, 30))
    with pytest.raises(NotPossible, match=r'604Ch\) is 1/10'):
        play(METHOD.require_startable(), (Read(above), 1), (Read(below), 10))
    with pytest.raises(NotPossible, match='6061h'):
        play(METHOD.zero_setpoint('3'))
