# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Settings are read, watched and compared with the wanted ones, and nothing of that writes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
import itertools
from typing import Any

import pytest
from support.rig import CONNECTIONS, Connection, Rig
from support.said import raises
from support.variants import ramps

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive import Cause, DriveError, Severity
from nfo_sinus_driver.drive.change.parameters import Parameters
from nfo_sinus_driver.link import Refused

#: A change at the keypad is seen within a round, s.
ROUND = 10.0
READ = {
    'rtu': 119, 'ascii': 119, 'tcp': 119, 'canopen': 119, 'classic': 120, 'classic v5.0': 116,
    # without option cards; three of them are only read
    'movitrac': 149 + 3,
}  # fmt: skip
ACCEL, RETARD, SWITCH = 'control.accel', 'control.retard', 'control.energy_save'


@pytest.fixture
def rig() -> Any:
    with Rig(poll_rate=2.0) as rig:
        yield rig


@pytest.fixture
def parameters(rig: Rig) -> Parameters:
    """The settings of a drive that is connected and has read them."""
    rig.connect(parameters=True)
    return rig.drive.parameters


def far(rig: Rig, *keys: str) -> list[Value]:
    """Return what the drive has."""
    return [rig.far.peek(key) for key in keys]


def texts(rig: Rig, cause: Cause) -> list[str]:
    """Return what was reported for a cause."""
    return [event.text for event in rig.notes.events if cause in event.text.causes]


def refuse(rig: Rig, key: str, code: int = Refused.ILLEGAL_ADDRESS) -> list[str]:
    """Have the reading of a parameter refused; return how often it was, one entry each time."""
    refused: list[str] = []

    def meet(asked: str, data: bytes | None) -> None:
        if asked == key and data is None:
            refused.append(asked)
            raise Refused(code)

    rig.meet = meet
    return refused


# --- the first reading ----------------------------------------------------------------------------


@pytest.mark.parametrize('connection', READ)
def test_all_are_read_and_watched_and_nothing_is_written(connection: str) -> None:
    with Rig(connection, poll_rate=2.0) as rig:
        parameters = rig.drive.parameters
        assert parameters.progress == 'not read'
        rig.connect(parameters=True)
        assert len(parameters.values) == READ[connection]
        assert parameters.progress == f'{READ[connection]} read'
        assert list(parameters.values.values()) == far(rig, *parameters.values)
        assert set(rig.notes.parameters) == set(parameters.values)
        assert rig.notes.said(f'parameters: {READ[connection]} read in ', Severity.INFO)
        rig.asked.clear()
        answer = rig.answer(parameters.refresh())
        assert answer == f'{READ[connection]} parameters read, changed: none'
        rig.notes.parameters.clear()
        up, down = ramps(CONNECTIONS[connection].model, 0.0, 0.0)
        rig.far.set_from_keypad(up, 9.0)
        rig.pass_time(ROUND + 1.0)
        assert texts(rig, Cause.CHANGED_AT_DRIVE) == [f'changed at the drive: {up}: 0.3 -> 9 s']
        assert rig.notes.parameters == [up]
        rig.far.set_from_keypad(up, 8.0)
        rig.far.set_from_keypad(down, 8.0)
        answer = rig.answer(parameters.refresh())
        assert answer == f'{READ[connection]} parameters read, changed: {up}, {down}'
        assert parameters.values[down] == 8.0
        assert not [key for _, key, data in rig.asked if data is not None]
        assert not rig.far.writes


def test_progress_is_reported_after_pauses_that_grow() -> None:
    # 20 s for all
    with Rig(line={'baud': 1200}, lost_after=5.0) as rig:
        rig.connect(parameters=True)
        reported = [event.at for event in rig.notes.events if 'of 119 read' in event.text]
        assert len(reported) == 2
        assert reported[1] - reported[0] == pytest.approx(10.0, abs=0.5)


