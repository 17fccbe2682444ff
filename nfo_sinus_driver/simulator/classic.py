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

"""
The Classic protocol as a simulated G2 speaks it ([M0 §6.1], [M2]).

A message that cannot be carried out sets a flag of SioErr, and while the bus has control that is a
serial fault: the motor coasts, MODE becomes Stop [M0 §6.1.5].
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
import math

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.catalog import to_bytes
from nfo_sinus_driver.catalog import to_words
from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator import classic_frames
from nfo_sinus_driver.simulator.classic_frames import BROADCAST
from nfo_sinus_driver.simulator.classic_frames import POINT_TO_POINT
from nfo_sinus_driver.simulator.drive import COMMANDS
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.faults import SioErr
from nfo_sinus_driver.simulator.line_faults import Reply
from nfo_sinus_driver.simulator.measured import measure
from nfo_sinus_driver.simulator.memory import convert
from nfo_sinus_driver.simulator.memory import home
from nfo_sinus_driver.simulator.protocol import Request
from nfo_sinus_driver.simulator.refusal import Reason
from nfo_sinus_driver.simulator.refusal import Refused
from nfo_sinus_driver.simulator.serial_side import CLASSIC
from nfo_sinus_driver.simulator.timing import Timing

#: How long the rest of a message may take (s). No manual says [C86].
_PAUSE = 1.0
#: Counters of 24 bits [C26].
_SHORT = frozenset({'status.op_time', 'status.rn_time', 'status.br_time'})
_24_BITS = 0xFFFFFF
_REFERENCES = frozenset({'status.frq_set', 'status.spd_set', 'status.trq_set', 'status.reg_set'})
_FLAGS: Mapping[Reason, SioErr] = {
    # there are no functions here, only parameters
    Reason.FUNCTION: SioErr.UNKNOWN,
    Reason.ADDRESS: SioErr.UNKNOWN,
    Reason.VALUE: SioErr.OUT_OF_RANGE,
    Reason.STATE: SioErr.NOT_PERMITTED,
}


class _Wrong(Exception):
    """A message that is not carried out, and the flag that says why."""

    def __init__(self, flag: SioErr) -> None:
        super().__init__(flag.name)
        self.flag = flag


class Classic:
    """Classic messages: whom they are for, and what the drive says to them."""

    name = 'classic'
    bus_type = CLASSIC
    serial = True

    def __init__(self) -> None:
        self._models: dict[str, _Ids] = {}

    @staticmethod
    def gap(timing: Timing) -> float:
        """None: EOT begins a message."""
        return 0.0

    @staticmethod
    def patience(timing: Timing) -> float:
        """A second."""
        return _PAUSE

    @staticmethod
    def cut(buffer: bytes) -> int:
        """Return how many bytes belong together, 0 while more must come."""
        return classic_frames.length(buffer)

    @staticmethod
    def unwrap(frame: bytes) -> Request | None:
        """Return whom a message is for, and the message; ``None`` if it does not tell."""
        address = classic_frames.address(frame)
        if address is None:
            return None
        return Request(address, frame, whole=not classic_frames.parse(frame).wrong)

    @staticmethod
    def concerns(drive: SimulatedDrive, request: Request) -> bool:
        """Whether the drive is meant; an ENQUIRY to all is for nobody [C86]."""
        if request.address == BROADCAST:
            return classic_frames.is_select(request.body)
        return request.address in (POINT_TO_POINT, drive.address)

    def answer(self, drive: SimulatedDrive, request: Request) -> bytes:
        """Let the drive carry out a message; return the answer, empty if there is none."""
        firmware = drive.firmware
        sender = drive.address if firmware.own_address else request.address
        message = classic_frames.parse(request.body, small_letters=firmware.lower_case)
        answer = b''
        try:
            if message.wrong:
                raise _Wrong(message.wrong)
            if message.value is None:
                word = self._enquiry(drive, message.id)
                small = firmware.lower_case
                answer = classic_frames.reply(sender, message.id, word, small_letters=small)
            else:
                self._select(drive, message.id, message.value, request.address == BROADCAST)
                answer = classic_frames.acknowledge(sender, True)
        except _Wrong as wrong:
            drive.serial_error(wrong.flag)
            # what did not arrive whole has not arrived; of a check sum [M2 §6] thinks otherwise
            unheard = SioErr.STRUCTURE | (SioErr(0) if firmware.naks_damage else SioErr.CHECK_SUM)
            if not wrong.flag & unheard:
                answer = classic_frames.acknowledge(sender, False)
        return b'' if request.address == BROADCAST else answer

    @staticmethod
    def instead(request: Request, there: bool) -> Reply | None:
        """Nothing: on a wire, silence is silence."""
        return None

    def _ids(self, model: Family) -> _Ids:
        if model.name not in self._models:
            self._models[model.name] = _Ids(model)
        return self._models[model.name]

    def _enquiry(self, drive: SimulatedDrive, id_: int) -> int:
        """Return the word that stands at an id."""
        log = drive.model.error_logs['classic']
        entry, position = divmod(id_ - log.first, log.stride)
        if 0 <= entry < drive.firmware.log_size:
            return to_words(log.codec.encode(drive.faults.log_word(entry)))[position]
        parameter, position = self._find(drive, id_)
        if parameter.access is Access.WRITE:
            raise _Wrong(SioErr.UNREADABLE)
        try:
            raw = _read(drive, parameter.key)
        except Refused as refused:
            raise _Wrong(_FLAGS[refused.reason]) from refused
        if parameter.key in _SHORT and drive.firmware.short_counters:
            raw &= _24_BITS
        words = to_words(parameter.at('classic').number.encode(raw))
        if len(words) > 1 and drive.tears:
            drive.tears -= drive.counters.carry(parameter)
        return words[position]

    def _select(self, drive: SimulatedDrive, id_: int, word: int, to_all: bool) -> None:
        """Set the parameter at an id."""
        parameter, _ = self._find(drive, id_)
        key, firmware = parameter.key, drive.firmware
        closed = key in _REFERENCES and not firmware.sets_references
        if closed or parameter.access not in (Access.WRITE, Access.READ_WRITE):
            raise _Wrong(SioErr.UNWRITABLE)
        raw = parameter.at('classic').number.decode(to_bytes([word]))
        if key == 'fieldbus.scmd':
            raw = _command(drive, raw)
        if drive.faults and not self._in_spite_of_a_fault(drive, key, raw, to_all):
            raise _Wrong(SioErr.BLOCKED)
        if firmware.bus_only and not _permitted(drive, key, raw):
            raise _Wrong(SioErr.NOT_PERMITTED)
        if key in firmware.codes and raw not in firmware.codes[key]:
            raise _Wrong(SioErr.OUT_OF_RANGE)
        if key == 'serial.address' and raw > firmware.most_address:
            raise _Wrong(SioErr.OUT_OF_RANGE)
        try:
            drive.write_raw(key, _at_home(parameter, raw))
        except Refused as refused:
            blocked = refused.reason is Reason.STATE and drive.faults
            raise _Wrong(SioErr.BLOCKED if blocked else _FLAGS[refused.reason]) from refused
        if key in COMMANDS:
            drive.runner.by_fieldbus = False

    @staticmethod
    def _in_spite_of_a_fault(drive: SimulatedDrive, key: str, raw: int, to_all: bool) -> bool:
        """Whether a SELECT is one of those that an active fault does not keep off [M0 §6.1.5]."""
        if key in ('fieldbus.drive_control', 'fieldbus.drv_ctrl_write_mask'):
            return True
        stops = key == 'fieldbus.mode' and raw == Mode.STOP
        return stops and drive.faults.serial and (to_all or drive.firmware.obeys_stop)

    def _find(self, drive: SimulatedDrive, id_: int) -> tuple[Parameter, int]:
        found = self._ids(drive.model).find(id_)
        if found is None or found[0].key in drive.firmware.lacks:
            raise _Wrong(SioErr.UNKNOWN)
        since = found[0].since
        if since is not None and drive.version is not None and drive.version < since:
            raise _Wrong(SioErr.UNKNOWN)
        return found


class _Ids:
    """Which parameter stands at which id, and which of its words."""

    def __init__(self, model: Family) -> None:
        self._by_id = {
            id_: (parameter, position)
            for parameter in model.values()
            if 'classic' in parameter.addresses
            for position, id_ in enumerate(parameter.at('classic').numbers)
        }

    def find(self, id_: int) -> tuple[Parameter, int] | None:
        return self._by_id.get(id_)


def _read(drive: SimulatedDrive, key: str) -> int:
    """Read a parameter as this protocol carries it, side effects included."""
    raw = drive.read_raw(key)
    if key == 'fieldbus.setpoint':
        key = drive.runner.setpoint_key
    parameter = drive.memory.model[key]
    # what is measured may be finer here than in the memory
    shown = measure(parameter, 'classic', drive.motor, drive.counters)
    return convert(parameter, raw, 'classic') if shown is None else shown


def _command(drive: SimulatedDrive, raw: int) -> int:
    """Return an SCMD as the drive understands it: to the old one much means Stop [C31]."""
    if not drive.firmware.even_stops:
        return raw
    if raw == Scmd.RESET_E_OUT:
        raise _Wrong(SioErr.OUT_OF_RANGE)
    return raw if raw & 1 or raw & Scmd.ERASE_E_LOG else Scmd.STOP


def _permitted(drive: SimulatedDrive, key: str, raw: int) -> bool:
    """Whether MODE permits a SELECT, where nothing is changed before MODE = Sio [C100]."""
    mode = drive.runner.mode
    if mode == Mode.INHIBIT:
        # whether this is taken is left to the drive's variant [C101]
        return key == 'fieldbus.scmd' and raw == Scmd.STOP
    return mode == Mode.BUS or key == 'fieldbus.mode'


def _at_home(parameter: Parameter, raw: int) -> int:
    """Return the number that the memory keeps for a Classic one, which is coarser [C14]."""
    protocol = home(parameter)
    exact = raw * parameter.factor('classic') / parameter.factor(protocol)
    kept = math.floor(exact + Fraction(1, 2))
    if not parameter.at(protocol).number.fits(kept):
        raise _Wrong(SioErr.OUT_OF_RANGE)
    return kept
