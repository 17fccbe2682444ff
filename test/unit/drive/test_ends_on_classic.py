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


"""Both ends of every setting on Classic, against a copy of the manuals made by hand."""

from __future__ import annotations

import re
from types import SimpleNamespace

import pytest
from support.addresses import packed
from support.classic_ends import OTHER_ON_CLASSIC
from support.classic_ends import on_classic
from support.parameter_ends import ENDS
from support.parameter_ends import Ends

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.drive.parameter_access import ParameterAccess
from nfo_sinus_driver.link import PROTOCOLS

_ON_CLASSIC = [on_classic(ends, '2.03') for ends in ENDS]
EVERY = pytest.mark.parametrize('ends', _ON_CLASSIC, ids=[ends.name for ends in ENDS])


@pytest.fixture(scope='module')
def registers() -> ParameterAccess:
    bus = SimpleNamespace(
        protocol=PROTOCOLS['classic'], use_resync_reads=lambda unit, addresses: None
    )
    return ParameterAccess(bus, 1, load_family('sinus_g2'), 0)  # type: ignore[arg-type]


@EVERY
def test_both_ends_there_and_back(registers: ParameterAccess, ends: Ends) -> None:
    for value, words in ((ends.low, ends.low_words), (ends.high, ends.high_words)):
        assert registers.encode(ends.name, value) == packed(*words)
        back = registers.value(ends.name, packed(*words))
        assert back == value
        assert type(back) is type(value)


@EVERY
def test_one_step_beyond_each_end_and_between_two(registers: ParameterAccess, ends: Ends) -> None:
    for value in (ends.below, ends.above, ends.between):
        if value is not None:
            with pytest.raises(ValueError, match=f'{re.escape(ends.name)}: '):
                registers.encode(ends.name, value)
    for neighbour in ends.neighbours or ():
        assert registers.value(ends.name, registers.encode(ends.name, neighbour)) == neighbour


@pytest.mark.parametrize('name', sorted(OTHER_ON_CLASSIC))
def test_the_range_that_is_shown(registers: ParameterAccess, name: str) -> None:
    (ends,) = (ends for ends in _ON_CLASSIC if ends.name == name)
    low, high, step = registers.limits(name)
    assert (low, high) == (ends.low, ends.high)
    assert ends.neighbours is None or ends.neighbours[1] - ends.neighbours[0] == pytest.approx(step)
