# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Where an adapter is plugged in, as Linux shows it: one that is back may be another one."""

from __future__ import annotations

import os
from pathlib import Path

_SYS = Path('/sys')
#: What tells one USB adapter from another in the same socket; many have no serial number.
_USB = ('idVendor', 'idProduct', 'serial')
#: The channel of a USB adapter that has several of them: of a serial one, of a CAN one.
_CHANNEL = ('device/port_number', 'dev_id', 'dev_port')


def place_of_tty(device: int) -> str:
    """Return where the adapter of a terminal with this device number is; ``''``: unknown."""
    return _place(_SYS / 'dev' / 'char' / f'{os.major(device)}:{os.minor(device)}')


def place_of_interface(name: str) -> str:
    """Return where the adapter of a network interface is; ``''``: unknown."""
    return _place(_SYS / 'class' / 'net' / name)


def _place(entry: Path) -> str:
    try:
        found = entry.resolve(strict=True)
    except OSError:
        # no terminal of a device, such as a pseudo-terminal, or gone already
        return ''
    if _SYS.resolve() / 'devices' / 'virtual' in found.parents:
        # there is a program behind it, or another interface
        return ''
    usb = next((parent for parent in found.parents if (parent / 'idVendor').is_file()), None)
    if usb is None:
        # a part of the computer; its number there is in the name
        return str(found)
    # the adapter has the next free number when it is back while the old one is open still
    way = [part for part in found.relative_to(usb).parts if part != found.name]
    identity = [_read(usb / name) for name in _USB]
    channel = [_read(found / name) for name in _CHANNEL]
    return ' '.join((str(usb), *identity, *way, *channel))


def _read(path: Path) -> str:
    """Return a line of sysfs; ``''`` if there is none."""
    try:
        return path.read_text('utf-8', 'replace').strip()
    except OSError:
        return ''
