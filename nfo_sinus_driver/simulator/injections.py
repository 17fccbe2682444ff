# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What can be made to happen to a running simulator, by ``simulator inject`` and by tests.

Each public method of :class:`Injections` is one injection. Its name, its type hints and its
docstring are the command line and the control channel. A family may have more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
import difflib
import inspect
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from nfo_sinus_driver.catalog import Family, Value
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.plc import Channel, Plc
from nfo_sinus_driver.simulator.wire import Wire

Seconds = Annotated[float, 'for how many seconds']
Switch = Annotated[Literal['on', 'off'], 'on or off']
Times = Annotated[int, 'how many answers']
#: One of the faults of the next answers.
What = Annotated[Literal['noise', 'damage', 'delay', 'drop', 'double'], 'what happens to them']


class Injections:
    """
    What can be made to happen to a drive of any family, and to its line.

    :param address: the drive; ``None``: the only one, or, for what happens to answers, any.
    :param now: the time (s).
    """

    def __init__(
        self,
        line: Wire,
        drives: Mapping[int, SimulatedDrive],
        plc: Plc | None,
        address: int | None,
        now: float,
    ) -> None:
        self._line = line
        self._drives = drives
        self._plc = plc
        self._address = address
        self._now = now

    # ---- to a drive ----

    def fault(
        self,
        code: Annotated[int, 'status code of the fault, such as 5'],
        standing: Annotated[bool, 'its cause lasts until ack-cause-gone'] = False,
    ) -> None:
        """Let a fault happen: the motor coasts until it is acknowledged."""
        self._drive.trip(code, cause_present=standing)

    def ack_cause_gone(self) -> None:
        """Take away the causes of all faults, so that they can be acknowledged."""
        self._drive.faults.end_causes()

    def run(self, state: Switch) -> None:
        """Switch the digital input RUN."""
        self._drive.set_run_input(state == 'on')

    def set(
        self,
        key: Annotated[str, 'its name, as in the table of parameters'],
        value: Annotated[Value, 'in its own unit, such as 7'],
    ) -> None:
        """Change a parameter at the keypad."""
        drive = self._drive
        drive.set_from_keypad(key, parse_setting(drive.memory.model, key, value))

    def factory_reset(self) -> None:
        """Give the parameters their factory values, but those of the line."""
        self._drive.factory_reset()

    def load(
        self, share: Annotated[float, 'torque at nominal speed, 1 is the nominal torque']
    ) -> None:
        """Change the load of the motor."""
        self._drive.motor.load = share

    def power_cycle(
        self,
        seconds: Annotated[
            float | None, 'how long it is silent (default: its boot time, 2 s)'
        ] = None,
    ) -> None:
        """Take the mains away and give them back."""
        self._drive.power_cycle(seconds)

    def silence(self, seconds: Seconds) -> None:
        """Let the drive neither hear nor answer."""
        self._drive.silence(seconds)

    # ---- to the line ----

    def line_dead(self, seconds: Seconds) -> None:
        """Let the line carry nothing, either way."""
        self._line.faults.dead_until = self._now + seconds

    def hangup(self, seconds: Seconds = 1.0) -> None:
        """Let the port disappear and come back, like a USB adapter that is pulled out."""
        self._line.hang_up(self._now + seconds)

    def noise(self, times: Times = 1) -> None:
        """Put noise before the next answers."""
        self._line.faults.add('noise', times, self._address)

    def damage(self, times: Times = 1) -> None:
        """Flip a bit in the next answers."""
        self._line.faults.add('damage', times, self._address)

    def delay(self, times: Times = 1, seconds: Annotated[float, 'how late'] = 0.5) -> None:
        """Send the next answers late."""
        self._line.faults.add('delay', times, self._address, seconds)

    def drop(self, times: Times = 1) -> None:
        """Lose the next answers; the requests are carried out."""
        self._line.faults.add('drop', times, self._address)

    def double(self, times: Times = 1) -> None:
        """Send the next answers twice."""
        self._line.faults.add('double', times, self._address)

    def noise_rate(
        self,
        what: What,
        share: Annotated[float, 'of all answers, such as 0.03; 0 ends it'],
        seed: Annotated[int | None, 'a number, for the same answers in every run'] = None,
        seconds: Annotated[float, 'how late they come, for delay'] = 0.5,
    ) -> None:
        """Spoil a share of all answers by chance, until heal."""
        self._line.faults.set_rate(what, share, seed, seconds)

    def burst(
        self,
        seconds: Annotated[float, 'how long; 0 ends it'],
        period: Annotated[float, 'from one to the next (s)'] = 5.0,
    ) -> None:
        """Let the line carry nothing for a while again and again, until heal."""
        self._line.faults.set_bursts(seconds, period, self._now)

    def traffic(
        self, rate: Annotated[float, 'how many a second, such as 1000; 0 ends it']
    ) -> None:
        """On a CAN bus: let others send frames that no node here takes."""
        self._line.set_traffic(rate, self._now)

    def heal(self) -> None:
        """End all faults of the line."""
        self._line.faults.heal()

    # ---- to a PLC, and the fieldbus behind it ----

    def fieldbus_cut(self, seconds: Seconds) -> None:
        """Let no telegram pass between the PLC and the drive."""
        self._channel.cut_until = self._now + seconds

    def plc_restart(self, seconds: Seconds) -> None:
        """Let the PLC be off, and begin anew with its registers 0."""
        self._the_plc.restart(self._now + seconds)

    def plc_stop(self, seconds: Seconds) -> None:
        """Let the PLC's program and fieldbus stand; its registers are still answered."""
        self._the_plc.stopped_until = self._now + seconds

    def release(self, state: Switch) -> None:
        """Let the PLC release the drive to ROS, or not."""
        self._channel.released = state == 'on'

    # ---- what they work on ----

    @property
    def _drive(self) -> SimulatedDrive:
        return the_drive(self._drives, self._address)

    @property
    def _the_plc(self) -> Plc:
        if self._plc is None:
            raise ValueError('there is no PLC: it is there with --protocol telegram1')
        return self._plc

    @property
    def _channel(self) -> Channel:
        plc, drive = self._the_plc, self._drive
        return next(one for one in plc.channels.values() if one.drive is drive)


