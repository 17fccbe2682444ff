# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``stop_with``: the drives that a drive names stop when it is stopped, on whichever line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import re
import signal
import time
from types import SimpleNamespace
from typing import NamedTuple

from bench import A_WHILE, Bench, Client, Process, holds_for, wait_until
from connections import needs
from nfo_sinus_msgs.msg import DriveStatus
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from nfo_sinus_driver.node.drive.other_lines import OtherLines
from nfo_sinus_driver.simulator.control import Client as Simulated

_TWO = """
/**/nfo_sinus_bus: {ros__parameters: {drives: [infeed, outfeed]}}
/**/infeed: {ros__parameters: {setpoint_timeout: 0.0, stop_with: [outfeed]}}
/**/outfeed: {ros__parameters: {address: 2, setpoint_timeout: 0.0, stop_with: [infeed]}}
"""
#: SCMD = Stop, by Modbus.
_STOP = '0602980000'
#: Within what time the drive of another line gets its stop, s: some 10 ms on a machine at rest.
_SOON = 0.5
#: What is said of a drive of another line that is not there, and of one that comes then.
_MISSED = 'does not stop with it'
_FOUND = 'is there now: it stops with this drive'
#: A drive that is never there. A driver says last that it misses this one, so that by then it has
#: looked for all: of a drive that is there from the beginning it says nothing.
_NOBODY = '/vanished/drive'


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
        lambda status: status.stop_reason == DriveStatus.REASON_STOP_WITH and not status.enabled
        and status.stop_text.startswith('it stops with /line1/infeed: fault 5 Overload'),
        'it stops with the other',
    )
    # a name that no drive has is refused, with those that there are
    answer = infeed.set_parameters(stop_with=['outfeed', 'outfed'])
    assert not answer.successful
    assert "no drive 'outfed' on this line: choose of infeed, outfeed" in answer.reason
    assert answer.reason.endswith('did you mean outfeed?')


@needs('own')
def test_full_names_of_its_own_line_are_those_of_the_line_and_its_own_is_none(
    bench: Bench
) -> None:
    bench.simulator('--address', '1', '--address', '2')
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(
        _TWO.replace('stop_with: [outfeed]', 'stop_with: [/line1/infeed, infeed, /line1/outfeed]')
    )
    driver = bench.driver('-r', '__ns:=/line1', '--params-file', str(parameters))
    infeed = bench.client('/line1/infeed').connected()
    outfeed = bench.client('/line1/outfeed').connected()
    outfeed.enable()
    for _ in range(5):
        infeed.enable()
        assert infeed.call('stop').success
    infeed.enable()
    infeed.wait_for('status', lambda status: status.enabled, 'it is enabled')
    holds_for(A_WHILE, lambda: infeed.newest('status').enabled, 'its own stop does not stop it')
    outfeed.wait_for(
        'status',
        lambda status: status.stop_reason == DriveStatus.REASON_STOP_WITH,
        'the other stops',
    )
    assert 'stop called by /line1/infeed' not in driver.text


def test_a_call_that_is_never_answered_is_not_kept_for_ever() -> None:
    forgotten: list[Future] = []
    client = SimpleNamespace(
        call_async=lambda request: Future(),
        service_is_ready=lambda: True,
        remove_pending_request=forgotten.append,
    )
    node = SimpleNamespace(
        get_logger=lambda: None,
        resolve_service_name=lambda name: name,
        create_client=lambda *_, **__: client,
    )
    queue = SimpleNamespace(put_first=lambda do: do(), put_every=lambda period, do: None)
    others = OtherLines(node, queue, lambda: ['/line2/right'], lambda: True)
    for _ in range(10):
        others.stop()
    assert len(others._calls) == 1 and len(forgotten) == 9


class Line(NamedTuple):
    """A line of its own: a simulated drive, its driver and a client."""

    bench: Bench
    simulator: Simulated
    driver: Process
    client: Client

    def turn(self) -> None:
        """Have the motor turn."""
        assert self.client.connected().enable().success
        self.client.publish(10.0)
        wait_until(lambda: self.simulator.state()['frequency'] > 9, 'it turns')
        wait_until_found(self.driver)

    def stops_since(self, moment: float) -> list[float]:
        """Return when its drive got its stop, s."""
        return [
            frame['first']
            for frame in self.bench.frames()
            if frame['first'] > moment and frame['hex'][2:].startswith(_STOP)
        ]


def wait_until_found(driver: Process) -> None:
    """Wait until a driver that enables has found the drives of other lines, all but one."""

    def found() -> bool:
        last = dict(re.findall(rf'(\S+) ({_MISSED}|{_FOUND})', driver.text))
        return {name for name, what in last.items() if what == _MISSED} == {_NOBODY}

    wait_until(found, 'it found them')


