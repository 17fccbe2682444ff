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

"""Ask before something that cannot be taken back."""

from __future__ import annotations

import argparse
import sys

from nfo_sinus_driver.cli.errors import CliError
from nfo_sinus_driver.cli.errors import UsageError


def require_yes(options: argparse.Namespace, question: str) -> None:
    """
    See to it that a person wants it.

    :raises CliError: the answer is no.
    :raises UsageError: there is nobody to ask, and no ``--yes``.
    """
    if options.yes:
        return
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(f'{question} Nobody can be asked here: say so with --yes')
    print(f'{question} [y/N] ', end='', file=sys.stderr, flush=True)
    answer = sys.stdin.readline()
    if not answer.endswith('\n'):
        print(file=sys.stderr)
    if answer.strip().lower() not in ('y', 'yes'):
        raise CliError('nothing was done')
