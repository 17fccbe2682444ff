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

"""A simulated Fable: enabled and run by one register, its direction in another than its size."""

from __future__ import annotations

from typing import Any

from nfo_sinus_driver.families.fable.words import Command
from nfo_sinus_driver.families.fable.words import Status
from nfo_sinus_driver.simulator.control_unit import ControlUnit
from nfo_sinus_driver.simulator.family import Option
from nfo_sinus_driver.simulator.family import SimulatedFamily
from nfo_sinus_driver.simulator.injections import Argument
from nfo_sinus_driver.simulator.injections import Verb
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused


class FableControlUnit(ControlUnit):
    """
    Takes the command register.

    :param most: the greatest set-point that it follows (Hz).
    """

    def __init__(self, memory: Memory, address: int, *, most: str = '60') -> None:
        super().__init__(memory, address)
        self._most = float(most)
        self._command = Command(0)

    def write(self, key: str, raw: int) -> bool:
        """Take a command; a fault is acknowledged by one of its bits."""
        if key != 'bus.command':
            return False
        command = Command(raw)
        if self.faults and not command & Command.ACKNOWLEDGE:
            raise Refused(Reason.STATE, 'a fault is active')
        self.faults.acknowledge()
        self._command = command
        return True

    def show(self, key: str) -> int | None:
        """Return the command and the status."""
        if key == 'bus.command':
            return int(self._command)
        if key == 'bus.code':
            return self.status_code
        if key != 'bus.status':
            return None
        enabled = Status.ENABLED if self._command & Command.ENABLE else Status(0)
        turns = Status.TURNS if self.motor.driven else Status(0)
        return int(enabled | turns | (Status.FAULT if self.faults else Status(0)))

    @property
    def status_code(self) -> int:
        """The fault, else whether the motor is driven."""
        return self.faults.shown or int(self.motor.driven)

    def settle(self) -> None:
        """Run the motor, or let it go."""
        run = Command.ENABLE | Command.RUN
        self.motor.accel = self.motor.retard = self.memory.number('ramps.time')
        if self._command & run == run and self.run_input and not self.faults:
            sign = -1 if self.memory.raw('bus.direction') else 1
            self.motor.energise()
            self.motor.demand = sign * min(self.memory.number('bus.frequency'), self._most)
        else:
            self.motor.release()

    @property
    def settled(self) -> bool:
        """Always: it has no clock of its own."""
        return True

    def restart(self) -> None:
        """Forget the command."""
        self._command = Command(0)

    def report(self) -> dict[str, Any]:
        """Return what it shows."""
        return {'code': self.status_code, 'command': int(self._command)}


FAMILY = SimulatedFamily(
    control_unit=FableControlUnit,
    factory={'ramps.time': 1.0},
    options=(Option('most', 'the greatest set-point that is followed', ('50', '60')),),
    verbs={
        'heat': Verb(
            'let it be too hot',
            lambda target, given: target.one.trip(7, cause_present=given['lasts']),
            (Argument('lasts', bool, 'it stays so', False),),
        )
    },
)
