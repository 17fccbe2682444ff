# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a drive is commanded that a file describes: the lists of steps of the file, by its status.

What the file does not tell is a feature that the drive does not have. Where neither status nor a
parameter tells who has control, the line counts as having it: a motor that runs is stopped when the
driver connects.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import ClassVar

from nfo_sinus_driver.catalog.declared import (
    STATUS_KEY,
    Assign,
    Await,
    Change,
    Description,
    Direction,
    Pause,
    Put,
    SetpointPlace,
    Steps as Listed,
)
from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    ControlMethod,
    Hold,
    Holder,
    Limits,
    NotPossible,
    Profile,
    Read,
    Refusal,
    Removal,
    SetpointTarget,
    Status,
    Steps,
    Until,
    Wait,
    Write,
    taken,
)
from nfo_sinus_driver.catalog.status import Role, StatusCode
from nfo_sinus_driver.families._declared.words import is_remote, words_of

#: The control method of every such drive.
METHOD = 'custom'
#: A measured value beyond so many times the greatest set-point is none of this drive.
_BEYOND = 1.5


# --- set-points -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Target(SetpointTarget):
    """Where the set-points of one drive go; with a direction word their size stands alone."""

    place: SetpointPlace | None = None

    def read_limits(self, has: Callable[[str], bool], *, older: bool = False) -> Steps[Limits]:
        """Find out what a set-point may be: the file and a parameter of the drive limit it."""
        found = yield from super().read_limits(has, older=older)
        assert self.place is not None
        if not self.place.limit:
            return found
        most = min(found.most, float((yield Read(self.place.limit))))
        return Limits(max(found.least, -most), most, found.nominal)

    def set_to_zero(self) -> Steps[None]:
        """Write set-point 0, and read it back where the drive tells it."""
        assert self.place is not None
        yield from self.zero(retry=True)
        if not self.place.read_key:
            return
        kept = float((yield Read(self.place.read_key)))
        if kept != 0:
            raise NotPossible(f'the drive keeps a set-point of {kept:g} where 0 was written')


@dataclass(frozen=True)
class SizeAndDirection(Target):
    """A set-point whose size stands beside a direction; at 0 the direction stays as it was."""

    def writes(self, value: float, before: float = math.nan) -> Sequence[Write]:
        """Return what is to be written: no size of the one direction is followed in the other."""
        direction = self._direction
        unknown = math.isnan(before)
        reverse = _reverse(before if value == 0 and not unknown else value)
        turn = Write(direction.key, direction.reverse if reverse else direction.forward)
        written = turn, Write(self.key, abs(value))
        turns = before != 0 and reverse is not _reverse(before)
        return (Write(self.key, 0.0), *written) if unknown or turns else written

    def value(self, values: Mapping[str, Value]) -> float:
        """Return the set-point that size and direction mean; -0.0 is 0 in reverse."""
        reverse = values[self._direction.key] == self._direction.reverse
        return math.copysign(float(values[self.key]), -1 if reverse else 1)

    def zero(self, *, retry: bool) -> Steps[None]:
        """Write size 0 and leave the direction alone, for with it goes a run command."""
        yield Write(self.key, 0.0, retry=retry)

    @property
    def _direction(self) -> Direction:
        assert self.place is not None and self.place.direction is not None
        return self.place.direction


def _reverse(value: float) -> bool:
    return math.copysign(1, value) < 0


def _target(place: SetpointPlace) -> Target:
    nominal = math.inf if place.nominal is None else place.nominal
    kind = Target if place.direction is None else SizeAndDirection
    forward_only = not place.signed and place.direction is None
    return kind(place.key, place.most, forward_only=forward_only, nominal=nominal, place=place)


# --- control --------------------------------------------------------------------------------------


