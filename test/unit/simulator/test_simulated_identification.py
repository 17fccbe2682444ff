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

"""Who a simulated drive says it is, byte by byte, and what reads and writes in one."""

from __future__ import annotations

import pytest

from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.main import main
from nfo_sinus_driver.simulator.modbus import TREATMENTS
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.modbus_frames import ModbusRtu
from nfo_sinus_driver.simulator.simulator import Simulator

SERIAL = '0123456789ABCDEF'
#: What M0 §6.2.4 prints, the revision in its 17 characters.
OBJECTS = (
    b'NFO Drives AB',
    b'',
    b' 4.38 / 4018     ',
    b'http://www.nfo.se',
    b'NFO Sinus',
    b'1.50/400',
    b'',
)


def ask(drive: SimulatedDrive, request: str) -> bytes:
    return server(drive).answer(bytes.fromhex(request))


def objects(*numbers: int) -> bytes:
    parts = (bytes((number, len(OBJECTS[number]))) + OBJECTS[number] for number in numbers)
    return b''.join(parts)


@pytest.mark.parametrize(
    ('request_', 'head', 'numbers'),
    [
        ('2B 0E 01 00', '2B 0E 01 82 00 00 03', (0, 1, 2)),
        ('2B 0E 01 02', '2B 0E 01 82 00 00 01', (2,)),
        ('2B 0E 02 00', '2B 0E 02 82 00 00 07', (0, 1, 2, 3, 4, 5, 6)),
        ('2B 0E 02 05', '2B 0E 02 82 00 00 02', (5, 6)),
        # from an object that is not there it begins anew, as the standard says
        ('2B 0E 01 03', '2B 0E 01 82 00 00 03', (0, 1, 2)),
        ('2B 0E 02 80', '2B 0E 02 82 00 00 07', (0, 1, 2, 3, 4, 5, 6)),
        *((f'2B 0E 04 {n:02X}', '2B 0E 04 82 00 00 01', (n,)) for n in range(7)),
    ],
)
def test_device_identification(request_: str, head: str, numbers: tuple[int, ...]) -> None:
    assert ask(simulated_drive(), request_) == bytes.fromhex(head) + objects(*numbers)


@pytest.mark.parametrize(
    ('request_', 'refusal'),
    [
        # no such object; no such code; another MEI type; wrong lengths
        ('2B 0E 04 07', 'AB 02'),
        ('2B 0E 03 00', 'AB 03'),
        ('2B 0E 00 00', 'AB 03'),
        ('2B 0D 01 00', 'AB 01'),
        ('2B', 'AB 01'),
        ('2B 0E 01', 'AB 03'),
        ('2B 0E 01 00 00', 'AB 03'),
        ('11 00', '91 03'),
    ],
)
def test_identification_refused(request_: str, refusal: str) -> None:
    assert ask(simulated_drive(), request_) == bytes.fromhex(refusal)


def test_the_longest_answer_fits_into_a_frame() -> None:
    frame = ModbusRtu.wrap(1, ask(simulated_drive(), '2B 0E 02 00'))
    assert len(frame) == 10 + 7 * 2 + sum(map(len, OBJECTS)) <= 256


@pytest.mark.parametrize(
    ('power', 'voltage', 'model'),
    [
        (1.5, 400, b'1.50/400'),
        (3, 230, b'3.00/230'),
        (11, 400, b'11.0/400'),
        (100, 400, b'100/400 '),
    ],
)
def test_model_is_power_and_voltage(power: float, voltage: int, model: bytes) -> None:
    drive = simulated_drive(settings={'motor.p_nom': power, 'motor.u_nom': voltage})
    assert server(drive).device_objects()[5] == model


def test_revision_is_the_firmware_in_17_characters() -> None:
    drive = simulated_drive(settings={'fieldbus.sw_ver': 4.3, 'fieldbus.nfo_ver': 4018})
    assert server(drive).device_objects()[2] == b' 4.30 / 4018     '
    assert len(server(drive).device_objects()[2]) == 17


def test_serial_number_is_all_that_is_reported() -> None:
    # 16 characters and no run indicator [C94]
    drive = simulated_drive(serial_number=SERIAL)
    assert ask(drive, '11') == b'\x11\x10' + SERIAL.encode()
    assert ask(simulated_drive(serial_number='7'), '11') == b'\x11\x107' + b' ' * 15


def test_every_drive_has_its_own_serial_number() -> None:
    numbers = {ask(simulated_drive(address=address), '11')[2:] for address in range(1, 248)}
    assert len(numbers) == 247
    assert {len(number) for number in numbers} == {16}


