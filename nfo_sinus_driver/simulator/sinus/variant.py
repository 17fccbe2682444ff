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

"""What the manuals leave open of a Sinus, so that a simulated one can do it this way or that."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

KEEPS, DROPS = 'keeps', 'drops'
ALL, SCMD, NOTHING = 'all', 'scmd', 'nothing'
TAKEN, REFUSED = 'taken', 'refused'
#: What each of them can be, what the G2 does by default last.
CHOICES: Mapping[str, tuple[str, ...]] = {
    'run_command_in_fault': (KEEPS, DROPS),
    'refuses_in_fault': (ALL, SCMD, NOTHING),
    'stop_in_tuning': (REFUSED, TAKEN),
}


@dataclass(frozen=True)
class Variant:
    """
    One way to read the manuals; by default a G2 that follows [M0 table 16].

    :ivar run_command_in_fault: what becomes of a run command by a fault [C98]. ``keeps``: it
        stands, and the motor starts by itself when the fault is over. ``drops``: an acknowledgement
        ends it, also one that was given meanwhile, so a run needs a new one [M0 table 16]. A fault
        that the drive ends by itself starts the motor again in either case: that is what RstDly and
        ErrCnt are for. So do the terminals, whose RUN stands. With DriveControl the G2's state
        machine decides.
    :ivar refuses_in_fault: what is refused while a fault is active [C98], in whatever protocol:
        ``all`` but DriveControl and MODE = Stop in a serial fault, the run command (``scmd``), or
        ``nothing``.
        Classic refuses all whatever this says [M0 §6.1.5].
    :ivar stop_in_tuning: whether SCMD = Stop is ``taken`` while MODE is Inhibit, and ends the
        tuning, or ``refused`` until it is over [C101].
    :raises ValueError: one of them cannot be that.
    """

    run_command_in_fault: str = DROPS
    refuses_in_fault: str = NOTHING
    stop_in_tuning: str = TAKEN

    def __post_init__(self) -> None:
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise ValueError(f'{name}: choose one of {", ".join(choices)}')
