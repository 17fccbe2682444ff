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


"""Tuning through the driver, against the simulated drive's own state."""

from __future__ import annotations

from dataclasses import replace

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import SCMD
from drive_rig import MakeRig
from drive_rig import Notes
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.said import said

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive import Tuned
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.link import line_settings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.simulator.faults import LogEntry
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused
from nfo_sinus_driver.simulator.simulator import Simulator

COMMANDS = {
    Procedure.FULL: (Scmd.FULL_TUNING, '45 TuningOK'),
    Procedure.BASIC: (Scmd.BASIC_TUNING, '45 TuningOK'),
    Procedure.STATOR_RESISTANCE: (Scmd.RS_MEASURE, '46 RsMeasOK'),
    Procedure.CALCULATE: (Scmd.PAR_CALC, '47 ParClcOK'),
}


def begin(rig: Rig, procedure: Procedure = Procedure.FULL):
    """Have the drive tune, and wait until it does; however slow the machine, it goes on."""
    future = rig.drive.tune(procedure)
    wait_until(lambda: rig.far.control_unit.status_code == 28)
    lasts(rig, 3600.0)
    return future


def lasts(rig: Rig, seconds: float) -> None:
    """Have a procedure that goes on be over after so long from now."""
    with rig.simulator.lock:
        if rig.far.control_unit.tuning is not None:
            rig.far.control_unit.tuning.left = seconds


def finish(rig: Rig, future) -> Tuned:
    """Let the time of a procedure go by, and return how it ended."""
    lasts(rig, 0.0)
    return future.result(PATIENCE)


def mode(rig: Rig) -> int:
    with rig.simulator.lock:
        return rig.far.control_unit.mode


@pytest.mark.parametrize('procedure', COMMANDS)
def test_each_procedure_is_done_and_what_it_changed_is_told(rig: Rig, procedure) -> None:
    rig.connect()
    before = {key: rig.far.peek(key) for key in rig.far.settings}
    result = finish(rig, begin(rig, procedure))
    command, shown = COMMANDS[procedure]
    assert result.success
    assert shown in said(result.how)
    assert int(command) in rig.writes(SCMD)
    after = {key: rig.far.peek(key) for key in rig.far.settings}
    changed = {key: (before[key], after[key]) for key in after if before[key] != after[key]}
    assert changed
    assert {change.key: (change.old, change.new) for change in result.changes} == changed
    assert str(result.changes[0]) in said(result)


def use_variant(rig: Rig, **fields: str) -> None:
    with rig.simulator.lock:
        rig.far.control_unit.variant = replace(rig.far.control_unit.variant, **fields)


@pytest.mark.parametrize('procedure', COMMANDS)
def test_standby_after_a_tuning_is_success_where_something_was_measured(
    rig: Rig, procedure
) -> None:
    use_variant(rig, tuning_ends_in='standby')
    rig.connect()
    result = finish(rig, begin(rig, procedure))
    assert result.success and '37' in said(result.how)
    assert result.changes
    # the same again changes nothing, and standby may have come by a lost RUN input
    shown: list[int] = []
    future = rig.drive.tune(procedure, lambda now, _: shown.append(now.status.code))
    wait_until(lambda: 28 in shown)
    again = finish(rig, future)
    assert again.success == (procedure is Procedure.CALCULATE), said(again.report)


@pytest.mark.parametrize('end', ['stop', 'RUN input', 'fault'])
def test_a_tuning_that_was_ended_by_something_else_is_no_success(rig: Rig, end: str) -> None:
    use_variant(rig, tuning_ends_in='standby')
    rig.connect()
    future = begin(rig)
    with rig.simulator.lock:
        if end == 'stop':
            rig.far.control_unit.press('stop')
        elif end == 'RUN input':
            rig.far.set_run_input(False)
        else:
            rig.far.trip(12)
    assert not future.result(PATIENCE).success


def test_control_is_given_back_as_it_was_found(rig: Rig) -> None:
    rig.connect()
    assert finish(rig, begin(rig, Procedure.CALCULATE)).success
    assert mode(rig) == 1
    with rig.simulator.lock:
        rig.far.write_raw('fieldbus.mode', 3)
    assert finish(rig, begin(rig, Procedure.CALCULATE)).success
    assert mode(rig) == 3
    # and nothing stands that would keep the motor from being enabled
    assert rig.far.control_unit.status_code == 37
    rig.enable()


def test_mode_inhibit_is_nobody_elses_take_over_and_the_status_flows(rig: Rig) -> None:
    rig.connect()
    future = begin(rig)
    assert mode(rig) == 0
    wait_until(lambda: rig.drive.snapshot.text == 'Tuning')
    rig.next_snapshots(10)
    assert not future.done()
    assert not rig.notes.told('stopped')
    assert not rig.drive.stop_unconfirmed
    # the run command was not taken back behind the tuning
    assert rig.writes(SCMD)[-1] == Scmd.FULL_TUNING
    assert finish(rig, future).success


