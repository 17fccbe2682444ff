# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Firmware of the v5.0 dialect: settings under bus control alone, faults on unknown ids, no status
word.

[C100], [C21]: a SELECT of anything but MODE is answered by NAK before MODE = Sio; a question for
what this firmware does not know, while the bus has control, stops the motor by a serial fault;
only its inverter status tells what it does.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from support.ends import of_g2
from support.rig import Connection, Rig
from support.said import raises, said

from nfo_sinus_driver.catalog import Fact, Kind, Role
from nfo_sinus_driver.drive import Cause, DriveError, Severity
from nfo_sinus_driver.drive.broadcast import broadcast_stop
from nfo_sinus_driver.drive.change.tuning import Procedure
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.classic import LineError
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.sinus_g2.servers import ClassicServer as Server

#: What a change of loses the drive.
LINE = {'serial.address', 'serial.si_baud'}
#: What is not changed while the motor is enabled, even at set-point 0.
SCALED = {'motor.f_nom': 60, 'motor.n_nom': 1700}
STOP, EXT, BUS = 1, 2, 3
SIO_FAIL, OFF, STANDBY, LIMIT, TUNING = 14, 24, 37, 27, 28
TIMEOUT = ('serial.sio_tot', 'serial.auto_stop')


class Older(Rig):
    """
    A drive of this firmware.

    :ivar flags: what went wrong on the line, as the drive notes it.
    :ivar energised: the motor was, at any time.
    """

    def __init__(self, connection: str | Connection = 'classic v5.0', **settings: Any) -> None:
        super().__init__(connection, setpoint_timeout=0.0, **settings)
        self.flags = LineError(0)
        self.energised = False
        unit, motor = self.far.control_unit, self.far.motor
        fail, energise = unit.serial_error, motor.energise

        def note_error(what: LineError) -> None:
            self.flags |= what
            fail(what)

        def note_energy() -> None:
            self.energised = True
            energise()

        unit.serial_error, motor.energise = note_error, note_energy

    @property
    def modes(self) -> list[int]:
        """What was written to MODE."""
        return self.written('fieldbus.mode')

    @property
    def mode(self) -> int:
        return self.far.control_unit.mode

    @property
    def code(self) -> int:
        return self.far.control_unit.status_code

    def has(self, *names: str) -> list[Any]:
        """Return what the drive has in the group Control."""
        return [self.far.peek(f'control.{name}') for name in names]

    def change(self, **values: Any) -> None:
        """Change parameters of the group Control."""
        wanted = {f'control.{name}': value for name, value in values.items()}
        self.result(self.drive.parameters.change(wanted))

    def refusal(self) -> str:
        """Return why parameters are not changed; nothing may have been written."""
        before = (dict(self.far.writes), self.modes, self.far.motor.driven)
        with pytest.raises(DriveError) as error:
            self.change(accel=6.0)
        assert (dict(self.far.writes), self.modes, self.far.motor.driven) == before
        return said(error.value)


@pytest.fixture
def rig() -> Any:
    with Older() as rig:
        rig.connect()
        yield rig


# --- settings -------------------------------------------------------------------------------------


def test_settings_are_written_under_control_that_is_given_back(rig: Older) -> None:
    # no control is taken for what the drive has already
    rig.change(accel=0.3)
    assert rig.modes == []
    rig.change(accel=6.0, retard=7.0)
    assert rig.has('accel', 'retard') == [6.0, 7.0]
    assert rig.modes == [BUS, STOP]
    assert not rig.energised and not rig.flags
    assert rig.code == OFF
    assert rig.far.command_writes.get('status.frq_set'), 'no old set-point may stand'


@pytest.mark.parametrize('turning', [False, True])
def test_under_bus_control_settings_are_just_written(rig: Older, turning: bool) -> None:
    rig.turn()
    if not turning:
        rig.result(rig.drive.stop())
        rig.pass_time(1.0)
    rig.change(accel=6.0)
    assert rig.has('accel') == [6.0]
    assert rig.modes == [BUS]
    assert rig.turns == rig.drive.following == turning
    assert not rig.flags


