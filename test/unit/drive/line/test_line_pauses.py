# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A drive, a gateway or a whole line that needs more silence than its protocol has."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import math
from pathlib import Path

import pytest
from support.described import SHIPPED, DescribedRig
from support.rig import SLICE, Asked, Rig

from nfo_sinus_driver.catalog import CatalogError
from nfo_sinus_driver.catalog.declared import read
from nfo_sinus_driver.drive import Cause, DriveError

#: Lines that may have something slow between.
LINES = ('rtu', 'ascii', 'tcp', 'classic', 'movitrac', 'described')


class Deaf:
    """
    Loses each request that comes too soon after an answer.

    :param seconds: how soon.
    :param units: who does so; all, where none is named.
    :param anyone: the answer of any unit counts, as for a gateway; else only the own ones.
    :param after: whether the answer to a request counts; each does, where it is not given.
    :ivar lost: when a request was lost.
    """

    def __init__(
        self,
        rig: Rig,
        seconds: float,
        *units: int,
        anyone: bool = False,
        after: Callable[[bytes], bool] = lambda request: True,
    ) -> None:
        self._rig = rig
        self._seconds = seconds
        self._units = units
        self._anyone = anyone
        self._after = after
        self.lost: list[float] = []
        rig.line.plan = self._plan

    def _plan(self, frame: bytes) -> str | None:
        line = self._rig.line
        unit = self._unit_of(frame)
        if self._units and unit not in self._units:
            return None
        if line.clock.now - self._answered_at(unit) >= self._seconds - 1e-6:
            return None
        self.lost.append(line.clock.now)
        return 'unheard'

    def _unit_of(self, frame: bytes) -> int:
        line = self._rig.line
        # as ASCII writes it
        return int(frame[1:3], 16) if frame[:1] == b':' else line.unit_of(frame)

    def _answered_at(self, unit: int) -> float:
        line = self._rig.line
        asked = None
        frames = line.frames
        for at in range(len(frames) - 1, -1, -1):
            if frames[at]['direction'] == 'request':
                continue
            asked = next(
                bytes.fromhex(frame['hex']) for frame in reversed(frames[:at])
                if frame['direction'] == 'request' and frame['note'] != 'lost'
            )
            if self._anyone or self._unit_of(asked) == unit:
                return frames[at]['last'] if self._after(asked) else -math.inf
        return -math.inf


def connect(rig: Rig) -> None:
    """Connect to all drives, as a node does that tries again and again."""
    for drive in rig.drives.values():
        end = rig.clock.now + 20.0
        while not drive.snapshot.connected:
            assert rig.clock.now < end, 'it never connects'
            with contextlib.suppress(DriveError):
                rig.result(drive.connect(parameters=False))
        drive.activate()
    rig.pass_time(0.2)


@pytest.mark.parametrize('connection', LINES)
@pytest.mark.parametrize('seconds', (0.007, 0.033, 0.095))
@pytest.mark.parametrize('anyone', (False, True), ids=('drive', 'gateway'))
def test_a_drive_that_hears_nothing_just_after_an_answer_is_used(
    connection: str, seconds: float, anyone: bool
) -> None:
    with Rig(connection, drives=2, lost_after=2.0) as rig:
        deaf = Deaf(rig, seconds, anyone=anyone)
        connect(rig)
        rig.pass_time(20.0)
        deaf.lost.clear()
        rig.enable()
        rig.send(20.0)
        rig.pass_time(5.0)
        assert all(abs(far.motor.frequency) > 19.0 for far in rig.fars.values())
        assert len(deaf.lost) <= 3
        texts = ' '.join(rig.bus.remarks)
        # the file of a described drive may have a pause that is long enough from the start
        assert ('unit 1 loses' in texts) == (rig.drive.model.profile.gap < seconds)
        for drive in rig.drives.values():
            assert 'stop' in rig.answer(drive.stop(), 2.0)


def test_others_are_asked_while_one_rests() -> None:
    with Rig('rtu', drives=2, poll_rate=50.0, lost_after=2.0) as rig:
        deaf = Deaf(rig, 0.095, 1)
        connect(rig)
        rig.pass_time(20.0)
        deaf.lost.clear()
        rig.asked.clear()
        rig.pass_time(5.0)
        units = [unit for unit, *_ in rig.asked]
        asked = {unit: units.count(unit) for unit in rig.drives}
        assert not deaf.lost
        assert asked[1] >= 35 and asked[2] >= 5 * asked[1]
        # it is learnt of the one alone
        assert 'unit 1 loses' in ' '.join(rig.bus.remarks)
        assert 'unit 2 loses' not in ' '.join(rig.bus.remarks)


@pytest.mark.parametrize('connection', LINES)
@pytest.mark.parametrize('kind', ('rests', 'needs silence'))
def test_a_stop_waits_for_the_pause_of_its_own_drive_and_of_no_other(
    connection: str, kind: str
) -> None:
    pause = 0.4
    with Rig(connection, drives=2, poll_rate=2.0) as rig:
        rig.turn()
        written: list[Asked] = []
        rig.told = lambda asked: written.append(asked) if asked.data is not None else None
        # no set-point is between
        rig.send(None)
        if kind == 'rests':
            rig.bus.call(lambda: rig.bus.rest(1, pause))
        else:
            rig.bus.require_gap(1, pause)
        rig.pass_time(SLICE / 10)
        began = rig.clock.now
        ends = [rig.drives[unit].stop() for unit in (1, 2)]
        rig.wait_until(lambda: all(end.done() for end in ends), 10.0)
        assert all('stop' in rig.answer(end) for end in ends)
        first = {
            unit: min(request.sent for request in written if request.unit == unit)
            for unit in (1, 2)
        }
        assert first[2] - began < 0.1
        assert first[1] - began > pause - 0.1


