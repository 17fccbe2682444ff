# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Law 9: the drive hears the driver in time, and stops by itself when it is gone."""

from __future__ import annotations

from concurrent.futures import Future
import itertools
import json
import os
from pathlib import Path
from typing import Any

import pytest
from support.drive_timeout import TIMED, by_default, drive_timeout
from support.rig import CONNECTIONS, Rig
from support.said import says
from support.variants import ramps

from nfo_sinus_driver.catalog import Role, Value, load_family
from nfo_sinus_driver.drive import Cause, Severity, StopReason
from nfo_sinus_driver.drive.change.memory import ProcessMemory
from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN
from nfo_sinus_driver.state_folder import StateFolder

#: How soon after its time-out a motor has to stand, s.
_SOON = 1.5
timed = pytest.mark.parametrize('connection', TIMED)


@timed
def test_9_a_drive_that_is_polled_seldom_gets_a_request_in_time(connection: str) -> None:
    with by_default(connection, poll_rate=0.05, telemetry_rate=0.0) as rig:
        rig.connect()
        rig.enable()
        assert drive_timeout(rig) == 2.0
        rig.line.make_noise(0.15, seed=1)
        begun = rig.clock.now
        rig.pass_time(12.0)
        sent = [
            frame['first'] for frame in rig.line.frames
            if frame['direction'] == 'request' and frame['first'] > begun
        ]
        # half the time-out of the drive
        assert max(after - before for before, after in itertools.pairwise(sent)) <= 1.0
        assert rig.drive.following and not rig.far.faults
        rig.line.mend()
        # a clean exit leaves no fault behind
        rig.answer(rig.drive.disconnect(4.0))
        rig.kill()
        rig.pass_time(6.0)
        assert not rig.far.faults


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_9_by_default_a_motor_stands_soon_after_its_driver_was_killed(connection: str) -> None:
    with by_default(connection) as rig:
        rig.connect()
        has_none = rig.notes.said(Cause.NO_OWN_TIMEOUT, Severity.WARNING)
        assert has_none == (
            CONNECTIONS[connection].model in ('acme', 'sinus_optimal') and not rig.line.plc
        )
        rig.turn()
        rig.kill()
        rig.line.go_to(rig.clock.now + 2.0 + _SOON)
        assert rig.turns == has_none


@timed
def test_9_a_driver_that_was_suspended_for_too_long_starts_nothing_when_it_is_back(
    connection: str
) -> None:
    with Rig(connection, drive_timeout=2.0, setpoint_timeout=0.0) as rig:
        rig.turn()
        rig.line.go_to(rig.clock.now + 5.0)
        for _ in range(200):
            assert not rig.turns
            rig.pass_time(0.01)
        assert rig.drive.snapshot.stop_reason is StopReason.DRIVE_TIMEOUT


@pytest.mark.parametrize(
    ('connection', 'drives', 'baud'), [('rtu', 32, 19200), ('classic', 16, 9600)]
)
def test_9_a_drive_gets_a_request_in_time_while_all_others_are_enabled(
    connection: str, drives: int, baud: int
) -> None:
    # so many that its polls wait for seconds
    with by_default(connection, drives=drives, line={'baud': baud}) as rig:
        rig.connect()
        rig.enable(1, 2)
        rig.enable(*range(3, drives + 1))
        assert not any(far.faults for far in rig.fars.values())
        assert all(drive.following for drive in rig.drives.values())


@timed
@pytest.mark.parametrize('found', [0.0, 1.0, 6.0])
def test_9_the_end_leaves_the_time_out_of_a_drive_as_it_was_found(
    connection: str, found: float
) -> None:
    with by_default(connection, found) as rig:
        rig.turn()
        # what is shorter was decided by others
        assert drive_timeout(rig) == (found if found == 1.0 else 2.0)
        rig.answer(rig.drive.stop_for_good(4.0))
        rig.answer(rig.drive.disconnect(4.0))
        assert drive_timeout(rig) == found
        assert rig.far.writes.get(rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT), 0) == (
            0 if found == 1.0 else 2
        )


