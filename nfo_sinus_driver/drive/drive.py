# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""One drive on a bus: connected, polled, commanded."""

from __future__ import annotations

from collections.abc import Callable, Collection, Coroutine, Sequence
from concurrent.futures import Future
import logging
import math
from typing import Any, TypeVar

from nfo_sinus_driver.bus import Bus, Priority, Statistics, Task, on_bus, stops_on_bus
from nfo_sinus_driver.catalog import InverterStatus, Procedure, Role, Value
from nfo_sinus_driver.drive.change.drive_timeout_writer import DriveTimeoutWriter
from nfo_sinus_driver.drive.change.memory import Memory, ProcessMemory
from nfo_sinus_driver.drive.change.parameters import Parameters
from nfo_sinus_driver.drive.change.tuning import Tuned, Tuning
from nfo_sinus_driver.drive.known.changes import ParameterChange
from nfo_sinus_driver.drive.known.contact import ContactEvent
from nfo_sinus_driver.drive.known.diagnosis import explained
from nfo_sinus_driver.drive.known.drive_state import DriveState, Hooks
from nfo_sinus_driver.drive.known.events import Cause, DriveError, Report, Severity
from nfo_sinus_driver.drive.known.identity import Identity
from nfo_sinus_driver.drive.known.recognising import Recogniser
from nfo_sinus_driver.drive.known.settings import DriveSettings
from nfo_sinus_driver.drive.known.snapshot import Listener, LogEntry, Snapshot
from nfo_sinus_driver.drive.known.steps import run_steps
from nfo_sinus_driver.drive.motion.controller import Controller, required
from nfo_sinus_driver.drive.motion.procedure import Procedures
from nfo_sinus_driver.drive.motion.setpoint import Setpoint
from nfo_sinus_driver.drive.watch.error_log import ErrorLog, ErrorLogMonitor
from nfo_sinus_driver.drive.watch.fault_name import FaultNamer
from nfo_sinus_driver.drive.watch.poller import Poller, take_snapshot
from nfo_sinus_driver.drive.watch.telemetry import watch_telemetry
from nfo_sinus_driver.link import LinkError

_log = logging.getLogger(__name__)
_T = TypeVar('_T')

#: How long an exit waits for the first answer of a drive that has never answered, s.
_FIRST_ANSWER = 1.0
#: The parameters that decide the unit of set-points.
_MODE_ROLES = (Role.CONTROL_MODE, Role.PROCESS_UNIT)
#: Why a motor is stopped by a command that gives no reason.
_BY = 'the program'
_STOP = Report(Cause.STOP_REQUESTED, by=_BY)
_QUICK_STOP = Report(Cause.QUICK_STOP_REQUESTED, by=_BY)
_ACKNOWLEDGE = Report(Cause.ACKNOWLEDGE_REQUESTED, by=_BY)
_LEFT = Report(Cause.TRANSITION_REQUESTED, by=_BY)
_ENDS = Report(Cause.DRIVER_ENDS, by=_BY)


