# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The command ``simulator``, without ROS: simulated drives, and what happens to running ones."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
import contextlib
import dataclasses
import json
import os
import signal
import sys
import time
from typing import Any

from nfo_sinus_driver.catalog import CatalogError, Value, with_factory_line
from nfo_sinus_driver.catalog.finding import find
from nfo_sinus_driver.families import USUAL
from nfo_sinus_driver.simulator.control import Client, ControlError, control_path
from nfo_sinus_driver.simulator.endpoints import GATEWAY_TIMEOUT, PROTOCOLS
from nfo_sinus_driver.simulator.family import (
    every_injection,
    every_option,
    load,
    machine_of,
    simulated,
)
from nfo_sinus_driver.simulator.injections import Parser, add_verbs, parse_setting
from nfo_sinus_driver.simulator.plc import PlcSetting
from nfo_sinus_driver.simulator.ports import PortError
from nfo_sinus_driver.simulator.simulator import Simulator
from nfo_sinus_driver.version import VERSION

#: Lets the line's thread go on soon after another one was busy (s).
_SWITCH_INTERVAL = 0.0002
#: How long a signal may wait that came to another thread: Python handles it in the main one, but
#: does not wake it (s). That is where it comes when the process was suspended.
_POLL_SIGNALS = 0.2

_EPILOG = """
While it runs, "simulator inject --link LINK VERB ..." makes things happen to it: faults, a lost
RUN input, the keypad, a power cycle, noise on the line; see "simulator inject --help".
"""

#: The options of a PLC, by the names of its settings.
_OF_THE_PLC = tuple(field.name for field in dataclasses.fields(PlcSetting))

_USUAL_LINE = {'protocol': 'modbus_rtu', 'address': 1, 'baud_rate': None, 'char_format': None}

_ROS_ARGS = '--ros-args'


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command, by default as the process was called, and return its exit status."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    if _ROS_ARGS in arguments:
        # a launch file's Node action adds them; there is no ROS in here
        del arguments[arguments.index(_ROS_ARGS) :]
    if arguments[:1] == ['inject']:
        return inject(arguments[1:])
    parser = _parser()
    try:
        options = parser.parse_args(arguments)
        with _signals_that_quit(), _simulator(options) as simulator:
            return _serve(simulator)
    except (ValueError, CatalogError) as error:
        parser.exit(2, f'simulator: error: {error}\n')
    except OSError as error:
        where = f'{error.filename}: ' if error.filename else ''
        print(f'simulator: {where}{error.strerror or error}', file=sys.stderr)
        return 1
    except (PortError, ControlError) as error:
        print(f'simulator: {error}', file=sys.stderr)
        return 1


def _serve(simulator: Simulator) -> int:
    sys.setswitchinterval(_SWITCH_INTERVAL)
    drives = 'drive' if len(simulator.drives) == 1 else 'drives'
    addresses = ', '.join(str(address) for address in simulator.drives)
    first, *others = (
        f'{line.name} at {line.speed} on {line.port.name}' for line in simulator.lines
    )
    also = ''.join(f'; also {other}' for other in others)
    print(f'serving {first}, {drives} {addresses}; control {simulator.control}{also}', flush=True)
    # the line has a thread of its own: this one waits for a signal, or for a failure there; not by
    # the event, whose lock stays taken where a signal ends the wait at the wrong moment
    while not simulator.finished.is_set():
        time.sleep(_POLL_SIGNALS)
    print(f'simulator: the line broke down: {simulator.failure!r}', file=sys.stderr)
    return 1


@contextlib.contextmanager
def _signals_that_quit() -> Iterator[None]:
    """Leave by SystemExit on SIGINT and SIGTERM, so that whatever was made is cleaned up."""

    def quit_(*_: object) -> None:
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        raise SystemExit(0)

    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, quit_)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _simulator(options: argparse.Namespace) -> Simulator:
    """
    Return the simulator that the options ask for.

    :raises ValueError: an option is wrong, of itself or beside another one.
    :raises PortError: the port cannot be had.
    :raises ControlError: another simulator is there.
    """
    given = {name: value for name, value in vars(options).items() if value is not None}
    model = given['model'] = find(family) if (family := given.pop('family', '')) else options.model
    plc = {name: given.pop(name) for name in _OF_THE_PLC if name in given}
    # the line is as the options say, or else as the drive leaves the factory
    line = {name: given.pop(name, None) for name in ('protocol', 'baud_rate', 'char_format')}
    line = {**_USUAL_LINE, **with_factory_line(line, load(model).line)}
    return Simulator(
        given.pop('address', [line['address']]),
        protocol=line['protocol'],
        baud=line['baud_rate'],
        char_format=line['char_format'],
        settings=_settings(model, given.pop('set', ())),
        plc=PlcSetting(**plc) if plc else None,
        **given,
    )


