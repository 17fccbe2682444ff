# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A step of a stop that is refused, lost or late does not end it (law 3, [C126])."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future
import contextlib
import itertools
from typing import Any

import pytest
from support.rig import CONNECTIONS, Rig

from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.drive import Cause, Drive

STOPS: dict[str, Callable[[Drive], Future[Any]]] = {
    'stop': lambda drive: drive.stop(),
    'quick stop': lambda drive: drive.quick_stop(),
    'exit': lambda drive: drive.stop_for_good(4.0),
}
#: What is lost costs little: how often a step is tried is not the point.
QUICK = {'response_timeout': 0.1}
#: Of the requests that tell the status nothing goes wrong: without them no stop is confirmed.
_TELLS = (
    *(Role.STATUS_WORD, Role.STATUS_CODE, Role.ACTUAL_FREQUENCY, Role.ACTUAL_SPEED),
    *(Role.CONTROL_SOURCE, Role.LOCAL_OPERATION),
)
#: Nothing else removes these run commands [C51], [C96]: set-point 0 is all that is left, and
#: where the reference is a terminal's not even that.
_NO_OTHER_WAY = {
    'optimal': 'fieldbus.smode',
    'optimal ascii': 'fieldbus.smode',
    'optimal, control word': 'fieldbus.drive_control',
    'movitrac': 'fieldbus.function_bits',
    'made up': 'bus.word',
    'described': 'line.r2000',
    'described, by states': 'line.r0000',
    'described, no holder': 'line.rfa00',
    'described, by pulses': 'line.pulse',
    'described, by set-point': 'line.setpoint',
}
#: There set-point 0 is the stop.
_BY_SETPOINT = 'described, by set-point'


def steps_of(connection: str, stop: str) -> set[tuple[str, bool]]:
    """Return what a stop over this connection asks, parameters and whether they are written."""
    with Rig(connection, line=QUICK) as rig:
        rig.turn()
        asked: set[tuple[str, bool]] = set()
        rig.meet = lambda key, data: asked.add((key, data is not None))  # type: ignore[func-returns-value]
        rig.answer(STOPS[stop](rig.drive))
        status = {rig.drive.model.key(role) for role in _TELLS}
    return {request for request in asked if request[1] or request[0] not in status}


def goes_wrong(connection: str, stop: str, step: tuple[str, bool], how: str) -> str:
    """Return what is wrong with a stop of which one step always goes wrong; ``''``: nothing."""
    rig = Rig(connection, line=QUICK, poll_rate=5.0)
    # what is only said to be carried out, or always refused, bends the order of commands
    with contextlib.closing(rig.bus):
        rig.turn()
        rig.meet = lambda key, data: how if (key, data is not None) == step else None
        future = STOPS[stop](rig.drive)
        rig.answer(future)
        held = step == (_NO_OTHER_WAY.get(connection), True)
        end = rig.clock.now + 8.0
        while rig.clock.now < end and (held or rig.turns or rig.drive.stop_unconfirmed):
            rig.pass_time(0.5)
        follows = rig.drive.settings.follows_setpoints
        wrong = []
        if rig.turns and connection != _BY_SETPOINT and (follows or not held or how == 'drop'):
            wrong.append(f'turns at {rig.far.motor.demand:g} Hz')
        if held and how != 'drop':
            if not rig.drive.stop_unconfirmed or not rig.notes.said(Cause.CANNOT_STOP):
                wrong.append('its run command stands, and nothing says so')
        elif not held:
            # what is ignored, lost or comes too soon is given time, unless the driver ends
            failed = future.exception() and (stop == 'exit' or how == 'refused')
            if (failed and stop != 'quick stop') or rig.drive.stop_unconfirmed:
                wrong.append(f'not confirmed: {future.exception()}')
    return '; '.join(wrong)


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_no_step_of_a_stop_ends_it(connection: str) -> None:
    rows = [
        (stop, step, how)
        for stop in STOPS
        for step in sorted(steps_of(connection, stop))
        for how in ('refused', 'busy', 'unheard', 'drop', *(('ignored',) if step[1] else ()))
        # by a drive that takes nothing else, and says that it does, nothing can be found out
        if how != 'ignored' or step[0] != _NO_OTHER_WAY.get(connection)
    ]
    wrong = {row: found for row in rows if (found := goes_wrong(connection, *row))}
    assert rows and not wrong, '\n'.join(f'{row}: {found}' for row, found in wrong.items())


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_a_refused_stop_of_a_motor_that_stands_is_no_alarm_until_it_turns(connection: str) -> None:
    # one that shows a run command after a stop does not show that it stands
    options = {'stop_status': 'no_enable'} if connection.startswith('movitrac') else {}
    with Rig(connection, line=QUICK, options=options) as rig:
        rig.turn()
        assert rig.answer(rig.drive.stop())
        for terminal in rig.connection.closed:
            rig.far.control_unit.switch(terminal, False)
        rig.pass_time(6.0)
        rig.meet = lambda key, data: None if data is None else 'refused'
        rig.drive.stop()
        rig.pass_time(8.0)
        assert rig.drive.stop_unconfirmed and not rig.notes.said(Cause.CANNOT_STOP)
        assert rig.notes.said(Cause.CANNOT_STOP_BUT_STANDS)
        # a drive that is not heard shows nothing
        rig.meet = lambda key, data: 'unheard'
        rig.pass_time(3.0)
        assert rig.notes.said(Cause.CANNOT_STOP)


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_the_status_goes_on_while_one_write_of_a_stop_gets_no_answer(connection: str) -> None:
    with Rig(connection, poll_rate=10.0) as rig:
        rig.turn()
        first: list[str] = []
        shown: list[tuple[float, bool]] = []

        def meet(key: str, data: bytes | None) -> str | None:
            if data is not None and not first:
                first.append(key)
            return 'drop' if data is not None and key in first else None

        began = rig.clock.now
        rig.meet = meet
        rig.notes.on_snapshot = (  # type: ignore[method-assign]
            lambda snapshot: shown.append((rig.clock.now, snapshot.enabled))
        )
        rig.drive.stop()
        rig.pass_time(3.0)
        times = [began, *(at for at, _ in shown), rig.clock.now]
        assert max(after - at for at, after in itertools.pairwise(times)) < 0.8
        assert not any(enabled for at, enabled in shown if at > began + 0.6)
        rig.meet = lambda key, data: None
        rig.pass_time(3.0)


