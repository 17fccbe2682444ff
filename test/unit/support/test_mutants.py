# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The mutants break what stands in the code today."""

from __future__ import annotations

from pathlib import Path
import sys

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / 'test' / 'mutants'))

from mutant import Mutant  # noqa: E402
from mutants import MUTANTS  # noqa: E402
import pytest  # noqa: E402


@pytest.mark.parametrize('mutant', MUTANTS, ids=str)
def test_what_a_mutant_replaces_stands_there(mutant: Mutant) -> None:
    for file, text in mutant.changes(ROOT):
        assert text != file.read_text(encoding='utf-8')
    assert mutant.arguments(ROOT)
