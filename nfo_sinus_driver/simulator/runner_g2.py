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
How a G2 is commanded and what it shows of it [M0 §7].

Commands become control words, and the state of the generic state machine orders to the motor.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from nfo_sinus_driver.families.sinus_g2.words import Control
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.families.sinus_g2.words import Status
from nfo_sinus_driver.simulator.control_source import RELEASED
from nfo_sinus_driver.simulator.control_source import RUN_COMMANDS
from nfo_sinus_driver.simulator.control_source import RUNNING
from nfo_sinus_driver.simulator.control_source import STANDBY
from nfo_sinus_driver.simulator.control_source import TERMINAL_SHARE
from nfo_sinus_driver.simulator.control_source import Source
from nfo_sinus_driver.simulator.control_source import local_share
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.measured import Counters
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.motor import Motor
from nfo_sinus_driver.simulator.motor import Regulation
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused
from nfo_sinus_driver.simulator.runner import Runner
from nfo_sinus_driver.simulator.runner import nameplate
from nfo_sinus_driver.simulator.state_machine import Conditions
from nfo_sinus_driver.simulator.state_machine import Phase
from nfo_sinus_driver.simulator.state_machine import StateMachine
from nfo_sinus_driver.simulator.tuning import FAILURES
from nfo_sinus_driver.simulator.tuning import PROCEDURES
from nfo_sinus_driver.simulator.tuning import Tuning
from nfo_sinus_driver.simulator.variant import REFUSED
from nfo_sinus_driver.simulator.variant import Variant

#: The regulated quantity of each control mode; PI-Reg regulates the process by the frequency.
_REGULATION_OF = {
    0: Regulation.FREQUENCY,
    1: Regulation.FREQUENCY,
    2: Regulation.TORQUE,
    3: Regulation.SPEED,
}
#: Accel and Retard (s) of a ramp generator that is reset (DriveControl bit 4).
_RESET_TIME = 0.2
#: InvSt of a motor that the keypad runs, and of one that it runs at standstill.
_KEYPAD_RUNNING, _KEYPAD_STILL = 30, 29
#: What each code of MODE hands control to; the others cannot be written [M0 table 17].
_SOURCES: Mapping[int, Source] = {
    Mode.STOP: Source.STOP,
    Mode.EXT: Source.EXT,
    Mode.BUS: Source.SCMD,
}


#: The inverter status while it tunes [M0 table 19].
_TUNING = 28
#: What DriveStatus adds while it tunes: the motor has current, and nobody says what that shows as.
_TUNING_STATUS = (
    Status.READY_TO_SWITCH_ON
    | Status.SWITCHED_ON
    | Status.OP_ENABLED
    | Status.VOLTAGE_ENABLED
    | Status.QUICK_STOP_DISABLED
    | Status.CTRL_FROM_NET
)


