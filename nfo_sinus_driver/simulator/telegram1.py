# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Standard telegram 1 as a simulated drive takes it: control word and set-point, and what comes back.

What the words mean is each family's business; how they come to the drive that of its master.
"""

from __future__ import annotations

import abc
from typing import ClassVar

from nfo_sinus_driver.simulator.parameter_channel import ParameterChannel

#: The most that a word of the telegram carries, signed.
_MOST = 0x7FFF


class Server(abc.ABC):
    """What one drive does with the telegrams of its fieldbus; its family says."""

    #: Bits of STW1 that a PLC clears and sets to stop the drive when its own master is lost.
    lost_clears: ClassVar[int] = 0x0001
    lost_sets: ClassVar[int] = 0x0000

    #: Its parameters, as its master reaches them beside the telegrams; ``None``: no manual says.
    parameters: ParameterChannel | None = None
    #: Its master exchanges the longer telegram with it, which it has beside the standard one.
    longer = False

    @property
    def online(self) -> bool:
        """Whether the drive takes part in the exchange at all, as it is set."""
        return not self.longer

    @property
    def more(self) -> tuple[int, int, int] | None:
        """What the longer telegram tells behind status word and actual value, if it has one."""
        return None

    @abc.abstractmethod
    def exchange(self, stw1: int, setpoint: int) -> tuple[int, int]:
        """Take control word and set-point; return status word and actual value, both signed."""


class FieldbusWatch:
    """
    Whether the telegrams of the fieldbus go on coming, as the drive sees it.

    A drive that has never had one does not miss them.
    """

    def __init__(self) -> None:
        self._unheard: float | None = None

    def heard(self) -> None:
        """Take note of a telegram."""
        self._unheard = 0.0

    def forget(self) -> None:
        """Begin as after power-on."""
        self._unheard = None

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""
        if self._unheard is not None:
            self._unheard += dt

    def silent_for(self, time: float) -> bool:
        """Whether no telegram has come for so long (s)."""
        return self._unheard is not None and self._unheard >= time

    @property
    def active(self) -> bool:
        """Whether telegrams have come."""
        return self._unheard is not None


def clipped(number: float) -> int:
    """Return the nearest number that a signed word of the telegram carries."""
    return min(max(round(number), -_MOST - 1), _MOST)
