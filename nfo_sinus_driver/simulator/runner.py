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

"""Runs the motor of one drive: who commands, what reference, and what the display says of it."""

from __future__ import annotations

from nfo_sinus_driver.catalog import Control
from nfo_sinus_driver.catalog import Scmd
from nfo_sinus_driver.catalog import Status
from nfo_sinus_driver.catalog.inv_st import START_DELAY
from nfo_sinus_driver.simulator.control_source import RELEASED
from nfo_sinus_driver.simulator.control_source import RUN_COMMANDS
from nfo_sinus_driver.simulator.control_source import RUNNING
from nfo_sinus_driver.simulator.control_source import STANDBY
from nfo_sinus_driver.simulator.control_source import TERMINAL_SHARE
from nfo_sinus_driver.simulator.control_source import Source
from nfo_sinus_driver.simulator.control_source import local_share
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.motor import Nameplate
from nfo_sinus_driver.simulator.motor import Regulation
from nfo_sinus_driver.simulator.state_machine import Conditions
from nfo_sinus_driver.simulator.state_machine import Phase
from nfo_sinus_driver.simulator.state_machine import StateMachine

#: The set-point register of each control mode, by the code of control.mode [M0 §8.3].
_SETPOINT_OF = {
    0: 'status.frq_set',
    1: 'status.reg_set',
    2: 'status.trq_set',
    3: 'status.spd_set',
}
SETPOINTS = frozenset(_SETPOINT_OF.values())
#: The regulated quantity of each control mode; PI-Reg regulates the process by the frequency.
_REGULATION_OF = {
    0: Regulation.FREQUENCY,
    1: Regulation.FREQUENCY,
    2: Regulation.TORQUE,
    3: Regulation.SPEED,
}
#: Accel and Retard (s) of a ramp generator that is reset (DriveControl bit 4).
_RESET_TIME = 0.2

#: InvSt by source: standing by, running, accelerating, retarding [M0 table 19].
_BUS_CODES = (37, 38, 39, 40)
_CODES = {
    Source.STOP: (24, 24, 24, 24),
    Source.EXT: (33, 34, 35, 36),
    Source.KEYPAD: (24, 30, 31, 32),
    Source.SCMD: _BUS_CODES,
    Source.CONTROL_WORD: _BUS_CODES,
}
_KEYPAD_STILL = 29
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


