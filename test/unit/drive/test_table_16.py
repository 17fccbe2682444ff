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

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.addresses import Words
from support.said import said

from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.simulator import motor as motor_module
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Conditions
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Phase
from nfo_sinus_driver.simulator.sinus_g2.state_machine import StateMachine

OVERLOAD = 5
STATUS = 0x258
CONTROL = 0x254
POWER = Control.NET_CTRL | Control.NET_REF | Control.ENABLE_VOLTAGE | Control.DISABLE_QUICK_STOP
RAMP = Control.ENABLE_RFG | Control.UNLOCK_RFG | Control.USE_REF_FOR_RFG
ON = POWER | RAMP | Control.SWITCH_ON
FORWARD = ON | Control.ENABLE_OP
REVERSE = ON | Control.ENABLE_REV_OP
#: So long a ramp is met on its way.
SLOW = {'control.retard': 20.0}

pytestmark = pytest.mark.usefixtures('hasty')

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
    with rig.simulator.lock:
        for word in words:
            rig.far.write_raw('fieldbus.drive_control', int(word))


def self_test(rig: Rig) -> None:
    """Begin anew as after power-on, but answering."""
    with rig.simulator.lock:
        rig.far.control_unit.restart()
        rig.far.motor.release(at_once=True)
        rig.far._settle()
        assert phase(rig) is Phase.NOT_READY_TO_SWITCH_ON


def initialise(rig: Rig) -> None:
    """End the self-test."""
    with rig.simulator.lock:
        rig.far.control_unit.initialised = True
        rig.far._settle()


def assert_it_can_be_enabled(rig: Rig) -> None:
    """It stands, no run command does, and the motor turns as soon as somebody enables it."""
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.wait_until_still()
    assert not unit(rig).word & Control.SWITCH_ON
    assert rig.enable().startswith('enabled')
    rig.publish(10.0)
    rig.wait_for_frequency(10.0)
    assert unit(rig).word & FORWARD == FORWARD
    assert not unit(rig).word & Control.ENABLE_REV_OP


def assert_disarmed(rig: Rig, cause: str) -> None:
    """The driver has noticed, says why, and takes the run command back."""
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for(cause)
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    with rig.simulator.lock:
        rig.far.memory.set('control.retard', 0.2)
    rig.wait_until_still()
    assert not unit(rig).word & Control.SWITCH_ON


# --- what the driver leads it through -------------------------------------------------------------


def enables(rig: Rig) -> None:
    rig.connect()
    assert rig.enable().startswith('enabled')
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    rig.wait_until_it_shows()


def stops(rig: Rig) -> None:
    enables(rig)
    assert said(rig.drive.stop().result(PATIENCE)).startswith('stop')
    wait_until(lambda: phase(rig) is Phase.READY_TO_SWITCH_ON)


def stops_and_coasts(rig: Rig) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.memory.set('control.st_mode', 'Release')
    stops(rig)


def stops_quickly(rig: Rig) -> None:
    enables(rig)
    assert said(rig.drive.quick_stop().result(PATIENCE)) == 'released: the motor coasts'
    wait_until(lambda: phase(rig) is Phase.SWITCH_ON_DISABLED)


def stops_down_a_ramp(rig: Rig) -> None:
    enables(rig)
    with rig.simulator.lock:
        rig.far.memory.set('control.retard', 20.0)
    assert said(rig.drive.stop().result(PATIENCE)) == 'stopping: it ramps down'
    assert phase(rig) is Phase.SHUTDOWN


def stops_quickly_on_a_ramp(rig: Rig) -> None:
    stops_down_a_ramp(rig)
    assert said(rig.drive.quick_stop().result(PATIENCE)) == 'released: the motor coasts'
    with rig.simulator.lock:
        rig.far.memory.set('control.retard', 0.2)


def enables_on_a_ramp(rig: Rig) -> None:
    stops_down_a_ramp(rig)
    assert rig.enable().startswith('enabled')
    assert phase(rig) is Phase.OPERATION_ENABLED
    assert rig.far.motor.frequency > 1.0, 'it came to its end'
    assert said(rig.drive.stop().result(PATIENCE)) == 'stopping: it ramps down'
    with rig.simulator.lock:
        rig.far.memory.set('control.retard', 0.2)


def when_switched_on(rig: Rig, act: Callable[[], object]) -> str:
    """Enable, and do something before the driver can give the direction; what enable answers."""
    rig.connect()
    done: list[int] = []

    def before(register: int, words: Words | None) -> None:
        if register == STATUS and not done and phase(rig) is Phase.SWITCHED_ON:
            done.append(register)
            act()

    rig.tap.before = before
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
    stops[0].result(PATIENCE)


