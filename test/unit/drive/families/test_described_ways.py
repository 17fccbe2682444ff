# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Ways of being commanded beside a run word: pulses, two words, the set-point, terminals."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.described import DescribedRig
from support.oddities import ODD, PLAIN, described

from nfo_sinus_driver.catalog.declared import DescriptionError
from nfo_sinus_driver.drive import Cause, DriveError, StopReason

SETPOINT = 'line.setpoint'
BY_SETPOINT = ('a set-point that is the command', 'terminals that start')


def way(tmp_path: Path, name: str, **more: Any) -> DescribedRig:
    """Return the rig of a drive that is commanded in one of these ways."""
    rig = DescribedRig(described(tmp_path, **ODD[name]), **more)
    rig.connect(parameters=True)
    return rig


def test_each_pulse_sets_one_coil_and_a_stop_is_one_of_its_own(tmp_path: Path) -> None:
    with way(tmp_path, 'pulses of coils') as rig:
        rig.enable()
        rig.follow(20.0)
        rig.follow(-20.0)
        # 73 forward and 74 reverse run; before them the stop, and none of them twice
        assert rig.written('line.pulse') [-3:] == [75, 73, 74]
        rig.answer(rig.drive.stop())
        assert rig.written('line.pulse')[-1] == 75
        rig.wait_until(lambda: not rig.far.motor.driven, 10.0)
        rig.send(20.0)
        rig.pass_time(3.0)
        assert not rig.turns and rig.written('line.pulse')[-1] == 75


def test_a_direction_of_its_own_is_written_before_the_run_and_does_not_run(tmp_path: Path) -> None:
    with way(tmp_path, 'two words to one register') as rig:
        rig.enable()
        assert rig.written('line.r000a')[-2:] == [0x80, 8]
        rig.follow(20.0)
        rig.follow(-20.0)
        assert rig.written('line.r000a')[-1] == 0x40
        rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.driven, 10.0)
        assert rig.written('line.r000a')[-1] == 4
        # and the next start runs forward again
        rig.enable()
        assert rig.written('line.r000a')[-2:] == [0x80, 8]
        rig.follow(20.0)
        assert rig.far.motor.frequency > 0


@pytest.mark.parametrize('name', BY_SETPOINT)
def test_nothing_but_set_points_commands_it(tmp_path: Path, name: str) -> None:
    with way(tmp_path, name) as rig:
        rig.enable()
        rig.pass_time(2.0)
        assert not rig.turns and set(rig.written(SETPOINT)) == {0}
        rig.follow(20.0)
        rig.follow(-15.0)
        for stop in (rig.drive.stop, rig.drive.quick_stop):
            rig.answer(stop())
            assert rig.written(SETPOINT)[-1] == 0
            rig.wait_until(lambda: not rig.turns and rig.far.motor.at_zero, 10.0)
            assert not rig.drive.stop_unconfirmed
            rig.assert_only_enable_helps(20.0)
        assert not rig.written('line.r000a')


@pytest.mark.parametrize('name', BY_SETPOINT)
def test_a_set_point_that_is_left_turns_nothing(tmp_path: Path, name: str) -> None:
    with way(tmp_path, name) as rig:
        rig.enable()
        rig.follow(20.0)
        rig.kill()
        rig.begin()
        rig.connect()
        rig.wait_until(lambda: not rig.turns, 3.0)
        rig.assert_only_enable_helps(20.0)
        rig.lose_the_line()
        rig.assert_only_enable_helps(20.0)
        # another master gives one, to a drive that nothing of this driver runs
        rig.answer(rig.drive.stop())
        rig.wait_until(lambda: rig.far.motor.at_zero, 10.0)
        rig.send(None)
        rig.pass_time(1.0)
        rig.far.memory.set(SETPOINT, 20.0)
        rig.far.control_unit.settle()
        rig.wait_until(lambda: rig.turns, 1.0)
        rig.wait_until(lambda: not rig.turns, 3.0)


@pytest.mark.parametrize('name', BY_SETPOINT)
def test_no_set_point_outlives_a_fault(tmp_path: Path, name: str) -> None:
    with way(tmp_path, name) as rig:
        rig.enable()
        rig.follow(20.0)
        rig.far.trip(1)
        rig.pass_time(1.0)
        assert rig.far.peek(SETPOINT) == 0
        rig.far.faults.acknowledge()
        rig.pass_time(2.0)
        assert not rig.turns and not rig.drive.following
        rig.assert_only_enable_helps(20.0)


