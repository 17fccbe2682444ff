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

"""MOVITRAC 31.. drives at a line: its pace, its time-outs, several drives, the commands."""

import json
import os

from movitrac_drive_bench import ACK
from movitrac_drive_bench import BITS
from movitrac_drive_bench import CW
from movitrac_drive_bench import ENABLE
from movitrac_drive_bench import HEAT_SINK
from movitrac_drive_bench import bcd
from movitrac_drive_bench import data
from movitrac_drive_bench import enquiry
from movitrac_drive_bench import nack
from movitrac_drive_bench import select
import pytest

from nfo_sinus_driver.simulator.endpoints import endpoint
from nfo_sinus_driver.simulator.family import simulated_drive
from nfo_sinus_driver.simulator.line import Line
from nfo_sinus_driver.simulator.main import inject
from nfo_sinus_driver.simulator.main import main
from nfo_sinus_driver.simulator.simulator import Simulator

CHARACTER = 10 / 9600
IS_25_5 = data(HEAT_SINK, bytes.fromhex('00002550'))
LINE = {'model': 'movitrac31', 'protocol': 'movitrac'}


class FakePort:
    """A port whose other end is a list of (time, bytes)."""

    def __init__(self, clock):
        self.clock = clock
        self.sent = []

    def send(self, frame):
        self.sent.append((self.clock(), frame))


class Rig:
    """A line whose time is a number."""

    def __init__(self, addresses=(0,), *, settings=None, option_card='none', **options):
        self.now = 100.0
        way = endpoint('movitrac')
        more = {'settings': settings, 'option_card': option_card}
        self.drives = [simulated_drive('movitrac31', address, **more) for address in addresses]
        self.port = FakePort(lambda: self.now)
        clock = self.port.clock
        self.line = Line(self.port, way.make(0.0), self.drives, way.timing, clock, **options)

    def send(self, frame):
        self.line.receive(frame, self.now)
        self.line.act(self.now)

    def wait(self, seconds):
        """Let time pass, and the line act exactly when it has to."""
        end = self.now + seconds
        while self.line.due <= end:
            self.now = max(self.now, self.line.due)
            self.line.act(self.now)
        self.now = end

    @property
    def heard(self):
        return b''.join(frame for _, frame in self.port.sent)


def test_paced_it_takes_what_the_line_takes():
    rig = Rig(paced=True)
    rig.send(enquiry(HEAT_SINK))
    rig.wait(1.0)
    (first, one), (last, rest) = rig.port.sent
    assert one + rest == IS_25_5
    assert first == pytest.approx(100 + 6 * CHARACTER)
    assert last == pytest.approx(100 + 13 * CHARACTER)


@pytest.mark.parametrize('paced', [False, True])
def test_the_response_time_delays_the_answer(paced):
    rig = Rig(settings={'serial.response_time': 120}, paced=paced)
    rig.send(enquiry(HEAT_SINK))
    rig.wait(1.0)
    last, _ = rig.port.sent[-1]
    assert last == pytest.approx(100.12 + 13 * CHARACTER * paced)
    assert rig.heard == IS_25_5


def test_another_response_time_counts_from_the_next_request_on():
    rig = Rig()
    rig.send(select(207, bcd(50)))
    rig.send(enquiry(HEAT_SINK))
    rig.wait(1.0)
    assert rig.port.sent == [(100.0, ACK), (pytest.approx(100.05), IS_25_5)]


def test_the_rest_of_a_frame_is_not_waited_for():
    rig = Rig()
    rig.send(enquiry(HEAT_SINK)[:3])
    rig.wait(0.2)
    rig.send(enquiry(HEAT_SINK))
    assert rig.heard == IS_25_5


def test_a_frame_that_comes_in_pieces():
    rig = Rig()
    for byte in enquiry(HEAT_SINK):
        rig.send(bytes([byte]))
        rig.wait(0.01)
    assert rig.heard == IS_25_5


def test_rubbish_before_a_frame():
    rig = Rig()
    rig.send(b'\x00\xff' + enquiry(HEAT_SINK))
    assert rig.heard == IS_25_5


def test_each_answers_for_itself():
    rig = Rig((0, 12))
    rig.send(select(25, bcd(3.7), address=12))
    rig.send(enquiry(25, address=0))
    rig.send(enquiry(25, address=12))
    rig.send(enquiry(25, address=13))
    rig.wait(1.0)
    assert rig.heard == ACK + data(25, bcd(1.0)) + data(25, bcd(3.7))


def test_no_master_is_heard_in_master_slave_operation():
    rig = Rig(option_card='fea')
    rig.send(select(212, bcd(1)))
    assert rig.heard == ACK
    rig.send(enquiry(HEAT_SINK))
    rig.wait(1.0)
    assert rig.heard == ACK


