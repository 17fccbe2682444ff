# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``make golden``: name the tests whose frames are others than with the driver of another commit.

Both run with the tests of this tree, which are copied beside that driver.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

_ROOT = Path(__file__).resolve().parents[1]
#: Where the tests are that have a virtual rig.
_TESTS = ('test/unit/drive', 'test/unit/families', 'test/unit/link')
#: What a test had on its lines: how many frames, and their hash.
Traces = Mapping[str, tuple[str, str]]


def main() -> int:
    """Compare; return 1 where something differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('commit', nargs='?', default='HEAD', help='default: HEAD')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix='nfo_sinus_golden_') as folder:
        other = Path(folder) / 'other'
        _git('worktree', 'add', '--detach', '--quiet', str(other), options.commit)
        try:
            for name in ('test', 'pyproject.toml'):
                _replace(other / name, _ROOT / name)
            before = _traces(other, Path(folder) / 'before')
        finally:
            _git('worktree', 'remove', '--force', str(other))
        now = _traces(_ROOT, Path(folder) / 'now')
    changed = _changed(before, now)
    for line in changed:
        print(line)
    print(f'{len(now)} tests with frames; {len(changed)} have others than with {options.commit}')
    return 1 if changed else 0


def _changed(before: Traces, now: Traces) -> list[str]:
    """Return a line for each test that is in one of both only, or had other frames."""
    found = []
    for name in sorted(before.keys() | now.keys()):
        (count, _), (count_now, _) = before.get(name, ('none', '')), now.get(name, ('none', ''))
        if before.get(name) != now.get(name):
            found.append(f'{name}: {count} frames before, {count_now} now')
    return found


def _traces(tree: Path, file: Path) -> Traces:
    """Run the tests of a tree, and return what they had on their lines; some may fail."""
    file.touch()
    subprocess.run(
        (
            *(sys.executable, '-m', 'pytest', '-q', '-p', 'xdist', '-p', 'timeout'),
            *('-p', 'hypothesispytest', '-p', 'support.golden', '-p', 'no:cacheprovider'),
            *('-n', 'auto', '--dist', 'worksteal', *_TESTS),
        ),
        cwd=tree,
        # the driver of the tree, not the one that is installed
        env={**os.environ, 'GOLDEN': str(file), 'PYTHONPATH': f'{tree}{os.pathsep}{tree / "test"}'},
        check=False,
    )
    lines = (line.split('\t') for line in file.read_text(encoding='utf-8').splitlines())
    return {name: (count, digest) for name, count, digest in lines}


def _replace(old: Path, new: Path) -> None:
    if old.is_dir():
        shutil.rmtree(old)
    (shutil.copytree if new.is_dir() else shutil.copy)(new, old)


def _git(*arguments: str) -> None:
    subprocess.run(('git', *arguments), cwd=_ROOT, check=True)


if __name__ == '__main__':
    sys.exit(main())
