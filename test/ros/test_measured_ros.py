# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive measures and no client can set: on ``~/measured``, or as a read-only parameter."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from bench import Bench, Client
from connections import CONNECTIONS
from nfo_sinus_msgs.msg import Measured
from parameter_bench import refused, set_one, values
import pytest

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.node.parameters.settings import DRIVE_SETTINGS
from nfo_sinus_driver.node.ros.qos import RELIABLE


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['movitrac']) as bench:
        yield bench


def test_measured_values_and_what_is_only_read(bench: Bench) -> None:
    bench.simulator()
    bench.driver('-p', 'telemetry_rate:=5.0')
    client: Client = bench.client().connected()
    client.listen('measured', Measured, '/nfo_sinus/measured', RELIABLE)
    heat = 'status.heat_sink_temperature'
    message = client.wait_for('measured', lambda message: message.value[0] > 0, 'a warm heat sink')
    usual = list(load_family('movitrac31').profile.measured)
    assert (message.name, len(message.value)) == (usual, len(usual))
    assert message.unit[:3] == ['°C', '%', '%']

    # named while it runs, and named wrongly
    assert client.set_parameters(measured=['status.frequency']).successful
    client.wait_for('measured', lambda message: message.name == ['status.frequency'], 'the other')
    refused(client.set_parameters(measured=['status.no_such']), 'status.no_such', heat)

    # between the ends of its range it takes some numbers alone
    five = 'one of 50, 60, 87, 104, 120'
    assert client.descriptor('frequency.f_base_1').additional_constraints.startswith(five)
    refused(set_one(client, 'frequency.f_base_1', 55), five.removeprefix('one '))

    # only read: shown and refused; what was dumped can be loaded
    name = 'terminal.output_61'
    assert client.descriptor(name).read_only
    before = values(client, name)[name]
    assert set_one(client, name, before).successful
    refused(set_one(client, name, 'Rotating field on'), name, 'only read')


def test_a_list_that_was_dumped_empty_is_taken_as_empty(bench: Bench, tmp_path: Path) -> None:
    names = [name for name, setting in DRIVE_SETTINGS.items() if isinstance(setting.default, list)]
    assert len(names) > 1
    bench.simulator()
    dumped = tmp_path / 'dumped.yaml'
    # as `ros2 param dump` writes it
    dumped.write_text(
        '\n'.join(['/nfo_sinus:', '  ros__parameters:', *(f'    {name}: []' for name in names)]),
        encoding='utf-8',
    )
    bench.driver('--params-file', str(dumped))
    client: Client = bench.client().connected()
    client.listen('measured', Measured, '/nfo_sinus/measured', RELIABLE)
    usual = list(load_family('movitrac31').profile.measured)
    client.wait_for('measured', lambda message: message.name == usual, 'the usual ones')
    # and while it runs
    assert client.set_parameters(measured=['status.frequency']).successful
    client.wait_for('measured', lambda message: message.name == ['status.frequency'], 'the one')
    result = client.set_parameters(measured=[])
    assert result.successful, result.reason
    client.wait_for('measured', lambda message: message.name == usual, 'the usual ones again')
