# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Standard telegram 1 as a simulated drive takes it: control word and set-point, and what comes back.

The words of PROFIdrive are here, for the families that have them; how words come to the drive is
the business of its master.
"""

from __future__ import annotations

import abc
import enum
from typing import ClassVar

from nfo_sinus_driver.simulator.parameter_channel import ParameterChannel

#: The most that a word of the telegram carries, signed.
_MOST = 0x7FFF


class Stw1(enum.IntFlag):
    """The control word of PROFIdrive."""

    ON = 1 << 0
    NO_COAST_STOP = 1 << 1
    NO_QUICK_STOP = 1 << 2
    ENABLE_OPERATION = 1 << 3
    ENABLE_RAMP = 1 << 4
    UNFREEZE_RAMP = 1 << 5
    ENABLE_SETPOINT = 1 << 6
    FAULT_ACKNOWLEDGE = 1 << 7
    CONTROL_BY_PLC = 1 << 10


class Zsw1(enum.IntFlag):
    """The status word of PROFIdrive."""

    READY_TO_SWITCH_ON = 1 << 0
    READY_TO_OPERATE = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    NO_COAST_STOP = 1 << 4
    NO_QUICK_STOP = 1 << 5
    SWITCHING_ON_INHIBITED = 1 << 6
    WARNING = 1 << 7
    WITHIN_TOLERANCE = 1 << 8
    CONTROL_REQUESTED = 1 << 9
    REACHED = 1 << 10
    PULSES_ENABLED = 1 << 15


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
        """What the longer telegram reports behind status word and actual value, if it has one."""
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

    def note_telegram(self) -> None:
        """Record a telegram."""
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
