# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Enable, stop and acknowledge: what is answered, and what the drive does."""

from __future__ import annotations

from neighbour import neighbour
import pytest
from support.rig import Rig

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Access, Fact, Kind
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd
from nfo_sinus_driver.link import Address, Read
from nfo_sinus_driver.simulator.classic import LineError
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit

OVERLOAD = 5
MODE, SCMD = 'fieldbus.mode', 'fieldbus.scmd'


def test_a_run() -> None:
    with Rig().connect() as rig:
        assert rig.answer(rig.drive.enable()) == (
            'enabled; it follows set-points that arrive from now on'
        )
        assert rig.drive.following and rig.far.motor.driven
        assert rig.answer(rig.drive.enable()) == 'is enabled already'
        for frequency in (20.0, -15.0, 0.0, 7.5):
            rig.send(frequency)
            rig.pass_time(1.0)
            assert rig.far.motor.frequency == pytest.approx(frequency, abs=0.2)
        assert rig.answer(rig.drive.stop()) == 'stopping: it ramps down'
        rig.pass_time(0.5)
        assert rig.answer(rig.drive.stop()) == 'stopped (37 Bus Stby)'
        # control is kept
        assert rig.far.control_unit.mode is Mode.BUS
        rig.assert_only_enable_helps(7.5)


def test_stop_that_coasts_says_so() -> None:
    # a slow ramp would be noticed: it is not used
    with Rig(parameters={'control.st_mode': 'Release', 'control.retard': 60.0}).turn() as rig:
        assert rig.answer(rig.drive.stop()) == 'stopping: it coasts'
        rig.pass_time(0.5)
        assert not rig.far.motor.driven


def test_a_stop_says_what_it_finds() -> None:
    with Rig().turn() as rig:
        rig.far.trip(OVERLOAD)
        rig.pass_time(1.0)
        for command in (rig.drive.stop, rig.drive.quick_stop):
            assert rig.answer(command()).startswith('stopped by fault 5 Overload')
    with Rig().connect() as rig:
        rig.far.control_unit.press('start')
        rig.pass_time(0.5)
        for command in (rig.drive.stop, rig.drive.quick_stop):
            assert rig.answer(command()).startswith('the bus has no control of this drive')
            # a motor run by the keypad is not disturbed
            assert rig.far.motor.driven
        assert rig.written(MODE) == []


def test_a_stop_goes_ahead_of_all_that_waits() -> None:
    with Rig().turn() as rig:
        status = rig.drive.params.address('fieldbus.drive_status')
        for priority in [known for known in Priority if known is not Priority.STOP] * 20:
            rig.bus.run(neighbour(rig.bus, status, priority))
        rig.pass_time(0.5)
        begun = len(rig.asked)
        rig.drive.stop()
        rig.pass_time(0.5)
        # before it comes at most what was about to be sent
        stop = [(key, data) for _, key, data in rig.asked[begun:]].index((SCMD, b'\0\0'))
        assert stop <= 1


def test_enable_needs_an_active_drive() -> None:
    with Rig() as rig:
        rig.result(rig.drive.connect())
        assert rig.answer(rig.drive.enable()) == 'the drive is not active'
        rig.drive.activate()
        rig.enable()
        assert rig.answer(rig.drive.deactivate()).startswith('stop')
        assert rig.answer(rig.drive.enable()) == 'the drive is not active'
        rig.drive.activate()
        rig.turn()
        rig.answer(rig.drive.stop_for_good(4.0))
        rig.drive.activate()
        assert rig.answer(rig.drive.enable()) == 'the drive is not active'


def test_two_at_a_time_cannot_enable_and_a_start_delay_of_the_drive_is_waited_for() -> None:
    with Rig(parameters={'control.run_dly': 5}).connect() as rig:
        first = rig.drive.enable()
        rig.pass_time(0.5)
        assert rig.answer(rig.drive.enable()) == 'it is being enabled already'
        rig.answer(rig.drive.stop())
        assert rig.answer(first) == 'it was stopped while it was being enabled'
        # what follows the delay has as long as everything else
        rig.enable()
        assert rig.far.motor.driven


@pytest.mark.parametrize(
    'connection', ['rtu', 'rtu, control word', 'classic v5.0', 'optimal', 'optimal, control word']
)
def test_a_power_cycle_in_a_start_delay_ends_the_enable(connection: str) -> None:
    # how long that delay is, an Optimal does not report
    with Rig(connection, parameters={'control.run_dly': 2}).connect() as rig:
        enabling = rig.drive.enable()
        rig.pass_time(1.0)
        rig.far.power_cycle(0.05)
        rig.answer(enabling, 8.0)
        assert enabling.exception() is not None
        rig.pass_time(3.0)
        assert not rig.turns
        rig.enable()


