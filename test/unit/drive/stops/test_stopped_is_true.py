# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A stop is a success only where status, run command and measured speed agree that it was done.

What a status says that no manual lists, and a speed that neither is 0 nor falls, confirm nothing; a
run command that stands at standstill would turn the motor with the next set-point.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future
import contextlib
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from support.described import DescribedRig
from support.oddities import PLAIN, described
from support.rig import CONNECTIONS, Rig
from support.said import said
from support.variants import ramps
from test_every_step_of_a_stop import QUICK, STOPS

from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.simulator._declared.control_unit import DeclaredControlUnit
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.movitrac31.control_unit import MovitracControlUnit
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit

#: Their status repeats what was commanded, so that the speed alone counts, however long it takes.
_BY_SPEED_ALONE = ('telegram1 g2', 'telegram1 sinus_h')
_RAMPS = (Cause.RAMPING, Cause.RAMPING_SO_FAR, Cause.STOPPING)


def by_speed_alone(connection: str) -> bool:
    """Return whether a stop is retried there as long as the motor turns."""
    return connection.startswith(_BY_SPEED_ALONE) and 'drivecontrol' not in connection


@contextlib.contextmanager
def measured(frequency: float) -> Iterator[None]:
    """Have drives measure a frequency, Hz, and the speed to it, whatever their motors do."""
    speed = 30 * frequency
    with (
        mock.patch.object(Motor, 'frequency', property(lambda _: frequency)),
        mock.patch.object(Motor, 'speed', property(lambda _: speed)),
    ):
        yield


def cause_of(future: Future[Any]) -> Cause | None:
    """Return what was answered to a stop, quick or not; ``None``: it failed."""
    if future.exception():
        return None
    answer = future.result()
    return answer.values.get('stop', answer).cause


# --- the speed ------------------------------------------------------------------------------------


@pytest.mark.parametrize('how', STOPS)
@pytest.mark.parametrize('connection', CONNECTIONS)
def test_no_stop_is_a_success_while_the_measured_speed_stays(connection: str, how: str) -> None:
    with Rig(connection, line=QUICK) as rig:
        rig.turn()
        with measured(20.0):
            stop = STOPS[how](rig.drive)
            rig.answer(stop)
            if how != 'exit':
                # a drive that says that it ramps is on its way; it says more when it is over
                rig.pass_time(1.0)
                assert cause_of(stop) in (None, *_RAMPS)
                stop = STOPS['stop'](rig.drive)
                rig.answer(stop)
                assert stop.exception(), said(stop.result())
            release = rig.drive.disconnect(2.0)
            rig.answer(release)
            assert stop.exception() or release.exception(), said(release.result())


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_what_is_not_clear_is_reported_in_the_end_and_forbids_no_enable(connection: str) -> None:
    with Rig(connection, line=QUICK) as rig:
        rig.turn()
        rig.send(None)
        rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.turning, 20.0)
        with measured(20.0):
            rig.pass_time(1.0)
            stop = rig.drive.stop()
            rig.answer(stop)
            assert stop.exception()
            rig.pass_time(15.0)
            assert rig.drive.stop_unconfirmed == by_speed_alone(connection)
            unclear = rig.notes.said(Cause.STOP_UNCLEAR, Severity.ERROR)
            assert unclear != by_speed_alone(connection)
            assert rig.drive.stop_overdue
        rig.pass_time(1.0)
        assert not rig.drive.stop_unconfirmed
        rig.enable()
        assert not rig.drive.stop_overdue


# --- what the answer says of the way there --------------------------------------------------------

#: The settings by which an ordinary stop releases the motor.
_RELEASED: dict[str, dict[str, Any]] = {
    'sinus_g2': {'control.st_mode': 'Release'},
    'sinus_optimal': {'control.st_mode': 'Release'},
    'sinus_h': {'adv.stop_mode': 'Free-Run'},
}
_AS_SET = [pytest.param(name, {}, id=f'{name}-as set') for name in CONNECTIONS] + [
    pytest.param(name, _RELEASED[kind.model], id=f'{name}-to release')
    for name, kind in CONNECTIONS.items() if kind.model in _RELEASED
]
_WAYS = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'rapid stop': lambda drive: drive.rapid_stop(),
    'release': lambda drive: drive.disconnect(1.0),
}
_SAYS_RAMPS = (Cause.RAMPING, Cause.RAMPING_SO_FAR, Cause.RAPID_STOPPING)
_SAYS_RELEASED = (
    Cause.COASTING, Cause.QUICK_STOPPED, Cause.COASTED_FOR_TIMEOUT,
    # a drive measures 0 while the motor is released
    Cause.STOPPED,
)


