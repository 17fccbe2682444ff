# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The driver led through every state and exit of [M0 table 16].

What the simulated drive makes of its control word is in test/unit/simulator; here is what the
driver makes of what the drive does, whatever brought it there.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any, cast

import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import Fact, State
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.families.sinus_g2.words import ControlWord
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Conditions, Phase, StateMachine

OVERLOAD = 5
CONNECTION = 'rtu, control word'
CONTROL, MASK = 'fieldbus.drive_control', 'fieldbus.drv_ctrl_write_mask'
POWER = (
    ControlWord.NET_CTRL
    | ControlWord.NET_REF
    | ControlWord.ENABLE_VOLTAGE
    | ControlWord.DISABLE_QUICK_STOP
)
RAMP = ControlWord.ENABLE_RFG | ControlWord.UNLOCK_RFG | ControlWord.USE_REF_FOR_RFG
ON = POWER | RAMP | ControlWord.SWITCH_ON
FORWARD = ON | ControlWord.ENABLE_OP
REVERSE = ON | ControlWord.ENABLE_REV_OP
EVENT = ControlWord.EVENT_TRIGGERED_OP
WITHOUT_VOLTAGE, QUICK_STOP = ~ControlWord.ENABLE_VOLTAGE, ~ControlWord.DISABLE_QUICK_STOP
N, D, R, S, E, B, X, Q, A, F = Phase
#: A state and that behind it, as ``ER``.
Exits = list[str]


@pytest.fixture
def exits(monkeypatch: pytest.MonkeyPatch) -> Exits:
    """Every change of state of the simulated drive, in order."""
    seen: Exits = []
    following = StateMachine._following
    names = dict(zip(Phase, 'NDRSEBXQAF', strict=True))

    def note(machine: StateMachine, now: Conditions) -> Phase:
        after = following(machine, now)
        if after is not machine.phase:
            seen.append(names[machine.phase] + names[after])
        return after

    monkeypatch.setattr(StateMachine, '_following', note)
    return seen


def unit(rig: Rig) -> G2ControlUnit:
    return cast(G2ControlUnit, rig.far.control_unit)


def phase(rig: Rig) -> Phase:
    return unit(rig).machine.phase


def shown(rig: Rig) -> State:
    """The state that the driver has published last."""
    status = rig.drive.snapshot.status
    return State.UNKNOWN if status is None else status.state


def command(rig: Rig, *words: ControlWord) -> None:
    """Write control words, as another master does: no poll comes between them."""
    for word in words:
        rig.far.write_raw(CONTROL, int(word))


def self_test(rig: Rig) -> None:
    """Begin anew as after power-on, but answering."""
    unit(rig).restart()
    rig.far.motor.release(at_once=True)
    rig.far.control_unit.settle()
    assert phase(rig) is N


def initialise(rig: Rig) -> None:
    """End the self-test."""
    unit(rig).initialised = True
    rig.far.control_unit.settle()


def turn(rig: Rig, retard: float = 0.3) -> None:
    """Enable and turn, whatever was before; on a long ramp it is met on its way."""
    rig.enable()
    rig.send(20.0)
    rig.wait_until(lambda: rig.far.motor.frequency > 19.8, 5.0)
    rig.pass_time(0.2)
    assert unit(rig).word & (FORWARD | REVERSE | EVENT) == FORWARD
    rig.far.memory.set('control.retard', retard)


def require_stopped(rig: Rig) -> None:
    """It comes to stand, the stop is confirmed, and no run command is left."""
    rig.far.memory.set('control.retard', 0.3)
    rig.pass_time(1.5)
    assert not rig.drive.following and not rig.drive.stop_unconfirmed
    assert not rig.far.motor.driven and not unit(rig).word & ControlWord.SWITCH_ON


def rows_that_fail(rows: Sequence[tuple[Any, ...]], check: Callable[..., None]) -> list[str]:
    """Return what is wrong, with the row."""
    wrong = []
    for row in rows:
        try:
            check(*row)
        except AssertionError as complaint:
            wrong.append(f'{row}: {complaint}')
    return wrong


# --- what the driver leads it through -------------------------------------------------------------