def test_a_stop_that_is_refused_is_repeated_until_the_set_point_is_0(tmp_path: Path) -> None:
    with way(tmp_path, BY_SETPOINT[0]) as rig:
        rig.enable()
        rig.follow(20.0)
        rig.spoil('refused', SETPOINT, 5)
        rig.drive.stop()
        rig.wait_until(lambda: not rig.turns, 5.0)
        assert rig.far.peek(SETPOINT) == 0


def test_terminals_have_to_start_it_first(tmp_path: Path) -> None:
    with way(tmp_path, 'terminals that start') as rig:
        rig.far.control_unit.run_input = False
        rig.far.control_unit.settle()
        rig.pass_time(1.0)
        with pytest.raises(DriveError, match='close the start terminal, then enable'):
            rig.result(rig.drive.enable())
        assert set(rig.written(SETPOINT)) <= {0}
        rig.far.control_unit.run_input = True
        rig.far.control_unit.settle()
        rig.pass_time(1.0)
        assert not rig.turns and rig.far.motor.driven
        rig.enable()
        rig.follow(20.0)


def test_terminals_that_open_end_the_run_and_closing_them_does_not_begin_one(
    tmp_path: Path,
) -> None:
    with way(tmp_path, 'terminals that start') as rig:
        rig.enable()
        rig.follow(20.0)
        rig.far.control_unit.run_input = False
        rig.far.control_unit.settle()
        rig.send(20.0)
        rig.wait_until(lambda: not rig.drive.following, 3.0)
        rig.pass_time(1.0)
        assert rig.far.peek(SETPOINT) == 0
        assert rig.drive.snapshot.stop_reason is not StopReason.NONE
        assert rig.notes.said(Cause.STOPPED_BECAUSE)
        rig.far.control_unit.run_input = True
        rig.far.control_unit.settle()
        rig.assert_only_enable_helps(20.0)


def test_a_frequency_that_stays_with_set_point_0_is_no_stop(tmp_path: Path) -> None:
    # a least frequency of the drive itself
    with way(tmp_path, 'terminals that start') as rig:
        rig.enable()
        rig.follow(20.0)
        kept = rig.far.control_unit
        kind = type(kept)
        demand = kind._demand.fget
        try:
            kind._demand = property(lambda unit: max(demand(unit), 5.0))
            rig.drive.stop()
            rig.pass_time(15.0)
            assert rig.far.motor.frequency == pytest.approx(5.0)
            assert rig.drive.stop_unconfirmed
        finally:
            kind._demand = property(demand)


@pytest.mark.parametrize(
    ('more', 'said'),
    [
        ({'run': [{'register': 10, 'value': 1}]}, 'run cannot stand beside run_by'),
        ({'stop': [{'register': 10, 'value': 0}]}, 'stop cannot stand beside run_by'),
        ({'requires': [{'parameter': 'ramp.accel', 'value': 5, 'write': True}]}, 'write: true'),
    ],
)
def test_a_run_command_beside_run_by_is_refused(
    tmp_path: Path, more: dict[str, Any], said: str
) -> None:
    control = {'run_by': 'setpoint', **more}
    with pytest.raises(DescriptionError, match=said):
        DescribedRig(described(tmp_path, control=control))


def test_a_motor_that_terminals_run_has_to_be_seen_to_stand(tmp_path: Path) -> None:
    control = {'run_by': 'terminals'}
    for more in ({'measured': {}}, {'status': {**PLAIN['status'], 'stopping': {'bit': 4}}}):
        with pytest.raises(DescriptionError, match='needs measured actual_frequency'):
            DescribedRig(described(tmp_path, control=control, **more))


@pytest.mark.parametrize(
    ('setpoint', 'said'),
    [
        ({'direction': {'register': 10, 'forward': 1, 'reverse': 2, 'alone': True}}, 'alone says'),
        ({'direction': {'register': 12, 'forward': 1, 'reverse': 2, 'alone': True}}, 'alone says'),
        ({'direction': {'pulse': True, 'forward': 1, 'reverse': 1}}, 'have to differ'),
        ({'direction': {'pulse': True, 'coil': 2, 'forward': 0, 'reverse': 1}}, 'one of both'),
    ],
)
def test_a_direction_that_is_none_is_refused(
    tmp_path: Path, setpoint: dict[str, Any], said: str
) -> None:
    plain = {key: value for key, value in PLAIN['setpoint'].items() if key != 'signed'}
    with pytest.raises(DescriptionError, match=said):
        DescribedRig(described(tmp_path, setpoint={**plain, **setpoint}))


