# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The part of a simulated drive that decides; each family has its own.

Around it are the parts that are alike in all: what it keeps (:mod:`memory`), what it turns
(:mod:`motor`), what went wrong (:mod:`faults`), power and time (:mod:`drive`).
"""

from __future__ import annotations

import abc
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, NamedTuple

from nfo_sinus_driver.catalog import Parameter
from nfo_sinus_driver.simulator.faults import Faults
from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.motor import Counters, Motor, Nameplate
from nfo_sinus_driver.simulator.timing import Timing


def choice(usual: str, *others: str, text: str) -> str:
    """Return a field of a :class:`Variant`: what it can be, and what that decides."""
    text = f'{text} (default: {usual})' if usual else text
    found: str = field(default=usual, metadata={'choices': (usual, *others), 'text': text})
    return found


class Option(NamedTuple):
    """One field of a variant; the first of its choices is the usual one."""

    name: str
    text: str
    choices: tuple[str, ...]


@dataclass(frozen=True)
class Variant:
    """
    How a drive is fitted out, and what it does where the manuals leave it open.

    Each field of a family's is a :func:`choice`, and an option of the command line.

    :raises ValueError: a field cannot be that.
    """

    def __post_init__(self) -> None:
        for name, _, choices in self.options():
            if getattr(self, name) not in choices:
                raise ValueError(f'{name}: choose one of {", ".join(filter(None, choices))}')

    @classmethod
    def options(cls) -> tuple[Option, ...]:
        """Return what can be chosen."""
        return tuple(
            Option(declared.name, declared.metadata['text'], declared.metadata['choices'])
            for declared in fields(cls)
        )


class ControlUnit(abc.ABC):
    """
    Takes the commands of a drive and turns them into orders to the motor.

    A family has to say what it does (the abstract ones); the rest has a default that does for a
    plain drive. Parameters go by their keys, as raw numbers of the memory.

    :param address: of the drive on its line.
    :param variant: how this one is.
    :param faults: those of this family; by default plain ones.

    :ivar run_input: the digital input that allows a run; set it at any time.
    :ivar initialised: the self-test after power-on is over.
    """

    #: Set-points that can be changed at the keypad, too.
    setpoints: ClassVar[frozenset[str]] = frozenset()
    #: What a factory reset leaves as it is: without them it would not hear the line any more.
    line_settings: ClassVar[frozenset[str]] = frozenset()
    #: The keys that can be pressed.
    keys: ClassVar[Sequence[str]] = ()

    def __init__(
        self, memory: Memory, address: int, variant: Variant, faults: Faults | None = None
    ) -> None:
        self.memory = memory
        self.variant = variant
        self.faults = Faults(memory.model) if faults is None else faults
        self.motor = Motor(self.nameplate())
        self.counters = Counters()
        self.run_input = True
        self.initialised = False
        self._address = address

    # ---- what it takes and shows ----

    def write(self, key: str, raw: int) -> bool:
        """Carry out a write of a command, or refuse it; ``False`` if it is none: it is stored."""
        return False

    def show(self, key: str) -> int | None:
        """Return the raw number of what is not stored, or measured its own way; else ``None``."""
        return None

    @property
    def status_code(self) -> int:
        """The inverter status, without acknowledging anything; here the fault, else 0."""
        return self.faults.shown

    def read(self, key: str) -> int | None:
        """Return what reading has an effect for, having it; else ``None``."""
        return None

    def scaled(self, parameter: Parameter) -> Parameter:
        """Return a parameter with the scale that this drive is set to."""
        return parameter

    def key_of(self, key: str) -> str:
        """Return which parameter is meant: there may be one for the set-points of all modes."""
        return key

    def validate(self, key: str) -> None:
        """Look whether a parameter may be written now (Refused: STATE)."""

    def stored(self, key: str) -> None:
        """Record that a parameter has a new value in the memory."""

    def written(self, key: str, protocol: str) -> None:
        """Record by which protocol, as the tables call it, a parameter was just written."""

    # ---- what it does ----

    @abc.abstractmethod
    def settle(self) -> None:
        """Carry out what stands: commands, state, power stage, demand."""

    @property
    @abc.abstractmethod
    def settled(self) -> bool:
        """Whether all stays as it is as long as nothing new comes and the motor is settled."""

    def wait(self, dt: float) -> None:
        """Let ``dt`` seconds pass."""

    @abc.abstractmethod
    def restart(self) -> None:
        """Begin as after power-on: without control. What is in the memory stays."""

    def boot(self) -> None:
        """End the self-test after power-on."""
        self.faults.restart()
        self.restart()
        self.initialised = True

    def trip(self, code: int, *, cause_present: bool = False) -> None:
        """Let a fault happen (ValueError: the family has no such fault)."""
        self.faults.trip(code, self.counters.operating_time, cause_present=cause_present)

    def nameplate(self) -> Nameplate:
        """Return the motor's data; by default those of a motor of 1.5 kW."""
        return Nameplate()

    def press(self, key: str) -> None:
        """Take one of :attr:`keys`."""

    # ---- the line ----

    @property
    def address(self) -> int:
        """The address that is in effect."""
        return self._address

    def set_to(self, lines: Sequence[tuple[str, Timing]]) -> None:
        """
        Configure the serial settings, if there are any, for ``lines[0]``; answer on all of them.

        :param lines: of each, the protocol that the drive speaks there, speed and format.
        :raises ValueError: it cannot be.
        """

    def hears(self, protocol: str, timing: Timing) -> bool:
        """Whether it is set to this protocol, speed and format."""
        return True

    @property
    def response_time(self) -> float:
        """How long it is set to wait before it answers (s)."""
        return 0.0

    def note_frame(self) -> None:
        """Record that a valid frame for this drive arrived."""

    # ---- for tests and people ----

    def report(self) -> dict[str, Any]:
        """Return what else there is to say of the drive, as plain data."""
        return {}
