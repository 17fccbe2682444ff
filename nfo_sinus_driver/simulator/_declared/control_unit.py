# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The part of a described drive that decides: commands, status, faults, time-out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from nfo_sinus_driver.catalog import Kind, Role, to_words
from nfo_sinus_driver.catalog.declared import (
    FAULT_KEY,
    PULSES,
    STATUS_KEY,
    Description,
    Place,
    Shown,
    drive_number,
    place_of,
)
from nfo_sinus_driver.simulator._declared.orders import Orders
from nfo_sinus_driver.simulator._declared.status import Wish, compose
from nfo_sinus_driver.simulator.control_unit import ControlUnit, Variant, choice
from nfo_sinus_driver.simulator.memory import Memory, Reason, Refused
from nfo_sinus_driver.simulator.motor import Nameplate, measured, nearest

#: How much it counts that a condition of the status is right.
_WEIGHTS = {'fault': 100, 'running': 50, 'remote': 50, 'local': 50, 'stopping': 20}
_AWAITED = 30
#: A motor that ramps slower than this is one that stands (s).
_QUICKEST = 0.05
#: The ramps of a drive whose file names no parameters for them (s).
_RAMP = 2.0
#: By how much a quick stop is quicker than the ramp.
_QUICKER = 0.25
#: What unsigned registers show without a sign.
_SIZES = (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED, Role.ACTUAL_TORQUE, Role.OUTPUT_POWER)
#: The number of a fault of which the file says nothing but that it is one.
_UNNAMED = 1


@dataclass(frozen=True)
class DeclaredVariant(Variant):
    """What files leave open."""

    run_command_in_fault: str = choice(
        'keeps', 'drops', text='what becomes of a run command in a fault'
    )
    in_local: str = choice(
        'ignores', 'refuses', 'keeps',
        text='what it does with commands while the line has no control; keeps: they count once it '
        'has',
    )


