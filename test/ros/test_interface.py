# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Names, types, quality of service and answers, as a ROS user meets them."""

from __future__ import annotations

from collections.abc import Iterator
import functools
import itertools
import math
import re

from bench import FULL_RATE, PATIENCE, TOPICS, Bench, Client, seconds, wait_until
from connections import Connection, needs
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from nfo_sinus_msgs.msg import BusStatistics, DriveStatus, InvSt
from parameter_bench import Wire
import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from nfo_sinus_driver.demo.bench import own_domain

#: What a drive reports of itself that turns at its set-point.
_RUNNING = (
    'ready', 'switched_on', 'operation_enabled', 'network_control', 'network_reference',
    'setpoint_reached',
)

_SETTINGS = {
    'address': 1,
    'control_method': '',
    'autostart': True,
    'poll_rate': 50.0,
    'idle_poll_rate': 0.0,
    'telemetry_rate': 2.0,
    'setpoint_timeout': 2.5,
    'setpoint_max': 0.0,
    'expected_control_mode': '',
    'drive_timeout': -1.0,
    'lost_after': 1.0,
    'jam_current': 0.0,
    'jam_speed': 0.0,
    'jam_time': 2.0,
    'on_jam': 'warn',
    'shutdown_timeout': 4.0,
    'frame_id': '',
}


@pytest.fixture(scope='module')
def idle(tmp_path_factory: pytest.TempPathFactory, connection: Connection) -> Iterator[Client]:
    """A client of a driver and its drive at rest, for the tests that leave both as they are."""
    with (
        own_domain() as domain,
        Bench(domain, tmp_path_factory.mktemp('idle'), connection) as bench,
    ):
        bench.simulator(paced=True)
        bench.driver()
        yield bench.client().connected()


def _stamps_increase(client: Client, topic: str) -> bool:
    messages = [message for message in client.messages[topic] if message.connected]
    stamps = [seconds(message.header.stamp) for message in messages]
    # what changes while no newer answer has come has the stamp of the last one
    in_order = all(a <= b for a, b in itertools.pairwise(stamps))
    return len(set(stamps)) > 3 and in_order


