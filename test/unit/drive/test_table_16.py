# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The driver led through every state and exit of [M0 table 16].

What the simulated drive makes of its control word is in test/unit/simulator; here is what the
driver makes of what the drive does, whoever brought it there.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Conditions
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Phase
from nfo_sinus_driver.simulator.sinus_g2.state_machine import StateMachine

OVERLOAD = 5
WAY = 'rtu, control word'
CONTROL, MASK = 'fieldbus.drive_control', 'fieldbus.drv_ctrl_write_mask'
POWER = Control.NET_CTRL | Control.NET_REF | Control.ENABLE_VOLTAGE | Control.DISABLE_QUICK_STOP
RAMP = Control.ENABLE_RFG | Control.UNLOCK_RFG | Control.USE_REF_FOR_RFG
ON = POWER | RAMP | Control.SWITCH_ON
FORWARD = ON | Control.ENABLE_OP
REVERSE = ON | Control.ENABLE_REV_OP
EVENT = Control.EVENT_TRIGGERED_OP
N, D, R, S, E, B, X, Q, A, F = Phase

Exits = list[tuple[Phase, Phase]]


@pytest.fixture
def exits(monkeypatch: pytest.MonkeyPatch) -> Exits:
    """Every change of state of the simulated drive, in order."""
    seen: Exits = []
    following = StateMachine._following

    def note(machine: StateMachine, now: Conditions) -> Phase:
        after = following(machine, now)
        if after is not machine.phase:
            seen.append((machine.phase, after))
        return after

    monkeypatch.setattr(StateMachine, '_following', note)
    return seen


def unit(rig: Rig) -> G2ControlUnit:
    far = rig.far.control_unit
    assert isinstance(far, G2ControlUnit)
    return far


def phase(rig: Rig) -> Phase:
    return unit(rig).machine.phase


def shown(rig: Rig) -> State:
    """The state that the driver has published last."""
    status = rig.drive.snapshot.status
    return State.UNKNOWN if status is None else status.state


def command(rig: Rig, *words: Control) -> None:
    """Write control words, as another master does: no poll comes between them."""
    for word in words:
        rig.far.write_raw(CONTROL, int(word))


def self_test(rig: Rig) -> None:
    """Begin anew as after power-on, but answering."""
    unit(rig).restart()
    rig.far.motor.release(at_once=True)
    rig.far._settle()
    assert phase(rig) is N


def initialise(rig: Rig) -> None:
    """End the self-test."""
    unit(rig).initialised = True
    rig.far._settle()


def slow(rig: Rig) -> None:
    """So long a ramp is met on its way."""
    rig.far.memory.set('control.retard', 20.0)


def turn(rig: Rig) -> None:
    """Enable, if it is not, and turn; any earlier state has to allow that."""
    rig.enable()
    rig.send(20.0)
    rig.wait_until(lambda: rig.far.motor.frequency > 19.8, 5.0)
    rig.pass_time(0.2)
    assert unit(rig).word & (FORWARD | REVERSE | EVENT) == FORWARD


def require_stopped(rig: Rig) -> None:
    """It comes to stand, the stop is confirmed, and no run command is left."""
    rig.far.memory.set('control.retard', 0.3)
    rig.pass_time(1.5)
    assert not rig.drive.armed and not rig.drive.stop_unconfirmed
    assert not rig.far.motor.driven and not unit(rig).word & Control.SWITCH_ON


def rows_that_fail(rows: dict[str, tuple], check: Callable[..., None]) -> dict[str, str]:
    """Return what is wrong, by the row."""
    wrong = {}
    for name, row in rows.items():
        try:
            check(*row)
        except AssertionError as complaint:
            wrong[name] = str(complaint)
    return wrong


# --- what the driver leads it through -------------------------------------------------------------


def stops(rig: Rig) -> None:
    turn(rig)
    assert rig.answer(rig.drive.stop()).startswith('stop')


def stops_and_coasts(rig: Rig) -> None:
    rig.far.memory.set('control.st_mode', 'Release')
    stops(rig)


def stops_quickly(rig: Rig) -> None:
    turn(rig)
    assert rig.answer(rig.drive.quick_stop()) == 'released: the motor coasts'


