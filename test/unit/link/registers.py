# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""A Modbus link to a PLC that a test plays, request by request."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from nfo_sinus_driver.link.modbus.link import ModbusLink
from nfo_sinus_driver.link.plc.mailbox import Registers


def registers_by(ask: Callable[[Any], tuple[bytes, float]]) -> Registers:
    """Return what reads and writes registers by requests that ``ask`` answers."""

    class Link(ModbusLink):
        def _ask(self, request: Any) -> tuple[Any, float]:
            return ask(request)

    return Link().transfer
