# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Tuning, against the simulated drive's own state."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import itertools
from typing import Any

import pytest
from support.rig import CONNECTIONS, Rig
from support.said import said

from nfo_sinus_driver.drive import Cause, Drive, Procedure, Snapshot, Tuned
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd

MODE, SCMD = 'fieldbus.mode', 'fieldbus.scmd'
TUNING = 28
COMMANDS = {
    Procedure.FULL: (Scmd.FULL_TUNING, 45, 'TuningOK'),
    Procedure.BASIC: (Scmd.BASIC_TUNING, 45, 'TuningOK'),
    Procedure.STATOR_RESISTANCE: (Scmd.RS_MEASURE, 46, 'RsMeasOK'),
    Procedure.CALCULATE: (Scmd.PAR_CALC, 47, 'ParClcOK'),
}
every_connection = pytest.mark.parametrize(
    'connection',
    [
        name
        for name, connection in CONNECTIONS.items()
        if (connection.model, connection.method) == ('sinus_g2', 'mode_scmd')
    ],
)


def begin(rig: Rig, procedure: Procedure = Procedure.FULL) -> Future[Tuned]:
    """Have the drive tune, and wait until it does."""
    future = rig.drive.tune(procedure)
    rig.wait_until(lambda: rig.far.control_unit.status_code == TUNING)
    return future


def mode_at_rest(rig: Rig) -> Mode:
    """Where control is when the bus has none: a CANopen module holds it."""
    return Mode.BUS if rig.connection.protocol == 'canopen' else Mode.STOP


@every_connection
def test_each_procedure_is_done_and_what_it_changed_is_reported(connection: str) -> None:
    # the long ones once
    for procedure in COMMANDS if connection == 'rtu' else list(COMMANDS)[2:]:
        command, code, text = COMMANDS[procedure]
        with Rig(connection, poll_rate=5.0).connect() as rig:
            news: list[tuple[Snapshot, float]] = []
            before = {key: rig.far.peek(key) for key in rig.far.settings}
            future = rig.drive.tune(procedure, lambda *told, news=news: news.append(told))
            result = rig.result(future)
            assert result.success and f'{code} {text}' in said(result.how)
            written = rig.written(SCMD)
            assert written[written.index(command) - 1] == Scmd.STOP
            after = {key: rig.far.peek(key) for key in rig.far.settings}
            changed = {key: (before[key], after[key]) for key in after if before[key] != after[key]}
            assert changed
            assert {change.key: (change.old, change.new) for change in result.changes} == changed
            assert str(result.changes[0]) in said(result)
            # every stage, as the drive reports
            codes = list(dict.fromkeys(status.status.code for status, _ in news if status.status))
            assert codes[-1] == code and news[-1][0].text == text
            assert TUNING in codes or procedure is Procedure.CALCULATE
            times = [elapsed for _, elapsed in news]
            assert times == sorted(times)
            assert rig.far.control_unit.mode == mode_at_rest(rig)
            assert not rig.far.faults


@pytest.mark.parametrize('procedure', COMMANDS)
def test_standby_after_a_tuning_is_success_where_something_was_measured(
    procedure: Procedure,
) -> None:
    with Rig(options={'tuning_ends_in': 'standby'}).connect() as rig:
        result = rig.result(rig.drive.tune(procedure))
        assert result.success and '37' in said(result.how)
        assert result.changes
        # the same again changes nothing, and standby may have come by a lost RUN input
        again = rig.result(rig.drive.tune(procedure))
        assert again.success == (procedure is Procedure.CALCULATE), said(again.report)


@pytest.mark.parametrize('ends_in', ['code', 'standby'])
def test_a_tuning_that_was_ended_by_something_else_is_no_success(ends_in: str) -> None:
    wrong = {}
    for end, act, text in (
        ('STOP key', lambda rig: rig.far.control_unit.press('stop'), '24 Stop'),
        ('RUN input', lambda rig: rig.far.set_run_input(False), 'has changed no parameter'),
        ('fault', lambda rig: rig.far.trip(12), 'fault_ack'),
        ('no RUN input', None, 'RUN input'),
    ):
        options = {'tuning_ends_in': ends_in, 'run_input': act is not None}
        with Rig(options=options).connect() as rig:
            future = rig.drive.tune(Procedure.FULL)
            rig.pass_time(2.0)
            if act:
                assert rig.far.control_unit.status_code == TUNING
                act(rig)
            result = rig.result(future)
            if end == 'fault':
                rig.acknowledged = 1
                rig.answer(rig.drive.acknowledge())
            if result.success or text not in said(result.how) or rig.far.control_unit.mode != 1:
                wrong[end] = said(result.how)
    assert not wrong


