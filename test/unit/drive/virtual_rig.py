# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A ride in virtual time, in which a test meets each request just before it is sent."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import any_order_rig
from framed_link import link_of
from support.addresses import Words, packed, words_of
from support.said import says
from support.variants import hardest, ramps
from support.wire import understand

from nfo_sinus_driver.catalog import load_family
from nfo_sinus_driver.drive import Cause, DriveSettings, Severity
from nfo_sinus_driver.link import Address, Refused, Reply
from nfo_sinus_driver.simulator.family import simulated_drive

#: What a drive takes to say that it is busy, s.
_BUSY_TIME = 0.004


class VirtualRig(any_order_rig.Rig):
    """
    The driver of one drive, and the drive, in virtual time.

    :ivar before: called with each request, register and words, ``None`` if it reads; what it
        raises is the answer.
    :ivar before_both: called with each that writes and reads (function 23), what it writes.
    """

    def __init__(
        self,
        parameters: dict[str, Any] | None = None,
        variant: Mapping[str, str] | None = None,
        **settings: Any,
    ) -> None:
        model = settings.setdefault('model', 'sinus_g2')
        method = next(iter(load_family(model).profile.methods))
        parameters = {**ramps(model, 0.3, 0.3), **(parameters or {})}
        settings = {'control_method': method, 'poll_rate': 20.0, **settings}
        options = hardest(model) if variant is None else variant
        far = simulated_drive(model, settings=parameters, **options)
        super().__init__(far, DriveSettings(**settings), link_of(far))
        self._protocol = self.link.protocol.name
        self.before: Callable[[int, Words | None], None] = lambda register, words: None
        self.before_both: Callable[[int, Words], None] = lambda *what: self.before(*what)
        read, write = self.link.read, self.link.write
        write_and_read = self.link.write_and_read

        def meet_read(unit: int, address: Address) -> Reply:
            self.before(address.index, None)
            return read(unit, address)

        def meet_write(unit: int, address: Address, data: bytes) -> Reply:
            self.before(address.index, words_of(data))
            return write(unit, address, data)

        def meet_write_and_read(
            unit: int, address: Address, data: bytes, source: Address
        ) -> Reply:
            self.before_both(address.index, words_of(data))
            return write_and_read(unit, address, data, source)

        self.link.read, self.link.write = meet_read, meet_write
        self.link.write_and_read = meet_write_and_read  # type: ignore[method-assign]

    def connect(self) -> str:
        """Connect and activate."""
        answer = self.answer(self.drive.connect())
        self.drive.activate()
        self.pass_time(0.2)
        return answer

    def ride(self, frequency: float = 20.0) -> None:
        """Connect, enable and turn, with a program that keeps on sending the set-point."""
        self.connect()
        assert 'enabled' in self.answer(self.drive.enable())
        self.send(frequency)
        self.pass_time(1.0)
        assert abs(self.far.motor.frequency - frequency) < 0.2
        self.notes.events.clear()

    def register(self, key: str) -> int:
        """Return where a parameter stands."""
        return self.drive.registers.address(key).index

    def be_busy(self, register: int, times: int = 1, *, writes: bool = False) -> None:
        """Have the drive say so many times that it is busy, to whoever reads or writes this."""
        left = [times]

        def meet(asked: int, words: Words | None) -> None:
            if left[0] and asked == register and (words is not None) == writes:
                left[0] -= 1
                self.elapse(_BUSY_TIME)
                raise Refused(Refused.BUSY)

        self.before = meet

    def written(self, register: int) -> list[int]:
        """Return what was written to a register, as one number each time, in order."""
        frames = [bytes.fromhex(one['hex']) for one in self.link.frames]
        requests = [understand(frame, self._protocol) for frame in frames]
        return [
            int.from_bytes(packed(*one.words), 'big')
            for one in requests
            if one is not None and one.words is not None and one.place == register
        ]

    def said(self, what: str | Cause, severity: Severity | None = None) -> bool:
        """Whether an event says this."""
        return any(
            says(text, what) for _, grave, text in self.notes.events if severity in (None, grave)
        )


MakeVirtual = Callable[..., VirtualRig]