def stops_quickly_on_a_ramp(rig: Rig) -> None:
    slow(rig)
    stops(rig)
    assert phase(rig) is X
    assert rig.answer(rig.drive.quick_stop()) == 'released: the motor coasts'


def enables_on_a_ramp(rig: Rig) -> None:
    slow(rig)
    stops(rig)
    rig.enable()
    assert phase(rig) is E and rig.far.motor.frequency > 1.0
    assert rig.answer(rig.drive.stop()) == 'stopping: it ramps down'


def when_switched_on(rig: Rig, act: Callable[[], object]) -> str:
    """Enable, and do something before the driver can give the direction; what enable answers."""
    done: list[bool] = []

    def before(key: str, data: bytes | None) -> None:
        if data is None and not done and phase(rig) is S:
            done.append(True)
            act()

    rig.meet = before
    answer = rig.answer(rig.drive.enable())
    assert done
    return answer


def stops_before_the_direction(rig: Rig) -> None:
    answer = when_switched_on(rig, rig.drive.stop)
    assert answer == 'it was stopped while it was being enabled'


def stops_quickly_before_the_direction(rig: Rig) -> None:
    stops: list[Future[str]] = []
    answer = when_switched_on(rig, lambda: stops.append(rig.drive.quick_stop()))
    assert answer == 'it was stopped while it was being enabled'
    rig.result(stops[0])


def is_left_by_another_before_the_direction(rig: Rig) -> None:
    answer = when_switched_on(rig, lambda: command(rig, ON & ~Control.ENABLE_VOLTAGE))
    assert 'does not start' in answer or 'RUN input' in answer


def is_met_in_its_self_test(rig: Rig) -> None:
    self_test(rig)
    rig.pass_time(0.2)
    assert shown(rig) is State.NOT_READY_TO_SWITCH_ON
    initialise(rig)


def has_its_self_test_while_enabled(rig: Rig) -> None:
    turn(rig)
    self_test(rig)
    rig.pass_time(1.0)
    assert not rig.drive.armed and rig.notes.said('the drive is starting (')
    initialise(rig)


LED: list[tuple[Callable[[Rig], None], Exits]] = [
    (is_met_in_its_self_test, [(N, D)]),
    (has_its_self_test_while_enabled, [(N, D)]),
    (stops, [(D, R), (R, S), (S, E), (E, X), (X, R)]),
    (stops_and_coasts, [(E, X), (X, R)]),
    (stops_quickly, [(E, Q), (Q, D)]),
    (stops_quickly_on_a_ramp, [(X, Q)]),
    (enables_on_a_ramp, [(X, E)]),
    (stops_before_the_direction, [(S, R)]),
    (stops_quickly_before_the_direction, [(S, R), (R, D)]),
    (is_left_by_another_before_the_direction, []),
]


@pytest.mark.parametrize(('lead', 'wanted'), LED, ids=[lead.__name__ for lead, _ in LED])
def test_table_16_led(exits: Exits, lead: Callable[[Rig], None], wanted: Exits) -> None:
    with Rig(WAY) as rig:
        rig.connect()
        lead(rig)
        require_stopped(rig)
        assert set(wanted) <= set(exits)
        assert not rig.notes.said(Cause.CANNOT_STOP)
        rig.assert_only_enable_helps()


@pytest.mark.parametrize(('reference', 'net_ref'), [('fieldbus', 0x8000), ('terminal', 0)])
def test_words_of_table_14(reference: str, net_ref: int) -> None:
    with Rig(WAY, reference=reference) as rig:
        rig.connect()
        rig.enable()
        # NetCtrl, power, no quick stop, ramp; bit 0 low first, then SwitchOn, then the direction
        assert rig.written(CONTROL) == [net_ref | 0x4076, net_ref | 0x4077, net_ref | 0x407F]
        rig.answer(rig.drive.stop())
        # SwitchOn and both directions are taken back by AND, and nothing is added by OR
        assert set(rig.written(MASK)) == {0x0000DFF6}
        rig.answer(rig.drive.quick_stop())
        # no longer DisableQuickStop; OverrideCoast
        assert 0x0800DFF2 in rig.written(MASK)
        # the mask saves reading the word
        assert (1, CONTROL, None) not in rig.asked


