# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A driver, a simulated drive and a client for each test, isolated from everything else."""

from __future__ import annotations

from collections.abc import Iterator
import os
from pathlib import Path

from bench import Bench
import pytest
from ways import DEFAULT
from ways import WAYS
from ways import Way
from ways import why_not

from nfo_sinus_driver.node.domain import own_domain

# before any context exists, in this process and in those it starts
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# a field of a wrong type is an exception then, and not the end of the process
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        '--way', default=DEFAULT, choices=WAYS, help='into the drive, for the tests of test/ros'
    )


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line('markers', 'needs(*features): of the way in, see ways.py')


@pytest.fixture(scope='session')
def way(request: pytest.FixtureRequest) -> Way:
    """Return the way in that the tests are run over."""
    # the option is not there where the folder above is given
    return WAYS[request.config.getoption('--way', DEFAULT)]


@pytest.fixture(autouse=True)
def _makes_sense(request: pytest.FixtureRequest, way: Way) -> None:
    """Skip a test that the way has nothing for."""
    for marker in request.node.iter_markers('needs'):
        reason = why_not(way, marker.args)
        if reason:
            pytest.skip(reason)


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
