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

"""What is not changed as a parameter, and what is only under conditions."""

from __future__ import annotations

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
from parameters_rig import Store
from parameters_rig import at_keypad
from parameters_rig import connect
from parameters_rig import far
from parameters_rig import on_write
from parameters_rig import written
import pytest
from support.said import raises
from support.said import said

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive.parameter_writer import ParameterError


@pytest.mark.parametrize(
    'key',
    [
        'fieldbus.scmd', 'fieldbus.mode', 'fieldbus.drive_control', 'fieldbus.setpoint',
        'fieldbus.drv_ctrl_write_mask', 'fieldbus.inv_st_with_ack', 'fieldbus.inv_st',
        'fieldbus.spd_scl_numerator', 'fieldbus.spd_scl_denominator', 'status.frq_set',
        'status.frq_act', 'control.any_bus', 'nobody.knows', '',
    ],
)  # fmt: skip
def test_what_is_no_setting_cannot_be_changed(make_rig: MakeRig, key: str) -> None:
    rig = make_rig(allow_communication_changes=True)
    parameters = connect(rig)
    commands = dict(rig.far.command_writes)
    message = rig.refused(parameters.change({'control.accel': 7, key: 1}))
    assert message == f'{key} is no parameter that can be changed here'
    assert written(rig) == {}
    assert dict(rig.far.command_writes) == commands


@pytest.mark.parametrize(
    ('key', 'value'),
    [
        ('serial.address', 9), ('serial.si_baud', '9600bps'), ('serial.bus_type', 'NFO'),
        ('serial.si_prot', '8b Op 1s'), ('serial.sio_tot', 9), ('serial.auto_reset', True),
    ],
)  # fmt: skip
def test_settings_of_the_line_are_guarded(rig: Rig, key: str, value: Value) -> None:
    parameters = connect(rig)
    message = rig.refused(parameters.change({'control.accel': 7, key: value}))
    assert message.startswith(f'{key}: communication settings are not changed unless allow_')
    with raises(Cause.COMMUNICATION_PROTECTED):
        parameters.admit(key, value)
    assert written(rig) == {}
    # a saved state of the same drive loads all the same
    same = {key: parameters.values[key], 'control.accel': 7}
    parameters.change(same).result(PATIENCE)
    assert written(rig) == {'control.accel': 1}


def test_settings_of_the_line_when_allowed(make_rig: MakeRig) -> None:
    rig = make_rig(allow_communication_changes=True)
    parameters = connect(rig)
    wanted: dict[str, Value] = {
        'serial.address': 9,
        'serial.si_prot': '8b Op 1s',
        'serial.si_baud': '9600bps',
        'control.accel': 7,
    }
    changes = parameters.change(wanted).result(PATIENCE)
    # what may cut the line comes last
    assert changes[0].key == 'control.accel'
    assert far(rig, *wanted) == list(wanted.values())
    hint = 'then start this driver with the address (9) and char_format (8b Op 1s) and baud_rate'
    rig.notes.wait_for(hint, Severity.WARNING)


def test_new_address_that_counts_at_once(make_rig: MakeRig) -> None:
    rig = make_rig(
        parameters={'serial.auto_reset': True},
        allow_communication_changes=True,
        retries=1,
    )
    parameters = connect(rig)
    with pytest.raises(ParameterError) as error:
        parameters.change({'serial.address': 9, 'control.accel': 7}).result(PATIENCE)
    message = said(error.value)
    assert message.startswith('serial.address: ')
    assert 'whether the drive took 9 is not known' in message
    assert 'serial.address is NOT put back to 1' in message
    assert 'control.accel is NOT put back to 0.2 s' in message
    assert 'then start this driver with the address (9) that it has' in message
    assert set(error.value.left) == {'serial.address', 'control.accel'}


def test_hint_only_when_the_line_may_have_changed(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make_rig(allow_communication_changes=True)
    parameters = connect(rig)

    def keep(write: Store, key: str, raw: int) -> None:
        if key != 'control.accel':
            write(key, raw)

    on_write(rig, monkeypatch, keep)
    message = rig.refused(parameters.change({'serial.address': 9, 'control.accel': 7}))
    assert 'start this driver' not in message
    assert written(rig) == {}


@pytest.mark.parametrize(('firmware', 'known'), [(4.27, False), (4.28, True)])
def test_format_codes_of_older_firmware(make_rig: MakeRig, firmware: float, known: bool) -> None:
    rig = make_rig(parameters={'fieldbus.sw_ver': firmware}, allow_communication_changes=True)
    change = connect(rig).change({'serial.si_prot': '8b Op 1s', 'serial.sio_tot': 9})
    if known:
        assert len(change.result(PATIENCE)) == 2
    else:
        assert 'change it at the keypad' in rig.refused(change)
        assert written(rig) == {}


def test_running_motor(rig: Rig) -> None:
    parameters = connect(rig)
    rig.enable()
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    message = rig.refused(parameters.change({'control.retard': 7, 'motor.i_magn': 2.0}))
    assert message.startswith('motor.i_magn: only while the motor is stopped, but it is not (')
    assert written(rig) == {}
    # what is the same needs no stop
    parameters.change({'control.retard': 7, 'motor.i_magn': 1.8}).result(PATIENCE)
    assert written(rig) == {'control.retard': 1}
    assert rig.far.motor.driven
    rig.stop_publishing()
    rig.drive.stop().result(PATIENCE)
    wait_until(lambda: rig.drive.snapshot.status and not rig.drive.snapshot.status.driven)
    parameters.change({'motor.i_magn': 2.0}).result(PATIENCE)
    assert far(rig, 'motor.i_magn') == [2.0]


@pytest.mark.parametrize('method', ['mode_scmd', 'monitor'])
def test_guard_against_what_is_no_longer_so(make_rig: MakeRig, method: str) -> None:
    # it is let through because the drive has it, as last read, but nothing is written
    rig = make_rig(control_method=method)
    parameters = connect(rig)
    parameters._keys = ()
    key = 'serial.sio_tot' if method == 'mode_scmd' else 'control.accel'
    old = parameters.values[key]
    at_keypad(rig, key, 9)
    assert parameters.change({key: old}).result(PATIENCE) == ()
    assert far(rig, key) == [9]
    assert written(rig) == {}