# --- what another master leads it through, under the driver's eyes --------------------------------

STOPPED = 'the drive stopped by itself'
#: From a motor that turns: the words, the exits, and what the driver says; '' if it goes on.
MISLED: dict[str, tuple[list[Control], Exits, str]] = {
    'operation enabled, voltage disabled': (
        [FORWARD & ~Control.ENABLE_VOLTAGE], [(E, Q), (Q, D)], STOPPED,
    ),
    'operation enabled, quick stop': (
        [FORWARD & ~Control.DISABLE_QUICK_STOP], [(E, Q), (Q, D)], STOPPED,
    ),
    'operation enabled, switch off': ([POWER | RAMP], [(E, X)], STOPPED),
    # and on by the driver, which takes bit 0 back
    'operation enabled, a lost direction': ([ON], [(E, B), (B, X)], STOPPED),
    'operation enabled, local control': (
        [FORWARD & ~Control.NET_CTRL], [(E, Q), (Q, D)], 'the bus has lost control',
    ),
    'disable, voltage disabled': (
        [ON, ON & ~Control.ENABLE_VOLTAGE], [(E, B), (B, Q)], STOPPED,
    ),
    'disable, quick stop': (
        [ON, ON & ~Control.DISABLE_QUICK_STOP], [(E, B), (B, Q)], STOPPED,
    ),
    'disable, switch off': ([ON, POWER | RAMP], [(E, B), (B, X)], STOPPED),
    'disable, coast': ([ON, ON | Control.OVERRIDE_COAST], [(E, B), (B, S)], STOPPED),
    'disable, a direction': ([ON, FORWARD], [(E, B), (B, E)], ''),
    'shutdown, switch on': ([POWER | RAMP, FORWARD], [(E, X), (X, E)], ''),
    'shutdown, switch on without direction': (
        [POWER | RAMP, ON], [(E, X), (X, E), (E, B)], STOPPED,
    ),
    'shutdown, voltage disabled': (
        [POWER, POWER & ~Control.ENABLE_VOLTAGE], [(E, X), (X, Q)], STOPPED,
    ),
    'shutdown, coast': ([POWER | RAMP | Control.OVERRIDE_COAST], [(E, X), (X, R)], STOPPED),
}


def test_table_16_misled(exits: Exits) -> None:
    with Rig(WAY, telemetry_rate=0.0) as rig:
        rig.connect()

        def check(words: list[Control], wanted: Exits, cause: str) -> None:
            turn(rig)
            slow(rig)
            exits.clear()
            rig.notes.events.clear()
            command(rig, *words)
            rig.pass_time(0.5)
            if cause:
                assert rig.notes.said(cause), rig.notes.events
                require_stopped(rig)
                assert set(wanted) <= set(exits), exits
            else:
                # it follows us again before that can be seen
                assert exits == wanted
                assert rig.drive.armed and rig.far.motor.frequency > 19.0

        assert not rows_that_fail(MISLED, check)


def test_table_16_disable_leaves_at_zero_rpm(exits: Exits) -> None:
    with Rig(WAY) as rig:
        rig.turn()
        exits.clear()
        command(rig, ON)
        rig.far.advance(2.0)
        assert exits == [(E, B), (B, S)]
        rig.pass_time(3.0)
        assert rig.notes.said(STOPPED)
        require_stopped(rig)
        assert (S, R) in exits
        rig.assert_only_enable_helps()


UNASKED = 'although nobody enabled it'
#: From a motor that stands under our control.
IDLE: dict[str, tuple[list[Control], Exits, str]] = {
    'switch on disabled, AutoInit': ([Control(0), ON | Control.AUTO_INIT], [(D, R), (R, S)], ''),
    'switch on disabled, bit 0 stays': ([POWER & ~Control.DISABLE_QUICK_STOP, ON], [(R, D)], ''),
    'ready, voltage disabled': ([POWER & ~Control.ENABLE_VOLTAGE], [(R, D)], ''),
    'ready, quick stop': ([POWER & ~Control.DISABLE_QUICK_STOP], [(R, D)], ''),
    'switched on, voltage disabled': (
        [ON, ON & ~Control.ENABLE_VOLTAGE], [(R, S), (S, R), (R, D)], '',
    ),
    'switched on, reverse': ([ON, REVERSE], [(R, S), (S, E)], UNASKED),
    'switched on, both directions': ([ON, FORWARD | REVERSE], [(R, S)], ''),
    'switched on, an old direction where an event is required': (
        [POWER | Control.ENABLE_OP, FORWARD | EVENT], [(R, S)], '',
    ),
    'switched on, a direction that changes where an event is required': (
        [POWER | Control.ENABLE_OP, FORWARD | EVENT, REVERSE | EVENT], [(R, S), (S, E)], UNASKED,
    ),
}


