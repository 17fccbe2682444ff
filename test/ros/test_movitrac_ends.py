# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Settings of a MOVITRAC through ROS: what is shown of all, what arrives of one of each kind."""

from __future__ import annotations

from collections.abc import Iterator
import json
from pathlib import Path
import re
import subprocess
import sys

from bench import PATIENCE, Bench, Client
from connections import CONNECTIONS
from parameter_bench import COUNTED, refused, set_one, values
import pytest
from rcl_interfaces.srv import DescribeParameters
from support.ends import Ends, Value, of_movitrac

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.demo.bench import own_domain

#: What has to be so for a setting to be switched on [M4 §2.1.2].
#: One of each kind; test/unit/drive/families/test_movitrac_manual.py has both ends of all.
_ONE_OF_EACH = (
    'ramp.t11_up', 'frequency.f_base_1', 'motor.pwm_frequency_1', 'special.four_quadrant_1',
    'serial.inverter_address',
)
_AT_KEYPAD = 'special.user_menu'


class Rig:
    """
    One drive and its driver: every test leaves both as they were.

    The drive is on RS-232, where its address is of no significance [M4 §2.4.4]: so that can be set.
    """

    def __init__(self, bench: Bench) -> None:
        self.trace = bench.trace
        self.drive = bench.simulator('--interface', 'rs232')
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


def select(ends: Ends, value: Value) -> str:
    """Return a SELECT frame to address 1 [M4 §2.1.1], as it stands in a trace."""
    data = bytes.fromhex(f'a901{ends.places[0]:04x}{ends.data(value)}')
    return (data + bytes((sum(data) % 256,))).hex()


@pytest.fixture(scope='module')
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    folder = tmp_path_factory.mktemp('ends')
    with own_domain() as domain, Bench(domain, folder, CONNECTIONS['movitrac']) as bench:
        yield Rig(bench)


def test_every_setting_that_needs_no_card_is_shown_with_its_number(rig: Rig) -> None:
    family = load_family('movitrac31')
    bare = [ends for ends in of_movitrac().values() if not family[ends.name].option]
    assert len(bare) == 149
    # the node's own have no group
    names = {name for name in rig.client.parameter_names() if '.' in name}
    only_read = {'setpoint.n2_offset', 'special.software_system', 'terminal.output_61'}
    assert names - {'qos_overrides./clock'} == {ends.name for ends in bare} | only_read
    asked = [ends.name for ends in bare]
    shown = values(rig.client, *asked)
    described = rig.client.call('describe_parameters', DescribeParameters, names=asked)
    wrong = [
        (ends.name, shown[ends.name], descriptor.description)
        for ends, descriptor in zip(bare, described.descriptors, strict=True)
        if type(shown[ends.name]) is not type(ends.low)
        or not re.search(rf': (P\d+.*, i|I)ndex {ends.places[0]}: ', descriptor.description)
    ]
    assert wrong == []


def test_both_ends_arrive_and_nothing_beyond_them(rig: Rig) -> None:
    for ends in (of_movitrac()[name] for name in _ONE_OF_EACH):
        factory = present = values(rig.client, ends.name)[ends.name]
        for value in ends.beyond:
            refused(set_one(rig.client, ends.name, value), ends.name)
        assert rig.writes() == [], ends.name
        # the low end twice, for one of both may be the factory's
        for value in (ends.low, ends.high, ends.low, *ends.counts):
            rig.set(ends.name, value)
            expected = [] if value == present else [select(ends, value)]
            assert rig.writes() == expected, (ends.name, value)
            rig.has(ends.name, value)
            present = value
        rig.set(ends.name, factory)
        rig.writes()


def test_the_user_menu_is_switched_off_and_no_more_on(rig: Rig) -> None:
    ends = of_movitrac()[_AT_KEYPAD]
    assert values(rig.client, ends.name)[ends.name] == ends.low
    try:
        rig.set(ends.name, ends.high)
        assert rig.writes() == [select(ends, ends.high)]
        refused(set_one(rig.client, ends.name, ends.low), ends.name, 'use the keypad', '19')
        assert rig.writes() == [select(ends, ends.low)]
        rig.has(ends.name, ends.high)
    finally:
        rig.drive.inject('set', ends.name, ends.low)
        assert rig.client.call('refresh_parameters').success


def test_the_telegrams_of_the_manual(tmp_path: Path) -> None:
    """Reading the heat sink temperature, and setting t11 to 3.7 s [M4 §2.4.3, §2.4.4]."""
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['movitrac']) as bench:
        bench.simulator('--address', '0')
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
