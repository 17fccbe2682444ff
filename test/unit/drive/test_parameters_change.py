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

"""A parameter is written if it differs, read back, and left alone where it must be."""

from __future__ import annotations

import struct
import threading

from drive_rig import PATIENCE
from drive_rig import Rig
from drive_rig import wait_until
from parameters_rig import ACCEL
from parameters_rig import Store
from parameters_rig import at_keypad
from parameters_rig import bound_magn_by_limt
from parameters_rig import connect
from parameters_rig import far
from parameters_rig import news
from parameters_rig import on_write
from parameters_rig import watch_only
from parameters_rig import written
import pytest
from support.said import said

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive.parameter_writer import ParameterError


def register(rig: Rig, key: str) -> int:
    return rig.drive.parameters._registers.address(key).index


# --- what is written ------------------------------------------------------------------------------


def test_change_is_written_once_and_read_back(rig: Rig) -> None:
    parameters = connect(rig)
    before = len(rig.trace())
    (change,) = parameters.change({'control.accel': 7.5}).result(PATIENCE)
    assert str(change) == f'control.accel: {ACCEL} -> 7.5 s'
    assert written(rig) == {'control.accel': 1}
    assert far(rig, 'control.accel') == [7.5]
    assert parameters.values['control.accel'] == 7.5
    assert rig.notes.news[-1] == 'control.accel'
    rig.notes.wait_for('control.accel: 0.2 -> 7.5 s', Severity.INFO)
    assert not news(rig)
    own = f'{register(rig, "control.accel"):04x}'
    frames = [frame['hex'].lower() for frame in rig.trace()[before:]]
    requests = [frame[2:4] for frame in frames if frame[4:8] == own]
    # read, write and its answer, read
    assert [code for code in requests if code == '03'] == ['03', '03']
    assert requests[0] == requests[-1] == '03'


def test_what_is_the_same_is_not_written(rig: Rig) -> None:
    parameters = connect(rig)
    same = {'control.accel': ACCEL, 'motor.i_magn': 1.8, 'control.st_mode': 'Brake'}
    assert parameters.change(same).result(PATIENCE) == ()
    (change,) = parameters.change({**same, 'control.retard': 7}).result(PATIENCE)
    assert change.key == 'control.retard'
    assert written(rig) == {'control.retard': 1}
    assert parameters.change({}).result(PATIENCE) == ()


def test_what_the_keypad_did_already_is_not_written_but_known(rig: Rig) -> None:
    parameters = connect(rig)
    rig.drive.parameters._keys = ()
    at_keypad(rig, 'control.accel', 7)
    assert parameters.change({'control.accel': 7}).result(PATIENCE) == ()
    assert written(rig) == {}
    assert parameters.values['control.accel'] == 7


def test_what_the_keypad_undid_is_written(rig: Rig) -> None:
    # only what the drive has counts, not what is remembered
    parameters = connect(rig)
    rig.drive.parameters._keys = ()
    parameters.change({'control.accel': 7}).result(PATIENCE)
    at_keypad(rig, 'control.accel', 9)
    (change,) = parameters.change({'control.accel': 7}).result(PATIENCE)
    assert str(change) == 'control.accel: 9 -> 7 s'
    assert far(rig, 'control.accel') == [7]


def test_old_value_that_means_nothing(rig: Rig) -> None:
    parameters = connect(rig)
    with rig.simulator.lock:
        rig.far.memory.put('control.st_mode', 9)
    (change,) = parameters.change({'control.st_mode': 'Release'}).result(PATIENCE)
    assert str(change) == 'control.st_mode: 9 -> Release'


@pytest.mark.parametrize('value', [0.7, 7.7, 123.4, 499.9])
def test_float32_renderings_are_taken(rig: Rig, value: float) -> None:
    rendered = struct.unpack('<f', struct.pack('<f', value))[0]
    assert rendered != value
    parameters = connect(rig)
    parameters.change({'control.accel': rendered}).result(PATIENCE)
    assert parameters.values['control.accel'] == value
    assert far(rig, 'control.accel') == [value]
    assert parameters.change({'control.accel': value}).result(PATIENCE) == ()


@pytest.mark.parametrize('value', [7, 7.0])
def test_whole_numbers_are_taken_for_any_other(rig: Rig, value: float) -> None:
    parameters = connect(rig)
    parameters.change({'control.accel': value, 'motor.u_nom': 100 * value}).result(PATIENCE)
    assert far(rig, 'control.accel', 'motor.u_nom') == [7, 700]
    assert type(parameters.values['control.accel']) is float
    assert type(parameters.values['motor.u_nom']) is int


def test_switches_labels_and_signs(rig: Rig) -> None:
    parameters = connect(rig)
    wanted: dict[str, Value] = {
        'control.energy_save': True,
        'control.mode': 'Speed',
        'pi_reg.reg_amp': 1,
    }
    parameters.change(wanted).result(PATIENCE)
    assert far(rig, *wanted) == list(wanted.values())
    parameters.change({'pi_reg.reg_amp': -1}).result(PATIENCE)
    assert far(rig, 'pi_reg.reg_amp') == [-1]


# --- what is refused without asking the drive -----------------------------------------------------


