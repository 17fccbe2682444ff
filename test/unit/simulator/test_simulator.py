# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The running simulator on real ports and in real time: links, hang-ups, several lines, pace.

What the lines themselves do is in test_lines.py, in made-up time.
"""

import itertools
import json
import os
import select
import socket
import time

from classic_bench import ACK, NAK, enquiry, reply, select as select_
import movitrac_drive_bench as movitrac
import pytest

from nfo_sinus_driver.link.canopen.link import CanopenLink
from nfo_sinus_driver.link.interface import Address, LineSettings
from nfo_sinus_driver.simulator.control import Client, ControlError
from nfo_sinus_driver.simulator.modbus import server
from nfo_sinus_driver.simulator.ports import PortError
from nfo_sinus_driver.simulator.simulator import Simulator

READ_MODE = bytes.fromhex('0302940001')
READ_INV_ST = bytes.fromhex('0302A50001')
MODE_BUS = bytes.fromhex('0602940003')


def until(condition, timeout=60.0):
    """Wait for a condition; fail when it does not come true in time."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, 'it did not come true'
        time.sleep(0.002)


@pytest.fixture
def link(folder):
    return str(folder / 'nfo0')


def tcp_address(simulator):
    host, _, port = simulator.port.partition(':')
    return host, int(port)


# ---- ports ----


def test_a_pseudo_terminal_is_there_under_its_link_while_it_runs(link, open_master, make_frame):
    os.symlink('/dev/pts/9999', link)  # a stale one is replaced
    with Simulator() as nameless, Simulator(link=link) as simulator:
        assert nameless.port.startswith('/dev/pts/') and simulator.port == link
        assert open_master(nameless.port).ask(1, READ_MODE, 7).hex() == '01030200017984'
        for _ in range(3):  # a master may go away and come back
            master = open_master(link)
            assert len(master.ask(1, READ_MODE, 7)) == 7
            os.close(master.fd)
            master.fd = os.open('/dev/null', os.O_RDONLY)
        # it need not set the terminal, and every byte goes through
        master.fd = os.open(link, os.O_RDWR | os.O_NOCTTY)
        for value in [0x0A0D, 0x0D0A, 0x0304, 0x1113, 0x7FFF, 0x001A, 0x1C15]:
            pdu = b'\x06\x03\xfc' + (value % 1500).to_bytes(2, 'big')
            assert master.ask(1, pdu, 8) == make_frame(1, pdu)
    assert not os.path.lexists(link)
    simulator.stop()


def test_what_is_no_link_of_ours_is_left_alone(link, folder):
    os.symlink('/dev/ttyUSB0', link)
    with pytest.raises(PortError, match='is a link to /dev/ttyUSB0'):
        Simulator(link=link)
    assert os.readlink(link) == '/dev/ttyUSB0'
    file = folder / 'file'
    file.write_text('precious')
    with pytest.raises(PortError, match='no link of a simulator'):
        Simulator(link=str(file))
    with pytest.raises(PortError, match='no link of a simulator'):
        Simulator(link=str(folder / 'nfo1'), also=[f'classic:{file}'])
    assert file.read_text() == 'precious'
    assert not os.path.lexists(folder / 'nfo1'), 'what was opened is closed'


def test_a_live_simulator_is_not_pushed_aside_and_a_dead_ones_socket_is_replaced(link):
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(f'{link}.control')
    with Simulator(link=link, control=''), Client.at_link(link) as client:
        assert client.state()['mode'] == 1
        with pytest.raises(ControlError, match='already serves'):
            Simulator(link=link, control='')
    assert not os.path.lexists(f'{link}.control')


def test_tcp_serves_one_master_after_another_and_may_hang_up(make_frame):
    with Simulator(tcp=0) as simulator:
        address = tcp_address(simulator)
        with pytest.raises(PortError, match='choose another'):
            Simulator(tcp=address[1])
        for hangs_up in (False, True):
            with socket.create_connection(address, timeout=60) as master:
                master.sendall(make_frame(1, READ_MODE))
                assert master.recv(100) == make_frame(1, bytes.fromhex('03020001'))
                if hangs_up:
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
    with Simulator(link=link, also=['modbus_rtu']) as simulator:
        master = open_master(link)
        assert len(master.ask(1, READ_MODE, 7)) == 7
        simulator.inject('hangup', 0.5)
        until(lambda: not os.path.lexists(link))
        poll = select.poll()
        poll.register(master.fd, select.POLLIN)
        ((_, event),) = poll.poll(2000)
        assert event & select.POLLHUP
        other = open_master(simulator.ports[1])
        assert len(other.ask(1, READ_MODE, 7)) == 7, 'a hang-up is of the first line'
        until(lambda: os.path.lexists(link))
        assert len(open_master(link).ask(1, READ_MODE, 7)) == 7


