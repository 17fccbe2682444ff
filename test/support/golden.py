# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What each test on the virtual rig had on its lines, as a hash of all frames with their times.

A change that is to change no traffic is compared with the commit before it: ``make golden``. The
time is virtual, so that two runs of one commit give the same.
"""

from __future__ import annotations

from collections.abc import Iterator
import hashlib
import json
import os
from typing import Any

import pytest

#: The frames of each line of the test that runs, in order; kept only where ``GOLDEN`` names a file.
_lines: list[list[Any]] = []
_FILE = os.environ.get('GOLDEN', '')


def keep(frames: list[Any]) -> None:
    """Keep what a line carries, until the test ends."""
    if _FILE:
        _lines.append(frames)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Write what was kept of one test; one line for each, as workers write to one file."""
    _lines.clear()
    result = yield
    if _lines:
        digest = hashlib.sha256(json.dumps(_lines, default=bytes.hex).encode()).hexdigest()
        frames = sum(map(len, _lines))
        with open(_FILE, 'a', encoding='utf-8') as stream:
            stream.write(f'{item.nodeid}\t{frames}\t{digest}\n')
    _lines.clear()
    return result
