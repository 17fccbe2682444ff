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

"""The commands ``simulator`` and ``simulator inject``, as processes of their own."""

import ctypes
import json
import os
from pathlib import Path
import re
import signal
import subprocess
import sys

import pytest

from nfo_sinus_driver.simulator.main import main

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


def inject(capsys, *arguments):
    """Run ``simulator inject`` in this process; return status, output and errors."""
    status = main(['inject', *arguments])
    out, err = capsys.readouterr()
    return status, out, err


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_it_says_what_it_serves_and_leaves_nothing_behind(start, link, open_master, number):
    process, line = start('--link', link, '--address', '1', '--address', '2')
    assert line == (
        f'serving modbus_rtu at 19200 8E1 on {link}, drives 1, 2; control {link}.control'
    )
    assert len(open_master(link).ask(2, READ_MODE, 7)) == 7
    process.send_signal(number)
    assert process.wait(PATIENCE) == 0
    assert not os.path.lexists(link)
    assert not os.path.lexists(f'{link}.control')
    assert process.stderr.read() == ''


def test_it_ends_though_it_was_suspended(start, link):
    process, _ = start('--link', link)
    # as a shell ends a suspended job
    process.send_signal(signal.SIGSTOP)
    process.send_signal(signal.SIGTERM)
    process.send_signal(signal.SIGCONT)
    assert process.wait(PATIENCE) == 0
    assert not os.path.lexists(link)


def test_a_signal_that_comes_to_another_thread_ends_it(start, link):
    process, _ = start('--link', link)
    # the system chooses one when the process was suspended, and Python does not wake the main one
    other = max(int(path.name) for path in Path(f'/proc/{process.pid}/task').iterdir())
    assert other != process.pid
    assert ctypes.CDLL(None).tgkill(process.pid, other, signal.SIGTERM) == 0
    assert process.wait(PATIENCE) == 0
    assert not os.path.lexists(link)


def test_a_killed_one_is_replaced_and_a_live_one_is_not(start, link):
    process, _ = start('--link', link)
    second, line = start('--link', link)
    assert second.wait(PATIENCE) == 1
    assert 'already serves' in second.stderr.read()
    process.kill()
    process.wait()
    assert os.path.lexists(link)
    _, line = start('--link', link)
    assert line.startswith('serving')


def test_tcp_and_its_control_channel(start, capsys):
    process, line = start('--tcp', '0', '--set', 'control.retard=60', '--no-run-input')
    port = re.search(r'on 127\.0\.0\.1:(\d+), drive 1;', line)[1]
    status, out, _ = inject(capsys, '--tcp', port, 'state')
    assert status == 0
    state = json.loads(out)['1']
    assert state['parameters']['control.retard'] == 60
    assert state['run_input'] is False
    process.terminate()
    assert process.wait(PATIENCE) == 0


def test_without_link_it_names_the_device(start, capsys, open_master):
    _, line = start('--paced', '--baud-rate', '57600', '--turnaround', '0.01')
    pattern = r'at 57600 8E1 on (/dev/pts/\d+), drive 1; control (\S+)'
    port, control = re.search(pattern, line).groups()
    assert len(open_master(port).ask(1, READ_MODE, 7)) == 7
    status, _, _ = inject(capsys, '--control', control, 'fault', '5')
    assert status == 0


def test_what_the_manuals_leave_open_is_chosen_by_options(start, link, capsys, open_master):
    start(
        *('--link', link, '--run-command-in-fault', 'keeps', '--refuses-in-fault', 'scmd'),
        *('--stop-in-tuning', 'refused'),
    )
    master = open_master(link)

    def scmd(code):
        answer = master.ask(1, bytes.fromhex('060298') + code.to_bytes(2, 'big'), 8, timeout=0.3)
        return answer[1] == 0x06 or answer[2]

    def driven():
        _, out, _ = inject(capsys, '--link', link, 'state')
        return json.loads(out)['1']['driven']

    master.ask(1, bytes.fromhex('0602940003'), 8)
    assert scmd(0x101) is True
    assert driven()
    inject(capsys, '--link', link, 'fault', '5')
    assert not driven()
    assert scmd(0) == 4, 'SCMD is refused in a fault'
    master.ask(1, bytes.fromhex('0302A40001'), 7)
    assert driven(), 'the run command is kept'
    assert scmd(0) is True
    inject(capsys, '--link', link, 'power-cycle', '0')
    master.ask(1, bytes.fromhex('0602940003'), 8)
    assert scmd(0x201) is True
    assert scmd(0) == 4, 'a tuning goes on to its end'


