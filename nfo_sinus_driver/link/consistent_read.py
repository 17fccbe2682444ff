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

"""Reading a value of two parts where each is a transaction of its own, as over Classic."""

from __future__ import annotations

from collections.abc import Generator
from collections.abc import Sequence

from nfo_sinus_driver.link.errors import DamagedAnswer
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import Reply

#: How often the parts of a value that changes meanwhile are read again.
_TRIES = 5


def consistent_read(
    unit: int, parts: Sequence[Address]
) -> Generator[Address, Reply, Reply]:
    """
    Yield the parts to read, one by one, and take what each was answered; return the whole.

    The high part, the low one, and the high one again until it stands still: others may talk
    between, and the value may change, but what is returned has been the value at one moment.

    :param parts: the low one, then the high one.

    :raises DamagedAnswer: it never stood still.
    """
    low_part, high_part = parts
    reply = yield high_part
    for _ in range(_TRIES):
        high = reply.data
        low = (yield low_part).data
        reply = yield high_part
        if reply.data == high:
            return Reply(low + high, reply.arrived)
    raise DamagedAnswer(f'unit {unit}: E{high_part.index:04X} never stood still')