def stops(rig: Rig, retard: float = 0.3, says: str = 'stopping: it ramps down') -> None:
    if not rig.drive.following:
        turn(rig, retard)
    assert rig.answer(rig.drive.stop()) == says


def stops_quickly(rig: Rig) -> None:
    assert rig.answer(rig.drive.quick_stop()) == 'released: the motor coasts'


def coasts(rig: Rig) -> None:
    rig.far.memory.set('control.st_mode', 'Release')
    stops(rig, says='stopping: it coasts')


def is_enabled_on_a_ramp(rig: Rig) -> None:
    stops(rig, 20.0)
    rig.enable()
    assert phase(rig) is E and rig.far.motor.frequency > 1.0
    stops(rig)


def before_the_direction(act: Callable[[Rig], object], says: str) -> Callable[[Rig], None]:
    """Enable, and do something when the next word would give the direction."""

    def lead(rig: Rig) -> None:
        done: list[object] = []

        def before(key: str, data: bytes | None) -> None:
            if data is None and not done and phase(rig) is S:
                done.append(act(rig))

        rig.meet = before
        assert says in rig.answer(rig.drive.enable())
        assert done

    return lead


def is_met_in_its_self_test(rig: Rig) -> None:
    self_test(rig)
    rig.pass_time(0.2)
    assert shown(rig) is State.NOT_READY_TO_SWITCH_ON
    initialise(rig)


def has_its_self_test_while_enabled(rig: Rig) -> None:
    turn(rig)
    self_test(rig)
    rig.pass_time(1.0)
    assert not rig.drive.following and rig.notes.said('the drive is starting (')
    initialise(rig)


ENDED = 'it was stopped while it was being enabled'
LED: dict[str, tuple[str, Callable[[Rig], object]]] = {
    'in its self-test': ('ND', is_met_in_its_self_test),
    'a self-test while enabled': ('ND', has_its_self_test_while_enabled),
    'stop': ('DR RS SE EX XR', stops),
    'coast': ('EX XR', coasts),
    'quick stop': ('EQ QD', lambda rig: (turn(rig), stops_quickly(rig))),
    'quick stop on a ramp': ('EX XQ', lambda rig: (stops(rig, 20.0), stops_quickly(rig))),
    'enable on a ramp': ('XE', is_enabled_on_a_ramp),
    'stop before the direction': ('SR', before_the_direction(lambda rig: rig.drive.stop(), ENDED)),
    'quick stop before the direction': (
        'SR RD', before_the_direction(lambda rig: rig.drive.quick_stop(), ENDED),
    ),
    'ended by another before the direction': (
        'RD', before_the_direction(lambda rig: command(rig, ON & WITHOUT_VOLTAGE), 'RUN input'),
    ),
}


@pytest.mark.parametrize('led', LED)
def test_table_16_led(exits: Exits, led: str) -> None:
    wanted, lead = LED[led]
    with Rig(CONNECTION).connect() as rig:
        lead(rig)
        require_stopped(rig)
        assert set(wanted.split()) <= set(exits)
        assert not rig.notes.said(Cause.CANNOT_STOP)
        rig.assert_only_enable_helps()


@pytest.mark.parametrize(('reference', 'net_ref'), [('fieldbus', 0x8000), ('terminal', 0)])
def test_words_of_table_14(reference: str, net_ref: int) -> None:
    with Rig(CONNECTION, reference=reference).connect() as rig:
        rig.enable()
        # NetCtrl, power, no quick stop, ramp; bit 0 low first, then SwitchOn, then the direction
        assert rig.written(CONTROL) == [net_ref | 0x4076, net_ref | 0x4077, net_ref | 0x407F]
        rig.answer(rig.drive.stop())
        # SwitchOn and both directions are removed by AND, and nothing is added by OR
        assert set(rig.written(MASK)) == {0x0000DFF6}
        rig.answer(rig.drive.quick_stop())
        # no longer DisableQuickStop; OverrideCoast
        assert 0x0800DFF2 in rig.written(MASK)
        # the mask saves reading the word
        assert (1, CONTROL, None) not in rig.asked


