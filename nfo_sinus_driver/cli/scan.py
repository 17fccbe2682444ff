# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``scan``: what answers on the line, and the parameter file of a driver for them."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
import copy
from datetime import datetime
import json
import os

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Role, load_family, load_parameter, load_profile
from nfo_sinus_driver.catalog.finding import PACKAGE
from nfo_sinus_driver.cli.console import (
    CliError,
    UsageError,
    as_json,
    listed,
    progress,
    put,
    remark,
    say,
)
from nfo_sinus_driver.cli.options import DEFAULTS, OF_SCAN, Verb, add_flag, addresses
from nfo_sinus_driver.cli.parameter_file import STANDARD, write_file
from nfo_sinus_driver.cli.session import OfflineDrive, Session
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive.known.settings import AUTO
from nfo_sinus_driver.link import PROTOCOLS, DamagedAnswer, NoAnswer, PortError, Refused
from nfo_sinus_driver.link.interface import NeverSilent

#: Parity and stop bits that are tried [M0 §6.2.2].
_PARITIES = ('E1', 'O1', 'N2')
_LIKELIEST = (19200, 9600, 57600, 38400, 4800, 2400, 1200, 115_200)
#: How often an address that gave a damaged answer is asked again.
_DAMAGE_RETRIES = 2
#: The columns and their widths.
_COLUMNS = (('address', 7), ('line', 10), ('product', 20), ('firmware', 11), ('serial number', 0))


class Scan(Verb):
    """Find out who answers on the line."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add what may be typed."""
        parser.add_argument(
            '--addresses', type=addresses, default=(), metavar='LIST',
            help='such as 1-10,20 (default: 1-247; modbus_tcp: 255, too; classic: 1-94; movitrac: '
            '0-63; canopen: 1-127)',
        )
        add_flag(
            parser, '--all-settings', 'try every baud rate and parity; takes long; not for canopen',
        )
        parser.add_argument(
            '--params', metavar='FILE',
            help='write a parameter file for the driver, with all that was found; - is the '
            'standard output',
        )
        add_flag(parser, '--force', 'let --params replace a file')

    def complete(self, options: argparse.Namespace) -> None:
        """Ask every address, and briefly; ``--retries`` is for silent addresses, too."""
        options.silence_retries = getattr(options, 'retries', OF_SCAN['retries'])
        if not hasattr(options, 'response_timeout'):
            options.response_timeout = OF_SCAN['response_timeout']
        if not options.addresses:
            protocol = PROTOCOLS[getattr(options, 'protocol', DEFAULTS['protocol'])]
            alone = protocol.point_to_point
            options.addresses = tuple(unit for unit in protocol.units if unit != alone)

    def main(self, options: argparse.Namespace) -> int:
        """Find out who answers on the line."""
        if options.params is not None:
            _require_new(options.params, force=options.force)
        # a parameter file on the standard output is alone there
        show = remark if options.params == STANDARD else put
        found: dict[int, dict[str, str]] = {}
        lines_of: dict[int, tuple[int, str]] = {}
        for address, line, facts in _find(options):
            if not options.json:
                if not found:
                    show(_row({name: name for name, _ in _COLUMNS}))
                show(_row({'address': f'{address:>7}', **facts}))
            found[address], lines_of[address] = facts, line
        if options.json:
            drives = [{'address': address, **facts} for address, facts in sorted(found.items())]
            show(as_json(drives, indent=2))
        if not found:
            protocol = PROTOCOLS[options.protocol]
            others = '' if protocol.rates_disturb else (
                ' (--all-settings tries all that the protocol can have), A and B of the wires'
            )
            raise CliError(f'no response: check in this order: {protocol.check}{others}')
        if options.params is not None:
            _write_params(options, found, lines_of)
        return 0


_Found = tuple[int, tuple[int, str], dict[str, str]]


def _find(options: argparse.Namespace) -> Iterator[_Found]:
    """Yield each drive that answers, once: its address, its line, and what it says of itself."""
    lines = _lines(options)
    left = list(options.addresses)
    with progress('scanning', len(lines) * len(left)) as step:
        for baud_rate, char_format in lines:
            for _ in range(len(options.addresses) - len(left)):
                step()
            line = copy.copy(options)
            line.baud_rate, line.char_format = baud_rate, char_format
            with Session(line) as session:
                for address in tuple(left):
                    facts = _ask(session.drive(address), options.silence_retries)
                    step()
                    if facts is not None:
                        named = f'{baud_rate} {char_format}'.rstrip()
                        facts['line'] = named if baud_rate else 'gateway'
                        left.remove(address)
                        yield address, (baud_rate, char_format), facts


