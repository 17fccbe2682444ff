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
"""What the manual leaves open of CANopen, each reading of it; and two protocols at one drive."""

from __future__ import annotations

from can_bus_bench import Bus
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.addresses import packed
from support.addresses import words_of

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Refused
from nfo_sinus_driver.simulator.modbus import server as modbus_server
from nfo_sinus_driver.simulator.sdo import Abort
from nfo_sinus_driver.simulator.sdo import AbortCode
from nfo_sinus_driver.simulator.sinus_g2.canopen_shape import OPTIONS

MODEL = load_family('sinus_g2')
PLACED = [one for one in MODEL.values() if 'canopen' in one.addresses]
BOTH = [one for one in PLACED if 'modbus' in one.addresses]
READABLE = [one for one in BOTH if one.access is not Access.WRITE]
WRITABLE = [
    one for one in READABLE if one.access is Access.READ_WRITE and not one.key.startswith('serial.')
]
INV_ST, MODE, ACCEL, P_NOM = 0x2026, 0x2022, 0x201C, 0x2005
EXT_FAIL = 5


def there(bus: Bus, index: int, sub_index: int = 0) -> bool:
    """Tell whether an object can be read."""
    request = b'\x40' + index.to_bytes(2, 'little') + bytes((sub_index, 0, 0, 0, 0))
    return not bus.sdo(request.hex()).startswith('80')


def same(parameter, one, other) -> bool:
    """Tell whether two values are alike, to the coarser step of two protocols."""
    if parameter.kind is not float:
        return one == other
    step = float(max(parameter.factor('modbus'), parameter.factor('canopen')))
    return one == pytest.approx(other, abs=step)


# ---- the communication profile ----

ALWAYS = [(0x1000, 0), (0x1001, 0), (0x1017, 0), (0x1018, 0), (0x1018, 1)]
MORE = [
    (0x1008, 0),
    (0x1009, 0),
    (0x100A, 0),
    (0x1014, 0),
    (0x1018, 4),
    (0x1200, 0),
    (0x1200, 2),
]
WATCHING = {'heartbeat': [(0x1016, 0), (0x1016, 1)], 'guarding': [(0x100C, 0), (0x100D, 0)]}


@pytest.mark.parametrize('watch', ['by_shape', 'none', 'heartbeat', 'guarding', 'both'])
@pytest.mark.parametrize('profile', ['full', 'minimal', 'bare'])
def test_what_there_is_of_the_communication_profile(profile: str, watch: str) -> None:
    bus = Bus(canopen_profile=profile, canopen_watch=watch)
    usual = 'both' if profile == 'full' else 'none'
    watches = {'by_shape': usual}.get(watch, watch)
    for objects, wanted in (
        (ALWAYS, profile != 'bare'),
        (MORE, profile == 'full'),
        (WATCHING['heartbeat'], watches in ('heartbeat', 'both')),
        (WATCHING['guarding'], watches in ('guarding', 'both')),
    ):
        assert [there(bus, *place) for place in objects] == len(objects) * [wanted]
    # the drive itself is there in any case, and tells its boot-up
    assert there(bus, INV_ST, 2)
    bus.drive.power_cycle(0.1)
    assert bus.wait(0.5)[0].data == b'\x00'


def test_identity() -> None:
    bus = Bus((3,), settings={'fieldbus.sw_ver': 4.38})
    assert bus.read(0x1018, 0, 3) == b'\x04'
    assert bus.read(0x1018, 3, 3) == (438).to_bytes(4, 'little')
    serial = int(bus.drives[3].serial_number)
    assert bus.read(0x1018, 4, 3) == (serial & 0xFFFFFFFF).to_bytes(4, 'little')
    assert bus.read(0x1200, 1, 3) == (0x603).to_bytes(4, 'little')
    assert bus.read(0x1200, 2, 3) == (0x583).to_bytes(4, 'little')
    assert bus.read(0x1014, 0, 3) == (0x083).to_bytes(4, 'little')