def is_enabled_after_its_self_test(rig: Rig) -> None:
    rig.connect()
    self_test(rig)
    rig.next_snapshots(2)
    assert shown(rig) is State.NOT_READY_TO_SWITCH_ON
    initialise(rig)


N, D, R, S, E, B, X, Q, A, F = Phase
LED = {
    'not_ready_to_switch_on_leaves_when_initialised': ([(N, D)], is_enabled_after_its_self_test),
    'switch_on_disabled_leaves_on_bits_1_and_2_with_bit_0_low': ([(D, R)], enables),
    'ready_to_switch_on_leaves_on_switch_on': ([(R, S)], enables),
    'ready_to_switch_on_leaves_on_quick_stop': ([(R, D)], stops_quickly_before_the_direction),
    'switched_on_leaves_on_switch_off': ([(S, R)], stops_before_the_direction),
    'switched_on_leaves_on_quick_stop': ([(S, R), (R, D)], stops_quickly_before_the_direction),
    'switched_on_leaves_on_forward': ([(S, E)], enables),
    'operation_enabled_leaves_on_quick_stop': ([(E, Q)], stops_quickly),
    'operation_enabled_leaves_on_switch_off': ([(E, X)], stops),
    'shutdown_leaves_when_it_has_braked_and_the_voltage_is_off': ([(X, R)], stops),
    'shutdown_leaves_when_it_coasts_and_the_voltage_is_off': ([(X, R)], stops_and_coasts),
    'shutdown_leaves_on_quick_stop': ([(X, Q)], stops_quickly_on_a_ramp),
    'shutdown_leaves_on_switch_on': ([(X, E)], enables_on_a_ramp),
    'quick_stop_leaves_when_the_voltage_is_off': ([(Q, D)], stops_quickly),
}


@pytest.mark.parametrize(('wanted', 'lead'), LED.values(), ids=LED)
def test_table_16_led(make_rig: MakeRig, exits: Exits, wanted: Exits, lead) -> None:
    rig = make_rig(control_method='drive_control')
    lead(rig)
    wait_until(lambda: set(wanted) <= set(exits))
    if rig.drive.armed:
        rig.drive.stop().result(PATIENCE)
    assert_it_can_be_enabled(rig)
    assert not rig.notes.told(Cause.CANNOT_STOP)


def masks(rig: Rig) -> list[tuple[int, int]]:
    """What was written to DrvCtrlWriteMask, AND and OR, in order."""
    data = [bytes.fromhex(frame['hex']) for frame in rig.trace() if frame['direction'] == 'request']
    return [
        (int.from_bytes(one[7:9], 'big'), int.from_bytes(one[9:11], 'big'))
        for one in data
        if one[1:4] == b'\x10\x02\x50'
    ]


@pytest.mark.parametrize(('reference', 'net_ref'), [('fieldbus', 0x8000), ('terminal', 0)])
def test_words_of_table_14(make_rig: MakeRig, reference: str, net_ref: int) -> None:
    rig = make_rig(control_method='drive_control', reference=reference)
    rig.connect()
    rig.enable()
    # NetCtrl, power, no quick stop, ramp; bit 0 low first, then SwitchOn, then the direction
    assert rig.writes(CONTROL) == [net_ref | 0x4076, net_ref | 0x4077, net_ref | 0x407F]
    rig.drive.stop().result(PATIENCE)
    # SwitchOn and both directions are taken back, and nothing is added
    assert set(masks(rig)) == {(0xDFF6, 0)}
    rig.drive.quick_stop().result(PATIENCE)
    # no longer DisableQuickStop; OverrideCoast
    assert (0xDFF2, 0x0800) in masks(rig)
    # the mask saves reading the word
    assert not any(frame['hex'][2:8] == '030254' for frame in rig.trace())


# --- what another master leads it through, under the driver's eyes --------------------------------

