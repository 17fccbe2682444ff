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

"""Parameters are read and watched, and nothing of that writes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from drive_rig import PATIENCE
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
from parameters_rig import SILENCE
from parameters_rig import at_keypad
from parameters_rig import connect
from parameters_rig import far
from parameters_rig import news
from parameters_rig import on_read
from parameters_rig import only_read
from parameters_rig import put_raw
from parameters_rig import watch_only
from parameters_rig import written
import pytest
from support.said import raises
from support.said import said

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import parameters as parameters_module
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused


@pytest.fixture
def busy_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a round of reading take no longer than it must."""
    monkeypatch.setattr(parameters_module, '_ROUND', 0.0)
    monkeypatch.setattr(parameters_module, '_WAIT', 0.01)


# --- the first reading ----------------------------------------------------------------------------


def test_all_are_read_and_nothing_is_written(rig: Rig) -> None:
    parameters = rig.drive.parameters
    assert parameters.progress == 'not read'
    connect(rig)
    # any_bus of the manual's 120 has no register
    assert len(parameters.values) == 119
    assert 'control.any_bus' not in parameters.values
    assert list(parameters.values.values()) == far(rig, *parameters.values)
    assert parameters.progress == '119 read'
    assert set(rig.notes.news) == set(parameters.values)
    rig.notes.wait_for('parameters: 119 read in ', Severity.INFO)
    assert not news(rig)
    parameters.refresh().result(PATIENCE)
    rig.next_snapshots()
    assert written(rig) == {}
    assert only_read(rig)


def test_progress(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parameters_module, '_PROGRESS', 0.0)
    seen: list[str] = []
    on_read(rig, monkeypatch, lambda key: seen.append(rig.drive.parameters.progress))
    connect(rig)
    assert '60 of 119 read' in seen
    rig.notes.wait_for('parameters: 60 of 119 read', Severity.INFO)


def test_older_firmware_lacks_what_came_later(make_rig: MakeRig) -> None:
    newest = 'error.short_c_err_cnt'
    rig = make_rig(parameters={'fieldbus.sw_ver': 4.31})
    assert newest not in connect(rig).values
    assert len(rig.drive.parameters.values) == 118


def test_firmware_that_has_it_since_just_then(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'fieldbus.sw_ver': 4.32})
    assert 'error.short_c_err_cnt' in connect(rig).values


def test_one_that_the_drive_does_not_show_is_not_there(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, busy_watch: None
) -> None:
    asked: list[str] = []

    def refuse(key: str) -> None:
        if key == 'freque.f_fix1':
            asked.append(key)
            raise Refused(Reason.ADDRESS, 'no such thing')

    on_read(rig, monkeypatch, refuse)
    parameters = connect(rig)
    assert len(parameters.values) == 118
    assert 'freque.f_fix1' not in parameters.values
    told = [text for _, text in rig.notes.events if text.startswith('freque.f_fix1 cannot be read')]
    assert len(told) == 1
    assert 'the drive has no such parameter' in told[0]
    before = len(asked)
    at_keypad(rig, 'control.accel', 9)
    wait_until(lambda: parameters.values['control.accel'] == 9)
    assert len(asked) == before
    message = rig.refused(parameters.change({'freque.f_fix1': 7}))
    assert message == 'freque.f_fix1: the drive has no such parameter (exception 2)'


