# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Connecting, what is told of a drive then, and leaving it."""

from __future__ import annotations

import math
from typing import Any

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import SCMD
from drive_rig import STOPPING_OR_STOPPED
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.said import said

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive.diagnosis import explain
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.link import PROTOCOLS
from nfo_sinus_driver.link import LineProtocol
from nfo_sinus_driver.link import NoAnswer

OVERLOAD = 5
#: Read registers, and who are you.
ONLY_READ = {3, 17, 43}


def test_connect_says_who_answers(rig: Rig) -> None:
    identity = rig.connect()
    assert 'firmware 4.38 / 4018' in identity
    assert rig.drive.identity is not None
    assert rig.drive.identity.firmware == pytest.approx(4.38)
    rig.notes.wait_for(Cause.CONNECTED, Severity.INFO)
    rig.notes.wait_for(identity, Severity.INFO)
    # a second time is no harm
    assert str(rig.drive.connect().result(PATIENCE)) == identity
    assert not rig.drive.armed


def test_connect_writes_nothing(rig: Rig) -> None:
    rig.connect()
    rig.next_snapshots()
    assert rig.functions <= ONLY_READ


def test_missing_time_out_is_mentioned(make_rig: MakeRig) -> None:
    rig = make_rig()
    rig.connect()
    rig.notes.wait_for(Cause.OWN_TIMEOUT_OFF, Severity.WARNING)


def test_nobody_at_this_address(make_rig: MakeRig) -> None:
    rig = make_rig(address=7, response_timeout=0.05, retries=0)
    message = rig.refused(rig.drive.connect())
    assert message.startswith('no response from address 7: check in this order')
    # what is wrong most often stands first [C93]
    hints = [message.index(word) for word in ('BusType', 'S5', 'address, baud', 'parity')]
    assert hints == sorted(hints)
    assert rig.drive.identity is None
    assert not rig.drive.snapshot.connected


def test_what_to_check_is_in_the_words_of_the_model(make_rig: MakeRig) -> None:
    rig = make_rig(model='sinus_optimal', address=7, response_timeout=0.05, retries=0)
    message = rig.refused(rig.drive.connect())
    assert 'BusType' not in message and 'the protocol that the drive is set to' in message


@pytest.mark.parametrize('protocol', PROTOCOLS.values(), ids=list(PROTOCOLS))
def test_each_protocol_says_what_to_check(protocol: LineProtocol) -> None:
    silent = NoAnswer('unit 3 did not answer')
    first = explain(silent, 3, check=protocol.check)
    assert first == Report(Cause.NO_RESPONSE, address=3, behind='', check=protocol.check)
    # what has answered once is set right
    assert explain(silent, 3).cause is Cause.NOT_REACHED


def test_rubbish_at_this_address(make_rig: MakeRig) -> None:
    rig = make_rig(response_timeout=1.5, retries=0)
    rig.simulator.inject('damage', 50)
    message = rig.refused(rig.drive.connect())
    assert 'is no answer' in message
    assert 'check baud rate and parity' in message


def test_commands_before_anybody_answers(make_rig: MakeRig) -> None:
    rig = make_rig(address=7, response_timeout=0.02, retries=0)
    rig.drive.activate()
    assert 'the drive at address 7' in rig.refused(rig.drive.enable())
    assert 'the drive at address 7' in rig.refused(rig.drive.acknowledge())


def test_snapshot_is_what_the_drive_says(rig: Rig) -> None:
    rig.turn(20.0)
    wait_until(lambda: rig.drive.snapshot.text == 'Bus Run')
    # what is measured is asked for one after the other
    wait_until(lambda: abs(rig.drive.snapshot.frequency - 20.0) < 0.11)
    wait_until(lambda: 500 < rig.drive.snapshot.speed < 620)
    snapshot = rig.drive.snapshot
    assert snapshot.connected and snapshot.enabled
    assert (snapshot.control_method, snapshot.control_mode) == ('mode_scmd', 'Freque')
    assert (snapshot.unit, snapshot.setpoint) == ('Hz', 20.0)
    assert snapshot.actual == snapshot.frequency
    assert 0 <= snapshot.setpoint_age < PATIENCE
    assert not snapshot.setpoint_clamped
    assert snapshot.frequency == pytest.approx(20.0, abs=0.11)
    assert snapshot.kind is Kind.STATUS
    assert snapshot.status is not None and snapshot.status.runs


def test_telemetry(rig: Rig) -> None:
    rig.connect()
    wait_until(lambda: rig.notes.telemetry)
    values = rig.notes.telemetry[0].values
    assert values[Role.DC_LINK_VOLTAGE] == pytest.approx(565, abs=5)
    assert values[Role.OPERATING_TIME] == pytest.approx(1234.5, abs=0.1)
    assert values[Role.ENERGY] == pytest.approx(1.234)
    assert not any(math.isnan(value) for value in values.values())


def test_telemetry_of_older_firmware(make_rig: MakeRig) -> None:
    # E-Out came with 4.38, and what is not there must not be asked for
    rig = make_rig(parameters={'fieldbus.sw_ver': 4.30})
    rig.connect()
    wait_until(lambda: rig.notes.telemetry)
    values = rig.notes.telemetry[0].values
    assert {role for role, value in values.items() if math.isnan(value)} == {
        Role.ENERGY,
        Role.TOTAL_ENERGY,
    }
    asked = {request[2:4].hex() for request in rig.requests}
    assert '02a8' in asked
    assert not {'05b0', '05b4'} & asked


def test_telemetry_turned_off(make_rig: MakeRig) -> None:
    rig = make_rig(telemetry_rate=0.0)
    rig.connect()
    rig.next_snapshots(10)
    assert rig.notes.telemetry == []


