# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What the view shows of the pictures of a source, in rows for a screen."""

from __future__ import annotations

from dataclasses import replace
import math

from hypothesis import given, strategies as st
import pytest

from nfo_sinus_driver.bus import Statistics
from nfo_sinus_driver.view.layout import Layout, natural, short_names, wrapped
from nfo_sinus_driver.view.picture import (
    Condition,
    DriveView,
    Level,
    Measured,
    Note,
    Picture,
)

_RUNS = DriveView(
    '/drive', Condition.RUNS, '38 Bus Run', enabled=True, setpoint=30.0, actual=29.9, unit='Hz',
    measured=Measured(29.9, 881.0, 1.87, 231.0, 105.0, 20.0, 560.0, 23.0),
)
_LINE = Statistics(0.25, 0.052, 1000, 2, *[0] * 4, *[math.nan] * 5)
_FAULT = replace(
    _RUNS, condition=Condition.FAULT, status='6 Overload', cause='too much for too long',
    remedy='check the load', requires_ack=True, enabled=False,
)
_SILENT = DriveView('/drive', Condition.SILENT, 'not connected')


class View:
    """The view of a source whose pictures a test changes."""

    title = 'ROS domain 7'
    advice = 'start one, and have both ends in one domain:\n\n    ros2 run nfo_sinus_driver driver'

    def __init__(self, *drives: DriveView, only_looks: str = '') -> None:
        self.only_looks = only_looks
        self.stopped: list[str] = []
        self.read: list[str] = []
        self._picture = Picture(drives, {'/bus': _LINE}, ())
        self._layout = Layout(self)
        self._layout.take_picture()

    def next_picture(self) -> Picture:
        return self._picture

    def stop(self, name: str) -> None:
        self.stopped.append(name)

    def stop_all(self) -> None:
        self.stopped.append('all')

    def acknowledge(self, name: str) -> None:
        self.stopped.append(f'acknowledge {name}')

    def read_errors(self, name: str) -> None:
        self.read.append(name)

    def change(self, **what: object) -> None:
        self._picture = replace(self._picture, **what)  # type: ignore[arg-type]
        self._layout.take_picture()
        self._picture = replace(self._picture, notes=())

    def press(self, *keys: str) -> None:
        for key in keys:
            self._layout.press(key)

    def text(self, width: int = 80, height: int = 24) -> str:
        rows = [''.join(text for text, _ in row) for row in self._layout.rows(width, height)]
        assert len(rows) <= height and all(len(row) <= width for row in rows)
        return '\n'.join(rows)


def conveyor(count: int) -> list[DriveView]:
    drives = [replace(_RUNS, name=f'/conveyor/drive_{number}') for number in range(1, count + 1)]
    drives[2] = replace(_FAULT, name=drives[2].name)
    drives[6] = replace(_SILENT, name=drives[6].name)
    return drives


@pytest.mark.parametrize(
    ('utilisation', 'shown'),
    [(0.89, '89 % used, cycle'), (0.97, '97 % used (polls fill the line by design), cycle')],
)
def test_a_full_line_is_said_to_be_full_by_design(utilisation: float, shown: str) -> None:
    view = View(_RUNS)
    view.change(lines={'/bus': replace(_LINE, utilisation=utilisation)})
    assert shown in view.text(160, 48)


@pytest.mark.parametrize('size', [(80, 24), (120, 40), (160, 48)], ids=['80', '120', '160'])
@pytest.mark.parametrize('count', [1, 8, 32])
def test_every_drive_is_in_the_table_and_the_chosen_one_in_full(
    count: int, size: tuple[int, int]
) -> None:
    view = View(*(conveyor(count) if count > 1 else [_RUNS]))
    text = view.text(*size)
    assert f'{count} drive' in text and 'ROS domain 7' in text
    assert '/bus: 2 without answer, 25 % used, cycle 52 ms' in text
    assert '► 38 Bus Run' in text and '30.0 Hz' in text and '29.9 Hz' in text
    assert '881 rpm' in text and '1.87 A' in text and 'DC link' in text
    assert 'current 1.87 A, the last 1 s' in text and '█' in text
    assert 'q quit' in text and 'stop ALL' in text
    for number in range(2, count + 1):
        view.press('down')
        assert f'>drive_{number} ' in view.text(*size)
    # the one that is chosen is reported in full
    last = f'/conveyor/drive_{count}' if count > 1 else '/drive'
    assert f'{last}  ►' in view.text(*size)


