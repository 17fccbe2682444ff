# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The error log and the kWh counter: read, watched, erased, reset; and when an entry came."""

from __future__ import annotations

from datetime import datetime, timedelta
import math

import pytest
from support.addresses import packed
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.drive import Cause, Severity
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.link import Address, Reply
from nfo_sinus_driver.simulator.faults import LogEntry

#: What a request for an entry of the log is called: it is no parameter.
LOG = ''
#: Where the drive's hours begin.
HOURS = 1234.5
#: How long it may take until an entry is found that no fault announced, s.
SEEN = 31.0
G2 = [
    name
    for name, connection in CONNECTIONS.items()
    if (connection.model, connection.method) == ('sinus_g2', 'mode_scmd')
]
#: A drive that is looked at without a hurry: the tests are about minutes.
RARELY = {'poll_rate': 2.0, 'telemetry_rate': 0.0}


def fill(rig: Rig, count: int) -> None:
    """Put entries into the drive's log, the newest first, one an hour."""
    rig.far.faults.log[:] = [LogEntry(1 + n % 12, 1234.0 - n) for n in range(count)]
    del rig.far.faults.log[rig.far.faults.log_size :]


def trip_unseen(rig: Rig, *codes: int) -> None:
    """Have faults come, and go at once as if they were acknowledged between two polls."""
    for code in codes:
        rig.far.trip(code)
    rig.far.faults.acknowledge()
    rig.far.control_unit.settle()


def asked(rig: Rig) -> list[str]:
    return [key for _, key, _ in rig.asked]


def is_written(rig: Rig) -> bool:
    return any(data is not None for _, _, data in rig.asked)


# --- read and erased ------------------------------------------------------------------------------


@pytest.mark.parametrize('connection', G2)
def test_newest_first_with_text_and_age(connection: str) -> None:
    with Rig(connection).connect() as rig:
        assert rig.result(rig.drive.error_log()) == ()
        for count in (3, 130):
            fill(rig, count)
            entries = rig.result(rig.drive.error_log())
            length = min(count, 32)
            assert [entry.code for entry in entries] == [1 + n % 12 for n in range(length)]
            times = [entry.operating_time for entry in entries]
            assert times == [1234.0 - n for n in range(length)]
            assert entries[0].text == 'Par Fail'
            # the drive's hours begin at 1234.5
            ages = [entry.age for entry in entries]
            assert ages == pytest.approx([0.5 + n for n in range(length)], abs=0.1)
        assert len(rig.result(rig.drive.error_log(4))) == 4
        # only the older firmware has more of them [C4]
        most = 128 if connection == 'classic v5.0' else 32
        assert len(rig.result(rig.drive.error_log(1000))) == most
        assert rig.answer(rig.drive.erase_error_log()) == 'the error log is erased'
        assert rig.far.faults.log == [] and not rig.far.faults
        assert rig.result(rig.drive.error_log()) == ()


def test_an_entry_that_comes_in_meanwhile() -> None:
    with Rig().connect() as rig:
        rig.pass_time(1.0)
        fill(rig, 5)
        begun = len(rig.asked)

        def trip(key: str, data: bytes | None) -> None:
            if key == LOG and asked(rig)[begun:].count(LOG) == 4:
                rig.far.faults.log.insert(0, LogEntry(12, 1234.4))

        rig.meet = trip
        entries = rig.result(rig.drive.error_log())
        assert [entry.code for entry in entries] == [12, 1, 2, 3, 4, 5]

        def trip_again(key: str, data: bytes | None) -> None:
            rig.far.faults.log.insert(0, LogEntry(12, 1234.4 + len(rig.asked)))

        rig.meet = trip_again
        assert Cause.LOG_CHANGES in rig.answer(rig.drive.error_log()).causes


