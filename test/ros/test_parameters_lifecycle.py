# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Parameters of drives through the life of a node: monitor, clean-up, dump and load, two drives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import itertools
import threading
from typing import Any

from bench import PATIENCE, Bench, Client, wait_until
from connections import needs
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from parameter_bench import (
    QUIET,
    Wire,
    ends_of,
    refused,
    set_each,
    set_one,
    settings,
    values,
    written,
)
import pytest
from rcl_interfaces.srv import ListParameters

pytestmark = needs('parameters')


def test_monitor_writes_nothing_whatever_is_called(bench: Bench) -> None:
    drive = bench.simulator()
    driver = bench.driver(
        *QUIET,
        '-p', 'control_method:=monitor',
        '-p', 'allow_communication_changes:=true',
        '-p', 'control.accel:=6.0',
        '-p', 'serial.sio_tot:=3.0',
        '-p', 'drive_timeout:=3.0',
    )
    client = bench.client().connected()
    assert set(settings(bench.connection)) <= client.parameter_names()
    assert client.parameter('control.accel') == 5.0
    wait_until(lambda: 'control_method is monitor' in driver.text, 'it says why not')
    has = values(client, *settings(bench.connection))
    assert all(result.successful for result in set_each(client, *has.items()))
    refused(client.set_parameters(**{'control.accel': 6.0, 'poll_rate': 5.0}), 'monitor')
    assert not client.set_parameters(drive_timeout=4.0).successful
    drive.inject('set', 'control.retard', 7.0)
    assert client.call('refresh_parameters').success
    wait_until(lambda: client.parameter('control.retard') == 7.0, 'it follows')
    for transition in (
        Transition.TRANSITION_DEACTIVATE,
        Transition.TRANSITION_CLEANUP,
        Transition.TRANSITION_CONFIGURE,
        Transition.TRANSITION_ACTIVATE,
    ):
        assert client.change_state(transition)
    assert client.parameter('control.retard') == 7.0
    wire = Wire(bench)
    assert wire.writes() == []
    for name, ends in ends_of(bench.connection).items():
        if ends.low != ends.high:
            other = ends.high if client.parameter(name) == ends.low else ends.low
            refused(set_one(client, name, other), name, 'monitor')
    assert wire.writes() == []


def test_parameters_go_with_cleanup_and_come_back_as_they_are(bench: Bench) -> None:
    drive = bench.simulator()
    bench.driver(*QUIET)
    client = bench.client().connected()
    everything = client.parameter_names()
    own = everything - set(settings(bench.connection))
    assert client.change_state(Transition.TRANSITION_DEACTIVATE)
    assert client.parameter_names() == everything, 'inactive, the drive is still there'
    assert set_one(client, 'control.accel', 6.0).successful
    assert client.change_state(Transition.TRANSITION_CLEANUP)
    assert client.parameter_names() == own
    wire = Wire(bench)
    wire.writes()
    answer = set_one(client, 'control.accel', 7.0)
    refused(answer, 'control.accel', 'configured')
    assert 'did you mean' not in answer.reason
    drive.inject('set', 'control.retard', 8.0)
    assert client.change_state(Transition.TRANSITION_CONFIGURE)
    assert client.parameter_names() == everything
    assert values(client, 'control.accel', 'control.retard') == {
        'control.accel': 6.0, 'control.retard': 8.0
    }
    assert wire.writes() == []


def _dump(client: Client) -> dict[str, object]:
    """Return all parameters of the node, as ``ros2 param dump`` does."""
    # that one is rclpy's own, and no node at all removes it
    return values(client, *sorted(client.parameter_names() - {'start_type_description_service'}))


def _load(client: Client, dump: dict[str, object]) -> None:
    """Set all of a dump one by one, as ``ros2 param load`` does; each has to be taken."""
    results = set_each(client, *dump.items())
    failed = [
        f'{name}: {result.reason}'
        for name, result in zip(dump, results, strict=True)
        if not result.successful
    ]
    assert failed == []


