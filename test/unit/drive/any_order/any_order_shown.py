# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a simulated drive shows by itself, for the laws in ``any_order_laws.py``: each family's way.

Written from the manuals; nothing of the driver is asked.
"""

from __future__ import annotations

import abc
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from support.rig import Rig

from nfo_sinus_driver.simulator.movitrac31.commands import (
    CONTROL_MODE,
    FUNCTION_BITS,
    MANUAL,
    SETPOINT,
)
from nfo_sinus_driver.simulator.movitrac31.parameters import Bit, Mode, Number
from nfo_sinus_driver.simulator.sinus.control_unit import Source
from nfo_sinus_driver.simulator.telegram1 import Stw1

#: What commands a drive of NFO [M0 §7], [M1]; of the mask and its word, the latter comes last.
MODE, CONTROL, MASK = 'fieldbus.mode', 'fieldbus.drive_control', 'fieldbus.drv_ctrl_write_mask'
SCMD = ('fieldbus.scmd', 'fieldbus.smode')
#: By the drive profile of CANopen (CiA 402): the control word, the set-points, and the mode of
#: operation by the parameter Mode.
CONTROL_WORD = 'fieldbus.control_word'
TARGETS = ('fieldbus.vl_target_velocity', 'fieldbus.target_torque')
_OPERATION_MODES = {'Freque': 'Speed', 'Speed': 'Speed', 'Torque': 'Torque', 'PI-Reg': '0'}
MODE_STOP, MODE_BUS = 1, 3
RUN_FIELDBUS = 0x101
FORWARD, REVERSE = 1 << 3, 1 << 13
#: Bit 0 of the control word [M0 table 14].
SWITCH_ON = 1 << 0
#: By these the bus has control.
_BUS_SOURCES = (Source.SCMD, Source.CONTROL_WORD)
#: Where a set-point is written, of whichever control mode ([M0 §8.2], [C11], [C12], [C53]).
_SETPOINTS = (
    *(f'status.{name}_set' for name in ('frq', 'spd', 'trq', 'reg')),
    *(f'fieldbus.{name}' for name in ('setpoint', 'input_freq_setpoint', 'input_speed_setpoint')),
)
_DIRECTIONS = Bit.CW | Bit.CCW
_RUNNING = (Number.ENABLE, Number.CHANGE_DIRECTION)

Complaints = Iterator[str]
#: A request: its parameter, and what is written to it; ``None``: it is read.
Request = tuple[str, bytes | None]


@dataclass(frozen=True)
class Times:
    """
    How soon a driver does what it has to, on one kind of line; s.

    :ivar noticed: two polls and a transaction, and what they themselves take, while active.
    :ivar noticed_idle: likewise, while not.
    :ivar control_told: how much later it may be noticed who has control.
    :ivar carried_out: a command is, within this.
    :ivar lost: three polls without a response and the drive is lost, while active.
    :ivar lost_idle: likewise, while not.
    :ivar taken_back: a run command that could not be removed is, so long after the line came back.
    :ivar found: a drive that was lost is found again within this.
    :ivar response_timeout: how long an answer is waited for at most.
    """

    noticed: float = 0.5
    noticed_idle: float = 1.2
    control_reported: float = 0.0
    carried_out: float = 0.06
    lost: float = 3.0
    lost_idle: float = 4.0
    taken_back: float = 1.7
    found: float = 5.0
    response_timeout: float = 0.1

    def slowed(self, response_time: float) -> Times:
        """Return the same for a drive that answers so much later, s; a poll is 4 transactions."""
        poll = 4 * response_time
        return Times(
            noticed=self.noticed + 2 * poll,
            noticed_idle=self.noticed_idle + 2 * poll,
            control_reported=self.control_reported + poll,
            carried_out=self.carried_out + poll,
            lost=self.lost + 3 * poll,
            lost_idle=self.lost_idle + 3 * poll,
            taken_back=self.taken_back + 3 * poll,
            found=self.found + 3 * poll,
            response_timeout=self.response_timeout,
        )


#: A status that shows a run along a ramp, too, shows so much later that one goes on at standstill,
#: s (docs/faults_and_stops.md).
_STANDSTILL = 1.5


class Shown(abc.ABC):
    """
    What one simulated drive shows, and what may be written to it.

    :cvar times: how soon things have to be done at its line.
    :cvar lead: how many transactions a stop lets go ahead: what it has to read itself.
    :ivar powered_by_acknowledgement: it refuses every command while a fault is active, so that a
        motor may have current until the stop that follows the acknowledgement.
    :cvar polls_wait: what a command has to read takes so long that the polls wait for it.
    :ivar refuses_stop: it may refuse a stop in a fault, and go on by it afterwards.
    :cvar runs_along_ramp: its status shows a run on the way to a stop, too.
    """

    times = Times()
    lead = 1
    powered_by_acknowledgement = False
    refuses_stop = False
    polls_wait = False
    runs_along_ramp = False

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._far = rig.far
        self._unit: Any = rig.far.control_unit
        self._method = rig.drive.settings.method

    @property
    def hides_stop(self) -> bool:
        """It stops by itself, and shows that it runs."""
        return False

    @property
    def hides_stop_whole(self) -> bool:
        """It does so, and its speed shows nothing of it either before the motor stands."""
        return False

    @property
    @abc.abstractmethod
    def by_bus(self) -> bool:
        """The bus controls the drive."""

    @property
    @abc.abstractmethod
    def running(self) -> bool:
        """The drive carries out a run command that came over the bus."""

    @property
    @abc.abstractmethod
    def standing(self) -> bool:
        """A run command that came over the bus stands in it, carried out or not."""

    @property
    def tuning(self) -> bool:
        """The drive measures its motor, which has current."""
        return False

    @property
    def may_run(self) -> bool:
        """Nothing at the terminals keeps the motor from running."""
        return self._unit.run_input

    @property
    def restarts_itself(self) -> bool:
        """A fault is active that the drive ends by itself."""
        return False

    def has_tries(self, code: int) -> bool:
        """Return whether a fault may end by itself."""
        return False

    @abc.abstractmethod
    def facts(self) -> dict[str, Any]:
        """Return what is true of the drive now; ``None``: what it says is not known."""

    def patience(self, name: str) -> float:
        """Return how much later than others a fact may be reported, s."""
        return _STANDSTILL if name == 'standstill' and self.runs_along_ramp else 0.0

    @abc.abstractmethod
    def reads_status(self, request: Request) -> bool:
        """Return whether a request is the one that every status is read with."""

    @abc.abstractmethod
    def wrong(self, key: str, number: int) -> Complaints:
        """Yield what is wrong with a write, before it is carried out."""

    @abc.abstractmethod
    def stops(self, key: str, number: int) -> bool:
        """Return whether a write stops the motor."""


class ShownSinus(Shown):
    """What both families of NFO show."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        # by Classic all is refused [M0 §6.1.5]
        refused = (
            self._unit.variant.refuses_in_fault if rig.connection.protocol != 'classic' else 'all'
        )
        protocol = rig.connection.protocol
        # what a command reads by Classic comes word by word; a gateway takes twice as long, and so
        # do the characters of ASCII
        slow = ('classic', 'modbus_ascii', 'modbus_tcp')
        self.polls_wait = protocol in slow
        if protocol == 'modbus_ascii' or rig.connection.options.get('dialect') == '5.0':
            # MODE is read with its status; a frame has twice the characters
            self.times = Times().slowed(0.02)
        self.powered_by_acknowledgement = refused == 'all'
        self.refuses_stop = refused != 'nothing' and self._method == 'mode_scmd'

    @property
    def by_bus(self) -> bool:
        return self._unit.source in _BUS_SOURCES

    def facts(self) -> dict[str, Any]:
        far = self._far
        return {
            'code': self._unit.status_code,
            'fault': bool(far.faults),
            'by bus': self.by_bus,
            # no manual says what a tuning shows of it
            'running': None if self.tuning else self.running,
            'limit': far.motor.limited,
            'frequency': round(far.motor.frequency, 1),
        }

    def reads_status(self, request: Request) -> bool:
        return request == ('fieldbus.inv_st', None)

    def wrong(self, key: str, number: int) -> Complaints:
        controls = key in (CONTROL, MASK)
        if key == MODE and number not in (MODE_STOP, MODE_BUS):
            yield f'MODE = {number}'
        if controls and self._method != 'drive_control':
            yield f'a control word in {self._method}'
        if key in SCMD and self._method != 'mode_scmd':
            yield f'SCMD in {self._method}'
        if key in (CONTROL_WORD, *TARGETS) and self._method != 'ds402':
            yield f'{key} in {self._method}'
        if key in _SETPOINTS and self._method == 'ds402':
            yield f'{key} in ds402'
        if key == MODE and self._method == 'drive_control' and number != MODE_STOP:
            yield 'MODE = 3 in drive_control'

    def stops(self, key: str, number: int) -> bool:
        return (
            (key in SCMD and number == 0)
            or (key == MODE and number == MODE_STOP)
            or (key in (CONTROL, MASK, CONTROL_WORD) and not number & SWITCH_ON)
            # a stop that a fault keeps the drive from taking goes on with the set-point
            or (key in (*_SETPOINTS, *TARGETS) and not number and bool(self._far.faults))
        )


