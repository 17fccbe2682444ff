# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
How a drive is commanded that a file describes: the lists of steps of the file, by its status.

What the file does not declare is a feature that the drive does not have. Where neither status nor a
parameter reports who has control, the line counts as having it: a motor that runs is stopped when
the driver connects.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from nfo_sinus_driver.catalog.declared import (
    STATUS_KEY,
    Await,
    Description,
    SetBits,
    Steps as Listed,
)
from nfo_sinus_driver.catalog.parameter import Value
from nfo_sinus_driver.catalog.profile import (
    ControlMethod,
    Hold,
    Holder,
    NotPossible,
    NotTried,
    Profile,
    Read,
    Refusal,
    Removal,
    Status,
    Steps,
    Until,
    Wait,
    Write,
    try_steps,
)
from nfo_sinus_driver.catalog.status import QUANTITIES, StatusCode
from nfo_sinus_driver.families._declared.setpoints import Target, target_of
from nfo_sinus_driver.families._declared.words import is_remote, words_of

#: The control method of every such drive.
METHOD = 'custom'
#: A measured value beyond so many times the greatest set-point is none of this drive.
_BEYOND = 1.5


# --- control --------------------------------------------------------------------------------------


class Declared(ControlMethod):
    """Control by the lists of steps of a file; a stop takes the steps of the file as they are."""

    means = 'registers'
    references = ('fieldbus',)
    _drive: ClassVar[Description]
    _setpoint: ClassVar[Target]

    def in_control(self) -> Steps[bool]:
        """Return whether the line has control; where nothing reports, it has."""
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
        Ensure that the drive obeys the line, and does nothing yet; it only reads.

        :raises NotPossible: keypad or terminals run the motor; or a parameter is not as it has to
            be, and the file does not have it written.
        """
        drive = self._drive
        if drive.tells_control:
            word = int((yield Read(STATUS_KEY)))
            if not is_remote(drive, word) and drive.facts['running'].holds(word):
                raise NotPossible('keypad or terminals run the motor: stop it there')
        missing = []
        for required in drive.requires:
            if not required.write and (found := (yield Read(required.key))) != required.value:
                remedy = required.text or f'set it to {required.value}'
                missing.append(f'{required.key} is {found} ({remedy})')
        if missing:
            raise NotPossible(f'the line has no control: {", ".join(missing)}')

    def take_control(self) -> Steps[None]:
        """
        Put the drive under control of the line, with no run command.

        One that an earlier session has left would turn the motor as soon as the line has control;
        a drive may refuse or ignore the stop before that, so it comes again right behind.
        """
        drive = self._drive
        yield from try_steps(_carry_out(drive.stop))
        changed = False
        for required in drive.requires:
            if required.write and (yield Read(required.key)) != required.value:
                yield Write(required.key, required.value, stored=True)
                changed = True
        if changed:
            yield from try_steps(_each(drive.after_write, retry=True))
        yield from _carry_out(drive.prepare)
        if not drive.prepare_stops:
            yield from _carry_out(drive.stop, head=True)

    def remove_leftover(self) -> Steps[None]:
        """Write the stop, which removes a run bit that would count once the line has control."""
        if not self._drive.stop_disturbs_local:
            yield from try_steps(_each(self._drive.stop, retry=True))

    def zero_setpoint(self, control_mode: str) -> Steps[None]:
        """Write set-point 0, and read it back where the drive reports it."""
        yield from self._setpoint.set_to_zero()

    def run(self) -> Steps[None]:
        """
        Give the run command, forward, each step once.

        A direction of its own may be left from before: it is written first, at set-point 0.
        """
        direction = self._drive.setpoint.direction
        written = {step.key for step in self._drive.run if isinstance(step, Write)}
        if direction is not None and (direction.alone or direction.key not in written):
            yield Write(direction.key, direction.forward, retry=False)
        yield from _carry_out(self._drive.run, retry=False)

    def stop(self, control_mode: str) -> Steps[None]:
        """Remove the run command and write set-point 0; each is tried even if the other fails."""
        yield from self._stop_by(_each(self._drive.stop), self._setpoint.zero(retry=False))

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Release the motor at once, or stop as quickly as the file has it."""
        steps = self._drive.coast or self._drive.quick_stop
        if not steps:
            return self.stop(control_mode)
        return self._stop_by(_each(steps, retry=True), self._setpoint.zero(retry=True))

    def release(self) -> Steps[None]:
        """Give control back, if the file says how; the run command is removed in any case."""
        if (yield from self.in_control()):
            yield from _carry_out(self._drive.stop)
            yield from _carry_out(self._drive.release)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove run command and set-point while a fault is active, each by itself."""
        command = yield from try_steps(_each(self._drive.stop, retry=True))
        setpoint = yield from try_steps(self.zero_setpoint(control_mode))
        if command:
            return Removal.COMMAND
        return Removal.SETPOINT if setpoint else Removal.NOTHING

    def _require_reset(self) -> None:
        if not self._drive.reset:
            raise NotPossible('it has no reset over the line: reset it at its keypad')

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault, the run command removed first.

        :raises NotPossible: the file has no reset, or the drive keeps its run command.
        """
        self._require_reset()
        if (yield from self.remove(control_mode)) is not Removal.COMMAND:
            raise NotPossible('the drive refuses the stop: reset it at its keypad')
        yield from _carry_out(self._drive.reset, holds=True)
        return ''


