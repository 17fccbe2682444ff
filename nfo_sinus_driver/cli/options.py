# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What may be typed after ``nfo-sinus``."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import math
import os
import shlex
from typing import Any

from nfo_sinus_driver.catalog import example_setting
from nfo_sinus_driver.cli.tune import PROCEDURES
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive.settings import AUTO, MONITOR, REFERENCES
from nfo_sinus_driver.link import BIT_RATES, PROTOCOLS, BusSettings
from nfo_sinus_driver.setting import settings_of
from nfo_sinus_driver.version import VERSION

#: Where the line and the drive are: settings as the nodes have them.
_SETTINGS = {**settings_of(BusSettings), **settings_of(DriveSettings)}
_LINE_AND_DRIVE = (
    'port', 'protocol', 'address', 'model', 'baud_rate', 'char_format', 'response_timeout',
    'retries',
)
DEFAULTS = {name: _SETTINGS[name].default for name in _LINE_AND_DRIVE}
#: What is as short as it can be for each of 247 addresses.
_OF_SCAN = {'response_timeout': 0.1, 'retries': 0}

_ALLOW = '--allow-communication-changes'
_EPILOG = """
Options may stand before and after the verb; "nfo-sinus VERB --help" lists those of a verb.
Reading never changes anything in a drive, and a motor that runs runs on.
"""


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return what was typed, complete with defaults; leave the program if it makes no sense."""
    parser = _parser()
    if '_ARGCOMPLETE' in os.environ:
        # a shell asks how a line may go on; loaded for that alone
        import argcomplete

        argcomplete.autocomplete(parser)
    options = parser.parse_args(arguments)
    defaults = dict(DEFAULTS)
    if options.verb == 'scan':
        defaults['response_timeout'] = _OF_SCAN['response_timeout']
        options.silence_retries = getattr(options, 'retries', _OF_SCAN['retries'])
    for name, default in defaults.items():
        if not hasattr(options, name):
            setattr(options, name, default)
    protocol = PROTOCOLS[options.protocol]
    if options.verb == 'scan' and not options.addresses:
        alone = protocol.point_to_point
        options.addresses = tuple(unit for unit in protocol.units if unit != alone)
    against = getattr(options, 'against', None)
    named = (options.address, *getattr(options, 'addresses', ()))
    try:
        for address in named if against is None else (*named, against):
            protocol.require_unit(address)
    except ValueError as error:
        parser.error(str(error))
    return options


def command_line(options: argparse.Namespace, *words: str) -> str:
    """Return how to call this tool for the same drive, as it can be typed."""
    given = [
        text
        for name, default in DEFAULTS.items()
        if getattr(options, name) != default
        for text in (f'--{name.replace("_", "-")}', str(getattr(options, name)))
    ]
    return shlex.join(('nfo-sinus', *given, *words))


def _common() -> argparse.ArgumentParser:
    """Return the options that stand before or after the verb."""
    # without a default the one behind the verb does not overrule the one in front of it
    parser = argparse.ArgumentParser(add_help=False, argument_default=argparse.SUPPRESS)
    group = parser.add_argument_group('line and drive, as the parameters of the driver')
    for name in _LINE_AND_DRIVE:
        _add_setting(group, name, f'--{name.replace("_", "-")}')
    return parser


def _add_setting(group: argparse._ActionsContainer, name: str, option: str, **more: Any) -> None:
    """Add a setting as an option; what more is given replaces what the setting says."""
    setting = _SETTINGS[name]

    def value(text: str) -> object:
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
        offered = [one for one in setting.choices if one not in (MONITOR, AUTO)]
        # what it says more is of those that are not offered here
        also = also if len(offered) == len(setting.choices) else ''
        given = {'choices': offered}
    elif name == 'baud_rate':
        given['choices'] = (0, *BIT_RATES)
    if setting.default == '':
        text, default = setting.text, setting.zero
    else:
        text, default = setting.description, str(setting.default)
    if name in _OF_SCAN:
        default += f'; scan: {_OF_SCAN[name]}'
    given['help'] = f'{"; ".join(filter(None, (text, also)))} (default: {default})'
    given |= more
    group.add_argument(option, **{**given, 'help': given['help'].replace('%', '%%')})


def _parser() -> argparse.ArgumentParser:
    common = _common()
    parser = argparse.ArgumentParser(
        prog='nfo-sinus',
        description='Looks after frequency inverters on a serial line.',
        epilog=_EPILOG,
        parents=[common],
    )
    parser.add_argument('--version', action='version', version=f'nfo_sinus_driver {VERSION}')
    verbs = parser.add_subparsers(dest='verb', metavar='VERB', required=True, title='verbs')

    def verb(name: str, help_text: str, *, json: bool = False) -> argparse.ArgumentParser:
        description = f'{help_text[0].upper()}{help_text[1:]}.'
        made = verbs.add_parser(name, help=help_text, description=description, parents=[common])
        if json:
            made.add_argument('--json', action='store_true', help='print JSON, for a script')
        return made

    scan = verb('scan', 'find out who answers on the line', json=True)
    scan.add_argument(
        '--addresses',
        type=_addresses,
        default=(),
        metavar='LIST',
        help='such as 1-10,20 (default: 1-247; classic: 1-94; movitrac: 0-63; canopen: 1-127)',
    )
    scan.add_argument(
        '--all-settings',
        action='store_true',
        help='try every baud rate and parity; takes long; not for canopen',
    )
    scan.add_argument(
        '--params',
        metavar='FILE',
        help='write a parameter file for the driver, with all that was found; - is the standard '
        'output',
    )
    scan.add_argument('--force', action='store_true', help='let --params replace a file')
    verb('info', 'show who the drive is and how it is doing', json=True)
    list_ = verb('list', 'show all settings of the drive', json=True)
    list_.add_argument(
        '--group',
        metavar='GROUP',
        help='only this one, such as Motor; Status are the measured values',
    )
    setting, value = example_setting()
    get = verb('get', 'show some parameters', json=True)
    get.add_argument('names', nargs='+', metavar='NAME', help=f'such as {setting}')
    set_ = verb('set', 'change parameters, all of them or none', json=True)
    set_.add_argument(
        'changes',
        nargs='+',
        type=_change,
        metavar='NAME=VALUE',
        help=f'such as {setting}={value:g}',
    )
    set_.add_argument(_ALLOW, action='store_true', help='let parameters serial.* be changed')
    dump = verb('dump', 'save all settings of the drive')
    dump.add_argument(
        'file', nargs='?', default='-', metavar='FILE', help='default: standard output'
    )
    _add_load(verb('load', 'put saved settings into the drive; only what differs is written'))
    diff = verb('diff', 'compare a drive with a file, two files, or two drives', json=True)
    diff.add_argument('files', nargs='*', metavar='FILE', help='with the drive, or two of them')
    diff.add_argument(
        '--against', type=_address, metavar='N', help='compare with the drive at this address'
    )
    errors = verb('errors', 'show the error log, newest entry first', json=True)
    errors.add_argument(
        '--count',
        type=_count,
        default=0,
        metavar='TIMES',
        help='at most so many entries; more than 32 where a drive has them (default: 0, which is '
        'all, or 32)',
    )
    _add_yes(errors)
    errors.add_argument('--erase', action='store_true', help='erase it, after it was shown')
    monitor = verb(
        'monitor',
        'show what the drive does, until q or Ctrl-C; then how the line was doing',
        json=True,
    )
    monitor.add_argument(
        '--period',
        type=_seconds,
        default=0.5,
        metavar='SECONDS',
        help='from one line to the next (default: 0.5)',
    )
    monitor.add_argument('--count', type=int, metavar='TIMES', help='end after so many')
    monitor.add_argument(
        '--lines',
        action='store_true',
        help='a line each time, where a terminal would show the view; so does --count',
    )
    monitor.add_argument(
        '--ros',
        action='store_true',
        help='show the drives of running drivers, on the graph of ROS, instead of a line',
    )
    monitor.add_argument(
        '--addresses',
        type=_addresses,
        default=(),
        metavar='LIST',
        help='several drives of the line, such as 1-10,20 (default: that of --address)',
    )
    completion = verb('completion', 'print what makes a shell complete what is typed')
    completion.add_argument(
        'shell',
        nargs='?',
        choices=('bash', 'zsh'),
        default='bash',
        help='type: source <(nfo-sinus completion bash), or put it into ~/.bashrc (default: bash)',
    )
    verb('ack', 'acknowledge a fault; nothing starts by it', json=True)
    _add_run(verb('run', 'run the motor, until Ctrl-C or --for is over; then stop it', json=True))
    stop = verb('stop', 'stop a motor that the bus runs, and give control back', json=True)
    stop.add_argument('--quick', action='store_true', help='release the motor at once: it coasts')
    tune = verb('tune', 'have the drive measure or calculate its motor', json=True)
    tune.add_argument(
        'procedure',
        choices=PROCEDURES,
        help='full or basic tuning, rs: only the stator resistance, calculate: from the motor '
        'plate alone',
    )
    _add_yes(tune)
    return parser


def _add_yes(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('--yes', action='store_true', help='do it without asking')


def _add_run(run: argparse.ArgumentParser) -> None:
    add = run.add_argument
    add(
        'setpoint',
        nargs='?',
        type=_setpoint,
        metavar='SETPOINT',
        help='in the unit of the control mode: Hz, rpm, %% of nominal torque, or that of the '
        'process; negative is reverse',
    )
    add(
        '--for',
        dest='seconds',
        type=_ride_seconds,
        metavar='SECONDS',
        help='stop after so long (default: run until Ctrl-C)',
    )
    for name, option, more in (
        ('control_method', '--method', {}),
        ('reference', '--reference', {'metavar': 'REFERENCE', 'help': (
            f'what the motor follows: {", ".join(REFERENCES)} (default: fieldbus, which is '
            'SETPOINT)'
        )}),
        ('expected_control_mode', '--control-mode', {'help': (
            'refuse to run in another one; an Optimal, which does not tell it, is taken to be in '
            'this one (default: any; an Optimal: Freque)'
        )}),
        ('setpoint_max', '--setpoint-max', {'help': (
            'the greatest SETPOINT that is meant to be one (default: what is nominal for the '
            'motor, where the drive tells it)'
        )}),
        ('drive_timeout', '--drive-timeout', {}),
    ):
        _add_setting(run, name, option, default=_SETTINGS[name].default, **more)
    add(
        '--period',
        type=_seconds,
        default=0.5,
        metavar='SECONDS',
        help='from one status to the next (default: 0.5)',
    )


def _add_load(load: argparse.ArgumentParser) -> None:
    load.add_argument('file', metavar='FILE', help='- is the standard input')
    load.add_argument(
        '--dry-run', action='store_true', help='only show what would change; write nothing'
    )
    load.add_argument(_ALLOW, action='store_true', help='let parameters serial.* be changed')
    after = load.add_mutually_exclusive_group()
    after.add_argument(
        '--put-back',
        action='store_true',
        help='if it fails half-way, put back what was written without asking',
    )
    after.add_argument(
        '--keep', action='store_true', help='if it fails half-way, leave what was written'
    )


def _address(text: str) -> int:
    address = int(text, 10)
    if not 0 <= address <= 247:
        raise argparse.ArgumentTypeError(f'{text} is not possible: 1 to 247')
    return address


def _addresses(text: str) -> tuple[int, ...]:
    found: set[int] = set()
    for part in text.split(','):
        first, _, last = part.partition('-')
        found.update(range(_address(first), _address(last or first) + 1))
    if not found:
        raise argparse.ArgumentTypeError(f'{text} is no list of addresses, such as 1-10,20')
    return tuple(sorted(found))


def _seconds(text: str) -> float:
    seconds = float(text)
    if not 0.01 <= seconds <= 3600:
        raise argparse.ArgumentTypeError(f'{text} is not possible: 0.01 s at least')
    return seconds


def _setpoint(text: str) -> float:
    setpoint = float(text)
    if not math.isfinite(setpoint):
        raise argparse.ArgumentTypeError(f'{text} is no set-point')
    return setpoint


def _ride_seconds(text: str) -> float:
    seconds = float(text)
    if not 0 < seconds < math.inf:
        raise argparse.ArgumentTypeError(f'{text} is not possible: more than 0 s')
    return seconds


def _count(text: str) -> int:
    count = int(text, 10)
    if count < 0:
        raise argparse.ArgumentTypeError(f'{text} is not possible: 0 or more')
    return count


def _change(text: str) -> tuple[str, str]:
    name, equals, value = text.partition('=')
    if not (name and equals and value):
        raise argparse.ArgumentTypeError(f'{text!r} is not NAME=VALUE')
    return name.strip(), value.strip()