@pytest.mark.parametrize('connection', CONNECTIONS)
def test_a_line_that_comes_back_at_any_request_of_a_stop_forces_nothing(connection: str) -> None:
    forced = []
    for number in range(2, 9):
        with Rig(connection, line=QUICK) as rig:
            rig.turn()
            asked = itertools.count(1)

            def meet(
                key: str, data: bytes | None, rig: Rig = rig, asked: Iterator[int] = asked,
                number: int = number,
            ) -> None:
                if next(asked) == number:
                    rig.line.mend()

            rig.line.state = 'silent'
            rig.meet = meet
            rig.drive.stop()
            rig.pass_time(6.0)
            if rig.notes.said(Cause.STOP_FORCED):
                forced.append(number)
            assert not rig.turns
    assert not forced


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen'])
@pytest.mark.parametrize('loses', [False, True])
def test_a_drive_that_ignores_its_stop_is_stopped_by_force_also_on_a_bad_line(
    connection: str, loses: bool
) -> None:
    with Rig(connection) as rig:
        rig.turn()
        written: list[str] = []

        def meet(key: str, data: bytes | None) -> str | None:
            if data is not None:
                written.append(key)
                return 'unheard' if key == written[0] else None
            # the status after each second stop is lost
            lost = written and written[-1] == written[0] and written.count(written[0]) % 2
            return 'unheard' if loses and lost else None

        stop = rig.drive.stop()
        rig.meet = meet
        rig.pass_time(12.0 if loses else 2.0)
        assert stop.done() and (loses or not stop.exception())
        assert rig.notes.said(Cause.STOP_FORCED) and not rig.turns


@pytest.mark.parametrize('connection', ['rtu', 'classic', 'canopen'])
@pytest.mark.parametrize('away', [4.0, 8.0])
def test_a_drive_that_is_found_again_and_ignores_its_stop_is_soon_stopped_by_force(
    connection: str, away: float
) -> None:
    with Rig(connection, poll_rate=10.0) as rig:
        rig.turn()
        written: list[str] = []

        def meet(key: str, data: bytes | None) -> str | None:
            if data is None:
                return None
            written.append(key)
            return 'unheard' if key == written[0] else None

        rig.line.state = 'silent'
        rig.drive.stop()
        rig.meet = meet
        rig.pass_time(away)
        rig.line.mend()
        # when it is found depends on when it was asked last: 1.6 to 3.2 s in all
        rig.pass_time(4.0)
        assert rig.notes.said(Cause.STOP_FORCED) and not rig.turns
