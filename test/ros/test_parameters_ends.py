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


"""Every setting of a drive through ROS: both ends, just outside and between; what arrives there."""

from __future__ import annotations

from collections.abc import Iterator
import re

from bench import Bench
from bench import Client
from parameter_bench import ANY_BUS
from parameter_bench import COUNTED
from parameter_bench import Value
from parameter_bench import Wire
from parameter_bench import refused
from parameter_bench import set_one
from parameter_bench import settings
from parameter_bench import values
from parameter_bench import written
import pytest
from support.parameter_ends import ENDS
from support.parameter_ends import Ends
from ways import NEWER
from ways import Way
from ways import needs

from nfo_sinus_driver.demo.bench import own_domain

pytestmark = needs('parameters')

_ENDS = {ends.name: ends for ends in ENDS}


def _each(*rows: Ends) -> pytest.MarkDecorator:
    """Have a test for each setting, where it is to be had."""
    marks = {
        ANY_BUS: needs('classic'),
        'serial.address': needs('later'),
        'serial.si_baud': needs('later'),
        **dict.fromkeys(NEWER, needs('newer')),
    }
    names = [ends.name for ends in rows]
    return pytest.mark.parametrize(
        'name', [pytest.param(name, id=name, marks=marks.get(name, ())) for name in names]
    )


class Rig:
    """One drive and its driver for all tests here: every test leaves the drive as it was."""

    def __init__(self, bench: Bench) -> None:
        self.way = bench.way
        self.drive = bench.simulator(paced=False)
        bench.driver(*COUNTED, '-p', 'allow_communication_changes:=true')
        self.client: Client = bench.client().connected()
        self.wire = Wire(bench)
        self.wire.writes()

    def ends(self, name: str) -> Ends:
        """Return what a setting is this way."""
        return settings(self.way)[name]

    def has(self, name: str, value: Value) -> None:
        """See that ROS and the drive have the same value, of the right type."""
        shown = values(self.client, name)[name]
        assert shown == value
        assert type(shown) is type(value)
        assert self.drive.state()['parameters'][name] == value


@pytest.fixture(scope='module')
def rig(tmp_path_factory: pytest.TempPathFactory, way: Way) -> Iterator[Rig]:
    with own_domain() as domain, Bench(domain, tmp_path_factory.mktemp('ends'), way) as bench:
        yield Rig(bench)


@_each(*ENDS)
def test_both_ends_arrive_and_nothing_beyond_them(rig: Rig, name: str) -> None:
    ends = rig.ends(name)
    classic = rig.way.protocol == 'classic'
    factory = values(rig.client, name)[name]
    present = factory
    try:
        _is_refused(rig, ends, factory)
        # the low end twice, for one of both may be the factory's
        for value, words in (
            (ends.low, ends.low_words),
            (ends.high, ends.high_words),
            (ends.low, ends.low_words),
        ):
            result = set_one(rig.client, name, value)
            assert result.successful, result.reason
            request = written(name, words, classic=classic)
            assert rig.wire.writes() == ([] if value == present else [request])
            rig.has(name, value)
            present = value
        for value in ends.neighbours or ():
            result = set_one(rig.client, name, value)
            assert result.successful, result.reason
            rig.has(name, value)
    finally:
        result = set_one(rig.client, name, factory)
        assert result.successful, result.reason
        rig.wire.writes()
    rig.has(name, factory)


def _is_refused(rig: Rig, ends: Ends, present: Value) -> None:
    for value, bound in ((ends.below, ends.low), (ends.above, ends.high)):
        if value is None:
            continue
        result = set_one(rig.client, ends.name, value)
        refused(result, ends.name)
        if ends.codes:
            refused(result, *(label for label, _ in ends.codes))
        else:
            assert bound in _numbers(result.reason, ends.name), result.reason
    if ends.neighbours is not None:
        assert ends.between is not None
        result = set_one(rig.client, ends.name, ends.between)
        refused(result, ends.name)
        assert _numbers(result.reason, ends.name) >= set(ends.neighbours), result.reason
    assert rig.wire.writes() == []
    rig.has(ends.name, present)


def _numbers(reason: str, name: str) -> set[float]:
    """Return the numbers in a reason, but those in the name that it begins with."""
    assert reason.startswith(f'{name}: ')
    said = re.findall(r'-?\d+(?:\.\d+)?(?:e-?\d+)?', reason.removeprefix(name))
    return {float(number) for number in said}


@_each(*(ends for ends in ENDS if ends.codes))
def test_every_label_arrives_as_its_code(rig: Rig, name: str) -> None:
    ends = rig.ends(name)
    factory = values(rig.client, name)[name]
    codes = dict(ends.codes)
    present = factory
    try:
        for label, code in ends.codes:
            result = set_one(rig.client, name, label)
            assert result.successful, result.reason
            words = () if label == present else (written(name, (code,)),)
            assert tuple(rig.wire.writes()) == words, label
            present = label
        for label in {label for label, _ in _ENDS[name].codes} - codes.keys():
            refused(set_one(rig.client, name, label), name, f'the drive does not accept {label}')
            rig.wire.writes()
            rig.has(name, present)
    finally:
        assert set_one(rig.client, name, factory).successful
        arrived = rig.wire.writes()
    assert arrived in ([], [written(name, (codes[factory],))])
    rig.has(name, factory)
