# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a G2 is commanded and what it shows of it [M0 §7].

Commands become control words, and the state of the generic state machine orders to the motor.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import ClassVar

from nfo_sinus_driver.catalog import Parameter, Value
from nfo_sinus_driver.families.sinus_g2.words import ControlWord, Mode, Scmd, Status
from nfo_sinus_driver.simulator.memory import Memory, Reason, Refused, home
from nfo_sinus_driver.simulator.motor import Regulation, nearest
from nfo_sinus_driver.simulator.sinus import control_unit
from nfo_sinus_driver.simulator.sinus.control_unit import TERMINAL_SHARE, SinusControlUnit, Source
from nfo_sinus_driver.simulator.sinus.serial_side import SinusFaults
from nfo_sinus_driver.simulator.sinus_g2 import ds402
from nfo_sinus_driver.simulator.sinus_g2.firmware import G2Variant, firmware_of
from nfo_sinus_driver.simulator.sinus_g2.state_machine import (
    FAILURES,
    PROCEDURES,
    RELEASED,
    RUN_COMMANDS,
    RUNNING,
    STANDBY,
    Conditions,
    Phase,
    SelfRestart,
    StateMachine,
    Tuning,
    local_share,
)

#: What leaves the factory beside what all have.
FACTORY: Mapping[str, Value] = {
    **control_unit.FACTORY,
    'motor.cos_phi': 0.82,
    'motor.r_rot': 3.4,
    'motor.l_main': 0.36,
    'motor.sigma': 0.08,
    'control.ain_set': '0-10V',
    'control.kp_spd': 2.0,
    'control.ti_spd': 0.2,
    'pi_reg.reg_amp': 1,
    'pi_reg.setmin': -150.0,
    'pi_reg.setmax': 150.0,
    'freque.op_mode': 'Terminal',
    'freque.f_fix1': 10,
    'freque.f_fix2': 15,
    'freque.f_fix3': 20,
    'freque.f_fix4': 25,
    'freque.f_fix5': 30,
    'freque.f_fix6': 40,
    'freque.f_fix7': 50,
    'freque.fr_max': 50,
    'fieldbus.sw_ver': 4.38,
    'fieldbus.nfo_ver': 4018,
    'fieldbus.spd_scl_numerator': 1,
    'fieldbus.spd_scl_denominator': 1,
    'fieldbus.vl_velocity_max_amount': 9000,
    'fieldbus.vl_dimension_factor_numerator': 1,
    'fieldbus.vl_dimension_factor_denominator': 1,
    'fieldbus.disable_operation_code': 'Brake',
}
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
#: What hands control to the bus.
_COMMANDS = frozenset({'fieldbus.mode', 'fieldbus.drive_control'})
#: The states that the state machine leaves by itself.
_PASSING = frozenset(
    {
        Phase.NOT_READY_TO_SWITCH_ON,
        Phase.DISABLE,
        Phase.SHUTDOWN,
        Phase.QUICK_STOP,
        Phase.FAULT_REACTION_ACTIVE,
    }
)
#: The inverter status while it tunes [M0 table 19].
_TUNING = 28
#: What DriveStatus adds while it tunes: the motor has current; no manual says what that shows.
_TUNING_STATUS = (
    Status.READY_TO_SWITCH_ON
    | Status.SWITCHED_ON
    | Status.OP_ENABLED
    | Status.VOLTAGE_ENABLED
    | Status.QUICK_STOP_DISABLED
    | Status.CTRL_FROM_NET
)


