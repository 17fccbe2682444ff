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
Runs the motor of one drive: who commands, what reference, and what the display says of it.

Here stands what all drive families do alike; what each does its own way is behind :class:`Runner`,
in ``runner_g2.py`` and ``runner_optimal.py``.
"""

from __future__ import annotations

import abc
from collections.abc import Mapping
from typing import ClassVar

from nfo_sinus_driver.simulator.control_source import Source
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.measured import Counters
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.motor import Nameplate
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused
from nfo_sinus_driver.simulator.variant import ALL
from nfo_sinus_driver.simulator.variant import DROPS
from nfo_sinus_driver.simulator.variant import SCMD
from nfo_sinus_driver.simulator.variant import Variant

#: InvSt by source: standing by, running, accelerating, retarding ([M0 table 19], [M1]).
_BUS_CODES = (37, 38, 39, 40)
_FIELDBUS_CODES = (41, 42, 43, 44)
_CODES = {
    Source.STOP: (24, 24, 24, 24),
    Source.EXT: (33, 34, 35, 36),
    Source.KEYPAD: (24, 30, 31, 32),
    Source.SCMD: _BUS_CODES,
    Source.CONTROL_WORD: _BUS_CODES,
}
_BRAKE_CHOPPER = 26
_CURRENT_LIMIT = 27


def nameplate(memory: Memory) -> Nameplate:
    """Return the motor's data as the parameters say."""
    return Nameplate(
        power=1000 * memory.number('motor.p_nom'),
        voltage=memory.number('motor.u_nom'),
        frequency=memory.number('motor.f_nom'),
        speed=memory.number('motor.n_nom'),
        current=memory.number('motor.i_nom'),
        magnetising=memory.number('motor.i_magn'),
        limit=memory.number('motor.i_limt'),
        resistance=memory.number('motor.r_stat'),
    )


class Runner(abc.ABC):
    """
    Takes the commands of one drive family and turns them into orders to the motor.

    :ivar source: who commands.
    :ivar scmd: the run command that stands, or Stop. It stands through a lost RUN input, so the
        motor starts by itself when that is over; through a fault as ``variant`` says.
    :ivar run_input: the digital input RUN.
    :ivar by_fieldbus: the bus that commands is a fieldbus, to the older firmware [C3].
    :ivar initialised: the self-test after power-on is over.
    :ivar variant: what it does where the manuals leave it open; set it at any time.
    """

    #: The set-point register of each control mode, by the code of control.mode.
    setpoint_of: ClassVar[Mapping[int, str]]
    #: InvSt while the start is delayed.
    delayed: ClassVar[int]
    #: What drives of this family do unless told otherwise.
    usual: ClassVar[Variant]
    #: The run command of this family.
    run_command: ClassVar[str]

    scmd: int

    def __init__(self, memory: Memory, motor: Motor, faults: Faults, counters: Counters) -> None:
        self._memory = memory
        self._motor = motor
        self._faults = faults
        self._counters = counters
        self.variant = self.usual
        self.source = Source.STOP
        self.run_input = True
        self.initialised = False
        self.by_fieldbus = False
        #: Seconds of RunDly left; None while nobody wants to run.
        self._delay_left: float | None = None

    def restart(self) -> None:
        """Begin as after power-on: nobody commands. Set-points are in the memory and stay."""
        self.initialised = False
        self.take(Source.STOP)

    @abc.abstractmethod
    def take(self, source: Source) -> None:
        """Hand control over; a run command that stood is forgotten."""

    @abc.abstractmethod
    def write(self, key: str, raw: int) -> bool:
        """
        Carry out a write of a command; ``False`` if ``key`` is none of this family.

        :raises Refused: VALUE or STATE.
        """

    @abc.abstractmethod
    def show(self, key: str) -> int | None:
        """Return the raw number of what is neither stored nor measured; else ``None``."""

    @abc.abstractmethod
    def settle(self) -> None:
        """Carry out what stands: commands, state, power stage, demand."""

    @property
    @abc.abstractmethod
    def settled(self) -> bool:
        """Whether all stays as it is as long as nothing new comes and the motor is settled."""

    @property
    @abc.abstractmethod
    def stopping(self) -> bool:
        """Whether the motor is on its way to a stop."""

    @property
    def mode(self) -> int:
        """What MODE reads."""
        return self.source.mode

    @property
    @abc.abstractmethod
    def control_word(self) -> int:
        """The control word, as it is read."""

    @property
    @abc.abstractmethod
    def status_word(self) -> int:
        """The status word."""

    @property
    @abc.abstractmethod
    def state(self) -> str:
        """The state that the drive is in, by its name."""

    @property
    def setpoint_key(self) -> str:
        """The key of the set-point that the control mode takes."""
        return self.setpoint_of[self._memory.raw('control.mode')]

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        if self._delay_left is not None:
            self._delay_left = max(0.0, self._delay_left - dt)

    @property
    def waiting(self) -> bool:
        """Whether something happens by the clock alone, such as the end of a start delay."""
        return bool(self._delay_left)

    @property
    def inv_st(self) -> int:
        """The inverter status while no fault stands ([M0 table 19], [M1])."""
        codes = _CODES[self.source]
        standby, running, faster, slower = (
            _FIELDBUS_CODES if self.by_fieldbus and codes is _BUS_CODES else codes
        )
        motor = self._motor
        if self._delay_left:
            return self.delayed
        if not motor.driven:
            return standby
        if motor.chopper:
            return _BRAKE_CHOPPER
        if motor.limited:
            return _CURRENT_LIMIT
        if self.stopping or motor.trend < 0:
            return slower
        return faster if motor.trend > 0 else running

    def refuse_when_faulted(self, key: str) -> None:
        """
        Refuse the write of a parameter that the drive does not take while a fault is active.

        :raises Refused: STATE.
        """
        refused = self.variant.refuses_in_fault
        if self._faults and (refused == ALL or (refused == SCMD and key == self.run_command)):
            raise Refused(Reason.STATE, f'fault {self._faults.shown} is active')

    def acknowledged(self) -> None:
        """Take note that an acknowledgement ended the last fault."""
        if self.variant.run_command_in_fault == DROPS:
            self._drop_run_command()

    @abc.abstractmethod
    def _drop_run_command(self) -> None:
        """Forget the run command, whoever gave it; the terminals give theirs all the time."""

    @abc.abstractmethod
    def _wanted(self) -> bool:
        """Whether somebody wants the motor to run, and RUN allows it."""

    def _keep_delay(self) -> None:
        """Start RunDly when a run is wanted, forget it when not."""
        if self._faults or not self._wanted():
            self._delay_left = None
        elif self._delay_left is None:
            self._delay_left = self._memory.number('control.run_dly')

    def _ramps(self) -> None:
        self._motor.accel = max(self._memory.number('control.accel'), 0.01)
        self._motor.retard = max(self._memory.number('control.retard'), 0.01)
