# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Errors of the driver itself: each kind is logged once in ten seconds, in whichever callback."""

from __future__ import annotations

from pathlib import Path
import sys
import time

from bench import FULL_RATE, PATIENCE, Bench, wait_until
from failing_driver import PARAMETER
from std_msgs.msg import Float32
from std_srvs.srv import Trigger

from nfo_sinus_driver.node.ros.log_limit import PERIOD

_FAILING = str(Path(__file__).with_name('failing_driver.py'))
#: What comes with every message: what is logged of it, and the text of the exception.
_KINDS = {
    'error in a callback; the driver goes on': 'a subscription',
    'error in a service of /nfo_sinus': 'a service',
    'a message could not be published': 'the publish queue',
}


def test_an_error_in_any_callback_is_logged_once_in_ten_seconds_with_how_many_were_not(
    bench: Bench,
) -> None:
    bench.simulator(paced=True)
    began = time.monotonic()
    driver = bench.driver(*FULL_RATE, through=(sys.executable, _FAILING), fails=True)
    client = bench.client()
    wait_until(lambda: client.state() == 'active', 'the node is active')
    setpoints = client.node.create_publisher(Float32, '/nfo_sinus/setpoint', 1)
    wait_until(setpoints.get_subscription_count, 'there is a subscriber')

    def both_periods() -> bool:
        setpoints.publish(Float32())
        answer = client.call('rapid_stop', Trigger)
        assert 'error in the driver' in answer.message
        return all(f'{said} (' in driver.text for said in _KINDS)

    wait_until(both_periods, 'each is logged again, with how many were not', PATIENCE, 0.01)
    text, periods = driver.text, (time.monotonic() - began) / PERIOD
    for said, what in _KINDS.items():
        assert 2 <= text.count(said) <= periods + 1, said
        assert text.count(f'LookupError: {what}') == text.count(said)
        assert ' of the same were not logged)' in text
    # what comes once is logged as ever
    assert text.count('LookupError: the bus') == 1
    client.set_parameters_async(**{PARAMETER: 'drum'})
    wait_until(lambda: 'LookupError: a parameter' in driver.text, 'so is a parameter callback')
    assert driver.running