@pytest.mark.parametrize(
    ('key', 'value', 'says'),
    [
        (
            'control.accel', 7.123456,
            'control.accel: 7.123456 lies between two steps of the drive, 7.123 and 7.124',
        ),
        ('control.accel', 0.19, 'control.accel: 0.19 is out of range, 0.2 to 500 s'),
        ('control.accel', 500.01, 'control.accel: 500.01 is out of range, 0.2 to 500 s'),
        ('control.accel', -7, 'control.accel: -7 is out of range, 0.2 to 500 s'),
        ('control.accel', 10**400, 'control.accel: inf is not finite'),
        ('control.accel', float('nan'), 'control.accel: nan is not finite'),
        ('control.accel', float('-inf'), 'control.accel: -inf is not finite'),
        ('control.accel', True, 'control.accel: True is not a number'),
        ('control.accel', '7', "control.accel: '7' is not a number"),
        ('control.accel', None, 'control.accel: None is not a number'),
        ('control.accel', [7], 'control.accel: [7] is not a number'),
        (
            'motor.u_nom', 400.5,
            'motor.u_nom: 400.5 lies between two steps of the drive, 400 and 401',
        ),
        ('control.st_mode', 'brake', "control.st_mode: 'brake' is none of Release, Brake"),
        ('control.st_mode', '', "control.st_mode: '' is none of Release, Brake"),
        ('control.st_mode', 1, 'control.st_mode: 1 is none of Release, Brake'),
        ('control.st_mode', True, 'control.st_mode: True is none of Release, Brake'),
        ('control.energy_save', 1, 'control.energy_save: 1 is none of OFF, ON'),
        ('pi_reg.reg_amp', 0, 'pi_reg.reg_amp: 0 is none of '),
        ('pi_reg.reg_amp', False, 'pi_reg.reg_amp: False is none of '),
        ('pi_reg.reg_amp', [1], 'pi_reg.reg_amp: [1] is none of '),
        ('pi_reg.reg_amp', 10**400, 'pi_reg.reg_amp: 1000'),
    ],
)
def test_values_that_no_drive_can_have(rig: Rig, key: str, value: Value, says: str) -> None:
    parameters = connect(rig)
    for method in (
        lambda: parameters.exact(key, value),
        lambda: parameters.admit(key, value),
        lambda: parameters.change({'control.retard': 9, key: value}).result(PATIENCE),
    ):
        with pytest.raises(ParameterError) as error:
            method()
        assert said(error.value).startswith(says)
    assert written(rig) == {}


# --- several --------------------------------------------------------------------------------------


@pytest.mark.parametrize('reverse', [False, True])
@pytest.mark.parametrize(('magn', 'limt'), [(6.0, 9.0), (0.5, 1.0)])
@pytest.mark.parametrize('how', ['change', 'apply'])
def test_values_that_bound_each_other_come_in_any_order(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, magn: float, limt: float, reverse: bool, how: str
) -> None:
    # from 1.8 and 5.1 A
    parameters = connect(rig)
    bound_magn_by_limt(rig, monkeypatch)
    wanted = {'motor.i_magn': magn, 'motor.i_limt': limt}
    if reverse:
        wanted = dict(reversed(wanted.items()))
    if how == 'change':
        assert len(parameters.change(wanted).result(PATIENCE)) == 2
    else:
        parameters.apply(wanted, write=True).result(PATIENCE)
        assert not rig.notes.told(Cause.WANTED_BUT_REFUSED)
    assert far(rig, *wanted) == list(wanted.values())
    assert written(rig) == {'motor.i_magn': 1, 'motor.i_limt': 1}


def test_two_that_contradict_each_other(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = connect(rig)
    bound_magn_by_limt(rig, monkeypatch)
    wanted = {'motor.i_magn': 3.0, 'control.accel': 7, 'motor.i_limt': 2.0}
    message = rig.refused(parameters.change(wanted))
    assert 'the drive does not accept 2 A (exception 3)' in message
    assert 'put back: motor.i_magn, control.accel' in message
    assert far(rig, *wanted) == [1.8, ACCEL, 5.1]


# --- at once --------------------------------------------------------------------------------------


def test_two_changes_at_once(rig: Rig) -> None:
    parameters = connect(rig)
    start = threading.Barrier(2)
    failures: list[BaseException] = []

    def change(first: float) -> None:
        try:
            for count in range(15):
                start.wait()
                value = first + count
                wanted = {'control.accel': value, 'control.retard': value, 'freque.f_fix1': value}
                parameters.change(wanted).result(PATIENCE)
        except BaseException as error:
            failures.append(error)
            start.abort()

    threads = [threading.Thread(target=change, args=(first,)) for first in (1, 50)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures
    accel, retard, fix = far(rig, 'control.accel', 'control.retard', 'freque.f_fix1')
    assert accel == retard == fix
    assert accel in (15, 64)
    assert parameters.values['control.accel'] == accel


def test_watch_does_not_take_a_change_for_somebody_elses(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters = connect(rig)
    watch_only(rig, monkeypatch, 'control.accel')

    def keep_another(write: Store, key: str, raw: int) -> None:
        write(key, raw + 1 if key == 'control.retard' and raw > 1000 else raw)

    on_write(rig, monkeypatch, keep_another)
    for count in range(40):
        value = 1.0 + count
        parameters.change({'control.accel': value, 'freque.f_fix1': value}).result(PATIENCE)
        assert parameters.values['control.accel'] == value
        # and this one is put back
        rig.refused(parameters.change({'control.accel': 99, 'control.retard': 99}))
        assert parameters.values['control.accel'] == value
    wait_until(lambda: len(rig.notes.snapshots) > 20)
    assert parameters.values['control.accel'] == value
    assert news(rig) == []


def test_long_changes_leave_the_polls_their_turns(rig: Rig) -> None:
    parameters = connect(rig)
    keys = [f'freque.f_fix{number}' for number in range(1, 8)] + ['control.accel', 'control.retard']
    for value in (7, 9, 11):
        before = len(rig.notes.snapshots)
        parameters.change(dict.fromkeys(keys, value)).result(PATIENCE)
        assert len(rig.notes.snapshots) - before >= 2