def _settings(model: str, given: Sequence[str]) -> dict[str, Value]:
    settings: dict[str, Value] = {}
    machine = machine_of(model)
    for text in given:
        key, equals, value = text.partition('=')
        if not equals:
            raise ValueError(f'argument --set: {text!r} is not NAME=VALUE')
        settings[key] = parse_setting(machine, key, value)
    return settings


def _addresses(text: str) -> list[int]:
    """Read a list of addresses, such as ``1-10,20``."""
    found: list[int] = []
    for part in text.split(','):
        first, dash, last = part.partition('-')
        last = last if dash else first
        whole = first.isdecimal() and last.isdecimal()
        if not (whole and int(first) <= int(last) < 1000):
            raise argparse.ArgumentTypeError(f'{text} is no list of addresses, such as 1-10,20')
        found += range(int(first), int(last) + 1)
    return found


def _seconds(text: str) -> float:
    seconds = float(text)
    if not 0 <= seconds < 1e6:
        raise argparse.ArgumentTypeError(f'{text} is not possible: 0 or more seconds')
    return seconds


def _block(text: str) -> tuple[int, int]:
    unit, colon, register = text.partition(':')
    try:
        return int(unit), int(register) if colon else 0
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not UNIT:REGISTER') from None


def _span(text: str) -> tuple[float, float]:
    low, colon, high = text.partition(':')
    return _seconds(low), _seconds(high if colon else low)


