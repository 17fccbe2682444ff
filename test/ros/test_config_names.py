# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Every topic, field and service that a file of config/ names is one of the driver at work."""

from __future__ import annotations

from collections.abc import Iterator
import importlib
import json
from pathlib import Path
import re
from typing import Any
from xml.etree import ElementTree

from bench import Bench, Client, wait_until
from connections import Connection
from nfo_sinus_msgs.msg import DriveStatus
import pytest
from support.aggregator import Aggregator
from support.places import MSG_DEFS
from support.sros2_policy import Policy, allowed
import yaml

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.node.line.joint_commands import message_type

CONFIG = Path(__file__).resolve().parents[2] / 'config'
_DRIVER = '/nfo_sinus/driver'
_COMMANDER = '/nfo_sinus/commander'
_ANYBODY = '/'
_NODES = ('nfo_sinus_bus', 'nfo_sinus')

#: What a message is published on, and a service offered as, by the name of its type.
Names = dict[str, str]


@pytest.fixture(scope='module')
def client(tmp_path_factory: pytest.TempPathFactory, connection: Connection) -> Iterator[Client]:
    """A client of a driver and its drive, which no client commands."""
    with (
        own_domain() as domain,
        Bench(domain, tmp_path_factory.mktemp('names'), connection) as bench,
    ):
        bench.simulator()
        bench.driver()
        client = bench.client().connected()
        client.wait_for('telemetry', lambda m: True, 'the node is active')
        wait_until(lambda: len(_statuses(client)) > 1, 'diagnostics of line and drive')
        yield client


def _of_nodes(client: Client, what: str) -> Names:
    """What the driver's nodes have of one kind, but for the parts that an action is made of."""
    found: Names = {}
    for node in _NODES:
        for name, types in getattr(client.node, f'get_{what}_names_and_types_by_node')(node, '/'):
            if '/_action/' not in name:
                (found[name],) = types
    return found


@pytest.fixture(scope='module')
def topics(client: Client) -> Names:
    """The topics of the driver."""
    return {**_of_nodes(client, 'publisher'), **_of_nodes(client, 'subscriber')}


@pytest.fixture(scope='module')
def services(client: Client) -> Names:
    """The services of the driver."""
    return _of_nodes(client, 'service')


def _class_of(name: str) -> Any:
    """The class of a message or a service, by the name of its type."""
    package, kind, type_ = name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), type_)


def _require_field(topic: str, path: list[str], topics: Names) -> None:
    """Fail unless a topic has a field by that path."""
    assert topic in topics
    type_ = topics[topic]
    for name in path:
        fields = _class_of(type_).get_fields_and_field_types()
        assert name in fields, f'{topic}: {type_} has no {name}'
        type_ = fields[name]
        if '/' in type_ and '/msg/' not in type_:
            type_ = type_.replace('/', '/msg/')
    assert '/' not in type_, f'{topic} {path}: {type_} is a message, and no value'


# --- Foxglove, PlotJuggler ------------------------------------------------------------------------


def _panels(kind: str) -> dict[str, dict[str, Any]]:
    panels = json.loads((CONFIG / 'foxglove.json').read_text())['configById']
    found = {name: panel for name, panel in panels.items() if name.startswith(f'{kind}!')}
    assert found, kind
    return found


def test_foxglove_shows_fields_that_exist(topics: Names) -> None:
    drawn = [*_panels('Plot').values(), *_panels('StateTransitions').values()]
    paths = [series['value'] for panel in drawn for series in panel['paths']]
    paths += [panel['path'] for panel in _panels('Indicator').values()]
    for path in paths:
        topic, *fields = path.split('.')
        _require_field(topic, fields, topics)
    for panel in _panels('DiagnosticSummary').values():
        assert topics[panel['topicToRender']] == 'diagnostic_msgs/msg/DiagnosticArray'


def test_foxglove_names_the_states_as_the_message_does() -> None:
    (panel,) = _panels('StateTransitions').values()
    (states,) = [
        path['customStates']['states'] for path in panel['paths'] if 'customStates' in path
    ]
    shown = {state['label'].upper().replace(' ', '_'): int(state['value']) for state in states}
    assert shown == {name: getattr(DriveStatus, name) for name in shown}
    text = (MSG_DEFS / 'msg' / 'DriveStatus.msg').read_text()
    (listed,) = re.findall(r'# state: the drive.*?\n((?:uint8 .*\n)+)', text)
    assert set(shown) == {*re.findall(r'uint8 (\w+)=', listed), 'UNKNOWN'}


def test_foxglove_calls_services_that_exist(services: Names) -> None:
    called = {panel['serviceName']: panel for panel in _panels('CallService').values()}
    for name, panel in called.items():
        assert name in services
        fields = _class_of(services[name]).Request.get_fields_and_field_types()
        assert set(json.loads(panel['requestPayload'])) <= set(fields)


