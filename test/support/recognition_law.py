# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Judges that a driver writes to no drive that it has not recognised, by what its link is asked.

It knows nothing of how the driver recognises a drive, only that this takes answers: to some reads
since the driver began, since the port was opened, and since a silence in which another drive may
have been put in its place. One that has answered enough of them before needs one more.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
import math

from nfo_sinus_driver.link import MAILBOX, Address, LinkError, NotReady, NotSent, PortError, Refused

#: So long a silence lets one drive be exchanged for another, s, and how late the driver may see it.
_EXCHANGE, _LATE = 3.0, 0.5
#: How many reads a drive answers at least before it is written to, and a PLC; and one that is seen
#: again.
_LEAST, _LEAST_OF_PLC, _LEAST_OF_KNOWN = 2, 1, 1
#: How much longer than an answer is waited for the stop of another drive may take that goes before,
#: s: P843 of a MOVITRAC is in it.
_TURN = 0.25
#: How much longer than a loss takes a stop may be written although nothing answers, s.
_BLIND = 0.5


class RecognitionLaw:
    """
    The requests of one driver, as they come.

    :param complaints: gets what breaks the law.
    :param lost_after: after which silence the drive of each unit is lost, s.
    :param place: returns where the port is.
    :param response_timeout: how long an answer is waited for, s.
    """

    def __init__(
        self,
        complaints: list[str],
        lost_after: Mapping[int, float],
        place: Callable[[], str] = lambda: '',
        response_timeout: float = 0.2,
    ) -> None:
        self._complaints = complaints
        self._place = place
        self._turn = response_timeout + _TURN
        self._lost_at_place: str | None = None
        self._frame_at = -math.inf
        self._longest = {unit: max(_EXCHANGE, at + _BLIND) for unit, at in lost_after.items()}
        self._known: set[int] = set()
        self._answers: dict[int, int] = defaultdict(int)
        self._silent_since: dict[int, float] = {}

    def port_lost(self) -> None:
        """Record that the port is lost: whatever comes next may be another drive."""
        self._lost_at_place = self._place()
        self._silent_since.clear()

    def _note_port(self, now: float) -> None:
        """Judge a port that was lost, and is used again: soon, and where it was, it is the same."""
        before, self._lost_at_place = self._lost_at_place, None
        if before is None:
            return
        if self._place() != before:
            self._known.clear()
            self._answers.clear()
        elif now - self._frame_at > _EXCHANGE:
            self._answers.clear()

    def asked(self, unit: int, address: Address, *, writes: bool, now: float) -> None:
        """Judge a request before it is sent."""
        self._note_port(now)
        if not writes and (address.block is None or address.space != MAILBOX):
            return
        least = _LEAST if address.block is None else _LEAST_OF_PLC
        least = _LEAST_OF_KNOWN if unit in self._known else least
        answers, silent = self._answers[unit], now - self._silent_since.get(unit, now)
        late = _LATE + self._turn * len(self._longest)
        if answers < least or silent > self._longest[unit] + late:
            self._complaints.append(
                f'{now:.3f} s: {address} of unit {unit} is written, which has answered {answers} '
                f'reads and is silent for {silent:.1f} s'
            )

    def ended(self, unit: int, error: LinkError | None, *, reads: bool, now: float) -> None:
        """Record how a request ended."""
        if isinstance(error, (NotReady, NotSent, PortError)):
            return
        if error is not None and not (error.responded or isinstance(error, Refused)):
            self._silent_since.setdefault(unit, now)
            return
        self._frame_at = now
        if error is not None and now - self._silent_since.get(unit, now) > _EXCHANGE:
            # something is there, and what is not known yet
            return
        if now - self._silent_since.pop(unit, now) > _EXCHANGE:
            self._answers[unit] = 0
        # to what is known one stop may be written that nothing answers, and that may be answered
        self._answers[unit] += error is None and (reads or unit in self._known)
        if self._answers[unit] >= _LEAST:
            self._known.add(unit)
