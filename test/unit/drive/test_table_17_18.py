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

"""
Every code of MODE and SCMD [M0 tables 17 and 18], and of MODE and SMODE [M1], by the driver.

What it sends is seen on the line, and what comes of it at the simulated drive. Tuning, the error
log and the kWh counter have more tests of their own.
"""

from __future__ import annotations

from drive_rig import MODE
from drive_rig import PATIENCE
from drive_rig import SCMD
from drive_rig import STOPPING_OR_STOPPED
from drive_rig import MakeRig
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.said import raises
from support.said import said

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.drive.settings import REFERENCES
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.families.sinus_optimal.words import Smode

pytestmark = pytest.mark.usefixtures('hasty')

#: The run command of each reference, and what the simulated drive follows then, Hz.
RUNS = {
    'fieldbus': (0x101, 12.5),
    'terminal': (0x081, 25),
    'op_mode': (0x041, 25),
    'analog': (0x003, 30),
    'analog_reverse': (0x005, -30),
    'fix1': (0x00B, 10),
    'fix1_reverse': (0x00D, -10),
    'fix2': (0x013, 15),
    'fix2_reverse': (0x015, -15),
    'fix3': (0x01B, 20),
    'fix3_reverse': (0x01D, -20),
    'fix4': (0x023, 25),
    'fix4_reverse': (0x025, -25),
    'fix5': (0x02B, 30),
    'fix5_reverse': (0x02D, -30),
    'fix6': (0x033, 40),
    'fix6_reverse': (0x035, -40),
    'fix7': (0x03B, 50),
    'fix7_reverse': (0x03D, -50),
}
OPTIMAL_RUNS = {'fieldbus': RUNS['fieldbus'], 'terminal': RUNS['terminal']}
TUNES = {
    Procedure.FULL: (0x201, '45 TuningOK'),
    Procedure.BASIC: (0x301, '45 TuningOK'),
    Procedure.STATOR_RESISTANCE: (0x401, '46 RsMeasOK'),
    Procedure.CALCULATE: (0x501, '47 ParClcOK'),
}


def run(rig: Rig, reference: str, code: int, frequency: float) -> None:
    """Enable, and see that the drive follows this reference and no other; stop."""
    rig.connect()
    with rig.simulator.lock:
        rig.far.memory.put(rig.far.control_unit.setpoint_key, 333)
    assert rig.enable().startswith('enabled')
    assert rig.writes(MODE) == [Mode.BUS]
    # nothing that stood there from before, and then this
    assert rig.writes(SCMD) == [Scmd.STOP, code]
    if reference == 'fieldbus':
        # what stood there before does not count
        assert rig.far.memory.raw(rig.far.control_unit.setpoint_key) == 0
        rig.publish(12.5)
    else:
        with raises(Cause.OWN_REFERENCE):
            rig.drive.set_setpoint(12.5)
    rig.wait_for_frequency(frequency)
    assert said(rig.drive.stop().result(PATIENCE)).startswith(STOPPING_OR_STOPPED)
    assert rig.writes(SCMD)[:3] == [Scmd.STOP, code, Scmd.STOP]
    rig.wait_until_still()


@pytest.mark.parametrize('reference', RUNS, ids=[f'{RUNS[one][0]:03X}_{one}' for one in RUNS])
def test_scmd_runs(make_rig: MakeRig, reference: str) -> None:
    run(make_rig(reference=reference), reference, *RUNS[reference])


@pytest.mark.parametrize(
    'reference', OPTIMAL_RUNS, ids=[f'{RUNS[one][0]:03X}_{one}' for one in OPTIMAL_RUNS]
)
def test_optimal_smode_runs(make_rig: MakeRig, reference: str) -> None:
    rig = make_rig(model='sinus_optimal', reference=reference)
    run(rig, reference, *OPTIMAL_RUNS[reference])


@pytest.mark.parametrize('model', ['sinus_g2', 'sinus_optimal'])
def test_scmd_000_stops_and_control_is_kept(make_rig: MakeRig, model: str) -> None:
    rig = make_rig(model=model)
    rig.turn()
    rig.drive.stop().result(PATIENCE)
    assert rig.writes(SCMD)[-1] == 0
    wait_until(lambda: rig.far.control_unit.status_code == 37)
    assert rig.far.control_unit.mode == Mode.BUS


