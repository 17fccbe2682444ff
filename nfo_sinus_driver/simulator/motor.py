# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
An induction motor, its load, the power stage in front of it and what is measured, in virtual time.

Good enough to look right on a plot and to make a driver's mistakes show: frequency ramps,
slip that grows with the load, a rotor that has inertia and coasts when it is released. All
frequencies are electrical (Hz), signed, negative in reverse; torque is relative to the nominal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import enum
import functools
import math

from nfo_sinus_driver.catalog import Parameter, Role

#: How long the rotor takes from standstill to f-Nom at nominal torque, without load (s).
_INERTIA = 0.5
#: How fast a released rotor slows down: time constant (s), and what friction adds (Hz/s).
_COAST_TIME = 2.5
_FRICTION = 1.0
#: How long the voltage stays on the motor after the power stage let go (s).
_DEMAGNETISING = 0.02
#: DC link of a drive at 400 V mains (V), and the voltage at which the brake chopper works.
_DC_LINK = 565.0
_DC_CHOPPER = 760.0
_DC_TIME = 0.1
#: Thermal time constant of the motor (s).
_THERMAL_TIME = 600.0
#: Below this the rotor stands (Hz).
_STANDSTILL = 0.01


class Regulation(enum.Enum):
    """What the power stage holds at the demanded value."""

    #: The stator frequency; the rotor lags by the slip.
    FREQUENCY = 'frequency'
    #: The rotor's speed; the slip is made up for.
    SPEED = 'speed'
    #: The torque; the speed is what comes of it.
    TORQUE = 'torque'


@dataclass(frozen=True)
class Nameplate:
    """The motor's data: W, V, Hz, rpm, A and Ω, as in the parameter group Motor [M0 table 4]."""

    power: float = 1500.0
    voltage: float = 400.0
    frequency: float = 50.0
    speed: float = 1440.0
    current: float = 3.4
    magnetising: float = 1.8
    limit: float = 5.1
    resistance: float = 4.2

    @functools.cached_property
    def pole_pairs(self) -> int:
        """How many turns of the field make one turn of the shaft."""
        return max(1, round(60 * self.frequency / self.speed))

    @functools.cached_property
    def slip(self) -> float:
        """The slip at nominal torque (Hz); never quite zero, whatever the nameplate says."""
        slip = self.frequency - self.speed * self.pole_pairs / 60
        return max(slip, 0.005 * self.frequency)

    @functools.cached_property
    def active(self) -> float:
        """The current that makes the nominal torque (A)."""
        return math.sqrt(max(self.current**2 - self.magnetising**2, 0.01 * self.current**2))

    @functools.cached_property
    def torque_limit(self) -> float:
        """The greatest torque that the current limit lets through, relative to the nominal."""
        return math.sqrt(max(self.limit**2 - self.magnetising**2, 0.0)) / self.active


