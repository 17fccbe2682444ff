# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Connecting, what is known of a drive then, and leaving it."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Any

import pytest
from support.rig import Rig
from support.said import said
from support.variants import shipped

from nfo_sinus_driver.catalog import Kind, Role
from nfo_sinus_driver.drive import Cause, DriveSettings, Severity
from nfo_sinus_driver.drive.known.diagnosis import explain
from nfo_sinus_driver.drive.known.events import Report
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.link import PROTOCOLS, NoAnswer
from nfo_sinus_driver.setting import settings_of
from nfo_sinus_driver.simulator.drive import SimulatedDrive

OVERLOAD = 5
MODE, SCMD = 'fieldbus.mode', 'fieldbus.scmd'
#: A drive that is not there.
ABSENT = {1: {'address': 7}}


def written(rig: Rig) -> list[str]:
    return [key for _, key, data in rig.asked if data is not None]


def test_connect_says_who_answers_and_writes_nothing() -> None:
    with Rig() as rig:
        identity = str(rig.result(rig.drive.connect()))
        assert 'firmware 4.38 / 4018' in identity
        assert rig.drive.identity is not None
        assert rig.drive.identity.firmware == pytest.approx(4.38)
        assert rig.notes.said(Cause.CONNECTED, Severity.INFO)
        assert rig.notes.said(identity, Severity.INFO)
        assert rig.notes.said(Cause.OWN_TIMEOUT_OFF, Severity.WARNING)
        # a second time is no harm
        assert str(rig.result(rig.drive.connect())) == identity
        rig.pass_time(1.0)
        assert not rig.drive.following and written(rig) == []


def test_an_address_without_a_drive() -> None:
    with Rig(own=ABSENT) as rig:
        message = rig.answer(rig.drive.connect())
        assert message.startswith('no response from address 7: check in this order')
        # what is wrong most often stands first [C93]
        hints = [message.index(word) for word in ('BusType', 'S5', 'address, baud', 'parity')]
        assert hints == sorted(hints)
        assert rig.drive.identity is None and not rig.drive.snapshot.connected
        rig.drive.activate()
        for command in (rig.drive.enable, rig.drive.acknowledge):
            assert 'the drive at address 7' in rig.answer(command())
    with Rig('optimal', own=ABSENT) as rig:
        message = rig.answer(rig.drive.connect())
        assert 'BusType' not in message and 'the protocol that the drive is set to' in message


def test_each_protocol_says_what_to_check() -> None:
    silent = NoAnswer('unit 3 did not answer')
    for protocol in PROTOCOLS.values():
        first = explain(silent, 3, check=protocol.check)
        assert first == Report(Cause.NO_RESPONSE, address=3, behind='', check=protocol.check)
    # what has answered once is set right
    assert explain(silent, 3).cause is Cause.NOT_REACHED


def test_rubbish_at_this_address() -> None:
    with Rig() as rig:
        rig.line.state = 'noise'
        message = rig.answer(rig.drive.connect())
        assert 'is no answer' in message
        assert 'check baud rate and parity' in message


SLOWEST = {'rtu': 1200, 'ascii': 1200, 'optimal ascii': 1200, 'classic': 1200, 'movitrac': 9600}


@pytest.mark.parametrize('connection', SLOWEST)
def test_a_drive_on_the_slowest_line_is_identified_and_turns(connection: str) -> None:
    with Rig(connection, line={'baud': SLOWEST[connection]}) as rig:
        rig.turn()
        assert rig.drive.identity is not None
        assert rig.drive.identity.serial or connection not in ('rtu', 'ascii')
        rig.pass_time(10.0)
        assert abs(rig.far.motor.frequency - 20) < 0.2
        assert not rig.notes.said(Cause.LOST_IN_USE)
        assert rig.bus.statistics().timeouts == rig.bus.statistics().damaged == 0


def test_snapshot_is_what_the_drive_says() -> None:
    with Rig().turn(20.0) as rig:
        snapshot = rig.drive.snapshot
        assert snapshot.connected and snapshot.enabled
        assert (snapshot.control_method, snapshot.control_mode) == ('mode_scmd', 'Freque')
        assert (snapshot.unit, snapshot.setpoint) == ('Hz', 20.0)
        assert snapshot.actual == snapshot.frequency == pytest.approx(20.0, abs=0.11)
        assert 500 < snapshot.speed < 620
        assert 0 <= snapshot.setpoint_age < 0.2
        assert not snapshot.setpoint_clamped
        assert (snapshot.text, snapshot.kind) == ('Bus Run', Kind.STATUS)
        assert snapshot.status is not None and snapshot.status.runs


