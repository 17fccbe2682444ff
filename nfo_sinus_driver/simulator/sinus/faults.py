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

"""Faults of the serial line, which a Sinus acknowledges apart from the others."""

from __future__ import annotations

from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.simulator.classic_frames import LineError
from nfo_sinus_driver.simulator.faults import Faults

#: The flags of messages that were understood and are not carried out.
REFUSALS = (
    LineError.BLOCKED
    | LineError.PREFIX
    | LineError.NOT_PERMITTED
    | LineError.UNKNOWN
    | LineError.UNREADABLE
    | LineError.UNWRITABLE
    | LineError.OUT_OF_RANGE
)


class SinusFaults(Faults):
    """
    The faults of a Sinus.

    :param log_size: entries that the error log holds [C4].

    :ivar sio_err: what went wrong on the line since it was last read.
    """

    def __init__(self, model: Family, *, log_size: int = 32) -> None:
        (lost,) = (code.code for code in model.codes(Meaning.SERIAL_FAILURE))
        # where SioErr can be read, that is how it is acknowledged [C42]
        kept = {lost} if 'fieldbus.sio_err' in model else set()
        super().__init__(model, log_size=log_size, kept=kept)
        #: What a silent or damaged line leads to.
        self.line_lost = lost
        #: Faults of the serial channel: they end fieldbus control, and MODE = Stop acknowledges
        #: them [M0 §6.1.5].
        self.of_the_line = {lost, *(code.code for code in model.codes(Meaning.FIELDBUS_FAILURE))}
        self.sio_err = LineError(0)

    @property
    def serial(self) -> bool:
        """Whether a fault of the serial channel is active."""
        return not self.of_the_line.isdisjoint(self._present)

    def acknowledge_serial(self) -> None:
        """Acknowledge the serial channel's faults, as MODE = Stop does [M0 §6.1.5]."""
        self.sio_err = LineError(0)
        self._present = {
            code: cause for code, cause in self._present.items() if code not in self.of_the_line
        }

    def take_sio_err(self) -> LineError:
        """Return the flags of SioErr and clear them, and Sio Fail unless its cause lasts."""
        flags, self.sio_err = self.sio_err, LineError(0)
        if not self._present.get(self.line_lost, True):
            del self._present[self.line_lost]
        return flags

    def restart(self) -> None:
        """Forget what a power cycle makes forget."""
        self.sio_err = LineError(0)
        super().restart()
