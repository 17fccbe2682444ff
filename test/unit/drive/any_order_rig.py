# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A drive, its bus and the simulated drive in virtual time: one thread, nothing waits, all repeats.

The link hands each request to the simulated drive at once and lets the clock go on by the times of
the frames; the bus is stepped in place of its worker. So a minute of a drive takes a fraction of a
second, and the same history always goes the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from concurrent.futures import Future
import contextlib
import functools
from random import Random
import struct
from typing import Any

from support.addresses import Words, packed, words_of
from support.said import Said, said
from support.wire import crc

from nfo_sinus_driver.bus import Bus
from nfo_sinus_driver.drive import (
    Drive,
    DriveSettings,
    Event,
    LogEntry,
    Severity,
    Snapshot,
    Telemetry,
)
from nfo_sinus_driver.drive.control_state import ControlState
from nfo_sinus_driver.link import (
    PROTOCOLS,
    Address,
    DamagedAnswer,
    Identification,
    NoAnswer,
    NotReady,
    PortError,
    Refused,
    Remarks,
    Reply,
)
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Refused as FarRefusal
from nfo_sinus_driver.simulator.modbus import server

#: One byte at 57600 8E1, the silence between frames, and what the drive takes to answer, s.
_CHARACTER = 11 / 57600
_GAP = 0.00175
_TURNAROUND = 0.001
RESPONSE_TIMEOUT = 0.1
#: How late an answer may come before it counts as lost, s.
_LATEST = RESPONSE_TIMEOUT
#: The longest step in which nothing is looked at, s.
_SLICE = 0.02
#: How often a program sends its set-point, s.
_SENDING_PERIOD = 0.1


@functools.lru_cache(maxsize=4096)
def _framed(request: bytes) -> bytes:
    """Return the frame of a request; most are sent again and again."""
    return request + crc(request).to_bytes(2, 'little')


class Clock:
    """The steady clock of everything in the rig."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now


class Notes:
    """A listener that keeps what the laws need."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self.snapshot: Snapshot | None = None
        self.events: list[tuple[float, Severity, Said]] = []

    def on_snapshot(self, snapshot: Snapshot) -> None:
        self.snapshot = snapshot

    def on_telemetry(self, telemetry: Telemetry) -> None:
        pass

    def on_parameters(self, keys: Collection[str]) -> None:
        pass

    def on_log_entry(self, entry: LogEntry) -> None:
        pass

    def on_event(self, event: Event) -> None:
        self.events.append((self._clock.now, event.severity, said(event)))


class _Told:
    """Questions of which none is left."""

    done = True
    found = Identification()

    def ask(self) -> Reply:
        raise AssertionError


