# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Every code of MODE and SCMD [M0 tables 17 and 18], and of MODE and SMODE [M1], by the driver.

Tuning (201h to 501h) is in test_tuning.py, the error log (800h) and the kWh counter (900h) in
test_error_log.py.
"""

from __future__ import annotations

import pytest
from support.rig import Rig
from support.said import raises

from nfo_sinus_driver.drive import Cause, DriveSettings
from nfo_sinus_driver.drive.known.settings import REFERENCES
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd
from nfo_sinus_driver.families.sinus_optimal.words import Smode

MODE, SCMD = 'fieldbus.mode', 'fieldbus.scmd'
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
TUNES = {0x201, 0x301, 0x401, 0x501}


@pytest.mark.parametrize('connection', ['rtu', 'classic v5.0', 'optimal'])
def test_run_commands(connection: str) -> None:
    wrong = {}
    for reference, (code, frequency) in (OPTIMAL_RUNS if connection == 'optimal' else RUNS).items():
        with Rig(connection, reference=reference, poll_rate=5.0, telemetry_rate=0.0) as rig:
            command = 'fieldbus.smode' if connection == 'optimal' else SCMD
            rig.connect()
            rig.far.memory.put(rig.far.control_unit.setpoint_key, 333)
            rig.enable()
            # nothing that stood there from before, and then this
            found = [rig.written(MODE) == [Mode.BUS], rig.written(command) == [Scmd.STOP, code]]
            if reference == 'fieldbus':
                # what stood there before does not count
                found.append(rig.far.memory.raw(rig.far.control_unit.setpoint_key) == 0)
                rig.send(frequency)
            else:
                with raises(Cause.OWN_REFERENCE):
                    rig.drive.set_setpoint(12.5)
            rig.pass_time(1.0)
            found.append(abs(rig.far.motor.frequency - frequency) < 0.2)
            found.append(rig.answer(rig.drive.stop()).startswith('stopping: it ramps down'))
            rig.pass_time(0.5)
            found.append(rig.written(command)[2] == Scmd.STOP and not rig.far.motor.driven)
        if not all(found):
            wrong[reference] = found
    assert not wrong


def test_no_code_is_left_out() -> None:
    driven = {code for code, _ in RUNS.values()} | TUNES | {0x000, 0x800, 0x900}
    assert driven == set(Scmd)
    assert {0x000, *(code for code, _ in OPTIMAL_RUNS.values())} == set(Smode)
    assert tuple(RUNS) == REFERENCES
    for reference in RUNS.keys() - OPTIMAL_RUNS:
        with pytest.raises(ValueError, match='it must be fieldbus or terminal'):
            DriveSettings(model='sinus_optimal', reference=reference)
