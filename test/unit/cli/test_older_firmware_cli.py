# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The command with drives of the v5.0 dialect of Classic, which fault on what they do not know."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cli_bench import Bench, Done, MakeBench, wait_until
import pytest

Nfo = Callable[..., Done]
STOP = 1


@pytest.fixture
def bench(make_bench: MakeBench) -> Bench:
    return make_bench(protocol='classic', dialect='5.0')


def untouched(bench: Bench) -> bool:
    """Control was given back, and nothing turns or is wrong."""
    state = bench.state()
    moved = state['driven'] or state['turning'] or state['scmd']
    return state['mode'] == STOP and not moved and not state['fault']


def test_set(nfo: Nfo, bench: Bench) -> None:
    done = nfo('set', 'control.accel=7.5', 'freque.f_fix1=12.5')
    assert done.status == 0, done.err
    assert (bench.value('control.accel'), bench.value('freque.f_fix1')) == (7.5, 12.5)
    assert untouched(bench)
    assert bench.state()['command_writes'], 'control was taken'
    before = bench.state()['command_writes']
    assert nfo('set', 'control.accel=7.5').status == 0
    assert bench.state()['command_writes'] == before


def test_load(nfo: Nfo, bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / 'some.yaml'
    path.write_text(
        '/**:\n  ros__parameters:\n    control.accel: 7.5\n    motor.p_nom: 2.2\n', encoding='utf-8'
    )
    done = nfo('load', path)
    assert done.status == 0, done.err
    assert (bench.value('control.accel'), bench.value('motor.p_nom')) == (7.5, 2.2)
    assert untouched(bench)


def test_set_while_the_terminals_run_the_motor(nfo: Nfo, bench: Bench) -> None:
    bench.simulator.inject('keypad', 'ext', address=1)
    wait_until(lambda: bench.state()['driven'])
    done = nfo('set', 'control.accel=7.5')
    assert done.status == 1
    assert 'the motor runs' in done.err
    state = bench.state()
    assert state['driven']
    assert (state['source'], state['writes'], state['fault']) == ('ext', {}, 0)


@pytest.mark.parametrize(
    'arguments', [('info',), ('get', 'control.accel'), ('errors',), ('scan', '--addresses', '1-2')]
)
def test_looking_at_a_drive_that_the_bus_runs_does_not_stop_it(
    nfo: Nfo, bench: Bench, arguments: tuple[str, ...]
) -> None:
    bench.run_by_bus()
    done = nfo(*arguments)
    assert done.status == 0, done.err
    state = bench.state()
    assert state['driven']
    assert (state['fault'], state['sio_err']) == (0, 0)


def test_set_while_the_bus_runs_the_motor(nfo: Nfo, bench: Bench) -> None:
    bench.run_by_bus()
    done = nfo('set', 'control.accel=7.5')
    assert done.status == 0, done.err
    assert bench.value('control.accel') == 7.5
    state = bench.state()
    assert state['driven']
    assert (state['fault'], state['sio_err']) == (0, 0)
