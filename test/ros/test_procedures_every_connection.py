# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The procedures through ROS, over a connection of each kind; the answer says what is lacking."""

from __future__ import annotations

from collections.abc import Iterator

from action_msgs.msg import GoalStatus
from bench import PATIENCE, Bench, Client, seconds, wait_until
from connections import Connection
from nfo_sinus_msgs.action import Tune
from nfo_sinus_msgs.msg import ErrorLogEntry
from nfo_sinus_msgs.srv import GetErrorLog
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from tuner import Tuner

from nfo_sinus_driver.demo.bench import own_domain
from nfo_sinus_driver.simulator.control import Client as Simulated

#: test/unit/drive has the same over every connection.
pytestmark = pytest.mark.each_kind

_KEPT = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_TUNING = 28
_NOT_THERE = 'is not known of this model'


class Rig:
    """One drive and its driver, which polls so seldom that polls miss stages."""

    def __init__(self, bench: Bench) -> None:
        self.connection = bench.connection
        self.drives = bench.drives
        # an enable has left P841 so; with another one a MOVITRAC ignores the reset bit [C110]
        movitrac = ('--set', 'serial.control_mode=Remote control')
        options = movitrac if bench.connection.model == 'movitrac31' else ()
        self.drive: Simulated = bench.simulator('--boot-time', '0.5', *options)
        bench.driver('-p', 'poll_rate:=2.0')
        self.client: Client = bench.client().connected()
        self.client.listen('entry', ErrorLogEntry, '/nfo_sinus/error_log_entry', _KEPT)

    @property
    def logs(self) -> bool:
        return self.connection.model != 'sinus_optimal'

    @property
    def log_has_times(self) -> bool:
        """New entries are published only where the log says when they came."""
        return self.connection.model == 'sinus_g2'

    @property
    def tunes(self) -> bool:
        return self.connection.model == 'sinus_g2'


@pytest.fixture(scope='module')
def rig(tmp_path_factory: pytest.TempPathFactory, connection: Connection) -> Iterator[Rig]:
    with own_domain() as domain, Bench(domain, tmp_path_factory.mktemp('rig'), connection) as bench:
        yield Rig(bench)


def test_a_fault_is_logged_published_and_acknowledged(rig: Rig) -> None:
    reads = rig.drive.state().get('ack_reads')
    overload = rig.drives.overload
    rig.drive.inject('fault', overload.code)
    rig.client.wait_for('inv_st', lambda status: status.code == overload.code, 'the fault')
    if rig.log_has_times:
        entry = rig.client.wait_for('entry', lambda entry: entry.code == overload.code, 'its entry')
        assert entry.text.startswith(overload.text) and seconds(entry.stamp) > 0
    log = rig.client.call('get_error_log', GetErrorLog)
    if rig.logs:
        assert log.success and log.entries[0].code == overload.code
        assert log.entries[0].text.startswith(overload.text)
    else:
        assert not log.success and 'not documented' in log.message
    assert rig.drive.state().get('ack_reads') == reads
    assert rig.client.call('fault_ack').message == f'acknowledged {overload}'
    assert rig.drive.state()['fault'] == 0
    erased = rig.client.call('erase_error_log')
    assert erased.success is rig.tunes, erased.message
    assert rig.tunes or _NOT_THERE in erased.message


def test_the_energy_is_reset_or_the_answer_says_why_not(rig: Rig) -> None:
    answer = rig.client.call('reset_energy')
    if rig.connection.name == 'classic_v5':
        assert not answer.success and 'firmware 4.38' in answer.message
    elif rig.tunes:
        assert answer.success and answer.message.endswith('-> 0.000 kWh'), answer.message
        assert rig.drive.state()['parameters']['status.e_out'] == 0
    else:
        assert not answer.success and _NOT_THERE in answer.message


def test_the_action_reports_every_stage(rig: Rig) -> None:
    tuner = Tuner(rig.client)
    status, result = tuner.result(tuner.begin(Tune.Goal.STATOR_RESISTANCE))
    if not rig.tunes:
        assert status == GoalStatus.STATUS_ABORTED
        assert _NOT_THERE in result.message and 'at the keypad' in result.message
        return
    assert status == GoalStatus.STATUS_SUCCEEDED, result.message
    assert any(text.startswith('motor.r_stat: ') for text in result.changed)
    # feedback is on its way beside the result
    wait_until(lambda: tuner.feedback[-1].status.text == 'RsMeasOK', 'the last stage')
    codes = [feedback.status.code for feedback in tuner.feedback]
    assert _TUNING in codes
    times = [feedback.elapsed for feedback in tuner.feedback]
    assert times == sorted(times) and times[0] < times[-1]


def test_the_action_is_cancelled(rig: Rig) -> None:
    if not rig.tunes:
        pytest.skip('it does not tune')
    tuner = Tuner(rig.client)
    handle = tuner.begin(Tune.Goal.FULL)
    rig.drive.wait_for(lambda state: state['inv_st'] == _TUNING, timeout=PATIENCE)
    tuner.cancel(handle)
    status, result = tuner.result(handle)
    assert status == GoalStatus.STATUS_CANCELED
    assert not result.success and 'was stopped' in result.message
    assert rig.drive.state()['mode'] == 1


def test_tuning_is_refused_with_the_reason(rig: Rig) -> None:
    if not rig.tunes:
        assert _NOT_THERE in rig.client.call('tune_full').message
        return
    with rig.client.run_at(8.0):
        assert 'the motor is enabled' in rig.client.call('tune_full').message
    rig.drive.inject('fault', 5)
    rig.client.wait_for('status', lambda status: status.fault and not status.enabled, 'the fault')
    message = rig.client.call('tune_basic').message
    assert message.startswith('fault 5 Overload is active: ')
    assert message.endswith('then call /nfo_sinus/fault_ack')
    assert rig.client.call('fault_ack').success
