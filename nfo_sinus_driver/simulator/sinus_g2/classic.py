# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a G2 does with Classic messages ([M0 §6.1], [M2]).

A message that cannot be carried out sets a flag of SioErr, and while the bus has control that is a
serial fault: the motor coasts, MODE becomes Stop [M0 §6.1.5].
"""

from __future__ import annotations

from collections.abc import Mapping
import functools

from nfo_sinus_driver.catalog import Access, Family, Parameter, to_bytes, to_words
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd
from nfo_sinus_driver.simulator import classic
from nfo_sinus_driver.simulator.classic import Wrong
from nfo_sinus_driver.simulator.classic_frames import LineError
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused, carried, kept
from nfo_sinus_driver.simulator.motor import measure
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit

#: Counters of 24 bits [C26].
_COUNTERS = frozenset({'status.op_time', 'status.rn_time', 'status.br_time'})
_REFERENCES = frozenset({'status.frq_set', 'status.spd_set', 'status.trq_set', 'status.reg_set'})
_FLAGS: Mapping[Reason, LineError] = {
    # there are no functions here, only parameters
    Reason.FUNCTION: LineError.UNKNOWN,
    Reason.ADDRESS: LineError.UNKNOWN,
    Reason.VALUE: LineError.OUT_OF_RANGE,
    Reason.STATE: LineError.NOT_PERMITTED,
}


class Server(classic.Server):
    """The Classic side of one G2; so many times yet a counter ``tears`` while it is read."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, G2ControlUnit)
        self._drive = drive
        self._unit = drive.control_unit
        self._firmware = self._unit.firmware
        self._ids = _ids(drive.model)
        self.own_address = self._firmware.own_address
        self.lower_case = self._firmware.lower_case
        self.tears = 0

    def enquiry(self, id_: int) -> int:
        """Return the word that stands at an id."""
        log = self._drive.model.error_logs['classic']
        entry, position = divmod(id_ - log.first, log.stride)
        if 0 <= entry < self._firmware.log_size:
            return to_words(log.codec.encode(self._drive.faults.log_entry(entry)))[position]
        parameter, position = self._find(id_)
        if parameter.access is Access.WRITE:
            raise Wrong(LineError.UNREADABLE)
        try:
            raw = self._read(parameter.key)
        except Refused as refused:
            raise Wrong(_FLAGS[refused.reason]) from refused
        raw *= 10 if parameter.key in self._firmware.tenths else 1
        if parameter.key in _COUNTERS:
            # nobody says whether the drive has more than the 24 bits that count [C26]
            high = 0xFF if self._firmware.short_counters else 0xFFFF
            raw = self._drive.read_raw(parameter.key)
            words: tuple[int, ...] = (raw & 0xFFFF, raw >> 16 & high)
        else:
            words = to_words(parameter.at('classic').number.encode(raw))
        if len(words) > 1 and self.tears:
            role, factor = self._drive.model.role_of.get(parameter.key), parameter.factor('classic')
            self.tears -= self._drive.counters.carry(role, float(factor))
        return words[position]

    def select(self, id_: int, word: int, *, to_all: bool) -> None:
        """Set the parameter at an id."""
        drive, firmware = self._drive, self._firmware
        parameter, _ = self._find(id_)
        key = parameter.key
        closed = key in _REFERENCES and not firmware.sets_references
        if closed or parameter.access not in (Access.WRITE, Access.READ_WRITE):
            raise Wrong(LineError.UNWRITABLE)
        raw = parameter.at('classic').number.decode(to_bytes([word]))
        if key == 'fieldbus.scmd':
            raw = self._understood(raw)
        if drive.faults and not self._in_spite_of_a_fault(key, raw, to_all):
            raise Wrong(LineError.BLOCKED)
        if firmware.bus_only and not self._permitted(key, raw):
            raise Wrong(LineError.NOT_PERMITTED)
        if key in firmware.codes and raw not in firmware.codes[key]:
            raise Wrong(LineError.OUT_OF_RANGE)
        if key == 'serial.address' and raw > firmware.most_address:
            raise Wrong(LineError.OUT_OF_RANGE)
        try:
            drive.write_raw(key, kept(parameter, raw, 'classic'))
        except Refused as refused:
            blocked = refused.reason is Reason.STATE and drive.faults
            raise Wrong(LineError.BLOCKED if blocked else _FLAGS[refused.reason]) from refused
        self._unit.written(key, 'classic')

    def refused(self, flag: LineError) -> bool:
        """Set the flag of SioErr; NAK but for what did not arrive whole."""
        self._unit.serial_error(flag)
        # what did not arrive whole has not arrived; of a check sum [M2 §6] thinks otherwise
        damage = LineError(0) if self._firmware.naks_damage else LineError.CHECK_SUM
        return not flag & (LineError.STRUCTURE | damage)

    def _in_spite_of_a_fault(self, key: str, raw: int, to_all: bool) -> bool:
        """Whether a SELECT is one of those that an active fault does not keep off [M0 §6.1.5]."""
        if key in ('fieldbus.drive_control', 'fieldbus.drv_ctrl_write_mask'):
            return True
        stops = key == 'fieldbus.mode' and raw == Mode.STOP
        return stops and self._unit.faults.serial and (to_all or self._firmware.obeys_stop)

    def _find(self, id_: int) -> tuple[Parameter, int]:
        found = self._ids.get(id_)
        if found is None or found[0].key in self._firmware.lacks:
            raise Wrong(LineError.UNKNOWN)
        since, version = found[0].since, self._drive.version
        if since is not None and version is not None and version < since:
            raise Wrong(LineError.UNKNOWN)
        return found

    def _read(self, key: str) -> int:
        """Read a parameter as this protocol carries it, side effects included."""
        drive = self._drive
        raw = drive.read_raw(key)
        key = self._unit.key_of(key)
        parameter, role = drive.model[key], drive.model.role_of.get(key)
        # what is measured may be finer here than in the memory, but for what the unit shows itself
        shown = None
        if self._unit.show(key) is None:
            shown = measure(role, parameter, 'classic', drive.motor, drive.counters)
        return carried(parameter, raw, 'classic') if shown is None else shown

    def _understood(self, raw: int) -> int:
        """Return an SCMD as the drive understands it: to the old one much means Stop [C31]."""
        if not self._firmware.even_stops:
            return raw
        if raw == Scmd.RESET_E_OUT:
            raise Wrong(LineError.OUT_OF_RANGE)
        return raw if raw & 1 or raw & Scmd.ERASE_E_LOG else Scmd.STOP

    def _permitted(self, key: str, raw: int) -> bool:
        """Whether MODE permits a SELECT, where nothing is changed before MODE = Sio [C100]."""
        mode = self._unit.mode
        if mode == Mode.INHIBIT:
            # whether this is taken is left to the drive's variant [C101]
            return key == 'fieldbus.scmd' and raw == Scmd.STOP
        return mode == Mode.BUS or key == 'fieldbus.mode'


@functools.cache
def _ids(model: Family) -> Mapping[int, tuple[Parameter, int]]:
    """Return which parameter stands at which id, and which of its words."""
    return {
        id_: (parameter, position)
        for parameter in model.values()
        if 'classic' in parameter.addresses
        for position, id_ in enumerate(parameter.at('classic').numbers)
    }