class BySetpoint(Declared):
    """
    Control of a drive without a run command: the motor follows each set-point.

    A stop is set-point 0, at which the motor stands; where terminals start it, it stands driven.
    """

    means = 'the set-point'
    reads_run_command = True

    def require_startable(self) -> Steps[None]:
        """
        Ensure that the drive follows a set-point, and follows none yet; it only reads.

        :raises NotPossible: as of every drive that is described; or its terminals do not start it.
        """
        yield from super().require_startable()
        if self._drive.run_by != 'terminals':
            return
        if not self._drive.facts['running'].holds(int((yield Read(STATUS_KEY)))):
            name = self._drive.enable_input or 'start terminal'
            raise NotPossible(f'its terminals do not start it: close the {name}, then enable')

    def take_control(self) -> Steps[None]:
        """Write set-point 0: nothing else keeps the motor from turning."""
        yield from self._setpoint.set_to_zero()

    def remove_leftover(self) -> Steps[None]:
        """Write set-point 0, for one that is left would count once the line has control."""
        if not self._drive.stop_disturbs_local:
            yield from try_steps(self._setpoint.zero(retry=True))

    def run(self) -> Steps[None]:
        """Do nothing: the next set-point runs the motor."""
        yield from ()

    def stop(self, control_mode: str) -> Steps[None]:
        """Write set-point 0."""
        yield from self._stop_by(self._setpoint.zero(retry=False))

    def quick_stop(self, control_mode: str) -> Steps[None]:
        """Stop as usual: nothing else stops it."""
        return self.stop(control_mode)

    def has_run_command(self) -> Steps[bool | None]:
        """Return false: there is none."""
        yield from ()
        return False

    def release(self) -> Steps[None]:
        """Write set-point 0."""
        if (yield from self.in_control()):
            yield from self._setpoint.zero(retry=True)

    def remove(self, control_mode: str) -> Steps[Removal]:
        """Remove the set-point while a fault is active; without one nothing turns."""
        removed = yield from try_steps(self.zero_setpoint(control_mode))
        return Removal.COMMAND if removed else Removal.NOTHING

    def acknowledge(self, shown: StatusCode, control_mode: str) -> Steps[str]:
        """
        Acknowledge a fault, with set-point 0.

        :raises NotPossible: the file has no reset, or the drive keeps its set-point.
        """
        self._require_reset()
        if (yield from self.remove(control_mode)) is not Removal.COMMAND:
            raise NotPossible(
                'the drive refuses set-point 0, and would turn the motor: reset it at its keypad'
            )
        yield from _carry_out(self._drive.reset, holds=True)
        return ''


def _carry_out(
    steps: Listed, *, retry: bool = True, head: bool = False, holds: bool = False
) -> Steps[None]:
    """Carry out the steps of a list; ``holds``: go on where a condition is never met."""
    for step in steps:
        if isinstance(step, Await):
            condition = _fulfils(step)
            yield Hold(condition, step.seconds) if holds else Until(condition)
        elif isinstance(step, Wait):
            yield step
        else:
            value = step.value if isinstance(step, Write) else (yield from _changed(step, retry))
            yield Write(step.key, value, retry=retry, head=head)


def _each(steps: Listed, *, retry: bool = False) -> Steps[None]:
    """
    Carry out the steps of a stop, each by itself.

    :raises Refusal: the drive has refused one; the others were tried.
    """
    refusal: Refusal | None = None
    for step in steps:
        try:
            yield from _carry_out((step,), retry=retry)
        except Refusal as error:
            refusal = refusal or error
    if refusal is not None:
        raise refusal


def _changed(step: SetBits, retry: bool) -> Steps[int]:
    """Return a register with bits changed; what is only cleared is 0 where it cannot be read."""
    try:
        before = int((yield Read(step.key, retry=retry)))
    except NotTried:
        raise
    except Refusal:
        if step.set:
            raise
        before = 0
    return (before | step.set) & ~step.clear


def _fulfils(step: Await) -> Callable[[Status], bool]:
    return lambda status: step.condition.holds(status.word or 0)


def _active_method(status: Status | None) -> Steps[str]:
    yield from ()
    return METHOD


def profile_of(drive: Description) -> Profile:
    """Return the profile of a drive that a file describes."""
    target = target_of(drive.setpoint, is_command=bool(drive.run_by))
    members = {
        '__doc__': f'Control of {drive.title}.',
        '_drive': drive,
        '_setpoint': target,
        'coasts': bool(drive.coast),
        'control_retained': '' if drive.release else 'nothing in its file gives it back',
    }
    most = _BEYOND * target.most
    holders: dict[Value, Holder] = {}
    if drive.holder is not None:
        key, values = drive.holder
        labels = drive.parameters[key].labels.values()
        holders = {label: Holder.BUS if label in values else Holder.LOCAL for label in labels}
    return Profile(
        title=drive.title,
        enable_input=drive.enable_input or Profile.enable_input,
        has_enable_input=bool(drive.enable_input) or 'enable_missing' in drive.facts,
        status_word=words_of(drive),
        holders=holders,
        methods={METHOD: type('Control', (BySetpoint if drive.run_by else Declared,), members)},
        setpoints={drive.setpoint.mode: target},
        releases='' if drive.stop_mode is None else drive.stop_mode[1],
        active_method=_active_method,
        identify=drive.identify,
        most={QUANTITIES[drive.setpoint.mode].role: most},
        start_settings=frozenset(required.key for required in drive.requires),
        line=drive.line.factory,
        refusals=drive.line.exceptions,
        busy=drive.line.busy,
        timeout_conditions={} if drive.timeout is None else drive.timeout.conditions,
        pole_pairs=drive.pole_pairs,
        keeps_run=drive.keeps_run,
        rung=drive.rung,
        fault_code=int if drive.codes is None else drive.codes.code,
        after_write=drive.after_write,
        gap=drive.line.gap,
        rest_after_write=drive.line.after_write,
        line_check=dict.fromkeys(('modbus_rtu', 'modbus_ascii', 'modbus_tcp'), drive.line.shown)
        if drive.line.shown
        else {},
    )
