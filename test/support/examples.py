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

"""How many examples of hypothesis a test has."""

from __future__ import annotations

import os

#: Set by ``make unit FULL=1``.
FULL = bool(os.environ.get('FULL'))
_SHARE = 4


def examples(number: int) -> int:
    """Return the number itself in a full run, and a share of it in a normal one."""
    return number if FULL else number // _SHARE