@pytest.mark.parametrize(
    ('control', 'said'),
    [
        ({'run': [{'pulse': 73}], 'stop': [{'pulse': 73}]}, 'leaves the run command'),
        ({'run': [{'pulse': 73}], 'stop': [{'register': 10, 'value': 0}]}, 'leaves the run'),
        (
            {'prepare': [{'pulse': 73}], 'run': [{'pulse': 73}], 'stop': [{'pulse': 75}]},
            'prepare gives the run command',
        ),
        (
            {'run': [{'pulse': 3}], 'stop': [{'pulse': 1}], 'reset': [{'coil': 3, 'on': True}]},
            'in the same coil',
        ),
    ],
)
def test_pulses_are_checked_as_words_are(
    tmp_path: Path, control: dict[str, Any], said: str
) -> None:
    with pytest.raises(DescriptionError, match=said):
        DescribedRig(described(tmp_path, control=control))


def changed(name: str, **control: Any) -> dict[str, Any]:
    """Return what a drive that is commanded in one of these ways differs in, with other lists."""
    return {**ODD[name], 'control': {**ODD[name]['control'], **control}}


def directed(name: str, **direction: Any) -> dict[str, Any]:
    """Return the same with another direction."""
    setpoint = ODD[name]['setpoint']
    return {'setpoint': {**setpoint, 'direction': {**setpoint['direction'], **direction}}}


PULSES, WORDS = 'pulses of coils', 'two words to one register'


@pytest.mark.parametrize(
    ('name', 'key', 'step', 'prepare', 'stop'),
    [
        (PULSES, 'line.pulse', {'pulse': 70}, 70, 75),
        (WORDS, 'line.r000a', {'register': 10, 'value': 0x200}, 0x200, 4),
    ],
)
def test_a_command_that_is_not_the_stop_leaves_a_run_of_before_standing(
    tmp_path: Path, name: str, key: str, step: Any, prepare: int, stop: int
) -> None:
    # a drive may ignore the stop before the line has control, and has it right behind
    with DescribedRig(described(tmp_path, **changed(name, prepare=[step]))) as rig:
        rig.connect(parameters=True)
        rig.enable()
        behind = rig.written(key)
        assert behind[behind.index(prepare) :][1] == stop
    with DescribedRig(
        described(tmp_path, **changed(name, prepare=[step, *ODD[name]['control']['stop']]))
    ) as rig:
        rig.connect(parameters=True)
        rig.enable()
        assert rig.written(key).count(stop) == 3, 'at the connect, and once before and in prepare'


@pytest.mark.parametrize('name', ['stop', 'coast', 'quick_stop'])
@pytest.mark.parametrize('way', [73, 74])
def test_a_stop_gives_no_run_command_for_a_moment(tmp_path: Path, name: str, way: int) -> None:
    steps = [{'pulse': way}, {'pulse': 75}]
    with pytest.raises(DescriptionError, match=f'{name} gives the run command'):
        DescribedRig(described(tmp_path, **changed(PULSES, **{name: steps})))


@pytest.mark.parametrize('name', ['stop', 'coast', 'quick_stop'])
def test_nor_does_one_of_words(tmp_path: Path, name: str) -> None:
    steps = [{'register': 10, 'value': 1}, {'register': 10, 'value': 0}]
    control = {**PLAIN['control'], name: steps}
    with pytest.raises(DescriptionError, match=f'{name} gives the run command'):
        DescribedRig(described(tmp_path, control=control))


def test_pulses_that_run_need_a_pulse_that_stops(tmp_path: Path) -> None:
    run, stop = [{'register': 10, 'value': 1}], [{'register': 10, 'value': 0}]
    with pytest.raises(DescriptionError, match='stop leaves the run command standing'):
        DescribedRig(described(tmp_path, **changed(PULSES, run=run, stop=stop)))


