# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What can be made to happen to a running simulator, by ``simulator inject`` and by tests.

:data:`INJECTIONS` is the command line and the control channel. A family may have more.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
import difflib
import math
from typing import Any, NoReturn

from nfo_sinus_driver.catalog import Family, Value
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.line_faults import ANSWER_FAULTS
from nfo_sinus_driver.simulator.plc import Channel, Plc
from nfo_sinus_driver.simulator.wire import Wire


@dataclass(frozen=True)
class Target:
    """
    What something happens to.

    :ivar address: of the drive; ``None``: the only one, or, for what happens to answers, any.
    :ivar now: the time (s).
    """

    line: Wire
    drives: Mapping[int, SimulatedDrive]
    _plc: Plc | None
    address: int | None
    now: float

    @property
    def drive(self) -> SimulatedDrive:
        """The drive (ValueError: which?)."""
        known = ', '.join(map(str, self.drives))
        if self.address is None and len(self.drives) > 1:
            raise ValueError(f'say which drive, with --address: {known}')
        address = next(iter(self.drives)) if self.address is None else self.address
        if address not in self.drives:
            raise ValueError(f'no drive has address {address}, only {known}')
        return self.drives[address]

    @property
    def unit(self) -> Any:
        """The control unit of the drive, of the class that its family has."""
        return self.drive.control_unit

    @property
    def plc(self) -> Plc:
        """The PLC (ValueError: there is none)."""
        if self._plc is None:
            raise ValueError('there is no PLC: it is there with --protocol telegram1')
        return self._plc

    @property
    def channel(self) -> Channel:
        """The drive as the PLC has it."""
        channels = self.plc.channels.values()
        return next(channel for channel in channels if channel.drive is self.drive)


class Injection:
    """
    One injection.

    :param text: what happens.
    :param do: lets it happen to a target, with the arguments by their names.
    :param arguments: each as :func:`argument` returns it.
    """

    def __init__(
        self,
        text: str,
        do: Callable[[Target, argparse.Namespace], object],
        *arguments: tuple[str, dict[str, Any]],
    ) -> None:
        self.text = text
        self.do = do
        self.arguments = arguments


def argument(name: str, text: str, **how: Any) -> tuple[str, dict[str, Any]]:
    """Return an argument, as :mod:`argparse` takes it; with a default it may be left out."""
    return name, {'help': text, **({'nargs': '?'} if 'default' in how else {}), **how}


def assign(target: object, **values: object) -> None:
    """Set attributes, where an expression is needed."""
    for name, value in values.items():
        setattr(target, name, value)


def _spoil(at: Target, given: argparse.Namespace) -> None:
    at.line.faults.add(given.verb, given.times, at.address, getattr(given, 'seconds', 0.0))


def _set(at: Target, given: argparse.Namespace) -> None:
    value = parse_setting(at.drive.memory.model, given.key, given.value)
    at.drive.set_from_keypad(given.key, value)


def _press(at: Target, given: argparse.Namespace) -> None:
    keys = at.unit.keys
    if given.key not in keys:
        raise ValueError(f'no key {given.key!r}: choose one of {", ".join(keys) or "none"}')
    at.unit.press(given.key)


def finite(text: str) -> float:
    """Read a number; what is none, or has no end, happens to nothing."""
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{text} is not possible: a finite number')
    return value


def _seconds(text: str) -> float:
    value = finite(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} is not possible: 0 or more seconds')
    return value


SWITCH = argument('state', 'on or off', choices=('on', 'off'))
_SECONDS = argument('seconds', 'for how many seconds', type=_seconds)
_TIMES = argument('times', 'how many answers', type=int, default=1)

