# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The view, with a source of pictures that a test holds in its hand."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
import math
import time

import pytest

from nfo_sinus_driver.view.picture import (
    Condition,
    DriveView,
    Level,
    LineView,
    Measured,
    Note,
    Picture,
)

pytest.importorskip('textual', minversion='3')
from textual.pilot import Pilot

from nfo_sinus_driver.view.app import MonitorApp, natural, short_names

#: Machines are shared and slow, s.
_PATIENCE = 60.0
_RUNS = DriveView(
    '/drive', Condition.RUNS, '38 Bus Run', enabled=True, setpoint=30.0, actual=29.9, unit='Hz',
    measured=Measured(29.9, 881.0, 1.87, 231.0, 105.0, 20.0, 560.0, 23.0),
)
_FAULT = replace(
    _RUNS, condition=Condition.FAULT, status='6 Overload', cause='too much for too long',
    remedy='check the load', requires_ack=True, enabled=False,
)
_SILENT = DriveView('/drive', Condition.SILENT, 'not connected')


class Hand:
    """A source whose pictures a test changes."""

    title = 'ROS domain 7'
    advice = 'start one'

    def __init__(self, *drives: DriveView, only_looks: str = '') -> None:
        self.only_looks = only_looks
        self.picture = Picture(drives, [LineView('/bus', 0.25, 0.052, 1000, timeouts=2)], ())
        self.stopped: list[str] = []

    def look(self) -> Picture:
        picture, self.picture = self.picture, replace(self.picture, notes=())
        return picture

    def stop(self, name: str) -> None:
        self.stopped.append(name)

    def stop_all(self) -> None:
        self.stopped.append('all')


def conveyor(count: int) -> list[DriveView]:
    drives = [replace(_RUNS, name=f'/conveyor/drive_{number}') for number in range(1, count + 1)]
    drives[2] = replace(_FAULT, name=drives[2].name)
    drives[6] = replace(_SILENT, name=drives[6].name)
    return drives


Seen = Callable[[MonitorApp], str]


def seen(app: MonitorApp) -> str:
    """Return what stands on the screen."""
    width, height = app.size
    rows = app.screen._compositor.render_strips()
    assert len(rows) == height
    return '\n'.join(row.text[:width].rstrip() for row in rows).replace('\xa0', ' ')


async def shown(app: MonitorApp, pilot: Pilot[None], *texts: str) -> str:
    """Wait until texts stand on the screen, for a busy machine draws when it can; return all."""
    deadline = time.monotonic() + _PATIENCE
    while True:
        await pilot.pause()
        text = seen(app)
        if all(one in text for one in texts):
            return text
        assert time.monotonic() < deadline, f'{texts} not seen in:\n{text}'
        await asyncio.sleep(0.02)


def through(
    source: Hand,
    steps: Callable[[MonitorApp, Pilot[None]], Awaitable[None]],
    size: tuple[int, int] = (80, 24),
) -> None:
    """Take a view of a source through some steps."""

    async def go() -> None:
        app = MonitorApp(source)
        async with app.run_test(size=size) as pilot:
            await shown(app, pilot, 'quit')
            await steps(app, pilot)

    asyncio.run(go())


@pytest.mark.parametrize('size', [(80, 24), (160, 48)], ids=['80', '160'])
@pytest.mark.parametrize('count', [1, 8, 32])
def test_every_drive_is_in_the_table_and_the_chosen_one_in_full(
    count: int, size: tuple[int, int]
) -> None:
    source = Hand(*(conveyor(count) if count > 1 else [_RUNS]))

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        text = await shown(app, pilot, f'{count} drive', 'ROS domain 7', 'DC link', 'stop ALL')
        assert '/bus: 2 without answer, 25 % used, cycle 52 ms' in text
        assert '► 38 Bus Run' in text and '30.0 Hz' in text and '29.9 Hz' in text
        assert '881 rpm' in text and '1.87 A' in text and 'DC link' in text
        assert 'current 1.87 A' in text and '█' in text
        assert 'q quit' in text and 'stop ALL' in text
        last = f'/conveyor/drive_{count}' if count > 1 else '/drive'
        await pilot.press('ctrl+end')
        # the one that is chosen is reported in full
        await shown(app, pilot, f' {last}  ')

    through(source, steps, size)


def test_a_fault_is_reported_with_cause_and_remedy_and_trouble_is_found_by_a_key() -> None:
    source = Hand(*conveyor(32))

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await shown(app, pilot, '✗ 1 fault', '? 1 silent')
        await pilot.press('n')
        await shown(
            app, pilot, '/conveyor/drive_3  ✗ 6 Overload  to be acknowledged',
            'why: too much for too long', 'do: check the load',
        )
        await pilot.press('n')
        await shown(app, pilot, '/conveyor/drive_7  ? not connected')
        await pilot.press('n')
        # round and round
        await shown(app, pilot, '/conveyor/drive_3  ')

    through(source, steps)


def test_keys_stop_the_drive_that_is_chosen_and_all() -> None:
    source = Hand(*conveyor(12))

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await pilot.press('down', 's', 'a')
        await pilot.pause()

    through(source, steps)
    # not the one that the order of letters has there, which is drive_10
    assert source.stopped == ['/conveyor/drive_2', 'all']


