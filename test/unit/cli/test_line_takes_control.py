# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A CANopen module takes control with the first request [M0 §6.4]: nothing is sent unasked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from cli_bench import Bench, Done, MakeBench, wait_until
import pytest

Nfo = Callable[..., Done]

#: Every verb that speaks to a drive and is not there to stop it.
VERBS = (
    ('scan', '--addresses', 1),
    ('info',),
    ('list',),
    ('get', 'control.accel'),
    ('set', 'control.accel=5'),
    ('dump',),
    ('load', 'FILE'),
    ('diff', 'FILE'),
    ('diff', '--against', 2),
    ('errors',),
    ('errors', '--erase'),
    ('monitor', '--count', 1),
    ('monitor', '--count', 1, '--addresses', '1,2'),
    ('ack',),
    ('run', 10, '--for', 1),
)
_QUESTION = 'a motor that the terminals run stops. Go on?'


@pytest.fixture
def bench(make_bench: MakeBench) -> Bench:
    """A CANopen line; terminals run the motor of the drive at address 1."""
    bench = make_bench(protocol='canopen', baud=125_000)
    bench.options += ('--baud-rate', '125000')
    bench.simulator.inject('keypad', 'ext', address=1)
    wait_until(lambda: bench.state()['driven'])
    return bench


@pytest.fixture
def parameters(tmp_path: Path) -> Path:
    """A parameter file."""
    path = tmp_path / 'parameters.yaml'
    path.write_text('/**:\n  ros__parameters:\n    control:\n      accel: 5.0\n')
    return path


@pytest.mark.parametrize('verb', VERBS, ids=lambda verb: ' '.join(map(str, verb)))
def test_without_a_terminal_nothing_is_sent_before_yes(
    bench: Bench, nfo: Nfo, parameters: Path, verb: tuple[object, ...]
) -> None:
    done = nfo(*(parameters if word == 'FILE' else word for word in verb))
    assert done.status == 2 and done.out == ''
    assert 'the CANopen module holds the drive in bus mode' in done.err.replace('The', 'the')
    assert f'{_QUESTION} There is no terminal to answer: say so with --yes' in done.err
    assert bench.state()['driven'] and bench.requests() == []


def test_yes_may_stand_in_front_of_the_verb_or_behind_it(bench: Bench, nfo: Nfo) -> None:
    assert nfo('--yes', 'info').status == 0
    assert nfo('get', 'control.accel', '--yes').status == 0
    wait_until(lambda: not bench.state()['driven'])


@pytest.mark.parametrize(('answer', 'goes_on'), [('y\n', True), ('\n', False), ('\x03', False)])
def test_on_a_terminal_it_asks_once(bench: Bench, answer: str, goes_on: bool) -> None:
    done = bench.on_terminal('info', ask='[y/N] ', answer=answer)
    assert done.out.count(_QUESTION) == 1
    assert (done.status == 0) == goes_on
    if goes_on:
        wait_until(lambda: not bench.state()['driven'])
    else:
        assert bench.state()['driven']
    assert bool(bench.requests()) == goes_on
    assert ('serial number' in done.out) == goes_on


def test_what_commands_a_drive_is_asked_for_each_of_its_questions(bench: Bench) -> None:
    with bench.simulator.lock:
        bench.drive().trip(5)
    # the question of the line is none of the log
    done = bench.on_terminal('errors', '--erase', ask=f'{_QUESTION} [y/N] ', answer='y\nn\n')
    assert done.out.count(_QUESTION) == 1
    assert 'Erase the error log' in done.out and 'nothing was done' in done.out
    assert len(bench.drive().faults.log) == 1


def test_a_stop_asks_nothing(bench: Bench, nfo: Nfo) -> None:
    done = nfo('stop')
    assert done.status == 0, done.err
    assert not bench.state()['driven']


def test_a_line_that_takes_no_control_asks_nothing(make_bench: MakeBench) -> None:
    bench = make_bench()
    done = bench.run('info')
    assert done.status == 0 and done.err == ''
