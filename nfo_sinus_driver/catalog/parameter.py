# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
One parameter of a drive: where it stands on each bus and how raw numbers become a value.

``value = raw * factor``, with one factor per bus ([C14], [C15]): the manuals write the same
scaling in three opposite notations, so the tables hold plain factors. The value of an enumeration
is its code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
import enum
from fractions import Fraction
import functools
import math
import re
import struct

from nfo_sinus_driver.catalog.codec import Number, Text

#: An engineering value: a number, the label of an enumeration, or on/off.
Value = bool | int | float | str


class Access(enum.Enum):
    """What the bus may do with a parameter."""

    READ = 'r'
    WRITE = 'w'
    READ_WRITE = 'rw'
    #: Reading it acknowledges a fault: only ever read when a person asked for that [C43].
    ACKNOWLEDGE = 'ack'


#: The labels that a switch has, in capitals, and what they say.
_SWITCH = {'OFF': False, 'ON': True, 'NO': False, 'YES': True}

#: What YAML takes for false and for true, in small letters.
_SWITCH_WORDS = (('off', 'no', 'false'), ('on', 'yes', 'true'))

#: The groups of the tables that hold no settings: what a drive measures, and what controls it.
NO_SETTINGS = frozenset({'Status', 'Fieldbus'})


@dataclass(frozen=True)
class Address:
    """
    Where a parameter stands on one bus, and how its bytes make a value there.

    :ivar protocol: the protocol that reaches it.
    :ivar space: which numbering of that protocol ``index`` counts in.
    :ivar index: its number there; of several registers the first.
    :ivar sub_index: which part of it; on Classic the id of the high word.
    :ivar codec: how the bytes are read.
    :ivar factor: the value of one raw count, in the parameter's unit.
    :ivar source: where in the manuals that stands.
    """

    protocol: str
    space: str
    index: int
    sub_index: int | None
    codec: Number | Text
    factor: Fraction
    source: str

    @property
    def number(self) -> Number:
        """The codec of what is no text (ValueError: it is a text)."""
        if isinstance(self.codec, Text):
            raise ValueError(f'{self.codec.name} is no number')
        return self.codec

    @property
    def numbers(self) -> tuple[int, ...]:
        """The index, and the sub-index where there is one."""
        return (self.index,) if self.sub_index is None else (self.index, self.sub_index)

    @property
    def place(self) -> tuple[str, int, int | None, int, bool | None]:
        """What a link needs: space, index, sub-index, size in bytes, whether it has a sign."""
        signed = self.codec.signed if isinstance(self.codec, Number) else None
        return self.space, self.index, self.sub_index, self.codec.size, signed

    @property
    def occupied(self) -> Sequence[tuple[int, ...]]:
        """All that it takes and no other may: registers and ids one by one."""
        if self.space == 'register':
            return [(self.index + word,) for word in range(self.codec.size // 2)]
        return [(id_,) for id_ in self.numbers] if self.space == 'id' else [self.numbers]


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of a drive, as the manuals describe it.

    :ivar key: ``group.name`` in snake case; for a setting this is the ROS parameter's name.
    :ivar name: the manual's name.
    :ivar addresses: where it stands, by protocol; a protocol that lacks it is absent.
    :ivar scale: the drive's scale parameter that may change the factor (``FrqScl`` …), or ``''``;
        the key of one whose value the factor is multiplied by; else
        the addresses of all but SpdScl are unknown [C16], so the factory's factors are assumed.
        TrqScl stands for T-nom / 100, so torque is in percent of the nominal torque [C13].
    :ivar unit: the unit of its values.
    :ivar minimum: the least value the manual allows, in ``unit``; ``None`` where it says none.
    :ivar maximum: the greatest, likewise.
    :ivar steps: where the drive takes fewer values than it can count: from which value on by which
        step, in this order.
    :ivar decimals: the decimals that the drive's own display shows.
    :ivar labels: the manual's label of each code of an enumeration.
    :ivar stopped: the motor must stand for it to be written (type Init, not Init/Run).
    :ivar since: the first firmware that has it, or ``None``.
    :ivar older: firmware of the family's older dialect has it, too; asking such a drive for others
        is a fault.
    :ivar option: the option cards of which the drive needs one for it to do anything, or ``''``.
    :ivar source: where in the manuals it stands.
    :ivar none: the raw number by which the drive reports that there is no value, or ``None``.
    """

    key: str
    name: str
    group: str
    addresses: Mapping[str, Address]
    access: Access
    scale: str = ''
    unit: str = ''
    minimum: Fraction | None = None
    maximum: Fraction | None = None
    steps: Sequence[tuple[Fraction, Fraction]] = ()
    decimals: int = 0
    labels: Mapping[int, str] = field(default_factory=dict)
    stopped: bool = False
    since: Fraction | None = None
    older: bool = False
    option: str = ''
    description: str = ''
    source: str = ''
    none: int | None = None

    @functools.cached_property
    def kind(self) -> type[bool] | type[int] | type[float] | type[str]:
        """The Python type of its values."""
        if self.labels:
            if self._is_switch:
                return bool
            # RegAmp is one of two numbers, with nothing between them [C46]
            return int if all(map(_WHOLE.fullmatch, self.labels.values())) else str
        if any(isinstance(address.codec, Text) for address in self.addresses.values()):
            return str
        # a scale parameter may make it finer
        whole = all(address.factor == 1 for address in self.addresses.values())
        return int if whole and not self.scale else float

    @property
    def is_kept(self) -> bool:
        """Whether it is a ROS parameter: a setting, or what is only read of the same groups."""
        read_only = self.access is Access.READ and self.group not in NO_SETTINGS
        return self.is_setting or read_only

    @property
    def is_readable(self) -> bool:
        """Whether reading it has no effect."""
        return self.access in (Access.READ, Access.READ_WRITE)

    @property
    def is_writable(self) -> bool:
        """Whether it can be written."""
        return self.access in (Access.WRITE, Access.READ_WRITE)

    @property
    def is_measured(self) -> bool:
        """Whether the drive reports it of itself, by a number or a label, and it is no setting."""
        if not self.is_readable or self.is_setting:
            return False
        by_label = bool(self.labels) and self.access is Access.READ
        return by_label or self.kind in (int, float)

    @property
    def is_setting(self) -> bool:
        """Whether the drive keeps it for people to read and write: a ROS parameter."""
        return self.access is Access.READ_WRITE and self.group not in NO_SETTINGS

    @property
    def _is_switch(self) -> bool:
        switched = {code: _SWITCH.get(label.upper()) for code, label in self.labels.items()}
        return switched == {0: False, 1: True}

    def at(self, protocol: str) -> Address:
        """Return where it stands on ``protocol``; a KeyError if that does not reach it."""
        try:
            return self.addresses[protocol]
        except KeyError:
            raise KeyError(f'{self.key} cannot be reached over {protocol}') from None

    def factor(self, protocol: str) -> Fraction:
        """Return the value of one raw count over ``protocol``, in :attr:`unit`."""
        return self.at(protocol).factor

    def rescaled(self, protocol: str, factor: Fraction) -> Parameter:
        """Return the same with another factor over ``protocol``: so many times as great."""
        address = self.at(protocol)
        address = replace(address, factor=address.factor * factor)
        return replace(self, addresses={**self.addresses, protocol: address})

    def in_rpm(self, count: Fraction) -> Parameter:
        """Return the same as a speed, of which one raw count is so many rpm on every bus."""
        addresses = {
            name: replace(address, factor=count) for name, address in self.addresses.items()
        }
        return replace(self, unit='rpm', scale='', addresses=addresses)

    def decode(self, data: bytes, protocol: str = 'modbus') -> Value:
        """
        Turn the bytes read from the drive into a value in :attr:`unit`.

        A code that the manual does not list is shown as its number: the drive is right [C19].

        :raises ValueError: not as many bytes as the parameter has, or a code that has no value of
            the parameter's type.
        """
        address = self.at(protocol)
        raw = address.codec.decode(data)
        if isinstance(raw, str):
            return raw
        if raw == self.none:
            return math.nan
        factor = address.factor
        if self.labels:
            return self._meaning(raw * factor)
        if self.kind is int:
            return raw
        return raw * factor.numerator / factor.denominator

    def number_of(self, value: Value) -> float:
        """
        Return one of its values as a number: of a label the code.

        :raises ValueError: it is a text.
        """
        if not isinstance(value, str):
            return float(value)
        codes = {label: code for code, label in self.labels.items()}
        # a code that has no label is shown as its number
        return float(codes.get(value, value))

    def meant(self, value: Value) -> Value:
        """
        Return what was meant by a value, in the type of the parameter where there is one.

        YAML makes a boolean of OFF and of Yes, which may be labels; a whole number may have a
        point. What cannot be meant is returned as it is.
        """
        if self.kind is str and isinstance(value, bool):
            words = _SWITCH_WORDS[value]
            labels = [label for label in self.labels.values() if label.lower() in words]
            return labels[0] if len(labels) == 1 else value
        if self.kind is float and type(value) is int:
            return float(value)
        if self.kind is int and isinstance(value, float) and value.is_integer():
            return int(value)
        return value

    def encode(self, value: Value, protocol: str = 'modbus') -> bytes:
        """
        Turn a value in :attr:`unit` into the bytes to write, exactly.

        :raises ValueError: wrong type, out of range, unknown label, or a number between two steps
            of the drive; the message says what would be right.
        """
        codec, factor = self.at(protocol).codec, self.factor(protocol)
        if isinstance(codec, Text):
            return codec.encode(str(value))
        if self.labels:
            return codec.encode(int(self._code(value) / factor))
        number = self._number(value)
        raw = self._nearest(number, factor)
        if not _means(float(number), raw * factor, factor):
            self._check_range(number, protocol)
            start, step = self._steps_at(number, factor)
            below = start + math.floor((number - start) / step) * step
            raise ValueError(
                f'{self.key}: {value} lies between two steps of the drive, '
                f'{_show(below)} and {_show(below + step)}'
            )
        self._check_range(raw * factor, protocol)
        return codec.encode(raw)

    def on_step(self, number: float) -> bool:
        """Return whether :attr:`steps` have a number; any is on one where there are none."""
        if not self.steps:
            return True
        start, step = self._steps_at(Fraction(number), Fraction(1))
        nearest = _rounded(Fraction(number), start, step)
        return nearest >= start and _means(number, nearest, step)

    @property
    def shown_steps(self) -> str:
        """What :attr:`steps` say, for a person."""
        return ', '.join(
            f'{_show(step)} from {_show(start)}' if index else _show(step)
            for index, (start, step) in enumerate(self.steps)
        )

    def step(self, protocol: str = 'modbus') -> Fraction:
        """Return the least difference between two values that the drive takes."""
        numbers = self._numbers
        if numbers:
            return Fraction(math.gcd(*(int(number - numbers[0]) for number in numbers)))
        return min((step for _, step in self.steps), default=self.factor(protocol))

    @property
    def _numbers(self) -> Sequence[Fraction]:
        """The labels in order where they are whole numbers, else nothing."""
        if self.labels and self.kind is int:
            return sorted(Fraction(label) for label in self.labels.values())
        return ()

    def span(self, protocol: str = 'modbus') -> tuple[Fraction, Fraction]:
        """
        Return the least and the greatest value over ``protocol``, in :attr:`unit`.

        Where the manual allows more than the type can carry, or says nothing, the type decides.
        """
        numbers = self._numbers
        if numbers:
            return numbers[0], numbers[-1]
        factor = self.factor(protocol)
        carried = self.at(protocol).number
        low, high = carried.minimum * factor, carried.maximum * factor
        low = low if self.minimum is None else max(low, self.minimum)
        return low, high if self.maximum is None else min(high, self.maximum)

    @property
    def never_negative(self) -> bool:
        """It is unsigned on some bus; Classic has signed types for nearly everything [C23]."""
        codecs = [address.codec for address in self.addresses.values()]
        return any(isinstance(codec, Number) and not codec.signed for codec in codecs)

    def quantise(self, value: float, protocol: str = 'modbus') -> bytes:
        """Turn a finite set-point in range into the bytes of the nearest step of the drive."""
        number = self._number(value)
        factor = self.factor(protocol)
        self._check_range(number, protocol)
        return self.at(protocol).number.encode(self._nearest(number, factor))

    def _nearest(self, number: Fraction, factor: Fraction) -> int:
        """Return the raw count of the step that is nearest to a number."""
        if not self.steps:
            # each count is one: set-points come often
            return round(number / factor)
        return int(_rounded(number, *self._steps_at(number, factor)) / factor)

    def _steps_at(self, number: Fraction, count: Fraction) -> tuple[Fraction, Fraction]:
        """
        Return where the steps that a number lies between begin, and how great they are.

        :param count: the value of one raw count, which is the step where the table has none.
        """
        found = self.steps[0] if self.steps else (Fraction(0), count)
        for steps in self.steps:
            if steps[0] <= number:
                found = steps
        return found

    def _meaning(self, code: Fraction) -> Value:
        """Return what a code of an enumeration means, or a ValueError if it means nothing."""
        label = self.labels.get(int(code)) if code.denominator == 1 else None
        if self.kind is str and code.denominator == 1:
            return str(code) if label is None else label
        if label is None:
            raise ValueError(
                f'{self.key}: the drive has code {_show(code)}, which is none of '
                f'{", ".join(self.labels.values())}'
            )
        return int(label) if self.kind is int else _SWITCH[label.upper()]

    def _code(self, value: Value) -> int:
        for code, label in self.labels.items():
            if label == value:
                return code
            if self.kind is bool and isinstance(value, bool) and _SWITCH[label.upper()] == value:
                return code
            if self.kind is int and type(value) in (int, float) and float(label) == value:
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

    def _check_range(self, number: Fraction, protocol: str) -> None:
        low, high = self.span(protocol)
        # the bounds are decimal fractions and the values binary ones
        slack = self.factor(protocol) / 1000
        if not low - slack <= number <= high + slack:
            if self.maximum is None and number < low:
                allowed = f'at least {_show(low)}'
            else:
                allowed = f'{_show(low)} to {_show(high)}'
            raise ValueError(
                f'{self.key}: {_show(number)} is out of range, {allowed} {self.unit}'.rstrip()
            )


_WHOLE = re.compile(r'-?\d+')


def _rounded(number: Fraction, start: Fraction, step: Fraction) -> Fraction:
    return start + round((number - start) / step) * step


def _show(number: Fraction) -> str:
    return f'{float(number):.10g}'


def _means(value: float, step: Fraction, factor: Fraction) -> bool:
    """
    Return whether a number is meant to be a step of the drive.

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