@pytest.mark.parametrize('sign', ['ignored', 'followed'])
@pytest.mark.parametrize('mode', ['Freque', 'Speed', 'Torque'])
def test_reverse_is_bit_13_beside_a_size(mode: str, sign: str) -> None:
    options, parameters = {'sign_in_drive_control': sign}, {'control.mode': mode}
    with Rig(CONNECTION, options=options, parameters=parameters).connect() as rig:
        rig.enable()
        key = unit(rig).setpoint_key
        for value in (20.0, -20.0, 0.0, -10.0, 10.0):
            rig.send(value)
            rig.pass_time(0.5)
        # SwitchOn is left as it is; no size stands when the direction changes
        assert rig.written(MASK) == [0x2000DFF7, 0x0008DFF7]
        count = 10 if mode == 'Freque' else 1
        sizes = [20 * count, 0, 20 * count, 0, 10 * count, 0, 10 * count]
        assert [size for size, _ in groupby(rig.written(key)) if size is not None][1:] == sizes
        rig.send(-20.0)
        rig.pass_time(1.5)
        assert (rig.far.motor.torque if mode == 'Torque' else rig.far.motor.frequency) < 0
        status = rig.drive.snapshot.status
        assert status is not None and Fact.REVERSE in status.facts and status.runs
        assert rig.drive.snapshot.setpoint == -20 and rig.drive.snapshot.actual < 0
        # a program that goes on gives no direction anew
        before = len(rig.written(MASK))
        rig.pass_time(12.0)
        assert len(rig.written(MASK)) == before and rig.drive.following


def test_the_sign_of_a_process_value_is_no_direction() -> None:
    process = {'control.mode': 'PI-Reg', 'pi_reg.setmin': -50.0, 'pi_reg.setmax': 50.0}
    with Rig(CONNECTION, parameters=process).connect() as rig:
        rig.enable()
        rig.send(-20.0)
        rig.pass_time(1.0)
        assert rig.written(MASK) == [] and unit(rig).word & ControlWord.ENABLE_OP
        assert rig.far.memory.number('status.reg_set') == -20


def test_a_reverse_gives_no_run_command_that_another_master_has_taken_back() -> None:
    with Rig(CONNECTION).connect() as rig:
        turn(rig, 20.0)
        rig.spoil('drop', MASK)
        command(rig, POWER | RAMP)
        rig.drive.set_setpoint(-20.0)
        rig.send(None)
        rig.pass_time(0.1)
        assert not unit(rig).word & ControlWord.SWITCH_ON
        require_stopped(rig)


# --- what another master leads it through, under the driver's eyes --------------------------------

STOPPED, LOST = 'the drive stopped by itself', 'the bus has lost control'
#: From a motor that turns: the exits, the words, and what the driver says; '' if it goes on.
MISLED: list[tuple[str, list[ControlWord], str]] = [
    ('EQ QD', [FORWARD & WITHOUT_VOLTAGE], STOPPED),
    ('EQ QD', [FORWARD & QUICK_STOP], STOPPED),
    ('EQ QD', [FORWARD & ~ControlWord.NET_CTRL], LOST),
    ('EX', [POWER | RAMP], STOPPED),
    # and on by the driver, which removes bit 0
    ('EB BX', [ON], STOPPED),
    ('EB BQ', [ON, ON & WITHOUT_VOLTAGE], STOPPED),
    ('EB BQ', [ON, ON & QUICK_STOP], STOPPED),
    ('EB BX', [ON, POWER | RAMP], STOPPED),
    ('EB BS', [ON, ON | ControlWord.OVERRIDE_COAST], STOPPED),
    # it follows us again before that can be seen
    ('EB BE', [ON, FORWARD], ''),
    ('EX XE', [POWER | RAMP, FORWARD], ''),
    ('EX XE EB', [POWER | RAMP, ON], STOPPED),
    ('EX XQ', [POWER, POWER & WITHOUT_VOLTAGE], STOPPED),
    ('EX XR', [POWER | RAMP | ControlWord.OVERRIDE_COAST], STOPPED),
]


