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

"""One line, open, and the drives on it: read by this tool, and written only when told to."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from collections.abc import Collection
from collections.abc import Coroutine
from collections.abc import Mapping
from concurrent.futures import Future
import math
import time
from typing import Any
from typing import TypeVar

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.bus import Cancelled
from nfo_sinus_driver.bus import Priority
from nfo_sinus_driver.bus import Statistics
from nfo_sinus_driver.catalog import Family
from nfo_sinus_driver.catalog import Value
from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.cli.progress import progress
from nfo_sinus_driver.cli.progress import remark
from nfo_sinus_driver.cli.trouble import Trouble
from nfo_sinus_driver.cli.trouble import UsageError
from nfo_sinus_driver.cli.wording import say
from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.drive import Drive
from nfo_sinus_driver.drive import DriveError
from nfo_sinus_driver.drive import DriveSettings
from nfo_sinus_driver.drive import Event
from nfo_sinus_driver.drive import Identity
from nfo_sinus_driver.drive import InverterStatus
from nfo_sinus_driver.drive import Listener
from nfo_sinus_driver.drive import Report
from nfo_sinus_driver.drive import Severity
from nfo_sinus_driver.drive import Snapshot
from nfo_sinus_driver.drive import Telemetry
from nfo_sinus_driver.drive.advice import explain
from nfo_sinus_driver.drive.commands import Commands
from nfo_sinus_driver.drive.commands import carry_out
from nfo_sinus_driver.drive.controller import Controller
from nfo_sinus_driver.drive.error_log import ErrorLog
from nfo_sinus_driver.drive.inverter import Inverter
from nfo_sinus_driver.drive.log_entry import LogEntry
from nfo_sinus_driver.drive.parameters import Parameters
from nfo_sinus_driver.drive.procedure import Procedures
from nfo_sinus_driver.drive.registers import Registers
from nfo_sinus_driver.drive.setpoint import Setpoint
from nfo_sinus_driver.link import LinkError
from nfo_sinus_driver.link import Refused
from nfo_sinus_driver.link import line_settings
from nfo_sinus_driver.link import open_link

_T = TypeVar('_T')


class Remote:
    """
    One drive at the other end of the line.

    It is never connected to as the driver does, which takes a run command back: a drive that runs
    runs on. What takes time raises :class:`DriveError` when it fails.
    """

    def __init__(self, bus: Bus, settings: DriveSettings) -> None:
        self._bus = bus
        self.address = settings.address
        self.model: Family = load_family(settings.model)
        self.registers = Registers(bus, settings.address, self.model, settings.retries)
        self.inverter = Inverter(self.model, self.registers, self, settings)
        controller = None
        if settings.control_method != 'monitor':
            commands = Commands(settings, self.registers)
            setpoint = Setpoint(
                bus, settings.address, self.registers, self.inverter, lambda reason: None
            )
            controller = Controller(bus, self.inverter, commands, setpoint)
        self._procedures = Procedures(bus, self.inverter, controller)
        self.parameters = Parameters(
            bus, self.inverter, self.registers, self._procedures, self._run, self._count
        )
        self._step: Callable[[], None] = lambda: None

    def __str__(self) -> str:
        return f'the drive at address {self.address}'

    def do(self, command: Callable[[], Coroutine[Any, Any, _T]]) -> _T:
        """Run a coroutine on the bus and return its result."""
        return self._run(command).result()

    def identify(self, *, thoroughly: bool = True) -> Identity:
        """
        Find out who answers.

        :param thoroughly: also ask for model and serial number.
        """

        async def ask() -> Identity:
            identity = await self.inverter.identify()
            return await self.inverter.introduce() if thoroughly else identity

        try:
            return self.do(ask)
        except DriveError as error:
            if not isinstance(error.__cause__, Refused):
                raise
            model, why = self.model.name, error.report
            other = Report(Cause.NOT_THE_MODEL, drive=str(self), model=model, why=why)
            raise DriveError(other) from error.__cause__

    def look(self) -> InverterStatus:
        """Read the status, without acknowledging anything."""
        return self.do(lambda: self.inverter.look(Priority.SERVICE))

    def read(self, only: Collection[str] | None = None) -> Mapping[str, Value]:
        """Read the settings of the drive, or some of them, and return those that it has."""
        keys = self.parameters.available(only)
        if not self.model.settings:
            raise Trouble(f'of a {self.model.name} no settings are known')
        with progress(f'reading {self}', len(keys)) as self._step:
            self.parameters.read(only).result()
        return self.parameters.values

    def error_log(self, most: int) -> tuple[LogEntry, ...]:
        """Read the error log, newest entry first; at most so many entries, 0: all."""
        log = ErrorLog(self.inverter, self.registers, self._procedures)
        return self.do(lambda: log.read_now(most))

    def method_in_charge(self) -> str:
        """Return the control method by which the bus runs it, or would be able to stop it."""
        steps = self.model.profile.in_charge(self.inverter.seen)
        return self.do(lambda: carry_out(steps, self.registers, Priority.SERVICE))

    def measure(self, key: str) -> Value:
        """Read one value."""
        return self.do(lambda: self.registers.read(key, Priority.SERVICE))

    def _run(self, command: Callable[[], Coroutine[Any, Any, _T]]) -> Future[_T]:
        return self._bus.run(self._explained(command))

    async def _explained(self, command: Callable[[], Coroutine[Any, Any, _T]]) -> _T:
        known = self.inverter.identity is not None
        try:
            return await command()
        except LinkError as error:
            raise DriveError(explain(error, self.address, known=known)) from error
        except Cancelled:
            raise DriveError(Report(Cause.ENDING)) from None

    def _count(self, keys: Collection[str]) -> None:
        for _ in keys:
            self._step()

    # --- what the layers below have to tell ---------------------------------------------------

    def on_event(self, event: Event) -> None:
        """Pass on what an operator has to know."""
        if event.severity is not Severity.INFO:
            remark(say(event.report))

    def on_snapshot(self, snapshot: Snapshot) -> None:
        """Nothing: nobody polls."""

    def on_telemetry(self, telemetry: Telemetry) -> None:
        """Nothing: nobody polls."""

    def on_parameters(self, keys: Collection[str]) -> None:
        """Nothing: the values are looked at when all are read."""

    def on_log_entry(self, entry: LogEntry) -> None:
        """Nothing: nobody watches the log."""


class Session:
    """
    The line that the options name, open while the ``with`` block lasts.

    :param writes: whether drives on it may be written to; without it they are only read.
    :raises UsageError: an option that can never work.
    """

    def __init__(self, options: argparse.Namespace, *, writes: bool = False) -> None:
        self._options = options
        self._writes = writes
        #: When the last round of reading each drive was over, s.
        self._polled_at: dict[int, float] = {}
        try:
            line = line_settings(
                options.protocol,
                baud_rate=options.baud_rate,
                char_format=options.char_format,
                response_timeout=options.response_timeout,
            )
            self._bus = Bus(open_link(options.protocol, options.port, line))
            self._settings(options.address)
        except ValueError as error:
            raise UsageError(str(error)) from None

    def __enter__(self) -> Session:
        self._bus.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bus.close()

    def drive(self, address: int | None = None) -> Remote:
        """Return the drive at an address, or at the one that the options name; nothing is sent."""
        if address is None:
            address = self._options.address
        return Remote(self._bus, self._settings(address))

    def polled(self, address: int) -> None:
        """Take note that one round of reading a drive is over."""
        now = time.monotonic()
        before = self._polled_at.get(address, math.nan)
        self._polled_at[address] = now
        self._bus.call(lambda: self._bus.recorder.cycle(address, now - before))

    def statistics(self, address: int | None = None) -> Statistics:
        """Return the counters and times of the line, or of one drive on it."""

        async def ask() -> Statistics:
            # on the bus, behind what was noted before
            return self._bus.statistics(address)

        return self._bus.run(ask()).result()

    def command(self, listener: Listener, **settings: Any) -> Drive:
        """
        Return the drive that the options name as the driver has it; nothing is sent.

        :param settings: fields of ``DriveSettings`` that are not as usual.
        :raises UsageError: they make no sense.
        """
        try:
            return Drive(self._bus, self._settings(self._options.address, **settings), listener)
        except ValueError as error:
            raise UsageError(str(error)) from None

    def _settings(self, address: int, **others: Any) -> DriveSettings:
        options = self._options
        usual: dict[str, Any] = {
            'address': address,
            'model': options.model,
            'control_method': 'mode_scmd' if self._writes else 'monitor',
            'retries': options.retries,
            'allow_communication_changes': getattr(options, 'allow_communication_changes', False),
        }
        return DriveSettings(**{**usual, **others})