@pytest.mark.parametrize(
    ('more', 'said'),
    [
        (directed(WORDS, forward=4), 'stop writes 4h, and a direction that is alone is no command'),
        (directed(WORDS, reverse=1), 'reset writes 1h'),
        (
            changed(WORDS, run=[{'register': 10, 'value': 0x40}, {'register': 10, 'value': 8}]),
            'run writes 40h',
        ),
        (
            changed(
                WORDS, run=[{'register': 10, 'set': 8}], stop=[{'register': 10, 'clear': 8}]
            ),
            'run sets or clears bits',
        ),
        (
            changed(
                WORDS, run=[{'register': 10, 'value': 8}], stop=[{'register': 10, 'value': 0}]
            ),
            'stop has no bit of its own',
        ),
        (
            {
                'setpoint': {
                    'register': 11, 'factor': 0.1, 'unit': 'Hz', 'most': 60,
                    'direction': {'coil': 4, 'forward': 0, 'reverse': 1, 'alone': True},
                },
            },
            'remove alone',
        ),
        (changed(PULSES) | directed(PULSES, alone=True, forward=75, reverse=82), 'stop writes 4Bh'),
    ],
)
def test_a_direction_of_its_own_is_no_command(
    tmp_path: Path, more: dict[str, Any], said: str
) -> None:
    with pytest.raises(DescriptionError, match=said):
        DescribedRig(described(tmp_path, **{**ODD[WORDS], **more}))


def test_a_way_to_end_a_run_command_is_none_of_a_set_point(tmp_path: Path) -> None:
    stop_mode = {'parameter': 'ramp.accel', 'coasts': 5}
    with pytest.raises(DescriptionError, match='stop_mode cannot stand beside run_by'):
        DescribedRig(described(tmp_path, **changed(BY_SETPOINT[0], stop_mode=stop_mode)))


def test_a_frequency_does_not_show_what_the_terminals_do(tmp_path: Path) -> None:
    status = {'register': 20, 'running': {'register': 22, 'except': [0]}, 'fault': {'bit': 3}}
    with pytest.raises(DescriptionError, match='shows the terminals at set-point 0'):
        DescribedRig(described(tmp_path, **{**ODD[BY_SETPOINT[1]], 'status': status}))


@pytest.mark.parametrize('name', BY_SETPOINT)
@pytest.mark.parametrize('after', [0.0, 1.0, 4.0])
def test_a_motor_that_has_stopped_by_itself_is_not_started_by_the_same_set_point(
    tmp_path: Path, name: str, after: float
) -> None:
    # the set-point is written again now and then: after a power cycle, or another master's stop
    with way(tmp_path, name) as rig:
        rig.enable()
        rig.follow(20.0)
        rig.pass_time(after)
        rig.far.memory.set(SETPOINT, 0)
        rig.far.control_unit.settle()
        rig.wait_until(lambda: rig.far.motor.at_zero, 2.0)
        written = rig.written(SETPOINT)
        rig.wait_until(lambda: not rig.drive.following, 4.0)
        assert set(rig.written(SETPOINT)[len(written) :]) <= {0}
        assert rig.notes.said(Cause.STOPPED_BY_ITSELF)
        rig.pass_time(6.0)
        assert not rig.turns
        rig.assert_only_enable_helps(20.0)


def test_a_set_point_that_is_the_command_is_written_again_while_the_motor_turns(
    tmp_path: Path,
) -> None:
    with way(tmp_path, BY_SETPOINT[0]) as rig:
        rig.enable()
        rig.follow(20.0)
        rig.far.memory.set(SETPOINT, 15.0)
        rig.far.control_unit.settle()
        rig.pass_time(6.0)
        assert rig.far.motor.frequency == pytest.approx(20.0)
        # a 0 starts nothing, and some drives stop where nothing is written
        rig.send(0.0)
        rig.pass_time(1.0)
        zeros = rig.written(SETPOINT).count(0)
        rig.pass_time(6.0)
        assert rig.written(SETPOINT).count(0) == zeros + 1


@pytest.mark.parametrize(
    ('unit', 'measured', 'said'),
    [
        ('Hz', {}, 'needs measured actual_frequency, which'),
        ('Hz', {'actual_speed': {'register': 23}}, 'needs measured actual_frequency, which'),
        ('rpm', {}, 'needs measured actual_frequency or actual_speed, which'),
    ],
)
def test_a_run_by_set_points_whose_end_does_not_show_is_refused(
    tmp_path: Path, unit: str, measured: dict[str, Any], said: str
) -> None:
    setpoint = {**PLAIN['setpoint'], 'unit': unit}
    more = {**ODD[BY_SETPOINT[0]], 'setpoint': setpoint, 'measured': measured}
    with pytest.raises(DescriptionError, match=said):
        DescribedRig(described(tmp_path, **more))