def _parser() -> Parser:
    """Return the parser: an option is an argument of :class:`Simulator` or :class:`PlcSetting`."""
    parser = Parser(
        prog='simulator',
        description='Simulates whole drives on a pseudo-terminal or TCP port.',
        epilog=_EPILOG,
    )
    flag, off, repeated = ({'action': how} for how in ('store_true', 'store_false', 'append'))
    seconds = {'type': _seconds, 'metavar': 'SECONDS'}
    path = {'metavar': 'PATH'}

    def add(name: str, text: str, **how: Any) -> None:
        parser.add_argument(name, help=text, **how)

    add('--version', 'the version', action='version', version=f'nfo_sinus_driver {VERSION}')
    # ---- the line ----
    add('--protocol', 'default: modbus_rtu; with --family as its file says', choices=PROTOCOLS)
    add('--model', f'default: {USUAL}', default=USUAL, choices=simulated())
    add('--family', 'in place of --model: a drive that a file describes, NAME.vfd.yaml; its name, '
        'its path, or package://name/path', metavar='FILE')
    add('--address', 'addresses of the drives, as their protocol has them, such as 1-10,20; may be '
        'repeated (default: 1; with --family as its file says)',
        type=_addresses, action='extend', metavar='LIST')
    add('--link', 'symbolic link to make to the pseudo-terminal', **path)
    add('--tcp', 'serve a TCP port of 127.0.0.1 (0: any free one)', type=int, metavar='PORT')
    add('--also', 'serve the same drives by another protocol as well, at a link or TCP port; may '
        'be repeated', **repeated, metavar='PROTOCOL:PLACE')
    add('--baud-rate', 'default: 19200, of classic and movitrac 9600, of canopen 125000 (bit/s); '
        'with --family as its file says', type=int)
    add('--char-format', 'default: 8E1, of classic and modbus_ascii 7E1, of movitrac 8N1; with '
        '--family as its file says', metavar='FORMAT')
    add('--echo', 'return every byte, as a half-duplex adapter does', **flag)
    add('--gateway-timeout', 'how long the gateway of modbus_tcp waits for a drive (default: '
        f'{GATEWAY_TIMEOUT})', **seconds)
    add('--paced', 'bytes take the time they take on a real line', **flag)
    add('--turnaround', 'how long a drive takes before it answers (default: 0)', **seconds)
    add('--trace', 'write every frame with its time, a JSON object a line', metavar='FILE')
    add('--control', 'socket of the control channel (default: LINK.control; without --link in the '
        "system's temporary folder)", default='', **path)
    # ---- the drives ----
    add('--set', 'a parameter other than factory, by its name in the table of parameters; may be '
        'repeated', **repeated, metavar='NAME=VALUE')
    add('--no-run-input', 'the digital input RUN is not active', dest='run_input', **off)
    add('--boot-time', 'how long a drive is silent after power-on (default: 2)', **seconds)
    add('--serial', 'serial number of a drive, at most 16 characters; once for each drive, in the '
        'order of their addresses (default: made of the address)',
        dest='serial_numbers', **repeated, metavar='TEXT')
    # ---- the PLC before them, over telegram1 ----
    add('--block', 'where the PLC has the block of a drive, once for each drive, in the order of '
        "their addresses (default: at unit ADDRESS, register 0); these are telegram1's",
        dest='blocks', type=_block, **repeated, metavar='UNIT:REGISTER')
    add('--plc-cycle', 'cycle of the program of the PLC (default: 0.01)', dest='cycle', **seconds)
    add('--exchange-time', 'from one telegram between PLC and drive to the next (default: 0.02)',
        dest='exchange', **seconds)
    add('--ros-time', "how long the driver's life counter may stand still for the PLC (default: 1)",
        **seconds)
    add('--drive-time', 'how long the PLC takes the data of a drive for valid that it does not '
        'reach (default: 0.5)', **seconds)
    add('--answer-time', 'how long the PLC takes to answer (s), such as 0.05:0.4 (default: 0)',
        type=_span, metavar='LEAST:MOST')
    add('--no-function-23', 'the PLC refuses function 23',
        dest='write_and_read', **off, default=None)
    add('--not-released', 'the PLC does not release the drives to ROS',
        dest='released', **off, default=None)
    add('--layout', 'layout of the blocks of the PLC; 2 has a mailbox for parameters (default: 1)',
        type=int, choices=(1, 2))
    add('--access-time', "how long each of the PLC's WRREC and RDREC takes (default: 0.02)",
        **seconds)
    add('--longer-telegram', 'the PLC exchanges the longer telegram that a family has beside the '
        'standard one', **flag, default=None)
    # ---- what the manuals leave open ----
    for option in every_option():
        add(f'--{option.name.replace("_", "-")}', option.text,
            choices=tuple(filter(None, option.choices)))
    return parser


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
    parser = _inject_parser()
    try:
        options = parser.parse_args(argv)
        if options.control is None and options.link is None and options.tcp is None:
            raise ValueError('say which simulator: --link, --tcp or --control')
    except ValueError as error:
        parser.exit(2, f'{parser.prog}: error: {error}\n')
    client = Client(options.control or control_path(options.link, options.tcp))
    try:
        if options.verb == 'state':
            _put(json.dumps(_state(client, options.address), indent=2, ensure_ascii=False))
            return 0
        # the simulator has the same parser of words
        words = _which_parser().parse_known_args(argv)[1]
        for address in options.address or (None,):
            client.call('inject', words=words, address=address)
    except ControlError as error:
        print(f'simulator inject: {error}', file=sys.stderr)
        return 1
    except OSError as error:
        why = f'the output cannot be written: {error.strerror}'
        print(f'simulator inject: {why}', file=sys.stderr)
        return 1
    return 0


def _put(text: str) -> None:
    """Print a text, as far as there is a reader (OSError: it cannot be written)."""
    try:
        print(text, flush=True)
    except OSError as error:
        # Python would complain once more at the end
        with open(os.devnull, 'w', encoding='utf-8') as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            raise


def _state(client: Client, addresses: Sequence[int]) -> Mapping[Any, Any]:
    """Return the state of one drive, or those of several or all by address."""
    if len(addresses) == 1:
        return client.state(addresses[0])
    return {address: client.state(address) for address in addresses} or client.states()


def _which_parser() -> Parser:
    """Return what takes the options that say to which simulator something happens."""
    parser = Parser(add_help=False)
    parser.add_argument('--link', metavar='PATH', help='the pseudo-terminal that it serves')
    parser.add_argument('--tcp', type=int, metavar='PORT', help='the TCP port that it serves')
    parser.add_argument('--control', metavar='PATH', help='its control channel')
    parser.add_argument(
        '--address',
        type=_addresses,
        default=(),
        metavar='LIST',
        help='the drives, such as 1-10,20; needed where there are several and it happens to one',
    )
    return parser


def _inject_parser() -> Parser:
    parser = Parser(
        prog='simulator inject',
        description='Makes something happen to a running simulator.',
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        parents=[_which_parser()],
    )
    text = 'print the state of the drives as JSON'
    add_verbs(parser, every_injection()).add_parser('state', help=text, description=text)
    return parser
