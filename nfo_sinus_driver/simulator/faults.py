# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The faults and alarms of a simulated drive, their acknowledgement, and the error log."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from nfo_sinus_driver.catalog import Family, Kind


@dataclass(frozen=True)
class LogEntry:
    """One entry of the error log: the fault's code, and the operating time (h) when it happened."""

    code: int
    op_time: float


class Faults:
    """
    The faults that are active and those that were; true if one is active.

    A drive whose status word has a bit for alarms can have alarms too, which stop nothing.

    :param log_size: entries that the error log holds.
    :param kept: faults that :meth:`acknowledge` does not end.

    :ivar log: the error log, newest first.
    """

    def __init__(
        self, model: Family, *, log_size: int = 32, kept: Collection[int] = frozenset()
    ) -> None:
        self._model = model
        self._kinds = {Kind.FAULT}
        if model.profile.status_word.tells_alarms:
            self._kinds.add(Kind.ALARM)
        self._kept = kept
        self.log_size = log_size
        self._present: dict[int, bool] = {}
        self.log: list[LogEntry] = []

    def __bool__(self) -> bool:
        return bool(self._present) and bool(self.codes)

    @property
    def codes(self) -> list[int]:
        """The faults that are active, the first one first."""
        return self._of(Kind.FAULT)

    @property
    def alarms(self) -> list[int]:
        """The alarms that are active, the first one first."""
        return self._of(Kind.ALARM)

    @property
    def shown(self) -> int:
        """What the inverter status shows of them: the first fault, else the first alarm, else 0."""
        return next(iter(self.codes + self.alarms), 0) if self._present else 0

    @property
    def lasting(self) -> bool:
        """Whether the cause of a fault is still there."""
        return any(self._present[code] for code in self.codes)

    def trip(self, code: int, op_time: float, *, cause_present: bool) -> None:
        """Let a fault happen, at ``op_time`` hours (ValueError: the model has no such fault)."""
        if self._model.status_code(code).kind not in self._kinds:
            raise ValueError(f'{code} is no fault of {self._model.name}: see its status codes')
        if code not in self._present:
            self.log.insert(0, LogEntry(code, op_time))
            del self.log[self.log_size :]
        self._present[code] = cause_present

    def end_causes(self) -> None:
        """Take the causes away; the faults stay active until they are acknowledged."""
        self._present = dict.fromkeys(self._present, False)

    def acknowledge(self) -> None:
        """End the faults whose cause is gone, but those that are kept."""
        self._present = {
            code: cause for code, cause in self._present.items() if cause or code in self._kept
        }

    def log_entry(self, entry: int) -> int:
        """Return an entry of the log as the catalog's ErrorLogArea has it; 0 if it is empty."""
        if entry >= len(self.log):
            return 0
        logged = self.log[entry]
        return logged.code << 24 | int(10 * logged.op_time) & 0xFFFFFF

    def restart(self) -> None:
        """Forget the faults whose cause is gone, as a power cycle does; the log stays."""
        self._present = {code: True for code, cause in self._present.items() if cause}

    def _of(self, kind: Kind) -> list[int]:
        return [code for code in self._present if self._model.status_code(code).kind is kind]
