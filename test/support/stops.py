# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""Which request takes the run command away, by the manuals and by nothing of the driver."""

from __future__ import annotations

from nfo_sinus_driver.catalog import is_described
from nfo_sinus_driver.simulator.movitrac31.commands import FUNCTION_BITS, SETPOINT
from nfo_sinus_driver.simulator.movitrac31.parameters import Bit
from support.rig import Rig
from support.variants import stop_registers

#: What commands a drive of NFO [M0 §7], [M1]; of the mask and its word, the latter comes last.
_MODE, _STOP = 'fieldbus.mode', 1
_SCMD = ('fieldbus.scmd', 'fieldbus.smode')
_CONTROL = ('fieldbus.drive_control', 'fieldbus.drv_ctrl_write_mask', 'fieldbus.control_word')
#: Bit 0 of a control word [M0 table 14], (CiA 402).
_SWITCH_ON = 1 << 0
_TELEGRAM = ('telegram.begin', 'telegram.clear')


def takes_run_away(rig: Rig, key: str, data: bytes | None) -> bool:
    """Return whether a request is a write after which no run command stands in the drive."""
    if data is None:
        return False
    number = rig.number(data)
    model = rig.connection.model
    if key.startswith('telegram.'):
        return key in _TELEGRAM
    if is_described(model):
        return (key, number) in stop_registers(model)
    if model == 'movitrac31':
        by_terminals = rig.connection.method == 'remote_setpoint'
        return (key == FUNCTION_BITS and not number & (Bit.CW | Bit.CCW)) or (
            by_terminals and key == SETPOINT and not number
        )
    return (
        (key in _SCMD and not number)
        or (key == _MODE and number == _STOP)
        or (key in _CONTROL and not number & _SWITCH_ON)
    )