class Drive:
    """
    One drive on a bus.

    All public methods may be called from any thread. Those that take time return a future; its
    exception is a :class:`DriveError`, which says what is wrong. Those that stop the motor take
    the reason: a report whose values name the caller.

    :param listener: called with every poll and event, on the worker of the bus.
    :param memory: keeps what is to be put back in the drive; by default for this process alone.
    :ivar model: what the catalog knows of its family.
    :ivar state: what is known of it; its methods, and those of the following, are for coroutines
        on the bus.
    :ivar params: its parameters.
    :ivar setpoint: its set-point.
    :ivar log: its error log.
    :ivar parameters: its settings.
    """

    def __init__(
        self,
        bus: Bus,
        settings: DriveSettings,
        listener: Listener,
        memory: Memory | None = None,
    ) -> None:
        settings.require_line(bus.protocol)
        self._bus = bus
        self._unit = settings.address
        self.state = DriveState(bus, settings, listener)
        self.model, self.params = self.state.model, self.state.params
        self.setpoint = Setpoint(self.state)
        self._controller: Controller | None = None
        self._recogniser = Recogniser(self.state)
        if settings.method != 'monitor':
            self._controller = Controller(self.state, self.setpoint, self._recogniser.look_once)
        self._poller = Poller(
            self.state, self.setpoint, self._controller, self._recogniser, self._connect
        )
        self._procedures = procedures = Procedures(self.state, self._controller)
        self.parameters = Parameters(
            self.state, procedures, self.run, self._take_parameters, self._take_scale
        )
        self._drive_timeout = DriveTimeoutWriter(
            self.state, self.parameters, memory or ProcessMemory(), self._controller
        )
        self.log = ErrorLog(self.state, procedures)
        self._error_log_monitor = ErrorLogMonitor(self.state, self.log)
        self._fault_namer = FaultNamer(self.state)
        self._tuning = Tuning(
            self.state, self.parameters, procedures, self._drive_timeout.ensure_set
        )
        #: Once a session: with each reconnect it would be said again.
        self._slow_line_reported = self._long_pauses_reported = False
        #: Stops the drives that stop with this one.
        self._on_stop: Callable[[Report], None] = lambda why: None
        # what follows in one part of it from what happens in another
        hooks = Hooks(
            status_arrived=self._poller.take_status,
            request_missed=self._poller.poll_soon,
            fault_came=self._error_log_monitor.expect,
            motor_stopped=self._motor_stopped,
            # a poll judges it before it is published
            status_changed=self._poller.wake,
            changed=self._poller.publish_change,
        )
        if self._controller is not None:
            hooks = hooks._replace(setpoint_refused=self._controller.refused)
        self.state.use_hooks(hooks)
        self.params.recognise_by(self._recogniser.require)
        bus.on_restart(self._unit, self._poller.restarted)
        bus.require_sign_of_life(self._unit, settings.lost_after)
        #: The tasks that run while it is connected, and while it is active.
        self._parameters_task: Task | None = None
        self._telemetry_task: Task | None = None

    # --- any thread ---------------------------------------------------------------------------

    @property
    def settings(self) -> DriveSettings:
        """Its settings; address, model and control method never change."""
        return self.state.settings

    @settings.setter
    def settings(self, settings: DriveSettings) -> None:
        self.state.use(settings)
        self._bus.require_sign_of_life(self._unit, settings.lost_after)

    @property
    def snapshot(self) -> Snapshot:
        """The newest poll."""
        return self._poller.snapshot

    @property
    def identity(self) -> Identity | None:
        """What answered; ``None`` before the first answer."""
        return self.state.nameplate.identity

    @property
    def identifies(self) -> bool:
        """Something tells its model from others that have all the registers which are read."""
        return self._recogniser.identifies

    @property
    def ever_responded(self) -> bool:
        """A drive has answered at its address at least once."""
        return self.state.contact.ever_answered

    @property
    def following(self) -> bool:
        """The motor follows set-points."""
        return self.setpoint.following

    @property
    def last_error(self) -> LogEntry | None:
        """The newest entry of the error log that was read in the background."""
        return self._error_log_monitor.newest

    @property
    def stop_unconfirmed(self) -> bool:
        """A stop was requested that the drive has not confirmed yet."""
        return self.state.control.stopping

    @property
    def stop_owed(self) -> bool:
        """This driver may have run the motor, and has no confirmation that it stops."""
        return self.state.control.stop_owed

    @property
    def stop_waits(self) -> bool:
        """A stop is written until it is confirmed, or it is not clear whether the motor stops."""
        return self._controller is not None and self._controller.stop_waits

    @property
    def stop_overdue(self) -> bool:
        """A stop was not confirmed in time, or not at all, and no fault keeps the motor still."""
        return self._controller is not None and self._controller.stop_overdue

    @property
    def jammed(self) -> Report | None:
        """How the enabled motor is jammed, where that does not stop it."""
        return None if self._controller is None else self._controller.jam.jammed

    @property
    def end_unconfirmed(self) -> str:
        """What is said where the driver ends, and no stop was confirmed."""
        return self.settings.end_unconfirmed(self._bus.protocol)

    @property
    def statistics(self) -> Statistics:
        """The counters and times of the requests to this drive."""
        return self._bus.statistics(self._unit)

    @property
    def line_check(self) -> str:
        """What to check, in this order, while the drive has never answered."""
        protocol = self._bus.protocol
        return self.state.model.profile.line_check.get(protocol.name, protocol.check)

    def run(
        self, command: Callable[[], Coroutine[Any, Any, _T]], *, stops: bool = False
    ) -> Future[_T]:
        """
        Run a coroutine on the bus; an error of the line becomes one that explains it.

        :param stops: it stops the motor.
        """

        def explain(error: BaseException) -> BaseException:
            check = None if self.state.nameplate.identity else self.line_check
            return explained(error, self._unit, check)

        return self._bus.run(command(), explain, stops=stops)

    def on_stop(self, call: Callable[[Report], None]) -> None:
        """Call a function on the bus whenever the motor is stopped, with the reason."""
        self._on_stop = call

    def stop_beside(self, why: Report) -> None:
        """Stop the motor, if this driver may run it, because another one stops; on the bus."""
        if self._controller is not None:
            self._controller.stop_because(why)

    def activate(self) -> None:
        """Poll at full rate and measure."""
        self._bus.call(lambda: self._set_active(True))

    def set_setpoint(self, value: float) -> None:
        """
        Request a set-point in the unit of the control mode; it counts only while enabled.

        :raises ValueError: not finite.
        :raises DriveError: the drive follows a reference of its own, and no set-points.
        """
        if not self.settings.follows_setpoints:
            raise DriveError(Cause.OWN_REFERENCE, reference=self.settings.reference)
        self.setpoint.request(value)

    # --- any thread, carried out on the bus ---------------------------------------------------

    @on_bus
    async def connect(self, *, retry: bool = True, parameters: bool = False) -> Identity:
        """
        Identify the drive, stop a motor that was not enabled, and poll the drive from then on.

        :param parameters: read all its parameters before, and watch them too.
        :param retry: repeat the first request when there is no response; a caller that tries again
            anyway need not cost the other drives on the line that time.
        """
        if not self._poller.begun:
            await self._connect(retry)
            try:
                if self._controller is not None:
                    await self._controller.jam.require_measured()
                if parameters:
                    await self.parameters.read_now([kept.key for kept in self.model.kept])
            except BaseException:
                # no poller watches it yet
                self._set_disconnected(_LEFT)
                raise
            if parameters:
                self._parameters_task = self._bus.spawn(self.parameters.watch_now())
            self._poller.begin()
            self._error_log_monitor.begin()
            self._fault_namer.begin()
        assert self.state.nameplate.identity is not None
        return self.state.nameplate.identity

    @on_bus
    async def require_standing(self) -> None:
        """
        Make sure that no motor runs by this control method, before another one is used.

        The status is read anew: after :meth:`disconnect` the motor may still be on its ramp.
        """
        if self._controller is None or self.state.nameplate.identity is None:
            return
        status = await self.state.reader.read(Priority.SERVICE)
        if status.driven and status.from_bus:
            method = self.settings.method
            raise DriveError(self.state.report(Cause.OTHER_METHOD_RUNS, method=method))

    @stops_on_bus
    async def disconnect(self, timeout: float, why: Report = _LEFT) -> Report:
        """Stop the motor, wait ``timeout`` s at most for standstill, and release control."""
        # no client may enable it until the motor stands still
        self._set_active(False)
        try:
            if self._controller is None:
                return Report(Cause.ONLY_WATCHED)
            try:
                answer = await self._controller.release(timeout, why, self._drive_timeout.undo)
            except (LinkError, DriveError) as error:
                self._drive_timeout.left(error)
                raise
            await self._drive_timeout.put_back()
            return answer
        finally:
            self._bus.cancel(self._parameters_task)
            self._set_disconnected(why)
            self._error_log_monitor.end()
            self._fault_namer.end()
            self._poller.end()

    @stops_on_bus
    async def deactivate(self, why: Report = _LEFT) -> Report | None:
        """Stop the motor, if it may run, and only watch the drive until it is active again."""
        return await self._deactivate(why)

    @stops_on_bus
    async def stop_for_good(self, patience: float, why: Report = _ENDS) -> Report | None:
        """Stop the motor within ``patience`` s; it can never be enabled again."""
        if self._controller is not None:
            self._controller.close(why)
        if not self.ever_responded:
            # it may not be there at all, or be just about to answer for the first time
            patience = min(patience, _FIRST_ANSWER)
        else:
            # time is left for the stop then
            self._bus.last_tries(patience)
        until = self._bus.now() + patience
        answer = await self._deactivate(why, patience)
        if self._controller is not None and answer is not None:
            await self._controller.leave(until - self._bus.now())
        return answer

    @on_bus
    async def enable(self, requested_at: float = math.inf) -> Report:
        """
        Take control and run at set-point 0, then follow set-points that come in.

        :param requested_at: when the client requested it, s of the clock, if not just now: it
            is refused if a stop was confirmed since.
        """
        self._require_active()
        controller = required(self._controller)
        self._require_connected()
        answer = await controller.enable(self._drive_timeout.ensure_set, requested_at)
        self._poller.wake()
        return answer

    @stops_on_bus
    async def stop(self, why: Report = _STOP) -> Report:
        """Stop as the drive's StMode says; control is kept."""
        return await required(self._controller).stop(why)

    @stops_on_bus
    async def rapid_stop(self, why: Report = _STOP) -> Report:
        """Stop along the stop ramp of the drive, where it has one; control is kept."""
        return await required(self._controller).rapid_stop(why)

    @stops_on_bus
    async def quick_stop(self, why: Report = _QUICK_STOP) -> Report:
        """Release the motor at once: it coasts."""
        return await required(self._controller).quick_stop(why)

    @on_bus
    async def acknowledge(self, why: Report = _ACKNOWLEDGE) -> Report:
        """Acknowledge a fault."""
        controller = required(self._controller)
        self._require_connected()
        return await controller.acknowledge(why)

    @on_bus
    async def identify(self, *, thoroughly: bool = True) -> Identity:
        """Identify the drive, thoroughly with model and serial number; a motor runs on."""
        identity = await self.state.nameplate.identify()
        await self.state.nameplate.scales.read()
        return await self._recogniser.read_nameplate() if thoroughly else identity

    @on_bus
    async def read_status(self) -> InverterStatus:
        """Read the status, connected or not, without acknowledging anything."""
        return await self.state.reader.read(Priority.SERVICE)

    @on_bus
    async def measure(self, key: str) -> Value:
        """Read one parameter, connected or not; NaN where its bits do not hold what it may be."""
        value = await self.params.read(key, Priority.SERVICE)
        if isinstance(value, str):
            return value
        cut_off = await self.state.measurements.is_cut_off(key, value, Priority.SERVICE, retry=True)
        return math.nan if cut_off else value

    @on_bus
    async def active_control_method(self) -> str:
        """Return the control method by which the bus runs the drive, or could stop it."""
        steps = self.model.profile.active_method(self.state.status)
        return await run_steps(self.state, steps, Priority.SERVICE)

    @on_bus
    async def error_log(self, most: int = 0) -> tuple[LogEntry, ...]:
        """Read the error log, newest entry first; ``most`` entries at most, 0: all."""
        self._require_connected()
        return await self.log.read_now(most)

    @on_bus
    async def erase_error_log(self) -> Report:
        """Erase the error log; the motor must be at standstill."""
        return await self.log.erase_now()

    @on_bus
    async def reset_energy(self) -> Report:
        """Reset the kWh counter; the motor must be at standstill."""
        return await self.log.reset_energy_now()

    @on_bus
    async def tune(
        self,
        procedure: Procedure,
        progress: Callable[[Snapshot, float], None] | None = None,
        requested_at: float = math.inf,
    ) -> Tuned:
        """
        Have the drive measure or calculate its motor; minutes may pass until the result.

        :param progress: called on the bus with a snapshot and the time elapsed, s, whenever the
            inverter status changes, and twice a second.
        :param requested_at: as for :meth:`enable`.
        """
        # as with enable, the motor may turn
        self._require_active()
        required(self._controller).require_newer(requested_at)

        def report(status: InverterStatus, elapsed: float) -> None:
            if progress is not None:
                progress(take_snapshot(self.state, self.setpoint, status), elapsed)

        return await self._tuning.tune_now(procedure, report)

    @stops_on_bus
    async def cancel_tuning(self) -> Report | None:
        """Stop a tuning, if there is one; stop nothing else."""
        return await self._procedures.abort()

    @on_bus
    async def set_drive_timeout(self, seconds: float) -> Sequence[ParameterChange]:
        """Set and verify the drive's own time-out, SioTot with AutoStop on [C91]."""
        return await self._drive_timeout.set_now(seconds)

    # --- on the bus ---------------------------------------------------------------------------

    def _require_connected(self) -> None:
        if not self.state.contact.connected:
            raise DriveError(Cause.NOT_CONNECTED, address=self._unit)

    def _require_active(self) -> None:
        # checked on the bus, where no deactivation can come between
        if not self._poller.active:
            raise DriveError(Cause.NOT_ACTIVE)

    def _motor_stopped(self, why: Report) -> None:
        try:
            self._on_stop(why)
        except Exception:
            _log.exception('other drives were not stopped: %s', why)
        self._poller.show_stop()

    async def _connect(self, retry: bool = False) -> None:
        state = self.state
        self.params.connected()
        takes_control = state.held_by_line
        if takes_control and not self.statistics.transactions:
            state.notify(Severity.WARNING, Cause.TAKES_CONTROL, why=takes_control)
        named = await self._recogniser.recognise(Priority.SERVICE if retry else Priority.POLL)
        if self._controller is not None:
            await self._controller.stop_unexpected_run()
            self._drive_timeout.connected()
        if not named:
            await self._recogniser.read_nameplate()
        await self._drive_timeout.recall()
        self._poller.connected()
        self.log.connected()
        state.contact.dispatch(ContactEvent.CONNECTED)
        if self._controller is not None:
            self._controller.connected()
        self._report_identity()
        if self._controller is None and takes_control:
            state.notify(Severity.WARNING, Cause.HELD_BY_LINE, why=takes_control)
        self._drive_timeout.warn_if_unfit()
        seconds, longest = self._bus.round_time(), self.settings.lost_after
        if seconds > longest and not self._slow_line_reported:
            self._slow_line_reported = True
            state.notify(
                Severity.WARNING, Cause.LINE_TOO_SLOW, seconds=seconds, lost_after=longest
            )
        self._report_long_pauses()

    def _report_long_pauses(self) -> None:
        state, seconds = self.state, self._bus.pauses_time()
        most = min(self.settings.lost_after, state.timeout.seconds / 2 or math.inf)
        if seconds > most and not self._long_pauses_reported:
            self._long_pauses_reported = True
            state.notify(Severity.WARNING, Cause.PAUSES_TOO_LONG, seconds=seconds, most=most)

    def _report_identity(self) -> None:
        state, profile, identity = self.state, self.model.profile, self.identity
        assert identity is not None
        if identity.model and not (profile.names_itself or profile.product):
            state.notify(
                Severity.WARNING,
                Cause.UNEXPECTED_IDENTITY,
                model=identity.model,
                title=profile.title,
            )
        name = '' if identity.model else self.model.name
        shown = ', '.join(part for part in (name, str(identity)) if part)
        cause = Cause.CONNECTED if self.identifies else Cause.CONNECTED_UNIDENTIFIED
        state.notify(Severity.INFO, cause, drive=shown)

    def _set_disconnected(self, why: Report) -> None:
        self.state.contact.dispatch(ContactEvent.LOST)
        if self._controller is not None:
            self._controller.disconnected(why)

    async def _deactivate(self, why: Report, patience: float | None = None) -> Report | None:
        self._set_active(False)
        if self._controller is None or not self._controller.may_run:
            return None
        return await self._controller.stop(why, patience)

    def _take_parameters(self, keys: Collection[str]) -> None:
        """Note new values of parameters, whatever changed them."""
        if self.state.timeout.take_values(keys, self.parameters.values):
            # the drive may have to be polled more often from now on
            self._poller.wake()
        if any(self.state.model.key(role) in keys for role in _MODE_ROLES):
            self._poller.read_mode_soon()
        self.state.listener.on_parameters(keys)

    def _take_scale(self, change: ParameterChange) -> None:
        """Stop a motor whose set-points would mean another speed from now on."""
        controller = self._controller
        is_used = self.state.nameplate.scales.found.get(change.key) == change.new
        if controller is not None and self.state.control.enabled and not is_used:
            controller.stop_because(Report(Cause.SCALE_CHANGED, change=change))

    def _set_active(self, active: bool) -> None:
        self._bus.cancel(self._telemetry_task)
        if active:
            telemetry = watch_telemetry(self.state, lambda: self._poller.yields)
            self._telemetry_task = self._bus.spawn(telemetry)
        self._poller.set_active(active)
