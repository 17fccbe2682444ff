# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Sinus H is commanded by telegrams, and what it does when they end [M3].

Where its manual leaves the drive's behaviour open, it does what makes a careless driver fail: it
obeys to the telegram although the keypad decides who commands, a set-point is a number without a
sign, and the module says "Operation" while the motor stands.
"""

from __future__ import annotations

import enum
from typing import Any

from nfo_sinus_driver.simulator.control_unit import ControlUnit
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.sinus_h import keypad
from nfo_sinus_driver.simulator.sinus_h.state_machine import (
    LEVELS,
    NONE,
    PATTERNS,
    PROFIDRIVE,
    Control,
    State,
    StateMachine,
    Status,
    Stop,
)
from nfo_sinus_driver.simulator.sinus_h.trips import LOST_COMMAND
from nfo_sinus_driver.simulator.telegram1 import FieldbusWatch

#: How bits 1 and 2 of the status word are read [C63].
STATE, WORD = 'state', 'word'
#: What STOP at the keypad does while the fieldbus commands: no manual says.
STOPS, IGNORED = 'stops', 'ignored'
CHOICES = {
    'unlisted_exits': (NONE, PROFIDRIVE, LEVELS),
    'echo_bits': (STATE, WORD),
    'keypad_stop': (STOPS, IGNORED),
}
KEYS = ('start', 'stop', 'reset')
#: The ramp that forces the frequency to 0 goes by the Dec time; the least that a ramp takes (s).
_LEAST_RAMP = 0.01


class Lost(enum.Enum):
    """What goes on while the telegrams are missing."""

    NOTHING = 'nothing'
    #: It brakes, and trips then.
    BRAKES = 'brakes'
    #: It follows something else than the telegram.
    HOLDS = 'holds'


class SinusHControlUnit(ControlUnit):
    """
    Runs the motor of a Sinus H.

    :param unlisted_exits: see :class:`StateMachine`.
    :param echo_bits: bits 1 and 2 of ZSW1 tell the ``state``, as the patterns have it, or are
        those of the ``word`` that has been input, as the table of the bits has it [C63].
    :param keypad_stop: whether STOP at the keypad stops the motor.
    :raises ValueError: one of these cannot be that.

    :ivar word: STW1, as it was input last.
    :ivar setpoint: of the last telegram (Hz).
    :ivar machine: the states of the module.
    :ivar fieldbus: the telegrams.
    """

    word: Control
    setpoint: float
    machine: StateMachine
    #: The last word that was not ignored [C107].
    _obeyed: Control
    _lost: Lost
    _held: float
    _keypad_runs: bool

    def __init__(
        self,
        memory: Memory,
        address: int,
        *,
        unlisted_exits: str = NONE,
        echo_bits: str = STATE,
        keypad_stop: str = STOPS,
    ) -> None:
        super().__init__(memory, address)
        given = {
            'unlisted_exits': unlisted_exits,
            'echo_bits': echo_bits,
            'keypad_stop': keypad_stop,
        }
        for name, value in given.items():
            if value not in CHOICES[name]:
                raise ValueError(f'{name}: choose one of {", ".join(CHOICES[name])}')
        self._unlisted = unlisted_exits
        self._echo_bits = echo_bits
        self._keypad_stop = keypad_stop
        self.fieldbus = FieldbusWatch()
        self.restart()

    # ---- what it takes and shows ----

    def take_telegram(self, word: Control, setpoint: int) -> None:
        """Take control word and set-point (0.01 Hz) of a telegram."""
        self.fieldbus.heard()
        if self._lost is Lost.HOLDS:
            self._lost = Lost.NOTHING
        rises = word & ~self.word
        self.word = word
        if word & Control.CONTROL_BY_PLC:
            # without it the drive goes on at the last set-point, too [C116]
            self.setpoint = (setpoint & 0xFFFF) / 100
            self._obeyed = word
            if rises & Control.FAULT_ACKNOWLEDGE:
                self.faults.acknowledge()
        self.machine.update(word, inhibited=bool(self.faults))
        self.settle()

    @property
    def status_word(self) -> Status:
        """ZSW1 [M3 §7.2.2]."""
        status = PATTERNS[self.machine.state]
        if self._echo_bits == WORD:
            status &= ~(Status.READY_FOR_OPERATION | Status.OPERATION)
            status |= _if(self.word & Control.ON, Status.READY_FOR_OPERATION)
            status |= _if(self.word & Control.ENABLE_OPERATION, Status.OPERATION)
        status |= _if(self.word & Control.NO_COAST_STOP, Status.NO_COAST_STOP)
        status |= _if(self.word & Control.NO_QUICK_STOP, Status.NO_QUICK_STOP)
        status |= _if(self.word & Control.CONTROL_BY_PLC, Status.CONTROL_REQUESTED)
        status |= _if(self.faults, Status.FAULT)
        lost = self._lost is not Lost.NOTHING
        status |= _if(lost or self.motor.limited or self.faults.alarms, Status.WARNING)
        return status | _if(self._runs and self.motor.reached, Status.SPEED_REACHED)

    @property
    def actual(self) -> int:
        """The output frequency (0.01 Hz)."""
        return round(100 * abs(self.motor.frequency))

    def write(self, key: str, raw: int) -> bool:
        """Take nothing: no bus reaches a parameter here."""
        return False

    def show(self, key: str) -> int | None:
        """Return nothing: what is stored is what is shown."""
        return None

    @property
    def status_code(self) -> int:
        """The fault that is active, else 0."""
        return self.faults.shown

    # ---- what it does ----

    def restart(self) -> None:
        """Begin as after power-on."""
        self.initialised = False
        self.word = self._obeyed = Control(0)
        self.setpoint = 0.0
        self.machine = StateMachine(self._unlisted)
        self.fieldbus.forget()
        self._lost = Lost.NOTHING
        self._held = 0.0
        self._keypad_runs = False

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """Let a fault happen: the module falls back to S1, the motor runs free."""
        super().trip(code, cause_present=cause_present)
        self.machine.inhibit(Stop.COAST)
        self._lost = Lost.NOTHING
        self._keypad_runs = False

    def press(self, key: str) -> None:
        """Press a key: start and stop of the keypad, or reset of a fault."""
        commands = self._number(keypad.CMD_SOURCE)
        if key == 'reset':
            self.faults.acknowledge()
        elif key == 'start':
            self._keypad_runs = commands == 0 and not self.faults
        else:
            self._keypad_runs = False
            if commands == keypad.FIELDBUS_COMMANDS and self._keypad_stop == STOPS:
                self.machine.inhibit(Stop.BY_MODE)
        self.settle()

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass, of silence too."""
        self.fieldbus.wait(dt)
        lost = self.fieldbus.silent_for(self.memory.number(keypad.LOST_CMD_TIME))
        if lost and self._lost is Lost.NOTHING and self._commanded:
            self._lose()
        if self._lost is Lost.BRAKES and not self.motor.driven:
            self.trip(LOST_COMMAND)

    def _lose(self) -> None:
        mode = self._number(keypad.LOST_CMD_MODE)
        if mode == keypad.FREE_RUN:
            self.trip(LOST_COMMAND)
        elif mode == keypad.DECELERATE:
            self._lost = Lost.BRAKES
        elif mode != keypad.NONE:
            self._lost = Lost.HOLDS
            self._held = {
                keypad.HOLD_INPUT: self.setpoint,
                keypad.HOLD_OUTPUT: self.motor.ramp,
                keypad.PRESET: self.memory.number(keypad.LOST_PRESET_F),
            }[mode]

    @property
    def settled(self) -> bool:
        """Whether nothing happens by the clock alone."""
        mode = self._number(keypad.LOST_CMD_MODE)
        watched = self._commanded and mode != keypad.NONE and self._lost is not Lost.HOLDS
        return not watched and self._lost is not Lost.BRAKES and not self._brakes

    def settle(self) -> None:
        """Carry out what stands: run, brake to a stop, or let the motor go."""
        motor = self.motor
        motor.accel = max(self.memory.number(keypad.ACC_TIME), _LEAST_RAMP)
        motor.retard = max(self.memory.number(keypad.DEC_TIME), _LEAST_RAMP)
        if self._runs:
            motor.energise()
            motor.demand = self._demand()
        elif self._brakes:
            motor.demand = 0.0
        else:
            motor.release()
        if self._lost is Lost.BRAKES:
            motor.retard = max(self.memory.number(keypad.TRIP_DEC_TIME), _LEAST_RAMP)
            motor.demand = 0.0
            if motor.at_zero:
                motor.release()

    @property
    def _commanded(self) -> bool:
        """Whether the fieldbus lets the motor run."""
        by_fieldbus = self._number(keypad.CMD_SOURCE) == keypad.FIELDBUS_COMMANDS
        return by_fieldbus and self.machine.state is State.OPERATION

    @property
    def _runs(self) -> bool:
        allowed = self.initialised and not self.faults
        return allowed and (self._commanded or self._keypad_runs)

    @property
    def _brakes(self) -> bool:
        """Whether the motor goes down the ramp to a stop."""
        motor = self.motor
        if self._runs or not motor.driven or motor.at_zero or self.faults:
            return False
        by_mode = self._number(keypad.STOP_MODE) == keypad.DEC
        return by_mode and self.initialised and self.machine.stop is Stop.BY_MODE

    def _demand(self) -> float:
        """The frequency to ramp to (Hz)."""
        if self._lost is Lost.HOLDS:
            return min(self._held, self.memory.number(keypad.MAX_FREQ))
        reference = self.memory.number(keypad.FREQUENCY)
        if self._number(keypad.FREQ_REF_SRC) == keypad.FIELDBUS_REFERENCE:
            reference = self.setpoint
        if self._commanded:
            word = self._obeyed
            if not word & Control.ENABLE_RAMP or not word & Control.ENABLE_SETPOINT:
                reference = 0.0
            elif not word & Control.UNFREEZE_RAMP:
                reference = self.motor.ramp
        return min(reference, self.memory.number(keypad.MAX_FREQ))

    def _number(self, key: str) -> int:
        return self.memory.raw(key)

    # ---- for tests and people ----

    def report(self) -> dict[str, Any]:
        """Return what the module shows."""
        return {
            'state': self.machine.state.value,
            'control_word': int(self.word),
            'status_word': int(self.status_word),
            'setpoint': self.setpoint,
            'lost_command': self._lost.value,
        }


def _if(condition: object, bit: Status) -> Status:
    return bit if condition else Status(0)