class Motor:
    """
    The motor with its load, fed by a power stage that ramps.

    The owner sets :attr:`demand` and the ramp times, calls :meth:`energise` or :meth:`release`,
    and lets time pass with :meth:`advance`.

    :ivar demand: the frequency to ramp to (Hz), or the torque (relative) under TORQUE.
    :ivar accel: time from 0 to f-Nom (s).
    :ivar retard: time from f-Nom to 0 (s).
    :ivar load: the load's torque at nominal speed, relative to the nominal torque.
    :ivar ramp: output of the ramp generator (Hz).
    :ivar rotor: the rotor's speed (Hz, electrical).
    :ivar driven: the power stage works on the motor.
    :ivar limited: the current limit holds the motor back.
    :ivar chopper: the brake chopper works.
    """

    def __init__(self, plate: Nameplate) -> None:
        self.plate = plate
        self.demand = 0.0
        self.accel = 5.0
        self.retard = 5.0
        self.regulation = Regulation.FREQUENCY
        self.load = 0.3
        self.ramp = 0.0
        self.rotor = 0.0
        self.torque = 0.0
        self.dc_link = _DC_LINK
        self.temperature = 0.0
        self.driven = False
        self.limited = False
        self.chopper = False
        self._stator = 0.0
        self._torque_trend = 0
        self._voltage_left = 0.0
        self._phase = 0.0

    def energise(self) -> None:
        """Switch the power stage on; a rotor that still turns is caught, not jerked."""
        if not self.driven:
            self.driven = True
            self.ramp = self._stator = self.rotor if self.turning else 0.0

    def release(self, *, at_once: bool = False) -> None:
        """Switch the power stage off; ``at_once`` as when the mains are gone."""
        if self.driven:
            self._voltage_left = _DEMAGNETISING
        if at_once:
            self._voltage_left = 0.0
        self.driven = False
        self.limited = self.chopper = False
        self.ramp = self.torque = self._stator = 0.0

    @property
    def voltage_on(self) -> bool:
        """Whether there is voltage on the motor; it outlives :attr:`driven` by a moment."""
        return self.driven or self._voltage_left > 0

    @property
    def turning(self) -> bool:
        """Whether the rotor moves, by more than half a turn a minute."""
        return abs(self.rotor_speed) > 0.5

    @property
    def at_zero(self) -> bool:
        """Whether a braked motor has arrived at zero rpm."""
        return abs(self.ramp) < _STANDSTILL and not self.turning

    @property
    def trend(self) -> int:
        """1 while the speed rises towards the demand, -1 while it falls, 0 when it is there."""
        if not self.driven:
            return 0
        if self.regulation is Regulation.TORQUE:
            return self._torque_trend
        if abs(self.ramp - self.demand) < 1e-6:
            return 0
        falls = self.demand * self.ramp < 0 or abs(self.demand) < abs(self.ramp)
        return -1 if falls else 1

    @property
    def reached(self) -> bool:
        """Whether what is regulated is as demanded."""
        if self.regulation is Regulation.TORQUE:
            return self.driven and not self.limited and self.torque == self.demand
        return self.driven and self.trend == 0

    @property
    def settled(self) -> bool:
        """Whether nothing will change soon, so that time may pass in longer steps."""
        if not self.driven:
            return self.rotor == 0 and not self.voltage_on
        if self.regulation is Regulation.TORQUE or self.limited or self.ramp != self.demand:
            return False
        goal = self._stator - self.plate.slip * self._load_torque()
        return abs(goal - self.rotor) < 1e-4

    @property
    def rotor_speed(self) -> float:
        """What a tachometer on the shaft would show (rpm)."""
        return 60 * self.rotor / self.plate.pole_pairs

    @property
    def frequency(self) -> float:
        """The output frequency (Hz); 0 when the power stage is off."""
        return self._stator if self.driven else 0.0

    @property
    def speed(self) -> float:
        """The drive's estimate of the speed (rpm): without an encoder, 0 while it coasts."""
        return self.rotor_speed if self.driven else 0.0

    @property
    def current(self) -> float:
        """The output current (A, RMS)."""
        if not self.driven:
            return 0.0
        weakening = max(1.0, abs(self._stator) / self.plate.frequency)
        return math.hypot(self.plate.magnetising / weakening, self.torque * self.plate.active)

    @property
    def voltage(self) -> float:
        """The output voltage (V, RMS): V/f up to U-Nom, with some boost at the bottom."""
        if not self.driven:
            return 0.0
        share = abs(self._stator) / self.plate.frequency
        drop = math.sqrt(3) * self.plate.resistance * self.current
        return min(self.plate.voltage, max(drop, self.plate.voltage * share))

    @property
    def power(self) -> float:
        """The output active power (W); negative while the motor feeds back."""
        if not self.driven:
            return 0.0
        plate, current = self.plate, self.current
        nominal = plate.power * self._stator * 60 / (plate.speed * plate.pole_pairs)
        apparent = math.sqrt(3) * self.voltage * current
        power = self.torque * nominal + 3 * plate.resistance * current**2
        return min(max(power, -apparent), apparent)

    @property
    def power_factor(self) -> float:
        """The output power factor, signed like the power."""
        apparent = math.sqrt(3) * self.voltage * self.current
        return self.power / apparent if apparent > 0 else 0.0

    def advance(self, dt: float) -> None:
        """Let ``dt`` seconds pass; a few milliseconds at a time unless :attr:`settled`."""
        if self.driven:
            if self.regulation is Regulation.TORQUE:
                self._hold_torque(dt)
            else:
                self._follow_ramp(dt)
        else:
            self._coast(dt)
        self._warm(dt)

    def _follow_ramp(self, dt: float) -> None:
        plate = self.plate
        self.ramp = self._ramped(dt)
        load = self._load_torque()
        boost = plate.slip * load if self.regulation is Regulation.SPEED else 0.0
        self._stator = self.ramp + boost
        goal = self._stator - plate.slip * load
        lag = _INERTIA * plate.slip / plate.frequency
        free = self.rotor + (goal - self.rotor) * -math.expm1(-dt / lag)
        wanted = load + (free - self.rotor) / dt * _INERTIA / plate.frequency
        limit = plate.torque_limit
        self.torque = min(max(wanted, -limit), limit)
        self.limited = abs(wanted) > limit
        moved = free
        if self.limited:
            moved = self.rotor + (self.torque - load) * plate.frequency / _INERTIA * dt
        if moved * self.rotor < 0 and self.rotor * self._stator > 0:
            moved = 0.0  # a load only brakes, it never turns the rotor backwards
        self.rotor = moved
        if self.limited:
            # the ramp waits for the rotor
            self._stator = self.rotor + plate.slip * self.torque
            self.ramp = self._stator - boost

    def _hold_torque(self, dt: float) -> None:
        plate = self.plate
        limit = plate.torque_limit
        load = self._load_torque()
        self.torque = min(max(self.demand, -limit), limit)
        self.limited = abs(self.demand) > limit
        moved = self.rotor + (self.torque - load) * plate.frequency / _INERTIA * dt
        if abs(self.torque) <= 0.2 * self.load and moved * self.rotor <= 0:
            moved = 0.0  # friction alone holds it
        if abs(moved) > plate.frequency:
            moved = math.copysign(plate.frequency, moved)
            self.torque = load
        change = abs(moved) - abs(self.rotor)
        self._torque_trend = 0 if abs(change) < 0.1 * dt else 1 if change > 0 else -1
        self.rotor = moved
        self._stator = self.ramp = moved + plate.slip * self.torque

    def _ramped(self, dt: float) -> float:
        """Where the ramp generator is after ``dt``: Retard towards zero, Accel away from it."""
        ramp, goal, left = self.ramp, self.demand, dt
        if ramp and (goal * ramp < 0 or abs(goal) < abs(ramp)):
            turn = goal if goal * ramp > 0 else 0.0
            rate = self.plate.frequency / self.retard
            needed = abs(ramp - turn) / rate
            if needed > left:
                return ramp - math.copysign(rate * left, ramp)
            ramp, left = turn, left - needed
        rate = self.plate.frequency / self.accel
        if abs(goal - ramp) <= rate * left:
            return goal
        return ramp + math.copysign(rate * left, goal - ramp)

    def _load_torque(self) -> float:
        """A conveyor: some friction, and more with speed; against the motion."""
        share = self.rotor / (self.plate.frequency - self.plate.slip)
        return self.load * (0.2 * min(max(100 * share, -1.0), 1.0) + 0.8 * share)

    def _coast(self, dt: float) -> None:
        self._voltage_left = max(0.0, self._voltage_left - dt)
        slowed = abs(self.rotor) * math.exp(-dt / _COAST_TIME) - _FRICTION * dt
        self.rotor = math.copysign(slowed, self.rotor) if slowed > _STANDSTILL else 0.0

    def _warm(self, dt: float) -> None:
        power = self.power / self.plate.power
        goal = _DC_LINK - 8 * power if power >= 0 else _DC_LINK - 600 * power
        self.chopper = self.driven and self.dc_link > _DC_CHOPPER
        if self.chopper:
            goal = min(goal, _DC_CHOPPER - 20)
        self._phase = (self._phase + 40 * dt) % math.tau
        ripple = 2.5 * math.sin(self._phase) if self.driven else 0.3 * math.sin(self._phase)
        self.dc_link += (goal + ripple - self.dc_link) * -math.expm1(-dt / _DC_TIME)
        heat = 100 * (self.current / self.plate.current) ** 2
        self.temperature += (heat - self.temperature) * -math.expm1(-dt / _THERMAL_TIME)


