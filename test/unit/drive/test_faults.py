# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every fault and alarm of both models, by each way to acknowledge; and drives that restart."""

from __future__ import annotations

import itertools

from drive_rig import PATIENCE, MakeRig, Rig, wait_until
import pytest
from support.said import said

from nfo_sinus_driver.catalog import Family, Kind, Meaning, load_family
from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.sinus_g2.self_restart import TRIES

OVERLOAD, OVERHEATED, SIO_FAIL = 5, 3, 14
MODE, CONTROL, MASK = 0x294, 0x254, 0x250
WITH_ACK = 0x2A4

WAYS = [
    ('sinus_g2', 'mode_scmd', 'fieldbus'),
    ('sinus_g2', 'drive_control', 'fieldbus'),
    ('sinus_optimal', 'mode_scmd', 'fieldbus'),
    ('sinus_optimal', 'drive_control', 'terminal'),
]
every_way = pytest.mark.parametrize(('model', 'method', 'reference'), WAYS, ids=map('-'.join, WAYS))

pytestmark = pytest.mark.usefixtures('hasty')


def codes(model: Family, kind: Kind) -> list[int]:
    return [code for code in range(64) if model.status_code(code).kind is kind]


def show(rig: Rig, code: int) -> None:
    """Wait until the driver has published a code."""
    rig.next_snapshots(1)
    wait_until(lambda: rig.notes.snapshots[-1].status.code == code)


@every_way
def test_every_fault(make_rig: MakeRig, model: str, method: str, reference: str) -> None:
    rig = make_rig(model=model, control_method=method, reference=reference)
    rig.connect()
    rig.enable()
    rig.drive.stop().result(PATIENCE)
    known = load_family(model)
    rig.next_snapshots(2)
    for code in codes(known, Kind.FAULT):
        listed = known.status_code(code)
        rig.notes.events.clear()
        rig.simulator.inject('fault', code)
        show(rig, code)
        wait_until(lambda: rig.notes.snapshots[-1].kind is Kind.FAULT)
        told = rig.notes.snapshots[-1]
        assert (told.kind, told.text) == (Kind.FAULT, listed.text)
        assert told.requires_ack is listed.requires_ack
        assert told.description == listed.description
        assert told.remedy == listed.remedy != ''
        # told once, whenever its entry in the log is; and nothing can be enabled with it
        told_of = [text for _, text in rig.notes.events if not text.startswith('error log: ')]
        assert told_of == [
            f'fault {code} {listed.text}: {listed.description}. {listed.remedy}; '
            'then call ~/fault_ack'
        ]
        assert f'fault {code} {listed.text} is active' in rig.refused(rig.drive.enable())
        # a serial fault of a G2 is acknowledged by MODE = Stop alone [C99]
        by_mode = model == 'sinus_g2' and code == SIO_FAIL
        rig.acknowledged += method == 'mode_scmd' and not by_mode
        answer = said(rig.drive.acknowledge().result(PATIENCE))
        assert answer == f'acknowledged {code} {listed.text}'
        assert rig.far.faults.codes == []
        wait_until(lambda: rig.notes.snapshots[-1].kind is Kind.STATUS)
    assert rig.far.control_unit.ack_reads == (rig.acknowledged if method == 'mode_scmd' else 0)
    assert rig.far.control_unit.sio_err_reads == 0
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    assert rig.enable().startswith('enabled')


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
def test_every_alarm_of_the_optimal(make_rig: MakeRig, method: str) -> None:
    rig = make_rig(
        model='sinus_optimal',
        control_method=method,
        reference='terminal',
        parameters={'control.accel': 1.0},
    )
    rig.connect()
    rig.enable()
    rig.wait_for_frequency(25.0)
    rig.wait_until_it_shows()
    known = load_family('sinus_optimal')
    (limit,) = known.codes(Meaning.CURRENT_LIMIT)
    for code in codes(known, Kind.ALARM):
        if code == limit.code:
            continue
        listed = known.status_code(code)
        rig.notes.events.clear()
        rig.simulator.inject('fault', code)
        show(rig, code)
        wait_until(lambda: rig.notes.snapshots[-1].kind is Kind.ALARM)
        wait_until(lambda: rig.notes.events)
        assert rig.notes.events == [
            (
                Severity.WARNING,
                f'alarm {code} {listed.text}: {listed.description}. {listed.remedy}',
            )
        ]
        # never as a status, although bit and code are read one after the other
        alarms = [one for one in rig.notes.snapshots if one.status and one.status.code == code]
        assert {one.kind for one in alarms} == {Kind.ALARM}
        assert rig.drive.armed
        with rig.simulator.lock:
            rig.far.faults.acknowledge()
        wait_until(lambda: rig.notes.snapshots[-1].kind is Kind.STATUS)


@every_way
def test_what_was_acknowledged_and_what_still_stands(
    make_rig: MakeRig, model: str, method: str, reference: str
) -> None:
    rig = make_rig(model=model, control_method=method, reference=reference)
    rig.connect()
    rig.simulator.inject('fault', OVERLOAD)
    rig.simulator.inject('fault', OVERHEATED, standing=True)
    show(rig, OVERLOAD)
    rig.acknowledged = 10
    message = rig.refused(rig.drive.acknowledge())
    assert message.startswith('acknowledged 5 Overload, but 3 Temp Hi is still active: ')
    assert 'Let it cool' in message
    message = rig.refused(rig.drive.acknowledge())
    assert message.startswith('3 Temp Hi is still active: ')
    rig.simulator.inject('ack-cause-gone')
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 3 Temp Hi'
    assert said(rig.drive.acknowledge().result(PATIENCE)).startswith('nothing to acknowledge')


