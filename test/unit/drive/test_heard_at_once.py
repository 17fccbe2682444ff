# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""What ends a ride is heard to its end at once, and answered, however full the line is."""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import threading

from drive_rig import PATIENCE
from drive_rig import SCMD
from drive_rig import Rig
from drive_rig import wait_until
import pytest
from support.addresses import Words
from support.addresses import register

from nfo_sinus_driver.bus import Priority

_STATUS, _INV_ST, _CONTROL_MODE = 0x258, 0x2A5, 0x29C
#: What the others ask for: FrqAct.
_CHATTER = register(0x400)


@contextlib.contextmanager
def _crowd(rig: Rig) -> Iterator[None]:
    """Let others ask without end, as the polls of a long line do."""
    ended = threading.Event()

    async def chatter() -> None:
        while not ended.is_set():
            await rig.bus.read(1, _CHATTER, Priority.POLL)

    talkers = [rig.bus.run(chatter()) for _ in range(4)]
    try:
        yield
    finally:
        ended.set()
        for talker in talkers:
            talker.result(PATIENCE)


def _happens_before_read_of(rig: Rig, register: int, *event: object) -> None:
    """Let something happen just before the next read of a register."""

    def before(asked: int, words: Words | None) -> None:
        if (asked, words) == (register, None):
            rig.tap.before = lambda *_: None
            rig.simulator.inject(*event)

    rig.tap.before = before


def _asked(rig: Rig) -> list[int]:
    """Which registers were asked for or written, in order."""
    requests = [frame for frame in rig.trace() if frame['direction'] == 'request']
    return [int(frame['hex'][4:8], 16) for frame in requests]


@pytest.mark.parametrize(
    ('told_by', 'event'),
    [
        # of a lost RUN input the inverter status says no more than that the motor slows down
        (_STATUS, ('run', False)),
        (_STATUS, ('keypad', 'ext')),
        (_STATUS, ('keypad', 'stop')),
        (_INV_ST, ('keypad', 'ext')),
        (_INV_ST, ('keypad', 'stop')),
    ],
)
def test_a_drive_that_stops_is_told_to_stop_before_anybody_else_talks(
    rig: Rig, told_by: int, event: tuple[object, ...]
) -> None:
    rig.turn()
    with _crowd(rig):
        begun = len(_asked(rig))
        _happens_before_read_of(rig, told_by, *event)
        wait_until(lambda: not rig.drive.armed)
        wait_until(lambda: SCMD in _asked(rig)[begun:])
    asked = _asked(rig)
    stop = asked.index(SCMD, begun)
    # the half that told it, and the other half
    order = [_STATUS, _INV_ST] if told_by == _STATUS else [_INV_ST, _STATUS]
    assert asked[stop - 2 : stop] == order


def test_a_changed_control_mode_is_answered_before_anybody_else_talks(rig: Rig) -> None:
    rig.connect()
    rig.enable()
    rig.next_snapshots()
    with _crowd(rig):
        begun = len(_asked(rig))
        rig.simulator.inject('set', 'control.mode', 'Speed')
        wait_until(lambda: not rig.drive.armed)
        wait_until(lambda: SCMD in _asked(rig)[begun:])
    asked = _asked(rig)
    stop = asked.index(SCMD, begun)
    assert asked[stop - 1] == _CONTROL_MODE
    assert asked[begun:stop].count(_STATUS) <= 2


def test_what_goes_on_as_it_did_has_no_claim_on_the_line(rig: Rig) -> None:
    rig.turn()
    with _crowd(rig):
        rig.next_snapshots()
        begun = len(_asked(rig))
        rig.next_snapshots()
        asked = _asked(rig)[begun:]
    follows = [asked[number + 1 :][:1] for number, what in enumerate(asked) if what == _STATUS]
    assert [_CHATTER.index] in follows
    assert [_INV_ST] not in follows
