# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Nothing is written to a drive before it was recognised, not even a stop: it may mean 'run'."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from support.recognition import other_make, writes_on_line
from support.rig import CONNECTIONS, Connection, Rig
from support.variants import shipped
import yaml

from nfo_sinus_driver.drive import Cause, Drive
from nfo_sinus_driver.drive.broadcast import broadcast_stop
from nfo_sinus_driver.link import Address, Reply

DELTA = shipped('delta_vfd_el')
STOPS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'rapid stop': lambda drive: drive.rapid_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'disconnect': lambda drive: drive.disconnect(4.0),
    'exit': lambda drive: drive.stop_for_good(4.0),
}


every_connection = pytest.mark.parametrize('connection', CONNECTIONS)
#: One of each kind.
KINDS = ('rtu', 'classic', 'canopen', 'optimal', 'movitrac', 'described', 'telegram1 g2')
#: Where a stop writes what it reads first: without an answer none goes out.
READS_FIRST = (
    'classic, control word', 'canopen, control word', 'optimal, control word', 'movitrac',
    'made up',
)
#: By when a drive that answers again is stopped, s: a try comes each second, and reads first.
_SOON = 2.0


def written(rig: Rig) -> list[str]:
    """Return what was written so far; of a line of Modbus every frame that writes."""
    if rig.connection.protocol.startswith('modbus'):
        return writes_on_line(rig)
    return [key for _, key, data in rig.asked if data is not None]


def at_another_make(folder: Path, **more: Any) -> Rig:
    """Return the driver of a VFD-EL at a drive to which its stop is a run command."""
    file = other_make(folder, **more)
    return Rig(Connection('modbus_rtu', file, 'custom', driver={'model': DELTA}))


@pytest.mark.parametrize('stop', STOPS)
def test_a_drive_of_another_make_is_not_started_by_a_stop(tmp_path: Path, stop: str) -> None:
    with at_another_make(tmp_path) as rig:
        assert 'another model' in rig.answer(rig.drive.connect())
        answer = rig.answer(STOPS[stop](rig.drive))
        assert Cause.NOT_RECOGNISED in answer.causes, answer
        rig.pass_time(10.0)
        assert not writes_on_line(rig) and not rig.far.motor.driven
        assert not rig.drive.stop_unconfirmed


def test_what_is_put_in_the_place_of_a_lost_drive_is_not_started(tmp_path: Path) -> None:
    with Rig(Connection('modbus_rtu', DELTA, 'custom')) as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(6.0)
        rig.line.exchange(other_make(tmp_path))
        rig.line.mend()
        written = len(writes_on_line(rig))
        rig.pass_time(10.0)
        assert len(writes_on_line(rig)) == written
        assert not rig.far.motor.driven
        # it has turned a motor, and cannot say that it stands
        assert rig.drive.stop_unconfirmed
        answer = rig.answer(rig.drive.stop_for_good(4.0))
        assert Cause.NOT_RECOGNISED in answer.causes
        assert len(writes_on_line(rig)) == written


# --- before it is recognised ----------------------------------------------------------------------


@pytest.mark.parametrize('stop', STOPS)
@every_connection
def test_before_an_answer_nothing_is_written_whatever_stops(connection: str, stop: str) -> None:
    with Rig(connection) as rig:
        # what is asked is carried out, and no answer comes
        rig.line.state = 'deaf'
        connecting = rig.drive.connect()
        answer = rig.answer(STOPS[stop](rig.drive))
        assert Cause.NOT_RECOGNISED in answer.causes, answer
        rig.answer(connecting)
        rig.pass_time(2.0)
        assert not written(rig) and not rig.far.writes and not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('stop', ['stop', 'quick stop', 'disconnect', 'exit'])
@pytest.mark.parametrize('connection', KINDS)
def test_what_an_earlier_session_left_running_is_stopped_before_it_is_connected_to(
    connection: str, stop: str
) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.kill()
        rig.pass_time(0.1)
        rig.begin()
        answer = rig.answer(STOPS[stop](rig.drive))
        assert Cause.NOT_RECOGNISED not in answer.causes
        rig.pass_time(1.0)
        assert not rig.turns


def test_no_setting_is_written_to_another_make(tmp_path: Path) -> None:
    with at_another_make(tmp_path) as rig:
        parameters = rig.drive.parameters
        rig.result(parameters.read(['ramp.accel']))
        answer = rig.answer(parameters.change({'ramp.accel': 7.0}))
        assert Cause.NOT_RECOGNISED in answer.causes and not writes_on_line(rig)


