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

"""The one interface of every link: read or write one parameter of one unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from typing import Protocol

#: 16-bit words, the low one first: what a parameter is made of on every bus of these drives.
Words = tuple[int, ...]


class Address(NamedTuple):
    """
    Where a parameter stands on a line; only the link looks inside.

    :ivar numbers: the Modbus base register, or the Classic id of each word.
    :ivar words: how many 16-bit words it has.
    """

    numbers: tuple[int, ...]
    words: int


class Reply(NamedTuple):
    """
    What a unit answered.

    :ivar words: the words read; empty for a write.
    :ivar arrived: when the last byte came, in seconds of ``time.monotonic``.
    """

    words: Words
    arrived: float


class Link(Protocol):
    """One line to several units, used by one thread."""

    def open(self) -> None:
        """
        Open the port.

        :raises PortError: it cannot be opened; the message says what to do.
        """

    def close(self) -> None:
        """Close the port; harmless when it is closed already."""

    def read(self, unit: int, address: Address) -> Reply:
        """
        Read one parameter.

        :raises LinkError: as its subclasses say.
        """

    def write(self, unit: int, address: Address, words: Words) -> Reply:
        """
        Write one parameter.

        :raises LinkError: as its subclasses say.
        """

    def use_probes(self, unit: int, probes: Sequence[Address]) -> None:
        """
        Name parameters of different sizes that are safe to read at any time.

        After a doubtful answer one of them tells whether the line can be believed again.
        """
