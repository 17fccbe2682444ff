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


"""No turn at an acknowledgement, whatever the drive does with its run command in a fault [C98]."""

from __future__ import annotations

from collections.abc import Mapping
import itertools
import os
import random

from drive_rig import MODE
from drive_rig import SCMD
import pytest
from support.addresses import Words
from virtual_rig import MakeVirtual
from virtual_rig import VirtualRig

from nfo_sinus_driver.families.sinus_g2.words import Mode
from nfo_sinus_driver.families.sinus_g2.words import Scmd
from nfo_sinus_driver.simulator.sinus.control_unit import ALL
from nfo_sinus_driver.simulator.sinus.control_unit import DROPS
from nfo_sinus_driver.simulator.sinus.control_unit import KEEPS
from nfo_sinus_driver.simulator.sinus.control_unit import NOTHING
from nfo_sinus_driver.simulator.sinus.control_unit import SCMD as SCMD_ONLY

#: How many acknowledgements each kind of drive goes through; a campaign has a thousand.
ACKNOWLEDGEMENTS = int(os.environ.get('ACKNOWLEDGEMENTS', '20'))
KINDS = (
    {'run_command_in_fault': KEEPS, 'refuses_in_fault': NOTHING},
    {'run_command_in_fault': KEEPS, 'refuses_in_fault': SCMD_ONLY},
    {'run_command_in_fault': DROPS, 'refuses_in_fault': ALL},
)
_WORST = {'run_command_in_fault': KEEPS, 'refuses_in_fault': ALL}
#: InvSt with acknowledging, and without [M0 table 5].
_WITH_ACK, _WITHOUT = 0x02A4, 0x02A5
_OVERLOAD = 5
_SIO_FAIL = 14


class Poller:
    """
    Notes when the motor is energised although it should not be.

    :ivar seconds: for how long it was, in all.
    """

    def __init__(self, rig: VirtualRig) -> None:
        self._rig = rig
        self._before = rig.clock.now
        self.watching = False
        self.seconds = 0.0
        rig.looked = self._look

    def _look(self) -> None:
        now = self._rig.clock.now
        if self.watching and self._rig.far.motor.driven:
            self.seconds += now - self._before
        self._before = now


def disturb(rig: VirtualRig, chance: random.Random) -> None:
    """Have some of the next answers lost, late or doubled, or requests unheard, or nothing."""
    what = chance.choice(('', '', 'losses', 'unheard', 'late', 'doubled'))
    if what == 'losses':
        rig.link.losses = chance.randint(1, 4)
    elif what == 'unheard':
        rig.link.unheard = chance.randint(1, 4)
    elif what == 'late':
        rig.link.state = 'late'
    elif what == 'doubled':
        rig.link.doubled = chance.randint(1, 8)


def acknowledge(rig: VirtualRig, watch: Poller, chance: random.Random) -> None:
    """Run the motor into a fault, and acknowledge it on a line that is not perfect."""
    assert 'enabled' in rig.answer(rig.drive.enable())
    rig.send(20.0)
    rig.pass_time(0.2)
    assert rig.far.motor.driven
    rig.far.trip(chance.choice((_OVERLOAD, _OVERLOAD, 7, _SIO_FAIL)))
    watch.watching = True
    # before the next poll, or when the stop that follows a fault is long over
    rig.pass_time(chance.choice((0.0, 0.01, 0.06, 1.0)))
    disturb(rig, chance)
    future = rig.drive.acknowledge()
    rig.pass_time(chance.choice((0.1, 1.0)))
    rig.link.mend()
    rig.answer(future)
    while not rig.drive.snapshot.connected:
        rig.pass_time(0.1)
    if rig.far.faults:
        rig.answer(rig.drive.acknowledge())
    assert not rig.far.faults
    rig.pass_time(1.0)
    assert not rig.drive.stop_unconfirmed
    watch.watching = False


def fall_still(rig: VirtualRig) -> None:
    """Run the motor into a fault, and wait until the shaft stands."""
    rig.ride()
    rig.far.trip(_OVERLOAD)
    while rig.far.motor.turning:
        rig.pass_time(0.5)


@pytest.mark.timeout(3600)
@pytest.mark.parametrize('kind', KINDS)
def test_no_turn_at_an_acknowledgement(make_virtual: MakeVirtual, kind: Mapping[str, str]) -> None:
    rig = make_virtual(variant=kind)
    rig.connect()
    watch = Poller(rig)
    for number in range(ACKNOWLEDGEMENTS):
        acknowledge(rig, watch, random.Random(number))
        assert not watch.seconds, f'energised at acknowledgement {number}'