def test_a_speed_shows_the_end_of_a_run_by_set_points_in_rpm(tmp_path: Path) -> None:
    more = {
        **ODD[BY_SETPOINT[0]],
        'setpoint': ODD['rpm']['setpoint'],
        'measured': {'actual_speed': {'register': 23, 'type': 'int16'}},
    }
    with DescribedRig(described(tmp_path, **more)) as rig:
        rig.connect()
        rig.enable()
        rig.follow(20.0)
        rig.far.memory.set(SETPOINT, 0)
        rig.far.control_unit.settle()
        rig.wait_until(lambda: not rig.drive.following, 4.0)
        assert rig.notes.said(Cause.STOPPED_BY_ITSELF)


def test_terminals_that_are_closed_are_no_run_of_an_earlier_session(tmp_path: Path) -> None:
    with way(tmp_path, BY_SETPOINT[1]) as rig:
        assert not rig.notes.said(Cause.FOUND_RUNNING)
        rig.enable()
        rig.follow(20.0)
        rig.kill()
        rig.begin()
        rig.connect()
        assert rig.notes.said(Cause.FOUND_RUNNING)
        rig.wait_until(lambda: not rig.turns, 3.0)


@pytest.mark.parametrize('name', BY_SETPOINT)
@pytest.mark.parametrize('vary', [0.0, 3.0])
@pytest.mark.parametrize('how', ['enable input', 'power'])
def test_a_run_that_has_ended_does_not_begin_again_by_set_points(
    tmp_path: Path, name: str, vary: float, how: str
) -> None:
    with way(tmp_path, name) as rig:
        rig.enable()
        rig.keep(lambda: rig.drive.set_setpoint(20.0 + vary * (rig.clock.now * 7 % 1)))
        rig.wait_until(lambda: rig.far.motor.frequency > 19.0, 5.0)
        rig.pass_time(2.0)
        if how == 'power':
            # no drive is back sooner
            rig.far.power_cycle(0.5)
        else:
            rig.far.set_run_input(False)
            rig.pass_time(0.3)
            rig.far.set_run_input(True)
        rig.wait_until(lambda: not rig.drive.following, 0.5)
        rig.wait_until(lambda: not rig.turns, 1.0)
        for _ in range(60):
            rig.pass_time(0.1)
            assert not rig.turns
        assert not rig.turns
        rig.assert_only_enable_helps(20.0)


@pytest.mark.parametrize('name', BY_SETPOINT)
def test_a_turn_through_standstill_is_no_end_of_a_run(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # it still turns the other way a second after the set-points have another sign
    slow = {'ramp.accel': 3.0, 'ramp.decel': 3.0}
    with way(tmp_path, name, parameters=slow) as rig:
        kind = type(rig.far.control_unit)
        demand = kind._demand.fget
        from_then = [0.0]
        monkeypatch.setattr(
            kind, '_demand',
            property(lambda unit: demand(unit) if rig.clock.now >= from_then[0] else 0.0),
        )
        rig.enable()
        for frequency in (20.0, -20.0, 3.0, -5.0, 20.0, 0.0, 20.0):
            # some drives stand for a while before they turn round
            from_then[0] = rig.clock.now + 1.8
            rig.send(frequency)
            rig.pass_time(1.85)
            rig.far.control_unit.settle()
            rig.pass_time(2.0)
            assert rig.drive.following
            assert rig.far.motor.frequency == pytest.approx(frequency, abs=0.3)


def test_a_small_set_point_is_not_repeated_to_a_motor_that_another_master_has_stopped(
    tmp_path: Path,
) -> None:
    # too small for a run that is seen to end: it is stopped when it has stood for 2 s
    with way(tmp_path, BY_SETPOINT[0]) as rig:
        rig.enable()
        rig.send(1.5)
        # a second before it would be written again
        rig.pass_time(4.0)
        assert rig.turns
        rig.far.memory.set(SETPOINT, 0.0)
        rig.far.control_unit.settle()
        for _ in range(50):
            rig.pass_time(0.1)
            assert not rig.turns
        assert not rig.drive.following
