# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive identifies itself as, in log and diagnostics; what it costs where it does not."""

from __future__ import annotations

import itertools
import re
import signal

from bench import Bench, Client, wait_until
from connections import needs
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
import pytest

pytestmark = needs('identity', 'modbus')

_QUICK = ('--set', 'control.accel=1', '--set', 'control.retard=1')
_SERIAL = '0123456789ABCDEF'
_DEVICE, _SLAVE_ID = '012b0e0200', '0111'
_STOP = '010602980000'


def _asked(bench: Bench) -> list[str]:
    """The requests that ask who the drive is, in order; what had no answer in time only once."""
    identifying = (_DEVICE, _SLAVE_ID)
    asked = (
        start for hex_ in bench.requests() for start in identifying if hex_.startswith(start)
    )
    return [start for start, _ in itertools.groupby(asked)]


def _diagnosis(client: Client, name: str = 'nfo_sinus') -> DiagnosticStatus:
    """Return the newest diagnosis of a connected drive."""

    def seen() -> DiagnosticStatus | None:
        for message in reversed(client.messages['diagnostics']):
            for status in message.status:
                ours = status.name == f'{name}: drive' and status.level == DiagnosticStatus.OK
                if ours and not status.message.startswith('not connected'):
                    return status
        return None

    diagnosis: DiagnosticStatus = wait_until(seen, 'diagnostics of a connected drive')
    return diagnosis


def _values(diagnosis: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in diagnosis.values}


@pytest.mark.parametrize('method', ['mode_scmd', 'monitor'])
def test_log_and_diagnostics_name_the_drive(bench: Bench, method: str) -> None:
    drive = bench.simulator('--serial', _SERIAL)
    driver = bench.driver('-p', f'control_method:={method}')
    client = bench.client().connected()
    assert (
        f'connected: NFO Sinus 1.50/400, firmware 4.38 / 4018, serial {_SERIAL}\n' in driver.text
    )
    diagnosis = _diagnosis(client)
    assert diagnosis.hardware_id == _SERIAL
    values = _values(diagnosis)
    assert values['model'] == 'NFO Sinus 1.50/400'
    assert values['serial number'] == _SERIAL
    assert values['firmware'] == '4.38 / 4018'
    assert _asked(bench) == [_DEVICE, _SLAVE_ID]
    assert not drive.state()['command_writes']


def test_it_is_asked_once_for_each_connection(bench: Bench) -> None:
    drive = bench.simulator('--serial', _SERIAL)
    driver = bench.driver()
    client = bench.client().connected()
    drive.inject('silence', 3.0)
    client.wait_for('status', lambda status: not status.connected, 'it is lost')
    client.wait_for('status', lambda status: status.connected, 'it is back')
    wait_until(lambda: driver.text.count(f'serial {_SERIAL}') == 2, 'it is named again')
    # while it was silent it may have been asked the same to find out whether it is there
    before = _asked(bench)
    assert client.change_state(Transition.TRANSITION_DEACTIVATE)
    assert client.change_state(Transition.TRANSITION_CLEANUP)
    assert client.change_state(Transition.TRANSITION_CONFIGURE)
    assert _asked(bench) == [*before, _DEVICE, _SLAVE_ID]


@pytest.mark.parametrize('treated', ['refused', 'silent'])
def test_a_drive_without_an_identity_connects_and_runs(bench: Bench, treated: str) -> None:
    drive = bench.simulator('--newer-functions', treated, *_QUICK)
    # else a machine that stands still asks again, to be certain whose answer it has
    driver = bench.driver('-p', 'response_timeout:=4.0')
    client = bench.client().connected()
    (line,) = re.findall(r'connected: .*', driver.text)
    assert line == 'connected: sinus_g2, firmware 4.38 / 4018'
    diagnosis = _diagnosis(client)
    assert diagnosis.hardware_id == ''
    values = _values(diagnosis)
    assert (values['model'], values['serial number']) == ('', '')
    assert values['firmware'] == '4.38 / 4018'
    with client.run_at(20.0):
        assert drive.state()['driven']
    # no retries, and a refusal is not complained of
    assert _asked(bench) == [_DEVICE, _SLAVE_ID]
    statistics = client.wait_for('statistics', lambda message: True, 'statistics')
    assert statistics.retries == 0
    assert 'ERROR' not in driver.text


def test_a_motor_found_running_is_stopped_before_the_drive_is_identified(bench: Bench) -> None:
    # with a drive that keeps silence to such questions, so that a stop behind them would be late
    drive = bench.simulator('--newer-functions', 'silent', *_QUICK)
    driver = bench.driver()
    client = bench.client().connected()
    with client.run_at(20.0):
        driver.signal(signal.SIGKILL)
        driver.wait()
        assert drive.state()['driven'], 'the drive runs on, and that makes this a test'
        before = len(bench.requests())
        bench.driver()
        wait_until(lambda: 'connected: sinus_g2' in bench.log, 'a new driver is connected')
    requests = bench.requests()[before:]
    stops = [number for number, hex_ in enumerate(requests) if hex_.startswith(_STOP)]
    questions = [number for number, hex_ in enumerate(requests) if hex_.startswith(_DEVICE)]
    assert len(questions) == 1
    assert stops[0] < questions[0]
    assert drive.state()['scmd'] == 0


def test_two_drives_are_distinguished(bench: Bench) -> None:
    bench.simulator('--address', '1', '--address', '2', '--serial', 'LEFT', '--serial', 'RIGHT')
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(
        'nfo_sinus_bus: {ros__parameters: {drives: [left, right]}}\n'
        'left: {ros__parameters: {address: 1}}\n'
        'right: {ros__parameters: {address: 2}}\n'
    )
    bench.driver('--params-file', str(parameters))
    left = bench.client('/left').connected()
    right = bench.client('/right').connected()
    assert _diagnosis(left, 'left').hardware_id == 'LEFT'
    assert _diagnosis(right, 'right').hardware_id == 'RIGHT'
