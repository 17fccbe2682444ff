# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A status word that comes with the answer to a set-point and may have to stop the motor starts the
poll anew, which may wait for its turn.
"""

from __future__ import annotations

from collections.abc import Callable
import itertools

from neighbour import neighbour
import pytest
from support.rig import Rig

from nfo_sinus_driver.bus import Request
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.link import Interrupted

OVERLOAD, EARTH_FAULT = 5, 1
NEIGHBOURS = 15
INV_ST = 'fieldbus.inv_st'


def waits_for(rig: Rig, key: str) -> bool:
    """The poll waits for its turn to read this."""
    task = rig.drive._poller._task
    assert task is not None
    awaited = task.awaited
    return isinstance(awaited, Request) and awaited.reads(1, rig.drive.params.address(key))


def until(rig: Rig, condition: Callable[[], object]) -> None:
    """Step the bus alone until it is so."""
    for _ in range(2000):
        if condition():
            return
        rig.bus.step()
    raise AssertionError('it never came true')


def full_line(connection: str, key: str) -> Rig:
    """Return a motor that turns on a line that is full, polled as fast as it allows."""
    options = {'refuses_in_fault': 'nothing'} if connection == 'rtu' else {}
    rig = Rig(connection, options=options, poll_rate=0.0, telemetry_rate=0.0)
    rig.turn()
    rig.send(None)
    for _ in range(NEIGHBOURS):
        rig.bus.run(neighbour(rig.bus, rig.drive.params.address(key)))
    for _ in range(100):
        rig.bus.step()
    return rig


@pytest.mark.parametrize('event', ['fault', 'run input', 'keypad'])
def test_a_stop_comes_whatever_the_poll_waits_for(event: str) -> None:
    wrong = {}
    for turns in range(0, 40, 10):
        with full_line('rtu', 'status.u_rms') as rig:
            for _ in range(turns):
                rig.bus.step()
            assert rig.drive.following
            if event == 'fault':
                rig.far.trip(OVERLOAD)
            elif event == 'keypad':
                rig.far.control_unit.press('stop')
            else:
                rig.far.control_unit.run_input = False
            rig.line.go_to(rig.clock.now + 0.01)
            begun = len(rig.asked)
            rig.drive.set_setpoint(30.0)
            for _ in range(10):
                rig.bus.step()
            asked = [(key, data) for _, key, data in rig.asked[begun:]]
            at = asked.index(('status.frq_set', (300).to_bytes(2, 'big')))
            stop = [(INV_ST, None), ('fieldbus.scmd', bytes(2))]
            if asked[at + 1 : at + 3] != stop or rig.drive.following:
                wrong[turns] = asked
    assert not wrong


def test_an_interruption_that_it_meets_is_the_loss_of_the_drive() -> None:
    with full_line('rtu', 'status.u_rms') as rig:
        until(rig, lambda: waits_for(rig, 'status.frq_act'))
        met: list[str] = []

        def interrupt(key: str, data: bytes | None) -> None:
            if key == INV_ST and not met:
                met.append(key)
                raise Interrupted('the PLC was not reached for 1 s')

        rig.far.trip(OVERLOAD)
        rig.line.go_to(rig.clock.now + 0.01)
        rig.drive.set_setpoint(30.0)
        rig.meet = interrupt
        # it is raised once only, and to whatever asks first
        until(rig, lambda: met)
        assert not rig.drive.following
        rig.pass_time(0.5)
        assert rig.notes.said(Cause.LOST_IN_USE)
        rig.wait_until(lambda: rig.drive.snapshot.connected)


def test_a_poll_that_pauses_because_the_drive_was_busy_is_not_waited_for() -> None:
    with full_line('rtu', 'status.u_rms') as rig:
        until(rig, lambda: waits_for(rig, 'status.frq_act'))
        rig.spoil('busy', 'status.frq_act', written=False)
        task = rig.drive._poller._task
        assert task is not None
        until(rig, lambda: task.asleep)
        rig.far.trip(OVERLOAD)
        rig.line.go_to(rig.clock.now + 0.01)
        begun = len(rig.asked)
        rig.drive.set_setpoint(30.0)
        until(rig, lambda: not rig.drive.following)
        assert len(rig.asked) - begun <= 4


def test_a_poll_that_it_has_replaced_reports_nothing_of_an_older_status() -> None:
    with full_line('telegram1 sinus_h', 'telegram.actual') as rig:
        until(rig, lambda: waits_for(rig, 'telegram.actual'))
        rig.notes.events.clear()
        rig.far.trip(EARTH_FAULT)
        for setpoint in itertools.cycle((25.0, 26.0)):
            # the PLC takes its time to show the fault
            rig.line.go_to(rig.clock.now + 0.02)
            rig.drive.set_setpoint(setpoint)
            rig.bus.step()
            if not rig.drive.following:
                break
        for _ in range(4):
            before = rig.drive.snapshot
            until(rig, lambda before=before: rig.drive.snapshot is not before)
        assert len(rig.notes.events) == 1, rig.notes.events
