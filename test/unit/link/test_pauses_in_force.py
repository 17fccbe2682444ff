# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The pauses of a unit are worked out where one changes: they are always those of its learners."""

from __future__ import annotations

from hypothesis import given, strategies as st

from nfo_sinus_driver.link.pauses import Pauses

UNITS = (1, 2, 3)


@given(
    st.lists(st.tuples(st.sampled_from(UNITS), st.booleans()), min_size=1, max_size=4),
    st.sampled_from((0.0, 0.004, 0.009, 0.04, 0.09)),
    st.sampled_from((0.0, 0.004, 0.009, 0.04)),
    st.sampled_from((0.001, 0.003)),
)
def test_what_is_in_force_is_what_was_learnt(
    round_: list[tuple[int, bool]], deaf_own: float, deaf_any: float, between: float
) -> None:
    """Unit 2 hears nothing for a while after its own answers, and after those of any."""
    now = 0.0
    pauses = Pauses(lambda text: None, lambda: now, broadcast=0)
    answered = dict.fromkeys(UNITS, -1.0)
    for unit, writes in round_ * 60:
        now = max(now + between, pauses.ready_at(unit))
        pauses.sent(unit, now, writes=writes)
        own, line = now - answered[unit], now - max(answered.values())
        now += 0.005
        if unit == 2 and (own < deaf_own or line < deaf_any):
            pauses.unanswered(unit, int)
        else:
            pauses.answered(unit, int, now)
            answered[unit] = now
        for number in UNITS:
            record = pauses._units[number]
            learners = record.learners.items()
            pause = max(
                learner.pause(own=True)
                for (wrote, _), learner in learners
                if record.wrote or not wrote
            )
            assert record.rests_until() == record.answered_at + pause
            if record.in_vain != record.probe_at:
                assert record.learnt() == max(at.pause(own=False) for _, at in learners)
        assert pauses.rests_until(0) == max(pauses.rests_until(number) for number in UNITS)