@pytest.mark.parametrize('connection', ['rtu', 'classic v5.0', 'rtu, control word', 'canopen'])
@pytest.mark.parametrize('delay', [0, 3])
def test_dc_braking_before_a_start_is_waited_for(connection: str, delay: int) -> None:
    brakes = {'control.run_dly': delay, 'control.dc_brk': 6}
    with Rig(
        connection, parameters=brakes, options={'shown_in_dc_brk': 'standby'}
    ).connect() as rig:
        begun = rig.clock.now
        rig.enable()
        assert rig.far.motor.driven and rig.clock.now - begun > delay + 5.0
        rig.answer(rig.drive.stop())
        # a stop ends it
        rig.pass_time(1.0)
        waiting = rig.drive.enable()
        rig.pass_time(delay + 1.0)
        rig.answer(rig.drive.stop())
        assert rig.answer(waiting) == 'it was stopped while it was being enabled'
        assert not rig.turns


def test_an_open_run_input_is_reported_although_the_drive_could_be_braking() -> None:
    brakes = {'control.dc_brk': 6}
    with Rig(options={'run_input': False}, parameters=brakes).connect() as rig:
        assert 'its RUN input (DIN1) is not active' in rig.answer(rig.drive.enable(), 10.0)


@pytest.mark.parametrize(
    'connection', ['rtu', 'rtu, control word', 'classic', 'classic, control word']
)
def test_stop_at_the_keypad_ends_bus_control_and_enable_regains_it(connection: str) -> None:
    # [M0 §5.2]
    with Rig(connection).turn() as rig:
        assert Fact.NETWORK_CONTROL in rig.drive.snapshot.status.facts
        rig.far.control_unit.press('stop')
        rig.pass_time(1.0)
        shown = rig.drive.snapshot
        assert not rig.far.motor.driven and not shown.enabled
        assert shown.text == 'Stop' and Fact.NETWORK_CONTROL not in shown.status.facts
        assert rig.far.control_unit.mode == Mode.STOP
        rig.assert_only_enable_helps()
        assert rig.far.control_unit.on_bus
        assert Fact.NETWORK_CONTROL in rig.drive.snapshot.status.facts


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen', 'rtu, control word'])
def test_a_run_input_that_is_opened_stops_the_motor_and_says_so(connection: str) -> None:
    # [M0 §5.2]
    with Rig(connection).turn() as rig:
        rig.far.set_run_input(False)
        rig.pass_time(1.0)
        assert not rig.far.motor.driven and not rig.drive.following
        assert rig.notes.said('RUN input (DIN1)')
        rig.far.set_run_input(True)
        rig.assert_only_enable_helps()


def test_run_input_is_missing() -> None:
    with Rig(options={'run_input': False}).connect() as rig:
        assert 'its RUN input (DIN1) is not active' in rig.answer(rig.drive.enable())
        rig.pass_time(0.5)
        # the run command that waits for RUN is removed
        assert rig.far.control_unit.scmd == 0
        rig.far.set_run_input(True)
        rig.assert_only_enable_helps()


def test_drive_that_gives_control_to_none() -> None:
    with Rig().connect() as rig:
        rig.far.write_raw(MODE, Mode.BUS)
        rig.far.write_raw(SCMD, Scmd.FULL_TUNING)
        assert 'MODE is Inhibit' in rig.answer(rig.drive.enable())
        assert rig.written(MODE) == []


def test_drive_that_keeps_its_set_point() -> None:
    with Rig(parameters={'status.frq_set': 30.0}).connect() as rig:
        rig.spoil('ignored', 'status.frq_set', times=99)
        message = rig.answer(rig.drive.enable())
        assert message == 'the drive keeps a set-point of 30 where 0 was written'
        assert Scmd.FIELDBUS not in rig.written(SCMD)


def test_drive_that_refuses_the_run_command() -> None:
    with Rig().connect() as rig:
        rig.meet = lambda key, data: (
            'refused' if (key, data) == (SCMD, b'\x01\x01') else None
        )
        assert 'exception 4' in rig.answer(rig.drive.enable())
        assert not rig.drive.following
        rig.pass_time(1.0)
        assert not rig.drive.stop_unconfirmed


# --- acknowledging --------------------------------------------------------------------------------

SIO_FAIL = 14
every_serial = pytest.mark.parametrize(
    'connection', ['rtu', 'rtu, control word', 'classic', 'classic, control word', 'classic v5.0']
)