def test_a_dump_loads_again_after_a_reset_and_into_another_driver(bench: Bench) -> None:
    drive = bench.simulator()
    driver = bench.driver(*QUIET)
    client = bench.client().connected()
    changed = {
        'control.accel': 6.5, 'control.mode': 'Speed', 'control.auto_start': False,
        'freque.op_mode': 'Fix-3 R', 'pi_reg.reg_amp': -1, 'motor.p_nom': 2.2,
        'error.overload_s_temp': -20, 'pi_reg.setmin': -12.5, 'poll_rate': 12.0,
        'drive_timeout': 12.5,
    }
    result = client.set_parameters(**changed)
    assert result.successful, result.reason
    # on CANopen the drive watches over the driver by what is no setting
    key, value, words = (
        ('serial.auto_stop', True, (1,))
        if bench.connection.protocol == 'canopen'
        else ('serial.sio_tot', 12.5, (125,))
    )
    wait_until(lambda: client.parameter(key) == value, 'what drive_timeout set')
    dump = _dump(client)
    assert set(settings(bench.connection)) < set(dump)
    assert {'autostart', 'address', 'control_method', 'apply_parameters'} < set(dump)
    wire = Wire(bench)
    wire.writes()
    _load(client, dump)
    assert wire.writes() == [], 'all of it is there'

    drive.inject('power-cycle')
    client.wait_for('status', lambda status: not status.connected, 'it is off')
    client.connected()
    _load(client, dump)
    assert _dump(client) == dump

    drive.inject('factory-reset')
    assert client.call('refresh_parameters').success
    wait_until(lambda: client.parameter('control.accel') == 5.0, 'the factory value')
    # communication settings need their permission, on the way back too
    assert set_one(client, 'allow_communication_changes', True).successful
    _load(client, {**dump, 'allow_communication_changes': True})
    assert _dump(client) == {**dump, 'allow_communication_changes': True}
    assert drive.state()['parameters']['motor.p_nom'] == 2.2

    driver.end()
    drive.inject('set', 'control.accel', 9.0)
    bench.driver(*QUIET)
    other = bench.client().connected()
    wire.writes()
    _load(other, dump)
    # where control stays with the bus, a clean end has put back what drive_timeout had set
    put_back = [written(key, words)] if bench.connection.protocol == 'canopen' else []
    assert sorted(wire.written()) == sorted([written('control.accel', (6500, 0)), *put_back])
    assert _dump(other) == dump


def test_two_drives_have_parameters_of_their_own(bench: Bench) -> None:
    left = bench.simulator('--address', '1', '--address', '2')
    path = bench.folder / 'two.yaml'
    path.write_text(
        '/**/nfo_sinus_bus:\n  ros__parameters:\n    drives: [left, right]\n'
        '/**:\n  ros__parameters:\n    control.retard: 7\n'
        '/**/left:\n  ros__parameters:\n    address: 1\n    control.accel: 6\n'
        '/**/right:\n  ros__parameters:\n    address: 2\n    freque.f_fix1: 60\n'
    )
    driver = bench.driver(*QUIET, '--params-file', str(path))
    clients = bench.client('/left').connected(), bench.client('/right').connected()
    wire = Wire(bench)
    assert sorted(wire.written()) == sorted([
        written('control.retard', (7000, 0), unit=1),
        written('control.accel', (6000, 0), unit=1),
        written('control.retard', (7000, 0), unit=2),
        written('freque.f_fix1', (600,), unit=2),
    ])
    # what both have or one of them: there is no warning
    assert 'there is none of that name' not in driver.text
    assert set_one(clients[0], 'control.st_mode', 'Release').successful
    assert wire.written() == [written('control.st_mode', (0,), unit=1)]
    left.inject('set', 'control.run_dly', 3, address=2)
    assert clients[1].call('refresh_parameters').success
    names = [
        'control.accel', 'freque.f_fix1', 'control.retard', 'control.st_mode', 'control.run_dly'
    ]
    wait_until(lambda: clients[1].parameter('control.run_dly') == 3, 'the change at the right one')
    assert [tuple(values(client, *names).values()) for client in clients] == [
        (6.0, 10.0, 7.0, 'Release', 0),
        (5.0, 60.0, 7.0, 'Brake', 3),
    ]
    for client in clients:
        assert set(settings(bench.connection)) <= client.parameter_names()
    # one that is silent keeps the other from nothing
    left.inject('silence', 3600.0, address=2)
    clients[1].wait_for('status', lambda status: not status.connected, 'it is lost')
    assert set_one(clients[0], 'control.accel', 8.0).successful
    refused(set_one(clients[1], 'control.accel', 8.0), 'control.accel', 'check the cable')
    left.inject('silence', 0.0, address=2)


