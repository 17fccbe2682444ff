# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""``nfo-sinus monitor`` on a terminal: the view of a line, which only reads."""

from __future__ import annotations

import signal

from cli_bench import COMMAND, Bench
import pytest
from support.terminal import Terminal


def view(bench: Bench, *arguments: object) -> Terminal:
    return Terminal([*COMMAND, *bench.options, 'monitor', *map(str, arguments)])


def test_a_fault_and_a_lost_drive_are_shown_and_nothing_is_written(bench: Bench) -> None:
    inject = bench.simulator.inject
    with view(bench, '--addresses', '1,2', '--period', 0.05) as terminal:
        text = terminal.wait_for('2 drives', '■ 2 standing', 'drive 1', 'drive 2', 'cycle')
        assert 'only looks' in text and 'nfo-sinus stop' in text and 'stop ALL' not in text
        inject('fault', 4, address=2)
        terminal.wait_for('✗ 1 fault', '4 PTC Temp')
        terminal.press('n')
        terminal.press('e')
        terminal.wait_for('error log: 4 PTC Temp')
        terminal.wait_for('to be acknowledged', 'why: Motor overheating', 'do: Let the motor cool')
        # keys that stop elsewhere
        terminal.press('sa')
        inject('silence', 3600.0, address=2)
        terminal.wait_for('? 1 silent', 'not connected', gone=['✗ 1 fault'])
        inject('silence', 0.0, address=2)
        terminal.wait_for('✗ 1 fault', gone=['silent'])
        terminal.press('q')
        assert terminal.wait() == 0
        assert terminal.settings == terminal.before, 'the terminal is as it was'
        terminal.wait_for('median', 'drive 2')
    assert bench.writes() == []


@pytest.mark.parametrize('end', [signal.SIGTERM, signal.SIGHUP, signal.SIGINT, 'ctrl-c'])
def test_however_it_is_ended_the_terminal_is_as_it_was(bench: Bench, end: int | str) -> None:
    with view(bench) as terminal:
        terminal.wait_for('■ 1 standing')
        if isinstance(end, str):
            terminal.press('\x03')
        else:
            terminal.signal(end)
        assert terminal.wait() == 0
        assert terminal.settings == terminal.before
        terminal.wait_for('median')


def test_it_fits_any_window_and_no_key_of_the_terminal_stops_it(bench: Bench) -> None:
    # the signal of another size may be lost
    command = ['env', '--block-signal=WINCH', *COMMAND, *bench.options, 'monitor']
    with Terminal([*command, '--addresses', '1,2', '--period', '0.05']) as terminal:
        terminal.wait_for('2 standing', 'q quit')
        # it would stop all that is drawn, and suspend the program
        terminal.press('\x13\x1a')
        # a key that is none here, though it ends in a letter that is one
        terminal.press('\x1b[1;5q')
        for columns, rows, text in (
            (120, 40, '│ drive 1'), (30, 8, '2 drives'), (3, 1, '2'), (80, 24, 'q quit'),
        ):
            terminal.resize(columns, rows)
            terminal.wait_for(text)
        terminal.press('q')
        assert terminal.wait() == 0


def test_one_that_is_not_there_is_reported_without_a_view(bench: Bench) -> None:
    with view(bench, '--address', 7, '--response-timeout', 0.05, '--retries', 0) as terminal:
        assert terminal.wait() == 1
        terminal.wait_for('no response')


def test_lines_where_they_are_requested(bench: Bench) -> None:
    with view(bench, '--lines', '--period', 0.05) as terminal:
        terminal.wait_for('24 Stop', 'rpm', gone=['standing'])
        terminal.press('\x03')
        assert terminal.wait() == 0


@pytest.mark.parametrize('setting', ['TERM=dumb', 'LC_ALL=C'])
def test_where_the_view_cannot_be_drawn_it_goes_on_line_by_line(
    bench: Bench, setting: str
) -> None:
    # or Python takes another one than C
    environment = ['env', 'PYTHONCOERCECLOCALE=0', setting]
    with Terminal([*environment, *COMMAND, *bench.options, 'monitor']) as terminal:
        terminal.wait_for('the view ', ': export ', '24 Stop')
        terminal.press('\x03')
        assert terminal.wait() == 0