def test_table_16_misled(exits: Exits) -> None:
    with Rig(CONNECTION, telemetry_rate=0.0).connect() as rig:

        def check(wanted: str, words: list[ControlWord], cause: str) -> None:
            turn(rig, 20.0)
            exits.clear()
            rig.notes.events.clear()
            command(rig, *words)
            rig.pass_time(0.5)
            if cause:
                assert rig.notes.said(cause), rig.notes.events
                require_stopped(rig)
            else:
                assert rig.drive.following and rig.far.motor.frequency > 19.0
            assert set(wanted.split()) <= set(exits), exits

        assert not rows_that_fail(MISLED, check)


UNASKED = 'although it was not enabled'
#: From a motor that stands under our control: the last exits, the words, and what the driver says.
IDLE: list[tuple[str, list[ControlWord], str]] = [
    ('DR RS', [ControlWord(0), ON | ControlWord.AUTO_INIT], ''),
    # it stays there while bit 0 is set
    ('RD', [POWER & QUICK_STOP, ON], ''),
    ('RD', [POWER & QUICK_STOP], ''),
    ('RD', [POWER & WITHOUT_VOLTAGE], ''),
    ('RS SR RD', [ON, ON & WITHOUT_VOLTAGE], ''),
    ('RS SE', [ON, REVERSE], UNASKED),
    # both directions at once are none
    ('RS', [ON, FORWARD | REVERSE], ''),
    # nor is an old one where an event is required, but one that changes is
    ('RS', [POWER | ControlWord.ENABLE_OP, FORWARD | EVENT], ''),
    ('RS SE', [POWER | ControlWord.ENABLE_OP, FORWARD | EVENT, REVERSE | EVENT], UNASKED),
]


def test_table_16_idle(exits: Exits) -> None:
    with Rig(CONNECTION, telemetry_rate=0.0).connect() as rig:

        def check(wanted: str, words: list[ControlWord], cause: str) -> None:
            # whatever another master left behind, the first word of an enable ends
            stops(rig)
            require_stopped(rig)
            exits.clear()
            rig.notes.events.clear()
            command(rig, *words)
            assert exits[-len(wanted.split()) :] == wanted.split(), exits
            rig.pass_time(1.5)
            assert not cause or rig.notes.said(cause), rig.notes.events
            assert not rig.drive.stop_unconfirmed and not rig.far.motor.driven

        assert not rows_that_fail(IDLE, check)
        turn(rig)


# --- faults ---------------------------------------------------------------------------------------

#: How to come to each state, from a motor that turns, and for how long to wait there, s.
TO_A_FAULT = [
    (D, FORWARD & QUICK_STOP, 0.1),
    (R, POWER | ControlWord.OVERRIDE_COAST, 0.1),
    (S, ON | ControlWord.OVERRIDE_COAST, 0.0),
    (E, FORWARD, 0.0),
    (B, ON, 0.0),
    (X, POWER | RAMP, 0.0),
    (Q, FORWARD & QUICK_STOP, 0.0),
]


def test_table_16_fault(exits: Exits) -> None:
    with Rig(CONNECTION, telemetry_rate=0.0).connect() as rig:

        def check(state: Phase, word: ControlWord, wait: float) -> None:
            turn(rig)
            exits.clear()
            rig.notes.events.clear()
            command(rig, word)
            rig.far.advance(wait)
            assert phase(rig) is state
            rig.far.trip(OVERLOAD)
            rig.pass_time(1.0)
            assert shown(rig) is State.FAULTED and not rig.drive.following
            assert sum('fault 5 Overload' in event.text for event in rig.notes.events) == 1
            assert rig.answer(rig.drive.acknowledge()) == 'acknowledged 5 Overload'
            assert {'AF', 'FD'} <= set(exits) and unit(rig).ack_reads == 0
            require_stopped(rig)

        assert not rows_that_fail(TO_A_FAULT, check)


def test_table_16_fault_reaction_active_leaves_when_the_voltage_is_off(exits: Exits) -> None:
    # an acknowledgement that comes before would have no effect
    with Rig(CONNECTION).turn() as rig:
        rig.far.trip(OVERLOAD)
        rig.far.motor._voltage_left = 0.5
        rig.pass_time(0.2)
        assert shown(rig) is State.FAULT_REACTION_ACTIVE
        assert rig.answer(rig.drive.acknowledge()) == 'acknowledged 5 Overload'
        assert [exit for exit in exits if 'A' in exit] == ['EA', 'AF']
