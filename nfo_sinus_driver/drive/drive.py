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

"""One drive on a bus: connected, polled, commanded."""

from __future__ import annotations

from collections.abc import Awaitable
from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Coroutine
from collections.abc import Sequence
from concurrent.futures import Future
import math
from typing import Any
from typing import TypeVar

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.bus import Statistics
from nfo_sinus_driver.bus import Task
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Procedure
from nfo_sinus_driver.catalog import Role
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.drive.commands import Commands
from nfo_sinus_driver.drive.commands import carry_out
from nfo_sinus_driver.drive.communication_watchdog import CommunicationWatchdog
from nfo_sinus_driver.drive.control_state import ControlState
from nfo_sinus_driver.drive.controller import Controller
from nfo_sinus_driver.drive.diagnosis import explain
from nfo_sinus_driver.drive.drive_state import DriveState
from nfo_sinus_driver.drive.drive_state import Identity
from nfo_sinus_driver.drive.error_log import ErrorLog
from nfo_sinus_driver.drive.error_log_monitor import ErrorLogMonitor
from nfo_sinus_driver.drive.events import Cause
from nfo_sinus_driver.drive.events import DriveError
from nfo_sinus_driver.drive.events import Report
from nfo_sinus_driver.drive.events import Severity
from nfo_sinus_driver.drive.log_entry import LogEntry
from nfo_sinus_driver.drive.parameter_access import ParameterAccess
from nfo_sinus_driver.drive.parameter_writer import Change
from nfo_sinus_driver.drive.parameters import Parameters
from nfo_sinus_driver.drive.picture import take_snapshot
from nfo_sinus_driver.drive.poller import Poller
from nfo_sinus_driver.drive.procedure import Procedures
from nfo_sinus_driver.drive.setpoint import Setpoint
from nfo_sinus_driver.drive.settings import DriveSettings
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.drive.snapshot import Listener
from nfo_sinus_driver.drive.snapshot import Snapshot
from nfo_sinus_driver.drive.telemetry import watch_telemetry
from nfo_sinus_driver.drive.tuning import Tuned
from nfo_sinus_driver.drive.tuning import Tuning
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused

_T = TypeVar('_T')

#: How long an exit waits for the first answer of a drive that has never answered yet, s.
_FIRST_ANSWER = 1.0
#: What the unit of set-points follows from.
_MODE_ROLES = (Role.CONTROL_MODE, Role.PROCESS_UNIT)