class Runner:
    """
    Turns commands into control words, and the state machine's state into orders to the motor.

    :ivar source: who commands.
    :ivar scmd: the run command that stands, or STOP. It stands through a lost RUN input and a
        fault, so the motor starts by itself when they are over.
    :ivar run_input: the digital input RUN.
    :ivar initialised: the self-test after power-on is over.
    """

    def __init__(self, memory: Memory, motor: Motor) -> None:
        self._memory = memory
        self._motor = motor
        self.machine = StateMachine()
        self.source = Source.STOP
        self.scmd = Scmd.STOP
        self.run_input = True
        self.initialised = False
        self.word = RELEASED
        #: Seconds of RunDly left; None while nobody wants to run.
        self._delay_left: float | None = None
        self._dc_brake_left = 0.0

    def restart(self) -> None:
        """Begin as after power-on: nobody commands. Set-points are in the memory and stay."""
        self.machine = StateMachine()
        self.initialised = False
        self.take(Source.STOP)

    def take(self, source: Source) -> None:
        """Hand control over; a run command that stood is forgotten."""
        self.source = source
        self.scmd = Scmd.STOP
        self.word = RELEASED
        self._delay_left = None

    def command(self, scmd: Scmd) -> None:
        """Take a run command or Stop from SCMD."""
        self.source = Source.SCMD
        self.scmd = scmd

    def control(self, word: Control) -> None:
        """Take a control word from DriveControl; without NetCtrl control goes to nobody."""
        if word & Control.NET_CTRL:
            self.source = Source.CONTROL_WORD
        elif self.source is Source.CONTROL_WORD:
            self.take(Source.STOP)
        self.scmd = Scmd.STOP
        self.word = word

    def wait(self, dt: float) -> None:
        """Let the start delay and the DC braking before the start run."""
        if self._delay_left is not None:
            self._delay_left = max(0.0, self._delay_left - dt)
        if self.machine.phase is Phase.OPERATION_ENABLED:
            self._dc_brake_left = max(0.0, self._dc_brake_left - dt)

    @property
    def waiting(self) -> bool:
        """Whether a start delay runs."""
        braking = self._dc_brake_left > 0 and self.machine.phase is Phase.OPERATION_ENABLED
        return bool(self._delay_left) or braking

    @property
    def settled(self) -> bool:
        """Whether the state machine stays where it is as long as nothing new comes."""
        return self.machine.phase not in (
            Phase.NOT_READY_TO_SWITCH_ON,
            Phase.DISABLE,
            Phase.SHUTDOWN,
            Phase.QUICK_STOP,
            Phase.FAULT_REACTION_ACTIVE,
        )

    def settle(self, *, fault: bool) -> None:
        """Carry out what stands: control word, state machine, power stage, demand."""
        self._keep_delay(fault)
        self.word = self._translated()
        effective = self.word
        if self.source is Source.CONTROL_WORD and (not self.run_input or self._delay_left):
            effective &= ~Control.SWITCH_ON
        motor, machine = self._motor, self.machine
        conditions = Conditions(
            initialised=self.initialised,
            fault=fault,
            brake=bool(self._memory.raw('control.st_mode')),
            at_zero=motor.at_zero,
            voltage=motor.voltage_on,
        )
        before = machine.phase
        machine.update(effective, conditions)
        started = machine.phase is Phase.OPERATION_ENABLED and not motor.driven
        if started and before not in (Phase.DISABLE, Phase.SHUTDOWN):
            self._dc_brake_left = self._memory.number('control.dc_brk')
        if machine.driven:
            motor.energise()
            self._demand()
        else:
            motor.release()

    @property
    def setpoint_key(self) -> str:
        """The key of the set-point that the control mode takes [M0 §8.3]."""
        return _SETPOINT_OF[self._memory.raw('control.mode')]

    @property
    def inv_st(self) -> int:
        """The inverter status while no fault stands [M0 table 19]."""
        standby, running, faster, slower = _CODES[self.source]
        motor = self._motor
        if self._delay_left:
            return START_DELAY
        if not motor.driven:
            return standby
        if motor.chopper:
            return _BRAKE_CHOPPER
        if motor.limited:
            return _CURRENT_LIMIT
        if self.machine.phase is not Phase.OPERATION_ENABLED or motor.trend < 0:
            return slower
        if motor.trend > 0:
            return faster
        still = self.source is Source.KEYPAD and motor.at_zero
        return _KEYPAD_STILL if still else running

    @property
    def status_word(self) -> Status:
        """DriveStatus [M0 table 15]."""
        status = self.machine.status()
        if self.source in (Source.SCMD, Source.CONTROL_WORD):
            status |= Status.CTRL_FROM_NET
            if self.word & Control.NET_REF:
                status |= Status.REF_FROM_NET
        if self.machine.phase is Phase.OPERATION_ENABLED and self._motor.trend == 0:
            status |= Status.SETPOINT_REACHED
        if self._motor.limited:
            status |= Status.LIMIT_ACTIVE
        return status

    def reference(self) -> float:
        """The reference that the source gives, signed: Hz, or the torque relative to nominal."""
        code = self._memory.raw('control.mode')
        frequency = self._motor.plate.frequency
        nominal = 1.0 if _REGULATION_OF[code] is Regulation.TORQUE else frequency
        if self.source is Source.SCMD and self.scmd is not Scmd.FIELDBUS:
            return nominal * local_share(self.scmd, self._fixed_shares())
        if not self.word & Control.NET_REF:
            return nominal * TERMINAL_SHARE
        setpoint = self._memory.number(self.setpoint_key)
        scale = {
            'status.frq_set': 1.0,
            'status.spd_set': self._motor.plate.pole_pairs / 60,
            'status.trq_set': 0.01,
            'status.reg_set': frequency / 100,
        }
        return setpoint * scale[self.setpoint_key]

    def _fixed_shares(self) -> dict[int, float]:
        """The fixed references of Freque, as shares of f-Nom; the other modes use the same."""
        frequency = self._motor.plate.frequency
        values = {n: self._memory.number(f'freque.f_fix{n}') for n in range(1, 8)}
        return {n: value / frequency for n, value in values.items() if value}

    def _keep_delay(self, fault: bool) -> None:
        """Start RunDly when a run is wanted, forget it when not."""
        if fault or not self._wanted():
            self._delay_left = None
        elif self._delay_left is None:
            self._delay_left = self._memory.number('control.run_dly')

    def _wanted(self) -> bool:
        if self.source is Source.KEYPAD:
            return True
        if not self.run_input:
            return False
        if self.source is Source.CONTROL_WORD:
            return bool(self.word & Control.SWITCH_ON)
        return self.source is Source.EXT or self.scmd in RUN_COMMANDS

    def _translated(self) -> Control:
        """The control word for the command that stands [M0 §7]."""
        if self.source is Source.CONTROL_WORD:
            return self.word
        if self.source is Source.STOP:
            return RELEASED
        net = Control(0)
        if self.source is Source.SCMD:
            net = Control.NET_CTRL
            if self.scmd is Scmd.FIELDBUS:
                net |= Control.NET_REF
        self.word = net
        if not self._wanted() or self._delay_left != 0:
            return STANDBY | net
        reference = self.reference()
        forward = reference > 0 or (reference == 0 and self.machine.direction > 0)
        return RUNNING | net | (Control.ENABLE_OP if forward else Control.ENABLE_REV_OP)

    def _demand(self) -> None:
        motor, memory = self._motor, self._memory
        motor.accel = max(memory.number('control.accel'), 0.01)
        motor.retard = max(memory.number('control.retard'), 0.01)
        regulation = _REGULATION_OF[memory.raw('control.mode')]
        braking = self.machine.phase is not Phase.OPERATION_ENABLED or self._dc_brake_left > 0
        if braking:
            # a stop goes down the ramp in every control mode
            motor.regulation = (
                Regulation.SPEED if regulation is Regulation.SPEED else Regulation.FREQUENCY
            )
            motor.demand = 0.0
            return
        motor.regulation = regulation
        reference = self.reference()
        if self.source is Source.CONTROL_WORD:
            reference *= self.machine.direction
            reference = self._through_rfg(reference)
        motor.demand = reference

    def _through_rfg(self, reference: float) -> float:
        """What the ramp generator's bits of DriveControl make of the reference [M0 table 14]."""
        if not self.word & Control.ENABLE_RFG:
            self._motor.accel = self._motor.retard = _RESET_TIME
            return 0.0
        if not self.word & Control.UNLOCK_RFG:
            return self._motor.ramp
        return reference if self.word & Control.USE_REF_FOR_RFG else 0.0