#: Many settings, so that to write them takes a while; on every way into a G2.
_MANY = {
    f'{group}.{name}{number}': value
    for group, name, value in (
        ('freque', 'f_fix', 11.0), ('speed', 'c_fix', 110.0), ('torque', 't_fix', 11.0)
    )
    for number in range(1, 8)
}


@pytest.fixture
def calling(bench: Bench) -> Iterator[Callable[[Callable[[Client], Any]], None]]:
    """Return what has a client call something over and over; each call has to be answered."""
    with contextlib.ExitStack() as stack:

        def call_on(call: Callable[[Client], Any]) -> None:
            client, ended = bench.client(), threading.Event()
            answered: list[bool] = []

            def run() -> None:
                while not ended.is_set():
                    future = call(client)
                    wait_until(future.done, 'a call is answered', period=0.002)
                answered.append(True)

            thread = threading.Thread(target=run, daemon=True)
            thread.start()

            def end() -> None:
                ended.set()
                thread.join()
                assert answered, 'every call was answered'

            stack.callback(end)

        yield call_on


def test_what_clients_set_and_list_meanwhile_hinders_no_transition(
    bench: Bench, calling: Callable[[Callable[[Client], Any]], None]
) -> None:
    bench.simulator()
    bench.driver(*QUIET, '-p', 'autostart:=false')
    client = bench.client()
    value = itertools.cycle((6.0, 7.0))
    calling(lambda client: client.set_parameters_async(**{'control.accel': next(value)}))
    calling(lambda client: client.call_async('list_parameters', ListParameters))
    for _ in range(4):
        # a simulated drive that gets no time to answer hinders it, too
        wait_until(lambda: client.change_state(Transition.TRANSITION_CONFIGURE), 'it is configured')
        assert 'control.accel' in client.parameter_names()
        assert client.change_state(Transition.TRANSITION_CLEANUP)
        assert 'control.accel' not in client.parameter_names()


def test_a_setting_that_is_taken_while_the_node_is_configured_is_that_of_the_drive(
    bench: Bench,
) -> None:
    drive = bench.simulator(*bench.drives.ramps(0.2))
    wanted = [word for name, value in _MANY.items() for word in ('-p', f'{name}:={value}')]
    driver = bench.driver(*wanted, '-p', 'autostart:=false', '-p', 'setpoint_timeout:=0.0')
    client = bench.client()
    client.state()
    configuring = client.call_async(
        'change_state', ChangeState, transition=Transition(id=Transition.TRANSITION_CONFIGURE)
    )
    wait_until(lambda: 'read in' in driver.text, 'its settings are read', period=0.002)
    # from here on it belongs to that address
    elsewhere = client.set_parameters(address=2)
    taken = client.set_parameters(setpoint_timeout=0.3)
    wait_until(configuring.done, 'configured')
    assert configuring.result().success
    assert not elsewhere.successful
    assert client.parameter('address') == 1
    assert taken.successful
    assert client.change_state(Transition.TRANSITION_ACTIVATE)
    with client.run_at(20.0):
        pass
    drive.wait_for(lambda state: not state['turning'], timeout=PATIENCE)


@needs('sio_tot')
def test_what_a_set_point_means_never_changes_with_the_time_out_of_the_drive(bench: Bench) -> None:
    drive = bench.simulator()
    bench.driver(*QUIET)
    client = bench.client().connected()
    result = client.set_parameters(scale=0.5, drive_timeout=3.0)
    refused(result, 'scale', 'drive_timeout', 'one after the other')
    assert (client.parameter('scale'), client.parameter('drive_timeout')) == (1.0, -1.0)
    assert drive.state()['parameters']['serial.sio_tot'] == 0.0
    # what stays as it is does not count: a dump can be loaded
    assert client.set_parameters(scale=1.0, drive_timeout=3.0).successful
    assert client.set_parameters(scale=0.5, drive_timeout=3.0).successful