def test_one_that_the_drive_does_not_show_is_not_there(rig: Rig) -> None:
    refused = refuse(rig, 'freque.f_fix1')
    rig.connect(parameters=True)
    parameters = rig.drive.parameters
    assert len(parameters.values) == 118
    (text,) = texts(rig, Cause.SETTING_UNREADABLE)
    assert 'freque.f_fix1 cannot be read: the drive has no such parameter' in text
    before = len(refused)
    rig.pass_time(ROUND)
    assert len(refused) == before
    answer = rig.answer(parameters.change({'freque.f_fix1': 7}))
    assert answer == 'freque.f_fix1: the drive has no such parameter (exception 2)'


def test_what_needs_option_cards_is_reported_as_one() -> None:
    with Rig('movitrac') as rig:
        rig.connect(parameters=True)
        assert not texts(rig, Cause.SETTING_UNREADABLE)
        (text,) = texts(rig, Cause.OPTIONS_MISSING)
        every = len(rig.drive.parameters.available([row.key for row in rig.drive.model.kept]))
        assert text.startswith(f'parameters: {every - READ["movitrac"]} are left out')


def test_a_drive_that_refuses_every_third_request_is_read(rig: Rig) -> None:
    count = itertools.count()
    codes = itertools.cycle((Refused.ILLEGAL_ADDRESS, Refused.ILLEGAL_VALUE, Refused.BUSY))

    def meet(key: str, data: bytes | None) -> None:
        if key in rig.far.settings and rig.drive.parameters._unread and next(count) % 3 == 2:
            raise Refused(next(codes))

    rig.meet = meet
    rig.connect(parameters=True)
    parameters = rig.drive.parameters
    assert list(parameters.values.values()) == far(rig, *parameters.values)
    assert parameters.progress == '119 read'
    assert not texts(rig, Cause.SETTING_UNREADABLE)


def test_a_switch_that_is_neither_on_nor_off_has_no_value(rig: Rig) -> None:
    rig.far.memory.put('serial.auto_stop', 2)
    rig.connect(parameters=True)
    values, timeout = rig.drive.parameters, rig.drive.state
    assert 'serial.auto_stop' not in values.values
    rig.far.set_from_keypad('serial.auto_stop', True)
    rig.pass_time(ROUND)
    assert values.values['serial.auto_stop'] is True
    assert timeout.timeout.stops_motor
    # a value that is gone is not relied on
    rig.far.memory.put('serial.auto_stop', 2)
    rig.pass_time(ROUND)
    assert 'serial.auto_stop' not in values.values
    assert not timeout.timeout.stops_motor
    reported = texts(rig, Cause.NOT_POSSIBLE)
    assert len(reported) == 2
    assert all('serial.auto_stop: the drive has code 2' in text for text in reported)


def test_a_drive_that_is_lost_while_it_is_read_is_not_known(rig: Rig) -> None:
    count = itertools.count()

    def meet(key: str, data: bytes | None) -> None:
        if next(count) == 60:
            rig.line.state = 'silent'

    rig.meet = meet
    parameters = rig.drive.parameters
    assert 'did not answer' in rig.answer(rig.drive.connect(parameters=True))
    assert parameters.values == {}
    assert parameters.progress == 'not read'
    rig.line.mend()
    rig.connect(parameters=True)
    assert list(parameters.values.values()) == far(rig, *parameters.values)
    assert not texts(rig, Cause.CHANGED_AT_DRIVE)


@pytest.mark.parametrize('error', [DriveError(Cause.NOT_ACTIVE), RuntimeError('a mistake')])
def test_a_first_reading_that_fails_leaves_nothing_connected(rig: Rig, error: Exception) -> None:
    async def fail(only: Collection[str]) -> None:
        raise error

    rig.drive.parameters.read_now = fail
    with pytest.raises(type(error)):
        rig.result(rig.drive.connect(parameters=True))
    with raises(Cause.NOT_CONNECTED):
        rig.result(rig.drive.acknowledge())
    del rig.drive.parameters.read_now
    rig.connect(parameters=True)
    assert rig.drive.parameters.values