@pytest.mark.parametrize('connection', ['rtu', 'movitrac'])
def test_9_a_time_out_that_was_changed_meanwhile_is_set_again_by_the_next_enable(
    connection: str,
) -> None:
    with by_default(connection, 0.0) as rig:
        rig.connect(parameters=True)
        rig.enable()
        assert drive_timeout(rig) == 2.0
        rig.answer(rig.drive.stop())
        rig.far.set_from_keypad(rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT), 0.0)
        rig.pass_time(15.0)
        rig.enable()
        assert drive_timeout(rig) == 2.0


@pytest.mark.parametrize('connection', ['rtu', 'classic'])
def test_9_an_end_with_a_fault_leaves_the_time_out_and_says_so(connection: str) -> None:
    # a run command may stand in the drive
    with by_default(connection, 0.0) as rig:
        rig.turn()
        rig.far.trip(rig.a_fault)
        rig.pass_time(1.0)
        rig.answer(rig.drive.stop_for_good(4.0))
        rig.answer(rig.drive.disconnect(4.0))
        assert drive_timeout(rig) == 2.0
        assert rig.notes.said(Cause.OWN_TIMEOUT_NOT_PUT_BACK)


@pytest.mark.parametrize('connection', ['rtu', 'classic'])
def test_9_an_end_without_a_confirmed_stop_leaves_the_drive_to_stop_by_itself(
    connection: str,
) -> None:
    with by_default(connection, 0.0) as rig:
        rig.turn()
        key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
        rig.meet = lambda asked, data: 'ignored' if data is not None and asked != key else None
        rig.answer(rig.drive.stop_for_good(4.0))
        rig.answer(rig.drive.disconnect(4.0))
        assert rig.turns and rig.notes.said(Cause.OWN_TIMEOUT_NOT_PUT_BACK)
        rig.kill()
        rig.pass_time(4.0)
        assert not rig.turns


@timed
def test_9_by_default_a_time_out_that_may_not_stop_the_motor_is_left_alone(connection: str) -> None:
    model = load_family(CONNECTIONS[connection].model, CONNECTIONS[connection].method)
    if not model.profile.timeout_conditions:
        pytest.skip('it always stops the motor')
    with Rig(connection, drive_timeout=AS_THE_DRIVE_CAN) as rig:
        rig.connect()
        assert rig.notes.said(Cause.OWN_TIMEOUT_STOPS_NOTHING, Severity.WARNING)
        before = drive_timeout(rig)
        rig.turn()
        assert drive_timeout(rig) == before
        rig.answer(rig.drive.set_drive_timeout(2.0))
        assert drive_timeout(rig) == 2.0 and rig.drive.state.timeout.stops_motor


@timed
@pytest.mark.parametrize('what', ['refused', 'unheard', 'ignored'])
def test_9_a_default_that_the_drive_does_not_take_keeps_no_motor_from_running(
    connection: str, what: str
) -> None:
    with by_default(connection, 0.0) as rig:
        rig.connect()
        key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
        rig.spoil(what, key, 1000)
        for _ in range(2):
            rig.enable()
            rig.answer(rig.drive.stop())
        events = rig.notes.events
        said = [event for event in events if says(event.text, Cause.OWN_TIMEOUT_NOT_TAKEN)]
        assert [event.severity for event in said] == [Severity.WARNING]
        assert drive_timeout(rig) == 0.0


