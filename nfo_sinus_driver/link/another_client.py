# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Another client of the SDO servers that are asked here, by what it asks them."""

from __future__ import annotations

from nfo_sinus_driver.link import sdo
from nfo_sinus_driver.link.another_master import Sightings
from nfo_sinus_driver.link.can import Frame
from nfo_sinus_driver.link.interface import Remarks
from nfo_sinus_driver.link.sdo import Kind


def _remark(unit: int) -> str:
    return (
        f'another SDO client asks node {unit}: a node answers one client at a time, so disconnect '
        'it or stop its program; until then readings come later, and commands of its own may '
        'reach the drive'
    )


class AnotherClient:
    """
    Finds what another client asks the nodes that are asked here.

    A node carries out what it is asked in order, whoever asks. So an answer that the other's
    request may have too is uncertain until the node has answered something else, asked later. A
    segment names no object, and whatever begins a transfer ends the one before: a transfer in
    segments is uncertain when anything else was asked meanwhile.
    """

    def __init__(self, remarks: Remarks) -> None:
        self._sightings = Sightings(remarks)
        #: What each node was asked last, until it comes back: some adapters return what they sent.
        self._own: dict[int, bytes] = {}
        #: The nodes of which the beginning of the last transfer came back.
        self._returned: set[int] = set()
        self._disturbed: set[int] = set()
        self._meanwhile: set[Kind] = set()

    def sent(self, frame: Frame) -> None:
        """Take note of a request of ours; what was asked before it is answered before it."""
        self._own[frame.identifier - sdo.REQUESTS] = frame.data
        self._meanwhile.clear()

    def begins(self, unit: int) -> None:
        """Take note that a transfer of ours is about to begin."""
        self._returned.discard(unit)
        self._disturbed.discard(unit)

    def is_there(self, now: float) -> bool:
        """Tell whether another client has been heard of late."""
        return self._sightings.is_there(now)

    def disturbed(self, unit: int) -> bool:
        """Tell whether a node was asked anything else since our transfer began."""
        return unit in self._disturbed

    @property
    def meanwhile(self) -> frozenset[Kind]:
        """The kinds of answers that it may still get, asked for since our last request."""
        return frozenset(self._meanwhile)

    def hear(self, frame: Frame, now: float) -> frozenset[Kind]:
        """Take a frame; return the kinds of answers that another client may get to it."""
        unit = frame.identifier - sdo.REQUESTS
        if unit not in self._own:
            return frozenset()
        kinds = sdo.kinds_asked_for(frame.data)
        names_object = kinds.isdisjoint(sdo.SEGMENTS)
        if frame.data == self._own[unit] and (names_object or unit in self._returned):
            # or the other asks the very same: its answer says what ours does
            self._own[unit] = b''
            self._returned.add(unit)
            return frozenset()
        self._sightings.add(now, _remark(unit))
        self._disturbed.add(unit)
        self._meanwhile |= kinds
        return kinds
