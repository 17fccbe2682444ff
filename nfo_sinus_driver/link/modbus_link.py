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

"""What every Modbus link does: turn what is asked for into requests."""

from __future__ import annotations

from abc import ABC
from abc import abstractmethod
from typing import TypeVar

from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import LineProtocol
from nfo_sinus_driver.link.interface import LinkError
from nfo_sinus_driver.link.interface import Reply
from nfo_sinus_driver.link.modbus_identify import ModbusInquiry
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.modbus_pdu import Write
from nfo_sinus_driver.link.modbus_pdu import read_of
from nfo_sinus_driver.link.modbus_pdu import write_and_read_of

#: The addresses of drives [M0 §6.2.2].
UNITS = range(1, 248)

_T = TypeVar('_T')


class ModbusLink(ABC):
    """A Modbus master, whatever carries its requests."""

    protocol: LineProtocol

    def parts(self, address: Address) -> tuple[Address]:
        """Return the whole: registers that belong together are read together."""
        return (address,)

    def read(self, unit: int, address: Address) -> Reply:
        """Read one parameter (function 03)."""
        return Reply(*self._ask(read_of(unit, address)))

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        """Write one parameter (function 06 for one register, 16 for several)."""
        return Reply(*self._ask(Write(unit, address.index, data)))

    def write_and_read(self, unit: int, address: Address, data: bytes, source: Address) -> Reply:
        """Write one parameter and read another, in one transaction (function 23)."""
        return Reply(*self._ask(write_and_read_of(unit, address, data, source)))

    def read_then_write(self, unit: int, source: Address, address: Address, data: bytes) -> Reply:
        """
        Read a parameter whose value nobody needs, then write another; nothing is sent between.

        :raises LinkError: as for a write; :attr:`LinkError.maybe_done` once the read was sent.
        """
        self._ask_unheard(read_of(unit, source))
        try:
            return self.write(unit, address, data)
        except LinkError as error:
            error.maybe_done = True
            raise

    def identify(self, unit: int) -> ModbusInquiry:
        """Return the questions by which a unit tells who it is (functions 43/14 and 17)."""
        return ModbusInquiry(unit, self._ask)

    @abstractmethod
    def _ask(self, request: Request[_T]) -> tuple[_T, float]:
        """Return the answer to a request, and when its last byte came."""

    @abstractmethod
    def _ask_unheard(self, request: Request[object]) -> None:
        """Send a request at once and wait for its answer, whatever that is and says."""