@timed
@pytest.mark.parametrize('what', ['refused', 'unheard'])
def test_9_a_default_that_the_drive_did_not_take_is_set_by_the_next_enable(
    connection: str, what: str
) -> None:
    with by_default(connection, 0.0) as rig:
        rig.connect()
        key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
        rig.spoil(what, key, 1000)
        rig.enable()
        rig.answer(rig.drive.stop())
        assert rig.notes.said(Cause.OWN_TIMEOUT_NOT_TAKEN) and drive_timeout(rig) == 0.0
        rig.meet = lambda key, data: None
        rig.enable()
        assert drive_timeout(rig) == rig.drive.settings.wanted_drive_timeout


@timed
def test_9_by_default_a_clean_end_leaves_a_slow_motor_to_its_ramp(connection: str) -> None:
    with by_default(
        connection, 0.0, parameters=ramps(CONNECTIONS[connection].model, 0.3, 30.0)
    ) as rig:
        rig.turn()
        assert 'left to its ramp' in rig.answer(rig.drive.disconnect(0.2))
        assert drive_timeout(rig) == 0.0
        rig.kill()
        rig.line.go_to(rig.clock.now + 40.0)
        assert not rig.far.motor.turning and not rig.far.faults


@timed
def test_9_a_stop_that_comes_while_the_time_out_is_set_is_no_later_and_undoes_it(
    connection: str,
) -> None:
    with by_default(connection, 0.0) as rig:
        rig.connect()
        key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
        stops: list[Future[Any]] = []

        def stop(asked: str, data: bytes | None) -> None:
            if asked == key and data is not None and not stops:
                stops.append(rig.drive.stop())

        rig.meet = stop
        rig.answer(rig.drive.enable())
        rig.wait_until(stops[0].done, 1.0)
        assert not rig.drive.following and not rig.turns
        rig.answer(rig.drive.disconnect(4.0))
        assert drive_timeout(rig) == 0.0


# --- a driver that was killed ---------------------------------------------------------------------


def enable_and_kill(rig: Rig) -> None:
    """Enable a drive whose motor an earlier driver may have left running, and kill the driver."""
    rig.connect()
    rig.wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.enable()
    assert drive_timeout(rig) == 2.0
    rig.kill()
    rig.pass_time(0.5)
    rig.begin()


def end(rig: Rig) -> None:
    """End the driver as a signal does."""
    rig.answer(rig.drive.stop_for_good(4.0))
    rig.answer(rig.drive.disconnect(4.0))


@timed
@pytest.mark.parametrize('found', [0.0, 6.0])
@pytest.mark.parametrize('enabled_again', [False, True])
def test_9_the_end_after_one_that_was_killed_leaves_the_time_out_as_the_first_found_it(
    connection: str, found: float, enabled_again: bool
) -> None:
    with by_default(connection, found) as rig:
        for _ in range(2):
            enable_and_kill(rig)
        rig.connect()
        assert rig.notes.said(Cause.OWN_TIMEOUT_RECALLED, Severity.INFO)
        if enabled_again:
            rig.wait_until(lambda: not rig.drive.stop_unconfirmed)
            rig.enable()
            assert drive_timeout(rig) == 2.0
        end(rig)
        assert drive_timeout(rig) == found
        rig.begin()
        rig.connect()
        assert not rig.notes.said(Cause.OWN_TIMEOUT_RECALLED)


@pytest.mark.parametrize('connection', ['rtu', 'movitrac', 'described'])
@pytest.mark.parametrize('changed_to', [0.0, 6.0])
def test_9_a_time_out_that_the_owner_has_changed_since_is_the_owners(
    connection: str, changed_to: float
) -> None:
    with by_default(connection, 8.0) as rig:
        enable_and_kill(rig)
        rig.far.set_from_keypad(rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT), changed_to)
        rig.connect()
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed)
        rig.enable()
        assert drive_timeout(rig) == 2.0
        # in this session, too
        rig.answer(rig.drive.stop())
        rig.far.set_from_keypad(rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT), 9.0)
        end(rig)
        assert drive_timeout(rig) == 9.0


