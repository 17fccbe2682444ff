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


"""Where the error log of a drive stands: an area of entries, not parameters of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.catalog.parameter import Protocol
from nfo_sinus_driver.catalog.parameter import RawType


@dataclass(frozen=True)
class ErrorLogArea:
    """
    The error log on one bus: entries of two words each, the newest first.

    The low word of an entry and the low byte of its high word are the operating time of the error
    in 0.1 h, the high byte is the code of :class:`InvStCode`; code 0 ends the log [M2 §9].

    :ivar first: the register or Classic id of the first word of the newest entry.
    :ivar stride: from an entry to the next older one.
    :ivar entries: how many every drive has.
    :ivar limit: how many some drives have; beyond ``entries`` stop at code 0 or a refusal [C4].
    """

    first: int
    stride: int
    entries: int
    limit: int

    #: The type of an entry.
    TYPE = RawType.UINT32

    def address(self, entry: int) -> int:
        """
        Return where the low word of an entry stands, 0 being the newest; the other one follows.

        :raises IndexError: no drive has so many entries.
        """
        if not 0 <= entry < self.limit:
            raise IndexError(f'the error log has {self.limit} entries, not {entry + 1}')
        return self.first + self.stride * entry


#: The error log of the G2 ([M0 table 2, table 4], [M2 §9], [C4]); the Optimal's is not documented.
#: On PROFIBUS it is P13157 to P13188; the index that CANopen has for it is in doubt [C2].
ERROR_LOG: Mapping[Protocol, ErrorLogArea] = {
    Protocol.MODBUS: ErrorLogArea(0xC000, 4, 32, 32),
    Protocol.CLASSIC: ErrorLogArea(0x0200, 2, 32, 128),
}