def test_a_stop_is_broadcast_only_where_a_drive_was_recognised() -> None:
    with Rig('classic') as rig:
        answer = rig.answer(broadcast_stop(rig.bus, rig.drives.values()))
        assert Cause.NONE_RECOGNISED in answer.causes and not written(rig)
        rig.turn()
        rig.line.state = 'deaf'
        rig.pass_time(6.0)
        rig.result(broadcast_stop(rig.bus, rig.drives.values()))
        assert not rig.far.motor.driven


# --- after a loss ---------------------------------------------------------------------------------


@pytest.mark.parametrize('connection', [name for name in CONNECTIONS if name not in READS_FIRST])
def test_a_drive_whose_answers_alone_are_lost_is_stopped(connection: str) -> None:
    with Rig(connection) as rig:
        rig.turn()
        rig.line.state = 'deaf'
        rig.pass_time(3.0)
        assert not rig.turns
        # and from then on another drive may be there
        rig.pass_time(1.0)
        before = len(written(rig))
        rig.pass_time(5.0)
        assert len(written(rig)) == before


def lose_line(rig: Rig) -> None:
    rig.line.state = 'silent'
    rig.pass_time(8.0)


def lose_port(rig: Rig) -> None:
    rig.line.state = 'gone'
    rig.pass_time(1.0)


@pytest.mark.parametrize('lose', [lose_line, lose_port])
@every_connection
def test_a_drive_that_answers_again_is_read_and_then_stopped_soon(
    connection: str, lose: Callable[[Rig], None]
) -> None:
    with Rig(connection) as rig:
        rig.turn()
        lose(rig)
        rig.line.mend()
        rig.wait_until(lambda: not rig.turns and not rig.drive.stop_unconfirmed, _SOON)


def test_what_was_moved_to_another_line_is_not_written_to(tmp_path: Path) -> None:
    # the adapter is pulled out and put in again, and another drive is behind it
    with Rig(Connection('modbus_rtu', DELTA, 'custom')) as rig:
        rig.turn()
        rig.line.state = 'gone'
        rig.pass_time(0.5)
        rig.line.exchange(other_make(tmp_path))
        rig.line.place = 'another socket'
        before = len(writes_on_line(rig))
        rig.line.mend()
        rig.pass_time(10.0)
        assert len(writes_on_line(rig)) == before and not rig.far.motor.driven


@pytest.mark.parametrize('same', [True, False])
def test_while_the_driver_stands_still_a_drive_may_be_exchanged(
    tmp_path: Path, same: bool
) -> None:
    with Rig(Connection('modbus_rtu', DELTA, 'custom')) as rig:
        rig.turn()
        rig.line.go_to(rig.clock.now + 10.0)
        if not same:
            rig.line.exchange(other_make(tmp_path))
        before = len(writes_on_line(rig))
        rig.pass_time(5.0)
        assert (len(writes_on_line(rig)) > before) is same
        assert rig.drive.following is rig.turns is same


def test_a_long_silence_that_is_no_loss_stops_nothing(tmp_path: Path) -> None:
    with Rig(Connection('modbus_rtu', DELTA, 'custom'), lost_after=10.0) as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(5.0)
        rig.line.mend()
        rig.send(30.0)
        rig.wait_until(lambda: rig.far.motor.frequency > 29.0, 3.0)
        assert rig.drive.following and not rig.notes.said(Cause.LOST_IN_USE)
        rig.line.state = 'silent'
        rig.pass_time(5.0)
        rig.line.exchange(other_make(tmp_path))
        before = len(writes_on_line(rig))
        rig.line.mend()
        rig.pass_time(5.0)
        assert rig.notes.said(Cause.OTHER_MODEL) and not rig.drive.following
        assert len(writes_on_line(rig)) == before and not rig.far.motor.driven


# --- by what it is recognised ---------------------------------------------------------------------


def answer_as(rig: Rig, key: str, data: bytes) -> None:
    """Have a parameter read as these bytes."""
    read = rig.link.read

    def answer(unit: int, address: Address, once: bool) -> Reply:
        reply = read(unit, address, once)
        return reply._replace(data=data) if rig.asked[-1][1] == key else reply

    rig.link.read = answer  # type: ignore[method-assign]


@pytest.mark.parametrize(
    ('connection', 'key', 'data'),
    [
        ('rtu', 'fieldbus.sw_ver', bytes(2)), ('rtu', 'fieldbus.sw_ver', b'\xff\xff'),
        ('rtu', 'fieldbus.inv_st', b'\xff\xff'), ('rtu', 'fieldbus.drive_status', b'\xff' * 4),
        ('optimal', 'fieldbus.inv_st', b'\xff\xff'),
    ],
)
def test_what_no_nfo_drive_reports_is_another(connection: str, key: str, data: bytes) -> None:
    with Rig(connection) as rig:
        answer_as(rig, key, data)
        assert Cause.CANNOT_BE in rig.answer(rig.drive.connect()).causes
        rig.answer(rig.drive.stop_for_good(1.0))
        assert not written(rig)


