# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the laws ask of a G2 on CANopen alone: its shapes, its watch, other masters of its bus."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, Event, Severity
from nfo_sinus_driver.drive.known.settings import AS_THE_DRIVE_CAN
from nfo_sinus_driver.simulator.can_frames import Frame
from nfo_sinus_driver.simulator.canopen import Server

#: Each reading in one of them at least.
SHAPES = {
    'full': {},
    'narrow': {
        'canopen_types': 'narrow', 'canopen_sub_indices': 'from_zero', 'canopen_error_log': '4F7D',
    },
    'wide': {'canopen_types': 'wide', 'canopen_profile': 'minimal'},
    'bare': {
        'canopen_profile': 'bare', 'canopen_error_log': 'none', 'canopen_bus_mode': 'free',
    },
    'guarded': {'canopen_watch': 'guarding', 'canopen_sub_indices': 'from_zero'},
}
#: A fault whose status is a code of its own: Overload.
OVERLOAD = 5
#: The fault of a drive that has lost its master, by heartbeat and by guarding.
MASTER_LOST = ([14], [15])
#: Of the watch: how its messages begin, and the objects that they write.
WATCHED = {
    'full': {b'161001': (0x1016, 1)},
    'guarded': {b'0C1000': (0x100C, 0), b'0D1000': (0x100D, 0)},
}
SIO_TOT, AUTO_STOP = 'serial.sio_tot', 'serial.auto_stop'


def shaped(shape: str, connection: str = 'canopen', **more: Any) -> Rig:
    """Return a rig whose node has this shape."""
    rig = Rig(connection, options=SHAPES[shape], **more)
    if SHAPES[shape].get('canopen_sub_indices') == 'from_zero':
        # the judge counts from one, where the status that acknowledges stands first
        rig.acknowledged = 1000
    return rig


def server_of(rig: Rig) -> Server:
    server = rig.far.servers['canopen']
    assert isinstance(server, Server)
    return server


def be_gone(rig: Rig, seconds: float) -> None:
    """End the driver without a word, and let time pass for the drive."""
    rig.kill()
    rig.line.go_to(rig.clock.now + seconds)


@pytest.mark.parametrize('shape', SHAPES)
@pytest.mark.parametrize('connection', ['canopen', 'canopen, control word', 'canopen, ds402'])
def test_every_shape_of_the_node_is_commanded_and_left_as_it_was_found(
    connection: str, shape: str
) -> None:
    with shaped(shape, connection, drive_timeout=4.0) as rig:
        rig.connect()
        rig.enable()
        assert not rig.notes.said(Cause.OWN_TIMEOUT_NOT_TAKEN)
        rig.turn(-10.0)
        rig.far.trip(OVERLOAD)
        rig.pass_time(1.5)
        # without a command it is not acknowledged, and its entry of the log is found
        assert rig.notes.said(Cause.STOPPED_BECAUSE_OF_FAULT) and not rig.turns
        assert rig.far.faults.codes == [OVERLOAD]
        assert bool(rig.notes.entries) == (shape != 'bare')
        rig.acknowledged += 1
        assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
        rig.assert_only_enable_helps(10.0)
        answer = rig.answer(rig.drive.disconnect(4.0))
        assert ('the bus keeps control' in answer) == (shape != 'bare'), answer
        assert rig.far.peek(SIO_TOT) == 0
        be_gone(rig, 6.0)
        assert not rig.far.faults.codes


# --- its watch over the driver --------------------------------------------------------------------


@pytest.mark.parametrize('shape', ['full', 'guarded', 'wide'])
@pytest.mark.parametrize('turns', [True, False])
@pytest.mark.parametrize('connection', ['canopen', 'canopen, ds402'])
def test_the_drive_stops_when_the_driver_is_gone_also_before_the_motor_starts(
    connection: str, shape: str, turns: bool
) -> None:
    with shaped(shape, connection, drive_timeout=4.0) as rig:
        rig.connect()
        rig.enable()
        rig.send(20.0 if turns else None)
        rig.pass_time(1.0)
        assert rig.turns == turns
        be_gone(rig, 5.0)
        assert rig.far.faults.codes in MASTER_LOST
        assert not rig.far.motor.driven


def test_the_watch_outlives_an_idle_driver() -> None:
    with Rig('canopen', drive_timeout=8.0, poll_rate=0.2, telemetry_rate=0.0) as rig:
        rig.connect()
        rig.enable()
        rig.answer(rig.drive.stop())
        asked = len(rig.asked)
        rig.pass_time(30.0)
        assert len(rig.asked) > asked + 2 and not rig.far.faults.codes


