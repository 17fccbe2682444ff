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


"""Nothing turns by itself: after whatever happened, somebody has to enable it again."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import RUN
from drive_rig import SCMD
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.addresses import Words

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import drive_state
from nfo_sinus_driver.drive import poller as watch_module
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused

OVERLOAD = 5


pytestmark = pytest.mark.usefixtures('hasty')


def assert_only_enable_helps(rig: Rig) -> None:
    """It stays still although set-points keep arriving, until somebody calls enable."""
    rig.assert_stays_still()
    assert rig.enable().startswith('enabled')
    rig.wait_for_frequency(20.0)


def wait_until_connected(rig: Rig) -> None:
    wait_until(lambda: rig.drive.snapshot.connected)


def test_fault(rig: Rig) -> None:
    rig.turn()
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for('stopped: fault 5 Overload')
    rig.notes.wait_for('~/enable to go on')
    rig.assert_stays_still()
    rig.acknowledged = 1
    rig.drive.acknowledge().result(PATIENCE)
    assert_only_enable_helps(rig)


def test_fault_that_somebody_else_acknowledges(rig: Rig) -> None:
    # the run command still stands in the drive: it would start by itself
    rig.turn()
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    with rig.simulator.lock:
        rig.far.faults.acknowledge()
        rig.far._settle()
    wait_until(lambda: rig.far.control_unit.scmd == Scmd.STOP)
    assert_only_enable_helps(rig)


def test_fault_that_ends_while_the_drive_is_polled_seldom(make_rig: MakeRig) -> None:
    rig = make_rig(poll_rate=0.02)
    rig.connect()
    rig.enable()
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    rig.simulator.inject('fault', OVERLOAD)
    # the drive refuses every command now, and its run command stands
    wait_until(lambda: rig.drive.blocked_by_fault)
    with rig.simulator.lock:
        rig.far.faults.acknowledge()
        rig.far._settle()
    wait_until(lambda: rig.far.control_unit.scmd == Scmd.STOP)
    rig.wait_until_still()


def test_fault_of_which_no_poll_knows(rig: Rig) -> None:
    # it comes and is acknowledged between two polls
    rig.turn()
    with rig.simulator.lock:
        rig.far.trip(OVERLOAD)
        rig.far.faults.acknowledge()
        rig.far.control_unit.command(Scmd.STOP)
        rig.far._settle()
    wait_until(lambda: not rig.drive.armed)
    assert_only_enable_helps(rig)


def test_run_input_lost_and_back(rig: Rig) -> None:
    rig.turn()
    rig.simulator.inject('run', 'off')
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for(Cause.STOPPED_BY_ITSELF, Severity.WARNING)
    rig.assert_stays_still()
    rig.simulator.inject('run', 'on')
    assert_only_enable_helps(rig)


def test_run_input_lost_for_a_moment(make_rig: MakeRig) -> None:
    # the drive ramps down meanwhile, and would go on
    rig = make_rig(parameters={'control.retard': 2.0})
    rig.turn()
    rig.simulator.inject('run', 'off')
    wait_until(lambda: not rig.drive.armed)
    rig.simulator.inject('run', 'on')
    assert_only_enable_helps(rig)


def test_stop_key(rig: Rig) -> None:
    rig.turn()
    rig.simulator.inject('keypad', 'stop')
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for(Cause.CONTROL_LOST, Severity.WARNING)
    assert_only_enable_helps(rig)


def test_keypad_that_takes_over_is_left_alone(rig: Rig) -> None:
    rig.turn()
    rig.simulator.inject('keypad', 'start')
    wait_until(lambda: not rig.drive.armed)
    published, polls = rig.published, len(rig.notes.snapshots)
    wait_until(
        lambda: rig.published >= published + 20 and len(rig.notes.snapshots) >= polls + 5
    )
    # whoever stands at the keypad runs it, and not the bus
    assert rig.far.motor.driven
    assert not rig.drive.armed
    rig.simulator.inject('keypad', 'stop')
    assert_only_enable_helps(rig)


def test_control_mode_changed_at_the_keypad(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch_module, '_MODE_PERIOD', 0.05)
    rig.turn()
    rig.simulator.inject('set', 'control.mode', 'Speed')
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for('the control mode was changed to Speed', Severity.WARNING)
    rig.assert_stays_still()


def test_power_cycle(make_rig: MakeRig) -> None:
    # silence of less than a time-out: it is never lost, yet another drive than before
    rig = make_rig(boot_time=0.1)
    rig.turn()
    rig.set_response_timeout(0.5)
    rig.simulator.inject('power-cycle')
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: rig.far.listening)
    wait_until_connected(rig)
    assert_only_enable_helps(rig)


def test_long_power_cycle(make_rig: MakeRig) -> None:
    rig = make_rig(retries=1)
    rig.turn()
    rig.set_response_timeout(0.1)
    rig.simulator.inject('power-cycle', 3600)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: not rig.drive.snapshot.connected)
    rig.notes.wait_for('retrying', Severity.ERROR)
    rig.set_response_timeout(2.0)
    rig.boot()
    wait_until_connected(rig)
    assert_only_enable_helps(rig)


def test_drive_that_restarts_by_itself(make_rig: MakeRig) -> None:
    # AutoStart with RUN active: the terminals start it, and that is not for the bus to end
    rig = make_rig(boot_time=0.1, parameters={'control.auto_start': True})
    rig.drive.connect().result(PATIENCE)
    rig.drive.activate()
    rig.enable()
    rig.publish(20.0)
    rig.wait_for_frequency(20.0)
    rig.wait_until_it_shows()
    rig.set_response_timeout(0.5)
    rig.simulator.inject('power-cycle')
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: rig.far.control_unit.mode is Mode.EXT)
    rig.next_snapshots(5)
    assert not rig.drive.armed
    assert rig.far.control_unit.mode is Mode.EXT


def test_line_that_is_dead_for_a_while(make_rig: MakeRig) -> None:
    rig = make_rig(retries=1)
    rig.turn()
    rig.set_response_timeout(0.1)
    rig.simulator.inject('line-dead', 3600)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: not rig.drive.snapshot.connected)
    rig.notes.wait_for('lost: ', Severity.ERROR)
    assert rig.drive.stop_unconfirmed
    # nobody could tell the drive: without a time-out of its own it runs on
    assert rig.far.motor.driven
    rig.set_response_timeout(2.0)
    rig.simulator.inject('heal')
    rig.wait_until_still()
    wait_until_connected(rig)
    assert_only_enable_helps(rig)


def test_port_that_is_unplugged_for_a_while(make_rig: MakeRig, tmp_path: Path) -> None:
    rig = make_rig(link=str(tmp_path / 'port'))
    rig.turn()
    rig.simulator.inject('hangup', 0.5)
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for('lost: ', Severity.ERROR)
    rig.wait_until_still()
    wait_until_connected(rig)
    assert rig.bus.statistics().reconnects >= 1
    assert_only_enable_helps(rig)


def test_time_out_of_the_drive(make_rig: MakeRig) -> None:
    # the drive stops by itself when the line is dead, and wants acknowledging
    rig = make_rig(retries=1, drive_timeout=20.0)
    rig.turn()
    rig.set_response_timeout(0.1)
    rig.simulator.inject('line-dead', 3600)
    rig.skip(21.0)
    rig.wait_until_still()
    assert rig.far.faults.codes
    wait_until(lambda: not rig.drive.snapshot.connected)
    rig.set_response_timeout(2.0)
    rig.simulator.inject('heal')
    wait_until_connected(rig)
    rig.assert_stays_still()
    rig.acknowledged = 1
    rig.drive.acknowledge().result(PATIENCE)
    assert_only_enable_helps(rig)


def test_bad_line_is_no_reason_to_stop(make_rig: MakeRig) -> None:
    rig = make_rig(lost_after=30.0)
    rig.turn(10.0)
    rig.set_response_timeout(0.5)
    for fault in ('noise', 'damage', 'drop', 'double', 'noise'):
        rig.simulator.inject(fault, 1)
        rig.next_snapshots(4)
    assert rig.drive.armed
    assert rig.drive.snapshot.frequency == pytest.approx(10.0, abs=0.11)
    figures = rig.bus.statistics()
    assert figures.timeouts + figures.damaged >= 1


def test_late_answers_are_never_taken_for_others(make_rig: MakeRig) -> None:
    rig = make_rig(retries=3)
    rig.turn(10.0)
    wait_until(lambda: rig.drive.snapshot.text == 'Bus Run' and rig.drive.snapshot.speed > 280)
    rig.set_response_timeout(0.05)
    before = len(rig.notes.snapshots)
    for _ in range(6):
        rig.simulator.inject('delay', 1, 0.08)
        rig.next_snapshots(3)
    # a word of status in the place of a frequency would show
    for snapshot in rig.notes.snapshots[before:]:
        if snapshot.status is not None and snapshot.enabled:
            assert snapshot.frequency == pytest.approx(10.0, abs=0.5)
            assert 270 < snapshot.speed < 310
            assert snapshot.status.code in range(24, 45)


def test_mistake_in_a_listener_stops_the_motor(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.turn()

    def mistake(*_: object) -> None:
        raise ZeroDivisionError

    good = rig.notes.on_snapshot
    monkeypatch.setattr(rig.notes, 'on_snapshot', mistake)
    monkeypatch.setattr(rig.notes, 'on_event', mistake)
    wait_until(lambda: not rig.drive.armed)
    rig.wait_until_still()
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    monkeypatch.setattr(rig.notes, 'on_snapshot', good)
    wait_until_connected(rig)
    assert_only_enable_helps(rig)


def test_set_point_that_the_drive_refuses(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    rig.turn()
    check = rig.far.memory.check

    def refuse(parameter, raw: int) -> None:
        if parameter.key == 'status.frq_set' and raw == 300:
            raise Refused(Reason.VALUE, 'as the test wants it')
        check(parameter, raw)

    monkeypatch.setattr(type(rig.far.memory), 'check', staticmethod(refuse))
    rig.publish(30.0)
    wait_until(lambda: not rig.drive.armed)
    rig.notes.wait_for('it refused set-point 30: ', Severity.WARNING)
    rig.assert_stays_still()


# --- who was here before, and who comes beside ----------------------------------------------------


def run_by_somebody_else(rig: Rig) -> None:
    """Run it over the bus, as another master does."""
    with rig.simulator.lock:
        rig.far.write_raw('fieldbus.mode', Mode.BUS)
        rig.far.write_raw('status.frq_set', 200)
        rig.far.write_raw('fieldbus.scmd', RUN)
        assert rig.far.motor.driven


def test_motor_that_runs_already_is_stopped(rig: Rig) -> None:
    # a driver that crashed has left it running
    run_by_somebody_else(rig)
    rig.wait_for_frequency(20.0)
    rig.connect()
    rig.publish(20.0)
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.assert_stays_still()
    assert rig.far.memory.raw('status.frq_set') == 0


def test_a_fault_that_holds_a_run_command_keeps_nobody_from_connecting(rig: Rig) -> None:
    # the stop that is refused must leave the line to others, although nothing is polled yet
    with rig.simulator.lock:
        rig.far.write_raw('fieldbus.mode', Mode.BUS)
        rig.far.write_raw('fieldbus.scmd', Scmd.FIELDBUS)
    rig.simulator.inject('fault', OVERLOAD)
    rig.connect()
    rig.acknowledged = 1
    rig.drive.acknowledge().result(PATIENCE)
    wait_until(lambda: rig.far.control_unit.scmd == Scmd.STOP and not rig.drive.stop_unconfirmed)


def test_motor_that_somebody_else_starts_is_stopped(rig: Rig) -> None:
    rig.connect()
    rig.publish(20.0)
    run_by_somebody_else(rig)
    rig.notes.wait_for(Cause.RUNS_UNASKED, Severity.WARNING)
    rig.wait_until_still()
    rig.assert_stays_still()


def test_motor_that_the_terminals_run_is_left_alone(rig: Rig) -> None:
    rig.simulator.inject('keypad', 'ext')
    rig.connect()
    rig.next_snapshots(5)
    assert rig.far.motor.driven
    assert rig.writes(SCMD) == rig.writes(MODE) == []


# --- a stop while it is being enabled -------------------------------------------------------------

Command = Callable[[Rig], Future[str]]
WAYS_TO_STOP: dict[str, Command] = {
    'stop': lambda rig: rig.drive.stop(),
    'quick_stop': lambda rig: rig.drive.quick_stop(),
    'deactivate': lambda rig: rig.drive.deactivate(),
    'disconnect': lambda rig: rig.drive.disconnect(PATIENCE),
}


def stopped_before(rig: Rig, way: str, moment: int) -> tuple[Future[str] | None, bool]:
    """Enable; stop before so many transactions. Return the stop, and whether it was enabled."""
    seen: list[tuple[int, Words | None]] = []
    stops: list[Future[str]] = []

    def before(register: int, words: Words | None) -> None:
        if len(seen) == moment:
            stops.append(WAYS_TO_STOP[way](rig))
        seen.append((register, words))

    rig.tap.before = before
    failure = rig.drive.enable().exception(PATIENCE)
    if stops:
        stops[0].result(PATIENCE)
    rig.tap.before = lambda register, words: None
    assert failure is None or isinstance(failure, DriveError)
    # the one that was about to be sent goes out; after it there is no run command
    assert (SCMD, (RUN,)) not in seen[moment + 1 :]
    return next(iter(stops), None), failure is None


@pytest.mark.parametrize('way', WAYS_TO_STOP)
def test_stop_at_any_moment_of_enabling(make_rig: MakeRig, way: str) -> None:
    # just before each transaction that enabling needs, one after the other; polls wait meanwhile
    rig = make_rig(poll_rate=2.0, telemetry_rate=0.0)
    rig.connect()
    for moment in range(100):
        stop, was_enabled = stopped_before(rig, way, moment)
        if stop is None:
            break
        wait_until(lambda: not rig.drive.stop_unconfirmed)
        rig.wait_until_still()
        assert not rig.drive.armed
        # the last word is no run command, and no run command stands
        assert rig.far.control_unit.scmd == Scmd.STOP
        commands = rig.writes(SCMD)
        assert not commands or commands[-1] == Scmd.STOP or rig.writes(MODE)[-1] == Mode.STOP
        if way == 'deactivate':
            rig.drive.activate()
        elif way == 'disconnect':
            rig.connect()
    assert moment >= 6, 'enabling takes more transactions than that'
    assert was_enabled


def test_stop_during_the_start_delay(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.run_dly': 20})
    rig.connect()
    enabling = rig.drive.enable()
    wait_until(lambda: rig.far.control_unit.inv_st == rig.far.control_unit.delayed)
    rig.publish(20.0)
    rig.drive.stop().result(PATIENCE)
    assert rig.refused(enabling) == 'it was stopped while it was being enabled'
    rig.skip(30.0)
    rig.assert_stays_still()


def test_stop_when_nobody_answers_is_tried_on_and_on(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = make_rig(retries=1)
    rig.turn()
    monkeypatch.setattr(drive_state, 'TIMEOUT', 0.5)
    rig.set_response_timeout(0.1)
    rig.simulator.inject('line-dead', 3600)
    message = rig.refused(rig.drive.stop())
    assert 'the stop is NOT confirmed' in message
    assert 'retrying' in message
    assert not rig.drive.armed
    assert rig.drive.stop_unconfirmed
    rig.notes.wait_for(Cause.CANNOT_STOP, Severity.ERROR)
    rig.notes.wait_for('emergency stop')
    rig.set_response_timeout(2.0)
    rig.simulator.inject('heal')
    rig.wait_until_still()
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    assert_only_enable_helps(rig)


def test_stop_while_the_drive_restarts(make_rig: MakeRig) -> None:
    # the stop gets no answer and then refusals, for the bus has lost control
    rig = make_rig()
    rig.turn()
    rig.set_response_timeout(0.2)
    rig.simulator.inject('power-cycle', 3600)
    assert 'NOT confirmed' in rig.refused(rig.drive.stop())
    rig.set_response_timeout(2.0)
    rig.boot()
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    assert not rig.drive.armed
    wait_until_connected(rig)
    assert_only_enable_helps(rig)


def test_exit_while_the_drive_restarts(
    make_rig: MakeRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the same, and nobody polls any more whose answers would tell
    rig = make_rig(retries=0)
    rig.turn()
    monkeypatch.setattr(drive_state, 'TIMEOUT', 0.2)
    rig.set_response_timeout(0.2)
    rig.simulator.inject('power-cycle', 3600)
    assert 'NOT confirmed' in rig.refused(rig.drive.disconnect(0.1))
    rig.boot()
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    assert not rig.drive.armed
    rig.wait_until_still()


def test_stop_that_is_refused_is_tried_on_and_on(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.turn()
    monkeypatch.setattr(drive_state, 'TIMEOUT', 0.3)

    def write_raw(key: str, raw: int) -> None:
        raise Refused(Reason.VALUE, 'as the test wants it')

    monkeypatch.setattr(rig.far, 'write_raw', write_raw)
    assert 'the stop is NOT confirmed' in rig.refused(rig.drive.stop())
    assert rig.far.motor.driven
    monkeypatch.undo()
    rig.wait_until_still()
    wait_until(lambda: not rig.drive.stop_unconfirmed)


def test_stop_reaches_the_line_ahead_of_everything(rig: Rig) -> None:
    # with set-points, polls, telemetry and others that ask without end
    rig.turn()
    seen: list[tuple[int, Words | None]] = []
    rig.tap.before = lambda register, words: seen.append((register, words))
    for _ in range(20):
        rig.drive.acknowledge()
    wait_until(lambda: len(seen) > 20)
    before = len(seen)
    rig.drive.stop().result(PATIENCE)
    place = seen.index((SCMD, (0,)), before)
    # what was on the line, what began before this thread got its turn, and then the stop
    assert place - before <= 5
