# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Playing the sequences of a profile by hand: no bus, no drive, each step and its answer named."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from nfo_sinus_driver.catalog.profile import Refusal, Step, Until
from nfo_sinus_driver.catalog.status import State

#: What a drive answers that refuses a step.
REFUSED = Refusal('it does not want to')


def status(**known: Any) -> SimpleNamespace:
    """A status, of which only something is known."""
    return SimpleNamespace(**{'word': None, 'state': State.UNKNOWN, 'from_bus': False, **known})


class Wait:
    """Stands for a step that waits for one of some statuses, and for none of others."""

    def __init__(self, *reached: SimpleNamespace, not_by: Sequence[SimpleNamespace]) -> None:
        self._reached = reached
        self._not_by = not_by

    def __eq__(self, step: object) -> bool:
        assert isinstance(step, Until)
        fulfilled = all(step.condition(state) for state in self._reached)
        return fulfilled and not any(step.condition(state) for state in self._not_by)

    __hash__ = None  # type: ignore[assignment]


def play(steps: Generator[Step, Any, Any], *script: tuple[Any, Any]) -> Any:
    """
    Play a sequence: it must yield just these steps, each of which has this answer.

    :returns: its result; what it ends by is raised.
    """
    answer: Any = None
    for expected, following in script:
        step = steps.throw(answer) if isinstance(answer, Refusal) else steps.send(answer)
        assert expected == step
        answer = following
    with pytest.raises(StopIteration) as end:
        steps.throw(answer) if isinstance(answer, Refusal) else steps.send(answer)
    return end.value.value
