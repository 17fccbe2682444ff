# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
When a port that is open and mute is to be opened again.

What carries the bytes may pass none until it is opened again, and report no error. Units that are
switched off look the same, and so does what is starting, so it is opened again more and more
seldom. A port from which any byte comes is not mute.

No thread, no clock and nothing sent: :class:`nfo_sinus_driver.bus.Bus` reports the outcome of each
request, and asks.
"""

from __future__ import annotations

import math

from nfo_sinus_driver.link import LinkError, NotSent, PortError

__all__ = ['MutePort']

#: How long a port that was opened is mute, s, until it is opened again, each time in vain: what is
#: behind it may restart whenever it is opened, and takes so long.
_MUTE_PAUSES = (2.0, 4.0, 8.0, 15.0, 30.0)
#: The same while a stop waits; then from the first on again. The last one is for what takes so long
#: to start, and would never be heard.
_MUTE_PAUSES_OF_A_STOP = (2.0, 4.0, *[8.0] * 10, 30.0)
#: The same where nothing was ever heard, or where bytes come, but nothing that is valid, s.
_MUTE_LONGEST = _MUTE_PAUSES[-1]


class MutePort:
    """
    For how long nothing has come through one port; all times are of one clock, s.

    :ivar heard: something valid has ever come.
    """

    def __init__(self) -> None:
        self.heard = False
        #: Since when every request has failed, and when the last of them did.
        self._since = math.inf
        self._in_vain_at = -math.inf
        #: How often it was opened since the last request that did not fail, and when last.
        self._opened = 0
        self._opened_at = -math.inf
        #: Until when it is opened once more at the latest, s, and until when only once.
        self._once_more = (math.inf, -math.inf)

    def note_request(self, now: float, error: LinkError | None, *, ever_answered: bool) -> bool:
        """
        Note the outcome of a request; return whether the port carries.

        :param ever_answered: the unit has; one that never did shows nothing.
        """
        if isinstance(error, NotSent):
            return False
        if error is None or error.responded or error.heard:
            self.heard, self._opened, self._since = True, 0, math.inf
            return True
        if not isinstance(error, PortError) and (not self.heard or ever_answered):
            self._since = min(self._since, now)
            self._in_vain_at = now
        return False

    def opened(self, now: float) -> None:
        """Note that it was opened."""
        self._opened += 1
        self._since = math.inf
        self._opened_at = now
        self._once_more = (math.inf, self._once_more[1])

    def paused(self, seconds: float) -> None:
        """Note that nothing was sent for so long, s, for the worker did not run."""
        self._since += seconds

    def hurry(self, at: float, end: float) -> None:
        """Have it opened once more while it is mute, at this moment or before, until the end, s."""
        first, last = self._once_more
        self._once_more = (min(first, at), max(last, end))

    def mute_for(self, now: float) -> float:
        """Return for how long nothing has come, s, although units were asked; 0: not at all."""
        return max(0.0, now - self._since)

    def reopen_at(self, last_byte_at: float, lost_after: float, *, stop_waits: bool) -> float:
        """
        Return when it is to be opened again, s, where it is mute.

        :param last_byte_at: when the last byte came, be it of no use, s.
        :param lost_after: after which silence all drives of the line are lost, s.
        :param stop_waits: a motor is to be stopped.
        """
        since, opened = self._since, self._opened
        at_last = since + max(lost_after, _MUTE_LONGEST)
        if not self.heard or (opened and last_byte_at >= self._opened_at):
            due = at_last
        elif opened:
            due = since + max(lost_after, _mute_pause(opened, stop_waits=stop_waits))
        else:
            due = min(max(since, last_byte_at) + lost_after, at_last)
        at, end = self._once_more
        if at == math.inf:
            # it was opened once more, if that was wanted
            return max(due, end)
        return min(due, max(at, since + end - at))

    def is_mute_at(self, moment: float, last_byte_at: float) -> bool:
        """
        Return whether it is known that it is mute still at the moment when it is opened.

        What takes just so long to start answers a request that is sent then; and where bytes came,
        others may have come since if units had been asked.
        """
        is_doubtful = self._opened or last_byte_at > self._since
        return not is_doubtful or self._in_vain_at >= moment


def _mute_pause(opened: int, *, stop_waits: bool) -> float:
    """Return how long a port is left alone that was opened so often in vain, s."""
    if stop_waits:
        return _MUTE_PAUSES_OF_A_STOP[(opened - 1) % len(_MUTE_PAUSES_OF_A_STOP)]
    return _MUTE_PAUSES[min(opened, len(_MUTE_PAUSES)) - 1]
