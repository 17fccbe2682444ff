# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The commands ``simulator`` and ``simulator inject``; what is about a process is one here."""

import ctypes
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

from classic_bench import enquiry, reply
import pytest

from nfo_sinus_driver.link.canopen_link import CanopenLink
from nfo_sinus_driver.link.interface import Address, LineSettings
from nfo_sinus_driver.simulator.main import main
from nfo_sinus_driver.simulator.simulator import Simulator

ROOT = Path(__file__).parents[3]
COMMAND = [sys.executable, '-m', 'nfo_sinus_driver.simulator']
#: No honest wait takes this long, on any machine, s.
PATIENCE = 60
READ_MODE = bytes.fromhex('0302940001')


@pytest.fixture
def start(folder):
    # the folder goes after what runs in it, which may put something there until its end
    running = []

    def start_(*arguments):
        process = subprocess.Popen(
            [*COMMAND, *arguments],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        running.append(process)
        return process, process.stdout.readline().rstrip('\n')

    yield start_
    for process in running:
        process.terminate()
        try:
            process.communicate(timeout=PATIENCE)
        finally:
            process.kill()


@pytest.fixture
def link(folder):
    return str(folder / 'nfo0')


@pytest.fixture
def inject(capsys):
    """Run ``simulator inject`` in this process; return status, output and errors."""

    def inject_(*arguments):
        status = main(['inject', *arguments])
        out, err = capsys.readouterr()
        return status, out, err

    return inject_


# ---- processes ----


def test_a_described_drive_is_served_as_it_leaves_the_factory(start, link):
    family = ['--family', 'yaskawa_v1000', '--link', link]
    assert f'modbus_rtu at 9600 8N1 on {link}, drive 31;' in start(*family)[1]


def test_a_described_drive_is_served_as_it_is_said(start):
    said = ['--tcp', '0', '--protocol', 'modbus_tcp', '--address', '2']
    assert re.search(r'modbus_tcp at 19200 8E1 on .*, drive 2;', start(
        '--family', 'yaskawa_v1000', *said
    )[1])


def test_it_says_what_it_serves_and_leaves_nothing_behind(start, link, open_master):
    process, line = start('--link', link, '--address', '1-2,5', '--address', '7')
    assert line == (
        f'serving modbus_rtu at 19200 8E1 on {link}, drives 1, 2, 5, 7; control {link}.control'
    )
    assert len(open_master(link).ask(2, READ_MODE, 7)) == 7
    second, _ = start('--link', link)
    assert second.wait(PATIENCE) == 1
    assert 'already serves' in second.stderr.read()
    process.send_signal(signal.SIGINT)
    assert process.wait(PATIENCE) == 0
    assert not os.path.lexists(link)
    assert not os.path.lexists(f'{link}.control')
    assert process.stderr.read() == ''
    killed, _ = start('--link', link)
    killed.kill()
    killed.wait()
    assert os.path.lexists(link)
    _, line = start('--link', link)
    assert line.startswith('serving'), 'one that was killed is replaced'


@pytest.mark.parametrize('wrong', ['', '1-', '-3', '3-1', '1,x', '1-9999999999'])
def test_what_is_no_list_of_addresses_is_refused(wrong, capsys):
    with pytest.raises(SystemExit):
        main([f'--address={wrong}'])
    assert 'no list of addresses, such as 1-10,20' in capsys.readouterr().err


def test_a_signal_ends_it_whatever_thread_it_comes_to_and_though_it_was_suspended(start, link):
    process, _ = start('--link', link)
    # as a shell ends a suspended job
    for number in (signal.SIGSTOP, signal.SIGTERM, signal.SIGCONT):
        process.send_signal(number)
    assert process.wait(PATIENCE) == 0
    assert not os.path.lexists(link)
    process, _ = start('--link', link)
    # the system chooses one when the process was suspended, and Python does not wake the main one
    other = max(int(path.name) for path in Path(f'/proc/{process.pid}/task').iterdir())
    assert other != process.pid
    assert ctypes.CDLL(None).tgkill(process.pid, other, signal.SIGTERM) == 0
    assert process.wait(PATIENCE) == 0
    assert not os.path.lexists(link)


def test_it_serves_several_lines_with_their_options(start, folder, open_master):
    links = [str(folder / name) for name in ('nfo0', 'nfo1')]
    _, line = start(
        *('--protocol', 'classic', '--link', links[0], '--also', f'modbus_ascii:{links[1]}'),
        *('--also', 'modbus_tcp:0', '--dialect', '5.0', '--echo', '--paced'),
        *('--gateway-timeout', '0.5', '--turnaround', '0.01'),
    )
    assert re.fullmatch(
        f'serving classic at 9600 7E1 on {links[0]}, drive 1; control {links[0]}.control; '
        rf'also modbus_ascii at 19200 7E1 on {links[1]}; '
        r'also modbus_tcp at 19200 8E1 on 127\.0\.0\.1:\d+',
        line,
    )
    master = open_master(links[0])
    master.send(enquiry('E0029', 0))
    assert master.receive(22) == enquiry('E0029', 0) + reply('E0029', 1, 1)
    other = open_master(links[1])
    other.send(b':01030294000165\r\n')
    assert other.receive(15) == b':0103020001F9\r\n'


def test_it_serves_tcp_and_its_control_channel(start, inject):
    settings = '--set', 'control.retard=60', '--no-run-input'
    for options in ((), settings):
        way = ('--tcp', '0') if options else ('--protocol', 'modbus_tcp')
        _, line = start(*way, *options)
        port = re.search(r'on 127\.0\.0\.1:(\d+), drive 1;', line)[1]
        status, out, _ = inject('--tcp', port, 'state')
        assert status == 0
        state = json.loads(out)['1']
        assert state['run_input'] is not bool(options)
        assert (state['parameters']['control.retard'] == 60) is bool(options)


def test_it_serves_canopen(start, folder):
    link = str(folder / 'nfo0')
    process, line = start(
        *('--protocol', 'canopen', '--address', '1', '--address', '7', '--link', link),
        *('--baud-rate', '250000', '--trace', str(folder / 'trace'), '--canopen-types', 'wide'),
    )
    assert line == f'serving canopen at 250000 bit/s on {link}, drives 1, 7; control {link}.control'
    client = CanopenLink.on_port(link, LineSettings(baud_rate=250_000, response_timeout=10.0))
    client.open()
    assert len(client.read(7, Address('object', 0x2022, None, 2)).data) == 4
    client.close()
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE) == 0
    trace = (folder / 'trace').read_text(encoding='ascii')
    hexed = re.findall(r'"direction": "(\w+)", "hex": "(\w+)"', trace)
    assert ('request', '06074022200000000000') in hexed
    assert ('answer', '05874322200003000000') in hexed


