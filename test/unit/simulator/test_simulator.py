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

"""The running simulator: real ports, real time."""

import itertools
import json
import os
import select
import socket
import time

import pytest

from nfo_sinus_driver.simulator.control import Client
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.ports import PortError
from nfo_sinus_driver.simulator.simulator import Simulator

READ_MODE = bytes.fromhex('0302940001')
MODE_BUS = bytes.fromhex('0602940003')


def until(condition, timeout=5.0):
    """Wait for a condition; fail when it does not come true in time."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, 'it did not come true'
        time.sleep(0.002)


@pytest.fixture
def link(folder):
    return str(folder / 'nfo0')


# ---- ports ----


def test_a_pseudo_terminal_without_a_link(open_master):
    with Simulator() as simulator:
        assert simulator.port.startswith('/dev/pts/')
        master = open_master(simulator.port)
        assert master.ask(1, READ_MODE, 7).hex() == '01030200017984'


def test_a_link_is_there_while_it_runs_and_gone_after(link, open_master):
    with Simulator(link=link) as simulator:
        assert simulator.port == link
        assert os.path.islink(link)
        assert len(open_master(link).ask(1, READ_MODE, 7)) == 7
    assert not os.path.lexists(link)


def test_a_master_may_go_away_and_come_back(link, open_master):
    with Simulator(link=link):
        for _ in range(3):
            master = open_master(link)
            assert len(master.ask(1, READ_MODE, 7)) == 7
            os.close(master.fd)
            master.fd = os.open('/dev/null', os.O_RDONLY)


def test_every_byte_goes_through(link, open_master, make_frame):
    with Simulator(link=link):
        master = open_master(link)
        for value in [0x0A0D, 0x0D0A, 0x0304, 0x1113, 0x7FFF, 0x001A, 0x1C15]:
            pdu = b'\x06\x03\xfc' + (value % 1500).to_bytes(2, 'big')
            assert master.ask(1, pdu, 8) == make_frame(1, pdu)


def test_a_master_need_not_set_the_terminal(link, make_frame):
    with Simulator(link=link):
        master = os.open(link, os.O_RDWR | os.O_NOCTTY)
        os.write(master, make_frame(1, READ_MODE))
        ready, _, _ = select.select([master], [], [], 2)
        assert ready
        assert os.read(master, 100) == make_frame(1, bytes.fromhex('03020001'))
        os.close(master)


def test_a_stale_link_is_replaced(link, open_master):
    os.symlink('/dev/pts/9999', link)
    with Simulator(link=link):
        assert len(open_master(link).ask(1, READ_MODE, 7)) == 7


def test_what_is_no_link_of_ours_is_left_alone(link, folder):
    os.symlink('/dev/ttyUSB0', link)
    with pytest.raises(PortError, match='is a link to /dev/ttyUSB0'):
        Simulator(link=link)
    assert os.readlink(link) == '/dev/ttyUSB0'
    file = folder / 'file'
    file.write_text('precious')
    with pytest.raises(PortError, match='no link of a simulator'):
        Simulator(link=str(file))
    assert file.read_text() == 'precious'


def test_a_live_simulator_is_not_pushed_aside(link):
    with Simulator(link=link, control=''), pytest.raises(PortError, match='already serves'):
        Simulator(link=link, control='')


def test_a_dead_simulators_socket_is_replaced(link):
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(f'{link}.control')
    with Simulator(link=link, control=''), Client.at_link(link) as client:
        assert client.state()['mode'] == 1
    assert not os.path.lexists(f'{link}.control')


def test_tcp_serves_one_master_after_another(make_frame):
    with Simulator(tcp=0) as simulator:
        host, port = simulator.port.split(':')
        for _ in range(3):
            with socket.create_connection((host, int(port)), timeout=2) as master:
                master.sendall(make_frame(1, READ_MODE))
                assert master.recv(100) == make_frame(1, bytes.fromhex('03020001'))


def test_a_tcp_port_that_is_taken(make_frame):
    with Simulator(tcp=0) as simulator:
        number = int(simulator.port.split(':')[1])
        with pytest.raises(PortError, match='choose another'):
            Simulator(tcp=number)


def test_a_tcp_port_may_hang_up(make_frame):
    with Simulator(tcp=0) as simulator:
        address = ('127.0.0.1', int(simulator.port.split(':')[1]))
        with socket.create_connection(address, timeout=2) as master:
            master.sendall(make_frame(1, READ_MODE))
            assert master.recv(100)
            simulator.inject('hangup', 0.2)
            assert master.recv(100) == b''

        def back():
            try:
                socket.create_connection(address, timeout=2).close()
            except OSError:
                return False
            return True

        until(back)


def test_a_pseudo_terminal_may_hang_up_and_comes_back_under_its_link(link, open_master):
    with Simulator(link=link) as simulator:
        master = open_master(link)
        assert len(master.ask(1, READ_MODE, 7)) == 7
        simulator.inject('hangup', 0.5)
        until(lambda: not os.path.lexists(link))
        poll = select.poll()
        poll.register(master.fd, select.POLLIN)
        ((_, event),) = poll.poll(2000)
        assert event & select.POLLHUP
        until(lambda: os.path.lexists(link))
        assert len(open_master(link).ask(1, READ_MODE, 7)) == 7


# ---- time ----


def test_paced_bytes_are_never_early(link, open_master):
    character = 11 / 19200
    with Simulator(link=link, paced=True):
        master = open_master(link)
        for _ in range(20):
            begin = time.monotonic()
            first = master.ask(1, READ_MODE, 1)
            first_at = time.monotonic() - begin
            rest = master.receive(7 - len(first))
            last_at = time.monotonic() - begin
            assert len(first + rest) == 7
            assert first_at >= (8 + 3.5 + 1) * character
            assert last_at >= (8 + 3.5 + 7) * character
            time.sleep(0.003)


def test_the_trace_of_a_paced_line_can_be_read_while_it_runs(link, folder, open_master):
    trace = folder / 'trace'
    with Simulator((1, 2), link=link, paced=True, baud=57600, trace=str(trace)):
        master = open_master(link)
        before = time.monotonic()
        for address in (1, 2, 3):
            master.ask(address, READ_MODE, 7, timeout=0.1)
        until(lambda: len(trace.read_text().splitlines()) >= 5)
        frames = [json.loads(line) for line in trace.read_text().splitlines()]
    assert [(one['direction'], one['hex'][:2]) for one in frames] == [
        ('request', '01'),
        ('answer', '01'),
        ('request', '02'),
        ('answer', '02'),
        ('request', '03'),
    ]
    assert frames[0]['first'] >= before
    for one, following in itertools.pairwise(frames):
        assert one['first'] < one['last'] <= following['first']
        assert following['gap'] == pytest.approx(following['first'] - one['last'])
        assert following['gap'] >= 0.00175 or following['direction'] == 'request'


def test_the_motor_lives_in_real_time(link):
    with Simulator(settings={'control.accel': 0.5}, control='', link=link) as simulator:
        with simulator.lock:
            drive = simulator.drives[1]
            server(drive).write(0x294, [3])
            server(drive).write(0x3FC, [200])
            server(drive).write(0x298, [0x101])
        begin = time.monotonic()
        with Client.at_link(link) as client:
            state = client.wait_for(lambda state: state['frequency'] == 20, timeout=5)
        assert time.monotonic() - begin > 0.15
        assert state['turning']
        assert state['driven']


def test_many_drives(link, open_master):
    addresses = tuple(range(1, 31))
    with Simulator(addresses, link=link) as simulator:
        master = open_master(link)
        for address in addresses:
            assert master.ask(address, MODE_BUS, 8)[0] == address
        assert [state['mode'] for state in simulator.states().values()] == [3] * 30


@pytest.mark.parametrize(
    ('options', 'text'),
    [
        ({'addresses': (0,)}, '1 to 247'),
        ({'addresses': (248,)}, '1 to 247'),
        ({'addresses': (1, 1)}, 'twice'),
        ({'addresses': ()}, 'needs a drive'),
        ({'protocol': 'profinet'}, 'choose one of modbus_rtu'),
        ({'model': 'sinus_x'}, 'sinus_g2'),
        ({'baud': 115200}, '57600'),
        ({'char_format': '9E1'}, '8E1'),
        ({'char_format': '7E1'}, '8 data bits'),
        ({'link': '/tmp/x', 'tcp': 0}, 'not both'),
    ],
)
def test_impossible_simulators(options, text):
    with pytest.raises(ValueError, match=text):
        Simulator(**options)


def test_stopping_twice_is_fine():
    simulator = Simulator()
    simulator.start()
    simulator.stop()
    simulator.stop()


def test_rubbish_on_the_line_is_survived(link, open_master):
    with Simulator(link=link) as simulator:
        master = open_master(link)
        for rubbish in [b'\x00', b'\xff' * 4000, os.urandom(3000), b'\x01\x10\x02\x94']:
            master.send(rubbish)
            until(lambda: simulator.line.due == float('inf'))
            master.receive(timeout=0.01)
        # what was sent last may not have been read yet: then the first question goes with it
        until(lambda: len(master.ask(1, READ_MODE, 7)) == 7)
        assert simulator.failure is None