@pytest.mark.parametrize('number', ['0123456789ABCDEFG', 'Ä', 'a\nb'])
def test_no_serial_number(number: str) -> None:
    with pytest.raises(ValueError, match='serial number'):
        simulated_drive(serial_number=number)


@pytest.mark.parametrize('request_', ['11', '2B 0E 02 00', '17 0294 0001 0294 0001 02 0003'])
def test_functions_that_older_drives_do_not_have(request_: str) -> None:
    refuses = simulated_drive(newer_functions='refused')
    function = int(request_[:2], 16)
    assert ask(refuses, request_) == bytes((function | 0x80, 1))
    silent = simulated_drive(newer_functions='silent')
    assert ask(silent, request_) == b''
    for drive in (refuses, silent):
        assert ask(drive, '03 0294 0001') == bytes.fromhex('03 02 0001')
        assert not drive.command_writes


# --- write and read in one ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('request_', 'answer'),
    [
        # what is read is what was written just before
        ('17 0294 0001 0294 0001 02 0003', '17 02 0003'),
        ('17 027E 0002 027E 0002 04 1170 0001', '17 04 1170 0001'),
        ('17 0294 0001 027E 0002 04 1170 0001', '17 02 0001'),
        # 02: nothing to read or to write there, a part, not that way
        ('17 0000 0001 0294 0001 02 0003', '97 02'),
        ('17 0298 0001 0294 0001 02 0003', '97 02'),
        ('17 027E 0001 0294 0001 02 0003', '97 02'),
        ('17 0294 0001 0000 0001 02 0003', '97 02'),
        ('17 0294 0001 02A5 0001 02 0003', '97 02'),
        # 03: counts and lengths that the standard forbids, values the drive does not take
        ('17 0294 0000 0294 0001 02 0003', '97 03'),
        ('17 0294 007E 0294 0001 02 0003', '97 03'),
        ('17 0294 0001 0294 0000 00', '97 03'),
        ('17 0294 0001 0294 0001 04 0003 0003', '97 03'),
        ('17 0294 0001 0294 0001 02 0003 00', '97 03'),
        ('17 0294 0001 0294 0001 02', '97 03'),
        ('17 0294 0001', '97 03'),
        ('17', '97 03'),
        ('17 0294 0001 0294 0001 02 0000', '97 03'),
        # 04: not now
        ('17 0294 0001 0298 0001 02 0101', '97 04'),
    ],
)
def test_write_and_read(request_: str, answer: str) -> None:
    assert ask(simulated_drive(), request_) == bytes.fromhex(answer)


def test_nothing_is_written_when_there_is_nothing_to_read() -> None:
    drive = simulated_drive()
    assert ask(drive, '17 0000 0001 027E 0002 04 1170 0001') == bytes.fromhex('97 02')
    assert not drive.writes
    assert ask(drive, '17 0294 0001 027E 0002 04 1170 0001')[0] == 0x17
    assert drive.writes == {'control.accel': 1}


# --- on a line, and from the command line ---------------------------------------------------------


def test_two_drives_on_a_line(open_master) -> None:
    with Simulator([1, 2], serial_numbers=['LEFT']) as simulator:
        master = open_master(simulator.port)
        left = master.ask(1, b'\x11', 21)
        right = master.ask(2, b'\x11', 21)
        device = master.ask(2, bytes.fromhex('2B0E0200'), 94)
        assert simulator.state(1)['serial_number'] == 'LEFT' + 12 * ' '
        assert simulator.state(2)['serial_number'].encode() == right[3:-2]
    assert left[:7] == b'\x01\x11\x10LEFT'
    assert b'1.50/400' in device


def test_a_silent_one_says_nothing_and_is_there(open_master) -> None:
    with Simulator(newer_functions='silent') as simulator:
        master = open_master(simulator.port)
        assert master.ask(1, b'\x11', 21, timeout=0.3) == b''
        assert len(master.ask(1, bytes.fromhex('0302940001'), 7)) == 7


def test_options_that_cannot_be() -> None:
    with pytest.raises(ValueError, match='2 serial numbers for 1 drives'):
        Simulator(serial_numbers=['1', '2'])
    with pytest.raises(ValueError, match=', '.join(TREATMENTS)):
        Simulator(newer_functions='unknown')


@pytest.mark.parametrize(
    ('arguments', 'complaint'),
    [
        (['--serial', '1', '--serial', '2'], '2 serial numbers for 1 drives'),
        (['--serial', '0123456789ABCDEFG'], 'at most 16 characters'),
        (['--newer-functions', 'no'], 'invalid choice'),
    ],
)
def test_options_of_the_command(capsys, arguments: list[str], complaint: str) -> None:
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err
