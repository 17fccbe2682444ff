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

"""Signals, held back until they are asked for: nothing may end or freeze who drives a motor."""

from __future__ import annotations

import signal

from nfo_sinus_driver.signals import ENDING
from nfo_sinus_driver.signals import SUSPENDING

_HELD = ENDING | SUSPENDING


class HeldSignals:
    """
    Holds signals back while the ``with`` block lasts.

    It has to begin before any other thread does, for a thread that does not hold them would get
    them.
    """

    def __init__(self) -> None:
        self._before: set[int | signal.Signals] = set()

    def __enter__(self) -> HeldSignals:
        self._before = signal.pthread_sigmask(signal.SIG_BLOCK, _HELD)
        return self

    def __exit__(self, *_: object) -> None:
        # what nobody asked for would end it now that all is done
        while self.next(0.0) is not None:
            continue
        signal.pthread_sigmask(signal.SIG_SETMASK, self._before)

    def next(self, timeout: float) -> int | None:
        """Return the next signal, or ``None`` when none came in time, s."""
        caught = signal.sigtimedwait(_HELD, timeout)
        return None if caught is None else caught.si_signo
