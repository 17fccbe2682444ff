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

"""What a protocol is to those above its link."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class LineProtocol:
    """
    What a protocol can do, and how its lines leave the factory.

    :ivar name: as the driver's parameter ``protocol`` has it.
    :ivar addressing: which addresses of the catalog it reaches parameters by.
    :ivar units: the addresses that a drive may have.
    :ivar baud_rate: of the factory, bit/s.
    :ivar char_format: of the factory, such as ``8E1``.
    :ivar char_formats: those that the protocol can have, the likeliest first; none where the line
        is a gateway's.
    :ivar broadcast: the address that every drive obeys and none answers; ``None``: there is none.
    :ivar point_to_point: the address at which a drive that is alone answers, whatever its own is.
    :ivar identifies: a drive can be asked who it is.
    :ivar writes_and_reads: it can write one parameter and read another in one transaction.
    """

    name: str
    addressing: str
    units: range
    baud_rate: int
    char_format: str
    char_formats: Sequence[str] = ()
    broadcast: int | None = None
    point_to_point: int | None = None
    identifies: bool = False
    writes_and_reads: bool = False

    def require_unit(self, address: int) -> None:
        """
        Make sure that a drive may have an address.

        :raises ValueError: it may not; the message says which there are.
        """
        if address not in self.units:
            name = self.addressing.title()
            raise ValueError(
                f'address {address}: {name} has {self.units[0]} to {self.units[-1]}'
            )

    def require_char_format(self, char_format: str) -> None:
        """
        Make sure that the protocol can have a character format.

        :raises ValueError: it cannot; the message says which it can.
        """
        if self.char_formats and char_format not in self.char_formats:
            raise ValueError(
                f'char_format {char_format!r}: {self.name} has {", ".join(self.char_formats)}'
            )
