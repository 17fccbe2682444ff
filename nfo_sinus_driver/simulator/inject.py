# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The command ``simulator inject``: makes something happen to a running simulator."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json
import sys

from nfo_sinus_driver.simulator.control import Client
from nfo_sinus_driver.simulator.control import ControlError
from nfo_sinus_driver.simulator.control import control_path
from nfo_sinus_driver.simulator.family import every_verb
from nfo_sinus_driver.simulator.injections import Argument

_EXAMPLES = """
examples:
  simulator inject --link /tmp/nfo0 --address 1 fault 5
  simulator inject --link /tmp/nfo0 run off
  simulator inject --link /tmp/nfo0 keypad stop
  simulator inject --link /tmp/nfo0 delay 1 0.5
  simulator inject --link /tmp/nfo0 state
"""


def inject(argv: Sequence[str]) -> int:
    """Run the command and return its exit status; ``argv`` begins behind ``inject``."""
    options = _parser().parse_args(argv)
    if options.control is not None:
        path = options.control
    elif options.link is not None or options.tcp is not None:
        path = control_path(options.link, options.tcp)
    else:
        _parser().error('say which simulator: --link, --tcp or --control')
    try:
        with Client(path) as client:
            if options.verb == 'state':
                one = options.address is not None
                state = client.state(options.address) if one else client.states()
                print(json.dumps(state, indent=2, ensure_ascii=False))
            else:
                names = [argument.name for argument in every_verb()[options.verb].arguments]
                given = {name: getattr(options, name) for name in names}
                client.inject(options.verb, address=options.address, **given)
    except ControlError as error:
        print(f'simulator inject: {error}', file=sys.stderr)
        return 1
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='simulator inject',
        description='Makes something happen to a running simulator.',
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument('--link', metavar='PATH', help='the pseudo-terminal that it serves')
    parser.add_argument('--tcp', type=int, metavar='PORT', help='the TCP port that it serves')
    parser.add_argument('--control', metavar='PATH', help='its control channel')
    parser.add_argument(
        '--address',
        type=int,
        metavar='N',
        help='the drive; needed where there are several and it happens to one',
    )
    verbs = parser.add_subparsers(dest='verb', metavar='VERB', required=True)
    for name, verb in every_verb().items():
        sub = verbs.add_parser(name, help=verb.help, description=verb.help)
        for argument in verb.arguments:
            _add(sub, argument)
    text = 'print the state of the drives as JSON'
    verbs.add_parser('state', help=text, description=text)
    return parser


def _add(parser: argparse.ArgumentParser, argument: Argument) -> None:
    if argument.type is bool:
        parser.add_argument(f'--{argument.name}', action='store_true', help=argument.help)
        return
    parser.add_argument(
        argument.name,
        type=argument.type if argument.type in (int, float) else str,
        help=argument.help,
        nargs=None if argument.required else '?',
        default=None if argument.required else argument.default,
        choices=argument.choices,
    )
