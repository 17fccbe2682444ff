# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Made-up drives at the other end of a line: registers behind what the bus knows as a link."""

from __future__ import annotations

from collections.abc import Sequence
import math
import struct
from typing import Any

from support.rig import Rig

from nfo_sinus_driver.drive.detect import detect_model
from nfo_sinus_driver.link import (
    PROTOCOLS,
    Address,
    Identification,
    LinkError,
    Plan,
    Refused,
    Remarks,
    Reply,
    Why,
)
from nfo_sinus_driver.link.pauses import Pauses
from nfo_sinus_driver.link.thread_clock import ThreadClock

#: How long an access takes, s.
_ACCESS = 0.002


class FarEnd:
    """The registers of a drive; it refuses what it does not have."""

    protocol = PROTOCOLS['modbus_rtu']
    remarks = Remarks()
    supervision = None
    place = ''
    last_byte_at = -math.inf
    write_and_read = read_then_write = None
    rig: MadeUpRig

    def __init__(self, registers: dict[int, int]) -> None:
        self.clock = ThreadClock(lambda: self.rig.clock.now)
        self.pauses = Pauses(lambda text: None, lambda: -math.inf)
        self.registers = registers
        #: What becomes of the next access to a register.
        self.fates: dict[int, LinkError] = {}
        #: Register and word of all that was written, in order; the registers read, likewise.
        self.writes: list[tuple[int, int]] = []
        self.reads: list[int] = []

    def wait_at_most(self, seconds: float) -> None:
        pass

    def end_listening_if(self, stop_waits: Any) -> None:
        pass

    def answers_twice(self, unit: int) -> bool:
        return False

    def was_read(self, number: int) -> None:
        """Do what time has brought; a drive may have more to do."""

    def was_written(self, before: dict[int, int]) -> None:
        """
        Do what was written; a drive may have more to do.

        :param before: the registers as they were.
        """

    # --- the link, as the bus has it ---

    def open(self) -> None:
        """Nothing has to be opened."""

    def close(self) -> None:
        """Nothing has to be closed."""

    def use_resync_reads(self, unit: int, addresses: Sequence[Address], why: Why = None) -> None:
        """Nothing is ever in doubt."""

    def identify(self, unit: int) -> Plan[Identification]:
        """It does not tell who it is."""
        yield from ()
        return Identification()

    def read(self, unit: int, address: Address, once: bool = False) -> Reply:
        numbers = self._numbers(address)
        self.reads.append(address.index)
        self.was_read(address.index)
        words = [self.registers[number] for number in numbers]
        return Reply(struct.pack(f'>{len(words)}H', *words), self.rig.clock.now)

    def write(self, unit: int, address: Address, data: bytes) -> Reply:
        numbers = self._numbers(address)
        words = struct.unpack(f'>{len(numbers)}H', data)
        before = dict(self.registers)
        self.writes += zip(numbers, words, strict=True)
        self.registers.update(zip(numbers, words, strict=True))
        self.was_written(before)
        return Reply(b'', self.rig.clock.now)

    def _numbers(self, address: Address) -> range:
        self.rig.line.go_to(self.rig.clock.now + _ACCESS)
        numbers = range(address.index, address.index + address.size // 2)
        if not all(number in self.registers for number in numbers):
            raise Refused(Refused.ILLEGAL_ADDRESS, 'there is no such register')
        if address.index in self.fates:
            raise self.fates.pop(address.index)
        return numbers


class MadeUpRig(Rig):
    """A driver of a made-up drive; the line with its simulated drive only has the clock."""

    def __init__(self, made_up: FarEnd, model: str, **settings: Any) -> None:
        self.made_up = made_up
        made_up.rig = self
        usual = {'control_method': '', 'setpoint_timeout': 0.0, 'model': model}
        super().__init__(**{**usual, **settings})

    def begin(self) -> None:
        self.line.link = lambda: self.made_up  # type: ignore[method-assign,assignment]
        super().begin()

    @property
    def found(self) -> Any:
        """The model that the driver takes it for."""
        return self.result(detect_model(self.bus, 1))
