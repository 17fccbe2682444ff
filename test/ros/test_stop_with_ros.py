# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``stop_with``: the drives that a drive names stop when it is stopped."""

from __future__ import annotations

from bench import Bench
from nfo_sinus_msgs.msg import DriveStatus
from ways import needs

_TWO = """
/**/nfo_sinus_bus: {ros__parameters: {drives: [infeed, outfeed]}}
/**/infeed: {ros__parameters: {setpoint_timeout: 0.0, stop_with: [outfeed]}}
/**/outfeed: {ros__parameters: {address: 2, setpoint_timeout: 0.0, stop_with: [infeed]}}
"""


@needs('own')
def test_a_drive_stops_those_that_it_names_and_says_why(bench: Bench) -> None:
    simulator = bench.simulator('--address', '1', '--address', '2')
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(_TWO)
    bench.driver('-r', '__ns:=/line1', '--params-file', str(parameters))
    infeed = bench.client('/line1/infeed').connected()
    outfeed = bench.client('/line1/outfeed').connected()
    infeed.enable()
    outfeed.enable()
    simulator.inject('fault', 5, address=1)
    outfeed.wait_for(
        'status',
        lambda one: one.stop_reason == DriveStatus.REASON_STOP_WITH and not one.enabled
        and one.stop_text.startswith('it stops with /line1/infeed: fault 5 Overload'),
        'it stops with the other',
    )
    # a name that no drive has is refused, with those that there are
    answer = infeed.set_parameters(stop_with=['outfeed', 'nobody'])
    assert not answer.successful
    assert "no drive 'nobody' on this line: choose of infeed, outfeed" in answer.reason
