# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``record`` and ``plot``: the run of any drive goes to a bag and to a picture."""

from __future__ import annotations

import os
from pathlib import Path
import re
import signal
import struct
import subprocess
import sys
from types import SimpleNamespace

from bench import Bench, Process, wait_until
from connections import needs
import pytest

from nfo_sinus_driver.demo.recorded import drives_in, identity, read
from nfo_sinus_driver.demo.recording import topics_of

_RECORD = (sys.executable, '-m', 'nfo_sinus_driver.demo.record')
_PLOT = (
    sys.executable, '-c',
    'import sys; from nfo_sinus_driver.demo.record import plot; sys.exit(plot())',
)
_DRIVE = '/line1/infeed'
_TIME = 120.0
_TWO = """
/**/nfo_sinus_bus: {ros__parameters: {drives: [infeed, outfeed]}}
/**/outfeed: {ros__parameters: {address: 2, setpoint_timeout: 0.0}}
/**/infeed: {ros__parameters: {setpoint_timeout: 0.0}}
"""


def _recorder(bench: Bench, *arguments: str) -> Process:
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    process = Process([*_RECORD, *arguments], environment, bench.folder / 'record.log')
    bench.callback(process.end)
    return process


def _run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, capture_output=True, text=True, timeout=_TIME, check=False)


def _is_picture(path: Path) -> bool:
    return struct.unpack('>II', path.read_bytes()[16:24]) == (1600, 1000)


def _is_png(path: Path) -> bool:
    return path.read_bytes().startswith(b'\x89PNG')


@pytest.mark.slow
@needs('own')
def test_the_run_of_any_drive_is_recorded_and_drawn(bench: Bench) -> None:
    bench.simulator()
    bench.driver('-r', '__ns:=/line1', '-p', 'drives:=[infeed]')
    client = bench.client(_DRIVE).connected()
    folder = bench.folder / 'a' / 'b'
    recorder = _recorder(bench, _DRIVE, '--output', str(folder))
    # the graph alone does not do: who listens may be known here before the drive knows it
    wait_until(
        lambda: (
            f'{_DRIVE} is heard' in recorder.text
            and client.node.count_subscribers(f'{_DRIVE}/setpoint') == 2
        ),
        'the recorder listens',
    )
    with client.run_at(20.0):
        pass
    assert client.call('stop').success
    client.wait_for('status', lambda status: abs(status.actual) < 0.1, 'it stands')
    # and the recorder, too, has heard it
    known = len(client.messages['status'])
    wait_until(lambda: len(client.messages['status']) > known + 5, 'it still stands')
    # suspended meanwhile, it gets the signal to end before it receives the last set-point
    recorder.signal(signal.SIGSTOP)
    client.publish(7.0)
    recorder.signal(signal.SIGINT, thread=recorder.pid)
    recorder.signal(signal.SIGCONT)
    assert recorder.wait() == 0, recorder.text
    bag, drawn = folder / 'ride', folder / 'ride.png'
    assert f'the bag is {bag}' in recorder.text and f'the picture is {drawn}' in recorder.text
    assert 'Traceback' not in recorder.text
    assert recorder.text.count('is heard') == 1
    assert _is_picture(drawn)
    # `ros2 bag play` of it must not command the drive: what the driver obeys is named
    obeyed = client.node.get_subscriber_names_and_types_by_node('infeed', '/line1')
    excluded = re.search(r'--exclude-topics (\S+)`', recorder.text)
    assert excluded is not None, recorder.text
    recorded = set(topics_of(_DRIVE))
    assert {excluded.group(1)} == recorded & {name for name, _ in obeyed}
    assert 'another ROS_DOMAIN_ID' in recorder.text

    [run] = read(bag, drives_in(bag))
    assert max(run.actual.values) > 19 and abs(run.actual.values[-1]) < 0.1
    assert set(run.setpoint.values) == {20.0, 7.0} and run.unit == 'Hz'
    assert len(run.enabled) == 1 and 'running' in {span.what for span in run.phases}

    # and again, by itself
    done = _run(*_PLOT, str(bag), '--output', str(folder / 'again.png'))
    assert done.returncode == 0 and _is_picture(folder / 'again.png'), done.stderr
    done = _run(*_PLOT, str(bag), '--drive', 'other')
    assert done.returncode == 1 and 'there is no drive /other in it, only ' in done.stderr
    # the folder of the recording has it, too
    done = _run(*_PLOT, str(folder), '--output', str(folder / 'third.png'))
    assert done.returncode == 0 and _is_picture(folder / 'third.png'), done.stderr
    done = _run(*_PLOT, str(folder.parent))
    assert done.returncode == 1 and 'it is no bag' in done.stderr
    again = _run(*_RECORD, '--output', str(folder))
    assert again.returncode == 2 and 'is there already' in again.stderr


