# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Where the set-points of a drive go that a file describes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math

from nfo_sinus_driver.catalog.declared import SetpointPlace
from nfo_sinus_driver.catalog.directed import DirectedTarget
from nfo_sinus_driver.catalog.profile import Limits, NotPossible, Read, SetpointTarget, Steps


@dataclass(frozen=True)
class Target(SetpointTarget):
    """Where the set-points of one drive go."""

    place: SetpointPlace | None = None

    def read_limits(self, has: Callable[[str], bool], *, older: bool = False) -> Steps[Limits]:
        """Find out what a set-point may be: the file and a parameter of the drive limit it."""
        found = yield from super().read_limits(has, older=older)
        assert self.place is not None
        if not self.place.limit:
            return found
        most = min(found.most, float((yield Read(self.place.limit))))
        return Limits(max(found.least, -most), most, found.nominal)

    def set_to_zero(self) -> Steps[None]:
        """Write set-point 0, and read it back where the drive reports it."""
        assert self.place is not None
        yield from self.zero(retry=True)
        if not self.place.read_key:
            return
        kept = float((yield Read(self.place.read_key)))
        if kept != 0:
            raise NotPossible(f'the drive keeps a set-point of {kept:g} where 0 was written')


@dataclass(frozen=True)
class SizeAndDirection(Target, DirectedTarget):
    """A set-point whose size stands beside a direction."""


def target_of(place: SetpointPlace, *, is_command: bool) -> Target:
    """Return where set-points go that a file describes; ``is_command``: nothing else runs it."""
    nominal = math.inf if place.nominal is None else place.nominal
    if place.direction is None:
        return Target(
            place.key, place.most, forward_only=not place.reverses, nominal=nominal,
            is_command=is_command, place=place,
        )
    way = place.direction
    return SizeAndDirection(
        place.key, place.most, nominal=nominal, place=place,
        direction=way.key, forward=way.forward, reverse=way.reverse,
    )
