# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Thirty-two drives on one line: they do what one does, and cost no more than the line."""

from __future__ import annotations

from pathlib import Path
import signal
import sys
import time

from bench import A_WHILE, PATIENCE, Bench, holds_for, wait_until
from connections import needs
from diagnostic_msgs.msg import DiagnosticArray
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from std_msgs.msg import Float32

#: By address.
NAMES = {address: f'conveyor_{address:02}' for address in range(1, 33)}
_COUNTING = str(Path(__file__).with_name('counting_driver.py'))
#: So few that neither the line nor the processors are what is tested.
_RARE = (
    '-p', 'poll_rate:=2.0', '-p', 'telemetry_rate:=0.0', '-p', 'setpoint_timeout:=0.0',
)
#: For how long an idle driver is watched, s, and how often it may be woken meanwhile.
_WATCHED = 10.0
_WAKE_UPS = 20
_SETPOINTS = 100
#: All parameters of all drives are read first, which takes as long as the machine makes it, s.
_START = 6 * PATIENCE
#: A read, and SCMD = Stop, by Modbus.
_READ = '03'
_STOP = '0602980000'


class Conveyor:
    """A driver with all these drives, and a client that watches and commands them."""

    def __init__(self, bench: Bench) -> None:
        self.simulator = bench.simulator(
            *bench.drives.ramps(1), '--boot-time', '0',
            *(f'--address={address}' for address in NAMES),
        )
        parameters = bench.folder / 'conveyor.yaml'
        parameters.write_text('\n'.join((
            f'nfo_sinus_bus: {{ros__parameters: {{drives: [{", ".join(NAMES.values())}]}}}}',
            *(f'{name}: {{ros__parameters: {{address: {at}}}}}' for at, name in NAMES.items()),
        )))
        self._wakes = bench.folder / 'wakes'
        counting = (sys.executable, _COUNTING, str(self._wakes))
        self.driver = bench.driver('--params-file', str(parameters), *_RARE, through=counting)
        self.client = bench.client('/nfo_sinus_bus')
        self.states: dict[str, str] = {}
        self.status: dict[int, DriveStatus] = {}
        node = self.client.node
        node.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 100)
        for address, name in NAMES.items():
            node.create_subscription(
                DriveStatus,
                f'/{name}/status',
                lambda status, address=address: self.status.update({address: status}),
                10,
            )
        self._setpoints = [node.create_publisher(Float32, f'/{name}/setpoint', 1)
                           for name in NAMES.values()]
        wait_until(
            lambda: list(self.states.values()).count('active') == len(NAMES),
            'all are active', timeout=_START,
        )

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            for pair in status.values:
                if pair.key == 'lifecycle state':
                    self.states[status.name] = pair.value

    def who_do_not(self, *others: int) -> dict[int, DriveStatus]:
        """Return the drives, but some, that do not follow their set-point of 20 Hz."""
        return {
            address: status
            for address, status in self.status.items()
            if address not in others
            and not (status.enabled and abs(status.actual - 20.0) < 1.0)
        }

    def run(self) -> None:
        """Enable all, and have them turn."""
        answer = self.client.call('enable_all')
        assert answer.success, answer.message
        assert answer.message.count(': enabled') == len(NAMES)
        wait_until(
            lambda: all(publisher.get_subscription_count() for publisher in self._setpoints),
            'each has a subscriber', period=0.1,
        )
        for publisher in self._setpoints:
            publisher.publish(Float32(data=20.0))
        wait_until(lambda: not self.who_do_not(), 'all follow', period=0.1)

    def sleeps(self) -> None:
        """See that nothing wakes the driver while no request comes, and that it wakes then."""
        counts = [0]

        def settled() -> bool:
            counts.append(self._wakes.stat().st_size)
            return counts[-1] == counts[-2]

        # what came by the start is over
        wait_until(settled, 'nothing wakes it for a second', period=1.0)
        time.sleep(_WATCHED)
        woken = self._wakes.stat().st_size - counts[-1]
        assert woken < _WAKE_UPS
        assert self.client.call(f'/{NAMES[1]}/stop').success
        assert self._wakes.stat().st_size > counts[-1] + woken

    def takes_setpoints_in_its_sleep(self) -> None:
        """See that a set-point wakes who takes it, and no executor."""
        before = self._wakes.stat().st_size
        for number in range(_SETPOINTS):
            self._setpoints[0].publish(Float32(data=20.0 + 0.5 * number / _SETPOINTS))
            # so that they are taken one by one
            time.sleep(0.02)
        wait_until(lambda: self.status[1].actual > 20.3, 'the last is followed', period=0.1)
        assert 0 < self._wakes.stat().st_size - before <= _SETPOINTS + _WAKE_UPS
        self._setpoints[0].publish(Float32(data=20.0))
        wait_until(lambda: self.status[1].actual < 20.1, 'it goes back', period=0.1)

    def others_follow(self, *others: int) -> None:
        """See that all drives but some follow for a while."""

        def check() -> bool:
            assert not self.who_do_not(*others), self.who_do_not(*others)
            return True

        holds_for(A_WHILE, check, 'the others follow')

    def turning(self) -> set[int]:
        """Return whose motors turn."""
        return {at for at in NAMES if self.simulator.state(at)['turning']}


@pytest.mark.slow
@needs('rtu')
@pytest.mark.timeout(2 * _START)
def test_a_conveyor_from_its_start_to_its_end(bench: Bench) -> None:
    # one start for all of it, for that is what takes long
    conveyor = Conveyor(bench)
    conveyor.sleeps()
    conveyor.run()
    conveyor.takes_setpoints_in_its_sleep()
    faulty, unplugged = 7, 23
    conveyor.simulator.inject('fault', 5, address=faulty)
    wait_until(lambda: not conveyor.status[faulty].enabled, 'its fault has stopped it')
    conveyor.others_follow(faulty)
    conveyor.simulator.inject('silence', 3600.0, address=unplugged)
    wait_until(lambda: not conveyor.status[unplugged].connected, 'it is lost')
    conveyor.others_follow(faulty, unplugged)
    answer = conveyor.client.call('stop_all')
    assert not answer.success
    assert f'{NAMES[unplugged]}: the stop is NOT confirmed' in answer.message
    # a slow machine may confirm some others after the two seconds of one call
    assert answer.message.count(': stopp') + answer.message.count(': the stop is NOT') == len(NAMES)
    wait_until(lambda: conveyor.turning() <= {unplugged}, 'all that hear it stand', period=0.5)

    conveyor.simulator.inject('silence', 0.0, address=unplugged)
    wait_until(lambda: not conveyor.turning(), 'it is stopped as soon as it answers', period=0.5)
    wait_until(lambda: conveyor.status[unplugged].connected, 'it is back')
    assert conveyor.client.call(f'/{NAMES[faulty]}/fault_ack').success
    conveyor.run()
    before = len(bench.requests())
    conveyor.driver.signal(signal.SIGTERM)
    assert conveyor.driver.wait() == 0, conveyor.driver.text
    assert not conveyor.turning()
    requests = bench.requests()[before:]
    stops = {address: requests.index(f'{address:02x}{_STOP}') for address in NAMES}
    meanwhile = requests[min(stops.values()) : max(stops.values())]
    asked = [request for request in meanwhile if request[2:4] == _READ]
    assert not asked, 'a drive was asked before all have a stop'
