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
    assert mutant.old in (ROOT / mutant.file).read_text(encoding='utf-8')
    assert (ROOT / mutant.tests[0]).is_file()
