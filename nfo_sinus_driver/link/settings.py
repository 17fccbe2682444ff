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

"""How a serial line is set: rate, character format, answer time."""

from __future__ import annotations

from dataclasses import dataclass
import functools
import re

#: Of serial lines to drives.
BAUD_RATES = (1200, 2400, 4800, 9600, 19200, 38400, 57600)

_FORMAT = re.compile(r'([78])([EON])([12])')


@dataclass(frozen=True)
class LineSettings:
    """
    How a serial line is set.

    :ivar baud_rate: bit/s; which there are is for the protocol to say. 19200 is the drive's default
        for Modbus [M0 §6.2.2].
    :ivar char_format: data bits, parity and stop bits, such as ``8E1``.
    :ivar response_timeout: from the last byte sent to the first byte of the answer, s.
    :ivar rs485: let the port itself switch the transmitter, where it can.
    :raises ValueError: a setting that no drive has; the message says which there are.
    """

    baud_rate: int = 19200
    char_format: str = '8E1'
    response_timeout: float = 0.2
    rs485: bool = False

    def __post_init__(self) -> None:
        if self.baud_rate <= 0:
            raise ValueError(f'baud_rate {self.baud_rate}: it is more than 0')
        if not _FORMAT.fullmatch(self.char_format):
            raise ValueError(
                f'char_format {self.char_format!r}: write data bits, parity and stop bits, '
                'such as 8E1, 8O1 or 8N2'
            )
        if not 0.01 <= self.response_timeout <= 10:
            raise ValueError(f'response_timeout {self.response_timeout}: 0.01 to 10 s')

    @property
    def data_bits(self) -> int:
        """7 or 8."""
        return int(self.char_format[0])

    @property
    def parity(self) -> str:
        """``E``, ``O`` or ``N``."""
        return self.char_format[1]

    @property
    def stop_bits(self) -> int:
        """1 or 2."""
        return int(self.char_format[2])

    @functools.cached_property
    def char_time(self) -> float:
        """The time of one character on the wire, s."""
        bits = 1 + self.data_bits + (self.parity != 'N') + self.stop_bits
        return bits / self.baud_rate

    @property
    def frame_gap(self) -> float:
        """The silence between two Modbus RTU frames, t3.5, s; fixed above 19200 bit/s."""
        return 0.00175 if self.baud_rate > 19200 else 3.5 * 11 / self.baud_rate
