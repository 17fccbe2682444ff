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

"""What a set-point is in each control mode, and what happens when the mode changes."""

from __future__ import annotations

from dataclasses import dataclass
import math

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest

from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import poller as watch_module


@dataclass(frozen=True)
class Quantity:
    """
    What one control mode controls.

    :ivar key: where its set-point goes; on the Optimal where it has another place.
    :ivar steps: of the drive in one unit.
    :ivar most: its limit [M2 table 2].
    :ivar nominal: what the simulated motor is made for; 0: nothing says it.
    :ivar value: a set-point that is soon reached.
    """

    unit: str
    key: str
    optimal_key: str
    steps: int
    most: float
    value: float
    nominal: float = 0.0


MODES = {
    'Freque': Quantity(
        'Hz',
        'status.frq_set',
        'fieldbus.input_freq_setpoint',
        steps=10,
        most=150,
        value=20,
        nominal=50,
    ),
    'Speed': Quantity(
        'rpm',
        'status.spd_set',
        'fieldbus.input_speed_setpoint',
        steps=1,
        most=9000,
        value=600,
        nominal=1440,
    ),
    'Torque': Quantity('%', 'status.trq_set', '', steps=1, most=200, value=10, nominal=100),
    'PI-Reg': Quantity('bar', 'status.reg_set', '', steps=10, most=150, value=40),
}
WAYS = [
    *(('sinus_g2', method, mode) for method in ('mode_scmd', 'drive_control') for mode in MODES),
    ('sinus_optimal', 'mode_scmd', 'Freque'),
    ('sinus_optimal', 'mode_scmd', 'Speed'),
]
every_way = pytest.mark.parametrize(('model', 'method', 'mode'), WAYS, ids=map('-'.join, WAYS))

pytestmark = pytest.mark.usefixtures('hasty')


def enabled(make_rig: MakeRig, model: str, method: str, mode: str, **settings: float) -> Rig:
    """An enabled drive in a control mode; the Optimal is only told which."""
    optimal = model == 'sinus_optimal'
    rig = make_rig(
        model=model,
        control_method=method,
        expected_control_mode=mode,
        parameters={'control.mode': mode, **({} if optimal else {'pi_reg.unit': 'bar'})},
        **settings,
    )
    rig.connect()
    assert rig.enable().startswith('enabled')
    return rig


def written(rig: Rig, mode: str) -> float:
    """What stands in the drive, in the unit of the mode."""
    quantity = MODES[mode]
    optimal = rig.drive.settings.model == 'sinus_optimal'
    raw = rig.far.memory.raw(quantity.optimal_key if optimal else quantity.key)
    return raw / quantity.steps


def facts(rig: Rig) -> Fact:
    status = rig.drive.snapshot.status
    return Fact(0) if status is None else status.facts


@every_way
def test_unit_sign_and_reached(make_rig: MakeRig, model: str, method: str, mode: str) -> None:
    rig = enabled(make_rig, model, method, mode)
    for value in (MODES[mode].value, -MODES[mode].value):
        follow(rig, mode, value)


def follow(rig: Rig, mode: str, value: float) -> None:
    with rig.simulator.lock:
        # so slow that it is seen on its way
        rig.far.memory.set('control.accel', 20.0)
    rig.publish(value)
    wait_until(lambda: written(rig, mode) == value)
    wait_until(lambda: rig.drive.snapshot.setpoint == value)
    rig.next_snapshots(2)
    if mode != 'Torque':
        # a torque is there at once, a speed needs its ramp
        assert Fact.SETPOINT_REACHED not in facts(rig)
    with rig.simulator.lock:
        rig.far.memory.set('control.accel', 0.2)
    wait_until(lambda: Fact.SETPOINT_REACHED in facts(rig))
    turns = rig.far.motor.torque if mode == 'Torque' else rig.far.motor.frequency
    assert turns * value > 0
    # the actual value has the unit of the set-point; the simulated process has no sign
    actual = abs(value) if mode == 'PI-Reg' else value
    wait_until(lambda: rig.drive.snapshot.actual == pytest.approx(actual, rel=0.07, abs=1.0))
    told = rig.drive.snapshot
    assert (told.control_mode, told.unit) == (mode, MODES[mode].unit)
    assert not told.setpoint_clamped


@pytest.mark.parametrize('ends', [(0.0, 1000.0), (1000.0, 0.0), (-50.0, 400.0), (0.0, 0.0)])
def test_a_process_set_point_lies_between_setmin_and_setmax(make_rig: MakeRig, ends) -> None:
    # in the unit of the process, such as 400 kPa [C113]
    setmin, setmax = ends
    rig = make_rig(
        parameters={
            'control.mode': 'PI-Reg',
            'pi_reg.unit': 'kPa',
            'pi_reg.setmin': setmin,
            'pi_reg.setmax': setmax,
        }
    )
    rig.connect()
    rig.enable()
    low, high = sorted(ends) if setmin != setmax else (-2000.0, 2000.0)
    for value in (400.0, high + 100.0, low - 100.0):
        rig.drive.set_setpoint(value)
        limited = max(low, min(high, value))
        wait_until(lambda limited=limited: rig.far.memory.number('status.reg_set') == limited)
        wait_until(
            lambda value=value, limited=limited: rig.drive.snapshot.setpoint == limited
            and rig.drive.snapshot.setpoint_clamped == (value != limited)
        )


def test_setpoint_max_is_kept_where_it_is_less_than_the_drive_takes(make_rig: MakeRig) -> None:
    rig = make_rig(
        parameters={'control.mode': 'PI-Reg', 'pi_reg.setmin': 100.0, 'pi_reg.setmax': 400.0},
        setpoint_max=50.0,
    )
    rig.connect()
    rig.enable()
    rig.drive.set_setpoint(80.0)
    wait_until(lambda: rig.drive.snapshot.setpoint_clamped)
    assert rig.drive.snapshot.setpoint == 50.0


