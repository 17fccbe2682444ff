# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""What was changed in a drive, and how a value is written for users."""

from __future__ import annotations

from dataclasses import dataclass

from nfo_sinus_driver.catalog import Value


@dataclass(frozen=True)
class ParameterChange:
    """A parameter that was written; bytes that mean nothing are shown as text."""

    key: str
    old: Value
    new: Value
    unit: str

    def __str__(self) -> str:
        return f'{self.key}: {show(self.old)} -> {show(self.new)} {self.unit}'.rstrip()


@dataclass(frozen=True)
class Written:
    """A parameter that was written and read back, as bytes."""

    key: str
    before: bytes
    after: bytes


def show(value: Value) -> str:
    """Return a value as it is written in a parameter file."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    return f'{value:.10g}' if isinstance(value, float) else str(value)


def shown_raw(data: bytes) -> str:
    """Return bytes that mean nothing, as the manuals print numbers."""
    return f'{data.hex().upper()}h'
