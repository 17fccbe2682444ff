# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""How a line is set: as a person says, and else as the drive leaves the factory."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def with_factory_line(given: Mapping[str, Any], factory: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return settings of a line, with those of the factory where none is given: 0, ``''`` or nothing.

    Speed and format of the factory are those of its protocol, and say nothing of another one.

    :param given: ``protocol``, ``baud_rate``, ``char_format`` and ``address``, as far as given.
    :param factory: the same of a family, see :attr:`~nfo_sinus_driver.catalog.Profile.line`.
    """
    said = {name: value for name, value in given.items() if value}
    if said.get('protocol', factory.get('protocol')) != factory.get('protocol'):
        factory = {name: value for name, value in factory.items() if name == 'address'}
    return {**factory, **said}