_HOUR = 3600.0


@dataclass
class Counters:
    """
    The counters of a drive that has worked for a while; a power cycle does not reset them.

    :ivar operating_time: hours live.
    :ivar running_time: hours running.
    :ivar brake_time: seconds with the brake chopper on.
    :ivar energy: since the last reset (kWh).
    :ivar total_energy: altogether (kWh).
    """

    operating_time: float = 1234.5
    running_time: float = 321.0
    brake_time: float = 12.0
    energy: float = 1.234
    total_energy: float = 1520.0

    def advance(self, dt: float, motor: Motor) -> None:
        """Count ``dt`` seconds of what the motor does."""
        self.operating_time += dt / _HOUR
        if motor.driven:
            self.running_time += dt / _HOUR
            energy = max(motor.power, 0.0) / 1000 * dt / _HOUR
            self.energy += energy
            self.total_energy += energy
        if motor.chopper:
            self.brake_time += dt

    def carry(self, role: Role | None, factor: float) -> bool:
        """Let a counter go on to where its low word, so much a count, begins anew; else false."""
        if role is None or role.value not in self.__dict__:
            return False
        high = round(getattr(self, role.value) / factor) >> 16
        setattr(self, role.value, (high + 1 << 16) * factor)
        return True


def _process(motor: Motor) -> float:
    """The process that a regulator holds: 100 units at nominal speed, at once."""
    return 100 * abs(motor.frequency) / motor.plate.frequency