@every_way
@pytest.mark.parametrize('most', ['nominal', 'less', 'the_drive'])
def test_limits(make_rig: MakeRig, model: str, method: str, mode: str, most: str) -> None:
    quantity = MODES[mode]
    # an Optimal tells no nominal value, and no process has any
    nominal = quantity.nominal if model == 'sinus_g2' and quantity.nominal else quantity.most
    limits = {'nominal': nominal, 'less': quantity.value / 2, 'the_drive': quantity.most}
    limit = limits[most]
    given = {'nominal': 0.0, 'less': limit, 'the_drive': 2 * limit}[most]
    rig = enabled(make_rig, model, method, mode, setpoint_max=given)
    for sign in (1.0, -1.0):
        rig.publish(sign * 1e6)
        wait_until(lambda given=sign * limit: rig.drive.snapshot.setpoint == given)
        assert rig.drive.snapshot.setpoint_clamped
        assert written(rig, mode) == sign * limit
    rig.publish(limit)
    wait_until(lambda: rig.drive.snapshot.setpoint == limit)
    assert not rig.drive.snapshot.setpoint_clamped
    texts = [text for _, text in rig.notes.events if 'is limited to' in text]
    assert len(texts) == 1, texts


# --- the control mode changes ---------------------------------------------------------------------


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
@pytest.mark.parametrize(
    ('before', 'after'),
    [('Freque', 'Speed'), ('Speed', 'Torque'), ('Torque', 'PI-Reg'), ('PI-Reg', 'Freque')],
    ids='-'.join,
)
def test_mode_that_is_changed_at_the_keypad_disarms(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch, method: str, before: str, after: str
) -> None:
    monkeypatch.setattr(watch_module, '_MODE_PERIOD', 0.02)
    rig = enabled(make_rig, 'sinus_g2', method, before)
    rig.publish(MODES[before].value)
    wait_until(lambda: rig.drive.snapshot.setpoint == MODES[before].value)
    with rig.simulator.lock:
        rig.far.set_from_keypad('control.mode', after)
        first = len(rig.notes.snapshots)
    wait_until(lambda: rig.drive.snapshot.control_mode == after)
    rig.wait_until_still()
    told = [one for one in rig.notes.snapshots[first:] if one.control_mode == after]
    # everywhere at once: no set-point of the one mode ever has the unit of the other
    assert {one.unit for one in told} == {MODES[after].unit}
    assert not any(one.enabled for one in told)
    assert all(math.isnan(one.setpoint) for one in told)
    texts = [text for _, text in rig.notes.events if 'control mode' in text]
    assert len(texts) == 1
    assert f'the control mode was changed to {after} at the drive' in texts[0]
    assert f'set-points are in {MODES[after].unit} now: check what sends them' in texts[0]
    assert texts[0].endswith('call ~/enable to go on')
    # what it was enabled for does not hold any more
    message = rig.refused(rig.drive.enable())
    assert message.startswith(f'the drive is in control mode {after}, expected is {before}')


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
def test_mode_that_we_change_has_its_unit_at_once(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    monkeypatch.setattr(watch_module, '_MODE_PERIOD', 3600.0)
    rig = make_rig(control_method=method)
    rig.drive.connect(parameters=True).result(PATIENCE)
    rig.drive.activate()
    rig.enable()
    # a motor that is enabled is driven, and a drive changes its mode at standstill only
    refusal = rig.refused(rig.drive.parameters.change({'control.mode': 'Speed'}))
    assert 'control.mode' in refusal
    assert rig.drive.armed
    rig.drive.stop().result(PATIENCE)
    wait_until(lambda: not rig.far.motor.voltage_on)
    rig.next_snapshots(2)
    rig.drive.parameters.change({'control.mode': 'Speed'}).result(PATIENCE)
    before = len(rig.notes.snapshots)
    wait_until(lambda: rig.drive.snapshot.unit == 'rpm')
    assert len(rig.notes.snapshots) - before <= 2
    rig.enable()
    rig.publish(300.0)
    wait_until(lambda: written(rig, 'Speed') == 300.0)
    assert rig.far.memory.raw('status.frq_set') == 0


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
@pytest.mark.parametrize('mode', MODES)
def test_expected_control_mode_guards_enable(
    make_rig: MakeRig, method: str, mode: str
) -> None:
    # nothing tells that of an Optimal [C58]
    rig = make_rig(
        control_method=method, expected_control_mode=mode, parameters={'control.mode': mode}
    )
    rig.connect()
    assert rig.enable().startswith('enabled')
    rig.drive.stop().result(PATIENCE)
    other = 'Speed' if mode == 'Freque' else 'Freque'
    rig.drive.settings = DriveSettings(control_method=method, expected_control_mode=other)
    assert f'expected is {other}' in rig.refused(rig.drive.enable())
    assert not rig.drive.armed


def test_newest_set_point_counts(make_rig: MakeRig) -> None:
    # whoever sends it; which ones are valid the node decides
    rig = enabled(make_rig, 'sinus_g2', 'mode_scmd', 'Freque')
    for value in (10.0, 30.0, 20.0):
        rig.drive.set_setpoint(value)
    with pytest.raises(ValueError, match='is no number'):
        rig.drive.set_setpoint(math.nan)
    rig.wait_for_frequency(20.0)
    wait_until(lambda: rig.drive.snapshot.setpoint == 20.0)
    assert not rig.notes.told(Cause.SETPOINT_LIMITED, Severity.WARNING)
