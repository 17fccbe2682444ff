# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What of the driver has become slower since its last release."""

from __future__ import annotations

from collections.abc import Iterator

GROWTH = 'processor time a transaction'
Figures = dict[str, dict[str, float]]
#: What is compared, and how many times that of the release it may be: what two runs of one
#: driver differ by, and a little more.
ALLOWED = {
    'cycle / wire time': 1.05,
    "processor time / peer's": 1.1,
    "processor time / peer's, subscribed to": 1.1,
    "memory / peer's": 1.1,
    GROWTH: 1.1,
}


def regressions(now: Figures, release: Figures) -> Iterator[str]:
    """
    Yield what has become worse than allowed, in words.

    :raises KeyError: a row of the release was not measured.
    """
    for title, figures in release.items():
        for name, before in figures.items():
            limit = before * ALLOWED[name]
            if now[title][name] > limit:
                yield (
                    f'{title}: {name} is {now[title][name]:.3f}, in the last release '
                    f'{before:.3f}; at most {limit:.3f} is allowed'
                )
