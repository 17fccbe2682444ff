# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every way of control does the same, on each model: run, stop, release, acknowledge."""

from __future__ import annotations

import dataclasses

from drive_rig import PATIENCE, STOPPING_OR_STOPPED, MakeRig, Rig, wait_until
import pytest
from support.said import raises, said

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive import Cause, DriveSettings, drive_state
from nfo_sinus_driver.simulator.sinus_optimal import control_unit

OVERLOAD = 5
#: Bits of the Optimal's Drive Status [M1].
ENABLED, FROM_BUS = 1 << 2, 1 << 9

#: Model, control method, and where the reference comes from.
WAYS = [
    ('sinus_g2', 'mode_scmd', 'fieldbus'),
    ('sinus_g2', 'mode_scmd', 'terminal'),
    ('sinus_g2', 'mode_scmd', 'fix3'),
    ('sinus_g2', 'mode_scmd', 'fix3_reverse'),
    ('sinus_g2', 'drive_control', 'fieldbus'),
    ('sinus_g2', 'drive_control', 'terminal'),
    ('sinus_optimal', 'mode_scmd', 'fieldbus'),
    ('sinus_optimal', 'mode_scmd', 'terminal'),
    ('sinus_optimal', 'drive_control', 'terminal'),
]
pytestmark = pytest.mark.usefixtures('hasty')


@pytest.fixture(params=WAYS, ids=' '.join)
def rig(request: pytest.FixtureRequest, make_rig: MakeRig) -> Rig:
    model, method, reference = request.param
    return make_rig(model=model, control_method=method, reference=reference)


def turn(rig: Rig) -> None:
    """Enable and let it turn, by set-points where they count."""
    rig.connect()
    assert rig.enable().startswith('enabled')
    if rig.drive.settings.follows_setpoints:
        rig.publish(20.0)
    wait_until(lambda: abs(rig.far.motor.frequency) > 10.0)
    rig.wait_until_it_shows()


def test_it_turns_and_stops(rig: Rig) -> None:
    turn(rig)
    reverse = rig.drive.settings.reference.endswith('reverse')
    assert (rig.far.motor.frequency < 0) is reverse
    assert said(rig.drive.stop().result(PATIENCE)).startswith(STOPPING_OR_STOPPED)
    rig.wait_until_still()
    rig.next_snapshots(5)
    assert not rig.far.motor.driven
    assert rig.enable().startswith('enabled')
    wait_until(lambda: rig.far.motor.driven)


def test_quick_stop(rig: Rig) -> None:
    turn(rig)
    answer = said(rig.drive.quick_stop().result(PATIENCE))
    if rig.drive.settings.model == 'sinus_optimal':
        assert 'no quick stop' in answer
    else:
        assert answer == 'released: the motor coasts'
    rig.wait_until_still()
    rig.next_snapshots(5)
    assert not rig.far.motor.driven and not rig.drive.armed
    wait_until(lambda: rig.far.motor.at_zero)
    assert rig.enable().startswith('enabled')


def test_fault_stops_and_nothing_starts_by_itself(rig: Rig) -> None:
    turn(rig)
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    # a set-point that it refuses comes before the status that tells why
    rig.notes.wait_for('fault 5 Overload')
    rig.acknowledged = 1
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 5 Overload'
    wait_until(lambda: not rig.far.faults)
    # a run command that it did not let go of while the fault stood is taken back now
    rig.wait_until_still()
    rig.next_snapshots(5)
    assert not rig.far.motor.driven
    assert rig.enable().startswith('enabled')
    wait_until(lambda: rig.far.motor.driven)


def test_run_input_lost_and_back(rig: Rig) -> None:
    turn(rig)
    rig.simulator.inject('run', False)
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for('RUN input')
    rig.wait_until_still()
    rig.simulator.inject('run', True)
    rig.next_snapshots(5)
    assert not rig.far.motor.driven
    assert rig.enable().startswith('enabled')


def test_without_the_run_input_it_is_not_enabled(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    # what will not happen need not be waited for
    monkeypatch.setattr(drive_state, 'TIMEOUT', 1.0)
    rig.connect()
    rig.simulator.inject('run', False)
    assert 'RUN input' in rig.refused(rig.drive.enable())
    rig.simulator.inject('run', True)
    rig.next_snapshots(5)
    assert not rig.far.motor.driven


def test_release_gives_control_back_and_starts_nothing(rig: Rig) -> None:
    turn(rig)
    answer = said(rig.drive.disconnect(PATIENCE).result(PATIENCE))
    assert answer.startswith('stop')
    wait_until(lambda: rig.far.motor.at_zero)
    assert not rig.far.motor.driven


def test_drive_that_restarts_stays_still(rig: Rig) -> None:
    turn(rig)
    rig.simulator.inject('power-cycle', 0.3)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: rig.drive.snapshot.connected)
    rig.next_snapshots(5)
    assert not rig.far.motor.driven
    assert rig.enable().startswith('enabled')


def test_set_points_are_refused_where_they_do_not_count(rig: Rig) -> None:
    if rig.drive.settings.follows_setpoints:
        pytest.skip('they do here')
    turn(rig)
    with raises(Cause.OWN_REFERENCE):
        rig.drive.set_setpoint(1.0)
    # nobody misses them either
    assert rig.drive.armed


