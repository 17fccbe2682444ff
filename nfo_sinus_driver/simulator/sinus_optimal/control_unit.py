# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a Sinus Optimal is commanded and what it shows of it [M1].

Its manual has no state machine, only bits and codes; what it leaves open is as a careless driver
does not expect it:

* MODE = Manual is no stop: a running motor goes on, now as the keypad's.
* Both control methods at once, which [M1] forbids: what one has started the other does not stop.
* A run command is taken while a fault is active, and holds when it is acknowledged; a variant can
  drop it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from nfo_sinus_driver.families.sinus_optimal.words import ControlWord, Mode, Smode, Status, state_of
from nfo_sinus_driver.simulator.control_unit import choice
from nfo_sinus_driver.simulator.memory import Memory, Reason, Refused, home
from nfo_sinus_driver.simulator.motor import Regulation, nearest
from nfo_sinus_driver.simulator.sinus.control_unit import (
    TERMINAL_SHARE,
    SinusControlUnit,
    SinusVariant,
    Source,
)
from nfo_sinus_driver.simulator.sinus.serial_side import SinusFaults

#: Codes of the setting control.mode.
_FREQUENCY, _SPEED = 0, 3
#: What a telegram carries at 50 Hz or at the nominal speed, and at most [M1, Profinet].
FULL_TELEGRAM, MOST_OF_TELEGRAM = 8192, 24576
_FULL_FREQUENCY = 50.0
#: The largest reference that the manual speaks of: Hz, and nominal speeds [M1, Profinet].
_MOST_FREQUENCY, _MOST_SPEEDS = 150.0, 3


@dataclass(frozen=True)
class OptimalVariant(SinusVariant):
    """An Optimal: [M1] knows no refusal in a fault, and no table that ends a run command."""

    run_command_in_fault: str = choice(
        'keeps', 'drops', text='what an acknowledged fault does to a run command'
    )