def test_the_table_scrolls_by_pages() -> None:
    view = View(*conveyor(32))
    assert 'drive 1-5/32' in view.text()
    view.press('page down', 'page down')
    assert '>drive_11' in view.text() and 'drive 7-11/32' in view.text()
    view.press('page up')
    assert '>drive_6' in view.text()
    view.press('end')
    assert '>drive_32' in view.text()
    view.press('home')
    assert '>drive_1 ' in view.text()


def test_a_fault_is_reported_with_cause_and_remedy_and_trouble_is_found_by_a_key() -> None:
    view = View(*conveyor(32))
    assert '? 1 silent  ✗ 1 fault' in view.text()
    view.press('n')
    text = view.text()
    assert '/conveyor/drive_3  ✗ 6 Overload  to be acknowledged' in text
    assert 'why: too much for too long' in text and 'do: check the load' in text
    view.press('n')
    assert '/conveyor/drive_7  ? not connected' in view.text()
    # round and round
    view.press('n')
    assert '/conveyor/drive_3  ' in view.text()


def test_keys_stop_the_drive_that_is_chosen_and_all() -> None:
    view = View(*conveyor(12))
    view.press('down', 's', 'a', 'k')
    # not the one that the order of letters has there, which is drive_10
    two = '/conveyor/drive_2'
    assert view.stopped == [two, 'all', f'acknowledge {two}']


def test_the_chosen_one_stays_chosen_when_others_come_and_go() -> None:
    drives = conveyor(8)
    view = View(*drives)
    view.press('down', 'down', 'down', 'down')
    view.change(drives=drives[2:])
    view.press('s')
    assert view.stopped == ['/conveyor/drive_5']


def test_a_source_that_only_looks_has_no_keys_that_stop() -> None:
    view = View(_RUNS, only_looks='looks only')
    text = view.text()
    assert 'looks only' in text and 'stop ALL' not in text and 'stop this' not in text
    assert 'acknowledge' not in text
    view.press('s', 'a', 'k')
    assert view.stopped == []


def test_without_drives_it_says_what_to_do() -> None:
    view = View()
    # and no key makes it fall
    view.press('s', 'k', 'n', 'p', 'down', 'page up', 'end', 'x')
    text = view.text()
    assert 'no drives  ROS domain 7' in text and '\n    ros2 run nfo_sinus_driver' in text
    assert 'domain:' in view.text(40), 'nothing of it is cut'
    assert view.stopped == []


def test_notes_stand_in_the_log_newest_at_the_end() -> None:
    view = View(_RUNS)
    view.change(notes=[Note(1.8e9 + n, Level.ERROR, '/drive', f'line {n}') for n in range(9)])
    *_, last, _ = view.text().splitlines()
    assert last.endswith('/drive line 8') and 'line 2' not in view.text()


def test_another_quantity_is_plotted_by_a_key() -> None:
    view = View(_RUNS)
    assert 'current 1.87 A, the last' in view.text()
    view.press('p')
    # high enough for more than one
    text = view.text(80, 30)
    assert text.index('frequency 29.9 Hz, the last') < text.index('torque 20 %, the last')


def test_the_error_log_of_the_chosen_drive_is_shown_by_a_key() -> None:
    drives = conveyor(7)
    view = View(*drives, only_looks='looks only')
    assert len(view.text().splitlines()[-1]) <= 80 and 'e errors' in view.text()
    view.press('e')
    assert view.read == ['/conveyor/drive_1'] and 'error log: being read' in view.text()
    entries = '5 Overload, at 12.0 h of operation', '7 DC Low'
    view.change(drives=[replace(drives[0], errors=entries), *drives[1:]])
    assert all(f'error log: {entry}' in view.text() for entry in entries)
    # it goes with the drive that is chosen
    view.press('down')
    assert view.read == ['/conveyor/drive_1', '/conveyor/drive_2']
    assert 'error log: being read' in view.text() and 'DC Low' not in view.text()
    view.press('e')
    assert 'error log' not in view.text() and view.stopped == []