def test_a_time_to_come_has_no_age() -> None:
    with Rig().connect() as rig:
        rig.far.faults.log[:] = [LogEntry(5, 2000.0)]
        (entry,) = rig.result(rig.drive.error_log())
        assert math.isnan(entry.age)
        assert str(entry) == '5 Overload at 2000.0 h'


def test_reading_writes_nothing_and_lets_a_motor_run() -> None:
    with Rig(control_method='monitor').connect() as rig:
        fill(rig, 2)
        assert len(rig.result(rig.drive.error_log())) == 2
        assert not is_written(rig)
    with Rig().turn() as rig:
        fill(rig, 32)
        assert len(rig.result(rig.drive.error_log())) == 32
        assert rig.drive.following and rig.turns
        # what changes something is refused while the motor is enabled
        for command in (rig.drive.erase_error_log, rig.drive.reset_energy):
            assert 'stop it first' in rig.answer(command())
        assert rig.drive.following
        assert not {0x800, 0x900} & set(rig.written('fieldbus.scmd'))


def test_erasing_gives_control_back_as_it_was_found() -> None:
    for found in (Mode.STOP, Mode.BUS):
        with Rig().connect() as rig:
            rig.far.write_raw('fieldbus.mode', found)
            fill(rig, 5)
            rig.result(rig.drive.erase_error_log())
            assert rig.far.control_unit.mode == found
            assert 0x800 in rig.written('fieldbus.scmd')


def test_a_log_that_is_not_empty_after_all() -> None:
    with Rig().connect() as rig:
        fill(rig, 5)

        def immortal(key: str, data: bytes | None) -> None:
            if key == LOG and not rig.far.faults.log:
                fill(rig, 1)

        rig.meet = immortal
        assert 'not empty' in rig.answer(rig.drive.erase_error_log())


@pytest.mark.parametrize('connection', G2)
def test_the_energy_counter(connection: str) -> None:
    with Rig(connection).connect() as rig:
        total, energy = rig.far.counters.total_energy, rig.far.counters.energy
        answer = rig.answer(rig.drive.reset_energy())
        if connection == 'classic v5.0':
            assert 'came with firmware 4.38; this drive has an older one' in answer
            assert rig.far.counters.energy == energy > 1
        else:
            assert answer == 'status.e_out: 1.234 -> 0.000 kWh'
            assert rig.far.counters.energy == 0
            assert 0x900 in rig.written('fieldbus.scmd')
        assert rig.far.counters.total_energy == total
        assert rig.far.control_unit.mode == (
            Mode.BUS if connection.startswith('canopen') else Mode.STOP
        )
        assert rig.far.control_unit.mode_ext_writes == 0 and not rig.far.faults


def test_older_firmware_cannot_reset_it() -> None:
    with Rig(parameters={'fieldbus.sw_ver': 4.37}).connect() as rig:
        message = rig.answer(rig.drive.reset_energy())
        assert 'firmware 4.38' in message and '4.37' in message
        assert not is_written(rig)


def test_neither_before_it_is_connected_nor_after_its_end() -> None:
    with Rig() as rig:
        changing = rig.drive.erase_error_log, rig.drive.reset_energy
        for command in (rig.drive.error_log, *changing):
            assert 'is not connected' in rig.answer(command())
        rig.connect()
        rig.answer(rig.drive.stop_for_good(1.0))
        for command in changing:
            assert 'is ending' in rig.answer(command())
        assert rig.far.control_unit.mode == Mode.STOP


def test_an_optimal_has_none_that_is_documented() -> None:
    with Rig('optimal', **RARELY).connect() as rig:
        assert 'not documented' in rig.answer(rig.drive.error_log())
        rig.far.trip(5)
        rig.pass_time(SEEN)
        assert rig.drive.snapshot.text == 'Overload'
        assert LOG not in asked(rig) and rig.drive.last_error is None


# --- watched --------------------------------------------------------------------------------------


