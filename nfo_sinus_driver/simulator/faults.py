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

"""The faults and alarms of a simulated drive, their acknowledgement, and the error log."""

from __future__ import annotations

from dataclasses import dataclass
import enum

from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Meaning


class SioErr(enum.IntFlag):
    """What may go wrong on the line: the flags of SioErr [M2 table 4]."""

    BLOCKED = 1 << 0
    PARITY = 1 << 1
    CHECK_SUM = 1 << 2
    STRUCTURE = 1 << 3
    TIMEOUT = 1 << 4
    PREFIX = 1 << 5
    NOT_PERMITTED = 1 << 6
    UNKNOWN = 1 << 7
    UNREADABLE = 1 << 8
    UNWRITABLE = 1 << 9
    OUT_OF_RANGE = 1 << 10
    OVERRUN = 1 << 14


#: The flags of messages that were understood and are not carried out.
REFUSALS = (
    SioErr.BLOCKED
    | SioErr.PREFIX
    | SioErr.NOT_PERMITTED
    | SioErr.UNKNOWN
    | SioErr.UNREADABLE
    | SioErr.UNWRITABLE
    | SioErr.OUT_OF_RANGE
)


@dataclass(frozen=True)
class LogEntry:
    """One entry of the error log: the fault's code, and OpTime (h) when it happened."""

    code: int
    op_time: float


class Faults:
    """
    The faults that stand and those that were; true if one stands.

    A drive whose status word has a bit for alarms can have alarms too, which stop nothing.

    :param log_size: entries that the error log holds [C4].

    :ivar log: the error log, newest first.
    :ivar sio_err: what went wrong on the line since it was last read.
    """

    def __init__(self, model: Family, log_size: int) -> None:
        self._model = model
        self._kinds = {Kind.FAULT}
        if model.profile.status_word.tells_alarms:
            self._kinds.add(Kind.ALARM)
        (lost,) = (code.code for code in model.codes(Meaning.SERIAL_FAILURE))
        #: What a silent or damaged line leads to.
        self.line_lost = lost
        #: Faults of the serial channel: they end fieldbus control, and MODE = Stop acknowledges
        #: them [M0 §6.1.5].
        self.of_the_line = {lost, *(code.code for code in model.codes(Meaning.FIELDBUS_FAILURE))}
        #: Faults that an acknowledgement of their own ends [C42].
        self._kept = {lost} if 'fieldbus.sio_err' in model else set()
        self._present: dict[int, bool] = {}
        self.log: list[LogEntry] = []
        self._log_size = log_size
        self.sio_err = SioErr(0)

    def __bool__(self) -> bool:
        return bool(self._present) and bool(self.codes)

    @property
    def codes(self) -> list[int]:
        """The faults that stand, the first one first."""
        return self._of(Kind.FAULT)

    @property
    def alarms(self) -> list[int]:
        """The alarms that stand, the first one first."""
        return self._of(Kind.ALARM)

    @property
    def shown(self) -> int:
        """What InvSt shows of them: the first fault, else the first alarm; 0 when none stands."""
        return next(iter(self.codes + self.alarms), 0) if self._present else 0

    @property
    def serial(self) -> bool:
        """Whether a fault of the serial channel stands."""
        return not self.of_the_line.isdisjoint(self._present)

    @property
    def lasting(self) -> bool:
        """Whether the cause of a fault is still there."""
        return any(self._present[code] for code in self.codes)

    def trip(self, code: int, op_time: float, *, cause_present: bool) -> None:
        """
        Let a fault happen, at ``op_time`` hours.

        :raises ValueError: the model has no such fault.
        """
        if self._model.status_code(code).kind not in self._kinds:
            raise ValueError(f'{code} is no fault of {self._model.name}: see its InvSt')
        if code not in self._present:
            self.log.insert(0, LogEntry(code, op_time))
            del self.log[self._log_size :]
        self._present[code] = cause_present

    def end_causes(self) -> None:
        """Take the causes away; the faults still stand until they are acknowledged."""
        self._present = dict.fromkeys(self._present, False)

    def acknowledge(self) -> None:
        """
        Acknowledge, as reading 02A4h does.

        A fault whose cause is still there stands on, and so does Sio Fail where it has an
        acknowledgement of its own [C42].
        """
        self._present = {
            code: cause for code, cause in self._present.items() if cause or code in self._kept
        }

    def acknowledge_serial(self) -> None:
        """Acknowledge the serial channel's faults, as MODE = Stop does [M0 §6.1.5]."""
        self.sio_err = SioErr(0)
        self._present = {
            code: cause for code, cause in self._present.items() if code not in self.of_the_line
        }

    def take_sio_err(self) -> SioErr:
        """Return the flags of SioErr and clear them, and Sio Fail unless its cause lasts."""
        flags, self.sio_err = self.sio_err, SioErr(0)
        if not self._present.get(self.line_lost, True):
            del self._present[self.line_lost]
        return flags

    def log_word(self, entry: int) -> int:
        """Return an entry of the log, 0 being the newest, as 32 bits; 0 if it is empty [M2 §9]."""
        if entry >= len(self.log):
            return 0
        one = self.log[entry]
        return one.code << 24 | int(10 * one.op_time) & 0xFFFFFF

    def restart(self) -> None:
        """Forget the faults whose cause is gone, as a power cycle does; the log stays."""
        self.sio_err = SioErr(0)
        self._present = {code: True for code, cause in self._present.items() if cause}

    def _of(self, kind: Kind) -> list[int]:
        return [code for code in self._present if self._model.status_code(code).kind is kind]
