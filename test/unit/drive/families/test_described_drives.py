# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Each shipped file is driven against the drive that is simulated from it."""

from __future__ import annotations

import itertools
from pathlib import Path
import textwrap

import pytest
from support.described import SHIPPED, DescribedRig
from support.rig import Asked

from nfo_sinus_driver.catalog.declared import read
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.simulator._declared.control_unit import DeclaredControlUnit

#: Whole runs, each over both lines of Modbus.
RUNS = list(itertools.product(SHIPPED, ('modbus_rtu', 'modbus_tcp')))


def reverses(rig: DescribedRig) -> bool:
    """Return whether the drive turns in reverse, by its file."""
    place = rig.file.setpoint
    return place.signed or place.direction is not None


def fault_of(rig: DescribedRig) -> int:
    """Return a fault of the drive, by its file."""
    listed = [*rig.file.faults, *(fault.code for _, fault in rig.file.flags)]
    return listed[0] if listed else 198


def test_ten_files_have_all_that_a_run_needs() -> None:
    files = [read(path) for path in SHIPPED.values()]
    assert len(files) >= 10
    for file in files:
        assert file.reset and (file.setpoint.signed or file.setpoint.direction), file.name
    # which parameters its registers are is to be set at the drive
    assert [file.name for file in files if not file.simulated.accel] == ['lenze_i500']


@pytest.mark.parametrize(('name', 'protocol'), RUNS)
def test_a_run(name: str, protocol: str) -> None:
    with DescribedRig(SHIPPED[name], protocol) as rig:
        rig.connect(parameters=True)
        rig.enable()
        assert not rig.turns and rig.far.motor.driven

        rig.follow(20.0)
        if reverses(rig):
            rig.follow(-15.0)
            assert rig.drive.snapshot.setpoint == pytest.approx(rig.unit(-15.0), rel=1e-3)

        ramp = rig.file.simulated.accel
        if ramp:
            rig.result(rig.drive.parameters.change({ramp: 1.0}))
            assert rig.far.peek(ramp) == 1.0

        assert 'stop' in rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.far.motor.turning, 20.0)
        rig.assert_only_enable_helps(rig.unit(20.0))

        rig.far.trip(fault_of(rig))
        rig.pass_time(1.0)
        assert not rig.drive.following
        rig.wait_until(lambda: not rig.far.motor.turning, 20.0)
        if rig.file.reset:
            answer = rig.answer(rig.drive.acknowledge())
            assert 'acknowledged' in answer, answer
            assert not rig.far.faults
            rig.assert_only_enable_helps(rig.unit(20.0))
            rig.lose_the_line()
            if rig.far.faults:
                # it was left alone until its own time-out had stopped it
                rig.result(rig.drive.acknowledge())
            rig.assert_only_enable_helps(rig.unit(20.0))
            rig.kill()
            rig.begin()
            rig.connect()
            rig.pass_time(1.0)
            assert not rig.turns


def test_the_template_of_the_page_is_right_and_is_driven(tmp_path: Path) -> None:
    page = (Path(__file__).parents[4] / 'docs' / 'your_own_drive.md').read_text(encoding='utf-8')
    template = page.partition('## Template\n')[2].partition('\nComplete examples')[0]
    path = tmp_path / 'my_drive.vfd.yaml'
    path.write_text(textwrap.dedent(template), encoding='utf-8')
    with DescribedRig(path) as rig:
        assert rig.file.title == 'Example 100'
        rig.connect(parameters=True)
        rig.enable()
        rig.follow(20.0)
        rig.follow(-20.0)
        rig.answer(rig.drive.quick_stop())
        assert not rig.far.motor.driven


@pytest.mark.parametrize('name', SHIPPED)
def test_no_run_command_outlives_a_fault(name: str) -> None:
    with DescribedRig(SHIPPED[name]) as rig:
        rig.connect()
        rig.enable()
        rig.follow(20.0)
        rig.far.trip(fault_of(rig))
        rig.pass_time(0.5)
        rig.far.faults.acknowledge()
        rig.send(rig.unit(20.0))
        rig.pass_time(3.0)
        assert not rig.turns and not rig.drive.following


