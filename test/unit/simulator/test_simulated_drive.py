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

"""Registers, values and counters of a simulated drive, in virtual time."""

import pytest

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.simulator.drive import describe
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.modbus import server

MODEL = load_family('sinus_g2')
ON_MODBUS = [p for p in MODEL.values() if 'modbus' in p.addresses]


# ---- factory settings ----


def test_it_comes_as_from_the_factory(bench):
    expected = {
        'fieldbus.sw_ver': 4.38,
        'fieldbus.nfo_ver': 4018,
        'fieldbus.mode': 1,
        'fieldbus.inv_st': 24,
        'motor.p_nom': 1.5,
        'motor.n_nom': 1440,
        'control.mode': 'Freque',
        'control.accel': 5.0,
        'control.retard': 5.0,
        'control.auto_start': False,
        'control.st_mode': 'Brake',
        'serial.bus_type': 'MbusRtu',
        'serial.address': 1,
        'serial.si_baud': '19200bps',
        'serial.sio_tot': 0.0,
        'serial.auto_stop': False,
        'fieldbus.spd_scl_numerator': 1,
        'fieldbus.spd_scl_denominator': 1,
    }
    assert {key: bench.read(key) for key in expected} == expected
    assert not bench.running


@pytest.mark.parametrize('parameter', ON_MODBUS, ids=lambda p: p.key)
def test_every_register_of_the_catalog_answers_as_its_access_says(bench, parameter):
    place = parameter.at('modbus')
    count = place.codec.size // 2
    if parameter.access is Access.WRITE:
        with bench.refuses(Reason.ADDRESS):
            server(bench.drive).read(place.index, count)
        return
    words = server(bench.drive).read(place.index, count)
    assert len(words) == count
    if parameter.access is not Access.READ_WRITE:
        with bench.refuses(Reason.ADDRESS):
            server(bench.drive).write(place.index, words)
    elif not parameter.key.startswith('fieldbus.'):
        server(bench.drive).write(place.index, words)
        assert server(bench.drive).read(place.index, count) == words


@pytest.mark.parametrize('parameter', ON_MODBUS, ids=lambda p: p.key)
def test_a_parameter_is_read_and_written_whole_or_not_at_all(bench, parameter):
    place = parameter.at('modbus')
    whole = place.codec.size // 2
    for register, count in [
        (place.index, whole + 1),
        (place.index, whole - 1),
        (place.index + 1, whole - 1),
    ]:
        if register == 0x2A5 and count == 1:
            continue  # the other InvSt begins here
        with bench.refuses(Reason.ADDRESS):
            server(bench.drive).read(register, count)
        with bench.refuses(Reason.ADDRESS):
            server(bench.drive).write(register, [0] * count)


def test_factory_values_are_ones_that_the_drive_would_take(bench):
    for parameter in ON_MODBUS:
        if parameter.access is Access.READ_WRITE:
            bench.drive.memory.check(parameter, bench.drive.memory.raw(parameter.key))


# ---- values ----


@pytest.mark.parametrize(
    ('register', 'words'),
    [
        (0x3FC, [1501]),  # 150.1 Hz
        (0x3FC, [0x10000 - 1501]),
        (0x25C, [9001]),
        (0x408, [201]),
        (0x27E, [199, 0]),  # 0.199 s
        (0x27E, [0xFFFF, 0xFFFF]),
        (0x29C, [4]),
        (0x3D4, [17]),
        (0x3D0, [248]),
        (0x3DC, [251]),
    ],
)
def test_a_value_that_the_manual_forbids_is_refused(bench, register, words):
    before = describe(bench.drive)['parameters']
    with bench.refuses(Reason.VALUE):
        server(bench.drive).write(register, words)
    assert describe(bench.drive)['parameters'] == before


def test_writes_are_counted_and_settings_apart_from_commands(bench):
    bench.write('control.accel', 7.0)
    bench.write('control.accel', 7.0)
    bench.run(10)
    with bench.refuses(Reason.VALUE):
        server(bench.drive).write(0x27E, [0, 0])
    assert bench.drive.writes == {'control.accel': 2}
    assert bench.drive.command_writes == {
        'fieldbus.mode': 1,
        'fieldbus.scmd': 1,
        'status.frq_set': 1,
    }


@pytest.mark.parametrize('key', [p.key for p in ON_MODBUS if p.stopped])
def test_an_init_parameter_changes_only_while_the_motor_stands(bench, key):
    value = bench.read(key)
    bench.write(key, value)
    bench.run(20, 1.0)
    with bench.refuses(Reason.STATE):
        bench.write(key, value)
    bench.mode(1)
    bench.drive.advance(0.5)
    assert not bench.running
    with bench.refuses(Reason.STATE):  # it still coasts
        bench.write(key, value)
    bench.drive.advance(10)
    bench.write(key, value)


def test_another_nameplate_is_another_motor(bench):
    bench.write('motor.n_nom', 2880)
    bench.run(25, 6)
    assert bench.drive.motor.rotor_speed == pytest.approx(1475, abs=15)


# ---- counters and the rest ----


def test_counters_advance(bench):
    before = describe(bench.drive)['parameters']
    bench.run(50, 3600)
    after = describe(bench.drive)['parameters']
    assert after['status.op_time'] - before['status.op_time'] == pytest.approx(1, abs=0.11)
    assert after['status.rn_time'] - before['status.rn_time'] == pytest.approx(1, abs=0.11)
    assert 0.1 < after['status.e_out'] - before['status.e_out'] < 2
    bench.mode(1)
    bench.drive.advance(3600)
    assert bench.read('status.rn_time') == pytest.approx(after['status.rn_time'], abs=0.11)


def test_catching_up_with_a_clock(bench):
    bench.drive.advance_to(1000.0)
    assert bench.drive.time == 0
    bench.drive.advance_to(1002.5)
    assert bench.drive.time == pytest.approx(2.5)
    bench.drive.advance_to(1001.0)
    assert bench.drive.time == pytest.approx(2.5)


@pytest.mark.parametrize(
    'options',
    [
        {'model': 'sinus_g3'},
        {'address': 248},
        {'settings': {'control.acel': 1}},
        {'settings': {'control.accel': 1000}},
    ],
)
def test_impossible_drives(options):
    with pytest.raises(ValueError, match=r'sinus_g2|range'):
        simulated_drive(**options)


def test_the_setpoint_of_classic_goes_where_the_mode_says(bench):
    bench.drive.write_raw('fieldbus.setpoint', -123)
    assert bench.read('status.frq_set') == -12.3
    bench.write('control.mode', 'Speed')
    bench.drive.write_raw('fieldbus.setpoint', 500)
    assert bench.read('status.spd_set') == 500
    assert bench.drive.read_raw('fieldbus.setpoint') == 500
