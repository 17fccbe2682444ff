# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The control channel, and what can be made to happen over it.

Its sockets are real; the line's own faults are in test_lines.py, in made-up time.
"""

from concurrent.futures import ThreadPoolExecutor
import json
import socket
import time

import pytest

from nfo_sinus_driver.catalog.finding import find
from nfo_sinus_driver.simulator.control import Client, ControlError
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


def test_the_state_is_plain_data_and_looking_has_no_effect(served):
    simulator, client = served
    state = client.state(2)
    assert state.keys() >= {
        'address', 'mode', 'scmd', 'run_input', 'inv_st', 'fault', 'state', 'status_word',
        'frequency', 'speed', 'rotor_speed', 'turning', 'driven', 'setpoint', 'setpoint_raw',
        'ack_reads', 'mode_ext_writes', 'writes', 'silent', 'parameters',
    }  # fmt: skip
    assert (state['address'], state['parameters']['control.accel']) == (2, 5.0)
    assert list(client.states()) == [1, 2]
    assert simulator.state(1)['inv_st_text'] == 'Stop'
    client.inject('fault', 5, address=1)
    for _ in range(3):
        assert client.state(1)['inv_st'] == 5
    assert client.state(1)['ack_reads'] == 0


def test_what_happens_to_a_drive_happens_to_no_other(served):
    _, client = served

    def of_the_other():
        state = client.state(1)
        return [state[key] for key in ('mode', 'run_input', 'fault', 'silent', 'inv_st')]

    accel = client.state(1)['parameters']['control.accel']
    for verb, values, seen in (
        ('run', ['off'], lambda state: not state['run_input']),
        ('run', ['on'], lambda state: state['run_input']),
        ('run', [False], lambda state: not state['run_input']),
        ('keypad', ['ext'], lambda state: state['mode'] == 2),
        ('keypad', ['start'], lambda state: state['inv_st'] == 31),
        ('keypad', ['stop'], lambda state: state['mode'] == 1),
        ('set', ['control.accel', '7'], lambda state: state['parameters']['control.accel'] == 7),
        ('set', ['control.auto_start', 'on'], lambda s: s['parameters']['control.auto_start']),
        ('fault', [5], lambda state: state['fault'] == 5),
        ('silence', [5], lambda state: state['silent']),
    ):
        before = of_the_other()
        client.inject(verb, *values, address=2)
        assert seen(client.state(2)), (verb, values)
        assert of_the_other() == before
    assert client.state(1)['parameters']['control.accel'] == accel
    client.inject('power-cycle', address=1)
    assert client.state(1)['silent']
    client.wait_for(lambda state: not state['silent'], 60.0, address=1)


def test_a_standing_cause_goes_and_a_load_comes_on_request(served):
    simulator, client = served
    client.inject('fault', 3, standing=True, address=1)
    for fault in (3, 0):
        with simulator.lock:
            server(simulator.drives[1]).read(0x2A4, 1)
        assert client.state(1)['fault'] == fault
        client.inject('ack-cause-gone', address=1)
    client.inject('keypad', 'start', address=1)
    client.inject('load', 0.9, address=1)
    client.wait_for(lambda state: state['turning'], 60.0, address=1)
    assert simulator.drives[1].motor.load == 0.9


def test_faults_of_the_line(served, open_master, make_frame):
    simulator, client = served
    master = open_master(simulator.port)
    good = make_frame(1, bytes.fromhex('03020001'))

    def ask(timeout=0.2, count=7):
        return master.ask(1, READ_MODE, count, timeout)

    client.inject('damage', 1)
    assert ask(10.0) != good
    client.inject('drop')
    assert ask() == b''
    client.inject('double', 1)
    assert ask(10.0, 14) == 2 * good
    client.inject('delay', 1, 0.3, address=1)
    assert ask(0.05) == b''
    assert master.ask(2, READ_MODE, 7)[0] == 2
    assert master.receive(7) == good, 'it comes after that of another drive'
    client.inject('line-dead', 60)
    assert ask() == b''
    client.inject('heal')
    assert ask(10.0) == good
    faults = simulator.lines[0].faults
    client.inject('noise-rate', 'drop', 1.0)
    client.inject('burst', 1.0, 1.0)
    assert faults.alter(1, READ_MODE) == []
    assert faults.dead(time.monotonic())
    client.inject('heal')
    assert len(faults.alter(1, READ_MODE)) == 1
    assert not faults.dead(time.monotonic())


def test_what_cannot_happen_is_said(served):
    _, client = served
    for what, values, named, text in (
        ('earthquake', [], {}, "invalid choice: 'earthquake'"),
        ('fault', [], {}, 'required: code'),
        ('fault', [99], {}, 'no fault'),
        ('fault', ['x'], {}, "argument code: invalid int value: 'x'"),
        ('fault', [5, 1], {}, 'unrecognized arguments: 1'),
        ('fault', [5], {'colour': True}, 'unrecognized arguments: --colour'),
        ('fault', [5], {'address': None}, 'say which drive, with --address: 1, 2'),
        ('fault', [5], {'address': 3}, 'no drive has address 3, only 1, 2'),
        ('run', ['maybe'], {}, "choose from 'on', 'off'"),
        ('keypad', ['enter'], {}, 'choose one of stop, ext, start'),
        ('keypad', ['manual'], {}, 'choose one of stop, ext, start'),
        ('set', ['control.acel', 1], {}, 'did you mean control.accel'),
        ('set', ['control.accel', 'fast'], {}, 'not a number'),
        ('set', ['control.accel', 1000], {}, 'out of range'),
        ('set', ['control.auto_start', 'maybe'], {}, 'neither ON nor OFF'),
        ('set', ['control.mode', 'Sped'], {}, 'none of'),
        ('noise-rate', ['drop', 2], {'address': None}, '0 to 1'),
        ('noise-rate', ['nonsense', 0.1], {'address': None}, 'choose from'),
    ):
        with pytest.raises(ControlError, match=text):
            client.inject(what, *values, **{'address': 1, **named})
    assert client.state(1)['inv_st'] == 24
    with pytest.raises(ControlError, match='say which drive'):
        client.state()
    with pytest.raises(TimeoutError, match=r"not within 0\.05 s.*'mode': 1"):
        client.wait_for(lambda state: state['turning'], timeout=0.05, address=1)


def test_a_client_says_when_there_is_no_simulator(link, folder):
    with pytest.raises(ControlError, match='start one there'):
        Client.at_link(link).state()
    simulator = Simulator(link=link, control='')
    simulator.start()
    client = Client.at_link(link)
    client.state()
    simulator.stop()
    with pytest.raises(ControlError, match='no simulator listens'):
        client.state()
    with pytest.raises(ControlError, match='too long'):
        Simulator(control=str(folder / ('x' * 120)))


def test_nonsense_on_the_control_channel_is_answered(served):
    simulator, client = served
    for line in (b'', b'{', b'[]', b'{}', b'{"verb": "fly"}', b'\xff', b'1'):
        with socket.socket(socket.AF_UNIX) as connection:
            connection.settimeout(10)
            connection.connect(simulator.control)
            connection.sendall(line + b'\n')
            answer = json.loads(connection.makefile('rb').readline())
        assert answer['ok'] is False and answer['error'], line
    assert client.state(1)['mode'] == 1


def test_several_clients_at_once(served):
    simulator, _ = served

    def look(_):
        with Client(simulator.control) as client:
            return [client.state(1)['address'] for _ in range(10)]

    with ThreadPoolExecutor(4) as pool:
        assert all(answer == [1] * 10 for answer in pool.map(look, range(4)))


def test_what_happens_to_drives_of_other_families():
    sinus_h = Simulator(
        model='sinus_h', protocol='telegram1', settings={'drv.cmd_source': 'Keypad'}
    )
    described = Simulator(model=find('yaskawa_v1000'))
    movitrac = Simulator(model='movitrac31', protocol='movitrac', option_card='fea')
    optimal = Simulator(model='sinus_optimal', settings={'control.retard': 2})
    for simulator, steps in (
        (movitrac, (
            ('terminal 41 closed', lambda state: state['terminals']['41'] and state['driven']),
            ('run off', lambda state: not state['terminals']['43']),
            ('run on', lambda state: state['terminals']['43']),
            ('fault 101', lambda state: state['inv_st_text'] == 'Overcurrent'),
            ('keypad reset', lambda state: state['fault'] == 0),
            ('keypad manual', lambda state: state['manual']),
            ('keypad ccw', lambda state: state['direction'] == -1),
            ('ambient 30', lambda s: s['parameters']['status.heat_sink_temperature'] == 30.0),
            ('set ramp.t11_up 7', lambda state: state['parameters']['ramp.t11_up'] == 7.0),
            ('terminal 51 closed', lambda state: state['terminals']['51']),
        )),
        (optimal, (
            ('run off', lambda state: not state['run_input']),
            ('set control.accel 7', lambda state: state['parameters']['control.accel'] == 7.0),
            ('fault 5', lambda state: (state['state'], state['fault']) == ('FAULTED', 5)),
            ('power-cycle 0', lambda state: state['fault'] == 0),
        )),
        (sinus_h, (
            ('keypad start', lambda state: state['driven']),
            ('keypad stop', lambda state: not state['driven']),
            ('plc-restart 1', lambda state: not any(state['plc']['block'])),
        )),
        (described, (
            ('local on', lambda state: not state['obeys']),
            ('local off', lambda state: state['obeys']),
        )),
    ):  # fmt: skip
        for words, seen in steps:
            simulator.inject(*words.split())
            assert seen(simulator.state()), words
        simulator.stop()
    with pytest.raises(ValueError, match='no key'):
        described.inject('keypad', 'start')
    for verb, value in (('keypad', 'start'), ('fault', '108')):
        with pytest.raises(ValueError, match=r'choose one of|no fault'):
            movitrac.inject(verb, value)