def _write_params(
    options: argparse.Namespace,
    found: Mapping[int, Mapping[str, str]],
    lines: Mapping[int, tuple[int, str]],
) -> None:
    """Write what the driver needs to start with the drives found, if they speak alike."""
    if len(set(lines.values())) > 1:
        found_at = [f'{address}: {facts["line"]}' for address, facts in sorted(found.items())]
        key = load_family(options.model).key(Role.BAUD_RATE)
        how = f'nfo-sinus set {key}=...' if key else ''
        raise CliError(
            listed(
                'no parameter file was written: one line has one baud rate and format, and the '
                f'drives have several; set them alike ({how or "at the keypad"})',
                found_at,
            )
        )
    baud_rate, char_format = next(iter(lines.values()))
    write_file(options.params, _driver_params(options, baud_rate, char_format, found))
    if options.params != STANDARD:
        remark(
            f'saved in {options.params}; start the driver with it: ros2 run nfo_sinus_driver '
            f'driver --ros-args --params-file {options.params}'
        )


def _lines(options: argparse.Namespace) -> Sequence[tuple[int, str]]:
    protocol = PROTOCOLS[options.protocol]
    if protocol.rates_disturb:
        if options.all_settings:
            raise UsageError(
                f'--all-settings: on {protocol.name} a wrong bit rate disturbs all other nodes, so '
                'none is tried; say --baud-rate'
            )
        return [(options.baud_rate or protocol.baud_rate, '')]
    if not protocol.char_formats:
        # the line is that of the gateway
        return [(0, '')]
    if options.all_settings:
        usual = [format_ for format_ in protocol.char_formats if format_[1:] in _PARITIES]
        rates = sorted(protocol.baud_rates, key=_LIKELIEST.index)
        formats = usual or protocol.char_formats
        return [(baud_rate, format_) for baud_rate in rates for format_ in formats]
    return [(options.baud_rate or protocol.baud_rate, options.char_format or protocol.char_format)]


def _ask(drive: OfflineDrive, silence_retries: int) -> dict[str, str] | None:
    """Return what answers at an address (DriveError: the port cannot be used)."""
    try:
        drive.do(lambda: _first_answer(drive, silence_retries))
        identity = drive.identify()
    except DriveError as error:
        cause = error.__cause__
        if isinstance(cause, PortError):
            raise
        if isinstance(cause, Refused):
            return {
                'product': f'no {drive.model.name}?',
                'firmware': '',
                'serial number': '',
                'model': AUTO,
            }
        if not isinstance(cause, NoAnswer):
            remark(say(error))
        return None
    return {
        'product': identity.model or drive.model.name,
        'firmware': identity.versions,
        'serial number': identity.serial,
        'model': drive.model.name,
    }


async def _first_answer(drive: OfflineDrive, silence_retries: int) -> None:
    """
    Have an address answer once.

    After silence it is asked again so often: most addresses have no drive. After a damaged answer
    it always is, for there is one.
    """
    damage_retries = _DAMAGE_RETRIES
    status = drive.model.key_of_status
    while True:
        try:
            await drive.params.read_data(status, Priority.POLL, retry=False)
            return
        except NoAnswer:
            if not silence_retries:
                raise
            silence_retries -= 1
        except NeverSilent:
            # nothing was asked
            raise
        except DamagedAnswer:
            if not damage_retries:
                raise
            damage_retries -= 1


def _row(facts: dict[str, str]) -> str:
    return '  '.join(f'{facts[name]:<{width}}' for name, width in _COLUMNS).rstrip()


