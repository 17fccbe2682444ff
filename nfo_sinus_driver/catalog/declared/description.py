# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
What a file says of a drive, as data: the declared profile and the simulated drive both go by it.

Registers and coils are as they are sent, words as they stand in one register, 0 to FFFFh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from nfo_sinus_driver.catalog.parameter import Address, Parameter, Value
from nfo_sinus_driver.catalog.profile import Wait, Write
from nfo_sinus_driver.catalog.status import Role

#: Status codes that say what the drive does; faults with such a number are moved behind.
STATES = range(190, 200)
_MOVED_BY = 1000


def status_code(number: int) -> int:
    """Return the status code of a fault with a number of the drive's own."""
    return number + _MOVED_BY if number in STATES else number


def drive_number(code: int) -> int:
    """Return the drive's own number of the fault with a status code."""
    return code - _MOVED_BY if code - _MOVED_BY in STATES else code


@dataclass(frozen=True)
class Condition:
    """
    A condition on the status.

    :ivar mask: the bits of the status word that count.
    :ivar values: what they are, where the condition holds.
    :ivar inverted: it holds with any other.
    """

    mask: int
    values: frozenset[int]
    inverted: bool = False

    def holds(self, status: int) -> bool:
        """Return whether it holds with a status word."""
        return (status & self.mask in self.values) is not self.inverted

    @property
    def names_numbers(self) -> bool:
        """It names some of the numbers that several bits can be, and says nothing of the others."""
        return not self.inverted and bool(self.mask & (self.mask - 1))


@dataclass(frozen=True)
class SetBits:
    """Set some bits of a register, clear others, and keep the rest."""

    key: str
    set: int
    clear: int


@dataclass(frozen=True)
class Await:
    """Wait until a condition holds, s at most."""

    condition: Condition
    seconds: float


#: What is written to the parameter of a register, several or a coil, stands there as it is.
Step = Write | SetBits | Wait | Await
Steps = Sequence[Step]


@dataclass(frozen=True)
class Requirement:
    """
    What a parameter has to be before the line has control.

    :ivar write: it is written where it differs, and reported.
    :ivar text: what else to do, for an operator.
    """

    key: str
    value: Value
    write: bool
    text: str


@dataclass(frozen=True)
class Direction:
    """
    The word, or the coil, that gives the direction; both go with the run command.

    :ivar key: where it is written.
    :ivar alone: these words give the direction alone, and the run command is another one there.
    """

    key: str
    forward: int
    reverse: int
    alone: bool = False


@dataclass(frozen=True)
class SetpointPlace:
    """
    Where set-points go.

    :ivar key: the parameter that takes them; :ivar read_key: the one that reports them, or ``''``.
    :ivar mode: the control mode of their unit.
    :ivar most: the greatest one; :ivar limit: the parameter that limits it, or ``''``.
    :ivar nominal: what the motor is made for: a value, the parameter that reports it, or ``None``.
    :ivar signed: a negative one is reverse.
    :ivar direction: what else gives the direction; with neither there is no reverse.
    """

    key: str
    read_key: str
    mode: str
    most: float
    limit: str = ''
    nominal: float | str | None = None
    signed: bool = False
    direction: Direction | None = None

    @property
    def reverses(self) -> bool:
        """A set-point may turn the motor in reverse."""
        return self.signed or self.direction is not None


@dataclass(frozen=True)
class Fault:
    """A fault: its status code and texts; ``line``: a silence of the line leaves it."""

    code: int
    text: str
    description: str = ''
    remedy: str = ''
    line: bool = False


@dataclass(frozen=True)
class FaultCodes:
    """
    Where the number of a fault stands.

    :ivar mask: its bits; :ivar shift: the lowest of them.
    :ivar none: the number that means none.
    :ivar in_status: it is a part of the status word; else it is a register of its own, which is
        read where the status reports a fault.
    """

    mask: int
    shift: int
    none: int
    in_status: bool

    def code(self, word: int) -> int:
        """Return the status code of the fault that a word has; 0 if it has none."""
        number = (word & self.mask) >> self.shift
        return 0 if number == self.none else status_code(number)


@dataclass(frozen=True)
class StatusPlace:
    """
    Where the status stands; it is read as one number, the first register in its highest bits.

    :ivar registers: as they stand in it, or one coil for each bit, the lowest first.
    :ivar coils: they are coils; :ivar inputs: input registers, which function 04 reads.
    """

    registers: Sequence[int]
    coils: bool = False
    inputs: bool = False

    def holds(self, address: Address) -> bool:
        """Return whether what stands at an address is a part of it."""
        same = (address.space == 'input') is self.inputs and not self.coils
        return same and address.index in self.registers

    def shift(self, register: int) -> int:
        """Return at which bit a register, or a coil, begins."""
        at = self.registers.index(register)
        return at if self.coils else 16 * (len(self.registers) - 1 - at)