@every_serial
@pytest.mark.parametrize('strict', [False, True])
def test_acknowledge_a_fault_that_ended_a_run(
    connection: str, strict: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if strict:
        refuse_control_words(monkeypatch)
    # those of the serial line, too, although it is the line that works
    for code, text in ((OVERLOAD, 'Overload'), (SIO_FAIL, 'Sio Fail'), (15, 'Bus Fail')):
        with Rig(connection).turn() as rig:
            rig.far.trip(code)
            rig.pass_time(1.0)
            assert not rig.drive.following
            rig.acknowledged = 1
            assert rig.answer(rig.drive.acknowledge()) == f'acknowledged {code} {text}'
            assert rig.far.faults.codes == []
            # what was refused of the stops before and after it is no fault of its own
            assert not rig.far.faults.sio_err & ~(LineError.BLOCKED | LineError.NOT_PERMITTED)
            rig.pass_time(1.0)
            assert not rig.drive.stop_unconfirmed and not rig.far.motor.driven
            rig.enable()


def refuse_control_words(monkeypatch: pytest.MonkeyPatch) -> None:
    """While a fault is active, no control word is taken either: [M0 §6.1.5] has no exception."""
    write = G2ControlUnit._write_control

    def refuse(unit: G2ControlUnit, raw: int) -> None:
        if unit.faults:
            raise Refused(Reason.STATE, 'a fault is active')
        write(unit, raw)

    monkeypatch.setattr(G2ControlUnit, '_write_control', refuse)


@pytest.mark.parametrize('connection', ['classic', 'classic, control word'])
def test_a_fault_whose_cause_lasts_is_named_where_nothing_is_taken(
    connection: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    refuse_control_words(monkeypatch)
    with Rig(connection).turn() as rig:
        rig.far.trip(OVERLOAD, cause_present=True)
        rig.pass_time(1.0)
        rig.acknowledged = 1
        assert '5 Overload is still active' in rig.answer(rig.drive.acknowledge())


@every_serial
def test_a_serial_fault_is_acknowledged_and_the_terminals_keep_control(connection: str) -> None:
    with Rig(connection).connect() as rig:
        rig.far.set_run_input(False)
        rig.far.trip(SIO_FAIL)
        rig.far.control_unit.press('ext')
        rig.acknowledged = 1
        answer = rig.answer(rig.drive.acknowledge())
        if rig.connection.protocol == 'modbus_rtu':
            # the one way that is left would take it from them
            assert 'keypad or terminals have control' in answer
            assert rig.far.faults
        else:
            assert 'acknowledged 14 Sio Fail' in answer
            assert not rig.far.faults
        assert rig.far.control_unit.mode == Mode.EXT


@every_serial
def test_the_reason_of_a_serial_fault_is_said(connection: str) -> None:
    with Rig(connection).turn() as rig:
        rig.far.control_unit.serial_error(LineError.TIMEOUT)
        rig.pass_time(1.0)
        assert not rig.drive.following
        rig.acknowledged = 1
        # there is no SioErr over Modbus, and MODE = Stop clears it where it is obeyed [C9], [C99]
        reason = ' (time-out of the serial communication)' if connection == 'classic v5.0' else ''
        assert rig.answer(rig.drive.acknowledge()) == f'acknowledged 14 Sio Fail{reason}'


def test_monitor_writes_nothing_at_all() -> None:
    with Rig(control_method='monitor', drive_timeout=2.0).connect() as rig:
        # another one runs it over the bus
        rig.far.write_raw(MODE, Mode.BUS)
        rig.far.write_raw('status.frq_set', 100)
        rig.far.write_raw(SCMD, Scmd.FIELDBUS)
        drive = rig.drive
        for command in (drive.enable, drive.stop, drive.quick_stop, drive.acknowledge):
            answer = rig.answer(command())
            assert 'control_method is monitor: this driver only reads' in answer
        assert 'monitor' in rig.answer(drive.set_drive_timeout(3.0))
        drive.set_setpoint(30.0)
        rig.pass_time(1.0)
        assert drive.snapshot.frequency == pytest.approx(10.0, abs=0.11)
        rig.far.trip(OVERLOAD)
        rig.pass_time(0.5)
        assert drive.snapshot.kind is Kind.FAULT
        rig.answer(drive.deactivate())
        assert rig.answer(drive.disconnect(1.0)) == 'only watched'
        assert not [request for request in rig.asked if request[2] is not None]
        assert rig.far.control_unit.ack_reads == 0


@pytest.mark.parametrize('connection', ['rtu', 'rtu, control word', 'classic', 'movitrac'])
def test_a_fault_that_was_acknowledged_is_not_published_any_more(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        rig.enable()
        for phase in range(8):
            rig.far.trip(101 if connection == 'movitrac' else 5)
            rig.pass_time(0.5 + phase / 200.0)
            rig.acknowledged += 1
            assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
            rig.notes.snapshots.clear()
            rig.enable()
            rig.pass_time(0.2)
            seen = rig.notes.snapshots
            assert any(snapshot.enabled for snapshot in seen)
            assert not any(snapshot.status and snapshot.status.faulted for snapshot in seen), phase


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'optimal'])
def test_a_parameter_that_is_only_read_acknowledges_nothing(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        acknowledging = [
            key for key, row in rig.drive.model.items() if row.access is Access.ACKNOWLEDGE
        ]
        rig.far.trip(rig.a_fault)
        rig.pass_time(0.5)
        for key in acknowledging:
            with pytest.raises(ValueError, match='acknowledges'):
                rig.result(rig.drive.measure(key))
        assert acknowledging and rig.far.faults.codes


def test_of_what_tells_why_it_refused_the_flags_alone_are_read_once() -> None:
    with Rig('classic') as rig:
        rig.connect()
        asked: dict[Address, bool] = {}

        def read(step: Read) -> int:
            asked[step.address] = step.once
            return SIO_FAIL

        rig.link._why[1](read, 0)
        places = map(rig.drive.params.address, ('fieldbus.inv_st', 'fieldbus.sio_err'))
        assert asked == dict(zip(places, (False, True), strict=True))
