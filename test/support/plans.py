# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Carries out the plans of a link without a bus."""

from __future__ import annotations

from typing import Any, TypeVar

from nfo_sinus_driver.link import LinkError, Plan

_T = TypeVar('_T')


def followed(plan: Plan[_T], link: Any = None, unit: int = 1) -> _T:
    """Return what a plan finds; what fails brings nothing, and is not repeated."""
    reply = None
    while True:
        try:
            operation = plan.send(reply)
        except StopIteration as end:
            found: _T = end.value
            return found
        try:
            reply = operation.carry_out(link, unit)
        except LinkError:
            reply = None
