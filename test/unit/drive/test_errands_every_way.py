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

"""Tuning, error log, acknowledging and energy over every way in; what a drive has not, it says."""

from __future__ import annotations

from collections.abc import Iterator
import math

from drive_rig import MODEST
from drive_rig import PATIENCE
from drive_rig import Notes
from drive_rig import wait_until
import pytest
from ros.ways import WAYS
from ros.ways import Way
from support.said import said

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.link import line_settings
from nfo_sinus_driver.link import open_link
from nfo_sinus_driver.simulator.classic_frames import LineError
from nfo_sinus_driver.simulator.faults import LogEntry
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused
from nfo_sinus_driver.simulator.simulator import Simulator
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit

#: To the parameters of a Sinus: a MOVITRAC has other faults, and none of the procedures
#: (test_movitrac_commands.py), and a telegram carries neither.
_WAYS = {
    name: way for name, way in WAYS.items() if way.model != 'movitrac31' and not way.method
}
_TUNING = 28
#: InvSt when it is finished.
_DONE = {
    Procedure.FULL: 45,
    Procedure.BASIC: 45,
    Procedure.STATOR_RESISTANCE: 46,
    Procedure.CALCULATE: 47,
}


class Rig:
    """A simulated drive, and a driver that goes one way into it."""

    def __init__(self, way: Way, method: str = 'mode_scmd') -> None:
        self.way = way
        self.method = method
        self.simulator = Simulator(**way.simulator, boot_time=0.2)
        self.notes = Notes()

    def start(self) -> None:
        """Connect and activate."""
        way = self.way
        self.simulator.start()
        line = line_settings(way.protocol, baud_rate=way.baud_rate, response_timeout=2.0)
        self.bus = Bus(open_link(way.protocol, self.simulator.port, line))
        self.bus.start()
        dialect = str(way.driver.get('classic_dialect', ''))
        settings = DriveSettings(
            model=way.model,
            control_method=self.method,
            classic_dialect=dialect,
            poll_rate=MODEST,
        )
        self.drive = Drive(self.bus, settings, self.notes)
        self.drive.connect().result(PATIENCE)
        self.drive.activate()

    def stop(self) -> None:
        self.bus.close()
        assert self.simulator.failure is None
        self.simulator.stop()

    @property
    def far(self):
        return self.simulator.drives[1]

    @property
    def optimal(self) -> bool:
        return self.way.model == 'sinus_optimal'

    @property
    def held(self) -> bool:
        """Its fieldbus module holds it in bus mode."""
        return self.way.protocol == 'canopen'

    def trip(self, code: int) -> None:
        with self.simulator.lock:
            self.far.trip(code)

    def refused(self, future) -> str:
        with pytest.raises(DriveError) as error:
            future.result(PATIENCE)
        return said(error.value)


@pytest.fixture(params=_WAYS.values(), ids=_WAYS)
def rig(request: pytest.FixtureRequest, unhurried: None) -> Iterator[Rig]:
    rig = Rig(request.param)
    rig.start()
    try:
        yield rig
    finally:
        rig.stop()


@pytest.fixture
def strict_faults(monkeypatch: pytest.MonkeyPatch) -> None:
    """While a fault is active, no control word is taken either: [M0 §6.1.5] makes no exception."""
    write = G2ControlUnit._write_control

    def refuse(unit: G2ControlUnit, raw: int) -> None:
        if unit.faults:
            raise Refused(Reason.STATE, 'a fault is active')
        write(unit, raw)

    monkeypatch.setattr(G2ControlUnit, '_write_control', refuse)


def test_acknowledging(rig: Rig) -> None:
    rig.trip(5)
    wait_until(lambda: rig.drive.snapshot.text == 'Overload')
    assert rig.far.control_unit.ack_reads == 0
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 5 Overload'
    assert not rig.far.faults
    unit = rig.far.control_unit
    assert (unit.ack_reads, unit.sio_err_reads, unit.mode_ext_writes) == (1, 0, 0)
    assert 'nothing to acknowledge' in said(rig.drive.acknowledge().result(PATIENCE))


def test_a_fault_whose_cause_lasts(rig: Rig) -> None:
    with rig.simulator.lock:
        rig.far.trip(5, cause_present=True)
    assert '5 Overload is still active' in rig.refused(rig.drive.acknowledge())