class ShownG2(ShownSinus):
    """What a G2 shows."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self._control_modes = rig.far.memory.model['control.mode'].labels

    @property
    def running(self) -> bool:
        return self.by_bus and self._unit.state == 'OPERATION_ENABLED'

    @property
    def standing(self) -> bool:
        if self._unit.source is Source.SCMD:
            return bool(self._unit.scmd & 1)
        return self.by_bus and bool(self._unit.word & SWITCH_ON)

    @property
    def tuning(self) -> bool:
        return self._unit.tuning is not None

    @property
    def restarts_itself(self) -> bool:
        return bool(self._unit.self_restart.waiting)

    def has_tries(self, code: int) -> bool:
        return bool(self._unit.self_restart._has_tries(code))

    def facts(self) -> dict[str, Any]:
        code = self._far.memory.raw('control.mode')
        return {**super().facts(), 'control mode': self._control_modes[code]}

    def patience(self, name: str) -> float:
        # it is not read with every poll
        return 1.0 if name == 'control mode' else super().patience(name)

    def wrong(self, key: str, number: int) -> Complaints:
        yield from super().wrong(key, number)
        if key in (CONTROL, MASK) and number & FORWARD and number & REVERSE:
            yield 'both directions at once'


class ShownDs402(ShownG2):
    """What a G2 shows by the drive profile of its CANopen module."""

    runs_along_ramp = True

    @property
    def hides_stop(self) -> bool:
        # along its ramp
        return self._unit.state in ('DISABLE', 'SHUTDOWN') and self._far.motor.driven

    @property
    def hides_stop_whole(self) -> bool:
        # docs/serial_line.md says so: a start delay alone shows a RUN input that is back by then
        delayed = self._far.memory.number('control.run_dly') > 0
        torque = self._control_modes[self._far.memory.raw('control.mode')] == 'Torque'
        return torque and not delayed and self.hides_stop

    def facts(self) -> dict[str, Any]:
        facts = super().facts()
        if self._unit.state in ('DISABLE', 'SHUTDOWN'):
            facts['running'] = None
        return {**facts, 'control mode': _OPERATION_MODES[facts['control mode']]}


class ShownOptimal(ShownSinus):
    """What an Optimal shows."""

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self.lead = 2 if self._method == 'drive_control' else 1

    @property
    def running(self) -> bool:
        return self.by_bus and bool(self._unit._running)

    @property
    def standing(self) -> bool:
        return self.by_bus and bool(self._unit.scmd or self._unit._steps.run)

    def facts(self) -> dict[str, Any]:
        return {
            **super().facts(),
            'run input missing': not self._unit.run_input,
            'sleeping': bool(self._unit._sleeping),
        }


#: Its line has 9600 bit/s, and an answer is waited for up to 0.4 s.
_MOVITRAC = Times(
    noticed=0.8,
    noticed_idle=1.8,
    control_reported=1.2,
    carried_out=0.2,
    lost=3.5,
    lost_idle=5.0,
    taken_back=3.0,
    found=7.0,
    response_timeout=0.4,
)


class ShownMovitrac(Shown):
    """What a MOVITRAC shows; who enables it reads what all its terminals are for."""

    polls_wait = True
    runs_along_ramp = True

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self.times = _MOVITRAC.slowed(self._unit.response_time)

    @property
    def by_bus(self) -> bool:
        # where it is only watched, the line may give the set-point alone
        watched = self._method == 'monitor' and self._mode == Mode.REMOTE_SETPOINT
        remote = self._mode == Mode.REMOTE_CONTROL or watched
        return remote and not self._far.memory.raw(MANUAL)

    @property
    def _mode(self) -> int:
        return round(self._far.memory.number(CONTROL_MODE))

    @property
    def _bits(self) -> int:
        return self._far.memory.raw(FUNCTION_BITS)

    @property
    def running(self) -> bool:
        driven = self._unit.number in _RUNNING
        return self.standing and driven and self._far.motor.driven

    @property
    def standing(self) -> bool:
        return self.by_bus and bool(self._bits & _DIRECTIONS)

    @property
    def may_run(self) -> bool:
        return self._unit.run_input or self._unit.variant.enable_bit == 'either'

    @property
    def restarts_itself(self) -> bool:
        return bool(self._unit._resets_itself)

    def has_tries(self, code: int) -> bool:
        return bool(self._far.memory.raw('special.auto_reset'))

    def facts(self) -> dict[str, Any]:
        unit = self._unit
        # magnetizing is the beginning of a run
        shows_enable = unit.number in (*_RUNNING, Number.START_MAGNETIZATION)
        remote = self.by_bus
        return {
            'code': unit.status_code,
            'fault': bool(self._far.faults),
            'by bus': remote,
            'running': remote and shows_enable and not self._far.faults,
            'frequency': round(self._far.motor.frequency, 1),
        }

    def patience(self, name: str) -> float:
        told_late = name in ('by bus', 'running')
        return self.times.control_reported if told_late else super().patience(name)

    def reads_status(self, request: Request) -> bool:
        return request == ('fieldbus.inverter_status', None)

    def wrong(self, key: str, number: int) -> Complaints:
        if key not in (FUNCTION_BITS, SETPOINT, CONTROL_MODE, 'serial.pc_timeout'):
            yield f'{key} was written'
        # Remote setpoint and Remote control, in packed decimal digits: 1.00 and 2.00
        if key == CONTROL_MODE and number not in (0x00000100, 0x00000200):
            yield f'P841 = {number:08X}'
        if key == FUNCTION_BITS:
            yield from self._wrong_bits(Bit(number))

    def _wrong_bits(self, bits: Bit) -> Complaints:
        before, size = self._bits, self._far.memory.raw(SETPOINT)
        direction = bits & _DIRECTIONS
        if direction == _DIRECTIONS:
            yield 'both directions at once'
        if bits & Bit.RESET and bits & (Bit.ENABLE | _DIRECTIONS):
            yield 'acknowledges with a run command'
        changes = direction and direction != before & _DIRECTIONS
        if changes and size and self._mode == Mode.REMOTE_CONTROL:
            yield 'a direction is given while the set-point is not 0'

    def stops(self, key: str, number: int) -> bool:
        return (key == FUNCTION_BITS and not number & _DIRECTIONS) or (
            key == SETPOINT and not number
        )


#: Behind a PLC an answer is two of its cycles and two telegrams later.
_PLC = Times(noticed=0.7, noticed_idle=1.4, carried_out=0.2, found=7.0)


class BehindPlc(Shown):
    """What of a drive a telegram shows; for a class that knows the drive."""

    times = _PLC
    lead = 2
    refuses_stop = True

    def facts(self) -> dict[str, Any]:
        """Return what a telegram tells: no codes, and of some drives no direction."""
        return {'fault': bool(self._far.faults), 'by bus': None, 'running': None}

    def reads_status(self, request: Request) -> bool:
        return request == ('telegram.status', None)

    def wrong(self, key: str, number: int) -> Complaints:
        if not key.startswith('telegram.'):
            yield f'{key} was written'

    def stops(self, key: str, number: int) -> bool:
        return key in ('telegram.begin', 'telegram.clear')


class ShownG2BehindPlc(BehindPlc, ShownG2):
    """A G2 with the option card of PROFINET."""

    runs_along_ramp = True

    @property
    def standing(self) -> bool:
        # only a new edge of bit 0 leads out of that state
        return super().standing and self._unit.state != 'SWITCH_ON_DISABLED'


class ShownOptimalBehindPlc(BehindPlc, ShownOptimal):
    """An Optimal with the option card of PROFINET."""


class ShownH(BehindPlc):
    """A Sinus H."""

    runs_along_ramp = True

    @property
    def by_bus(self) -> bool:
        return bool(self._unit.word & Stw1.CONTROL_BY_PLC)

    @property
    def running(self) -> bool:
        return self.standing and self._far.motor.driven and not self._far.faults

    @property
    def standing(self) -> bool:
        return bool(self._unit._commanded)


class ShownDescribed(Shown):
    """What a drive shows that a file describes; its speed is read with each status."""

    times = Times(carried_out=0.08)
    lead = 3
    refuses_stop = True

    @property
    def by_bus(self) -> bool:
        return bool(self._unit.obeys)

    @property
    def running(self) -> bool:
        return self.standing and self._far.motor.driven and not self._far.faults

    @property
    def standing(self) -> bool:
        return self.by_bus and bool(self._unit._run)

    def facts(self) -> dict[str, Any]:
        return {'fault': bool(self._far.faults), 'by bus': None, 'running': None}

    def reads_status(self, request: Request) -> bool:
        return request == (self._far.memory.model.key_of_status, None)

    def wrong(self, key: str, number: int) -> Complaints:
        yield from ()

    def stops(self, key: str, number: int) -> bool:
        return key != self._unit._drive.setpoint.key or not number


_FAMILIES: Mapping[str, type[Shown]] = {
    'sinus_g2': ShownG2,
    'sinus_optimal': ShownOptimal,
    'movitrac31': ShownMovitrac,
}
_BEHIND_PLC: Mapping[str, type[Shown]] = {
    'sinus_g2': ShownG2BehindPlc,
    'sinus_optimal': ShownOptimalBehindPlc,
    'sinus_h': ShownH,
}


def shown_by(rig: Rig) -> Shown:
    """Return what the drive of a rig shows."""
    model, method = rig.drive.settings.model, rig.drive.settings.method
    if method == 'ds402':
        return ShownDs402(rig)
    if method == 'custom':
        return ShownDescribed(rig)
    return (_BEHIND_PLC if method == 'telegram1' else _FAMILIES)[model](rig)
