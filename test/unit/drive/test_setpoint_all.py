# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One set-point for all drives of a line: one broadcast, taken by each as a request of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
import dataclasses
from typing import Any
from unittest import mock

import pytest
from support.rig import Rig
from support.said import Said, said

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.drive.setpoint_all import SetpointAll, Told

_TO_ALL = b'\x04\x7f\x02E001E='
_LINE = {'baud': 57600}


class Conveyor(Rig):
    """A line of Classic drives, enabled and with nothing asked yet, and a program for all."""

    def __init__(
        self, drives: int = 4, *, way: str = 'classic', enable: bool = True, **settings: Any
    ) -> None:
        ramps = {'control.accel': 0.5, 'control.retard': 0.5}
        super().__init__(
            way, drives=drives, parameters=ramps, line=_LINE, poll_rate=50.0, **settings
        )
        self.told: list[Told] = []
        names = {f'drive{address}': drive for address, drive in self.drives.items()}
        self.all = SetpointAll(
            self.bus,
            lambda: {name: drive.setpoint for name, drive in names.items()},
            self.told.append,
        )
        self.connect()
        if enable:
            self.enable()
        self.begun = len(self.line.frames)
        for notes in self.notes_of.values():
            notes.events.clear()

    def keep_all(self, value: float) -> None:
        """Send a set-point to all again and again."""
        self.keep(lambda: self.all.request(value))

    @property
    def _requests(self) -> list[bytes]:
        frames = self.line.frames[self.begun :]
        return [bytes.fromhex(one['hex']) for one in frames if one['direction'] == 'request']

    @property
    def calls(self) -> list[float]:
        """The set-points that were sent to all, in Hz."""
        return [_value(frame) for frame in self._requests if frame.startswith(_TO_ALL)]

    def own(self, address: int) -> list[float]:
        """The set-points that were sent to one drive alone."""
        head = b'\x04' + bytes((32 + address,)) + b'\x02E001E='
        return [_value(frame) for frame in self._requests if frame.startswith(head)]

    def read_back(self, address: int) -> int:
        """How often a drive was asked which set-point it has."""
        asked = b'\x04' + bytes((32 + address,)) + b'E0020\x05'
        return sum(frame == asked for frame in self._requests)

    @property
    def refused(self) -> Said:
        return said(self.told[-1].refused)

    @property
    def frequencies(self) -> list[float]:
        return [round(far.motor.frequency, 1) for far in self.fars.values()]


def _value(frame: bytes) -> float:
    word = int(frame[9:13], 16)
    return (word - 0x10000 if word & 0x8000 else word) / 10


MakeConveyor = Callable[..., Conveyor]


@pytest.fixture
def make() -> Iterator[MakeConveyor]:
    """Makes a conveyor; at the end the laws are judged by what was on its line."""
    with contextlib.ExitStack() as stack:
        yield lambda *args, **settings: stack.enter_context(Conveyor(*args, **settings))


def _events(conveyor: Conveyor, address: int) -> list[str]:
    return [text for _, _, text in conveyor.notes_of[address].events]


def test_one_frame_moves_the_whole_line_and_each_drive_is_asked_whether_it_took_it(
    make: MakeConveyor,
) -> None:
    conveyor = make()
    conveyor.all.request(20.0)
    conveyor.pass_time(2.0)
    assert conveyor.calls == [20.0]
    assert conveyor.frequencies == [20.0] * 4
    for address, drive in conveyor.drives.items():
        assert conveyor.own(address) == []
        assert conveyor.read_back(address) == 1
        assert drive.snapshot.setpoint == 20.0 and drive.snapshot.setpoint_age < 2.5
        assert drive.armed and not _events(conveyor, address)
    conveyor.all.request(-12.5)
    conveyor.pass_time(2.0)
    assert conveyor.calls == [20.0, -12.5]
    assert conveyor.frequencies == [-12.5] * 4


def test_one_that_does_not_change_is_repeated_seldom_and_to_all(make: MakeConveyor) -> None:
    conveyor = make()
    conveyor.keep_all(20.0)
    conveyor.pass_time(10.0)
    assert conveyor.frequencies == [20.0] * 4
    assert 2 <= len(conveyor.calls) <= 12
    assert all(not conveyor.own(address) for address in conveyor.drives)
    assert all(conveyor.read_back(address) == 1 for address in conveyor.drives)