def test_rubbish_on_the_line_is_survived(link, open_master):
    with Simulator(link=link) as simulator:
        master = open_master(link)
        for rubbish in [b'\x00', b'\xff' * 4000, os.urandom(3000), b'\x01\x10\x02\x94']:
            master.send(rubbish)
            until(lambda: simulator.line.due == float('inf'))
            master.receive(timeout=0.01)
        # what was sent last may not have been read yet: then the first question goes with it
        until(lambda: len(master.ask(1, READ_MODE, 7, timeout=2.0)) == 7)
        assert simulator.failure is None


# ---- time ----


def test_paced_bytes_are_never_early_and_the_trace_can_be_read_meanwhile(
    link, folder, open_master
):
    character = 11 / 19200
    trace = folder / 'trace'
    with Simulator((1, 2), link=link, paced=True, trace=str(trace), also=['classic']) as simulator:
        master = open_master(link)
        for _ in range(5):
            begin = time.monotonic()
            first = master.ask(1, READ_MODE, 1)
            assert time.monotonic() - begin >= (8 + 3.5 + 1) * character
            first += master.receive(7 - len(first))
            assert time.monotonic() - begin >= (8 + 3.5 + 7) * character
            assert len(first) == 7
        master.ask(3, READ_MODE, 7, timeout=0.1)
        other = open_master(simulator.ports[1])
        other.send(enquiry('E0029'))
        other.receive(14)
        until(lambda: len(trace.read_text().splitlines()) >= 11)
        frames = [json.loads(line) for line in trace.read_text().splitlines()]
    found = [(frame['direction'], frame['hex'][:2]) for frame in frames]
    assert found == 5 * [('request', '01'), ('answer', '01')] + [('request', '03')]
    for frame, following in itertools.pairwise(frames):
        assert frame['first'] < frame['last'] <= following['first']
        assert following['gap'] == pytest.approx(following['first'] - frame['last'])
    others = [json.loads(line) for line in (folder / 'trace.2').read_text().splitlines()]
    directions = [frame['direction'] for frame in others]
    assert directions == ['request', 'answer'], 'each line has its own'


def test_the_motor_lives_in_real_time(link):
    with Simulator(settings={'control.accel': 0.5}, control='', link=link) as simulator:
        with simulator.lock:
            drive = simulator.drives[1]
            for register, word in ((0x294, 3), (0x3FC, 200), (0x298, 0x101)):
                server(drive).write(register, [word])
        begin = time.monotonic()
        with Client.at_link(link) as client:
            state = client.wait_for(lambda state: state['frequency'] == 20, timeout=60)
        assert time.monotonic() - begin > 0.15
        assert state['turning'] and state['driven']


def test_many_drives(link, open_master):
    addresses = tuple(range(1, 31))
    numbers = ['LEFT']
    with Simulator(addresses, link=link, serial_numbers=numbers) as simulator:
        master = open_master(link)
        for address in addresses:
            assert master.ask(address, MODE_BUS, 8)[0] == address
        assert [state['mode'] for state in simulator.states().values()] == [3] * 30
        assert master.ask(1, b'\x11', 21)[:7] == b'\x01\x11\x10LEFT'
        assert simulator.state(1)['serial_number'] == 'LEFT' + 12 * ' '
        assert b'1.50/400' in master.ask(2, bytes.fromhex('2B0E0200'), 88)


# ---- several lines, other protocols ----


