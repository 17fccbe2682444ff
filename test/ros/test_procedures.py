# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Error log, kWh counter and tuning, through ROS."""

from __future__ import annotations

import signal

from action_msgs.msg import GoalStatus
from bench import PATIENCE, Bench, Client, seconds, wait_until
from connections import needs
from nfo_sinus_msgs.action import Tune
from nfo_sinus_msgs.msg import ErrorLogEntry
from nfo_sinus_msgs.srv import GetErrorLog
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import Trigger
from tuner import Tuner

#: The other connections have their tests beside those of the drive, without ROS.
pytestmark = needs('parameters', 'fine')

_TUNING = 28


def _standing(bench: Bench) -> int:
    """Return what a drive shows that stands and was left: Stop, or Bus Stby where it is held."""
    return 24 if 'local' in bench.connection.features else 37


def start(bench: Bench, *arguments: str) -> tuple:
    simulator = bench.simulator()
    bench.driver('-p', 'poll_rate:=50.0', *arguments)
    return simulator, bench.client().connected()


def _last_error(client: Client) -> str:
    for array in reversed(client.messages['diagnostics']):
        for status in array.status:
            if status.name == 'nfo_sinus: drive':
                return {pair.key: pair.value for pair in status.values}['last error']
    return ''


def test_the_error_log_is_read_and_erased(bench: Bench) -> None:
    simulator, client = start(bench)
    for code in (5, 12, 3):
        simulator.inject('fault', code)
    wait_until(lambda: simulator.state()['fault'] == 5, 'the faults stand')
    assert client.call('fault_ack').success
    log = client.call('get_error_log', GetErrorLog, max_entries=0)
    assert log.success, log.message
    assert [(entry.code, entry.text) for entry in log.entries] == [
        (3, 'Temp Hi'),
        (12, 'Cur High'),
        (5, 'Overload'),
    ]
    assert all(abs(entry.operating_time - 1234.5) < 0.2 for entry in log.entries)
    assert all(0 <= entry.age < 0.2 for entry in log.entries)
    assert len(client.call('get_error_log', GetErrorLog, max_entries=2).entries) == 2
    erased = client.call('erase_error_log')
    assert erased.success, erased.message
    assert simulator.state()['error_log'] == []
    assert bench.drives.left(simulator.state())
    assert list(client.call('get_error_log', GetErrorLog).entries) == []


def test_a_new_entry_is_published_with_the_fault(bench: Bench) -> None:
    simulator = bench.simulator()
    simulator.inject('fault', 3)
    simulator.inject('power-cycle', 0.1)
    bench.driver('-p', 'poll_rate:=50.0')
    client = bench.client().connected()
    kept = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    client.listen('entry', ErrorLogEntry, '/nfo_sinus/error_log_entry', kept)
    wait_until(lambda: _last_error(client).startswith('3 Temp Hi'), 'the log is read')
    before = client.node.get_clock().now().nanoseconds / 1e9
    with client.run_at(10.0):
        simulator.inject('fault', 5)
        entry = client.wait_for('entry', lambda entry: entry.code == 5, 'the entry')
    assert (entry.text, len(client.messages['entry'])) == ('Overload', 1)
    assert abs(entry.operating_time - 1234.5) < 0.2
    assert before <= seconds(entry.stamp) <= client.node.get_clock().now().nanoseconds / 1e9
    assert not simulator.state()['driven']
    client.wait_for('status', lambda status: status.fault, 'the fault stands')
    assert simulator.state()['ack_reads'] == 0
    wait_until(lambda: _last_error(client).startswith('5 Overload at'), 'reported there')
    # both are of the tick of the first reading, and may be from before it was switched on
    log = client.call('get_error_log', GetErrorLog)
    assert [entry.code for entry in log.entries] == [5, 3]
    assert [seconds(entry.stamp) for entry in log.entries] == [0, 0]
    assert '2 of them without the wall time' in log.message
    # who comes late gets it too
    late = bench.client()
    late.listen('entry', ErrorLogEntry, '/nfo_sinus/error_log_entry', kept)
    late.wait_for('entry', lambda message: message == entry, 'the entry')


