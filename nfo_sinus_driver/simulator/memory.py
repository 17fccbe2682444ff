# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
The parameter memory of a simulated drive: raw numbers by catalog key, and how it says no.

A raw number is the one that the first protocol carries that the tables name for a parameter.
"""

from __future__ import annotations

from collections.abc import Mapping
import enum
from fractions import Fraction
import functools
import math

from nfo_sinus_driver.catalog import Family, Parameter, Role, Value


def home(parameter: Parameter) -> str:
    """Return the protocol whose raw number the memory keeps."""
    return next(iter(parameter.addresses))


def carried(parameter: Parameter, raw: int, protocol: str) -> int:
    """Return the number that ``protocol`` carries for one of the memory, the nearest it can."""
    source = home(parameter)
    if protocol == source:
        return raw
    exact = raw * parameter.factor(source) / parameter.factor(protocol)
    codec = parameter.at(protocol).number
    return min(max(math.floor(exact + Fraction(1, 2)), codec.minimum), codec.maximum)


def kept(parameter: Parameter, raw: int, protocol: str) -> int:
    """
    Return the number of the memory for one that ``protocol`` carries, which may be coarser [C14].

    :raises Refused: VALUE.
    """
    target = home(parameter)
    if protocol == target:
        return raw
    exact = raw * parameter.factor(protocol) / parameter.factor(target)
    number = math.floor(exact + Fraction(1, 2))
    if not parameter.at(target).number.fits(number):
        raise Refused(Reason.VALUE, f'{parameter.key} cannot be so large')
    return number


class Memory:
    """
    The parameters of one drive, as raw numbers.

    :param model: the drive family, with all that a drive of it keeps.
    :param factory: what it leaves the factory with, in engineering units, by key; everything else
        starts at 0, or at the value allowed that is nearest to it.
    :param settings: values other than the factory's, in engineering units, by key.
    :raises ValueError: an unknown key, or a value that the drive would refuse.

    :ivar given: the keys of the settings, which the bus and the keypad alone change.
    """

    def __init__(
        self, model: Family, factory: Mapping[str, Value], settings: Mapping[str, Value]
    ) -> None:
        self.model = model
        self._factors = {
            key: float(parameter.factor(home(parameter))) for key, parameter in model.items()
        }
        self._raw = {key: self._least(parameter) for key, parameter in model.items()}
        for key, value in factory.items():
            self._raw[key] = _factory_raw(model, key, value)
        self._factory = dict(self._raw)
        for key, value in settings.items():
            self.set(key, value)
        self.given = frozenset(settings)
        #: Of each parameter that was shown the raw number, and what it is in engineering units.
        self._shown: dict[str, tuple[int, Value]] = {}

    def raw(self, key: str) -> int:
        """Return the raw number of a parameter."""
        return self._raw[key]

    def put(self, key: str, raw: int) -> None:
        """Store a raw number, unchecked."""
        self._raw[key] = raw

    def factory_raw(self, key: str) -> int:
        """Return the raw number that a parameter leaves the factory with."""
        return self._factory[key]

    def get(self, key: str) -> Value:
        """Return a parameter in engineering units."""
        return self.shown(key, self._raw[key])

    @property
    def version(self) -> Fraction | None:
        """The version of the firmware; ``None`` of a drive that does not report it."""
        key = self.model.key(Role.FIRMWARE)
        return self._raw[key] * self.model[key].factor(home(self.model[key])) if key else None

    def number(self, key: str, default: float = 0.0) -> float:
        """Return a numeric parameter; ``default`` when this model's table lacks it."""
        raw = self._raw.get(key)
        return default if raw is None else raw * self._factors[key]

    def set(self, key: str, value: Value) -> None:
        """Store a value in engineering units, as someone at the keypad would, or a ValueError."""
        if key not in self.model:
            raise ValueError(f'{self.model.name} has no parameter {key!r}')
        self._raw[key] = _raw_of(self.model[key], value)

    def shown(self, key: str, raw: int) -> Value:
        """Turn a raw number of a parameter into engineering units."""
        # a client that watches a drive asks for all of them again and again, and few change
        last = self._shown.get(key)
        if last is None or last[0] != raw:
            parameter = self.model[key]
            protocol = home(parameter)
            data = parameter.at(protocol).number.encode(raw)
            last = self._shown[key] = raw, parameter.decode(data, protocol)
        return last[1]

    @staticmethod
    def check(parameter: Parameter, raw: int) -> None:
        """Refuse a raw number that the manual does not allow (Refused: VALUE)."""
        value = raw * parameter.factor(home(parameter))
        if parameter.labels:
            if value not in parameter.labels:
                raise Refused(Reason.VALUE, f'{parameter.key} has no code {float(value):g}')
            return
        low = parameter.minimum is not None and value < parameter.minimum
        high = parameter.maximum is not None and value > parameter.maximum
        if low or high:
            raise Refused(Reason.VALUE, f'{parameter.key} = {float(value):g} is out of range')

    @staticmethod
    def _least(parameter: Parameter) -> int:
        """The raw number to start with: 0, or what is allowed and nearest to it."""
        if parameter.labels:
            code = 0 if 0 in parameter.labels else min(parameter.labels)
            return int(code / parameter.factor(home(parameter)))
        low = parameter.minimum
        if low is None or low <= 0:
            return 0
        return -int(-Fraction(low) / parameter.factor(home(parameter)) // 1)


# every drive of a family begins with the same; True is not 1
@functools.lru_cache(maxsize=None, typed=True)
def _factory_raw(model: Family, key: str, value: Value) -> int:
    return _raw_of(model[key], value)


def _raw_of(parameter: Parameter, value: Value) -> int:
    """Return the raw number of a value in engineering units (ValueError: it is not possible)."""
    data = parameter.encode(value, home(parameter))
    return parameter.at(home(parameter)).number.decode(data)


class Reason(enum.IntEnum):
    """
    Why a request is refused; the numbers are Modbus's exception codes.

    The manuals do not say which code the drive uses when [C87]; these are the standard's meanings.
    """

    #: The drive does not have this function.
    FUNCTION = 1
    #: No such parameter, not its length, not its beginning, or not this way (read, write).
    ADDRESS = 2
    #: The value is out of range, or no code of the enumeration.
    VALUE = 3
    #: Right as such, but not in the state that the drive is in.
    STATE = 4


class GatewayReason(enum.IntEnum):
    """What a gateway says in place of a drive; the standard's exception codes."""

    #: It knows no way to the drive.
    NO_PATH = 10
    #: The drive does not answer it.
    NO_ANSWER = 11


class Refused(Exception):
    """The drive refuses a request; ``reason`` goes over the line, the text is for people."""

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(text)
        self.reason = reason