@needs('direct')
def test_every_topic_says_what_the_drive_does(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    bench.driver(*FULL_RATE, '-p', 'frame_id:=drive', '-p', 'telemetry_rate:=10.0')
    client = bench.client().connected()
    with client.run_at(25.0):
        reached = 'setpoint_reached' not in bench.connection.unreported
        status = client.wait_for(
            'status',
            lambda status: abs(status.actual - 25) < 0.1 and status.setpoint_reached == reached,
            'reached',
        )
        assert status.header.frame_id == 'drive'
        method = bench.drives.control_method.upper()
        assert status.control_method == getattr(DriveStatus, method)
        assert status.control_mode == DriveStatus.FREQUE
        assert status.unit == 'Hz'
        assert status.setpoint == 25.0
        assert 0 <= status.setpoint_age < 2.5
        assert not status.setpoint_clamped
        assert status.actual == pytest.approx(25.0, abs=0.5)
        for name in _RUNNING:
            reported = name not in bench.connection.unreported
            valid = getattr(DriveStatus, f'VALID_{name.upper()}')
            assert bool(status.valid & valid) == reported, name
            assert getattr(status, name) == reported, name
        word = 'ready' not in bench.connection.unreported
        assert status.state == (DriveStatus.OPERATION_ENABLED if word else DriveStatus.UNKNOWN)
        assert not status.reverse and not status.fault
        assert status.valid & DriveStatus.VALID_FAULT
        reported = bench.connection.model == 'sinus_optimal'
        assert bool(status.valid & DriveStatus.VALID_RUN_INPUT_MISSING) == reported
        assert _stamps_increase(client, 'status')
        text = 'Sio Run' if bench.connection.dialect == '5.0' else bench.drives.running
        inv_st = client.wait_for('inv_st', lambda m: m.text == text, 'it runs')
        assert inv_st.kind == InvSt.STATUS
        client.wait_for('actual_frequency', lambda m: abs(m.data - 25) < 0.5, 'frequency')
        speed = drive.state()['speed']
        client.wait_for('actual_speed', lambda m: abs(m.data - speed) < 30, 'speed')
        # each value is as old as its own reading
        telemetry = client.wait_for(
            'telemetry',
            lambda m: abs(m.frequency - 25) < 0.5
            and (m.output_current > 1 or 'output_current' in bench.connection.unmeasured)
            and (m.output_voltage > 100 or 'output_voltage' in bench.connection.unmeasured),
            'telemetry',
        )
        values = {name: getattr(telemetry, name) for name in telemetry.get_fields_and_field_types()}
        del values['header']
        unknown = {name for name, value in values.items() if math.isnan(value)}
        assert unknown == bench.connection.unmeasured
        if 'dc_link_voltage' not in bench.connection.unmeasured:
            assert telemetry.dc_link_voltage == pytest.approx(565, abs=40)
    with client.setpoints(-10.0):
        client.wait_for('status', lambda status: status.actual < -9, 'reverse')
        assert client.newest('status').reverse == ('reverse' not in bench.connection.unreported)


def test_bus_statistics_and_diagnostics_flow_before_any_drive_answers(bench: Bench) -> None:
    bench.simulator('--address', '7', paced=True)
    driver = bench.driver(*FULL_RATE)
    client = bench.client()
    wait_until(lambda: len(client.messages['statistics']) > 1, 'statistics')
    client.wait_for('status', lambda status: not status.connected, 'a status all the same')
    assert math.isnan(client.newest('status').actual)
    wait_until(lambda: _diagnosis(client, 'nfo_sinus: drive'), 'diagnostics of the drive')
    wait_until(lambda: _diagnosis(client, 'nfo_sinus_bus: line'), 'diagnostics of the line')
    first, *others = bench.connection.no_answer
    wait_until(lambda: first in driver.text, 'advice in the log')
    advice = driver.text[driver.text.index(first) :]
    order = [advice.index(word) for word in others]
    assert order == sorted(order)
    client.wait_for('statistics', lambda message: message.transactions > 3, 'it goes on trying')
    assert driver.text.count(first) == 1, 'it is said once'


def _diagnosis(client: Client, name: str) -> DiagnosticStatus | None:
    for message in reversed(client.messages['diagnostics']):
        for status in message.status:
            if status.name == name:
                return status
    return None


def _values(status: DiagnosticStatus) -> dict[str, str]:
    return {pair.key: pair.value for pair in status.values}


@needs('direct')
def test_diagnostics_of_an_address_without_a_drive_are_steady(bench: Bench) -> None:
    bench.simulator('--address', '7', paced=True)
    driver = bench.driver(*FULL_RATE)
    client = bench.client()
    first, *others = bench.connection.no_answer

    def shown() -> bool:
        status = _diagnosis(client, 'nfo_sinus: drive')
        return status is not None and first in status.message

    wait_until(shown, 'what to check')
    client.wait_for('statistics', lambda message: message.transactions > 0, 'it was asked')
    seen = len(client.messages['diagnostics'])
    before = client.newest('statistics').transactions
    # over several tries of autostart, each with a rest
    client.wait_for('statistics', lambda message: message.transactions >= before + 3, 'more tries')
    reported = {
        (status.name, status.level, status.message)
        for message in client.messages['diagnostics'][seen:]
        for status in message.status
    }
    assert {name for name, *_ in reported} == {'nfo_sinus: drive', 'nfo_sinus_bus: line'}
    assert len(reported) == 2, reported
    for _, level, message in reported:
        assert level == DiagnosticStatus.ERROR
        assert all(word in message for word in others)
    assert driver.text.count(first) == 1
    assert client.newest('statistics').silent_drives == ['nfo_sinus']


@needs('direct')
def test_diagnostics_name_a_fault_with_its_remedy(bench: Bench) -> None:
    drive = bench.simulator(paced=True)
    bench.driver(*FULL_RATE)
    client = bench.client().connected()

    def level(level: bytes) -> DiagnosticStatus | None:
        status = _diagnosis(client, 'nfo_sinus: drive')
        return status if status is not None and status.level == level else None

    well = wait_until(lambda: level(DiagnosticStatus.OK), 'all is well')
    assert 'fault' not in _values(well)
    overvoltage = bench.drives.overvoltage
    drive.inject('fault', overvoltage.code)
    diagnosis = wait_until(lambda: level(DiagnosticStatus.ERROR), 'the fault')
    assert diagnosis.message.startswith(f'{overvoltage.text}: ')
    assert all(part in diagnosis.message for part in overvoltage.explained)
    assert _values(diagnosis)['fault'] == re.sub(r'\W+', '_', overvoltage.text.upper())
    inv_st = client.wait_for('inv_st', lambda m: m.code == overvoltage.code, 'the fault')
    assert inv_st.kind == InvSt.FAULT
    assert inv_st.requires_ack
    assert inv_st.remedy
    assert client.call('fault_ack').success
    over = wait_until(lambda: level(DiagnosticStatus.OK), 'the fault is over')
    assert 'fault' not in _values(over)


def test_diagnostics_of_a_node_that_is_not_configured_are_no_error(bench: Bench) -> None:
    bench.simulator(paced=True)
    bench.driver('-p', 'autostart:=false')
    client = bench.client()
    status = wait_until(lambda: _diagnosis(client, 'nfo_sinus: drive'), 'its diagnosis')
    assert status.level == DiagnosticStatus.OK
    assert status.message == 'not connected: the node is not configured'
    line = wait_until(lambda: _diagnosis(client, 'nfo_sinus_bus: line'), 'that of the line')
    # a path would be taken for the name of a node
    assert line.hardware_id and '/' not in line.hardware_id
    assert _values(line)['port'].endswith(line.hardware_id)


def test_diagnostics_of_a_run_name_its_fault_and_cry_over_no_stop_that_goes_well(
    bench: Bench,
) -> None:
    drive = bench.simulator(paced=True)
    bench.driver(*FULL_RATE)
    client = bench.client().connected()

    def said() -> list[str]:
        messages = client.messages['diagnostics']
        return [status.message for message in messages for status in message.status]

    with client.run_at(20.0):
        assert client.call('stop').success
    drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)
    with client.run_at(20.0):
        fault = bench.drives.overload
        drive.inject('fault', fault.code)
        # at once, and with the second that follows
        wait_until(
            lambda: sum(line.startswith(f'{fault.text}: ') for line in said()) > 1, 'the fault'
        )
    assert not [line for line in said() if 'NOT confirmed' in line]