def test_plotjuggler_draws_fields_that_exist(topics: Names) -> None:
    root = ElementTree.parse(CONFIG / 'plotjuggler.xml').getroot()
    curves = [curve.attrib['name'] for curve in root.iter('curve')]
    assert len(curves) > 5
    for curve in curves:
        node, topic, *fields = curve.strip('/').split('/')
        _require_field(f'/{node}/{topic}', fields, topics)


# --- diagnostic_aggregator ------------------------------------------------------------------------


def _statuses(client: Client) -> set[str]:
    """The names of what the driver says in its diagnostics."""
    return {status.name for message in client.messages['diagnostics'] for status in message.status}


def test_diagnostics_are_grouped_by_bus_and_by_drive(client: Client) -> None:
    aggregator = Aggregator(CONFIG / 'diagnostic_aggregator.yaml')
    assert _statuses(client) == {'nfo_sinus_bus: line', 'nfo_sinus: drive'}
    for prefix in ('', 'line1/'):
        assert aggregator.groups(f'{prefix}nfo_sinus_bus: line') >= {'Lines'}
        assert aggregator.groups(f'{prefix}nfo_sinus: drive') == {'Drives'}
    # the bus with its drives is that of conveyor.yaml, by the names that the driver gives them
    conveyor = yaml.safe_load((CONFIG / 'conveyor.yaml').read_text())
    drives = conveyor['/**/nfo_sinus_bus']['ros__parameters']['drives']
    (bus,) = (name for name in _statuses(client) if name.startswith('nfo_sinus_bus'))
    (status,) = _statuses(client) - {bus}
    named = {drive: status.replace('nfo_sinus', drive) for drive in drives}
    assert aggregator.expected() == {bus, *named.values()}
    assert aggregator.groups(bus) == {'Lines', 'Conveyor/line'}
    for drive, status in named.items():
        assert aggregator.groups(status) == {'Drives', f'Conveyor/{drive}'}


# --- SROS 2 ---------------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def policy() -> Policy:
    return allowed(CONFIG / 'sros2_policy.xml')


@pytest.fixture(scope='module')
def actions(client: Client) -> set[str]:
    """The actions of the driver."""
    names = (
        name
        for node in _NODES
        for name, _ in client.node.get_service_names_and_types_by_node(node, '/')
    )
    return {name.removesuffix('/_action/send_goal') for name in names if 'send_goal' in name}


def test_driver_may_do_what_it_does_and_nothing_else(
    client: Client, services: Names, actions: set[str], policy: Policy
) -> None:
    driver = policy[_DRIVER]
    assert driver['publish'] == set(_of_nodes(client, 'publisher'))
    # only a driver that is set to takes the simulated time, and the message may not be installed
    optional = {'/clock'} | ({'/nfo_sinus_bus/joint_command'} if message_type() is None else set())
    assert driver['subscribe'] - optional == set(_of_nodes(client, 'subscriber'))
    assert driver['reply'] == set(services)
    assert driver['execute'] == actions == {'/nfo_sinus/tune'}
    assert not driver['request'] and not driver['call']


def test_one_enclave_commands_all_that_can_be_commanded(policy: Policy, services: Names) -> None:
    driver, commander = policy[_DRIVER], policy[_COMMANDER]
    setpoints = driver['subscribe'] - {'/clock'}
    assert commander['publish'] == setpoints | {'/rosout', '/parameter_events'}
    assert commander['request'] == set(services)
    assert commander['call'] == driver['execute']


def test_all_may_read_and_only_one_may_command(policy: Policy, services: Names) -> None:
    driver = policy[_DRIVER]
    for enclave, rules in policy.items():
        if enclave != _DRIVER:
            # all that it says, and what it should do
            assert driver['publish'] | driver['subscribe'] <= rules['subscribe'] | {'/clock'}
        if enclave in (_DRIVER, _COMMANDER):
            continue
        # what every node has for itself
        assert rules['publish'] == {'/rosout', '/parameter_events'}, enclave
        assert not rules['call'] and not rules['execute'] and not rules['reply'], enclave
        assert rules['request'] <= set(services)
        for service in rules['request']:
            assert re.fullmatch(r'(get|list|describe)_\w+', service.rpartition('/')[2]), service
    assert set(policy) == {_DRIVER, _COMMANDER, _ANYBODY}
    changing = {'enable', 'stop', 'set_parameters', 'set_parameters_atomically', 'change_state'}
    assert {f'/nfo_sinus/{name}' for name in changing} <= set(services)
    assert not {f'/nfo_sinus/{name}' for name in changing} & policy[_ANYBODY]['request']
    # and what only reads is for every process, all of it
    reading = {name for name in services if re.search(r'/(get|list|describe)_\w+$', name)}
    assert policy[_ANYBODY]['request'] == reading


def test_enclaves_see_the_parts_of_the_action(policy: Policy) -> None:
    parts = {f'/nfo_sinus/tune/_action/{part}' for part in ('feedback', 'status')}
    assert parts <= policy[_ANYBODY]['subscribe']
    assert not parts & policy[_ANYBODY]['publish']
