# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A setting is declared once, as a field: nodes, command line and docs take it from there."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

_T = TypeVar('_T')

#: When a setting may be changed.
ANY_TIME = 'any time'
UNCONFIGURED = 'unconfigured'
DISABLED = 'while the drive is not enabled'
START_ONLY = 'at the start only'
#: Read-only for ROS, too.
FIXED = 'never'


@dataclass(frozen=True)
class Setting:
    """
    What is known of one setting.

    :ivar text: what it means.
    :ivar low: the least it may be, in its unit; ``None``: it has no range.
    :ivar high: the most.
    :ivar choices: what a text may be.
    :ivar zero: what 0, or an empty text, stands for.
    :ivar also: what else has to hold for a value, for the reader.
    :ivar change: when it may be changed.
    """

    default: Any
    text: str
    low: float | None = None
    high: float = 0.0
    unit: str = ''
    choices: tuple[str, ...] = ()
    zero: str = ''
    also: str = ''
    change: str = ANY_TIME
    name: str = ''

    @property
    def description(self) -> str:
        """What it means, and what 0 or an empty text does."""
        nothing = '0'
        if isinstance(self.default, (str, list)):
            nothing = "''" if isinstance(self.default, str) else 'empty'
        return f'{self.text}; {nothing}: {self.zero}' if self.zero else self.text

    @property
    def allowed(self) -> str:
        """What it may be, beside its range."""
        if not self.choices:
            return self.also
        said = f'one of {", ".join(self.choices)}'
        return ', '.join(filter(None, ("'' or " * bool(self.zero) + said, self.also)))

    def check(self, value: Any) -> None:
        """
        Make sure that a value is in the range, or among the choices.

        :raises ValueError: it is not; the message says what is.
        """
        if self.low is not None and not self.low <= value <= self.high:
            span = f'{self.low:g} to {self.high:g} {self.unit}'.rstrip()
            zero = f' (0: {self.zero})' if self.zero else ''
            raise ValueError(f'{self.name} {value:g}: allowed are {span}{zero}')
        choices = ('', *self.choices) if self.zero else self.choices
        if self.choices and value not in choices:
            shown = ', '.join(repr(choice) for choice in choices)
            raise ValueError(f'{self.name} {value!r}: choose one of {shown}')


def setting(default: _T, text: str, low: float | None = None, high: float = 0.0, **more: Any) -> _T:
    """Return a field of a dataclass that is a :class:`Setting`."""
    shown = list(default) if isinstance(default, tuple) else default
    made = Setting(shown, text, low, high, **more)
    return field(default=default, metadata={'setting': made})


def settings_of(class_: type) -> dict[str, Setting]:
    """Return the settings that are fields of a dataclass, by name."""
    return {
        declared.name: replace(declared.metadata['setting'], name=declared.name)
        for declared in fields(class_)
        if 'setting' in declared.metadata
    }
