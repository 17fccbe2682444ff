# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Set-points whose direction is a command of its own, beside a size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math

from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import NotPossible, Read, SetpointTarget, Steps, Write


@dataclass(frozen=True)
class DirectedTarget(SetpointTarget):
    """
    Where the size of a set-point goes, beside a direction that is a command.

    The size is 0 before the direction changes, and the motor ramps through zero. At set-point 0 the
    direction stays as it was. It is written only when it changes: written again beside a size, it
    could let a motor run that a fault or another master has stopped meanwhile.

    :ivar direction: the parameter that takes the direction.
    :ivar forward: what is written to it for a set-point from 0 upwards.
    :ivar reverse: what is written to it for one below.
    """

    direction: str = ''
    forward: int = 0
    reverse: int = 0

    @property
    def has_sign(self) -> bool:
        """A size is written, and the direction beside it."""
        return False

    @property
    def written_once(self) -> frozenset[str]:
        """The direction: a set-point that is written again leaves it out."""
        return frozenset((self.direction,))

    def writes(self, value: float, before: float = math.nan) -> Sequence[Write]:
        """
        Return what is to be written for a set-point: where the direction changes, size 0 first.

        :param before: the set-point that the drive has, -0.0 being one in reverse; NaN if
            unknown.
        """
        unknown = math.isnan(before)
        reverse = _is_reverse(before if value == 0 and not unknown else value)
        direction = Write(self.direction, self.reverse if reverse else self.forward)
        written = direction, Write(self.key, abs(value), at=self.at)
        turns = before != 0 and reverse is not _is_reverse(before)
        return (Write(self.key, 0.0, at=self.at), *written) if unknown or turns else written

    def value(self, values: Mapping[str, Value]) -> float:
        """Return the set-point that size and direction mean; -0.0 is 0 in reverse."""
        reverse = values[self.direction] == self.reverse
        return math.copysign(float(values[self.key]), -1 if reverse else 1)

    def zero(self, *, retry: bool) -> Steps[None]:
        """Write size 0 and leave the direction alone, which would be a command."""
        yield Write(self.key, 0.0, at=self.at, retry=retry)

    def set_to_zero(self) -> Steps[None]:
        """Write size 0, and read it back alone."""
        yield from self.zero(retry=True)
        kept = float((yield Read(self.key)))
        if kept:
            raise NotPossible(f'the drive keeps a set-point of {kept:g} where 0 was written')


def with_direction(
    target: SetpointTarget, direction: str, forward: int, reverse: int
) -> DirectedTarget:
    """Return a target for sizes, with a command for the direction."""
    return DirectedTarget(**vars(target), direction=direction, forward=forward, reverse=reverse)


def _is_reverse(value: float) -> bool:
    return math.copysign(1, value) < 0