# --- the watch ------------------------------------------------------------------------------------


def test_the_watch_goes_on_after_reading_anew_and_after_a_loss(
    rig: Rig, parameters: Parameters
) -> None:
    for _ in range(3):
        rig.answer(parameters.read())
    rig.far.set_from_keypad(ACCEL, 9)
    rig.pass_time(ROUND)
    assert parameters.values[ACCEL] == 9
    rig.line.state = 'silent'
    rig.pass_time(5.0)
    assert not rig.drive.snapshot.connected
    rig.line.mend()
    rig.far.set_from_keypad(RETARD, 9)
    rig.pass_time(ROUND + 6.0)
    assert parameters.values[RETARD] == 9
    assert len(texts(rig, Cause.CHANGED_AT_DRIVE)) == 2


def test_a_round_reads_each_once(rig: Rig, parameters: Parameters) -> None:
    rig.pass_time(2.0)
    rig.asked.clear()
    rig.pass_time(ROUND - 0.2)
    read = Counter(key for _, key, _ in rig.asked if key in parameters.values)
    # the polls read the control mode too; what the line depends on takes turns
    assert [key for key, times in read.items() if times > 1] == ['control.mode']
    assert len(read) > 113


def test_refresh_passes_over_what_is_refused(rig: Rig, parameters: Parameters) -> None:
    for key in (ACCEL, RETARD):
        rig.far.set_from_keypad(key, 9)
    refuse(rig, ACCEL, Refused.DEVICE_FAILURE)
    answer = rig.answer(parameters.refresh())
    assert answer == f'119 parameters read, changed: {RETARD}'
    assert not texts(rig, Cause.SETTING_UNREADABLE)


@pytest.mark.provokes
def test_a_listener_that_fails_does_not_end_the_watch(
    rig: Rig, parameters: Parameters, caplog: pytest.LogCaptureFixture
) -> None:

    def fail(keys: Any) -> None:
        raise RuntimeError('a mistake of a listener')

    rig.notes.on_parameters = fail
    for key in (ACCEL, RETARD):
        rig.far.set_from_keypad(key, 9)
        rig.pass_time(ROUND)
        assert parameters.values[key] == 9
    assert 'a mistake of a listener' in caplog.text