def test_control_taken_by_one_line_is_seen_by_the_other(folder, open_master):
    links = [str(folder / name) for name in ('nfo0', 'nfo1')]
    with Simulator(
        protocol='classic', link=links[0], echo=True, also=[f'modbus_rtu:{links[1]}']
    ) as simulator:
        assert simulator.ports == tuple(links)
        classic, modbus = map(open_master, links)

        def say(frame, count):
            classic.send(frame)
            return classic.receive(len(frame) + count)[len(frame) :]

        for write in ('0602940003', '0603FC00FA'):
            assert len(modbus.ask(1, bytes.fromhex(write), 8)) == 8
        assert say(enquiry('E001E'), 14) == reply('E001E', 250)
        assert say(select_('E00AD', 0x101), 2) == ACK
        assert modbus.ask(1, READ_INV_ST, 7)[4] in (38, 39)
        assert say(enquiry('EFFFF'), 2) == NAK
        assert modbus.ask(1, READ_INV_ST, 7)[4] == 14
        assert modbus.ask(1, READ_MODE, 7)[4] == 1


def test_sio_errors_and_torn_counters_on_request(open_master):
    with Simulator(protocol='classic') as simulator:
        master = open_master(simulator.port)
        simulator.inject('sio-error', 1)
        assert (simulator.state()['sio_err'], simulator.state()['fault']) == (2, 0)
        for frame in (select_('E0029', 3), enquiry('E0127'), enquiry('E00AC')):
            simulator.inject('torn')
            master.send(frame)
            master.receive(2 if frame[2] == 2 else 14)
        assert simulator.state()['parameters']['status.op_time'] == 6553.6
        assert simulator.state()['sio_err_reads'] == 1
        simulator.inject('sio-error', 14)
        assert (simulator.state()['fault'], simulator.state()['mode']) == (14, 1)
        with pytest.raises(ValueError, match='no bit 12'):
            simulator.inject('sio-error', 12)


def test_movitrac_drives_on_two_interfaces(open_master):
    both = {'protocol': 'movitrac', 'also': ['movitrac']}
    with Simulator([0, 63], model='movitrac31', **both) as simulator:
        masters = [open_master(port) for port in simulator.ports]

        def say(frame, count, master=masters[0]):
            master.send(frame)
            return master.receive(count)

        assert len(say(movitrac.enquiry(movitrac.HEAT_SINK, 63), 8)) == 8
        for index, value in ((205, 2), (223, 20)):
            assert say(movitrac.select(index, movitrac.bcd(value)), 2) == movitrac.ACK
        run = bytes([0, 0, 0, movitrac.CW | movitrac.ENABLE])
        assert say(movitrac.select(movitrac.BITS, run), 2) == movitrac.ACK
        assert simulator.state(0)['driven'] and not simulator.state(63)['driven']
        for master, value in zip(masters, (2.0, 3.0), strict=True):
            assert say(movitrac.select(25, movitrac.bcd(value)), 2, master) == movitrac.ACK
        for master in masters:
            last = movitrac.data(25, movitrac.bcd(3.0))
            assert say(movitrac.enquiry(25), 8, master) == last, 'the last counts'


def test_canopen_beside_modbus():
    with Simulator(protocol='modbus_rtu', also=['canopen']) as simulator:
        settings = LineSettings(baud_rate=125_000, response_timeout=10.0)
        link = CanopenLink.on_port(simulator.ports[1], settings)
        link.open()
        assert link.read(1, Address('object', 0x2005, None, 4)).data == (1500).to_bytes(4, 'little')
        link.close()
        with pytest.raises(ValueError, match='only a CAN bus'):
            simulator.inject('traffic', 1000)


# ---- what it is made of ----


def test_the_format_is_the_protocols_and_the_firmware_the_dialects():
    for protocol, baud, char_format, bus_type in (
        ('modbus_rtu', 19200, '8E1', 'MbusRtu'),
        ('modbus_ascii', 19200, '7E1', 'MbusAsc'),
        ('modbus_tcp', 19200, '8E1', 'MbusRtu'),
        ('classic', 9600, '7E1', 'NFO'),
    ):
        with Simulator(protocol=protocol) as simulator:
            timing = simulator.timing
            assert (timing.baud, timing.char_format) == (baud, char_format)
            assert simulator.state()['parameters']['serial.bus_type'] == bus_type
    older = {'settings': {'fieldbus.sw_ver': 4.27}}
    for options, firmware in (
        ({}, 4.38), ({'dialect': '2.03'}, 4.38), ({'dialect': '5.0'}, 4.21),
        ({'dialect': '5.0', **older}, 4.27), (older, 4.27),
    ):
        with Simulator(protocol='classic', **options) as simulator:
            assert simulator.state()['parameters']['fieldbus.sw_ver'] == firmware