@pytest.mark.parametrize('connection', [*G2, 'rtu, control word', 'monitor'])
def test_the_entry_of_a_fault_is_reported(connection: str) -> None:
    monitor = {'control_method': 'monitor'} if connection == 'monitor' else {}
    with Rig('rtu' if monitor else connection, poll_rate=10.0, **monitor).connect() as rig:
        rig.pass_time(2.0)
        began = rig.clock.now
        rig.far.trip(5)
        rig.pass_time(2.0)
        (entry,) = rig.notes.entries
        assert (entry.code, entry.text, entry.operating_time) == (5, 'Overload', HOURS)
        assert began <= entry.at <= began + 0.5
        assert rig.notes.said('error log: 5 Overload at 1234.5 h', Severity.INFO)
        assert rig.drive.last_error == entry
        rig.pass_time(2.0)
        assert rig.notes.entries == [entry]
        assert rig.far.control_unit.ack_reads == rig.far.control_unit.sio_err_reads == 0
        assert not (monitor and is_written(rig))


def test_an_entry_has_the_local_time_of_its_moment() -> None:
    with Rig(**RARELY).connect() as rig:
        rig.far.trip(5)
        rig.pass_time(70.0)
        (entry,) = rig.notes.entries
        ago = timedelta(seconds=rig.clock.now - entry.at)
        before = datetime.now() - ago
        shown = entry.wall_time
        after = datetime.now() - ago
        assert shown in {moment.isoformat(' ', 'minutes') for moment in (before, after)}


def test_the_motor_is_stopped_first() -> None:
    with Rig().turn() as rig:
        rig.pass_time(1.0)
        rig.asked.clear()
        rig.far.trip(5)
        rig.pass_time(1.0)
        stops = [(key, data) for _, key, data in rig.asked].index(('fieldbus.scmd', b'\0\0'))
        assert stops < asked(rig).index(LOG)
        assert not rig.drive.following and rig.notes.entries


def test_what_is_older_than_the_driver_is_no_news() -> None:
    with Rig() as rig:
        rig.far.faults.log[:] = [LogEntry(3, 1200.0), LogEntry(4, 1100.0)]
        rig.connect()
        rig.pass_time(1.0)
        assert rig.drive.last_error is not None and rig.drive.last_error.code == 3
        rig.far.trip(12)
        rig.pass_time(1.0)
        assert [entry.code for entry in rig.notes.entries] == [12]
        assert not rig.notes.said('log', Severity.WARNING)


def test_a_fault_that_stands_already_is_reported_but_not_since_when() -> None:
    with Rig() as rig:
        rig.far.trip(5)
        rig.connect()
        rig.pass_time(1.0)
        (entry,) = rig.notes.entries
        assert entry.code == 5 and math.isnan(entry.at)
        assert entry.wall_time.endswith(' or before')


def test_faults_that_no_poll_saw() -> None:
    with Rig(**RARELY).connect() as rig:
        rig.pass_time(1.0)
        began = rig.clock.now
        trip_unseen(rig, 7, 8)
        rig.pass_time(SEEN)
        # the older one first
        assert [entry.code for entry in rig.notes.entries] == [7, 8]
        assert all(began - 1 < entry.at <= rig.clock.now for entry in rig.notes.entries)
        assert rig.notes.said('8 DC High at 1234.5 h', Severity.WARNING)


def test_the_same_fault_twice_within_a_tick_is_reported_twice() -> None:
    with Rig().connect() as rig:
        rig.pass_time(1.0)
        rig.far.trip(5)
        rig.pass_time(3.0)
        trip_unseen(rig)
        rig.pass_time(0.5)
        rig.far.trip(5)
        rig.pass_time(1.0)
        first, second = rig.notes.entries
        assert first.operating_time == second.operating_time and second.at > first.at


