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

"""Modbus ASCII over one serial line."""

from __future__ import annotations

from typing import Any
from typing import TypeVar

from nfo_sinus_driver.link import modbus_ascii
from nfo_sinus_driver.link.modbus_link import UNITS
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.protocol import LineProtocol
from nfo_sinus_driver.link.serial_link import SerialLink

#: Frames need no silence between them, but transmitters take a moment to switch, characters.
_SWITCHING = 2

_T = TypeVar('_T')


class AsciiLink(SerialLink):
    """
    A Modbus ASCII master.

    The standard allows a pause of a second between two characters. An answer whose end was lost
    would leave the line unused for that, so no pause may be longer than it may take to begin one.
    """

    protocol = LineProtocol(
        name='modbus_ascii',
        addressing='modbus',
        units=UNITS,
        baud_rate=19200,
        char_format='7E1',
        char_formats=('7E1', '7O1', '7N2', '7N1', '7E2', '7O2'),
        identifies=True,
        writes_and_reads=True,
    )

    @property
    def _gap(self) -> float:
        return _SWITCHING * self._settings.char_time

    def _encode(self, request: Request[Any]) -> bytes:
        return modbus_ascii.encode(request)

    def _reader(self, request: Request[_T]) -> modbus_ascii.AsciiReader[_T]:
        timeout = min(modbus_ascii.INTER_BYTE_TIMEOUT, self._settings.response_timeout)
        return modbus_ascii.AsciiReader(request, timeout)

    def _frame_length(self, message_length: int) -> int:
        return modbus_ascii.length(message_length)
