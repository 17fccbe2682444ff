# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What can be made to happen to a running simulator, by ``simulator inject`` and by tests.

Here is what can happen to a drive of any family and to its line; a family may have more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
import difflib
from typing import Any

from nfo_sinus_driver.catalog import Family, Value
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.line_faults import ANSWER_FAULTS
from nfo_sinus_driver.simulator.plc import Channel, Plc
from nfo_sinus_driver.simulator.wire import Wire

#: Stands for an argument that must be given.
_REQUIRED: Any = object()


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


@dataclass(frozen=True)
class Argument:
    """One argument of a verb; optional where it has a default."""

    name: str
    type: Callable[[Any], Any]
    help: str
    default: Any = _REQUIRED
    choices: Sequence[str] | None = None

    @property
    def required(self) -> bool:
        """Whether it must be given."""
        return self.default is _REQUIRED

    def joined(self, other: Argument) -> Argument:
        """Return an argument that has the choices of both."""
        both = dict.fromkeys([*(self.choices or ()), *(other.choices or ())])
        return replace(self, choices=tuple(both) or None)

    def convert(self, value: Any) -> Any:
        """Return the value in its right type (ValueError: it cannot be that)."""
        if value is None and not self.required:
            return None
        try:
            converted = self.type(value)
        except (TypeError, ValueError):
            raise ValueError(f'{self.name}: {value!r} is not right: {self.help}') from None
        if self.choices is not None and converted not in self.choices:
            raise ValueError(f'{self.name}: choose one of {", ".join(self.choices)}')
        return converted


@dataclass(frozen=True)
class Target:
    """What a verb works on; ``drive`` is ``None`` when it concerns any drive of the line."""

    line: Wire
    drive: SimulatedDrive | None
    now: float
    plc: Plc | None = None

    @property
    def one(self) -> SimulatedDrive:
        """The drive of a verb that needs one."""
        assert self.drive is not None
        return self.drive

    @property
    def channel(self) -> Channel:
        """The drive as the PLC has it (ValueError: there is none)."""
        for channel in self.the_plc.channels.values():
            if channel.drive is self.drive:
                return channel
        raise ValueError('the drive is not on a fieldbus')

    @property
    def the_plc(self) -> Plc:
        """The PLC before the drives (ValueError: there is none)."""
        if self.plc is None:
            raise ValueError('there is no PLC: it is there with --protocol telegram1')
        return self.plc

    @property
    def address(self) -> int | None:
        """The address of the drive, ``None`` for any."""
        return None if self.drive is None else self.drive.address


@dataclass(frozen=True)
class Verb:
    """Something that can be made to happen."""

    help: str
    act: Callable[[Target, dict[str, Any]], None]
    arguments: tuple[Argument, ...] = ()
    #: Whether it happens to one drive; otherwise to the line, or to every drive on it.
    to_drive: bool = True

    def joined(self, other: Verb) -> Verb:
        """Return a verb that takes what two of the same name take, each in its own family."""
        if other is self:
            return self
        pairs = zip(self.arguments, other.arguments, strict=True)
        arguments = tuple(one.joined(two) for one, two in pairs)
        return replace(self, help=f'{self.help}; or {other.help}', arguments=arguments)

    def bind(self, values: Sequence[Any], named: Mapping[str, Any]) -> dict[str, Any]:
        """Return the arguments by name, converted and complete, or a ValueError."""
        names = [argument.name for argument in self.arguments]
        if len(values) > len(names):
            raise ValueError(f'takes at most {len(names)} arguments: {", ".join(names)}')
        given = {**dict(zip(names, values, strict=False)), **named}
        unknown = set(given) - set(names)
        if unknown:
            raise ValueError(f'has no argument {", ".join(sorted(unknown))}')
        bound = {}
        for argument in self.arguments:
            if argument.name not in given and argument.required:
                raise ValueError(f'needs {argument.name}: {argument.help}')
            bound[argument.name] = argument.convert(given.get(argument.name, argument.default))
        return bound


def _switch(value: object) -> str:
    """Take ``on`` and ``off`` as they are, and True and False for them."""
    if isinstance(value, bool):
        return 'on' if value else 'off'
    return str(value)


def _as_is(value: object) -> object:
    return value


def _set(target: Target, given: dict[str, Any]) -> None:
    drive = target.one
    value = parse_setting(drive.memory.model, given['key'], given['value'])
    drive.set_from_keypad(given['key'], value)


def _line_dead(target: Target, given: dict[str, Any]) -> None:
    target.line.faults.dead_until = target.now + given['seconds']


def _load(target: Target, given: dict[str, Any]) -> None:
    target.one.motor.load = given['share']


def _answers(what: str, help_text: str, *more: Argument) -> Verb:
    """Return a verb that spoils the next answers."""

    def act(target: Target, given: dict[str, Any]) -> None:
        target.line.faults.add(what, given['times'], target.address, given.get('seconds', 0.0))

    times = Argument('times', int, 'how many answers', 1)
    return Verb(help_text, act, (times, *more), to_drive=False)