@pytest.mark.parametrize('connection', LINES)
def test_before_each_request_the_line_is_silent_for_request_gap(connection: str) -> None:
    gap = 0.031
    with Rig(connection, drives=2, line={'request_gap': gap}, lost_after=2.0) as rig:
        rig.turn()
        # a resynchronising read and a repeat, and what comes behind one
        rig.line.losses = 2
        rig.pass_time(2.0)
        assert all('stop' in rig.answer(drive.stop()) for drive in rig.drives.values())
        frames = rig.line.frames
        gaps = [
            after['first'] - max(frame['last'] for frame in frames[max(0, at - 3) : at + 1])
            for at, after in enumerate(frames[1:])
            if after['direction'] == 'request'
        ]
        assert len(gaps) > 100
        assert min(gaps) > gap - 0.001


def described(folder: Path, line: str) -> Path:
    """Return a file with more in its part for the line."""
    text = SHIPPED['delta_vfd_el'].read_text().replace('  gap: 0.011\n', '')
    path = folder / 'slow.vfd.yaml'
    path.write_text(text.replace('line:\n', f'line:\n{line}', 1))
    return path


@pytest.mark.parametrize('protocol', ('modbus_rtu', 'modbus_tcp'))
def test_a_file_says_how_long_the_line_is_silent_before_requests(
    protocol: str, tmp_path: Path
) -> None:
    with DescribedRig(described(tmp_path, '  gap: 0.04\n'), protocol, drives=2) as rig:
        deaf = Deaf(rig, 0.04, anyone=True)
        rig.turn()
        assert all('stop' in rig.answer(drive.stop()) for drive in rig.drives.values())
        assert not deaf.lost
        assert rig.bus.remarks == ()


def test_a_file_says_how_long_the_drive_is_left_alone_after_a_parameter(tmp_path: Path) -> None:
    rest = 0.3
    path = described(tmp_path, f'  after_write: {rest}\n')
    with DescribedRig(path, drives=2, poll_rate=20.0, telemetry_rate=5.0) as rig:
        rig.connect(parameters=True)
        key = 'ramp.accel'
        asked: list[Asked] = []
        rig.told = asked.append
        rig.result(rig.drive.parameters.change({key: 3.0}))
        at = next(
            n
            for n, request in enumerate(asked)
            if request.key == key and request.data is not None
        )
        written = asked[at].ended
        later = [request for request in asked[at + 1 :] if request.sent < written + rest]
        assert {request.unit for request in later} == {2}
        # the reading back is the next one
        assert any(request.unit == 1 and request.sent >= written + rest for request in asked)


def test_the_shipped_files_have_the_pauses_of_their_makers() -> None:
    lines = {name: read(path).line for name, path in SHIPPED.items()}
    assert all(line.gap > 0.01 for name, line in lines.items() if name.startswith('delta'))
    assert lines['yaskawa_v1000'].gap >= 0.005
    assert lines['yaskawa_v1000'].after_write >= 0.2


@pytest.mark.parametrize('connection', ('rtu', 'tcp', 'classic', 'movitrac'))
@pytest.mark.parametrize('noise', (0.05, 0.2))
def test_noise_is_no_pause(connection: str, noise: float) -> None:
    with Rig(connection, drives=2, lost_after=4.0) as rig:
        rig.connect()
        rig.line.make_noise(noise, 5)
        rig.pass_time(40.0)
        assert not [text for text in rig.bus.remarks if 'loses' in text]


@pytest.mark.parametrize('connection', LINES)
def test_a_drive_that_is_switched_off_makes_no_pause(connection: str) -> None:
    with Rig(connection, drives=2) as rig:
        rig.connect()
        rig.line.unplug(2)
        rig.pass_time(30.0)
        assert rig.bus.remarks == ()
        rig.line.unplug()
        rig.wait_until(lambda: rig.drives[2].state.contact.connected, 20.0)
        assert rig.bus.remarks == ()


def told_of_too_long_pauses(rig: Rig) -> bool:
    return any(notes.said(Cause.PAUSES_TOO_LONG) for notes in rig.notes_of.values())


def test_pauses_that_add_up_to_a_loss_are_told() -> None:
    with Rig('rtu', drives=4, lost_after=1.0, line={'request_gap': 0.3}) as rig:
        connect(rig)
        rig.wait_until(lambda: told_of_too_long_pauses(rig))
    with Rig('rtu', drives=4, lost_after=1.0, line={'request_gap': 0.01}) as rig:
        connect(rig)
        assert not told_of_too_long_pauses(rig)


def test_a_line_whose_drives_want_silence_is_shown_as_full() -> None:
    with Rig(drives=4, poll_rate=100.0, line={'request_gap': 0.02}) as rig:
        rig.connect()
        rig.pass_time(4.0)
        assert rig.bus.statistics().utilisation > 0.9


def test_no_file_keeps_a_stop_back_for_longer_than_half_a_second(tmp_path: Path) -> None:
    read(described(tmp_path, '  after_write: 0.5\n'))
    with pytest.raises(CatalogError, match=r'after_write'):
        read(described(tmp_path, '  after_write: 0.6\n'))