class Drive:
    """
    One inverter on a bus.

    All public methods may be called from any thread. Those that take time return a future; its
    exception is a :class:`DriveError`, which says what is wrong.

    :param listener: told about every poll and event, on the worker of the bus.
    """

    def __init__(self, bus: Bus, settings: DriveSettings, listener: Listener) -> None:
        self._bus = bus
        self._unit = settings.address
        self._listener = listener
        model = load_family(settings.model)
        self._registers = ParameterAccess(bus, self._unit, model, settings.retries)
        self._inverter = DriveState(model, self._registers, listener, settings)
        self._setpoint = Setpoint(
            bus,
            self._unit,
            self._registers,
            self._inverter,
            lambda reason: self._controller.refused(reason) if self._controller else None,
            lambda reply: self._watch.told(reply),
        )
        self._controller: Controller | None = None
        if settings.method != 'monitor':
            commands = Commands(settings, self._registers, self._inverter.tell)
            self._controller = Controller(bus, self._inverter, commands, self._setpoint)
        self._watch = Poller(
            bus,
            self._inverter,
            self._registers,
            self._setpoint,
            self._controller,
            listener,
            lambda: self._connect(patient=False),
        )
        self._procedures = procedures = Procedures(bus, self._inverter, self._controller)
        #: The settings of the drive.
        self.parameters = Parameters(
            bus, self._inverter, self._registers, procedures, self.run, self._take_parameters
        )
        self._watchdog = CommunicationWatchdog(
            self._inverter, self.parameters, commanded=self._controller is not None
        )
        self._error_log = ErrorLog(self._inverter, self._registers, procedures)
        self._error_log_monitor = ErrorLogMonitor(bus, self._inverter, self._error_log, listener)
        self._tuning = Tuning(bus, self._inverter, self._registers, self.parameters, procedures)
        self._parameters_task: Task | None = None
        self._telemetry_task: Task | None = None

    # --- any thread ---------------------------------------------------------------------------

    @property
    def settings(self) -> DriveSettings:
        """How the drive is treated; address, model and control method never change."""
        return self._inverter.settings

    @settings.setter
    def settings(self, settings: DriveSettings) -> None:
        for name in ('address', 'model', 'control_method', 'reference'):
            if getattr(settings, name) != getattr(self.settings, name):
                raise ValueError(f'{name} cannot change within a session: make another Drive')
        self._inverter.settings = settings

    @property
    def model(self) -> Family:
        """What the catalog knows of its family."""
        return self._inverter.model

    @property
    def inverter(self) -> DriveState:
        """What is known of it; its methods are for coroutines on the bus."""
        return self._inverter

    @property
    def registers(self) -> ParameterAccess:
        """Its parameters, for coroutines on the bus."""
        return self._registers

    @property
    def log(self) -> ErrorLog:
        """Its error log, for coroutines on the bus."""
        return self._error_log

    @property
    def snapshot(self) -> Snapshot:
        """The newest poll."""
        return self._watch.snapshot

    @property
    def identity(self) -> Identity | None:
        """Who answered, or ``None`` if nobody did yet."""
        return self._inverter.identity

    @property
    def heard(self) -> bool:
        """Somebody has answered at its address, be it only once."""
        return self._bus.silences.heard_at(self._unit) > -math.inf

    @property
    def armed(self) -> bool:
        """The motor follows set-points."""
        return self._setpoint.armed

    @property
    def setpoint(self) -> Setpoint:
        """What it is to follow, for coroutines on the bus."""
        return self._setpoint

    @property
    def last_error(self) -> LogEntry | None:
        """The newest entry of the error log that was read in the background."""
        return self._error_log_monitor.newest

    @property
    def powered_since(self) -> float:
        """From this operating hour on the drive is known to have had power; NaN: not known."""
        return self._error_log.clock.since

    @property
    def stop_unconfirmed(self) -> bool:
        """A stop was asked for that the drive has not confirmed yet."""
        return self._controller is not None and self._controller.stopping

    @property
    def blocked_by_fault(self) -> bool:
        """A fault keeps the drive from taking a stop, and the motor still."""
        return self._controller is not None and self._controller.blocked_by_fault

    @property
    def stop_overdue(self) -> bool:
        """It has had time to confirm it, and no fault keeps it from turning the motor."""
        return self._controller is not None and self._controller.stop_overdue

    @property
    def statistics(self) -> Statistics:
        """The counters and times of what is said to this drive."""
        return self._bus.statistics(self._unit)

    def connect(self, *, patient: bool = True, parameters: bool = False) -> Future[Identity]:
        """
        Identify the drive, make sure that nothing runs unasked, and watch it from then on.

        :param parameters: read all its parameters before, and watch them too.
        :param patient: repeat the first request when there is no response; who tries again anyway
            saves the other drives on the line that time.
        """
        return self.run(lambda: self._connect_first(patient, parameters))

    def require_standing(self) -> Future[None]:
        """
        Make sure that another control method may follow: no motor may run by this one any more.

        It is looked at anew, for after :meth:`disconnect` it may have been left to its ramp.
        """
        return self.run(lambda: self._require_standing())

    def disconnect(self, timeout: float) -> Future[Report]:
        """
        Stop the motor, give control back and leave the drive alone.

        :param timeout: how long the motor may take to stand before it is left to its ramp, s.
        """
        return self.run(lambda: self._disconnect(timeout))

    def activate(self) -> None:
        """Poll at full rate and measure."""
        self._bus.call(lambda: self._set_active(True))

    def deactivate(self) -> Future[Report | None]:
        """
        Stop the motor and only keep watch; it cannot be enabled until it is active again.

        The result is ``None`` where there is nothing to stop.
        """
        return self.run(lambda: self._deactivate())

    def stop_for_good(self, patience: float) -> Future[Report | None]:
        """
        Stop the motor as :meth:`deactivate` does; it can never be enabled again.

        :param patience: how long the drive may take to confirm it, s.
        """
        return self.run(lambda: self._stop_for_good(patience))

    def enable(self) -> Future[Report]:
        """Take control and run at set-point 0, then follow set-points that come in."""
        return self.run(lambda: self._enable())

    def stop(self) -> Future[Report]:
        """Stop as the drive's StMode says; control is kept."""
        return self.run(lambda: self._command(lambda controller: controller.stop()))

    def quick_stop(self) -> Future[Report]:
        """Release the motor at once: it coasts."""
        return self.run(lambda: self._command(lambda controller: controller.quick_stop()))

    def acknowledge(self) -> Future[Report]:
        """Acknowledge a fault."""
        return self.run(
            lambda: self._command(lambda controller: controller.acknowledge(), connected=True)
        )

    def run(self, command: Callable[[], Coroutine[Any, Any, _T]]) -> Future[_T]:
        """Run a coroutine on the bus; what goes wrong on the line is explained."""
        return self._bus.run(self._explained(command))

    def identify(self, *, thoroughly: bool = True) -> Future[Identity]:
        """
        Find out who answers, without connecting to it: a motor that runs runs on.

        :param thoroughly: also ask for model and serial number.
        """

        async def ask() -> Identity:
            identity = await self._inverter.identify()
            return await self._inverter.introduce() if thoroughly else identity

        return self.run(ask)

    def read_status(self) -> Future[InverterStatus]:
        """Read the status, connected or not, without acknowledging anything."""
        return self.run(lambda: self._inverter.look(Priority.SERVICE))

    def measure(self, key: str) -> Future[Value]:
        """Read one parameter, connected or not."""
        return self.run(lambda: self._registers.read(key, Priority.SERVICE))

    def method_in_charge(self) -> Future[str]:
        """Return the control method by which the bus runs it, or would be able to stop it."""
        steps = self.model.profile.in_charge(self._inverter.seen)
        return self.run(lambda: carry_out(steps, self._registers, Priority.SERVICE))

    def error_log(self, most: int = 0) -> Future[tuple[LogEntry, ...]]:
        """Read the error log, newest entry first; at most so many entries, 0: all."""
        return self.run(lambda: self._read_error_log(most))

    def erase_error_log(self) -> Future[Report]:
        """Erase the error log; the motor must stand."""
        return self.run(lambda: self._unless_closed(self._error_log.erase_now))

    def reset_energy(self) -> Future[Report]:
        """Reset the kWh counter; the motor must stand."""
        return self.run(lambda: self._unless_closed(self._error_log.reset_energy_now))

    def tune(
        self, procedure: Procedure, progress: Callable[[Snapshot, float], None] | None = None
    ) -> Future[Tuned]:
        """
        Have the drive measure or calculate its motor; minutes may pass until the result.

        :param progress: told on the bus what the drive says, and how long it takes already, s:
            whenever the inverter status changes, and twice a second.
        """
        return self.run(lambda: self._tune(procedure, progress))

    def cancel_tuning(self) -> Future[Report | None]:
        """Stop a tuning; does nothing else, and nothing if there is none."""
        return self.run(self._procedures.abort)

    def set_drive_timeout(self, seconds: float) -> Future[Sequence[Change]]:
        """Set and verify the drive's own time-out, SioTot with AutoStop on [C91]."""
        return self.run(lambda: self._watchdog.set_now(seconds))

    def set_setpoint(self, value: float) -> None:
        """
        Ask for a set-point in the unit of the control mode; it counts only while armed.

        :raises ValueError: not finite.
        :raises DriveError: the drive follows a reference of its own, and no set-points.
        """
        if not self.settings.follows_setpoints:
            reference = self.settings.reference
            raise DriveError(Report(Cause.OWN_REFERENCE, reference=reference))
        self._setpoint.request(value)

    # --- on the bus ---------------------------------------------------------------------------

    async def _explained(self, command: Callable[[], Coroutine[Any, Any, _T]]) -> _T:
        try:
            return await command()
        except LinkError as error:
            raise DriveError(self._explain(error)) from error
        except Cancelled:
            raise DriveError(Report(Cause.ENDING)) from None

    def _explain(self, error: LinkError) -> Report:
        known = self._inverter.identity is not None
        return explain(error, self._unit, check=None if known else self._bus.protocol.check)

    async def _command(
        self, command: Callable[[Controller], Awaitable[Report]], *, connected: bool = False
    ) -> Report:
        if self._controller is None:
            raise DriveError(Report(Cause.MONITOR_ONLY))
        if connected:
            self._require_connected()
        return await command(self._controller)

    def _require_connected(self) -> None:
        if not self._inverter.connected:
            raise DriveError(Report(Cause.NOT_CONNECTED, address=self._unit))

    async def _enable(self) -> Report:
        # looked at on the bus, where a deactivation cannot come between
        if not self._watch.active:
            raise DriveError(Report(Cause.NOT_ACTIVE))
        answer = await self._command(
            lambda controller: controller.enable(self._watchdog.require_set), connected=True
        )
        self._watch.wake()
        return answer

    async def _read_error_log(self, most: int) -> tuple[LogEntry, ...]:
        self._require_connected()
        return await self._error_log.read_now(most)

    async def _unless_closed(self, procedure: Callable[[], Awaitable[Report]]) -> Report:
        # it would take control that nobody gives back any more
        if self._controller is not None and self._controller.state is ControlState.CLOSED:
            raise DriveError(Report(Cause.ENDING))
        return await procedure()

    async def _tune(
        self, procedure: Procedure, progress: Callable[[Snapshot, float], None] | None
    ) -> Tuned:
        # as with enable, the motor may turn
        if not self._watch.active:
            raise DriveError(Report(Cause.NOT_ACTIVE))

        def tell(seen: InverterStatus, elapsed: float) -> None:
            if progress is not None:
                progress(take_snapshot(self._inverter, self._setpoint, seen), elapsed)

        return await self._tuning.tune_now(procedure, tell)

    async def _connect_first(self, patient: bool, parameters: bool) -> Identity:
        if not self._watch.begun:
            await self._connect(patient)
            if parameters:
                try:
                    await self.parameters.read_now()
                except BaseException:
                    # nobody watches it yet
                    self._inverter.connected = False
                    if self._controller is not None:
                        self._controller.disconnected()
                    raise
                self._parameters_task = self._bus.spawn(self.parameters.watch_now())
            self._watch.begin()
            self._error_log_monitor.begin()
        assert self._inverter.identity is not None
        return self._inverter.identity

    async def _connect(self, patient: bool) -> None:
        inverter = self._inverter
        try:
            await inverter.identify(patient=patient)
        except Refused as error:
            if error.code == Refused.BUSY:
                raise
            raise DriveError(
                Report(Cause.OTHER_MODEL, error=str(error), model=inverter.model.name)
            ) from error
        await inverter.read_control_mode()
        await inverter.read_timeout()
        await inverter.look(Priority.SERVICE)
        if self._controller is not None:
            await self._controller.secure_found()
            await self._watchdog.prepare()
        identity = await inverter.introduce()
        self._watch.connected()
        self._setpoint.connected()
        inverter.connected = inverter.answering = True
        if self._controller is not None:
            self._controller.connected()
        name = '' if identity.model else inverter.model.name
        if identity.model and not inverter.model.profile.names_itself:
            title = inverter.model.profile.title
            unexpected = Report(Cause.UNEXPECTED_IDENTITY, model=identity.model, title=title)
            inverter.tell(Severity.WARNING, unexpected)
        told = ', '.join(part for part in (name, str(identity)) if part)
        inverter.tell(Severity.INFO, Report(Cause.CONNECTED, drive=told))
        self._watchdog.warn_if_unfit()

    async def _disconnect(self, timeout: float) -> Report:
        # nobody may enable it while it is awaited that the motor stands
        self._set_active(False)
        try:
            if self._controller is None:
                return Report(Cause.ONLY_WATCHED)
            return await self._controller.release(timeout)
        finally:
            if self._parameters_task is not None:
                task, self._parameters_task = self._parameters_task, None
                self._bus.cancel(task)
            self._inverter.connected = False
            if self._controller is not None:
                self._controller.disconnected()
            self._error_log_monitor.end()
            self._watch.end()

    async def _require_standing(self) -> None:
        if self._controller is None or self._inverter.identity is None:
            return
        seen = await self._inverter.look(Priority.SERVICE)
        if seen.driven and seen.from_bus:
            method = self.settings.method
            raise DriveError(self._inverter.report(Cause.OTHER_METHOD_RUNS, method=method))

    async def _stop_for_good(self, patience: float) -> Report | None:
        if self._controller is not None:
            self._controller.close()
        return await self._deactivate(patience)

    async def _deactivate(self, patience: float | None = None) -> Report | None:
        self._set_active(False)
        if self._controller is None or not self._controller.may_run:
            return None
        if patience is not None and not self.heard:
            # it may not be there at all, or be just about to answer for the first time
            patience = min(patience, _FIRST_ANSWER)
        return await self._controller.stop(patience)

    def _take_parameters(self, keys: Collection[str]) -> None:
        """Take note of parameters that have new values, whoever changed them."""
        values, key = self.parameters.values, self.model.key
        timeout, stop = key(Role.COMMUNICATION_TIMEOUT), key(Role.STOP_AT_TIMEOUT)
        if timeout in keys:
            self._inverter.sio_tot = float(values[timeout])
        if stop in keys:
            self._inverter.auto_stop = bool(values.get(stop))
        if timeout in keys:
            # the drive may have to be kept alive more often from now on
            self._watch.wake()
        if any(key(role) in keys for role in _MODE_ROLES):
            self._watch.read_mode_soon()
        self._listener.on_parameters(keys)

    def _set_active(self, active: bool) -> None:
        self._watch.active = active
        if self._telemetry_task is not None:
            self._bus.cancel(self._telemetry_task)
            self._telemetry_task = None
        if active:
            self._telemetry_task = self._bus.spawn(
                watch_telemetry(self._bus, self._inverter, self._listener)
            )
            self._watch.wake()