def test_a_drive_whose_set_point_0_is_a_frequency_is_not_run() -> None:
    # in between 3-02 and 3-03 its set-points are scaled: Design Guide of the FC 101, 7.11.3
    with DescribedRig(SHIPPED['danfoss_fc101'], parameters={'reference.minimum': 10.0}) as rig:
        rig.connect()
        answer = rig.answer(rig.drive.enable())
        assert '3-02' in answer and not rig.turns, answer


def test_a_wj200_that_is_silent_after_its_reset_is_not_lost() -> None:
    """For a second, says LinuxCNC's wj200_vfd; the coil is taken away behind that."""
    with DescribedRig(SHIPPED['hitachi_wj200'], lost_after=2.0) as rig:
        rig.connect()
        rig.far.trip(3)
        rig.pass_time(1.0)
        told: list[bytes] = []

        def restart(asked: Asked) -> None:
            if asked.key == 'line.coil_3' and asked.data is not None:
                told.append(asked.data)
                rig.line.state = 'silent' if asked.data == b'\1' else rig.line.state

        rig.told = restart
        acknowledged = rig.drive.acknowledge()
        rig.pass_time(1.1)
        assert told == [b'\1']
        rig.line.mend()
        assert 'acknowledged' in rig.answer(acknowledged)
        rig.pass_time(3.0)
        assert told == [b'\1', b'\0'] and not rig.far.faults
        assert rig.drive.state.contact.connected and not rig.notes.said(Cause.LOST)
        rig.enable()
        rig.follow(20.0)


def test_a_fr_d700_that_restarts_in_place_of_an_answer_has_no_fault_afterwards() -> None:
    """Its reset is a restart, and QiTech's program awaits no answer; three tries end with that."""
    with DescribedRig(SHIPPED['mitsubishi_fr_d700'], lost_after=2.0) as rig:
        rig.connect()
        rig.far.trip(16)
        rig.pass_time(1.0)

        def meet(key: str, data: bytes | None) -> None:
            if key == 'line.r0001' and data is not None and rig.line.state == 'whole':
                rig.line.state = 'deaf'

        def restart(asked: Asked) -> None:
            if rig.line.state == 'deaf':
                rig.line.state = 'silent'

        rig.meet, rig.told = meet, restart
        acknowledged = rig.drive.acknowledge()
        rig.pass_time(1.1)
        assert len(rig.written('line.r0001')) == 3
        rig.line.mend()
        rig.meet, rig.told = (lambda key, data: None), (lambda asked: None)
        assert 'did not answer' in rig.answer(acknowledged)
        rig.pass_time(3.0)
        assert len(rig.written('line.r0001')) == 3 and not rig.far.faults
        assert rig.drive.state.contact.connected and not rig.notes.said(Cause.LOST)
        rig.assert_only_enable_helps(20.0)


@pytest.mark.parametrize('name', SHIPPED)
def test_a_local_drive_is_not_run(name: str) -> None:
    with DescribedRig(SHIPPED[name]) as rig:
        rig.connect()
        if rig.file.tells_control:
            assert isinstance(rig.far.control_unit, DeclaredControlUnit)
            rig.far.control_unit.local = True
            answer = rig.answer(rig.drive.enable())
            assert 'enabled' not in answer or 'not' in answer, answer
        for required in rig.file.requires:
            labels = tuple(rig.far.memory.model[required.key].labels.values())
            other = next((label for label in labels if label != required.value), None)
            if not labels and isinstance(required.value, int | float):
                other = required.value + 1
            if other is not None and not required.write:
                rig.far.set_from_keypad(required.key, other)
                answer = rig.answer(rig.drive.enable())
                assert required.key in answer, answer
                rig.far.set_from_keypad(required.key, required.value)
        assert not rig.turns
        assert not rig.notes.said(Cause.DRIVER_ERROR)
