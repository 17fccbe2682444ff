# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Which answers may still be on their way, so that no late one is taken for the right one."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Set as AbstractSet
import time
from typing import Generic
from typing import TypeVar

from nfo_sinus_driver.link.errors import NotReady

Kind = TypeVar('Kind')
Question = TypeVar('Question')

#: How late an answer may come, in time-outs, before it counts as lost for good.
LATEST_ANSWER = 4


class Doubts(Generic[Kind]):
    """
    What may still come from each unit, by *kinds*: what tells its answers from one another.

    Units answer in order and :data:`LATEST_ANSWER` time-outs late at most. An answer of a kind
    that is in doubt may be that to an earlier request, so it proves nothing. One of a kind that is
    not in doubt is that to the present request, and whatever was to come has come before it.

    So nobody has to wait until a doubt is over: :meth:`first_certain` finds something to ask
    meanwhile. A request that fails takes a time-out, and what could answer it stays in doubt for
    three more, so there are never more than three such kinds: of four questions with answers of
    different kinds one is always certain, and of three after a time-out at most.

    :param response_timeout: how long an answer is waited for, s.
    """

    def __init__(self, response_timeout: float) -> None:
        self._memory = (LATEST_ANSWER - 1) * response_timeout
        self._until: dict[int, dict[Kind, float]] = {}

    def add(self, unit: int, kinds: Iterable[Kind]) -> None:
        """Expect an answer of one of these kinds from a unit, one more than has come."""
        until = time.monotonic() + self._memory
        self._until.setdefault(unit, {}).update(dict.fromkeys(kinds, until))

    def of(self, unit: int) -> AbstractSet[Kind]:
        """Return the kinds of answers that may still come from a unit."""
        return self._left(unit).keys()

    def end(self, unit: int) -> None:
        """Expect nothing more from a unit: it has answered what was asked last."""
        self._until.pop(unit, None)

    def clear(self) -> None:
        """Expect nothing more from anybody."""
        self._until.clear()

    def first_certain(
        self, unit: int, questions: Iterable[tuple[Question, Iterable[Kind]]]
    ) -> Question:
        """
        Return the first question whose answer cannot be confused with any that may still come.

        :param questions: each with the kinds of answers to be told apart; one question at least.
        :raises NotReady: there is none, and when there will be.
        """
        left = self._left(unit)
        free = []
        for question, kinds in questions:
            doubted = [left[kind] for kind in kinds if kind in left]
            if not doubted:
                return question
            free.append(max(doubted))
        raise NotReady(min(free))

    def _left(self, unit: int) -> dict[Kind, float]:
        """Forget what is too late by now; return the rest, and until when each may come."""
        if unit not in self._until:
            return {}
        now = time.monotonic()
        left = {kind: until for kind, until in self._until[unit].items() if until > now}
        self._until[unit] = left
        return left