class OptimalControlUnit(SinusControlUnit):
    """
    Runs the motor of an Optimal.

    One that takes commands by levels goes on by what stands when it has power again.
    """

    setpoint_of: ClassVar[Mapping[int, str]] = {
        _FREQUENCY: 'fieldbus.input_freq_setpoint',
        _SPEED: 'fieldbus.input_speed_setpoint',
    }
    setpoints = frozenset(setpoint_of.values())
    delayed = 54
    run_command = 'fieldbus.smode'
    run_codes = frozenset(Smode)

    def __init__(self, memory: Memory, address: int, variant: OptimalVariant) -> None:
        super().__init__(memory, address, variant, SinusFaults(memory.model))
        self._by_level = variant.commands == 'levels'
        self._steps = ControlSteps(by_level=self._by_level)
        self._running = False
        self._sleeping = False
        self._telegram_setpoint = 0

    @property
    def mode(self) -> int:
        """What MODE reads [M1]: whatever is neither bus nor terminals is Manual."""
        if self.on_bus:
            return Mode.BUS
        return Mode.AUTO if self.source is Source.EXT else Mode.MANUAL

    @property
    def control_word(self) -> ControlWord:
        """The control word, as it was written."""
        return self._steps.word

    def restart(self) -> None:
        """Begin as after power-on."""
        self._steps = ControlSteps(by_level=self._by_level)
        self._running = self._sleeping = False
        super().restart()

    def hand_control_to(self, source: Source) -> None:
        """Hand control over; a run command that stood is forgotten."""
        super().hand_control_to(source)
        if not self.on_bus:
            self._steps.give_up()

    def show(self, key: str) -> int | None:
        """Return the raw number of what is neither stored nor measured."""
        # the reference that is followed, nothing while the motor is off
        motor = self.motor
        demand = motor.demand if motor.driven else 0.0
        if key == 'status.control_freq':
            return self._nearest(key, demand)
        if key == 'status.control_speed':
            return self._nearest(key, 60 * demand / motor.plate.pole_pairs)
        return super().show(key)

    def _nearest(self, key: str, value: float) -> int:
        parameter = self.memory.model[key]
        return nearest(parameter, value, home(parameter))

    def _write_mode(self, raw: int) -> None:
        if raw not in set(Mode):
            raise Refused(Reason.VALUE, f'MODE = {raw} cannot be written')
        self.validate('fieldbus.mode')
        if raw == Mode.MANUAL:
            self.hand_control_to(Source.KEYPAD if self._running else Source.STOP)
        else:
            self.hand_control_to(Source.EXT if raw == Mode.AUTO else Source.SCMD)

    def _command(self, raw: int) -> None:
        self.scmd = Smode(raw)

    def _write_control(self, raw: int) -> None:
        word = ControlWord(raw)
        shown = self.status_word
        faulted = bool(self.faults)
        if word & ~self.control_word & ControlWord.FAULT_ACK:
            self.faults.acknowledge()
        self._steps.write(word, shown)
        if faulted and not self.faults:
            self.acknowledged()
        if self.source is Source.CONTROL_WORD and not self._steps.has_control:
            self.hand_control_to(Source.STOP)

    def _drop_run_command(self) -> None:
        super()._drop_run_command()
        self._steps.drop_run()

    def wait(self, dt: float) -> None:
        """Let the start delay run, and the drive respond to Drive Control."""
        super().wait(dt)
        self._steps.wait(dt, self.status_word)
        if self._steps.has_control and not self.on_bus:
            self.hand_control_to(Source.CONTROL_WORD)

    @property
    def settled(self) -> bool:
        """Whether all stays as it is: no stop goes on, and the control word has had its effect."""
        going_on = self._steps.waiting or self._steps.next_due(self.status_word)
        return super().settled and not self.stopping and not going_on

    def settle(self) -> None:
        """Carry out what stands: run, brake to a stop, sleep, or let the motor go."""
        self._keep_delay()
        motor = self.motor
        working = self.initialised and not self.faults
        self._running = working and self._wanted and self._delay_left == 0
        reference = self.reference()
        self._sleeping = self._running and self._sleeps(reference)
        self._ramps()
        by_speed = self.memory.raw('control.mode') == _SPEED
        motor.regulation = Regulation.SPEED if by_speed else Regulation.FREQUENCY
        if self._running and not self._sleeping:
            motor.energise()
            motor.demand = reference
        elif motor.driven and working and not self._sleeping and self._brakes:
            motor.demand = 0.0
            if motor.at_zero:
                motor.release()
        else:
            motor.release()

    @property
    def stopping(self) -> bool:
        """Whether the motor goes down the ramp to a stop."""
        return self.motor.driven and not self._running

    @property
    def inv_st(self) -> int:
        """The inverter status while no fault is active [M1]."""
        return 29 if self._sleeping else super().inv_st

    @property
    def status_word(self) -> Status:
        """Drive Status [M1]."""
        motor = self.motor
        ready = self.initialised and not self.faults
        alarm = motor.limited or bool(self.faults.alarms)
        # not a dict: to hash these costs more than all the rest, at every step of the drive
        bits = (
            (Status.READY, ready),
            (Status.SWITCHED_ON, motor.driven),
            (Status.ENABLED, ready and self._steps.enabled and not self.stopping),
            (Status.FAULT_ACTIVE, bool(self.faults)),
            (Status.ECHO_1, bool(self.control_word & ControlWord.ECHO_1)),
            (Status.ECHO_2, bool(self.control_word & ControlWord.ECHO_2)),
            (Status.DISABLED, not self.run_input),
            (Status.ALARM_ACTIVE, alarm),
            (Status.CONTROL_FROM_BUS, self.on_bus),
            (Status.SETPOINT_REACHED, self._running and motor.reached),
            (Status.LIMIT_ACTIVE, motor.limited),
            (Status.SLEEP_ACTIVE, self._sleeping),
            (Status.STOPMODE_BRAKE, self._brakes),
            (Status.REVERSE, motor.speed < -0.5),
            (Status.STOPPING, self.stopping),
        )
        return Status(sum(bit for bit, is_set in bits if is_set))

    @property
    def state(self) -> str:
        """What the status word amounts to, since the manual has no state machine."""
        return state_of(self.status_word).name

    def reference(self) -> float:
        """The reference that is followed in a run, signed (Hz)."""
        plate = self.motor.plate
        if self.source is Source.CONTROL_WORD and self.fieldbus.active:
            # it comes by telegram, with the control word
            share = min(max(self._telegram_setpoint, -MOST_OF_TELEGRAM), MOST_OF_TELEGRAM)
            return self.telegram_unit * share
        if self.scmd != Smode.FIELDBUS:
            return plate.frequency * TERMINAL_SHARE
        setpoint = self.memory.number(self.setpoint_key)
        if self.memory.raw('control.mode') == _FREQUENCY:
            most, scale = _MOST_FREQUENCY, 1.0
        else:
            most, scale = _MOST_SPEEDS * plate.speed, plate.pole_pairs / 60
        return scale * min(max(setpoint, -most), most)

    @property
    def telegram_unit(self) -> float:
        """
        What one count of a value of the telegram is, as a frequency (Hz) [M1].

        8192 are 50 Hz in Frequency mode, and the nominal speed in Speed mode: that of the
        manual's example, 1500 rpm for four poles, is the motor's without slip.
        """
        by_speed = self.memory.raw('control.mode') == _SPEED
        full = self.motor.plate.frequency if by_speed else _FULL_FREQUENCY
        return full / FULL_TELEGRAM

    @property
    def telegram_actual(self) -> float:
        """The actual value of the telegram, in its counts, signed."""
        motor = self.motor
        by_speed = self.memory.raw('control.mode') == _SPEED
        turned = motor.speed * motor.plate.pole_pairs / 60 if by_speed else motor.frequency
        return turned / self.telegram_unit

    def _take_setpoint(self, setpoint: int) -> None:
        self._telegram_setpoint = setpoint

    def _commanded(self) -> bool:
        bus = self.scmd != Smode.STOP or self._steps.run
        return bus if self.on_bus else self.source is Source.EXT

    def _sleeps(self, reference: float) -> bool:
        """Whether so small a reference suspends the output, once the ramp has come down to it."""
        least = self.memory.number('control.f_sleep')
        slow = not self.motor.driven or abs(self.motor.ramp) < least
        return slow and abs(reference) < least


