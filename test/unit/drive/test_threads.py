# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What only real threads can show: others come into the bus from theirs while its worker works.

A real port and a real clock, so nothing here says how fast something has to be.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
import contextlib
import itertools
from pathlib import Path
import threading
import time
from typing import Any

import pytest
from support.rig import Notes
from support.rig_line import Clock
from support.said import raises, said
from support.variants import ramps

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import Cause, Drive, DriveError, DriveSettings
from nfo_sinus_driver.link import BusSettings, open_link
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.simulator import Simulator

#: No wait that ends takes this long, on any machine, s.
PATIENCE = 60.0


class Listener(Notes):
    """Keeps what is reported, and by which threads."""

    def __init__(self) -> None:
        super().__init__(Clock())
        self.threads: set[int] = set()

    def on_snapshot(self, snapshot: Any) -> None:
        self.threads.add(threading.get_ident())
        super().on_snapshot(snapshot)

    def on_event(self, event: Any) -> None:
        self.threads.add(threading.get_ident())
        super().on_event(event)


class Real:
    """A simulated drive at a port, a bus with its worker, and a driver."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator
        line = BusSettings(protocol='modbus_rtu', baud_rate=57600, response_timeout=1.0).line
        self.bus = Bus(open_link('modbus_rtu', simulator.port, line))
        self.notes = Listener()
        settings = DriveSettings(poll_rate=50.0, lost_after=10.0, setpoint_timeout=0.0)
        self.drive = Drive(self.bus, settings, self.notes)
        self.bus.start()
        self.drive.connect().result(PATIENCE)
        self.drive.activate()

    @property
    def far(self) -> SimulatedDrive:
        return self.simulator.drives[1]

    def enable(self) -> None:
        # under load the drive may be slower than the driver waits
        wait_until(lambda: self.drive.following or try_to(self.drive.enable))

    def polls(self, count: int) -> None:
        before = len(self.notes.snapshots)
        wait_until(lambda: len(self.notes.snapshots) >= before + count)


@pytest.fixture
def real(tmp_path: Path) -> Iterator[Real]:
    settings = ramps('sinus_g2', 0.2, 0.2)
    # by a name of its own: what is unplugged comes back as another device, and the number of the
    # one before may be that of another test by then
    link = str(tmp_path / 'port')
    with Simulator(link=link, baud=57600, boot_time=0.2, settings=settings) as simulator:
        real = Real(simulator)
        try:
            yield real
        finally:
            real.bus.close()
        assert not real.bus.alive
        assert simulator.failure is None


def wait_until(condition: Callable[[], object]) -> None:
    """Wait until a condition holds; fail when it does not in time."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline, 'it never came true'
        time.sleep(0.002)


def try_to(command: Callable[[], Any]) -> bool:
    """Give a command; return whether it was carried out."""
    try:
        command().result(PATIENCE)
    except DriveError:
        return False
    return True


@contextlib.contextmanager
def meanwhile(*actions: Callable[[], object]) -> Iterator[None]:
    """Have threads do something again and again."""
    ended = threading.Event()

    def work(action: Callable[[], object]) -> None:
        while not ended.is_set():
            action()
            time.sleep(0.0005)

    with ThreadPoolExecutor(len(actions)) as pool:
        futures = [pool.submit(work, action) for action in actions]
        try:
            yield
        finally:
            ended.set()
    for future in futures:
        future.result()


def test_a_run_and_all_is_reported_by_the_worker(real: Real) -> None:
    real.enable()
    with meanwhile(lambda: real.drive.set_setpoint(20.0)):
        wait_until(lambda: abs(real.far.motor.frequency - 20.0) < 0.2)
    wait_until(lambda: try_to(real.drive.stop))
    wait_until(lambda: not real.far.motor.driven)
    real.drive.disconnect(PATIENCE).result(PATIENCE)
    assert len(real.notes.threads) == 1
    assert threading.get_ident() not in real.notes.threads


def test_what_comes_in_wakes_a_worker_that_sleeps(real: Real) -> None:
    real.drive.disconnect(PATIENCE).result(PATIENCE)
    # nothing is due any more, so that only this can wake it
    for _ in range(20):
        time.sleep(0.01)
        called = threading.Event()
        real.bus.call(called.set)
        assert called.wait(PATIENCE)


def test_the_newest_of_the_set_points_of_many_threads_is_followed(real: Real) -> None:
    real.enable()
    numbers = itertools.count()

    def give() -> None:
        real.drive.set_setpoint(next(numbers) % 40)

    with meanwhile(give, give, give, give):
        real.polls(20)
    real.drive.set_setpoint(12.0)
    wait_until(lambda: abs(real.far.motor.frequency - 12.0) < 0.2)
    # none of the others has piled up behind it
    real.polls(3)
    assert real.far.memory.raw('status.frq_set') == 120
    assert real.drive.snapshot.setpoint == 12.0


def test_a_stop_ends_what_others_do_at_the_same_time(real: Real) -> None:
    def enable() -> None:
        try_to(real.drive.enable)

    for _ in range(3):
        with meanwhile(enable, enable, lambda: real.drive.set_setpoint(20.0)):
            wait_until(lambda: real.far.motor.driven)
        wait_until(lambda: try_to(real.drive.stop))
        # the set-points go on, and nothing turns
        with meanwhile(lambda: real.drive.set_setpoint(20.0)):
            wait_until(lambda: not real.far.motor.driven)
            real.polls(5)
            assert not real.drive.following and not real.far.motor.driven


def test_after_the_last_stop_no_thread_can_enable(real: Real) -> None:
    def enable() -> None:
        real.drive.activate()
        try_to(real.drive.enable)

    with meanwhile(enable, enable, lambda: real.drive.set_setpoint(20.0)):
        wait_until(lambda: real.far.motor.driven)
        real.drive.stop_for_good(PATIENCE).result(PATIENCE)
        wait_until(lambda: not real.far.motor.driven)
        real.polls(10)
        assert not real.drive.following and not real.far.motor.driven
    assert 'not active' in said(real.drive.enable().exception(PATIENCE))


def test_parameters_that_many_threads_change_at_once_are_all_changed(real: Real) -> None:
    wanted = {
        'control.accel': 7.0, 'control.retard': 8.0, 'control.run_dly': 2, 'control.dc_brk': 3.0,
    }
    real.drive.connect(parameters=True).result(PATIENCE)
    change = real.drive.parameters.change
    with ThreadPoolExecutor(len(wanted)) as pool:
        for future in list(pool.map(lambda key: change({key: wanted[key]}), wanted)):
            future.result(PATIENCE)
    assert {key: real.far.peek(key) for key in wanted} == wanted
    assert {key: real.drive.parameters.values[key] for key in wanted} == wanted


def test_the_end_of_the_bus_ends_all_that_wait(real: Real) -> None:
    real.simulator.inject('line-dead', 3600)
    waiting = [real.drive.measure('status.trq_act') for _ in range(20)]
    real.bus.close()
    later = real.drive.measure('status.trq_act')
    for future in (*waiting, later):
        with raises(Cause.ENDING):
            future.result(PATIENCE)
    assert not real.bus.alive


def test_a_port_that_was_unplugged_is_opened_again(real: Real) -> None:
    real.enable()
    real.simulator.inject('hangup', 1.0)
    wait_until(lambda: not real.drive.snapshot.connected)
    wait_until(lambda: real.drive.snapshot.connected)
    assert not real.drive.following
    real.enable()
