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

from nfo_sinus_driver.simulator.main import _parser, _simulator, main
from nfo_sinus_driver.simulator.plc import PlcSetting
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


# ---- in this process ----


def the_line(simulator):
    return simulator.line.name, simulator.line.speed, *simulator.drives


def state_of(*keys):
    """What the state of the drive at address 1 has at some keys."""
    def found(simulator):
        state = simulator.state(1)
        return [state.get(key, state['parameters'].get(key)) for key in keys]
    return found


def variant_of(*names):
    return lambda simulator: [
        getattr(simulator.drives[1].control_unit.variant, name) for name in names
    ]


@pytest.mark.parametrize(('options', 'look', 'found'), [
    ('', the_line, ('modbus_rtu', '19200 8E1', 1)),
    ('--baud-rate 9600 --char-format 8N2', the_line, ('modbus_rtu', '9600 8N2', 1)),
    ('--family yaskawa_v1000', the_line, ('modbus_rtu', '9600 8N1', 31)),
    ('--family yaskawa_v1000 --tcp 0 --protocol modbus_tcp --address 2', the_line,
        ('modbus_tcp', '19200 8E1', 2)),
    ('--protocol canopen --address 1 --address 7 --baud-rate 250000', the_line,
        ('canopen', '250000 bit/s', 1, 7)),
    ('--protocol classic --dialect 5.0', state_of('fieldbus.sw_ver'), [4.21]),
    ('--set control.retard=60 --no-run-input --serial ONE',
        state_of('control.retard', 'run_input', 'serial_number'), [60, False, f'{"ONE":16}']),
    ('--boot-time 0.5', lambda simulator: simulator.drives[1].boot_time, 0.5),
    ('--run-command-in-fault keeps --canopen-types wide',
        variant_of('run_command_in_fault', 'canopen_types', 'commands'),
        ['keeps', 'wide', 'edges']),
    ('--protocol telegram1 --address 1-2 --block 1:0 --block 1:16 --answer-time 0.01:0.02 '
        '--exchange-time 1 --no-function-23 --not-released',
        lambda simulator: simulator.plc.setting,
        PlcSetting(blocks=[(1, 0), (1, 16)], answer_time=(0.01, 0.02), exchange=1.0,
            write_and_read=False, released=False)),
])  # fmt: skip
def test_options_reach_the_line_and_the_drives(options, look, found):
    simulator = _simulator(_parser().parse_args(options.split()))
    assert look(simulator) == found
    simulator.stop()


def test_the_control_channel_of_a_tcp_port_is_known_by_its_number(inject):
    with _simulator(_parser().parse_args(['--protocol', 'modbus_tcp'])) as simulator:
        port = simulator.port.partition(':')[2]
        assert inject('--tcp', port, 'state')[0] == 0


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


def test_output_that_cannot_be_written_is_said(link):
    with Simulator((1,), link=link, control=''), open('/dev/full', 'w') as out:
        command = [*COMMAND, 'inject', '--link', link, 'state']
        done = subprocess.run(
            command, cwd=ROOT, stdout=out, stderr=subprocess.PIPE, timeout=PATIENCE, text=True
        )
    why = 'the output cannot be written: No space left on device'
    assert (done.returncode, done.stderr) == (1, f'simulator inject: {why}\n')


@pytest.mark.parametrize(
    'words',
    [
        ('load', 'nan'), ('load', 'inf'), ('silence', '-1'), ('silence', 'nan'),
        ('power-cycle', 'inf'), ('line-dead', '-0.1'), ('hangup', 'nan'), ('delay', '1', 'nan'),
        ('noise-rate', 'delay', '0.1', '1', 'nan'), ('burst', 'nan'), ('traffic', 'inf'),
    ],
)
def test_a_number_that_is_none_is_refused(link, inject, words):
    with Simulator((1,), link=link, control=''):
        with pytest.raises(SystemExit) as left:
            inject('--link', link, *words)
        assert left.value.code == 2


def test_inject_does_what_is_typed_and_says_what_is_wrong(link, inject):
    with Simulator((1, 2), link=link, control=''):

        def do(*arguments):
            status, out, err = inject('--link', link, '--address', '1', *arguments)
            assert (status, err) == (0, ''), arguments
            return out

        do('fault', '5', '--standing')
        assert json.loads(do('state'))['fault'] == 5
        do('load', '-0.5')
        do('delay', '1', '0.5')
        do('silence', '5')
        assert json.loads(do('state'))['silent']
        status, _, err = inject('--link', link, 'fault', '5')
        assert status == 1 and 'say which drive, with --address: 1, 2' in err
    status, _, err = inject('--link', link + 'x', 'fault', '5')
    assert status == 1 and 'no simulator listens at' in err


# what a simulator cannot be is in test_simulator.py
@pytest.mark.parametrize(('arguments', 'text'), [
    ('--model sinus_g3', 'sinus_g2'),
    ('--protocol profinet', 'modbus_rtu'),
    ('--address 1 --address 1', 'given twice'),
    ('--set control.acel=1', 'did you mean control.accel'),
    ('--model sinus_optimal --set control.acel=1', 'did you mean control.accel'),
    ('--set control.accel', 'is not NAME=VALUE'),
    ('--set control.accel=fast', 'not a number'),
    ('--turnaround -1', '0 or more'),
    ('--block 1:x', 'is not UNIT:REGISTER'),
    ('--newer-functions no', 'invalid choice'),
    ('inject fault 5', 'say which simulator'),
    ('inject --link x', 'VERB'),
    ('inject --link x fault', 'code'),
    ('inject --link x run maybe', 'on'),
    *((f'--address={wrong}', 'no list of addresses, such as 1-10,20')
        for wrong in ('', '1-', '-3', '3-1', '1,x', '1-9999999999')),
])  # fmt: skip
def test_wrong_arguments(arguments, text, capsys):
    with pytest.raises(SystemExit) as exit_:
        main(arguments.split())
    assert exit_.value.code == 2
    said = capsys.readouterr().err
    assert text in said and said.count('\n') == 1, 'no usage: it is longer than a screen'


def test_a_place_that_cannot_be_had_and_help(capsys, folder):
    for arguments, text in (
        (['--link', str(folder / 'no' / 'nfo0')], 'cannot make the link'),
        (['--link', str(folder / 'nfo0'), '--trace', str(folder / 'no' / 't')], 'No such file'),
        (['--link', str(folder / 'nfo0'), '--trace', str(folder)], f'{folder}: Is a directory'),
    ):
        assert main(arguments) == 1
        said = capsys.readouterr().err
        assert text in said and 'Errno' not in said
    assert list(folder.iterdir()) == []
    for arguments in (['--help'], ['inject', '--help'], ['inject', 'fault', '-h']):
        with pytest.raises(SystemExit) as exit_:
            main(arguments)
        assert exit_.value.code == 0
        assert 'usage: simulator' in capsys.readouterr().out
