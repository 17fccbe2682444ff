# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The services of the bus node: all drives stopped or enabled at once."""

from __future__ import annotations

from bench import PATIENCE, Bench, wait_until
from connections import needs
import pytest

from nfo_sinus_driver.families.sinus_g2.words import Mode

_THREE = """
nfo_sinus_bus: {ros__parameters: {drives: [left, right, watched]}}
left: {ros__parameters: {address: 1}}
right: {ros__parameters: {address: 2}}
watched: {ros__parameters: {address: 3, control_method: monitor}}
"""


def start(bench: Bench) -> tuple:
    simulator = bench.simulator('--address', '1', '--address', '2', '--address', '3')
    parameters = bench.folder / 'three.yaml'
    parameters.write_text(_THREE)
    bench.driver('--params-file', str(parameters))
    for name in ('/left', '/right', '/watched'):
        bench.client(name).connected()
    return simulator, bench.client('/nfo_sinus_bus')


def running(simulator) -> list[bool]:
    return [simulator.state(address)['turning'] for address in (1, 2, 3)]


@needs('watched', 'reverse')
def test_all_drives_are_enabled_and_stopped_but_the_one_that_is_only_watched(bench: Bench) -> None:
    simulator, every_drive = start(bench)
    answer = every_drive.call('enable_all')
    assert answer.success, answer.message
    assert 'left: enabled' in answer.message and 'right: enabled' in answer.message
    assert 'watched' not in answer.message
    with bench.client('/left').setpoints(20.0), bench.client('/right').setpoints(-20.0):
        wait_until(lambda: running(simulator) == [True, True, False], 'both turn')
        # from a crawl nothing would have to stop
        wait_until(
            lambda: all(abs(simulator.state(address)['frequency']) > 15.0 for address in (1, 2)),
            'both are fast',
        )
        answer = every_drive.call('stop_all')
        assert answer.success, answer.message
        assert 'left: stopp' in answer.message and 'right: stopp' in answer.message
        wait_until(lambda: running(simulator) == [False, False, False], 'both stand')
        # set-points go on arriving, and no drive follows them
        states = [simulator.state(address) for address in (1, 2)]
        assert not any(state['turning'] for state in states)
    assert simulator.state(3)['writes'] == {}


@needs('watched')
def test_one_that_cannot_be_reached_is_named_and_the_others_stop(bench: Bench) -> None:
    simulator, every_drive = start(bench)
    assert every_drive.call('enable_all').success
    with bench.client('/left').setpoints(20.0):
        wait_until(lambda: simulator.state(1)['turning'], 'it turns')
        simulator.inject('silence', 3600.0, address=2)
        answer = every_drive.call('disable_all')
    assert not answer.success
    assert answer.message.startswith('right: the stop is NOT confirmed'), answer.message
    assert 'left: stop' in answer.message
    wait_until(lambda: not simulator.state(1)['turning'], 'it stands')
    answer = every_drive.call('enable_all')
    assert not answer.success
    assert answer.message.startswith('right: '), answer.message
    assert 'left: enabled' in answer.message


@pytest.mark.every_connection
@needs('classic')
@pytest.mark.parametrize('watched', [False, True], ids=['all_ours', 'one_is_only_watched'])
def test_a_stop_for_all_where_it_may_be(bench: Bench, watched: bool) -> None:
    simulator = bench.simulator('--address', '1', '--address', '2', '--address', '3')
    parameters = bench.folder / 'three.yaml'
    parameters.write_text(_THREE if watched else _THREE.replace('monitor', 'mode_scmd'))
    bench.driver('--params-file', str(parameters))
    for name in ('/left', '/right', '/watched'):
        bench.client(name).connected()
    assert bench.client('/left').enable().success
    simulator.inject('silence', 3600.0, address=2)
    answer = bench.client('/nfo_sinus_bus').call('stop_all')
    assert not answer.success
    if watched:
        assert 'no stop was broadcast' in answer.message
        assert bench.drives.taken(simulator.state(1))
    else:
        assert 'a stop for all was broadcast' in answer.message
        # it is MODE = Stop, which takes control, too
        simulator.wait_for(lambda state: state['mode'] == Mode.STOP, timeout=PATIENCE, address=1)
