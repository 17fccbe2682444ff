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

from collections.abc import Callable
from collections.abc import Coroutine
from concurrent.futures import Future
import logging
import math
import time
from typing import Any
from typing import TypeVar

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.bus import Task
from nfo_sinus_driver.catalog import load_model
from nfo_sinus_driver.drive.advice import explain
from nfo_sinus_driver.drive.drive_timeout import set_drive_timeout
from nfo_sinus_driver.drive.errors import DriveError
from nfo_sinus_driver.drive.inverter import Identity
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.mode_scmd import ModeScmd
from nfo_sinus_driver.drive.motion import Motion
from nfo_sinus_driver.drive.picture import take_picture
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.drive.setpoint import Setpoint
from nfo_sinus_driver.drive.settings import DriveSettings
from nfo_sinus_driver.drive.snapshot import NAN
from nfo_sinus_driver.drive.snapshot import InverterStatus
from nfo_sinus_driver.drive.snapshot import Listener
from nfo_sinus_driver.drive.snapshot import Severity
from nfo_sinus_driver.drive.snapshot import Snapshot
from nfo_sinus_driver.drive.telemetry import watch_telemetry
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import PortError
from nfo_sinus_driver.link import Refused

_log = logging.getLogger(__name__)
_T = TypeVar('_T')

#: How often a drive is looked at while its node is not active, s.
_IDLE_PERIOD = 0.5
#: How often the control mode is read; it can only change while the motor stands, s.
_MODE_PERIOD = 1.0
#: How often the status is read at least while the motor runs, s.
_WATCH_PERIOD = 0.2
#: How often a drive that does not answer is tried again, at first and at last, s.
_RECONNECT_PERIOD = 1.0
_SLOWEST_RECONNECT = 4.0
#: The bus is silent for no more than this share of the drive's own time-out.
_KEEP_ALIVE_SHARE = 1 / 3
#: The value that is polled beside frequency and speed, by control mode.
_ACTUAL_KEYS = {'Torque': 'status.trq_act', 'PI-Reg': 'status.reg_act'}

_MONITOR = 'control_method is monitor: this driver only reads; set control_method to mode_scmd'


