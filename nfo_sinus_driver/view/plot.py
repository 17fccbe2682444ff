# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The running plot, made of text."""

from __future__ import annotations

from collections.abc import Sequence
import math

#: An eighth of a character's height each.
_EIGHTHS = ' ▁▂▃▄▅▆▇█'


def span(values: Sequence[float], least: float = 0.0) -> tuple[float, float]:
    """
    Return where the axis begins and ends: zero is always on it.

    :param least: how much the axis shows at least, so that noise is not drawn as an event.
    """
    known = [value for value in values if math.isfinite(value)]
    low, high = min((0.0, *known)), max((0.0, *known))
    if high - low < least:
        high = low + least if high > 0 or low == 0 else high
        low = low if high > 0 else high - least
    return low, high


def plot(
    values: Sequence[float], width: int, height: int, axis: tuple[float, float]
) -> list[str]:
    """
    Return columns from the bottom of the axis up to each value, newest at the right, as lines.

    :param values: oldest first; NaN leaves a gap. More than ``width`` are cut off at the left.
    """
    low, high = axis
    size = high - low
    shown = list(values)[-width:] if width else []
    # without a size there is but the value zero
    heights = [_height((value - low) / (size or 1.0), height) for value in shown]
    blank = ' ' * (width - len(shown))
    return [
        blank + ''.join(_EIGHTHS[min(8, max(0, eighths - 8 * row))] for eighths in heights)
        for row in reversed(range(height))
    ]


def _height(share: float, height: int) -> int:
    """Return how many eighths of a character a share of the axis is; a value has one at least."""
    if not math.isfinite(share):
        return 0
    return max(1, min(8 * height, round(share * 8 * height)))
