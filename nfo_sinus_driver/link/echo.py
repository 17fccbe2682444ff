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

"""Our own requests that come back, as many half-duplex adapters hand them over."""

from __future__ import annotations


class Echo:
    """
    Tells an echo of a request from its answer.

    Who finds the request itself among the bytes that come sets ``present``; from then on every
    request has to come back before anything else counts. That matters most where the answer is
    the same as the request: function 06.

    :ivar present: every request comes back.
    :ivar before: what came between the request and its echo.
    """

    def __init__(self) -> None:
        self.present = False
        self.before = b''
        self._awaited = b''
        self._held = b''

    def sent(self, frame: bytes) -> None:
        """Expect a request to come back, if they do."""
        self._awaited = frame if self.present else b''
        self._held = self.before = b''

    @property
    def bytes_needed(self) -> int:
        """How many bytes of the echo have to come yet."""
        return max(0, len(self._awaited) - len(self._held))

    def strip(self, data: bytes) -> bytes:
        """Return what of the bytes that came is no echo, nor came before it."""
        if not self._awaited:
            return data
        self._held += data
        before, echo, rest = self._held.partition(self._awaited)
        if echo:
            self.before = before
            self._awaited = self._held = b''
        return rest

    def give_up(self) -> bytes:
        """Return what came instead of the echo."""
        held, self._held, self._awaited = self._held, b'', b''
        return held
