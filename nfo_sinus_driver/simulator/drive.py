# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A whole drive made of software: parameters, commands, motor, faults, power and time.

What a family does its own way is behind :class:`ControlUnit`. It knows parameters by catalog key
and raw numbers, and time only as it is given; which protocol asks is not its business.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

from nfo_sinus_driver.catalog import Access, Family, Parameter, Value
from nfo_sinus_driver.simulator.control_unit import ControlUnit
from nfo_sinus_driver.simulator.memory import Memory, Reason, Refused, carried, home, kept
from nfo_sinus_driver.simulator.motor import measure
from nfo_sinus_driver.simulator.timing import Timing

#: The characters of a serial number [M0 §6.2.4].
SERIAL_LENGTH = 16
#: The longest step of model time (s) while something moves, and while nothing does.
_STEP = 0.005
_IDLE_STEP = 0.1


class SimulatedDrive:
    """
    One simulated drive.

    :param model: the drive family, as the tables have it.
    :param control_unit: what it does its family's way.
    :param servers: what makes those that answer its requests, by the protocols of the tables.
    :param run_input: whether the digital input RUN is active.
    :param boot_time: how long it is silent after the mains come back (s).
    :param serial_number: at most 16 characters; by default one for each address.
    :raises ValueError: the serial number is none.

    :ivar settings: the keys of the parameters that live in EEPROM: no set-points, no commands.
    :ivar step: the longest step of model time while something moves (s).
    :ivar time: model time since the start (s).
    :ivar boots: how often it has come up after power-on.
    :ivar writes: how often the bus wrote each parameter that lives in EEPROM, by key.
    :ivar command_writes: how often it wrote each set-point or command, by key.
    """

    def __init__(
        self,
        model: Family,
        control_unit: ControlUnit,
        servers: Mapping[str, Callable[[SimulatedDrive], object]],
        *,
        run_input: bool = True,
        boot_time: float = 2.0,
        serial_number: str | None = None,
    ) -> None:
        self.model = model
        self.control_unit = control_unit
        self.memory = control_unit.memory
        self.faults = control_unit.faults
        self.motor = control_unit.motor
        self.counters = control_unit.counters
        self.serial_number = _serial_number(serial_number, control_unit.address)
        self.boot_time = boot_time
        self.settings = frozenset(
            key for key, parameter in self.memory.model.items() if parameter.is_setting
        )
        self.writes: Counter[str] = Counter()
        self.command_writes: Counter[str] = Counter()
        self.step = _STEP
        self.time = 0.0
        self.boots = 0
        self._origin: float | None = None
        self._boot_left = 0.0
        self._silent_left = 0.0
        self.servers = {protocol: make(self) for protocol, make in servers.items()}
        control_unit.run_input = run_input
        self._booted()

    # ---- time ----

    def advance(self, dt: float) -> None:
        """Let ``dt`` seconds of model time pass."""
        while dt > 1e-9:
            resting = self._resting
            step = min(dt, _IDLE_STEP if resting else self.step)
            self._pass(step, resting)
            dt -= step

    def advance_to(self, now: float) -> None:
        """Catch up with the caller's clock (s); the first call only sets the clock."""
        if self._origin is None:
            self._origin = now - self.time
        self.advance(now - self._origin - self.time)

    # ---- the bus ----

    @property
    def listening(self) -> bool:
        """Whether it hears the line and answers: not while it boots or is held silent."""
        return self._boot_left <= 0 and self._silent_left <= 0

    @property
    def response_time(self) -> float:
        """How long it waits before it answers (s)."""
        return self.control_unit.response_time

    def hears(self, protocol: str, timing: Timing) -> bool:
        """Whether it is set to this protocol, speed and format."""
        return self.control_unit.hears(protocol, timing)

    def note_frame(self) -> None:
        """Record that a valid frame addressed to this drive arrived."""
        self.control_unit.note_frame()

    def read_raw(self, key: str) -> int:
        """Read a parameter as the bus does, a number of the memory, side effects included."""
        if self.memory.model[key].access is Access.WRITE:
            raise Refused(Reason.ADDRESS, f'{key} cannot be read')
        raw = self.control_unit.read(key)
        return self._peek(key) if raw is None else raw

    def write_raw(self, key: str, raw: int) -> None:
        """Write a parameter as the bus does, a number of the memory, or be refused."""
        key = self.control_unit.key_of(key)
        parameter = self.memory.model[key]
        if not parameter.is_writable:
            raise Refused(Reason.ADDRESS, f'{key} cannot be written')
        Memory.check(self.control_unit.scaled(parameter), raw)
        if not self.control_unit.write(key, raw):
            self.control_unit.validate(key)
            if parameter.stopped and (self.motor.driven or self.motor.turning):
                raise Refused(Reason.STATE, f'{key} changes only while the motor stands')
            self._store(key, raw)
        counter = self.writes if key in self.settings else self.command_writes
        counter[key] += 1
        self.control_unit.settle()

    def read_over(self, protocol: str, parameter: Parameter) -> int:
        """Read a parameter; return the number that a protocol carries, the nearest it can."""
        return carried(parameter, self.read_raw(parameter.key), protocol)

    def write_over(self, protocol: str, parameter: Parameter, raw: int) -> None:
        """Write a parameter by the number that a protocol carries, or be refused."""
        self.write_raw(parameter.key, kept(parameter, raw, protocol))
        self.control_unit.written(parameter.key, protocol)

    # ---- what happens to it ----

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """
        Let a fault happen: the motor coasts, and it wants acknowledging.

        :param cause_present: the cause lasts, so that it cannot be acknowledged yet.
        """
        self.control_unit.trip(code, cause_present=cause_present)
        self.control_unit.settle()

    def set_run_input(self, active: bool) -> None:
        """Switch the digital input RUN."""
        self.control_unit.run_input = active
        self.control_unit.settle()

    def set_from_keypad(self, key: str, value: Value) -> None:
        """Change a parameter at the keypad, in engineering units, or a ValueError."""
        if key not in self.settings and key not in self.control_unit.setpoints:
            raise ValueError(f'{key} cannot be changed at the keypad')
        self.memory.set(key, value)
        self._store(key, self.memory.raw(key))
        self.control_unit.settle()

    def factory_reset(self) -> None:
        """Give the parameters their factory values, but those of the line, so that it answers."""
        for key in self.settings - self.control_unit.line_settings:
            self._store(key, self.memory.factory_raw(key))
        self.control_unit.settle()

    def power_cycle(self, boot_time: float | None = None) -> None:
        """Take the mains away and give them back: silent for the boot time (s), then anew."""
        self._boot_left = self.boot_time if boot_time is None else boot_time
        self.motor.release(at_once=True)
        self.motor.dc_link = 0.0
        self.control_unit.restart()
        if self._boot_left <= 0:
            self._booted()

    def silence(self, seconds: float) -> None:
        """Neither hear nor answer for a while, as with a loose connector; the motor runs on."""
        self._silent_left = seconds

    # ---- what it shows ----

    @property
    def address(self) -> int:
        """The address that is in effect."""
        return self.control_unit.address

    @property
    def version(self) -> Fraction | None:
        """The version of its firmware; ``None`` of a drive that does not report it."""
        return self.memory.version

    def has(self, parameter: Parameter) -> bool:
        """Whether its firmware has a parameter of the family."""
        if parameter.since is None:
            return True
        version = self.version
        return version is None or version >= parameter.since

    def peek(self, key: str) -> Value:
        """Return a parameter in engineering units, without side effects."""
        return self.memory.shown(key, self._peek(key))

    # ---- inside ----

    def _peek(self, key: str) -> int:
        """Read a parameter without side effects."""
        shown = self.control_unit.show(key)
        if shown is None:
            parameter, role = self.memory.model[key], self.model.role_of.get(key)
            shown = measure(role, parameter, home(parameter), self.motor, self.counters)
        return self.memory.raw(key) if shown is None else shown

    def _store(self, key: str, raw: int) -> None:
        self.memory.put(key, raw)
        self.control_unit.stored(key)

    def _booted(self) -> None:
        self._boot_left = 0.0
        self.boots += 1
        self.control_unit.boot()
        self.note_frame()
        self.control_unit.settle()

    @property
    def _resting(self) -> bool:
        waits = self._boot_left > 0 or self._silent_left > 0
        return not waits and self.motor.settled and self.control_unit.settled

    def _pass(self, dt: float, resting: bool) -> None:
        self.time += dt
        self._silent_left = max(0.0, self._silent_left - dt)
        if self._boot_left > 0:
            self.motor.advance(dt)
            self._boot_left -= dt
            if self._boot_left <= 1e-9:
                self._booted()
            return
        self.control_unit.wait(dt)
        self.motor.advance(dt)
        self.counters.advance(dt, self.motor)
        if not resting:
            self.control_unit.settle()


