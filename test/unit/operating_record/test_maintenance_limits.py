# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The setting ``maintenance``: what is due after so many hours or starts."""

from __future__ import annotations

import pytest

from nfo_sinus_driver.operating_record.figures import NS_OF_HOUR, Figures
from nfo_sinus_driver.operating_record.maintenance import limits


def test_it_is_due_when_its_limit_is_reached() -> None:
    figures = Figures(0.0, powered=79_999 * NS_OF_HOUR, running=10 * NS_OF_HOUR, starts=7)
    fan, grease, contactor = limits(
        ['fan=powered_time:80000', 'bearing grease=running_time:20.5', 'contactor=starts:7', '']
    )
    assert [limit.is_passed(figures) for limit in (fan, grease, contactor)] == [False, False, True]
    assert fan.shown(figures) == 'fan 79,999 of 80,000 h powered'
    assert grease.shown(figures) == 'bearing grease 10 of 20.5 h running'
    assert contactor.shown(figures) == 'contactor 7 of 7 starts'
    figures.powered += NS_OF_HOUR
    assert fan.is_passed(figures)


@pytest.mark.parametrize(
    'text',
    [
        'fan', 'fan=80000', 'fan=powered_time', 'fan=energy:5', '=starts:5', 'fan=starts:0',
        'fan=starts:-1', 'fan=starts:many', 'fan=starts:inf', 'fan=starts:nan', 'fan:starts=5',
    ],
)
def test_one_that_makes_no_sense_says_how_to_write_it(text: str) -> None:
    with pytest.raises(ValueError, match='NAME=FIGURE:LIMIT') as caught:
        limits(['fan=starts:5', text])
    assert repr(text) in str(caught.value)
