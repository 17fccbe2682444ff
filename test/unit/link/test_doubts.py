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

"""What is certain while answers may still come, without any line."""

from __future__ import annotations

from types import SimpleNamespace
from unittest import mock

from hypothesis import given
from hypothesis import strategies as st
import pytest

from nfo_sinus_driver.catalog import Access
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.link import NotReady
from nfo_sinus_driver.link import classic_link
from nfo_sinus_driver.link import doubts
from nfo_sinus_driver.link.doubts import LATEST_ANSWER
from nfo_sinus_driver.link.doubts import Doubts

TIMEOUT = 0.2
UNIT = 1


class Clock(SimpleNamespace):
    """Time that stands still unless it is moved."""

    now = 1000.0

    def monotonic(self) -> float:
        return self.now


def waits(kinds: int, lost: list[float]) -> list[float]:
    """
    Ask questions that have so many kinds of answers, and lose each.

    :param lost: how long each transaction takes beyond its time-out, s.
    :returns: how long one had to wait before each.
    """
    clock = Clock()
    waited = []
    with mock.patch.object(doubts, 'time', clock):
        doubt: Doubts[int] = Doubts(TIMEOUT)
        for more in lost:
            began = clock.now
            questions = [(kind, (kind,)) for kind in range(kinds)]
            try:
                question = doubt.first_certain(UNIT, questions)
            except NotReady as error:
                clock.now = error.until
                question = doubt.first_certain(UNIT, questions)
            waited.append(clock.now - began)
            assert question not in doubt.of(UNIT)
            clock.now += TIMEOUT + more
            doubt.add(UNIT, (question,))
    return waited


LOST = st.lists(st.floats(0.001, 0.3), max_size=30)


@given(LOST)
def test_of_four_questions_one_is_always_certain(lost: list[float]) -> None:
    assert waits(4, lost) == [0.0] * len(lost)


@given(LOST)
def test_of_three_questions_one_is_certain_after_a_time_out(lost: list[float]) -> None:
    assert all(wait <= TIMEOUT for wait in waits(3, lost))


def test_of_two_questions_none_is_for_two_time_outs() -> None:
    # that is why two probes are too few
    assert max(waits(2, [0.001] * 5)) == pytest.approx(2 * TIMEOUT, abs=0.01)


def test_a_doubt_lasts_until_the_latest_answer_or_any_certain_one() -> None:
    clock = Clock()
    with mock.patch.object(doubts, 'time', clock):
        doubt: Doubts[str] = Doubts(TIMEOUT)
        doubt.add(UNIT, ('a', 'b'))
        doubt.add(2, ('c',))
        assert doubt.of(UNIT) == {'a', 'b'}
        clock.now += (LATEST_ANSWER - 1) * TIMEOUT - 0.001
        assert doubt.of(UNIT) == {'a', 'b'}
        doubt.add(UNIT, ('b',))
        clock.now += 0.002
        assert doubt.of(UNIT) == {'b'}
        assert doubt.of(2) == set()
        doubt.end(UNIT)
        assert doubt.of(UNIT) == set()


def test_a_question_is_certain_when_each_of_its_answers_is() -> None:
    clock = Clock()
    with mock.patch.object(doubts, 'time', clock):
        doubt: Doubts[str] = Doubts(TIMEOUT)
        doubt.add(UNIT, ('answer',))
        clock.now += 0.1
        doubt.add(UNIT, ('refusal',))
        with pytest.raises(NotReady) as raised:
            doubt.first_certain(UNIT, [('question', ('answer', 'refusal'))])
        assert raised.value.until == pytest.approx(clock.now + 3 * TIMEOUT)


def test_what_is_asked_over_classic_is_in_the_table_of_every_firmware_and_does_nothing() -> None:
    model = load_family('sinus_g2')
    for number in classic_link._EVERYWHERE:
        (parameter,) = (
            parameter
            for parameter in model.values()
            if 'classic' in parameter.addresses
            and parameter.at('classic').numbers == (number,)
        )
        assert parameter.since is None
        assert parameter.access in (Access.READ, Access.READ_WRITE)