def test_impossible_simulators():
    classic, canopen = {'protocol': 'classic'}, {'protocol': 'canopen'}
    optimal = {'model': 'sinus_optimal'}
    movitrac31 = {'model': 'movitrac31', 'protocol': 'movitrac'}
    for options, text in (
        ({'addresses': (0,)}, '1 to 247'),
        ({'addresses': (248,)}, '1 to 247'),
        ({'addresses': (1, 1)}, 'twice'),
        ({'addresses': ()}, 'needs a drive'),
        ({'protocol': 'profinet'}, 'choose one of modbus_rtu'),
        ({'model': 'sinus_x'}, 'sinus_g2'),
        ({'baud': 115200}, '57600'),
        ({'char_format': '9E1'}, '8E1'),
        ({'char_format': '7E1'}, '8 data bits'),
        ({'link': '/tmp/x', 'tcp': 0}, 'exclude each other'),
        ({'settings': {'control.acel': 1}}, "no parameter 'control.acel'"),
        ({'settings': {'control.accel': 1000}}, 'out of range'),
        ({'settings': {'serial.address': 2}}, 'with --address'),
        ({'serial_numbers': ['1', '2']}, '2 serial numbers for 1 drives'),
        ({'serial_numbers': ['0123456789ABCDEFG']}, 'at most 16 characters'),
        ({'newer_functions': 'unknown'}, 'known, refused, silent'),
        ({**classic, 'addresses': (95,)}, '1 to 94'),
        ({'also': ['classic'], 'addresses': (95,)}, '1 to 94'),
        ({**classic, **optimal}, 'does not speak classic'),
        ({'also': ['classic'], **optimal}, 'does not speak classic'),
        ({'protocol': 'modbus_ascii', 'char_format': '8E1'}, '7 data bits'),
        ({'protocol': 'modbus_tcp', 'link': '/tmp/x'}, 'needs a TCP port'),
        ({'protocol': 'modbus_tcp', 'echo': True}, 'has no echo'),
        ({**classic, 'dialect': '5.0', 'baud': 19200}, '9600 at most'),
        ({**classic, 'dialect': '5.0', 'char_format': '8E1'}, '7E1, 8N1'),
        ({**classic, 'char_format': '8N1'}, '8N2'),
        ({'char_format': '8N1'}, '8N2'),
        ({'dialect': '4.0'}, '2.03, 5.0'),
        ({'dialect': '5.0', 'settings': {'fieldbus.sw_ver': 4.38}}, 'not that of firmware'),
        ({'dialect': '5.0', **optimal}, 'no option dialect'),
        ({'enable_bit': 'anded'}, 'sinus_g2 has no option enable_bit'),
        ({'also': ['profinet']}, 'choose one of modbus_rtu'),
        ({'also': ['modbus_tcp:/tmp/x']}, 'needs a TCP port'),
        ({'also': ['modbus_tcp:70000']}, '65535'),
        ({**canopen, 'baud': 19200}, '19200 bit/s: choose one of 10000, 20000'),
        ({**canopen, 'addresses': [128]}, '1 to 127 over canopen'),
        ({**canopen, 'echo': True}, 'canopen has no echo'),
        ({**canopen, **optimal}, 'sinus_optimal does not speak canopen'),
        ({**canopen, 'canopen_types': 'long'}, 'canopen_types: choose one of'),
        ({'model': 'movitrac31'}, 'movitrac31 does not speak modbus_rtu'),
        ({**movitrac31, 'addresses': [64]}, '0 to 63'),
        ({**movitrac31, 'baud': 19200}, '9600 8N1'),
        ({**movitrac31, 'char_format': '8E1'}, '9600 8N1'),
        ({**movitrac31, 'settings': {'serial.inverter_address': 2}}, 'with --address'),
        ({**movitrac31, 'enable_bit': 'sometimes'}, 'anded'),
        ({'tcp': 70000}, '65535'),
    ):
        with pytest.raises(ValueError, match=text):
            Simulator(**options)
