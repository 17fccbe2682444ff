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

"""Network management of CANopen, without I/O: start, boot-up and heartbeat (CiA 301 §7.2.8)."""

from __future__ import annotations

from nfo_sinus_driver.link.can import Frame

#: Added to the address of a node, the identifier of its boot-up and of its heartbeat.
HEARTBEATS = 0x700
#: The node that this client is to those that watch over its heartbeat (object 1016h).
CLIENT = 127

_COMMANDS = 0x000
_START = 0x01
_BOOTED, _OPERATIONAL = b'\x00', b'\x05'

#: What this client sends for as long as it is there.
HEARTBEAT = Frame(HEARTBEATS + CLIENT, _OPERATIONAL)


def start(unit: int) -> Frame:
    """Return what makes a node operational; there is no answer to it."""
    return Frame(_COMMANDS, bytes((_START, unit)))


def booted(frame: Frame) -> int | None:
    """Return which node has started anew; ``None``: the frame says nothing of the kind."""
    unit = frame.identifier - HEARTBEATS
    return unit if 0 < unit <= CLIENT and frame.data == _BOOTED else None
