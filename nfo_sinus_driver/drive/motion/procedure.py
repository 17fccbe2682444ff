# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What a drive does on a command at standstill: tune, erase, reset [M0 table 18]."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
import contextlib

from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.catalog import Family, Holder, Procedure, Reset, Role
from nfo_sinus_driver.drive.known import drive_state
from nfo_sinus_driver.drive.known.control_state import ControlState
from nfo_sinus_driver.drive.known.diagnosis import require_no_fault
from nfo_sinus_driver.drive.known.drive_state import DriveState
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report
from nfo_sinus_driver.drive.known.exclusive_access import ExclusiveAccess
from nfo_sinus_driver.drive.known.steps import run_steps
from nfo_sinus_driver.drive.motion.controller import Controller, required
from nfo_sinus_driver.link import LinkError

#: How often what the drive does is read by the mailbox of a PLC, s.
_CODE_PERIOD = 0.2


def require_known(procedure: Procedure | Reset, model: Family) -> None:
    """Raise a :class:`DriveError` if a model has no command for a procedure."""
    if not model.profile.methods_with(procedure):
        what = procedure.value
        raise DriveError(Cause.UNKNOWN_PROCEDURE, what=what, model=model.name)


class Procedures:
    """
    Has one drive carry out procedures; used on the bus alone.

    :param controller: what commands the drive otherwise; ``None`` if this driver only reads.
    :raises DriveError: the drive is not free, has no such procedure, or does not confirm it.
    """

    def __init__(self, state: DriveState, controller: Controller | None) -> None:
        self._bus = state.bus
        self._state = state
        self._controller = controller

    @property
    def controller(self) -> Controller:
        """What commands the drive otherwise; a :class:`DriveError` if this driver only reads."""
        return required(self._controller)

    @property
    def enabled(self) -> bool:
        """The motor is enabled, or about to be; not by the control that a write has taken."""
        states = ControlState.ENABLING, ControlState.ENABLED
        return self._state.control.state in states

    def require(self, procedure: Procedure | Reset) -> None:
        """Make sure that a procedure may begin."""
        controller, state = self.controller, self._state
        if not state.contact.connected:
            raise DriveError(Cause.NOT_CONNECTED, address=state.settings.address)
        require_known(procedure, state.model)
        profile = state.model.profile
        have = profile.methods_with(procedure)
        if state.settings.method not in have:
            raise DriveError(
                Cause.OTHER_METHOD_NEEDED,
                what=procedure.value,
                means=profile.methods[have[0]].means,
                method=have[0],
            )
        controller.require_idle(procedure.value)

    @contextlib.contextmanager
    def begun(self, procedure: Procedure | Reset) -> Iterator[ExclusiveAccess]:
        """Give a procedure exclusive access, from its first preparations on."""
        self.require(procedure)
        with self.controller.exclusive(procedure.value) as access:
            yield access

    @contextlib.asynccontextmanager
    async def in_standby(
        self, access: ExclusiveAccess, ended: Report | None = None
    ) -> AsyncIterator[None]:
        """
        Take control of a drive whose motor stands still, and release it as it was found.

        Not from keypad or terminals: releasing it to them could start the motor [C43].

        :param ended: why the motor stops at the end, if it was energised.
        """
        async with self._code_watched():
            found = await self._take(access)
            try:
                yield
            except Exception:
                # the caller gets the first error; what follows from it is logged
                with contextlib.suppress(DriveError, LinkError):
                    await self._give_back(found, ended)
                raise
            await self._give_back(found, ended)

    @contextlib.asynccontextmanager
    async def _code_watched(self) -> AsyncIterator[None]:
        """
        Read again and again what the drive does, where the telegram of a PLC does not tell.

        Until it is over, a motor that is tuned is energised, whatever the telegram shows.
        """
        state = self._state
        key = state.model.key(Role.FAULT_CODE)
        if not key or not state.params.by_mailbox(key):
            yield
            return
        await state.reader.read_reported_code(Priority.SERVICE)
        task = self._bus.spawn(self._watch_code())
        try:
            yield
        finally:
            self._bus.cancel(task)
            state.reader.forget_reported_code()

    async def _watch_code(self) -> None:
        state = self._state
        while True:
            await self._bus.sleep(_CODE_PERIOD)
            # the poll reports it if the drive is lost
            with contextlib.suppress(LinkError, DriveError):
                await state.reader.read_reported_code(Priority.POLL)

    async def abort(self) -> Report | None:
        """End the procedure that has exclusive access; stop nothing else."""
        if not (what := self._state.control.procedure):
            return None
        return await self.controller.stop(Report(Cause.PROCEDURE_CANCELLED, what=what))

    async def command(self, access: ExclusiveAccess, procedure: Procedure | Reset) -> None:
        """
        Have the drive begin, once: the state before a second try would be unknown.

        It queues with the stops, so that no later one overtakes it; if it is not wanted any more at
        its turn, nothing is written. A busy drive has done nothing, and gets it again.
        """
        write = self.controller.method.procedures[procedure]
        await self._state.params.write(write, Priority.STOP, access.require_wanted)

    async def _take(self, access: ExclusiveAccess) -> Holder:
        controller, state, what = self.controller, self._state, access.what
        status = await state.reader.read(Priority.SERVICE)
        require_no_fault(state, status)
        found = await run_steps(state, controller.method.holder(), Priority.SERVICE)
        if found is Holder.INHIBITED:
            why = state.model.profile.inhibited
            raise DriveError(state.report(Cause.CONTROL_INHIBITED, what=what, why=why))
        if status.driven:
            raise DriveError(state.report(Cause.MOTOR_RUNS, what=what))
        # what keeps control of the drive keeps it from keypad and terminals
        if found not in (Holder.NOBODY, Holder.BUS) and not controller.method.control_retained:
            raise DriveError(state.report(Cause.CONTROLLED_LOCALLY, what=what))
        access.require_wanted()
        control_mode = state.control_mode or await state.read_control_mode()
        await controller.take_control(control_mode)
        deadline = self._bus.now() + drive_state.TIMEOUT
        while not (await state.reader.read(Priority.SERVICE)).standby:
            if self._bus.now() > deadline:
                with contextlib.suppress(DriveError, LinkError):
                    await self._give_back(found)
                raise DriveError(state.report(Cause.NO_STANDBY, what=what))
            # no manual says that a drive forgets an earlier command
            await run_steps(state, controller.method.stop(control_mode), Priority.STOP)
            await self._bus.sleep(drive_state.LOOK_PERIOD)
        return found

    async def _give_back(self, found: Holder, ended: Report | None = None) -> None:
        """Remove the command, and release control where it was free; not while faulted."""
        controller = self.controller
        await controller.withdraw_run_command(ended)
        if found is Holder.NOBODY and not self._state.control.blocked:
            await controller.give_back()
