# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a verb is, what may be typed for each of them, and how arguments are read."""

from __future__ import annotations

import argparse
from collections.abc import Callable
import math
import re
import shlex
from typing import Any, TypeVar

from nfo_sinus_driver.catalog import load_profile, with_factory_line
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive.known.settings import AUTO, MONITOR
from nfo_sinus_driver.link import BIT_RATES, BusSettings
from nfo_sinus_driver.setting import settings_of

_N = TypeVar('_N', int, float)

#: Where the line and the drive are: settings as the nodes have them.
SETTINGS = {**settings_of(BusSettings), **settings_of(DriveSettings)}
LINE_AND_DRIVE = (
    'port', 'protocol', 'address', 'model', 'family', 'baud_rate', 'char_format',
    'response_timeout', 'retries', 'control_method', 'block_address', 'telegram_words',
)
#: What of them a family may say, as it leaves the factory.
LINE = ('protocol', 'baud_rate', 'char_format', 'address')
DEFAULTS = {name: SETTINGS[name].default for name in LINE_AND_DRIVE}
#: What every verb has besides, where nothing else was typed or filled in.
USUAL = {'yes': False, 'may_take_control': False, 'trace': ''}
#: Defaults of a scan: a short time-out, no retries.
OF_SCAN = {'response_timeout': 0.1, 'retries': 0}


class Verb:
    """
    One verb with its own arguments, as in ros2cli; the docstring of its class is its help.

    :cvar json: it has the option ``--json``.
    :cvar failed: its exit status when it fails.
    """

    json = True
    failed = 1

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed after this verb alone."""

    def complete(self, options: argparse.Namespace) -> None:
        """Fill in what has another default for this verb than for the others."""

    def main(self, options: argparse.Namespace) -> int:
        """Do it; return the exit status."""
        raise NotImplementedError


def take_family(options: argparse.Namespace) -> None:
    """
    Take the model that ``--family`` means, and how its line leaves the factory.

    :raises ValueError: there is no such family, or it cannot be used.
    """
    family = getattr(options, 'family', '')
    if not family:
        return
    given = {'family': family, 'model': getattr(options, 'model', DEFAULTS['model'])}
    options.model = DriveSettings(**given).model
    given = {name: getattr(options, name, None) for name in LINE}
    for name, value in with_factory_line(given, load_profile(options.model).line).items():
        setattr(options, name, value)


def command_line(options: argparse.Namespace, *words: str) -> str:
    """Return how to call this tool for the same drive, as it can be typed."""
    given = [
        text
        for name, default in DEFAULTS.items()
        if getattr(options, name) != default and not (name == 'model' and options.family)
        for text in (f'--{name.replace("_", "-")}', str(getattr(options, name)))
    ]
    return shlex.join(('nfo-sinus', *given, *words))


def add_setting(group: argparse._ActionsContainer, name: str, option: str, **more: Any) -> None:
    """Add a setting as an option; what more is given replaces what the setting says."""
    setting = SETTINGS[name]

    def value(text: str) -> object:
        if name == 'address' and re.fullmatch('[0-9]+[-,][-,0-9]*', text):
            raise argparse.ArgumentTypeError(
                f'{text}: this is one drive; scan and monitor take --addresses {text}'
            )
        given = type(setting.default)(text)
        try:
            setting.check(given)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None
        return given

    # what argparse calls it in its own words
    value.__name__ = 'number'
    given: dict[str, Any] = {'type': value, 'metavar': option.rpartition('-')[2].upper()}
    also = setting.also
    if setting.choices:
        offered = [choice for choice in setting.choices if choice not in (MONITOR, AUTO)]
        # what it says more is of those that are not offered here
        also = also if len(offered) == len(setting.choices) else ''
        given = {'choices': offered}
    elif name == 'baud_rate':
        given['choices'] = (0, *BIT_RATES)
    if setting.default == '':
        text, default = setting.text, setting.zero
    else:
        text, default = setting.description, str(setting.default)
    if name in OF_SCAN:
        default += f'; scan: {OF_SCAN[name]}'
    given['help'] = f'{"; ".join(filter(None, (text, also)))} (default: {default})'
    given |= more
    group.add_argument(option, **{**given, 'help': given['help'].replace('%', '%%')})


def add_flag(parser: argparse._ActionsContainer, option: str, meaning: str) -> None:
    """Add an option that takes no value."""
    parser.add_argument(option, action='store_true', help=meaning)


def add_allow(parser: argparse.ArgumentParser) -> None:
    """Add the option of those that write settings."""
    add_flag(parser, '--allow-communication-changes', 'let parameters serial.* be changed')


def number(
    kind: Callable[[str], _N], possible: Callable[[_N], bool], wanted: str
) -> Callable[[str], _N]:
    """Return what reads a number of this kind, of which some are possible."""

    def read(text: str) -> _N:
        value = kind(text)
        if not possible(value):
            raise argparse.ArgumentTypeError(f'{text} is {wanted}')
        return value

    read.__name__ = 'number'
    return read


address = number(int, lambda value: 0 <= value <= 255, 'not possible: 1 to 255')
count = number(int, lambda value: value >= 0, 'not possible: 0 or more')
times = number(int, lambda value: value >= 1, 'not possible: 1 or more')
period = number(float, lambda value: 0.01 <= value <= 3600, 'not possible: 0.01 s at least')
duration = number(float, lambda value: 0 < value < math.inf, 'not possible: more than 0 s')
setpoint = number(float, math.isfinite, 'no set-point')


def addresses(text: str) -> tuple[int, ...]:
    """Read a list of addresses, such as ``1-10,20``."""
    found: set[int] = set()
    for part in text.split(','):
        first, dash, last = part.partition('-')
        if not (first.isdecimal() and (last.isdecimal() or not dash)):
            raise argparse.ArgumentTypeError(f'{text} is no list of addresses, such as 1-10,20')
        span = range(address(first), address(last if dash else first) + 1)
        if not span:
            raise argparse.ArgumentTypeError(f'{text} is no list of addresses, such as 1-10,20')
        found.update(span)
    return tuple(sorted(found))


def change(text: str) -> tuple[str, str]:
    """Read a name and its new value."""
    name, equals, value = text.partition('=')
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name.strip(), value.strip()
