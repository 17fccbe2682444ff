# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which settings of a MOVITRAC 31.. go with which: what the return codes of [M4 §2.1.2] say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from nfo_sinus_driver.simulator.memory import Memory
from nfo_sinus_driver.simulator.movitrac_frames import ReturnCode


class _Rule(NamedTuple):
    """A setting is not switched so while another stands so."""

    key: str
    on: bool
    other: str
    other_on: bool
    code: ReturnCode


def _never_both(one: str, other: str, code: ReturnCode) -> Iterator[_Rule]:
    yield _Rule(one, True, other, True, code)
    yield _Rule(other, True, one, True, code)


def _needs(key: str, needed: str, missing: ReturnCode, in_use: ReturnCode) -> Iterator[_Rule]:
    yield _Rule(key, True, needed, False, missing)
    yield _Rule(needed, False, key, True, in_use)


_RULES = (
    *_needs(
        'control.hoist_1',
        'special.four_quadrant_1',
        ReturnCode.NEEDS_4Q_1,
        ReturnCode.HOIST_1_ACTIVE,
    ),
    *_needs(
        'control.hoist_2',
        'special.four_quadrant_2',
        ReturnCode.NEEDS_4Q_2,
        ReturnCode.HOIST_2_ACTIVE,
    ),
    *_never_both('motor.size_up_1', 'control.rapid_start_1', ReturnCode.SIZE_UP_OR_RAPID_START_1),
    *_never_both('motor.size_up_2', 'control.rapid_start_2', ReturnCode.SIZE_UP_OR_RAPID_START_2),
    *_never_both(
        'special.four_quadrant_1', 'control.dc_braking_1', ReturnCode.FOUR_Q_OR_DC_BRAKING_1
    ),
    *_never_both(
        'special.four_quadrant_2', 'control.dc_braking_2', ReturnCode.FOUR_Q_OR_DC_BRAKING_2
    ),
)


def broken(memory: Memory, key: str, raw: int) -> ReturnCode | None:
    """Return why a setting cannot have a raw number as the others stand, ``None`` if it can."""
    for rule in _RULES:
        stands = bool(memory.raw(rule.other)) == rule.other_on
        if rule.key == key and rule.on == bool(raw) and stands:
            return rule.code
    return None
