# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
``make mutants``: break the laws in copies of the project, one by one; each time a test must fail.

A long campaign, and therefore not part of ``make test``. Several are tried at once, for their
tests wait more than they work.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ThreadPoolExecutor
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

from mutant import Mutant
from mutants import MUTANTS

_ROOT = Path(__file__).resolve().parents[2]
_PYTEST = (sys.executable, '-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider', '-p', 'timeout')
_FAILED = 1
_NOTICED = 'noticed'


def main() -> int:
    """Try every mutant; return 1 if one was not noticed, or could not be tried."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--only', default='', help='only those whose name contains this')
    parser.add_argument('--jobs', type=int, default=(os.cpu_count() or 1) + 1, metavar='N')
    options = parser.parse_args()
    chosen = [mutant for mutant in MUTANTS if options.only in str(mutant)]
    failures = 0
    with ThreadPoolExecutor(options.jobs) as executor:
        # in the order of the list, whichever is through first
        for mutant, result in zip(chosen, executor.map(_try, chosen), strict=True):
            print(f'{result:8}  {mutant}', flush=True)
            failures += result != _NOTICED
    print(f'{len(chosen)} mutants, {failures} not noticed')
    return 1 if failures else 0


def _try(mutant: Mutant) -> str:
    """Return what became of a mutant."""
    with tempfile.TemporaryDirectory(prefix='nfo_sinus_mutant_') as folder:
        copy = Path(folder) / 'copy'
        _copy_project(copy)
        try:
            for file, text in mutant.changes(_ROOT):
                (copy / file.relative_to(_ROOT)).write_text(text, encoding='utf-8')
            tests = mutant.arguments(_ROOT)
        except ValueError as error:
            return f'NOT TRIED ({error})'
        # the processes that a test starts import the copy, too
        path = os.pathsep.join((str(copy), os.environ.get('PYTHONPATH', '')))
        # judged by what runs before every commit
        environment = {name: value for name, value in os.environ.items() if name != 'FULL'}
        done = subprocess.run(
            (*_PYTEST, *tests),
            cwd=copy,
            env={**environment, 'PYTHONPATH': path, 'PYTHONDONTWRITEBYTECODE': '1'},
            capture_output=True,
            text=True,
            check=False,
        )
    if done.returncode not in (0, _FAILED):
        return f'NOT TRIED (pytest: {(done.stdout + done.stderr).strip().splitlines()[-1:]})'
    return _NOTICED if done.returncode == _FAILED else 'SURVIVED'


def _copy_project(target: Path) -> None:
    listed = subprocess.run(
        ('git', 'ls-files', '--cached', '--others', '--exclude-standard'),
        cwd=_ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in listed.stdout.splitlines():
        source = _ROOT / name
        if source.is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target / name)


if __name__ == '__main__':
    sys.exit(main())
