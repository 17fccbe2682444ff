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

"""Modbus RTU over one serial line."""

from __future__ import annotations

from typing import Any
from typing import TypeVar

from nfo_sinus_driver.link import rtu
from nfo_sinus_driver.link.modbus_link import UNITS
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.protocol import LineProtocol
from nfo_sinus_driver.link.serial_link import SerialLink

_T = TypeVar('_T')


class RtuLink(SerialLink):
    """A Modbus RTU master; between frames the line is silent for t3.5."""

    protocol = LineProtocol(
        name='modbus_rtu',
        addressing='modbus',
        units=UNITS,
        baud_rate=19200,
        char_format='8E1',
        char_formats=('8E1', '8O1', '8N2', '8N1', '8E2', '8O2'),
        identifies=True,
        writes_and_reads=True,
    )

    @property
    def _gap(self) -> float:
        return self._settings.frame_gap

    def _encode(self, request: Request[Any]) -> bytes:
        return rtu.encode(request)

    def _reader(self, request: Request[_T]) -> rtu.RtuReader[_T]:
        return rtu.RtuReader(request)

    def _frame_length(self, message_length: int) -> int:
        return message_length + rtu.CRC_LENGTH
