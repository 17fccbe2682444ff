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

"""The control channel, and what can be made to happen over it."""

from concurrent.futures import ThreadPoolExecutor
import json
import socket
import time

import pytest

from nfo_sinus_driver.simulator.control import Client
from nfo_sinus_driver.simulator.control import ControlError
from nfo_sinus_driver.simulator.injections import VERBS
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.simulator import Simulator

READ_MODE = bytes.fromhex('0302940001')


@pytest.fixture
def link(folder):
    return str(folder / 'nfo0')


@pytest.fixture
def served(link):
    with (
        Simulator((1, 2), link=link, control='', boot_time=0.2) as simulator,
        Client.at_link(link) as client,
    ):
        yield simulator, client


def test_the_state_is_plain_data(served):
    simulator, client = served
    state = client.state(2)
    assert state.keys() >= {
        'address', 'mode', 'scmd', 'run_input', 'inv_st', 'fault', 'state', 'status_word',
        'frequency', 'speed', 'rotor_speed', 'turning', 'driven', 'setpoint', 'setpoint_raw',
        'ack_reads', 'mode_ext_writes', 'writes', 'silent', 'parameters',
    }  # fmt: skip
    assert state['address'] == 2
    assert state['parameters']['control.accel'] == 5.0
    assert list(client.states()) == [1, 2]
    assert simulator.state(1)['inv_st_text'] == 'Stop'


def test_looking_has_no_effect(served):
    _simulator, client = served
    client.inject('fault', 5, address=1)
    for _ in range(3):
        assert client.state(1)['inv_st'] == 5
    assert client.state(1)['ack_reads'] == 0


def test_with_several_drives_one_must_be_named(served):
    _, client = served
    with pytest.raises(ControlError, match='say which drive, with --address: 1, 2'):
        client.state()
    with pytest.raises(ControlError, match='say which drive'):
        client.inject('fault', 5)
    with pytest.raises(ControlError, match='no drive has address 3, only 1, 2'):
        client.inject('fault', 5, address=3)


@pytest.mark.parametrize(
    ('verb', 'values', 'seen'),
    [
        ('fault', [5], lambda state: state['fault'] == 5),
        ('run', ['off'], lambda state: not state['run_input']),
        ('run', [False], lambda state: not state['run_input']),
        ('keypad', ['ext'], lambda state: state['mode'] == 2),
        ('keypad', ['start'], lambda state: state['inv_st'] == 31),
        ('set', ['control.accel', '7'], lambda state: state['parameters']['control.accel'] == 7),
        ('set', ['control.auto_start', 'on'], lambda s: s['parameters']['control.auto_start']),
        ('power-cycle', [], lambda state: state['silent']),
        ('power-cycle', [5], lambda state: state['silent']),
        ('silence', [5], lambda state: state['silent']),
    ],
)
def test_what_happens_to_a_drive(served, verb, values, seen):
    _, client = served
    client.inject(verb, *values, address=2)
    assert seen(client.state(2))
    assert not seen(client.state(1))


def test_a_standing_cause_goes_on_request(served):
    simulator, client = served
    client.inject('fault', 3, standing=True, address=1)
    with simulator.lock:
        server(simulator.drives[1]).read(0x2A4, 1)
    assert client.state(1)['fault'] == 3
    client.inject('ack-cause-gone', address=1)
    with simulator.lock:
        server(simulator.drives[1]).read(0x2A4, 1)
    assert client.state(1)['fault'] == 0


def test_the_load_and_the_stop_key(served):
    simulator, client = served
    client.inject('keypad', 'start', address=1)
    client.inject('load', 0.9, address=1)
    client.wait_for(lambda state: state['turning'], address=1)
    assert simulator.drives[1].motor.load == 0.9
    client.inject('keypad', 'stop', address=1)
    state = client.state(1)
    assert (state['mode'], state['driven'], state['turning']) == (1, False, True)


def test_a_power_cycle_ends(served):
    _, client = served
    client.inject('power-cycle', address=1)
    assert client.state(1)['silent']
    client.wait_for(lambda state: not state['silent'], address=1)


def test_faults_of_the_line(served, open_master, make_frame):
    simulator, client = served
    master = open_master(simulator.port)
    good = make_frame(1, bytes.fromhex('03020001'))

    def ask(timeout=0.2, count=7):
        return master.ask(1, READ_MODE, count, timeout)

    client.inject('damage', 1)
    assert ask() != good
    client.inject('drop')
    assert ask() == b''
    client.inject('double', 1)
    assert ask(count=14) == 2 * good
    client.inject('noise')
    noisy = ask(count=100)
    assert noisy.endswith(good)
    assert noisy != good
    client.inject('delay', 1, 0.3)
    begin = time.monotonic()
    assert ask(timeout=2) == good
    assert time.monotonic() - begin >= 0.3
    client.inject('line-dead', 10)
    assert ask() == b''
    client.inject('heal')
    assert ask() == good
    client.inject('silence', 10, address=1)
    assert ask() == b''