def test_the_error_register_shows_a_fault() -> None:
    bus = Bus()
    assert bus.read(0x1001) == b'\x00'
    bus.drive.trip(EXT_FAIL)
    assert bus.read(0x1001) == b'\x01'


# ---- sizes ----


@pytest.mark.parametrize(
    ('types', 'mode', 'accel', 'p_nom'),
    [('table', 2, 4, 4), ('narrow', 1, 4, 4), ('wide', 4, 4, 4)],
)
def test_sizes(types: str, mode: int, accel: int, p_nom: int) -> None:
    bus = Bus(canopen_types=types)
    assert len(bus.read(0x2024)) == mode
    assert len(bus.read(ACCEL, 2)) == accel
    assert len(bus.read(P_NOM)) == p_nom
    # each is written with the size that it has, and with no other
    for size in (1, 2, 4):
        code = bus.write(0x2024, 0, bytes((3,)).ljust(size, b'\0'))
        assert code == ('' if size == mode else '06070012' if size > mode else '06070013')
    assert bus.drive.peek('control.mode') == 'Speed'


@given(st.sampled_from(['table', 'narrow', 'wide']), st.sampled_from(READABLE))
def test_each_size_tells_the_same(types: str, parameter) -> None:
    drive = simulated_drive('sinus_g2', canopen_types=types)
    place = parameter.at('canopen')
    data = drive.servers['canopen'].read(place.index, place.sub_index or 0)
    number = int.from_bytes(data, 'little', signed=place.number.signed)
    usual = place.number.encode(number)
    assert same(parameter, parameter.decode(usual, 'canopen'), drive.peek(parameter.key))


@pytest.mark.parametrize('types', ['narrow', 'wide'])
def test_negative_numbers_have_their_sign_in_any_size(types: str) -> None:
    bus = Bus(canopen_types=types)
    size = len(bus.read(0x207C))
    assert bus.write(0x207C, 0, (-123).to_bytes(size, 'little', signed=True)) == ''
    assert bus.drive.peek('status.frq_set') == -12.3
    assert bus.read(0x207C) == (-123).to_bytes(size, 'little', signed=True)


def test_what_does_not_fit_the_drive_is_refused() -> None:
    bus = Bus(canopen_types='wide')
    assert bus.write(0x207C, 0, (40_000).to_bytes(4, 'little')) == '06090030'


# ---- arrays ----


def test_arrays_from_one() -> None:
    bus = Bus()
    assert bus.read(INV_ST) == bus.read(ACCEL) == b'\x02'
    assert bus.sdo('4026200300000000') == '8026200311000906'
    assert bus.read(ACCEL, 2) == (5000).to_bytes(4, 'little')


def test_arrays_from_zero() -> None:
    bus = Bus(canopen_sub_indices='from_zero')
    assert bus.sdo('4026200200000000') == '8026200211000906'
    assert bus.read(ACCEL, 1) == (5000).to_bytes(4, 'little')
    bus.drive.trip(EXT_FAIL)
    assert bus.read(INV_ST, 1) == bytes((EXT_FAIL, 0))
    assert bus.drive.faults.shown == EXT_FAIL
    assert bus.read(INV_ST, 0) == bytes((EXT_FAIL, 0))
    assert bus.drive.faults.shown == 0


@pytest.mark.parametrize(('which', 'acknowledges'), [('first', 1), ('second', 2)])
def test_which_element_acknowledges(which: str, acknowledges: int) -> None:
    bus = Bus(canopen_acknowledging=which)
    bus.drive.trip(EXT_FAIL)
    assert bus.read(INV_ST, 3 - acknowledges) == bytes((EXT_FAIL, 0))
    assert bus.drive.faults.shown == EXT_FAIL
    assert bus.read(INV_ST, acknowledges) == bytes((EXT_FAIL, 0))
    assert bus.drive.faults.shown == 0


