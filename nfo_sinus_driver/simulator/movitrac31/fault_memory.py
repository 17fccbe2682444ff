# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The faults of a MOVITRAC 31.., and what it remembers of the last five (P060 to P064)."""

from __future__ import annotations

from collections.abc import Mapping

from nfo_sinus_driver.simulator.faults import Faults

#: How many faults it remembers.
_SIZE = 5


class MovitracFaults(Faults):
    """Faults of which each may have a cause of its own that comes and goes."""

    def end_cause(self, code: int) -> None:
        """Take the cause of one fault away; it stays active until it is reset."""
        if code in self._present:
            self._present[code] = False


class FaultMemory:
    """
    What was measured when a fault happened, of the last five, the newest first.

    Power-off leaves it as it is.
    """

    def __init__(self) -> None:
        self._entries: list[Mapping[str, int]] = []

    def add(self, entry: Mapping[str, int]) -> None:
        """
        Remember a fault in place of the oldest.

        :param entry: raw numbers, by what follows ``fault_t0`` in the keys of the tables.
        """
        self._entries.insert(0, entry)
        del self._entries[_SIZE:]

    def raw(self, key: str) -> int | None:
        """Return a raw number of it; ``None`` for another parameter."""
        head, fault, rest = key.partition('.fault_t')
        if head != 'status' or not fault:
            return None
        number, name = int(rest[0]), rest[1:].removeprefix('_')
        return self._entries[number][name] if number < len(self._entries) else 0