def test_a_drive_that_writes_its_log_late() -> None:
    with Rig().connect() as rig:
        rig.pass_time(1.0)
        rig.far.trip(5)
        late = list(rig.far.faults.log)
        rig.far.faults.log.clear()
        rig.pass_time(1.0)
        assert rig.notes.entries == []
        rig.far.faults.log[:] = late
        rig.pass_time(0.5)
        (entry,) = rig.notes.entries
        assert entry.code == 5 and not math.isnan(entry.at)


def test_what_came_while_the_drive_was_not_reached() -> None:
    with Rig(**RARELY).connect() as rig:
        rig.pass_time(1.0)
        rig.far.power_cycle(boot_time=90.0)
        rig.far.faults.log.insert(0, LogEntry(7, HOURS))
        rig.pass_time(100.0)
        (entry,) = rig.notes.entries
        assert entry.code == 7 and math.isnan(entry.at)


def test_a_drive_that_has_no_log_is_asked_once() -> None:
    with Rig(**RARELY) as rig:
        rig.meet = lambda key, data: 'refused' if key == LOG else None
        rig.connect()
        rig.pass_time(2 * SEEN)
        assert rig.notes.said(Cause.LOG_NOT_WATCHED)
        assert asked(rig).count(LOG) == 1
        assert rig.drive.snapshot.connected


def test_an_operating_time_that_cannot_be_does_not_end_the_watch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with Rig(**RARELY).connect() as rig:
        rig.pass_time(3.0)
        read, hours = rig.link.read, rig.drive.params.address('status.op_time').index

        def absurd(unit: int, address: Address, once: bool) -> Reply:
            reply = read(unit, address, once)
            if address.index != hours:
                return reply
            return Reply(packed(0xFFFF, 0x7FFF), reply.arrived)

        monkeypatch.setattr(rig.link, 'read', absurd)
        # not looked at for long, so that only the hours tell when the entry came
        rig.drive._error_log_monitor._looked_at = -math.inf
        for code, name in ((5, 'Overload'), (1, 'Par Fail')):
            trip_unseen(rig, code)
            rig.pass_time(SEEN)
            assert rig.notes.said(f'error log: {code} {name} at 1234.5 h')
            assert not rig.notes.said('or before')
        entries = rig.result(rig.drive.error_log())
        assert [str(entry).split(' at ')[0] for entry in entries] == ['1 Par Fail', '5 Overload']


def test_an_entry_has_its_wall_time_if_the_drive_has_had_power_ever_since() -> None:
    with Rig(poll_rate=0.2, telemetry_rate=0.1).connect() as rig:
        for off in (False, True):
            began = rig.clock.now
            rig.pass_time(400.0)
            rig.far.trip(5)
            rig.answer(rig.drive.acknowledge())
            rig.acknowledged += 1
            tripped = rig.clock.now
            rig.pass_time(800.0)
            if off:
                # its hours do not count while it is off
                rig.far.counters.operating_time -= 0.22
                rig.pass_time(2 * SEEN)
            (newest, *_) = rig.result(rig.drive.error_log())
            if off:
                assert math.isnan(newest.at) and newest.wall_time.endswith(' or before')
            else:
                assert newest.age == pytest.approx((rig.clock.now - tripped) / 3600, abs=0.11)
                assert began < newest.at == pytest.approx(tripped, abs=400.0)
                assert rig.drive.log.powered_since == HOURS


def test_an_entry_from_before_a_loss_has_no_wall_time() -> None:
    # for the drive may have been off, be it for less than its hours show
    with Rig(poll_rate=0.2, telemetry_rate=0.1).connect() as rig:
        rig.pass_time(800.0)
        rig.far.trip(5)
        rig.acknowledged = 1
        rig.answer(rig.drive.acknowledge())
        rig.line.state = 'silent'
        rig.pass_time(20.0)
        rig.line.mend()
        rig.wait_until(lambda: rig.drive.snapshot.connected)
        (newest,) = rig.result(rig.drive.error_log())
        assert math.isnan(newest.at) and newest.wall_time.endswith(' or before')
