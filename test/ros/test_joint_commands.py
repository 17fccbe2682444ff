# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""`~/joint_command` of the bus node: all joints of a message get their set-points, or none."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import logging
import math
import threading
from types import SimpleNamespace
from typing import Any

from bench import A_WHILE, Bench, Client, holds_for, wait_until
from connections import needs
import pytest
from std_msgs.msg import Header

from nfo_sinus_driver.node.line.joint_commands import JointCommands, message_type

_TOPIC = '/nfo_sinus_bus/joint_command'
#: Left and right; on the right the motor is the mirror image, and the joint has a name of its own.
_DRIVES = """
nfo_sinus_bus: {ros__parameters: {drives: [left, right]}}
left: {ros__parameters: {address: 1, gear_ratio: 20.0, stop_with: [right]}}
right: {ros__parameters: {address: 2, gear_ratio: -20.0, joint_name: right_joint,
  stop_with: [left]}}
"""
_JOINTS = ['left', 'right_joint']
#: rad/s of the wheels, and what it is of the motors, rpm.
_SPEED = 600 * 2 * math.pi / 60 / 20
_RPM = 600
_TIMEOUT = 10.0

pytestmark = needs('own')
#: No wheel has the message: it is tested where ROS has control_msgs 5.10 or newer.
with_message = pytest.mark.skipif(message_type() is None, reason='no control_msgs/JointCommand')


class Sender:
    """Publishes commands, each with what differs from a good one."""

    def __init__(self, client: Client) -> None:
        self._node = client.node
        type_ = message_type()
        assert type_ is not None
        self._type: Any = type_
        self._publisher = client.node.create_publisher(type_, _TOPIC, 1)

    def send(self, old: float = 0.0, **fields: Any) -> None:
        """Publish one, made ``old`` s ago."""
        wait_until(self._publisher.get_subscription_count, 'the driver takes them')
        stamp = self._node.get_clock().now()
        made = type(stamp)(nanoseconds=stamp.nanoseconds - round(old * 1e9))
        given: dict[str, Any] = {
            'joint_names': _JOINTS, 'interface_name': 'velocity', 'values': [_SPEED, _SPEED / 2],
            'header': Header(stamp=made.to_msg()),
        }
        self._publisher.publish(self._type(**{**given, **fields}))

    @contextlib.contextmanager
    def sending(self, **fields: Any) -> Iterator[None]:
        """Publish over and over."""
        ended = threading.Event()

        def publish() -> None:
            while not ended.wait(0.05):
                self.send(**fields)

        thread = threading.Thread(target=publish)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()


def start(bench: Bench, *arguments: str) -> tuple[Any, Any, Sender, Client]:
    """Start two drives that are quick, and their driver."""
    simulator = bench.simulator(
        '--address', '1', '--address', '2', '--set', 'control.mode=Speed',
        '--set', 'control.accel=1', '--set', 'control.retard=1',
    )
    parameters = bench.folder / 'drives.yaml'
    parameters.write_text(_DRIVES)
    timeouts = [word for name in ('left', 'right')
                for word in ('-p', f'{name}:setpoint_timeout:={_TIMEOUT}')]
    driver = bench.driver('--params-file', str(parameters), *timeouts, *arguments)
    for name in ('/left', '/right'):
        bench.client(name).connected()
    every_drive = bench.client('/nfo_sinus_bus')
    return simulator, driver, Sender(every_drive), every_drive


def speeds(simulator: Any) -> tuple[float, float]:
    """Return how fast the motors turn, rpm."""
    return tuple(round(simulator.state(address)['speed']) for address in (1, 2))


def near(simulator: Any, left: float, right: float) -> bool:
    """Return whether they turn so fast."""
    found = speeds(simulator)
    return abs(found[0] - left) < 3 and abs(found[1] - right) < 3


@with_message
def test_both_wheels_follow_one_message_and_stop_as_one(bench: Bench) -> None:
    simulator, driver, sender, every_drive = start(bench)
    left = bench.client('/left')
    with sender.sending():
        wait_until(lambda: 'before all are enabled' in driver.text, 'it says what to call')
        assert 'all are enabled: call /left/enable, call /right/enable' in driver.text
        assert left.enable(True).success
        holds_for(A_WHILE, lambda: speeds(simulator) == (0, 0), 'one alone does not move')
        assert every_drive.call('enable_all').success
        wait_until(lambda: near(simulator, _RPM, -_RPM / 2), 'each has its own set-point')
        assert left.call('stop').success
        wait_until(lambda: speeds(simulator) == (0, 0), 'both stop')
        holds_for(A_WHILE, lambda: speeds(simulator) == (0, 0), 'no message moves either')
    assert every_drive.call('enable_all').success
    holds_for(A_WHILE, lambda: speeds(simulator) == (0, 0), 'one from before does neither')
    with sender.sending(values=[-_SPEED, _SPEED]):
        wait_until(lambda: near(simulator, -_RPM, -_RPM), 'a fresh one does')
    # one joint is a message, too; the other one keeps its set-point
    sender.send(joint_names=['left'], values=[0.0])
    wait_until(lambda: near(simulator, 0, -_RPM), 'the left one alone')


