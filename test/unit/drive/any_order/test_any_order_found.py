# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What histories in any order have found, each in the shortest one that shows it."""

from __future__ import annotations

from concurrent.futures import Future
import itertools

from any_order_machine import AnyOrder
from any_order_machines import Canopen, CanopenDs402, G2DriveControl, G2ModeScmd, Movitrac
import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.families.sinus_g2.words import Mode

BUS_FAIL, RUN = 15, 0x101
SCMD = 'fieldbus.scmd'


def test_a_fault_that_holds_the_stop_does_not_keep_the_line_busy_while_it_connects() -> None:
    state = G2DriveControl()
    state.begin(drive_timeout=2.0)
    try:
        state.fault(BUS_FAIL, standing=True)
        state.clean_up()
        state.run_by_another(wait=0.0)
        # the new driver removes the run command, is refused, and must still get to connect
        state.kill(wait=0.1)
        assert state.rig.notes.snapshot is not None and state.rig.notes.snapshot.connected
    finally:
        state.teardown()


def test_a_start_that_the_run_input_ends_does_not_wait_for_it() -> None:
    state = G2ModeScmd()
    state.begin(delay=1)
    try:
        state.enable(wait=0.4)
        assert state.rig.far.control_unit.status_text == 'Wait...'
        state.run_input_off(wait=0.3)
        assert not state.laws.standing
        state.run_input_on(wait=3.0)
        assert not state.rig.far.motor.driven
    finally:
        state.teardown()


def test_a_run_at_standstill_that_a_fault_has_held_back_is_removed() -> None:
    # another master's words came while the fault stood; its set-points were refused
    state = CanopenDs402()
    state.begin(refuses='all', delay=1, restart_after=1)
    try:
        state.fault(7, standing=True, wait=0.02)
        state.run_by_another(wait=0.0)
        state.end_cause(wait=2.2)
        assert state.rig.far.motor.driven and not state.rig.far.motor.frequency
        state.let(2.0)
        assert not state.laws.standing
        assert state.rig.notes.said(Cause.RUN_COMMAND_STANDS)
    finally:
        state.teardown()


def test_an_end_is_not_blocked_by_a_fault_that_it_has_ended() -> None:
    # over CANopen MODE = Stop ends the fault, and the bus keeps control
    state = Canopen()
    state.begin(drive_timeout=-1.0, refuses='scmd')
    try:
        state.deactivate(wait=0.0)
        state.lose_line_for_long(state='silent', wait=0.1)
        state.acknowledge(wait=2.5)
        state.run_by_another(wait=2.5)
        state.shut_down(wait=0.0)
    finally:
        state.teardown()


def test_nothing_is_enabled_while_it_is_awaited_that_the_motor_stands() -> None:
    with Rig(parameters={'control.retard': 3.0}) as rig:
        rig.turn()
        gone = rig.drive.disconnect(1.0)
        rig.pass_time(0.3)
        assert not gone.done()
        assert 'not active' in rig.answer(rig.drive.enable())
        assert 'left to its ramp' in rig.answer(gone)
        rig.pass_time(5.0)
        assert not rig.drive.following
        assert not rig.far.motor.driven


def timed_out() -> Rig:
    """Return a drive whose time-out is over, and a new driver that wants another drive_timeout."""
    rig = Rig(drive_timeout=2.0)
    rig.turn()
    rig.kill()
    rig.line.go_to(rig.clock.now + 3.0)
    assert rig.far.control_unit.status_text == 'Sio Fail'
    rig.acknowledged = 1
    rig.reset(drive_timeout=1.5)
    rig.begin()
    rig.connect()
    return rig


def test_a_serial_fault_that_stands_keeps_no_driver_from_acknowledging_it() -> None:
    with timed_out() as rig:
        assert 'Sio Fail is active' in rig.answer(rig.drive.enable())
        assert rig.answer(rig.drive.acknowledge()).startswith('acknowledged 14 Sio Fail')
        rig.asked.clear()
        rig.enable()
        # the bus has control by then, for older firmware takes it only so [C100]; nothing runs yet
        writes = [(key, rig.number(data)) for _, key, data in rig.asked if data is not None]
        before = writes[: [key for key, _ in writes].index('serial.sio_tot')]
        assert ('fieldbus.mode', Mode.BUS) in before
        assert ('fieldbus.scmd', RUN) not in before
        assert rig.far.peek('serial.sio_tot') == 1.5
        # and once is enough
        rig.answer(rig.drive.stop())
        rig.asked.clear()
        rig.enable()
        assert 'serial.sio_tot' not in [key for _, key, _ in rig.asked]


def test_nothing_runs_without_the_time_out_that_could_not_be_set() -> None:
    with timed_out() as rig:
        rig.answer(rig.drive.acknowledge())
        rig.asked.clear()
        rig.spoil('refused', 'serial.sio_tot', 100)
        for _ in range(2):
            assert 'serial.sio_tot' in rig.answer(rig.drive.enable())
            assert not rig.drive.following
        assert RUN not in rig.written('fieldbus.scmd')
        rig.spoil('refused', 'serial.sio_tot', 0)
        rig.enable()


@pytest.mark.parametrize('connection', ['rtu', 'rtu, control word'])
def test_a_poll_that_a_quick_stop_overtakes_complains_of_no_other_master(connection: str) -> None:
    with Rig(connection, poll_rate=1000.0) as rig:
        rig.connect()
        for moment in range(12):
            rig.enable()
            rig.send(20.0)
            rig.pass_time(0.3)
            quick_stopped(rig, moment)
            rig.pass_time(0.1)
            assert not rig.notes.said(Cause.RUNS_UNASKED), moment


