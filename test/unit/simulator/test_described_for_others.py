# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a file says for other masters of its simulated drive: registers, a bit, the loopback."""

from __future__ import annotations

from pathlib import Path
import struct

import pytest
from support.described import SHIPPED

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog.declared import Copied, DescriptionError, Shown, read
from nfo_sinus_driver.simulator._declared.server import Server
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.memory import Refused

FILES = [name for name, path in SHIPPED.items() if read(path).simulated.registers]
#: Where commands go, and what leads to a run, in reverse where a word says that.
TO_RUN = {
    'toshiba_vf_s11': (0xFA00, 0xC600),
    'delta_ms300': (0x2000, 0x22),
    'delta_vfd_el': (0x2000, 0x22),
    'siemens_v20': (99, 0x047E, 0x0C7F),
    'abb_acs355': (0, 0x0476, 0x0477, 0x047F),
    'yaskawa_v1000': (1, 2),
    'automationdirect_gs2': (0x091B, 1),
    'huanyang_gt': (0x1000, 2),
    'soyan_svd_ps': (0x2000, 2),
    'invt_gd20': (0x2000, 2),
}
#: Those that run by a coil, and which.
RUN_COILS = {'hitachi_wj200': 0}
#: What a word of them may be wrong by, of two counts of different sizes.
_COUNTS = 2


def running(name: str) -> tuple[SimulatedDrive, Server]:
    """Return a drive whose motor runs."""
    drive = simulated_drive(str(SHIPPED[name]))
    server = drive.servers['modbus']
    assert isinstance(server, Server)
    for required in read(SHIPPED[name]).requires:
        drive.set_from_keypad(required.key, required.value)
    drive.write_raw(read(SHIPPED[name]).setpoint.key, 2000)
    if name in RUN_COILS:
        server.answer(struct.pack('>BHH', 5, RUN_COILS[name], 0xFF00))
    register, *words = TO_RUN.get(name, (0,))
    for word in words:
        server.write(register, (word,))
        drive.advance(0.2)
    drive.advance(30.0)
    assert abs(drive.motor.frequency) > 1.0
    return drive, server


@pytest.mark.parametrize('name', FILES)
def test_each_register_has_what_the_file_says_and_is_read_alone(name: str) -> None:
    drive, server = running(name)
    file, unit = read(SHIPPED[name]), server._unit
    quantities = {
        Role.ACTUAL_FREQUENCY: drive.motor.frequency,
        Role.ACTUAL_SPEED: drive.motor.speed,
        Role.ACTUAL_TORQUE: 100 * drive.motor.torque,
        Role.OUTPUT_CURRENT: drive.motor.current,
        Role.OUTPUT_VOLTAGE: drive.motor.voltage,
        Role.OUTPUT_POWER: drive.motor.power,
    }
    key = file.setpoint.key
    setpoint = float(drive.memory.get(key)) * unit.scale(key)
    addresses = [parameter.at('modbus') for parameter in file.parameters.values()]
    known = {address.index for address in addresses if address.space != 'coil'}
    for register, found in file.simulated.registers.items():
        assert register not in known, 'the driver knows nothing of it'
        (word,) = server.read(register, 1)
        if isinstance(found, Copied):
            (whole,) = server.read(found.register, 1)
            assert word == whole >> found.shift & found.mask
        elif isinstance(found, Shown):
            value = setpoint if found.quantity is None else quantities[found.quantity]
            scale = found.parameter.scale
            factor = float(found.parameter.at('modbus').factor)
            factor *= float(drive.memory.get(scale)) if scale else 1.0
            signed = found.parameter.at('modbus').number.signed
            number = (word ^ 0x8000) - 0x8000 if signed else word
            expected = value if signed else abs(value)
            assert abs(number - expected / factor) < _COUNTS, hex(register)
        else:
            assert word == found
        with pytest.raises(Refused):
            server.write(register, (0,))


@pytest.mark.parametrize('name', SHIPPED)
def test_the_loopback_is_answered_where_the_file_has_it(name: str) -> None:
    server = simulated_drive(str(SHIPPED[name])).servers['modbus']
    request = bytes.fromhex('08 0000 A537')
    looped = server.answer(request)
    if read(SHIPPED[name]).simulated.loopback:
        assert looped == request
        assert server.answer(bytes.fromhex('08 0001 0000'))[0] == 0x88
    else:
        assert looped == bytes((0x88, 1))


@pytest.mark.parametrize(('word', 'turned'), [(0x0C7F, 1), (0x047F, 0)])
def test_a_bit_turns_the_direction_of_a_v20_round(word: int, turned: int) -> None:
    drive = simulated_drive(str(SHIPPED['siemens_v20']))
    server = drive.servers['modbus']
    server.write(100, (0x2000,))
    for each in (0x047E, word):
        server.write(99, (each,))
        drive.advance(0.2)
    drive.advance(30.0)
    assert round(drive.motor.frequency) == (-25 if turned else 25)
    assert server.read(4, 1) == (turned,)


@pytest.mark.parametrize(('entry', 'said'), [
    ('{register: 0x2222}', 'says one of shows, copies, value'),
    ('{register: 0x2222, value: 1, copies: 0x2000}', 'says one of shows, copies, value'),
    ('{register: 0x2222, copies: 0x2222}', 'copies a register that is a copy, too'),
    ('{register: 0x2001, value: 1}', 'stand in the same register'),
    ('{register: 0x2222, shows: noise}', 'choose one of setpoint, actual_frequency'),
    ('{register: 0x2222, shows: setpoint, scaled_by: no.such}', 'no.such is none of'),
])  # fmt: skip
def test_what_is_wrong_is_named(tmp_path: Path, entry: str, said: str) -> None:
    text = SHIPPED['delta_vfd_el'].read_text()
    path = tmp_path / 'mine.vfd.yaml'
    path.write_text(text.replace('    - {register: 0x211B, copies: 0x0100}', f'    - {entry}'))
    with pytest.raises(DescriptionError) as error:
        read(path)
    assert said in str(error.value)