def test_clean_exit(make_rig: MakeRig) -> None:
    rig = make_rig(drive_timeout=20.0)
    rig.turn()
    answer = said(rig.drive.disconnect(PATIENCE).result(PATIENCE))
    assert answer.startswith(STOPPING_OR_STOPPED)
    assert answer.endswith('; control released')
    assert not rig.far.motor.driven
    assert rig.far.control_unit.mode is Mode.STOP
    assert rig.far.control_unit.mode_ext_writes == 0
    assert not rig.drive.armed
    assert not rig.drive.snapshot.connected
    # nobody talks any more, and no fault comes of it
    rig.skip(30.0)
    assert rig.far.faults.codes == []
    # and the next one finds a drive that works
    rig.connect()
    assert rig.enable().startswith('enabled')


def test_exit_of_one_who_never_had_control(rig: Rig) -> None:
    rig.connect()
    rig.simulator.inject('keypad', 'start')
    assert said(rig.drive.disconnect(1.0).result(PATIENCE)) == 'not under bus control'
    assert rig.far.motor.driven
    assert rig.functions <= ONLY_READ


def test_exit_leaves_a_slow_motor_to_its_ramp(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.retard': 60.0})
    rig.turn()
    answer = said(rig.drive.disconnect(0.1).result(PATIENCE))
    assert answer == 'stopping: it ramps down; it was left to its ramp, under bus control'
    assert rig.far.motor.driven
    assert rig.writes(SCMD)[-1] == 0
    assert Mode.STOP not in rig.writes(MODE)


def test_exit_releases_a_slow_motor_that_would_end_in_a_fault(make_rig: MakeRig) -> None:
    rig = make_rig(parameters={'control.retard': 60.0}, drive_timeout=20.0)
    rig.turn()
    answer = said(rig.drive.disconnect(0.1).result(PATIENCE))
    assert answer.startswith('released to coast')
    assert not rig.far.motor.driven
    rig.skip(30.0)
    assert rig.far.faults.codes == []


@pytest.mark.parametrize('retries', [0, 2])
def test_exit_in_the_middle_of_silence(make_rig: MakeRig, hasty: None, retries: int) -> None:
    # a driver that cannot stop the motor says so and keeps trying
    rig = make_rig(retries=retries)
    rig.turn()
    rig.set_response_timeout(0.1)
    rig.simulator.inject('line-dead', 3600)
    rig.refused(rig.drive.disconnect(0.1))
    assert not rig.drive.armed
    assert rig.drive.stop_unconfirmed
    rig.simulator.inject('heal')
    rig.wait_until_still()
    wait_until(lambda: not rig.drive.stop_unconfirmed)


@pytest.mark.parametrize(
    ('setting', 'message'),
    [
        ({'address': -1}, 'allowed are 0 to 247'),
        ({'address': 248}, 'allowed are 0 to 247'),
        ({'model': 'sinus_x'}, "'sinus_g2', "),
        ({'control_method': 'profidrive'}, "choose one of 'mode_scmd', 'drive_control', 'tele"),
        (
            {'reference': 'analog', 'control_method': 'drive_control'},
            'with drive_control on sinus_g2 it must be fieldbus or terminal',
        ),
        ({'expected_control_mode': 'Frequency'}, "'Freque', 'PI-Reg', 'Torque', 'Speed'"),
        ({'poll_rate': -1.0}, 'allowed are 0 to 1000 Hz'),
        ({'poll_rate': math.nan}, 'allowed are'),
        ({'telemetry_rate': 101.0}, 'allowed are 0 to 100 Hz'),
        ({'setpoint_timeout': -0.1}, 'allowed are 0 to 3600 s'),
        ({'setpoint_max': math.inf}, 'allowed are 0 to 32767'),
        ({'shutdown_timeout': -1.0}, 'allowed are 0 to 600 s'),
        ({'lost_after': 0.1}, 'allowed are 0.2 to 60 s'),
        ({'lost_after': 61.0}, 'allowed are 0.2 to 60 s'),
        ({'drive_timeout': 1.4}, 'at least 1.5 s, half a second more than lost_after'),
        ({'drive_timeout': 1.2, 'lost_after': 0.75}, 'at least 1.3 s, half a second more'),
        ({'drive_timeout': 25.1}, 'allowed are 0 to 25 s with sinus_g2'),
        ({'drive_timeout': 10.1, 'model': 'movitrac31'}, 'allowed are 0 to 10 s with movitrac31'),
        ({'drive_timeout': 25.1, 'model': 'auto'}, 'allowed are 0 to 25 s (0: as it is)'),
        ({'drive_timeout': 25.1, 'model': 'sinus_optimal'}, 'allowed are 0 to 25 s'),
        ({'drive_timeout': 2.55}, 'between two steps of the drive, 2.5 and 2.6'),
    ],
)
def test_settings_that_make_no_sense(setting: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=next(iter(setting))) as error:
        DriveSettings(**setting)
    assert message in said(error.value)


def test_settings_that_do() -> None:
    for timeout in range(15, 251):
        assert DriveSettings(drive_timeout=timeout / 10).drive_timeout == timeout / 10
    for timeout in range(7, 251):
        longest = (timeout - 5) / 10
        assert DriveSettings(drive_timeout=timeout / 10, lost_after=longest)
    assert DriveSettings(drive_timeout=10.0, model='movitrac31')
    # it may be the one that takes it
    assert DriveSettings(drive_timeout=25.0, model='auto')
    assert DriveSettings(drive_timeout=0.0, setpoint_timeout=0.0, poll_rate=1000.0)
