# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""With ``use_sim_time`` the clock of a drive node goes on whatever else it does, or stands."""

from __future__ import annotations

from collections.abc import Callable
import threading
import time

from bench import FULL_RATE, Bench, seconds, wait_until
from builtin_interfaces.msg import Time
from connections import needs
from nfo_sinus_msgs.msg import Setpoint
from rosgraph_msgs.msg import Clock

#: Simulated time is so far from that of the machine, s, and goes on so often.
_APART = 1000.0
_PERIOD = 0.02
#: How far stamps may be from it, s; setting takes longer than the time-out of set-points.
_NEAR = 0.3
_SILENCE = 0.8
_SETTING = 2.5
_TIMEOUT = 1.5


def _now() -> float:
    return time.monotonic() + _APART


@needs('own')
def test_the_clock_goes_on_while_a_setting_waits_for_the_drive(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    timeouts = ('-p', f'setpoint_timeout:={_TIMEOUT}', '-p', 'lost_after:=10.0')
    waits = ('-p', f'response_timeout:={_SETTING}')
    driver = bench.driver(*FULL_RATE, *timeouts, *waits, '-p', 'use_sim_time:=true')
    client = bench.client().connected()
    clock = client.node.create_publisher(Clock, '/clock', 10)
    setpoint = client.node.create_publisher(Setpoint, '/nfo_sinus/setpoint_stamped', 1)
    known, ended = threading.Event(), threading.Event()

    def publish() -> None:
        while not ended.wait(_PERIOD):
            now = _now()
            stamp = Time(sec=int(now), nanosec=int(now % 1 * 1e9))
            clock.publish(Clock(clock=stamp))
            if known.is_set():
                message = Setpoint(value=20.0, unit=Setpoint.HZ)
                message.header.stamp = stamp
                setpoint.publish(message)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        client.wait_for(
            'status', lambda status: abs(_now() - seconds(status.header.stamp)) < _NEAR, 'its time'
        )
        known.set()
        assert client.enable().success
        wait_until(lambda: drive.state()['frequency'] == 20.0, 'it follows')
        drive.inject('silence', _SILENCE)
        begun = time.monotonic()
        assert client.set_parameters(**{'freque.f_fix1': 21.0}).successful
        assert time.monotonic() - begun > _TIMEOUT
        stamp = seconds(client.newest('status').header.stamp)
        client.wait_for(
            'status',
            lambda status: seconds(status.header.stamp) > stamp + 2 * _TIMEOUT,
            'time goes on',
        )
        assert drive.state()['frequency'] == 20.0
        assert client.newest('status').enabled
    finally:
        ended.set()
        thread.join()
    assert 'no set-point for' not in driver.text


@needs('own')
def test_a_set_point_that_is_repeated_while_the_clock_stands_is_missed(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1))
    driver = bench.driver('-p', 'setpoint_timeout:=1.0', '-p', 'use_sim_time:=true')
    client = bench.client().connected()
    clock = client.node.create_publisher(Clock, '/clock', 10)
    setpoint = client.node.create_publisher(Setpoint, '/nfo_sinus/setpoint_stamped', 1)
    now = _APART

    def publish(passes: float) -> None:
        nonlocal now
        now += passes
        stamp = Time(sec=int(now), nanosec=int(now % 1 * 1e9))
        clock.publish(Clock(clock=stamp))
        message = Setpoint(value=20.0, unit=Setpoint.HZ)
        message.header.stamp = stamp
        setpoint.publish(message)

    def until(passes: float, condition: Callable[[], object], what: str) -> None:
        def met() -> object:
            publish(passes)
            return condition()

        wait_until(met, what, period=_PERIOD)

    until(_PERIOD, lambda: client.latest('status').header.stamp.sec >= _APART, 'its time')
    assert client.enable().success
    until(_PERIOD, lambda: drive.state()['frequency'] == 20.0, 'it follows')
    # the simulation pauses, and its last command is repeated
    until(0.0, lambda: 'no set-point for 1 s' in driver.text, 'it is missed')
    until(0.0, lambda: drive.state()['frequency'] == 0.0, 'the motor stands')
    assert 'an old one is repeated, or the clock of its publisher stands' in driver.text
    assert client.newest('status').enabled
    # it goes on
    until(_PERIOD, lambda: drive.state()['frequency'] == 20.0, 'it follows again')
