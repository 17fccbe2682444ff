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

"""A wanted state is brought about, or reported, and drifts are told and left."""

from __future__ import annotations

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
from parameters_rig import at_keypad
from parameters_rig import connect
from parameters_rig import far
from parameters_rig import news
from parameters_rig import only_read
from parameters_rig import put_raw
from parameters_rig import watch_only
from parameters_rig import written
import pytest

from nfo_sinus_driver.drive import Severity


def drifts(rig: Rig) -> list[str]:
    return [text for _, text in rig.notes.events if 'was asked for: it is left so' in text]


def test_wanted_state_is_written_where_it_differs(rig: Rig) -> None:
    parameters = connect(rig)
    wanted = {'control.accel': 7, 'control.retard': 0.2, 'control.st_mode': 'Release'}
    parameters.apply(wanted, write=True).result(PATIENCE)
    assert written(rig) == {'control.accel': 1, 'control.st_mode': 1}
    assert far(rig, *wanted) == [7, 0.2, 'Release']
    assert parameters.drift == ()
    text = 'control.accel: 0.2 -> 7 s, as the parameter file says'
    rig.notes.wait_for(text, Severity.INFO)
    assert not rig.notes.told('control.retard')
    parameters.apply(wanted, write=True).result(PATIENCE)
    assert sum(written(rig).values()) == 2


@pytest.mark.parametrize('method', ['mode_scmd', 'monitor'])
def test_wanted_state_is_only_reported(make_rig: MakeRig, method: str) -> None:
    rig = make_rig(control_method=method)
    parameters = connect(rig)
    parameters.apply({'control.accel': 7}, write=False).result(PATIENCE)
    assert [str(drift) for drift in parameters.drift] == ['control.accel: 7 -> 0.2 s']
    assert drifts(rig) == [
        'control.accel is 0.2 s in the drive, but 7 was asked for: it is left so'
    ]
    assert written(rig) == {}


def test_monitor_writes_nothing(make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig = make_rig(control_method='monitor', allow_communication_changes=True)
    parameters = connect(rig)
    for key, value in (('control.accel', 7), ('serial.sio_tot', 7)):
        assert 'this driver only reads' in rig.refused(parameters.change({key: value}))
    parameters.apply({'control.accel': 7}, write=True).result(PATIENCE)
    rig.notes.wait_for('not applied from the parameter file: control.accel', Severity.ERROR)
    assert parameters.drift
    # what it has already is no change
    assert parameters.change({'control.accel': 0.2}).result(PATIENCE) == ()
    parameters.refresh().result(PATIENCE)
    watch_only(rig, monkeypatch, 'control.accel')
    at_keypad(rig, 'control.accel', 7)
    wait_until(lambda: not parameters.drift)
    assert only_read(rig)


def test_drift_is_told_once_and_not_reverted(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    parameters.apply({'control.accel': 7}, write=True).result(PATIENCE)
    watch_only(rig, monkeypatch, 'control.accel', 'control.retard')
    at_keypad(rig, 'control.accel', 9)
    wait_until(lambda: drifts(rig))
    assert drifts(rig) == ['control.accel is 9 s in the drive, but 7 was asked for: it is left so']
    assert [str(drift) for drift in parameters.drift] == ['control.accel: 7 -> 9 s']
    at_keypad(rig, 'control.retard', 9)
    wait_until(lambda: parameters.values['control.retard'] == 9)
    assert far(rig, 'control.accel') == [9]
    assert len(drifts(rig)) == 1
    assert len(news(rig)) == 1
    # who sets it through the driver wants that from now on
    parameters.change({'control.accel': 8}).result(PATIENCE)
    assert parameters.drift == ()
    at_keypad(rig, 'control.accel', 9)
    wait_until(lambda: len(drifts(rig)) == 2)
    at_keypad(rig, 'control.accel', 8)
    wait_until(lambda: not parameters.drift)
    assert written(rig) == {'control.accel': 2}


def test_drift_to_what_means_nothing(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    parameters.apply({'control.energy_save': True}, write=True).result(PATIENCE)
    watch_only(rig, monkeypatch, 'control.energy_save')
    put_raw(rig, 'control.energy_save', 2)
    wait_until(lambda: parameters.drift)
    assert [str(drift) for drift in parameters.drift] == ['control.energy_save: true -> 0002h']


def test_wanted_switch_that_is_neither_is_written(rig: Rig) -> None:
    put_raw(rig, 'control.energy_save', 2)
    connect(rig).apply({'control.energy_save': False}, write=True).result(PATIENCE)
    assert far(rig, 'control.energy_save') == [False]


def test_wanted_state_with_what_this_drive_lacks(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'fieldbus.sw_ver': 4.31})
    parameters = connect(rig)
    wanted = {'error.short_c_err_cnt': 1, 'control.any_bus': 1, 'control.accel': 7}
    parameters.apply(wanted, write=True).result(PATIENCE)
    text = 'this drive has no error.short_c_err_cnt, control.any_bus: not applied'
    rig.notes.wait_for(text, Severity.WARNING)
    assert written(rig) == {'control.accel': 1}


def test_wanted_state_that_no_drive_can_have_changes_nothing(rig: Rig) -> None:
    parameters = connect(rig)
    message = rig.refused(parameters.apply({'control.accel': 7, 'control.retard': -1}, write=True))
    assert message.startswith('control.retard: -1 is out of range')
    assert written(rig) == {}


def test_wanted_state_that_the_drive_refuses_in_part(rig: Rig) -> None:
    rig.far.set_run_input(True)
    parameters = connect(rig)
    rig.enable()
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    wanted = {'motor.i_magn': 2.0, 'control.retard': 7}
    parameters.apply(wanted, write=True).result(PATIENCE)
    assert written(rig) == {'control.retard': 1}
    assert [drift.key for drift in parameters.drift] == ['motor.i_magn']
    text = 'not applied from the parameter file: motor.i_magn: only while the motor is stopped'
    assert sum(text in told for _, told in rig.notes.events) == 1