def test_what_the_manuals_leave_open_is_chosen_by_options(start, inject, open_master):
    _, line = start(
        *('--baud-rate', '57600', '--run-command-in-fault', 'keeps'),
        *('--refuses-in-fault', 'scmd', '--stop-in-tuning', 'refused'),
    )
    pattern = r'at 57600 8E1 on (/dev/pts/\d+), drive 1; control (\S+)'
    port, control = re.search(pattern, line).groups()
    master = open_master(port)

    def scmd(code):
        answer = master.ask(1, bytes.fromhex('060298') + code.to_bytes(2, 'big'), 8, timeout=0.5)
        return answer[1] == 0x06 or answer[2]

    def driven():
        return json.loads(inject('--control', control, 'state')[1])['1']['driven']

    master.ask(1, bytes.fromhex('0602940003'), 8)
    assert scmd(0x101) is True
    assert driven()
    assert inject('--control', control, 'fault', '5') == (0, '', '')
    assert not driven()
    assert scmd(0) == 4, 'SCMD is refused in a fault'
    master.ask(1, bytes.fromhex('0302A40001'), 7)
    assert driven(), 'the run command is kept'
    assert scmd(0) is True
    inject('--control', control, 'power-cycle', '0')
    master.ask(1, bytes.fromhex('0602940003'), 8)
    assert scmd(0x201) is True
    assert scmd(0) == 4, 'a tuning goes on to its end'


# ---- in this process ----


def test_inject_takes_a_list_of_addresses(link, inject):
    with Simulator((1, 2, 3, 4), link=link, control=''):
        assert inject('--link', link, '--address', '1-2,4', 'run', 'off') == (0, '', '')
        states = json.loads(inject('--link', link, 'state')[1])
        assert [states[at]['run_input'] for at in '1234'] == [False, False, True, False]
        two = json.loads(inject('--link', link, '--address', '2-3', 'state')[1])
        assert list(two) == ['2', '3']
        assert inject('--link', link, '--address', '4-6', 'state')[0] == 1


def test_a_reader_that_has_gone_is_no_error(link):
    with Simulator((1,), link=link, control=''):
        reading, writing = os.pipe()
        os.close(reading)
        command = [*COMMAND, 'inject', '--link', link, 'state']
        with open(writing, 'w') as out:
            done = subprocess.run(
                command, cwd=ROOT, stdout=out, stderr=subprocess.PIPE, timeout=PATIENCE
            )
        assert (done.returncode, done.stderr) == (0, b'')


