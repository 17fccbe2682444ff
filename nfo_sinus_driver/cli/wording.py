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

"""What the drive layer says, in the words of this tool: it speaks of services and parameters."""

from __future__ import annotations

#: What it says, and what is typed here instead; the longer ones first.
_WORDS = (
    ('call ~/fault_ack, then ~/enable to go on', 'type nfo-sinus ack, then run it again'),
    ('call ~/enable to go on', 'run it again to go on'),
    ('call ~/fault_ack', 'type nfo-sinus ack'),
    ('~/fault_ack', 'nfo-sinus ack'),
    ('~/enable', 'nfo-sinus run'),
    ('expected_control_mode in the driver', 'give another --control-mode'),
    ('more than lost_after', 'more than a silence after which it is lost'),
    ('set drive_timeout', 'give --drive-timeout'),
    ('drive_timeout', '--drive-timeout'),
    ('set model to auto or to what it is', 'give the right --model'),
    ('if this driver is killed', 'if this command is killed'),
    ('the driver is ending', 'this command is ending'),
    ('; tried again for ever', ''),
)


def in_our_words(text: str) -> str:
    """Return a message of the drive layer so that it names what can be typed here."""
    for theirs, ours in _WORDS:
        text = text.replace(theirs, ours)
    return text