def test_the_parameters_are_known_anew(rig: Rig) -> None:
    rig.drive.connect(parameters=True).result(PATIENCE)
    rig.drive.activate()
    old = rig.drive.parameters.values['motor.r_stat']
    rig.notes.news.clear()
    result = finish(rig, begin(rig, Procedure.STATOR_RESISTANCE))
    new = rig.drive.parameters.values['motor.r_stat']
    assert [(one.key, one.old, one.new) for one in result.changes] == [('motor.r_stat', old, new)]
    assert new == rig.far.peek('motor.r_stat') != old
    assert 'motor.r_stat' in rig.notes.news
    # told once, as the result, and not as a change by somebody else
    assert not rig.notes.told(Cause.CHANGED_AT_DRIVE)


def test_parameters_are_not_changed_meanwhile(rig: Rig) -> None:
    rig.drive.connect(parameters=True).result(PATIENCE)
    rig.drive.activate()
    future = begin(rig)
    message = rig.refused(rig.drive.parameters.change({'control.accel': 7.0}))
    assert 'the drive is tuning' in message
    assert finish(rig, future).success
    rig.drive.parameters.change({'control.accel': 7.0}).result(PATIENCE)


@pytest.mark.parametrize(('code', 'text'), [(16, '16 TunFailP'), (17, '17 TunFailM')])
def test_a_failure_is_told_in_the_words_of_the_drive(rig: Rig, code: int, text: str) -> None:
    rig.connect()
    rig.simulator.inject('tuning-fails', code)
    result = finish(rig, begin(rig))
    assert not result.success
    assert text in said(result.how) and 'fault_ack' in said(result.how)
    assert result.changes == ()
    # the fault keeps the next one from beginning, until somebody acknowledges it
    assert text in rig.refused(rig.drive.tune(Procedure.FULL))
    rig.acknowledged += 1
    rig.drive.acknowledge().result(PATIENCE)
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    assert finish(rig, begin(rig)).success


def test_cancelling_stops_it(rig: Rig) -> None:
    rig.connect()
    future = begin(rig)
    rig.drive.cancel_tuning().result(PATIENCE)
    assert rig.far.control_unit.status_code != 28
    result = future.result(PATIENCE)
    assert not result.success
    assert 'was stopped' in said(result.how)
    assert mode(rig) == 1
    # with nothing to cancel, nothing happens: not even to a motor that runs
    rig.turn()
    rig.drive.cancel_tuning().result(PATIENCE)
    assert rig.drive.armed


@pytest.mark.parametrize('way', ['stop', 'quick_stop', 'deactivate', 'disconnect'])
def test_every_way_out_ends_it(rig: Rig, way: str) -> None:
    rig.connect()
    future = begin(rig)
    if way == 'quick_stop':
        # MODE cannot be written meanwhile, so it ends as an ordinary stop does
        assert 'NOT confirmed' in rig.answer(rig.drive.quick_stop())
    else:
        rig.answer(rig.drive.disconnect(1.0) if way == 'disconnect' else getattr(rig.drive, way)())
    wait_until(lambda: rig.far.control_unit.status_code != 28)
    rig.answer(future)
    assert rig.far.control_unit.tuning is None
    assert not rig.far.motor.driven


