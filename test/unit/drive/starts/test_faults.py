# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every fault and alarm of both models, by each way to acknowledge; and drives that restart."""

from __future__ import annotations

import itertools

import pytest
from support.rig import Rig

from nfo_sinus_driver.catalog import Fact, Family, Kind, Meaning, load_family
from nfo_sinus_driver.drive import Cause, Procedure, Severity
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.sinus_g2.state_machine import TRIES

OVERLOAD, OVERHEATED, DC_LOW, SIO_FAIL = 5, 3, 7, 14
MODE, WORD, MASK = (f'fieldbus.{key}' for key in ('mode', 'drive_control', 'drv_ctrl_write_mask'))
CONNECTIONS = ('rtu', 'rtu, control word', 'optimal', 'optimal, control word')
every_connection = pytest.mark.parametrize('connection', CONNECTIONS)


def codes(model: Family, kind: Kind) -> list[int]:
    return [code for code in range(64) if model.status_code(code).kind is kind]


def show(rig: Rig, code: int) -> None:
    """Wait until the driver has published a code."""
    rig.wait_until(lambda: rig.notes.snapshot.status.code == code, 5.0)


@every_connection
def test_every_fault_is_shown_reported_and_acknowledged(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        known, by_word = load_family(rig.connection.model), 'word' in connection
        for code in codes(known, Kind.FAULT):
            listed = known.status_code(code)
            rig.notes.events.clear()
            rig.far.trip(code)
            show(rig, code)
            rig.wait_until(lambda: rig.notes.snapshot.kind is Kind.FAULT, 5.0)
            shown = rig.notes.snapshot
            assert (shown.text, shown.requires_ack, shown.description, shown.remedy) == (
                listed.text, listed.requires_ack, listed.description, listed.remedy
            )
            assert listed.remedy
            # reported once, whenever its entry in the log is; and nothing is enabled with it
            reported = [event.text for event in rig.notes.events if 'error log: ' not in event.text]
            assert reported == [
                f'fault {code} {listed.text}: {listed.description}. {listed.remedy}; '
                'then call ~/fault_ack'
            ]
            assert f'fault {code} {listed.text} is active' in rig.answer(rig.drive.enable())
            # a serial fault of a G2 is acknowledged by MODE = Stop alone [C99]
            by_mode = connection == 'rtu' and code == SIO_FAIL
            rig.acknowledged += not by_word and not by_mode
            assert rig.answer(rig.drive.acknowledge()) == f'acknowledged {code} {listed.text}'
            assert rig.far.faults.codes == []
            rig.wait_until(lambda: rig.notes.snapshot.kind is Kind.STATUS, 5.0)
            # a poll that had begun before is over: between its reads no other fault comes
            rig.pass_time(0.1)
        assert rig.far.control_unit.ack_reads == rig.acknowledged
        assert rig.far.control_unit.sio_err_reads == 0
        rig.wait_until(lambda: not rig.drive.stop_unconfirmed, 5.0)
        rig.enable()


@every_connection
def test_an_enable_is_told_of_the_fault_also_before_its_stop_is_confirmed(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn(25.0)
        rig.meet = lambda key, data: 'busy' if data is not None else None
        rig.far.trip(OVERLOAD)
        rig.wait_until(lambda: rig.drive.stop_unconfirmed, 1.0)
        commands = [rig.drive.enable()]
        if connection == 'rtu':
            commands.append(rig.drive.tune(Procedure.FULL))
        for command in commands:
            assert f'fault {OVERLOAD} Overload is active' in rig.answer(command)
            assert rig.drive.stop_unconfirmed


@pytest.mark.parametrize('connection', ['optimal', 'optimal, control word'])
def test_every_alarm_of_the_optimal_is_shown_and_reported_and_stops_nothing(
    connection: str,
) -> None:
    with Rig(connection, parameters={'control.accel': 1.0}) as rig:
        rig.turn(25.0)
        known = load_family('sinus_optimal')
        (limit,) = known.codes(Meaning.CURRENT_LIMIT)
        for code in codes(known, Kind.ALARM):
            if code == limit.code:
                continue
            listed = known.status_code(code)
            rig.notes.events.clear()
            before = len(rig.notes.snapshots)
            rig.far.trip(code)
            show(rig, code)
            rig.pass_time(0.3)
            assert [(event.severity, event.text) for event in rig.notes.events] == [(
                Severity.WARNING,
                f'alarm {code} {listed.text}: {listed.description}. {listed.remedy}',
            )]
            # never as a status, although bit and code are read one after the other
            later = rig.notes.snapshots[before:]
            shown = [snapshot for snapshot in later if snapshot.status.code == code]
            assert {snapshot.kind for snapshot in shown} == {Kind.ALARM}
            assert rig.drive.following
            rig.far.faults.acknowledge()
            rig.wait_until(lambda: rig.notes.snapshot.kind is Kind.STATUS, 5.0)


@pytest.mark.parametrize('connection', ['optimal', 'optimal, control word'])
def test_an_alarm_of_the_optimal_is_acknowledged_like_a_fault(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.far.trip(DC_LOW)
        rig.wait_until(lambda: rig.notes.snapshot.kind is Kind.ALARM, 5.0)
        assert Fact.ALARM in rig.notes.snapshot.status.facts
        rig.acknowledged = connection == 'optimal'
        assert rig.answer(rig.drive.acknowledge()) == f'acknowledged {DC_LOW} DC Low'
        assert rig.far.control_unit.ack_reads == rig.acknowledged
        assert rig.far.faults.codes == []
        rig.wait_until(lambda: rig.notes.snapshot.kind is Kind.STATUS, 5.0)


@every_connection
def test_what_was_acknowledged_and_what_still_stands(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.far.trip(OVERLOAD)
        rig.far.trip(OVERHEATED, cause_present=True)
        show(rig, OVERLOAD)
        rig.acknowledged = 10
        answer = rig.answer(rig.drive.acknowledge())
        assert answer.startswith('acknowledged 5 Overload, but 3 Temp Hi is still active: ')
        assert 'Let it cool' in answer
        assert rig.answer(rig.drive.acknowledge()).startswith('3 Temp Hi is still active: ')
        rig.far.faults.end_causes()
        assert rig.answer(rig.drive.acknowledge()) == 'acknowledged 3 Temp Hi'
        assert rig.answer(rig.drive.acknowledge()).startswith('nothing to acknowledge')


def test_reading_the_status_with_ack_acknowledges_once_and_writes_nothing() -> None:
    with Rig() as rig:
        rig.connect()
        rig.far.trip(OVERLOAD)
        rig.pass_time(0.3)
        rig.asked.clear()
        rig.acknowledged = 1
        rig.answer(rig.drive.acknowledge())
        assert rig.far.control_unit.ack_reads == 1
        assert rig.written(MODE) == rig.written(WORD) == []


def test_the_reset_bit_rises_once() -> None:
    for connection in ('rtu, control word', 'optimal, control word'):
        with Rig(connection) as rig:
            rig.connect()
            rig.far.trip(OVERLOAD)
            rig.pass_time(0.3)
            rig.asked.clear()
            rig.answer(rig.drive.acknowledge())
            if connection == 'rtu, control word':
                # by the mask: what another master has in its word stays, and nothing is read first
                masks = [data for _, key, data in rig.asked if key == MASK and data is not None]
                assert [mask[2:].hex() for mask in masks] == ['0000', '0080', '0000']
                words = [mask[2] << 8 | mask[3] for mask in masks]
                assert not any(mask[1] & 0x80 for mask in masks)
            else:
                words = rig.written(WORD)
            rises = [word & ~before & 0x80 for before, word in itertools.pairwise([0, *words])]
            assert sum(map(bool, rises)) == 1 and not words[-1] & 0x80
            assert rig.far.control_unit.ack_reads == 0


# --- drives that restart by themselves ------------------------------------------------------------

RESTARTS = {TRIES[OVERLOAD]: 3, 'error.rst_dly': 2, 'error.tr_time': 10}


def test_a_run_command_is_taken_back_before_the_drive_restarts() -> None:
    # by the control word, which a G2 takes in spite of a fault: it is how it is acknowledged
    options = {'refuses_in_fault': 'scmd'}
    with Rig('rtu, control word', parameters=RESTARTS, options=options) as rig:
        rig.turn()
        rig.far.trip(OVERLOAD)
        rig.pass_time(0.5)
        assert not rig.drive.following
        assert not rig.far.control_unit.word & 1
        rig.pass_time(3.0)
        assert rig.far.faults.codes == []
        rig.assert_only_enable_helps()


def test_a_drive_that_refuses_every_command_is_stopped_as_soon_as_it_restarts() -> None:
    # by SCMD, which a G2 refuses while a fault is active
    with Rig(parameters=RESTARTS) as rig:
        rig.turn()
        rig.far.trip(OVERLOAD)
        rig.pass_time(0.5)
        assert not rig.drive.following and rig.drive.state.control.blocked
        assert rig.far.control_unit.scmd == Scmd.FIELDBUS
        # its 2 s are over, and it runs again by itself
        rig.wait_until(lambda: rig.far.motor.driven, 3.0)
        before = len(rig.notes.snapshots)
        rig.wait_until(lambda: rig.far.control_unit.scmd == Scmd.STOP, 1.0)
        assert len(rig.notes.snapshots) - before <= 2
        rig.pass_time(1.0)
        for cause in (Cause.CANNOT_STOP, Cause.RUNS_UNASKED):
            assert not rig.notes.said(cause)
        assert rig.notes.said('the motor started by the run command that was still active')
        rig.assert_only_enable_helps()


def test_a_fault_that_is_over_before_a_poll_either_stops_the_run_or_changes_nothing() -> None:
    # it restarts at once: only the reaction to the fault shows, for 20 ms
    with Rig(parameters={**RESTARTS, 'error.rst_dly': 0}, poll_rate=5.0) as rig:
        rig.turn()
        for _ in range(3):
            rig.pass_time(0.07)
            rig.far.trip(OVERLOAD)
            rig.pass_time(2.0)
            assert not rig.far.faults.codes
            if rig.drive.following:
                assert abs(rig.far.motor.frequency - 20) < 0.5
            else:
                rig.assert_only_enable_helps()
        assert {entry.code for entry in rig.far.faults.log} == {OVERLOAD}