def test_a_screen_of_24_lines_has_six_lines_of_log() -> None:
    view = View(_RUNS)
    view.change(notes=[Note(1.8e9 + n, Level.ERROR, '/drive', f'line {n}') for n in range(9)])
    assert [n for n in range(9) if f'line {n}' in view.text(80, 24)] == [3, 4, 5, 6, 7, 8]


def test_what_is_not_known_is_not_shown_as_zero() -> None:
    view = View(replace(_RUNS, setpoint=math.nan, actual=math.nan, measured=Measured()))
    text = view.text()
    assert '38 Bus Run  enabled' in text
    assert ' 0.0' not in text and ' 0 rpm' not in text and 'nan' not in text.lower()


def test_names_are_in_the_order_of_their_numbers() -> None:
    names = ['/a/drive_10', '/a/drive_2', '/a/drive_1', '/drive', '7']
    assert sorted(names, key=natural) == ['7', '/a/drive_1', '/a/drive_2', '/a/drive_10', '/drive']


def test_names_are_shortened_where_that_loses_nothing() -> None:
    names = ['/conveyor/infeed', '/conveyor/a_name_that_is_too_long_for_it']
    assert list(short_names(names, 16).values()) == ['infeed', '…too_long_for_it']
    assert short_names(['/conveyor/infeed'], 16) == {'/conveyor/infeed': '/conveyor/infeed'}
    assert short_names(['/a/x', '/b/x'], 16) == {'/a/x': '/a/x', '/b/x': '/b/x'}


def test_a_unit_of_the_user_and_small_values_show() -> None:
    view = View(replace(_RUNS, unit='[m/s]', setpoint=0.0432, actual=-0.00001))
    text = view.text()
    assert 'set 0.0432 [m/s]' in text and 'actual 0.0000 [m/s]' in text
    # without the unit where both have no room
    assert ' 0.0432 ' in text


def test_what_would_control_the_terminal_and_wide_characters_do_no_harm() -> None:
    view = View(replace(_RUNS, status='負荷' * 30, unit='\x1b[2J'))
    view.change(notes=[Note(1.8e9, Level.INFO, '/drive', '\x1b]0;\x07\udc80 a\nb')])
    text = view.text(160, 48)
    assert not any(ord(character) < 32 for character in text.replace('\n', ''))
    # two columns each, and one is left
    assert '負荷負荷負荷負…   ' in text
    text.encode()


def test_stops_that_are_not_confirmed_stay_in_sight() -> None:
    view = View(*conveyor(8))
    notes = [Note(1.8e9, Level.INFO, '/drive', 'much ' * 40)] * 9
    view.change(notes=notes, stops=['/drive: NOT stopped: no response'])
    assert '/drive: NOT stopped: no response' in view.text()
    assert '/drive: NOT stopped' in view.text(20, 8), 'in a small window, too'
    view.change(stops=[])
    assert 'NOT stopped' not in view.text()


def test_what_is_old_is_shown_as_old() -> None:
    assert 'as of 75 s ago' in View(replace(_RUNS, age=75.0)).text()


def test_the_worst_stands_first_in_a_narrow_head() -> None:
    drives = conveyor(32)
    drives[4] = replace(drives[4], condition=Condition.GONE)
    first, *_ = View(*drives).text(50).splitlines()
    assert first.index('1 gone') < first.index('1 silent') < first.index('1 fault')


def test_the_date_is_shown_of_what_was_not_today() -> None:
    view = View(_RUNS)
    view.change(notes=[
        Note(1.0e9, Level.WARNING, '/drive', 'old'), Note(math.nan, Level.INFO, '/drive', 'x')
    ])
    assert '2001-09-0' in view.text() and '--:--:-- /drive x' in view.text()


@given(st.lists(st.text(st.sampled_from('ab \n'))), st.integers(20, 40))
def test_what_is_wrapped_loses_no_word(texts: list[str], width: int) -> None:
    rows = wrapped([(text, '') for text in texts], width)
    shown = [''.join(text for text, _ in row) for row in rows]
    assert all(len(row) <= width for row in shown)
    assert ''.join(''.join(shown).split()) == ''.join(''.join(texts).split())


@given(st.integers(1, 200), st.integers(1, 60))
def test_any_size_is_filled_and_no_more(width: int, height: int) -> None:
    view = View(*conveyor(12))
    assert len(view.text(width, height).split('\n')) == height