@pytest.mark.parametrize(
    ('real', 'assumed', 'register'),
    [
        ('Speed', '', 'fieldbus.input_speed_setpoint'),
        ('Freque', 'Speed', 'fieldbus.input_freq_setpoint'),
    ],
)
def test_old_set_point_of_a_mode_that_nobody_tells_does_not_turn_the_motor(
    make_rig: MakeRig, real: str, assumed: str, register: str
) -> None:
    rig = make_rig(
        model='sinus_optimal', expected_control_mode=assumed, parameters={'control.mode': real}
    )
    with rig.simulator.lock:
        rig.far.memory.put(register, 300)
    rig.connect()
    assert rig.enable().startswith('enabled')
    assert rig.far.memory.raw(register) == 0
    rig.next_snapshots(10)
    assert rig.far.motor.at_zero


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
def test_stop_is_confirmed_in_a_control_mode_that_no_manual_lists(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    rig = make_rig(control_method=method)
    rig.connect()
    assert rig.enable().startswith('enabled')
    inverter = rig.drive.inverter

    async def read(priority: Priority = Priority.SERVICE, *, once: bool = False) -> str:
        inverter.control_mode = '7'
        return inverter.control_mode

    monkeypatch.setattr(inverter, 'read_control_mode', read)
    wait_until(lambda: not rig.drive.armed)
    assert said(rig.drive.stop().result(PATIENCE)).startswith('stop')
    assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('mode', ['Torque', 'PI-Reg'])
def test_the_optimal_is_expected_in_no_mode_that_it_lacks(mode: str) -> None:
    with pytest.raises(ValueError, match='expected_control_mode'):
        DriveSettings(model='sinus_optimal', expected_control_mode=mode)


# --- the control word of the Optimal --------------------------------------------------------------


def test_each_step_of_the_optimal_is_confirmed_before_the_next(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(control_unit, '_RESPONSE', 0.3)
    rig = make_rig(
        model='sinus_optimal', control_method='drive_control', reference='terminal'
    )
    rig.connect()
    confirmed: list[tuple[int, int]] = []
    write = rig.far.write_raw

    def note(key: str, raw: int) -> None:
        if key == 'fieldbus.drive_control':
            confirmed.append((raw, rig.far.control_unit.status_word & (FROM_BUS | ENABLED)))
        write(key, raw)

    monkeypatch.setattr(rig.far, 'write_raw', note)
    assert rig.enable().startswith('enabled')
    assert confirmed == [
        (0, 0), (0x4000, 0), (0x4008, FROM_BUS), (0x4009, FROM_BUS | ENABLED)
    ]


@pytest.mark.parametrize('key', ['stop', 'start', 'ext'])
def test_optimal_is_enabled_again_after_its_keypad(make_rig: MakeRig, key: str) -> None:
    # the bit that asks for control still stands in its word, and has to rise anew
    rig = make_rig(
        model='sinus_optimal', control_method='drive_control', reference='terminal'
    )
    turn(rig)
    rig.simulator.inject('keypad', key)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    assert rig.enable().startswith('enabled')


def test_optimal_that_stays_under_bus_control_says_so(make_rig: MakeRig) -> None:
    rig = make_rig(model='sinus_optimal', control_method='drive_control', reference='terminal')
    turn(rig)
    answer = rig.drive.disconnect(PATIENCE).result(PATIENCE)
    assert answer.cause is Cause.CONTROL_KEPT
    assert 'the bus keeps control: from the terminals an active RUN input' in said(answer)
    assert rig.far.read_raw('fieldbus.drive_control') == 0x4000
    assert rig.far.control_unit.status_word & FROM_BUS


# --- one method in a session ----------------------------------------------------------------------


@pytest.mark.parametrize(
    'changed',
    [
        {'control_method': 'drive_control'},
        {'reference': 'terminal'},
        {'address': 2},
        {'model': 'sinus_optimal'},
    ],
    ids=lambda changed: next(iter(changed)),
)
def test_method_of_a_session_never_changes(make_rig: MakeRig, changed: dict[str, str]) -> None:
    rig = make_rig()
    with pytest.raises(ValueError, match=f'{next(iter(changed))} cannot change within a session'):
        rig.drive.settings = dataclasses.replace(rig.drive.settings, **changed)
    rig.turn()
    assert rig.drive.settings.method == 'mode_scmd'


@pytest.mark.parametrize(
    ('model', 'reference'), [('sinus_g2', 'fieldbus'), ('sinus_optimal', 'terminal')]
)
def test_another_method_waits_until_the_motor_stands(
    make_rig: MakeRig, model: str, reference: str
) -> None:
    rig = make_rig(model=model, reference=reference, parameters={'control.retard': 60.0})
    turn(rig)
    assert 'left to its ramp' in said(rig.drive.disconnect(0.1).result(PATIENCE))
    message = rig.refused(rig.drive.require_standing())
    assert 'the motor still runs by control_method mode_scmd (40 Bus Ret)' in message
    rig.skip(70.0)
    rig.drive.require_standing().result(PATIENCE)


def test_another_method_need_not_wait_for_who_only_watched(make_rig: MakeRig) -> None:
    rig = make_rig(control_method='monitor')
    rig.simulator.inject('keypad', 'ext')
    rig.connect()
    rig.drive.require_standing().result(PATIENCE)