def test_inject_does_every_verb_and_says_what_is_wrong(link, inject):
    with Simulator((1, 2), link=link, control=''):

        def do(*arguments):
            status, out, err = inject('--link', link, '--address', '1', *arguments)
            assert (status, err) == (0, ''), arguments
            return out

        def state():
            return json.loads(do('state'))

        do('fault', '5', '--standing')
        assert state()['fault'] == 5
        do('ack-cause-gone')
        for switch in ('off', 'on'):
            do('run', switch)
            assert state()['run_input'] is (switch == 'on')
        do('set', 'control.accel', '7')
        assert state()['parameters']['control.accel'] == 7
        for verb in (
            'keypad stop', 'line-dead 0.1', 'noise', 'damage 3', 'delay 1 0.5', 'drop 1',
            'double 1', 'heal', 'load 0.5', 'hangup 0.1', 'sio-error 4', 'torn', 'silence 5',
            'power-cycle',
        ):
            do(*verb.split())
        assert state()['silent']
        status, _, err = inject('--link', link, 'fault', '5')
        assert status == 1 and 'say which drive, with --address: 1, 2' in err
    status, _, err = inject('--link', link + 'x', 'fault', '5')
    assert status == 1 and 'no simulator listens at' in err


def test_wrong_arguments(capsys):
    for arguments, text in (
        ('--model sinus_g3', 'sinus_g2'),
        ('--protocol profinet', 'modbus_rtu'),
        ('--address 0', '1 to 247'),
        ('--address 248', '1 to 247'),
        ('--address x', 'no list of addresses'),
        ('--address 1 --address 1', 'given twice'),
        ('--set control.acel=1', 'did you mean control.accel'),
        ('--model sinus_optimal --set control.acel=1', 'did you mean control.accel'),
        ('--set control.accel', 'is not NAME=VALUE'),
        ('--set control.accel=fast', 'not a number'),
        ('--set control.accel=1000', 'out of range'),
        ('--set serial.address=2', 'with --address'),
        ('--baud-rate 115200', '57600'),
        ('--baud 115200', '57600'),
        ('--char-format 7E1', 'data bits'),
        ('--tcp 70000', '65535'),
        ('--tcp 0 --link /tmp/x', 'exclude'),
        ('--turnaround -1', '0 or more'),
        ('--protocol classic --address 100', '1 to 94'),
        ('--also bus:1', 'choose one of'),
        ('--dialect 3', '2.03'),
        ('--protocol classic --baud-rate 57600 --dialect 5.0', '9600 at most'),
        ('--protocol modbus_tcp --link x', 'needs a TCP port'),
        ('--serial 1 --serial 2', '2 serial numbers for 1 drives'),
        ('--serial 0123456789ABCDEFG', 'at most 16 characters'),
        ('--newer-functions no', 'invalid choice'),
        ('--model movitrac31', 'movitrac31 does not speak modbus_rtu'),
        ('--model movitrac31 --protocol movitrac --address 64', '0 to 63'),
        ('--model movitrac31 --protocol movitrac --baud-rate 19200', '9600 8N1'),
        ('--model movitrac31 --protocol movitrac --char-format 8E1', '9600 8N1'),
        (
            '--model movitrac31 --protocol movitrac --set serial.inverter_address=2',
            'with --address',
        ),
        ('--model movitrac31 --protocol movitrac --enable-bit sometimes', 'anded'),
        ('inject fault 5', 'say which simulator'),
        ('inject --link x', 'VERB'),
        ('inject --link x fault', 'code'),
        ('inject --link x run maybe', 'on'),
    ):
        with pytest.raises(SystemExit) as exit_:
            main(arguments.split())
        assert exit_.value.code == 2, arguments
        said = capsys.readouterr().err
        assert text in said, arguments
        # that of the simulator is longer than a screen
        assert 'usage' not in said or arguments.startswith('inject'), arguments


def test_a_place_that_cannot_be_had_and_help(capsys, folder):
    for arguments, text in (
        (['--link', str(folder / 'no' / 'nfo0')], 'cannot make the link'),
        (['--link', str(folder / 'nfo0'), '--trace', str(folder / 'no' / 't')], 'No such file'),
    ):
        assert main(arguments) == 1
        assert text in capsys.readouterr().err
    assert list(folder.iterdir()) == []
    for arguments in (['--help'], ['inject', '--help'], ['inject', 'fault', '-h']):
        with pytest.raises(SystemExit) as exit_:
            main(arguments)
        assert exit_.value.code == 0
        assert 'usage: simulator' in capsys.readouterr().out