@pytest.mark.parametrize(
    'procedure', TUNES, ids=lambda one: f'{TUNES[one][0]:03X}_{one.name.lower()}'
)
def test_scmd_tunes(rig: Rig, procedure: Procedure) -> None:
    rig.connect()
    tuning = rig.drive.tune(procedure)
    wait_until(lambda: rig.far.control_unit.mode == Mode.INHIBIT)
    rig.skip(10.0)
    result = tuning.result(PATIENCE)
    code, shown = TUNES[procedure]
    assert result.success and shown in said(result.how)
    assert rig.writes(SCMD)[:2] == [Scmd.STOP, code]


def test_scmd_800_erases_the_error_log(rig: Rig) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.trip(5)
        rig.far.read_raw('fieldbus.inv_st_with_ack')
    rig.drive.erase_error_log().result(PATIENCE)
    assert 0x800 in rig.writes(SCMD)
    assert rig.far.faults.log == []


def test_scmd_900_resets_the_kwh_counter(rig: Rig) -> None:
    rig.connect()
    rig.drive.reset_energy().result(PATIENCE)
    assert 0x900 in rig.writes(SCMD)
    assert rig.far.counters.energy == 0


def test_no_code_of_scmd_is_left_out() -> None:
    driven = {code for code, _ in (*RUNS.values(), *TUNES.values())} | {0x000, 0x800, 0x900}
    assert driven == set(Scmd)
    assert {0x000, *(code for code, _ in OPTIMAL_RUNS.values())} == set(Smode)
    assert tuple(RUNS) == REFERENCES


@pytest.mark.parametrize('reference', [one for one in RUNS if one not in OPTIMAL_RUNS])
def test_optimal_has_no_other_reference(reference: str) -> None:
    with pytest.raises(ValueError, match='it must be fieldbus or terminal'):
        DriveSettings(model='sinus_optimal', reference=reference)


# --- MODE -----------------------------------------------------------------------------------------


def test_mode_0_inhibit_lets_nobody_enable(rig: Rig) -> None:
    rig.connect()
    with rig.simulator.lock:
        rig.far.write_raw('fieldbus.mode', Mode.BUS)
        rig.far.write_raw('fieldbus.scmd', Scmd.FULL_TUNING)
    assert 'MODE is Inhibit' in rig.refused(rig.drive.enable())
    assert rig.writes(MODE) == []


def test_mode_1_stop_releases_the_motor_and_gives_control_back(rig: Rig) -> None:
    rig.turn()
    rig.drive.quick_stop().result(PATIENCE)
    assert rig.writes(MODE)[-1] == Mode.STOP
    assert (rig.far.motor.driven, rig.far.control_unit.mode) == (False, Mode.STOP)


@pytest.mark.parametrize('model', ['sinus_g2', 'sinus_optimal'])
def test_mode_1_gives_control_back_when_the_motor_stands(make_rig: MakeRig, model: str) -> None:
    rig = make_rig(model=model)
    rig.turn()
    answer = said(rig.drive.disconnect(PATIENCE).result(PATIENCE))
    assert answer.endswith('; control released')
    assert rig.writes(MODE) == [Mode.BUS, 1]
    assert (rig.far.motor.driven, rig.far.control_unit.mode) == (False, 1)


@pytest.mark.parametrize('model', ['sinus_g2', 'sinus_optimal'])
def test_mode_2_is_read_from_the_terminals_and_never_written(make_rig: MakeRig, model: str) -> None:
    rig = make_rig(model=model)
    rig.turn()
    rig.simulator.inject('keypad', 'ext')
    wait_until(lambda: not rig.drive.armed)
    rig.next_snapshots(2)
    assert (rig.far.motor.driven, rig.far.control_unit.mode) == (True, 2)
    rig.notes.wait_for('terminals have control now')
    # somebody who enables it takes it from them
    assert rig.enable().startswith('enabled')
    rig.drive.disconnect(PATIENCE).result(PATIENCE)
    assert rig.far.control_unit.mode_ext_writes == 0


@pytest.mark.parametrize('model', ['sinus_g2', 'sinus_optimal'])
def test_mode_3_takes_control_and_stops_what_runs(make_rig: MakeRig, model: str) -> None:
    rig = make_rig(model=model)
    rig.simulator.inject('keypad', 'ext')
    rig.connect()
    rig.next_snapshots(2)
    assert rig.far.motor.driven
    assert rig.enable().startswith('enabled')
    assert rig.writes(MODE) == [Mode.BUS]
    # with no set-point yet it goes to 0
    rig.wait_for_frequency(0.0)
    assert rig.far.control_unit.mode == Mode.BUS