def test_telemetry() -> None:
    with Rig().connect() as rig:
        rig.pass_time(2.0)
        values = rig.notes.telemetry[0].values
        assert values[Role.DC_LINK_VOLTAGE] == pytest.approx(565, abs=5)
        assert values[Role.OPERATING_TIME] == pytest.approx(1234.5, abs=0.1)
        assert values[Role.ENERGY] == pytest.approx(1.234)
        assert not any(math.isnan(value) for value in values.values())
    with Rig(telemetry_rate=0.0).connect() as rig:
        rig.pass_time(2.0)
        assert rig.notes.telemetry == []


#: What a drive measures of its motor, and counts; an Optimal has the last seven.
MEASURED: dict[Role, Callable[[SimulatedDrive], float]] = {
    Role.OUTPUT_VOLTAGE: lambda far: far.motor.voltage,
    Role.DC_LINK_VOLTAGE: lambda far: far.motor.dc_link,
    Role.ACTUAL_TORQUE: lambda far: 100 * far.motor.torque,
    Role.MOTOR_TEMPERATURE: lambda far: far.motor.temperature,
    Role.PT1000_TEMPERATURE: lambda far: 25 + 0.6 * far.motor.temperature,
    Role.BRAKE_TIME: lambda far: far.counters.brake_time,
    Role.ACTUAL_FREQUENCY: lambda far: far.motor.frequency,
    Role.ACTUAL_SPEED: lambda far: far.motor.speed,
    Role.OUTPUT_CURRENT: lambda far: far.motor.current,
    Role.OUTPUT_POWER: lambda far: far.motor.power,
    Role.POWER_FACTOR: lambda far: far.motor.power_factor,
    Role.OPERATING_TIME: lambda far: far.counters.operating_time,
    Role.RUNNING_TIME: lambda far: far.counters.running_time,
}


@pytest.mark.parametrize(
    ('connection', 'measures'), [('classic v5.0', [*MEASURED]), ('optimal', [*MEASURED][6:])]
)
def test_telemetry_is_what_the_drive_measures_and_nothing_else(
    connection: str, measures: list[Role]
) -> None:
    with Rig(connection, poll_rate=5.0, telemetry_rate=2.0).turn() as rig:
        # beyond 16 bits, in each unit
        rig.far.counters.operating_time = 7000.0
        rig.far.counters.running_time = 6700.0
        rig.far.counters.brake_time = 70_000.0
        rig.far.motor.temperature = 40.0
        # one of those that change slowly with each message
        rig.pass_time(12.0)
        values = rig.notes.telemetry[-1].values
        assert {role for role, value in values.items() if not math.isnan(value)} == {*measures}
        for role in measures:
            assert values[role] == pytest.approx(MEASURED[role](rig.far), rel=0.02, abs=0.02), role


def test_telemetry_of_older_firmware() -> None:
    # E-Out came with 4.38, and what is not there must not be asked for
    with Rig(parameters={'fieldbus.sw_ver': 4.30}).connect() as rig:
        rig.pass_time(2.0)
        values = rig.notes.telemetry[0].values
        assert {role for role, value in values.items() if math.isnan(value)} == {
            Role.ENERGY, Role.TOTAL_ENERGY,
        }
        asked = {key for _, key, _ in rig.asked}
        assert rig.drive.state.model.key(Role.OPERATING_TIME) in asked
        assert not {rig.drive.state.model.key(role) for role in (
            Role.ENERGY, Role.TOTAL_ENERGY,
        )} & asked


@pytest.mark.parametrize('connection', ['rtu', 'optimal'])
def test_clean_exit(connection: str) -> None:
    with Rig(connection, drive_timeout=20.0 if connection == 'rtu' else 0.0).turn() as rig:
        rig.send(None)
        answer = rig.answer(rig.drive.disconnect(4.0))
        assert answer == 'stopping: it ramps down; control released'
        assert not rig.far.motor.driven
        assert rig.written(MODE) == [Mode.BUS, Mode.STOP]
        assert rig.far.control_unit.mode == Mode.STOP
        assert not rig.drive.following and not rig.drive.snapshot.connected
        # silence from now on, and no fault comes of it
        asked = len(rig.asked)
        rig.pass_time(30.0)
        assert len(rig.asked) == asked and rig.far.faults.codes == []
        # and the next one finds a drive that works
        rig.connect()
        rig.enable()