#: In engineering units, by what it is to the driver.
_MEASURED: Mapping[Role, Callable[[Motor, Counters], float]] = {
    Role.OUTPUT_VOLTAGE: lambda motor, _: motor.voltage,
    Role.OUTPUT_CURRENT: lambda motor, _: motor.current,
    Role.OUTPUT_POWER: lambda motor, _: motor.power,
    Role.POWER_FACTOR: lambda motor, _: motor.power_factor,
    Role.DC_LINK_VOLTAGE: lambda motor, _: motor.dc_link,
    Role.ACTUAL_FREQUENCY: lambda motor, _: motor.frequency,
    Role.ACTUAL_SPEED: lambda motor, _: motor.speed,
    Role.ACTUAL_TORQUE: lambda motor, _: 100 * motor.torque,
    Role.ACTUAL_PROCESS_VALUE: lambda motor, _: _process(motor),
    Role.PT1000_TEMPERATURE: lambda motor, _: 25 + 0.6 * motor.temperature,
    Role.MOTOR_TEMPERATURE: lambda motor, _: motor.temperature,
    Role.OPERATING_TIME: lambda _, counters: counters.operating_time,
    Role.RUNNING_TIME: lambda _, counters: counters.running_time,
    Role.BRAKE_TIME: lambda _, counters: counters.brake_time,
    Role.ENERGY: lambda _, counters: counters.energy,
    Role.TOTAL_ENERGY: lambda _, counters: counters.total_energy,
}


def measured(role: Role, motor: Motor, counters: Counters) -> float:
    """Return what is measured, in engineering units."""
    return _MEASURED[role](motor, counters)


def measure(
    role: Role | None, parameter: Parameter, protocol: str, motor: Motor, counters: Counters
) -> int | None:
    """Return what ``protocol`` carries of a measured parameter; ``None`` for a stored one."""
    function = _MEASURED.get(role) if role else None
    if function is None:
        return None
    return nearest(parameter, function(motor, counters), protocol)


def nearest(parameter: Parameter, value: float, protocol: str) -> int:
    """Return the number that ``protocol`` carries for a value, the nearest it can."""
    raw = round(value / float(parameter.factor(protocol)))
    codec = parameter.at(protocol).number
    return min(max(raw, codec.minimum), codec.maximum)
