# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Judges that a driver writes to no drive that it has not recognised, by what its link is asked.

It knows nothing of how the driver recognises a drive, only that this takes answers: to some reads
since the driver began, since the port was opened, and since a silence in which another drive may
have been put in its place.
"""

from __future__ import annotations

from collections import defaultdict

from nfo_sinus_driver.link import (
    MAILBOX,
    Address,
    LinkError,
    NotReady,
    NotSent,
    PortError,
    Refused,
)

#: So long a silence lets one drive be exchanged for another, s, and how late the driver may see it.
_EXCHANGE, _LATE = 3.0, 0.5
#: How many reads a drive answers at least before it is written to, and a PLC.
_LEAST, _LEAST_OF_PLC = 2, 1


class RecognitionLaw:
    """
    The requests of one driver, as they come.

    :param complaints: gets what breaks the law.
    """

    def __init__(self, complaints: list[str]) -> None:
        self._complaints = complaints
        self._answers: dict[int, int] = defaultdict(int)
        self._silent_since: dict[int, float] = {}

    def port_lost(self) -> None:
        """Record that the port is lost: whatever comes next may be another drive."""
        self._answers.clear()
        self._silent_since.clear()

    def asked(self, unit: int, address: Address, *, writes: bool, now: float) -> None:
        """Judge a request before it is sent."""
        if not writes and (address.block is None or address.space != MAILBOX):
            return
        least = _LEAST if address.block is None else _LEAST_OF_PLC
        answers, silent = self._answers[unit], now - self._silent_since.get(unit, now)
        if answers < least or silent > _EXCHANGE + _LATE:
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
        if now - self._silent_since.pop(unit, now) > _EXCHANGE:
            self._answers[unit] = 0
        self._answers[unit] += reads and error is None
