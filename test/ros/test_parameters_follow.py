# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What changes at the drive shows in ROS: at the keypad, by a reset, beyond what a manual says."""

from __future__ import annotations

from typing import Any

from bench import A_WHILE, Bench, Client, holds_for, wait_until
from connections import needs
from parameter_bench import COUNTED, Stubborn, Wire, refused, says_once, set_one, settings, values
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import parameter_value_to_python

pytestmark = needs('parameters')


def _listening(bench: Bench, name: str = '/nfo_sinus') -> Client:
    client = bench.client(name)
    client.listen('events', ParameterEvent, '/parameter_events', 1000)
    return client.connected()


def _changes(client: Client, name: str) -> list[Any]:
    """Return what the events said of a parameter."""
    return [
        parameter_value_to_python(parameter.value)
        for event in list(client.messages['events'])
        if event.node == '/nfo_sinus'
        for parameter in event.changed_parameters
        if parameter.name == name
    ]


def test_a_change_at_the_keypad_shows_and_is_reported_once(bench: Bench) -> None:
    drive = bench.simulator()
    driver = bench.driver(*COUNTED)
    client = _listening(bench)
    wire = Wire(bench)
    drive.inject('set', 'control.retard', 7.5)
    drive.inject('set', 'error.cur_low_mode', 'Alarm')
    wait_until(
        lambda: client.parameter('control.retard') == 7.5
        and client.parameter('error.cur_low_mode') == 'Alarm',
        'both changes show',
    )
    wait_until(lambda: _changes(client, 'error.cur_low_mode'), 'an event')
    holds_for(A_WHILE, lambda: len(_changes(client, 'control.retard')) <= 1, 'one event')
    assert _changes(client, 'control.retard') == [7.5]
    assert _changes(client, 'error.cur_low_mode') == ['Alarm']
    says_once(driver, 'changed at the drive: control.retard: 5 -> 7.5 s')
    says_once(driver, 'changed at the drive: error.cur_low_mode: Disable -> Alarm')
    assert driver.text.count('changed at the drive') == 2
    assert wire.writes() == [], 'to follow is no reason to write'


def test_refresh_answers_what_has_changed(bench: Bench) -> None:
    drive = bench.simulator()
    bench.driver(*COUNTED)
    client = _listening(bench)
    wire = Wire(bench)
    unchanged = client.call('refresh_parameters')
    assert unchanged.success
    count = len(settings(bench.connection))
    assert unchanged.message == f'{count} parameters read, changed: none'
    drive.inject('set', 'freque.f_fix7', 44.5)
    drive.inject('set', 'control.auto_start', True)
    answer = client.call('refresh_parameters')
    assert answer.success
    # unless the watch came first: it reads one of 119 every 70 ms
    changed = set(answer.message.partition('changed: ')[2].split(', ')) - {'none'}
    assert changed <= {'freque.f_fix7', 'control.auto_start'}
    wait_until(
        lambda: values(client, 'freque.f_fix7', 'control.auto_start')
        == {'freque.f_fix7': 44.5, 'control.auto_start': True},
        'both show',
    )
    drive.inject('factory-reset')
    assert client.call('refresh_parameters').success
    wait_until(lambda: client.parameter('freque.f_fix7') == 50.0, 'the factory value')
    assert wire.writes() == []


def test_what_no_manual_allows_is_shown_as_it_is(bench: Bench) -> None:
    stubborn = bench.enter_context(Stubborn(bench))
    memory = stubborn.drive.memory
    # the most that the type carries
    raw, most = (0x7FFF, 3276.7) if bench.connection.protocol == 'classic' else (0xFFFF, 6553.5)
    # 200 Hz, 0 s, and a code that has no label
    memory.put('freque.f_fix1', 2000)
    memory.put('control.accel', 0)
    memory.put('speed.op_mode', 193)
    driver = bench.driver(*COUNTED)
    client = _listening(bench)
    wire = Wire(bench)
    shown = values(client, 'freque.f_fix1', 'control.accel', 'speed.op_mode')
    assert shown == {
        'freque.f_fix1': 200.0, 'control.accel': 0.0, 'speed.op_mode': '193'
    }
    memory.put('freque.f_fix2', raw)
    memory.put('control.run_dly', raw)
    memory.put('freque.op_mode', 193)
    assert client.call('refresh_parameters').success
    wanted = {'freque.f_fix2': most, 'control.run_dly': raw, 'freque.op_mode': '193'}
    wait_until(lambda: values(client, *wanted) == wanted, 'the new ones show')
    span = client.descriptor('freque.f_fix2').floating_point_range[0]
    assert (span.from_value, span.to_value) == (0.0, most), 'the range takes it in'
    assert wire.writes() == []
    # what the drive has may be given, so that a dump loads; anything else has to be allowed
    for name, value in {**shown, **wanted}.items():
        result = set_one(client, name, value)
        assert result.successful, result.reason
    refused(set_one(client, 'freque.f_fix2', most - 0.1), 'freque.f_fix2', '0 to 150')
    assert wire.writes() == []
    assert set_one(client, 'freque.f_fix2', 150.0).successful
    assert set_one(client, 'freque.op_mode', 'Fix-1 F').successful
    memory.put('freque.f_fix2', 100)
    assert client.call('refresh_parameters').success
    wait_until(lambda: client.parameter('freque.f_fix2') == 10.0, 'in range')
    span = client.descriptor('freque.f_fix2').floating_point_range[0]
    assert (span.from_value, span.to_value) == (0.0, 150.0), 'the range is that of the manual'
    says_once(driver, f'changed at the drive: freque.f_fix2: 15 -> {most} Hz')


def test_a_code_without_any_meaning_is_reported_and_does_no_harm(bench: Bench) -> None:
    stubborn = bench.enter_context(Stubborn(bench))
    stubborn.drive.memory.put('control.auto_start', 7)
    driver = bench.driver(*COUNTED)
    client = _listening(bench)
    has = client.parameter_names() & set(stubborn.names)
    assert has == set(stubborn.names) - {'control.auto_start'}
    says_once(driver, 'control.auto_start: the drive has code 7')
    stubborn.drive.memory.put('pi_reg.reg_amp', 3)
    assert client.call('refresh_parameters').success
    text = 'pi_reg.reg_amp: the drive has code 3'
    wait_until(lambda: text in driver.text, 'it is reported')
    assert client.parameter('pi_reg.reg_amp') == 1
    assert set_one(client, 'pi_reg.reg_amp', -1).successful
    assert stubborn.drive.memory.raw('pi_reg.reg_amp') == -1