#: The commands in their order, and the status bits that must be there for one to be taken.
_STEPS = (
    (ControlWord.BUS_CONTROL, Status(0)),
    (ControlWord.ENABLE, Status.CONTROL_FROM_BUS | Status.READY),
    (ControlWord.SWITCH_ON, Status.CONTROL_FROM_BUS | Status.ENABLED),
)
#: How long the drive takes to respond (s): longer than a write, so that it matters to wait.
_RESPONSE = 0.05


class ControlSteps:
    """
    How far a master has come.

    A command is taken when its bit rises and the status word is ready for it. What came too early
    does nothing until it is removed and given again; what is removed ends at once, and all
    that came after it.

    :param by_level: a command is taken as soon as its bit stands and the status word is ready.
    :ivar word: the last control word.
    """

    def __init__(self, *, by_level: bool = False) -> None:
        self.word = ControlWord(0)
        self._by_level = by_level
        self._asked = 0
        self._reached = 0
        self._left = 0.0

    def write(self, word: ControlWord, shown: Status) -> None:
        """Take a control word; ``shown`` is the status word until now."""
        rises = word & ~self.word
        self.word = word
        held = 0
        while held < len(_STEPS) and word & _STEPS[held][0]:
            held += 1
        self._asked = min(self._asked, held)
        self._reached = min(self._reached, held)
        if self._reached == self._asked < held:
            command, needed = _STEPS[self._asked]
            if rises & command and shown & needed == needed:
                self._asked += 1
                self._left = _RESPONSE

    def next_due(self, shown: Status) -> bool:
        """Return whether the next command is taken because its bit stands."""
        if not self._by_level or self.waiting or self._asked == len(_STEPS):
            return False
        command, needed = _STEPS[self._asked]
        return bool(self.word & command) and shown & needed == needed

    def give_up(self) -> None:
        """Lose control to another source; the word stays as it was written."""
        self._asked = self._reached = 0

    def drop_run(self) -> None:
        """Forget the run command; its bit must be removed and given again."""
        before_run = len(_STEPS) - 1
        self._asked = min(self._asked, before_run)
        self._reached = min(self._reached, before_run)

    def wait(self, dt: float, shown: Status) -> None:
        """Let ``dt`` seconds pass; ``shown`` is the status word."""
        if self.next_due(shown):
            self._asked += 1
            self._left = _RESPONSE
        self._left = max(0.0, self._left - dt)
        if not self._left:
            self._reached = self._asked

    @property
    def waiting(self) -> bool:
        """Whether a command has been taken and has had no effect yet."""
        return self._asked > self._reached

    @property
    def has_control(self) -> bool:
        """Whether the bus has control by this word."""
        return self._reached >= 1

    @property
    def enabled(self) -> bool:
        """Whether a run command would be taken."""
        return self._reached >= 2

    @property
    def run(self) -> bool:
        """Whether a run command stands."""
        return self._reached == len(_STEPS)