def test_by_default_it_watches_from_the_first_enable_to_the_end() -> None:
    with Rig('canopen', parameters={AUTO_STOP: True}, drive_timeout=AS_THE_DRIVE_CAN) as rig:
        watch = server_of(rig)
        rig.connect(parameters=True)
        assert watch.read(0x1016, 1) == bytes(4)
        rig.enable()
        assert watch.read(0x1016, 1)[:2] == (2000).to_bytes(2, 'little')
        assert rig.notes.said('after 2 s (consumer heartbeat, object 1016h)', Severity.INFO)
        assert not rig.written(SIO_TOT)
        # no set-point, and hardly a poll: the heartbeat alone
        rig.pass_time(20.0)
        assert rig.drive.following and not rig.far.faults.codes
        rig.answer(rig.drive.disconnect(4.0))
        assert watch.read(0x1016, 1) == bytes(4)


def test_a_watch_that_could_not_be_changed_is_ended_all_the_same() -> None:
    with Rig('canopen', drive_timeout=5.0) as rig:
        rig.connect()
        rig.enable()
        rig.answer(rig.drive.stop())
        rig.line.state = 'silent'
        assert 'did not answer' in rig.answer(rig.drive.set_drive_timeout(6.0))
        rig.line.mend()
        # its consumer heartbeat, whose time is the low half
        assert server_of(rig).read(0x1016, 1)[:2] == (5000).to_bytes(2, 'little')
        rig.answer(rig.drive.disconnect(4.0))
        assert server_of(rig).read(0x1016, 1) == bytes(4)


def ended_at(shape: str, why: str, moment: int) -> bool:
    """End a watch after this message of it; return whether there was such a message."""
    messages = 0

    def plan(request: bytes) -> str | None:
        nonlocal messages
        if not any(place in request for place in WATCHED[shape]):
            return None
        messages += 1
        if messages - 1 == moment and why == 'stop':
            rig.drive.stop()
        return 'drop' if messages - 1 == moment and why == 'no answer' else None

    with shaped(shape, drive_timeout=5.0, retries=0) as rig:
        rig.connect()
        rig.line.plan = plan
        rig.answer(rig.drive.enable())
        reached = messages > moment
        rig.line.plan = lambda request: None
        rig.answer(rig.drive.disconnect(4.0))
        left = [server_of(rig).read(*place) for place in WATCHED[shape].values()]
        assert not any(map(any, left)), (moment, left)
        be_gone(rig, 6.0)
        assert not rig.far.faults.codes, moment
    return reached


@pytest.mark.parametrize('why', ['no answer', 'stop'])
@pytest.mark.parametrize('shape', ['full', 'guarded'])
def test_a_watch_that_was_begun_only_is_ended_all_the_same(shape: str, why: str) -> None:
    moments = itertools.takewhile(lambda moment: ended_at(shape, why, moment), itertools.count())
    assert len(list(moments)) >= 3


def test_a_lost_answer_to_the_end_of_the_watch_is_no_failed_clean_up() -> None:
    with Rig('canopen', drive_timeout=5.0, retries=0) as rig:
        rig.connect()
        rig.enable()
        rig.line.plan = lambda data: 'drop' if b'161001' in data else None
        assert 'the bus keeps control' in rig.answer(rig.drive.disconnect(4.0))
        assert rig.notes.said(Cause.WATCH_LEFT)


def test_a_long_ramp_leaves_no_fault_behind() -> None:
    with shaped('wide', drive_timeout=4.0, parameters={'control.retard': 30.0}) as rig:
        rig.turn()
        assert 'left to its ramp' in rig.answer(rig.drive.disconnect(0.1))
        assert rig.far.peek(SIO_TOT) == 0
        be_gone(rig, 60.0)
        assert not rig.far.faults.codes


# --- what a bus tells -----------------------------------------------------------------------------


def test_a_drive_that_restarted_is_no_longer_enabled_at_once() -> None:
    # its silence alone would say so after a minute
    with Rig('canopen', lost_after=60.0, options={'boot_time': 0.01}) as rig:
        rig.turn()
        rig.far.power_cycle()
        rig.pass_time(0.5)
        assert rig.notes.said('its boot-up message was received') and not rig.drive.following
        rig.wait_until(lambda: rig.drive.snapshot.connected)
        rig.assert_only_enable_helps()