@pytest.mark.parametrize('way', _WAYS)
@pytest.mark.parametrize(('connection', 'set_to'), _AS_SET)
def test_a_motor_ramps_or_is_released_as_the_answer_says(
    connection: str, set_to: dict[str, Any], way: str
) -> None:
    made = CONNECTIONS[connection]
    slow = ramps(made.model, 0.3, 6.0)
    with Rig(connection, parameters={**slow, **made.parameters, **set_to}, line=QUICK) as rig:
        rig.turn()
        rig.send(None)
        driven: set[bool] = set()

        def look() -> None:
            if abs(rig.far.motor.rotor) > 1.0:
                driven.add(rig.far.motor.driven)

        rig.looked = look
        stop = _WAYS[way](rig.drive)
        rig.answer(stop)
        rig.wait_until(lambda: not rig.far.motor.turning, 30.0)
        released = False in driven
        assert cause_of(stop) in (_SAYS_RELEASED if released else _SAYS_RAMPS), said(stop.result())


#: Without its run command this one releases the motor.
_HAS_NO_RAMP = 'made up'


@pytest.mark.parametrize('connection', [name for name in CONNECTIONS if name != _HAS_NO_RAMP])
def test_the_end_waits_for_the_ramp(connection: str) -> None:
    made = CONNECTIONS[connection]
    slow = ramps(made.model, 0.3, 3.0)
    with Rig(connection, parameters={**slow, **made.parameters}, line=QUICK) as rig:
        rig.turn()
        rig.send(None)
        coasted: list[float] = []

        def look() -> None:
            if abs(rig.far.motor.rotor) > 1.0 and not rig.far.motor.driven:
                coasted.append(rig.clock.now)

        rig.looked = look
        rig.result(rig.drive.disconnect(20.0))
        rig.pass_time(1.0)
        assert not coasted
        assert not rig.far.motor.turning


def test_a_motor_that_coasts_is_stopped_as_soon_as_its_speed_falls() -> None:
    def encoder(motor: Motor) -> float:
        return motor.rotor

    with Rig(parameters={'control.st_mode': 'Release'}) as rig:
        rig.turn()
        with mock.patch.object(Motor, 'frequency', property(encoder)):
            asked_at = rig.clock.now
            assert rig.answer(rig.drive.stop()) == 'stopping: it coasts'
            assert rig.clock.now < asked_at + 0.5 and rig.far.motor.turning
            rig.pass_time(20.0)
            assert rig.answer(rig.drive.stop()) == 'stopped (37 Bus Stby)'
        assert not rig.notes.said(Cause.CANNOT_STOP)