#: From a motor that turns: the words, the exits, and what the driver says; '' if it goes on.
MISLED = {
    'operation_enabled_leaves_on_voltage_disabled': (
        [FORWARD & ~Control.ENABLE_VOLTAGE], [(E, Q), (Q, D)], 'the drive stopped by itself',
    ),
    'operation_enabled_leaves_on_quick_stop': (
        [FORWARD & ~Control.DISABLE_QUICK_STOP], [(E, Q), (Q, D)], 'the drive stopped by itself',
    ),
    'operation_enabled_leaves_on_switch_off': (
        [POWER | RAMP], [(E, X)], 'the drive stopped by itself',
    ),
    # and on by the driver, which takes bit 0 back
    'operation_enabled_leaves_on_a_lost_direction': (
        [ON], [(E, B), (B, X)], 'the drive stopped by itself',
    ),
    'operation_enabled_leaves_on_local_control': (
        [FORWARD & ~Control.NET_CTRL], [(E, Q), (Q, D)], 'the bus has lost control',
    ),
    'disable_leaves_on_voltage_disabled': (
        [ON, ON & ~Control.ENABLE_VOLTAGE], [(E, B), (B, Q)], 'the drive stopped by itself',
    ),
    'disable_leaves_on_quick_stop': (
        [ON, ON & ~Control.DISABLE_QUICK_STOP], [(E, B), (B, Q)], 'the drive stopped by itself',
    ),
    'disable_leaves_on_switch_off': (
        [ON, POWER | RAMP], [(E, B), (B, X)], 'the drive stopped by itself',
    ),
    'disable_leaves_on_coast': (
        [ON, ON | Control.OVERRIDE_COAST], [(E, B), (B, S)], 'the drive stopped by itself',
    ),
    'disable_leaves_on_a_direction': ([ON, FORWARD], [(E, B), (B, E)], ''),
    'shutdown_leaves_on_switch_on': ([POWER | RAMP, FORWARD], [(E, X), (X, E)], ''),
    'shutdown_leaves_on_switch_on_without_direction': (
        [POWER | RAMP, ON], [(E, X), (X, E), (E, B)], 'the drive stopped by itself',
    ),
    'shutdown_leaves_on_voltage_disabled': (
        [POWER, POWER & ~Control.ENABLE_VOLTAGE], [(E, X), (X, Q)], 'the drive stopped by itself',
    ),
    'shutdown_leaves_when_coast_is_chosen_and_the_voltage_is_off': (
        [POWER | RAMP | Control.OVERRIDE_COAST], [(E, X), (X, R)], 'the drive stopped by itself',
    ),
}


@pytest.mark.parametrize(('words', 'wanted', 'cause'), MISLED.values(), ids=MISLED)
def test_table_16_misled(make_rig: MakeRig, exits: Exits, words, wanted, cause: str) -> None:
    rig = make_rig(control_method='drive_control', parameters=SLOW)
    rig.turn()
    exits.clear()
    command(rig, *words)
    if cause:
        assert_disarmed(rig, cause)
        wait_until(lambda: set(wanted) <= set(exits))
        assert_it_can_be_enabled(rig)
    else:
        # it follows us again before anybody could see it
        rig.next_snapshots(3)
        assert exits == wanted
        assert rig.drive.armed
        rig.wait_for_frequency(20.0)


def test_table_16_disable_leaves_at_zero_rpm(make_rig: MakeRig, exits: Exits) -> None:
    rig = make_rig(control_method='drive_control')
    rig.turn()
    exits.clear()
    with rig.simulator.lock:
        command(rig, ON)
        rig.skip(2.0)
        assert exits == [(E, B), (B, S)]
    assert_disarmed(rig, 'the drive stopped by itself')
    assert (S, R) in exits
    assert_it_can_be_enabled(rig)


#: From a motor that stands under our control.
IDLE = {
    'switch_on_disabled_leaves_on_auto_init': (
        [Control(0), ON | Control.AUTO_INIT], [(D, R), (R, S)], '',
    ),
    'switch_on_disabled_stays_while_bit_0_is_set': (
        [POWER & ~Control.DISABLE_QUICK_STOP, ON], [(R, D)], '',
    ),
    'ready_to_switch_on_leaves_on_voltage_disabled': (
        [POWER & ~Control.ENABLE_VOLTAGE], [(R, D)], '',
    ),
    'ready_to_switch_on_leaves_on_quick_stop': (
        [POWER & ~Control.DISABLE_QUICK_STOP], [(R, D)], '',
    ),
    'switched_on_leaves_on_voltage_disabled': (
        [ON, ON & ~Control.ENABLE_VOLTAGE], [(R, S), (S, R), (R, D)], '',
    ),
    'switched_on_leaves_on_reverse': (
        [ON, REVERSE], [(R, S), (S, E)], 'although nobody enabled it',
    ),
    'switched_on_stays_on_both_directions': (
        [ON, FORWARD | REVERSE], [(R, S)], '',
    ),
    'switched_on_stays_on_an_old_direction_if_an_event_is_required': (
        [POWER | Control.ENABLE_OP, FORWARD | Control.EVENT_TRIGGERED_OP], [(R, S)], '',
    ),
    'switched_on_leaves_on_a_direction_that_changes_if_an_event_is_required': (
        [
            POWER | Control.ENABLE_OP,
            FORWARD | Control.EVENT_TRIGGERED_OP,
            REVERSE | Control.EVENT_TRIGGERED_OP,
        ],
        [(R, S), (S, E)],
        'although nobody enabled it',
    ),
}