@pytest.mark.parametrize(
    ('name', 'method'),
    [
        ('modbus_rtu', 'mode_scmd'),
        ('modbus_rtu', 'drive_control'),
        ('classic_v2', 'mode_scmd'),
        ('classic_v2', 'drive_control'),
        ('classic_v5', 'mode_scmd'),
    ],
)
@pytest.mark.parametrize(('code', 'text'), [(14, 'Sio Fail'), (5, 'Overload')])
def test_a_drive_that_takes_no_word_while_a_fault_stands(
    name: str, method: str, code: int, text: str, strict_faults: None
) -> None:
    rig = Rig(WAYS[name], method)
    rig.start()
    try:
        rig.drive.enable().result(PATIENCE)
        rig.trip(code)
        wait_until(lambda: not rig.drive.armed)
        assert said(rig.drive.acknowledge().result(PATIENCE)) == f'acknowledged {code} {text}'
        assert not rig.far.faults
        # what was refused of the stops before and after it is no fault of its own
        assert not rig.far.faults.sio_err & ~(LineError.BLOCKED | LineError.NOT_PERMITTED)
        wait_until(lambda: not rig.drive.stop_unconfirmed)
        rig.drive.enable().result(PATIENCE)
    finally:
        rig.stop()


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
def test_a_fault_whose_cause_lasts_is_named_where_nothing_is_taken(
    method: str, strict_faults: None
) -> None:
    rig = Rig(WAYS['classic_v2'], method)
    rig.start()
    try:
        rig.drive.enable().result(PATIENCE)
        with rig.simulator.lock:
            rig.far.trip(5, cause_present=True)
        wait_until(lambda: not rig.drive.armed)
        assert '5 Overload is still active' in rig.refused(rig.drive.acknowledge())
    finally:
        rig.stop()


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
@pytest.mark.parametrize('name', ['modbus_rtu', 'classic_v2', 'classic_v5'])
def test_a_serial_fault_is_acknowledged_and_the_terminals_keep_control(
    name: str, method: str
) -> None:
    if (name, method) == ('classic_v5', 'drive_control'):
        pytest.skip('it has no control word')
    rig = Rig(WAYS[name], method)
    rig.start()
    try:
        with rig.simulator.lock:
            rig.far.set_run_input(False)
            rig.far.trip(14)
            rig.far.control_unit.press('ext')
        if name == 'modbus_rtu':
            # the one way that is left would take it from them
            assert 'keypad or terminals have control' in rig.refused(rig.drive.acknowledge())
            assert rig.far.faults
        else:
            assert 'acknowledged 14 Sio Fail' in said(rig.drive.acknowledge().result(PATIENCE))
            assert not rig.far.faults
        assert rig.far.control_unit.mode == Mode.EXT
    finally:
        rig.stop()


@pytest.mark.parametrize('method', ['mode_scmd', 'drive_control'])
@pytest.mark.parametrize('name', ['modbus_rtu', 'classic_v2', 'classic_v5'])
def test_the_reason_of_a_serial_fault_is_told(name: str, method: str) -> None:
    if (name, method) == ('classic_v5', 'drive_control'):
        pytest.skip('it has no control word')
    rig = Rig(WAYS[name], method)
    rig.start()
    try:
        rig.drive.enable().result(PATIENCE)
        rig.simulator.inject('sio-error', 4)
        wait_until(lambda: not rig.drive.armed)
        answer = said(rig.drive.acknowledge().result(PATIENCE))
        # there is no SioErr over Modbus, and MODE = Stop clears it where it is obeyed [C9], [C99]
        reason = ' (time-out of the serial communication)' if name == 'classic_v5' else ''
        assert answer == f'acknowledged 14 Sio Fail{reason}'
    finally:
        rig.stop()


def test_the_error_log(rig: Rig) -> None:
    with rig.simulator.lock:
        rig.far.faults.log[:] = [LogEntry(1 + n % 12, 1200.0 - n) for n in range(130)]
        del rig.far.faults.log[rig.far.faults.log_size :]
    if rig.optimal:
        assert 'not documented' in rig.refused(rig.drive.error_log())
        assert 'is not known of this model' in rig.refused(rig.drive.erase_error_log())
        return
    entries = rig.drive.error_log().result(PATIENCE)
    assert [entry.operating_time for entry in entries] == [1200.0 - n for n in range(32)]
    assert [entry.code for entry in entries] == [1 + n % 12 for n in range(32)]
    assert entries[0].age == pytest.approx(34.5, abs=0.2)
    # only the older firmware has more of them [C4]
    every = rig.drive.error_log(1000).result(PATIENCE)
    assert len(every) == (128 if rig.way.name == 'classic_v5' else 32)
    assert said(rig.drive.erase_error_log().result(PATIENCE)) == 'the error log is erased'
    assert rig.far.faults.log == []
    assert not rig.far.faults
    assert rig.drive.error_log().result(PATIENCE) == ()


