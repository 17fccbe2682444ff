# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Sinus H is commanded by telegrams, and what it does when they end [M3].

Where its manual leaves the drive's behaviour open, it does what makes a careless driver fail: it
obeys to the telegram although the keypad decides who commands, a set-point is a number without a
sign, and the module says "Operation" while the motor stands.
"""

from __future__ import annotations

from dataclasses import dataclass
import enum
from typing import Any

from nfo_sinus_driver.simulator.control_unit import ControlUnit, Variant, choice
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.sinus_h import keypad
from nfo_sinus_driver.simulator.telegram1 import FieldbusWatch, Stw1, Zsw1


class State(enum.Enum):
    """The states of the module."""

    SWITCHING_ON_INHIBITED = 'S1'
    READY_FOR_SWITCHING_ON = 'S2'
    READY_FOR_OPERATION = 'S3'
    OPERATION = 'S4'


class Order(enum.Enum):
    """What bits 0 to 3 of STW1 command [M3 §6]; SwitchON is OperationDisable, too."""

    COAST_STOP = enum.auto()
    QUICK_STOP = enum.auto()
    SWITCH_OFF = enum.auto()
    SWITCH_ON = enum.auto()
    OPERATION_ENABLE = enum.auto()

    @classmethod
    def of(cls, word: Stw1) -> Order:
        """Return what a word commands."""
        if not word & Stw1.NO_COAST_STOP:
            return cls.COAST_STOP
        if not word & Stw1.NO_QUICK_STOP:
            return cls.QUICK_STOP
        if not word & Stw1.ON:
            return cls.SWITCH_OFF
        return cls.OPERATION_ENABLE if word & Stw1.ENABLE_OPERATION else cls.SWITCH_ON


_S1, _S2, _S3, _S4 = State
#: The bits of each state [M3 §7.2.2].
_PATTERNS = {
    _S1: Zsw1.SWITCHING_ON_INHIBITED,
    _S2: Zsw1.READY_TO_SWITCH_ON,
    _S3: Zsw1.READY_TO_SWITCH_ON | Zsw1.READY_TO_OPERATE,
    _S4: Zsw1.READY_TO_SWITCH_ON | Zsw1.READY_TO_OPERATE | Zsw1.OPERATION_ENABLED,
}
#: The table of [M3 §6]. The diagram is missing, and with it perhaps exits that the table does not
#: print [C65].
_EXITS = {
    (_S1, Order.SWITCH_OFF): _S2,
    (_S2, Order.COAST_STOP): _S1,
    (_S2, Order.QUICK_STOP): _S1,
    (_S2, Order.SWITCH_ON): _S3,
    (_S2, Order.OPERATION_ENABLE): _S3,
    (_S3, Order.SWITCH_OFF): _S2,
    (_S3, Order.OPERATION_ENABLE): _S4,
    (_S4, Order.COAST_STOP): _S1,
    (_S4, Order.QUICK_STOP): _S1,
    (_S4, Order.SWITCH_ON): _S3,
}
_PROFIDRIVE = {
    (_S3, Order.QUICK_STOP): _S1,
    (_S3, Order.COAST_STOP): _S1,
    (_S4, Order.SWITCH_OFF): _S2,
}
#: What follows only where unlisted exits are taken as other drives of the profile have them; with
#: levels S1 is left, too, by a word that has been there all the time.
_UNLISTED = {
    'none': {},
    'profidrive': _PROFIDRIVE,
    'levels': {
        **_PROFIDRIVE,
        (_S1, Order.SWITCH_ON): _S2,
        (_S1, Order.OPERATION_ENABLE): _S2,
    },
}


class StateMachine:
    """
    The state of the module; one telegram leads to the next state at most.

    :ivar state: where it is.
    :ivar coasts: a motor that does not run any more runs free, else it stops as ADV-8 says.
    """

    def __init__(self, unlisted: str = 'none') -> None:
        self.state = _S1
        self.coasts = True
        self._exits = {**_EXITS, **_UNLISTED[unlisted]}

    def update(self, word: Stw1, *, inhibited: bool) -> None:
        """Take the word of a telegram (inhibited: a fault keeps the module from switching on)."""
        if not word & Stw1.CONTROL_BY_PLC:
            # the whole word is ignored [M3 §7.2.1, C107]
            return
        order, before = Order.of(word), self.state
        if not (inhibited and before is _S1):
            self.state = self._exits.get((before, order), before)
        if order is Order.COAST_STOP:
            self.coasts = True
        elif before is _S4 and self.state is not _S4:
            self.coasts = False

    def inhibit(self, *, coasts: bool) -> None:
        """Fall back to S1: a fault, or STOP at the keypad."""
        self.state, self.coasts = _S1, coasts


#: The ramp that forces the frequency to 0 goes by the Dec time; the least that a ramp takes (s).
_LEAST_RAMP = 0.01


@dataclass(frozen=True)
class SinusHVariant(Variant):
    """One way to read the manual."""

    unlisted_exits: str = choice(
        *_UNLISTED, text='exits of its states that the manual does not list'
    )
    #: As the patterns of the states have it, or the table of the bits [C63].
    echo_bits: str = choice(
        'state', 'word', text='bits 1 and 2 of ZSW1 tell the state, or those of the control word'
    )
    #: No manual says.
    keypad_stop: str = choice(
        'stops', 'ignored', text='what STOP at the keypad does while the fieldbus commands'
    )


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

    :ivar word: STW1, as it was input last.
    :ivar setpoint: of the last telegram (Hz).
    :ivar machine: the states of the module.
    :ivar fieldbus: the telegrams.
    """

    keys = ('start', 'stop', 'reset')
    variant: SinusHVariant
    word: Stw1
    setpoint: float
    machine: StateMachine
    #: The last word that was not ignored [C107].
    _obeyed: Stw1
    _lost: Lost
    _held: float
    _keypad_runs: bool

    def __init__(self, memory: Memory, address: int, variant: SinusHVariant) -> None:
        super().__init__(memory, address, variant)
        self.fieldbus = FieldbusWatch()
        self.restart()

    # ---- what it takes and shows ----

    def take_telegram(self, word: Stw1, setpoint: int) -> None:
        """Take control word and set-point (0.01 Hz) of a telegram."""
        self.fieldbus.note_telegram()
        if self._lost is Lost.HOLDS:
            self._lost = Lost.NOTHING
        rises = word & ~self.word
        self.word = word
        if word & Stw1.CONTROL_BY_PLC:
            # without it the drive goes on at the last set-point, too [C116]
            self.setpoint = (setpoint & 0xFFFF) / 100
            self._obeyed = word
            if rises & Stw1.FAULT_ACKNOWLEDGE:
                self.faults.acknowledge()
        self.machine.update(word, inhibited=bool(self.faults))
        self.settle()

    @property
    def status_word(self) -> Zsw1:
        """ZSW1 [M3 §7.2.2]."""
        status = _PATTERNS[self.machine.state]
        if self.variant.echo_bits == 'word':
            status &= ~(Zsw1.READY_TO_OPERATE | Zsw1.OPERATION_ENABLED)
            status |= _if(self.word & Stw1.ON, Zsw1.READY_TO_OPERATE)
            status |= _if(self.word & Stw1.ENABLE_OPERATION, Zsw1.OPERATION_ENABLED)
        status |= _if(self.word & Stw1.NO_COAST_STOP, Zsw1.NO_COAST_STOP)
        status |= _if(self.word & Stw1.NO_QUICK_STOP, Zsw1.NO_QUICK_STOP)
        status |= _if(self.word & Stw1.CONTROL_BY_PLC, Zsw1.CONTROL_REQUESTED)
        status |= _if(self.faults, Zsw1.FAULT)
        lost = self._lost is not Lost.NOTHING
        status |= _if(lost or self.motor.limited or self.faults.alarms, Zsw1.WARNING)
        return status | _if(self._runs and self.motor.reached, Zsw1.WITHIN_TOLERANCE)

    @property
    def actual(self) -> int:
        """The output frequency (0.01 Hz)."""
        return round(100 * abs(self.motor.frequency))

    # ---- what it does ----

    def restart(self) -> None:
        """Begin as after power-on."""
        self.initialised = False
        self.word = self._obeyed = Stw1(0)
        self.setpoint = 0.0
        self.machine = StateMachine(self.variant.unlisted_exits)
        self.fieldbus.forget()
        self._lost = Lost.NOTHING
        self._held = 0.0
        self._keypad_runs = False

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """Let a fault happen: the module falls back to S1, the motor runs free."""
        super().trip(code, cause_present=cause_present)
        self.machine.inhibit(coasts=True)
        self._lost = Lost.NOTHING
        self._keypad_runs = False

    def press(self, key: str) -> None:
        """Press a key: start and stop of the keypad, or reset of a fault."""
        commands = self.memory.raw(keypad.CMD_SOURCE)
        if key == 'reset':
            self.faults.acknowledge()
        elif key == 'start':
            self._keypad_runs = commands == 0 and not self.faults
        else:
            self._keypad_runs = False
            if commands == keypad.FIELDBUS_COMMANDS and self.variant.keypad_stop == 'stops':
                self.machine.inhibit(coasts=False)
        self.settle()

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass, of silence too."""
        self.fieldbus.wait(dt)
        lost = self.fieldbus.silent_for(self.memory.number(keypad.LOST_CMD_TIME))
        if lost and self._lost is Lost.NOTHING and self._commanded:
            self._lose()
        if self._lost is Lost.BRAKES and not self.motor.driven:
            self.trip(keypad.LOST_COMMAND)

    def _lose(self) -> None:
        mode = self.memory.raw(keypad.LOST_CMD_MODE)
        if mode == keypad.FREE_RUN:
            self.trip(keypad.LOST_COMMAND)
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
        mode = self.memory.raw(keypad.LOST_CMD_MODE)
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
        by_fieldbus = self.memory.raw(keypad.CMD_SOURCE) == keypad.FIELDBUS_COMMANDS
        return by_fieldbus and self.machine.state is _S4

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
        by_mode = self.memory.raw(keypad.STOP_MODE) == keypad.DEC
        return by_mode and self.initialised and not self.machine.coasts

    def _demand(self) -> float:
        """The frequency to ramp to (Hz)."""
        if self._lost is Lost.HOLDS:
            return min(self._held, self.memory.number(keypad.MAX_FREQ))
        reference = self.memory.number(keypad.FREQUENCY)
        if self.memory.raw(keypad.FREQ_REF_SRC) == keypad.FIELDBUS_REFERENCE:
            reference = self.setpoint
        if self._commanded:
            word = self._obeyed
            if not word & Stw1.ENABLE_RAMP or not word & Stw1.ENABLE_SETPOINT:
                reference = 0.0
            elif not word & Stw1.UNFREEZE_RAMP:
                reference = self.motor.ramp
        return min(reference, self.memory.number(keypad.MAX_FREQ))

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


def _if(condition: object, bit: Zsw1) -> Zsw1:
    return bit if condition else Zsw1(0)
