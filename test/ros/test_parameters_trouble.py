# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters that cannot be set: the answer says why, and ROS and the drive have the same."""

from __future__ import annotations

from collections.abc import Callable
import itertools
import time

from bench import PATIENCE, Bench, Client, wait_until
from connections import needs
from parameter_bench import (
    QUIET,
    Stubborn,
    Wire,
    Write,
    refused,
    register,
    set_each_async,
    set_one,
    values,
    written,
)
import pytest
from std_srvs.srv import Trigger

from nfo_sinus_driver.simulator.memory import Reason, Refused

pytestmark = needs('parameters')

#: SCMD = Stop [M0 table 5, table 18].
_STOP = Write(1, 0x0298, (0,))
#: How soon one says that a drive does not answer, s: not a time-out for each of a hundred settings.
_SOON = PATIENCE
#: How long a drive takes for an answer here, so that the driver does not wait for all of them, s.
_LONG = 6.0


def _agree(client: Client, drive: Stubborn) -> None:
    """Wait until ROS shows what the drive has, of all of it."""
    wait_until(lambda: values(client, *drive.names) == drive.parameters(), 'ROS and drive agree')


def _stands(drive: Stubborn) -> None:
    """Wait until the drive reports that the motor stands."""
    wait_until(lambda: drive.simulator.state()['state'] == 'READY_TO_SWITCH_ON', 'it stands')


@pytest.fixture
def stubborn(bench: Bench) -> Stubborn:
    # ended by the bench, after the driver
    return bench.enter_context(Stubborn(bench))


@pytest.fixture
def client(bench: Bench, stubborn: Stubborn) -> Client:
    # each refusal is of one kind: a drive that has to wait for the processor is no silent one
    bench.driver(*QUIET, '-p', 'response_timeout:=1.0')
    return bench.client().connected()


@pytest.fixture
def wire(bench: Bench, client: Client) -> Wire:
    return Wire(bench)


def _refusing(name: str, reason: Reason) -> Callable[[str, str], None]:
    def happens(what: str, key: str) -> None:
        if (what, key) == ('write', name):
            raise Refused(reason, 'stubborn')

    return happens


# --- what the drive reports ---------------------------------------------------------------------


@pytest.mark.parametrize('reason', Reason)
def test_what_was_written_before_a_refusal_is_put_back(
    stubborn: Stubborn, client: Client, wire: Wire, reason: Reason
) -> None:
    before = stubborn.parameters()
    stubborn.before_requests(_refusing('error.rst_dly', reason))
    wanted = {'control.accel': 6.0, 'control.st_mode': 'Release', 'error.rst_dly': 3}
    result = client.set_parameters(poll_rate=20.0, **wanted)
    refused(result, 'error.rst_dly', 'put back', 'control.accel', 'control.st_mode')
    assert result.reason.startswith('error.rst_dly: ')
    assert stubborn.parameters() == before
    assert values(client, *stubborn.names) == before
    assert client.parameter('poll_rate') == 10.0
    assert wire.written()[-2:] == [
        written('control.st_mode', (1,)), written('control.accel', (5000, 0))
    ]
    assert set_one(client, 'control.accel', 6.0).successful, 'the others can be set'


@needs('sio_tot')
def test_drive_timeout_that_is_refused_takes_the_parameters_back(
    stubborn: Stubborn, client: Client
) -> None:
    before = stubborn.parameters()
    stubborn.before_requests(_refusing('serial.auto_stop', Reason.STATE))
    result = client.set_parameters(**{'control.accel': 6.0, 'drive_timeout': 3.0})
    refused(result, 'drive_timeout', 'serial.auto_stop', 'put back')
    assert stubborn.parameters() == before
    assert values(client, *stubborn.names) == before
    assert client.parameter('drive_timeout') == -1.0


