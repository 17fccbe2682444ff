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

"""Where the set-point of a control mode goes, on each model and over each protocol."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.link import Address

#: What takes the set-point, by control mode.
_ROLES: Mapping[str, Role] = {
    'Freque': Role.FREQUENCY_SETPOINT,
    'Speed': Role.SPEED_SETPOINT,
    'Torque': Role.TORQUE_SETPOINT,
    'PI-Reg': Role.PROCESS_SETPOINT,
}
#: The greatest set-point over a bus in either direction [M2 table 2].
_MOST = {'Freque': 150.0, 'Speed': 9000.0, 'Torque': 200.0, 'PI-Reg': 150.0}


def references(registers: Registers, control_modes: Iterable[str]) -> list[Reference]:
    """Return the places of the set-points of some control modes; one that has none is left out."""
    return [Reference(registers, mode) for mode in control_modes if _key(registers, mode)]


def _key(registers: Registers, control_mode: str) -> str:
    role = _ROLES.get(control_mode)
    return '' if role is None else registers.model.key(role)


class Reference:
    """
    The place of the set-point in one control mode.

    :ivar most: the greatest value in either direction, in the unit of the control mode.
    :ivar address: where it is written.
    :raises DriveError: the drive takes no set-point in this control mode.
    """

    def __init__(self, registers: Registers, control_mode: str) -> None:
        self._registers = registers
        self._key = _key(registers, control_mode)
        if not self._key:
            raise DriveError(
                f'the drive takes no set-point over the bus in control mode {control_mode or "?"}'
            )
        self.most = _MOST[control_mode]
        # over Classic all are written there, in the unit of the control mode ([C11], [C12])
        common = registers.model.key(Role.COMMON_SETPOINT)
        written = common if registers.reaches(common) else self._key
        self.address: Address = registers.address(written)

    def encode(self, value: float) -> bytes:
        """
        Return the bytes of the drive's step nearest to a set-point.

        :raises ValueError: out of range or not finite.
        """
        return self._registers.encode_nearest(self._key, value)

    def value(self, data: bytes) -> float:
        """Return the set-point that bytes mean to the drive, after its own rounding."""
        return self._registers.number(self._key, data)

    async def read(self, priority: Priority) -> bytes:
        """
        Read back what stands there; a request that nobody answers is not repeated.

        :raises LinkError: the drive does not answer, or refuses.
        """
        return await self._registers.read_data(self._key, priority, once=True)

    async def write_zero(self, priority: Priority, *, once: bool = True) -> None:
        """
        Write set-point 0.

        :param once: do not repeat the request when nobody answers.
        :raises LinkError: the drive does not answer, or refuses.
        """
        await self._registers.write_at(self.address, self.encode(0.0), priority, once=once)

    async def set_to_zero(self, priority: Priority) -> None:
        """
        Write set-point 0, and read it back.

        :raises DriveError: the drive keeps another value.
        :raises LinkError: the drive does not answer, or refuses.
        """
        await self.write_zero(priority, once=False)
        kept = await self._registers.read_number(self._key, priority)
        if kept != 0:
            raise DriveError(f'the drive keeps a set-point of {kept:g} where 0 was written')
