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

"""Answers that are spoiled by chance, and bursts in which nothing passes."""

from __future__ import annotations

import pytest

from nfo_sinus_driver.simulator.line_faults import LineFaults
from nfo_sinus_driver.simulator.line_faults import Reply

FRAME = bytes(range(8))
MANY = 10_000


def spoiled(faults: LineFaults, what: str) -> int:
    """Return how many of many answers are not as they were."""
    untouched = [Reply(FRAME)]
    replies = [faults.alter(1, FRAME) for _ in range(MANY)]
    wrong = [some for some in replies if some != untouched]
    if what == 'drop':
        assert all(some == [] for some in wrong)
    elif what == 'double':
        assert all([one.data for one in some] == [FRAME, FRAME] for some in wrong)
    elif what == 'delay':
        assert all(some[0].data == FRAME and some[0].delay == 0.2 for some in wrong)
    else:
        assert all(some[0].data != FRAME for some in wrong)
    return len(wrong)


@pytest.mark.parametrize('what', ['noise', 'damage', 'delay', 'drop', 'double'])
def test_a_share_of_the_answers_is_spoiled_by_chance(what: str) -> None:
    faults = LineFaults()
    faults.set_rate(what, 0.03, seed=1, seconds=0.2)
    assert 0.02 * MANY < spoiled(faults, what) < 0.04 * MANY
    faults.set_rate(what, 0.0)
    assert spoiled(faults, what) == 0


def test_the_same_seed_spoils_the_same_answers() -> None:
    def fates() -> list[bool]:
        faults = LineFaults()
        faults.set_rate('drop', 0.1, seed=7)
        return [not faults.alter(1, FRAME) for _ in range(200)]

    assert fates() == fates()
    assert any(fates())


def test_of_several_rates_each_counts() -> None:
    faults = LineFaults()
    faults.set_rate('double', 1.0)
    faults.set_rate('delay', 1.0, seconds=0.1)
    assert faults.alter(1, FRAME) == [
        Reply(FRAME, 0.1, 'delayed'),
        Reply(FRAME, 0.1, 'double, delayed'),
    ]


def test_a_burst_comes_again_and_again() -> None:
    faults = LineFaults()
    faults.set_bursts(0.8, 5.0, now=100.0)
    moments = {100.1: False, 104.1: False, 104.3: True, 104.9: True, 105.1: False, 109.5: True}
    assert {now: faults.dead(now) for now in moments} == moments
    faults.set_bursts(0.0, 5.0, now=100.0)
    assert not faults.dead(104.9)


def test_heal_ends_both() -> None:
    faults = LineFaults()
    faults.set_rate('drop', 1.0)
    faults.set_bursts(1.0, 1.0, now=0.0)
    assert faults.dead(0.5) and faults.alter(1, FRAME) == []
    faults.heal()
    assert not faults.dead(0.5) and faults.alter(1, FRAME) == [Reply(FRAME)]


def test_what_would_never_end_or_never_be_is_refused() -> None:
    faults = LineFaults()
    with pytest.raises(ValueError, match='never end'):
        faults.set_bursts(6.0, 5.0, now=0.0)
    for share in (-0.1, 1.1):
        with pytest.raises(ValueError, match='0 to 1'):
            faults.set_rate('drop', share)
