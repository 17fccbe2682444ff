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
