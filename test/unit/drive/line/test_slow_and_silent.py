# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Slow answers are no loss, and drives that do not answer cost no other drive its motor."""

from __future__ import annotations

from random import Random

import pytest
from support.drive_timeout import by_default
from support.rig import Rig

from nfo_sinus_driver.drive import Cause, DriveSettings


def answer_after(rig: Rig, seconds: float) -> None:
    """Have all drives, or their gateway, answer so long after a request from now on, s."""
    name = '_pause' if hasattr(rig.line.wire, '_pause') else '_turnaround'
    setattr(rig.line.wire, name, seconds)


@pytest.mark.parametrize(
    ('connection', 'seconds', 'line'),
    [
        ('rtu', 0.15, {}), ('optimal', 0.15, {}), ('classic', 0.15, {}), ('movitrac', 0.15, {}),
        ('canopen', 0.06, {}), ('canopen', 0.1, {}), ('tcp', 0.1, {'gateway_timeout': 0.5}),
    ],
)
def test_drives_that_answer_later_than_ever_before_are_not_lost(
    connection: str, seconds: float, line: dict[str, float]
) -> None:
    with Rig(connection, drives=3, line=line) as rig:
        rig.turn()
        answer_after(rig, seconds)
        rig.pass_time(8.0)
        assert all(drive.following for drive in rig.drives.values())


@pytest.mark.parametrize('drives', [3, 8])
def test_a_late_answer_now_and_then_is_no_loss(drives: int) -> None:
    with Rig(drives=drives) as rig:
        rig.turn()
        random, usual = Random(1), rig.line.wire._pause

        def plan(frame: bytes) -> None:
            answer_after(rig, 0.15 if random.random() < 0.05 else usual)

        rig.line.plan = plan
        rig.pass_time(10.0)
        assert all(drive.following for drive in rig.drives.values())


@pytest.mark.parametrize(('drives', 'dead'), [(3, 2), (4, 3), (8, 5), (8, 7)])
@pytest.mark.parametrize('response_timeout', [0.2, 0.5, 1.0, 2.0])
@pytest.mark.parametrize('connection', ['rtu', 'classic', 'movitrac', 'canopen', 'tcp'])
def test_a_drive_that_answers_is_not_lost_beside_those_that_do_not(
    connection: str, drives: int, dead: int, response_timeout: float
) -> None:
    if connection == 'tcp' and response_timeout > DriveSettings().lost_after:
        pytest.skip('such a gateway keeps the line for longer than a drive may be silent')
    with Rig(connection, drives=drives, line={'response_timeout': response_timeout}) as rig:
        rig.turn()
        last = drives - dead
        rig.line.plan = lambda frame: 'unheard' if rig.line.unit_of(frame) > last else None
        rig.pass_time(12.0)
        assert [unit for unit, drive in rig.drives.items() if drive.following] == [
            *range(1, last + 1)
        ]


@pytest.mark.parametrize('enabled', [[1], [1, 2]])
def test_where_all_that_may_run_are_silent_the_line_is_quiet_until_their_time_out_has_struck(
    enabled: list[int],
) -> None:
    # any message counts for it, also those to drives that stand
    with by_default('rtu', drives=3, line={'any_counts': True}) as rig:
        rig.connect()
        rig.enable(*enabled)
        rig.send(20.0, *enabled)
        rig.pass_time(2.0)
        rig.line.plan = lambda frame: 'unheard' if rig.line.unit_of(frame) in enabled else None
        # lost, to be written to for 3 s, and left alone
        rig.pass_time(7.0)
        assert not any(rig.fars[unit].motor.driven for unit in enabled)
        assert not any(notes.said(Cause.MAY_RUN_ON) for notes in rig.notes_of.values())


def test_where_another_that_runs_answers_it_is_asked_and_that_is_said() -> None:
    with by_default('rtu', drives=2, line={'any_counts': True}) as rig:
        rig.turn()
        rig.line.plan = lambda frame: 'unheard' if rig.line.unit_of(frame) == 1 else None
        rig.pass_time(7.0)
        assert rig.drives[2].following
        assert rig.notes.said(Cause.MAY_RUN_ON)


def test_a_drive_of_which_the_plc_has_no_data_is_lost_also_while_it_is_stopped() -> None:
    with Rig('telegram1 g2', drives=2) as rig:
        rig.turn()
        rig.fars[1].silence(3600.0)
        rig.drives[1].stop()
        rig.wait_until(lambda: not rig.drives[1].snapshot.connected, 2.0)


@pytest.mark.parametrize('connection', ['rtu', 'ascii', 'tcp', 'classic', 'movitrac', 'canopen'])
def test_drives_that_answer_in_no_time_are_waited_for_no_longer_than_others(
    connection: str,
) -> None:
    at_once = {'response_timeout': 4.0, 'turnaround': 0.0, 'paced': False}
    with Rig(connection, drives=3, line=at_once) as rig:
        rig.turn()
        rig.line.spoil('drop')
        rig.send(10.0)
        rig.pass_time(2.0)
        assert all(drive.following for drive in rig.drives.values())
        # they hear all that is sent, and nothing of them is heard
        rig.line.state = 'deaf'
        rig.pass_time(4.0)
        assert not any(far.motor.driven for far in rig.fars.values())