@pytest.mark.parametrize('connection', ['rtu', 'made up', 'described'])
def test_a_speed_that_fluctuates_at_standstill_is_none(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.answer(rig.drive.stop())
        rig.pass_time(2.0)
        with measured(0.3):
            assert rig.answer(rig.drive.stop()).startswith('stopped')


@pytest.mark.parametrize('connection', ['rtu', 'classic v5.0', 'described, by states'])
def test_a_fault_is_no_success_while_the_measured_speed_stays(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        with measured(20.0):
            rig.far.trip(rig.a_fault)
            rig.pass_time(0.5)
            stop = rig.drive.stop()
            rig.answer(stop)
            assert stop.exception(), said(stop.result())


# --- the run command ------------------------------------------------------------------------------

#: Where a stop writes what is more than set-point 0.
_COMMANDS = {
    'rtu, control word': 'fieldbus.drv_ctrl_write_mask',
    'classic, control word': 'fieldbus.drive_control',
    'canopen, control word': 'fieldbus.drive_control',
    'canopen, ds402': 'fieldbus.control_word',
    'canopen, ds402 alone': 'fieldbus.control_word',
    'optimal': 'fieldbus.smode',
    'optimal ascii': 'fieldbus.smode',
    'optimal, control word': 'fieldbus.drive_control',
    'movitrac': 'fieldbus.function_bits',
    'made up': 'bus.word',
    'described': 'line.r2000',
    'described, by states': 'line.r0000',
    'described, no holder': 'line.rfa00',
    'described, by pulses': 'line.pulse',
}
#: The terminals run the motor there, or the set-point, and no command of the line does.
_WITHOUT = ('movitrac, by terminals', 'described, by set-point')
_RUN_COMMANDS = [name for name in CONNECTIONS if name not in _WITHOUT]


def command_of(connection: str) -> str:
    """Return the parameter by which a run command is removed over a connection."""
    by_plc = connection.startswith('telegram1')
    return 'telegram.clear' if by_plc else _COMMANDS.get(connection, 'fieldbus.scmd')


def ignore_the_removal(rig: Rig, connection: str) -> None:
    """Have the drive answer each removal of its run command and do nothing."""
    command = command_of(connection)
    rig.meet = lambda key, data: 'ignored' if data is not None and key == command else None


def runs_on(rig: Rig) -> bool:
    """Return whether a set-point of anyone would turn the motor."""
    return bool(rig.far.motor.driven)


@pytest.mark.parametrize('connection', _RUN_COMMANDS)
def test_a_run_command_that_stands_is_not_taken_for_removed(connection: str) -> None:
    rig = Rig(connection, line=QUICK)
    # what is only said to be carried out bends the order of commands
    with contextlib.closing(rig.bus):
        rig.turn()
        rig.send(None)
        ignore_the_removal(rig, connection)
        rig.answer(rig.drive.stop())
        rig.pass_time(15.0)
        # set-point 0 was taken, where one of the line counts
        assert not rig.turns or not rig.drive.settings.follows_setpoints
        if runs_on(rig):
            assert rig.drive.stop_unconfirmed and rig.notes.said(Cause.CANNOT_STOP)
        else:
            assert rig.notes.said(Cause.STOP_FORCED) and not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('connection', _RUN_COMMANDS)
def test_an_exit_is_a_success_only_without_a_run_command(connection: str) -> None:
    rig = Rig(connection, line=QUICK)
    with contextlib.closing(rig.bus):
        rig.turn()
        rig.send(None)
        ignore_the_removal(rig, connection)
        stop = rig.drive.stop_for_good(4.0)
        rig.answer(stop)
        release = rig.drive.disconnect(3.5)
        rig.answer(release)
        assert not runs_on(rig) or (stop.exception() or release.exception())


@pytest.mark.parametrize(
    ('connection', 'ramp', 'stop'),
    [
        ('canopen, ds402', 'control.retard', 0x0076),
        ('described, by states', 'ramp.decel', 0x047E),
    ],
)
def test_a_run_command_that_shows_after_the_ramp_is_removed_by_force(
    connection: str, ramp: str, stop: int
) -> None:
    rig = Rig(connection, line=QUICK, parameters={ramp: 10.0})
    with contextlib.closing(rig.bus):
        rig.turn()
        rig.send(None)
        # another word of the same register releases the motor
        command = command_of(connection)

        def meet(key: str, data: bytes | None) -> str | None:
            if key != command:
                return None
            # read back, it would show at once
            return 'refused' if data is None else 'ignored' if rig.number(data) == stop else None

        rig.meet = meet
        assert rig.answer(rig.drive.stop()).startswith('stopping')
        rig.wait_until(lambda: rig.notes.said(Cause.RUN_COMMAND_STANDS), 20.0)
        assert not rig.far.motor.turning and rig.far.motor.driven
        rig.wait_until(lambda: not rig.far.motor.driven, 10.0)
        rig.pass_time(1.0)
        assert rig.notes.said(Cause.STOP_FORCED) and not rig.drive.stop_unconfirmed


# --- a drive that brakes a motor that has stopped -------------------------------------------------


#: By how long a drive brakes, s, and whether its file says which parameter that is.
BRAKING: dict[str, Any] = {
    'control': {**PLAIN['control'], 'coast': [{'register': 10, 'value': 2}]},
    'parameters': {
        **PLAIN['parameters'],
        'stop.braking': {
            'register': 32, 'factor': 0.1, 'unit': 's', 'role': 'stop_braking', 'default': 5,
        },
    },
}


def coasts(rig: Rig) -> bool:
    """Return whether the driver has released the motor of such a drive."""
    return 2 in rig.written('line.r000a')


@pytest.mark.parametrize('end', ['stop', 'exit'])
def test_a_motor_that_the_drive_brakes_is_not_released(tmp_path: Path, end: str) -> None:
    with DescribedRig(described(tmp_path, **BRAKING)) as rig:
        rig.connect()
        rig.enable()
        rig.follow(20.0)
        rig.send(None)
        rig.notes.events.clear()
        if end == 'exit':
            rig.answer(rig.drive.stop_for_good(10.0))
            rig.result(rig.drive.disconnect(10.0))
        else:
            rig.result(rig.drive.stop())
            rig.wait_until(lambda: not rig.far.motor.turning)
            # the one that asks again is told the same
            rig.result(rig.drive.stop())
            rig.pass_time(4.0)
            assert rig.far.motor.driven
            rig.pass_time(4.0)
        assert not rig.far.motor.driven and not coasts(rig)
        assert not rig.notes.events


def test_a_braking_that_the_file_does_not_name_is_waited_for_within_a_bound(
    tmp_path: Path,
) -> None:
    for seconds, released in ((1.2, False), (4.0, False), (60.0, True)):
        path = tmp_path / f'{seconds}'
        path.mkdir()
        file = described(path, control=BRAKING['control'])
        braking = property(lambda _, seconds=seconds: seconds)
        with mock.patch.object(DeclaredControlUnit, '_braking', braking), DescribedRig(file) as rig:
            rig.connect()
            rig.enable()
            rig.follow(20.0)
            rig.send(None)
            rig.answer(rig.drive.stop())
            rig.pass_time(20.0)
            assert not rig.far.motor.driven and coasts(rig) == released
            assert rig.notes.said(Cause.RUN_COMMAND_STANDS) == (seconds > 1.5)


# --- statuses that no manual lists ----------------------------------------------------------------

#: A drive whose status is a number.
NUMBERS: dict[str, Any] = {
    'status': {
        'register': 20, 'ready': {'value': 1}, 'running': {'value': 2}, 'fault': {'value': 3},
    },
    'faults': {},
    'parameters': {**PLAIN['parameters'], 'motor.poles': {'register': 33, 'while_running': False}},
}


@contextlib.contextmanager
def shown(word: int) -> Iterator[None]:
    """Have described drives show a status."""
    with mock.patch.object(DeclaredControlUnit, 'status_word', property(lambda _: word)):
        yield


@pytest.mark.parametrize('word', [0, 5, 0x5A5A])
def test_a_number_that_the_file_does_not_name_confirms_nothing(tmp_path: Path, word: int) -> None:
    number = f'199 Unknown status {word:04X}h'
    with DescribedRig(described(tmp_path, **NUMBERS)) as rig:
        rig.connect()
        rig.enable()
        rig.follow(20.0)
        rig.send(None)
        reads = [key for _, key, data in rig.asked if data is None].count('line.status')
        with shown(word):
            for stop in (rig.drive.stop(), rig.drive.quick_stop()):
                rig.answer(stop)
                assert stop.exception() and number in said(stop.exception())
            rig.pass_time(1.0)
            assert rig.drive.stop_unconfirmed and rig.notes.said(Cause.CANNOT_STOP)
            # it is read again before it counts
            assert [key for _, key, data in rig.asked if data is None].count('line.status') > reads
            assert rig.drive.snapshot.text == number.partition(' ')[2]
            # nor does it say that the motor stands
            change = rig.drive.parameters.change({'motor.poles': 2})
            assert 'only while the motor is stopped' in rig.answer(change)
        rig.pass_time(1.0)
        assert not rig.drive.stop_unconfirmed

        with shown(word):
            assert 'enabled' not in rig.answer(rig.drive.enable())
            assert not rig.drive.following
        rig.pass_time(1.0)

        rig.enable()
        rig.follow(20.0)
        with shown(word):
            rig.pass_time(1.0)
            assert not rig.drive.following
        rig.pass_time(1.0)
        assert any(number in noted.text for noted in rig.notes.events)


@pytest.mark.parametrize(
    ('status', 'word'),
    [
        # bits that are clear say that nothing goes on
        ({'register': 20, 'running': {'bit': 0}, 'fault': {'bit': 3}}, 0),
        # so does 0, where no number is named for a motor that stands
        ({'register': 20, 'running': {'mask': 7, 'value': 2}, 'fault': {'bit': 3}}, 0x10),
        ({'register': 20, 'running': {'mask': 7, 'except': [1]}, 'fault': {'bit': 3}}, 1),
    ],
)
def test_a_status_that_says_that_nothing_goes_on_is_known(
    tmp_path: Path, status: dict[str, Any], word: int
) -> None:
    with DescribedRig(described(tmp_path, status=status, faults={})) as rig:
        rig.connect()
        with shown(word):
            rig.pass_time(1.0)
            assert rig.drive.snapshot.text == 'Ready'
            assert rig.answer(rig.drive.stop()).startswith('stopped')


@pytest.mark.parametrize(
    ('connection', 'unit', 'name', 'shows', 'text'),
    [
        # status number 42 [M4 §4]
        ('movitrac', MovitracControlUnit, 'status_word', 0x2A9010, '99 Unknown status 2A9010h'),
        ('classic v5.0', G2ControlUnit, 'status_code', 60, '60 Code 60'),
        ('canopen, no DriveStatus', G2ControlUnit, 'status_code', 60, '60 Code 60'),
    ],
)
def test_a_code_that_the_manual_does_not_list_confirms_no_stop(
    connection: str, unit: type, name: str, shows: int, text: str
) -> None:
    with Rig(connection) as rig:
        rig.turn()
        with mock.patch.object(unit, name, property(lambda _: shows)):
            stop = rig.drive.stop()
            rig.answer(stop)
            assert stop.exception() and text in said(stop.exception())
            assert rig.drive.stop_unconfirmed
            rig.pass_time(1.0)
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed)


# --- a run command whose end is answered, and not done --------------------------------------------


@pytest.mark.parametrize('how', ['stop', 'rapid stop', 'deactivate'])
@pytest.mark.parametrize('connection', [name for name in _RUN_COMMANDS if 'telegram1' not in name])
def test_the_answer_to_a_stop_that_is_not_done_is_the_last_word_on_it(
    connection: str, how: str
) -> None:
    made = CONNECTIONS[connection]
    with Rig(connection, parameters={**ramps(made.model, 0.3, 6.0), **made.parameters}) as rig:
        rig.turn()
        rig.send(None)
        ignore_the_removal(rig, connection)
        stop = _ANSWERED[how](rig.drive)
        rig.answer(stop)
        # that it is not done shows, or is said not to show yet
        unread = connection in _UNREAD
        assert cause_of(stop) == (Cause.RAMPING_SO_FAR if unread else None), said(stop.result())


#: No manual says of their commands that they can be read, and their status shows the same of a ramp
#: to set-point 0 as of one to a stop.
_UNREAD = (
    'classic v5.0', 'canopen, no DriveStatus', 'described, by states', 'described, no holder',
    'described, by pulses',
)
_ANSWERED = {
    'stop': lambda drive: drive.stop(),
    'rapid stop': lambda drive: drive.rapid_stop(),
    'deactivate': lambda drive: drive.deactivate(),
}


@pytest.mark.parametrize('wrong', ['refused', 'none such'])
def test_where_the_control_word_cannot_be_read_back_standstill_shows_the_end(wrong: str) -> None:
    with Rig('canopen, ds402', parameters=ramps('sinus_g2', 0.3, 6.0)) as rig:
        rig.turn()
        rig.send(None)
        rig.spoil(wrong, 'fieldbus.control_word', 10**6, written=False)
        stop = rig.drive.stop()
        rig.answer(stop)
        assert cause_of(stop) is Cause.RAMPING_SO_FAR
        rig.wait_until(lambda: not rig.far.motor.turning, 20.0)
        assert not rig.notes.said(Cause.CANNOT_STOP, Severity.ERROR)


def test_a_motor_that_ramps_by_its_set_point_alone_is_released_once_it_stands() -> None:
    with Rig('canopen, ds402', parameters={'control.retard': 30.0}) as rig:
        rig.turn()
        rig.send(None)
        # another word releases the motor
        rig.meet = lambda key, data: (
            'ignored' if key == 'fieldbus.control_word' and data and rig.number(data) == 0x76
            else None
        )
        stop = rig.drive.stop()
        rig.answer(stop)
        assert stop.exception()
        rig.wait_until(lambda: not rig.far.motor.turning, 30.0)
        assert rig.far.motor.driven and not rig.notes.said(Cause.STOP_FORCED)
        rig.wait_until(lambda: not rig.far.motor.driven, 10.0)
        rig.pass_time(1.0)
        assert rig.notes.said(Cause.STOP_FORCED) and not rig.drive.stop_unconfirmed