def test_the_chosen_one_stays_chosen_when_others_come_and_go() -> None:
    drives = conveyor(8)
    source = Hand(*drives)

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await pilot.press('down', 'down', 'down', 'down')
        source.picture = replace(source.picture, drives=drives[2:])
        app._look()
        await pilot.pause()
        await pilot.press('s')
        await pilot.pause()

    through(source, steps)
    assert source.stopped == ['/conveyor/drive_5']


def test_a_source_that_only_looks_has_no_keys_that_stop() -> None:
    source = Hand(_RUNS, only_looks='looks only')

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        text = await shown(app, pilot, 'looks only')
        assert 'stop ALL' not in text
        await pilot.press('s', 'a')
        await pilot.pause()

    through(source, steps)
    assert source.stopped == []


def test_without_drives_it_says_what_to_do() -> None:
    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await shown(app, pilot, 'no drives  ROS domain 7', 'start one')
        # and no key makes it fall
        await pilot.press('s', 'n', 'p', 'down')
        await shown(app, pilot, 'start one')

    through(Hand(), steps)


def test_notes_stand_in_the_log_newest_at_the_end() -> None:
    source = Hand(_RUNS)
    notes = [Note(1.8e9 + n, Level.ERROR, '/drive', f'line {n} [bold]of it') for n in range(9)]
    source.picture = replace(source.picture, notes=notes)

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        # brackets are no markup
        text = await shown(app, pilot, '/drive line 8 [bold]of it')
        assert 'line 0' not in text

    through(source, steps)


def test_another_quantity_is_plotted_by_a_key() -> None:
    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await shown(app, pilot, 'current 1.87 A, the last')
        await pilot.press('p')
        text = await shown(app, pilot, 'frequency 29.9 Hz, the last', 'torque 20 %, the last')
        assert text.index('frequency 29.9 Hz, the last') < text.index('torque 20 %, the last')

    # high enough for more than one
    through(Hand(_RUNS), steps, (80, 30))


def test_what_is_not_known_is_not_shown_as_zero() -> None:
    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        text = await shown(app, pilot, '38 Bus Run  enabled')
        assert ' 0.0' not in text and ' 0 rpm' not in text and 'nan' not in text.lower()

    through(Hand(replace(_RUNS, setpoint=math.nan, actual=math.nan, measured=Measured())), steps)


def test_names_are_in_the_order_of_their_numbers() -> None:
    names = ['/a/drive_10', '/a/drive_2', '/a/drive_1', '/drive', '7']
    assert sorted(names, key=natural) == ['7', '/a/drive_1', '/a/drive_2', '/a/drive_10', '/drive']


def test_names_are_shortened_where_that_loses_nothing() -> None:
    names = ['/conveyor/infeed', '/conveyor/a_name_that_is_too_long_for_it']
    assert list(short_names(names, 16).values()) == ['infeed', '…too_long_for_it']
    assert short_names(['/conveyor/infeed'], 16) == {'/conveyor/infeed': '/conveyor/infeed'}
    assert short_names(['/a/x', '/b/x'], 16) == {'/a/x': '/a/x', '/b/x': '/b/x'}


def test_a_unit_of_the_user_is_no_markup_and_small_values_show() -> None:
    belt = replace(_RUNS, unit='[m/s]', setpoint=0.0432, actual=-0.00001)

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        # without the unit where both have no room
        await shown(app, pilot, 'set 0.0432 [m/s]', 'actual 0.0000 [m/s]', ' 0.0432 ')

    through(Hand(belt, replace(belt, name='/other', unit='[/]')), steps)


def test_stops_that_are_not_confirmed_stay_in_sight() -> None:
    source = Hand(*conveyor(8))
    source.picture = replace(
        source.picture,
        notes=[Note(1.8e9, Level.INFO, '/drive', 'much ' * 40)] * 9,
        stops=['/drive: NOT stopped: no response'],
    )

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await shown(app, pilot, '/drive: NOT stopped: no response')
        source.picture = replace(source.picture, stops=[])
        app._look()
        await pilot.pause()
        assert 'NOT stopped' not in seen(app)

    through(source, steps)


def test_what_is_old_is_shown_as_old() -> None:
    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await shown(app, pilot, 'as of 75 s ago')

    through(Hand(replace(_RUNS, age=75.0)), steps)


def test_the_worst_stands_first_in_a_narrow_head() -> None:
    drives = conveyor(32)
    drives[4] = replace(drives[4], condition=Condition.GONE)

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        first = (await shown(app, pilot, '1 fault')).splitlines()[0]
        assert first.index('1 gone') < first.index('1 silent') < first.index('1 fault')

    through(Hand(*drives), steps)


def test_the_date_is_shown_of_what_was_not_today() -> None:
    source = Hand(_RUNS)
    notes = [Note(1.0e9, Level.WARNING, '/drive', 'old'), Note(math.nan, Level.INFO, '/drive', 'x')]
    source.picture = replace(source.picture, notes=notes)

    async def steps(app: MonitorApp, pilot: Pilot[None]) -> None:
        await shown(app, pilot, '2001-09-0', '--:--:-- /drive x')

    through(source, steps)