@needs('own')
def test_what_a_slow_machine_has_not_written_yet_is_in_the_bag_at_its_end(bench: Bench) -> None:
    program = """
import sys, time
from nfo_sinus_driver.demo import record, recording
write = recording.Recorder._write
recording.Recorder._write = lambda *message: time.sleep(0.05) or write(*message)
sys.exit(record.main())
"""
    bench.simulator(*bench.drives.ramps(1))
    bench.driver()
    client = bench.client().connected()
    command = [sys.executable, '-c', program, '--output', str(bench.folder / 'slow')]
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(bench.domain)}
    recorder = Process(command, environment, bench.folder / 'record.log')
    bench.callback(recorder.end)
    wait_until(lambda: 'is heard' in recorder.text, 'the recorder listens')
    with client.run_at(20.0):
        client.wait_for('status', lambda status: abs(status.actual - 20) < 0.1, 'it runs')
    assert client.call('stop').success
    client.wait_for('status', lambda status: abs(status.actual) < 0.1, 'it stands')
    recorder.signal(signal.SIGINT)
    assert recorder.wait() == 0, recorder.text
    [run] = read(bench.folder / 'slow' / 'ride', ['/nfo_sinus'])
    assert max(run.actual.values) > 19 and abs(run.actual.values[-1]) < 0.1


@pytest.mark.slow
@needs('own')
def test_all_drives_are_recorded_and_it_is_explained_why_they_stopped(bench: Bench) -> None:
    simulator = bench.simulator('--address', '1', '--address', '2')
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(_TWO)
    bench.driver('-r', '__ns:=/line1', '--params-file', str(parameters))
    infeed = bench.client('/line1/infeed').connected()
    outfeed = bench.client('/line1/outfeed').connected()
    bus = bench.client('/line1/nfo_sinus_bus')
    folder = bench.folder / 'all'
    recorder = _recorder(bench, '--all', '--output', str(folder))
    wait_until(lambda: recorder.text.count('is heard') == 2, 'the recorder hears both')
    infeed.enable()
    outfeed.enable()
    simulator.inject('fault', 5, address=1)
    infeed.wait_for('status', lambda status: status.stop_reason == status.REASON_FAULT, 'the fault')
    bus.call('stop_all')
    outfeed.wait_for(
        'status', lambda status: status.stop_reason == status.REASON_STOP_ALL, 'the stop'
    )
    known = len(outfeed.messages['status'])
    # the name of who called is there within a second
    wait_until(lambda: len(outfeed.messages['status']) > known + 80, 'it says who stopped it')
    recorder.signal(signal.SIGINT)
    assert recorder.wait() == 0, recorder.text
    assert _is_png(folder / 'ride.png') and 'infeed/setpoint /line1/outfeed/' in recorder.text

    done = _run(*_PLOT, str(folder / 'ride'), '--explain')
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.split('/line1/outfeed, times in s')
    assert 'STOPPED, fault: fault 5 Overload' in first and 'the drive shows' not in first
    name = bus.node.get_fully_qualified_name()
    assert 'STOPPED, stop all: a stop of all drives was requested: ' in second
    assert f'/line1/nfo_sinus_bus/stop_all called by {name}' in second
    assert 'enable (true) called by' in second and 'the drive shows' not in second


