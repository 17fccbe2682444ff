# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Who may make the motor turn, and how it is made to stop.

The motor follows set-points only while :attr:`Motion.armed`; a person arms it by
:meth:`Motion.enable`. Whatever happens to the drive, the line or us disarms it, and from then on
the run command is taken back until the drive says that it stops. All of this runs on the bus.
"""

from __future__ import annotations

from collections.abc import Awaitable
from collections.abc import Callable
import contextlib
import math
import time

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.bus import Task
from nfo_sinus_driver.catalog import Fact
from nfo_sinus_driver.catalog import Kind
from nfo_sinus_driver.catalog import Meaning
from nfo_sinus_driver.catalog import State
from nfo_sinus_driver.drive import withdrawal
from nfo_sinus_driver.drive.advice import NO_RUN_INPUT
from nfo_sinus_driver.drive.advice import explain_fault
from nfo_sinus_driver.drive.advice import explain_loss
from nfo_sinus_driver.drive.advice import explain_stop
from nfo_sinus_driver.drive.advice import require_no_fault
from nfo_sinus_driver.drive.commands import Commands
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.loan import Loan
from nfo_sinus_driver.drive.setpoint import Setpoint
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.drive.snapshot import Severity
from nfo_sinus_driver.drive.withdrawal import Withdrawal
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused


class Motion:
    """Arms, stops and watches one drive."""

    def __init__(
        self, bus: Bus, inverter: Inverter, method: Commands, setpoint: Setpoint
    ) -> None:
        self._bus = bus
        self._inverter = inverter
        self._method = method
        self._setpoint = setpoint
        self._arming: Task | None = None
        #: Who has the drive instead, and commands it by :attr:`method`.
        self.loan: Loan | None = None
        self._withdrawal = Withdrawal(bus, inverter, method, self._note_change)
        #: When the run command was last given or taken back: an older status says nothing.
        self._changed_at = 0.0
        #: A set-point that the drive did not take: when, and what it answered.
        self._refusal: tuple[float, str] | None = None
        #: It was lost while it may have followed us.
        self._lost_in_use = False
        #: How many quick stops are on their way, which the drive has not confirmed yet.
        self._releasing = 0

    def _note_change(self) -> None:
        self._changed_at = time.monotonic()

    @property
    def armed(self) -> bool:
        """The motor follows set-points."""
        return self._setpoint.armed

    @property
    def stopping(self) -> bool:
        """A stop is not confirmed yet."""
        return self._withdrawal.going_on

    @property
    def taking_back(self) -> Withdrawal:
        """How it goes with a stop that was asked for."""
        return self._withdrawal

    @property
    def method(self) -> Commands:
        """How the drive is commanded, for who has it on loan."""
        return self._method

    @property
    def ours(self) -> bool:
        """Something that we have begun may drive the motor."""
        return self.armed or self._arming is not None or self.loan is not None

    # --- what a person asks for ---------------------------------------------------------------

    async def enable(self, prepare: Callable[[], Awaitable[None]]) -> str:
        """
        Take control and run at set-point 0, then follow set-points that arrive from now on.

        :param prepare: does what has to be done before a run command, once the bus has control.
        :returns: what was done.
        :raises DriveError: it was not done, and why; the run command is taken back then.
        """
        if self.armed:
            return 'is enabled already'
        if self._arming is not None:
            raise DriveError('it is being enabled already')
        if self.loan is not None:
            raise DriveError(f'{self.loan.what} is going on: wait for its end, or stop it')
        if not self._withdrawal.held_by_fault:
            self._require_no_stop()
        self._arming = self._bus.current
        try:
            await self._arm(prepare)
        except Cancelled:
            raise DriveError('it was stopped while it was being enabled') from None
        except Exception as error:
            # whatever went wrong, a run command may stand by now
            self._withdrawal.begin()
            await self._settle()
            raise DriveError(str(error) or repr(error)) from error
        finally:
            self._arming = None
        if self._inverter.settings.follows_setpoints:
            return 'enabled; it follows set-points that arrive from now on'
        return f'enabled; it follows its own reference ({self._inverter.settings.reference})'

    async def stop(self, patience: float | None = None) -> str:
        """
        Stop as the drive's StMode says; control is kept.

        :param patience: how long the drive may take to confirm it, s.
        :returns: whether it ramps or coasts [C97].
        :raises DriveError: the drive does not confirm the stop; it is tried on and on.
        """
        self.disarm()
        self._withdrawal.begin()
        await self._withdrawal.finish(patience or None)
        seen = self._inverter.seen
        if self._withdrawal.held_by_fault:
            return self._withdrawal.by_fault
        if seen is not None and seen.faulted and not seen.driven:
            return f'stopped by fault {self._inverter.describe()}'
        if seen is None or not seen.from_bus:
            return self._no_control(seen)
        if not seen.driven:
            return f'stopped ({self._inverter.describe()})'
        try:
            coasts = await self._inverter.coasts_to_stop()
        except LinkError:
            # the stop is confirmed all the same
            return f'stopping ({self._inverter.describe()})'
        return 'stopping: it coasts' if coasts else 'stopping: it ramps down'

    async def take_control(self, control_mode: str) -> None:
        """
        Put the drive under bus control, with no run command standing.

        The set-point of an earlier session is removed before, where the drive lets us: one that has
        kept its run command, too, would turn the motor at once.

        :raises DriveError: it lets nobody take control.
        """
        if not self._inverter.settings_need_control:
            with contextlib.suppress(DriveError, Refused):
                await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await self._method.take_control(self._await_step)

    async def take_back(self) -> None:
        """
        Take back what was commanded on loan; control is kept.

        :raises DriveError: the drive does not confirm that it stops; it is tried on and on.
        """
        self._withdrawal.begin()
        await self._withdrawal.finish()

    async def quick_stop(self) -> str:
        """
        Release the motor at once: it coasts; by MODE and SCMD control is given back, too.

        Where the drive has no way to do that, stop as usual [C96].

        :raises DriveError: the drive does not confirm it; the stop is tried on and on.
        """
        if not self._method.coasts:
            return f'{await self.stop()} (this drive has no quick stop)'
        ours = self.concerned
        self.disarm()
        self._releasing += 1
        try:
            ours = ours or await self._method.in_control(Priority.STOP)
            ours = ours or (await self._inverter.look(Priority.STOP)).tuning
            if ours:
                await self._method.quick_stop(self._inverter.control_mode)
                await self._await_status(
                    lambda seen: not seen.driven, Priority.STOP, withdrawal.PATIENCE
                )
        except (DriveError, LinkError) as error:
            self._withdrawal.begin()
            with contextlib.suppress(LinkError):
                await self._inverter.look(Priority.STOP)
            seen = self._inverter.seen
            by_fault = seen is not None and seen.faulted and not seen.runs_by_bus
            if isinstance(error, Refused) and by_fault:
                return self._withdrawal.by_fault
            raise DriveError(
                f'the quick stop is NOT confirmed: {error} ({self._inverter.describe()}); '
                'trying a stop'
            ) from error
        finally:
            self._releasing -= 1
        if not ours:
            return self._no_control(self._inverter.seen)
        self._withdrawal.begin()
        await self._settle()
        return 'released: the motor coasts'

    async def acknowledge(self) -> str:
        """
        Acknowledge a fault; run command and set-point are removed before, where the drive lets us.

        :returns: what was acknowledged.
        :raises DriveError: the fault is still active.
        """
        inverter = self._inverter
        seen = await inverter.look(Priority.SERVICE)
        fault = seen.listed
        if not seen.faulted and fault.kind is Kind.STATUS:
            return f'nothing to acknowledge ({inverter.describe()})'
        ours = self.concerned or await self._method.in_control(Priority.SERVICE)
        self.disarm()
        name = inverter.describe()
        if seen.state is State.FAULT_REACTION_ACTIVE:
            # what comes before FAULTED acknowledges nothing [M0 table 16]
            with contextlib.suppress(DriveError):
                await self._await_status(
                    lambda now: now.state is not State.FAULT_REACTION_ACTIVE,
                    Priority.SERVICE,
                    withdrawal.PATIENCE,
                )
        try:
            why = await self._method.acknowledge(seen.code, inverter.control_mode)
        finally:
            # even if no answer came, the drive may be free to run now; and who has enabled it
            # meanwhile did so before this stop
            self.disarm()
            if ours:
                self._withdrawal.begin_anew()
        try:
            await self._await_status(
                lambda now: not now.faulted and now.code != seen.code, Priority.SERVICE, 0.5
            )
            await self._settle()
        except DriveError:
            now = inverter.seen or seen
            stands = now.listed
            first = f'acknowledged {name}, but ' if now.code != seen.code else ''
            raise DriveError(
                f'{first}{inverter.describe()} still stands: {stands.description}. {stands.remedy}'
            ) from None
        return f'acknowledged {name} ({why})' if why else f'acknowledged {name}'

    async def release(self, timeout: float) -> str:
        """
        Give control back once the motor stands.

        A motor that still ramps after ``timeout`` is left to its ramp. Only if the drive has a
        time-out of its own it is released, for else that would end the ramp with a fault.

        :raises DriveError: the drive does not confirm that it stops.
        """
        # a run command may be on its way, whoever has control at this moment; and where the bus has
        # it, one may stand that an acknowledgement has not come to remove yet
        seen = self._inverter.seen
        ours = self.ours or self.stopping or (seen is not None and seen.from_bus)
        stopped = await self.stop() if ours else ''
        if not await self._method.in_control(Priority.SERVICE):
            return stopped or 'control is not ours'
        stopped = stopped or await self.stop()
        if self._withdrawal.held_by_fault:
            raise DriveError(
                f'fault {self._inverter.describe()} stands and the drive takes no command: '
                'a run command may still stand in it when the fault is acknowledged'
            )
        try:
            await self._await_status(lambda seen: not seen.driven, Priority.SERVICE, timeout)
        except DriveError:
            await self._inverter.read_timeout()
            if not self._inverter.sio_tot:
                return f'{stopped}; it was left to its ramp, under bus control'
            stopped = 'released to coast, for the time-out of the drive would end the ramp'
        await self._method.release()
        return f'{stopped}; control given back'

    @property
    def concerned(self) -> bool:
        """The motor runs by us, or may do so, or at least the bus has control of it."""
        seen = self._inverter.seen
        ours = self.ours or self.stopping
        return ours or seen is None or seen.from_bus or seen.tuning

    # --- what happens by itself ---------------------------------------------------------------

    async def connected(self) -> None:
        """Make sure that nothing runs under bus control that nobody has enabled since."""
        seen = self._inverter.seen
        if await self._method.in_control(Priority.SERVICE):
            if seen is not None and seen.runs_by_bus and not self.stopping:
                self._tell(
                    Severity.WARNING,
                    f'the motor runs under bus control from before '
                    f'({self._inverter.describe()}): stopping it; call ~/enable to go on',
                )
            self._withdrawal.begin_anew()
        elif self._lost_in_use and seen is not None and not seen.faulted:
            self._tell(Severity.WARNING, explain_loss(self._inverter))
        self._lost_in_use = False

    def lost(self) -> bool:
        """Take note that the drive does not answer any more; true if it may have followed us."""
        self._lost_in_use = self.ours or self._refusal is not None
        if self._refusal is not None:
            # no status will come that could tell a better reason
            (_, reason), self._refusal = self._refusal, None
            self._tell(Severity.WARNING, f'stopping: {reason}')
        self.disarm()
        if self._lost_in_use:
            self._withdrawal.begin()
        return self._lost_in_use

    def alarmed_by(self, seen: InverterStatus) -> bool:
        """Tell whether a status would end the ride."""
        follows = self.armed and seen.at >= self._changed_at
        return follows and bool(self._why_stopped(seen))

    def watch(self, seen: InverterStatus) -> bool:
        """Judge what the drive says about itself; true if a person was told of it."""
        self._setpoint.answered()
        if self._withdrawal.held_by_fault and not seen.faulted:
            self._withdrawal.begin_anew()
        if self._explain_refusal(seen):
            return True
        if seen.at < self._changed_at:
            return False
        reason = ''
        if self.armed:
            reason = self._why_stopped(seen)
        elif not (self.ours or self.stopping or self._releasing) and seen.keeps_running:
            reason = (
                'it runs under bus control although nobody enabled it: find out whether another '
                'master commands it'
            )
        if reason:
            self.secure(reason)
        return bool(reason)

    def refused(self, reason: str) -> None:
        """Disarm and stop because of a set-point; the next status may tell a better reason."""
        self.disarm()
        self._withdrawal.begin()
        self._refusal = (time.monotonic(), reason)

    def _explain_refusal(self, seen: InverterStatus) -> bool:
        refused_at, reason = self._refusal or (math.inf, '')
        if seen.at <= refused_at:
            return False
        # it was told to stop when it refused; a drive with a fault refuses everything
        self._refusal = None
        self._tell_stopped(explain_fault(self._inverter, seen) if seen.faulted else reason)
        return True

    def secure(self, reason: str) -> None:
        """Disarm and stop for a reason that a person should know, with what to do about it."""
        self.disarm()
        self._withdrawal.begin()
        self._tell_stopped(reason)

    def _tell_stopped(self, reason: str) -> None:
        seen = self._inverter.seen
        if seen is not None and seen.faulted:
            remedy = 'then call ~/fault_ack and ~/enable to go on'
            self._tell(Severity.ERROR, f'stopped: {reason}; {remedy}')
        else:
            self._tell(Severity.WARNING, f'stopped: {reason}; then call ~/enable to go on')

    def disarm(self) -> None:
        """Follow set-points no more; end an enable that is on its way, and a loan."""
        self._setpoint.disarm()
        if self._arming is not None and self._arming is not self._bus.current_or_none:
            self._bus.cancel(self._arming)
        if self.loan is not None:
            self.loan.recalled = True

    # --- how --------------------------------------------------------------------------------

    async def _arm(self, prepare: Callable[[], Awaitable[None]]) -> None:
        inverter = self._inverter
        seen = await inverter.look(Priority.SERVICE)
        self._explain_refusal(seen)
        require_no_fault(inverter, seen)
        self._require_no_stop()
        control_mode = await inverter.read_control_mode()
        expected = inverter.settings.expected_control_mode
        if expected and control_mode != expected:
            raise DriveError(
                f'the drive is in control mode {control_mode}, expected is {expected}: '
                'set control.mode in the drive or expected_control_mode in the driver'
            )
        await self.take_control(control_mode)
        await self._await_step(lambda now: now.from_bus)
        if inverter.settings.follows_setpoints:
            await self._method.zero_setpoint(control_mode, Priority.SERVICE)
        await prepare()
        await self._method.run(self._await_start)
        await self._await_start(lambda now: now.runs)
        self._note_change()
        self._setpoint.arm(control_mode)

    async def _await_start(self, wanted: Callable[[InverterStatus], bool]) -> None:
        """
        Wait until the drive has made a step on its way to run.

        :raises DriveError: it does not.
        """
        deadline = time.monotonic() + withdrawal.PATIENCE
        delayed = False
        while True:
            seen = await self._inverter.look(Priority.SERVICE)
            if wanted(seen):
                return
            if seen.faulted:
                raise DriveError(f'the drive did not start: {self._inverter.describe()}')
            # in standby after the start delay it has forgotten the start, and must not wait for
            # another one
            if Fact.RUN_INPUT_MISSING in seen.facts or (delayed and seen.standby):
                raise DriveError(NO_RUN_INPUT)
            if seen.means(Meaning.START_DELAY) and not delayed:
                delayed = True
                deadline += await self._inverter.read_start_delay()
            if time.monotonic() > deadline:
                raise DriveError(
                    NO_RUN_INPUT
                    if seen.standby
                    else f'the drive does not start: {self._inverter.describe()}'
                )
            await self._bus.sleep(withdrawal.LOOK_PERIOD)

    async def _await_step(self, wanted: Callable[[InverterStatus], bool]) -> None:
        await self._await_status(wanted, Priority.SERVICE, withdrawal.PATIENCE)

    async def _await_status(
        self, wanted: Callable[[InverterStatus], bool], priority: Priority, timeout: float
    ) -> None:
        deadline = time.monotonic() + timeout
        while not wanted(await self._inverter.look(priority)):
            if time.monotonic() > deadline:
                raise DriveError(f'the drive does not do it; it says {self._inverter.describe()}')
            await self._bus.sleep(withdrawal.LOOK_PERIOD)

    def _require_no_stop(self) -> None:
        """
        See to it that nobody has asked for a stop that is not confirmed yet.

        :raises DriveError: somebody has; who enables meanwhile may not know of it.
        """
        if self.stopping or self._releasing:
            raise DriveError('a stop is on its way and not confirmed yet: wait for it, then enable')

    async def _settle(self) -> None:
        """Let a stop that comes with something else be confirmed, so that enable can follow."""
        with contextlib.suppress(DriveError):
            await self._withdrawal.finish()

    def _why_stopped(self, seen: InverterStatus) -> str:
        return explain_stop(self._inverter, seen, self._setpoint.control_mode)

    def _no_control(self, seen: InverterStatus | None) -> str:
        text = f'the bus has no control of this drive ({self._inverter.describe()})'
        if seen is not None and seen.driven:
            raise DriveError(f'{text}: stop it where it is controlled, by keypad or RUN input')
        return f'{text}, and it does not run'

    def _tell(self, severity: Severity, text: str) -> None:
        self._inverter.tell(severity, text)
