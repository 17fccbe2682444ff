# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Set-points do not wait for the executor, and yet come to the node like any other message."""

from __future__ import annotations

from collections.abc import Iterator
import time

from bench import FULL_RATE, Bench, wait_until
import pytest
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float32, Float64

from nfo_sinus_driver.node.drive.graph_watch import PERIOD
from nfo_sinus_driver.node.drive.setpoint_subscriber import SetpointSubscriber


@pytest.fixture
def node(domain: int) -> Iterator[Node]:
    """A node in the default context, as the driver has it."""
    rclpy.init(domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = Node('test_subscriber')
    yield node
    node.destroy_node()
    rclpy.shutdown()


def test_a_remapped_topic_in_a_namespace_belongs_to_the_drive_node(bench: Bench) -> None:
    drive = bench.simulator(paced=True)
    bench.driver(*FULL_RATE, '-r', '__ns:=/plant', '-r', '~/setpoint:=/hand/speed')
    client = bench.client('/plant/nfo_sinus').connected()

    def owners() -> list[tuple[str, str]]:
        found = client.node.get_subscriptions_info_by_topic('/hand/speed')
        return [(info.node_namespace, info.node_name) for info in found]

    wait_until(lambda: owners() == [('/plant', 'nfo_sinus')], 'it is said whose topic it is')
    assert client.enable().success
    publisher = client.node.create_publisher(Float32, '/hand/speed', 1)

    def arrives() -> bool:
        publisher.publish(Float32(data=12.0))
        return drive.state()['frequency'] == pytest.approx(12.0, abs=0.3)

    wait_until(arrives, 'the motor follows it', period=0.05)


def test_a_callback_that_raises_keeps_no_later_message_out(
    node: Node, caplog: pytest.LogCaptureFixture
) -> None:
    heard = {'/one': 0, '/two': 0}

    def raises(topic: str) -> None:
        heard[topic] += 1
        raise ValueError('oops')

    subscriber = SetpointSubscriber()
    publishers = {topic: node.create_publisher(Float32, topic, 1) for topic in heard}
    for topic in heard:
        subscriber.subscribe(node, Float32, topic, lambda _, __, topic=topic: raises(topic))
    subscriber.start()
    for topic, publisher in publishers.items():

        def twice(topic: str = topic, publisher: rclpy.publisher.Publisher = publisher) -> bool:
            publisher.publish(Float32())
            return heard[topic] >= 2

        wait_until(twice, f'{topic} is heard twice')
    assert subscriber.alive
    assert 'oops' in caplog.text
    subscriber.close()
    assert not subscriber.alive


def test_it_ends_without_a_message(node: Node) -> None:
    subscriber = SetpointSubscriber()
    subscriber.subscribe(node, Float32, '/one', lambda _, __: None)
    subscriber.start()
    assert subscriber.alive
    subscriber.close()
    assert not subscriber.alive


def test_who_publishes_another_type_is_warned_of_once_with_what_to_type(
    bench: Bench, node: Node
) -> None:
    bench.simulator(paced=True)
    driver = bench.driver('-r', '__ns:=/plant', '-r', '~/setpoint:=/hand/speed')
    bench.client('/plant/nfo_sinus').connected()
    wrong = {
        '/hand/speed': (Float64, 'std_msgs/msg/Float32', '{data: 0.0}'),
        '/plant/nfo_sinus/setpoint_stamped': (
            Float32, 'nfo_sinus_msgs/msg/Setpoint', '{value: 0.0, unit: 0}'
        ),
        '/plant/nfo_sinus/joint_command': (
            Float32, 'sensor_msgs/msg/JointState', '{name: [joint], velocity: [0.0]}'
        ),
        '/plant/nfo_sinus_bus/setpoint_all': (Float64, 'std_msgs/msg/Float32', '{data: 0.0}'),
    }
    publishers = [node.create_publisher(type_, topic, 1) for topic, (type_, _, _) in wrong.items()]
    warnings = [
        f'/test_subscriber publishes {topic} as std_msgs/msg/{type_.__name__}, which never arrives '
        f'here: publish it as {wanted}, such as by ros2 topic pub -r 10 {topic} {wanted} '
        f"'{written}'"
        for topic, (type_, wanted, written) in wrong.items()
    ]
    for warning in warnings:
        wait_until(lambda warning=warning: warning in driver.text, warning)
    # it looks again, and says nothing
    time.sleep(2 * PERIOD)
    assert all(driver.text.count(warning) == 1 for warning in warnings)
    # one that begins anew is another one
    node.destroy_publisher(publishers[0])
    node.create_publisher(Float64, '/hand/speed', 1)
    wait_until(lambda: driver.text.count(warnings[0]) == 2, 'it is warned of again')


def test_another_node_of_its_name_is_warned_of(bench: Bench, node: Node) -> None:
    bench.simulator(paced=True)
    driver = bench.driver()
    bench.client().connected()
    # it looks, and says nothing
    time.sleep(2 * PERIOD)
    assert 'another node is called' not in driver.text
    namesake = Node('nfo_sinus')
    wait_until(lambda: 'another node is called /nfo_sinus, too' in driver.text, 'it is warned of')
    namesake.destroy_node()


@pytest.mark.parametrize('other', ['/nfo_sinus_bus/setpoint_all', '/nfo_sinus/setpoint'])
def test_two_sources_at_once_are_warned_of_by_name(bench: Bench, node: Node, other: str) -> None:
    bench.simulator(*bench.drives.ramps(1))
    driver = bench.driver()
    client = bench.client().connected()
    publisher = node.create_publisher(Float32, other, 1)
    words = 'different set-points come from two sources at once'
    assert client.enable().success
    with client.setpoints(20.0):
        client.wait_for(
            'status', lambda status: status.enabled and status.setpoint == 20.0, 'it follows'
        )
        # that two agree is no harm, nor one that is heard now and then
        for value in (20.0, 20.0, 20.0, 10.0):
            publisher.publish(Float32(data=value))
            time.sleep(0.1)
        assert words not in driver.text

        def warned() -> bool:
            publisher.publish(Float32(data=-20.0))
            return words in driver.text

        wait_until(warned, 'they are warned of', period=0.05)
    (line,) = [line for line in driver.text.splitlines() if words in line]
    mine, theirs = client.node.get_fully_qualified_name(), '/test_subscriber'
    if other == '/nfo_sinus/setpoint':
        both = ' and '.join(sorted((mine, theirs)))
        assert f'/nfo_sinus/setpoint (published by {both})' in line
    else:
        # the client of the bench has a publisher of its own alone
        assert f'/nfo_sinus/setpoint (published by {mine})' in line
        assert f'{other} (published by {theirs})' in line