@needs('own')
def test_of_a_recorder_that_was_killed_all_but_the_last_two_seconds_is_there(bench: Bench) -> None:
    bench.simulator()
    bench.driver('-r', '__node:=nfo_sinus')
    client = bench.client().connected()
    output = bench.folder / 'cut'
    recorder = _recorder(bench, '--output', str(output))
    wait_until(lambda: '/nfo_sinus is heard' in recorder.text, 'it records')
    with client.run_at(20.0):
        client.wait_for('status', lambda status: status.enabled, 'it runs')
    client.call('stop')
    # what a healthy machine has done in two seconds, a busy one may do later
    wait_until(lambda: read(output / 'ride', ['/nfo_sinus'])[0].stops, 'it is on disk')
    recorder.signal(signal.SIGKILL)
    recorder.wait()
    assert not (output / 'ride' / 'metadata.yaml').exists()
    done = _run(*_PLOT, str(output), '--explain')
    assert done.returncode == 0, done.stderr
    assert 'STOPPED' in done.stdout and '/nfo_sinus/stop' in done.stdout
    assert _run(*_PLOT, str(output)).returncode == 0 and _is_png(output / 'ride.png')


@needs('own')
def test_a_recorder_without_messages_says_what_to_check(bench: Bench) -> None:
    recorder = _recorder(bench, '--output', str(bench.folder / 'out'), '--for', '6')
    assert recorder.wait() == 1
    assert 'nothing is heard of /nfo_sinus yet' in recorder.text
    assert f'in this ROS_DOMAIN_ID ({bench.domain})?' in recorder.text
    assert 'the bag is empty: nothing was heard' in recorder.text
    assert 'Traceback' not in recorder.text


@needs('own')
def test_a_signal_that_comes_to_another_thread_ends_a_recorder(bench: Bench) -> None:
    recorder = _recorder(bench, '--output', str(bench.folder / 'out'))
    wait_until(lambda: 'nothing is heard' in recorder.text, 'it waits without end')
    # the system chooses one when the process was suspended, and Python does not wake the main one
    other = max(int(path.name) for path in Path(f'/proc/{recorder.pid}/task').iterdir())
    recorder.signal(signal.SIGTERM, thread=other)
    assert recorder.wait() == 1
    assert 'the bag is empty: nothing was heard' in recorder.text


def test_a_recorder_refuses_what_cannot_be() -> None:
    for arguments, why in (
        (('a b',), 'must not contain characters other than alphanumerics'),
        (('--for', 'x'), "'x' is no time in s"),
        (('--for', '-1'), "'-1' is no time in s"),
    ):
        done = _run(*_RECORD, *arguments)
        assert done.returncode == 2 and why in done.stderr, done.stderr
    done = _run(*_RECORD, '--output', '/proc/none', '--for', '1')
    assert done.returncode == 1 and 'no bag can be written to /proc/none/ride' in done.stderr


def test_the_identity_of_a_drive_comes_from_its_own_diagnostics() -> None:
    def diagnostics(name: str, serial: str) -> SimpleNamespace:
        values = {'firmware': '4.38', 'serial number': serial}
        pairs = [SimpleNamespace(key=key, value=value) for key, value in values.items()]
        return SimpleNamespace(status=[SimpleNamespace(name=name, values=pairs)])

    arrays = [diagnostics('line1/outfeed: drive', 'A1'), diagnostics('line1/infeed: drive', 'B2')]
    assert identity(arrays, _DRIVE) == ['serial B2', 'firmware 4.38']
    assert identity(arrays, '/infeed') == []
