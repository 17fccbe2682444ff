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

"""A simulated drive on CANopen, asked by the driver's own link."""

from __future__ import annotations

import pytest

from nfo_sinus_driver.link.canopen_link import CanopenLink
from nfo_sinus_driver.link.interface import Address
from nfo_sinus_driver.link.interface import LineSettings
from nfo_sinus_driver.link.interface import NoAnswer
from nfo_sinus_driver.link.interface import Refused
from nfo_sinus_driver.simulator.simulator import Simulator

VENDOR = Address('object', 0x1018, 1, 4)
NAME = Address('object', 0x1008, None, 64)
INV_ST = Address('object', 0x2026, 2, 2)
MODE = Address('object', 0x2022, None, 2)


@pytest.fixture
def simulator():
    with Simulator([1, 2], protocol='canopen') as simulator:
        yield simulator


def link_to(simulator, rate=125_000, patience=2.0):
    link = CanopenLink.on_port(
        simulator.port, LineSettings(baud_rate=rate, response_timeout=patience)
    )
    link.open()
    return link


def test_the_driver_reads_each_node(simulator):
    link = link_to(simulator)
    for unit in (1, 2):
        assert link.read(unit, VENDOR).data == bytes.fromhex('1b000000')
        assert link.read(unit, NAME).data == b'NFO Sinus'
        # bus mode, standing by
        assert link.read(unit, INV_ST).data == bytes((37, 0))
        assert link.read(unit, MODE).data == bytes((3, 0))
    with pytest.raises(Refused, match='no such object'):
        link.read(1, Address('object', 0x2FFF, None, 2))
    link.close()


def test_a_wrong_bit_rate_hears_nobody(simulator):
    link = link_to(simulator, 250_000, 0.05)
    with pytest.raises(NoAnswer):
        link.read(1, VENDOR)
    for _ in range(8):
        with pytest.raises(NoAnswer):
            link.read(1, MODE)
    with pytest.raises(NoAnswer, match='frames do not leave'):
        link.read(1, MODE)
    link.close()
