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


"""Where the error log of a drive stands: an area of entries, or parameters of their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from nfo_sinus_driver.catalog.codec import Number


@dataclass(frozen=True)
class ErrorLogArea:
    """
    The error log on one bus, the newest entry first.

    The low 24 bits of an entry are the operating time of the error in 0.1 h, the high byte is the
    code of :class:`StatusCode`; code 0 ends the log [M2 §9].

    :ivar protocol: the protocol that reaches it.
    :ivar space: which numbering of that protocol ``first`` counts in.
    :ivar first: where the newest entry stands.
    :ivar stride: from an entry to the next older one.
    :ivar entries: how many every drive has.
    :ivar limit: how many some drives have; beyond ``entries`` stop at code 0 or a refusal [C4].
    :ivar codec: how the bytes of an entry are read.
    """

    protocol: str
    space: str
    first: int
    stride: int
    entries: int
    limit: int
    codec: Number

    def address(self, entry: int) -> int:
        """
        Return where an entry begins, 0 being the newest.

        :raises IndexError: no drive has so many entries.
        """
        if not 0 <= entry < self.limit:
            raise IndexError(f'the error log has {self.limit} entries, not {entry + 1}')
        return self.first + self.stride * entry

    def place(self, entry: int) -> tuple[str, int, int | None, int]:
        """
        Return what a link is told of an entry: space, index, sub-index and size in bytes.

        :raises IndexError: no drive has so many entries.
        """
        index = self.address(entry)
        # on Classic the high word has the next id
        sub_index = index + 1 if self.space == 'id' else None
        return self.space, index, sub_index, self.codec.size


@dataclass(frozen=True)
class RememberedFault:
    """
    One entry of an error log that has no operating time, but what was measured when it came.

    :ivar number: the key of the number of the fault; 0 ends the log.
    :ivar first: what is added to that number for its status code.
    :ivar readings: the keys of what was measured, by a short name.
    """

    number: str
    first: int
    readings: Mapping[str, str]
