# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0


"""A drive on a bus, with the simulated one at the far end, and the laws of the house on top."""

from __future__ import annotations

from collections.abc import Callable, Collection
import dataclasses
import json
import math
from pathlib import Path
import threading
import time
from typing import Any

import pytest
from support import trace_laws
from support.addresses import Words, words_of
from support.said import Said, said, says
from support.variants import hardest

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.catalog import Fact, Meaning
from nfo_sinus_driver.drive import (
    Cause,
    Drive,
    DriveError,
    DriveSettings,
    Event,
    LogEntry,
    Severity,
    Snapshot,
    Telemetry,
)
from nfo_sinus_driver.drive.settings import DRIVE_TIMEOUT_MARGIN
from nfo_sinus_driver.link import PROTOCOLS, Address, LineSettings, Link, Reply, open_link
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.simulator import Simulator

#: No honest wait takes this long, on any machine, s.
PATIENCE = 90.0
#: s; see :func:`patient`.
_LOST_AFTER = 10.0
BAUD = 57600
#: How often a drive is polled, and told a set-point, where a test does not say it, Hz. As fast as
#: a line that is not paced allows takes a whole processor, of which other tests then have less.
MODEST = 50.0
ACKNOWLEDGES = 'reads the status that acknowledges'
SCMD = 0x298
MODE = 0x294
RUN = 0x101
#: Fast ramps: nobody wants to wait for a motor.
QUICK = {'control.accel': 0.2, 'control.retard': 0.2}
#: How a stop is answered: whether it is asked for before such a ramp is over is luck.
STOPPING_OR_STOPPED = ('stopping: it ramps down', 'stopped (')


def patient(drive_timeout: float) -> float:
    """
    Return a ``lost_after`` for a machine on which the simulated drive may be kept waiting, s.

    Longer than a response time-out, so that one request without an answer loses no drive.
    """
    return min(_LOST_AFTER, drive_timeout - DRIVE_TIMEOUT_MARGIN) if drive_timeout else _LOST_AFTER


