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

"""Any changes on any drive, however it refuses: all new, or all old, or told by name."""

from __future__ import annotations

import enum
import itertools

from drive_rig import PATIENCE
from drive_rig import Rig
from hypothesis import HealthCheck
from hypothesis import given
from hypothesis import settings
from hypothesis import strategies as st
from parameters_rig import Store
from parameters_rig import connect
from parameters_rig import far
from parameters_rig import on_read
from parameters_rig import on_write
import pytest
from support.said import said

from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.drive.parameter_writer import ParameterError
from nfo_sinus_driver.simulator.memory import Reason
from nfo_sinus_driver.simulator.memory import Refused

BEFORE: dict[str, Value] = {
    'control.accel': 1.0,
    'control.retard': 1.0,
    'freque.f_fix1': 1.0,
    'control.st_mode': 'Brake',
    'control.energy_save': False,
    'motor.u_nom': 400,
}


class Whim(enum.Enum):
    """What the drive makes of a request to a setting."""

    OBEY = enum.auto()
    REFUSE_ADDRESS = enum.auto()
    REFUSE_VALUE = enum.auto()
    REFUSE_STATE = enum.auto()
    #: It does what it is told, and says that it does not.
    LIE = enum.auto()
    #: It says that it does what it is told, and does not.
    IGNORE = enum.auto()
    #: It keeps another value.
    CLAMP = enum.auto()


REFUSALS = {
    Whim.REFUSE_ADDRESS: Reason.ADDRESS,
    Whim.REFUSE_VALUE: Reason.VALUE,
    Whim.REFUSE_STATE: Reason.STATE,
}
#: What a drive that keeps another value keeps, as raw numbers.
CLAMPED = {'control.st_mode': 0, 'control.energy_save': 1, 'motor.u_nom': 333}

CHANGES = st.dictionaries(st.sampled_from(list(BEFORE)), st.booleans(), min_size=1)
#: Mostly it obeys, so that something is done before it does not; two times it does not.
TWO = st.lists(
    st.tuples(st.integers(0, 9), st.sampled_from(list(Whim))).map(
        lambda pair: [Whim.OBEY] * pair[0] + [pair[1]]
    ),
    max_size=2,
).map(lambda lists: list(itertools.chain.from_iterable(lists)))
#: Sooner or later it hardly ever obeys any more.
MANY = st.tuples(
    st.integers(0, 12), st.lists(st.sampled_from([*Whim, *REFUSALS]), min_size=2, max_size=30)
).map(lambda pair: [Whim.OBEY] * pair[0] + pair[1])
AFTER: dict[str, Value] = {
    'control.accel': 7.0,
    'control.retard': 7.0,
    'freque.f_fix1': 7.0,
    'control.st_mode': 'Release',
    'control.energy_save': True,
    'motor.u_nom': 230,
}


class Moody:
    """Has a drive follow whims, one for each request to a setting; then it obeys."""

    def __init__(self, rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
        self.whims: list[Whim] = []
        on_write(rig, monkeypatch, self.on_write)
        on_read(rig, monkeypatch, self.on_read)

    def next(self) -> Whim:
        return self.whims.pop(0) if self.whims else Whim.OBEY

    def on_write(self, write: Store, key: str, raw: int) -> None:
        whim = self.next()
        if whim in REFUSALS:
            raise Refused(REFUSALS[whim], 'a whim')
        if whim is Whim.CLAMP:
            raw = CLAMPED.get(key, 3000)
        if whim is not Whim.IGNORE:
            write(key, raw)
        if whim is Whim.LIE:
            raise Refused(Reason.STATE, 'a whim')

    def on_read(self, key: str) -> None:
        if key not in BEFORE:
            return
        whim = self.next()
        if whim in REFUSALS:
            raise Refused(REFUSALS[whim], 'a whim')


def reset(rig: Rig, moody: Moody) -> None:
    """Let the drive have what it had, and the driver know it."""
    moody.whims = []
    with rig.simulator.lock:
        for key, value in BEFORE.items():
            rig.far.set_from_keypad(key, value)
    rig.drive.parameters._keys = tuple(BEFORE)
    rig.drive.parameters.refresh().result(PATIENCE)
    # nobody else reads meanwhile
    rig.drive.parameters._keys = ()


@pytest.mark.parametrize('moods', [TWO, MANY], ids=['two', 'many'])
def test_all_new_or_all_old(
    rig: Rig, monkeypatch: pytest.MonkeyPatch, moods: st.SearchStrategy[list[Whim]]
) -> None:
    parameters = connect(rig)
    moody = Moody(rig, monkeypatch)
    ends = {'done': 0, 'undone': 0, 'left': 0}

    @settings(
        max_examples=120,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(st.lists(st.tuples(CHANGES, moods), min_size=1, max_size=3))
    def run(sequence: list[tuple[dict[str, bool], list[Whim]]]) -> None:
        reset(rig, moody)
        for choice, whims in sequence:
            wanted = {key: AFTER[key] if new else BEFORE[key] for key, new in choice.items()}
            old = dict(zip(BEFORE, far(rig, *BEFORE), strict=True))
            moody.whims = list(whims)
            left: tuple[str, ...] = ()
            try:
                changes = parameters.change(wanted).result(PATIENCE)
            except ParameterError as error:
                left = error.left
                expected = old
                for key in left:
                    assert f'{key} is NOT put back' in said(error)
                ends['left' if left else 'undone'] += 1
            else:
                expected = {**old, **wanted}
                assert {change.key for change in changes} == {
                    key for key in wanted if wanted[key] != old[key]
                }
                ends['done'] += 1
            moody.whims = []
            assert set(left) <= set(wanted)
            # a drive that refuses twice is put right all the same
            assert not left or moods is MANY
            has = dict(zip(BEFORE, far(rig, *BEFORE), strict=True))
            for key in BEFORE.keys() - set(left):
                assert has[key] == expected[key], key
                assert parameters.values[key] == expected[key], key
            if left:
                # what may be otherwise than before is not known until it is read
                reset(rig, moody)

    run()
    assert ends['done'] > 20
    assert ends['undone'] > 20
    assert (ends['left'] > 5) is (moods is MANY)
