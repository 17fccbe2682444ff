# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A driver, a simulated drive and a client for each test, isolated from everything else."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path

from bench import Bench
from connections import CONNECTIONS, DEFAULT, EACH_KIND, USUAL, Connection, reason_to_skip
import pytest
from support.chosen import axes_of, chosen
from support.examples import FULL

from nfo_sinus_driver.demo.bench import own_domain

# before any context exists, in this process and in those it starts
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# shared memory is one for all domains, and a process that is killed, as tests do, leaves its files
os.environ['FASTDDS_BUILTIN_TRANSPORTS'] = 'UDPv4'
# a field of a wrong type is an exception then, and not the end of the process
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'


#: Of its connections a test has one in so many, unless all were asked for (FULL=1).
_ONE_CONNECTION_IN = 3
#: What ``--connection`` takes for all of them.
_ALL = 'all'


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        '--connection', default=DEFAULT, choices=[*CONNECTIONS, _ALL],
        help='into the drive, for the tests of test/ros',
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line('markers', 'needs(*features): of the connection, see connections.py')
    config.addinivalue_line('markers', 'every_connection: whichever connection was requested')
    config.addinivalue_line(
        'markers', 'each_kind: over a connection of each kind, see connections.py'
    )
    config.addinivalue_line(
        'markers', 'shared: of every_connection, each case over some connections in turn'
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Have a test that goes into a drive once for every connection that was requested."""
    if 'connection' in metafunc.fixturenames:
        # the option is not there where the folder above is given
        asked = metafunc.config.getoption('--connection', DEFAULT)
        marked = metafunc.definition.get_closest_marker
        if asked == _ALL:
            connections = [*CONNECTIONS]
        elif marked('every_connection'):
            connections = [*dict.fromkeys((*USUAL, asked))]
        else:
            connections = [*EACH_KIND] if marked('each_kind') else [asked]
        metafunc.parametrize('connection', connections, indirect=True, scope='module')


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip a test that its connection has nothing for, and share out those that are shared."""
    shared: dict[str, list[pytest.Item]] = {}
    for item in items:
        callspec = getattr(item, 'callspec', None)
        if callspec is None or 'connection' not in callspec.params:
            continue
        missing = [
            reason
            for marker in item.iter_markers('needs')
            if (reason := reason_to_skip(CONNECTIONS[callspec.params['connection']], marker.args))
        ]
        for reason in missing:
            item.add_marker(pytest.mark.skip(reason=reason))
        if not missing and item.get_closest_marker('shared'):
            shared.setdefault(item.nodeid.split('[')[0], []).append(item)
    if config.getoption('--connection', DEFAULT) == _ALL:
        return
    left_out = {item for tests in shared.values() for item in _left_out(tests)}
    if not (FULL or any('[' in argument for argument in config.args)):
        rest = ((item.nodeid, axes_of(item)) for item in items if item not in left_out)
        names = chosen(rest, one_in=_ONE_CONNECTION_IN)
        left_out |= {item for item in items if item.nodeid not in names}
    config.hook.pytest_deselected(items=list(left_out))
    items[:] = [item for item in items if item not in left_out]


def _left_out(tests: list[pytest.Item]) -> list[pytest.Item]:
    """Return which cases of a test to leave out; each keeps some connections, each of them some."""
    connections = list(dict.fromkeys(_connection_of(test) for test in tests))
    cases = list(dict.fromkeys(_case_of(test) for test in tests))
    turns = min(len(connections), len(cases))
    return [
        test
        for test in tests
        if (connections.index(_connection_of(test)) - cases.index(_case_of(test))) % turns
    ]


def _connection_of(test: pytest.Item) -> str:
    return test.callspec.params['connection']


def _case_of(test: pytest.Item) -> str:
    """Return the name of a test without that of its connection."""
    return test.nodeid.replace(_connection_of(test), '', 1)


@pytest.fixture(scope='module')
def connection(request: pytest.FixtureRequest) -> Connection:
    """Return the connection that a test is run over."""
    return CONNECTIONS[request.param]


@pytest.fixture
def domain() -> Iterator[int]:
    """Return a ROS domain that no other test and no demo on this machine uses at the time."""
    with own_domain() as number:
        yield number


@pytest.fixture
def bench(domain: int, tmp_path: Path, connection: Connection) -> Iterator[Bench]:
    """Return a bench on which nothing runs yet."""
    with Bench(domain, tmp_path, connection) as bench:
        yield bench