@pytest.mark.parametrize('connection', ['rtu', 'movitrac'])
def test_9_a_time_out_that_the_owner_has_changed_and_an_enable_has_set_again_is_the_owners(
    connection: str,
) -> None:
    with by_default(connection, 8.0) as rig:
        rig.connect(parameters=True)
        rig.enable()
        rig.answer(rig.drive.stop())
        rig.far.set_from_keypad(rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT), 9.0)
        rig.pass_time(15.0)
        rig.enable()
        assert drive_timeout(rig) == 2.0
        end(rig)
        assert drive_timeout(rig) == 9.0


def test_9_a_time_out_that_a_setting_wants_stays_after_a_kill_as_after_an_end() -> None:
    with by_default('rtu', 0.0) as rig:
        enable_and_kill(rig)
        rig.reset(drive_timeout=2.0)
        rig.begin()
        enable_and_kill(rig)
        rig.reset(drive_timeout=AS_THE_DRIVE_CAN)
        rig.begin()
        rig.connect()
        end(rig)
        assert drive_timeout(rig) == 2.0


@pytest.mark.parametrize('connection', ['movitrac', 'described'])
def test_9_where_the_bus_keeps_control_what_a_setting_wants_is_put_back_after_a_kill(
    connection: str,
) -> None:
    with by_default(connection, 6.0) as rig:
        rig.reset(drive_timeout=2.0)
        rig.begin()
        enable_and_kill(rig)
        rig.connect()
        end(rig)
        assert drive_timeout(rig) == 6.0


def test_9_an_end_with_a_fault_leaves_the_time_out_to_the_next_end() -> None:
    with by_default('rtu', 0.0) as rig:
        rig.turn()
        rig.far.trip(rig.a_fault)
        rig.pass_time(1.0)
        end(rig)
        assert drive_timeout(rig) == 2.0
        rig.kill()
        rig.far.faults.acknowledge()
        rig.begin()
        rig.connect()
        end(rig)
        assert drive_timeout(rig) == 0.0


def test_9_what_is_remembered_of_one_drive_is_not_put_back_in_another() -> None:
    with by_default('rtu', 6.0, drives=2) as rig:
        rig.connect()
        rig.enable(1)
        rig.kill()
        rig.begin()
        rig.far.set_from_keypad('serial.sio_tot', 5.0)
        rig.fars[2].set_from_keypad('serial.sio_tot', 2.0)
        rig.connect()
        for drive in rig.drives.values():
            rig.answer(drive.disconnect(4.0))
        assert [far.peek('serial.sio_tot') for far in rig.fars.values()] == [5.0, 2.0]


@timed
def test_9_what_is_to_be_put_back_is_remembered_before_it_is_set(connection: str) -> None:
    with by_default(connection, 6.0) as rig:
        kept: list[Any] = []
        write = rig.memory.write

        def note(drive: str, borrowed: Any) -> Future[None]:
            kept.append(dict(borrowed))
            return write(drive, borrowed)

        rig.memory.write = note  # type: ignore[method-assign]
        rig.connect()
        key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
        sent: list[Any] = []

        def meet(asked: str, data: bytes | None) -> None:
            if asked == key and data is not None:
                sent.append(kept[-1:])

        rig.meet = meet
        rig.enable()
        end(rig)
        assert sent == [[{key: (6.0, 2.0)}]] * 2
        assert kept == [{key: (6.0, 2.0)}, {}]


@pytest.mark.parametrize(('connection', 'by_serial'), [('rtu', True), ('classic', False)])
def test_9_a_drive_is_known_by_its_serial_number_or_by_its_place(
    connection: str, by_serial: bool
) -> None:
    memory = ProcessMemory()
    memory.line = '/dev/ttyUSB0'
    with by_default(connection, 0.0) as rig:
        rig.memory = memory
        rig.begin()
        enable_and_kill(rig)
    for line, recalled in (('/dev/ttyUSB1', by_serial), ('/dev/ttyUSB0', not by_serial)):
        memory.line = line
        with by_default(connection, 2.0) as rig:
            rig.memory = memory
            rig.begin()
            rig.connect()
            assert rig.notes.said(Cause.OWN_TIMEOUT_RECALLED) == recalled
            end(rig)
            assert drive_timeout(rig) == (0.0 if recalled else 2.0)


