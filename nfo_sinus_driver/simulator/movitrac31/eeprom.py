# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a MOVITRAC 31.. keeps through power-off, and what only in its RAM (P801)."""

from __future__ import annotations

from nfo_sinus_driver.simulator.memory import Memory

_SAVE = 'special.save_to_eeprom'


class Eeprom:
    """The settings that stand otherwise in the EEPROM than in the memory."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._saved: dict[str, int] = {}

    def lacks(self, key: str) -> bool:
        """Tell whether a parameter has a value that is lost when power is off."""
        return key in self._saved

    def before(self, key: str) -> None:
        """Take note that a parameter will be written."""
        if not self._saves:
            self._saved.setdefault(key, self._memory.raw(key))

    def after(self, key: str) -> None:
        """Take note that it has been."""
        if self._saves:
            self._saved.pop(key, None)

    def restore(self) -> None:
        """Fill the memory from the EEPROM, as power-on does."""
        for key, raw in self._saved.items():
            self._memory.put(key, raw)
        self._saved.clear()

    @property
    def _saves(self) -> bool:
        """Whether what is written is saved: P801 is On, which is code 0."""
        return not self._memory.raw(_SAVE)