def test_only_watched_and_yet_in_bus_mode() -> None:
    with Rig('canopen', control_method='monitor') as rig:
        rig.connect()
        rig.pass_time(0.5)
        assert rig.notes.said(
            'control_method is monitor, but the CANopen module holds the drive in bus mode'
        )


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control', 'ds402', 'monitor'])
def test_before_the_first_frame_it_says_that_a_motor_of_the_terminals_stops(method: str) -> None:
    with Rig('canopen', control_method=method, drives=2) as rig:
        asked_when_said: list[int] = []
        listener = rig.notes.on_event

        def on_event(event: Event) -> None:
            if event.cause is Cause.TAKES_CONTROL:
                assert event.severity is Severity.WARNING
                asked_when_said.append(sum(unit == 1 for unit, _, _ in rig.asked))
            listener(event)

        rig.notes.on_event = on_event
        rig.far.control_unit.press('ext')
        rig.pass_time(1.0)
        assert rig.far.motor.driven and not rig.asked
        # as often as it is tried, and however often it is lost
        rig.line.state = 'silent'
        for _ in range(3):
            rig.answer(rig.drive.connect(retry=False))
        rig.line.mend()
        rig.connect()
        rig.far.silence(5.0)
        rig.pass_time(8.0)
        assert rig.drive.snapshot.connected
        assert asked_when_said == [0]
        assert not rig.far.motor.driven


def test_of_two_nodes_one_is_silent() -> None:
    with Rig('canopen', drives=2, lost_after=5.0) as rig:
        rig.turn()
        rig.send(20.0, 1)
        rig.fars[2].silence(1000.0)
        before = len(rig.notes.snapshots)
        rig.wait_until(lambda: rig.notes_of[2].said('did not answer'), 8.0)
        assert rig.drive.following and len(rig.notes.snapshots) > before + 5
        assert 'stopp' in rig.answer(rig.drive.stop())


def test_a_wrong_bit_rate_says_what_to_check() -> None:
    with Rig('canopen') as rig:
        rig.line.wire.timing = dataclasses.replace(rig.line.wire.timing, baud=250_000)
        for _ in range(10):
            answer = rig.answer(rig.drive.connect(retry=False))
        assert 'with this bit rate?' in answer and 'the node id, the bit rate' in answer


def test_the_motor_of_a_node_that_another_master_stops_stands() -> None:
    with Rig('canopen') as rig:
        rig.turn()
        list(server_of(rig).receive(Frame(0, bytes((2, 1))), rig.clock.now))
        rig.pass_time(3.0)
        assert rig.notes.said(Cause.LOST_IN_USE) and not rig.turns


def test_another_sdo_client_is_reported_and_nothing_of_it_is_published() -> None:
    with Rig('canopen') as rig:
        rig.turn()
        # it writes an object that the driver reads, and reads a text in segments
        foreign = ('2B7B200009090000', '400A100000000000', '6000000000000000', '7000000000000000')
        rig.line.wire._foreign = itertools.cycle(
            Frame(0x601, bytes.fromhex(data)) for data in foreign
        )
        rig.notes.snapshots.clear()
        rig.line.wire.set_traffic(50.0, rig.clock.now)
        rig.pass_time(2.0)
        assert rig.bus.statistics().foreign_frames >= 50
        assert len(rig.notes.snapshots) > 5
        assert all(abs(shown.actual - 20) < 0.5 for shown in rig.notes.snapshots)
        (remark,) = rig.bus.remarks
        assert 'another SDO client asks node 1' in remark
        assert not rig.notes.said(Cause.LOST_IN_USE)


# --- objects that a module need not have ----------------------------------------------------------


@pytest.mark.parametrize('connection', ['canopen, control word', 'canopen'])
def test_without_drive_control_what_needs_it_is_refused_and_names_the_others(
    connection: str,
) -> None:
    rig = Rig(connection, options={'canopen_state_machine': 'absent'})
    answer = rig.answer(rig.drive.connect(retry=False))
    if connection == 'canopen':
        assert rig.drive.identity is not None and rig.drive.identity.firmware == 4.38
    else:
        assert 'this drive has no DriveControl and DriveStatus' in answer
        assert 'set control_method to another one (mode_scmd' in answer
        assert all(data is None for _, _, data in rig.asked)
    rig.close()


def test_what_is_only_watched_is_shown_by_the_inverter_status_alone() -> None:
    alone = {'canopen_state_machine': 'absent'}
    with Rig('canopen', options=alone, control_method='monitor') as rig:
        rig.connect()
        rig.far.trip(OVERLOAD)
        rig.pass_time(0.5)
        shown = rig.notes.snapshot
        assert shown.status.word is None and shown.status.faulted
        assert all(data is None for _, _, data in rig.asked)


def test_a_drive_that_is_exchanged_has_what_it_has() -> None:
    with Rig('canopen') as rig:
        rig.connect()
        assert rig.notes.snapshot.status.word is not None
        entries = server_of(rig)._entries
        status = entries.pop((0x2013, 0))
        rig.far.power_cycle()
        rig.wait_until(lambda: not rig.drive.snapshot.connected)
        rig.wait_until(lambda: rig.drive.snapshot.connected)
        assert rig.notes.snapshot.status.word is None
        entries[0x2013, 0] = status