def test_what_needs_option_cards_is_told_in_one(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    cards = {'freque.f_fix1': 'X1', 'freque.f_fix2': 'X1', 'control.accel': 'Y or Z'}
    model = rig.drive.inverter.model
    for key, card in cards.items():
        monkeypatch.setitem(model.parameters, key, replace(model[key], option=card))  # type: ignore[arg-type]

    def refuse(key: str) -> None:
        if key in cards:
            raise Refused(Reason.ADDRESS, 'no such thing')

    on_read(rig, monkeypatch, refuse)
    assert len(connect(rig).values) == 116
    assert not rig.notes.told(Cause.SETTING_UNREADABLE)
    rig.notes.wait_for(
        'parameters: 3 are left out, for the drive has none of the option cards that they need '
        '(Y or Z, X1)',
        Severity.INFO,
    )


@pytest.mark.parametrize('reason', [Reason.ADDRESS, Reason.VALUE, Reason.STATE])
def test_drive_that_refuses_every_third_request(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, reason: Reason
) -> None:
    count = iter(range(10**9))

    def refuse(key: str) -> None:
        if rig.drive.parameters._unread and next(count) % 3 == 2:
            raise Refused(reason, 'every third')

    on_read(rig, monkeypatch, refuse)
    parameters = connect(rig)
    assert list(parameters.values.values()) == far(rig, *parameters.values)
    assert parameters.progress == '119 read'
    assert not rig.notes.told(Cause.SETTING_UNREADABLE)


def test_switch_that_is_neither_on_nor_off(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, busy_watch: None
) -> None:
    put_raw(rig, 'serial.auto_stop', 2)
    parameters = connect(rig)
    assert 'serial.auto_stop' not in parameters.values
    rig.notes.wait_for('serial.auto_stop: the drive has code 2', Severity.WARNING)
    at_keypad(rig, 'serial.auto_stop', True)
    wait_until(lambda: parameters.values.get('serial.auto_stop') is True)
    wait_until(lambda: rig.drive.inverter.timeout.stops_motor)
    # nobody relies on a value that is gone
    put_raw(rig, 'serial.auto_stop', 2)
    wait_until(lambda: 'serial.auto_stop' not in parameters.values)
    wait_until(lambda: not rig.drive.inverter.timeout.stops_motor)
    told = [text for _, text in rig.notes.events if 'has code 2' in text]
    assert len(told) == 2


def test_switch_that_is_neither_can_be_set(rig: Rig) -> None:
    put_raw(rig, 'control.energy_save', 2)
    parameters = connect(rig)
    (change,) = parameters.change({'control.energy_save': True}).result(PATIENCE)
    assert str(change) == 'control.energy_save: 0002h -> true'
    assert parameters.values['control.energy_save'] is True
    assert far(rig, 'control.energy_save') == [True]


def test_drive_that_disappears_while_it_is_read(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make_rig(retries=1)
    asked: list[str] = []

    def vanish(key: str) -> None:
        asked.append(key)
        if len(asked) == 60:
            rig.far.silence(SILENCE)

    on_read(rig, monkeypatch, vanish)
    parameters = rig.drive.parameters
    assert 'did not answer' in rig.refused(rig.drive.connect(parameters=True))
    assert parameters.values == {}
    assert parameters.progress == 'not read'
    with rig.simulator.lock:
        rig.far.silence(0)
    connect(rig)
    assert parameters.progress == '119 read'
    assert list(parameters.values.values()) == far(rig, *parameters.values)
    assert not news(rig)
    assert written(rig) == {}


def test_reading_anew_does_not_end_the_watch(rig: Rig, busy_watch: None) -> None:
    parameters = connect(rig)
    for _ in range(3):
        parameters.read().result(PATIENCE)
    at_keypad(rig, 'control.accel', 9)
    wait_until(lambda: parameters.values.get('control.accel') == 9)


# --- the watch ------------------------------------------------------------------------------------


def test_change_at_the_keypad_shows_within_a_round_and_is_told_once(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, busy_watch: None
) -> None:
    parameters = connect(rig)
    rounds: list[str] = []
    on_read(rig, monkeypatch, rounds.append)
    at_keypad(rig, 'freque.f_fix1', 12.5)
    before = len(rounds)
    wait_until(lambda: parameters.values['freque.f_fix1'] == 12.5)
    # those of the poll count too, but that reads only the control mode
    assert len([key for key in rounds[before:] if key != 'control.mode']) <= 119 + 2
    after = len(rounds)
    wait_until(lambda: len(rounds) >= after + 2 * 119)
    assert news(rig) == ['changed at the drive: freque.f_fix1: 10 -> 12.5 Hz']
    assert rig.notes.news.count('freque.f_fix1') == 2
    assert written(rig) == {}


def test_refresh_says_what_has_changed(rig: Rig) -> None:
    parameters = connect(rig)
    rig.drive.parameters._keys = tuple(parameters.values)
    answer = said(parameters.refresh().result(PATIENCE))
    assert answer == '119 parameters read, changed: none'
    at_keypad(rig, 'control.accel', 9)
    at_keypad(rig, 'control.st_mode', 'Release')
    answer = said(parameters.refresh().result(PATIENCE))
    assert answer == '119 parameters read, changed: control.accel, control.st_mode'
    assert parameters.values['control.st_mode'] == 'Release'


def test_refresh_of_a_drive_that_refuses_one(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)

    def refuse(key: str) -> None:
        if key == 'control.accel':
            raise Refused(Reason.STATE, 'not now')

    on_read(rig, monkeypatch, refuse)
    at_keypad(rig, 'control.accel', 9)
    at_keypad(rig, 'control.retard', 9)
    answer = said(parameters.refresh().result(PATIENCE))
    assert answer == '119 parameters read, changed: control.retard'
    assert not rig.notes.told(Cause.SETTING_UNREADABLE)


def test_watch_goes_on_when_the_drive_is_back(
    make_rig: MakeRig, busy_watch: None, hasty: None
) -> None:
    rig = make_rig(retries=1)
    parameters = connect(rig)
    with rig.simulator.lock:
        rig.far.silence(SILENCE)
    rig.notes.wait_for('lost: ', Severity.ERROR)
    with rig.simulator.lock:
        rig.far.silence(0)
    at_keypad(rig, 'control.accel', 9)
    wait_until(lambda: parameters.values['control.accel'] == 9)
    assert len(news(rig)) == 1


def test_listener_that_fails_does_not_end_the_watch(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    parameters = connect(rig)
    watch_only(rig, monkeypatch, 'control.accel', 'control.retard')

    def fail(keys: Any) -> None:
        raise RuntimeError('a mistake of who listens')

    monkeypatch.setattr(rig.notes, 'on_parameters', fail)
    at_keypad(rig, 'control.accel', 9)
    wait_until(lambda: parameters.values['control.accel'] == 9)
    at_keypad(rig, 'control.retard', 9)
    wait_until(lambda: parameters.values['control.retard'] == 9)
    assert 'a mistake of who listens' in caplog.text


@pytest.mark.parametrize('auto', [True, False])
def test_time_out_of_the_drive_reaches_the_keeping_alive(
    rig: Rig, busy_watch: None, auto: bool
) -> None:
    parameters = connect(rig)
    inverter = rig.drive.inverter
    at_keypad(rig, 'serial.sio_tot', 5)
    at_keypad(rig, 'serial.auto_stop', auto)
    wait_until(lambda: inverter.timeout.seconds == 5 and inverter.timeout.stops_motor is auto)
    rig.drive.set_drive_timeout(7).result(PATIENCE)
    assert inverter.timeout.seconds == 7
    assert inverter.timeout.stops_motor
    assert parameters.values['serial.sio_tot'] == 7
    assert far(rig, 'serial.sio_tot', 'serial.auto_stop') == [7, True]


def test_time_out_set_as_a_parameter_reaches_the_keeping_alive(make_rig: MakeRig) -> None:
    rig = make_rig(allow_communication_changes=True)
    connect(rig).change({'serial.sio_tot': 3, 'serial.auto_stop': True}).result(PATIENCE)
    assert rig.drive.inverter.timeout.seconds == 3
    assert rig.drive.inverter.timeout.stops_motor


@pytest.mark.parametrize(
    'error', [DriveError(Cause.NOT_ACTIVE), RuntimeError('a mistake')]
)
def test_a_first_reading_that_fails_leaves_nothing_connected(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    async def fail() -> None:
        raise error

    monkeypatch.setattr(rig.drive.parameters, 'read_now', fail)
    with pytest.raises(type(error)):
        rig.drive.connect(parameters=True).result(PATIENCE)
    with raises(Cause.NOT_CONNECTED):
        rig.drive.acknowledge().result(PATIENCE)
    monkeypatch.undo()
    assert connect(rig).values