@needs('direct')
def test_inv_st_is_there_for_late_comers(bench: Bench) -> None:
    bench.simulator(paced=True)
    bench.driver()
    bench.client().connected()
    late = bench.client()
    late.wait_for('inv_st', lambda m: m.text == bench.drives.stopped, 'the inverter status')


def test_quality_of_service(idle: Client) -> None:
    node = idle.node
    for topic in TOPICS:
        publishers = functools.partial(node.get_publishers_info_by_topic, f'/nfo_sinus/{topic}')
        (info,) = wait_until(publishers, f'the publisher of {topic}')
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE, topic
        latched = info.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert latched == (topic == 'inv_st'), topic
    (info,) = node.get_subscriptions_info_by_topic('/nfo_sinus/setpoint')
    assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert info.qos_profile.durability == DurabilityPolicy.VOLATILE


@needs('direct')
def test_the_settings_have_their_defaults_and_descriptions(bench: Bench) -> None:
    bench.simulator(paced=True)
    given = {'port': bench.port, **bench.connection.driver}
    bench.bare_driver(*(word for item in given.items() for word in ('-p', '{}:={}'.format(*item))))
    client = bench.client().connected()
    names = client.parameter_names()
    for name, default in {**_SETTINGS, 'model': bench.connection.model}.items():
        assert name in names
        assert client.parameter(name) == default
        assert client.descriptor(name).description
    assert client.descriptor('setpoint_timeout').floating_point_range[0].to_value == 3600
    bus = bench.client('/nfo_sinus_bus')
    assert bus.parameter('response_timeout') == 0.2
    assert bus.parameter('drives') == ['nfo_sinus']
    assert bus.descriptor('port').read_only


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('address', 5, 'unconfigured'),
        ('control_method', 'monitor', 'unconfigured'),
        ('setpoint_timeout', -1.0, 'setpoint_timeout'),
        ('drive_timeout', 0.55, 'at least 1.5 s'),
        ('drive_timeout', 2.25, 'lies between two steps of the drive, 2.2 and 2.3'),
        ('drive_timeout', 26.0, 'drive_timeout'),
        ('expected_control_mode', 'Warp', "choose one of '', 'Freque'"),
        ('poll_rate', 'fast', 'write a number'),
    ],
)
def test_a_setting_that_makes_no_sense_is_refused_with_the_reason(
    idle: Client, name: str, value: object, reason: str
) -> None:
    before = idle.parameter(name)
    result = idle.set_parameters(**{name: value})
    assert not result.successful
    assert reason in result.reason
    assert idle.parameter(name) == before


def test_settings_take_effect_at_once_and_integers_are_taken_for_doubles(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.ramps(1), paced=True)
    bench.driver(*FULL_RATE)
    client = bench.client().connected()
    assert client.set_parameters(setpoint_max=10, telemetry_rate=20).successful
    assert client.parameter('setpoint_max') == 10.0
    with client.setpoints(30.0):
        assert client.enable().success
        status = client.wait_for('status', lambda status: status.setpoint_clamped, 'clamped')
        # a telegram counts in steps
        assert status.setpoint == pytest.approx(10.0, abs=0.01)
    if not bench.connection.tells or bench.connection.method == 'telegram1':
        # nothing is set at the drive
        return
    assert client.set_parameters(drive_timeout=2).successful
    assert bench.drives.has_timeout(drive.state(), 2.0)
    writes = drive.state()['writes']
    assert client.set_parameters(drive_timeout=2.0).successful
    assert drive.state()['writes'] == writes, 'only a change is written'