_HEAD = """\
# {count} found by nfo-sinus scan on {date}.
#
#   ros2 launch nfo_sinus_driver driver.launch.py params_file:=FILE
#   ros2 run nfo_sinus_driver driver --ros-args --params-file FILE
#
# Rename the drives as you like, in `drives` and in front of their sections. Every parameter is
# listed in docs/interface.md; what is left out here keeps its default.

# What holds for every drive; the sections below may say otherwise.
/**:
  ros__parameters:
    # The driver ramps the motor down when no fresh set-point came for this long, s.
    setpoint_timeout: 2.5

/**/nfo_sinus_bus:
  ros__parameters:
"""
_DRIVE = """
# {named}
/**/{name}:
  ros__parameters:
    address: {address}
"""
_TIMEOUT = """\
    # The drive stops the motor by itself when it has heard nothing for this long, s. The driver
    # writes it to the drive ({written}) with the first enable.
    drive_timeout: 2.0
"""
#: What is written only if it is not what the driver takes by itself.
_IF_OTHER = ('response_timeout', 'retries')
#: What of a drive is written only if it was given.
_OF_A_DRIVE = ('control_method', 'block_address', 'telegram_words')


def _require_new(name: str, *, force: bool) -> None:
    """Ensure that it can be written, and replaces no file that may have been edited since."""
    folder = os.path.dirname(name)
    if os.path.isdir(name):
        such = os.path.join(name, 'line.yaml')
        raise CliError(f'{name} is a folder: name a file in it, such as {such}')
    if folder and not os.path.isdir(folder):
        raise CliError(f'{name} cannot be written: there is no folder {folder}')
    if name != STANDARD and not force and os.path.lexists(name):
        raise CliError(f'{name} exists already: choose another name, or say --force to replace it')


def _driver_params(
    options: argparse.Namespace,
    baud_rate: int,
    char_format: str,
    found: Mapping[int, Mapping[str, str]],
) -> str:
    """Return a parameter file with which the driver starts with what was found, by address."""
    names = {address: f'drive_{address}' for address in sorted(found)}
    line: dict[str, object] = {'port': options.port, 'protocol': options.protocol}
    if baud_rate:
        line['baud_rate'] = baud_rate
    if char_format:
        line['char_format'] = char_format
    for name in _IF_OTHER:
        # a scan is content with less time than the driver should give
        if getattr(options, name) > DEFAULTS[name]:
            line[name] = getattr(options, name)
    line['drives'] = list(names.values())
    count = 'one drive' if len(names) == 1 else f'{len(names)} drives'
    date = f'{datetime.now().astimezone():%Y-%m-%d %H:%M %z}'
    # what JSON has is YAML, too
    settings = [f'    {name}: {json.dumps(value)}\n' for name, value in line.items()]
    drives = [
        _DRIVE.format(named=_named(facts), name=names[address], address=address)
        + _how_it_is_reached(options, facts['model'])
        + _timeout(options, facts['model'])
        for address, facts in sorted(found.items())
    ]
    return ''.join((_HEAD.format(count=count, date=date), *settings, *drives))


def _how_it_is_reached(options: argparse.Namespace, model: str) -> str:
    """Return the settings by which the scan has found a drive, without which it is not found."""
    settings = {'model': model}
    if options.family and model != AUTO:
        # a path counts from the folder in which it was typed
        typed = options.family
        is_path = typed.endswith('.yaml') or os.sep in typed
        named = typed.startswith(PACKAGE) or not is_path
        settings = {'family': typed if named else options.model}
    given = {name: getattr(options, name) for name in _OF_A_DRIVE}
    settings |= {name: value for name, value in given.items() if value != DEFAULTS[name]}
    return ''.join(f'    {name}: {json.dumps(value)}\n' for name, value in settings.items())


def _timeout(options: argparse.Namespace, model: str) -> str:
    """Return what the file says of the time-out of the drive itself, where a model has one."""
    methods = load_profile(options.model).methods
    method = methods.get(options.control_method) or next(iter(methods.values()))
    timeout = load_parameter(options.model, Role.COMMUNICATION_TIMEOUT)
    if model == AUTO or timeout is None or method.addressing in PROTOCOLS[options.protocol].carries:
        # behind a PLC it is not used
        return ''
    family = load_family(options.model)
    names = [timeout.name, *(family[key].name for key in family.profile.timeout_conditions)]
    return _TIMEOUT.format(written=' and '.join(names))


def _named(facts: Mapping[str, str]) -> str:
    """Return what a drive reports of itself, fit for a comment."""
    names = {'product': '', 'firmware': 'firmware ', 'serial number': 'serial '}
    text = ', '.join(f'{name}{facts[fact]}' for fact, name in names.items() if facts[fact])
    return ''.join(char if char.isprintable() else ' ' for char in text)
