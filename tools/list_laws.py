# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``make laws``: for each law of docs/architecture.md the tests that hold it, and its mutants.

A test holds the laws whose number its name begins with (``test_3_every_way_out_…``), and those
whose mutants name its file. Nothing of that is stored: what is printed is read from the tests.
"""

from __future__ import annotations

from collections import Counter, defaultdict
import os
from pathlib import Path
import re
import subprocess
import sys

_ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(_ROOT / 'test' / 'mutants'))

from mutants import MUTANTS  # noqa: E402, the folder is no package

_LAW = re.compile(r'^(\d+)\. \*\*(.+?)\*\*', re.MULTILINE | re.DOTALL)
_NUMBERED = re.compile(r'^test/(\S+?)::test_(\d+)_(\w+)', re.MULTILINE)


def main() -> None:
    """Print all laws."""
    page = (_ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
    numbered = _numbered()
    for number, title in _LAW.findall(page):
        law = int(number)
        print(f'{law}. {" ".join(title.split())}')
        for name, cells in sorted(numbered[law].items()):
            print(f'   {name}: {cells} {"cell" if cells == 1 else "cells"}')
        mutants = Counter(mutant.tests[0] for mutant in MUTANTS if mutant.law == law)
        for file, count in sorted(mutants.items()):
            print(f'   {file}: {count} {"mutant" if count == 1 else "mutants"}')


def _numbered() -> dict[int, Counter[str]]:
    """Return the tests that name a law, and how many cells each has, by the law."""
    done = subprocess.run(
        (
            *(sys.executable, '-m', 'pytest', '--collect-only', '-q', '-p', 'timeout'),
            *('-p', 'hypothesispytest', '-p', 'no:cacheprovider', 'test/unit/drive'),
        ),
        cwd=_ROOT, env={**os.environ, 'FULL': '1'}, capture_output=True, text=True, check=True,
    )
    found: dict[int, Counter[str]] = defaultdict(Counter)
    for file, law, name in _NUMBERED.findall(done.stdout):
        found[int(law)][f'test/{file}::test_{law}_{name}'] += 1
    return found


if __name__ == '__main__':
    main()
