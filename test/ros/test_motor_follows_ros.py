# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a start depends on stays as it is while enabled, and no motor runs on without set-points."""

from __future__ import annotations

from pathlib import Path

from bench import Bench, wait_until
from connections import CONNECTIONS
from parameter_bench import set_one

from nfo_sinus_driver.demo.bench import own_domain

LEAST = 'frequency.f_min_1'


def test_a_least_frequency_keeps_no_motor_turning_that_is_given_no_set_points(
    tmp_path: Path,
) -> None:
    with own_domain() as domain, Bench(domain, tmp_path, CONNECTIONS['movitrac']) as bench:
        drive = bench.simulator()
        bench.driver()
        client = bench.client().connected()
        with client.run_at(35.0):
            result = set_one(client, LEAST, 30.0)
            assert not result.successful
            assert 'the motor is enabled' in result.reason
            # the keypad is not kept from it
            drive.inject('set', LEAST, 30.0)
        wait_until(lambda: 'does not slow down at set-point 0' in bench.log, 'the reason')
        wait_until(lambda: not drive.state()['turning'], 'the motor stands')
