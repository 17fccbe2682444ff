# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0
"""
What a G2 has in its object dictionary, and what CANopen does to it [M0 §6.4].

What of the communication profile it has, and how its values stand, the manual does not say: see
:class:`CanopenShape`. The objects of DS402 [M0 table 11] are not there.
"""

from __future__ import annotations

from collections.abc import Iterator
import zlib

from nfo_sinus_driver.catalog import Access, Parameter
from nfo_sinus_driver.simulator import canopen
from nfo_sinus_driver.simulator.canopen import Entries, Entry, Identity
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused, carried, kept
from nfo_sinus_driver.simulator.sinus_g2.canopen_shape import (
    FROM_ONE,
    HELD,
    NARROW,
    NONE,
    SECOND,
    WIDE,
)
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit

_PROTOCOL = 'canopen'
#: A drive of profile 402, a frequency converter.
_DEVICE_TYPE = 0x0001_0192
#: Made up: no manual tells vendor and product.
_VENDOR, _PRODUCT = 0x0000_001B, 0x0000_0038
_NAME, _HARDWARE, _SOFTWARE = 0x1008, 0x1009, 0x100A
_LOG_ENTRY = 4
_WIDE, _NARROW = 4, 1
#: The elements of InvSt, by the order in which the manual prints them.
_STATUSES = ('fieldbus.inv_st_with_ack', 'fieldbus.inv_st')


class Server(canopen.Server):
    """The CANopen side of one G2."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, G2ControlUnit)
        self._unit = drive.control_unit
        self._shape = self._unit.canopen
        super().__init__(drive, self._shape.profile)

    def identity(self) -> Identity:
        """Return who it is, as far as it is in the profile."""
        number = self.drive.memory.number
        revision = f'{number("fieldbus.sw_ver"):.2f} / {number("fieldbus.nfo_ver"):.0f}'
        serial = self.drive.serial_number.strip()
        # a serial number may have letters, that of CANopen is a number
        value = int(serial) if serial.isdigit() else zlib.crc32(serial.encode())
        return Identity(
            device_type=_DEVICE_TYPE,
            vendor=_VENDOR,
            product=_PRODUCT,
            revision=round(100 * number('fieldbus.sw_ver')),
            serial=value & 0xFFFF_FFFF,
            texts={_NAME: 'NFO Sinus', _HARDWARE: '1.00', _SOFTWARE: revision},
        )

    def established(self) -> None:
        """Hold the drive in bus mode from now on."""
        if self._shape.canopen_bus_mode == HELD:
            self._unit.hold_bus_mode()

    def lost(self) -> None:
        """Let go of the drive, which may stop for it."""
        self._unit.bus_lost()

    def entries(self) -> Entries:
        """Return the parameters and the error log."""
        found = {(index, sub): self._entry(one) for index, sub, one in self._places()}
        if self._shape.canopen_sub_indices == FROM_ONE:
            arrays = {index for index, sub in found if sub}
            for index in arrays:
                most = max(sub for other, sub in found if other == index)
                found[index, 0] = canopen.constant(most, 1)
        if self._shape.canopen_error_log != NONE:
            first = int(self._shape.canopen_error_log, 16)
            found |= {(first + n, 0): self._log_entry(n) for n in range(self.drive.faults.log_size)}
        return found

    def _places(self) -> Iterator[tuple[int, int, Parameter]]:
        """Give index and sub-index of each parameter."""
        model, shape = self.drive.model, self._shape
        version = self.drive.version
        for parameter in model.values():
            since = parameter.since
            younger = since is not None and version is not None and version < since
            if younger or _PROTOCOL not in parameter.addresses:
                continue
            address = parameter.at(_PROTOCOL)
            sub_index = address.sub_index or 0
            if sub_index and shape.canopen_sub_indices != FROM_ONE:
                sub_index -= 1
            if parameter.key in _STATUSES and shape.canopen_acknowledging == SECOND:
                other = _STATUSES[1 - _STATUSES.index(parameter.key)]
                yield address.index, sub_index, model[other]
            else:
                yield address.index, sub_index, parameter

    def _size(self, parameter: Parameter) -> int:
        """Return how many bytes a parameter has."""
        usual = parameter.at(_PROTOCOL).codec.size
        if self._shape.canopen_types == WIDE:
            return max(usual, _WIDE)
        codes = parameter.labels
        if self._shape.canopen_types == NARROW and codes and max(codes) < 0x80:
            return _NARROW
        return usual

    def _entry(self, parameter: Parameter) -> Entry:
        address, size = parameter.at(_PROTOCOL), self._size(parameter)
        codec, drive, key = address.number, self.drive, parameter.key

        def read() -> bytes:
            raw = carried(parameter, drive.read_raw(key), _PROTOCOL)
            if size == codec.size:
                return codec.encode(raw)
            return raw.to_bytes(size, 'little', signed=codec.signed)

        def write(data: bytes) -> None:
            if size == codec.size:
                raw = codec.decode(data)
            else:
                raw = int.from_bytes(data, 'little', signed=codec.signed)
            if not codec.fits(raw):
                raise Refused(Reason.VALUE, f'{key} cannot be {raw}')
            drive.write_raw(key, kept(parameter, raw, _PROTOCOL))
            self._unit.written(key, _PROTOCOL)

        writable = parameter.access in (Access.WRITE, Access.READ_WRITE)
        readable = parameter.access is not Access.WRITE
        return Entry(size, read if readable else None, write if writable else None)

    def _log_entry(self, entry: int) -> Entry:
        faults = self.drive.faults
        return Entry(_LOG_ENTRY, lambda: canopen.number(faults.log_entry(entry), _LOG_ENTRY))
