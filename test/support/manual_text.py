# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The text of the manuals, a second opinion on the catalog: what they print beside what it says."""

from __future__ import annotations

from collections.abc import Iterator
import functools
from pathlib import Path
from typing import Any, TypeAlias

import pytest

MANUALS = Path(__file__).resolve().parents[3] / 'shared' / 'manuals'
#: Where it stands, what is printed there, as the catalog would have it, and what that has.
Fact: TypeAlias = tuple[str, Any, Any]


@functools.cache
def manual(number: int) -> list[str]:
    """The lines of the manual M0 to M4; the test is skipped where it is not there."""
    found = sorted(MANUALS.glob(f'{number:03d}_*.txt'))
    if not found:
        pytest.skip(f'M{number} is not beside this clone')
    return found[0].read_text(encoding='utf-8').splitlines()


def between(lines: list[str], start: str, end: str) -> Iterator[list[str]]:
    """The rows between two lines, as cells."""
    first = next(number for number, line in enumerate(lines) if line.startswith(start))
    for line in lines[first:]:
        if line.startswith(end):
            return
        yield [cell.strip() for cell in line.split('\t')]