@with_message
@pytest.mark.parametrize(('why', 'wrong'), [
    ('there is no joint right on this line, which has left, right_joint',
     {'joint_names': ['left', 'right']}),
    ('a joint stands twice in left, left', {'joint_names': ['left', 'left']}),
    ('it has 2 joint_names, but 1 values', {'values': [0.0]}),
    ('it names no joint', {'joint_names': [], 'values': []}),
    ('the velocity of right_joint is nan', {'values': [0.0, math.nan]}),
    ('the velocity of right_joint is inf', {'values': [0.0, math.inf]}),
    ("its interface_name is 'position', not velocity", {'interface_name': 'position'}),
    (f'it was made {2 * _TIMEOUT:.1f} s ago', {'old': 2 * _TIMEOUT}),
    (f'its stamp is {2 * _TIMEOUT:.1f} s ahead', {'old': -2 * _TIMEOUT}),
])
def test_a_message_with_a_mistake_moves_none(bench: Bench, why: str, wrong: Any) -> None:
    simulator, driver, sender, every_drive = start(bench)
    assert every_drive.call('enable_all').success
    sender.send()
    wait_until(lambda: near(simulator, _RPM, -_RPM / 2), 'both turn')
    with sender.sending(**{'values': [0.0, 0.0], **wrong}):
        wait_until(lambda: why in driver.text, 'it is said')
        holds_for(A_WHILE, lambda: near(simulator, _RPM, -_RPM / 2), 'neither takes it')
    assert f'{_TOPIC} is ignored, for all joints: {why}' in driver.text
    assert driver.text.count('is ignored, for all joints') == 1


@with_message
def test_a_drive_that_follows_no_setpoints_keeps_the_others_from_theirs(bench: Bench) -> None:
    simulator, driver, sender, every_drive = start(bench, '-p', 'right:reference:=terminal')
    assert every_drive.call('enable_all').success
    with sender.sending():
        wait_until(lambda: 'for all joints: right_joint: ' in driver.text, 'it is said')
        holds_for(A_WHILE, lambda: speeds(simulator)[0] == 0, 'the left one does not move')


def test_without_the_message_there_is_no_such_topic(bench: Bench) -> None:
    _, _, client = bench.simulator(), bench.driver(), bench.client()
    client.connected()
    found = dict(client.node.get_subscriber_names_and_types_by_node('nfo_sinus_bus', '/'))
    assert (_TOPIC in found) == (message_type() is not None)


class Wheel:
    """A joint, with what it was given."""

    setpoint_timeout = 0.0
    how_to_enable = 'call it'

    def __init__(self, name: str, *, follows: bool) -> None:
        self.joint_name, self.follows = name, follows
        self.taken: list[float] = []

    def setpoint(self, velocity: float) -> float:
        return 2 * velocity

    def take(self, value: float, origin: object) -> None:
        self.taken.append(value)


@pytest.mark.parametrize(('values', 'taken'), [
    ((0.0, 0.0), [0.0]), ((-0.0, 5.0), [0.0]), ((5.0, 0.0), []), ((5.0, 5.0), []),
])
def test_a_joint_that_follows_takes_a_zero_whatever_the_others_do(
    values: tuple[float, float], taken: list[float]
) -> None:
    # without setpoint_timeout nothing else would end its last set-point
    wheels = Wheel('left', follows=True), Wheel('right', follows=False)
    give: list[Any] = []
    context: Any = SimpleNamespace(
        joints=wheels, subscribe=lambda node, topics: give.extend(topics.values())
    )
    now = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=10**9))
    node: Any = SimpleNamespace(
        get_logger=lambda: logging.getLogger('line'), get_clock=lambda: now,
        resolve_topic_name=lambda name: name,
    )
    JointCommands(node, context, object)
    ((_, on_message),) = give
    stamp = SimpleNamespace(sec=0, nanosec=0)
    on_message(SimpleNamespace(
        joint_names=['left', 'right'], interface_name='velocity', values=values,
        header=SimpleNamespace(stamp=stamp),
    ), None)
    assert wheels[0].taken == taken
    assert not wheels[1].taken