def test_a_line_that_is_silent_is_a_fault_and_damaged_frames_are_silence():
    rig = Rig(settings={'serial.pc_timeout': 1.0, 'serial.control_mode': 'Remote control'})
    (drive,) = rig.drives
    rig.send(enquiry(HEAT_SINK))
    for _ in range(12):
        rig.wait(0.1)
        rig.send(enquiry(HEAT_SINK)[:-1] + b'\x00')
        rig.send(enquiry(HEAT_SINK, address=7))
    assert drive.faults.codes == []
    drive.advance_to(rig.now)
    assert drive.faults.codes == [145]


# ---- the running simulator ----


def test_over_a_pseudo_terminal(open_master):
    with Simulator([0, 63], paced=True, **LINE) as simulator:
        master = open_master(simulator.port)
        master.send(enquiry(HEAT_SINK, 63))
        assert master.receive(8) == IS_25_5
        for index, value in ((205, bcd(2)), (223, bcd(20)), (BITS, bytes([0, 0, 0, CW | ENABLE]))):
            master.send(select(index, value))
            assert master.receive(2) == ACK
        assert simulator.state(0)['driven']
        assert not simulator.state(63)['driven']
        master.send(enquiry(9999))
        assert master.receive(3) == nack(0x10)


def test_the_last_value_counts_whichever_of_two_interfaces_it_came_by(open_master):
    with Simulator(also=['movitrac'], **LINE) as simulator:
        masters = [open_master(port) for port in simulator.ports]
        for master, value in zip(masters, (2.0, 3.0), strict=True):
            master.send(select(25, bcd(value), address=1))
            assert master.receive(2) == ACK
        for master in masters:
            master.send(enquiry(25, address=1))
            assert master.receive(8) == data(25, bcd(3.0))


def test_what_is_injected(capsys, folder):
    link = str(folder / 'm0')
    with Simulator(link=link, control='', **LINE) as simulator:

        def do(*arguments):
            assert inject(['--link', link, *arguments]) == 0
            return capsys.readouterr().out

        do('terminal', '41', 'closed')
        assert simulator.state()['terminals']['41']
        assert simulator.state()['driven']
        do('run', 'off')
        assert not simulator.state()['terminals']['43']
        do('run', 'on')
        do('fault', '101', '--standing')
        assert json.loads(do('state'))['1']['inv_st_text'] == 'Overcurrent'
        do('keypad', 'reset')
        assert simulator.state()['fault'] == 101
        do('ack-cause-gone')
        do('keypad', 'reset')
        assert simulator.state()['fault'] == 0
        do('keypad', 'manual')
        do('keypad', 'ccw')
        assert simulator.state()['manual']
        assert simulator.state()['direction'] == -1
        do('ambient', '30')
        assert simulator.state()['parameters']['status.heat_sink_temperature'] == 30.0
        do('set', 'ramp.t11_up', '7')
        do('power-cycle', '0')
        assert simulator.state()['parameters']['ramp.t11_up'] == 7.0
        for wrong in (['terminal', '48', 'closed'], ['keypad', 'start'], ['fault', '108']):
            assert inject(['--link', link, *wrong]) == 1
            assert capsys.readouterr().err


def test_another_family_keeps_its_own_keys():
    with Simulator() as simulator:
        simulator.inject('keypad', 'start')
        with pytest.raises(ValueError, match='choose one of stop, ext, start'):
            simulator.inject('keypad', 'manual')


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        ([], 'movitrac31 does not speak modbus_rtu'),
        (['--protocol', 'movitrac', '--address', '64'], '0 to 63'),
        (['--protocol', 'movitrac', '--baud-rate', '19200'], '9600 8N1'),
        (['--protocol', 'movitrac', '--char-format', '8E1'], '9600 8N1'),
        (['--protocol', 'movitrac', '--set', 'serial.inverter_address=2'], 'with --address'),
        (['--protocol', 'movitrac', '--enable-bit', 'sometimes'], 'anded'),
    ],
)
def test_wrong_arguments(capsys, arguments, text):
    with pytest.raises(SystemExit) as exit_:
        main(['--model', 'movitrac31', *arguments])
    assert exit_.value.code == 2
    assert text in capsys.readouterr().err


def test_the_switches_are_options_of_the_command(folder):
    link = str(folder / 'm0')
    with pytest.raises(ValueError, match='sinus_g2 has no option enable_bit'):
        Simulator(enable_bit='anded')
    with Simulator(link=link, enable_bit='anded', option_card='fea', **LINE) as simulator:
        assert '51' in simulator.state()['terminals']
    assert not os.path.lexists(link)