def test_a_new_entry(rig: Rig) -> None:
    wait_until(lambda: rig.optimal or rig.drive._error_log_monitor._known is not None)
    rig.trip(5)
    if rig.optimal:
        wait_until(lambda: rig.drive.snapshot.text == 'Overload')
        assert rig.drive.last_error is None
        return
    wait_until(lambda: rig.notes.entries)
    (entry,) = rig.notes.entries
    assert (entry.code, entry.text) == (5, 'Overload')
    assert not math.isnan(entry.at)
    assert rig.far.control_unit.ack_reads == rig.far.control_unit.sio_err_reads == 0


def test_the_energy(rig: Rig) -> None:
    if rig.optimal:
        assert 'is not known of this model' in rig.refused(rig.drive.reset_energy())
    elif rig.way.name == 'classic_v5':
        message = rig.refused(rig.drive.reset_energy())
        assert 'came with firmware 4.38; this drive has an older one' in message
        assert rig.far.counters.energy > 1
    else:
        assert said(rig.drive.reset_energy().result(PATIENCE)) == 'status.e_out: 1.234 -> 0.000 kWh'
        assert rig.far.counters.energy == 0
    assert rig.far.control_unit.mode_ext_writes == 0
    assert not rig.far.faults


@pytest.mark.parametrize('procedure', _DONE)
def test_tuning(rig: Rig, procedure: Procedure) -> None:
    told: list[tuple[Snapshot, float]] = []
    future = rig.drive.tune(procedure, lambda *news: told.append(news))
    if rig.optimal:
        message = rig.refused(future)
        assert 'is not known of this model' in message and 'at the keypad' in message
        assert not told
        return
    before = {key: rig.far.peek(key) for key in rig.far.settings}
    result = future.result(PATIENCE)
    assert result.success, result
    assert {change.key for change in result.changes} == {
        key for key in before if rig.far.peek(key) != before[key]
    }
    # every stage, as the drive says
    codes = [snapshot.status.code for snapshot, _ in told]
    assert list(dict.fromkeys(codes))[-1] == _DONE[procedure]
    assert _TUNING in codes or procedure is Procedure.CALCULATE
    assert told[-1][0].text == rig.far.model.status_code(_DONE[procedure]).shown(rig.far.version)
    times = [elapsed for _, elapsed in told]
    assert times == sorted(times)
    assert not rig.far.faults


def test_a_tuning_is_cancelled(rig: Rig) -> None:
    if rig.optimal:
        pytest.skip('nothing to cancel')
    future = rig.drive.tune(Procedure.FULL)
    wait_until(lambda: rig.far.control_unit.status_code == _TUNING)
    rig.drive.cancel_tuning().result(PATIENCE)
    result = future.result(PATIENCE)
    assert not result.success and 'was stopped' in said(result.how)
    assert rig.far.control_unit.tuning is None
    assert rig.far.control_unit.mode == (3 if rig.held else 1)
    assert not rig.far.faults


def test_a_tuning_that_fails(rig: Rig) -> None:
    if rig.optimal:
        pytest.skip('nothing can fail')
    rig.simulator.inject('tuning-fails', 17)
    result = rig.drive.tune(Procedure.STATOR_RESISTANCE).result(PATIENCE)
    assert not result.success and '17 TunFailM' in said(result.how)
    # nothing begins while a fault is active
    assert '17 TunFailM is active' in rig.refused(rig.drive.tune(Procedure.FULL))
    assert said(rig.drive.acknowledge().result(PATIENCE)) == 'acknowledged 17 TunFailM'


def test_tuning_is_refused_while_the_motor_runs(rig: Rig) -> None:
    if rig.optimal:
        pytest.skip('it is refused anyway')
    if rig.held:
        pytest.skip('its module holds it in bus mode: no key starts it')
    rig.drive.enable().result(PATIENCE)
    assert 'the motor is enabled' in rig.refused(rig.drive.tune(Procedure.FULL))
    assert rig.drive.armed
    rig.drive.stop().result(PATIENCE)
    wait_until(lambda: not rig.far.motor.driven)
    with rig.simulator.lock:
        rig.far.control_unit.press('start')
    assert 'the motor runs' in rig.refused(rig.drive.tune(Procedure.FULL))
    assert rig.far.motor.driven


def test_tuning_is_refused_without_motor_data(rig: Rig) -> None:
    if rig.optimal:
        pytest.skip('it is refused anyway')
    with rig.simulator.lock:
        rig.far.memory.put('motor.n_nom', 0)
    message = rig.refused(rig.drive.tune(Procedure.FULL))
    assert 'motor.n_nom: set it as the motor plate says' in message
    assert not rig.far.faults
