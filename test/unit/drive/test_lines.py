# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Lines of several drives that stop answering: each motor stops; see ``support/line_laws.py``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any

import pytest
from support.line_laws import LineLaws
from support.own_timeout import by_default
from support.rig import Rig

#: How long after the first lost answer all motors have stopped, s: they are lost, a stop goes to
#: each; or each is left in peace until its own time-out of 2 s strikes.
_ALL_STAND = 6.0


def _stop(rig: Rig, laws: LineLaws) -> list[Future[Any]]:
    laws.called()
    return [drive.stop() for drive in rig.drives.values()]


def _end(rig: Rig, laws: LineLaws) -> list[Future[Any]]:
    laws.called()
    return [drive.stop_for_good(4.0) for drive in rig.drives.values()]


#: What is called for 0.3 s after the first lost answer.
_CALLS: Mapping[str, Callable[[Rig, LineLaws], object]] = {
    'nothing': lambda rig, laws: None,
    'stop_all': _stop,
    'end': _end,
}


@pytest.mark.parametrize('call', _CALLS)
@pytest.mark.parametrize('drives', [1, 2, 3, 8, 16])
@pytest.mark.parametrize('at', [0, 1, 2, 5])
def test_all_answers_are_lost_from_one_request_on(drives: int, call: str, at: int) -> None:
    with by_default(
        'rtu', drives=drives, line={'baud': 19200}, poll_rate=50.0, telemetry_rate=2.0
    ) as rig:
        rig.turn()
        laws = LineLaws(rig)
        rig.pass_time(0.5)
        asked = len(rig.asked)
        rig.wait_until(lambda: len(rig.asked) >= asked + at)
        rig.line.state = 'deaf'
        rig.pass_time(0.3)
        _CALLS[call](rig, laws)
        rig.pass_time(_ALL_STAND - 0.3)
        assert (laws.broken, laws.still_turning()) == ([], [])
