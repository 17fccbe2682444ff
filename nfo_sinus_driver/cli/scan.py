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

"""The verb ``scan``: who answers on the line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from collections.abc import Iterator
from collections.abc import Mapping
from collections.abc import Sequence
import copy
import json

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.cli.driver_params import driver_params
from nfo_sinus_driver.cli.driver_params import require_new
from nfo_sinus_driver.cli.errors import CliError
from nfo_sinus_driver.cli.errors import listed
from nfo_sinus_driver.cli.parameter_file import STANDARD
from nfo_sinus_driver.cli.parameter_file import write_file
from nfo_sinus_driver.cli.progress import progress
from nfo_sinus_driver.cli.progress import put
from nfo_sinus_driver.cli.progress import remark
from nfo_sinus_driver.cli.session import Remote
from nfo_sinus_driver.cli.session import Session
from nfo_sinus_driver.cli.wording import say
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive.settings import AUTO
from nfo_sinus_driver.link import PROTOCOLS
from nfo_sinus_driver.link import NoAnswer
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.link.settings import BAUD_RATES

#: Parity and stop bits that are tried [M0 §6.2.2].
_PARITIES = ('E1', 'O1', 'N2')
_LIKELIEST = (19200, 9600, 57600, 38400, 4800, 2400, 1200)
#: The columns and their widths.
_COLUMNS = (
    ('address', 7),
    ('line', 10),
    ('product', 20),
    ('firmware', 11),
    ('serial number', 0),
)


def scan(options: argparse.Namespace) -> int:
    """Find out who answers on the line."""
    assert set(_LIKELIEST) == set(BAUD_RATES)
    if options.params:
        require_new(options.params, force=options.force)
    # a parameter file on the standard output is alone there
    show = remark if options.params == STANDARD else put
    lines = _lines(options)
    found: dict[int, dict[str, str]] = {}
    lines_of: dict[int, tuple[int, str]] = {}
    with progress('scanning', len(lines) * len(options.addresses)) as step:
        for baud_rate, char_format in lines:
            line = copy.copy(options)
            line.baud_rate, line.char_format = baud_rate, char_format
            asked = [address for address in options.addresses if address not in found]
            for _ in range(len(options.addresses) - len(asked)):
                step()
            for address, facts in _who_answers(line, asked, step):
                facts['line'] = f'{baud_rate} {char_format}' if baud_rate else 'gateway'
                if not found and not options.json:
                    show(_row({name: name for name, _ in _COLUMNS}))
                found[address] = facts
                lines_of[address] = line.baud_rate, line.char_format
                if not options.json:
                    show(_row({'address': f'{address:>7}', **facts}))
    if options.json:
        drives = [{'address': address, **facts} for address, facts in sorted(found.items())]
        show(json.dumps(drives, ensure_ascii=False, indent=2))
    if not found:
        check = PROTOCOLS[options.protocol].check
        raise CliError(
            f'no response: check in this order: {check} (--all-settings tries all that the '
            'protocol can have), A and B of the wires'
        )
    if options.params:
        _write_params(options, found, lines_of)
    return 0


def _write_params(
    options: argparse.Namespace,
    found: Mapping[int, Mapping[str, str]],
    lines: Mapping[int, tuple[int, str]],
) -> None:
    """
    Write what the driver needs to start with the drives that were found.

    :raises CliError: they do not speak alike, so that no line could have them all.
    """
    if len(set(lines.values())) > 1:
        told = [f'{address}: {facts["line"]}' for address, facts in sorted(found.items())]
        raise CliError(
            listed(
                'no parameter file was written: one line has one baud rate and format, and the '
                'drives have several; set them alike (nfo-sinus set serial.si_baud=...)',
                told,
            )
        )
    baud_rate, char_format = next(iter(lines.values()))
    write_file(options.params, driver_params(options, baud_rate, char_format, found))
    if options.params != STANDARD:
        remark(
            f'saved in {options.params}; start the driver with it: ros2 run nfo_sinus_driver '
            f'driver --ros-args --params-file {options.params}'
        )


def _lines(options: argparse.Namespace) -> Sequence[tuple[int, str]]:
    protocol = PROTOCOLS[options.protocol]
    if not protocol.char_formats:
        # the line is that of the gateway
        return [(0, '')]
    if options.all_settings:
        usual = [format_ for format_ in protocol.char_formats if format_[1:] in _PARITIES]
        rates = [rate for rate in _LIKELIEST if rate in protocol.baud_rates]
        formats = usual or protocol.char_formats
        return [(baud_rate, format_) for baud_rate in rates for format_ in formats]
    return [
        (options.baud_rate or protocol.baud_rate, options.char_format or protocol.char_format)
    ]


def _who_answers(
    options: argparse.Namespace, addresses: Sequence[int], step: Callable[[], None]
) -> Iterator[tuple[int, dict[str, str]]]:
    """Ask one address after the other, as one line is set."""
    with Session(options) as session:
        for address in addresses:
            facts = _ask(session.drive(address))
            step()
            if facts is not None:
                yield address, facts


def _ask(drive: Remote) -> dict[str, str] | None:
    """
    Return who answers at an address.

    :raises DriveError: the port cannot be used.
    """
    try:
        status = drive.model.key_of_status
        drive.do(lambda: drive.registers.read_data(status, Priority.POLL, once=True))
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


def _row(facts: dict[str, str]) -> str:
    return '  '.join(f'{facts[name]:<{width}}' for name, width in _COLUMNS).rstrip()
