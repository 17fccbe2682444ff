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


"""Finding 3: a drive that scales the speeds of the bus turns as fast as it is told [C114]."""

from __future__ import annotations

from dataclasses import replace

import pytest
from support.said import says
from ways_rig import WAYS
from ways_rig import WayRig

from nfo_sinus_driver.drive import Cause

G2_WAYS = {name: way for name, way in WAYS.items() if name.startswith('G2') and 'tele' not in name}


def rig_of(name: str, numerator: int, denominator: int, **settings: float) -> WayRig:
    parameters = {
        'control.mode': 'Speed',
        'fieldbus.spd_scl_numerator': numerator,
        'fieldbus.spd_scl_denominator': denominator,
    }
    return WayRig(replace(G2_WAYS[name], parameters=parameters), **settings)


@pytest.mark.parametrize('scale', [(1, 10), (2, 1), (1, 1), (0, 1), (1, 0), (-1, 10)])
@pytest.mark.parametrize('way', G2_WAYS)
def test_speeds_are_in_rpm_whatever_the_scale(way: str, scale: tuple[int, int]) -> None:
    rig = rig_of(way, *scale)
    rig.answer(rig.drive.connect())
    rig.drive.activate()
    rig.answer(rig.drive.enable())
    for speed in (300.0, -300.0):
        rig.send(speed)
        rig.pass_time(4.0)
        assert rig.far.motor.speed == pytest.approx(speed, abs=3)
        assert rig.drive.snapshot.speed == pytest.approx(speed, abs=3)
        assert rig.drive.snapshot.actual == pytest.approx(speed, abs=3)
        assert rig.drive.snapshot.setpoint == speed
    reports = [text for _, _, text in rig.notes.events if says(text, Cause.SPEED_SCALE)]
    # what cannot be a scale is none
    used = scale in ((1, 10), (2, 1))
    assert len(reports) == used
    rig.answer(rig.drive.stop())
    # a setting, too
    rig.far.memory.put('speed.c_fix1', 1500)
    reading = rig.drive.measure('speed.c_fix1')
    rig.answer(reading)
    value = reading.result()
    assert value == (1500 * scale[0] / scale[1] if used else 1500)
    rig.close()


def test_a_scale_that_was_changed_since_connect_counts_from_the_next_enable_on() -> None:
    rig = rig_of('G2, Modbus, MODE', 1, 1)
    rig.answer(rig.drive.connect())
    rig.drive.activate()
    rig.far.memory.put('fieldbus.spd_scl_numerator', 10)
    rig.answer(rig.drive.enable())
    rig.send(300.0)
    rig.pass_time(4.0)
    assert rig.far.motor.speed == pytest.approx(300.0, abs=10)
    assert [text for _, _, text in rig.notes.events if says(text, Cause.SPEED_SCALE)]
    rig.close()


def test_a_speed_that_the_scale_cannot_carry_is_clamped() -> None:
    rig = rig_of('G2, Modbus, MODE', 1, 10, setpoint_max=9000.0)
    rig.answer(rig.drive.connect())
    rig.drive.activate()
    rig.answer(rig.drive.enable())
    rig.send(9000.0)
    rig.pass_time(1.0)
    assert rig.far.memory.raw('status.spd_set') == 0x7FFF
    assert rig.drive.snapshot.setpoint_clamped
    rig.close()


@pytest.mark.parametrize('way', ['G2, Modbus, MODE', 'G2, Classic, MODE', 'G2, CANopen, MODE'])
def test_scales_that_no_bus_tells_are_chosen(way: str) -> None:
    # FrqScl 1/100: a set-point of 20 Hz is 2000 counts, and 200 counts are 2 Hz
    rig = WayRig(G2_WAYS[way], frequency_scale=0.01)
    registers = rig.drive.registers
    key = 'status.frq_set'
    raw = registers.model[key].at(registers.protocol).codec.decode(registers.encode(key, 20.0))
    assert raw == 2000
    assert registers.value(key, registers.encode(key, 20.0)) == 20.0
    assert registers.limits(key)[2] == 0.01
    rig.close()