@pytest.mark.parametrize('drive_timeout', [0.0, 20.0])
def test_exit_leaves_a_slow_motor_to_its_ramp_unless_a_fault_would_end_it(
    drive_timeout: float,
) -> None:
    with Rig(parameters={'control.retard': 60.0}, drive_timeout=drive_timeout).turn() as rig:
        rig.send(None)
        answer = rig.answer(rig.drive.disconnect(0.1))
        if drive_timeout:
            assert answer.startswith('the motor coasts')
            assert not rig.far.motor.driven
        else:
            assert answer == (
                'stopping: it ramps down; it was left to its ramp, under bus control'
            )
            assert rig.far.motor.driven
            assert rig.written(SCMD)[-1] == 0 and Mode.STOP not in rig.written(MODE)
        rig.pass_time(30.0)
        assert rig.far.faults.codes == []


@pytest.mark.parametrize(
    ('model', 'lost_after', 'own'),
    [
        ('sinus_g2', 1.0, 2.0),
        ('sinus_g2', 1.5, 2.0),
        ('sinus_g2', 1.55, 2.1),
        ('sinus_g2', 60.0, 0.0),
        ('movitrac31', 9.5, 10.0),
        ('movitrac31', 9.6, 0.0),
        (shipped('toshiba_vf_s11'), 1.6, 3.0),
        ('sinus_optimal', 1.0, 0.0),
    ],
)
def test_the_default_is_what_the_drive_and_lost_after_allow(
    model: str, lost_after: float, own: float
) -> None:
    assert DriveSettings(model=model, lost_after=lost_after).wanted_drive_timeout == own


NO_SENSE: list[tuple[dict[str, Any], str]] = [
    ({'address': 256}, 'allowed are 0 to 255'),
    ({'model': 'sinus_x'}, "'sinus_g2', "),
    ({'control_method': 'profidrive'}, "choose one of 'mode_scmd', 'drive_control', 'ds402'"),
    (
        {'reference': 'analog', 'control_method': 'drive_control'},
        'with drive_control on sinus_g2 it must be fieldbus or terminal',
    ),
    (
        {'control_method': 'drive_control', 'classic_dialect': 'v5.0'},
        'classic_dialect v5.0 has no control word',
    ),
    ({'expected_control_mode': 'Frequency'}, "'Freque', 'PI-Reg', 'Torque', 'Speed'"),
    ({'poll_rate': math.nan}, 'allowed are'),
    ({'setpoint_max': math.inf}, 'allowed are 0 to 32767'),
    ({'drive_timeout': 1.4}, 'at least 1.5 s, half a second more than lost_after'),
    ({'drive_timeout': 1.2, 'lost_after': 0.75}, 'at least 1.3 s, half a second more'),
    ({'drive_timeout': 25.1}, 'allowed are 0 to 25 s with sinus_g2'),
    ({'drive_timeout': 10.1, 'model': 'movitrac31'}, 'allowed are 0 to 10 s with movitrac31'),
    ({'drive_timeout': 25.1, 'model': 'auto'}, 'allowed are 0 to 25 s (0: leave it as it is)'),
    ({'drive_timeout': 25.1, 'model': 'sinus_optimal'}, 'allowed are 0 to 25 s'),
    ({'drive_timeout': 2.55}, 'between two steps of the drive, 2.5 and 2.6'),
]


def test_settings_that_make_no_sense() -> None:
    settings = settings_of(DriveSettings)
    ranges = {name: known for name, known in settings.items() if known.low is not None}
    beyond = [
        ({name: value}, 'allowed are')
        for name, known in ranges.items()
        for value in (math.nextafter(known.low, -math.inf), math.nextafter(known.high, math.inf))
    ]
    wrong = []
    for setting, message in [*NO_SENSE, *beyond]:
        try:
            DriveSettings(**setting)
        except ValueError as error:
            if any(name in str(error) for name in setting) and message in said(error):
                continue
        wrong.append(setting)
    assert not wrong


def test_settings_that_do() -> None:
    for timeout in range(15, 251):
        DriveSettings(drive_timeout=timeout / 10)
        DriveSettings(drive_timeout=(timeout - 8) / 10, lost_after=(timeout - 13) / 10)
    DriveSettings(drive_timeout=10.0, model='movitrac31')
    with pytest.raises(ValueError, match=r'drive_timeout -0.5: allowed are 0 to 25 s'):
        DriveSettings(drive_timeout=-0.5)
    # it may be the one that takes it
    DriveSettings(drive_timeout=25.0, model='auto')
    DriveSettings(drive_timeout=0.0, setpoint_timeout=0.0, poll_rate=1000.0)
