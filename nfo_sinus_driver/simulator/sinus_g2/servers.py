# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a G2 answers, by protocol: Modbus [M0 §6.2], Classic [M0 §6.1], CANopen [M0 §6.4], telegram 1.

A Classic message that cannot be carried out sets a flag of SioErr, and while the bus has control
that is a serial fault: the motor coasts, MODE becomes Stop [M0 §6.1.5]. What it has of CANopen's
communication profile, and how its values stand there, the manual does not say: see
:class:`~.firmware.G2Variant`; of DS402 see :mod:`~.ds402`. The words of
telegram 1 are those of PROFIdrive [C111], or DriveControl and DriveStatus [M0 tables 14 to 16];
set-point and actual value are scaled as the parameters are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
import functools
import zlib

from nfo_sinus_driver.catalog import Access, Family, Parameter, to_bytes, to_words
from nfo_sinus_driver.families.sinus_g2.words import ControlWord, Mode, Scmd
from nfo_sinus_driver.simulator import canopen, classic, telegram1
from nfo_sinus_driver.simulator.canopen import Entries, Entry, Identity
from nfo_sinus_driver.simulator.classic import LineError, Wrong
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.memory import Memory, Reason, Refused, carried
from nfo_sinus_driver.simulator.motor import measure
from nfo_sinus_driver.simulator.parameter_channel import (
    Entries as ChannelEntries,
    ParameterChannel,
    ParameterEntry,
    entries_of,
    read_only,
)
from nfo_sinus_driver.simulator.sinus import parts
from nfo_sinus_driver.simulator.sinus_g2.control_unit import G2ControlUnit
from nfo_sinus_driver.simulator.sinus_g2.state_machine import Phase
from nfo_sinus_driver.simulator.telegram1 import Stw1, Zsw1

# ---- Modbus ----

_REVISION_LENGTH = 17
_MODEL_LENGTH = 8


class ModbusServer(parts.ModbusServer):
    """The Modbus side of one G2, which reports who it is."""

    functions = parts.ModbusServer.functions | parts.NEWER

    def __init__(self, drive: SimulatedDrive) -> None:
        super().__init__(drive)
        self._objects = _device_objects(drive.memory)

    def device_objects(self) -> Mapping[int, bytes]:
        """Return the objects of Read Device Identification, by their numbers."""
        return self._objects


def _device_objects(memory: Memory) -> Mapping[int, bytes]:
    """Return the objects of Read Device Identification, by their numbers [M0 §6.2.4]."""
    versions = f' {memory.number("fieldbus.sw_ver"):.2f} / {memory.number("fieldbus.nfo_ver"):.0f} '
    texts = (
        'NFO Drives AB',
        '',
        versions.ljust(_REVISION_LENGTH),
        'http://www.nfo.se',
        'NFO Sinus',
        _model(memory.number('motor.p_nom'), memory.number('motor.u_nom')),
        '',
    )
    return {number: text.encode('ascii') for number, text in enumerate(texts)}


def _model(power: float, voltage: float) -> str:
    """Return power and voltage in 8 characters, such as 1.50/400 or 11.0/400."""
    fitting = (f'{power:.{decimals}f}/{voltage:.0f}' for decimals in (2, 1, 0))
    return next(text for text in fitting if len(text) <= _MODEL_LENGTH).ljust(_MODEL_LENGTH)


# ---- Classic ----

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


class ClassicServer(classic.Server):
    """
    The Classic side of one G2.

    :ivar tears: how many times yet a counter carries while it is read.
    """

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
            # no manual says whether the drive has more than the 24 bits that count [C26]
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
        if closed or not parameter.is_writable:
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
            drive.write_over('classic', parameter, raw)
        except Refused as refused:
            blocked = refused.reason is Reason.STATE and drive.faults
            raise Wrong(LineError.BLOCKED if blocked else _FLAGS[refused.reason]) from refused

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
        lacks = found is None or found[0].key in self._firmware.lacks
        if found is None or lacks or not self._drive.has(found[0]):
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


# ---- CANopen ----