@needs('timeout')
def test_what_the_drive_has_already_is_not_written(bench: Bench) -> None:
    drive = bench.simulator(*bench.drives.timeout(2), paced=True)
    bench.driver(*FULL_RATE, '-p', 'drive_timeout:=2.0')
    client = bench.client().connected()
    assert not drive.state()['writes']
    assert client.enable().success
    assert not {'serial.sio_tot', 'serial.auto_stop', 'serial.pc_timeout'} & {
        *drive.state()['writes']
    }


def test_an_integer_on_the_command_line_is_taken_for_a_double(bench: Bench) -> None:
    bench.simulator(paced=True)
    bench.driver(*FULL_RATE, '-p', 'setpoint_timeout:=3')
    assert bench.client().connected().parameter('setpoint_timeout') == 3.0


def test_lifecycle_by_hand(bench: Bench) -> None:
    bench.simulator(paced=True)
    bench.driver(*FULL_RATE, '-p', 'autostart:=false')
    client = bench.client()
    client.wait_for('status', lambda status: not status.connected, 'the node is there')
    assert client.state() == 'unconfigured'
    assert client.change_state(Transition.TRANSITION_CONFIGURE)
    client.wait_for('status', lambda status: status.connected, 'connected')
    assert client.state() == 'inactive'
    assert not client.messages['actual_speed']
    assert not client.enable().success
    assert client.change_state(Transition.TRANSITION_ACTIVATE)
    client.wait_for('actual_speed', lambda message: True, 'the speed')
    assert client.change_state(Transition.TRANSITION_DEACTIVATE)
    assert client.change_state(Transition.TRANSITION_CLEANUP)
    client.wait_for('status', lambda status: not status.connected, 'disconnected')
    assert client.set_parameters(address=9).successful
    assert not client.change_state(Transition.TRANSITION_CONFIGURE)
    assert client.set_parameters(address=1).successful
    assert client.change_state(Transition.TRANSITION_CONFIGURE)
    assert client.change_state(Transition.TRANSITION_INACTIVE_SHUTDOWN)
    assert client.state() == 'finalized'


@needs('own')
def test_a_refused_enable_names_the_transitions_that_lead_to_it(bench: Bench) -> None:
    bench.simulator()
    bench.driver('-p', 'autostart:=false')
    client = bench.client()
    transitions = {
        'configure': Transition.TRANSITION_CONFIGURE,
        'activate': Transition.TRANSITION_ACTIVATE,
    }
    for state in ('unconfigured', 'inactive'):
        while client.state() != state:
            assert client.change_state(transitions['configure'])
        refused = client.enable()
        assert not refused.success
        named = re.findall('configure|activate', refused.message.partition(': ')[2])
        assert all(client.change_state(transitions[name]) for name in named), refused.message
        assert client.state() == 'active', refused.message
        assert client.change_state(Transition.TRANSITION_DEACTIVATE)
        assert client.change_state(Transition.TRANSITION_CLEANUP)


@needs('modbus', 'scmd')
def test_another_control_method_waits_until_the_motor_stands(bench: Bench) -> None:
    drive = bench.simulator('--set', 'control.accel=0.5', '--set', 'control.retard=30', paced=True)
    driver = bench.driver(*FULL_RATE, '-p', 'shutdown_timeout:=0.1')
    client = bench.client().connected()
    with client.run_at(20.0):
        result = client.set_parameters(control_method='drive_control')
        assert not result.successful and 'deactivate it and clean it up first' in result.reason
        assert client.change_state(Transition.TRANSITION_DEACTIVATE)
    assert not client.set_parameters(control_method='drive_control').successful
    # it is left to its ramp, under bus control
    assert client.change_state(Transition.TRANSITION_CLEANUP)
    assert client.set_parameters(control_method='drive_control').successful
    assert not client.change_state(Transition.TRANSITION_CONFIGURE)
    why = 'the motor still runs by control_method mode_scmd'
    wait_until(lambda: why in driver.text, 'the log says why')
    drive.inject('set', 'control.retard', 0.2)
    wait_until(lambda: drive.state()['state'] == 'READY_TO_SWITCH_ON', 'it stands')
    assert client.change_state(Transition.TRANSITION_CONFIGURE), driver.text
    assert client.change_state(Transition.TRANSITION_ACTIVATE)
    with client.run_at(10.0):
        assert client.messages['status'][-1].control_method == DriveStatus.DRIVE_CONTROL