def test_set_points_without_end_leave_the_line_to_the_polls(make: MakeConveyor) -> None:
    conveyor = make()
    number = iter(range(10000))
    conveyor.keep(lambda: conveyor.all.request(10.0 + next(number) % 100 / 10))
    before = [len(notes.snapshots) for notes in conveyor.notes_of.values()]
    conveyor.pass_time(5.0)
    after = [len(notes.snapshots) for notes in conveyor.notes_of.values()]
    assert len(conveyor.calls) >= 45
    assert all(b - a > 20 for a, b in zip(before, after, strict=True))
    # each is asked twice a second at most, and at the end
    assert all(5 <= conveyor.read_back(address) <= 12 for address in conveyor.drives)
    assert all(not conveyor.own(address) for address in conveyor.drives)


def test_a_drive_that_did_not_take_it_gets_it_alone_and_that_is_said_once(
    make: MakeConveyor,
) -> None:
    conveyor = make()
    conveyor.line.plan = lambda frame: conveyor.line.unplug(*[3] * frame.startswith(_TO_ALL))
    for value in (20.0, 25.0):
        conveyor.keep_all(value)
        conveyor.pass_time(2.0)
        assert conveyor.frequencies == [value] * 4
    assert conveyor.own(3) == [20.0, 25.0]
    (said,) = _events(conveyor, 3)
    assert 'did not take the set-point for all drives' in said
    assert not any(conveyor.own(address) for address in (1, 2, 4))


def test_a_drive_that_is_not_heard_for_a_moment_gets_its_own_when_it_is(
    make: MakeConveyor,
) -> None:
    conveyor = make()
    conveyor.keep_all(20.0)
    conveyor.pass_time(1.0)
    conveyor.line.unplug(2)
    conveyor.pass_time(0.4)
    conveyor.keep_all(30.0)
    conveyor.pass_time(0.2)
    conveyor.line.unplug()
    conveyor.pass_time(2.0)
    assert conveyor.frequencies == [30.0] * 4
    assert conveyor.own(2)[-1] == 30.0
    assert all(drive.armed for drive in conveyor.drives.values())


def test_the_newest_counts_whichever_it_was_for(make: MakeConveyor) -> None:
    conveyor = make()
    conveyor.all.request(10.0)
    conveyor.line.go_to(conveyor.clock.now + 0.001)
    conveyor.drives[2].set_setpoint(30.0)
    conveyor.pass_time(2.0)
    # it was overtaken before it could be sent: the second drive never gets the older one
    assert conveyor.frequencies == [10.0, 30.0, 10.0, 10.0]
    assert conveyor.own(2) == [30.0]
    conveyor.all.request(15.0)
    conveyor.pass_time(2.0)
    assert conveyor.frequencies == [15.0] * 4
    assert conveyor.calls == [15.0]


def test_no_set_point_for_a_time_ramps_all_to_a_stop(make: MakeConveyor) -> None:
    conveyor = make(setpoint_timeout=1.0)
    conveyor.keep_all(20.0)
    conveyor.pass_time(3.0)
    assert conveyor.frequencies == [20.0] * 4
    assert not any(_events(conveyor, address) for address in conveyor.drives)
    conveyor.keep(lambda: None)
    conveyor.pass_time(3.0)
    assert conveyor.frequencies == [0.0] * 4
    for address, drive in conveyor.drives.items():
        assert any('no set-point for 1 s' in text for text in _events(conveyor, address))
        assert drive.armed and drive.snapshot.setpoint == 0.0
    conveyor.keep_all(20.0)
    conveyor.pass_time(2.0)
    assert conveyor.frequencies == [20.0] * 4


def test_it_is_limited_to_the_least_that_a_drive_allows(make: MakeConveyor) -> None:
    conveyor = make(setpoint_max=40.0, own={3: {'setpoint_max': 15.0}})
    conveyor.keep_all(-60.0)
    conveyor.pass_time(2.0)
    assert conveyor.frequencies == [-15.0] * 4
    assert {said(told.limited) for told in conveyor.told} == {
        '-60 is limited to -15, the least that a drive allows (drive3)'
    }
    assert all(drive.snapshot.setpoint_clamped for drive in conveyor.drives.values())
    conveyor.keep_all(10.0)
    conveyor.pass_time(2.0)
    assert conveyor.told[-1] == Told()
    assert not any(drive.snapshot.setpoint_clamped for drive in conveyor.drives.values())


