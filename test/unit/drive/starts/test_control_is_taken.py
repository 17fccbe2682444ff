# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Nothing turns the motor while control is taken, whatever stands in the drive from before."""

from __future__ import annotations

import pytest
from support.rig import Rig

from nfo_sinus_driver.drive import Procedure
from nfo_sinus_driver.families.sinus_g2.words import Mode, Scmd
from nfo_sinus_driver.simulator.sinus.control_unit import Source

MODE, RUN = 'fieldbus.mode', 0x101
_COMMANDS = {'rtu': 'fieldbus.scmd', 'optimal': 'fieldbus.smode'}
_SETPOINTS = {'rtu': 'status.frq_set', 'optimal': 'fieldbus.input_freq_setpoint'}
#: For so long may a motor have current by a command that is removed with the next frame, s.
_LONGEST = 0.02
every_connection = pytest.mark.parametrize('connection', _COMMANDS)


class Left:
    """
    A drive in which an earlier session has left a set-point and a run command.

    That the drive waits for a command once the bus has control says [M0 table 17]; that it has
    forgotten the one from before says none, and this one has not.

    :ivar driven: for how long the motor has been energised, s.
    :ivar turned: it has turned.
    """

    def __init__(self, rig: Rig, connection: str) -> None:
        self._rig = rig
        self.command, self.setpoint = _COMMANDS[connection], _SETPOINTS[connection]
        unit = rig.far.control_unit
        self._hand_over = unit.hand_control_to
        unit.hand_control_to = self._keep_command
        unit.scmd = type(unit.scmd)(RUN)
        rig.far.memory.set(self.setpoint, 30.0)
        self.driven, self.turned = 0.0, False
        self._looked_at = rig.clock.now
        rig.looked = self._look
        rig.asked.clear()

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

    def written(self) -> list[tuple[str, int]]:
        """Return what was written where, in order: of the command, MODE and the set-point."""
        return [
            (key, self._rig.number(data))
            for _, key, data in self._rig.asked
            if data is not None and key in (self.command, MODE, self.setpoint)
        ]


def follow(rig: Rig) -> None:
    """Give a set-point, and let the drive follow it."""
    rig.send(20.0)
    rig.pass_time(1.0)
    assert abs(rig.far.motor.frequency - 20.0) < 0.2


@every_connection
def test_what_an_earlier_session_has_left_does_not_turn_the_motor(connection: str) -> None:
    with Rig(connection) as rig:
        rig.connect()
        left = Left(rig, connection)
        rig.enable()
        # to stop it as soon as control is there, and never at an old set-point
        assert left.written()[:3] == [(left.setpoint, 0), (MODE, Mode.BUS), (left.command, 0)]
        rig.pass_time(0.5)
        assert not left.turned
        follow(rig)


@every_connection
def test_a_drive_that_refuses_set_points_until_it_is_controlled_is_stopped_first(
    connection: str,
) -> None:
    with Rig(connection) as rig:
        rig.connect()
        left = Left(rig, connection)
        driven = []

        def refuse(key: str, data: bytes | None) -> str | None:
            if key == left.command:
                driven.append(left.driven)
            taken = rig.far.control_unit.mode == Mode.BUS
            return 'refused' if key == left.setpoint and data is not None and not taken else None

        rig.meet = refuse
        rig.enable()
        # the first was refused
        assert left.written()[1:] == [
            (MODE, Mode.BUS), (left.command, 0), (left.setpoint, 0), (left.command, RUN)
        ]
        # by what was left there, until the stop
        assert driven[0] <= _LONGEST
        follow(rig)


def test_a_drive_that_takes_its_time_to_be_controlled_is_stopped_then() -> None:
    with Rig() as rig:
        rig.connect()
        command = _COMMANDS['rtu']
        show = rig.far._peek
        not_yet = {'fieldbus.inv_st': 24, 'fieldbus.drive_status': 0}
        controlled_at = 0.0

        def take_time(key: str, data: bytes | None) -> str | None:
            nonlocal controlled_at
            if key == MODE and data is not None and rig.number(data) == Mode.BUS:
                controlled_at = rig.clock.now + 0.1
            return 'refused' if key == command and rig.clock.now < controlled_at else None

        def show_in_time(key: str) -> int:
            late = rig.clock.now < controlled_at and key in not_yet
            return not_yet[key] if late else show(key)

        rig.meet, rig.far._peek = take_time, show_in_time
        rig.enable()
        assert rig.clock.now > controlled_at > 0
        assert rig.written(command)[-2:] == [Scmd.STOP, RUN]
        follow(rig)


def test_settings_of_the_driver_are_written_to_a_drive_that_is_safe() -> None:
    with Rig(drive_timeout=2.0) as rig:
        # which takes none before it is acknowledged
        rig.far.advance(rig.far.boot_time)
        rig.far.trip(5)
        rig.connect()
        rig.acknowledged = 1
        rig.answer(rig.drive.acknowledge())
        left = Left(rig, 'rtu')
        rig.enable()
        keys = [key for _, key, data in rig.asked if data is not None]
        left_off = keys[: keys.index('serial.sio_tot')]
        assert [key for key in left_off if key in (left.command, MODE, left.setpoint)][-2:] == [
            left.command, left.setpoint
        ]
        assert left.written()[: len(left_off)][-2:] == [(left.command, 0), (left.setpoint, 0)]


def test_a_tuning_takes_control_without_a_turn() -> None:
    with Rig() as rig:
        rig.connect()
        left = Left(rig, 'rtu')
        rig.answer(rig.drive.tune(Procedure.CALCULATE))
        assert left.written()[:3] == [(left.setpoint, 0), (MODE, Mode.BUS), (left.command, 0)]
        assert not left.turned
        assert Scmd.PAR_CALC in rig.written(left.command)