def test_the_drives_time_out_reaches_the_keeping_alive() -> None:
    with Rig(allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        parameters, inverter = rig.drive.parameters, rig.drive.state

        def known() -> tuple[float, bool]:
            return inverter.timeout.seconds, inverter.timeout.stops_motor

        for auto in (True, False):
            rig.far.set_from_keypad('serial.sio_tot', 5 + auto)
            rig.far.set_from_keypad('serial.auto_stop', auto)
            rig.pass_time(ROUND)
            assert known() == (5 + auto, auto)
        rig.result(rig.drive.set_drive_timeout(7))
        assert known() == (7, True)
        assert parameters.values['serial.sio_tot'] == 7
        assert far(rig, 'serial.sio_tot', 'serial.auto_stop') == [7, True]
        rig.result(parameters.change({'serial.sio_tot': 3, 'serial.auto_stop': False}))
        assert known() == (3, False)


# --- what is wanted -------------------------------------------------------------------------------


def test_a_wanted_state_is_written_where_it_differs_or_only_reported(
    rig: Rig, parameters: Parameters
) -> None:
    rig.result(parameters.apply({ACCEL: 7}, write=False))
    assert [str(drift) for drift in parameters.drift] == [f'{ACCEL}: 7 -> 0.3 s']
    assert texts(rig, Cause.NOT_AS_WANTED) == [
        f'{ACCEL} is 0.3 s in the drive, the parameter file has 7: not changed'
    ]
    assert not rig.far.writes
    rig.far.memory.put(SWITCH, 2)
    rig.pass_time(ROUND)
    wanted = {ACCEL: 7, RETARD: 0.3, 'control.st_mode': 'Release', SWITCH: False}
    for _ in range(2):
        rig.result(parameters.apply(wanted, write=True))
        assert rig.far.writes == {ACCEL: 1, 'control.st_mode': 1, SWITCH: 1}
        assert far(rig, *wanted) == list(wanted.values())
        assert parameters.drift == ()
    assert rig.notes.said(f'{ACCEL}: 0.3 -> 7 s, as the parameter file says', Severity.INFO)
    assert not rig.notes.said(RETARD)


def test_a_monitor_writes_nothing() -> None:
    connection = Connection(
        'modbus_rtu', method='monitor', driver={'allow_communication_changes': True}
    )
    with Rig(connection) as rig:
        rig.connect(parameters=True)
        parameters = rig.drive.parameters
        for key, value in ((ACCEL, 7), ('serial.sio_tot', 7)):
            assert 'this driver only reads' in rig.answer(parameters.change({key: value}))
        rig.result(parameters.apply({ACCEL: 7}, write=True))
        assert rig.notes.said(f'not applied from the parameter file: {ACCEL}', Severity.ERROR)
        assert parameters.drift
        # what it has already is no change
        assert rig.result(parameters.change({ACCEL: 0.3})) == ()
        rig.result(parameters.refresh())
        rig.far.set_from_keypad(ACCEL, 7)
        rig.pass_time(ROUND)
        assert not parameters.drift
        assert not [key for _, key, data in rig.asked if data is not None]


def test_a_drift_is_reported_once_and_not_undone(rig: Rig, parameters: Parameters) -> None:
    rig.result(parameters.apply({ACCEL: 7, SWITCH: True}, write=True))
    rig.far.set_from_keypad(ACCEL, 9)
    rig.far.set_from_keypad(RETARD, 9)
    rig.pass_time(2 * ROUND)
    assert texts(rig, Cause.NOT_AS_WANTED) == [
        f'{ACCEL} is 9 s in the drive, the parameter file has 7: not changed'
    ]
    assert [str(drift) for drift in parameters.drift] == [f'{ACCEL}: 7 -> 9 s']
    assert far(rig, ACCEL) == [9]
    assert len(texts(rig, Cause.CHANGED_AT_DRIVE)) == 1
    # what is set through the driver is wanted from then on
    rig.result(parameters.change({ACCEL: 8}))
    assert parameters.drift == ()
    rig.far.set_from_keypad(ACCEL, 9)
    rig.pass_time(ROUND)
    assert len(texts(rig, Cause.NOT_AS_WANTED)) == 2
    rig.far.set_from_keypad(ACCEL, 8)
    rig.far.memory.put(SWITCH, 2)
    rig.pass_time(ROUND)
    assert rig.far.writes == {ACCEL: 2, SWITCH: 1}
    assert [str(drift) for drift in parameters.drift] == [f'{SWITCH}: true -> 0002h']


def test_a_wanted_state_that_this_drive_or_no_drive_can_have() -> None:
    with Rig(parameters={'fieldbus.sw_ver': 4.31}) as rig:
        rig.connect(parameters=True)
        parameters = rig.drive.parameters
        answer = rig.answer(parameters.apply({ACCEL: 7, RETARD: -1}, write=True))
        assert answer.startswith(f'{RETARD}: -1 is out of range')
        assert not rig.far.writes
        wanted = {'error.short_c_err_cnt': 1, 'control.any_bus': 1, ACCEL: 7}
        rig.result(parameters.apply(wanted, write=True))
        text = 'this drive has no error.short_c_err_cnt, control.any_bus: not applied'
        assert rig.notes.said(text, Severity.WARNING)
        assert rig.far.writes == {ACCEL: 1}