def test_inject(start, link, capsys):
    start('--link', link, '--address', '1', '--address', '2')

    def do(*arguments):
        status, _, err = inject(capsys, '--link', link, '--address', '1', *arguments)
        assert (status, err) == (0, '')

    def state():
        _, out, _ = inject(capsys, '--link', link, '--address', '1', 'state')
        return json.loads(out)

    do('fault', '5', '--standing')
    assert state()['fault'] == 5
    do('ack-cause-gone')
    do('run', 'off')
    assert state()['run_input'] is False
    do('run', 'on')
    assert state()['run_input'] is True
    do('set', 'control.accel', '7')
    assert state()['parameters']['control.accel'] == 7
    for verb in [
        ['keypad', 'stop'],
        ['line-dead', '0.1'],
        ['noise'],
        ['damage', '3'],
        ['delay', '1', '0.5'],
        ['drop', '1'],
        ['double', '1'],
        ['heal'],
        ['load', '0.5'],
        ['hangup', '0.1'],
        ['silence', '5'],
        ['power-cycle'],
    ]:
        do(*verb)
    assert state()['silent']


def test_inject_says_what_is_wrong(start, link, capsys):
    start('--link', link, '--address', '1', '--address', '2')
    status, _, err = inject(capsys, '--link', link, 'fault', '5')
    assert status == 1
    assert 'say which drive, with --address: 1, 2' in err
    status, _, err = inject(capsys, '--link', link + 'x', 'fault', '5')
    assert status == 1
    assert 'no simulator listens at' in err


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (['--model', 'sinus_g3'], 'sinus_g2'),
        (['--protocol', 'profinet'], 'modbus_rtu'),
        (['--address', '0'], '1 to 247'),
        (['--address', '248'], '1 to 247'),
        (['--address', 'x'], 'invalid'),
        (['--address', '1', '--address', '1'], 'given twice'),
        (['--set', 'control.acel=1'], 'did you mean control.accel'),
        (['--set', 'control.accel'], 'is not NAME=VALUE'),
        (['--set', 'control.accel=fast'], 'not a number'),
        (['--set', 'control.accel=1000'], 'out of range'),
        (['--set', 'serial.address=2'], 'with --address'),
        (['--baud-rate', '115200'], '57600'),
        (['--baud', '115200'], '57600'),
        (['--char-format', '7E1'], 'data bits'),
        (['--tcp', '70000'], '65535'),
        (['--tcp', '0', '--link', '/tmp/x'], 'exclude'),
        (['--turnaround', '-1'], '0 or more'),
        (['inject', 'fault', '5'], 'say which simulator'),
        (['inject', '--link', 'x'], 'VERB'),
        (['inject', '--link', 'x', 'fault'], 'code'),
        (['inject', '--link', 'x', 'run', 'maybe'], 'on'),
    ],
)
def test_wrong_arguments(capsys, arguments, text):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 2
    assert text in capsys.readouterr().err


def test_a_place_that_cannot_be_had(capsys, folder):
    assert main(['--link', str(folder / 'no' / 'nfo0')]) == 1
    assert 'cannot make the link' in capsys.readouterr().err
    assert main(['--link', str(folder / 'nfo0'), '--trace', str(folder / 'no' / 'trace')]) == 1
    assert 'No such file' in capsys.readouterr().err
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize('arguments', [['--help'], ['inject', '--help'], ['inject', 'fault', '-h']])
def test_help(capsys, arguments):
    with pytest.raises(SystemExit) as exit_:
        main(arguments)
    assert exit_.value.code == 0
    assert 'usage: simulator' in capsys.readouterr().out