class DeclaredControlUnit(ControlUnit):
    """Takes the words of the file; what they mean it knows from the lists of the file alone."""

    variant: DeclaredVariant

    def __init__(
        self, memory: Memory, address: int, variant: DeclaredVariant, drive: Description
    ) -> None:
        self._drive = drive
        super().__init__(memory, address, variant)
        self._orders = Orders(drive)
        self._words: dict[Place, int] = {}
        #: Where nothing else was commanded since the last word.
        self._newest: set[Place] = set()
        self._run = self._reverse = self._coasts = self._quick = self._turned_round = False
        self._silent_for = self._braked_for = 0.0
        self.local = False

    # ---- commands ----

    @property
    def command_places(self) -> set[Place]:
        """Where commands are written."""
        return self._orders.places

    @property
    def pulses(self) -> set[int]:
        """The coils that are commands by being set."""
        return self._orders.pulses

    def take_word(self, place: Place, word: int) -> None:
        """Take a word, or a coil, that is a command."""
        if not self.obeys and self.variant.in_local != 'keeps':
            if self.variant.in_local == 'refuses':
                raise Refused(Reason.STATE, 'the line has no control')
            return
        is_repeated = place in self._newest and self._words.get(place) == word
        if is_repeated and place != PULSES:
            # a PLC writes cyclically
            return
        self._words[place] = word
        orders = self._orders
        done, way = {*orders.made_by(place, word)}, orders.direction_of(place, word)
        if way:
            self._reverse = way < 0
            # the word of the direction may be the run command, too
            done |= {'run'} if orders.runs_by_direction(place) else set()
        turned_round = self._drive.simulated.reverse
        if turned_round is not None and place == ('register', turned_round[0]):
            self._turned_round = bool(word & turned_round[1])
        removes = orders.removes_run(place, word)
        self._newest = {place} if done or removes else self._newest | {place}
        if removes:
            self._run = False
        for name in ('run', 'stop', 'quick_stop', 'coast', 'release', 'reset'):
            if name in done:
                self._act(name)

    def _act(self, name: str) -> None:
        if name == 'run':
            self._run, self._coasts, self._quick = True, False, False
        elif name in ('stop', 'quick_stop', 'coast'):
            self._run, self._quick = False, name == 'quick_stop'
            mode = self._drive.stop_mode
            released = mode is not None and self.memory.get(mode[0]) == mode[1]
            self._coasts = name == 'coast' or (name == 'stop' and released)
        elif name == 'release':
            self._run = False
        elif name == 'reset':
            self.faults.acknowledge()

    def word(self, place: Place) -> int:
        """Return what was written last."""
        return self._words.get(place, 0)

    @property
    def obeys(self) -> bool:
        """The line has control: nothing local, and each parameter is as it has to be."""
        drive, get = self._drive, self.memory.get
        if drive.holder is not None and get(drive.holder[0]) not in drive.holder[1]:
            return False
        return not self.local and all(
            get(required.key) == required.value for required in drive.requires
        )

    # ---- what it shows ----

    def show(self, key: str) -> int | None:
        """Return status, read-back and what is measured without a sign."""
        if key == STATUS_KEY:
            return self.status_word
        if key == FAULT_KEY:
            return self.fault_number()
        if key == self._drive.setpoint.read_key != self._drive.setpoint.key:
            return self.memory.raw(self._drive.setpoint.key)
        parameter = self._drive.parameters[key]
        role = self.memory.model.role_of.get(key)
        address = parameter.at('modbus')
        is_register = key.startswith('line.r') and address.codec.size == 2
        if is_register or key.startswith('line.coil_'):
            return self.word(place_of(address))
        measured = self._measured(role)
        if measured is None:
            return None
        if role in _SIZES and not address.number.signed:
            measured = abs(measured)
        return nearest(parameter, measured / self.scale(key), 'modbus')

    def shown(self, what: Shown) -> int:
        """Return the word of a register that the driver does not read."""
        parameter = what.parameter
        scale = self.memory.number(parameter.scale, 1.0) or 1.0 if parameter.scale else 1.0
        if what.quantity is None:
            key = self._drive.setpoint.key
            value = self.memory.number(key) * self.scale(key)
        else:
            value = measured(what.quantity, self.motor, self.counters)
        if not parameter.at('modbus').number.signed:
            value = abs(value)
        return to_words(
            parameter.at('modbus').number.encode(nearest(parameter, value / scale, 'modbus'))
        )[0]

    def _measured(self, role: Role | None) -> float | None:
        motor = self.motor
        if role is Role.ACTUAL_FREQUENCY:
            return motor.frequency
        if role is Role.ACTUAL_SPEED:
            return motor.speed
        if role is Role.ACTUAL_TORQUE:
            return 100 * motor.torque
        return motor.power if role is Role.OUTPUT_POWER else None

    def scale(self, key: str) -> float:
        """Return by what the factor of a parameter is multiplied."""
        scale = self._drive.parameters[key].scale
        return self.memory.number(scale, 1.0) or 1.0 if scale else 1.0

    @property
    def status_word(self) -> int:
        """Return the status as one number, by the conditions of the file."""
        drive, fault = self._drive, self.faults.shown
        is_fault = bool(self.faults)
        wishes: list[Wish] = [
            (drive.facts[name], truth, _WEIGHTS.get(name, 1))
            for name, truth in self._truths().items()
            if name in drive.facts
        ]
        wishes += [
            (condition, is_fault and flag.code == fault, 10) for condition, flag in drive.flags
        ]
        wishes += [(condition, True, _AWAITED) for condition in self._orders.shown]
        mask = fixed = 0
        for shift, word in self._measured_words():
            mask, fixed = mask | 0xFFFF << shift, fixed | word << shift
        codes = drive.codes
        if codes is not None and codes.in_status:
            mask, fixed = mask | codes.mask, fixed | self.fault_number() << codes.shift
        return compose(tuple(wishes), mask, fixed)

    def fault_number(self) -> int:
        """Return what the register of the fault has."""
        codes, fault = self._drive.codes, self.faults.shown
        assert codes is not None
        if not self.faults:
            return codes.none
        return _UNNAMED if fault in self._flags else drive_number(fault)

    def _measured_words(self) -> Iterator[tuple[int, int]]:
        """Yield the words of frequency and speed that stand in the status, and at which bit."""
        status = self._drive.status
        for role in (Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED):
            key = self._drive.roles.get(role, '')
            raw = self.show(key) if key and not status.coils else None
            if raw is None:
                continue
            address = self._drive.parameters[key].at('modbus')
            words = to_words(address.number.encode(raw))
            for register, word in enumerate(words, address.index):
                if register in status.registers:
                    yield status.shift(register), word

    @property
    def _flags(self) -> list[int]:
        return [fault.code for _, fault in self._drive.flags]

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """Let a fault happen, or a warning (ValueError: the drive cannot show it)."""
        if self.memory.model.status_code(code).kind is Kind.FAULT and not self._can_show(code):
            listed = (*self._drive.faults, *self._flags)
            known = ', '.join(str(drive_number(fault)) for fault in listed)
            raise ValueError(f'its status cannot show fault {code}: its file has {known}')
        super().trip(code, cause_present=cause_present)

    def _can_show(self, code: int) -> bool:
        codes = self._drive.codes
        if code in self._flags or (codes is None and not self._flags):
            return True
        number = drive_number(code)
        return codes is not None and number != codes.none and number <= codes.mask >> codes.shift

    def _truths(self) -> dict[str, bool]:
        motor, fault = self.motor, bool(self.faults)
        commanded = self._runs or 'stopping' not in self._drive.facts
        return {
            'fault': fault,
            'running': motor.driven and commanded,
            'stopping': motor.driven and not self._runs,
            'quick_stop': motor.driven and self._quick and not self._runs,
            'ready': not fault and self.run_input,
            'reverse': motor.ramp < 0 or (motor.ramp == 0 and self._reverse and motor.driven),
            'at_setpoint': motor.driven and motor.reached,
            'alarm': bool(self.faults.alarms),
            'remote': self.obeys,
            'local': not self.obeys,
            'inhibited': fault or not self.run_input,
            'enable_missing': not self.run_input,
            'sleeping': False,
        }

    # ---- what it does ----

    def settle(self) -> None:
        """Run the motor, ramp it to a stop, or let it go."""
        motor = self.motor
        if self.faults:
            if self._runs and self.variant.run_command_in_fault != 'keeps':
                self._drop_run()
            motor.release()
            return
        self._set_ramps()
        if self._runs and self.run_input and self.obeys:
            motor.energise()
            motor.demand = self._demand
        elif motor.driven:
            motor.demand = 0.0
            stopped = motor.at_zero and self._braked_for >= self._braking
            if self._coasts or not self.run_input or stopped:
                motor.release()

    def _drop_run(self) -> None:
        """Take the run command away; one that is repeated is a new one then."""
        self._run = False
        self._newest.clear()
        if self._drive.run_by:
            self.memory.put(self._drive.setpoint.key, 0)

    @property
    def _runs(self) -> bool:
        """The motor is commanded to run; by terminals, as long as their input is closed."""
        if self._drive.run_by == 'setpoint':
            return self.memory.number(self._drive.setpoint.key) != 0
        return self._run or self._drive.run_by == 'terminals'

    @property
    def _braking(self) -> float:
        """How long a motor that has stopped is braked by direct current (s)."""
        return self.memory.number(self.memory.model.roles.get(Role.STOP_BRAKING, ''), 0.0)

    @property
    def _demand(self) -> float:
        """The frequency of the set-point (Hz), no greater than the drive allows."""
        place = self._drive.setpoint
        value = self.memory.number(place.key) * self.scale(place.key)
        most = self.memory.number(place.limit, place.most) if place.limit else place.most
        value = max(-most, min(most, value))
        if place.mode == 'Speed':
            value = value * self.motor.plate.pole_pairs / 60
        value = -abs(value) if self._reverse and place.direction is not None else value
        return -value if self._turned_round else value

    def _set_ramps(self) -> None:
        number, ramps, motor = self.memory.number, self._drive.simulated, self.motor
        motor.accel = max(_QUICKEST, number(ramps.accel) if ramps.accel else _RAMP)
        motor.retard = max(_QUICKEST, number(ramps.decel) if ramps.decel else _RAMP)
        if self._quick and not self._runs:
            motor.retard = max(_QUICKEST, motor.retard * _QUICKER)

    @property
    def settled(self) -> bool:
        """Nothing is left to do: no ramp to a stop ends, and no time-out runs."""
        return not self._time_out and (self._runs or not self.motor.driven)

    def restart(self) -> None:
        """Forget commands and set-point, unless the file says that the drive keeps them."""
        if self._drive.keeps_run:
            return
        self._words.clear()
        self._newest.clear()
        self._orders = Orders(self._drive)
        self._run = self._reverse = self._coasts = self._quick = self._turned_round = False
        self.memory.put(self._drive.setpoint.key, 0)

    # ---- the line ----

    @property
    def _time_out(self) -> float:
        """After how long a silence something happens (s); 0: nothing."""
        timeout = self._drive.timeout
        if timeout is None:
            return 0.0
        acts = all(self.memory.get(key) in stops for key, stops in timeout.conditions.items())
        return self.memory.number(timeout.key) if acts else 0.0

    def wait(self, dt: float) -> None:
        """Count how long the motor is braked, and the line is silent: too long, and it stops."""
        brakes = self.motor.driven and self.motor.at_zero and not self._runs
        self._braked_for = self._braked_for + dt if brakes else 0.0
        self._silent_for += dt
        if self._time_out and self._silent_for > self._time_out and (self._runs or self.faults):
            self._silent_for = 0.0
            self._drop_run()
            lost = [fault.code for fault in self._drive.faults.values() if fault.line]
            if lost and not self.faults:
                self.trip(lost[0])
            self.settle()

    def note_frame(self) -> None:
        """Begin to count anew."""
        self._silent_for = 0.0

    def validate(self, key: str) -> None:
        """Refuse the set-point where the line has no control."""
        refuses = self.variant.in_local == 'refuses' and not self.obeys
        if key == self._drive.setpoint.key and refuses:
            raise Refused(Reason.STATE, 'the line has no control')

    def nameplate(self) -> Nameplate:
        """Return the motor's data, as far as parameters report it."""
        get, roles = self.memory.number, self.memory.model.roles
        usual = Nameplate()
        if self._drive.pole_pairs:
            usual = replace(usual, speed=usual.speed * usual.pole_pairs / self._drive.pole_pairs)
        frequency = get(roles.get(Role.NOMINAL_FREQUENCY, ''), usual.frequency) or usual.frequency
        speed = get(roles.get(Role.NOMINAL_SPEED, ''), 0.0) or usual.speed * frequency / 50
        return Nameplate(frequency=frequency, speed=speed)

    def report(self) -> dict[str, Any]:
        """Return what it shows."""
        return {
            'run_command': self._runs,
            'obeys': self.obeys,
            'status_word': self.status_word,
            'fault_kind': (Kind.FAULT if self.faults else Kind.STATUS).value,
        }
