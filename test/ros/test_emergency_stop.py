# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The emergency stop of docs/control.md: a relay that opens the RUN inputs of two drives."""

from __future__ import annotations

from bench import A_WHILE, Bench, Client, holds_for, wait_until
from connections import needs

pytestmark = needs('direct')

_TWO = """
nfo_sinus_bus: {ros__parameters: {drives: [left, right]}}
left: {ros__parameters: {address: 1}}
right: {ros__parameters: {address: 2}}
"""
_DRIVES = (1, 2)


class Machine:
    """Two drives that follow set-points, and their relay."""

    def __init__(self, bench: Bench) -> None:
        addresses = [word for address in _DRIVES for word in ('--address', str(address))]
        self.simulator = bench.simulator(*addresses, *bench.drives.ramps(1))
        parameters = bench.folder / 'two.yaml'
        parameters.write_text(_TWO)
        bench.driver('--params-file', str(parameters))
        self.drives: list[Client] = [bench.client(n).connected() for n in ('/left', '/right')]
        self.bus = bench.client('/nfo_sinus_bus')
        self.without_run_input = bench.drives.without_run_input

    def relay(self, closed: bool) -> None:
        """Close or open the relay of the emergency stop."""
        for address in _DRIVES:
            self.simulator.inject('run', closed, address=address)

    @property
    def turning(self) -> list[bool]:
        """Which motors turn."""
        return [self.simulator.state(address)['turning'] for address in _DRIVES]

    def start(self) -> None:
        """Enable both, and see them turn as commanded."""
        answer = self.bus.call('enable_all')
        assert answer.success, answer.message
        for drive in self.drives:
            drive.wait_for('status', lambda s: s.enabled and abs(s.actual) > 19, 'it turns')

    def wait_until_still(self) -> None:
        wait_until(lambda: self.turning == [False, False], 'both stand')


def test_emergency_stop_and_arming_again(bench: Bench) -> None:
    machine = Machine(bench)
    left, right = machine.drives
    with left.setpoints(20.0), right.setpoints(-20.0):
        machine.start()
        machine.relay(closed=False)
        for drive in machine.drives:
            drive.wait_for('status', lambda status: not status.enabled, 'it is disabled')
        machine.wait_until_still()
        # while it is open nothing can be enabled, and the answer says why
        for drive in machine.drives:
            refused = drive.enable()
            assert not refused.success
            assert machine.without_run_input in refused.message
        machine.relay(closed=True)
        holds_for(A_WHILE, lambda: not any(machine.turning), 'set-points alone move nothing')
        machine.start()


def test_one_drive_that_stops_does_not_stop_the_other(bench: Bench) -> None:
    machine = Machine(bench)
    left, right = machine.drives
    with left.setpoints(20.0), right.setpoints(-20.0):
        machine.start()
        machine.simulator.inject('fault', bench.drives.overload.code, address=1)
        left.wait_for('status', lambda status: not status.enabled, 'the left one is disabled')
        wait_until(lambda: machine.turning == [False, True], 'the right one turns on')
        assert machine.bus.call('stop_all').success
        machine.wait_until_still()
