# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
A PLC between a master on Modbus TCP and drives on its fieldbus, which speak telegram 1.

It runs the program of ``config/telegram1/`` in cycles, and exchanges telegrams with the drives in
another rhythm. Modbus requests come in between; the registers are there for them all the time,
whatever became of the drives. It is given the time, as everything here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
import random
from typing import Any

from nfo_sinus_driver.simulator import modbus, telegram1
from nfo_sinus_driver.simulator.drive import SimulatedDrive
from nfo_sinus_driver.simulator.memory import Reason, Refused
from nfo_sinus_driver.simulator.plc_records import Records
from nfo_sinus_driver.simulator.structured_text import load
from nfo_sinus_driver.simulator.timing import Timing

#: The name of the telegram in the tables of the families.
TELEGRAM = 'telegram1'
_UNITS = range(1, 248)
_LAST_REGISTER = 0xFFFF
#: How many registers a block has, by its layout, and the first of its mailbox.
_REGISTERS, _MAILBOX = {1: 11, 2: 28}, 16
_GAP = (0,) * (_MAILBOX - _REGISTERS[1])
#: Those that the driver writes.
_WORDS_OF_ROS, _REQUESTS_OF_ROS = frozenset(range(8, 11)), frozenset(range(_MAILBOX, 22))


@cache
def program() -> Mapping[str, Any]:
    """Return the structures and function blocks that are shipped, by their names there."""
    found: dict[str, Any] = {}
    for name in ('ros_telegram1.st', 'ros_mailbox.st'):
        # a link to that in config/, of which an installed package has a copy
        found |= load((Path(__file__).parent / name).read_text('utf-8'), name)
    return found


@dataclass(frozen=True)
class PlcSetting:
    """
    How a PLC is programmed; times in s.

    :ivar blocks: unit and register of the block of each drive; empty: register 0 of a unit each.
    :ivar cycle: of the program; :ivar exchange: from one telegram to the next.
    :ivar ros_time: how long the driver's life counter may stand still.
    :ivar drive_time: how long the data of a drive are valid that is not reached.
    :ivar answer_time: how long an answer takes, at least and at most.
    :ivar write_and_read: function 23 is not refused.
    :ivar released: the drives are released to ROS.
    :ivar layout: of the blocks; 2 has a mailbox for parameters, of which each record takes
        ``access_time``.
    :ivar longer_telegram: the telegram is the longer one that a family has beside the standard one.
    :raises ValueError: a time or a block that cannot be.
    """

    blocks: Sequence[tuple[int, int]] = ()
    cycle: float = 0.01
    exchange: float = 0.02
    ros_time: float = 1.0
    drive_time: float = 0.5
    answer_time: tuple[float, float] = (0.0, 0.0)
    write_and_read: bool = True
    released: bool = True
    layout: int = 1
    access_time: float = 0.02
    longer_telegram: bool = False

    def __post_init__(self) -> None:
        for name in ('cycle', 'exchange', 'ros_time', 'drive_time', 'access_time'):
            if not getattr(self, name) > 0:
                raise ValueError(f'{name} = {getattr(self, name):g} s is not possible')
        low, high = self.answer_time
        if not 0 <= low <= high:
            raise ValueError(f'an answer takes {low:g} to {high:g} s: the lesser time goes first')
        if self.layout not in _REGISTERS:
            raise ValueError(f'there is no layout {self.layout}: choose 1 or 2')
        taken: set[tuple[int, int]] = set()
        for unit, register in self.blocks:
            if unit not in _UNITS or not 0 <= register <= _LAST_REGISTER + 1 - self.registers:
                raise ValueError(f'no block can be at unit {unit}, register {register}')
            registers = {(unit, register + offset) for offset in range(self.registers)}
            if registers & taken:
                raise ValueError(f'the block at unit {unit}, register {register} is over another')
            taken |= registers

    @property
    def registers(self) -> int:
        """How many a block has."""
        return _REGISTERS[self.layout]


