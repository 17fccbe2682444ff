# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Nothing turns the motor while control is taken, whatever stands in the drive from before."""

from __future__ import annotations

from drive_rig import MODE, RUN
import pytest
from support.addresses import Words
from virtual_rig import MakeVirtual, VirtualRig

from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.simulator.sinus.control_unit import Source

_COMMANDS = {'sinus_g2': 'fieldbus.scmd', 'sinus_optimal': 'fieldbus.smode'}
_SETPOINTS = {'sinus_g2': 'status.frq_set', 'sinus_optimal': 'fieldbus.input_freq_setpoint'}
#: For so long may a motor have current by a command that is removed with the next frame, s.
_LONGEST = 0.02


class Left:
    """
    A drive in which an earlier session has left a set-point and a run command.

    That the drive waits for a command once the bus has control says [M0 table 17]; that it has
    forgotten the one from before says nobody, and this one has not.

    :ivar driven: for how long the motor has been energised, s.
    :ivar turned: it has turned.
    """

    def __init__(self, rig: VirtualRig) -> None:
        self._rig = rig
        model = rig.settings.model
        self.command = rig.register(_COMMANDS[model])
        self.setpoint = rig.register(_SETPOINTS[model])
        unit = rig.far.control_unit
        self._hand_over = unit.take
        unit.take = self._keep_command
        unit.scmd = type(unit.scmd)(RUN)
        rig.far.memory.set(_SETPOINTS[model], 30.0)
        self.driven, self.turned = 0.0, False
        self._looked_at = rig.clock.now
        rig.looked = self._look

    def _keep_command(self, source: Source) -> None:
        unit = self._rig.far.control_unit
        standing = unit.scmd
        self._hand_over(source)
        unit.scmd = standing

    def _look(self) -> None:
        now, motor = self._rig.clock.now, self._rig.far.motor
        if motor.driven:
            self.driven += now - self._looked_at
        self.turned = self.turned or motor.turning
        self._looked_at = now

    def written(self) -> list[tuple[int, int]]:
        """Return what was written where, in order: of the command, MODE and the set-point."""
        frames = [bytes.fromhex(frame['hex']) for frame in self._rig.link.frames]
        writes = [
            (int.from_bytes(frame[2:4], 'big'), int.from_bytes(frame[-4:-2], 'big'))
            for frame in frames
            if frame[1] in (6, 16)
        ]
        return [write for write in writes if write[0] in (self.command, MODE, self.setpoint)]


def follow(rig: VirtualRig) -> None:
    """Give a set-point, and let the drive follow it."""
    rig.send(20.0)
    rig.pass_time(1.0)
    assert abs(rig.far.motor.frequency - 20.0) < 0.2


@pytest.mark.parametrize('model', _COMMANDS)
def test_what_an_earlier_session_has_left_does_not_turn_the_motor(
    make_virtual: MakeVirtual, model: str
) -> None:
    rig = make_virtual(model=model)
    rig.connect()
    left = Left(rig)
    begun = len(left.written())
    assert 'enabled' in rig.answer(rig.drive.enable())
    # to stop it as soon as control is there, and never at an old set-point
    assert left.written()[begun:][:3] == [(left.setpoint, 0), (MODE, Mode.BUS), (left.command, 0)]
    rig.pass_time(0.5)
    assert not left.turned
    follow(rig)


@pytest.mark.parametrize('model', _COMMANDS)
def test_a_drive_that_refuses_set_points_until_it_is_controlled_is_stopped_first(
    make_virtual: MakeVirtual, model: str
) -> None:
    rig = make_virtual(model=model)
    rig.connect()
    left = Left(rig)
    driven = []

    def refuse(register: int, words: Words | None) -> None:
        taken = rig.far.control_unit.mode == Mode.BUS
        if register == left.setpoint and words is not None and not taken:
            raise Refused(4)
        if register == left.command:
            driven.append(left.driven)

    rig.before = refuse
    begun = len(left.written())
    assert 'enabled' in rig.answer(rig.drive.enable())
    assert left.written()[begun:] == [
        (MODE, Mode.BUS),
        (left.command, 0),
        (left.setpoint, 0),
        (left.command, RUN),
    ]
    # by what was left there, until the stop
    assert driven[0] <= _LONGEST
    follow(rig)


def test_a_drive_that_takes_its_time_to_be_controlled_is_stopped_then(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual()
    rig.connect()
    command = rig.register(_COMMANDS['sinus_g2'])
    show = rig.far._peek
    not_yet = {'fieldbus.inv_st': 24, 'fieldbus.drive_status': 0}
    controlled_at = 0.0

    def take_time(register: int, words: Words | None) -> None:
        nonlocal controlled_at
        if (register, words) == (MODE, (Mode.BUS,)):
            controlled_at = rig.clock.now + 0.1
        if register == command and rig.clock.now < controlled_at:
            raise Refused(4)

    def show_in_time(key: str) -> int:
        late = rig.clock.now < controlled_at and key in not_yet
        return not_yet[key] if late else show(key)

    rig.before, rig.far._peek = take_time, show_in_time
    assert 'enabled' in rig.answer(rig.drive.enable())
    assert rig.clock.now > controlled_at > 0
    assert rig.written(command) == [Scmd.STOP, RUN]
    follow(rig)


def test_settings_of_the_driver_are_written_to_a_drive_that_is_safe(
    make_virtual: MakeVirtual,
) -> None:
    rig = make_virtual(drive_timeout=2.0)
    # which takes none before it is acknowledged
    rig.far.advance(rig.far.boot_time)
    rig.far.trip(5)
    rig.connect()
    rig.answer(rig.drive.acknowledge())
    left = Left(rig)
    timeout = rig.register('serial.sio_tot')
    safe = []

    def look(register: int, words: Words | None) -> None:
        if register == timeout and words is not None:
            safe.append(left.written()[-2:])

    rig.before = look
    assert 'enabled' in rig.answer(rig.drive.enable())
    assert safe[0] == [(left.command, 0), (left.setpoint, 0)]


def test_a_tuning_takes_control_without_a_turn(make_virtual: MakeVirtual) -> None:
    rig = make_virtual()
    rig.connect()
    left = Left(rig)
    begun = len(left.written())
    tuning = rig.drive.tune(Procedure.CALCULATE)
    rig.answer(tuning)
    assert left.written()[begun:][:3] == [(left.setpoint, 0), (MODE, Mode.BUS), (left.command, 0)]
    assert not left.turned
    assert Scmd.PAR_CALC in rig.written(left.command)
