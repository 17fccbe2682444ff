# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A driver, a simulated drive and a client for each test, isolated from everything else."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path

from bench import Bench
import pytest
from ways import DEFAULT, EACH_KIND, USUAL, WAYS, Way, why_not

from nfo_sinus_driver.demo.bench import own_domain

# before any context exists, in this process and in those it starts
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# shared memory is one for all domains, and a process that is killed, as tests do, leaves its files
os.environ['FASTDDS_BUILTIN_TRANSPORTS'] = 'UDPv4'
# a field of a wrong type is an exception then, and not the end of the process
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'


#: What ``--way`` takes for all of them.
_ALL = 'all'


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        '--way', default=DEFAULT, choices=[*WAYS, _ALL],
        help='into the drive, for the tests of test/ros',
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line('markers', 'needs(*features): of the way in, see ways.py')
    config.addinivalue_line('markers', 'every_way: whichever way was asked for')
    config.addinivalue_line('markers', 'each_kind: over a way of each kind, see ways.py')
    config.addinivalue_line('markers', 'shared: of every_way, each case over some ways in turn')


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Have a test that goes into a drive once for every way that was asked for."""
    if 'way' in metafunc.fixturenames:
        # the option is not there where the folder above is given
        asked = metafunc.config.getoption('--way', DEFAULT)
        marked = metafunc.definition.get_closest_marker
        if asked == _ALL:
            ways = [*WAYS]
        elif marked('every_way'):
            ways = [*dict.fromkeys((*USUAL, asked))]
        else:
            ways = [*EACH_KIND] if marked('each_kind') else [asked]
        metafunc.parametrize('way', ways, indirect=True, scope='module')


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Skip a test that its way has nothing for, and share out those that are shared."""
    shared: dict[str, list[pytest.Item]] = {}
    for item in items:
        callspec = getattr(item, 'callspec', None)
        if callspec is None or 'way' not in callspec.params:
            continue
        missing = [
            reason
            for marker in item.iter_markers('needs')
            if (reason := why_not(WAYS[callspec.params['way']], marker.args))
        ]
        for reason in missing:
            item.add_marker(pytest.mark.skip(reason=reason))
        if not missing and item.get_closest_marker('shared'):
            shared.setdefault(item.nodeid.split('[')[0], []).append(item)
    if config.getoption('--way', DEFAULT) == _ALL:
        return
    left_out = [item for tests in shared.values() for item in _left_out(tests)]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in left_out]


def _left_out(tests: list[pytest.Item]) -> list[pytest.Item]:
    """Return which cases of a test to leave out: each has some ways left, each way some cases."""
    ways = list(dict.fromkeys(_way_of(test) for test in tests))
    cases = list(dict.fromkeys(_case_of(test) for test in tests))
    turns = min(len(ways), len(cases))
    return [
        test
        for test in tests
        if (ways.index(_way_of(test)) - cases.index(_case_of(test))) % turns
    ]


def _way_of(test: pytest.Item) -> str:
    return test.callspec.params['way']


def _case_of(test: pytest.Item) -> str:
    """Return the name of a test without that of its way."""
    return test.nodeid.replace(_way_of(test), '', 1)


@pytest.fixture(scope='module')
def way(request: pytest.FixtureRequest) -> Way:
    """Return the way in that a test is run over."""
    return WAYS[request.param]


@pytest.fixture
def domain() -> Iterator[int]:
    """Return a ROS domain that no other test and no demo on this machine uses at the time."""
    with own_domain() as number:
        yield number


@pytest.fixture
def bench(domain: int, tmp_path: Path, way: Way) -> Iterator[Bench]:
    """Return a bench on which nothing runs yet."""
    with Bench(domain, tmp_path, way) as bench:
        yield bench