@pytest.mark.parametrize(('words', 'wanted', 'cause'), IDLE.values(), ids=IDLE)
def test_table_16_idle(make_rig: MakeRig, exits: Exits, words, wanted, cause: str) -> None:
    rig = make_rig(control_method='drive_control')
    rig.connect()
    rig.enable()
    rig.drive.stop().result(PATIENCE)
    wait_until(lambda: phase(rig) is Phase.READY_TO_SWITCH_ON)
    exits.clear()
    with rig.simulator.lock:
        command(rig, *words)
        assert exits[-len(wanted) :] == wanted
    if cause:
        rig.notes.wait_for(cause)
        rig.wait_until_still()
    # whatever another master left behind, the first word of an enable ends
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.next_snapshots(2)
    assert not rig.far.motor.driven
    assert rig.enable().startswith('enabled')
    assert rig.drive.armed
    assert unit(rig).word & (FORWARD | REVERSE | Control.EVENT_TRIGGERED_OP) == FORWARD


def test_table_16_switched_on_that_is_left_while_it_is_being_enabled(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drive_state, 'TIMEOUT', 2.0)
    rig = make_rig(control_method='drive_control')
    answer = when_switched_on(rig, lambda: command(rig, ON & ~Control.ENABLE_VOLTAGE))
    assert 'does not start' in answer or 'RUN input' in answer
    assert not rig.drive.armed
    monkeypatch.setattr(drive_state, 'TIMEOUT', 10.0)
    assert_it_can_be_enabled(rig)


def test_table_16_not_ready_to_switch_on_of_a_drive_that_was_enabled(make_rig: MakeRig) -> None:
    rig = make_rig(control_method='drive_control')
    rig.turn()
    self_test(rig)
    assert_disarmed(rig, 'the drive is starting (')
    initialise(rig)
    assert_it_can_be_enabled(rig)


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


@pytest.mark.parametrize(
    'state', TO_A_FAULT, ids=lambda state: f'{state.value.lower()}_leaves_on_a_fault'
)
def test_table_16_fault(make_rig: MakeRig, exits: Exits, state: Phase) -> None:
    rig = make_rig(control_method='drive_control')
    rig.turn()
    with rig.simulator.lock:
        if state is N:
            self_test(rig)
        command(rig, *TO_A_FAULT[state])
        if state in (D, R):
            rig.skip(0.1)
        assert phase(rig) is state
        rig.far.trip(OVERLOAD)
        assert (state, A) in exits
    wait_until(lambda: shown(rig) is State.FAULTED)
    assert not rig.drive.armed
    assert (A, F) in exits
    # it is told right after
    wait_until(lambda: sum('fault 5 Overload' in text for _, text in rig.notes.events))
    assert sum('fault 5 Overload' in text for _, text in rig.notes.events) == 1
    if state is N:
        initialise(rig)
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 5 Overload'
    assert (F, D) in exits
    assert rig.far.control_unit.ack_reads == 0
    assert_it_can_be_enabled(rig)


def test_table_16_fault_reaction_active_leaves_when_the_voltage_is_off(
    make_rig: MakeRig, exits: Exits, monkeypatch: pytest.MonkeyPatch
) -> None:
    # an acknowledgement that comes before would have no effect
    monkeypatch.setattr(motor_module, '_DEMAGNETISING', 0.5)
    rig = make_rig(control_method='drive_control')
    rig.turn()
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: shown(rig) is State.FAULT_REACTION_ACTIVE)
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 5 Overload'
    assert [exit for exit in exits if A in exit] == [(E, A), (A, F)]
    assert_it_can_be_enabled(rig)


def test_table_16_faulted_stays_while_the_fault_stands(make_rig: MakeRig, exits: Exits) -> None:
    rig = make_rig(control_method='drive_control')
    rig.turn()
    rig.simulator.inject('fault', OVERLOAD, standing=True)
    wait_until(lambda: phase(rig) is F)
    assert '5 Overload is still active' in rig.refused(rig.drive.acknowledge())
    assert phase(rig) is F
    assert 'fault 5 Overload is active' in rig.refused(rig.drive.enable())
    rig.simulator.inject('ack-cause-gone')
    rig.next_snapshots(3)
    # bit 7 has to rise again
    assert phase(rig) is F
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 5 Overload'
    assert_it_can_be_enabled(rig)