@needs('watched')
def test_monitor_writes_nothing(bench: Bench) -> None:
    drive = bench.simulator(paced=True)
    driver = bench.driver(*FULL_RATE, '-p', 'control_method:=monitor', '-p', 'drive_timeout:=2.0')
    client = bench.client().connected()
    with client.setpoints(20.0):
        for service in ('stop', 'quick_stop', 'fault_ack'):
            assert 'monitor' in client.call(service).message
        assert 'monitor' in client.enable().message
        client.wait_for('telemetry', lambda message: True, 'telemetry flows')
        wait_until(
            lambda: len([f for f in bench.frames() if f['direction'] == 'request']) > 20,
            'it is read again and again',
        )
    driver.end()
    assert Wire(bench).writes() == []
    state = drive.state()
    assert not state['writes'] and not state['command_writes']
    assert not state.get('ack_reads') and not state.get('sio_err_reads')


@needs('reverse')
def test_two_drives_on_one_bus_and_one_of_them_silent(bench: Bench) -> None:
    drive = bench.simulator('--address', '1', '--address', '2', *bench.drives.ramps(1), paced=True)
    parameters = bench.folder / 'two.yaml'
    parameters.write_text(
        'nfo_sinus_bus: {ros__parameters: {drives: [left, right]}}\n'
        'left: {ros__parameters: {address: 1}}\n'
        'right: {ros__parameters: {address: 2}}\n'
    )
    bench.driver(*FULL_RATE, '--params-file', str(parameters))
    left = bench.client('/left').connected()
    right = bench.client('/right').connected()
    with left.run_at(15.0), right.run_at(-15.0):
        drive.inject('silence', 60.0, address=2)
        right.wait_for('status', lambda status: not status.connected, 'right is lost')
        left.wait_for('statistics', lambda m: m.silent_drives == ['right'], 'it is named')
        seen = len(left.messages['status'])
        wait_until(lambda: len(left.messages['status']) > seen + 50, 'left is polled on')
        assert left.newest('status').enabled
        assert drive.state(1)['turning']
        response = left.call('stop')
        assert response.success, response.message


@needs('direct')
def test_each_drive_publishes_its_own_statistics(bench: Bench) -> None:
    drive = bench.simulator('--address', '1', '--address', '2', paced=True)
    parameters = bench.folder / 'two.yaml'
    # so long that no answer of the other is late on a busy machine; and one that is silent is
    # asked several times before it is lost
    parameters.write_text(
        'nfo_sinus_bus: {ros__parameters: {drives: [left, right], response_timeout: 1.0}}\n'
        'left: {ros__parameters: {address: 1}}\n'
        'right: {ros__parameters: {address: 2, lost_after: 5.0}}\n'
    )
    bench.driver('--params-file', str(parameters))
    left = bench.client('/left').connected()
    right = bench.client('/right').connected()
    for client, name in ((left, '/left'), (right, '/right')):
        client.listen('own statistics', BusStatistics, f'{name}/statistics', 10)
    drive.inject('silence', 600.0, address=2)
    lost = right.wait_for(
        'own statistics', lambda m: m.silent_drives == ['right'] and m.timeouts > 2, 'it is lost'
    )
    assert lost.retries > 0 and math.isnan(lost.cycle_time)
    seen = left.messages['own statistics'][-1].transactions
    own = left.wait_for(
        'own statistics', lambda m: m.transactions > seen and m.cycle_time > 0, 'left goes on'
    )
    assert own.silent_drives == []
    assert own.timeouts == own.damaged == own.reconnects == 0
    # what an option card is needed for is refused
    assert not own.refused or bench.connection.bus == 'movitrac'
    assert 0 < own.round_trip_min <= own.round_trip_median <= own.round_trip_p99
    assert own.round_trip_p99 <= own.round_trip_max
    line = left.wait_for('statistics', lambda m: m.transactions > own.transactions, 'the line')
    assert line.timeouts > 2 and line.round_trip_median > 0
    drive.inject('silence', 0.0, address=2)
    right.wait_for('own statistics', lambda m: m.reconnects == 1 and not m.silent_drives, 'back')
    values = {pair.key: pair.value for pair in _diagnosis(right, 'right: drive').values}
    assert int(values['timeouts']) > 2
    wait_until(lambda: _median(right) > 0, 'its round trips are in its diagnostics')


def _median(client: Client) -> float:
    values = {pair.key: pair.value for pair in _diagnosis(client, 'right: drive').values}
    return float(values['round trip median'].partition(' ')[0] or 0)
