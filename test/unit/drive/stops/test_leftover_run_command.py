# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A run command of an earlier session that is left in a local drive starts nothing later."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from support.described import SHIPPED, DescribedRig
from support.rig import Rig
import yaml

from nfo_sinus_driver.catalog.declared import read

#: Those whose status shows who has control.
TELLING = [name for name, path in SHIPPED.items() if read(path).tells_control]
CONTROL_MODE = 'serial.control_mode'


def never_driven(rig: Rig) -> None:
    """Have the test fail if the motor is driven from now on, for a moment only."""

    def look() -> None:
        assert not rig.far.motor.driven, 'the motor is driven'

    rig.looked = look


def left_in_local(file: Path, **options: str) -> DescribedRig:
    """Return a drive that was made local while it ran, and whose driver was killed then."""
    rig = DescribedRig(file, options=options)
    rig.turn(rig.unit(20.0))
    rig.kill()
    set_local(rig, local=True)
    rig.wait_until(lambda: not rig.far.motor.driven)
    rig.begin()
    return rig


def set_local(rig: Rig, *, local: bool) -> None:
    """Let keypad or terminals take control, or give it to the line."""
    rig.far.control_unit.local = local  # type: ignore[attr-defined]
    rig.far.control_unit.settle()


@pytest.mark.parametrize('name', TELLING)
@pytest.mark.parametrize('monitor', [False, True])
def test_it_is_taken_back_as_the_driver_connects(name: str, monitor: bool) -> None:
    with left_in_local(SHIPPED[name], in_local='keeps') as rig:
        if monitor:
            # the motor starts where nothing removes it, which makes this a test
            rig.reset(control_method='monitor')
            rig.kill()
            rig.begin()
        rig.connect()
        set_local(rig, local=False)
        if monitor:
            assert rig.far.motor.driven
            return
        never_driven(rig)
        rig.pass_time(3.0)


@pytest.mark.parametrize('in_local', ['ignores', 'refuses'])
def test_a_drive_that_takes_no_command_in_local_is_connected_to(in_local: str) -> None:
    with left_in_local(SHIPPED['delta_vfd_el'], in_local=in_local) as rig:
        rig.connect()
        assert not rig.drive.stop_unconfirmed


@pytest.mark.parametrize('disturbs', [False, True])
def test_a_file_can_say_that_the_stop_disturbs_keypad_and_terminals(
    tmp_path: Path, disturbs: bool
) -> None:
    file: dict[str, Any] = yaml.safe_load(SHIPPED['delta_vfd_el'].read_text(encoding='utf-8'))
    file['control']['stop_disturbs_local'] = disturbs
    path = tmp_path / 'own.vfd.yaml'
    path.write_text(yaml.safe_dump(file), encoding='utf-8')
    with left_in_local(path, in_local='keeps') as rig:
        rig.asked.clear()
        rig.connect()
        written = [key for _, key, data in rig.asked if data is not None]
        assert (written == []) is disturbs
        rig.pass_time(3.0)
        assert [key for _, key, data in rig.asked if data is not None] == written


@pytest.mark.parametrize('mode', ['Standard', 'Remote setpoint', 'Fieldbus'])
def test_directions_of_a_movitrac_do_not_wait_for_remote_control(mode: str) -> None:
    with Rig('movitrac') as rig:
        rig.turn()
        rig.kill()
        rig.far.set_from_keypad(CONTROL_MODE, mode)
        rig.wait_until(lambda: not rig.far.motor.driven)
        rig.begin()
        rig.asked.clear()
        rig.connect()
        if mode == 'Fieldbus':
            # whose bits they are is not known
            assert not any(data for _, _, data in rig.asked)
            return
        rig.far.set_from_keypad(CONTROL_MODE, 'Remote control')
        never_driven(rig)
        rig.pass_time(3.0)


def test_no_read_in_vain_goes_before_the_stop_of_a_motor_that_is_found_standing() -> None:
    # its direction is left in the function bits, and at set-point 0 it shows a run
    with Rig('movitrac') as rig:
        rig.turn(20.0)
        rig.send(0.0)
        rig.wait_until(lambda: rig.far.motor.frequency == 0.0, 10.0)
        rig.pass_time(1.0)
        rig.kill()
        rig.begin()
        rig.meet = lambda key, data: (
            'unheard' if key == 'fieldbus.function_bits' and data is None else None
        )
        rig.drive.connect()
        rig.pass_time(0.5)
        # both directions
        assert not int(rig.far.peek('fieldbus.function_bits')) & 0x3