class Declared(ControlMethod):
    """Control by the lists of steps of a file; a stop takes the steps of the file as they are."""

    means = 'registers'
    references = ('fieldbus',)
    _drive: ClassVar[Description]
    _setpoint: ClassVar[Target]

    def in_control(self) -> Steps[bool]:
        """Tell whether the line has control; where nothing tells, it has."""
        return (yield from self.holder()) is Holder.BUS

    def holder(self) -> Steps[Holder]:
        """Tell who has control of the drive."""
        drive = self._drive
        if drive.tells_control:
            word = int((yield Read(STATUS_KEY)))
            return Holder.BUS if is_remote(drive, word) else Holder.LOCAL
        if drive.holder is not None:
            key, values = drive.holder
            return Holder.BUS if (yield Read(key)) in values else Holder.LOCAL
        return Holder.BUS

    def require_startable(self) -> Steps[None]:
        """
        See to it that the parameters are so that the drive obeys the line; it only reads.

        :raises NotPossible: one is not, and the file does not have it written.
        """
        for one in self._drive.requires:
            if not one.write and (found := (yield Read(one.key))) != one.value:
                todo = one.text or f'set {one.key} to {one.value}'
                raise NotPossible(f'{one.key} is {found}, so the line has no control: {todo}')

    def take_control(self) -> Steps[None]:
        """Put the drive under control of the line, with no run command."""
        for one in self._drive.requires:
            if one.write:
                yield Write(one.key, one.value, stored=True)
        yield from _carry_out(self._drive.prepare or self._drive.stop)

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """Write set-point 0, and read it back where the drive tells it."""
        yield from self._setpoint.set_to_zero()

    def run(self) -> Steps[None]:
        """
        Give the run command, forward, each step once.

        A direction of its own may be left from before: it is written first, at set-point 0.
        """
        direction = self._drive.setpoint.direction
        written = {step.key for step in self._drive.run if isinstance(step, Put)}
        if direction is not None and direction.key not in written:
            yield Write(direction.key, direction.forward, retry=False)
        yield from _carry_out(self._drive.run, retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """Take the run command back and write set-point 0, each step by itself [C126]."""
        yield from self._stop_by(
            _carry_out(self._drive.stop, retry=False), self._setpoint.zero(retry=False)
        )

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor at once, or stop as quickly as the file has it."""
        steps = self._drive.coast or self._drive.quick_stop
        if not steps:
            return self.stop(control_mode)
        return self._stop_by(_carry_out(steps), self._setpoint.zero(retry=True))

    def release(self) -> Steps[None]:
        """Give control back, if the file says how; the run command is taken back in any case."""
        if (yield from self.in_control()):
            yield from _carry_out(self._drive.stop)
            yield from _carry_out(self._drive.release)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove run command and set-point while a fault is active, each by itself."""
        command = yield from taken(_carry_out(self._drive.stop))
        setpoint = yield from taken(self.zero_setpoint(control_mode))
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault, the run command removed first.

        :raises NotPossible: the file has no reset, or the drive keeps its run command.
        """
        if not self._drive.reset:
            raise NotPossible('it has no reset over the line: reset it at its keypad')
        if (yield from self.remove(control_mode)) is not Removal.COMMAND:
            raise NotPossible('the drive refuses the stop: reset it at its keypad')
        yield from _carry_out(self._drive.reset, holds=True)
        return ''


def _carry_out(steps: Listed, *, retry: bool = True, holds: bool = False) -> Steps[None]:
    """Carry out the steps of a list; ``holds``: go on where a condition is never met."""
    for step in steps:
        if isinstance(step, Put):
            yield Write(step.key, step.raw, retry=retry)
        elif isinstance(step, Change):
            yield Write(step.key, (yield from _changed(step, retry=retry)), retry=retry)
        elif isinstance(step, Assign):
            yield Write(step.key, step.value, retry=retry)
        elif isinstance(step, Pause):
            yield Wait(step.seconds)
        elif holds:
            yield Hold(_fulfils(step), step.seconds)
        else:
            yield Until(_fulfils(step))


def _changed(step: Change, *, retry: bool) -> Steps[int]:
    """Return a register with some bits changed; where it cannot be read, none are kept."""
    try:
        before = int((yield Read(step.key, retry=retry)))
    except Refusal:
        before = 0
    return (before | step.set) & ~step.clear


def _fulfils(step: Await) -> Callable[[Status], bool]:
    return lambda status: step.condition.holds(status.word or 0)


def _in_charge(status: Status | None) -> Steps[str]:
    yield from ()
    return METHOD


def profile_of(drive: Description) -> Profile:
    """Return the profile of a drive that a file describes."""
    target = _target(drive.setpoint)
    members = {
        '__doc__': f'Control of {drive.title}.',
        '_drive': drive,
        '_setpoint': target,
        'coasts': bool(drive.coast),
        'control_retained': '' if drive.release else 'nothing in its file gives it back',
    }
    most = _BEYOND * target.most
    of_speed = Role.ACTUAL_FREQUENCY if drive.setpoint.mode == 'Freque' else Role.ACTUAL_SPEED
    holders: dict[Value, Holder] = {}
    if drive.holder is not None:
        key, values = drive.holder
        labels = drive.parameters[key].labels.values()
        holders = {one: Holder.BUS if one in values else Holder.LOCAL for one in labels}
    return Profile(
        title=drive.title,
        enable_input=drive.enable_input,
        status_word=words_of(drive),
        holders=holders,
        methods={METHOD: type('Control', (Declared,), members)},
        setpoints={drive.setpoint.mode: target},
        releases='' if drive.stop_mode is None else drive.stop_mode[1],
        in_charge=_in_charge,
        most={of_speed: most},
        line=drive.line.factory,
        refusals=drive.line.exceptions,
        busy=drive.line.busy,
        stops_at_timeout=True if drive.timeout is None else drive.timeout.stops,
        after_write=tuple(Write(step.key, step.raw) for step in drive.after_write),
        line_check=dict.fromkeys(('modbus_rtu', 'modbus_tcp'), drive.line.shown)
        if drive.line.shown
        else {},
    )
