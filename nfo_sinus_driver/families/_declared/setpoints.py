# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Where the set-points of a drive go that a file describes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import math

from nfo_sinus_driver.catalog.declared import Direction, SetpointPlace
from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    Limits,
    NotPossible,
    Read,
    SetpointTarget,
    Steps,
    Write,
)


@dataclass(frozen=True)
class Target(SetpointTarget):
    """Where the set-points of one drive go; with a direction word their size stands alone."""

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
        """Write set-point 0, and read it back where the drive tells it."""
        assert self.place is not None
        yield from self.zero(retry=True)
        if not self.place.read_key:
            return
        kept = float((yield Read(self.place.read_key)))
        if kept != 0:
            raise NotPossible(f'the drive keeps a set-point of {kept:g} where 0 was written')


@dataclass(frozen=True)
class SizeAndDirection(Target):
    """A set-point whose size stands beside a direction; at 0 the direction stays as it was."""

    def writes(self, value: float, before: float = math.nan) -> Sequence[Write]:
        """Return what is to be written: no size of the one direction is followed in the other."""
        direction = self._direction
        unknown = math.isnan(before)
        reverse = _reverse(before if value == 0 and not unknown else value)
        turn = Write(direction.key, direction.reverse if reverse else direction.forward)
        written = turn, Write(self.key, abs(value))
        turns = before != 0 and reverse is not _reverse(before)
        return (Write(self.key, 0.0), *written) if unknown or turns else written

    def value(self, values: Mapping[str, Value]) -> float:
        """Return the set-point that size and direction mean; -0.0 is 0 in reverse."""
        reverse = values[self._direction.key] == self._direction.reverse
        return math.copysign(float(values[self.key]), -1 if reverse else 1)

    def zero(self, *, retry: bool) -> Steps[None]:
        """Write size 0 and leave the direction alone, for with it goes a run command."""
        yield Write(self.key, 0.0, retry=retry)

    @property
    def _direction(self) -> Direction:
        assert self.place is not None and self.place.direction is not None
        return self.place.direction


def _reverse(value: float) -> bool:
    return math.copysign(1, value) < 0


def target_of(place: SetpointPlace) -> Target:
    """Return where set-points go that a file describes."""
    nominal = math.inf if place.nominal is None else place.nominal
    kind = Target if place.direction is None else SizeAndDirection
    forward_only = not place.signed and place.direction is None
    return kind(place.key, place.most, forward_only=forward_only, nominal=nominal, place=place)
