# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What is published of the calls of services, by the setting `introspection` of the bus node."""

from __future__ import annotations

from pathlib import Path
import sys
from typing import Any

from bench import Bench, Client, Process, wait_until
from connections import needs
from nfo_sinus_msgs.srv import GetErrorLog
import pytest
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger

from nfo_sinus_driver.demo.recorded import drives_in, read
from nfo_sinus_driver.node.bags import bags

_NODES = ('/nfo_sinus_bus', '/nfo_sinus')
_COMMANDS = {
    *(f'/nfo_sinus/{name}' for name in ('enable', 'stop', 'quick_stop', 'rapid_stop', 'fault_ack')),
    *(f'/nfo_sinus_bus/{name}' for name in ('stop_all', 'enable_all', 'disable_all')),
}
_EVENT = '/_service_event'

pytestmark = needs('own')


def start(bench: Bench, *arguments: str) -> Client:
    """Start a drive and its driver; return its client."""
    bench.simulator()
    bench.driver(*arguments)
    return bench.client().connected()


def _names(found: list[tuple[str, list[str]]]) -> set[str]:
    # an action is made of services that rclpy does not let publish their calls
    return {name for name, _ in found if '/_action/' not in name}


def published(client: Client) -> set[str]:
    """Return the services whose calls are published."""
    topics = set()
    for node in _NODES:
        topics |= _names(client.node.get_publisher_names_and_types_by_node(node[1:], '/'))
    return {topic.removesuffix(_EVENT) for topic in topics if topic.endswith(_EVENT)}


def services(client: Client) -> set[str]:
    """Return all services of the driver."""
    found = set()
    for node in _NODES:
        found |= _names(client.node.get_service_names_and_types_by_node(node[1:], '/'))
    return found


def made_by_rcl(client: Client) -> set[str]:
    """Return the services that rclpy does not let publish their calls."""
    return {
        name for name in services(client)
        if name.rpartition('/')[2] in (
            'change_state', 'get_state', 'get_available_states', 'get_available_transitions',
            'get_transition_graph', 'get_type_description',
        )
    }


def events_of(client: Client, name: str, type_: type) -> list[Any]:
    """Return where the events of a service will be; its publisher is known by then."""
    topic = f'/nfo_sinus/{name}{_EVENT}'
    client.listen(name, type_.Event, topic, 10)
    wait_until(lambda: client.node.count_publishers(topic), 'its publisher is found')
    return client.messages[name]


@pytest.mark.parametrize('given', [(), ('-p', 'introspection:=off')])
def test_off_publishes_the_calls_of_commands_alone(bench: Bench, given: tuple[str, ...]) -> None:
    client = start(bench, *given)
    wait_until(lambda: published(client) == _COMMANDS, 'those of commands, and no others')


@pytest.mark.parametrize('extent', ['metadata', 'contents'])
def test_calls_of_all_services_are_published(bench: Bench, extent: str) -> None:
    client = start(bench, '-p', f'introspection:={extent}')
    wait_until(
        lambda: published(client) == services(client) - made_by_rcl(client) > _COMMANDS,
        'all of both nodes',
    )
    (offered,) = client.node.get_publishers_info_by_topic(f'/nfo_sinus/get_error_log{_EVENT}')
    assert offered.qos_profile.reliability == ReliabilityPolicy.RELIABLE
    assert offered.qos_profile.durability == DurabilityPolicy.VOLATILE
    got, logs, enables = (
        events_of(client, name, type_)
        for name, type_ in (
            ('get_parameters', GetParameters), ('get_error_log', GetErrorLog), ('enable', SetBool)
        )
    )
    begun = client.node.get_clock().now().nanoseconds
    client.call('get_parameters', GetParameters, names=['address'])
    client.call('get_error_log', GetErrorLog, max_entries=7)
    client.call('enable', SetBool, data=False)
    for events in (got, logs, enables):
        wait_until(lambda e=events: len(e) >= 2, 'its call and its answer are published')
        # a client may call again where no answer came
        called, answered = events[:2]
        assert called.info.event_type == called.info.REQUEST_RECEIVED
        assert answered.info.event_type == answered.info.RESPONSE_SENT
        stamps = [event.info.stamp.sec * 10**9 + event.info.stamp.nanosec for event in events[:2]]
        assert begun <= stamps[0] <= stamps[1]
        assert list(called.info.client_gid) == list(answered.info.client_gid)
        assert any(called.info.client_gid), 'who called'
        assert called.info.sequence_number == answered.info.sequence_number
    whole = extent == 'contents'
    assert [len(logs[0].request), len(logs[1].response)] == [whole, whole]
    if whole:
        assert logs[0].request[0].max_entries == 7
        assert got[1].response[0].values[0].integer_value == 1
    # a command is a command
    assert [enables[0].request[0].data, len(enables[1].response)] == [False, 1]


def test_what_it_may_be_is_said(bench: Bench) -> None:
    bench.simulator()
    driver = bench.driver('-p', 'introspection:=on', fails=True)
    assert driver.wait() == 2
    assert 'introspection is True (a boolean): write a text in quotes' in driver.text
    driver = bench.driver('-p', 'introspection:=all', fails=True)
    assert driver.wait() == 2
    assert "introspection 'all': choose one of 'off', 'metadata', 'contents'" in driver.text


@pytest.mark.skipif(not bags.is_installed(), reason='no library for bags')
def test_a_recording_has_them_and_can_be_read(bench: Bench, tmp_path: Path) -> None:
    client = start(bench, '-p', 'introspection:=contents')
    command = [sys.executable, '-m', 'nfo_sinus_driver.demo.record', '--output', str(tmp_path)]
    recorder = Process(command, bench._environment, tmp_path / 'log')
    bench.callback(recorder.end)
    topic = f'/nfo_sinus/set_parameters{_EVENT}'
    wait_until(lambda: client.node.count_subscribers(topic), 'the recorder has found it')
    client.call('set_parameters', SetParameters, parameters=[
        Parameter('setpoint_timeout', value=3.5).to_parameter_msg()
    ])
    client.call('get_error_log', GetErrorLog)
    client.call('stop', Trigger)
    recorder.end()
    bag = tmp_path / 'ride'
    found = {topic: message for topic, _, message in bags.read(bag, lambda t: t.endswith(_EVENT))}
    assert f'/nfo_sinus/get_error_log{_EVENT}' in found
    kept = [m for t, _, m in bags.read(bag, lambda t: t == topic) if len(m.request)]
    assert kept[0].request[0].parameters[0].name == 'setpoint_timeout'
    assert kept[0].request[0].parameters[0].value.double_value == 3.5
    # and what is made of a bag goes on
    assert [call.name for run in read(bag, drives_in(bag)) for call in run.calls] == ['stop']
