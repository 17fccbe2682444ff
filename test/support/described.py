# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Drives that files describe: those that are shipped, and the driver of one in virtual time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nfo_sinus_driver import families
from nfo_sinus_driver.catalog.declared import SUFFIX, read
from support.rig import Connection, Rig

#: The files that are shipped, by name.
SHIPPED = {
    path.name.removesuffix(SUFFIX): path
    for path in sorted(Path(families.__path__[0]).rglob(f'*{SUFFIX}'))
}


class DescribedRig(Rig):
    """
    A drive that a file describes, simulated from that file, and its driver.

    Frequencies are those of the motor, Hz; the set-points are in the unit of the drive.
    """

    def __init__(self, path: Path, protocol: str = 'modbus_rtu', **more: Any) -> None:
        self.file = read(path)
        super().__init__(Connection(protocol, str(path), 'custom'), **more)

    def unit(self, frequency: float) -> float:
        """Return the set-point for a frequency."""
        if self.file.setpoint.mode == 'Freque':
            return frequency
        return frequency * 60 / self.far.motor.plate.pole_pairs

    def follow(self, frequency: float) -> None:
        """Have the motor follow a frequency."""
        self.send(self.unit(frequency))
        near = 0.03 * abs(frequency)
        self.wait_until(lambda: abs(self.far.motor.frequency - frequency) < near, 10.0)
        self.pass_time(0.5)
        if 'actual_frequency' in {role.value for role in self.file.roles}:
            assert abs(self.drive.snapshot.frequency - frequency) < near + 0.1

    def lose_the_line(self) -> None:
        """Let the line be silent, until the drive is lost, and come back."""
        self.line.state = 'silent'
        self.pass_time(4.0)
        assert not self.drive.state.contact.connected
        self.line.mend()
        self.wait_until(lambda: self.drive.state.contact.connected, 20.0)
        self.pass_time(2.0)
        assert not self.turns