def test_every_setting_that_its_manual_lists_is_written_and_read_back() -> None:
    # at the other end of its range [M2 table 1]; those of the line have a test of their own
    with Older(poll_rate=2.0, telemetry_rate=0.0, allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        has = rig.drive.parameters.values
        ends = of_g2('classic', '5.0')
        # whose codes are not certain there [C5]
        assert ends.keys() - has.keys() == {'serial.si_prot'}
        for key in [key for key in has if key not in LINE | SCALED.keys()]:
            low, high = ends[key].low, ends[key].high
            wanted = low if has[key] == high else high
            if wanted != has[key]:
                rig.result(rig.drive.parameters.change({key: wanted}))
            assert rig.far.peek(key) == wanted == rig.drive.parameters.values[key], key
        assert not rig.flags and not rig.energised


def test_what_scales_a_set_point_is_written_under_bus_control_without_an_enable() -> None:
    with Older() as rig:
        rig.connect()
        rig.enable()
        rig.result(rig.drive.stop())
        rig.pass_time(1.0)
        for key, value in SCALED.items():
            rig.result(rig.drive.parameters.change({key: value}))
            assert rig.far.peek(key) == value
        assert rig.modes == [BUS] and not rig.flags


def test_what_scales_a_set_point_is_written_under_control_that_is_given_back() -> None:
    with Older() as rig:
        rig.connect()
        for key, value in SCALED.items():
            rig.result(rig.drive.parameters.change({key: value}))
            assert rig.far.peek(key) == value


def test_what_else_has_control_keeps_it(rig: Older) -> None:
    rig.far.set_run_input(False)
    rig.far.control_unit.press('ext')
    assert 'giving it back to them could start the motor: press STOP' in rig.refusal()
    rig.far.set_run_input(True)
    rig.pass_time(0.2)
    assert 'the motor runs' in rig.refusal()
    rig.far.control_unit.press('stop')
    rig.pass_time(1.0)
    rig.change(accel=6.0)
    assert rig.has('accel') == [6.0]


def test_not_while_a_fault_is_active_or_others_tune_it(
    rig: Older, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.far.trip(5)
    rig.pass_time(0.2)
    why = rig.refusal()
    assert '5 Overload' in why and '~/fault_ack' in why
    rig.acknowledged += 1
    rig.result(rig.drive.acknowledge())
    rig.change(accel=5.0)
    monkeypatch.setattr(type(rig.far.control_unit), 'mode', property(lambda _: 0))
    # [M2 §10]
    elsewhere = 'MODE is Inhibit: it is tuning or, before firmware 4.28, controlled from another'
    assert elsewhere in rig.refusal()
    for what in (rig.drive.erase_error_log, rig.drive.enable):
        assert elsewhere in rig.answer(what())
    assert not rig.energised


@pytest.mark.parametrize('refused', [False, True])
def test_a_write_that_fails_half_way_puts_all_back(rig: Older, refused: bool) -> None:
    write = rig.far.write_raw

    def fail(key: str, raw: int) -> None:
        # a refusal under bus control is a serial fault: MODE is Stop after it
        if key != 'control.retard':
            write(key, raw)
        elif refused:
            raise Refused(Reason.VALUE, 'not this one')

    rig.far.write_raw = fail
    # the link clears the serial fault that its own write has caused, of each of two
    rig.acknowledged += 2 * refused
    with raises(Cause.VALUE_NOT_ACCEPTED if refused else Cause.DRIVE_KEEPS_OTHER) as error:
        rig.change(accel=6.0, retard=7.0)
    assert 'put back: control.accel' in said(error.value)
    assert rig.has('accel') == [0.3]
    assert rig.mode == STOP
    assert refused or rig.modes == [BUS, STOP]
    assert not rig.energised


def test_an_enable_waits_until_settings_are_written(rig: Older) -> None:
    change = rig.drive.parameters.change({'control.accel': 6.0, 'control.retard': 7.0})
    rig.wait_until(lambda: rig.far.writes['control.accel'])
    with raises(Cause.PROCEDURE_GOES_ON):
        rig.result(rig.drive.enable())
    rig.result(change)
    assert rig.modes == [BUS, STOP]
    assert not rig.energised
    rig.enable()


def test_control_that_was_stopped_meanwhile_is_not_taken_again(rig: Older) -> None:
    change = rig.drive.parameters.change({'control.accel': 6.0, 'control.retard': 7.0})
    rig.wait_until(lambda: rig.far.writes['control.accel'])
    rig.drive.stop()
    rig.far.control_unit.press('stop')
    assert rig.answer(change) == (
        'control.retard: changing settings was stopped; '
        'control.accel is NOT put back to 0.3 s: changing settings was stopped'
    )
    assert rig.has('accel', 'retard') == [6.0, 0.3]
    assert rig.modes == [BUS]
    assert not rig.energised


def test_a_run_command_that_the_drive_has_kept_is_removed(rig: Older) -> None:
    # no manual says that MODE = Stop ends it
    take = rig.far.control_unit.hand_control_to

    def keeps(source: Any) -> None:
        take(source)
        if source.value == 'scmd':
            rig.far.control_unit.scmd = Scmd.FIELDBUS

    rig.far.control_unit.hand_control_to = keeps
    rig.far.memory.set('status.frq_set', 20.0)
    rig.change(accel=6.0)
    assert rig.has('accel') == [6.0]
    assert not rig.far.motor.turning
    assert rig.modes == [BUS, STOP]


def test_the_drives_time_out_is_set_when_the_bus_gets_control() -> None:
    with Older(drive_timeout=4.0) as rig:
        rig.far.control_unit.press('ext')
        rig.connect()
        assert rig.far.peek('serial.sio_tot') == 0
        assert rig.mode == EXT
        rig.far.control_unit.press('stop')
        rig.pass_time(1.0)
        rig.enable()
        assert [rig.far.peek(key) for key in TIMEOUT] == [4.0, True]
        assert rig.modes == [BUS]
        assert not rig.flags


# --- nothing is asked that it does not know -------------------------------------------------------


def test_two_lost_answers_do_not_trip_it(rig: Older) -> None:
    rig.turn()
    for key in ('fieldbus.inv_st', 'fieldbus.mode'):
        # the status, and what is read to find out whether its answer is only late
        rig.spoil('drop', key, 2, written=False)
        rig.pass_time(2.0)
        assert rig.flags == 0
        assert rig.turns


@pytest.mark.parametrize('method', ['mode_scmd', 'monitor'])
def test_a_driver_that_is_begun_while_the_motor_turns(rig: Older, method: str) -> None:
    rig.turn()
    rig.kill()
    rig._settings[1] = replace(rig._settings[1], classic_dialect='', control_method=method)
    rig.begin()
    rig.connect()
    assert rig.flags == 0
    assert rig.code != SIO_FAIL
    assert rig.notes.said('the bus has control', Severity.WARNING)
    rig.pass_time(2.0)
    assert rig.turns == (method == 'monitor')
    assert (rig.code == STANDBY) == (method != 'monitor')


@pytest.mark.parametrize(('dialect', 'firmware'), [('2.03', '4.38'), ('5.0', '')])
def test_the_firmware_is_asked_for_while_the_bus_has_no_control(
    dialect: str, firmware: str
) -> None:
    with Older(Connection('classic', options={'dialect': dialect})) as rig:
        rig.connect()
        assert rig.drive.identity is not None and rig.drive.snapshot.status is not None
        assert firmware in str(rig.drive.identity)
        assert bool(firmware) == (rig.drive.snapshot.status.word is not None)
        assert rig.flags == (LineError(0) if firmware else LineError.UNKNOWN)
        assert rig.code == OFF
        if not firmware:
            return
        # a drive that was asked once is known when it comes back under control
        rig.turn()
        rig.line.state = 'deaf'
        rig.pass_time(3.0)
        assert not rig.drive.snapshot.connected
        rig.line.mend()
        rig.pass_time(6.0)
        assert rig.drive.snapshot.connected
        assert firmware in str(rig.drive.identity)
        assert not rig.notes.said('the bus has control')


def test_nothing_at_all_is_asked_that_it_does_not_know() -> None:
    # answers are lost for longer than a drive would wait by default
    with Older(poll_rate=10.0, drive_timeout=16.0, lost_after=5.0) as rig:
        rig.connect(parameters=True)
        drive = rig.drive
        assert drive.parameters.values

        def beside() -> None:
            """Let all go on that goes on without a command, on a line that is whole and not."""
            rig.pass_time(1.0)
            for what in ('drop', 'damage', 'double', 'delay'):
                for _ in range(3):
                    rig.line.spoil(what)
                rig.pass_time(1.0)

        beside()
        rig.change(accel=0.4)
        rig.result(drive.error_log(40))
        rig.result(drive.erase_error_log())
        with pytest.raises(DriveError):
            rig.result(drive.reset_energy())
        assert rig.result(drive.tune(Procedure.CALCULATE)).success
        rig.enable()
        rig.send(20.0)
        rig.pass_time(1.0)
        rig.result(drive.parameters.refresh())
        rig.change(accel=0.5)
        rig.result(drive.set_drive_timeout(20.0))
        rig.result(drive.error_log(40))
        assert LineError.UNKNOWN not in rig.flags
        rig.send(None)
        rig.result(drive.stop())
        beside()
        assert not rig.flags, rig.flags
        rig.far.trip(5)
        rig.pass_time(0.5)
        rig.acknowledged += 1
        rig.result(drive.acknowledge())
        rig.result(drive.disconnect(5.0))
        unasked = LineError.UNKNOWN | LineError.PREFIX | LineError.UNREADABLE | LineError.UNWRITABLE
        assert not rig.flags & unasked


# --- its line and its faults ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ('key', 'value', 'then'),
    [('serial.address', 9, 'address (9)'), ('serial.si_baud', '4800bps', 'baud_rate (4800')],
)
def test_a_setting_of_its_line_counts_at_once_and_how_to_follow_is_said(
    key: str, value: Any, then: str
) -> None:
    with Older(allow_communication_changes=True) as rig:
        rig.connect(parameters=True)
        # its codes are others than those of newer firmware [C5]
        assert 'serial.si_prot' not in rig.drive.parameters.values
        answer = rig.answer(rig.drive.parameters.change({key: value}))
        assert rig.far.peek(key) == value
        assert f'start this driver with the {then}' in answer
        assert not rig.energised


def test_a_broadcast_of_mode_stop_ends_the_serial_faults_of_all() -> None:
    # the one message that a drive with such a fault obeys [M2 §7]
    with Rig('classic v5.0', drives=2).turn() as rig:
        for far in rig.fars.values():
            far.control_unit.serial_error(LineError.TIMEOUT)
        rig.pass_time(1.0)
        assert [far.faults.codes for far in rig.fars.values()] == 2 * [[SIO_FAIL]]
        rig.result(broadcast_stop(rig.bus, rig.drives.values()))
        rig.pass_time(1.0)
        for number, far in rig.fars.items():
            assert (far.faults.codes, far.faults.sio_err, far.control_unit.mode) == ([], 0, STOP)
            assert rig.drives[number].snapshot.kind is Kind.STATUS
            assert not far.motor.driven


def test_its_status_is_shown_by_the_texts_of_its_firmware(monkeypatch: pytest.MonkeyPatch) -> None:
    # 37 to 40 are those of the serial line here, 41 to 44 of a fieldbus [M2 table 3]
    with Rig('classic v5.0', control_method='monitor').connect() as rig:
        for code, text in (
            (37, 'Sio Stby'), (38, 'Sio Run'), (39, 'Sio Acc'), (40, 'Sio Ret'),
            (41, 'Bus Stby'), (42, 'Bus Run'), (43, 'Bus Acc'), (44, 'Bus Ret'),
        ):  # fmt: skip
            show(rig, monkeypatch, code)
            rig.pass_time(0.3)
            assert (rig.drive.snapshot.status.code, rig.drive.snapshot.text) == (code, text)


# --- without a status word ------------------------------------------------------------------------


def show(rig: Rig, patch: pytest.MonkeyPatch, code: int | None, *, driven: bool = False) -> None:
    """
    Have the drive say this of itself, whatever it does; ``None``: what it does.

    :param driven: only while the motor is driven.
    """
    patch.undo()
    unit = type(rig.far.control_unit)
    true = unit.inv_st
    if code is not None:
        patch.setattr(
            unit,
            'inv_st',
            property(lambda self: true.fget(self) if driven and not self.motor.driven else code),
        )


def test_stop_down_a_long_ramp_is_confirmed_and_said_once() -> None:
    with Rig('classic v5.0', parameters={'control.retard': 20.0}).turn(40.0) as rig:
        assert rig.answer(rig.drive.stop()).startswith('stopping: it ramps down')
        rig.pass_time(5.0)
        assert rig.far.motor.driven
        assert not rig.notes.said(Cause.RUNS_UNASKED)
        assert not rig.notes.said(Cause.CANNOT_STOP)
        assert not rig.drive.stop_unconfirmed


def test_torque_has_the_decimals_of_its_firmware() -> None:
    # one decimal on firmware of the v5.0 dialect, none on others [C115]
    older = 'classic v5.0'
    for connection, chosen in ((older, 'v5.0'), (older, ''), ('classic', 'v2.03'), ('classic', '')):
        with Rig(connection, classic_dialect=chosen) as rig:
            rig.far.motor.torque = 0.6
            rig.result(rig.drive.connect())
            assert rig.result(rig.drive.measure('status.trq_act')) == 60.0, (connection, chosen)


# --- who controls, where only the inverter status tells -------------------------------------------


@pytest.mark.parametrize('code', [26, LIMIT])
def test_a_chopper_and_a_current_limit_are_no_take_over(
    monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    with Rig('classic v5.0').turn() as rig:
        show(rig, monkeypatch, code)
        rig.pass_time(1.0)
        assert rig.drive.following and rig.turns, rig.notes.events
        status = rig.drive.snapshot.status
        assert status.code == code and status.runs_by_bus and status.driven
        assert Fact.NETWORK_CONTROL | Fact.OPERATION_ENABLED in status.facts
        show(rig, monkeypatch, None)
        rig.pass_time(1.0)
        assert rig.drive.following, rig.notes.events


@pytest.mark.parametrize('press', ['start', 'ext', 'stop'])
def test_a_take_over_behind_a_current_limit_is_noticed(
    monkeypatch: pytest.MonkeyPatch, press: str
) -> None:
    with Rig('classic v5.0').turn() as rig:
        show(rig, monkeypatch, LIMIT)
        rig.pass_time(0.5)
        assert rig.drive.following
        rig.far.control_unit.press(press)
        rig.pass_time(2.0)
        assert not rig.drive.following
        text = 'keypad or terminals have control now and run the motor (27 Cur Limt)'
        assert rig.notes.said(text)


def test_a_motor_that_starts_against_its_current_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    with Rig('classic v5.0').connect() as rig:
        show(rig, monkeypatch, LIMIT, driven=True)
        rig.enable()
        assert rig.drive.following


def test_a_stop_is_not_confirmed_by_a_current_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    with Rig('classic v5.0').turn() as rig:
        show(rig, monkeypatch, LIMIT)
        monkeypatch.setattr(type(rig.far.control_unit), 'command', lambda self, scmd: None)
        with raises(Cause.STOP_UNCONFIRMED):
            rig.result(rig.drive.stop())
        monkeypatch.undo()
        rig.pass_time(3.0)
        assert not rig.drive.stop_unconfirmed and not rig.far.motor.driven


@pytest.mark.parametrize('what', ['fault', 'tuning'])
def test_a_code_that_hides_who_has_control_reports_nothing_of_it(
    monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    with Rig('classic v5.0').turn() as rig:
        assert Fact.NETWORK_CONTROL in rig.drive.snapshot.status.valid
        if what == 'fault':
            rig.far.trip(rig.a_fault)
        else:
            show(rig, monkeypatch, TUNING)
        rig.pass_time(1.0)
        status = rig.drive.snapshot.status
        assert status.code in (rig.a_fault, TUNING)
        assert Fact.NETWORK_CONTROL not in status.valid
        assert Fact.OPERATION_ENABLED | Fact.FAULT in status.valid


@pytest.mark.parametrize('press', ['start', 'ext'])
def test_a_motor_that_others_run_shows_and_is_left_alone(press: str) -> None:
    with Rig('classic v5.0').connect() as rig:
        rig.far.control_unit.press(press)
        rig.pass_time(1.0)
        status = rig.drive.snapshot.status
        assert status.driven and not status.runs_by_bus
        with raises(Cause.RUN_BY_OTHERS):
            rig.result(rig.drive.stop())
        rig.pass_time(1.0)
        assert not rig.notes.said(Cause.RUNS_UNASKED)
        assert rig.far.motor.driven


def test_current_limit_is_no_stop() -> None:
    # its code stands in for the one that says who runs the motor; no ramp reaches it before
    with Rig('classic v5.0', parameters={'control.accel': 1.0}).turn() as rig:
        rig.far.motor.load = 6.0
        rig.pass_time(3.0)
        status = rig.drive.snapshot.status
        assert rig.drive.snapshot.text == 'Cur Limt' and rig.drive.following
        assert status.runs_by_bus and status.kind is Kind.ALARM
        assert sum('the current limit' in event.text for event in rig.notes.events) == 1
        assert rig.answer(rig.drive.stop()).startswith('stop')
        # one that takes it away is noticed all the same
        rig.far.motor.load = 0.3
        rig.pass_time(1.0)
        assert not rig.far.motor.driven
        rig.enable()
        rig.far.control_unit.press('stop')
        rig.pass_time(1.0)
        assert not rig.drive.following


def test_counters_have_24_bits_over_classic(monkeypatch: pytest.MonkeyPatch) -> None:
    enquiry = Server.enquiry

    def filled(self: Server, number: int) -> int:
        word = enquiry(self, number)
        # no manual says what the rest of the second word of a counter has [C26]
        return word | 0xA500 if number in (0x0127, 0x0128, 0x00DE) else word

    monkeypatch.setattr(Server, 'enquiry', filled)
    with Rig('classic v5.0', telemetry_rate=2.0).connect() as rig:
        rig.pass_time(10.0)
        values = rig.notes.telemetry[-1].values
        assert values[Role.OPERATING_TIME] == pytest.approx(1234.5, abs=0.2)
        assert 0 <= values[Role.RUNNING_TIME] < 1e5
        assert 0 <= values[Role.BRAKE_TIME] < 1e5
