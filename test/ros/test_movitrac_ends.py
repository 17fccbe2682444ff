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

"""Every setting of a MOVITRAC through ROS, at both ends and between, against frames by hand."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
import contextlib
import json
from pathlib import Path
import re
import subprocess
import sys

from bench import PATIENCE
from bench import Bench
from bench import Client
from parameter_bench import COUNTED
from parameter_bench import refused
from parameter_bench import set_one
from parameter_bench import values
import pytest
from support.movitrac_ends import COUNTS
from support.movitrac_ends import ENDS
from support.movitrac_ends import Ends
from support.movitrac_ends import Value
from ways import WAYS

from nfo_sinus_driver.demo.bench import own_domain

#: What has to be so for a setting to be switched on [M4 §2.1.2].
_NEEDS = {
    'control.hoist_1': 'special.four_quadrant_1',
    'control.hoist_2': 'special.four_quadrant_2',
}
#: Switched on at the keypad alone.
_AT_KEYPAD = 'special.user_menu'


class Rig:
    """
    One drive and its driver: every test leaves both as they were.

    The drive is on RS-232, where its address is of no significance [M4 §2.4.4]: so that can be set.
    """

    def __init__(self, bench: Bench, card: str) -> None:
        self.trace = bench.trace
        cards = ('--option-card', card) if card else ()
        self.drive = bench.simulator('--interface', 'rs232', *cards, paced=False)
        bench.driver(*COUNTED, '-p', 'allow_communication_changes:=true')
        self.client: Client = bench.client().connected()
        self._read = 0
        self.writes()

    def writes(self) -> list[str]:
        """Return the SELECT frames that have arrived since the last call, in hexadecimal."""
        with self.trace.open('rb') as stream:
            stream.seek(self._read)
            text = stream.read()
        # the last line may not be complete yet
        text = text[: text.rfind(b'\n') + 1]
        self._read += len(text)
        frames = [json.loads(line) for line in text.splitlines() if b'"request"' in line]
        return [frame['hex'] for frame in frames if frame['hex'].startswith(('a9', 'ad'))]

    def set(self, name: str, value: Value) -> None:
        """Set a parameter, and see that it was."""
        result = set_one(self.client, name, value)
        assert result.successful, result.reason

    def has(self, name: str, value: Value) -> None:
        """See that ROS and the drive have the same value, of the right type."""
        shown = values(self.client, name)[name]
        assert shown == value
        assert type(shown) is type(value)
        assert self.drive.state()['parameters'][name] == value


def select(index: int, raw: str) -> str:
    """Return a SELECT frame to address 1 [M4 §2.1.1], as it stands in a trace."""
    data = bytes.fromhex(f'a901{index:04x}{raw}')
    return (data + bytes((sum(data) % 256,))).hex()


@pytest.fixture(scope='module')
def rigs(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Rig]]:
    """The drives by their option cards, each made when it is first asked for."""
    with contextlib.ExitStack() as stack:
        yield _Rigs(stack, tmp_path_factory)


class _Rigs(dict[str, Rig]):
    def __init__(self, stack: contextlib.ExitStack, folders: pytest.TempPathFactory) -> None:
        self._stack, self._folders = stack, folders

    def __missing__(self, card: str) -> Rig:
        domain = self._stack.enter_context(own_domain())
        folder = self._folders.mktemp(card or 'no_card')
        bench = self._stack.enter_context(Bench(domain, folder, WAYS['movitrac']))
        self[card] = Rig(bench, card)
        return self[card]


def test_the_table_has_every_setting(rigs: dict[str, Rig]) -> None:
    assert Counter(ends.card for ends in ENDS) == COUNTS
    names = rigs[''].client.parameter_names()
    bare = {ends.name for ends in ENDS if not ends.card}
    # the node's own have no group
    assert {name for name in names if '.' in name} - {'qos_overrides./clock'} == bare
    assert len(bare) == 149


@pytest.mark.parametrize(
    'ends', [pytest.param(ends, id=ends.name) for ends in ENDS if ends.name != _AT_KEYPAD]
)
def test_both_ends_arrive_and_nothing_beyond_them(rigs: dict[str, Rig], ends: Ends) -> None:
    rig = rigs[ends.card]
    factory = values(rig.client, ends.name)[ends.name]
    described = rig.client.descriptor(ends.name).description
    number = f'{ends.number}, index' if ends.number else 'Index'
    assert f'{number} {ends.index}: ' in described
    needed = _NEEDS.get(ends.name)
    if needed:
        rig.set(needed, True)
        rig.writes()
    present = factory
    try:
        _is_refused(rig, ends, factory)
        # the low end twice, for one of both may be the factory's
        for value, raw in (
            (ends.low, ends.low_raw), (ends.high, ends.high_raw), (ends.low, ends.low_raw)
        ):
            rig.set(ends.name, value)
            assert rig.writes() == ([] if value == present else [select(ends.index, raw)])
            rig.has(ends.name, value)
            present = value
        for value in ends.neighbours or ():
            rig.set(ends.name, value)
            rig.has(ends.name, value)
        for value, raw in ends.codes:
            rig.set(ends.name, value)
            expected = [] if value == present else [select(ends.index, raw)]
            assert rig.writes() == expected, value
            rig.has(ends.name, value)
            present = value
    finally:
        rig.set(ends.name, factory)
        if needed:
            rig.set(needed, False)
        rig.writes()
    rig.has(ends.name, factory)


def test_the_user_menu_is_switched_off_and_no_more_on(rigs: dict[str, Rig]) -> None:
    rig = rigs['']
    (ends,) = [ends for ends in ENDS if ends.name == _AT_KEYPAD]
    assert values(rig.client, ends.name)[ends.name] == ends.low
    try:
        rig.set(ends.name, ends.high)
        assert rig.writes() == [select(ends.index, ends.high_raw)]
        refused(set_one(rig.client, ends.name, ends.low), ends.name, 'use the keypad', '19')
        assert rig.writes() == [select(ends.index, ends.low_raw)]
        rig.has(ends.name, ends.high)
    finally:
        rig.drive.inject('set', ends.name, ends.low)
        assert rig.client.call('refresh_parameters').success


def _is_refused(rig: Rig, ends: Ends, present: Value) -> None:
    for value, bound in ((ends.below, ends.low), (ends.above, ends.high)):
        if value is None:
            continue
        result = set_one(rig.client, ends.name, value)
        refused(result, ends.name)
        if isinstance(bound, str):
            refused(result, *(str(label) for label, _ in ends.codes))
        else:
            assert bound in _numbers(result.reason, ends.name), result.reason
    if ends.between is not None:
        assert ends.neighbours is not None
        result = set_one(rig.client, ends.name, ends.between)
        refused(result, ends.name)
        assert _numbers(result.reason, ends.name) >= set(ends.neighbours), result.reason
    assert rig.writes() == []
    rig.has(ends.name, present)


def _numbers(reason: str, name: str) -> set[float]:
    """Return the numbers in a reason, but those in the name that it begins with."""
    assert reason.startswith(f'{name}: ')
    said = re.findall(r'-?\d+(?:\.\d+)?(?:e-?\d+)?', reason.removeprefix(name))
    return {float(number) for number in said}


def test_the_telegrams_of_the_manual(tmp_path: Path) -> None:
    """Reading the heat sink temperature, and setting t11 to 3.7 s [M4 §2.4.3, §2.4.4]."""
    with own_domain() as domain, Bench(domain, tmp_path, WAYS['movitrac']) as bench:
        bench.simulator('--address', '0', paced=False)
        _read_the_temperature(bench)
        _set_the_ramp(bench)


def _read_the_temperature(bench: Bench) -> None:
    command = (sys.executable, '-c', 'from nfo_sinus_driver.cli.main import main; exit(main())')
    drive = ('--protocol', 'movitrac', '--model', 'movitrac31', '--address', '0')
    done = subprocess.run(
        [*command, 'get', '--port', bench.port, *drive, 'status.heat_sink_temperature'],
        capture_output=True, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert '25.5 °C' in done.stdout
    frames = [frame['hex'] for frame in bench.frames()]
    assert frames[frames.index('b5000004b9') + 1] == 'c800040000255041'


def _set_the_ramp(bench: Bench) -> None:
    bench.driver('-p', 'address:=0')
    client = bench.client().connected()
    assert set_one(client, 'ramp.t11_up', 3.7).successful
    frames = [frame['hex'] for frame in bench.frames()]
    assert frames[frames.index('a90000190000037035') + 1] == 'd2d2'