@pytest.mark.parametrize(
    ('settings', 'why'),
    [
        ({}, 'drive2 is not enabled'),
        ({'own': {2: {'control_method': 'monitor'}}}, 'drive2 is only monitored'),
        ({'own': {2: {'reference': 'fix1'}}}, 'drive2 follows a reference of its own (fix1)'),
        ({'way': 'rtu'}, 'only the Classic protocol'),
    ],
)
def test_it_is_refused_where_it_cannot_be(
    make: MakeConveyor, settings: dict[str, Any], why: str
) -> None:
    conveyor = make(enable=False, **settings)
    conveyor.enable(1, 3, 4)
    conveyor.keep_all(20.0)
    conveyor.pass_time(1.0)
    assert why in conveyor.refused
    assert conveyor.calls == []
    assert conveyor.frequencies == [0.0] * 4


def test_it_is_refused_as_long_as_one_drive_is_not_enabled(make: MakeConveyor) -> None:
    conveyor = make(enable=False)
    conveyor.enable(1, 2, 4)
    conveyor.keep_all(20.0)
    conveyor.pass_time(1.0)
    assert conveyor.refused == 'drive3 is not enabled'
    assert conveyor.calls == []
    conveyor.keep(lambda: None)
    # none that came before counts
    conveyor.enable(3)
    conveyor.pass_time(1.0)
    assert conveyor.calls == [] and conveyor.frequencies == [0.0] * 4
    conveyor.keep_all(20.0)
    conveyor.pass_time(2.0)
    assert conveyor.frequencies == [20.0] * 4


@pytest.mark.parametrize(
    'change', [{'at': '', 'key': 'fieldbus.scmd'}, {'forward_only': True}], ids=['place', 'range']
)
def test_it_is_refused_where_it_would_not_be_written_alike(
    make: MakeConveyor, change: dict[str, Any]
) -> None:
    # what only drives of different families could do, which no line of Classic has yet
    conveyor = make(2, enable=False)
    conveyor.enable(1)
    family = load_family('sinus_g2')
    target = dataclasses.replace(family.profile.setpoints['Freque'], **change)
    setpoints = {**family.profile.setpoints, 'Freque': target}
    other = dataclasses.replace(family.profile, setpoints=setpoints)
    with mock.patch.dict(family.__dict__, profile=other):
        conveyor.enable(2)
    conveyor.keep_all(20.0)
    conveyor.pass_time(1.0)
    assert conveyor.refused == 'it would not be written alike to all drives (drive1 and drive2)'
    assert conveyor.calls == []


def test_it_is_refused_where_it_would_not_mean_the_same(make: MakeConveyor) -> None:
    conveyor = make(enable=False)
    conveyor.fars[2].set_from_keypad('control.mode', 'Speed')
    conveyor.pass_time(2.0)
    conveyor.enable()
    conveyor.keep_all(20.0)
    conveyor.pass_time(1.0)
    assert 'would not mean the same' in conveyor.refused
    assert 'Speed rpm' in conveyor.refused and 'Freque Hz' in conveyor.refused
    assert conveyor.calls == []


def test_a_stop_goes_first_and_ends_it(make: MakeConveyor) -> None:
    conveyor = make()
    conveyor.keep_all(20.0)
    conveyor.pass_time(2.0)
    conveyor.all.request(30.0)
    stop = conveyor.drives[2].stop()
    assert 'stopping' in conveyor.answer(stop)
    conveyor.pass_time(2.0)
    assert 30.0 not in conveyor.calls
    assert conveyor.refused == 'drive2 is not enabled'
    assert conveyor.fars[2].motor.frequency == 0.0


@pytest.mark.parametrize('value', [float('nan'), float('inf')])
def test_what_is_no_number_is_no_request(make: MakeConveyor, value: float) -> None:
    conveyor = make()
    with pytest.raises(ValueError, match='no number'):
        conveyor.all.request(value)
    conveyor.pass_time(0.5)
    assert conveyor.calls == []


def test_a_fault_of_one_drive_stops_it_and_ends_it_for_all(make: MakeConveyor) -> None:
    conveyor = make(setpoint_timeout=1.0)
    conveyor.keep_all(20.0)
    conveyor.pass_time(2.0)
    conveyor.fars[4].trip(3)
    conveyor.pass_time(0.8)
    calls = len(conveyor.calls)
    assert conveyor.refused == 'drive4 is not enabled'
    conveyor.pass_time(3.0)
    assert len(conveyor.calls) == calls
    # the others have had no set-point since
    assert conveyor.frequencies == [0.0] * 4
