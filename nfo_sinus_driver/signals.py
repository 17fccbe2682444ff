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

"""Which signals end a process that drives motors, and which it must not obey."""

from __future__ import annotations

import signal

#: Signals that would suspend a process and leave the motors running.
SUSPENDING = frozenset((signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU))
#: Signals that end no process, or that cannot or must not be caught: those of a crash.
_OTHERS = frozenset(
    (
        signal.SIGCHLD,
        signal.SIGCONT,
        signal.SIGURG,
        signal.SIGWINCH,
        signal.SIGPIPE,
        signal.SIGKILL,
        signal.SIGSTOP,
        signal.SIGBUS,
        signal.SIGFPE,
        signal.SIGILL,
        signal.SIGSEGV,
        signal.SIGSYS,
    )
)
#: Every other signal ends a process, and therefore stops the motors first.
ENDING = frozenset(signal.valid_signals()) - SUSPENDING - _OTHERS


def signal_name(number: int) -> str:
    """Return what a signal is called."""
    try:
        return signal.Signals(number).name
    except ValueError:
        # the real-time signals have no names but the first and the last
        return f'signal {number}'
