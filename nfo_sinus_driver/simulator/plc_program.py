# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The program of the PLC between ROS and the drives, the same as ``config/telegram1/`` has it.

What is shipped is Structured Text; a test runs both programs over the same cycles and compares what
they do. It knows no clock of its own: a PLC gives it the time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
import struct

#: How the registers of a block make its fields: words, and two signed numbers.
_LAYOUT = struct.Struct('>HhHHHHHHHhH')
#: Registers of a block, and the first of those that the driver writes.
REGISTERS, FIRST_WRITTEN = 11, 8
#: What the longer telegram of a drive has behind status word and actual value.
More = tuple[int, int, int]


@dataclass
class Block:
    """
    The registers that the driver and the PLC share, for one drive.

    :ivar zsw1: +0, status word 1 from the drive.
    :ivar actual: +1, its actual value.
    :ivar plc_life: +2, changes with every exchange with the drive.
    :ivar flags: +3, bit 0 the data are valid, bit 1 released to ROS, bit 2 +5 to +7 are valid.
    :ivar version: +4, of this layout.
    :ivar more1: +5, what the family's longer telegram reports beside; with the next two.
    :ivar more2: +6.
    :ivar more3: +7.
    :ivar stw1: +8, control word 1 from the driver.
    :ivar setpoint: +9, its set-point.
    :ivar ros_life: +10, changes while the driver lives.
    """

    zsw1: int = 0
    actual: int = 0
    plc_life: int = 0
    flags: int = 0
    version: int = 0
    more1: int = 0
    more2: int = 0
    more3: int = 0
    stw1: int = 0
    setpoint: int = 0
    ros_life: int = 0

    def registers(self) -> tuple[int, ...]:
        """Return the block as it stands in holding registers."""
        return struct.unpack(f'>{REGISTERS}H', _LAYOUT.pack(*vars(self).values()))

    def put(self, offset: int, words: tuple[int, ...]) -> None:
        """Set registers from ``offset`` on, as a Modbus master does."""
        registers = list(self.registers())
        registers[offset : offset + len(words)] = words
        data = struct.pack(f'>{REGISTERS}H', *registers)
        for one, value in zip(fields(self), _LAYOUT.unpack(data), strict=True):
            setattr(self, one.name, value)


class Ton:
    """
    The timer TON of IEC 61131-3: ``q`` once its input has been true for the preset time.

    :param clock: returns the time (s).
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._since: float | None = None
        self.q = False

    def __call__(self, input_: bool, preset: float) -> None:
        """Take the input, with the preset time (s)."""
        now = self._clock()
        if not input_:
            self._since = None
        elif self._since is None:
            self._since = now
        # a clock that counts fractions is never exactly at the preset
        self.q = self._since is not None and now - self._since >= preset - 1e-9


class RosTelegram1:
    """
    The function block ``FB_RosTelegram1``: one drive, called once in every cycle of the PLC.

    :param clock: returns the time (s).
    :param lost_clears: bits of STW1 that are cleared while ROS is lost or has no release.
    :param lost_sets: bits that are set then, without which the drive would not obey.
    :param ros_time: how long the driver's life counter may stand still (s).
    :param drive_time: how long no exchange with the drive may come (s).
    :param layout: of the block; only 2 shows ``more``.

    :ivar stw1: for the drive.
    :ivar setpoint: for the drive.
    :ivar ros_alive: the driver's life counter has moved within its time.
    """

    def __init__(
        self,
        clock: Callable[[], float],
        *,
        lost_clears: int = 0x0001,
        lost_sets: int = 0x0000,
        ros_time: float = 1.0,
        drive_time: float = 0.5,
        layout: int = 1,
    ) -> None:
        # VAR_INPUT with initial values
        self.lost_clears = lost_clears
        self.lost_sets = lost_sets
        self.ros_time = ros_time
        self.drive_time = drive_time
        self.layout = layout
        # VAR_OUTPUT
        self.stw1 = 0
        self.setpoint = 0
        self.ros_alive = False
        # VAR
        self.started = False
        self.seen_life = 0
        self.drive_heard = False
        self.new_flags = 0
        self.ros_still = Ton(clock)
        self.drive_silent = Ton(clock)

    def __call__(
        self,
        block: Block,
        zsw1: int,
        actual: int,
        exchanged: bool,
        release: bool,
        more: More | None = None,
    ) -> None:
        """
        Run once.

        :param block: the registers.
        :param zsw1: status word 1 from the drive.
        :param actual: its actual value.
        :param exchanged: both came from the drive since the last call.
        :param release: ROS may control the drive.
        :param more: three words that came with them; ``None``: its telegram has no more.
        """
        more_valid = more is not None
        more1, more2, more3 = more or (0, 0, 0)
        self.drive_silent(not exchanged, self.drive_time)
        if exchanged:
            block.zsw1 = zsw1
            block.actual = actual
            if self.layout == 2:
                block.more1 = more1
                block.more2 = more2
                block.more3 = more3
            self.drive_heard = True
            if block.plc_life == 65535:
                block.plc_life = 0
            else:
                block.plc_life = block.plc_life + 1
        elif self.drive_silent.q:
            self.drive_heard = False
        self.new_flags = 0x0000
        if self.drive_heard:
            self.new_flags = self.new_flags | 0x0001
        if release:
            self.new_flags = self.new_flags | 0x0002
        if self.drive_heard and more_valid and self.layout == 2:
            self.new_flags = self.new_flags | 0x0004
        block.flags = self.new_flags
        block.version = self.layout
        self.ros_still(block.ros_life == self.seen_life, self.ros_time)
        if not self.started:
            self.started = True
        elif block.ros_life != self.seen_life:
            self.ros_alive = True
        elif self.ros_still.q:
            self.ros_alive = False
        self.seen_life = block.ros_life
        if not (self.ros_alive and release):
            block.stw1 = (block.stw1 & ~self.lost_clears) | self.lost_sets
            block.setpoint = 0
        self.stw1 = block.stw1
        self.setpoint = block.setpoint
