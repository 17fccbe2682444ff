# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A driver that stood still: stopped by a signal, suspended, in a virtual machine that paused.

What it measures meanwhile says nothing of the line, and what it read may be old.
"""

from __future__ import annotations

from collections import Counter
import itertools
from typing import Any

import pytest
from support.drive_timeout import by_default
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.link import Reply

#: For how long, s; and so short that no drive can be exchanged meanwhile.
_STOOD, _SHORT = 5.0, 2.5
#: When the operator stops the motor after that, s, and how soon that is on the wire, s.
_LATER = 0.15
_AT_ONCE = 0.05
#: Where a fault is acknowledged by a read behind which nothing is written.
_ACKNOWLEDGED_BY_READ = ('rtu', 'ascii', 'classic', 'canopen, ds402 alone', 'optimal')
_OVERLOAD, _OVERHEATED, _SIO_FAIL = 5, 3, 14
#: How long it takes to recognise a drive anew, s.
_RECOGNISED = 1.0
#: The moments at which it begins, within the time of some transactions, s; all that are tried.
_MOMENTS = (0.004, 0.011, 0.018, 0.027, 0.039)
_ALL_MOMENTS = tuple(0.003 * n for n in range(20))
#: For how long requests are counted, s.
_WHILE = 2.0

every_connection = pytest.mark.parametrize('connection', CONNECTIONS)


def running(connection: str) -> Rig:
    """Two drives that stand enabled, at set-point 0."""
    baud = {'baud': 19200} if CONNECTIONS[connection].protocol == 'modbus_rtu' else {}
    rig = Rig(connection, drives=2, line=baud, setpoint_timeout=0.0, poll_rate=50.0)
    rig.connect()
    rig.enable()
    rig.pass_time(0.5)
    return rig


def time_to_wire(rig: Rig, at: float) -> float:
    """Stop the first drive at a moment, wherever the driver is; return how soon it is sent, s."""
    written: list[float] = []

    def stop() -> None:
        if not rig.drive.following:
            # it is stopped already, as by a PLC
            written.append(at)
        rig.drive.stop()

    def meet(key: str, data: bytes | None) -> None:
        if data is not None and rig.clock.now >= at:
            written.append(rig.clock.now)

    rig.meet = meet
    rig.line.later(at, stop)
    rig.wait_until(lambda: written)
    return written[0] - at


@pytest.mark.parametrize('key', ['fieldbus.inv_st', 'fieldbus.drive_status', 'status.frq_act'])
@pytest.mark.parametrize('connection', ['classic', 'classic, control word'])
def test_the_serial_fault_by_which_a_drive_stopped_meanwhile_is_left_to_the_operator(
    connection: str, key: str
) -> None:
    with by_default(connection, drives=2, poll_rate=50.0) as rig:
        rig.turn()

        def stand_still(asked: str, data: bytes | None) -> None:
            if asked == key:
                # its answer waits in the port meanwhile
                rig.meet = lambda asked, data: None
                rig.line.stand_still(rig.clock.now + 0.001, _SHORT)

        rig.meet = stand_still
        rig.pass_time(_SHORT + _WHILE)
        for far in rig.fars.values():
            assert _SIO_FAIL in far.faults.codes
            assert far.control_unit.sio_err_reads == 0


@pytest.mark.parametrize(('stood', 'most'), [(_SHORT, _AT_ONCE), (_STOOD, _RECOGNISED)])
@every_connection
def test_a_stop_is_on_the_wire_at_once_after_that(
    connection: str, stood: float, most: float
) -> None:
    took = []
    for begins in _ALL_MOMENTS if connection == 'rtu' else _MOMENTS:
        with running(connection) as rig:
            rig.line.stand_still(rig.clock.now + begins, stood)
            took.append(time_to_wire(rig, rig.clock.now + begins + stood + _LATER))
    assert max(took) <= most, [round(seconds, 3) for seconds in took]


@every_connection
def test_no_answer_is_waited_for_longer_after_that(connection: str) -> None:
    for begins in _MOMENTS[::2]:
        with running(connection) as rig:
            over = rig.clock.now + begins + _SHORT
            rig.line.stand_still(over - _SHORT, _SHORT)
            rig.line.later(over, lambda rig=rig: rig.line.unplug(2))
            timeout = rig.line.settings.response_timeout
            if rig.connection.protocol == 'movitrac':
                # as P843 may have it wait
                timeout += 0.2
            took = time_to_wire(rig, over + _LATER)
            assert took <= timeout + _AT_ONCE


@every_connection
def test_all_is_read_as_often_after_that(connection: str) -> None:
    for begins in _MOMENTS[:2]:
        with running(connection) as rig:

            def asked(rig: Rig = rig) -> Counter[tuple[int, str]]:
                begun = len(rig.asked)
                rig.pass_time(_WHILE)
                return Counter((unit, key) for unit, key, _ in rig.asked[begun:])

            before = asked()
            rig.line.stand_still(rig.clock.now + begins, _STOOD)
            # after that each drive is recognised anew
            rig.pass_time(_STOOD + 1.0)
            if rig.line.plc is not None:
                # it has stopped them meanwhile
                rig.pass_time(5.0)
                rig.enable()
            after = asked()
            # of the telemetry some values are read in turn
            often = (key for key in before if before[key] > 2 * _WHILE)
            seldom = {key: after[key] for key in often if after[key] < 0.7 * before[key]}
            assert not seldom, {key: (before[key], after[key]) for key in seldom}


@every_connection
def test_nothing_old_is_published_after_that(connection: str) -> None:
    # after the longer pause each drive is recognised anew before
    for begins, stood in itertools.product(_MOMENTS[1:4], (_SHORT, _STOOD)):
        with running(connection) as rig:
            at = rig.clock.now + begins
            rig.line.later(at + 1.0, lambda rig=rig: rig.far.trip(rig.a_fault))
            rig.line.stand_still(at, stood)
            rig.line.later(at + stood, rig.notes.snapshots.clear)
            rig.pass_time(begins + stood + 2.5)
            later = rig.notes.snapshots
            assert later and all(not snapshot.enabled for snapshot in later)
            assert all(snapshot.status is None or snapshot.status.faulted for snapshot in later)


def stand_still_while_acknowledging(connection: str, fault: int, key: str) -> None:
    """Stand still when a drive has carried out a read that acknowledges; another fault comes."""
    with Rig(connection) as rig:
        rig.connect()
        rig.far.trip(fault)
        rig.wait_until(lambda: rig.notes.snapshot.status.code == fault, 5.0)

        def stand_still() -> None:
            if not rig.far.faults.codes:
                rig.looked = lambda: None
                rig.line.later(rig.clock.now + 1.0, lambda: rig.far.trip(_OVERHEATED))
                rig.line.stand_still(rig.clock.now, _SHORT)

        rig.looked = stand_still
        rig.acknowledged = 1
        rig.answer(rig.drive.acknowledge())
        rig.pass_time(1.0)
        assert [asked for _, asked, _ in rig.asked].count(key) == 1
        # read again it would have ended what the user has not seen
        assert rig.far.faults.codes == [_OVERHEATED]


@pytest.mark.parametrize('connection', _ACKNOWLEDGED_BY_READ)
def test_no_later_fault_is_acknowledged_after_that(connection: str) -> None:
    stand_still_while_acknowledging(connection, _OVERLOAD, 'fieldbus.inv_st_with_ack')


def test_no_fault_behind_a_serial_one_is_acknowledged_after_that() -> None:
    stand_still_while_acknowledging('classic v5.0', _SIO_FAIL, 'fieldbus.sio_err')


def test_what_is_read_anew_after_that_may_be_repeated_as_before() -> None:
    # only what acknowledges is not, beside another master or where a gateway closes connections
    with running('rtu') as rig:
        asked: list[tuple[Any, ...]] = []
        read = rig.link.read

        def note(unit: int, *what: Any) -> Reply:
            asked.append((unit, *what))
            return read(unit, *what)

        rig.link.read = note
        for begins in _MOMENTS:
            rig.line.stand_still(rig.clock.now + begins, _SHORT)
            rig.pass_time(_SHORT + 0.5)
        assert asked and not [request for request in asked if True in request[2:]]


def test_a_drive_that_was_unplugged_is_found_as_soon_after_that() -> None:
    with running('rtu') as rig:
        rig.line.unplug(2)
        rig.pass_time(6.0)
        assert not rig.drives[2].snapshot.connected
        # in the middle of a request to it
        rig.wait_until(lambda: rig.asked[-1][0] == 2)
        begun = len(rig.asked)
        rig.meet = lambda key, data: rig.line.stand_still(rig.clock.now + 0.02, _STOOD)
        rig.wait_until(lambda: any(unit == 2 for unit, _, _ in rig.asked[begun:]))
        rig.meet = lambda key, data: None
        rig.pass_time(_STOOD)
        rig.line.unplug()
        rig.wait_until(lambda: rig.drives[2].snapshot.connected, 6.0)


# --- what else a stop would wait for --------------------------------------------------------------


@every_connection
def test_a_stop_is_on_the_wire_at_once_while_a_drive_is_known_as_slow(connection: str) -> None:
    # it is, for some dozens of answers, so the line is listened to for longer
    took = []
    for moment in _MOMENTS[:3]:
        with running(connection) as rig:
            wire, slow = rig.line.wire, 0.15
            name = '_turnaround' if rig.connection.protocol == 'canopen' else '_pause'
            usual = getattr(wire, name)
            setattr(wire, name, slow)
            rig.pass_time(0.5)
            setattr(wire, name, usual)
            rig.pass_time(slow)
            took.append(time_to_wire(rig, rig.clock.now + 0.1 + moment))
    assert max(took) <= _AT_ONCE, [round(seconds, 3) for seconds in took]


# behind a PLC it is not this line that is silent
@pytest.mark.parametrize(
    'connection', [name for name, kind in CONNECTIONS.items() if kind.protocol != 'telegram1']
)
def test_a_drive_that_was_silent_meanwhile_is_recognised_before_it_is_written_to(
    connection: str,
) -> None:
    # it is another matter that this is no silence for which a drive is lost
    with Rig(connection, drives=2, setpoint_timeout=0.0, lost_after=3.0) as rig:
        rig.turn()
        rig.far.silence(4.6)
        rig.pass_time(0.6)
        for _ in range(3):
            # shorter than what tells that this end was away, and the other drive answers between
            rig.line.stand_still(rig.clock.now + 0.01, 1.3)
            rig.pass_time(1.4)
        rig.drive.stop()
        rig.pass_time(3.0)
        assert not rig.turns
        # whether it was recognised first, the rig judges