class FaultyLine:
    """
    What is wrong with the line to one simulated drive.

    :ivar state: ``whole``; ``silent``: nobody hears; ``deaf``: carried out, but no answer comes;
        ``noise``: carried out, the answer is damaged; ``late``: it comes when nobody waits for it
        any more; ``gone``: the port is.
    :ivar losses: how many answers are still lost although the line is whole.
    :ivar unheard: how many requests are.
    :ivar noise: the share of the answers that are damaged or lost, by chance.
    :ivar doubled: how many answers come twice yet: each spoils the next.
    :ivar frames: every request, for :mod:`support.trace_laws`.
    :ivar asked_at: when the last one went out.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self.state = 'whole'
        self.losses = self.unheard = self.doubled = 0
        self.noise = 0.0
        self._random = Random(0)
        self.frames: list[dict[str, Any]] = []
        self.asked_at = rig.clock.now

    @property
    def whole(self) -> bool:
        return self.passes and not self.noise

    @property
    def passes(self) -> bool:
        """Whether requests are carried out and answers come, but for some by chance."""
        return self.state == 'whole' and not (self.losses or self.unheard or self.doubled)

    def make_noise(self, share: float, seed: int) -> None:
        """Damage or lose this share of the answers from now on."""
        self.noise = share
        self._random = Random(seed)

    def mend(self) -> None:
        """End all that is wrong with the line."""
        self.state = 'whole'
        self.noise = 0.0
        self.losses = self.unheard = self.doubled = 0

    def _begin_request(self, frame: bytes) -> None:
        """Take note of a request that goes out."""
        self.asked_at = self._rig.clock.now
        self.frames.append({'direction': 'request', 'gap': 0.0, 'hex': frame.hex()})

    def _is_heard(self) -> bool:
        """Tell whether the drive hears a request."""
        if self.unheard or self.state == 'silent' or not self._rig.far.listening:
            self.unheard -= self.unheard > 0
            return False
        self._rig.far.heard()
        return True

    def _require_port(self) -> None:
        if self.state == 'gone':
            raise PortError('the port is gone')


class DirectLink(FaultyLine):
    """The line, without frames: what is asked is done at once, and the clock goes on."""

    protocol = PROTOCOLS['modbus_rtu']
    remarks = Remarks()
    supervision = None

    def __init__(self, rig: Rig) -> None:
        super().__init__(rig)
        self._not_ready_until = 0.0

    def open(self) -> None:
        self._require_port()

    def close(self) -> None:
        pass

    def parts(self, address: Address) -> tuple[Address]:
        return (address,)

    def use_resync_reads(self, unit: int, addresses: Sequence[Address]) -> None:
        pass

    def identify(self, unit: int) -> _Told:
        return _Told()

    def read(self, unit: int, address: Address) -> Reply:
        if self._rig.clock.now < self._not_ready_until:
            raise NotReady(self._not_ready_until)
        register, count = address.index, address.size // 2
        request = struct.pack('>BBHH', unit, 3, register, count)
        words = self._exchange(
            request, 5 + 2 * count, lambda far: server(far).read(register, count)
        )
        return Reply(packed(*words), self._rig.clock.now)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        register, words = address.index, words_of(data)
        if len(words) == 1:
            request = struct.pack('>BBHH', unit, 6, register, words[0])
        else:
            request = struct.pack('>BBHHB', unit, 16, register, len(words), len(data)) + data

        def carry_out(far: SimulatedDrive) -> Words:
            server(far).write(register, words)
            return ()

        self._rig.judge(lambda: self._rig.wrote(register, words))
        self._exchange(request, 8, carry_out)
        return Reply(b'', self._rig.clock.now)

    def write_and_read(
        self, unit: int, address: Address, data: bytes, source: Address
    ) -> Reply:
        register, count, words = address.index, source.size // 2, words_of(data)
        where = (source.index, count, register, len(words))
        request = struct.pack('>BB4HB', unit, 23, *where, len(data)) + data
        self._rig.judge(lambda: self._rig.wrote(register, words))
        told = self._exchange(
            request,
            5 + 2 * count,
            lambda far: server(far).write_and_read(register, words, source.index, count),
        )
        return Reply(packed(*told), self._rig.clock.now)

    def read_then_write(
        self, unit: int, source: Address, address: Address, data: bytes
    ) -> Reply:
        with contextlib.suppress(NoAnswer, DamagedAnswer, Refused, NotReady):
            self.read(unit, source)
        return self.write(unit, address, data)

    def _exchange(
        self, request: bytes, length: int, carry_out: Callable[[SimulatedDrive], Words]
    ) -> Words:
        rig = self._rig
        self._require_port()
        self._begin_request(_framed(request))
        rig.elapse(_GAP + (len(request) + 2) * _CHARACTER)
        if not self._is_heard():
            rig.elapse(RESPONSE_TIMEOUT)
            raise NoAnswer('nobody answers')
        refusal = None
        try:
            words = carry_out(rig.far)
        except FarRefusal as error:
            words, length, refusal = (), 5, error
        if not self.passes:
            self._lose_answer()
        if self.noise and self._random.random() < self.noise:
            self._spoil_answer()
        # the drive catches up when it is looked at next
        rig.clock.now += _TURNAROUND + length * _CHARACTER
        if refusal is not None:
            raise Refused(int(refusal.reason))
        return words

    def _spoil_answer(self) -> None:
        """Damage an answer or lose it, one as likely as the other."""
        self._rig.elapse(RESPONSE_TIMEOUT)
        if self._random.random() < 0.5:
            raise DamagedAnswer('what came is no answer')
        raise NoAnswer('nobody answers')

    def _lose_answer(self) -> None:
        if self.doubled:
            self.doubled -= 1
            raise DamagedAnswer('an answer came twice')
        self.losses -= self.losses > 0
        self._rig.elapse(RESPONSE_TIMEOUT)
        if self.state == 'noise':
            raise DamagedAnswer('what came is no answer')
        if self.state == 'late':
            self._not_ready_until = self._rig.clock.now + _LATEST
        raise NoAnswer('nobody answers')


class Rig:
    """
    The driver of one drive, and the drive.

    :param far: the simulated drive.
    :param link: makes the line between them.
    :ivar looked: called whenever something may have happened.
    :ivar changed: whether something else has happened since that a look would judge.
    :ivar wrote: called with each write, register and words, before it is sent.
    """

    def __init__(
        self,
        far: SimulatedDrive,
        settings: DriveSettings,
        link: Callable[[Rig], Any] = DirectLink,
    ) -> None:
        self.clock = Clock()
        self.far = far
        self.far.step = _SLICE
        self.far.advance_to(self.clock.now)
        self.settings = settings
        self.looked: Callable[[], None] = lambda: None
        self.changed: Callable[[], bool] = lambda: True
        self.wrote: Callable[[int, Words], None] = lambda register, words: None
        self.link = link(self)
        self._broken: AssertionError | None = None
        self._sent: float | None = None
        self._send_at = 0.0
        self.begin()

    def begin(self) -> None:
        """Start a driver."""
        self.notes = Notes(self.clock)
        self.bus = Bus(self.link, now=self.clock.monotonic)
        self.drive = Drive(self.bus, self.settings, self.notes)

    def kill(self) -> None:
        """End the driver without a word to the drive, as a power cut of the computer does."""
        self.bus.close()

    def close(self) -> None:
        self.kill()

    def send(self, value: float | None) -> None:
        """Let a program send a set-point again and again from now on; ``None``: it ends."""
        self._sent = value
        self._send_at = self.clock.now

    def pass_time(self, seconds: float) -> None:
        """Let time pass for all."""
        end = self.clock.now + seconds
        self.judge(self.looked)
        while self.clock.now < end:
            if self._sent is not None and self.clock.now >= self._send_at:
                self._send_at = self.clock.now + _SENDING_PERIOD
                self.drive.set_setpoint(self._sent)
                self.gave(self._sent)
            before = self._shown
            until = min(self.bus.step(), end, self.clock.now + _SLICE)
            if self._shown != before or self.changed():
                self.judge(self.looked)
            self._require_consistent()
            if self._broken is not None:
                raise self._broken
            if until > self.clock.now:
                self.elapse(until - self.clock.now)

    def _require_consistent(self) -> None:
        """See to it that the state of control says what there is of a stop, and who is followed."""
        controller = self.drive._controller
        if controller is None:
            return
        state, stopping = controller.state, controller.stopping
        if state in (ControlState.STOPPING, ControlState.BLOCKED):
            assert stopping, f'{state.name}, and nothing stops it'
        elif state not in (ControlState.PROCEDURE, ControlState.ABORTING, ControlState.CLOSED):
            assert not stopping, f'{state.name}, and a stop is on its way'
        assert self.drive.armed == (state is ControlState.ENABLED)

    @property
    def _shown(self) -> tuple[object, ...]:
        """All that a step of the bus may change beside what :attr:`changed` tells."""
        notes = self.notes
        return self.clock.now, len(self.link.frames), id(notes.snapshot), len(notes.events)

    def gave(self, value: float) -> None:
        """Take note of a set-point that was given; whoever wants to know puts himself here."""

    def answer(self, future: Future[Any], patience: float = 60.0) -> Said:
        """Let time pass until a command is answered; return what it says, done or not."""
        end = self.clock.now + patience
        while not future.done():
            assert self.clock.now < end, 'no answer'
            self.pass_time(_SLICE)
        return said(future.exception() or future.result())

    def elapse(self, seconds: float) -> None:
        """Let time pass while the driver waits."""
        self.clock.now += seconds
        self.far.advance_to(self.clock.now)
        self.judge(self.looked)

    def judge(self, look: Callable[[], None]) -> None:
        """Keep what a look complains of until it can be raised: a driver survives everything."""
        try:
            look()
        except AssertionError as complaint:
            self._broken = self._broken or complaint
