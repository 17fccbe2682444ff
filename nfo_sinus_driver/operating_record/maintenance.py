# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is due after so many hours or starts, by the setting ``maintenance``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
import math

from nfo_sinus_driver.operating_record.figures import Figures

#: What may be limited, and how it is said.
_FIGURES = {'powered_time': 'h powered', 'running_time': 'h running', 'starts': 'starts'}
_FORM = f'write it NAME=FIGURE:LIMIT, with one of {", ".join(_FIGURES)}, as fan=powered_time:80000'


@dataclass(frozen=True)
class Limit:
    """
    What is due after so much of a figure.

    :ivar what: its name, such as ``fan``.
    :ivar figure: the field of :class:`Figures`.
    :ivar most: the limit, in the unit of the figure.
    """

    what: str
    figure: str
    most: float

    def is_passed(self, figures: Figures) -> bool:
        """Return whether it is due."""
        return bool(getattr(figures, self.figure) >= self.most)

    def shown(self, figures: Figures) -> str:
        """Return how far it is, such as ``fan 80,012 of 80,000 h powered``."""
        now = math.floor(getattr(figures, self.figure))
        return f'{self.what} {now:,} of {self.most:,g} {_FIGURES[self.figure]}'


def limits(texts: Sequence[str]) -> tuple[Limit, ...]:
    """Return the limits of the setting; a ValueError says which makes no sense."""
    return tuple(_limit(text) for text in texts if text)


def _limit(text: str) -> Limit:
    what, _, rest = text.partition('=')
    figure, _, most = rest.partition(':')
    try:
        limit = Limit(what.strip(), figure.strip(), float(most))
    except ValueError:
        raise ValueError(f'maintenance {text!r}: {_FORM}') from None
    if not limit.what or limit.figure not in _FIGURES or not 0 < limit.most < math.inf:
        raise ValueError(f'maintenance {text!r}: {_FORM}')
    return limit