@dataclass
class Channel:
    """
    One drive on the fieldbus of the PLC, and its block.

    :ivar register: the first of the block.
    :ivar program: ``FB_RosTelegram1``, whose ``block`` Modbus shows.
    :ivar mailbox: ``FB_RosMailbox`` with +16 to +27; in layout 1 they do not show.
    :ivar cut_until: until when the fieldbus does not reach the drive (s).
    """

    drive: SimulatedDrive
    server: telegram1.Server
    unit: int
    register: int
    program: Any
    mailbox: Any
    records: Records
    released: bool
    cut_until: float = field(default=float('-inf'))

    @property
    def block(self) -> Any:
        """The registers that the driver and the PLC share, but those of the mailbox."""
        return self.program.block

    def reaches(self, now: float) -> bool:
        """Whether the fieldbus reaches the drive."""
        return now >= self.cut_until and self.drive.listening and self.server.online

    def exchange(self, now: float) -> None:
        """Exchange a telegram with the drive, if it is reached."""
        self.drive.advance_to(now)
        if not self.reaches(now):
            return
        program, server = self.program, self.server
        program.zsw1, program.actual = server.exchange(program.stw1, program.setpoint)
        more = server.more if server.longer else None
        program.more_valid = more is not None
        program.more1, program.more2, program.more3 = more or (0, 0, 0)
        program.exchanged = True

    def run(self, now: float) -> None:
        """Run the programs once."""
        self.program.release = self.released
        self.program()
        self.program.exchanged = False
        reached = self.reaches(now) and self.server.parameters is not None
        self.mailbox.access = reached
        self.mailbox()
        self.records.run(now, self.mailbox, self.server.parameters if reached else None)

    @property
    def registers(self) -> tuple[int, ...]:
        """What stands in the block, as many registers as its layout has."""
        words = (*self.block.registers(), *_GAP, *self.mailbox.mailbox.registers())
        return words[: _REGISTERS[self.program.layout]]

    def put(self, offset: int, words: tuple[int, ...]) -> None:
        """
        Take registers that are the driver's.

        :raises Refused: ADDRESS: one of them is not.
        """
        written = set(range(offset, offset + len(words)))
        if written <= _WORDS_OF_ROS:
            self.block.put(offset, words)
        elif written <= _REQUESTS_OF_ROS:
            self.mailbox.mailbox.put(offset - _MAILBOX, words)
        else:
            raise Refused(Reason.ADDRESS, f'the PLC writes some of +{offset} on itself')

    def describe(self) -> dict[str, Any]:
        """Return what stands in the block, and what the program says; it can be JSON."""
        return {
            'unit': self.unit,
            'register': self.register,
            'block': list(self.registers),
            'stw1': self.program.stw1,
            'setpoint': self.program.setpoint,
            'ros_alive': self.program.ros_alive,
        }