class G2ControlUnit(SinusControlUnit):
    """
    Runs the motor of a G2, and tunes it.

    :raises ValueError: SWVer was given and is of another firmware than the variant's.

    :ivar firmware: what its firmware does its own way.
    :ivar self_restart: ends faults by itself.
    :ivar tuning: the procedure that is going on.
    """

    # [M0 §8.3]
    setpoint_of: ClassVar[Mapping[int, str]] = {
        0: 'status.frq_set',
        1: 'status.reg_set',
        2: 'status.trq_set',
        3: 'status.spd_set',
    }
    setpoints = frozenset(setpoint_of.values())
    delayed = 25
    run_command = 'fieldbus.scmd'
    run_codes = frozenset(Scmd)

    variant: G2Variant

    def __init__(self, memory: Memory, address: int, variant: G2Variant) -> None:
        self.firmware = firmware_of(memory, variant.dialect)
        faults = SinusFaults(memory.model, log_size=self.firmware.log_size)
        super().__init__(memory, address, variant, faults, self.firmware.line_rules)
        #: The module of CANopen holds it in bus mode.
        self._is_held = False
        self.self_restart = SelfRestart(memory, faults)
        self.machine = StateMachine()
        self.word = RELEASED
        self._profile = ds402.DriveProfile(memory, self.motor, faults)
        #: The control word that stands came by the drive profile, and so does the reference.
        self._by_profile = False
        self._dc_brake_left = 0.0
        self.tuning: Tuning | None = None
        #: What InvSt says of the tuning that was finished, until the next command.
        self._tuned = 0
        self._next_failure = 0

    def restart(self) -> None:
        """Begin as after power-on."""
        self.machine = StateMachine()
        self._is_held = False
        self.memory.put(ds402.CONTROL_WORD, 0)
        super().restart()

    def hand_control_to(self, source: Source) -> None:
        """Hand control over; a run command that stood is forgotten."""
        super().hand_control_to(source)
        self.word = RELEASED
        self.tuning = None
        self._tuned = 0

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """Let a fault happen, and count the tries to end it."""
        super().trip(code, cause_present=cause_present)
        self.self_restart.tripped(code)

    def hold_bus_mode(self) -> None:
        """Be in bus mode, and come back to it when control is taken, while that module talks."""
        if not self._is_held:
            self._is_held = True
            self.settle()

    def bus_lost(self) -> None:
        """Be held no more; with AutoStop, a fault of the fieldbus where the bus commands [C91]."""
        self._is_held = False
        if self.memory.raw('serial.auto_stop') and self.bus_controls:
            self.trip(self.faults.fieldbus_lost)
            self.settle()

    def fail_tuning(self, code: int) -> None:
        """Let the next tuning end with a fault (ValueError: none that a tuning ends with)."""
        if code not in FAILURES:
            raise ValueError(f'a tuning fails with {sorted(FAILURES)}, not with {code}')
        self._next_failure = code

    def key_of(self, key: str) -> str:
        """Return the set-point of the control mode for the common one, and what has two objects."""
        return self.setpoint_key if key == 'fieldbus.setpoint' else ds402.ALIASES.get(key, key)

    def write(self, key: str, raw: int) -> bool:
        """Carry out MODE, SCMD, DriveControl or its mask."""
        if key == 'fieldbus.drv_ctrl_write_mask':
            keep, add = ControlWord(raw & 0xFFFF), ControlWord(raw >> 16)
            self._write_control(self.word & keep | add)
            return True
        if key == ds402.CONTROL_WORD:
            self._write_profile(raw)
            return True
        if key == ds402.MODE:
            self._profile.require_mode(raw)
            return True
        return super().write(key, raw)

    def _write_profile(self, raw: int) -> None:
        self.memory.put(ds402.CONTROL_WORD, raw)
        # under local control ("remote" is 0) it is not processed
        if self.on_bus:
            self._write_control(ds402.control(raw))
            self._by_profile = True

    def written(self, key: str, protocol: str) -> None:
        """Record a fieldbus: to the older firmware all but Classic is one [C3]."""
        if key in _COMMANDS:
            self.by_fieldbus = protocol != 'classic' and self.firmware.own_bus_codes

    def show(self, key: str) -> int | None:
        """Return the raw number of what is neither stored nor measured."""
        if key == 'fieldbus.setpoint':
            return self.memory.raw(self.setpoint_key)
        if key == 'fieldbus.profidrive_status':
            return int(self.status_word)
        if key == ds402.STATUS_WORD:
            ramp = self.variant.canopen_ramp
            return ds402.status_word(self.status_word, self.machine.phase, ramp)
        if key in ds402.ALIASES:
            return self.memory.raw(ds402.ALIASES[key])
        if key == 'status.spd_act':
            parameter = self.memory.model[key]
            return nearest(parameter, self.motor.speed / self._speed_scale, home(parameter))
        shown = self._profile.show(key)
        return super().show(key) if shown is None else shown

    def command(self, scmd: Scmd) -> None:
        """Take a run command or Stop from SCMD."""
        self.source = Source.SCMD
        self.scmd = scmd

    def control(self, word: ControlWord) -> None:
        """Take a control word from DriveControl; without NetCtrl control is free."""
        if word & ControlWord.NET_CTRL:
            self.source = Source.CONTROL_WORD
        elif self.source is Source.CONTROL_WORD:
            self.hand_control_to(Source.STOP)
        self.scmd = Scmd.STOP
        self.word = word
        self._by_profile = False

    def _write_mode(self, raw: int) -> None:
        source = _SOURCES.get(raw)
        if source is None:
            raise Refused(Reason.VALUE, f'MODE = {raw} cannot be written')
        self._refuse_when_tuning()
        if raw == Mode.STOP and self.faults.serial:
            self.faults.acknowledge_serial()
        else:
            self.validate('fieldbus.mode')
        self.hand_control_to(source)

    def _command(self, raw: int) -> None:
        if raw != Scmd.STOP or self.variant.stop_in_tuning == 'refused':
            self._refuse_when_tuning()
        self.tuning, self._tuned = None, 0
        if raw in PROCEDURES:
            self._tune(raw)
        elif raw == Scmd.ERASE_E_LOG:
            self.faults.log.clear()
        elif raw == Scmd.RESET_E_OUT:
            self.counters.energy = 0.0
        elif raw in RUN_COMMANDS or raw == Scmd.STOP:
            self.command(Scmd(raw))

    def _tune(self, raw: int) -> None:
        if self.motor.driven or self.motor.turning:
            raise Refused(Reason.STATE, 'tuning needs a motor that stands')
        self.command(Scmd.STOP)
        # as a run command without RUN or in a fault, it leads to nothing
        if not self.faults and (self.run_input or not PROCEDURES[raw].measures):
            self.tuning = Tuning.begun(raw)

    def _refuse_when_tuning(self) -> None:
        if self.tuning is not None:
            raise Refused(Reason.STATE, 'tuning: MODE is Inhibit')

    def _go_on_tuning(self, dt: float) -> None:
        tuning = self.tuning
        if tuning is None:
            return
        if self.faults or (tuning.procedure.measures and not self.run_input):
            self.tuning = None
            return
        tuning.left -= dt
        if tuning.left > 1e-9:
            return
        self.tuning = None
        if self._next_failure:
            code, self._next_failure = self._next_failure, 0
            self.faults.trip(code, self.counters.operating_time, cause_present=False)
            return
        if self.variant.tuning_ends_in == 'code':
            self._tuned = tuning.procedure.done
        tuning.store(self.memory)
        self.motor.plate = self.nameplate()

    def _write_control(self, raw: int) -> None:
        word = ControlWord(raw)
        self._refuse_when_tuning()
        # acknowledging goes this way, so a fault does not refuse it [M0 table 16, FAULTED]
        if self.machine.asks_reset(word):
            self.faults.acknowledge()
        self.control(word)

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass: of tuning, of the DC braking before the start, of a fault."""
        super().wait(dt)
        self._go_on_tuning(dt)
        if self.machine.phase is Phase.OPERATION_ENABLED:
            self._dc_brake_left = max(0.0, self._dc_brake_left - dt)
        self.self_restart.wait(dt, driven=self.motor.driven, voltage=self.motor.voltage_on)

    @property
    def actual(self) -> int:
        """The actual value of what is regulated, in the counts of its set-point."""
        key, motor = self.setpoint_key, self.motor
        values = {
            'status.frq_set': motor.frequency,
            'status.spd_set': motor.speed / self._speed_scale,
            'status.trq_set': 100 * motor.torque,
            'status.reg_set': 100 * abs(motor.frequency) / motor.plate.frequency,
        }
        parameter = self.memory.model[key]
        return nearest(parameter, values[key], home(parameter))

    def scaled(self, parameter: Parameter) -> Parameter:
        """Return a parameter with SpdScl, where it is a speed."""
        if parameter.scale != 'SpdScl' or self._speed_scale == 1:
            return parameter
        return parameter.rescaled(home(parameter), Fraction(self._speed_scale))

    @property
    def _speed_scale(self) -> float:
        """SpdScl: what comes over a bus times this is a speed [M0 §8.3.2]."""
        above = self.memory.number('fieldbus.spd_scl_numerator')
        below = self.memory.number('fieldbus.spd_scl_denominator')
        return above / below if above > 0 and below > 0 else 1.0

    def _take_setpoint(self, setpoint: int) -> None:
        self.memory.put(self.setpoint_key, setpoint)

    @property
    def mode(self) -> int:
        """What MODE reads [M0 table 17]."""
        if self.tuning is not None:
            return Mode.INHIBIT
        if self.source is Source.STOP:
            return Mode.STOP
        return Mode.BUS if self.on_bus else Mode.EXT

    @property
    def settled(self) -> bool:
        """Whether all stays as it is: state machine, DC braking, tuning, faults."""
        phase = self.machine.phase
        waits = self._dc_brakes or self.tuning is not None or self.self_restart.waiting
        return super().settled and not waits and phase not in _PASSING

    @property
    def _dc_brakes(self) -> bool:
        """Whether the motor is braked before it starts: DC-Brk."""
        return self._dc_brake_left > 0 and self.machine.phase is Phase.OPERATION_ENABLED

    @property
    def preparing(self) -> bool:
        """Whether it shows standby although the start has begun [C122]."""
        return self._dc_brakes and self.variant.shown_in_dc_brk == 'standby'

    def settle(self) -> None:
        """Carry out what stands: control word, state machine, power stage, demand."""
        self._settle()
        if self._is_held and self.tuning is None and not self.on_bus and not self.faults.serial:
            # to take control ends a run; bus mode is entered again at once [M0 §6.4]
            self.hand_control_to(Source.SCMD)
            self._settle()

    def _settle(self) -> None:
        self._keep_delay()
        self.word = self._translated()
        effective = self.word
        if self.source is Source.CONTROL_WORD and (not self.run_input or self._delay_left):
            effective &= ~ControlWord.SWITCH_ON
        motor, machine = self.motor, self.machine
        conditions = Conditions(
            initialised=self.initialised,
            fault=bool(self.faults),
            brake=self._brakes,
            at_zero=motor.at_zero,
            voltage=motor.voltage_on,
        )
        before = machine.phase
        machine.update(effective, conditions)
        started = machine.phase is Phase.OPERATION_ENABLED and not motor.driven
        if started and before not in (Phase.DISABLE, Phase.SHUTDOWN):
            self._dc_brake_left = self.memory.number('control.dc_brk')
        if machine.driven:
            motor.energise()
            self._demand()
        else:
            motor.release()

    @property
    def control_word(self) -> ControlWord:
        """DriveControl, or what MODE and SCMD are translated to."""
        return self.word

    @property
    def stopping(self) -> bool:
        """Whether the state machine wants no run any more."""
        return self.machine.phase is not Phase.OPERATION_ENABLED

    @property
    def inv_st(self) -> int:
        """The inverter status while no fault is active [M0 table 19]."""
        if self.tuning is not None:
            return _TUNING
        if self._tuned:
            return self._tuned
        code = super().inv_st
        still = code == _KEYPAD_RUNNING and self.motor.at_zero
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
        if self.preparing:
            status &= ~(Status.OP_ENABLED | Status.REV_OP_ENABLED)
        if self.on_bus:
            status |= Status.CTRL_FROM_NET
            if self.word & ControlWord.NET_REF:
                status |= Status.REF_FROM_NET
        running = self.machine.phase is Phase.OPERATION_ENABLED and not self.preparing
        if running and self.motor.reached:
            status |= Status.SETPOINT_REACHED
        if self.motor.limited:
            status |= Status.LIMIT_ACTIVE
        return status

    def reference(self) -> float:
        """The reference that the source gives, signed: Hz, or the torque relative to nominal."""
        code = self.memory.raw('control.mode')
        frequency = self.motor.plate.frequency
        nominal = 1.0 if _REGULATION_OF[code] is Regulation.TORQUE else frequency
        if self.source is Source.SCMD and self.scmd != Scmd.FIELDBUS:
            return nominal * local_share(self.scmd, self._fixed_shares())
        if self.source is Source.CONTROL_WORD and self._by_profile:
            return self._profile.reference
        if not self.word & ControlWord.NET_REF:
            return nominal * TERMINAL_SHARE
        setpoint = self.memory.number(self.setpoint_key)
        scale = {
            'status.frq_set': 1.0,
            'status.spd_set': self._speed_scale * self.motor.plate.pole_pairs / 60,
            'status.trq_set': 0.01,
            'status.reg_set': frequency / 100,
        }
        return setpoint * scale[self.setpoint_key]

    def _fixed_shares(self) -> dict[int, float]:
        """The fixed references of Freque, as shares of f-Nom; the other modes use the same."""
        frequency = self.motor.plate.frequency
        values = {n: self.memory.number(f'freque.f_fix{n}') for n in range(1, 8)}
        return {n: value / frequency for n, value in values.items() if value}

    def _commanded(self) -> bool:
        if self.source is Source.CONTROL_WORD:
            return bool(self.word & ControlWord.SWITCH_ON)
        return self.source is Source.EXT or self.scmd in RUN_COMMANDS

    def _translated(self) -> ControlWord:
        """The control word for the command that stands [M0 §7]."""
        if self.source is Source.CONTROL_WORD:
            return self.word
        if self.source is Source.STOP:
            return RELEASED
        net = ControlWord(0)
        if self.source is Source.SCMD:
            net = ControlWord.NET_CTRL
            if self.scmd == Scmd.FIELDBUS:
                net |= ControlWord.NET_REF
        self.word = net
        if not self._wanted or self._delay_left != 0:
            return STANDBY | net
        reference = self.reference()
        forward = reference > 0 or (reference == 0 and self.machine.direction > 0)
        return RUNNING | net | (ControlWord.ENABLE_OP if forward else ControlWord.ENABLE_REV_OP)

    def _demand(self) -> None:
        motor = self.motor
        self._ramps()
        regulation = _REGULATION_OF[self.memory.raw('control.mode')]
        if self.machine.phase is not Phase.OPERATION_ENABLED or self._dc_brakes:
            # a stop goes down the ramp in every control mode
            motor.regulation = (
                Regulation.SPEED if regulation is Regulation.SPEED else Regulation.FREQUENCY
            )
            motor.demand = 0.0
            return
        motor.regulation = regulation
        reference = self.reference()
        if self.source is Source.CONTROL_WORD:
            reference = self._through_rfg(self._directed(reference))
        motor.demand = reference

    def _directed(self, reference: float) -> float:
        """What bits 3 and 13 of DriveControl make of a reference [M0 table 14]."""
        signed = self.setpoint_key == 'status.reg_set' or self._sign_counts
        return self.machine.direction * (reference if signed else abs(reference))

    @property
    def _sign_counts(self) -> bool:
        """Whether the sign of a set-point reverses: that of a drive profile does [C111]."""
        by_telegram = self.fieldbus.active and self.variant.telegram_words == 'profidrive'
        by_profile = by_telegram or self._by_profile
        return by_profile or self.variant.sign_in_drive_control == 'followed'

    def _through_rfg(self, reference: float) -> float:
        """What the ramp generator's bits of DriveControl make of the reference [M0 table 14]."""
        if not self.word & ControlWord.ENABLE_RFG:
            self.motor.accel = self.motor.retard = _RESET_TIME
            return 0.0
        if not self.word & ControlWord.UNLOCK_RFG:
            return self.motor.ramp
        return reference if self.word & ControlWord.USE_REF_FOR_RFG else 0.0
