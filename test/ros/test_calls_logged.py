# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Each command leaves one line in the log: what was called, which node called, what came of it."""

from __future__ import annotations

from bench import Bench, wait_until
from connections import needs
from nfo_sinus_msgs.action import Tune
from std_srvs.srv import SetBool, Trigger
from tuner import Tuner

_TRIGGERS = (
    'stop', 'quick_stop', 'rapid_stop', 'fault_ack', 'refresh_parameters', 'erase_error_log',
)


@needs('own')
def test_each_command_is_logged_once_with_the_name_of_its_client(bench: Bench) -> None:
    simulator = bench.simulator()
    driver = bench.driver()
    client = bench.client().connected()
    name = client.node.get_fully_qualified_name()
    for value in (True, False):
        client.call('enable', SetBool, data=value)
    for service in (*_TRIGGERS, 'tune_basic'):
        client.call(service)
    others = bench.client('/nfo_sinus_bus')
    for service in ('stop_all', 'disable_all', 'enable_all'):
        others.call(service, Trigger)
    other = others.node.get_fully_qualified_name()
    simulator.inject('fault', 5)
    client.wait_for('inv_st', lambda inv_st: inv_st.code == 5, 'the fault')
    assert not client.call('enable', SetBool, data=True).success
    # a tuning that does not begin is logged with the reason, by service and by action
    assert not client.call('tune_full').success
    tuner = Tuner(client)
    assert not tuner.result(tuner.begin(Tune.Goal.BASIC))[1].success
    expected = [
        f'/nfo_sinus/enable (true) called by {name}',
        f'/nfo_sinus/enable (false) called by {name}',
        *(f'/nfo_sinus/{service} called by {name}' for service in (*_TRIGGERS, 'tune_basic')),
        *(f'/nfo_sinus_bus/{service} called by {other}' for service in ('stop_all', 'disable_all')),
        f'/nfo_sinus_bus/enable_all called by {other}',
        f'/nfo_sinus/enable (true) called by {name}: fault 5 ',
        f'/nfo_sinus/tune_full called by {name}: fault 5 ',
        f'/nfo_sinus/tune (basic) called by {name}: fault 5 ',
    ]
    wait_until(lambda: all(line in driver.text for line in expected), f'{expected}')
    assert driver.text.count(' called by ') == len(expected), driver.text
    # and with what came of it
    assert f'/nfo_sinus/enable (true) called by {name}: enabled; it follows' in driver.text
    assert f'/nfo_sinus/enable (false) called by {name}: stopp' in driver.text
    # one that is refused is a warning
    for line in driver.text.splitlines():
        if ' called by ' in line:
            assert ('[WARN]' if 'fault 5' in line else '[INFO]') in line