def _noise_rate(target: Target, given: dict[str, Any]) -> None:
    target.line.faults.set_rate(given['what'], given['share'], given['seed'], given['seconds'])


def _burst(target: Target, given: dict[str, Any]) -> None:
    target.line.faults.set_bursts(given['seconds'], given['period'], target.now)


def _fieldbus_cut(target: Target, given: dict[str, Any]) -> None:
    target.channel.cut_until = target.now + given['seconds']


def _plc_restart(target: Target, given: dict[str, Any]) -> None:
    target.the_plc.restart(target.now + given['seconds'])


def _plc_stop(target: Target, given: dict[str, Any]) -> None:
    target.the_plc.stopped_until = target.now + given['seconds']


def _release(target: Target, given: dict[str, Any]) -> None:
    target.channel.released = given['state'] == 'on'


_SECONDS = Argument('seconds', float, 'for how many seconds')

VERBS: Mapping[str, Verb] = {
    'fault': Verb(
        'let a fault happen: the motor coasts until it is acknowledged',
        lambda target, given: target.one.trip(given['code'], cause_present=given['standing']),
        (
            Argument('code', int, 'status code of the fault, such as 5'),
            Argument('standing', bool, 'its cause lasts until ack-cause-gone', False),
        ),
    ),
    'ack-cause-gone': Verb(
        'take away the causes of all faults, so that they can be acknowledged',
        lambda target, _: target.one.end_fault_causes(),
    ),
    'run': Verb(
        'switch the digital input RUN',
        lambda target, given: target.one.set_run_input(given['state'] == 'on'),
        (Argument('state', _switch, 'on or off', choices=('on', 'off')),),
    ),
    'set': Verb(
        'change a parameter at the keypad',
        _set,
        (
            Argument('key', str, 'its name, as in the table of parameters'),
            Argument('value', _as_is, 'in its own unit, such as 7'),
        ),
    ),
    'factory-reset': Verb(
        'give the parameters their factory values, but those of the line',
        lambda target, _: target.one.factory_reset(),
    ),
    'load': Verb(
        'change the load of the motor',
        _load,
        (Argument('share', float, 'torque at nominal speed, 1 is the nominal torque'),),
    ),
    'power-cycle': Verb(
        'take the mains away and give them back',
        lambda target, given: target.one.power_cycle(given['seconds']),
        (Argument('seconds', float, 'how long it is silent (default: its boot time, 2 s)', None),),
    ),
    'silence': Verb(
        'let the drive neither hear nor answer',
        lambda target, given: target.one.silence(given['seconds']),
        (_SECONDS,),
    ),
    'line-dead': Verb('let the line carry nothing, either way', _line_dead, (_SECONDS,), False),
    'hangup': Verb(
        'let the port disappear and come back, like a USB adapter that is pulled out',
        lambda target, given: target.line.hang_up(target.now + given['seconds']),
        (Argument('seconds', float, 'for how many seconds', 1.0),),
        to_drive=False,
    ),
    'noise': _answers('noise', 'put noise before the next answers'),
    'damage': _answers('damage', 'flip a bit in the next answers'),
    'delay': _answers(
        'delay', 'send the next answers late', Argument('seconds', float, 'how late', 0.5)
    ),
    'drop': _answers('drop', 'lose the next answers; the requests are carried out'),
    'double': _answers('double', 'send the next answers twice'),
    'noise-rate': Verb(
        'spoil a share of all answers by chance, until heal',
        _noise_rate,
        (
            Argument('what', str, ', '.join(ANSWER_FAULTS), choices=ANSWER_FAULTS),
            Argument('share', float, 'of all answers, such as 0.03; 0 ends it'),
            Argument('seed', int, 'a number, for the same answers in every run', None),
            Argument('seconds', float, 'how late they come, for delay', 0.5),
        ),
        to_drive=False,
    ),
    'burst': Verb(
        'let the line carry nothing for a while again and again, until heal',
        _burst,
        (
            Argument('seconds', float, 'how long; 0 ends it'),
            Argument('period', float, 'from one to the next (s)', 5.0),
        ),
        to_drive=False,
    ),
    'fieldbus-cut': Verb(
        'let no telegram pass between the PLC and the drive', _fieldbus_cut, (_SECONDS,)
    ),
    'plc-restart': Verb(
        'let the PLC be off, and begin anew with its registers 0', _plc_restart, (_SECONDS,)
    ),
    'plc-stop': Verb(
        'let the program of the PLC stand, and its fieldbus; its registers are still answered',
        _plc_stop,
        (_SECONDS,),
        to_drive=False,
    ),
    'release': Verb(
        'let the PLC release the drive to ROS, or not',
        _release,
        (Argument('state', _switch, 'on or off', choices=('on', 'off')),),
    ),
    'traffic': Verb(
        'on a CAN bus: let others send frames that are for nobody here',
        lambda target, given: target.line.set_traffic(given['rate'], target.now),
        (Argument('rate', float, 'how many a second, such as 1000; 0 ends it'),),
        to_drive=False,
    ),
    'heal': Verb(
        'end all faults of the line', lambda target, _: target.line.faults.heal(), to_drive=False
    ),
}
