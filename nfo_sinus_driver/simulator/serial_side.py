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

from nfo_sinus_driver.simulator.firmware import NEW
from nfo_sinus_driver.simulator.firmware import firmware_of
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.timing import BAUD_CODES
from nfo_sinus_driver.simulator.timing import Timing

#: Codes of BusType [M0 table 4].
CLASSIC, MODBUS_ASCII, MODBUS_RTU = 1, 2, 3


class SerialSide:
    """
    What the group Serial does.

    A change of address, speed or format takes effect at the next power-on, or at once with
    AutoReset [M0 §5.3.4]; on older firmware always at once [C7].

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
        # the older firmware knows nothing but Classic
        firmware = firmware_of(self._memory) if self.bus_type == CLASSIC else NEW
        if firmware.at_once or self._memory.raw('serial.auto_reset'):
            self.initialise()

    def hears(self, bus_type: int, timing: Timing) -> bool:
        """Whether it is set to this protocol, speed and format."""
        firmware = firmware_of(self._memory) if bus_type == CLASSIC else NEW
        return (
            self.bus_type == bus_type
            and self.baud == BAUD_CODES[timing.baud]
            and self.char_format == firmware.formats.get(timing.char_format)
        )

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