def test_mode_inhibit_is_no_take_over_and_control_is_given_back_as_it_was_found() -> None:
    with Rig().connect() as rig:
        rig.far.write_raw(MODE, Mode.BUS)
        future = begin(rig)
        assert rig.far.control_unit.mode == Mode.INHIBIT
        rig.pass_time(2.0)
        assert rig.drive.snapshot.text == 'Tuning'
        assert not future.done()
        assert not rig.notes.said('stopped') and not rig.drive.stop_unconfirmed
        # the run command was not removed behind the tuning
        assert rig.written(SCMD)[-1] == Scmd.FULL_TUNING
        assert rig.result(future).success
        assert rig.far.control_unit.mode == Mode.BUS
        # and nothing stands that would keep the motor from being enabled
        rig.enable()


def test_the_parameters_are_known_anew_and_not_changed_meanwhile() -> None:
    with Rig().connect(parameters=True) as rig:
        old = rig.drive.parameters.values['motor.r_stat']
        rig.notes.parameters.clear()
        future = begin(rig, Procedure.STATOR_RESISTANCE)
        message = rig.answer(rig.drive.parameters.change({'control.accel': 7.0}))
        assert 'the drive is tuning' in message
        result = rig.result(future)
        new = rig.drive.parameters.values['motor.r_stat']
        assert [(change.key, change.old, change.new) for change in result.changes] == [
            ('motor.r_stat', old, new)
        ]
        assert new == rig.far.peek('motor.r_stat') != old
        assert 'motor.r_stat' in rig.notes.parameters
        # said once, as the result, and not as a change by others
        assert not rig.notes.said(Cause.CHANGED_AT_DRIVE)
        rig.result(rig.drive.parameters.change({'control.accel': 7.0}))


@every_connection
def test_a_failure_is_said_in_the_words_of_the_drive(connection: str) -> None:
    with Rig(connection, poll_rate=5.0).connect() as rig:
        for code, text in ((16, '16 TunFailP'), (17, '17 TunFailM')):
            rig.far.control_unit.fail_tuning(code)
            result = rig.result(rig.drive.tune(Procedure.STATOR_RESISTANCE))
            assert not result.success and result.changes == ()
            assert text in said(result.how) and 'fault_ack' in said(result.how)
            # the fault keeps the next one from beginning, until it is acknowledged
            assert f'{text} is active' in rig.answer(rig.drive.tune(Procedure.FULL))
            rig.acknowledged += 1
            assert rig.answer(rig.drive.acknowledge()) == f'acknowledged {text}'
        assert rig.result(rig.drive.tune(Procedure.CALCULATE)).success


@every_connection
def test_cancelling_stops_it(connection: str) -> None:
    with Rig(connection).connect() as rig:
        future = begin(rig)
        rig.answer(rig.drive.cancel_tuning())
        assert rig.far.control_unit.tuning is None
        result = rig.result(future)
        assert not result.success and 'was stopped' in said(result.how)
        assert rig.far.control_unit.mode == mode_at_rest(rig)
        # with nothing to cancel, nothing happens: not even to a motor that runs
        rig.enable()
        rig.answer(rig.drive.cancel_tuning())
        assert rig.drive.following


@pytest.mark.parametrize('out', ['stop', 'quick_stop', 'deactivate', 'disconnect'])
def test_every_way_out_ends_it(out: str) -> None:
    with Rig().connect() as rig:
        future = begin(rig)
        answer = rig.answer(getattr(rig.drive, out)(*(1.0,) * (out == 'disconnect')))
        # MODE cannot be written meanwhile, so it ends as an ordinary stop does
        assert ('NOT confirmed' in answer) == (out == 'quick_stop')
        rig.pass_time(1.0)
        assert rig.far.control_unit.tuning is None and not rig.far.motor.driven
        assert future.done()


def test_a_drive_that_is_lost_meanwhile_is_stopped_when_it_is_back() -> None:
    with Rig().connect() as rig:
        future = begin(rig)
        rig.far.control_unit.tuning.left = 3600.0
        rig.line.state = 'silent'
        assert 'did not answer' in rig.answer(future)
        rig.pass_time(3.0)
        assert rig.far.control_unit.status_code == TUNING
        rig.line.mend()
        rig.pass_time(8.0)
        assert rig.far.control_unit.status_code != TUNING
        assert not rig.drive.stop_unconfirmed and not rig.drive.following


def test_not_two_at_a_time() -> None:
    with Rig().connect() as rig:
        future = begin(rig)
        assert 'is going on already' in rig.answer(rig.drive.tune(Procedure.BASIC))
        assert 'is going on already' in rig.answer(rig.drive.erase_error_log())
        assert 'is going on' in rig.answer(rig.drive.enable())
        assert rig.result(future).success


def ramps_down(rig: Rig) -> None:
    rig.far.memory.set('control.retard', 60.0)
    rig.turn()
    rig.send(None)
    rig.answer(rig.drive.stop())


def has_terminals(rig: Rig) -> None:
    rig.far.set_run_input(False)
    rig.far.control_unit.press('ext')


def is_tuned_by_another(rig: Rig) -> None:
    rig.far.write_raw(MODE, Mode.BUS)
    rig.far.write_raw(SCMD, Scmd.RS_MEASURE)


