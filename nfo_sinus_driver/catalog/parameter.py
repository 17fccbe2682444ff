# Copyright 2026 The nfo_sinus_driver authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
One parameter of a drive: where it stands on each bus and how raw words become a value.

``value = raw * factor``, with one factor per bus ([C14], [C15]): the manuals write the same
scaling in three opposite notations, so the tables hold plain factors.
"""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence
from dataclasses import dataclass
import enum
from fractions import Fraction
import functools
import math
import struct

#: An engineering value: a number, the label of an enumeration, or on/off.
Value = bool | int | float | str


class Protocol(enum.Enum):
    """The two ways a parameter is addressed on the drive's own serial port."""

    MODBUS = 'modbus'
    CLASSIC = 'classic'


class RawType(enum.Enum):
    """The type of a parameter on the bus, as the manuals name it [M0 table 2, table 4]."""

    UINT16 = (1, False)
    SINT16 = (1, True)
    UINT32 = (2, False)
    SINT32 = (2, True)
    ENUM = (1, False, 'enum')  # the third item only keeps it from being an alias of UINT16

    def __init__(self, words: int, signed: bool, _: str = '') -> None:
        self.words = words
        self.signed = signed
        bits = 16 * words
        self.minimum = -(1 << bits - 1) if signed else 0
        self.maximum = (1 << bits - int(signed)) - 1

    def to_raw(self, words: Sequence[int]) -> int:
        """
        Join 16-bit words, the low one first [M0 §6.2.3], to the raw number.

        :raises ValueError: not exactly as many words as the type has.
        """
        if len(words) != self.words:
            raise ValueError(f'{self.name} takes {self.words} words, not {len(words)}')
        raw = 0
        for position, word in enumerate(words):
            raw |= (word & 0xFFFF) << 16 * position
        if raw > self.maximum:
            raw -= 1 << 16 * self.words
        return raw

    def to_words(self, raw: int) -> tuple[int, ...]:
        """
        Split a raw number into 16-bit words, the low one first.

        :raises ValueError: the number does not fit the type.
        """
        if not self.minimum <= raw <= self.maximum:
            raise ValueError(f'{raw} does not fit {self.name} ({self.minimum} to {self.maximum})')
        return tuple(raw >> 16 * position & 0xFFFF for position in range(self.words))


class Access(enum.Enum):
    """What the bus may do with a parameter."""

    READ = 'r'
    WRITE = 'w'
    READ_WRITE = 'rw'
    #: Reading it acknowledges a fault: only ever read when a person asked for that [C43].
    ACKNOWLEDGE = 'ack'


@dataclass(frozen=True)
class Scaling:
    """
    The factors that a drive's scale parameters set for whole groups [M0 §8.3].

    The addresses of all but SpdScl are unknown [C16], so the factory defaults are assumed.
    TrqScl stands for T-nom / 100, so torque is in percent of the nominal torque [C13].
    """

    frq_scl: Fraction = Fraction(1, 10)
    spd_scl: Fraction = Fraction(1)
    trq_scl: Fraction = Fraction(1)
    reg_scl: Fraction = Fraction(1, 10)

    def factor(self, name: str) -> Fraction:
        """Return the factor the manual calls ``name``: ``FrqScl``, ``SpdScl`` and so on."""
        factor: Fraction = getattr(self, f'{name[:3].lower()}_scl')
        return factor


DEFAULT_SCALING = Scaling()

#: The groups of the tables that hold no settings: what a drive measures, and what controls it.
NO_SETTINGS = frozenset({'Status', 'Fieldbus'})


