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

"""
The laws of the house, each over every way to command a drive, in virtual time.

Laws 1, 4, 5 and 6 are judged besides in every test that has a rig, by all frames on its line. A new
way is one line in :data:`support.rig.WAYS`; a new law is one test here.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
import math
from typing import Any

import pytest
from support.drives import DRIVES
from support.rig import WAYS
from support.rig import Rig

from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import Severity

#: How soon a loss has to be noticed and the motor has to be told to stop, beyond lost_after, s.
_SOON = 1.5
#: What may have to be waited until a drive that was away is known again, s.
_BACK = 6.0

STOPS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'deactivate': lambda drive: drive.deactivate(),
    'disconnect': lambda drive: drive.disconnect(4.0),
    'exit': lambda drive: drive.stop_for_good(4.0),
}
every_way = pytest.mark.parametrize('way', WAYS)
every_stop = pytest.mark.parametrize('stop', STOPS)


def follows(way: str) -> bool:
    """Tell whether a motor that is commanded this way follows set-points."""
    return WAYS[way].reference == 'fieldbus'


def overload(way: str) -> int:
    """Return the code of a fault that every drive of this way can have."""
    found = WAYS[way]
    return (DRIVES.get(f'{found.model} {found.method}') or DRIVES[found.model]).overload.code


def settings_of(rig: Rig) -> dict[str, int]:
    """Return how often each setting of the drive was written."""
    return dict(rig.far.writes)


# --- 1 and 4: what only looks writes nothing ------------------------------------------------------


@every_way
def test_1_polling_writes_nothing(way: str) -> None:
    with Rig(way) as rig:
        rig.connect(parameters=True)
        # what holds a drive in the mode of the bus is told to stop as soon as it is found
        rig.asked.clear()
        rig.pass_time(3.0)
        assert [key for _, key, data in rig.asked if data is not None] == []
        assert not rig.far.writes and not rig.turns


@every_way
def test_4_a_ride_writes_no_setting_but_what_control_needs(way: str) -> None:
    with Rig(way) as rig:
        rig.turn()
        rig.result(rig.drive.disconnect(4.0))
        first = settings_of(rig)
        rig.connect()
        rig.enable()
        rig.pass_time(1.0)
        rig.result(rig.drive.disconnect(4.0))
        # what stands so already is not written again
        assert settings_of(rig) == first
        assert len(first) <= 1


# --- 2: the motor turns only when it was enabled since, and a fresh set-point came after that -----


@every_way
def test_2_a_set_point_from_before_enable_is_not_taken_over(way: str) -> None:
    with Rig(way) as rig:
        rig.connect()
        if follows(way):
            rig.drive.set_setpoint(20.0)
        else:
            pytest.skip('it follows no set-points')
        rig.enable()
        rig.pass_time(1.5)
        assert rig.drive.armed
        assert rig.far.motor.demand == 0 or not rig.far.motor.driven


@every_way
def test_2_without_enable_set_points_turn_nothing(way: str) -> None:
    if not follows(way):
        pytest.skip('it follows no set-points')
    with Rig(way) as rig:
        rig.connect()
        rig.send(20.0)
        rig.pass_time(2.0)
        assert not rig.turns and not rig.drive.armed


def lose_line(rig: Rig) -> None:
    rig.line.state = 'silent'
    rig.pass_time(3.0)
    rig.line.mend()


def lose_port(rig: Rig) -> None:
    rig.line.state = 'gone'
    rig.pass_time(3.0)
    rig.line.mend()


def lose_power(rig: Rig) -> None:
    rig.far.power_cycle(boot_time=2.0)
    rig.pass_time(3.0)


def restart_driver(rig: Rig) -> None:
    rig.kill()
    rig.pass_time(0.3)
    rig.begin()
    rig.connect()


LOSSES = {
    'line': lose_line, 'port': lose_port, 'power': lose_power, 'driver': restart_driver,
}


@every_way
@pytest.mark.parametrize('loss', LOSSES)
def test_2_after_a_loss_nothing_turns_until_it_is_enabled_again(way: str, loss: str) -> None:
    with Rig(way) as rig:
        rig.turn()
        LOSSES[loss](rig)
        rig.pass_time(_BACK)
        rig.send(20.0 if follows(way) else None)
        rig.pass_time(2.0)
        assert not rig.drive.armed and not rig.turns
        rig.enable()
        rig.send(20.0 if follows(way) else None)
        rig.pass_time(2.0)
        assert rig.turns


@every_way
def test_2_after_a_fault_and_its_acknowledgement_nothing_turns(way: str) -> None:
    with Rig(way) as rig:
        rig.turn()
        rig.far.trip(overload(way))
        rig.pass_time(1.0)
        assert not rig.drive.armed
        rig.acknowledged += 1
        rig.answer(rig.drive.acknowledge())
        rig.pass_time(3.0)
        assert not rig.turns and not rig.drive.armed


@every_way
@every_stop
def test_2_a_stop_ends_an_enable_that_was_asked_for_before(way: str, stop: str) -> None:
    with Rig(way) as rig:
        rig.connect()
        enable = rig.drive.enable()
        stopped = STOPS[stop](rig.drive)
        rig.answer(enable)
        rig.answer(stopped)
        if follows(way) and stop not in ('disconnect', 'exit'):
            rig.send(20.0)
        rig.pass_time(1.0)
        assert not rig.turns and not rig.drive.armed


# --- 3: every way out stops the motor, and no success is reported that was not confirmed ----------


@every_way
@every_stop
def test_3_every_way_out_stops_the_motor(way: str, stop: str) -> None:
    with Rig(way) as rig:
        rig.turn()
        future = STOPS[stop](rig.drive)
        rig.answer(future)
        rig.pass_time(1.0)
        assert not rig.turns and not rig.drive.armed


@every_way
def test_3_a_stop_on_a_dead_line_is_said_and_carried_out_when_it_is_back(way: str) -> None:
    with Rig(way) as rig:
        rig.turn()
        rig.line.state = 'silent'
        answer = rig.answer(rig.drive.stop())
        assert 'stopped' not in answer, answer
        rig.pass_time(4.0)
        assert any(one.severity is Severity.ERROR for one in rig.notes.events)
        rig.line.mend()
        rig.pass_time(_BACK)
        assert not rig.turns


@every_way
def test_3_without_fresh_set_points_it_stops(way: str) -> None:
    if not follows(way):
        pytest.skip('it follows no set-points')
    with Rig(way, setpoint_timeout=1.0) as rig:
        rig.turn()
        rig.send(None)
        rig.pass_time(4.0)
        assert not rig.turns and not rig.far.motor.turning


# --- 7 and 8: what is reported is true ------------------------------------------------------------


@every_way
def test_8_noise_makes_no_false_reading(way: str) -> None:
    with Rig(way) as rig:
        rig.turn()
        before = len(rig.notes.snapshots)
        frequency = rig.far.motor.frequency
        rig.line.make_noise(0.15, seed=3)
        rig.pass_time(10.0)
        found = [one.frequency for one in rig.notes.snapshots[before:]]
        wrong = [one for one in found if not math.isnan(one) and abs(one - frequency) > 1.0]
        assert not wrong
        assert rig.drive.armed


# --- 9 and 10: the line is kept alive; a motor is not stopped without a reason --------------------


@every_way
def test_10_a_few_lost_answers_stop_nothing_and_a_silence_does(way: str) -> None:
    with Rig(way) as rig:
        rig.turn()
        for what in ('unheard', 'drop', 'damage', 'double'):
            rig.line.spoil(what)
            rig.pass_time(1.5)
            assert rig.drive.armed, what
        rig.line.state = 'silent'
        rig.pass_time(rig.drive.settings.lost_after + _SOON)
        assert not rig.drive.armed and not rig.drive.snapshot.connected