def test_a_late_answer_is_sent_after_a_later_request(served, open_master):
    simulator, client = served
    master = open_master(simulator.port)
    client.inject('delay', 1, 0.3, address=1)
    assert master.ask(1, READ_MODE, 7, timeout=0.05) == b''
    assert master.ask(2, READ_MODE, 7)[0] == 2
    assert master.receive(7)[0] == 1


@pytest.mark.parametrize(
    ('what', 'values', 'named', 'text'),
    [
        ('earthquake', [], {}, 'unknown injection'),
        ('fault', [], {}, 'needs code'),
        ('fault', [99], {}, 'no fault'),
        ('fault', ['x'], {}, 'is not right'),
        ('fault', [5, False, 1], {}, 'at most 2'),
        ('fault', [5], {'colour': 1}, 'no argument colour'),
        ('run', ['maybe'], {}, 'choose one of on, off'),
        ('keypad', ['enter'], {}, 'choose one of stop, ext, start'),
        ('set', ['control.acel', 1], {}, 'did you mean control.accel'),
        ('set', ['control.accel', 'fast'], {}, 'not a number'),
        ('set', ['control.accel', 1000], {}, 'out of range'),
        ('set', ['control.auto_start', 'maybe'], {}, 'neither ON nor OFF'),
        ('set', ['control.mode', 'Sped'], {}, 'none of'),
    ],
)
def test_what_cannot_happen_is_said(served, what, values, named, text):
    _, client = served
    with pytest.raises(ControlError, match=text):
        client.inject(what, *values, address=1, **named)
    assert client.state(1)['inv_st'] == 24


def test_every_verb_has_help():
    assert all(verb.help for verb in VERBS.values())
    assert all(argument.help for verb in VERBS.values() for argument in verb.arguments)


def test_nobody_listens(link):
    with pytest.raises(ControlError, match='start one there'):
        Client.at_link(link).state()


def test_a_client_says_when_the_simulator_goes_away(link):
    simulator = Simulator(link=link, control='')
    simulator.start()
    client = Client.at_link(link)
    client.state()
    simulator.stop()
    with pytest.raises(ControlError, match='no simulator listens'):
        client.state()
    client.close()


def test_waiting_in_vain_shows_the_state(served):
    _, client = served
    with pytest.raises(TimeoutError, match=r"not within 0\.05 s.*'mode': 1"):
        client.wait_for(lambda state: state['turning'], timeout=0.05, address=1)


@pytest.mark.parametrize('line', [b'', b'{', b'[]', b'{}', b'{"verb": "fly"}', b'\xff', b'1'])
def test_nonsense_on_the_control_channel_is_answered(served, line):
    simulator, client = served
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(2)
        connection.connect(simulator.control)
        connection.sendall(line + b'\n')
        answer = json.loads(connection.makefile('rb').readline())
    assert answer['ok'] is False
    assert answer['error']
    assert client.state(1)['mode'] == 1


def test_several_clients_at_once(served):
    simulator, _ = served

    def look(_):
        with Client(simulator.control) as client:
            return [client.state(1)['address'] for _ in range(20)]

    with ThreadPoolExecutor(8) as pool:
        assert all(answer == [1] * 20 for answer in pool.map(look, range(8)))


def test_a_control_path_that_is_too_long(folder):
    with pytest.raises(ControlError, match='too long'):
        Simulator(control=str(folder / ('x' * 120)))


def test_noise_by_chance_and_bursts_belong_to_the_line_and_heal(served):
    simulator, client = served
    client.inject('noise-rate', 'drop', 1.0)
    client.inject('burst', 1.0, 1.0)
    faults = simulator.lines[0].faults
    assert faults.alter(1, READ_MODE) == []
    assert faults.dead(time.monotonic())
    client.inject('heal')
    assert len(faults.alter(1, READ_MODE)) == 1
    assert not faults.dead(time.monotonic())
    with pytest.raises(ControlError, match='0 to 1'):
        client.inject('noise-rate', 'drop', 2)
    with pytest.raises(ControlError, match='choose one of'):
        client.inject('noise-rate', 'nonsense', 0.1)


def test_a_serial_line_has_no_frames_of_others():
    with Simulator() as simulator, pytest.raises(ValueError, match='only a CAN bus'):
        simulator.inject('traffic', 1000)
