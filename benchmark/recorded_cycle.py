# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

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
