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

"""A family that nothing general has heard of: its two folders are all there is of it."""

from pathlib import Path
import struct

import pytest

from nfo_sinus_driver import families
from nfo_sinus_driver import simulator as room
from nfo_sinus_driver.catalog import family as catalog
from nfo_sinus_driver.simulator.family import every_verb
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.inject import inject
from nfo_sinus_driver.simulator.main import main
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.simulator import Simulator

HERE = Path(__file__).parent / 'made_up'
COMMAND, STATUS, CODE, FREQUENCY, DIRECTION, ACTUAL = 0x10, 0x11, 0x12, 0x20, 0x22, 0x40
ENABLE, RUN, ACKNOWLEDGE = 1 << 8, 1 << 9, 1 << 15


@pytest.fixture(autouse=True)
def fable(monkeypatch):
    for package, name in [(families, 'families'), (room, 'simulator')]:
        monkeypatch.setattr(package, '__path__', [*package.__path__, str(HERE / name)])
    monkeypatch.setattr(catalog, '_FAMILIES', HERE / 'families')


class Master:
    """Asks one drive by registers."""

    def __init__(self, drive):
        self.drive = drive

    def write(self, register, *words):
        pdu = struct.pack(f'>BHHB{len(words)}H', 16, register, len(words), 2 * len(words), *words)
        return server(self.drive).answer(pdu)[0] == 16

    def read(self, register):
        answer = server(self.drive).answer(struct.pack('>BHH', 3, register, 1))
        return struct.unpack('>h', answer[2:])[0]


@pytest.fixture
def simulator():
    # not started: time passes when told
    simulator = Simulator(model='fable')
    yield simulator
    simulator.stop()


@pytest.fixture
def master(simulator):
    return Master(simulator.drives[1])


def run(master, frequency):
    assert master.write(FREQUENCY, frequency >> 16, frequency & 0xFFFF)
    assert master.write(COMMAND, ENABLE)
    assert master.write(COMMAND, ENABLE | RUN)
    master.drive.advance(5)


def test_it_runs_reverses_and_stops(master):
    run(master, 0x00002550)
    assert (master.read(STATUS), master.read(CODE), master.read(ACTUAL)) == (0x110, 1, 255)
    assert master.write(DIRECTION, 1)
    master.drive.advance(5)
    assert master.read(ACTUAL) == -255
    assert master.write(COMMAND, ENABLE)
    assert not master.drive.motor.driven
    assert master.read(STATUS) == 0x100


def test_its_faults(simulator, master):
    run(master, 0x00001000)
    simulator.inject('heat')
    assert (master.read(CODE), master.read(STATUS) & 1) == (7, 1)
    assert not master.write(COMMAND, ENABLE | RUN)
    assert master.write(COMMAND, ACKNOWLEDGE)
    assert (master.read(CODE), master.drive.motor.driven) == (0, False)
    simulator.inject('fault', 7, standing=True)
    assert master.write(COMMAND, ACKNOWLEDGE)
    assert master.read(CODE) == 7
    with pytest.raises(ValueError, match='8 is no fault of fable'):
        simulator.inject('fault', 8)


def test_what_happens_to_every_drive_happens_to_it(simulator, master):
    run(master, 0x00001000)
    simulator.inject('run', False)
    assert not master.drive.motor.driven
    simulator.inject('set', 'ramps.time', '2.5')
    assert master.read(0x30) == 25
    simulator.inject('factory-reset')
    assert master.read(0x30) == 10
    simulator.inject('power-cycle', 0)
    assert master.read(COMMAND) == 0
    assert master.drive.writes == {}
    assert master.drive.command_writes == {'bus.frequency': 1, 'bus.command': 2}


def test_its_registers_have_their_own_ends(master):
    assert not master.write(FREQUENCY, 0x0000, 0x6001)
    assert not master.write(FREQUENCY, 0x0000, 0x00AB), 'no decimal digits'
    assert not master.write(DIRECTION, 2)


def test_its_options():
    master = Master(simulated_drive('fable', most='50'))
    run(master, 0x00006000)
    assert master.read(ACTUAL) == 500
    with pytest.raises(ValueError, match='fable has no option lenient'):
        Simulator(model='fable', lenient=True)


def test_it_speaks_what_it_has_a_server_for():
    with pytest.raises(ValueError, match='fable does not speak classic'):
        Simulator(model='fable', protocol='classic')


def test_over_a_line(open_master):
    with Simulator(model='fable') as simulator:
        client = open_master(simulator.port)
        assert client.ask(1, struct.pack('>BHH', 3, CODE, 1), 7)[3:5] == b'\0\0'
        state = simulator.state()
        assert (state['model'], state['code'], state['parameters']['ramps.time']) == ('fable', 0, 1)


def test_the_command_line_offers_it(capsys):
    assert 'heat' in every_verb()
    for command, argument, offered in [
        (main, '--help', '--most {50,60}'),
        (inject, '--help', 'let it be too hot'),
    ]:
        with pytest.raises(SystemExit):
            command([argument])
        assert offered in capsys.readouterr().out