def test_the_energy_is_reset(bench: Bench) -> None:
    simulator, client = start(bench)
    answer = client.call('reset_energy')
    assert answer.success, answer.message
    assert answer.message == 'status.e_out: 1.234 -> 0.000 kWh'
    assert simulator.state()['parameters']['status.e_out'] == 0
    with client.run_at(10.0):
        answer = client.call('reset_energy')
        assert not answer.success and 'stop it first' in answer.message


@pytest.mark.parametrize(
    ('service', 'shown'),
    [
        ('tune_full', 'TuningOK'),
        ('tune_basic', 'TuningOK'),
        ('measure_rs', 'RsMeasOK'),
        ('calculate_parameters', 'ParClcOK'),
    ],
)
def test_a_service_answers_at_the_end(bench: Bench, service: str, shown: str) -> None:
    simulator, client = start(bench)
    before = simulator.state()['parameters']
    answer = client.call(service)
    assert answer.success, answer.message
    assert shown in answer.message
    after = simulator.state()['parameters']
    changed = [key for key in after if key.startswith('motor.') and after[key] != before[key]]
    assert changed and all(f'{key}: ' in answer.message for key in changed)
    # the parameters of the node follow
    wait_until(
        lambda: all(abs(client.parameter(key) - after[key]) < 1e-6 for key in changed),
        'the parameters of the node are those of the drive',
    )


def test_the_node_answers_and_the_status_flows_meanwhile(bench: Bench) -> None:
    _, client = start(bench)
    future = client.call_async('tune_full', Trigger)
    client.wait_for('inv_st', lambda status: status.code == _TUNING, 'it tunes')
    polls = len(client.messages['status'])
    second = client.call('tune_basic')
    assert not second.success and 'is going on already' in second.message
    assert client.state() == 'active'
    refused = client.set_parameters(**{'control.accel': 9.0})
    assert not refused.successful and 'tuning' in refused.reason
    assert client.call('get_error_log', GetErrorLog).success
    assert len(client.messages['status']) > polls
    assert not future.done()
    wait_until(future.done, 'it ends')
    assert future.result().success, future.result().message


def test_the_action_reports_its_progress_and_what_changed(bench: Bench) -> None:
    _, client = start(bench)
    tuner = Tuner(client)
    status, result = tuner.result(tuner.begin(Tune.Goal.FULL))
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert result.success and 'TuningOK' in result.message
    assert {text.split(':')[0] for text in result.changed} >= {'motor.r_stat', 'motor.sigma'}
    assert all(' -> ' in text for text in result.changed)
    during = [feedback for feedback in tuner.feedback if feedback.status.code == _TUNING]
    assert during and during[-1].elapsed > during[0].elapsed >= 0
    assert during[0].status.text == 'Tuning'


def test_the_action_is_cancelled(bench: Bench) -> None:
    simulator, client = start(bench)
    tuner = Tuner(client)
    handle = tuner.begin(Tune.Goal.FULL)
    simulator.wait_for(lambda state: state['inv_st'] == _TUNING, timeout=PATIENCE)
    tuner.cancel(handle)
    status, result = tuner.result(handle)
    assert status == GoalStatus.STATUS_CANCELED
    assert not result.success and 'was stopped' in result.message
    assert simulator.state()['inv_st'] == _standing(bench)
    # and the next one goes well
    assert client.call('calculate_parameters').success


def test_a_failure_and_a_procedure_that_there_is_not(bench: Bench) -> None:
    simulator, client = start(bench)
    tuner = Tuner(client)
    assert not tuner.ask(9).accepted
    wait_until(lambda: '/nfo_sinus/tune rejected: there is no procedure 9' in bench.log, 'said')
    simulator.inject('tuning-fails', 17)
    status, result = tuner.result(tuner.begin(Tune.Goal.STATOR_RESISTANCE))
    assert status == GoalStatus.STATUS_ABORTED
    assert not result.success and '17 TunFailM' in result.message
    assert client.call('fault_ack').success


def test_ctrl_c_ends_a_tuning(bench: Bench) -> None:
    simulator = bench.simulator()
    driver = bench.driver()
    client = bench.client().connected()
    future = client.call_async('tune_full', Trigger)
    simulator.wait_for(lambda state: state['inv_st'] == _TUNING, timeout=PATIENCE)
    driver.signal(signal.SIGINT)
    assert driver.wait() == 0
    state = simulator.state()
    assert state['inv_st'] == _standing(bench) and bench.drives.left(state)
    del future