@dataclass(frozen=True)
class LineDefaults:
    """
    The line as the drive leaves the factory.

    :ivar write: the functions by which it takes writes.
    :ivar exceptions: what its exception codes mean; :ivar busy: those that mean to try again.
    :ivar gap: the least silence of the line before each request to it, s.
    :ivar after_write: for how long it is asked nothing after one of its parameters was written, s.
    """

    protocol: str = 'modbus_rtu'
    baud_rate: int = 0
    char_format: str = ''
    address: int = 0
    check: str = ''
    write: tuple[int, ...] = (6, 16)
    most_registers: int = 123
    exceptions: Mapping[int, str] = field(default_factory=dict)
    busy: frozenset[int] = frozenset()
    gap: float = 0.0
    after_write: float = 0.0

    @property
    def factory(self) -> Mapping[str, int | str]:
        """The protocol, and what of speed, format and address the file has."""
        found: dict[str, int | str] = {
            'protocol': self.protocol, 'baud_rate': self.baud_rate,
            'char_format': self.char_format, 'address': self.address,
        }
        return {name: value for name, value in found.items() if value}

    @property
    def shown(self) -> str:
        """What is said, for an operator."""
        speed = f'{self.baud_rate} bit/s' if self.baud_rate else ''
        address = f'address {self.address}' if self.address else ''
        found = ', '.join(filter(None, (f'{speed} {self.char_format}'.strip(), address)))
        factory = f'{found} from the factory' if found else ''
        return '; '.join(filter(None, (self.check, factory)))


@dataclass(frozen=True)
class Timeout:
    """
    The drive's own time-out.

    :ivar key: its parameter.
    :ivar conditions: the parameters on which it depends that the motor stops then, each with the
        values by which it does, first the one to be written.
    """

    key: str
    conditions: Mapping[str, Sequence[Value]] = field(default_factory=dict)


@dataclass(frozen=True)
class Shown:
    """
    A register that is only read, and not by this driver.

    :ivar parameter: how it carries its value.
    :ivar quantity: what that is; ``None``: the set-point.
    """

    parameter: Parameter
    quantity: Role | None


@dataclass(frozen=True)
class Copied:
    """A register in which some bits of another one stand, the lowest first."""

    register: int
    shift: int
    mask: int


@dataclass(frozen=True)
class Simulated:
    """
    What a file says for the simulated drive alone.

    :ivar accel, decel: the parameters of its ramps, or ``''``.
    :ivar loopback: it answers function 08, sub-function 0.
    :ivar reverse: the register of commands, and the bit in it that turns the direction round.
    :ivar registers: what stands in those that this driver does not read; a number, or where that
        comes from.
    """

    accel: str = ''
    decel: str = ''
    loopback: bool = False
    reverse: tuple[int, int] | None = None
    registers: Mapping[int, int | Shown | Copied] = field(default_factory=dict)


@dataclass(frozen=True)
class Description:
    """
    A drive, as its file describes it.

    :ivar name: the name of the file without ``.vfd.yaml``; :ivar path: the file.
    :ivar rung: what its numbers were taken from: ``manual``, ``master``, ``capture``, ``drive``; or
        ``''``.
    :ivar parameters: all, by key, those of commands and status among them.
    :ivar registers: of each key of a command, set-point or parameter, its first register or coil.
    :ivar facts: the conditions of the status, by the names of the file.
    :ivar flags: faults that are bits, the gravest first.
    :ivar identify: the parameters that tell it from other drives, and the numbers by which they do.
    :ivar holder: the parameter that reports who has control, and its values for the line.
    :ivar run_by: ``setpoint``: there is no run command, and the motor follows each set-point;
        ``terminals``: while they start it; ``''``: the run command does.
    :ivar stop_disturbs_local: a stop over the line stops a motor that keypad or terminals run.
    :ivar prepare_stops: no run command stands behind ``prepare``.
    :ivar keeps_run: the drive keeps its run command without power; ``None``: the file does not say.
    :ivar pole_pairs: of the motor; 0: not known.
    :ivar stop_mode: the parameter that says how it stops, and its value for coasting.
    :ivar defaults: with what value a parameter leaves the factory, by key.
    :ivar simulated: what is for the simulated drive alone.
    :ivar unused: which keys of the file have no effect, a sentence each.
    """

    name: str
    path: str
    title: str
    source: str
    rung: str
    tested: str
    line: LineDefaults
    parameters: Mapping[str, Parameter]
    roles: Mapping[Role, str]
    status: StatusPlace
    facts: Mapping[str, Condition]
    setpoint: SetpointPlace
    run: Steps
    stop: Steps
    identify: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    prepare: Steps = ()
    prepare_stops: bool = False
    keeps_run: bool | None = None
    run_by: str = ''
    stop_disturbs_local: bool = False
    coast: Steps = ()
    quick_stop: Steps = ()
    reset: Steps = ()
    release: Steps = ()
    after_write: Sequence[Write | Wait] = ()
    requires: Sequence[Requirement] = ()
    holder: tuple[str, tuple[Value, ...]] | None = None
    stop_mode: tuple[str, Value] | None = None
    enable_input: str = ''
    codes: FaultCodes | None = None
    faults: Mapping[int, Fault] = field(default_factory=dict)
    flags: Sequence[tuple[Condition, Fault]] = ()
    alarm: Fault = Fault(0, 'Warning', remedy='Look at its keypad which one it is')
    timeout: Timeout | None = None
    defaults: Mapping[str, Value] = field(default_factory=dict)
    pole_pairs: int = 0
    simulated: Simulated = field(default_factory=Simulated)
    unused: Sequence[str] = ()

    @property
    def tells_control(self) -> bool:
        """The status reports who has control."""
        return 'remote' in self.facts or 'local' in self.facts
