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

"""What a Modbus unit can be asked at any time, to find out whether the line can be believed."""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence
from typing import Any

from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.modbus_identify import SPECIFIC
from nfo_sinus_driver.link.modbus_identify import ReadDevice
from nfo_sinus_driver.link.modbus_identify import ReportSlaveId
from nfo_sinus_driver.link.modbus_pdu import Request
from nfo_sinus_driver.link.modbus_pdu import read_of
from nfo_sinus_driver.link.modbus_pdu import refusal_head

#: The object of function 43/14 whose text is empty, so its answer is the shortest [M0 §6.2.4].
_PRODUCT_CODE = 1


def answer_kinds(request: Request[Any]) -> tuple[bytes, bytes]:
    """Return what tells the answer to a request from others, and what its refusal."""
    return request.answer_head, refusal_head(request)


def resync_reads(
    unit: int, addresses: Sequence[Address]
) -> Iterator[tuple[Request[Any], Sequence[bytes]]]:
    """
    Yield requests that do nothing, the quickest first, each with what has to tell its answer.

    First the parameters that the drive is known to have. Then functions 17 and 43/14, which only
    identify a drive [M0 §6.2.4]: one that does not have them [C57] refuses, and a refusal names
    the function, so that tells as much.
    """
    for address in addresses:
        read = read_of(unit, address)
        yield read, (read.answer_head,)
    for request in (ReportSlaveId(unit), ReadDevice(unit, SPECIFIC, _PRODUCT_CODE)):
        yield request, answer_kinds(request)
