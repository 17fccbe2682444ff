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

"""A tuning that is being prepared: a stop ends it, and a busy drive is told again."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import itertools
from typing import Any

from drive_rig import SCMD
import pytest
from support.addresses import Words
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.link import Refused

STOPS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'cancel': lambda drive: drive.cancel_tuning(),
    'deactivate': lambda drive: drive.deactivate(),
    'for good': lambda drive: drive.stop_for_good(2.0),
}


def tuned_until_stopped(rig: VirtualRig, way: str, moment: int) -> bool:
    """Have a drive tune, and stop it at so many requests; tell whether it had begun by then."""
    requests = itertools.count()
    stops: list[Future[Any]] = []
    begun = False

    def stop(register: int, words: Words | None) -> None:
        nonlocal begun
        begun = begun or (register, words) == (SCMD, (Scmd.FULL_TUNING,))
        if next(requests) == moment:
            stops.append(STOPS[way](rig.drive))

    rig.connect()
    rig.before = stop
    tuning = rig.drive.tune(Procedure.FULL)
    while not stops:
        rig.pass_time(0.001)
    had_begun = begun
    rig.answer(stops[0])
    rig.pass_time(0.5)
    # what only waits for the line by then is kept off it
    assert rig.written(SCMD).count(Scmd.FULL_TUNING) == had_begun
    assert 'stopped' in rig.answer(tuning, 0.1)
    assert rig.far.control_unit.status_text != 'Tuning'
    return had_begun


@pytest.mark.parametrize('way', STOPS)
def test_a_stop_at_any_moment_of_the_preparation_ends_the_tuning(
    make_virtual: MakeVirtual, way: str
) -> None:
    moment = 0
    while not tuned_until_stopped(make_virtual(poll_rate=1.0, telemetry_rate=0), way, moment):
        moment += 1
    assert moment > 10


def test_a_busy_drive_is_told_again_to_tune(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.connect()
    busy = tuned_when_free(rig, 4)
    tuning = rig.drive.tune(Procedure.CALCULATE)
    assert '47 ParClcOK' in rig.answer(tuning)
    assert len(busy) == 4
    assert rig.written(SCMD).count(Scmd.PAR_CALC) == 1


def test_a_drive_that_stays_busy_does_not_tune(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.connect()
    busy = tuned_when_free(rig, 10_000)
    assert 'the drive is busy' in rig.answer(rig.drive.tune(Procedure.CALCULATE))
    assert 0.4 < busy[-1] - busy[0] < 0.6
    # a line that others need, too, is not filled by it
    assert len(busy) < 15
    assert not rig.drive.stop_unconfirmed


def test_a_drive_that_was_busy_is_not_told_to_tune_after_a_stop(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.connect()
    busy = tuned_when_free(rig, 2)
    tuning = rig.drive.tune(Procedure.CALCULATE)
    while not busy:
        rig.pass_time(0.001)
    rig.answer(rig.drive.stop())
    assert 'was stopped' in rig.answer(tuning)
    assert Scmd.PAR_CALC not in rig.written(SCMD)


def tuned_when_free(rig: VirtualRig, times: int) -> list[float]:
    """Have the drive be too busy to calculate, so many times; return when it was."""
    busy: list[float] = []

    def meet(register: int, words: Words | None) -> None:
        if register == SCMD and words == (Scmd.PAR_CALC,) and len(busy) < times:
            busy.append(rig.clock.now)
            raise Refused(Refused.BUSY)

    rig.before = meet
    return busy
