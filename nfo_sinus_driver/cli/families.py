# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The verb ``family``, and the command ``families``: drives that files describe."""

from __future__ import annotations

import argparse
import sys

from nfo_sinus_driver import catalog
from nfo_sinus_driver.catalog.finding import every, find
from nfo_sinus_driver.cli.console import OutputLost, UsageError, put, put_columns, remark
from nfo_sinus_driver.cli.options import Verb

#: What many manuals print for the register that is sent as 0.
_PRINTED_FROM = 40001
#: What is no register.
_COILS = ('coil', 'pulse')
#: What the numbers of a file were taken from.
_RUNGS = {
    'manual': "from its maker's manual, on no drive yet",
    'master': 'from a master that runs such drives, on none by this driver yet',
    'capture': 'from frames of a real drive, on none by this driver yet',
    'drive': 'has run a real drive',
}


class Family(Verb):
    """Check files that describe drives (NAME.vfd.yaml), or list the families that are found."""

    json = False

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Take what to do, and the files."""
        parser.add_argument('action', choices=('check', 'list'), help='what to do')
        parser.add_argument(
            'files', nargs='*', metavar='FILE',
            help='with check: NAME.vfd.yaml, package://PACKAGE/PATH, or the name of a family',
        )

    def main(self, options: argparse.Namespace) -> int:
        """Do it; check fails where a file is wrong."""
        if bool(options.files) != (options.action == 'check'):
            raise UsageError('family check takes one file or more, family list takes none')
        if options.action == 'list':
            put_families()
            return 0
        right = [check(name) for name in options.files]
        return int(not all(right))


def check(name: str) -> bool:
    """Check a file, print what is wrong in it or what it describes; return whether it is right."""
    try:
        model = find(name)
        family = catalog.load_family(model)
    except (catalog.CatalogError, ValueError) as error:
        put(str(error))
        return False
    profile = family.profile
    said = f', {_RUNGS[profile.rung]}' if profile.rung else ''
    put(f'{name}: {profile.title}, {len(family.settings)} settings{said}')
    for note in (*family.unused, *notes(family)) if catalog.is_described(model) else ():
        put(f'  {note}')
    return True


def notes(family: catalog.Family) -> list[str]:
    """Return what an operator has to know of a drive that is described so."""
    profile = family.profile
    found = []
    (target,) = profile.setpoints.values()
    (method,) = profile.methods.values()
    if target.forward_only:
        found.append('it turns forward only: neither signed nor direction')
    if profile.status_word.sizes and not catalog.Fact.REVERSE & profile.status_word.valid:
        found.append(
            'its frequency has no sign, and nothing reports the direction: the status shows the '
            'direction commanded, and no value while others command. Add reverse to status (the '
            'sign of another register will do: {register: R, bit: 15}), or a type with a sign'
        )
    if target.is_command:
        found.append('it has no run command: nothing but set-point 0 stops it over the line')
    elif profile.status_word.runs_by_turning:
        found.append(
            'its status shows a run only while the motor turns: that an enable has been carried '
            'out shows with the first set-point that is not 0; use a bit that says so, if there is '
            'one'
        )
    if not profile.identify:
        found.append(
            'nothing tells it from another drive with these registers, and any such is written to: '
            'add identify, with a register whose numbers its manual gives (type, size, software), '
            'such as identify: [{register: 0x0000, values: [2, 4, 6]}]'
        )
    if not method.coasts and not target.is_command:
        found.append('it has no coast: quick_stop is an ordinary stop, or a quick ramp')
    if not family.key(catalog.Role.COMMUNICATION_TIMEOUT):
        found.append('it has no time-out of its own: the motor runs on when the driver is gone')
    if profile.keeps_run is None:
        command = 'set-point' if target.is_command else 'run command'
        found.append(
            f'does its {command} survive a power cycle? Look in the manual, or try it without the '
            'motor, and add keeps_run: true or keeps_run: false; with true a silence of 0.4 s '
            'stops the motor'
        )
    parameters = [parameter for parameter in family.values() if 'modbus' in parameter.addresses]
    addresses = [parameter.at('modbus') for parameter in parameters]
    registers = [address.index for address in addresses if address.space not in _COILS]
    if min(registers, default=0) >= _PRINTED_FROM:
        found.append(
            f'its registers are sent as {min(registers)} and above: if the first one that its '
            f'manual prints is {_PRINTED_FROM}, add numbering: {_PRINTED_FROM} under line'
        )
    shown = catalog.Fact.NETWORK_CONTROL in profile.status_word.valid
    if not (shown or profile.holders):
        found.append(
            'nothing tells who has control: a motor that runs is stopped when the driver connects'
        )
    return found


def put_families() -> None:
    """Print all families that are found, and where."""
    found = sorted(every(), key=lambda family: family.name)
    rows = [(family.name, family.title, family.of, family.place) for family in found]
    put_columns([('family', 'title', 'found in', 'place'), *rows])


def main() -> int:
    """Run the command ``families``."""
    if sys.argv[1:2] and sys.argv[1] != '--ros-args':
        put('usage: families lists the families of drives that are found, and where')
        return 0 if sys.argv[1] in ('-h', '--help') else 2
    try:
        put_families()
    except OutputLost as error:
        if not isinstance(error.__cause__, BrokenPipeError):
            remark(str(error))
        return 1
    return 0