def test_a_drive_that_takes_no_stop_meanwhile_is_told_of(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = rig.far.control_unit._write_scmd

    def stubborn(raw: int) -> None:
        if rig.far.control_unit.tuning is not None:
            raise Refused(Reason.STATE, 'tuning')
        write(raw)

    monkeypatch.setattr(rig.far.control_unit, '_write_scmd', stubborn)
    rig.connect()
    future = begin(rig)
    message = rig.refused(rig.drive.stop())
    assert 'NOT confirmed' in message and '28 Tuning' in message
    assert rig.drive.stop_unconfirmed
    lasts(rig, 0.0)
    rig.answer(future)
    wait_until(lambda: not rig.drive.stop_unconfirmed)


def test_the_keypad_ends_it(rig: Rig) -> None:
    rig.connect()
    future = begin(rig)
    with rig.simulator.lock:
        rig.far.control_unit.press('stop')
    result = future.result(PATIENCE)
    assert not result.success and '24 Stop' in said(result.how)
    assert mode(rig) == 1


def test_without_the_run_input_it_does_not_begin(make_rig: MakeRig) -> None:
    rig = make_rig(run_input=False)
    rig.connect()
    result = rig.drive.tune(Procedure.FULL).result(PATIENCE)
    assert not result.success and 'RUN input' in said(result.how)
    assert mode(rig) == 1


def test_the_run_input_lost_ends_it(rig: Rig) -> None:
    rig.connect()
    future = begin(rig)
    rig.next_snapshots(20)
    with rig.simulator.lock:
        rig.far.set_run_input(False)
    result = future.result(PATIENCE)
    assert not result.success and 'has changed no parameter' in said(result.how)


def test_a_drive_that_is_lost_meanwhile_is_stopped_when_it_is_back(
    make_rig: MakeRig, hasty: None
) -> None:
    rig = make_rig(retries=0)
    rig.connect()
    future = begin(rig)
    rig.set_response_timeout(0.02)
    rig.simulator.inject('silence', 3600.0)
    assert 'did not answer' in rig.refused(future)
    wait_until(lambda: not rig.drive.snapshot.connected)
    rig.set_response_timeout(2.0)
    with rig.simulator.lock:
        assert rig.far.control_unit.status_code == 28, 'it should still be at it'
        rig.far._silent_left = 0.0
    wait_until(lambda: rig.far.control_unit.status_code != 28 and not rig.drive.stop_unconfirmed)
    assert not rig.drive.armed


def test_not_two_at_a_time(rig: Rig) -> None:
    rig.connect()
    future = begin(rig)
    assert 'is going on already' in rig.refused(rig.drive.tune(Procedure.BASIC))
    assert 'is going on already' in rig.refused(rig.drive.erase_error_log())
    assert 'is going on' in rig.refused(rig.drive.enable())
    assert finish(rig, future).success


def test_refused_while_the_motor_is_enabled(rig: Rig) -> None:
    rig.turn()
    assert 'the motor is enabled' in rig.refused(rig.drive.tune(Procedure.FULL))
    assert rig.drive.armed
    assert Scmd.FULL_TUNING not in rig.writes(SCMD)


def test_refused_while_the_motor_ramps_down(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.retard': 60.0, 'control.st_mode': 'Brake'})
    rig.turn()
    rig.drive.stop().result(PATIENCE)
    message = rig.refused(rig.drive.tune(Procedure.FULL))
    assert 'the motor runs' in message, message


def test_refused_while_a_fault_stands(rig: Rig) -> None:
    rig.connect()
    rig.simulator.inject('fault', 5)
    assert 'fault 5 Overload is active' in rig.refused(rig.drive.tune(Procedure.FULL))


def test_refused_while_the_terminals_have_control(rig: Rig) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.set_run_input(False)
        rig.far.control_unit.press('ext')
    assert 'press STOP at the drive first' in rig.refused(rig.drive.tune(Procedure.FULL))
    assert rig.writes(MODE) == []


def test_refused_without_motor_data(rig: Rig) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.memory.put('motor.n_nom', 0)
    assert 'motor.n_nom' in rig.refused(rig.drive.tune(Procedure.FULL))
    assert rig.writes(MODE) == []


def test_refused_while_not_active(rig: Rig) -> None:
    rig.drive.connect().result(PATIENCE)
    assert 'not active' in rig.refused(rig.drive.tune(Procedure.FULL))


@pytest.mark.parametrize(
    ('settings', 'reason'),
    [
        ({'control_method': 'monitor'}, 'only reads'),
        ({'control_method': 'drive_control'}, 'does not mix control methods'),
        ({'model': 'sinus_optimal'}, 'not known of this model'),
    ],
)
def test_refused_where_there_is_no_such_command(make_rig: MakeRig, settings, reason) -> None:
    rig = make_rig(**settings)
    rig.connect()
    assert reason in rig.refused(rig.drive.tune(Procedure.FULL))
    assert reason in rig.refused(rig.drive.reset_energy())
    assert reason in rig.refused(rig.drive.erase_error_log())


@pytest.mark.parametrize('dialect', ['2.03', '5.0'])
def test_over_classic(dialect: str) -> None:
    simulator = Simulator(protocol='classic', dialect=dialect, boot_time=0.2)
    line = line_settings('classic', baud_rate=9600, response_timeout=2.0)
    settings = DriveSettings(classic_dialect=f'v{dialect}')
    with simulator:
        bus = Bus(open_link('classic', simulator.port, line))
        bus.start()
        try:
            drive = Drive(bus, settings, Notes())
            drive.connect().result(PATIENCE)
            drive.activate()
            with simulator.lock:
                simulator.drives[1].faults.log[:] = [LogEntry(5, 1200.0 - n) for n in range(40)]
            entries = drive.error_log(40).result(PATIENCE)
            assert len(entries) == (40 if dialect == '5.0' else 32)
            assert entries[0].operating_time == 1200.0
            assert entries[0].age == pytest.approx(34.5, abs=0.2)
            assert said(drive.erase_error_log().result(PATIENCE))
            tuned = drive.tune(Procedure.CALCULATE).result(PATIENCE)
            assert tuned.success and '47 ParClcOK' in said(tuned.how)
            assert tuned.changes
            assert simulator.drives[1].control_unit.mode == 1
            assert not simulator.drives[1].faults
        finally:
            bus.close()