INJECTIONS: Mapping[str, Injection] = {
    # ---- to a drive ----
    'fault': Injection('let a fault happen: the motor coasts until it is acknowledged',
        lambda at, given: at.drive.trip(given.code, cause_present=given.standing),
        argument('code', 'status code of the fault, such as 5', type=int),
        argument('--standing', 'its cause lasts until ack-cause-gone', action='store_true')),
    'ack-cause-gone': Injection(
        'take away the causes of all faults, so that they can be acknowledged',
        lambda at, given: at.drive.faults.end_causes()),
    'run': Injection('switch the digital input RUN',
        lambda at, given: at.drive.set_run_input(given.state == 'on'), SWITCH),
    'keypad': Injection('press a key of the keypad', _press,
        argument('key', 'stop (STOP), ext (SHIFT+STOP: to the terminals), start (run locally); of '
            'a MOVITRAC manual, automatic (who commands), cw, ccw, stop (they count in manual '
            'operation) or reset; of a Sinus H start, stop, reset')),
    'set': Injection('change a parameter at the keypad', _set,
        argument('key', 'its name, as in the table of parameters'),
        argument('value', 'in its own unit, such as 7')),
    'factory-reset': Injection('give the parameters their factory values, but those of the line',
        lambda at, given: at.drive.factory_reset()),
    'load': Injection('change the load of the motor',
        lambda at, given: assign(at.drive.motor, load=given.share),
        argument('share', 'torque at nominal speed, 1 is the nominal torque', type=finite)),
    'power-cycle': Injection('take the mains away and give them back',
        lambda at, given: at.drive.power_cycle(given.seconds),
        argument('seconds', 'how long it is silent (default: its boot time)',
            type=_seconds, default=None)),
    'silence': Injection('let the drive neither hear nor answer',
        lambda at, given: at.drive.silence(given.seconds), _SECONDS),
    # ---- to the line ----
    'line-dead': Injection('let the line carry nothing, either way',
        lambda at, given: assign(at.line.faults, dead_until=at.now + given.seconds), _SECONDS),
    'hangup': Injection(
        'let the port disappear and come back, like a USB adapter that is pulled out',
        lambda at, given: at.line.hang_up(at.now + given.seconds),
        argument('seconds', 'for how many seconds (default: 1)', type=_seconds, default=1.0)),
    'noise': Injection('put noise before the next answers', _spoil, _TIMES),
    'damage': Injection('flip a bit in the next answers', _spoil, _TIMES),
    'drop': Injection('lose the next answers; the requests are carried out', _spoil, _TIMES),
    'double': Injection('send the next answers twice', _spoil, _TIMES),
    'delay': Injection('send the next answers late', _spoil, _TIMES,
        argument('seconds', 'how late (default: 0.5)', type=_seconds, default=0.5)),
    'noise-rate': Injection('spoil a share of all answers by chance, until heal',
        lambda at, given: at.line.faults.set_rate(
            given.what, given.share, given.seed, given.seconds),
        argument('what', 'what happens to them', choices=ANSWER_FAULTS),
        argument('share', 'of all answers, such as 0.03; 0 ends it', type=finite),
        argument('seed', 'a number, for the same answers in every run', type=int, default=None),
        argument('seconds', 'how late they come, for delay', type=_seconds, default=0.5)),
    'burst': Injection('let the line carry nothing for a while again and again, until heal',
        lambda at, given: at.line.faults.set_bursts(given.seconds, given.period, at.now),
        argument('seconds', 'how long; 0 ends it', type=finite),
        argument('period', 'from one to the next (s, default: 5)', type=finite, default=5.0)),
    'traffic': Injection('on a CAN bus: let others send frames that no node here takes',
        lambda at, given: at.line.set_traffic(given.rate, at.now),
        argument('rate', 'how many a second, such as 1000; 0 ends it', type=finite)),
    'heal': Injection('end all faults of the line', lambda at, given: at.line.faults.heal()),
    # ---- to a PLC, and the fieldbus behind it ----
    'fieldbus-cut': Injection('let no telegram pass between the PLC and the drive',
        lambda at, given: assign(at.channel, cut_until=at.now + given.seconds), _SECONDS),
    'plc-restart': Injection('let the PLC be off, and begin anew with its registers 0',
        lambda at, given: at.plc.restart(at.now + given.seconds), _SECONDS),
    'plc-stop': Injection(
        "let the PLC's program and fieldbus stand; its registers are still answered",
        lambda at, given: assign(at.plc, stopped_until=at.now + given.seconds), _SECONDS),
    'release': Injection('let the PLC release the drive to ROS, or not',
        lambda at, given: assign(at.channel, released=given.state == 'on'), SWITCH),
}


class Parser(argparse.ArgumentParser):
    """Raises a ValueError that says what is wrong with an argument."""

    def error(self, message: str) -> NoReturn:
        """Refuse what was typed."""
        raise ValueError(message)


def add_verbs(parser: argparse.ArgumentParser, injections: Mapping[str, Injection]) -> Any:
    """Let a parser take the words of an injection: its name as ``verb``, and its arguments."""
    verbs = parser.add_subparsers(dest='verb', metavar='VERB', required=True)
    for name, injection in injections.items():
        verb = verbs.add_parser(name, help=injection.text, description=injection.text)
        for argument_, how in injection.arguments:
            verb.add_argument(argument_, **how)
    return verbs


def parse_setting(model: Family, key: str, text: str) -> Value:
    """Turn what was typed for a parameter into its value; a ValueError names the nearest."""
    if key not in model:
        near = difflib.get_close_matches(key, list(model), n=3, cutoff=0.4)
        hint = f': did you mean {", ".join(near)}?' if near else ''
        raise ValueError(f'{model.name} has no parameter {key!r}{hint}')
    kind = model[key].kind
    if kind is str:
        return text
    if kind is bool:
        switch = {'on': True, 'true': True, '1': True, 'off': False, 'false': False, '0': False}
        if text.lower() not in switch:
            raise ValueError(f'{key}: {text!r} is neither ON nor OFF')
        return switch[text.lower()]
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f'{key}: {text!r} is not a number') from None
    return int(number) if kind is int and number.is_integer() else number
