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

"""The serial interface of a simulated drive: the settings in effect, and the watch on silence."""

from __future__ import annotations

from nfo_sinus_driver.simulator.memory import Memory


class SerialSide:
    """
    What the group Serial does.

    A change of address, speed or format takes effect at the next power-on, or at once with
    AutoReset [M0 §5.3.4].

    :ivar address: the address in effect.
    :ivar baud: code of SiBaud in effect.
    :ivar char_format: code of SiProt in effect.
    :ivar bus_type: code of BusType in effect.
    """

    address: int
    baud: int
    char_format: int
    bus_type: int

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._unheard = 0.0
        self.initialise()

    def initialise(self) -> None:
        """Put the settings into effect, as at power-on."""
        self.address = self._memory.raw('serial.address')
        self.baud = self._memory.raw('serial.si_baud')
        self.char_format = self._memory.raw('serial.si_prot')
        self.bus_type = self._memory.raw('serial.bus_type')

    def changed(self) -> None:
        """Take note that one of the settings was written."""
        if self._memory.raw('serial.auto_reset'):
            self.initialise()

    def heard(self) -> None:
        """Take note of a valid frame: the bus is alive."""
        self._unheard = 0.0

    def advance(self, dt: float) -> None:
        """Let ``dt`` seconds of silence pass."""
        self._unheard += dt

    @property
    def watches(self) -> bool:
        """Whether silence has a consequence: only with AutoStop [C91], and with a SioTot."""
        memory = self._memory
        return bool(memory.raw('serial.auto_stop') and memory.raw('serial.sio_tot'))

    @property
    def timed_out(self) -> bool:
        """Whether the silence has lasted longer than SioTot."""
        return self.watches and self._unheard >= self._memory.number('serial.sio_tot')