@needs('sio_tot')
def test_a_drive_timeout_that_may_be_written_later_is_said_to_be(bench: Bench) -> None:
    stubborn = bench.enter_context(Stubborn(bench))
    bench.driver(*QUIET, '-p', 'response_timeout:=10.0', '-p', 'lost_after:=60.0')
    client = bench.client().connected()
    slow = True

    def happens(what: str, key: str) -> None:
        if slow and key.startswith('serial.'):
            time.sleep(_LONG)

    stubborn.before_requests(happens)
    refused(client.set_parameters(lost_after=1.0, drive_timeout=3.0), 'drive_timeout', 'may do it')
    slow = False
    assert client.parameter('drive_timeout') == -1.0
    wait_until(lambda: stubborn.parameters()['serial.sio_tot'] == 3.0, 'it does it')


def test_what_cannot_be_put_back_is_named_and_shown(stubborn: Stubborn, client: Client) -> None:
    writes = itertools.count()

    def happens(what: str, key: str) -> None:
        if what == 'write' and key.startswith('control.') and next(writes):
            raise Refused(Reason.STATE, 'stubborn')

    stubborn.before_requests(happens)
    result = client.set_parameters(**{'control.accel': 6.0, 'control.retard': 7.0})
    refused(result, 'control.retard: ', 'control.accel is NOT put back to 5 s')
    assert stubborn.parameters()['control.accel'] == 6.0
    _agree(client, stubborn)
    assert client.parameter('control.accel') == 6.0