def test_reading_the_status_with_ack_acknowledges_once(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.connect()
    rig.simulator.inject('fault', OVERLOAD)
    rig.acknowledged = 1
    rig.drive.acknowledge().result(PATIENCE)
    assert rig.far.control_unit.ack_reads == 1
    assert rig.writes(MODE) == rig.writes(CONTROL) == []


def test_mode_stop_ends_a_serial_fault(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.turn()
    rig.simulator.inject('fault', SIO_FAIL)
    wait_until(lambda: not rig.drive.armed)
    rig.acknowledged = 1
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 14 Sio Fail'
    assert rig.writes(MODE)[-1] == 1
    rig.assert_stays_still()


def rises(words: list[int]) -> int:
    """How often bit 7 rises in what was written to the control word."""
    return sum(bool(two & ~one & 0x80) for one, two in itertools.pairwise(words))


def test_the_reset_bit_of_an_optimal_rises_once(make_rig: MakeRig) -> None:
    rig = make_rig(model='sinus_optimal', control_method='drive_control', reference='terminal')
    rig.connect()
    rig.simulator.inject('fault', OVERLOAD)
    rig.drive.acknowledge().result(PATIENCE)
    words = rig.writes(CONTROL)
    assert rises(words) == 1
    assert not words[-1] & 0x80
    assert rig.far.control_unit.ack_reads == 0


def test_the_reset_bit_of_a_g2_rises_once(make_rig: MakeRig) -> None:
    rig = make_rig(control_method='drive_control')
    rig.connect()
    rig.simulator.inject('fault', OVERLOAD)
    rig.drive.acknowledge().result(PATIENCE)
    # by the mask: what another master has in its word stays, and nothing has to be read first
    masks = [
        bytes.fromhex(frame['hex'])[7:11]
        for frame in rig.trace()
        if frame['direction'] == 'request' and frame['hex'][2:8] == '100250'
    ]
    assert [one[2:].hex() for one in masks] == ['0000', '0080', '0000']
    assert not any(int.from_bytes(one[:2], 'big') & 0x80 for one in masks)
    assert rig.far.control_unit.ack_reads == 0


# --- drives that restart by themselves ------------------------------------------------------------

RESTARTS = {TRIES[OVERLOAD]: 3, 'error.rst_dly': 2, 'error.tr_time': 10}


def test_run_command_is_taken_back_before_the_drive_restarts(make_rig: MakeRig) -> None:
    # by the control word, which a G2 takes in spite of a fault: it is how it is acknowledged
    rig = make_rig(control_method='drive_control', parameters=RESTARTS)
    rig.turn()
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: not rig.far.control_unit.word & 1)
    rig.skip(3.0)
    assert rig.far.faults.codes == []
    rig.assert_stays_still()
    assert rig.enable().startswith('enabled')
    rig.wait_for_frequency(20.0)


def test_drive_that_refuses_every_command_is_stopped_as_soon_as_it_restarts(
    make_rig: MakeRig,
) -> None:
    # by SCMD, which a G2 refuses while a fault is active: nobody can take it back before
    rig = make_rig(parameters=RESTARTS)
    rig.turn()
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    wait_until(lambda: rig.drive.blocked_by_fault)
    assert rig.far.control_unit.scmd == Scmd.FIELDBUS
    # its 2 s are over, and it runs again by itself
    with rig.simulator.lock:
        rig.skip(2.1)
        assert rig.far.motor.driven
        before = len(rig.notes.snapshots)
    wait_until(lambda: rig.far.control_unit.scmd == Scmd.STOP)
    assert len(rig.notes.snapshots) - before <= 2
    rig.assert_stays_still()
    assert not rig.notes.told(Cause.CANNOT_STOP)
    assert not rig.notes.told(Cause.RUNS_UNASKED)
    rig.notes.wait_for('the motor started by the run command that stood there')
    assert rig.enable().startswith('enabled')
    rig.wait_for_frequency(20.0)


def test_fault_that_nobody_could_see_in_time(make_rig: MakeRig) -> None:
    # it restarts at once: only the reaction to the fault shows, for 20 ms
    rig = make_rig(parameters={**RESTARTS, 'error.rst_dly': 0}, poll_rate=5.0)
    rig.turn()
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.far.faults.codes)
    # if no poll saw it, the drive follows its set-points as if nothing had been
    rig.next_snapshots(2)
    if rig.drive.armed:
        rig.wait_for_frequency(20.0)
    else:
        rig.assert_stays_still()
    assert [entry.code for entry in rig.far.faults.log] == [OVERLOAD]


@every_way
def test_fault_that_somebody_else_acknowledges_restarts_nothing(
    make_rig: MakeRig, model: str, method: str, reference: str
) -> None:
    rig = make_rig(model=model, control_method=method, reference=reference)
    rig.connect()
    rig.enable()
    if reference == 'fieldbus':
        rig.publish(20.0)
    wait_until(lambda: rig.far.motor.frequency > 10.0)
    rig.simulator.inject('fault', OVERLOAD)
    wait_until(lambda: not rig.drive.armed)
    with rig.simulator.lock:
        rig.far.faults.acknowledge()
        rig.far._settle()
    wait_until(lambda: not rig.drive.stop_unconfirmed)
    rig.wait_until_still()
    rig.next_snapshots(5)
    assert not rig.far.motor.driven


def test_a_fault_whose_cause_lasts_is_named_by_a_drive_that_refuses_everything(
    make_rig: MakeRig,
) -> None:
    rig = make_rig()
    rig.turn()
    with rig.simulator.lock:
        rig.far.trip(OVERHEATED, cause_present=True)
    wait_until(lambda: not rig.drive.armed)
    rig.acknowledged = 1
    assert '3 Temp Hi is still active' in rig.refused(rig.drive.acknowledge())
    assert rig.far.control_unit.ack_reads == 1