REFUSED: list[tuple[Callable[[Rig], object], str]] = [
    (Rig.enable, 'the motor is enabled'),
    (ramps_down, 'the motor runs'),
    (lambda rig: rig.far.control_unit.press('start'), 'the motor runs'),
    (lambda rig: rig.far.trip(5), 'fault 5 Overload is active'),
    (has_terminals, 'press STOP at the drive first'),
    (is_tuned_by_another, 'MODE is Inhibit'),
    (
        lambda rig: rig.far.memory.put('motor.n_nom', 0),
        'motor.n_nom: set it as the motor plate says',
    ),
    (lambda rig: rig.answer(rig.drive.deactivate()), 'not active'),
]


def test_refused() -> None:
    wrong = []
    for lead, text in REFUSED:
        with Rig().connect() as rig:
            lead(rig)
            before = rig.far.motor.driven, rig.drive.following
            answer = rig.answer(rig.drive.tune(Procedure.FULL))
            driven = rig.far.motor.driven, rig.drive.following
            if text not in answer or driven != before or Scmd.FULL_TUNING in rig.written(SCMD):
                wrong.append(answer)
    assert not wrong


def test_refused_where_there_is_no_such_command() -> None:
    wrong = []
    for connection, settings, reason in (
        ('rtu', {'control_method': 'monitor'}, 'only reads'),
        ('rtu, control word', {}, 'does not mix control methods'),
        ('optimal', {}, 'is not known of this model'),
        ('movitrac', {}, 'is not known of this model'),
    ):
        with Rig(connection, **settings).connect() as rig:
            drive = rig.drive
            rig.asked.clear()
            for command in (
                drive.tune(Procedure.FULL), drive.reset_energy(), drive.erase_error_log()
            ):
                answer = rig.answer(command)
                if reason not in answer or any(data is not None for _, _, data in rig.asked):
                    wrong.append((connection, answer))
    assert not wrong


def test_none_is_begun_once_the_driver_ends() -> None:
    with Rig().connect() as rig:
        rig.result(rig.drive.stop_for_good(2.0))
        rig.asked.clear()
        for command in (rig.drive.reset_energy(), rig.drive.erase_error_log()):
            assert Cause.ENDING in rig.answer(command).causes
        assert all(data is None for _, _, data in rig.asked)


# --- while it is being prepared -------------------------------------------------------------------

STOPS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'cancel': lambda drive: drive.cancel_tuning(),
    'deactivate': lambda drive: drive.deactivate(),
    'for good': lambda drive: drive.stop_for_good(2.0),
}


def tuned_until_stopped(moment: int) -> bool:
    """Have a drive tune, and stop it at so many requests; return whether it had begun by then."""
    requests = itertools.count()
    stop = list(STOPS.values())[moment % len(STOPS)]
    stops: list[Future[Any]] = []
    begun = False

    def act(key: str, data: bytes | None) -> None:
        nonlocal begun
        begun = begun or (key, data) == (SCMD, Scmd.FULL_TUNING.to_bytes(2, 'big'))
        if next(requests) == moment:
            stops.append(stop(rig.drive))

    with Rig(poll_rate=1.0, telemetry_rate=0.0) as rig:
        rig.result(rig.drive.connect())
        rig.drive.activate()
        rig.meet = act
        tuning = rig.drive.tune(Procedure.FULL)
        rig.wait_until(lambda: stops)
        had_begun = begun
        rig.answer(stops[0])
        rig.pass_time(0.5)
        # what only waits for the line by then is kept off it
        assert rig.written(SCMD).count(Scmd.FULL_TUNING) == had_begun, moment
        assert 'stopped' in rig.answer(tuning, 0.1), moment
        assert rig.far.control_unit.status_code != TUNING, moment
    return had_begun


def test_a_stop_at_any_moment_of_the_preparation_ends_the_tuning() -> None:
    moment = 0
    while not tuned_until_stopped(moment):
        moment += 1
    assert moment > 10


def test_a_busy_drive_is_asked_again_to_tune_for_a_while_but_not_after_a_stop() -> None:
    with Rig().connect() as rig:
        calculate = (SCMD, Scmd.PAR_CALC.to_bytes(2, 'big'))
        busy: list[float] = []

        def tune(times: int) -> Future[Any]:
            busy.clear()

            def meet(key: str, data: bytes | None) -> str | None:
                if (key, data) != calculate or len(busy) == times:
                    return None
                busy.append(rig.clock.now)
                return 'busy'

            rig.meet = meet
            return rig.drive.tune(Procedure.CALCULATE)

        assert '47 ParClcOK' in rig.answer(tune(4))
        assert len(busy) == 4
        assert 'the drive is busy' in rig.answer(tune(10_000))
        assert 0.4 < busy[-1] - busy[0] < 0.6
        # a line that others need, too, is not filled by it
        assert len(busy) < 15 and not rig.drive.stop_unconfirmed
        tuning = tune(2)
        rig.wait_until(lambda: busy)
        before, written = len(busy), rig.written(SCMD).count(Scmd.PAR_CALC)
        rig.answer(rig.drive.stop())
        assert 'was stopped' in rig.answer(tuning)
        assert len(busy) == before and rig.written(SCMD).count(Scmd.PAR_CALC) == written
