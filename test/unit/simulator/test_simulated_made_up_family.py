# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A family that nothing general has heard of: its two folders are all there is of it."""

from pathlib import Path
import struct

import pytest

from nfo_sinus_driver import families, simulator as room
from nfo_sinus_driver.simulator.family import every_injection, simulated_drive
from nfo_sinus_driver.simulator.main import inject, main
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.simulator import Simulator

HERE = Path(__file__).parent
RAMP, WORD, TURN, SIZE, STATUS, CODE, HERTZ = 10, 100, 101, 102, 200, 201, 202
RESET, RUN, REMOTE = 1 << 3, 1 << 12, 1 << 15
RUNNING, TRIPPED, HAS_REMOTE = 1 << 5, 1 << 9, 1 << 13


@pytest.fixture(autouse=True)
def acme(monkeypatch):
    for package, folder in [(families, HERE.parent / 'drive/made_up'), (room, HERE / 'made_up')]:
        monkeypatch.setattr(package, '__path__', [*package.__path__, str(folder)])


class Master:
    """Asks one drive by registers."""

    def __init__(self, drive):
        self.drive = drive

    def write(self, register, *words):
        pdu = struct.pack(f'>BHHB{len(words)}H', 16, register, len(words), 2 * len(words), *words)
        return server(self.drive).answer(pdu)[0] == 16

    def read(self, register, count=1):
        answer = server(self.drive).answer(struct.pack('>BHH', 3, register, count))
        return int.from_bytes(answer[2:], 'big', signed=True)

    def run(self, digits):
        assert self.write(SIZE, digits >> 16, digits & 0xFFFF)
        assert self.write(WORD, REMOTE)
        assert self.write(WORD, REMOTE | RUN)
        self.drive.advance(5)


@pytest.fixture
def simulator():
    # not started: time passes by command
    simulator = Simulator(model='acme')
    yield simulator
    simulator.stop()


@pytest.fixture
def master(simulator):
    return Master(simulator.drives[1])


def test_it_runs_reverses_and_stops(master):
    assert master.read(CODE) == 1
    master.run(0x00002550)
    assert (master.read(STATUS), master.read(CODE)) == (HAS_REMOTE | RUNNING, 3)
    assert master.read(HERTZ, 2) == 2550
    assert master.write(TURN, 1)
    master.drive.advance(5)
    assert master.read(HERTZ, 2) == -2550
    assert master.write(WORD, REMOTE)
    assert not master.drive.motor.driven
    assert (master.read(STATUS), master.read(CODE)) == (HAS_REMOTE, 2)


def test_its_faults(simulator, master):
    master.run(0x00001000)
    simulator.inject('heat')
    assert (master.read(CODE), master.read(STATUS)) == (70, HAS_REMOTE | TRIPPED)
    assert master.write(WORD, REMOTE | RESET)
    assert (master.read(CODE), master.drive.motor.driven) == (2, False)
    simulator.inject('fault', 70, standing=True)
    assert master.write(WORD, REMOTE)
    assert master.write(WORD, REMOTE | RESET)
    assert master.read(CODE) == 70
    with pytest.raises(ValueError, match='8 is no fault of acme'):
        simulator.inject('fault', 8)


def test_what_happens_to_every_drive_happens_to_it(simulator, master):
    master.run(0x00001000)
    simulator.inject('run', False)
    assert not master.drive.motor.driven
    simulator.inject('set', 'ramp.up', '2.5')
    assert master.read(RAMP) == 25
    simulator.inject('factory-reset')
    assert master.read(RAMP) == 10
    simulator.inject('power-cycle', 0)
    assert master.read(WORD) == 0
    assert master.drive.writes == {}
    assert master.drive.command_writes == {'bus.size': 1, 'bus.word': 2}


def test_its_registers_have_their_own_ends(master):
    assert not master.write(SIZE, 0x0004, 0x0001)
    assert not master.write(SIZE, 0x0000, 0x00AB), 'no decimal digits'
    assert not master.write(TURN, 2)


def test_its_options():
    master = Master(simulated_drive('acme', most='50'))
    master.run(0x00006000)
    assert master.read(HERTZ, 2) == 5000
    with pytest.raises(ValueError, match='acme has no option lenient'):
        Simulator(model='acme', lenient=True)


def test_it_speaks_what_it_has_a_server_for():
    with pytest.raises(ValueError, match='acme does not speak classic'):
        Simulator(model='acme', protocol='classic')


def test_over_a_line(open_master):
    with Simulator(model='acme') as simulator:
        client = open_master(simulator.port)
        assert client.ask(1, struct.pack('>BHH', 3, CODE, 1), 7)[3:5] == b'\0\1'
        state = simulator.state()
        assert (state['model'], state['code'], state['parameters']['ramp.up']) == ('acme', 1, 1)


def test_the_command_line_offers_it(capsys):
    assert {'heat', 'sio-error'} <= every_injection().keys()
    for command, how, offered, experts in (
        (main, '--help', '--most {400,50}', True),
        (inject, '--help', 'let it be too hot', False),
    ):
        with pytest.raises(SystemExit) as left:
            command([how])
        shown = capsys.readouterr().out
        assert not left.value.code and offered in shown and ('--most' in shown) is experts
