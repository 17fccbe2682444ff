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

"""The transactions that the driver made, for other masters to make them again."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
import json
from pathlib import Path

from trace_file import Frame

#: A request, and how many bytes it is answered.
Cycle = list[tuple[bytes, int]]


def save(frames: Sequence[Frame], path: Path) -> None:
    """Write down every transaction of a trace."""
    found = [
        (request.data.hex(), len(answer.data))
        for request, answer in pairwise(frames)
        if request.is_request and not answer.is_request
    ]
    path.write_text(json.dumps(found))


def load(path: str) -> Cycle:
    """Return what was written down."""
    found = json.loads(Path(path).read_text())
    return [(bytes.fromhex(request), length) for request, length in found]