# ---- the error log ----


@pytest.mark.parametrize('where', ['2F7C', '4F7D', 'none'])
def test_where_the_error_log_stands(where: str) -> None:
    bus = Bus(canopen_error_log=where)
    bus.drive.trip(EXT_FAIL)
    for name in ('2F7C', '4F7D'):
        first = int(name, 16)
        assert there(bus, first) == there(bus, first + 31) == (where == name)
        assert not there(bus, first + 32)
    if where != 'none':
        assert bus.read(int(where, 16))[3] == EXT_FAIL


# ---- versions, options ----


def test_what_younger_firmware_has() -> None:
    assert there(Bus(settings={'fieldbus.sw_ver': 4.38}), 0x20E9)
    bus = Bus(settings={'fieldbus.sw_ver': 4.30})
    assert bus.sdo('40e9200000000000') == '80e9200000000206'


@pytest.mark.parametrize('option', OPTIONS, ids=lambda one: one.name)
def test_every_choice_is_possible_and_no_other(option) -> None:
    for choice in option.choices:
        assert there(Bus(**{option.name: choice}), MODE)
    with pytest.raises(ValueError, match=f'{option.name}: choose one of'):
        Bus(**{option.name: 'nonsense'})


# ---- two protocols at one drive ----


def by_modbus(drive, parameter):
    place = parameter.at('modbus')
    words = modbus_server(drive).read(place.index, place.codec.size // 2)
    return parameter.decode(packed(*words), 'modbus')


def by_canopen(drive, parameter):
    place = parameter.at('canopen')
    return parameter.decode(
        drive.servers['canopen'].read(place.index, place.sub_index or 0), 'canopen'
    )


@pytest.mark.parametrize('parameter', READABLE, ids=lambda one: one.key)
def test_both_read_the_same(parameter) -> None:
    drive = simulated_drive('sinus_g2')
    assert same(parameter, by_canopen(drive, parameter), by_modbus(drive, parameter))


@given(st.sampled_from(WRITABLE), st.booleans(), st.data())
def test_what_one_writes_the_other_reads(parameter, first: bool, data: st.DataObject) -> None:
    drive = simulated_drive('sinus_g2')
    protocol = 'modbus' if first else 'canopen'
    number = parameter.at(protocol).number
    codes = [int(code) for code in parameter.labels]
    raw = data.draw(
        st.sampled_from(codes) if codes else st.integers(number.minimum, number.maximum)
    )
    place, encoded = parameter.at(protocol), number.encode(raw)
    before = by_canopen(drive, parameter)
    try:
        if first:
            modbus_server(drive).write(place.index, words_of(encoded))
        else:
            drive.servers['canopen'].write(place.index, place.sub_index or 0, encoded)
    except (Refused, Abort):
        assert by_canopen(drive, parameter) == before
    else:
        assert same(parameter, by_canopen(drive, parameter), by_modbus(drive, parameter))


def test_a_motor_that_one_starts_the_other_stops() -> None:
    bus = Bus(always_heard=True)
    assert bus.write(0x207C, 0, b'\x64\x00') == ''
    assert bus.write(0x2023, 0, b'\x01\x01') == ''
    bus.wait(1.0)
    modbus = modbus_server(bus.drive)
    assert modbus.read(0x2A5, 1) == (38,) or modbus.read(0x2A5, 1) == (39,)
    modbus.write(0x298, [0])
    bus.wait(5.0)
    assert bus.read(INV_ST, 2) == b'\x25\x00'
    assert not bus.drive.motor.driven


@pytest.mark.parametrize('place', [(0x6040, 0), (0x6041, 0), (0x2FFF, 0)])
def test_objects_that_are_not_there(place: tuple[int, int]) -> None:
    node = simulated_drive('sinus_g2').servers['canopen']
    with pytest.raises(Abort) as refused:
        node.read(*place)
    assert refused.value.code is AbortCode.NO_OBJECT
