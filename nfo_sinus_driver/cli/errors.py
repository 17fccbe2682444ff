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

"""Why the command did not do what it was told."""

from __future__ import annotations

from collections.abc import Iterable


class CliError(Exception):
    """It was not done; the message says why and what to do."""


class UsageError(Exception):
    """What was typed makes no sense; the message says what would."""


class Interrupted(Exception):
    """A person or the system ended it."""

    def __init__(self) -> None:
        super().__init__('interrupted')


def listed(head: str, lines: Iterable[str]) -> str:
    """Return a text with a list below it."""
    return '\n  '.join((head, *lines))
