# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

"""
Why a drive answered by NACK: its 34 return codes, and what a person does about each [M4 §2.1.2].

Two of them inform only, for the drive has done what it was told [C81].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from nfo_sinus_driver.link.interface import Refused


class ReturnCode(NamedTuple):
    """
    What a return code says.

    :ivar kind: the code of :class:`Refused` that means the same.
    :ivar remedy: what a person does about it.
    """

    kind: int
    meaning: str
    remedy: str


_NO_SUCH = Refused.ILLEGAL_ADDRESS
_VALUE = Refused.ILLEGAL_VALUE
_STATE = Refused.DEVICE_FAILURE

_OPTION = ReturnCode(
    _NO_SUCH,
    'the necessary option pcb is not installed',
    'fit the option that the parameter belongs to, or leave it as it is',
)
_OTHER_INTERFACE = ReturnCode(
    _STATE,
    'not permitted via this serial interface',
    'use the keypad, or the other interface (X4 or X20)',
)
_INHIBIT = (
    'stop the motor, then inhibit the controller: call the service ~/quick_stop, or open a '
    'terminal that has the function /Controller inhibit'
)

#: What the drive has done all the same.
DONE: Mapping[int, str] = {
    0x1E: 'factory setting was started',
    0x28: 'parameter stored to volatile memory, lost on power-down (P801 is Off)',
}
REFUSALS: Mapping[int, ReturnCode] = {
    0x10: ReturnCode(_NO_SUCH, 'illegal index', 'look whether the model is set right'),
    0x11: ReturnCode(
        _NO_SUCH, 'function or parameter not implemented', 'this size or firmware does not have it'
    ),
    0x12: ReturnCode(_NO_SUCH, 'read access only', 'nobody can write it'),
    0x13: ReturnCode(_STATE, 'parameter lock (P800) active', 'set P800 to No'),
    0x14: ReturnCode(
        Refused.BUSY, 'factory setting (P830) running', 'wait until it is done, some seconds'
    ),
    0x15: ReturnCode(_VALUE, 'parameter value too large', 'choose a smaller one'),
    0x16: ReturnCode(_VALUE, 'parameter value too small', 'choose a larger one'),
    0x17: _OPTION,
    0x18: ReturnCode(
        _STATE, 'fault in system software', 'switch the drive off and on; if it stays, ask SEW'
    ),
    0x19: _OTHER_INTERFACE,
    0x1A: ReturnCode(_STATE, 'speed control (P770) active', 'set P770 to V/f mode first'),
    0x1B: ReturnCode(_STATE, 'unauthorized access', 'it is for the maker alone'),
    0x1C: ReturnCode(_STATE, 'output stage is not inhibited', _INHIBIT),
    0x1D: ReturnCode(
        _VALUE, 'invalid parameter value', 'choose one of its steps; not all between are allowed'
    ),
    0x22: ReturnCode(
        _STATE,
        '4Q operation 1 (P890) required, for example for hoist function 1 (P710)',
        'set P890 to Yes first',
    ),
    0x23: ReturnCode(
        _STATE,
        '4Q operation 2 (P891) required, for example for hoist function 2 (P712)',
        'set P891 to Yes first',
    ),
    0x24: ReturnCode(_STATE, 'DC braking 1 (P730) active', 'set P730 to No first'),
    0x25: ReturnCode(_STATE, 'DC braking 2 (P733) active', 'set P733 to No first'),
    0x26: ReturnCode(_STATE, 'hoist function set 1 (P710) active', 'set P710 to No first'),
    0x27: ReturnCode(_STATE, 'hoist function set 2 (P712) active', 'set P712 to No first'),
    0x29: _OTHER_INTERFACE,
    0x2A: ReturnCode(_STATE, 'speed control (P770) inactive', 'set P770 to Speed control first'),
    0x2B: ReturnCode(_STATE, 'controller inhibit required', _INHIBIT),
    0x2C: ReturnCode(
        _STATE,
        'motor size-up 1 (P328) and rapid start 1 (P720) exclude each other',
        'set the other one to No first',
    ),
    0x2D: ReturnCode(
        _STATE,
        'motor size-up 2 (P348) and rapid start 2 (P723) exclude each other',
        'set the other one to No first',
    ),
    0x2E: _OPTION,
    0x2F: ReturnCode(
        _STATE,
        '4Q operation 1 (P890) and DC braking 1 (P730) exclude each other',
        'set the other one to No first',
    ),
    0x30: ReturnCode(
        _STATE,
        '4Q operation 2 (P891) and DC braking 2 (P733) exclude each other',
        'set the other one to No first',
    ),
    0x31: ReturnCode(
        _STATE,
        'controller inhibit active',
        'take the inhibit away first (terminal or function bits); that may start the motor',
    ),
    0x32: ReturnCode(
        _STATE, 'synchronous operation control (P760) inactive', 'set P760 to Yes first'
    ),
    0x33: ReturnCode(
        _STATE,
        'this drive is slave of the synchronous operation control (P761)',
        'change it in the master, or P761 first',
    ),
    0x34: ReturnCode(
        Refused.ILLEGAL_FUNCTION,
        'illegal message type',
        'the parameter may be of the other length, 4 or 8 bytes: look whether the model is right',
    ),
}


def refusal(code: int) -> Refused:
    """Return what a NACK with a return code says."""
    hexadecimal = f'(return code {code:02X})'
    known = REFUSALS.get(code)
    if known is None:
        why = DONE.get(code, 'the drive refused; no manual lists why')
        return Refused(_STATE, f'{why} {hexadecimal}')
    return Refused(known.kind, f'{known.meaning}: {known.remedy} {hexadecimal}')
