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

"""Progress bars and remarks, on standard error, so that the output stays what a script wants."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Iterator
import contextlib
import sys
import threading

from tqdm import tqdm

#: What takes less needs no bar, s.
_DELAY = 0.3
_FORMAT = '{desc} {bar} {n_fmt}/{total_fmt}, {remaining} left'

# its own watch thread and process lock are for more than one bar in one program
tqdm.monitor_interval = 0
tqdm.set_lock(threading.RLock())


@contextlib.contextmanager
def progress(what: str, total: int) -> Iterator[Callable[[], None]]:
    """Show a bar, if standard error is a terminal; what it yields is called for every step."""
    with tqdm(
        desc=what,
        total=total,
        bar_format=_FORMAT,
        delay=_DELAY,
        disable=None,
        dynamic_ncols=True,
        file=sys.stderr,
        leave=False,
    ) as bar:
        yield lambda: bar.update()


def remark(text: str) -> None:
    """Say something to a person, above the bar if there is one."""
    tqdm.write(f'nfo-sinus: {text}', file=sys.stderr)
    sys.stderr.flush()


def put(text: str) -> None:
    """Print a line of output, above the bar if there is one."""
    tqdm.write(text, file=sys.stdout)
    sys.stdout.flush()
