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

"""
The driver, which also writes down when a service of a drive is called; a process of its own.

Appends one line for each call to the file that is its first argument: s of the steady clock.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from nfo_sinus_driver.node import commands
from nfo_sinus_driver.node import main


def run() -> int:
    """Run the driver until it ends."""
    path = sys.argv.pop(1)
    answer = commands.Commands._answer
    with open(path, 'a', buffering=1, encoding='ascii') as stamps:

        def stamped(self: Any, *arguments: Any) -> Any:
            stamps.write(f'{time.monotonic()}\n')
            return answer(self, *arguments)

        commands.Commands._answer = stamped
        return main.main()


if __name__ == '__main__':
    sys.exit(run())
