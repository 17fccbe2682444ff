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

"""
Modbus TCP frames of a master, without I/O.

A frame is a number that the answer repeats, two bytes of zero, the length of the message and the
message (MODBUS Messaging on TCP/IP Implementation Guide V1.0b §3.1.3). TCP itself sees to it that
bytes come whole and in order, so there is no check sum, and a header that makes no sense says that
somebody else is there.
"""

from __future__ import annotations

import struct

from nfo_sinus_driver.link import modbus_pdu
from nfo_sinus_driver.link.modbus_pdu import Request

_HEADER = struct.Struct('>HHH')
#: Unit and function, and as much data as there can be.
_MESSAGE_LENGTHS = range(2, 255)


def encode(request: Request[object], number: int) -> bytes:
    """Return the frame of a request; its answer will have the same number."""
    message = modbus_pdu.encode(request)
    return _HEADER.pack(number, 0, len(message)) + message


class FrameReader:
    """
    Cuts the bytes of one connection into frames.

    :ivar out_of_step: something came that is no frame; nothing after it can be understood.
    """

    def __init__(self) -> None:
        self.out_of_step = False
        self._buffer = b''

    @property
    def received(self) -> int:
        """How many bytes have come of a frame that is not complete."""
        return len(self._buffer)

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Take bytes that came in; return number and message of each frame that is complete."""
        self._buffer += data
        frames = []
        while len(self._buffer) >= _HEADER.size and not self.out_of_step:
            number, protocol, length = _HEADER.unpack_from(self._buffer)
            end = _HEADER.size + length
            if protocol or length not in _MESSAGE_LENGTHS:
                self.out_of_step = True
            elif len(self._buffer) < end:
                break
            else:
                frames.append((number, self._buffer[_HEADER.size : end]))
                self._buffer = self._buffer[end:]
        return frames