class G2Runner(Runner):
    """
    Runs the motor of a G2, and tunes it.

    :ivar tuning: the procedure that is going on.
    """

    # [M0 §8.3]
    setpoint_of: ClassVar[Mapping[int, str]] = {
        0: 'status.frq_set',
        1: 'status.reg_set',
        2: 'status.trq_set',
        3: 'status.spd_set',
    }
    delayed = 25
    usual = Variant()
    run_command = 'fieldbus.scmd'

    def __init__(self, memory: Memory, motor: Motor, faults: Faults, counters: Counters) -> None:
        super().__init__(memory, motor, faults, counters)
        self.machine = StateMachine()
        self.scmd = Scmd.STOP
        self.word = RELEASED
        self._dc_brake_left = 0.0
        self.tuning: Tuning | None = None
        #: What InvSt says of the tuning that was finished, until the next command.
        self._tuned = 0
        self._next_failure = 0

    def restart(self) -> None:
        """Begin as after power-on."""
        self.machine = StateMachine()
        super().restart()

    def take(self, source: Source) -> None:
        """Hand control over; a run command that stood is forgotten."""
        self.source = source
        self.scmd = Scmd.STOP
        self.word = RELEASED
        self._delay_left = None
        self.tuning = None
        self._tuned = 0

    def fail_tuning(self, code: int) -> None:
        """
        Let the next tuning end with a fault.

        :raises ValueError: none that a tuning ends with.
        """
        if code not in FAILURES:
            raise ValueError(f'a tuning fails with {sorted(FAILURES)}, not with {code}')
        self._next_failure = code

    def write(self, key: str, raw: int) -> bool:
        """Carry out MODE, SCMD, DriveControl or its mask."""
        if key == 'fieldbus.mode':
            self._write_mode(raw)
        elif key == 'fieldbus.scmd':
            self._write_scmd(raw)
        elif key == 'fieldbus.drive_control':
            self._write_control(Control(raw))
        elif key == 'fieldbus.drv_ctrl_write_mask':
            keep, add = Control(raw & 0xFFFF), Control(raw >> 16)
            self._write_control(self.word & keep | add)
        else:
            return False
        return True

    def show(self, key: str) -> int | None:
        """Return the raw number of MODE, DriveControl or a status word."""
        if key == 'fieldbus.mode':
            return self.mode
        if key == 'fieldbus.drive_control':
            return int(self.word)
        if key in ('fieldbus.drive_status', 'fieldbus.profidrive_status'):
            return int(self.status_word)
        return None

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

    def _write_mode(self, raw: int) -> None:
        source = _SOURCES.get(raw)
        if source is None:
            raise Refused(Reason.VALUE, f'MODE = {raw} cannot be written')
        self._refuse_when_tuning()
        if raw == Mode.STOP and self._faults.serial:
            self._faults.acknowledge_serial()
        else:
            self.refuse_when_faulted('fieldbus.mode')
        self.take(source)

    def _write_scmd(self, raw: int) -> None:
        if raw not in set(Scmd):
            raise Refused(Reason.VALUE, f'SCMD has no code {raw:#x}')
        self.refuse_when_faulted('fieldbus.scmd')
        if self.source.mode is not Mode.BUS:
            raise Refused(Reason.STATE, 'SCMD needs MODE = Bus')
        if raw != Scmd.STOP or self.variant.stop_in_tuning == REFUSED:
            self._refuse_when_tuning()
        self.tuning, self._tuned = None, 0
        if raw in PROCEDURES:
            self._tune(raw)
        elif raw == Scmd.ERASE_E_LOG:
            self._faults.log.clear()
        elif raw == Scmd.RESET_E_OUT:
            self._counters.e_out = 0.0
        elif raw in RUN_COMMANDS or raw == Scmd.STOP:
            self.command(Scmd(raw))

    def _tune(self, raw: int) -> None:
        if self._motor.driven or self._motor.turning:
            raise Refused(Reason.STATE, 'tuning needs a motor that stands')
        self.command(Scmd.STOP)
        # as a run command without RUN or in a fault, it leads to nothing
        if not self._faults and (self.run_input or not PROCEDURES[raw].measures):
            self.tuning = Tuning.begun(raw)

    def _drop_run_command(self) -> None:
        self.scmd = Scmd.STOP
        if self.source is Source.KEYPAD:
            self.take(Source.STOP)

    def _refuse_when_tuning(self) -> None:
        if self.tuning is not None:
            raise Refused(Reason.STATE, 'tuning: MODE is Inhibit')

    def _go_on_tuning(self, dt: float) -> None:
        tuning = self.tuning
        if tuning is None:
            return
        if self._faults or (tuning.procedure.measures and not self.run_input):
            self.tuning = None
            return
        tuning.left -= dt
        if tuning.left > 1e-9:
            return
        self.tuning = None
        if self._next_failure:
            code, self._next_failure = self._next_failure, 0
            self._faults.trip(code, self._counters.op_time, cause_present=False)
            return
        self._tuned = tuning.procedure.done
        tuning.store(self._memory)
        self._motor.plate = nameplate(self._memory)

    def _write_control(self, word: Control) -> None:
        self._refuse_when_tuning()
        # acknowledging goes this way, so a fault does not refuse it [M0 table 16, FAULTED]
        if self.machine.asks_reset(word):
            self._faults.acknowledge()
        self.control(word)

    def wait(self, dt: float) -> None:
        """Let the start delay and the DC braking before the start run."""
        super().wait(dt)
        self._go_on_tuning(dt)
        if self.machine.phase is Phase.OPERATION_ENABLED:
            self._dc_brake_left = max(0.0, self._dc_brake_left - dt)

    @property
    def waiting(self) -> bool:
        """Whether a start delay, DC braking or a tuning runs."""
        braking = self._dc_brake_left > 0 and self.machine.phase is Phase.OPERATION_ENABLED
        return braking or self.tuning is not None or super().waiting

    @property
    def mode(self) -> int:
        """What MODE reads."""
        return super().mode if self.tuning is None else Mode.INHIBIT

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

    def settle(self) -> None:
        """Carry out what stands: control word, state machine, power stage, demand."""
        self._keep_delay()
        self.word = self._translated()
        effective = self.word
        if self.source is Source.CONTROL_WORD and (not self.run_input or self._delay_left):
            effective &= ~Control.SWITCH_ON
        motor, machine = self._motor, self.machine
        conditions = Conditions(
            initialised=self.initialised,
            fault=bool(self._faults),
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
    def control_word(self) -> Control:
        """DriveControl, or what MODE and SCMD are translated to."""
        return self.word

    @property
    def stopping(self) -> bool:
        """Whether the state machine wants no run any more."""
        return self.machine.phase is not Phase.OPERATION_ENABLED

    @property
    def inv_st(self) -> int:
        """The inverter status while no fault stands [M0 table 19]."""
        if self.tuning is not None:
            return _TUNING
        if self._tuned:
            return self._tuned
        code = super().inv_st
        still = code == _KEYPAD_RUNNING and self._motor.at_zero
        return _KEYPAD_STILL if still else code

    @property
    def state(self) -> str:
        """The state of the generic state machine."""
        return self.machine.phase.value

    @property
    def status_word(self) -> Status:
        """DriveStatus [M0 table 15]."""
        if self.tuning is not None:
            return _TUNING_STATUS
        status = self.machine.status()
        if self.source in (Source.SCMD, Source.CONTROL_WORD):
            status |= Status.CTRL_FROM_NET
            if self.word & Control.NET_REF:
                status |= Status.REF_FROM_NET
        if self.machine.phase is Phase.OPERATION_ENABLED and self._motor.reached:
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
        motor = self._motor
        self._ramps()
        regulation = _REGULATION_OF[self._memory.raw('control.mode')]
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
