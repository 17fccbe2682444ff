# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive that has no settings on the bus: the node's own parameters do all the same."""

from __future__ import annotations

from bench import Bench, wait_until
from connections import needs
from parameter_bench import QUIET, Wire, refused, set_each, set_one, values
from setting_names import SETTINGS

pytestmark = needs('bare')

#: A value of the type of each setting of a G2.
_VALUES = {'bool': True, 'integer': 1, 'double': 1.0, 'string': 'Brake'}
_SETTINGS = {
    name: _VALUES[type_]
    for _, _, name, type_ in (line.split(',') for line in SETTINGS.splitlines() if line)
}


def test_a_dump_has_the_nodes_own_parameters_and_loads_again(bench: Bench) -> None:
    bench.simulator()
    bench.driver(*QUIET)
    client = bench.client().connected()
    wire = Wire(bench)
    wire.writes()
    # that one is rclpy's own, and no node at all removes it
    names = client.parameter_names() - {'start_type_description_service'}
    assert not names & _SETTINGS.keys()
    assert client.set_parameters(poll_rate=20.0, setpoint_max=30.0).successful
    dump = values(client, *sorted(names))
    assert dump['setpoint_max'] == 30.0
    assert client.set_parameters(setpoint_max=10.0).successful
    assert [result.reason for result in set_each(client, *dump.items())] == [''] * len(dump)
    assert values(client, *sorted(names)) == dump
    assert client.call('refresh_parameters').message == '0 parameters read, changed: none'
    assert wire.writes() == []


def test_settings_are_refused_one_by_one_and_with_others(bench: Bench) -> None:
    bench.simulator()
    bench.driver(*QUIET)
    client = bench.client().connected()
    wire = Wire(bench)
    wire.writes()
    for name, value in _SETTINGS.items():
        refused(set_one(client, name, value), name)
    refused(client.set_parameters(**{'poll_rate': 20.0, 'control.accel': 6.0}), 'control.accel')
    refused(client.set_parameters(poll_rate=20.0, drive_timeout=2.0), 'drive_timeout')
    assert client.parameter('poll_rate') == 10.0
    assert wire.writes() == []


def test_settings_in_a_parameter_file_are_warned_about_and_do_no_harm(bench: Bench) -> None:
    drive = bench.simulator()
    path = bench.folder / 'drive.yaml'
    path.write_text(
        '/**/nfo_sinus:\n  ros__parameters:\n    control: {accel: 6.0}\n    setpoint_max: 30.0\n'
    )
    driver = bench.driver(*QUIET, '--params-file', str(path))
    client = bench.client().connected()
    wait_until(lambda: 'control.accel was given to nfo_sinus' in driver.text, 'the warning')
    assert client.parameter('setpoint_max') == 30.0
    assert not drive.state()['writes']