@pytest.fixture
def lines(bench: Bench) -> Iterator[tuple[Line, Line]]:
    """Two lines whose drives name each other, ``/drive`` and ``/line2/drive``."""
    folder = bench.folder / 'second'
    folder.mkdir()
    with Bench(bench.domain, folder, bench.connection) as second:
        yield _line(bench, '', 'line2/drive'), _line(second, '/line2', '/drive')


def _line(bench: Bench, namespace: str, other: str) -> Line:
    place = ('-r', f'__ns:={namespace or "/"}', '-r', '__node:=drive')
    settings = ('-p', 'setpoint_timeout:=0.0', '-p', f'stop_with:=[{other}, {_NOBODY}]')
    return Line(
        bench,
        bench.simulator(*bench.drives.ramps(1)),
        bench.driver(*place, *settings),
        bench.client(f'{namespace}/drive'),
    )


_STOPS: dict[str, Callable[[Line], object]] = {
    'stop': lambda line: line.client.call('stop'),
    'fault': lambda line: line.simulator.inject('fault', 5),
    'lost line': lambda line: line.simulator.inject('hangup', 60.0),
    'end of the driver': lambda line: line.driver.signal(signal.SIGINT),
}


@needs('own')
@pytest.mark.parametrize('stop', _STOPS)
def test_whatever_stops_a_drive_stops_the_one_of_another_line(
    lines: tuple[Line, Line], stop: str
) -> None:
    first, second = lines
    for line in lines:
        line.turn()
    begun = time.monotonic()
    _STOPS[stop](first)
    other = wait_until(lambda: second.stops_since(begun), 'the other gets its stop')
    own = [begun]
    if stop != 'lost line':
        own = wait_until(lambda: first.stops_since(begun), 'the first gets its stop')
    assert other[0] - own[0] < _SOON
    second.client.wait_for(
        'status', lambda status: status.stop_reason == DriveStatus.REASON_STOP, 'it says why'
    )
    assert '/line2/drive/stop called by ' in second.client.newest('status').stop_text
    wait_until(lambda: second.simulator.state()['frequency'] == 0, 'it stands')


@needs('own')
def test_two_that_name_each_other_stop_once_and_can_be_enabled_again(
    lines: tuple[Line, Line]
) -> None:
    first, second = lines
    for line in lines:
        line.turn()
    first.simulator.inject('fault', 5)
    second.client.wait_for('status', lambda status: not status.enabled, 'the other stops')
    assert second.client.newest('status').stop_text.endswith('/line2/drive/stop called by /drive')
    wait_until(lambda: '/drive stops with it: ' in second.driver.text, 'and has it stopped')
    assert first.client.call('fault_ack').success
    for line in lines:
        line.turn()
    holds_for(A_WHILE, lambda: all(line.client.newest('status').enabled for line in lines), 'runs')


@needs('own')
def test_what_does_not_stop_with_it_is_said_and_keeps_no_stop(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver('-p', f'stop_with:=[{_NOBODY}, /deaf/drive, /refusing/drive]')
    client = bench.client().connected()
    client.node.create_service(Trigger, '/refusing/drive/stop', _refuse)
    with deaf(bench.domain, '/deaf/drive/stop'):
        assert client.enable().success
        warned = (
            f'{_NOBODY} does not stop with it: nothing offers {_NOBODY}/stop; start its '
            'driver, or correct stop_with'
        )
        wait_until(lambda: warned in driver.text, 'a warning while it is enabled')
        wait_until_found(driver)
        assert client.call('stop').success
        for said in (
            f'{_NOBODY} does NOT stop with it: nothing offers {_NOBODY}/stop; use its',
            '/refusing/drive does NOT stop with it: it cannot; use its enable input',
            '/deaf/drive does NOT stop with it: no answer of /deaf/drive/stop in 3 s; use its',
        ):
            wait_until(lambda said=said: said in driver.text, said)
    assert driver.text.count(warned) == 1
    # and what cannot be a name is refused
    answer = client.set_parameters(stop_with=['/line 2/right'])
    assert not answer.successful
    assert "stop_with: '/line 2/right' cannot be the name of a drive" in answer.reason
    # without them nothing is called any more
    assert client.set_parameters(stop_with=['']).successful
    before = driver.text.count('does NOT stop with it')
    assert client.enable().success and client.call('stop').success
    holds_for(A_WHILE, lambda: driver.text.count('does NOT stop with it') == before, 'silence')


def _refuse(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.message = 'it cannot'
    return response


@contextlib.contextmanager
def deaf(domain: int, service: str) -> Iterator[None]:
    """Offer a service that never answers."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node('deaf', context=context)
    node.create_service(Trigger, service, _refuse)
    try:
        yield
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)