def test_two_transactions_at_most_where_everything_is_refused(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(variant=_WORST)
    fall_still(rig)
    watch = Poller(rig)
    watch.watching = True
    frames = len(rig.link.frames)
    assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
    rig.pass_time(0.5)
    asked = [frame['hex'][2:8] for frame in rig.link.frames[frames:]]
    read = asked.index(f'03{_WITH_ACK:04x}')
    assert asked[read + 1] == f'06{MODE:04x}'
    # the answer to the acknowledgement, and the stop
    assert watch.seconds < 0.013
    assert not rig.far.motor.driven


def test_the_stop_that_everything_depends_on_is_repeated_until_it_is_heard(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual(variant=_WORST)
    fall_still(rig)
    watch = Poller(rig)
    watch.watching = True

    def lose(register: int, words: Words | None) -> None:
        if register == _WITH_ACK:
            rig.link.losses = 1
        elif words is not None and not rig.far.faults:
            if not stops:
                rig.link.unheard = 3
            stops.append((rig.clock.now, register))

    stops: list[tuple[float, int]] = []
    rig.before = lose
    rig.answer(rig.drive.acknowledge())
    rig.pass_time(1.0)
    assert [register for _, register in stops[:4]] == [MODE, SCMD, SCMD, SCMD]
    # nothing between two of them but the time-out that shows that one was lost
    assert max(later[0] - at[0] for at, later in itertools.pairwise(stops[:4])) < 0.12
    assert watch.seconds and not rig.far.motor.driven
    assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('variant', [*KINDS, _WORST])
def test_everything_is_removed_before_the_acknowledgement(
    make_virtual: MakeVirtual, variant: Mapping[str, str]
) -> None:
    rig = make_virtual(variant=variant)
    rig.ride()
    frames = len(rig.link.frames)
    rig.far.trip(_OVERLOAD)
    rig.pass_time(0.5)
    assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
    asked = [frame['hex'][2:12] for frame in rig.link.frames[frames:]]
    before = asked[: [frame[:6] for frame in asked].index(f'03{_WITH_ACK:04x}')]
    setpoint = rig.register('status.frq_set')
    for write in (
        f'06{SCMD:04x}{Scmd.STOP:04x}',
        f'06{setpoint:04x}0000',
        f'06{MODE:04x}{Mode.STOP:04x}',
    ):
        assert write in before


def test_a_serial_fault_is_acknowledged_by_mode_stop_alone(make_virtual: MakeVirtual) -> None:
    rig = make_virtual(variant=_WORST)
    rig.ride()
    rig.far.trip(_SIO_FAIL)
    rig.pass_time(0.5)
    frames = len(rig.link.frames)
    assert 'acknowledged 14' in rig.answer(rig.drive.acknowledge())
    asked = [frame['hex'][2:8] for frame in rig.link.frames[frames:]]
    assert asked[next(n for n, frame in enumerate(asked) if frame[:2] == '06')] == f'06{MODE:04x}'
    assert f'03{_WITH_ACK:04x}' not in asked


@pytest.mark.parametrize('variant', [*KINDS, _WORST])
def test_control_of_the_terminals_is_left_to_them(
    make_virtual: MakeVirtual, variant: Mapping[str, str]
) -> None:
    rig = make_virtual(variant=variant)
    rig.connect()
    rig.far.control_unit.press('ext')
    rig.pass_time(0.5)
    rig.far.trip(_OVERLOAD)
    rig.pass_time(0.5)
    frames = len(rig.link.frames)
    assert 'acknowledged' in rig.answer(rig.drive.acknowledge())
    rig.pass_time(0.5)
    assert not [frame for frame in rig.link.frames[frames:] if frame['hex'][2:4] == '06']
    assert rig.far.control_unit.mode == Mode.EXT


@pytest.mark.parametrize('kind', [kind for kind in KINDS if kind['refuses_in_fault'] != ALL])
def test_a_fault_that_ends_by_itself_turns_nothing(
    make_virtual: MakeVirtual, kind: Mapping[str, str]
) -> None:
    rig = make_virtual(variant=kind)
    rig.ride()
    rig.far.trip(_OVERLOAD)
    rig.pass_time(0.5)
    watch = Poller(rig)
    watch.watching = True
    rig.far.faults.acknowledge()
    rig.far.set_run_input(True)
    rig.pass_time(1.0)
    assert not watch.seconds
