# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A described drive obeys words that its file does not name, as masters in the field write them.

The words are those of LinuxCNC's vfdb_vfd, vfs11_vfd and mb2hal, of FluidNC, grblHAL, Buildbotics
and of the makers' own examples; what they mean is in the makers' tables of the bits.
"""

from __future__ import annotations

from pathlib import Path
import struct
from typing import Any

import pytest
from support.described import SHIPPED
from support.oddities import ODD, described

from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.simulator._declared.control_unit import DeclaredControlUnit
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.family import simulated_drive


class Master:
    """Writes words to a simulated drive whose line has control, and has a set-point."""

    def __init__(self, name: str, **options: str) -> None:
        model = str(SHIPPED[name])
        self.drive: SimulatedDrive = simulated_drive(model, **options)
        assert isinstance(self.drive.control_unit, DeclaredControlUnit)
        self.unit = self.drive.control_unit
        self.file = self.unit._drive
        for required in self.file.requires:
            self.drive.set_from_keypad(required.key, required.value)
        self.drive.write_raw(self.file.setpoint.key, 2000)
        self.server = self.drive.servers['modbus']

    def write(self, register: int, *words: int) -> None:
        for word in words:
            self.server.write(register, (word,))
            self.drive.advance(0.1)

    @property
    def turns(self) -> int:
        """Which way its run command turns the motor."""
        demand = self.drive.motor.demand if self.drive.motor.driven else 0.0
        return (demand > 0) - (demand < 0)

    def trip(self) -> None:
        """Let the first fault happen that it has."""
        codes = self.drive.model.status_codes.items()
        self.drive.trip(next(code for code, status in codes if status.kind is Kind.FAULT))
        self.drive.advance(0.1)

    @property
    def has_fault(self) -> bool:
        return bool(self.unit.faults)


@pytest.mark.parametrize(
    ('name', 'register', 'run', 'word', 'turns'),
    [
        # stop with a direction
        ('delta_ms300', 0x2000, (0x12,), 0x11, 0),
        ('delta_ms300', 0x2000, (0x12,), 0x21, 0),
        ('delta_vfd_el', 0x2000, (0x22,), 0x21, 0),
        # stop, with speed preset and in reverse
        ('toshiba_vf_s11', 0xFA00, (0xC400,), 0xC040, 0),
        ('toshiba_vf_s11', 0xFA00, (0xC400,), 0xC240, 0),
        ('toshiba_vf_s11', 0xFA00, (), 0xC440, 1),
        ('toshiba_vf_s11', 0xFA00, (), 0xC640, -1),
        # control words with one bit more
        ('siemens_v20', 99, (0x047E, 0x047F), 0x0C7E, 0),
        ('siemens_v20', 99, (0x047E, 0x047F), 0x0C7F, -1),
        ('danfoss_fc101', 2809, (), 0x0C7C, 1),
        ('danfoss_fc101', 2809, (), 0x8C7C, -1),
        ('danfoss_fc101', 2809, (0x047C,), 0x0C3C, 0),
        ('invertek_optidrive_e3', 0, (), 0x0003, 1),
        ('abb_acs355', 0, (0x0476, 0x0477), 0x0C7F, 1),
        ('yaskawa_v1000', 1, (), 0x0011, 1),
        # Buildbotics' reverse of a Teco is there a direction without a run; a PLC stops one of
        # Mitsubishi by 0
        ('teco_e510', 0x2501, (0x0001,), 0x0000, 0),
        ('teco_e510', 0x2501, (), 0x0003, -1),
        ('teco_e510', 0x2501, (), 0x0002, 0),
        ('teco_e510', 0x2501, (0x0001,), 0x0002, 0),
        ('mitsubishi_fr_d700', 8, (0x0002,), 0x0001, 0),
        ('mitsubishi_fr_d700', 8, (), 0x0004, -1),
        ('mitsubishi_fr_d700', 8, (0x0002,), 0x0000, 0),
        # the bit of a quick stop is no command of the file
        ('schneider_atv12', 8501, (0x0006, 0x0007, 0x000F), 0x000B, 0),
    ],
)
def test_only_bits_count_in_which_commands_differ(
    name: str, register: int, run: tuple[int, ...], word: int, turns: int
) -> None:
    master = Master(name)
    master.write(register, *run)
    if len(run) != 2:
        assert bool(master.turns) == bool(run)
    master.write(register, word)
    assert master.turns == turns


@pytest.mark.parametrize(
    ('name', 'register', 'words'),
    [
        ('abb_acs355', 0, (0x0476, 0x0477, 0x047F)),
        ('schneider_atv12', 8501, (0x0006, 0x0007, 0x000F)),
        ('siemens_v20', 99, (0x047E, 0x047F)),
        ('lenze_i500', 2100, (0x0060, 0x0061)),
    ],
)
def test_a_word_that_is_repeated_changes_nothing(
    name: str, register: int, words: tuple[int, ...]
) -> None:
    """mb2hal, and every PLC, writes cyclically."""
    master = Master(name)
    for word in words:
        assert not master.turns
        master.write(register, *[word] * 5)
    assert master.turns == 1
    # a sequence that is begun anew has to be whole
    master.write(register, words[0])
    assert not master.turns


@pytest.mark.parametrize(
    ('name', 'register', 'word'),
    [
        ('delta_ms300', 0x2002, 0x02),
        ('yaskawa_v1000', 1, 0x08),
        ('siemens_v20', 99, 0x04FE),
        ('siemens_v20', 99, 0x0CFE),
        ('invt_gd20', 0x2000, 7),
        ('teco_e510', 0x2501, 8),
        ('mitsubishi_fr_d700', 1, 1),
    ],
)
def test_a_reset_counts_from_its_first_word_and_once(name: str, register: int, word: int) -> None:
    master = Master(name)
    master.trip()
    assert master.has_fault
    master.write(register, word)
    assert not master.has_fault
    # held, it resets no other
    master.trip()
    master.write(register, word)
    assert master.has_fault


def test_a_word_that_is_a_number_is_one_command() -> None:
    """5, 6 and 7 differ from a run in the same bit: stop, coast and reset."""
    master = Master('invt_gd20')
    master.trip()
    for word in (5, 6):
        master.write(0x2000, word)
        assert master.has_fault
    master.write(0x2000, 7)
    assert not master.has_fault
    master.write(0x2000, 1)
    assert master.turns == 1
    master.write(0x2000, 5)
    assert not master.unit._coasts


def test_a_run_word_that_goes_on_is_a_new_one_after_a_fault_took_it() -> None:
    """The worse of two for a driver: the motor starts as the fault ends."""
    master = Master('delta_ms300', run_command_in_fault='drops')
    master.write(0x2000, 0x12, 0x12)
    master.trip()
    master.write(0x2002, 0x02)
    assert not master.turns
    master.write(0x2000, 0x12)
    assert master.turns == 1


@pytest.mark.parametrize(
    ('name', 'run', 'reset', 'stop'),
    [('pulses of coils', 73, 80, 75), ('two words to one register', 8, 1, 4)],
)
def test_a_command_by_itself_is_no_other_one(
    tmp_path: Path, name: str, run: int, reset: int, stop: int
) -> None:
    drive = simulated_drive(str(described(tmp_path, **ODD[name])), run_command_in_fault='keeps')
    server: Any = drive.servers['modbus']

    def write(word: int) -> None:
        if name == 'pulses of coils':
            server._carry_out(5, struct.pack('>HH', word, 0xFF00))
        else:
            server.write(10, (word,))
        drive.advance(0.1)

    write(run)
    assert drive.motor.driven
    # neither does it stop the motor, nor is the second one of two none
    for _ in range(2):
        drive.trip(1)
        drive.advance(0.1)
        assert not drive.motor.driven
        write(reset)
        assert not drive.control_unit.faults and drive.motor.driven
        if name != 'pulses of coils':
            write(0x80)
    write(stop)
    drive.advance(1.0)
    assert not drive.motor.driven
