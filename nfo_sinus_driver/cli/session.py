# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""The line, open, and the drives on it; a drive is only read unless it is to be written."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Collection, Coroutine, Mapping
from dataclasses import replace
import math
import time
from typing import Any, TypeVar

from nfo_sinus_driver.bus import Bus, Statistics
from nfo_sinus_driver.catalog import Value, load_profile
from nfo_sinus_driver.cli.console import (
    CliError,
    UsageError,
    progress,
    remark,
    require_yes,
    say,
)
from nfo_sinus_driver.drive import (
    Cause,
    Drive,
    DriveError,
    DriveSettings,
    Event,
    Identity,
    InverterStatus,
    Listener,
    LogEntry,
    Report,
    Severity,
)
from nfo_sinus_driver.drive.known.diagnosis import ended
from nfo_sinus_driver.drive.known.settings import MONITOR
from nfo_sinus_driver.link import BusSettings, Refused
from nfo_sinus_driver.state_folder import StateFolder

_T = TypeVar('_T')


class OfflineDrive(Listener):
    """
    A drive that is read, and its settings written, without the connection that commands it.

    Connecting removes a run command; this does not, so that a motor that runs runs on. What takes
    time raises :class:`DriveError` when it fails.
    """

    def __init__(self, bus: Bus, settings: DriveSettings) -> None:
        self._drive = drive = Drive(bus, settings, self)
        self.address = settings.address
        self.model = drive.model
        self.params = drive.params
        self.state = drive.state
        self.parameters = drive.parameters
        self._step: Callable[[], None] = lambda: None

    def __str__(self) -> str:
        return f'the drive at address {self.address}'

    def do(self, command: Callable[[], Coroutine[Any, Any, _T]]) -> _T:
        """Run a coroutine on the bus and return its result."""
        return self._drive.run(command).result()

    def identify(self, *, thoroughly: bool = True) -> Identity:
        """Find out what answers, thoroughly with model and serial number."""
        try:
            return self._drive.identify(thoroughly=thoroughly).result()
        except DriveError as error:
            if not isinstance(error.__cause__, Refused):
                raise
            model, why = self.model.name, error.report
            other = Report(Cause.NOT_THE_MODEL, drive=str(self), model=model, why=why)
            raise DriveError(other) from error.__cause__

    @property
    def identifies(self) -> bool:
        """Something tells its model from others that have all the registers which are read."""
        return self._drive.identifies

    def read_status(self) -> InverterStatus:
        """Read the status, without acknowledging anything."""
        return self._drive.read_status().result()

    def read(self, only: Collection[str] | None = None) -> Mapping[str, Value]:
        """Read the settings of the drive, or some of them, and return those that it has."""
        keys = self.parameters.available(only)
        if not self.model.settings:
            raise CliError(f'of a {self.model.name} no settings are known')
        with progress(f'reading {self}', len(keys)) as self._step:
            self.parameters.read(only).result()
        return self.parameters.values

    def error_log(self, most: int) -> tuple[LogEntry, ...]:
        """Read the error log, newest entry first; at most so many entries, 0: all."""
        return self.do(lambda: self._drive.log.read_now(most))

    def active_control_method(self) -> str:
        """Return the control method by which the bus runs it, or would be able to stop it."""
        return self._drive.active_control_method().result()

    def measure(self, key: str) -> Value:
        """Read one value."""
        return self._drive.measure(key).result()

    def on_event(self, event: Event) -> None:
        """Report what an operator has to know."""
        if event.severity is not Severity.INFO or event.report.cause is Cause.NO_MAILBOX:
            remark(say(event.report))

    def on_parameters(self, keys: Collection[str]) -> None:
        """Count those that were read."""
        for _ in keys:
            self._step()


class Session:
    """
    The line that the options name, open in a ``with`` block; only read without ``writes``.

    It begins with a question where the first request takes control of a drive.
    """

    def __init__(self, options: argparse.Namespace, *, writes: bool = False) -> None:
        self._options = options
        self._writes = writes
        #: When the last round of reading each drive was over, s.
        self._polled_at: dict[int, float] = {}
        try:
            link = BusSettings(
                options.port,
                options.protocol,
                options.baud_rate,
                options.char_format,
                options.response_timeout,
                trace=options.trace,
            ).open()
            self._bus = Bus(link, link.protocol.most_requests)
            self._memory = StateFolder(options.port)
            self._settings(options.address).require_line(link.protocol)
        except ValueError as error:
            raise UsageError(str(error)) from None
        if not options.may_take_control:
            profile = load_profile(options.model)
            if why := profile.holds_control.get(link.protocol.addressing):
                stops = f'{why}: a motor that the terminals run stops'
                require_yes(options, f'{stops[0].upper()}{stops[1:]}. Go on?')
            options.may_take_control = True

    def __enter__(self) -> Session:
        self._bus.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bus.close()
        for text in self._bus.remarks:
            remark(text)

    def drive(self, address: int | None = None) -> OfflineDrive:
        """Return the drive at an address, or at the one that the options name; nothing is sent."""
        given = self._options.address if address is None else address
        return OfflineDrive(self._bus, self._settings(given))

    def commanded_drive(self, listener: Listener, **settings: Any) -> Drive:
        """Return the drive that the options name, to be commanded; nothing is sent."""
        try:
            wanted = self._settings(self._options.address, **settings)
            return Drive(self._bus, wanted, listener, self._memory)
        except ValueError as error:
            raise UsageError(str(error)) from None

    def on_mute(self, call: Callable[[float], None]) -> None:
        """Call a function, on the worker of the bus, as :meth:`Bus.on_mute`."""
        self._bus.on_mute(call)

    def last_tries(self, seconds: float) -> None:
        """Say that the line is used for so long yet, s, as :meth:`Bus.last_tries`."""
        self._bus.call(lambda: self._bus.last_tries(seconds))

    def polled(self, address: int) -> None:
        """Record that one round of reading a drive is over."""
        now = time.monotonic()
        before = self._polled_at.get(address, math.nan)
        self._polled_at[address] = now
        self._bus.call(lambda: self._bus.recorder.cycle(address, now - before))

    def statistics(self, address: int | None = None) -> Statistics:
        """Return the counters and times of the line, or of one drive on it."""

        async def ask() -> Statistics:
            # on the bus, behind what was noted before
            return self._bus.statistics(address)

        return self._bus.run(ask(), ended).result()

    def _settings(self, address: int, **others: Any) -> DriveSettings:
        options = self._options
        usual: dict[str, Any] = {
            'address': address,
            'model': options.model,
            'family': options.family,
            'control_method': options.control_method,
            'block_address': options.block_address,
            'telegram_words': options.telegram_words,
            'retries': options.retries,
            'allow_communication_changes': getattr(options, 'allow_communication_changes', False),
        }
        settings = DriveSettings(**{**usual, **others})
        # a PLC is sent a request for each parameter that is read
        if self._writes or settings.method_class.addressing:
            return settings
        return replace(settings, control_method=MONITOR)