def _serial_number(text: str | None, address: int) -> str:
    """Return the characters of a serial number; by default one for each address."""
    if text is None:
        text = f'{26_0117_0000_0000 + address:0{SERIAL_LENGTH}d}'
    if len(text) > SERIAL_LENGTH or not (text.isascii() and text.isprintable()):
        raise ValueError(f'serial number {text!r}: at most {SERIAL_LENGTH} characters of ASCII')
    return text.ljust(SERIAL_LENGTH)


def describe(drive: SimulatedDrive) -> dict[str, Any]:
    """Return everything about a drive, in engineering units; it can be written as JSON."""
    motor = drive.motor
    return {
        'address': drive.address,
        'model': drive.model.name,
        'serial_number': drive.serial_number,
        'time': drive.time,
        'silent': not drive.listening,
        'run_input': drive.control_unit.run_input,
        **drive.control_unit.report(),
        'fault': next(iter(drive.faults.codes), 0),
        'faults': drive.faults.codes,
        'alarms': drive.faults.alarms,
        'frequency': motor.frequency,
        'speed': motor.speed,
        'rotor_speed': motor.rotor_speed,
        'turning': motor.turning,
        'driven': motor.driven,
        'current': motor.current,
        'torque': 100 * motor.torque,
        'dc_link': motor.dc_link,
        'writes': dict(drive.writes),
        'command_writes': dict(drive.command_writes),
        'error_log': [[entry.code, entry.op_time] for entry in drive.faults.log],
        'parameters': {
            key: drive.peek(key)
            for key, parameter in drive.memory.model.items()
            if parameter.is_readable
        },
    }