def quick_stopped(rig: Rig, moment: int) -> None:
    """Stop a drive quickly at so many requests."""
    requests = itertools.count()
    stops: list[Future[str]] = []

    def stop(key: str, data: bytes | None) -> None:
        if next(requests) == moment:
            stops.append(rig.drive.quick_stop())

    rig.meet = stop
    rig.wait_until(lambda: stops)
    assert rig.answer(stops[0]) == 'released: the motor coasts'


def test_why_it_stops_is_said_although_the_line_is_lost_at_once() -> None:
    with Rig() as rig:
        rig.turn()

        def refuse(key: str, data: bytes | None) -> str | None:
            if key != 'status.frq_set' or data is None or not any(data):
                return None
            rig.line.state = 'silent'
            return 'refused'

        rig.meet = refuse
        rig.send(10.0)
        rig.pass_time(2.5)
        assert rig.notes.said('stopping: it refused set-point 10', Severity.WARNING)
        assert rig.notes.said('retrying; it is stopped as soon as it answers', Severity.ERROR)
        rig.meet = lambda key, data: None
        rig.line.mend()
        rig.pass_time(5.0)
        assert rig.drive.snapshot.connected
        assert not rig.far.motor.driven
        assert sum('refused' in event.text for event in rig.notes.events) == 1


@pytest.mark.parametrize('machine', [G2ModeScmd, G2DriveControl])
def test_an_enable_that_comes_with_a_quick_stop_is_refused(machine: type[AnyOrder]) -> None:
    state = machine()
    state.begin()
    try:
        state.run_motor()
        # what comes with it, and what comes while it is on its way
        quick_stop, enable = state.rig.drive.quick_stop(), state.rig.drive.enable()
        state.rig.pass_time(0.004)
        later = state.rig.drive.enable()
        assert 'released' in state.rig.answer(quick_stop)
        for refused in (enable, later):
            assert 'a stop is on its way' in state.rig.answer(refused)
        assert not state.rig.drive.following
    finally:
        state.rig.close()


def test_a_clean_up_while_a_fault_is_being_acknowledged_stops_first() -> None:
    state = G2DriveControl()
    state.begin(keeps=True, refuses='scmd')
    try:
        # the acknowledgement has ended the enable, and waits until the reaction to the fault ends
        state.fault_in_a_run_acknowledged(between=0.0, code=5, wait=0.02)
        asked = len(state.rig.asked)
        state.rig.drive.disconnect(1.0)
        state.rig.pass_time(0.05)
        # the transaction that was on the line, and then the run bits
        keys = [key for _, key, data in state.rig.asked[asked : asked + 2] if data is not None]
        assert keys.count('fieldbus.drv_ctrl_write_mask') == 1, state.rig.asked[asked:]
    finally:
        state.rig.close()


def test_a_stop_that_a_fault_has_refused_waits_for_no_measured_values() -> None:
    # the drive ends the fault by itself, and the driver reads what it was in the error log
    state = Canopen()
    state.begin(restart_after=0, refuses='all')
    try:
        state.another_run(value=20.0, wait=0.0)
        asked = len(state.rig.asked)
        state.fault(code=5, standing=False, wait=0.02)
        state.shut_down(wait=0.0)
        keys = [key for _, key, _ in state.rig.asked[asked:]]
        refused = keys.index(SCMD)
        removed = keys.index(SCMD, refused + 1)
        # what a stop itself writes and reads, and no more
        status = {'fieldbus.drive_status', 'fieldbus.inv_st'}
        assert {*keys[refused:removed]} <= {SCMD, 'fieldbus.mode', 'status.frq_set', *status}
    finally:
        state.rig.close()


def test_a_stop_follows_the_first_status_without_the_fault_that_refused_it() -> None:
    state = Canopen()
    state.begin(restart_after=0, refuses='all')
    try:
        state.at_once(names=('enable', 'stop'), begun='', after=0.0, wait=0.0)
        state.good_run(value=20.0, wait=0.4)
        state.activate(wait=0.0)
        asked = len(state.rig.asked)
        # the fault is over while the stop is being tried
        state.fault(code=5, standing=False, wait=0.05)
        stops = [key for _, key, data in state.rig.asked[asked:] if data == b'\0\0']
        assert stops.count(SCMD) == 2 and not state.laws.standing
    finally:
        state.rig.close()


def test_a_stop_waits_for_no_look_whether_the_motor_has_to_be_stopped() -> None:
    state = Movitrac()
    state.begin(response_time=30.0)
    try:
        for _ in range(9):
            state.activate(wait=0.0)
        state.factory_setting(wait=0.0)
        state.factory_setting(wait=0.0)
        state.activate(wait=0.0)
        state.run_motor(value=20.0, wait=0.4)
        state.activate(wait=0.0)
        # a look begins: who has control, and then whether keypad or terminals command
        state.close_terminal(terminal=42, wait=0.1)
        state.stop(wait=0.1)
    finally:
        state.rig.close()


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'movitrac'])
def test_a_drive_that_is_silent_is_lost_in_time_although_its_own_time_out_is_near(
    connection: str,
) -> None:
    with Rig(connection, drive_timeout=2.0) as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.drive.stop()
        rig.pass_time(4.0)
        assert not rig.drive.snapshot.connected