#: A drive of profile 402, a frequency converter.
_DEVICE_TYPE = 0x0001_0192
#: Made up: no manual gives vendor and product.
_VENDOR, _PRODUCT = 0x0000_001B, 0x0000_0038
_NAME, _HARDWARE, _SOFTWARE = 0x1008, 0x1009, 0x100A
_LOG_ENTRY = 4
#: "Not yet implemented" [M0 table 11].
_MISSING = frozenset({0x6076, 0x6087})
#: ProfidriveStatus, ProfidriveControl, DriveControlMaskWrite, DriveControl, DriveStatus.
_STATE_MACHINE = frozenset({0x2001, 0x2003, 0x2011, 0x2012, 0x2013})
#: The objects of a drive profile: their arrays count as CiA 402 says.
_PROFILE = 0x6000
_WIDE, _NARROW = 4, 1


class CanopenServer(canopen.Server):
    """The CANopen side of one G2."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, G2ControlUnit)
        self._unit = drive.control_unit
        self._shape = self._unit.variant
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
        if self._shape.canopen_bus_mode == 'held':
            self._unit.hold_bus_mode()

    def lost(self) -> None:
        """Let go of the drive, which may stop for it."""
        self._unit.bus_lost()

    def entries(self) -> Entries:
        """Return the parameters and the error log."""
        found = {(index, sub): self._entry(place) for index, sub, place in self._places()}
        arrays = {index for index, sub in found if sub} - {index for index, sub in found if not sub}
        for index in arrays:
            most = max(sub for other, sub in found if other == index)
            found[index, 0] = canopen.constant(most, 1)
        if self._shape.canopen_error_log != 'none':
            first = int(self._shape.canopen_error_log, 16)
            found |= {(first + n, 0): self._log_entry(n) for n in range(self.drive.faults.log_size)}
        return found

    def _places(self) -> Iterator[tuple[int, int, Parameter]]:
        """Give index and sub-index of each parameter."""
        model, shape = self.drive.model, self._shape
        absent = _MISSING | (_STATE_MACHINE if shape.canopen_state_machine == 'absent' else set())
        for parameter in model.values():
            if 'canopen' not in parameter.addresses or not self.drive.has(parameter):
                continue
            address = parameter.at('canopen')
            if address.index in absent:
                continue
            sub_index = address.sub_index or 0
            counted = address.index < _PROFILE
            if sub_index and counted and shape.canopen_sub_indices != 'from_one':
                sub_index -= 1
            yield address.index, sub_index, parameter

    def _size(self, parameter: Parameter) -> int:
        """Return how many bytes a parameter has."""
        usual = parameter.at('canopen').codec.size
        if self._shape.canopen_types == 'wide':
            return max(usual, _WIDE)
        codes = parameter.labels
        if self._shape.canopen_types == 'narrow' and codes and max(codes) < 0x80:
            return _NARROW
        return usual

    def _entry(self, parameter: Parameter) -> Entry:
        codec, size, drive = parameter.at('canopen').number, self._size(parameter), self.drive

        def read() -> bytes:
            raw = drive.read_over('canopen', parameter)
            return raw.to_bytes(size, 'little', signed=codec.signed)

        def write(data: bytes) -> None:
            raw = int.from_bytes(data, 'little', signed=codec.signed)
            if not codec.fits(raw):
                raise Refused(Reason.VALUE, f'{parameter.key} cannot be {raw}')
            drive.write_over('canopen', parameter, raw)

        readable = parameter.access is not Access.WRITE
        return Entry(
            size, read if readable else None, write if parameter.is_writable else None
        )

    def _log_entry(self, entry: int) -> Entry:
        faults = self.drive.faults
        return Entry(_LOG_ENTRY, lambda: canopen.number(faults.log_entry(entry), _LOG_ENTRY))


# ---- telegram 1 ----

#: What each bit of STW1 of PROFIdrive is in DriveControl.
_CONTROL = {
    Stw1.ON: ControlWord.SWITCH_ON,
    Stw1.NO_COAST_STOP: ControlWord.ENABLE_VOLTAGE,
    Stw1.NO_QUICK_STOP: ControlWord.DISABLE_QUICK_STOP,
    Stw1.ENABLE_OPERATION: ControlWord.ENABLE_OP,
    Stw1.ENABLE_RAMP: ControlWord.ENABLE_RFG,
    Stw1.UNFREEZE_RAMP: ControlWord.UNLOCK_RFG,
    Stw1.ENABLE_SETPOINT: ControlWord.USE_REF_FOR_RFG,
    Stw1.FAULT_ACKNOWLEDGE: ControlWord.RESET_MALFUNCTION,
    Stw1.CONTROL_BY_PLC: ControlWord.NET_CTRL | ControlWord.NET_REF,
}
#: The maker of the module: HMS.
_HMS = 0x0109
_SWITCHED_ON = Zsw1.READY_TO_SWITCH_ON | Zsw1.READY_TO_OPERATE
#: What the states of the drive are in PROFIdrive; S5, switching off, looks like S3.
_STATES = {
    Phase.NOT_READY_TO_SWITCH_ON: Zsw1(0),
    Phase.SWITCH_ON_DISABLED: Zsw1.SWITCHING_ON_INHIBITED,
    Phase.READY_TO_SWITCH_ON: Zsw1.READY_TO_SWITCH_ON,
    Phase.SWITCHED_ON: _SWITCHED_ON,
    Phase.OPERATION_ENABLED: _SWITCHED_ON | Zsw1.OPERATION_ENABLED,
    Phase.DISABLE: _SWITCHED_ON,
    Phase.SHUTDOWN: _SWITCHED_ON,
    Phase.QUICK_STOP: Zsw1.SWITCHING_ON_INHIBITED,
    Phase.FAULT_REACTION_ACTIVE: Zsw1.FAULT,
    Phase.FAULTED: Zsw1.FAULT,
}


def _history(faults: Faults, situation: int) -> Callable[[], int]:
    """Return what reads a fault situation that is over."""

    def read() -> int:
        past = faults.log[1:] if faults else faults.log
        return past[situation - 1].code if situation <= len(past) else 0

    return read


class TelegramServer(telegram1.Server):
    """The fieldbus side of one G2."""

    def __init__(self, drive: SimulatedDrive) -> None:
        assert isinstance(drive.control_unit, G2ControlUnit)
        self._unit = drive.control_unit
        self._drive = drive
        #: STW1 that was input last, and that was not ignored last.
        self._word = self._obeyed = 0
        self.parameters = ParameterChannel({**entries_of(drive, 'profibus'), **self._profile()})

    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value."""
        unit, self._word = self._unit, stw1
        if unit.variant.telegram_words == 'drivecontrol':
            unit.take_telegram(self._by_level(stw1), setpoint)
            return int(unit.status_word), unit.actual
        # without control by PLC the process data do not count, and what was before goes on
        if stw1 & Stw1.CONTROL_BY_PLC:
            self._obeyed = stw1
            word = sum(bit for given, bit in _CONTROL.items() if stw1 & given)
            unit.take_telegram(self._by_level(word), setpoint)
        else:
            unit.fieldbus.note_telegram()
        return int(self._zsw1(stw1)), unit.actual

    def _profile(self) -> ChannelEntries:
        """Return the parameters of PROFIdrive [M0 table 8], and the error log [M0 table 9]."""
        faults, number = self._drive.faults, self._drive.memory.number
        firmware = round(100 * number('fieldbus.sw_ver'))
        readable: dict[int, tuple[int | Callable[[], int], ...]] = {
            918: (lambda: self._drive.address,),
            922: (1,),
            924: (2, 15),
            944: (lambda: len(faults.log),),
            947: (lambda: faults.shown, *(_history(faults, n) for n in range(1, 8))),
            950: (8, 1),
            964: (_HMS, 0, firmware, 2013, 101),
            965: (0x0329,),
            967: (lambda: self._word,),
            968: (lambda: int(self._zsw1(self._word)),),
        }
        log = self._drive.model.error_logs['profibus']
        entries = {
            (log.first + n, 0): ParameterEntry(functools.partial(faults.log_entry, n), size=4)
            for n in range(log.limit)
        }
        return {**read_only(readable), **entries}

    def _by_level(self, word: int) -> int:
        """Add what makes the drive switch on by a bit that has been there all the time."""
        return word | ControlWord.AUTO_INIT if self._unit.variant.commands == 'levels' else word

    def _zsw1(self, stw1: int) -> Zsw1:
        unit, motor = self._unit, self._unit.motor
        status = _STATES[unit.machine.phase]
        if stw1 & Stw1.NO_COAST_STOP:
            status |= Zsw1.NO_COAST_STOP
        if stw1 & Stw1.NO_QUICK_STOP:
            status |= Zsw1.NO_QUICK_STOP
        if unit.on_bus:
            status |= Zsw1.CONTROL_REQUESTED
        if motor.limited or unit.faults.alarms:
            status |= Zsw1.WARNING
        if unit.machine.phase is Phase.OPERATION_ENABLED and motor.reached:
            status |= Zsw1.WITHIN_TOLERANCE | Zsw1.REACHED
        return status | Zsw1.PULSES_ENABLED if motor.driven else status
