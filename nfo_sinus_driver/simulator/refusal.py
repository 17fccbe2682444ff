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

"""How a simulated drive says no."""

from __future__ import annotations

import enum


class Reason(enum.IntEnum):
    """
    Why a request is refused; the numbers are Modbus's exception codes.

    The manuals do not say which code the drive uses when [C87]; these are the standard's meanings.
    """

    #: The drive does not have this function.
    FUNCTION = 1
    #: No such parameter, not its length, not its beginning, or not this way (read, write).
    ADDRESS = 2
    #: The value is out of range, or no code of the enumeration.
    VALUE = 3
    #: Right as such, but not in the state that the drive is in.
    STATE = 4


class GatewayReason(enum.IntEnum):
    """What a gateway says in place of a drive; the standard's exception codes."""

    #: It knows no way to the drive.
    NO_PATH = 10
    #: The drive does not answer it.
    NO_ANSWER = 11


class Refused(Exception):
    """The drive refuses a request; ``reason`` goes over the line, the text is for people."""

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(text)
        self.reason = reason