@dataclass(frozen=True)
class Place:
    """Where a parameter stands on one bus, its type there and its factor there."""

    #: The Modbus base register, or the Classic ids of the words, the low word's first.
    addresses: tuple[int, ...]
    type: RawType
    #: ``None`` where one of the drive's scale parameters gives the factor [M0 §8.3].
    factor: Fraction | None

    @property
    def address(self) -> int:
        """The Modbus register, or the Classic id of the low word."""
        return self.addresses[0]

    @property
    def words(self) -> int:
        """How many 16-bit words the parameter has here."""
        return self.type.words

    @property
    def occupied(self) -> Sequence[int]:
        """Every register or id that it takes: Classic names them all, Modbus only the first."""
        if len(self.addresses) == self.words:
            return self.addresses
        return range(self.address, self.address + self.words)


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of a drive, as the manuals describe it.

    :ivar key: ``group.name`` in snake case; for a setting this is the ROS parameter's name.
    :ivar name: the manual's name.
    :ivar places: where it stands, by protocol; a protocol that lacks it is absent.
    :ivar scale: the drive's scale parameter that gives the factor (``FrqScl`` …), or ``''``.
    :ivar unit: the unit of its values.
    :ivar minimum: the least value the manual allows, in ``unit``; ``None`` where it says none.
    :ivar maximum: the greatest, likewise.
    :ivar decimals: the decimals that the drive's own display shows.
    :ivar labels: the manual's label of each code of an enumeration.
    :ivar stopped: the motor must stand for it to be written (type Init, not Init/Run).
    :ivar since: the first firmware that has it, or ``None``.
    :ivar source: where in the manuals it stands.
    :ivar pnu: its PROFIBUS parameter number, 1000 + ADI [M0 §6.3.3]; ``None`` if it has none.
    :ivar canopen: its CANopen index, 2000h + ADI [M0 §6.4.3], likewise.
    """

    key: str
    name: str
    group: str
    places: Mapping[Protocol, Place]
    scale: str
    unit: str
    minimum: Fraction | None
    maximum: Fraction | None
    decimals: int
    labels: Mapping[int, str]
    access: Access
    stopped: bool
    since: Fraction | None
    description: str
    source: str
    pnu: int | None = None
    canopen: int | None = None

    @functools.cached_property
    def kind(self) -> type[bool] | type[int] | type[float] | type[str]:
        """The Python type of its values."""
        if self.labels:
            labels = set(self.labels.values())
            # RegAmp is one of two numbers, with nothing between them [C46]
            return bool if labels == {'OFF', 'ON'} else int if labels == {'-1', '1'} else str
        whole = all(place.factor == 1 for place in self.places.values())
        return int if whole else float

    @property
    def is_setting(self) -> bool:
        """Whether the drive keeps it for people to read and write: a ROS parameter."""
        return self.access is Access.READ_WRITE and self.group not in NO_SETTINGS

    @property
    def older(self) -> bool:
        """Firmware that [M2] describes has it too; asking such a drive for others is a fault."""
        return 'M2' in self.source

    def place(self, protocol: Protocol) -> Place:
        """
        Return where it stands on ``protocol``.

        :raises KeyError: the parameter cannot be reached over that protocol.
        """
        try:
            return self.places[protocol]
        except KeyError:
            raise KeyError(f'{self.key} cannot be reached over {protocol.value}') from None

    def factor(self, protocol: Protocol, scaling: Scaling = DEFAULT_SCALING) -> Fraction:
        """Return the value of one raw count over ``protocol``, in :attr:`unit`."""
        if scaling is DEFAULT_SCALING and protocol in self._factors:
            return self._factors[protocol]
        factor = self.place(protocol).factor
        return scaling.factor(self.scale) if factor is None else factor

    @functools.cached_property
    def _factors(self) -> Mapping[Protocol, Fraction]:
        """The factors that hold by default, for they are asked for with every value."""
        default = DEFAULT_SCALING.factor(self.scale) if self.scale else None
        factors = {protocol: place.factor for protocol, place in self.places.items()}
        return {
            protocol: factor
            for protocol, own in factors.items()
            if (factor := default if own is None else own) is not None
        }

    def decode(
        self,
        words: Sequence[int],
        protocol: Protocol = Protocol.MODBUS,
        scaling: Scaling = DEFAULT_SCALING,
    ) -> Value:
        """
        Turn the words read from the drive into a value in :attr:`unit`.

        A code that the manual does not list is shown as its number: the drive is right [C19].

        :raises ValueError: not as many words as the parameter has, or a code that has no value of
            the parameter's type.
        """
        raw = self.place(protocol).type.to_raw(words)
        if self.labels:
            return self._meaning(raw)
        if self.kind is int:
            return raw
        factor = self.factor(protocol, scaling)
        return raw * factor.numerator / factor.denominator

    def encode(
        self,
        value: Value,
        protocol: Protocol = Protocol.MODBUS,
        scaling: Scaling = DEFAULT_SCALING,
    ) -> tuple[int, ...]:
        """
        Turn a value in :attr:`unit` into the words to write, exactly.

        :raises ValueError: wrong type, out of range, unknown label, or a number between two steps
            of the drive; the message says what would be right.
        """
        if self.labels:
            return self.place(protocol).type.to_words(self._code(value))
        number = self._number(value)
        factor = self.factor(protocol, scaling)
        raw = round(number / factor)
        if not _means(float(number), raw * factor, factor):
            self._check_range(number, protocol, scaling)
            below = math.floor(number / factor)
            raise ValueError(
                f'{self.key}: {value} lies between two steps of the drive, '
                f'{_show(below * factor)} and {_show((below + 1) * factor)}'
            )
        self._check_range(raw * factor, protocol, scaling)
        return self.place(protocol).type.to_words(raw)

    def span(
        self, protocol: Protocol = Protocol.MODBUS, scaling: Scaling = DEFAULT_SCALING
    ) -> tuple[Fraction, Fraction]:
        """
        Return the least and the greatest value over ``protocol``, in :attr:`unit`.

        Where the manual allows more than the type can carry, or says nothing, the type decides.
        """
        factor = self.factor(protocol, scaling)
        carried = self.place(protocol).type
        low, high = carried.minimum * factor, carried.maximum * factor
        low = low if self.minimum is None else max(low, self.minimum)
        return low, high if self.maximum is None else min(high, self.maximum)

    @property
    def never_negative(self) -> bool:
        """It is unsigned on some bus; Classic has signed types for nearly everything [C23]."""
        return any(not place.type.signed for place in self.places.values())

    def quantise(
        self,
        value: float,
        protocol: Protocol = Protocol.MODBUS,
        scaling: Scaling = DEFAULT_SCALING,
    ) -> tuple[int, ...]:
        """
        Turn a set-point into the words of the nearest step of the drive.

        :raises ValueError: not finite, or out of range.
        """
        number = self._number(value)
        factor = self.factor(protocol, scaling)
        self._check_range(number, protocol, scaling)
        return self.place(protocol).type.to_words(round(number / factor))

    def _meaning(self, raw: int) -> Value:
        """Return what a code of an enumeration means."""
        if self.kind is str:
            return self.labels.get(raw, str(raw))
        if raw not in self.labels:
            raise ValueError(
                f'{self.key}: the drive has code {raw}, which is none of '
                f'{", ".join(self.labels.values())}'
            )
        label = self.labels[raw]
        return int(label) if self.kind is int else label == 'ON'

    def _code(self, value: Value) -> int:
        if self.kind is bool and isinstance(value, bool):
            value = 'ON' if value else 'OFF'
        elif self.kind is int and not isinstance(value, (bool, str)) and value in (-1, 1):
            value = f'{value:g}'
        for code, label in self.labels.items():
            if label == value:
                return code
        raise ValueError(f'{self.key}: {value!r} is none of {", ".join(self.labels.values())}')

    def _number(self, value: Value) -> Fraction:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ValueError(f'{self.key}: {value!r} is not a number')
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise ValueError(f'{self.key}: {number} is not finite')
        return Fraction(value)

    def _check_range(self, number: Fraction, protocol: Protocol, scaling: Scaling) -> None:
        low, high = self.span(protocol, scaling)
        # the bounds are decimal fractions and the values binary ones
        slack = self.factor(protocol, scaling) / 1000
        if not low - slack <= number <= high + slack:
            if self.maximum is None and number < low:
                allowed = f'at least {_show(low)}'
            else:
                allowed = f'{_show(low)} to {_show(high)}'
            raise ValueError(
                f'{self.key}: {_show(number)} is out of range, {allowed} {self.unit}'.rstrip()
            )


def _show(number: Fraction) -> str:
    return f'{float(number):.10g}'


def _means(value: float, step: Fraction, factor: Fraction) -> bool:
    """
    Tell whether a number is meant to be a step of the drive.

    Decimal fractions never hit a binary number exactly, and what went through a Float32 message or
    a tool that computes with one is off by more.
    """
    if abs(Fraction(value) - step) <= max(abs(step) / 2**50, factor / 10**6):
        return True
    try:
        single = struct.unpack('<f', struct.pack('<f', float(step)))[0]
    except OverflowError:
        return False
    return bool(value == single)