class Broken:
    """A memory that keeps nothing, at once or after a while."""

    line = ''

    def __init__(self, error: OSError | None) -> None:
        self._error = error

    def _fail(self) -> Future[Any]:
        future: Future[Any] = Future()
        if self._error is not None:
            future.set_exception(self._error)
        return future

    def read(self, drive: str) -> Future[Any]:
        return self._fail()

    def write(self, drive: str, borrowed: Any) -> Future[Any]:
        return self._fail()


@pytest.mark.parametrize('connection', ['rtu', 'movitrac', 'described'])
@pytest.mark.parametrize('error', [OSError(30, 'Read-only file system'), None])
def test_9_a_disk_that_keeps_nothing_prevents_no_enable_and_is_reported_once(
    connection: str, error: OSError | None
) -> None:
    with by_default(connection, 0.0) as rig:
        rig.memory = Broken(error)
        rig.begin()
        rig.connect()
        for _ in range(2):
            rig.enable()
            assert drive_timeout(rig) == 2.0
            rig.answer(rig.drive.stop())
        end(rig)
        assert drive_timeout(rig) == 0.0
        key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
        said = [event.text for event in rig.notes.events if says(event.text, Cause.NOT_REMEMBERED)]
        assert len(said) == 1 and f'check {key}' in said[0], said


@pytest.mark.parametrize('borrowed', [None, 'Ramp', True, 1e300, -1.0])
@pytest.mark.parametrize('connection', ['rtu', 'movitrac', 'described'])
def test_9_a_spoilt_file_keeps_no_drive_from_being_connected_to(
    connection: str, borrowed: Value | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv('XDG_STATE_HOME', str(tmp_path))
    folder = StateFolder('/dev/ttyUSB0', lambda work: work())
    with by_default(connection, 0.0) as rig:
        key = rig.drive.state.model.key(Role.COMMUNICATION_TIMEOUT)
        rig.memory = folder
        rig.begin()
        rig.connect()
        rig.enable()
        rig.kill()
    ((drive, descriptor),) = folder._locked.items()
    os.close(descriptor)
    (path,) = (tmp_path / 'nfo_sinus_driver').iterdir()
    spoilt = {'drive': drive, 'borrowed': {key: (borrowed, 2.0)}}
    path.write_text('[' * 65536 if borrowed is None else json.dumps(spoilt), encoding='utf-8')
    with by_default(connection, 2.0) as rig:
        rig.memory = StateFolder('/dev/ttyUSB0', lambda work: work())
        rig.begin()
        rig.connect()
        said = [event.text for event in rig.notes.events if says(event.text, Cause.NOT_REMEMBERED)]
        assert [f'check {key}' in text and str(path) in text for text in said] == (
            [True] if borrowed is None else []
        )
        rig.turn()
        rig.answer(rig.drive.stop())
        end(rig)
        assert not rig.turns and drive_timeout(rig) == 2.0


class Slow(ProcessMemory):
    """A memory that gives what it keeps, and takes for ever to keep more."""

    def write(self, drive: str, borrowed: Any) -> Future[Any]:
        return Future()


def test_9_a_stop_does_not_wait_for_the_disk() -> None:
    with by_default('rtu', 0.0) as rig:
        rig.memory = Slow()
        rig.begin()
        rig.connect()
        enabling = rig.drive.enable()
        rig.pass_time(0.3)
        assert not enabling.done()
        begun = rig.clock.now
        rig.answer(rig.drive.stop())
        assert rig.clock.now - begun < 0.1 and not rig.drive.following
