# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Two masters ask one drive, whatever the other one asks: what answers it is never believed."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any

import pytest
from support.belief import Judge
from support.rig import Rig

from nfo_sinus_driver.drive import Cause
from nfo_sinus_driver.link.modbus import ascii, rtu
from nfo_sinus_driver.link.modbus.link import ReportSlaveId
from nfo_sinus_driver.link.modbus.pdu import Read, ReadInput, Write
from nfo_sinus_driver.link.pairs import classic

ENCODE: dict[str, Callable[[Any], bytes]] = {
    'rtu': rtu.encode, 'ascii': ascii.encode, 'classic': classic.encode,
}
#: Where no drive has anything; the first two begin as the length of an answer does.
NOWHERE = (0x0201, 0x0301, 0xEEE0)
#: Registers that are read by the first bytes of an answer of one, two and three registers; what the
#: driver reads itself, and what is beside it.
REGISTERS = (0x264, 0x24C, 0x2D0, 0x400, 0x401, 0x600, 3, 0x3F8, 0x258, *NOWHERE)
#: How long a drive hears nothing after its answer, s: less than the silence that a master keeps.
RECOVERY = {'rtu': 0.001, 'ascii': 0.001, 'classic': 0.0}


class Hub:
    """
    A hub between a drive and two masters; each hears what the other sends.

    :param requests: what the other one asks in turn, by chance.
    :param period: how often, s.
    :param deaf: for so long the drive hears nothing after a request, but for what ends by its
        answer, s.
    :param split: the other's frames come in two pieces, with such a pause between, s.
    :ivar false: what this end believes and the drive has not said to it.
    """

    def __init__(
        self,
        rig: Rig,
        connection: str,
        requests: list[Any],
        random: Random,
        *,
        period: float = 0.15,
        deaf: float = 0.1,
        split: float = 0.0,
    ) -> None:
        self.false = Judge(rig).false
        self._clock, self._line = rig.clock, rig.line
        self._frames = [ENCODE[connection](request) for request in requests]
        self._random = random
        self._period, self._deaf, self._split = period, deaf, split
        self._recovery = RECOVERY[connection]
        self._busy_until = -1.0
        wire = rig.line.wire
        self._receive, self._send = wire.receive, rig.line.send
        wire.receive, rig.line.send = self._take, self._answer  # type: ignore[method-assign]
        self._ask()

    def _take(self, frame: bytes, now: float) -> None:
        if now < self._busy_until:
            return
        if self._deaf:
            self._busy_until = now + self._deaf
        self._receive(frame, now)

    def _answer(self, data: bytes) -> None:
        self._busy_until = self._clock.now + self._recovery if self._deaf else -1.0
        self._send(data)

    def _ask(self) -> None:
        frame, now = self._random.choice(self._frames), self._clock.now
        if self._split:
            self._send(frame[:3])
            self._line.later(now + self._split, lambda: self._pass_on(frame[3:], frame))
        else:
            self._pass_on(frame, frame)
        self._line.later(now + self._period * self._random.uniform(0.5, 1.5), self._ask)

    def _pass_on(self, heard: bytes, frame: bytes) -> None:
        self._send(heard)
        self._take(frame, self._clock.now)


def two_masters(
    connection: str, requests: list[Any], random: Random, line: Any = None, **hub: Any
) -> tuple[Rig, Hub]:
    """Return a drive that turns at 20 Hz, and the hub at which another master asks it."""
    rig = Rig(connection, poll_rate=20.0, line=line)
    rig.turn()
    rig.notes.snapshots.clear()
    return rig, Hub(rig, connection, requests, random, **hub)


def any_requests(connection: str, random: Random) -> list[Any]:
    """Return up to four requests that change nothing in the drive."""

    def any_request() -> Any:
        register = random.choice([*REGISTERS, random.randrange(0x10000)])
        if connection == 'classic':
            return classic.Enquiry(1, random.choice([0x1E, 0xB6, 0xE9, register]))
        nowhere = random.choice(NOWHERE)
        return random.choice([
            *4 * [Read(1, register, 1)], Read(1, register, 2), Read(1, register, 3),
            ReadInput(1, register, 1), Write(1, nowhere, b'\0\1'), Write(1, nowhere, b'\0\1\0\2'),
            ReportSlaveId(1),
        ])

    return [any_request() for _ in range(random.randrange(1, 5))]


@pytest.mark.parametrize('seed', range(24))
@pytest.mark.parametrize('connection', ENCODE)
def test_nothing_is_believed_that_the_drive_has_not_said_to_us(connection: str, seed: int) -> None:
    random = Random(seed)
    rig, hub = two_masters(
        connection, any_requests(connection, random), random,
        line={'turnaround': random.choice([0.002, 0.002, 0.02, 0.05])},
        period=random.choice([0.1, 0.15, 0.3]),
        deaf=random.choice([0.1, 0.1, 0.0]),
        split=random.choice([0.0, 0.0, 0.003]),
    )
    rig.pass_time(20.0)
    assert not hub.false
    assert not rig.notes.said(Cause.CHANGED_AT_DRIVE)
    rig.kill()


@pytest.mark.parametrize('registers', [(0x400, 0x264), (0x401, 0x2D0), (0x24C, 3), (0x3F8,)])
@pytest.mark.parametrize('connection', ['rtu', 'ascii'])
def test_readings_go_on_and_commands_do_what_they_say(
    connection: str, registers: tuple[int, ...]
) -> None:
    random = Random(7)
    rig, hub = two_masters(connection, [Read(1, register, 1) for register in registers], random)
    rig.pass_time(20.0)
    shown = [snapshot for snapshot in rig.notes.snapshots if abs(snapshot.frequency - 20) < 0.3]
    assert len(shown) > (200 if connection == 'rtu' else 50)
    assert all(
        snapshot.enabled and abs(snapshot.actual - 20) < 0.3 for snapshot in rig.notes.snapshots
    )
    rig.send(None)
    enabled = 0
    for _ in range(6):
        assert 'stop' in rig.answer(rig.drive.stop())
        rig.wait_until(lambda: not rig.turns, 0.5)
        answer = rig.answer(rig.drive.enable())
        assert 'exception' not in answer
        enabled += 'enabled' in answer
    assert enabled >= 3
    assert not hub.false
    rig.kill()


@pytest.mark.parametrize('delay', range(0, 160, 40))
@pytest.mark.parametrize('connection', ENCODE)
def test_a_stop_is_not_held_back(connection: str, delay: int) -> None:
    request = classic.Enquiry(1, 0xE9) if connection == 'classic' else Read(1, 0x264, 1)
    rig, _ = two_masters(connection, [request], Random(delay))
    rig.pass_time(2.0 + delay / 1000)
    called = rig.clock.now
    stop = rig.drive.stop()
    # what was asked before it, and the answer to the other one, end first
    rig.wait_until(lambda: rig.line.sent_at > called, 0.35)
    rig.wait_until(lambda: not rig.turns, 3.0)
    rig.answer(stop)
    rig.kill()