def the_drive(drives: Mapping[int, SimulatedDrive], address: int | None) -> SimulatedDrive:
    """Return the drive at an address, without one the only one (ValueError: which?)."""
    known = ', '.join(map(str, drives))
    if address is None:
        if len(drives) > 1:
            raise ValueError(f'say which drive, with --address: {known}')
        return next(iter(drives.values()))
    if address not in drives:
        raise ValueError(f'no drive has address {address}, only {known}')
    return drives[address]


def parse_setting(model: Family, key: str, text: Value) -> Value:
    """Turn what was typed for a parameter into its value; a ValueError names the nearest."""
    if key not in model:
        near = difflib.get_close_matches(key, list(model), n=3, cutoff=0.4)
        hint = f': did you mean {", ".join(near)}?' if near else ''
        raise ValueError(f'{model.name} has no parameter {key!r}{hint}')
    kind = model[key].kind
    if not isinstance(text, str) or kind is str:
        return text
    if kind is bool:
        switch = {'on': True, 'true': True, '1': True, 'off': False, 'false': False, '0': False}
        if text.lower() not in switch:
            raise ValueError(f'{key}: {text!r} is neither ON nor OFF')
        return switch[text.lower()]
    try:
        return int(text) if kind is int else float(text)
    except ValueError:
        raise ValueError(f'{key}: {text!r} is not a number') from None


# ---- from a method to its arguments ----


@dataclass(frozen=True)
class Argument:
    """
    One argument of an injection; optional where it has a default.

    :ivar type: what makes its value; ``None``: it stays as it is.
    """

    name: str
    type: Callable[[Any], Any] | None
    help: str
    default: Any
    choices: tuple[str, ...]

    @property
    def required(self) -> bool:
        """Whether it must be given."""
        return self.default is inspect.Parameter.empty

    def convert(self, value: Any) -> Any:
        """Return the value in its right type (ValueError: it cannot be that)."""
        if isinstance(value, bool) and self.choices:
            value = 'on' if value else 'off'
        try:
            if self.type is not None and value != self.default:
                value = self.type(value)
        except (TypeError, ValueError):
            raise ValueError(f'{self.name}: {value!r} is not right: {self.help}') from None
        if self.choices and value not in self.choices:
            raise ValueError(f'{self.name}: choose one of {", ".join(self.choices)}')
        return value


@dataclass(frozen=True)
class Injection:
    """
    One injection, as its method says.

    :ivar help: what happens.
    """

    help: str
    arguments: tuple[Argument, ...]

    @classmethod
    def of(cls, method: Callable[..., None]) -> Injection:
        """Return what the signature and the docstring of a method say."""
        hints = get_type_hints(method, include_extras=True)
        named = list(inspect.signature(method).parameters.values())[1:]
        text = ' '.join((inspect.getdoc(method) or '').split('\n\n')[0].split()).rstrip('.')
        arguments = tuple(_argument(hints[one.name], one) for one in named)
        return cls(text[:1].lower() + text[1:], arguments)

    def joined(self, other: Injection) -> Injection:
        """Return one that takes what two of the same name take, each in its own family."""
        if other == self:
            return self
        arguments = tuple(
            replace(one, choices=tuple(dict.fromkeys(one.choices + two.choices)))
            for one, two in zip(self.arguments, other.arguments, strict=True)
        )
        return Injection(f'{self.help}; or {other.help}', arguments)

    def bind(self, values: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments by name, converted and complete, or a ValueError."""
        names = [argument.name for argument in self.arguments]
        if len(values) > len(names):
            raise ValueError(f'takes at most {len(names)} arguments: {", ".join(names)}')
        given = {**dict(zip(names, values, strict=False)), **named}
        if unknown := set(given) - set(names):
            raise ValueError(f'has no argument {", ".join(sorted(unknown))}')
        for argument in self.arguments:
            if argument.name not in given and argument.required:
                raise ValueError(f'needs {argument.name}: {argument.help}')
        return {
            one.name: one.convert(given.get(one.name, one.default)) for one in self.arguments
        }


def injections_of(kind: type[Injections]) -> dict[str, Injection]:
    """Return the injections of a class by their names on the command line."""
    methods = inspect.getmembers(kind, inspect.isfunction)
    return {
        name.replace('_', '-'): Injection.of(method)
        for name, method in methods
        if not name.startswith('_')
    }


def _argument(hint: Any, parameter: inspect.Parameter) -> Argument:
    type_, text = get_args(hint)
    choices = get_args(type_) if get_origin(type_) is Literal else ()
    optional = [one for one in get_args(type_) if one is not type(None)]
    if choices:
        type_ = str
    elif optional:
        type_ = optional[0] if len(optional) == 1 else None
    return Argument(parameter.name, type_, text, parameter.default, choices)
