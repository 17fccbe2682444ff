# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A driver loads what it needs: the tables of its family and the link of its protocol."""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

import pytest

from nfo_sinus_driver.catalog import families
from nfo_sinus_driver.link import PROTOCOLS, BusSettings

ROOT = Path(__file__).resolve().parents[2]
PORTS = {'modbus_tcp': 'gateway:502'}
#: The module of the link that speaks each protocol.
LINKS = {
    name: type(BusSettings(PORTS.get(name, '/dev/x'), name).open()).__module__
    for name in PROTOCOLS
}


def said_by(program: str, *arguments: str) -> str:
    """What a program says in an interpreter of its own."""
    command = [sys.executable, '-c', program, *arguments]
    return subprocess.run(command, check=True, cwd=ROOT, capture_output=True, text=True).stdout


@pytest.mark.parametrize('protocol', PROTOCOLS)
def test_only_the_link_that_is_opened_is_loaded(protocol: str) -> None:
    said = said_by(
        'import sys\n'
        'from nfo_sinus_driver.link import BusSettings\n'
        'BusSettings(sys.argv[2], sys.argv[1]).open()\n'
        'print(*sys.modules)',
        protocol,
        PORTS.get(protocol, '/dev/x'),
    )
    assert set(said.split()) & set(LINKS.values()) == {LINKS[protocol]}
    # a gateway has no serial port
    assert ('serial' in said.split()) == (protocol not in PORTS)


@pytest.mark.parametrize('family', families())
def test_only_the_tables_of_the_family_that_is_driven_are_kept(family: str) -> None:
    said = said_by(
        'import gc, sys\n'
        'from nfo_sinus_driver.catalog import Parameter, load_family\n'
        'from nfo_sinus_driver.drive import DriveSettings\n'
        'own = load_family(DriveSettings(model=sys.argv[1]).model)\n'
        'print(sum(isinstance(one, Parameter) for one in gc.get_objects()) - len(own))',
        family,
    )
    # of the others, the time-out alone: the longest of all is the limit of drive_timeout
    assert int(said) < len(families())
