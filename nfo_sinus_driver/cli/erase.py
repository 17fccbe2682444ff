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

"""``errors --erase``: the error log of a drive is erased."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import json

from nfo_sinus_driver.cli.confirm import require_yes
from nfo_sinus_driver.cli.control_session import NO_TIMEOUT
from nfo_sinus_driver.cli.control_session import control_session
from nfo_sinus_driver.cli.progress import put
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import LogEntry

_MUTE = {*NO_TIMEOUT, Cause.FAULT_APPEARED}
_LONGEST = 15.0


def erase(options: argparse.Namespace, entries: Sequence[LogEntry], rows: object) -> int:
    """
    Erase the error log, and see that it is empty.

    :param entries: what stands in it.
    :param rows: the same for a script.
    """
    count = '1 entry' if len(entries) == 1 else f'{len(entries)} entries'
    if entries:
        require_yes(options, f'Erase the error log ({count}) of address {options.address}?')
        with control_session(options, mute=_MUTE) as control:
            drive = control.drive()
            control.finish(drive.connect(), _LONGEST)
            control.finish(drive.erase_error_log(), _LONGEST)
    if options.json:
        put(json.dumps({'erased': rows}, ensure_ascii=False, indent=2))
    else:
        put(f'erased: {count}' if entries else 'the error log is empty already')
    return 0
