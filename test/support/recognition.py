# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive of another make, to which a stop means something else; what was written to a line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from nfo_sinus_driver.catalog.declared import SUFFIX
from support.described import SHIPPED
from support.rig import Rig

#: What is refused by the other drive, as of its kin: the registers of group 09.
_MOVED = {'serial.address': 0x2900, 'serial.fault': 0x2902, 'serial.timeout': 0x2903}


def other_make(
    folder: Path, *, answers_all: bool = False, also: Mapping[str, Any] | None = None
) -> str:
    """
    Return the file of a drive with the registers of a Delta VFD-EL, to which 2000h := 1 is run.

    :param answers_all: it has every register that the driver of a VFD-EL reads.
    :param also: more of its parameters, as a file has them.
    """
    file: dict[str, Any] = yaml.safe_load(SHIPPED['delta_vfd_el'].read_text(encoding='utf-8'))
    file['title'] = 'PI130'
    file['control'] |= {
        'run': [{'register': 0x2000, 'value': 0x01}], 'stop': [{'register': 0x2000, 'value': 0x05}],
    }
    file['setpoint']['direction'] = {'register': 0x2000, 'forward': 0x01, 'reverse': 0x02}
    file['parameters'] |= also or {}
    if not answers_all:
        for key, register in _MOVED.items():
            file['parameters'][key]['register'] = register
    path = folder / f'other{SUFFIX}'
    path.write_text(yaml.safe_dump(file), encoding='utf-8')
    return str(path)


def writes_on_line(rig: Rig) -> list[str]:
    """Return the frames that write registers or coils, of those that were on a line of Modbus."""
    return list(_writes(rig))


def _writes(rig: Rig) -> Iterator[str]:
    for frame in rig.line.frames:
        if frame['direction'] == 'request' and _function(rig, frame['hex']) in (5, 6, 15, 16, 23):
            yield frame['hex']


def _function(rig: Rig, shown: str) -> int:
    data = bytes.fromhex(shown)
    if rig.connection.protocol == 'modbus_ascii':
        data = bytes.fromhex(data[1:-2].decode())
    return data[7] if rig.connection.protocol in ('modbus_tcp', 'telegram1') else data[1]
