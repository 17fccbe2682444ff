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


"""Drive Control of a Sinus Optimal: three commands, each of which must precede the next [M1]."""

from __future__ import annotations

from nfo_sinus_driver.families.sinus_optimal.words import Control
from nfo_sinus_driver.families.sinus_optimal.words import Status

#: The commands in their order, and the status bits that must be there for one to be taken.
_STEPS = (
    (Control.BUS_CONTROL, Status(0)),
    (Control.ENABLE, Status.CONTROL_FROM_BUS | Status.READY),
    (Control.SWITCH_ON, Status.CONTROL_FROM_BUS | Status.ENABLED),
)
#: How long the drive takes to respond (s): longer than a write, so that it matters to wait.
_RESPONSE = 0.05


class ControlSteps:
    """
    How far a master has come.

    A command is taken when its bit rises and the status word is ready for it. What came too early
    does nothing until it is taken back and given again; what is taken back ends at once, and all
    that came after it.

    :ivar word: the last control word.
    """

    def __init__(self) -> None:
        self.word = Control(0)
        self._asked = 0
        self._reached = 0
        self._left = 0.0

    def write(self, word: Control, shown: Status) -> None:
        """Take a control word; ``shown`` is the status word until now."""
        rises = word & ~self.word
        self.word = word
        held = 0
        while held < len(_STEPS) and word & _STEPS[held][0]:
            held += 1
        self._asked = min(self._asked, held)
        self._reached = min(self._reached, held)
        if self._reached == self._asked < held:
            command, needed = _STEPS[self._asked]
            if rises & command and shown & needed == needed:
                self._asked += 1
                self._left = _RESPONSE

    def give_up(self) -> None:
        """Lose control to somebody else; the word stays as it was written."""
        self._asked = self._reached = 0

    def drop_run(self) -> None:
        """Forget the run command; its bit must be taken back and given again."""
        before_run = len(_STEPS) - 1
        self._asked = min(self._asked, before_run)
        self._reached = min(self._reached, before_run)

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        self._left = max(0.0, self._left - dt)
        if not self._left:
            self._reached = self._asked

    @property
    def waiting(self) -> bool:
        """Whether a command has been taken and has had no effect yet."""
        return self._asked > self._reached

    @property
    def has_control(self) -> bool:
        """Whether the bus has control by this word."""
        return self._reached >= 1

    @property
    def enabled(self) -> bool:
        """Whether a run command would be taken."""
        return self._reached >= 2

    @property
    def run(self) -> bool:
        """Whether a run command stands."""
        return self._reached == len(_STEPS)