def wait_until(condition: Callable[[], object], timeout: float = PATIENCE) -> None:
    """Wait until a condition holds; fail when it does not in time."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, 'it never came true'
        time.sleep(0.002)


class Notes:
    """A listener that keeps what it is told."""

    def __init__(self) -> None:
        self.snapshots: list[Snapshot] = []
        self.telemetry: list[Telemetry] = []
        self.events: list[tuple[Severity, Said]] = []
        self.news: list[str] = []
        self.entries: list[LogEntry] = []

    def on_snapshot(self, snapshot: Snapshot) -> None:
        self.snapshots.append(snapshot)

    def on_telemetry(self, telemetry: Telemetry) -> None:
        self.telemetry.append(telemetry)

    def on_parameters(self, keys: Collection[str]) -> None:
        self.news += keys

    def on_log_entry(self, entry: LogEntry) -> None:
        self.entries.append(entry)

    def on_event(self, event: Event) -> None:
        self.events.append((event.severity, said(event)))

    def told(self, what: str | Cause, severity: Severity | None = None) -> bool:
        """Whether an event says this."""
        return any(says(text, what) for grave, text in self.events if severity in (None, grave))

    def wait_for(self, what: str | Cause, severity: Severity | None = None) -> None:
        """Wait until an event says this: it may be told after what it is about is seen."""
        deadline = time.monotonic() + PATIENCE
        while not self.told(what, severity):
            assert time.monotonic() < deadline, f'not told: {what}; but {self.events}'
            time.sleep(0.002)


class Tap:
    """A link with somebody who sees every transaction just before it is sent."""

    protocol = PROTOCOLS['modbus_rtu']

    def __init__(self, link: Link) -> None:
        self._link = link
        self.before: Callable[[int, Words | None], None] = lambda register, words: None
        self.open = link.open
        self.close = link.close
        self.parts = link.parts
        self.use_resync_reads = link.use_resync_reads
        self.identify = link.identify
        self.supervision = link.supervision
        self.remarks = link.remarks

    def read(self, unit: int, address: Address) -> Reply:
        self.before(address.index, None)
        return self._link.read(unit, address)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        self.before(address.index, words_of(data))
        return self._link.write(unit, address, data)

    def write_and_read(
        self, unit: int, address: Address, data: bytes, source: Address
    ) -> Reply:
        self.before(address.index, words_of(data))
        return self._link.write_and_read(unit, address, data, source)

    def read_then_write(
        self, unit: int, source: Address, address: Address, data: bytes
    ) -> Reply:
        self.before(source.index, None)
        self.before(address.index, words_of(data))
        return self._link.read_then_write(unit, source, address, data)


class Rig:
    """
    A simulated drive, a bus and a drive on it.

    :ivar far: the simulated drive; hold ``simulator.lock`` to touch it.
    :ivar acknowledged: how often the test itself has a fault acknowledged.
    """

    def __init__(
        self,
        trace: Path,
        settings: DriveSettings,
        parameters: dict[str, Any],
        response_timeout: float,
        **options: Any,
    ) -> None:
        self._trace = trace
        options = {'boot_time': 0.2, **hardest(settings.model), **options}
        self.simulator = Simulator(
            baud=BAUD,
            trace=str(trace),
            settings={**QUICK, **parameters},
            model=settings.model,
            **options,
        )
        self.line = LineSettings(baud_rate=BAUD, response_timeout=response_timeout)
        self._link = open_link('modbus_rtu', self.simulator.port, self.line)
        self.tap = Tap(self._link)
        self.notes = Notes()
        self.bus = Bus(self.tap)
        self.drive = Drive(self.bus, settings, self.notes)
        self.acknowledged = 0
        self._publishing = threading.Event()
        self._publisher: threading.Thread | None = None
        self.published = 0

    def start(self) -> None:
        self.simulator.start()
        self.bus.start()

    def stop(self) -> None:
        self.stop_publishing()
        self.bus.close()
        assert not self.bus.alive
        assert self.simulator.failure is None
        self.simulator.stop()
        self.check_laws()

    def check_laws(self) -> None:
        """Judge everything that was on the line, but for its times: the machine may be slow."""
        model = self.drive.settings.model
        found = trace_laws.violations(self.trace(), -math.inf, model)
        acknowledged = [complaint for complaint in found if ACKNOWLEDGES in complaint]
        others = [complaint for complaint in found if ACKNOWLEDGES not in complaint]
        assert not others, others
        assert len(acknowledged) <= self.acknowledged, acknowledged
        # a mistake, be it of a test that replaces a part of the driver, may pass for a lost drive
        assert not self.notes.told(Cause.DRIVER_ERROR), self.notes.events

    def trace(self) -> list[dict[str, Any]]:
        """Every frame on the line so far, as the simulator saw it."""
        lines = self._trace.read_text(encoding='utf-8').splitlines(keepends=True)
        return [json.loads(line) for line in lines if line.endswith('\n')]

    def writes(self, register: int) -> list[int]:
        """What was written to a register of one word, in order."""
        data = self.requests
        return [
            int.from_bytes(frame[4:6], 'big')
            for frame in data
            if frame[1] == 6 and int.from_bytes(frame[2:4], 'big') == register
        ]

    def set_response_timeout(self, seconds: float) -> None:
        """
        Let the driver wait so long for an answer from now on.

        Short times are only for what will not be answered: the machine may be slow.
        """
        done = threading.Event()

        def change() -> None:
            self._link._settings = dataclasses.replace(self.line, response_timeout=seconds)
            done.set()

        self.bus.call(change)
        assert done.wait(PATIENCE)

    # --- the driver's side ---

    def connect(self) -> str:
        """Connect and activate."""
        identity = self.drive.connect().result(PATIENCE)
        self.drive.activate()
        return str(identity)

    def enable(self) -> str:
        """Enable, as soon as no stop is on its way any more."""
        wait_until(lambda: not self.drive.stop_unconfirmed)
        return said(self.drive.enable().result(PATIENCE))

    def refused(self, future: Any) -> Said:
        """The message with which a command fails."""
        with pytest.raises(DriveError) as error:
            future.result(PATIENCE)
        return said(error.value)

    def answer(self, future: Any) -> Said:
        """What a command answers, done or not."""
        try:
            return said(future.result(PATIENCE))
        except DriveError as error:
            return said(error)

    def publish(self, value: float, period: float = 1 / MODEST) -> None:
        """Send a set-point again and again, as a program of a user does."""
        self.stop_publishing()
        self._publishing.set()

        def work() -> None:
            while self._publishing.is_set():
                self.drive.set_setpoint(value)
                self.published += 1
                time.sleep(period)

        self._publisher = threading.Thread(target=work, daemon=True)
        self._publisher.start()

    def stop_publishing(self) -> None:
        self._publishing.clear()
        if self._publisher is not None:
            self._publisher.join()
            self._publisher = None

    def next_snapshots(self, count: int = 3) -> None:
        """Wait for some more polls."""
        before = len(self.notes.snapshots)
        wait_until(lambda: len(self.notes.snapshots) >= before + count)

    # --- the drive's side ---

    @property
    def far(self) -> SimulatedDrive:
        return self.simulator.drives[1]

    def skip(self, seconds: float) -> None:
        """Let time pass in the drive, at once, in which nobody speaks to it."""
        with self.simulator.lock:
            self.far.advance(seconds)
            assert self.far._origin is not None
            self.far._origin -= seconds

    def boot(self) -> None:
        """End the silence of a drive that was switched off and on."""
        with self.simulator.lock:
            assert not self.far.listening
            self.far._boot_left = 0.01
        wait_until(lambda: self.far.listening)

    def turn(self, frequency: float = 20.0) -> None:
        """Connect, enable and turn, with a program that keeps on sending the set-point."""
        self.connect()
        self.enable()
        self.publish(frequency)
        self.wait_for_frequency(frequency)
        self.wait_until_it_shows()

    def wait_until_it_shows(self) -> None:
        """
        Wait until a poll tells of a motor that turns steadily.

        Until then the driver has seen no more than a drive that takes its command, or one that a
        short ramp has brought to its current limit, whose code hides who has control.
        """

        steady = time.monotonic()

        def shown(told: Snapshot) -> bool:
            status = told.status
            return (
                told.at > steady
                and told.enabled
                and status is not None
                and not status.means(Meaning.CURRENT_LIMIT)
                and Fact.LIMIT_ACTIVE not in status.facts
            )

        wait_until(lambda: self.notes.snapshots and shown(self.notes.snapshots[-1]))

    @property
    def requests(self) -> list[bytes]:
        """All requests so far."""
        sent = (frame for frame in self.trace() if frame['direction'] == 'request')
        return [bytes.fromhex(frame['hex']) for frame in sent]

    @property
    def functions(self) -> set[int]:
        """Their functions."""
        return {request[1] for request in self.requests}

    def refuse(self, monkeypatch: pytest.MonkeyPatch, key: str, only: int | None = None) -> None:
        """Let the simulated drive refuse to have a parameter written."""
        write = self.far.write_raw

        def write_raw(written: str, raw: int) -> None:
            if written == key and only in (None, raw):
                raise Refused(Reason.STATE, 'as the test wants it')
            write(written, raw)

        monkeypatch.setattr(self.far, 'write_raw', write_raw)

    def wait_for_frequency(self, frequency: float) -> None:
        wait_until(lambda: abs(self.far.motor.frequency - frequency) < 0.2)

    def wait_until_still(self) -> None:
        """Wait until the output stage is off."""
        wait_until(lambda: not self.far.motor.driven)

    def assert_stays_still(self) -> None:
        """Nothing turns although set-points keep arriving, and nobody tells it to."""
        self.wait_until_still()
        assert self._publisher is not None
        runs = self.writes(SCMD).count(RUN)
        published, polls = self.published, len(self.notes.snapshots)
        wait_until(
            lambda: self.far.motor.driven
            or (self.published >= published + 20 and len(self.notes.snapshots) >= polls + 5)
        )
        assert not self.far.motor.driven
        assert not self.drive.armed
        assert self.writes(SCMD).count(RUN) == runs


MakeRig = Callable[..., Rig]
