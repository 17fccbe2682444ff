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
The shape of a control method, and which there are.

A control method knows what to write, and nothing of when; `motion` decides that.
"""

from __future__ import annotations

from collections.abc import Awaitable
from collections.abc import Callable
import enum
from typing import Protocol

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.drive.snapshot import InverterStatus

#: Waits until the drive's status fulfils a condition; raises DriveError if it does not.
Reached = Callable[[Callable[[InverterStatus], bool]], Awaitable[None]]


class Removal(enum.Enum):
    """What a drive with a fault has let go of, so that it does not turn the motor afterwards."""

    #: It has refused everything: a run command may stand, and a set-point.
    NOTHING = enum.auto()
    #: The set-point is 0; a run command may stand.
    SETPOINT = enum.auto()
    #: No run command stands.
    COMMAND = enum.auto()


class ControlMethod(Protocol):
    """What to write so that a drive does something; coroutines for the bus."""

    name: str
    #: It can release the motor at once.
    coasts: bool

    async def in_control(self, priority: Priority) -> bool:
        """Tell whether the bus has control of the drive, from us or from whom was here before."""

    async def take_control(self, reached: Reached) -> None:
        """
        Put the drive under bus control with no run command standing.

        :param reached: for a drive that refuses what comes before its status says who has control.
        :raises DriveError: it lets nobody.
        """

    async def zero_setpoint(self, control_mode: str, priority: Priority) -> None:
        """
        Write set-point 0 in the unit of a control mode, and read it back.

        :raises DriveError: the drive keeps another value.
        """

    async def run(self, reached: Reached) -> None:
        """
        Give the run command; once, for nobody knows what has happened before a second one.

        :param reached: for what takes several steps, each confirmed by the drive's status.
        :raises DriveError: a step is not confirmed.
        """

    async def stop(self, control_mode: str) -> None:
        """
        Take the run command back and write set-point 0, at the head of the bus.

        Does nothing to a drive that is not under bus control.

        :raises LinkError: the drive does not answer, or refuses although the bus has control.
        """

    async def quick_stop(self, control_mode: str) -> None:
        """Release the motor at once, if the drive has a way; control may be given back by it."""

    async def release(self) -> None:
        """Give control back; never by a MODE that can start the motor [C43], [C51]."""

    async def remove(self, control_mode: str) -> Removal:
        """
        Remove run command and set-point while a fault is active, each by itself [C98].

        A drive may refuse any of it then, and may go on by what is left once the fault is over.

        :raises LinkError: the drive does not answer, so that nobody knows.
        """

    async def acknowledge(self, code: int, control_mode: str) -> str:
        """
        Acknowledge a fault, run command and set-point first where the bus has control.

        From a drive that refuses to let go of them the stop is the very next frame [C98].

        :param code: the inverter status code that is shown.
        :returns: what more the drive said of it; ``''`` if nothing.
        :raises DriveError: it cannot be, without taking control from keypad or terminals.
        :raises LinkError: the drive does not answer; what it did is not known.
        """