def test_one_that_was_recognised_is_stopped_whatever_its_status_word_says() -> None:
    with Rig() as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(1.5)
        answer_as(rig, 'fieldbus.drive_status', b'\xff' * 4)
        rig.line.mend()
        rig.wait_until(lambda: not rig.turns, _SOON)


def test_no_fault_of_what_is_no_nfo_drive_is_acknowledged() -> None:
    # it answers where ours was, and its status says that a fault is active
    with Rig(lost_after=20.0) as rig:
        rig.connect()
        rig.line.state = 'silent'
        rig.pass_time(5.0)
        answer_as(rig, 'fieldbus.drive_status', b'\xff' * 4)
        rig.line.mend()
        answer = rig.answer(rig.drive.acknowledge())
        assert Cause.NOT_RECOGNISED in answer.causes, answer
        assert rig.far.control_unit.ack_reads == 0


@pytest.mark.parametrize(('maker', 'is_ours'), [(b'NFO Drives AB', True), (b'Acme', False)])
def test_another_maker_in_function_43_is_another_drive(maker: bytes, is_ours: bool) -> None:
    with Rig() as rig:
        rig.far.servers['modbus']._objects[0] = maker  # type: ignore[attr-defined]
        answer = rig.answer(rig.drive.connect())
        assert (Cause.MADE_BY in answer.causes) is not is_ours
        if not is_ours:
            assert 'Acme' in answer
            rig.answer(rig.drive.stop_for_good(1.0))
            assert not written(rig)


def with_identity(folder: Path, **identity: Any) -> str:
    """Return a copy of the file of the VFD-EL with a register that identifies it."""
    file = yaml.safe_load(Path(DELTA).read_text(encoding='utf-8'))
    path = folder / 'known.vfd.yaml'
    path.write_text(yaml.safe_dump({**file, 'identify': [identity]}), encoding='utf-8')
    return str(path)


def test_a_file_tells_its_drive_from_one_that_has_all_its_registers(tmp_path: Path) -> None:
    other = other_make(tmp_path, answers_all=True, also={'drive.size': {'register': 0}})
    known = with_identity(tmp_path, register=0, values=[2, 4])
    with Rig(Connection('modbus_rtu', other, 'custom', driver={'model': known})) as rig:
        answer = rig.answer(rig.drive.connect())
        assert Cause.IS_NOT in answer.causes
        assert 'register 0 is 0, and should be 2 or 4' in answer
        for stop in STOPS.values():
            rig.answer(stop(rig.drive))
        assert not writes_on_line(rig) and not rig.far.motor.driven
    with Rig(Connection('modbus_rtu', known, 'custom')) as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(5.0)
        rig.asked.clear()
        rig.line.mend()
        rig.wait_until(lambda: not rig.turns, _SOON)
        # the one read before the stop is what identifies it
        keys = [key for _, key, _ in rig.asked]
        stop = next(number for number, (_, _, data) in enumerate(rig.asked) if data is not None)
        assert 'line.identity_1' in keys[:stop]


@pytest.mark.parametrize('connection', KINDS)
def test_the_connect_line_says_whether_anything_tells_the_drive_from_others(
    connection: str, tmp_path: Path
) -> None:
    with Rig(connection) as rig:
        rig.connect()
        assert rig.notes.said('recognised by nothing of its own') is (connection == 'described')
    known = with_identity(tmp_path, register=0, values=[2, 4])
    with Rig(Connection('modbus_rtu', known, 'custom')) as rig:
        rig.connect()
        assert rig.notes.said('connected: known')
        assert not rig.notes.said('recognised by nothing')


def test_one_that_identifies_itself_as_another_after_a_loss_is_not_written_to(
    tmp_path: Path,
) -> None:
    known = with_identity(tmp_path, register=0, values=[2, 4])
    with Rig(Connection('modbus_rtu', known, 'custom')) as rig:
        rig.turn()
        rig.line.state = 'silent'
        rig.pass_time(6.0)
        rig.line.exchange(
            other_make(tmp_path, answers_all=True, also={'drive.size': {'register': 0}})
        )
        before = len(writes_on_line(rig))
        rig.line.mend()
        rig.pass_time(5.0)
        assert len(writes_on_line(rig)) == before and not rig.far.motor.driven