class Drive:
    """
    One inverter on a bus.

    All public methods may be called from any thread. Those that take time return a future; its
    exception is a :class:`DriveError` whose message says what is wrong and what to do.

    :param listener: told about every poll and event, on the worker of the bus.
    """

    def __init__(self, bus: Bus, settings: DriveSettings, listener: Listener) -> None:
        self._bus = bus
        self._unit = settings.address
        self._listener = listener
        model = load_model(settings.model)
        self._registers = Registers(bus, self._unit, model, settings.retries)
        self._inverter = Inverter(model, self._registers, listener, settings)
        self._setpoint = Setpoint(
            bus,
            self._unit,
            self._registers,
            self._inverter,
            lambda reason: self._motion.secure(reason) if self._motion else None,
        )
        self._motion: Motion | None = None
        if settings.control_method != 'monitor':
            method = ModeScmd(self._registers)
            self._motion = Motion(bus, self._inverter, method, self._setpoint)
        self._active = False
        self._barred = False
        self._misses = 0
        #: How often in a row nobody answered an attempt to connect.
        self._silences = 0
        #: When the control mode was last read.
        self._mode_read_at = 0.0
        self._complaint = ''
        self._told_timeout = ''
        self._told_fault = 0
        self._poll_task: Task | None = None
        self._telemetry_task: Task | None = None
        self._snapshot = take_picture(self._inverter, self._setpoint, None)

    # --- any thread ---------------------------------------------------------------------------

    @property
    def settings(self) -> DriveSettings:
        """How the drive is treated; address, model and control method never change."""
        return self._inverter.settings

    @settings.setter
    def settings(self, settings: DriveSettings) -> None:
        self._inverter.settings = settings

    @property
    def snapshot(self) -> Snapshot:
        """The newest poll."""
        return self._snapshot

    @property
    def identity(self) -> Identity | None:
        """Who answered, or ``None`` if nobody did yet."""
        return self._inverter.identity

    @property
    def armed(self) -> bool:
        """The motor follows set-points."""
        return self._setpoint.armed

    @property
    def stop_unconfirmed(self) -> bool:
        """A stop was asked for that the drive has not confirmed yet."""
        return self._motion is not None and self._motion.stopping

    def connect(self, *, patient: bool = True) -> Future[str]:
        """
        Identify the drive, make sure that nothing runs unasked, and watch it from then on.

        :param patient: repeat the first request when nobody answers; who tries again anyway saves
            the other drives on the line that time.
        """
        return self._run(lambda: self._connect_first(patient))

    def disconnect(self, timeout: float) -> Future[str]:
        """
        Stop the motor, give control back and leave the drive alone.

        :param timeout: how long the motor may take to stand before it is left to its ramp, s.
        """
        return self._run(lambda: self._disconnect(timeout))

    def activate(self) -> None:
        """Poll at full rate and measure."""
        self._bus.call(lambda: self._set_active(True))

    def deactivate(self) -> Future[str]:
        """Stop the motor and only keep watch; it cannot be enabled until it is active again."""
        return self._run(lambda: self._deactivate())

    def stop_for_good(self, patience: float) -> Future[str]:
        """
        Stop the motor; it can never be enabled again.

        :param patience: how long the drive may take to confirm it, s.
        """
        self._barred = True
        return self._run(lambda: self._deactivate(patience))

    def enable(self) -> Future[str]:
        """Take control and run at set-point 0, then follow set-points that come in."""
        return self._run(lambda: self._enable())

    def stop(self) -> Future[str]:
        """Stop as the drive's StMode says; control is kept."""
        return self._run(lambda: self._command(lambda motion: motion.stop()))

    def quick_stop(self) -> Future[str]:
        """Release the motor at once: it coasts."""
        return self._run(lambda: self._command(lambda motion: motion.quick_stop()))

    def acknowledge(self) -> Future[str]:
        """Acknowledge a fault."""
        return self._run(lambda: self._command(lambda motion: motion.acknowledge(), connected=True))

    def set_drive_timeout(self, seconds: float) -> Future[str]:
        """Set and verify the drive's own time-out, SioTot with AutoStop on [C91]."""
        return self._run(lambda: self._set_drive_timeout(seconds))

    def set_setpoint(self, value: float) -> None:
        """
        Ask for a set-point in the unit of the control mode; it counts only while armed.

        :raises ValueError: not finite.
        """
        self._setpoint.request(value)

    # --- on the bus ---------------------------------------------------------------------------

    def _run(self, command: Callable[[], Coroutine[Any, Any, str]]) -> Future[str]:
        return self._bus.run(self._explained(command))

    async def _explained(self, command: Callable[[], Coroutine[Any, Any, str]]) -> str:
        try:
            return await command()
        except LinkError as error:
            raise DriveError(self._explain(error)) from error
        except Cancelled:
            raise DriveError('the driver is ending') from None

    def _explain(self, error: LinkError) -> str:
        return explain(error, self._unit, known=self._inverter.identity is not None)

    async def _command(self, command: Any, *, connected: bool = False) -> str:
        if self._motion is None:
            raise DriveError(_MONITOR)
        if connected and not self._inverter.connected:
            raise DriveError(f'the drive at address {self._unit} is not connected')
        answer: str = await command(self._motion)
        return answer

    async def _enable(self) -> str:
        # looked at on the bus, where a deactivation cannot come between
        if self._barred or not self._active:
            raise DriveError('the drive is not active')
        answer = await self._command(lambda motion: motion.enable(), connected=True)
        if self._poll_task is not None:
            self._bus.wake(self._poll_task)
        return answer

    async def _connect_first(self, patient: bool) -> str:
        if self._poll_task is None:
            await self._connect(patient)
            self._poll_task = self._bus.spawn(self._poll_for_ever())
        return str(self._inverter.identity)

    async def _connect(self, patient: bool) -> None:
        inverter = self._inverter
        if not patient:
            # a silent drive costs its neighbours one time-out
            await inverter.look(Priority.POLL, once=True)
        await inverter.identify()
        await inverter.read_control_mode()
        await inverter.read_timeout()
        await inverter.look(Priority.SERVICE)
        if self._motion is not None:
            await self._motion.connected()
            if inverter.settings.drive_timeout:
                await self._set_drive_timeout(inverter.settings.drive_timeout)
        identity = await inverter.introduce()
        self._misses = self._silences = 0
        self._complaint = ''
        inverter.connected = inverter.answering = True
        name = '' if identity.model else f'{inverter.model.name}, '
        inverter.tell(Severity.INFO, f'connected: {name}{identity}')
        self._warn_of_missing_timeout()

    def _warn_of_missing_timeout(self) -> None:
        inverter = self._inverter
        if self._motion is None or (inverter.sio_tot and inverter.auto_stop):
            return
        why = 'AutoStop is OFF' if inverter.sio_tot else 'SioTot is 0'
        if why == self._told_timeout:
            return
        self._told_timeout = why
        inverter.tell(
            Severity.WARNING,
            f'the drive has no time-out of its own ({why}): if this driver is killed or the cable '
            'is cut, the motor runs on; set drive_timeout',
        )

    async def _disconnect(self, timeout: float) -> str:
        try:
            if self._motion is None:
                return 'only watched'
            return await self._motion.release(timeout)
        finally:
            self._set_active(False)
            if self._poll_task is not None:
                task, self._poll_task = self._poll_task, None
                self._bus.cancel(task)
            self._inverter.connected = False
            self._bus.forget_cycle(self._unit)
            self._publish(None)

    async def _deactivate(self, patience: float | None = None) -> str:
        self._set_active(False)
        if self._motion is None or not self._motion.concerned:
            return ''
        return await self._motion.stop(patience)

    async def _set_drive_timeout(self, seconds: float) -> str:
        if self._motion is None:
            raise DriveError(_MONITOR)
        answer = await set_drive_timeout(self._registers, seconds)
        await self._inverter.read_timeout()
        if self._poll_task is not None:
            # the drive may have to be kept alive more often from now on
            self._bus.wake(self._poll_task)
        if answer:
            self._inverter.tell(Severity.INFO, answer)
        return answer

    def _set_active(self, active: bool) -> None:
        self._active = active
        if self._telemetry_task is not None:
            self._bus.cancel(self._telemetry_task)
            self._telemetry_task = None
        if active:
            self._telemetry_task = self._bus.spawn(
                watch_telemetry(self._bus, self._inverter, self._registers, self._listener)
            )
            if self._poll_task is not None:
                self._bus.wake(self._poll_task)

    async def _poll_for_ever(self) -> None:
        polled_at = -math.inf
        while True:
            started = time.monotonic()
            due = started >= polled_at + self._period
            try:
                if not self._inverter.connected:
                    await self._connect(patient=False)
                elif due:
                    await self._poll()
                else:
                    await self._look()
                self._misses = 0
            except (LinkError, DriveError) as error:
                self._miss(error)
            except Exception as error:
                # a drive that is no longer watched must not go on running
                self._miss(DriveError(f'error in the driver: {error!r}'))
            if due:
                if self._inverter.connected and self._active and polled_at > 0:
                    self._bus.note_cycle(self._unit, started - polled_at)
                polled_at = started
            await self._bus.sleep(self._pause(polled_at))

    def _pause(self, polled_at: float) -> float:
        """Return how long to wait until the drive is asked again, s."""
        inverter = self._inverter
        if not inverter.connected:
            # a drive that stays silent costs its neighbours less and less
            return min(_RECONNECT_PERIOD * max(1, self._silences), _SLOWEST_RECONNECT)
        pause = polled_at + self._period - time.monotonic()
        # however seldom somebody wants to read the status, a motor that runs is watched
        return min(pause, _WATCH_PERIOD) if self.armed else pause

    @property
    def _period(self) -> float:
        """The time from one poll to the next, s."""
        if not self._active:
            period = _IDLE_PERIOD
        else:
            rate = self._inverter.settings.poll_rate
            period = 1 / rate if rate else 0.0
        if self._inverter.sio_tot:
            period = min(period, self._inverter.sio_tot * _KEEP_ALIVE_SHARE)
        return period

    async def _look(self) -> InverterStatus:
        """Read the status and judge it."""
        # a request that fails is not repeated at once, so that a silent drive costs its
        # neighbours no more than one time-out in each of their cycles
        seen = await self._inverter.look(Priority.POLL, once=True)
        self._inverter.answering = True
        self._tell_fault(seen)
        if self._motion is not None:
            self._motion.watch(seen)
        return seen

    async def _poll(self) -> None:
        inverter = self._inverter
        seen = await self._look()
        if time.monotonic() - self._mode_read_at > _MODE_PERIOD:
            self._mode_read_at = time.monotonic()
            await inverter.read_control_mode(Priority.POLL)
        inverter.frequency = frequency = await self._measure('status.frq_act')
        inverter.speed = speed = await self._measure('status.spd_act')
        actual = {'Freque': frequency, 'Speed': speed}.get(inverter.control_mode, NAN)
        if inverter.control_mode in _ACTUAL_KEYS:
            actual = await self._measure(_ACTUAL_KEYS[inverter.control_mode])
        self._publish(seen, frequency=frequency, speed=speed, actual=actual)

    def _tell_fault(self, seen: InverterStatus) -> None:
        """Say on change that a fault stands; one that ends a ride is told by who ends it."""
        code = seen.code if seen.faulted else 0
        if code and code != self._told_fault and not self.armed:
            fault = self._inverter.model.inv_st(code)
            self._inverter.tell(
                Severity.ERROR,
                f'fault {self._inverter.describe()}: {fault.description}. {fault.remedy}; '
                'then call ~/fault_ack',
            )
        self._told_fault = code

    async def _measure(self, key: str) -> float:
        """Read a measured value; NaN if the drive refuses it, for it answers all the same."""
        try:
            return await self._registers.read_number(key, Priority.POLL, once=True)
        except Refused:
            return NAN

    def _miss(self, error: LinkError | DriveError) -> None:
        """Count a failed poll; too many in a row and the drive is lost."""
        inverter = self._inverter
        self._misses += 1
        inverter.answering = False
        if inverter.connected and (
            self._misses > inverter.settings.retries or isinstance(error, PortError)
        ):
            inverter.connected = False
            explained = self._explain(error) if isinstance(error, LinkError) else str(error)
            self._bus.forget_cycle(self._unit)
            if self._motion is not None:
                self._motion.lost()
            inverter.tell(Severity.ERROR, f'lost: {explained}; trying again for ever')
            try:
                self._publish(None)
            except Exception:
                # a mistake of who listens must not end the watch
                _log.exception('the loss of the drive could not be told')
        elif not inverter.connected:
            self._silences += 1
            if isinstance(error, DriveError):
                self._complain(str(error))

    def _complain(self, text: str) -> None:
        """Say what keeps the drive from being used, once."""
        if text != self._complaint:
            self._complaint = text
            self._inverter.tell(Severity.ERROR, text)

    def _publish(self, seen: InverterStatus | None, **values: float) -> None:
        self._snapshot = take_picture(self._inverter, self._setpoint, seen, **values)
        self._listener.on_snapshot(self._snapshot)
