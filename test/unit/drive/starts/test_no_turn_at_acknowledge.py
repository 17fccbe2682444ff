# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""No turn at an acknowledgement, whatever the drive does with its run command in a fault [C98]."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future
import itertools
import os
import random
from typing import Any

import pytest
from support.rig import Rig

from nfo_sinus_driver.families.sinus_g2.words import Mode

#: How many acknowledgements each kind of drive goes through; a campaign has a thousand.
ACKNOWLEDGEMENTS = int(os.environ.get('ACKNOWLEDGEMENTS', '6'))
KINDS = (
    {'run_command_in_fault': 'keeps', 'refuses_in_fault': 'nothing'},
    {'run_command_in_fault': 'keeps', 'refuses_in_fault': 'scmd'},
    {'run_command_in_fault': 'drops', 'refuses_in_fault': 'all'},
)
_WORST = {'run_command_in_fault': 'keeps', 'refuses_in_fault': 'all'}
#: InvSt with acknowledging [M0 table 5], and what stops.
_ACK, _MODE, _SCMD = 'fieldbus.inv_st_with_ack', 'fieldbus.mode', 'fieldbus.scmd'
_OVERLOAD = 5
_SIO_FAIL = 14


class Poller:
    """
    Notes when the motor is energised although it should not be.

    :ivar seconds: for how long it was, in all.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._before = rig.clock.now
        self.watching = True
        self.seconds = 0.0
        rig.looked = self._look

    def _look(self) -> None:
        now = self._rig.clock.now
        if self.watching and self._rig.far.motor.driven:
            self.seconds += now - self._before
        self._before = now


def acknowledged(rig: Rig) -> Future[Any]:
    rig.acknowledged += 1
    return rig.drive.acknowledge()


def asked(rig: Rig, since: int) -> list[tuple[str, int | None]]:
    """Return what was read and written since so many requests."""
    return [
        (key, None if data is None else int.from_bytes(data, 'big'))
        for _, key, data in rig.asked[since:]
    ]


def disturb(rig: Rig, chance: random.Random) -> None:
    """Have some of the next answers lost, late or doubled, or requests unheard, or nothing."""
    what = chance.choice(('', '', 'losses', 'unheard', 'late', 'doubled'))
    if what == 'late':
        rig.line.state = 'late'
    elif what:
        setattr(rig.line, what, chance.randint(1, 8 if what == 'doubled' else 4))


def fault_and_acknowledge(rig: Rig, watch: Poller, chance: random.Random) -> None:
    """Run the motor into a fault, and acknowledge it on a line that is not perfect."""
    rig.enable()
    rig.send(20.0)
    rig.pass_time(0.2)
    assert rig.far.motor.driven
    rig.far.trip(chance.choice((_OVERLOAD, _OVERLOAD, 7, _SIO_FAIL)))
    watch.watching = True
    # before the next poll, or when the stop that follows a fault is long over
    rig.pass_time(chance.choice((0.0, 0.01, 0.06, 1.0)))
    disturb(rig, chance)
    future = acknowledged(rig)
    rig.pass_time(chance.choice((0.1, 1.0)))
    rig.line.mend()
    rig.answer(future)
    rig.wait_until(lambda: rig.drive.snapshot.connected)
    if rig.far.faults:
        rig.answer(acknowledged(rig))
    assert not rig.far.faults
    rig.pass_time(1.0)
    assert not rig.drive.stop_unconfirmed
    watch.watching = False


def fallen_still(rig: Rig) -> Poller:
    """Run the motor into a fault, and wait until the shaft stands."""
    rig.turn()
    rig.far.trip(_OVERLOAD)
    rig.wait_until(lambda: not rig.far.motor.turning)
    rig.pass_time(0.5)
    return Poller(rig)


@pytest.mark.timeout(3600)
@pytest.mark.parametrize('connection', ['rtu', 'rtu, control word'])
@pytest.mark.parametrize('kind', KINDS)
def test_no_turn_at_an_acknowledgement(kind: Mapping[str, str], connection: str) -> None:
    with Rig(connection, options=kind, drive_timeout=0.0) as rig:
        rig.connect()
        watch = Poller(rig)
        watch.watching = False
        for number in range(ACKNOWLEDGEMENTS):
            fault_and_acknowledge(rig, watch, random.Random(number))
            assert not watch.seconds, f'energised at acknowledgement {number}'


def test_two_transactions_at_most_where_everything_is_refused() -> None:
    with Rig(options=_WORST) as rig:
        watch = fallen_still(rig)
        since = len(rig.asked)
        assert 'acknowledged' in rig.answer(acknowledged(rig))
        rig.pass_time(0.5)
        requests = asked(rig, since)
        assert requests[requests.index((_ACK, None)) + 1] == (_MODE, Mode.STOP)
        # the answer to the acknowledgement, and the stop
        assert 0.0 < watch.seconds < 0.013
        assert not rig.far.motor.driven


def test_the_stop_that_everything_depends_on_is_repeated_until_it_is_answered() -> None:
    with Rig(options=_WORST) as rig:
        watch = fallen_still(rig)
        stops: list[tuple[float, str]] = []

        def lose(key: str, data: bytes | None) -> str | None:
            if data is not None and not rig.far.faults:
                stops.append((rig.clock.now, key))
                return 'unheard' if len(stops) <= 3 else None
            return 'drop' if key == _ACK else None

        rig.meet = lose
        rig.answer(acknowledged(rig))
        rig.pass_time(1.0)
        assert [key for _, key in stops[:4]] == [_MODE, _SCMD, _SCMD, _SCMD]
        # nothing between two of them but the time-out that shows that one was lost
        assert max(later[0] - at[0] for at, later in itertools.pairwise(stops[:4])) < 0.25
        assert watch.seconds and not rig.far.motor.driven
        assert not rig.drive.stop_unconfirmed


def test_everything_is_removed_before_the_acknowledgement() -> None:
    stays = []
    for kind in (*KINDS, _WORST):
        with Rig(options=kind) as rig:
            rig.turn()
            since = len(rig.asked)
            rig.far.trip(_OVERLOAD)
            rig.pass_time(0.5)
            assert 'acknowledged' in rig.answer(acknowledged(rig))
            requests = asked(rig, since)
            before = requests[: requests.index((_ACK, None))]
            removed = ((_SCMD, 0), ('status.frq_set', 0), (_MODE, Mode.STOP))
            stays += [(kind, word) for word in removed if word not in before]
    assert not stays


def test_a_serial_fault_is_acknowledged_by_mode_stop_alone() -> None:
    with Rig(options=_WORST) as rig:
        rig.turn()
        rig.far.trip(_SIO_FAIL)
        rig.pass_time(0.5)
        since = len(rig.asked)
        assert 'acknowledged 14' in rig.answer(acknowledged(rig))
        requests = asked(rig, since)
        written = [request for request in requests if request[1] is not None]
        assert written[0][0] == _MODE
        assert (_ACK, None) not in requests


def test_control_of_the_terminals_is_left_to_them() -> None:
    taken = []
    for kind in (*KINDS, _WORST):
        with Rig(options=kind) as rig:
            rig.connect()
            rig.far.control_unit.press('ext')
            rig.pass_time(0.5)
            rig.far.trip(_OVERLOAD)
            rig.pass_time(0.5)
            since = len(rig.asked)
            assert 'acknowledged' in rig.answer(acknowledged(rig))
            rig.pass_time(0.5)
            if any(data is not None for _, data in asked(rig, since)):
                taken.append(kind)
            assert rig.far.control_unit.mode == Mode.EXT
    assert not taken


def test_a_fault_that_ends_by_itself_turns_nothing() -> None:
    for kind in (kind for kind in KINDS if kind['refuses_in_fault'] != 'all'):
        with Rig(options=kind) as rig:
            rig.turn()
            rig.far.trip(_OVERLOAD)
            rig.pass_time(0.5)
            watch = Poller(rig)
            rig.far.faults.acknowledge()
            rig.far.set_run_input(True)
            rig.pass_time(1.0)
            assert not watch.seconds, kind