def test_a_value_that_the_drive_alters_is_put_back(
    stubborn: Stubborn, client: Client, wire: Wire
) -> None:
    before = stubborn.parameters()
    memory = stubborn.drive.memory

    def happens(what: str, key: str) -> None:
        # it knows half seconds alone, say
        if (what, key) == ('read', 'control.accel'):
            memory.put(key, memory.raw(key) // 500 * 500)

    stubborn.before_requests(happens)
    refused(
        set_one(client, 'control.accel', 6.3),
        'control.accel', 'keeps 6 s', '6.3 s was written', '5 s as before',
    )
    assert wire.written() == [
        written('control.accel', (6300, 0)), written('control.accel', (5000, 0))
    ]
    assert stubborn.parameters() == before
    _agree(client, stubborn)


def test_a_fault_that_stands_is_named(stubborn: Stubborn, client: Client) -> None:
    before = stubborn.parameters()
    stubborn.simulator.inject('fault', 5)
    client.wait_for('status', lambda status: status.fault, 'the fault')
    text = stubborn.simulator.state()['inv_st_text']
    refused(set_one(client, 'control.accel', 6.0), 'control.accel', text, '/nfo_sinus/fault_ack')
    assert stubborn.parameters() == before
    assert client.call('fault_ack').success
    assert set_one(client, 'control.accel', 6.0).successful


def test_what_a_running_motor_forbids_keeps_the_others_from_being_written(
    stubborn: Stubborn, client: Client, wire: Wire
) -> None:
    before = stubborn.parameters()
    with client.run_at(10.0):
        wire.writes()
        wanted = {'freque.f_fix1': 60.0, 'motor.u_nom': 230, 'motor.p_nom': 2.2}
        refused(client.set_parameters(**wanted), 'motor.u_nom', 'motor.p_nom', 'stopped')
        registers = {register(name) for name in wanted}
        assert registers.isdisjoint(write.register for write in wire.writes())
        assert stubborn.parameters() == before
        assert client.set_parameters(**{'freque.f_fix1': 60.0, 'motor.u_nom': 400}).successful
        assert client.newest('status').enabled, 'and it runs on'
    assert client.call('stop').success
    _stands(stubborn)
    assert set_one(client, 'motor.u_nom', 230).successful
    _agree(client, stubborn)


def test_every_third_request_for_a_setting_refused_leaves_ros_and_the_drive_the_same(
    stubborn: Stubborn, client: Client
) -> None:
    requests = itertools.count(1)
    difficult = True

    def happens(what: str, key: str) -> None:
        if difficult and key in stubborn.names and next(requests) % 3 == 0:
            raise Refused(Reason.STATE, 'stubborn')

    stubborn.before_requests(happens)
    before = stubborn.parameters()
    for name in itertools.islice((name for name in stubborn.names if 'fix' in name), 24):
        value = before[name] + 1.0
        result = set_one(client, name, value)
        has = stubborn.parameters()[name]
        assert has == (value if result.successful else before[name]) or 'NOT' in result.reason
        assert result.successful or result.reason.startswith(name)
    client.call('refresh_parameters')
    assert len(client.parameter_names() & set(stubborn.names)) == len(stubborn.names)
    difficult = False
    client.connected()
    assert client.call('refresh_parameters').success
    _agree(client, stubborn)


# --- no answer ---------------------------------------------------------------------------------


def test_a_drive_that_goes_silent_in_the_middle_is_known_again_when_it_is_back(
    stubborn: Stubborn, client: Client
) -> None:
    def happens(what: str, key: str) -> None:
        if (what, key) == ('write', 'control.retard'):
            stubborn.drive.silence(3600.0)

    stubborn.before_requests(happens)
    started = time.monotonic()
    result = client.set_parameters(**{'control.accel': 6.0, 'control.retard': 7.0, 'poll_rate': 20})
    assert time.monotonic() - started < _SOON
    refused(result, 'control.retard', '7 s', 'not known', 'control.accel is NOT put back')
    assert values(client, 'control.accel', 'control.retard', 'poll_rate') == {
        'control.accel': 5.0, 'control.retard': 5.0, 'poll_rate': 10.0
    }
    stubborn.simulator.inject('silence', 0.0)
    client.connected()
    assert stubborn.parameters()['control.retard'] == 7.0
    assert stubborn.parameters()['control.accel'] == 6.0
    assert client.call('refresh_parameters').success
    _agree(client, stubborn)


def test_a_silent_drive_is_reported_soon_and_nothing_changes(
    stubborn: Stubborn, client: Client
) -> None:
    before = stubborn.parameters()
    stubborn.simulator.inject('silence', 3600.0)
    client.wait_for('status', lambda status: not status.connected, 'it is lost')
    started = time.monotonic()
    refused(set_one(client, 'control.accel', 6.0), 'control.accel', 'check the cable')
    refused(client.set_parameters(**{'control.accel': 6.0, 'motor.u_nom': 230}), 'check the cable')
    answer = client.call('refresh_parameters')
    assert not answer.success
    assert 'check the cable' in answer.message
    assert time.monotonic() - started < 3 * _SOON
    assert values(client, *stubborn.names) == before, 'what was read last'
    stubborn.simulator.inject('silence', 0.0)
    client.wait_for('status', lambda status: status.connected, 'it is back')
    assert set_one(client, 'control.accel', 6.0).successful
    _agree(client, stubborn)


def test_a_port_that_is_gone_is_reported_soon(
    bench: Bench, stubborn: Stubborn, client: Client
) -> None:
    stubborn.simulator.inject('hangup', 5.0)
    client.wait_for('status', lambda status: not status.connected, 'it is lost')
    started = time.monotonic()
    refused(set_one(client, 'control.accel', 6.0), 'control.accel', bench.port)
    assert time.monotonic() - started < _SOON
    assert client.parameter('control.accel') == 5.0
    client.wait_for('status', lambda status: status.connected, 'it is back')
    assert set_one(client, 'control.accel', 6.0).successful
    _agree(client, stubborn)


def test_a_stop_goes_before_all_that_is_being_set_on_a_silent_drive(
    stubborn: Stubborn, client: Client, wire: Wire
) -> None:
    with client.run_at(20.0):
        stubborn.simulator.inject('silence', 4.0)
        fixed = {name: 2.0 for name in stubborn.names if 'fix' in name}
        setting = client.set_parameters_async(**fixed)
        each = set_each_async(client, *fixed.items())
        wire.writes()
        started = time.monotonic()
        stop = client.call_async('stop', Trigger)
        wait_until(lambda: _STOP in wire.every_write(), 'a request to stop')
        wait_until(stop.done, 'the stop answers')
        assert time.monotonic() - started < _SOON
    wait_until(setting.done, 'an answer')
    wait_until(each.done, 'all answers', timeout=2 * PATIENCE)
    _stands(stubborn)
    client.wait_for('status', lambda status: status.connected, 'it is back')
    assert client.call('refresh_parameters').success
    _agree(client, stubborn)