def test_what_a_set_point_means_never_changes_while_enabled(bench: Bench) -> None:
    drive = bench.simulator()
    bench.driver(*QUIET)
    client = bench.client().connected()
    before = values(client, 'gear_ratio', *_MANY)
    first, *_ = _MANY
    changing = client.set_parameters_async(gear_ratio=-20.0, **_MANY)
    drive.wait_for(lambda state: state['parameters'][first] == _MANY[first], timeout=PATIENCE)
    enabled = client.enable()
    wait_until(changing.done, 'the change is answered')
    result = changing.result().result
    # the one or the other
    assert enabled.success != result.successful, (enabled.message, result.reason)
    if enabled.success:
        refused(result, 'gear_ratio', 'not enabled')
        assert values(client, 'gear_ratio', *_MANY) == before
        has = drive.state()['parameters']
        assert {name: has[name] for name in _MANY} == {name: before[name] for name in _MANY}


@pytest.mark.parametrize(
    ('name', 'value'), [('measured', ['no.such']), ('drive_timeout', 30.0)]
)
def test_a_setting_that_the_model_found_cannot_have_is_refused(
    bench: Bench, name: str, value: Any
) -> None:
    bench.simulator()
    bench.driver(*QUIET, '-p', 'model:=auto', '-p', 'drive_timeout:=2.0')
    client = bench.client().connected()
    before = client.parameter(name)
    result = client.set_parameters(**{name: value})
    refused(result, name)
    assert client.parameter(name) == before
    assert client.set_parameters(frame_id='belt').successful
    assert client.parameter('frame_id') == 'belt'


@pytest.mark.parametrize('ways', [
    (Transition.TRANSITION_ACTIVE_SHUTDOWN,),
    (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP),
])
def test_a_drive_that_is_let_go_is_left_alone(bench: Bench, ways: tuple[int, ...]) -> None:
    bench.simulator()
    bench.driver(*QUIET)
    client = bench.client().connected()
    own = client.parameter_names() - set(settings(bench.connection))
    assert all(map(client.change_state, ways))
    assert client.parameter_names() == own
    requests = len(bench.requests())
    refused(set_one(client, 'control.accel', 7.0), 'control.accel')
    answer = client.call('refresh_parameters')
    assert not answer.success
    assert 'configure it first' in answer.message or 'was shut down' in answer.message
    assert len(bench.requests()) == requests
    # and it is not missed
    heard = len(client.messages['diagnostics'])
    wait_until(lambda: len(client.messages['diagnostics']) > heard + 1, 'what is known now')
    found = {status.name: status for status in client.messages['diagnostics'][-1].status}
    assert {status.level for status in found.values()} == {DiagnosticStatus.OK}, found
    assert 'not connected' in found['nfo_sinus: drive'].message
    assert list(client.newest('statistics').silent_drives) == []


@pytest.mark.parametrize('between', [{}, {'lost_after': 2.0}])
def test_a_later_difference_from_the_parameter_file_is_reported_after_a_new_start(
    bench: Bench, between: dict[str, float]
) -> None:
    drive = bench.simulator(*bench.drives.ramps(5.0))
    bench.driver(*QUIET, '-p', 'control.accel:=6.0', '-p', 'control.retard:=6.0')
    client = bench.client().connected()
    assert drive.state()['parameters']['control.accel'] == 6.0
    # what a client sets is wanted from then on
    assert set_one(client, 'control.retard', 7.0).successful
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP):
        assert client.change_state(transition)
    assert client.set_parameters(**between).successful
    drive.inject('set', 'control.accel', 9.0)
    assert client.change_state(Transition.TRANSITION_CONFIGURE)
    client.wait_for(
        'diagnostics',
        lambda message: any('1 parameters differ' in status.message for status in message.status),
        'it is reported',
        timeout=20.0,
    )
    assert drive.state()['parameters']['control.accel'] == 9.0
