# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The site of the documentation, where ``make docs`` has installed what makes it."""

from __future__ import annotations

from pathlib import Path
import subprocess

import pytest

ROOT = Path(__file__).resolve().parents[2]
_SPHINX = ROOT / '.venv' / 'docs' / 'bin' / 'sphinx-build'


@pytest.mark.skipif(not _SPHINX.exists(), reason='Sphinx is not installed: make docs')
def test_every_page_is_made_and_no_link_leads_nowhere(tmp_path: Path) -> None:
    done = subprocess.run(
        [_SPHINX, '-q', '-W', '--keep-going', '-b', 'html', '-c', 'docs', '.', tmp_path],
        cwd=ROOT, capture_output=True, text=True, timeout=300, check=False,
    )
    assert done.returncode == 0, done.stderr
    pages = [*(ROOT / 'docs').rglob('*.md'), ROOT / 'README.md', ROOT / 'CHANGELOG.rst']
    index = (tmp_path / 'docs' / 'README.html').read_text()
    for page in pages:
        made = tmp_path / page.relative_to(ROOT).with_suffix('.html')
        assert made.is_file(), page
        assert page.name == 'README.md' or made.name in index, f'{page} is in the contents'
    assert 'docs/README.html' in (tmp_path / 'index.html').read_text(), 'the folder has a page'