def test_table_16_idle(exits: Exits) -> None:
    with Rig(WAY, telemetry_rate=0.0) as rig:
        rig.connect()

        def check(words: list[Control], wanted: Exits, cause: str) -> None:
            # whatever another master left behind, the first word of an enable ends
            stops(rig)
            require_stopped(rig)
            assert phase(rig) is R
            exits.clear()
            rig.notes.events.clear()
            command(rig, *words)
            assert exits[-len(wanted) :] == wanted, exits
            rig.pass_time(1.5)
            assert not cause or rig.notes.said(cause), rig.notes.events
            assert not rig.drive.stop_unconfirmed and not rig.far.motor.driven

        assert not rows_that_fail(IDLE, check)
        turn(rig)


# --- faults ---------------------------------------------------------------------------------------

#: How to come to each state, from a motor that turns.
TO_A_FAULT = {
    N: (),
    D: (FORWARD & ~Control.DISABLE_QUICK_STOP,),
    R: (POWER | Control.OVERRIDE_COAST,),
    S: (ON | Control.OVERRIDE_COAST,),
    E: (FORWARD,),
    B: (ON,),
    X: (POWER | RAMP,),
    Q: (FORWARD & ~Control.DISABLE_QUICK_STOP,),
}


@pytest.mark.parametrize('state', TO_A_FAULT, ids=lambda state: state.value)
def test_table_16_fault(exits: Exits, state: Phase) -> None:
    with Rig(WAY) as rig:
        rig.turn()
        if state is N:
            self_test(rig)
        command(rig, *TO_A_FAULT[state])
        if state in (D, R):
            rig.far.advance(0.1)
        assert phase(rig) is state
        rig.far.trip(OVERLOAD)
        assert (state, A) in exits
        rig.pass_time(1.0)
        assert shown(rig) is State.FAULTED and not rig.drive.armed
        assert (A, F) in exits
        assert sum('fault 5 Overload' in one.text for one in rig.notes.events) == 1
        if state is N:
            initialise(rig)
        assert rig.answer(rig.drive.acknowledge()) == 'acknowledged 5 Overload'
        assert (F, D) in exits
        assert unit(rig).ack_reads == 0
        require_stopped(rig)
        rig.assert_only_enable_helps()


def test_table_16_fault_reaction_active_leaves_when_the_voltage_is_off(exits: Exits) -> None:
    # an acknowledgement that comes before would have no effect
    with Rig(WAY) as rig:
        rig.turn()
        rig.far.trip(OVERLOAD)
        rig.far.motor._voltage_left = 0.5
        rig.pass_time(0.2)
        assert shown(rig) is State.FAULT_REACTION_ACTIVE
        assert rig.answer(rig.drive.acknowledge()) == 'acknowledged 5 Overload'
        assert [exit for exit in exits if A in exit] == [(E, A), (A, F)]


def test_table_16_faulted_stays_while_the_fault_stands() -> None:
    with Rig(WAY) as rig:
        rig.turn()
        rig.far.trip(OVERLOAD, cause_present=True)
        rig.pass_time(1.0)
        assert '5 Overload is still active' in rig.answer(rig.drive.acknowledge())
        assert phase(rig) is F
        assert 'fault 5 Overload is active' in rig.answer(rig.drive.enable())
        rig.far.end_fault_causes()
        rig.pass_time(0.5)
        # bit 7 has to rise again
        assert phase(rig) is F
        assert rig.answer(rig.drive.acknowledge()) == 'acknowledged 5 Overload'
        rig.assert_only_enable_helps()
