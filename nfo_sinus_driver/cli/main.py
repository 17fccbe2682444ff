# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The command ``nfo-sinus``: looks after drives from the command line; needs no ROS."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import inspect
import io
import os
import re
import signal
import sys
from typing import NoReturn

from nfo_sinus_driver.cli.check.verb import Check
from nfo_sinus_driver.cli.console import (
    CliError,
    OutputLost,
    UsageError,
    flush_output,
    put,
    remark,
    say,
    signals_handled,
)
from nfo_sinus_driver.cli.families import Family
from nfo_sinus_driver.cli.history import History
from nfo_sinus_driver.cli.monitor import Monitor
from nfo_sinus_driver.cli.options import (
    DEFAULTS,
    LINE_AND_DRIVE,
    USUAL,
    Verb,
    add_flag,
    add_setting,
    take_family,
)
from nfo_sinus_driver.cli.parameter_file import did_you_mean
from nfo_sinus_driver.cli.read import Errors, Get, Info, List, Set
from nfo_sinus_driver.cli.run import Run
from nfo_sinus_driver.cli.scan import Scan
from nfo_sinus_driver.cli.stop import Ack, Stop
from nfo_sinus_driver.cli.transfer import Diff, Dump, Load
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.link import PROTOCOLS
from nfo_sinus_driver.signals import hold_to_the_end
from nfo_sinus_driver.version import VERSION

_USAGE = 2
_INTERRUPTED = 130
_EPILOG = """
Options may stand before and after the verb; "nfo-sinus VERB --help" lists those of a verb alone.
Reading never changes anything in a drive, and a motor that runs runs on; not so on canopen, where
the first request gives the bus control, and a motor that the terminals run stops: it asks before.
"""


class Completion(Verb):
    """Print what makes a shell complete what is typed."""

    json = False

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Take the shell."""
        parser.add_argument(
            'shell', nargs='?', choices=('bash', 'zsh'), default='bash',
            help='type: source <(nfo-sinus completion bash), or put it into ~/.bashrc '
            '(default: bash)',
        )

    def main(self, options: argparse.Namespace) -> int:
        """Print it."""
        from argcomplete.shell_integration import shellcode

        put(shellcode(['nfo-sinus'], shell=options.shell))
        return 0


#: The verbs by name, in the order of the help.
VERBS: dict[str, Verb] = {
    type(verb).__name__.lower(): verb
    for verb in (
        Scan(), Info(), List(), Get(), Set(), Dump(), Load(), Diff(), Errors(), Monitor(),
        Check(), History(), Family(), Completion(), Ack(), Run(), Stop(),
    )
}


def command() -> int:
    """Run the command as a process of its own, which ends with this exit status."""
    hold_to_the_end()
    try:
        return main()
    finally:
        flush_output()


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status, 0 only when the drive did it."""
    for stream in (sys.stdout, sys.stderr):
        # what the locale cannot write, such as a unit, must not end what drives a motor
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors='replace')
    options = parse(sys.argv[1:] if argv is None else argv)
    verb = VERBS[options.verb]
    try:
        # SIGTERM and SIGHUP end it as Ctrl-C does, so that everything is cleaned up
        with signals_handled(signal.default_int_handler, to_the_end=True):
            return verb.main(options)
    except UsageError as error:
        remark(str(error))
        return _USAGE
    except OutputLost as error:
        if not isinstance(error.__cause__, BrokenPipeError):
            remark(str(error))
        return verb.failed
    except (CliError, DriveError) as error:
        remark(say(error))
        return verb.failed
    except KeyboardInterrupt:
        return _INTERRUPTED


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return what was typed, complete with defaults; leave the program if it makes no sense."""
    parser = make_parser()
    if '_ARGCOMPLETE' in os.environ:
        # a shell asks how a line may go on; loaded for that alone
        import argcomplete

        # those of the line are not in the help of each verb
        argcomplete.autocomplete(parser, print_suppressed=True)
    if not arguments:
        parser.print_help(sys.stderr)
        parser.exit(_USAGE)
    if arguments[0] == 'help':
        arguments = [*arguments[1:], '--help']
    parser.require_options(arguments)
    options = parser.parse_args(arguments)
    try:
        take_family(options)
    except ValueError as error:
        parser.exit(_USAGE, f'{parser.prog}: error: {error}\n')
    VERBS[options.verb].complete(options)
    for name, default in {**DEFAULTS, **USUAL}.items():
        if not hasattr(options, name):
            setattr(options, name, default)
    others = (*getattr(options, 'addresses', ()), getattr(options, 'against', None))
    try:
        for address in (options.address, *others):
            if address is not None:
                PROTOCOLS[options.protocol].require_unit(address)
    except ValueError as error:
        parser.error(str(error))
    return options


def make_parser() -> _Parser:
    """Return the parser of the whole command."""
    # without a default the one behind the verb does not overrule the one in front of it
    parser = _Parser(
        prog='nfo-sinus', description='Looks after frequency inverters on a serial line.',
        usage='nfo-sinus [OPTION]... VERB ...', epilog=_EPILOG, add_help=False,
        argument_default=argparse.SUPPRESS,
    )
    verbs = parser.add_subparsers(
        dest='verb', metavar='VERB', required=True, title='verbs', prog=parser.prog
    )
    _add_line(parser)
    others = parser.add_argument_group('other options')
    others.add_argument('-h', '--help', action='help', help='show this help, and end')
    others.add_argument('--version', action='version', version=f'nfo_sinus_driver {VERSION}')
    common = _Parser(add_help=False, argument_default=argparse.SUPPRESS)
    _add_line(common, help=argparse.SUPPRESS)
    for name, verb in VERBS.items():
        text = inspect.getdoc(verb) or ''
        short = text[:1].lower() + text[1:].removesuffix('.')
        made = verbs.add_parser(
            name, help=short, description=text, parents=[common],
            epilog='The options of line and drive, such as --port: nfo-sinus --help',
        )
        if verb.json:
            add_flag(made, '--json', 'print JSON, for a script')
        verb.add_arguments(made)
    return parser


def _add_line(parser: argparse.ArgumentParser, **more: str) -> None:
    """Add the options of line and drive; what more is given replaces what they have."""
    group = parser.add_argument_group('line and drive, as the parameters of the driver')
    for name in LINE_AND_DRIVE:
        add_setting(group, name, f'--{name.replace("_", "-")}', **more)
    add_setting(group, 'trace', '--trace', **({'metavar': 'FILE'} | more))
    add_flag(group, '--yes', more.get('help', 'do it without asking'))


class _Parser(argparse.ArgumentParser):
    """Says in one line what is wrong, and what may have been meant."""

    def error(self, message: str) -> NoReturn:
        """End the program."""
        wrong = re.search(r"VERB: invalid choice: '([^']*)'", message)
        if wrong:
            message = f'there is no verb {wrong[1]}{did_you_mean(wrong[1], VERBS)}; nfo-sinus help'
        self.exit(_USAGE, f'{self.prog}: error: {message}\n')

    @property
    def options(self) -> set[str]:
        """Every option of this parser and of the verbs."""
        parsers: list[argparse.ArgumentParser] = [self]
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                parsers += action.choices.values()
        return {option for parser in parsers for option in parser._option_string_actions}

    def require_options(self, words: Sequence[str]) -> None:
        """Make sure that there are all options that were typed, or shortened, as argparse does."""
        known = self.options
        for word in words:
            name = word.partition('=')[0]
            if word == '--':
                return
            if name.startswith('--') and not any(option.startswith(name) for option in known):
                self.error(f'there is no option {name}{did_you_mean(name, known)}')