class Plc:
    """
    A PLC with a drive for each block.

    :param drives: those on its fieldbus.
    :raises ValueError: not a block for each drive, or a drive without this telegram.

    :ivar channels: by the addresses that the drives began with.
    :ivar stopped_until: until when its program stands (s).
    """

    def __init__(self, drives: Mapping[int, SimulatedDrive], setting: PlcSetting) -> None:
        if setting.blocks and len(setting.blocks) != len(drives):
            raise ValueError(f'{len(setting.blocks)} blocks for {len(drives)} drives')
        blocks = setting.blocks or [(address, 0) for address in drives]
        self.setting = setting
        self.stopped_until = float('-inf')
        self._now = 0.0
        self._next_cycle: float | None = None
        self._next_exchange = 0.0
        self._chance = random.Random(0)
        self.channels = {
            address: self._channel(drive, *block)
            for (address, drive), block in zip(drives.items(), blocks, strict=True)
        }

    def restart(self, until: float) -> None:
        """Be off until then (s), and begin anew: the registers of all blocks are 0."""
        self.stopped_until = until
        for address, channel in self.channels.items():
            fresh = self._channel(channel.drive, channel.unit, channel.register)
            for name in ('program', 'mailbox', 'records'):
                setattr(self.channels[address], name, getattr(fresh, name))

    def _channel(self, drive: SimulatedDrive, unit: int, register: int) -> Channel:
        server = drive.servers.get(TELEGRAM)
        if not isinstance(server, telegram1.Server):
            raise ValueError(f'{drive.model.name} does not speak {TELEGRAM}')
        server.longer = self.setting.longer_telegram
        shipped, clock = program(), lambda: self._now
        telegram = shipped['FB_RosTelegram1'](clock)
        telegram.lost_clears, telegram.lost_sets = server.lost_clears, server.lost_sets
        telegram.ros_time, telegram.drive_time = self.setting.ros_time, self.setting.drive_time
        telegram.layout = self.setting.layout
        mailbox = shipped['FB_RosMailbox'](clock)
        records = Records(shipped['FB_RosParameter'](clock), self.setting.access_time)
        return Channel(
            drive, server, unit, register, telegram, mailbox, records, self.setting.released
        )

    @property
    def units(self) -> list[Unit]:
        """The units that it is to its master."""
        numbers = {channel.unit for channel in self.channels.values()}
        return [Unit(self, number) for number in sorted(numbers)]

    @property
    def answer_time(self) -> float:
        """How long the next answer takes (s)."""
        return self._chance.uniform(*self.setting.answer_time)

    def advance_to(self, now: float) -> None:
        """Run cycles and exchange telegrams until now (s); the first call only sets the clock."""
        if self._next_cycle is None:
            self._next_cycle = self._next_exchange = now
            for channel in self.channels.values():
                channel.drive.advance_to(now)
        while min(self._next_cycle, self._next_exchange) <= now:
            if self._next_exchange <= self._next_cycle:
                self._now = self._next_exchange
                self._next_exchange += self.setting.exchange
                if self._runs:
                    for channel in self.channels.values():
                        channel.exchange(self._now)
            else:
                self._now = self._next_cycle
                self._next_cycle += self.setting.cycle
                if self._runs:
                    for channel in self.channels.values():
                        channel.run(self._now)
        for channel in self.channels.values():
            channel.drive.advance_to(now)

    @property
    def _runs(self) -> bool:
        return self._now >= self.stopped_until


class Unit:
    """
    One unit of a PLC, as it stands at a line.

    :ivar address: its number.
    :ivar servers: what answers its requests.
    :ivar listening: a PLC always is.
    """

    listening = True

    def __init__(self, plc: Plc, address: int) -> None:
        self._plc = plc
        self.address = address
        self.servers: Mapping[str, object] = {'modbus': Registers(plc, address)}

    @property
    def response_time(self) -> float:
        """How long it waits before it answers (s)."""
        return self._plc.answer_time

    @staticmethod
    def hears(protocol: str, timing: Timing) -> bool:
        """Whether it is set to a line: there is nothing to set."""
        return True

    @staticmethod
    def note_frame() -> None:
        """Record a frame; it means nothing to a PLC, its program watches the life counter."""

    def advance_to(self, now: float) -> None:
        """Catch up with the caller's clock (s)."""
        self._plc.advance_to(now)


class Registers(modbus.Requests):
    """The holding registers of one unit: its blocks, of which the driver writes the end alone."""

    functions = frozenset((modbus.READ, modbus.WRITE_MULTIPLE, modbus.WRITE_AND_READ))

    def __init__(self, plc: Plc, unit: int) -> None:
        if not plc.setting.write_and_read:
            self.functions -= {modbus.WRITE_AND_READ}
        self._channels = [channel for channel in plc.channels.values() if channel.unit == unit]

    def read(self, register: int, count: int) -> tuple[int, ...]:
        """Return registers of a block (Refused: ADDRESS)."""
        channel, offset = self._find(register, count)
        return channel.registers[offset : offset + count]

    def write(self, register: int, words: Sequence[int]) -> None:
        """Write registers that are the driver's (Refused: ADDRESS)."""
        channel, offset = self._find(register, len(words))
        channel.put(offset, tuple(words))

    def require(self, register: int, count: int) -> None:
        """Ensure that a block has registers (Refused: ADDRESS)."""
        self._find(register, count)

    def _find(self, register: int, count: int) -> tuple[Channel, int]:
        for channel in self._channels:
            offset = register - channel.register
            if offset in range(len(channel.registers) + 1 - count):
                return channel, offset
        raise Refused(Reason.ADDRESS, f'no block has {count} registers at {register}')
